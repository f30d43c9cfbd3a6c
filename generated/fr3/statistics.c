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
    DEPTH = 16, /* tiles that are eliminated together: R is read and written once for all of them */
    HEIGHT = (N * DEPTH) | 1, /* vectors from column to column, off the powers of two */
    TOGETHER = 3 /* columns that are changed together: with four reflections, all that 16 registers hold */
};

#define INLINE static inline __attribute__((always_inline))

/* A number that is used several times is loaded once: compilers take it from memory for each use,
 * and the ports to memory are as busy as those that multiply. */
#if W > 1 && defined(__x86_64__)
#define HOLD(x) __asm__("" : "+v"(x))
#elif W > 1 && defined(__aarch64__)
#define HOLD(x) __asm__("" : "+w"(x))
#else
#define HOLD(x) ((void)0)
#endif

/* Sums of squares up to here count as zero: below, their power 3/2, by which a reflection divides,
 * leaves the range of numbers. */
#define TINY 1e-200

/* Neighbouring columns: rows that take part, columns to the right that change. */
typedef struct {
    short first, width, rows, row_count, columns, column_count;
} panel;

static const panel panels[] = {
    {0, 1, 0, 1, 0, 41},
    {1, 2, 1, 1, 41, 41},
    {3, 5, 2, 2, 82, 36},
    {8, 7, 4, 3, 118, 29},
    {15, 7, 7, 4, 147, 22},
    {22, 7, 11, 5, 169, 15},
    {29, 7, 16, 6, 184, 8},
    {36, 7, 22, 7, 192, 1},
};
enum { PANELS = sizeof panels / sizeof panels[0], TEAMS = 2 };

static const short panel_rows[] = {0, 1, 0, 1, 0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5, 6};
static const short panel_columns[] = {3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 36, 37, 38, 39, 40, 41, 42, 43, 43};

/* Per joint, from the first to behind the last column of Y_b that is not zero by structure; then
 * entries outside that fill in: joint, column. */
static const short runs[N][2] = {{0, 43}, {1, 43}, {8, 43}, {15, 43}, {22, 43}, {29, 43}, {36, 43}};

/* Columns of Y_b in the row of a joint, and tau. */
static const short joint_columns[] = {0, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 36, 37, 38, 39, 40, 41, 42, 43};
static const short joint_at[] = {0, 42, 85, 121, 150, 172, 187, 195};

static const short counting[] = {0, 1, 2, 3, 4, 5, 6, 7};

/* A team of up to four reflections I - u u' / h of neighbouring columns: u is `top` in the row of R
 * and the pivot column in the rows that take part, inverse is 1 / h, cross[i][j] = u_i'u_j, i < j. */
typedef struct {
    const vd *u[4];
    vd *r[4]; /* row of R, by column */
    vd top[4], inverse[4], cross[4][4];
    vd dot[4]; /* u_i'a of the column a that comes next */
    const short *joints; /* whose rows take part */
    int joint_count, width;
} team;

/* `first` goes through the rows that take part, by fours. */
#define EACH_FOUR_ROWS(f) \
    for (int k = 0; k < (f)->joint_count; ++k) \
        for (int first = (f)->joints[k] * DEPTH, end = first + DEPTH; first < end; first += 4)

/* Householder's w = A'u / h, A -= u w' for `width` reflections and `count` columns at once: each
 * reflection starts from what those before it leave behind, w_j = (A'u_j - sum u_i'u_j w_i) / h_j. */
