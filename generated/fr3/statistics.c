/* fr3: N samples -> the triangular factor of their weighted rows, written by symgen 0.1.0.
 *
 * The rows [F Y_b tau] of a sample, one per joint and scaled by the root of its weight, are
 * eliminated into a triangle R by Householder reflections, so that R'R is the sum of their outer
 * products, and are then forgotten. The k friction columns of a joint come first, since they touch
 * no other joint, then the base parameters from the root of the robot on: a row is zero before the
 * columns of its own joint. Each of the 8 lanes has a triangle and samples of its own, so that
 * nothing is shuffled; the triangles are joined at the end. The diagonal is never negative. */
#include <stdint.h>

#include "tiles.h"

enum {
    N = 7,
    BASE = 43,
    DEPTH = 4, /* tiles that are eliminated together: R is read and written once for all of them */
    COLUMN = N * DEPTH + 1 /* vectors from one column to the next, off the powers of two */
};

#define INLINE static inline __attribute__((always_inline))

/* Squares below are rounded coarsely, and so would be the reflection; sums of squares up to here
 * count as zero. */
#define TINY 1e-280

/* One or two neighbouring columns: rows that take part, columns to the right that change. */
typedef struct {
    short first, width, rows, row_count, columns, column_count;
} panel;

static const panel panels[] = {
    {0, 1, 0, 1, 0, 41},
    {1, 2, 1, 1, 41, 41},
    {3, 2, 2, 2, 82, 39},
    {5, 2, 4, 2, 121, 37},
    {7, 1, 6, 2, 158, 36},
    {8, 2, 8, 3, 194, 34},
    {10, 2, 11, 3, 228, 32},
    {12, 2, 14, 3, 260, 30},
    {14, 1, 17, 3, 290, 29},
    {15, 2, 20, 4, 319, 27},
    {17, 2, 24, 4, 346, 25},
    {19, 2, 28, 4, 371, 23},
    {21, 1, 32, 4, 394, 22},
    {22, 2, 36, 5, 416, 20},
    {24, 2, 41, 5, 436, 18},
    {26, 2, 46, 5, 454, 16},
    {28, 1, 51, 5, 470, 15},
    {29, 2, 56, 6, 485, 13},
    {31, 2, 62, 6, 498, 11},
    {33, 2, 68, 6, 509, 9},
    {35, 1, 74, 6, 518, 8},
    {36, 2, 80, 7, 526, 6},
    {38, 2, 87, 7, 532, 4},
    {40, 2, 94, 7, 536, 2},
    {42, 1, 101, 7, 538, 1},
};
enum { PANELS = sizeof panels / sizeof panels[0] };

static const short panel_rows[] = {0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5, 6, 0, 1, 2, 3, 4, 5, 6, 0, 1, 2, 3, 4, 5, 6, 0, 1, 2, 3, 4, 5, 6};
static const short panel_columns[] = {3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 35, 36, 37, 38, 39, 40, 41, 42, 43, 36, 37, 38, 39, 40, 41, 42, 43, 38, 39, 40, 41, 42, 43, 40, 41, 42, 43, 42, 43, 43};

