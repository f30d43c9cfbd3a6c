/* Sums of products of columns, and their way into a triangle. Written by symgen; the same for every
 * robot. The file that includes it says how columns lie: DEPTH rows of each joint, HEIGHT vectors
 * from one column to the next, and HOLD for a number that is used several times. */
#ifndef SYMGEN_GRAM_H
#define SYMGEN_GRAM_H

#include "lanes.h"

enum {
    TALL = REGISTERS < 32 ? 2 : 4, /* columns times columns of which sums stay in registers */
    BROAD = 6
};

/* Columns from a on times columns from b on, over the rows of these joints. Sums go to g, by column of a. */
typedef struct {
    const vd *a, *b;
    vd *g[TALL];
    const short *joints;
    int joint_count;
} product;

/* G += A'B; with `square`, B is A, and of the symmetric block the upper half is added. */
INLINE void multiply(const product *p, const int tall, const int broad, const int square)
{
    const int parts = tall * broad <= 2 ? 4 : tall * broad <= 4 ? 2 : 1; /* sums enough for the pipes */
    vd sum[4][TALL][BROAD];
    UNROLL for (int part = 0; part < parts; ++part) {
        UNROLL for (int i = 0; i < tall; ++i) {
            UNROLL for (int j = 0; j < broad; ++j) {
                sum[part][i][j] = vd_all(0.0);
            }
        }
    }
    for (int k = 0; k < p->joint_count; ++k) {
        const vd *a = p->a + p->joints[k] * DEPTH, *b = p->b + p->joints[k] * DEPTH;
        for (int row = 0; row < DEPTH; row += 4, a += 4, b += 4) {
            UNROLL for (int t = 0; t < 4; ++t) {
                vd x[TALL];
                UNROLL for (int i = 0; i < tall; ++i) {
                    x[i] = a[i * HEIGHT + t];
                    HOLD(x[i]);
                }
                UNROLL for (int j = 0; j < broad; ++j) {
                    vd y = square ? x[j] : b[j * HEIGHT + t];
                    HOLD(y);
                    UNROLL for (int i = 0; i < tall; ++i) {
                        if (!square || i <= j) {
                            sum[t % parts][i][j] += x[i] * y;
                        }
                    }
                }
            }
        }
    }
    UNROLL for (int i = 0; i < tall; ++i) {
        UNROLL for (int j = 0; j < broad; ++j) {
            UNROLL for (int part = 1; part < parts; ++part) {
                sum[0][i][j] += sum[part][i][j];
            }
            if (!square || i <= j) {
                p->g[i][j] += sum[0][i][j];
            }
        }
    }
}

INLINE void multiply_tall(const product *p, const int tall, const int broad)
{
    if (broad == 6) {
        multiply(p, tall, 6, 0);
    } else if (broad == 3) {
        multiply(p, tall, 3, 0);
    } else if (broad == 2) {
        multiply(p, tall, 2, 0);
    } else {
        multiply(p, tall, 1, 0);
    }
}

/* `tall` columns times `count` later ones. */
static APART void multiply_range(product *p, int tall, long count)
{
    for (long now; count > 0; count -= now) {
        now = count >= 6 ? 6 : count >= 3 ? 3 : count;
        if (tall == 1) {
            multiply_tall(p, 1, (int)now);
        } else if (tall == 2) {
            multiply_tall(p, 2, (int)now);
#if REGISTERS >= 32
        } else if (tall == 3) {
            multiply_tall(p, 3, (int)now);
        } else {
            multiply_tall(p, 4, (int)now);
#endif
        }
        p->b += now * HEIGHT;
        for (int i = 0; i < tall; ++i) {
            p->g[i] += now;
        }
    }
}

/* `tall` columns times themselves. */
static APART void multiply_square(const product *p, int tall)
{
    if (tall == 1) {
        multiply(p, 1, 1, 1);
    } else if (tall == 2) {
        multiply(p, 2, 2, 1);
#if REGISTERS >= 32
    } else if (tall == 3) {
        multiply(p, 3, 3, 1);
    } else {
        multiply(p, 4, 4, 1);
#endif
    }
}

#endif