INLINE void apply_group(const team *f, vd *b, long shift, const short *columns, const int width, const int count)
{
    const int parts = width * count <= 2 ? 4 : width * count <= 8 ? 2 : 1; /* sums enough for the pipes */
    vd w[4][TOGETHER], more[3][4][TOGETHER];
    vd *a[TOGETHER];
    UNROLL for (int i = 0; i < count; ++i) {
        a[i] = b + columns[i] * HEIGHT;
        UNROLL for (int j = 0; j < width; ++j) {
            w[j][i] = f->top[j] * f->r[j][shift + columns[i]];
            UNROLL for (int part = 1; part < parts; ++part) {
                more[part - 1][j][i] = vd_all(0.0);
            }
        }
    }
    EACH_FOUR_ROWS(f) {
        UNROLL for (int p = 0; p < 4; ++p) {
            const long at = first + p;
            vd x[TOGETHER];
            UNROLL for (int i = 0; i < count; ++i) {
                x[i] = a[i][at];
                HOLD(x[i]);
            }
            UNROLL for (int j = 0; j < width; ++j) {
                vd u = f->u[j][at];
                HOLD(u);
                UNROLL for (int i = 0; i < count; ++i) {
                    if (p % parts == 0) {
                        w[j][i] += u * x[i];
                    } else {
                        more[p % parts - 1][j][i] += u * x[i];
                    }
                }
            }
        }
    }
    UNROLL for (int j = 0; j < width; ++j) {
        UNROLL for (int i = 0; i < count; ++i) {
            UNROLL for (int part = 1; part < parts; ++part) {
                w[j][i] += more[part - 1][j][i];
            }
            UNROLL for (int before = 0; before < j; ++before) {
                w[j][i] -= f->cross[before][j] * w[before][i];
            }
            w[j][i] *= f->inverse[j];
            f->r[j][shift + columns[i]] -= f->top[j] * w[j][i];
        }
    }
    EACH_FOUR_ROWS(f) {
        UNROLL for (int p = 0; p < 4; ++p) {
            const long at = first + p;
            vd x[TOGETHER];
            UNROLL for (int i = 0; i < count; ++i) {
                x[i] = a[i][at];
            }
            UNROLL for (int j = 0; j < width; ++j) {
                vd u = f->u[j][at];
                HOLD(u);
                UNROLL for (int i = 0; i < count; ++i) {
                    x[i] -= u * w[j][i];
                }
            }
            UNROLL for (int i = 0; i < count; ++i) {
                a[i][at] = x[i];
            }
        }
    }
}

INLINE void apply_count(const team *f, vd *b, long shift, const short *columns, const int count)
{
    if (f->width == 4) {
        apply_group(f, b, shift, columns, 4, count);
    } else if (f->width == 3) {
        apply_group(f, b, shift, columns, 3, count);
    } else if (f->width == 2) {
        apply_group(f, b, shift, columns, 2, count);
    } else {
        apply_group(f, b, shift, columns, 1, count);
    }
}

/* One team after the other, so that the columns stay in the first cache. */
static APART void apply(const team *f, int teams, vd *b, long shift, const short *columns, int count)
{
    for (; count >= TOGETHER; count -= TOGETHER, columns += TOGETHER) {
        for (int i = 0; i < teams; ++i) {
            apply_count(f + i, b, shift, columns, TOGETHER);
        }
    }
    for (; count >= 2; count -= 2, columns += 2) {
        for (int i = 0; i < teams; ++i) {
            apply_count(f + i, b, shift, columns, 2);
        }
    }
    for (; count >= 1; --count, ++columns) {
        for (int i = 0; i < teams; ++i) {
            apply_count(f + i, b, shift, columns, 1);
        }
    }
}

/* Column c as number `which` of a team: the reflections before it are applied to it, its own is
 * formed and multiplied with the next column, all in one pass; in vain if that is not in the team.
 * R has r >= 0, so that r - |[r; u]| is formed without cancellation and the new diagonal is positive.
 * NaN is not <= TINY and passes on. */
INLINE void reflect(team *f, vd *own, long c, const int which)
{
    const int parts = which == 0 ? 4 : 2; /* sums enough for the pipes */
    vd w[4], square[4], cross[4][4], dot[4][4];
    UNROLL for (int j = 0; j < which; ++j) {
        w[j] = f->dot[j] + f->top[j] * f->r[j][c];
        UNROLL for (int before = 0; before < j; ++before) {
            w[j] -= f->cross[before][j] * w[before];
        }
        w[j] *= f->inverse[j];
        f->r[j][c] -= f->top[j] * w[j];
    }
    UNROLL for (int part = 0; part < parts; ++part) {
        square[part] = vd_all(0.0);
        UNROLL for (int j = 0; j <= which; ++j) {
            cross[j][part] = dot[j][part] = vd_all(0.0);
        }
    }
    EACH_FOUR_ROWS(f) {
        UNROLL for (int p = 0; p < 4; ++p) {
            const long at = first + p;
            vd u[4], x = own[at];
            UNROLL for (int j = 0; j < which; ++j) {
                u[j] = f->u[j][at];
                HOLD(u[j]);
                x -= u[j] * w[j];
            }
            own[at] = x;
            square[p % parts] += x * x;
            UNROLL for (int j = 0; j < which; ++j) {
                cross[j][p % parts] += u[j] * x;
            }
            if (which < 3) {
                vd next = own[HEIGHT + at];
                HOLD(next);
                UNROLL for (int j = 0; j < which; ++j) {
                    dot[j][p % parts] += u[j] * next;
                }
                dot[which][p % parts] += x * next;
            }
        }
    }
    UNROLL for (int part = 1; part < parts; ++part) {
        square[0] += square[part];
        UNROLL for (int j = 0; j <= which; ++j) {
            cross[j][0] += cross[j][part];
            dot[j][0] += dot[j][part];
        }
    }
    UNROLL for (int j = 0; j < which; ++j) {
        f->cross[j][which] = cross[j][0];
    }
    UNROLL for (int j = 0; j <= which; ++j) {
        f->dot[j] = dot[j][0];
    }
    const vd s = square[0], r = f->r[which][c], length = vd_sqrt(r * r + s), both = r + length;
    const vi none = s <= TINY;
    f->r[which][c] = length;
    f->top[which] = vd_choose(none, vd_all(0.0), -s / both);
    f->inverse[which] = vd_choose(none, vd_all(0.0), both / (length * s));
    f->u[which] = own;
    f->width = which + 1;
}

