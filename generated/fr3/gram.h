/* Sums of products of columns, and their way into a triangle. Written by symgen; the same for every
 * robot. The file that includes it says how columns lie: DEPTH rows of each joint, HEIGHT vectors
 * from one column to the next, and HOLD for a number that is used several times. */
#ifndef SYMGEN_GRAM_H
#define SYMGEN_GRAM_H

#include "lanes.h"

enum {
    TALL = REGISTERS < 32 ? 2 : 4, /* columns times columns of which sums stay in registers */
    BROAD = 6,
    NEAR = 40960 / (8 * W * (TALL + BROAD)) /* rows of so many columns that stay in the first cache */
};

/* `tall` columns of a block times `broad` later ones, or with `square` times themselves, over rows
 * that follow one another. Sums lie by row; those of a square below its diagonal stay zero. */
typedef struct {
    long a, b, sums; /* where columns and sums begin, in vectors */
    short tall, broad, square, rows;
    short row, column; /* place of the first sum in the triangle */
    short fresh; /* whether these sums have not been met before */
} product;

INLINE void multiply(const product *p, const vd *block, vd *g, const int tall, const int broad, const int square)
{
    const int parts = tall * broad <= 2 ? 4 : tall * broad <= 4 ? 2 : 1; /* sums enough for the pipes */
    const int together = parts > 2 ? 4 : 2;
    const vd *a = block + p->a, *b = block + p->b, *end = a + p->rows;
    vd sum[4][TALL][BROAD];
    g += p->sums;
    UNROLL for (int i = 0; i < tall; ++i) {
        UNROLL for (int j = square ? i : 0; j < broad; ++j) {
            sum[0][i][j] = g[i * broad + j];
            UNROLL for (int part = 1; part < parts; ++part) {
                sum[part][i][j] = vd_all(0.0);
            }
        }
    }
    for (; a < end; a += together, b += together) {
        UNROLL for (int t = 0; t < together; ++t) {
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
    UNROLL for (int i = 0; i < tall; ++i) {
        UNROLL for (int j = square ? i : 0; j < broad; ++j) {
            UNROLL for (int part = 1; part < parts; ++part) {
                sum[0][i][j] += sum[part][i][j];
            }
            g[i * broad + j] = sum[0][i][j];
        }
    }
}

/* Each kind in a function of its own, which a compiler arranges better than all in one. */
#define EACH_BROAD(f, tall) f(tall, 1) f(tall, 2) f(tall, 3) f(tall, 4) f(tall, 5) f(tall, 6)
#if REGISTERS < 32
#define EACH_KIND(f) EACH_BROAD(f, 1) EACH_BROAD(f, 2)
#define EACH_TALL(f) f(1) f(2)
#else
#define EACH_KIND(f) EACH_BROAD(f, 1) EACH_BROAD(f, 2) EACH_BROAD(f, 3) EACH_BROAD(f, 4)
#define EACH_TALL(f) f(1) f(2) f(3) f(4)
#endif
#define WITH_LATER(tall, broad)                                                                     \
    static APART void multiply_##tall##_##broad(const product *p, const vd *block, vd *g)           \
    {                                                                                               \
        multiply(p, block, g, tall, broad, 0);                                                      \
    }
#define WITH_SELF(tall)                                                                             \
    static APART void square_##tall(const product *p, const vd *block, vd *g)                       \
    {                                                                                               \
        multiply(p, block, g, tall, tall, 1);                                                       \
    }
EACH_KIND(WITH_LATER)
EACH_TALL(WITH_SELF)

/* All products of a block, added to their sums. */
static void add_products(const product *p, long count, const vd *block, vd *g)
{
    for (const product *end = p + count; p < end; ++p) {
        switch (p->square ? p->tall : 8 * p->tall + p->broad) {
#define CASE_LATER(tall, broad)                                                                     \
        case 8 * tall + broad:                                                                      \
            multiply_##tall##_##broad(p, block, g);                                                 \
            break;
#define CASE_SELF(tall)                                                                             \
        case tall:                                                                                  \
            square_##tall(p, block, g);                                                             \
            break;
        EACH_KIND(CASE_LATER)
        EACH_TALL(CASE_SELF)
        }
    }
}

#undef EACH_BROAD
#undef EACH_KIND
#undef EACH_TALL
#undef WITH_LATER
#undef WITH_SELF
#undef CASE_LATER
#undef CASE_SELF

#endif