/* Entries of Y_b that are not zero by structure: joint, column; then those that fill in. */
static const short filled[][2] = {{0, 0}, {0, 3}, {0, 4}, {0, 5}, {0, 6}, {0, 7}, {0, 8}, {0, 9}, {0, 10}, {0, 11}, {0, 12}, {0, 13}, {0, 14}, {0, 15}, {0, 16}, {0, 17}, {0, 18}, {0, 19}, {0, 20}, {0, 21}, {0, 22}, {0, 23}, {0, 24}, {0, 25}, {0, 26}, {0, 27}, {0, 28}, {0, 29}, {0, 30}, {0, 31}, {0, 32}, {0, 33}, {0, 34}, {0, 35}, {0, 36}, {0, 37}, {0, 38}, {0, 39}, {0, 40}, {0, 41}, {0, 42}, {1, 1}, {1, 2}, {1, 3}, {1, 4}, {1, 5}, {1, 6}, {1, 7}, {1, 8}, {1, 9}, {1, 10}, {1, 11}, {1, 12}, {1, 13}, {1, 14}, {1, 15}, {1, 16}, {1, 17}, {1, 18}, {1, 19}, {1, 20}, {1, 21}, {1, 22}, {1, 23}, {1, 24}, {1, 25}, {1, 26}, {1, 27}, {1, 28}, {1, 29}, {1, 30}, {1, 31}, {1, 32}, {1, 33}, {1, 34}, {1, 35}, {1, 36}, {1, 37}, {1, 38}, {1, 39}, {1, 40}, {1, 41}, {1, 42}, {2, 8}, {2, 9}, {2, 10}, {2, 11}, {2, 12}, {2, 13}, {2, 14}, {2, 15}, {2, 16}, {2, 17}, {2, 18}, {2, 19}, {2, 20}, {2, 21}, {2, 22}, {2, 23}, {2, 24}, {2, 25}, {2, 26}, {2, 27}, {2, 28}, {2, 29}, {2, 30}, {2, 31}, {2, 32}, {2, 33}, {2, 34}, {2, 35}, {2, 36}, {2, 37}, {2, 38}, {2, 39}, {2, 40}, {2, 41}, {2, 42}, {3, 15}, {3, 16}, {3, 17}, {3, 18}, {3, 19}, {3, 20}, {3, 21}, {3, 22}, {3, 23}, {3, 24}, {3, 25}, {3, 26}, {3, 27}, {3, 28}, {3, 29}, {3, 30}, {3, 31}, {3, 32}, {3, 33}, {3, 34}, {3, 35}, {3, 36}, {3, 37}, {3, 38}, {3, 39}, {3, 40}, {3, 41}, {3, 42}, {4, 22}, {4, 23}, {4, 24}, {4, 25}, {4, 26}, {4, 27}, {4, 28}, {4, 29}, {4, 30}, {4, 31}, {4, 32}, {4, 33}, {4, 34}, {4, 35}, {4, 36}, {4, 37}, {4, 38}, {4, 39}, {4, 40}, {4, 41}, {4, 42}, {5, 29}, {5, 30}, {5, 31}, {5, 32}, {5, 33}, {5, 34}, {5, 35}, {5, 36}, {5, 37}, {5, 38}, {5, 39}, {5, 40}, {5, 41}, {5, 42}, {6, 36}, {6, 37}, {6, 38}, {6, 39}, {6, 40}, {6, 41}, {6, 42}};

/* Columns of Y_b in the row of a joint, and tau. */
static const short joint_columns[] = {0, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 36, 37, 38, 39, 40, 41, 42, 43};
static const short joint_at[] = {0, 42, 85, 121, 150, 172, 187, 195};

static const short counting[] = {0, 1, 2, 3, 4, 5, 6};

/* One or two reflections I - u u' / h, u = [top; rows of the pivot column], inverse = 1 / h. */
typedef struct {
    const vd *u[2];
    vd *r[2]; /* row of R, by column */
    vd top[2], inverse[2], cross;
    const short *rows;
    int row_count, width;
} reflection;

/* The reflection of one column; R has r >= 0, so that r - |[r; u]| is formed without cancellation
 * and the new diagonal is positive. NaN is not <= TINY and passes on. */
INLINE void reflect(reflection *f, const int which, long c)
{
    vd sum[DEPTH] = {{0}};
    const vd *u = f->u[which];
    for (int i = 0; i < f->row_count; ++i) {
        const vd *here = u + f->rows[i] * DEPTH;
        UNROLL for (int t = 0; t < DEPTH; ++t) {
            sum[t] += here[t] * here[t];
        }
    }
    const vd s = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    const vd r = f->r[which][c], length = vd_sqrt(r * r + s), both = r + length;
    const vi none = s <= TINY;
    f->r[which][c] = length;
    f->top[which] = vd_choose(none, vd_all(0.0), -s / both);
    f->inverse[which] = vd_choose(none, vd_all(0.0), both / (length * s));
}

/* Reflections on `count` columns at once: Householder's w = A'u / h, A -= u w', for both u in one
 * pass, where w of the second starts from what the first leaves behind. */