/* A panel at work. */
typedef struct {
    team teams[TEAMS > 1 ? TEAMS : 2];
    const short *joints;
    int joint_count;
} shape;

/* The next reflection of a panel whose `width` columns begin at b and c of `size`. */
static APART void advance(shape *s, int step, vd *b, vd *r, long size, long c, int width)
{
    const long here = c + step;
    team *f = s->teams + step / 4;
    const int which = step % 4;
    f->r[which] = r + here * (2 * size - here - 1) / 2;
    f->joints = s->joints;
    f->joint_count = s->joint_count;
    if (which == 0) {
        reflect(f, b + step * HEIGHT, here, 0);
    } else if (which == 1) {
        reflect(f, b + step * HEIGHT, here, 1);
    } else if (which == 2) {
        reflect(f, b + step * HEIGHT, here, 2);
    } else {
        reflect(f, b + step * HEIGHT, here, 3);
        apply(f, 1, b + (step + 1) * HEIGHT, here + 1, counting, width - step - 1);
    }
}

/* DEPTH samples per lane, b[column][joint][tile] with rows [F Y_b tau], into the triangle r. While a
 * panel is applied to the columns on its right, the reflections of the next one, each of which waits
 * for a root and a quotient, are on their way. */
static APART void eliminate(vd *b, vd *r, long k)
{
    const long shift = N * k, size = shift + BASE + 1;
    shape shapes[2];
    for (int joint = 0; joint < N; ++joint) {
        shapes->joints = counting + joint;
        shapes->joint_count = 1;
        for (long m = 0; m < k; m += 4) {
            const int width = k - m < 4 ? (int)(k - m) : 4;
            const long c = joint * k + m;
            for (int i = 0; i < width; ++i) {
                advance(shapes, i, b + m * HEIGHT, r, size, c, width);
            }
            for (long own = m + width; own < k; ++own) {
                apply(shapes->teams, 1, b + own * HEIGHT, joint * k + own, counting, 1);
            }
            apply(shapes->teams, 1, b + k * HEIGHT, shift, joint_columns + joint_at[joint], joint_at[joint + 1] - joint_at[joint]);
        }
    }
    b += k * HEIGHT;
    shapes->joints = panel_rows + panels[0].rows;
    shapes->joint_count = panels[0].row_count;
    for (int i = 0; i < panels[0].width; ++i) {
        advance(shapes, i, b + panels[0].first * HEIGHT, r, size, shift + panels[0].first, panels[0].width);
    }
    for (int p = 0; p < PANELS; ++p) {
        const team *now = shapes[p & 1].teams;
        const int teams = (panels[p].width + 3) / 4;
        const short *columns = panel_columns + panels[p].columns;
        int count = panels[p].column_count;
        if (p + 1 < PANELS) {
            const panel *next = panels + p + 1;
            shape *then = shapes + (1 - (p & 1));
            int lead = 0;
            while (lead < count && columns[lead] < next->first + next->width) {
                ++lead;
            }
            lead = (lead + TOGETHER - 1) / TOGETHER * TOGETHER;
            lead = lead < count ? lead : count;
            apply(now, teams, b, shift, columns, lead);
            columns += lead;
            count -= lead;
            then->joints = panel_rows + next->rows;
            then->joint_count = next->row_count;
            for (int i = 0; i < next->width; ++i) {
                advance(then, i, b + next->first * HEIGHT, r, size, shift + next->first, next->width);
                const int part = count / (next->width - i) / TOGETHER * TOGETHER;
                apply(now, teams, b, shift, columns, part);
                columns += part;
                count -= part;
            }
        }
        apply(now, teams, b, shift, columns, count);
    }
    vd *last = r + size * (size + 1) / 2 - 1, sum = *last * *last;
    for (int i = 0; i < N * DEPTH; ++i) {
        const vd tau = b[BASE * HEIGHT + i];
        sum += tau * tau;
    }
    *last = vd_sqrt(sum);
}