INLINE void apply_group(const reflection *f, vd *b, long shift, const short *columns, const int width, const int count)
{
    const int parts = 4 / count; /* enough sums to keep the pipes full */
    vd dot[2][4][4] = {{{{0}}}};
    vd *a[4];
    UNROLL for (int i = 0; i < count; ++i) {
        a[i] = b + (shift + columns[i]) * COLUMN;
    }
    for (int k = 0; k < f->row_count; ++k) {
        const long at = f->rows[k] * DEPTH;
        UNROLL for (int t = 0; t < DEPTH; ++t) {
            const vd u0 = f->u[0][at + t], u1 = f->u[width - 1][at + t];
            UNROLL for (int i = 0; i < count; ++i) {
                const vd x = a[i][at + t];
                dot[0][t % parts][i] += u0 * x;
                if (width == 2) {
                    dot[1][t % parts][i] += u1 * x;
                }
            }
        }
    }
    vd w[2][4];
    UNROLL for (int i = 0; i < count; ++i) {
        vd *r = f->r[0] + shift + columns[i];
        vd sum = dot[0][0][i] + f->top[0] * *r;
        UNROLL for (int part = 1; part < parts; ++part) {
            sum += dot[0][part][i];
        }
        w[0][i] = f->inverse[0] * sum;
        *r -= f->top[0] * w[0][i];
    }
    if (width == 2) {
        UNROLL for (int i = 0; i < count; ++i) {
            vd *r = f->r[1] + shift + columns[i];
            vd sum = dot[1][0][i] + f->top[1] * *r;
            UNROLL for (int part = 1; part < parts; ++part) {
                sum += dot[1][part][i];
            }
            w[1][i] = f->inverse[1] * (sum - f->cross * w[0][i]);
            *r -= f->top[1] * w[1][i];
        }
    }
    for (int k = 0; k < f->row_count; ++k) {
        const long at = f->rows[k] * DEPTH;
        UNROLL for (int t = 0; t < DEPTH; ++t) {
            const vd u0 = f->u[0][at + t], u1 = f->u[width - 1][at + t];
            UNROLL for (int i = 0; i < count; ++i) {
                vd x = a[i][at + t] - u0 * w[0][i];
                if (width == 2) {
                    x -= u1 * w[1][i];
                }
                a[i][at + t] = x;
            }
        }
    }
}

INLINE void apply_width(const reflection *f, vd *b, long shift, const short *columns, int count, const int width)
{
    for (; count >= 4; count -= 4, columns += 4) {
        apply_group(f, b, shift, columns, width, 4);
    }
    if (count == 3) {
        apply_group(f, b, shift, columns, width, 3);
    } else if (count == 2) {
        apply_group(f, b, shift, columns, width, 2);
    } else if (count == 1) {
        apply_group(f, b, shift, columns, width, 1);
    }
}

static __attribute__((noinline)) void apply(const reflection *f, vd *b, long shift, const short *columns, int count)
{
    if (f->width == 2) {
        apply_width(f, b, shift, columns, count, 2);
    } else {
        apply_width(f, b, shift, columns, count, 1);
    }
}

/* The first reflection of a panel that begins at column c of `size`. */
INLINE void begin(reflection *f, const vd *b, vd *r, long size, long c, int width, const short *rows, int row_count)
{
    f->rows = rows;
    f->row_count = row_count;
    f->width = 1;
    for (long k = 0; k < width; ++k) {
        f->u[k] = b + (c + k) * COLUMN;
        f->r[k] = r + (c + k) * (2 * size - (c + k) - 1) / 2;
    }
    reflect(f, 0, c);
}

/* The second one, if the panel has two columns. */
INLINE void complete(reflection *f, vd *b, long c, int width)
{
    if (width < 2) {
        return;
    }
    apply_group(f, b, c + 1, counting, 1, 1);
    vd cross[DEPTH] = {{0}};
    for (int i = 0; i < f->row_count; ++i) {
        const long at = f->rows[i] * DEPTH;
        UNROLL for (int t = 0; t < DEPTH; ++t) {
            cross[t] += f->u[0][at + t] * f->u[1][at + t];
        }
    }
    f->cross = (cross[0] + cross[1]) + (cross[2] + cross[3]);
    reflect(f, 1, c + 1);
    f->width = 2;
}

/* DEPTH samples per lane, b[column][joint][DEPTH], into the triangle r. While the rest of a panel's
 * columns are computed, the reflections of the next panel, which wait for a root and a quotient,
 * are on their way. */
static __attribute__((noinline)) void eliminate(vd *b, vd *r, long k)
{
    const long shift = N * k, size = shift + BASE + 1;
    reflection f[2];
    for (int joint = 0; joint < N; ++joint) {
        for (long m = 0; m < k; m += 2) {
            const int width = k - m < 2 ? 1 : 2;
            const long c = joint * k + m;
            begin(f, b, r, size, c, width, counting + joint, 1);
            complete(f, b, c, width);
            for (long own = m + width; own < k; ++own) {
                apply(f, b, joint * k + own, counting, 1);
            }
            apply(f, b, shift, joint_columns + joint_at[joint], joint_at[joint + 1] - joint_at[joint]);
        }
    }
    begin(f, b, r, size, shift + panels[0].first, panels[0].width, panel_rows + panels[0].rows, panels[0].row_count);
    complete(f, b, shift + panels[0].first, panels[0].width);
    for (int p = 0; p < PANELS; ++p) {
        const reflection *now = f + (p & 1);
        const short *columns = panel_columns + panels[p].columns;
        int count = panels[p].column_count;
        if (p + 1 < PANELS) {
            reflection *then = f + (1 - (p & 1));
            const panel *next = panels + p + 1;
            int lead = 0;
            while (lead < count && columns[lead] < next->first + next->width) {
                ++lead;
            }
            apply(now, b, shift, columns, lead);
            begin(then, b, r, size, shift + next->first, next->width, panel_rows + next->rows, next->row_count);
            columns += lead;
            count -= lead;
            const int half = count / 8 * 4;
            apply(now, b, shift, columns, half);
            complete(then, b, shift + next->first, next->width);
            columns += half;
            count -= half;
        }
        apply(now, b, shift, columns, count);
    }
    vd *last = r + size * (size + 1) / 2 - 1, sum = *last * *last;
    const vd *tau = b + (shift + BASE) * COLUMN;
    for (int i = 0; i < N * DEPTH; ++i) {
        sum += tau[i] * tau[i];
    }
    *last = vd_sqrt(sum);
}