/* Chunks of `vectors` columns from j on: what `apply_group` does, with the rows one by one. */
INLINE void join_chunk(double *row, double *rows, long c, long j, long count, long step, double length, double s, const int vectors)
{
    vd w[4] = {{0}};
    for (long i = 0; i < count; ++i) {
        const vd u = vd_all(rows[i * step + c]);
        UNROLL for (int v = 0; v < vectors; ++v) {
            w[v] += u * *(const vu *)(rows + i * step + j + v * W);
        }
    }
    UNROLL for (int v = 0; v < vectors; ++v) {
        /* r = 0: u = [-length; rows], h = s */
        *(vu *)(row + j + v * W) = w[v] / length;
        w[v] /= s;
    }
    for (long i = 0; i < count; ++i) {
        const vd u = vd_all(rows[i * step + c]);
        UNROLL for (int v = 0; v < vectors; ++v) {
            *(vu *)(rows + i * step + j + v * W) -= u * w[v];
        }
    }
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
            const long vectors = (size - j + W - 1) / W;
            if (vectors >= 4) {
                join_chunk(row, rows, c, j, count, step, length, s, 4);
            } else if (vectors == 3) {
                join_chunk(row, rows, c, j, count, step, length, s, 3);
            } else if (vectors == 2) {
                join_chunk(row, rows, c, j, count, step, length, s, 2);
            } else {
                join_chunk(row, rows, c, j, count, step, length, s, 1);
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
    const long triangles = size * (size + 1) / 2 * LANES, block = (HEIGHT * (k + BASE + 1) + N * BASE) * LANES;
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
    const long packed = size * (size + 1) / 2, part = HEIGHT * (k + BASE + 1);
    double *r = aligned(work), *b = r + packed * LANES, *y = b + part * LANES;
    double root[N];
    for (long i = 0; i < N * BASE * LANES; ++i) {
        y[i] = 0.0; /* what is zero by structure is never written */
    }
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
                vd *to = (vd *)(b + h * part * W) + t;
                if (t >= tiles) {
                    for (long c = 0; c < k + BASE + 1; ++c) {
                        for (int joint = 0; joint < N; ++joint) {
                            to[c * HEIGHT + joint * DEPTH] = vd_all(0.0);
                        }
                    }
                    continue;
                }
#define ROW(tile, index) (*(const vd *)((tile) + (index) * LANES + h * W))
                for (int joint = 0; joint < N; ++joint) {
                    vd *here = to + joint * DEPTH;
                    const vd s = ROW(scale, joint);
                    for (long m = 0; m < k; ++m) {
                        vd x = s;
                        for (int l = 0; l < W; ++l) {
                            const long sample = i + h * W + l < n ? i + h * W + l : n - 1;
                            x[l] *= columns[(sample * N + joint) * k + m];
                        }
                        here[m * HEIGHT] = x;
                    }
                    here += k * HEIGHT;
                    /* contiguous runs: the rest of Y_b is zero by structure */
                    for (int c = runs[joint][0]; c < runs[joint][1]; ++c) {
                        here[c * HEIGHT] = s * ROW(y, joint * BASE + c);
                    }
                    here[BASE * HEIGHT] = s * ROW(tau_tile, joint);
                }
#undef ROW
            }
        }
        for (int h = 0; h < VECTORS; ++h) {
            eliminate((vd *)(b + h * part * W), (vd *)(r + h * W * packed), k);
        }
    }
    double *joined = b, *rows = b + size * step;
    for (long i = 0; i < size * LANES * step; ++i) {
        rows[i] = 0.0;
    }
    for (long h = 0; h < VECTORS; ++h) {
        const double *from = r + h * W * packed;
        for (long c = 0; c < size; ++c) {
            double *to = rows + (c * LANES + h * W) * step;
            for (long j = c; j < size; ++j, from += W) {
                for (long l = 0; l < W; ++l) {
                    to[l * step + j] = from[l];
                }
            }
        }
    }
    join(joined, rows, size, LANES, step);
    for (long i = 0; i < size * size; ++i) {
        triangle[i] = joined[i / size * step + i % size];
    }
}