/* `each` triangles of `size` columns become one. Rows are `step` >= size + W apart and zero beyond
 * their `size` numbers; row c of triangle i is row c each + i of `rows`, which is used up. */
static void join(double *r, double *rows, long size, long each, long step)
{
    for (long i = 0; i < size * step; ++i) {
        r[i] = 0.0;
    }
    for (long c = 0; c < size; ++c) {
        const long count = (c + 1) * each;
        double sum[4] = {0.0};
        for (long i = 0; i < count; ++i) {
            const double x = rows[i * step + c];
            sum[i & 3] += x * x;
        }
        const double s = (sum[0] + sum[1]) + (sum[2] + sum[3]);
        if (s <= TINY) {
            continue;
        }
        const double length = sqrt(s); /* the row of R is still empty */
        double *row = r + c * step;
        row[c] = length;
        for (long j = c + 1; j < size; j += 4 * W) {
            const int vectors = (int)((size - j + W - 1) / W < 4 ? (size - j + W - 1) / W : 4);
            vd w[4] = {{0}};
            for (long i = 0; i < count; ++i) {
                const double u = rows[i * step + c];
                for (int v = 0; v < vectors; ++v) {
                    w[v] += u * *(const vu *)(rows + i * step + j + v * W);
                }
            }
            for (int v = 0; v < vectors; ++v) {
                /* u = [-length; rows], h = s: with r = 0 both are what they are in `reflect` */
                *(vu *)(row + j + v * W) = w[v] / length;
                w[v] /= s;
            }
            for (long i = 0; i < count; ++i) {
                const double u = rows[i * step + c];
                for (int v = 0; v < vectors; ++v) {
                    *(vu *)(rows + i * step + j + v * W) -= u * w[v];
                }
            }
        }
    }
}

static double *aligned(double *work)
{
    return (double *)(((uintptr_t)work + 63) / 64 * 64);
}

static long step_of(long size)
{
    return (size + W + 7) / 8 * 8;
}

/* Doubles of `work` that _statistics needs with k friction columns per joint, and _statistics_join
 * for `count` triangles of `size` columns. */
long OWN(statistics_work)(long k);
long OWN(statistics_work)(long k)
{
    const long size = N * k + BASE + 1, step = step_of(size);
    const long triangles = size * (size + 1) / 2 * LANES, block = size * COLUMN * LANES + N * BASE * LANES;
    const long join_rows = size * (LANES + 1) * step;
    return 8 + triangles + (block > join_rows ? block : join_rows);
}

long OWN(statistics_join_work)(long size, long count);
long OWN(statistics_join_work)(long size, long count)
{
    return size * (count + 1) * step_of(size);
}

/* `count` triangles, one after the other, each size x size and row-major: the triangle of all their
 * rows together. What is below their diagonals is not read. */
void OWN(statistics_join)(long size, long count, const double *triangles, double *work, double *triangle);
void OWN(statistics_join)(long size, long count, const double *triangles, double *work, double *triangle)
{
    const long step = step_of(size);
    double *rows = work + size * step;
    for (long i = 0; i < size; ++i) {
        for (long f = 0; f < count; ++f) {
            const double *from = triangles + (f * size + i) * size;
            double *to = rows + (i * count + f) * step;
            for (long j = 0; j < step; ++j) {
                to[j] = j < i || j >= size ? 0.0 : from[j];
            }
        }
    }
    join(work, rows, size, count, step);
    for (long i = 0; i < size * size; ++i) {
        triangle[i] = work[i / size * step + i % size];
    }
}

/* The triangle of n samples, size x size and row-major with size = N k + BASE + 1 columns
 * [F Y_b tau]. Samples follow one another; columns holds N x k numbers per sample and is not read
 * when k = 0; weight one number per joint; sample_weight one per sample, or NULL for ones. */
void OWN(statistics)(long n, const double *q, const double *dq, const double *ddq, const double *tau, long k, const double *columns, const double *weight, const double *sample_weight, double *work, double *triangle);
void OWN(statistics)(long n, const double *q, const double *dq, const double *ddq, const double *tau, long k, const double *columns, const double *weight, const double *sample_weight, double *work, double *triangle)
{
    const long shift = N * k, size = shift + BASE + 1, step = step_of(size);
    const long packed = size * (size + 1) / 2;
    double *r = aligned(work), *b = r + packed * LANES, *y = b + size * COLUMN * LANES;
    double root[N];
    for (int i = 0; i < N; ++i) {
        root[i] = sqrt(weight[i]);
    }
    for (long i = 0; i < packed * LANES; ++i) {
        r[i] = 0.0;
    }
    for (long block = 0; block < n; block += DEPTH * LANES) {
        TILE(q_tiles, DEPTH * N);
        TILE(sc, DEPTH * 2 * N);
        const long end = block + DEPTH * LANES < n ? block + DEPTH * LANES : n;
        const long tiles = (end - block + LANES - 1) / LANES;
        for (long t = 0; t < tiles; ++t) {
            const long i = block + t * LANES;
            load(q_tiles + t * N * LANES, q + i * N, N, N, n - i, (n - i) * N);
        }
        OWN(base_regressor_sines)(tiles, q_tiles, sc);
        for (long t = 0; t < DEPTH; ++t) {
            const long i = block + t * LANES;
            TILE(dq_tile, N);
            TILE(ddq_tile, N);
            TILE(tau_tile, N);
            TILE(scale, N);
            if (t < tiles) {
                load(dq_tile, dq + i * N, N, N, n - i, (n - i) * N);
                load(ddq_tile, ddq + i * N, N, N, n - i, (n - i) * N);
                load(tau_tile, tau + i * N, N, N, n - i, (n - i) * N);
                OWN(base_regressor_tile)(sc + t * 2 * N * LANES, q_tiles + t * N * LANES, dq_tile, ddq_tile, y);
            }
            for (int l = 0; l < LANES; ++l) {
                const double here = i + l >= n ? 0.0 : sample_weight ? sqrt(sample_weight[i + l]) : 1.0;
                for (int joint = 0; joint < N; ++joint) {
                    scale[joint * LANES + l] = here * root[joint];
                }
            }
            for (int h = 0; h < VECTORS; ++h) {
                vd *to = (vd *)(b + h * W * size * COLUMN) + t;
                if (t >= tiles) {
                    for (long c = 0; c < size; ++c) {
                        for (int joint = 0; joint < N; ++joint) {
                            to[c * COLUMN + joint * DEPTH] = vd_all(0.0);
                        }
                    }
                    continue;
                }
#define ROW(tile, index) (*(const vd *)((tile) + (index) * LANES + h * W))
                for (unsigned e = 0; e < sizeof filled / sizeof filled[0]; ++e) {
                    const int joint = filled[e][0], c = filled[e][1];
                    to[(shift + c) * COLUMN + joint * DEPTH] = ROW(scale, joint) * ROW(y, joint * BASE + c);
                }
                for (int joint = 0; joint < N; ++joint) {
                    to[(shift + BASE) * COLUMN + joint * DEPTH] = ROW(scale, joint) * ROW(tau_tile, joint);
                    for (long m = 0; m < k; ++m) {
                        vd x = ROW(scale, joint);
                        for (int l = 0; l < W; ++l) {
                            const long sample = i + h * W + l < n ? i + h * W + l : n - 1;
                            x[l] *= columns[(sample * N + joint) * k + m];
                        }
                        to[(joint * k + m) * COLUMN + joint * DEPTH] = x;
                    }
                }
#undef ROW
            }
        }
        for (int h = 0; h < VECTORS; ++h) {
            eliminate((vd *)(b + h * W * size * COLUMN), (vd *)(r + h * W * packed), k);
        }
    }
    double *joined = b, *rows = b + size * step;
    for (long c = 0, at = 0; c < size; at += size - c, ++c) {
        for (long l = 0; l < LANES; ++l) {
            double *to = rows + (c * LANES + l) * step;
            for (long j = 0; j < step; ++j) {
                to[j] = j < c || j >= size ? 0.0 : r[l / W * W * packed + (at + j - c) * W + l % W];
            }
        }
    }
    join(joined, rows, size, LANES, step);
    for (long i = 0; i < size * size; ++i) {
        triangle[i] = joined[i / size * step + i % size];
    }
}
