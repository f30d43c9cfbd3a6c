/* fr3: N samples -> the triangular factor of their weighted rows, written by symgen 0.1.0.
 *
 * The rows [F Y_b tau] of a sample, one per joint and scaled by the root of its weight, are
 * eliminated into a triangle R by Householder reflections, so that R'R is the sum of their outer
 * products, and are then forgotten. The k friction columns of a joint come first, since they touch
 * no other joint, then the base parameters from the root of the robot on: a row is zero before the
 * columns of its own joint. Each of the 8 lanes has a triangle and samples of its own, so that
 * nothing is shuffled; the triangles are joined at the end. The diagonal is never negative.
 *
 * Products of rows take half of the multiply-adds of an elimination, but squares round to the square
 * of the condition number. So the samples of a long log are turned by an orthogonal matrix into means
 * of 16 to 256 neighbours, which are eliminated, and differences from them, which are multiplied and
 * folded into the triangle: differences of a log are small. Bounds of rounding of a trial and of the
 * result decide; where they say no, all rows are eliminated. */
#include <stdint.h>

#include "tiles.h"

#if defined(__AVX512F__) || defined(__aarch64__)
#define REGISTERS 32
#else
#define REGISTERS 16
#endif

enum {
    N = 7,
    BASE = 43,
    DEPTH = 16, /* tiles that are eliminated together: R is read and written once for all of them */
    HEIGHT = (N * DEPTH) | 1, /* vectors from column to column, off the powers of two */
    AHEAD = 4, /* tiles whose samples are on their way from memory */
    TRIAL = 4, /* blocks of samples that show whether products are accurate enough */
    WINDOW = 16, /* most blocks whose mean is eliminated where what changes slowly stays small */
    LEAST = 4096, /* samples below which all rows are eliminated */
    CACHED = 64 * 8, /* rows times lanes up to which a panel and the columns it changes stay in the first cache */
    TOGETHER = REGISTERS < 32 ? 3 : 4 /* columns that are changed together by four reflections */
};

/* A number that is used several times is loaded once: compilers take it from memory for each use,
 * and the ports to memory are as busy as those that multiply. */
#if W > 1 && defined(__x86_64__)
#define HOLD(x) __asm__("" : "+v"(x))
#elif W > 1 && defined(__aarch64__)
#define HOLD(x) __asm__("" : "+w"(x))
#else
#define HOLD(x) ((void)0)
#endif

#include "fold.h"
#include "gram.h"

/* A window is chosen so that the rounding of its products may exceed that of the trial so many times. */
#define RESERVE 1.0
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

/* Columns of Y_b in the row of a joint, and tau. */
static const short joint_columns[] = {0, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 36, 37, 38, 39, 40, 41, 42, 43};
static const short joint_at[] = {0, 42, 85, 121, 150, 172, 187, 195};

/* Neighbouring columns of the same joints, and the columns from there on that share joints. */
typedef struct {
    short first, width, range, range_count;
} run;

typedef struct {
    short from, to, rows, row_count;
} sharing;

static const run runs[] = {
    {0, 1, 0, 2},
    {1, 2, 2, 1},
    {3, 5, 3, 1},
    {8, 7, 4, 1},
    {15, 7, 5, 1},
    {22, 7, 6, 1},
    {29, 7, 7, 1},
    {36, 8, 8, 1},
};
enum { RUNS = sizeof runs / sizeof runs[0] };

static const sharing ranges[] = {
    {0, 1, 0, 1},
    {3, 44, 1, 1},
    {1, 44, 2, 1},
    {3, 44, 3, 2},
    {8, 44, 5, 3},
    {15, 44, 8, 4},
    {22, 44, 12, 5},
    {29, 44, 17, 6},
    {36, 44, 23, 7},
};
static const short range_rows[] = {0, 0, 1, 0, 1, 0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5, 6};

static const short counting[] = {0, 1, 2, 3, 4, 5, 6, 7};

/* A team of up to four reflections I - u u' / h of neighbouring columns: u is `top` in the row of R
 * and the pivot column in the rows that take part, inverse is 1 / h, cross[i][j] = u_i'u_j, i < j. */
typedef struct {
    const vd *u[4];
    vd *r[4]; /* row of R, by column */
    vd top[4], inverse[4], cross[4][4];
    vd dot[4]; /* u_i'a of the column a that comes next */
    const short *joints; /* `depth` rows of each take part */
    int joint_count, depth, width;
} team;

/* `first` goes through the rows that take part, by fours. */
#define EACH_FOUR_ROWS(f) \
    for (int k = 0; k < (f)->joint_count; ++k) \
        for (int first = (f)->joints[k] * DEPTH, end = first + (f)->depth; first < end; first += 4)

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
    for (int now; count > 0; count -= now, columns += now) {
        now = count < TOGETHER ? count : TOGETHER;
        for (int i = 0; i < teams; ++i) {
            if (now == TOGETHER) {
                apply_count(f + i, b, shift, columns, TOGETHER);
            } else if (now == 3) {
                apply_count(f + i, b, shift, columns, 3);
            } else if (now == 2) {
                apply_count(f + i, b, shift, columns, 2);
            } else {
                apply_count(f + i, b, shift, columns, 1);
            }
        }
    }
}

/* Column c as number `which` of a team: the reflections before it are applied to it, its own is
 * formed and multiplied with the next column of the team, if there is one, all in one pass.
 * R has r >= 0, so that r - |[r; u]| is formed without cancellation and the new diagonal is positive.
 * NaN is not <= TINY and passes on. */
INLINE void reflect(team *f, vd *own, long c, const int which, const int more)
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
            if (more) {
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

/* A panel at work: teams of `most` columns and a last one of what remains. */
typedef struct {
    team teams[TEAMS > 1 ? TEAMS : 2];
    const short *joints;
    int joint_count, depth, width, most;
} shape;

static void begin(shape *s, const panel *p, int depth)
{
    const int teams = (p->width + 3) / 4;
    s->joints = panel_rows + p->rows;
    s->joint_count = p->row_count;
    s->depth = depth;
    s->width = p->width;
    s->most = (p->width + teams - 1) / teams;
}

/* The next reflection of a panel whose columns begin at b and c of `size`. */
static APART void advance(shape *s, int step, vd *b, vd *r, long size, long c)
{
    const long here = c + step;
    team *f = s->teams + step / s->most;
    const int which = step % s->most, more = which + 1 < s->most && step + 1 < s->width;
    vd *own = b + step * HEIGHT;
    f->r[which] = r + here * (2 * size - here - 1) / 2;
    f->joints = s->joints;
    f->joint_count = s->joint_count;
    f->depth = s->depth;
    if (which == 0) {
        reflect(f, own, here, 0, 1);
    } else if (which == 1 && more) {
        reflect(f, own, here, 1, 1);
    } else if (which == 1) {
        reflect(f, own, here, 1, 0);
    } else if (which == 2 && more) {
        reflect(f, own, here, 2, 1);
    } else if (which == 2) {
        reflect(f, own, here, 2, 0);
    } else {
        reflect(f, own, here, 3, 0);
    }
    if (!more) {
        apply(f, 1, b + (step + 1) * HEIGHT, here + 1, counting, s->width - step - 1);
    }
}

/* The first panel from `from` on that does not fit into the first cache with so many of its rows. */
static int fitting(int from, int depth)
{
    while (from < PANELS && (depth <= 4 || panels[from].row_count * depth * W <= CACHED)) {
        ++from;
    }
    return from;
}

/* The panels [from, to) with `depth` rows of each joint. While a panel is applied to the columns on
 * its right, the reflections of the next one, each of which waits for a root and a quotient, are on
 * their way. */
static void sweep(vd *b, vd *r, long shift, int from, int to, int depth)
{
    const long size = shift + BASE + 1;
    shape shapes[2];
    begin(shapes + (from & 1), panels + from, depth);
    for (int i = 0; i < panels[from].width; ++i) {
        advance(shapes + (from & 1), i, b + panels[from].first * HEIGHT, r, size, shift + panels[from].first);
    }
    for (int p = from; p < to; ++p) {
        const shape *now = shapes + (p & 1);
        const int teams = (now->width + 3) / 4;
        const short *columns = panel_columns + panels[p].columns;
        int count = panels[p].column_count;
        if (p + 1 < to) {
            const panel *next = panels + p + 1;
            shape *then = shapes + (1 - (p & 1));
            int lead = 0;
            while (lead < count && columns[lead] < next->first + next->width) {
                ++lead;
            }
            lead = (lead + TOGETHER - 1) / TOGETHER * TOGETHER;
            lead = lead < count ? lead : count;
            apply(now->teams, teams, b, shift, columns, lead);
            columns += lead;
            count -= lead;
            begin(then, next, depth);
            for (int i = 0; i < next->width; ++i) {
                advance(then, i, b + next->first * HEIGHT, r, size, shift + next->first);
                const int part = count / (next->width - i) / TOGETHER * TOGETHER;
                apply(now->teams, teams, b, shift, columns, part);
                columns += part;
                count -= part;
            }
        }
        apply(now->teams, teams, b, shift, columns, count);
    }
}

/* Rows of each joint that are eliminated for so many that are filled. */
static int whole_depth(long filled)
{
    return filled > 8 ? DEPTH : filled > 4 ? 8 : 4;
}

/* `depth` samples per lane, b[column][joint][tile] with rows [F Y_b tau], into the triangle r. Panels
 * of many rows take the block in pieces. */
static APART void eliminate(vd *b, vd *r, long k, int depth)
{
    const long shift = N * k, size = shift + BASE + 1;
    shape own = {.joint_count = 1, .depth = depth};
    for (int joint = 0; joint < N; ++joint) {
        for (long m = 0; m < k; m += 4) {
            const int width = k - m < 4 ? (int)(k - m) : 4;
            const long c = joint * k + m;
            own.joints = counting + joint;
            own.width = own.most = width;
            for (int i = 0; i < width; ++i) {
                advance(&own, i, b + m * HEIGHT, r, size, c);
            }
            for (long later = m + width; later < k; ++later) {
                apply(own.teams, 1, b + later * HEIGHT, joint * k + later, counting, 1);
            }
            apply(own.teams, 1, b + k * HEIGHT, shift, joint_columns + joint_at[joint], joint_at[joint + 1] - joint_at[joint]);
        }
    }
    b += k * HEIGHT;
    for (int from = 0, to, piece = depth; from < PANELS; from = to, piece /= 2) {
        to = fitting(from, piece);
        for (int first = 0; first < depth && from < to; first += piece) {
            sweep(b + first, r, shift, from, to, piece);
        }
    }
    vd *last = r + size * (size + 1) / 2 - 1, sum = *last * *last;
    for (int joint = 0; joint < N; ++joint) {
        for (int i = 0; i < depth; ++i) {
            const vd tau = b[BASE * HEIGHT + joint * DEPTH + i];
            sum += tau * tau;
        }
    }
    *last = vd_sqrt(sum);
}

/* The products of a block in the order in which columns stay in the first cache, and their sums. */
typedef struct {
    product *items; /* NULL where they are only counted */
    long count, sums;
} schedule;

/* A product over the joints [from, to) of each run of joints that follow one another. The sums begin
 * at s->sums. */
static void enter(schedule *s, product p, const short *joints, int joint_count, int from, int to)
{
    for (int k = 0, next; k < joint_count; k = next) {
        int first = joints[k], end = first + 1;
        for (next = k + 1; next < joint_count && joints[next] == end; ++next) {
            ++end;
        }
        p.fresh = k == 0 && first >= from;
        first = first > from ? first : from;
        end = end < to ? end : to;
        if (first >= end) {
            continue;
        }
        if (s->items) {
            product *item = s->items + s->count;
            *item = p;
            item->a += first * DEPTH;
            item->b += first * DEPTH;
            item->rows = (short)((end - first) * DEPTH);
            item->sums = s->sums;
        }
        ++s->count;
    }
    s->sums += p.tall * p.broad;
}

/* The width of the next of the fewest equal parts of `rest` columns. */
static int next_part(long rest)
{
    const long parts = (rest + TALL - 1) / TALL;
    return (int)((rest + parts - 1) / parts);
}

/* The products of friction columns, each of which has rows of one joint. */
static void enter_friction(schedule *s, long k)
{
    for (int joint = 0; joint < N; ++joint) {
        const short *of = joint_columns + joint_at[joint];
        const int filled = joint_at[joint + 1] - joint_at[joint];
        int tall;
        for (long m = 0; m < k; m += tall) {
            tall = next_part(k - m);
            const short row = (short)(joint * k + m);
            product p = {m * HEIGHT, m * HEIGHT, 0, (short)tall, (short)tall, 1, 0, row, row, 0};
            enter(s, p, counting + joint, 1, 0, N);
            p.square = 0;
            for (long later = m + tall; later < k; later += p.broad) {
                p.broad = (short)(k - later < BROAD ? k - later : BROAD);
                p.b = later * HEIGHT;
                p.column = (short)(joint * k + later);
                enter(s, p, counting + joint, 1, 0, N);
            }
            for (int at = 0; at < filled; at += p.broad) {
                for (p.broad = 1; p.broad < BROAD && at + p.broad < filled && of[at + p.broad] == of[at] + p.broad;) {
                    ++p.broad;
                }
                p.b = (k + of[at]) * HEIGHT;
                p.column = (short)(N * k + of[at]);
                enter(s, p, counting + joint, 1, 0, N);
            }
        }
    }
}

/* The products of all columns with those of [low, high) over the joints [from, to). */
static void enter_zone(schedule *s, long k, int low, int high, int from, int to)
{
    for (int r = 0; r < RUNS; ++r) {
        const int end = runs[r].first + runs[r].width;
        for (int c = runs[r].first, tall; c < end && c < high; c += tall) {
            tall = next_part(end - c);
            const short row = (short)(N * k + c);
            product p = {(k + c) * HEIGHT, (k + c) * HEIGHT, 0, (short)tall, (short)tall, 1, 0, row, row, 0};
            for (int n = 0; n < runs[r].range_count; ++n) {
                const sharing *with = ranges + runs[r].range + n;
                const short *joints = range_rows + with->rows;
                int first = with->from > low ? with->from : low;
                const int last = with->to < high ? with->to : high;
                if (with->from <= c && low <= c + tall - 1 && c + tall - 1 < high) {
                    enter(s, p, joints, with->row_count, from, to);
                }
                first = first > c + tall ? first : c + tall;
                if (first < last) {
                    product q = p;
                    q.square = 0;
                    q.broad = (short)(last - first);
                    q.b = (k + first) * HEIGHT;
                    q.column = (short)(N * k + first);
                    enter(s, q, joints, with->row_count, from, to);
                }
            }
        }
    }
}

/* Zones of BROAD columns from the last one on, over as many rows as stay in the first cache while the
 * columns before them pass. */
static void enter_all(schedule *s, long k)
{
    enum { PIECES = (N * DEPTH + NEAR - 1) / NEAR, STRIDE = (N + PIECES - 1) / PIECES };
    s->count = s->sums = 0;
    enter_friction(s, k);
    for (int high = BASE + 1; high > 0; high -= BROAD) {
        const long sums = s->sums;
        for (int from = 0; from < N; from += STRIDE) {
            s->sums = sums;
            enter_zone(s, k, high > BROAD ? high - BROAD : 0, high, from, from + STRIDE);
        }
    }
    s->sums = (s->sums + W - 1) / W * W;
}

/* The rows [from, to) of each joint in a block become zero. */
static APART void clear_rows(vd *b, long k, int from, int to)
{
    for (long i = from < to ? 0 : (k + BASE + 1) * N; i < (k + BASE + 1) * N; ++i) {
        for (int row = from; row < to; ++row) {
            b[i / N * HEIGHT + i % N * DEPTH + row] = vd_all(0.0);
        }
    }
}

/* The means of windows become row `slot` of a block, and the sums zero. */
static APART void keep_means(vd *sums, vd *up, long k, int slot, double scale)
{
    for (long c = 0; c < k + BASE + 1; ++c) {
        for (int joint = 0; joint < N; ++joint) {
            up[c * HEIGHT + joint * DEPTH + slot] = scale * sums[c * N + joint];
            sums[c * N + joint] = vd_all(0.0);
        }
    }
}

enum { TEAM = 4 }; /* reflections that a join applies together */

/* TEAM reflections of a join: number i has u = [-length; u] with `span` rows, h = length^2. */
typedef struct {
    const double *u;
    double *row; /* of R, `step` from one to the next */
    double length[TEAM], inverse[TEAM], cross[TEAM][TEAM];
    long span, count, step;
} joiner;

/* Number `which` of a team: the reflections before it are applied to its column, its own is formed. */
INLINE void join_reflect(joiner *f, double *x, long c, const int which)
{
    double w[TEAM];
    vd dot[TEAM] = { {0.0} };
    for (long i = 0; i < f->count; i += W) {
        UNROLL for (int j = 0; j < which; ++j) {
            dot[j] += *(const vu *)(f->u + j * f->span + i) * *(const vu *)(x + i);
        }
    }
    UNROLL for (int j = 0; j < which; ++j) {
        w[j] = vd_sum(dot[j]);
        UNROLL for (int before = 0; before < j; ++before) {
            w[j] -= f->cross[before][j] * w[before];
        }
        w[j] *= f->inverse[j];
    }
    vd square = {0.0};
    UNROLL for (int j = 0; j < which; ++j) {
        f->row[j * f->step + c] = f->length[j] * w[j];
        dot[j] = (vd){0.0};
    }
    for (long i = 0; i < f->count; i += W) {
        vd here = *(const vu *)(x + i);
        UNROLL for (int j = 0; j < which; ++j) {
            here -= *(const vu *)(f->u + j * f->span + i) * w[j];
        }
        *(vu *)(x + i) = here;
        square += here * here;
        UNROLL for (int j = 0; j < which; ++j) {
            dot[j] += *(const vu *)(f->u + j * f->span + i) * here;
        }
    }
    UNROLL for (int j = 0; j < which; ++j) {
        f->cross[j][which] = vd_sum(dot[j]);
    }
    const double s = vd_sum(square);
    f->length[which] = s <= TINY ? 0.0 : sqrt(s);
    f->inverse[which] = s <= TINY ? 0.0 : 1.0 / s;
    f->row[which * f->step + c] = f->length[which];
}

/* A team takes `vectors` vectors of columns from j on, in which the rows of R are still empty. */
INLINE void join_apply(const joiner *f, double *rows, long j, const int vectors)
{
    vd w[TEAM][TOGETHER];
    UNROLL for (int t = 0; t < TEAM; ++t) {
        UNROLL for (int v = 0; v < vectors; ++v) {
            w[t][v] = vd_all(0.0);
        }
    }
    for (long i = 0; i < f->count; ++i) {
        UNROLL for (int v = 0; v < vectors; ++v) {
            vd x = *(const vu *)(rows + i * f->step + j + v * W);
            HOLD(x);
            UNROLL for (int t = 0; t < TEAM; ++t) {
                w[t][v] += f->u[t * f->span + i] * x;
            }
        }
    }
    UNROLL for (int v = 0; v < vectors; ++v) {
        UNROLL for (int t = 0; t < TEAM; ++t) {
            UNROLL for (int before = 0; before < t; ++before) {
                w[t][v] -= f->cross[before][t] * w[before][v];
            }
            w[t][v] *= f->inverse[t];
            *(vu *)(f->row + t * f->step + j + v * W) = f->length[t] * w[t][v];
        }
    }
    for (long i = 0; i < f->count; ++i) {
        UNROLL for (int v = 0; v < vectors; ++v) {
            vu *x = (vu *)(rows + i * f->step + j + v * W);
            vd here = *x;
            UNROLL for (int t = 0; t < TEAM; ++t) {
                here -= f->u[t * f->span + i] * w[t][v];
            }
            *x = here;
        }
    }
}

/* Numbers that a join keeps for a team. */
static long team_size(long size, long each)
{
    return TEAM * ((size * each + LANES - 1) / LANES * LANES);
}

/* `each` triangles of `size` columns become one. Rows are `step` >= size + W apart and zero beyond
 * their `size` numbers; row c of triangle i is row c each + i of `rows`, which is used up. */
static void join(double *r, double *rows, long size, long each, long step, double *u)
{
    for (long i = 0; i < size * step; ++i) {
        r[i] = 0.0;
    }
    for (long c = 0; c < size; c += TEAM) {
        const int width = size - c < TEAM ? (int)(size - c) : TEAM;
        const long end = (c + width) * each;
        long first = 0, at = 0;
        for (int empty = 1; empty && first < end; first += empty) { /* those of other joints' friction */
            for (int t = 0; t < width; ++t) {
                empty &= rows[first * step + c + t] == 0.0;
            }
        }
        joiner f = {.u = u, .row = r + c * step, .count = end - first, .step = step};
        f.span = (f.count + LANES - 1) / LANES * LANES;
        for (long i = first; i < end; ++i, ++at) {
            for (int t = 0; t < width; ++t) {
                u[t * f.span + at] = rows[i * step + c + t];
            }
        }
        for (; at < f.span; ++at) {
            for (int t = 0; t < width; ++t) {
                u[t * f.span + at] = 0.0;
            }
        }
        join_reflect(&f, u, c, 0);
        if (width > 1) {
            join_reflect(&f, u + f.span, c + 1, 1);
        }
        if (width > 2) {
            join_reflect(&f, u + 2 * f.span, c + 2, 2);
        }
        if (width > 3) {
            join_reflect(&f, u + 3 * f.span, c + 3, 3);
        }
        long j = c + TEAM;
        for (; j + (TOGETHER - 1) * W < size; j += TOGETHER * W) {
            join_apply(&f, rows + first * step, j, TOGETHER);
        }
        for (; j < size; j += W) {
            join_apply(&f, rows + first * step, j, 1);
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

/* Doubles that a schedule takes. */
static long items_size(const schedule *s)
{
    return (s->count * (long)sizeof(product) + 63) / 64 * 8;
}

/* Doubles of `work` that _statistics needs with k friction columns per joint, and _statistics_join
 * for `count` triangles of `size` columns. */
long OWN(statistics_work)(long k);
long OWN(statistics_work)(long k)
{
    const long size = N * k + BASE + 1, step = step_of(size);
    const long triangles = size * (size + 1) / 2 * LANES, means = HEIGHT * (k + BASE + 1) * LANES;
    const long block = means + N * k * LANES, joined = size * (LANES + 1) * step + team_size(size, LANES);
    schedule products = {0};
    enter_all(&products, k);
    return 8 + triangles + products.sums * LANES + items_size(&products) + means + N * (k + BASE + 1) * LANES + (block > joined ? block : joined);
}

long OWN(statistics_join_work)(long size, long count);
long OWN(statistics_join_work)(long size, long count)
{
    return size * (count + 1) * step_of(size) + team_size(size, count);
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
    join(work, rows, size, count, step, rows + size * count * step);
    for (long i = 0; i < size * size; ++i) {
        triangle[i] = work[i / size * step + i % size];
    }
}

/* N samples as `statistics` takes them, and the roots of the weights of the joints. */
typedef struct {
    long n, k;
    const double *q, *dq, *ddq, *tau, *columns, *sample_weight;
    double root[N];
} samples;

/* Y_b with tau = Y_b beta, Eq. 3.11: its rows in a block, each times its scale. */
#define VS VECTORS
#define PUT(joint, column, value) to[(joint) * DEPTH + (column) * HEIGHT] = scale[joint] * (value)
static APART void place(const vu *restrict sc, const vu *restrict q, const vu *restrict dq, const vu *restrict ddq, const vd *restrict scale, vd *restrict to)
{
    (void)q;
    PUT(0, 0, ddq[0 * VS]);
    const vd t9 = sc[2 * VS] * dq[0 * VS];
    const vd t10 = dq[1 * VS] * t9;
    const vd t12 = t10 * sc[3 * VS];
    const vd t13 = sc[2 * VS] * ddq[0 * VS];
    const vd t14 = sc[3 * VS] * dq[0 * VS];
    const vd t15 = t14 * dq[1 * VS];
    const vd t16 = t13 + t15;
    const vd t17 = t16 * sc[2 * VS];
    const vd t18 = t12 + t17;
    PUT(0, 3, t18);
    const vd t20 = t15 * sc[2 * VS];
    const vd t21 = t20 - t12;
    PUT(0, 4, t21);
    const vd t23 = t15 + t16;
    const vd t24 = t23 * sc[3 * VS];
    const vd t25 = t9 * dq[1 * VS];
    const vd t26 = sc[3 * VS] * ddq[0 * VS];
    const vd t27 = t25 - t26;
    const vd t28 = t25 + t27;
    const vd t29 = t28 * sc[2 * VS];
    const vd t30 = t24 - t29;
    PUT(0, 5, t30);
    const vd t32 = dq[1 * VS] * dq[1 * VS];
    const vd t33 = t9 * t9;
    const vd t34 = t32 - t33;
    const vd t35 = t34 * sc[3 * VS];
    const vd t36 = t9 * t14;
    const vd t38 = t36 + ddq[1 * VS];
    const vd t39 = t38 * sc[2 * VS];
    const vd t40 = t35 + t39;
    const vd t41 = -t40;
    PUT(0, 6, t41);
    const vd t43 = t36 - ddq[1 * VS];
    const vd t44 = t43 * sc[3 * VS];
    const vd t45 = t14 * t14;
    const vd t46 = t45 - t32;
    const vd t47 = t46 * sc[2 * VS];
    const vd t48 = t44 - t47;
    PUT(0, 7, t48);
    const vd t52 = sc[4 * VS] * t9;
    const vd t54 = sc[5 * VS] * dq[1 * VS];
    const vd t55 = t52 + t54;
    const vd t56 = t55 * t55;
    const vd t58 = t14 + dq[2 * VS];
    const vd t59 = t58 * t58;
    const vd t60 = t56 + t59;
    const vd t62 = (-0.316) * sc[2 * VS];
    const vd t63 = sc[4 * VS] * t62;
    const vd t64 = t60 * t63;
    const vd t65 = (-0.316) * t43;
    const vd t67 = 9.8100000000000005 * sc[2 * VS];
    const vd t68 = t65 - t67;
    const vd t69 = sc[4 * VS] * t68;
    const vd t70 = (-0.316) * t23;
    const vd t71 = sc[5 * VS] * t70;
    const vd t72 = t69 + t71;
    const vd t73 = t72 * sc[3 * VS];
    const vd t74 = sc[4 * VS] * dq[1 * VS];
    const vd t75 = sc[5 * VS] * t9;
    const vd t76 = t74 - t75;
    const vd t77 = t76 * t55;
    const vd t79 = ddq[2 * VS] - t27;
    const vd t80 = t77 + t79;
    const vd t81 = sc[5 * VS] * t62;
    const vd t82 = t80 * t81;
    const vd t83 = t73 + t82;
    const vd t84 = t64 - t83;
    const vd t85 = 9.8100000000000005 * sc[3 * VS];
    const vd t86 = t33 + t32;
    const vd t87 = (-0.316) * t86;
    const vd t88 = t85 + t87;
    const vd t89 = sc[4 * VS] * sc[2 * VS];
    const vd t90 = t88 * t89;
    const vd t91 = t84 - t90;
    PUT(0, 8, t91);
    const vd t93 = t76 * t76;
    const vd t94 = t93 + t59;
    const vd t95 = t94 * t81;
    const vd t96 = sc[5 * VS] * t68;
    const vd t97 = sc[4 * VS] * t70;
    const vd t98 = t96 - t97;
    const vd t99 = t98 * sc[3 * VS];
    const vd t100 = t95 - t99;
    const vd t101 = t77 - t79;
    const vd t102 = t101 * t63;
    const vd t103 = t100 - t102;
    const vd t104 = sc[5 * VS] * sc[2 * VS];
    const vd t105 = t88 * t104;
    const vd t106 = t103 - t105;
    PUT(0, 9, t106);
    const vd t108 = t58 * t76;
    const vd t109 = t108 * t89;
    const vd t110 = t77 * sc[3 * VS];
    const vd t111 = t109 - t110;
    const vd t112 = sc[4 * VS] * ddq[1 * VS];
    const vd t113 = sc[5 * VS] * t16;
    const vd t114 = t112 - t113;
    const vd t115 = t55 * dq[2 * VS];
    const vd t116 = t114 + t115;
    const vd t117 = t116 * t104;
    const vd t118 = t111 - t117;
    PUT(0, 10, t118);
    const vd t120 = t79 * sc[3 * VS];
    const vd t121 = t120 - t109;
    const vd t122 = t55 * t58;
    const vd t123 = t122 * t104;
    const vd t124 = t121 - t123;
    PUT(0, 11, t124);
    const vd t126 = t93 - t56;
    const vd t127 = t126 * sc[3 * VS];
    const vd t128 = t122 + t116;
    const vd t129 = t128 * t89;
    const vd t130 = t127 + t129;
    const vd t131 = t76 * t58;
    const vd t132 = sc[4 * VS] * t16;
    const vd t133 = sc[5 * VS] * ddq[1 * VS];
    const vd t134 = t132 + t133;
    const vd t135 = t76 * dq[2 * VS];
    const vd t136 = t134 - t135;
    const vd t137 = t131 - t136;
    const vd t138 = t137 * t104;
    const vd t139 = t130 + t138;
    PUT(0, 12, t139);
    const vd t141 = t59 - t93;
    const vd t142 = t141 * t89;
    const vd t143 = t122 - t116;
    const vd t144 = t143 * sc[3 * VS];
    const vd t145 = t142 - t144;
    const vd t146 = t80 * t104;
    const vd t147 = t145 - t146;
    PUT(0, 13, t147);
    const vd t149 = t131 + t136;
    const vd t150 = t149 * sc[3 * VS];
    const vd t151 = t101 * t89;
    const vd t152 = t150 - t151;
    const vd t153 = t56 - t59;
    const vd t154 = t153 * t104;
    const vd t155 = t152 - t154;
    PUT(0, 14, t155);
    const vd t159 = sc[7 * VS] * t76;
    const vd t161 = sc[6 * VS] * t58;
    const vd t162 = t159 + t161;
    const vd t164 = dq[3 * VS] - t55;
    const vd t165 = t162 * t164;
    const vd t166 = sc[7 * VS] * t79;
    const vd t167 = sc[6 * VS] * t116;
    const vd t168 = t166 - t167;
    const vd t169 = t162 * dq[3 * VS];
    const vd t170 = t168 - t169;
    const vd t171 = t165 - t170;
    const vd t173 = 0.082500000000000004 * sc[3 * VS];
    const vd t174 = t81 - t173;
    const vd t175 = t171 * t174;
    const vd t176 = sc[7 * VS] * t58;
    const vd t177 = sc[6 * VS] * t76;
    const vd t178 = t176 - t177;
    const vd t179 = t162 * t178;
    const vd t181 = ddq[3 * VS] - t136;
    const vd t182 = t179 + t181;
    const vd t183 = sc[6 * VS] * t63;
    const vd t184 = 0.082500000000000004 * t89;
    const vd t185 = sc[7 * VS] * t184;
    const vd t186 = t183 - t185;
    const vd t187 = t182 * t186;
    const vd t188 = t175 + t187;
    const vd t189 = t178 * t178;
    const vd t190 = t164 * t164;
    const vd t191 = t189 + t190;
    const vd t192 = sc[7 * VS] * t63;
    const vd t193 = sc[6 * VS] * t184;
    const vd t194 = t192 + t193;
    const vd t195 = t191 * t194;
    const vd t196 = t188 + t195;
    const vd t197 = 0.082500000000000004 * t137;
    const vd t198 = t88 + t197;
    const vd t199 = sc[7 * VS] * t198;
    const vd t200 = 0.082500000000000004 * t60;
    const vd t201 = t98 - t200;
    const vd t202 = sc[6 * VS] * t201;
    const vd t203 = t199 - t202;
    const vd t204 = t203 * t89;
    const vd t205 = t196 - t204;
    const vd t206 = 0.082500000000000004 * t80;
    const vd t207 = t206 - t72;
    const vd t208 = sc[7 * VS] * sc[3 * VS];
    const vd t209 = sc[6 * VS] * t104;
    const vd t210 = t208 + t209;
    const vd t211 = t207 * t210;
    const vd t212 = t205 + t211;
    PUT(0, 15, t212);
    const vd t214 = t178 * t164;
    const vd t215 = sc[7 * VS] * t116;
    const vd t216 = sc[6 * VS] * t79;
    const vd t217 = t215 + t216;
    const vd t218 = t178 * dq[3 * VS];
    const vd t219 = t217 + t218;
    const vd t220 = t214 + t219;
    const vd t221 = t220 * t174;
    const vd t222 = t162 * t162;
    const vd t223 = t222 + t190;
    const vd t224 = t223 * t186;
    const vd t225 = t221 - t224;
    const vd t226 = t179 - t181;
    const vd t227 = t226 * t194;
    const vd t228 = t225 - t227;
    const vd t229 = sc[7 * VS] * t201;
    const vd t230 = sc[6 * VS] * t198;
    const vd t231 = t229 + t230;
    const vd t232 = t231 * t89;
    const vd t233 = t228 + t232;
    const vd t234 = sc[6 * VS] * sc[3 * VS];
    const vd t235 = sc[7 * VS] * t104;
    const vd t236 = t234 - t235;
    const vd t237 = t207 * t236;
    const vd t238 = t233 - t237;
    PUT(0, 16, t238);
    const vd t240 = t179 * t89;
    const vd t241 = t164 * t162;
    const vd t242 = t241 * t210;
    const vd t243 = t240 + t242;
    const vd t244 = t219 * t236;
    const vd t245 = t243 + t244;
    PUT(0, 17, t245);
    const vd t247 = t214 * t236;
    const vd t248 = t181 * t89;
    const vd t249 = t248 + t242;
    const vd t250 = t247 - t249;
    PUT(0, 18, t250);
    const vd t252 = t220 * t210;
    const vd t253 = t222 - t189;
    const vd t254 = t253 * t89;
    const vd t255 = t252 - t254;
    const vd t256 = t171 * t236;
    const vd t257 = t255 - t256;
    PUT(0, 19, t257);
    const vd t259 = t214 - t219;
    const vd t260 = t259 * t89;
    const vd t261 = t190 - t222;
    const vd t262 = t261 * t210;
    const vd t263 = t260 + t262;
    const vd t264 = t182 * t236;
    const vd t265 = t263 + t264;
    PUT(0, 20, t265);
    const vd t267 = t189 - t190;
    const vd t268 = t267 * t236;
    const vd t269 = t165 + t170;
    const vd t270 = t269 * t89;
    const vd t271 = t226 * t210;
    const vd t272 = t270 + t271;
    const vd t273 = t268 - t272;
    PUT(0, 21, t273);
    const vd t277 = sc[9 * VS] * t162;
    const vd t279 = sc[8 * VS] * t164;
    const vd t280 = t277 - t279;
    const vd t282 = t178 + dq[4 * VS];
    const vd t283 = t280 * t282;
    const vd t284 = sc[8 * VS] * t219;
    const vd t285 = sc[9 * VS] * t181;
    const vd t286 = t284 + t285;
    const vd t287 = t280 * dq[4 * VS];
    const vd t288 = t286 + t287;
    const vd t289 = t283 + t288;
    const vd t291 = (-0.082500000000000004) * t89;
    const vd t292 = t186 - t291;
    const vd t293 = t289 * t292;
    const vd t295 = 0.38400000000000001 * t226;
    const vd t296 = (-0.082500000000000004) * t191;
    const vd t297 = t295 - t296;
    const vd t298 = t231 + t297;
    const vd t299 = sc[8 * VS] * t298;
    const vd t300 = (-0.082500000000000004) * t171;
    const vd t301 = 0.38400000000000001 * t220;
    const vd t302 = t300 + t301;
    const vd t303 = t302 - t207;
    const vd t304 = sc[9 * VS] * t303;
    const vd t305 = t299 + t304;
    const vd t306 = t305 * t210;
    const vd t307 = t293 - t306;
    const vd t309 = t170 + ddq[4 * VS];
    const vd t310 = sc[8 * VS] * t162;
    const vd t311 = sc[9 * VS] * t164;
    const vd t312 = t310 + t311;
    const vd t313 = t280 * t312;
    const vd t314 = t309 - t313;
    const vd t315 = (-0.082500000000000004) * t210;
    const vd t316 = t315 - t174;
    const vd t317 = 0.38400000000000001 * t236;
    const vd t318 = t316 - t317;
    const vd t319 = sc[9 * VS] * t318;
    const vd t320 = 0.38400000000000001 * t89;
    const vd t321 = t320 - t194;
    const vd t322 = sc[8 * VS] * t321;
    const vd t323 = t319 - t322;
    const vd t324 = t314 * t323;
    const vd t325 = t307 + t324;
    const vd t326 = t312 * t312;
    const vd t327 = t282 * t282;
    const vd t328 = t326 + t327;
    const vd t329 = sc[9 * VS] * t321;
    const vd t330 = sc[8 * VS] * t318;
    const vd t331 = t329 + t330;
    const vd t332 = t328 * t331;
    const vd t333 = t325 - t332;
    const vd t334 = (-0.082500000000000004) * t182;
    const vd t335 = 0.38400000000000001 * t223;
    const vd t336 = t334 - t335;
    const vd t337 = t203 + t336;
    const vd t338 = sc[9 * VS] * t89;
    const vd t339 = sc[8 * VS] * t236;
    const vd t340 = t338 - t339;
    const vd t341 = t337 * t340;
    const vd t342 = t333 - t341;
    PUT(0, 22, t342);
    const vd t344 = sc[9 * VS] * t219;
    const vd t345 = sc[8 * VS] * t181;
    const vd t346 = t344 - t345;
    const vd t347 = t312 * dq[4 * VS];
    const vd t348 = t346 - t347;
    const vd t349 = t312 * t282;
    const vd t350 = t348 - t349;
    const vd t351 = t350 * t292;
    const vd t352 = sc[9 * VS] * t298;
    const vd t353 = sc[8 * VS] * t303;
    const vd t354 = t352 - t353;
    const vd t355 = t354 * t210;
    const vd t356 = t351 - t355;
    const vd t357 = t280 * t280;
    const vd t358 = t357 + t327;
    const vd t359 = t358 * t323;
    const vd t360 = t356 - t359;
    const vd t361 = t313 + t309;
    const vd t362 = t361 * t331;
    const vd t363 = t360 - t362;
    const vd t364 = sc[8 * VS] * t89;
    const vd t365 = sc[9 * VS] * t236;
    const vd t366 = t364 + t365;
    const vd t367 = t337 * t366;
    const vd t368 = t363 + t367;
    PUT(0, 23, t368);
    const vd t370 = t313 * t210;
    const vd t371 = t282 * t280;
    const vd t372 = t371 * t340;
    const vd t373 = t370 + t372;
    const vd t374 = t348 * t366;
    const vd t375 = t373 + t374;
    PUT(0, 24, t375);
    const vd t377 = t309 * t210;
    const vd t378 = t377 - t372;
    const vd t379 = t349 * t366;
    const vd t380 = t378 - t379;
    PUT(0, 25, t380);
    const vd t382 = t357 - t326;
    const vd t383 = t382 * t210;
    const vd t384 = t350 * t340;
    const vd t385 = t383 + t384;
    const vd t386 = t289 * t366;
    const vd t387 = t385 - t386;
    PUT(0, 26, t387);
    const vd t389 = t349 + t348;
    const vd t390 = t389 * t210;
    const vd t391 = t327 - t357;
    const vd t392 = t391 * t340;
    const vd t393 = t390 + t392;
    const vd t394 = t314 * t366;
    const vd t395 = t393 + t394;
    PUT(0, 27, t395);
    const vd t397 = t283 - t288;
    const vd t398 = t397 * t210;
    const vd t399 = t361 * t340;
    const vd t400 = t398 + t399;
    const vd t401 = t326 - t327;
    const vd t402 = t401 * t366;
    const vd t403 = t400 + t402;
    PUT(0, 28, t403);
    const vd t407 = sc[11 * VS] * t280;
    const vd t409 = sc[10 * VS] * t282;
    const vd t410 = t407 + t409;
    const vd t411 = sc[11 * VS] * t282;
    const vd t412 = sc[10 * VS] * t280;
    const vd t413 = t411 - t412;
    const vd t414 = t410 * t413;
    const vd t416 = t288 + ddq[5 * VS];
    const vd t417 = t414 + t416;
    const vd t418 = sc[11 * VS] * t292;
    const vd t419 = sc[10 * VS] * t331;
    const vd t420 = t418 - t419;
    const vd t421 = t417 * t420;
    const vd t423 = t312 + dq[5 * VS];
    const vd t424 = t410 * t423;
    const vd t425 = sc[11 * VS] * t309;
    const vd t426 = sc[10 * VS] * t348;
    const vd t427 = t425 - t426;
    const vd t428 = t410 * dq[5 * VS];
    const vd t429 = t427 - t428;
    const vd t430 = t424 - t429;
    const vd t431 = t430 * t323;
    const vd t432 = t421 - t431;
    const vd t433 = t413 * t413;
    const vd t434 = t423 * t423;
    const vd t435 = t433 + t434;
    const vd t436 = sc[10 * VS] * t292;
    const vd t437 = sc[11 * VS] * t331;
    const vd t438 = t436 + t437;
    const vd t439 = t435 * t438;
    const vd t440 = t432 - t439;
    const vd t441 = sc[11 * VS] * t337;
    const vd t442 = sc[10 * VS] * t354;
    const vd t443 = t441 - t442;
    const vd t444 = t443 * t340;
    const vd t445 = t440 - t444;
    const vd t446 = sc[11 * VS] * t210;
    const vd t447 = sc[10 * VS] * t366;
    const vd t448 = t446 - t447;
    const vd t449 = t305 * t448;
    const vd t450 = t445 - t449;
    PUT(0, 29, t450);
    const vd t452 = t414 - t416;
    const vd t453 = t452 * t438;
    const vd t454 = t413 * t423;
    const vd t455 = sc[11 * VS] * t348;
    const vd t456 = sc[10 * VS] * t309;
    const vd t457 = t455 + t456;
    const vd t458 = t413 * dq[5 * VS];
    const vd t459 = t457 + t458;
    const vd t460 = t454 + t459;
    const vd t461 = t460 * t323;
    const vd t462 = t410 * t410;
    const vd t463 = t462 + t434;
    const vd t464 = t463 * t420;
    const vd t465 = t461 + t464;
    const vd t466 = t453 - t465;
    const vd t467 = sc[11 * VS] * t354;
    const vd t468 = sc[10 * VS] * t337;
    const vd t469 = t467 + t468;
    const vd t470 = t469 * t340;
    const vd t471 = t466 + t470;
    const vd t472 = sc[10 * VS] * t210;
    const vd t473 = sc[11 * VS] * t366;
    const vd t474 = t472 + t473;
    const vd t475 = t305 * t474;
    const vd t476 = t471 + t475;
    PUT(0, 30, t476);
    const vd t478 = t414 * t340;
    const vd t479 = t423 * t410;
    const vd t480 = t479 * t448;
    const vd t481 = t478 + t480;
    const vd t482 = t459 * t474;
    const vd t483 = t481 + t482;
    PUT(0, 31, t483);
    const vd t485 = t454 * t474;
    const vd t486 = t416 * t340;
    const vd t487 = t486 + t480;
    const vd t488 = t485 - t487;
    PUT(0, 32, t488);
    const vd t490 = t460 * t448;
    const vd t491 = t462 - t433;
    const vd t492 = t491 * t340;
    const vd t493 = t490 - t492;
    const vd t494 = t430 * t474;
    const vd t495 = t493 - t494;
    PUT(0, 33, t495);
    const vd t497 = t454 - t459;
    const vd t498 = t497 * t340;
    const vd t499 = t434 - t462;
    const vd t500 = t499 * t448;
    const vd t501 = t498 + t500;
    const vd t502 = t417 * t474;
    const vd t503 = t501 + t502;
    PUT(0, 34, t503);
    const vd t505 = t433 - t434;
    const vd t506 = t505 * t474;
    const vd t507 = t424 + t429;
    const vd t508 = t507 * t340;
    const vd t509 = t452 * t448;
    const vd t510 = t508 + t509;
    const vd t511 = t506 - t510;
    PUT(0, 35, t511);
    const vd t515 = sc[13 * VS] * t410;
    const vd t517 = sc[12 * VS] * t423;
    const vd t518 = t515 + t517;
    const vd t520 = dq[6 * VS] - t413;
    const vd t521 = t518 * t520;
    const vd t522 = sc[13 * VS] * t416;
    const vd t523 = sc[12 * VS] * t459;
    const vd t524 = t522 - t523;
    const vd t525 = t518 * dq[6 * VS];
    const vd t526 = t524 - t525;
    const vd t527 = t521 - t526;
    const vd t529 = 0.087999999999999995 * t340;
    const vd t530 = t529 - t420;
    const vd t531 = t527 * t530;
    const vd t532 = sc[13 * VS] * t423;
    const vd t533 = sc[12 * VS] * t410;
    const vd t534 = t532 - t533;
    const vd t535 = t518 * t534;
    const vd t537 = ddq[6 * VS] - t429;
    const vd t538 = t535 + t537;
    const vd t539 = sc[12 * VS] * t438;
    const vd t540 = 0.087999999999999995 * t448;
    const vd t541 = t323 + t540;
    const vd t542 = sc[13 * VS] * t541;
    const vd t543 = t539 + t542;
    const vd t544 = t538 * t543;
    const vd t545 = t531 - t544;
    const vd t546 = t534 * t534;
    const vd t547 = t520 * t520;
    const vd t548 = t546 + t547;
    const vd t549 = sc[13 * VS] * t438;
    const vd t550 = sc[12 * VS] * t541;
    const vd t551 = t549 - t550;
    const vd t552 = t548 * t551;
    const vd t553 = t545 - t552;
    const vd t554 = 0.087999999999999995 * t430;
    const vd t555 = t305 + t554;
    const vd t556 = sc[13 * VS] * t555;
    const vd t557 = 0.087999999999999995 * t435;
    const vd t558 = t469 - t557;
    const vd t559 = sc[12 * VS] * t558;
    const vd t560 = t556 - t559;
    const vd t561 = t560 * t448;
    const vd t562 = t553 - t561;
    const vd t563 = 0.087999999999999995 * t417;
    const vd t564 = t443 + t563;
    const vd t565 = sc[13 * VS] * t340;
    const vd t566 = sc[12 * VS] * t474;
    const vd t567 = t565 + t566;
    const vd t568 = t564 * t567;
    const vd t569 = t562 - t568;
    PUT(0, 36, t569);
    const vd t571 = t534 * t520;
    const vd t572 = sc[13 * VS] * t459;
    const vd t573 = sc[12 * VS] * t416;
    const vd t574 = t572 + t573;
    const vd t575 = t534 * dq[6 * VS];
    const vd t576 = t574 + t575;
    const vd t577 = t571 + t576;
    const vd t578 = t577 * t530;
    const vd t579 = t518 * t518;
    const vd t580 = t579 + t547;
    const vd t581 = t580 * t543;
    const vd t582 = t578 + t581;
    const vd t583 = t535 - t537;
    const vd t584 = t583 * t551;
    const vd t585 = t582 + t584;
    const vd t586 = sc[13 * VS] * t558;
    const vd t587 = sc[12 * VS] * t555;
    const vd t588 = t586 + t587;
    const vd t589 = t588 * t448;
    const vd t590 = t585 + t589;
    const vd t591 = sc[13 * VS] * t474;
    const vd t592 = sc[12 * VS] * t340;
    const vd t593 = t591 - t592;
    const vd t594 = t564 * t593;
    const vd t595 = t590 - t594;
    PUT(0, 37, t595);
    const vd t597 = t535 * t448;
    const vd t598 = t520 * t518;
    const vd t599 = t598 * t567;
    const vd t600 = t597 - t599;
    const vd t601 = t576 * t593;
    const vd t602 = t600 + t601;
    PUT(0, 38, t602);
    const vd t604 = t537 * t448;
    const vd t605 = t599 - t604;
    const vd t606 = t571 * t593;
    const vd t607 = t605 + t606;
    PUT(0, 39, t607);
    const vd t609 = t579 - t546;
    const vd t610 = t609 * t448;
    const vd t611 = t577 * t567;
    const vd t612 = t610 + t611;
    const vd t613 = t527 * t593;
    const vd t614 = t612 + t613;
    const vd t615 = -t614;
    PUT(0, 40, t615);
    const vd t617 = t571 - t576;
    const vd t618 = t617 * t448;
    const vd t619 = t547 - t579;
    const vd t620 = t619 * t567;
    const vd t621 = t618 - t620;
    const vd t622 = t538 * t593;
    const vd t623 = t621 + t622;
    PUT(0, 41, t623);
    const vd t625 = t583 * t567;
    const vd t626 = t521 + t526;
    const vd t627 = t626 * t448;
    const vd t628 = t625 - t627;
    const vd t629 = t546 - t547;
    const vd t630 = t629 * t593;
    const vd t631 = t628 + t630;
    PUT(0, 42, t631);
    const vd t634 = -t85;
    PUT(1, 1, t634);
    PUT(1, 2, t67);
    const vd t637 = -t36;
    PUT(1, 3, t637);
    PUT(1, 4, ddq[1 * VS]);
    const vd t640 = t33 - t45;
    PUT(1, 5, t640);
    const vd t642 = -t13;
    PUT(1, 6, t642);
    const vd t644 = t27 - t25;
    PUT(1, 7, t644);
    const vd t646 = (-0.316) * sc[4 * VS];
    const vd t647 = t80 * t646;
    const vd t649 = 0.316 * sc[5 * VS];
    const vd t650 = t60 * t649;
    const vd t651 = t647 - t650;
    const vd t652 = t88 * sc[5 * VS];
    const vd t653 = t651 - t652;
    PUT(1, 8, t653);
    const vd t655 = t101 * t649;
    const vd t656 = t94 * t646;
    const vd t657 = t655 - t656;
    const vd t658 = t88 * sc[4 * VS];
    const vd t659 = t657 + t658;
    PUT(1, 9, t659);
    const vd t661 = t108 * sc[5 * VS];
    const vd t662 = t116 * sc[4 * VS];
    const vd t663 = t661 + t662;
    PUT(1, 10, t663);
    const vd t665 = t122 * sc[4 * VS];
    const vd t666 = t665 - t661;
    PUT(1, 11, t666);
    const vd t668 = t128 * sc[5 * VS];
    const vd t669 = t137 * sc[4 * VS];
    const vd t670 = t668 - t669;
    PUT(1, 12, t670);
    const vd t672 = t141 * sc[5 * VS];
    const vd t673 = t80 * sc[4 * VS];
    const vd t674 = t672 + t673;
    PUT(1, 13, t674);
    const vd t676 = t153 * sc[4 * VS];
    const vd t677 = t101 * sc[5 * VS];
    const vd t678 = t676 - t677;
    PUT(1, 14, t678);
    const vd t680 = t171 * t646;
    const vd t681 = sc[6 * VS] * t649;
    const vd t682 = 0.082500000000000004 * sc[5 * VS];
    const vd t683 = sc[7 * VS] * t682;
    const vd t684 = t681 + t683;
    const vd t685 = t182 * t684;
    const vd t686 = t680 + t685;
    const vd t687 = sc[7 * VS] * t649;
    const vd t688 = sc[6 * VS] * t682;
    const vd t689 = t687 - t688;
    const vd t690 = t191 * t689;
    const vd t691 = t686 + t690;
    const vd t692 = t203 * sc[5 * VS];
    const vd t693 = t691 + t692;
    const vd t694 = sc[6 * VS] * sc[4 * VS];
    const vd t695 = t207 * t694;
    const vd t696 = t693 + t695;
    const vd t697 = -t696;
    PUT(1, 15, t697);
    const vd t699 = t223 * t684;
    const vd t700 = t220 * t646;
    const vd t701 = t699 - t700;
    const vd t702 = t226 * t689;
    const vd t703 = t701 + t702;
    const vd t704 = t231 * sc[5 * VS];
    const vd t705 = t703 + t704;
    const vd t706 = sc[7 * VS] * sc[4 * VS];
    const vd t707 = t207 * t706;
    const vd t708 = t705 - t707;
    PUT(1, 16, t708);
    const vd t710 = t179 * sc[5 * VS];
    const vd t711 = t241 * t694;
    const vd t712 = t710 - t711;
    const vd t713 = t219 * t706;
    const vd t714 = t712 + t713;
    PUT(1, 17, t714);
    const vd t716 = t181 * sc[5 * VS];
    const vd t717 = t711 - t716;
    const vd t718 = t214 * t706;
    const vd t719 = t717 + t718;
    PUT(1, 18, t719);
    const vd t721 = t253 * sc[5 * VS];
    const vd t722 = t220 * t694;
    const vd t723 = t721 + t722;
    const vd t724 = t171 * t706;
    const vd t725 = t723 + t724;
    const vd t726 = -t725;
    PUT(1, 19, t726);
    const vd t728 = t259 * sc[5 * VS];
    const vd t729 = t261 * t694;
    const vd t730 = t728 - t729;
    const vd t731 = t182 * t706;
    const vd t732 = t730 + t731;
    PUT(1, 20, t732);
    const vd t734 = t226 * t694;
    const vd t735 = t269 * sc[5 * VS];
    const vd t736 = t734 - t735;
    const vd t737 = t267 * t706;
    const vd t738 = t736 + t737;
    PUT(1, 21, t738);
    const vd t740 = t305 * t694;
    const vd t741 = (-0.082500000000000004) * sc[5 * VS];
    const vd t742 = t684 + t741;
    const vd t743 = t289 * t742;
    const vd t744 = t740 - t743;
    const vd t745 = (-0.082500000000000004) * t694;
    const vd t746 = t646 - t745;
    const vd t747 = 0.38400000000000001 * t706;
    const vd t748 = t746 - t747;
    const vd t749 = sc[9 * VS] * t748;
    const vd t750 = 0.38400000000000001 * sc[5 * VS];
    const vd t751 = t689 + t750;
    const vd t752 = sc[8 * VS] * t751;
    const vd t753 = t749 - t752;
    const vd t754 = t314 * t753;
    const vd t755 = t744 + t754;
    const vd t756 = sc[9 * VS] * t751;
    const vd t757 = sc[8 * VS] * t748;
    const vd t758 = t756 + t757;
    const vd t759 = t328 * t758;
    const vd t760 = t755 - t759;
    const vd t761 = sc[9 * VS] * sc[5 * VS];
    const vd t762 = sc[8 * VS] * t706;
    const vd t763 = t761 - t762;
    const vd t764 = t337 * t763;
    const vd t765 = t760 - t764;
    PUT(1, 22, t765);
    const vd t767 = t354 * t694;
    const vd t768 = t350 * t742;
    const vd t769 = t767 - t768;
    const vd t770 = t358 * t753;
    const vd t771 = t769 - t770;
    const vd t772 = t361 * t758;
    const vd t773 = t771 - t772;
    const vd t774 = sc[8 * VS] * sc[5 * VS];
    const vd t775 = sc[9 * VS] * t706;
    const vd t776 = t774 + t775;
    const vd t777 = t337 * t776;
    const vd t778 = t773 + t777;
    PUT(1, 23, t778);
    const vd t780 = t371 * t763;
    const vd t781 = t313 * t694;
    const vd t782 = t780 - t781;
    const vd t783 = t348 * t776;
    const vd t784 = t782 + t783;
    PUT(1, 24, t784);
    const vd t786 = t309 * t694;
    const vd t787 = t786 + t780;
    const vd t788 = t349 * t776;
    const vd t789 = t787 + t788;
    const vd t790 = -t789;
    PUT(1, 25, t790);
    const vd t792 = t350 * t763;
    const vd t793 = t382 * t694;
    const vd t794 = t792 - t793;
    const vd t795 = t289 * t776;
    const vd t796 = t794 - t795;
    PUT(1, 26, t796);
    const vd t798 = t391 * t763;
    const vd t799 = t389 * t694;
    const vd t800 = t798 - t799;
    const vd t801 = t314 * t776;
    const vd t802 = t800 + t801;
    PUT(1, 27, t802);
    const vd t804 = t361 * t763;
    const vd t805 = t397 * t694;
    const vd t806 = t804 - t805;
    const vd t807 = t401 * t776;
    const vd t808 = t806 + t807;
    PUT(1, 28, t808);
    const vd t810 = sc[11 * VS] * t694;
    const vd t811 = sc[10 * VS] * t776;
    const vd t812 = t810 + t811;
    const vd t813 = t305 * t812;
    const vd t814 = t430 * t753;
    const vd t815 = sc[11 * VS] * t742;
    const vd t816 = sc[10 * VS] * t758;
    const vd t817 = t815 + t816;
    const vd t818 = t417 * t817;
    const vd t819 = t814 + t818;
    const vd t820 = sc[11 * VS] * t758;
    const vd t821 = sc[10 * VS] * t742;
    const vd t822 = t820 - t821;
    const vd t823 = t435 * t822;
    const vd t824 = t819 + t823;
    const vd t825 = t443 * t763;
    const vd t826 = t824 + t825;
    const vd t827 = t813 - t826;
    PUT(1, 29, t827);
    const vd t829 = t463 * t817;
    const vd t830 = t460 * t753;
    const vd t831 = t829 - t830;
    const vd t832 = t452 * t822;
    const vd t833 = t831 + t832;
    const vd t834 = t469 * t763;
    const vd t835 = t833 + t834;
    const vd t836 = sc[11 * VS] * t776;
    const vd t837 = sc[10 * VS] * t694;
    const vd t838 = t836 - t837;
    const vd t839 = t305 * t838;
    const vd t840 = t835 + t839;
    PUT(1, 30, t840);
    const vd t842 = t414 * t763;
    const vd t843 = t479 * t812;
    const vd t844 = t842 - t843;
    const vd t845 = t459 * t838;
    const vd t846 = t844 + t845;
    PUT(1, 31, t846);
    const vd t848 = t416 * t763;
    const vd t849 = t843 - t848;
    const vd t850 = t454 * t838;
    const vd t851 = t849 + t850;
    PUT(1, 32, t851);
    const vd t853 = t491 * t763;
    const vd t854 = t460 * t812;
    const vd t855 = t853 + t854;
    const vd t856 = t430 * t838;
    const vd t857 = t855 + t856;
    const vd t858 = -t857;
    PUT(1, 33, t858);
    const vd t860 = t497 * t763;
    const vd t861 = t499 * t812;
    const vd t862 = t860 - t861;
    const vd t863 = t417 * t838;
    const vd t864 = t862 + t863;
    PUT(1, 34, t864);
    const vd t866 = t452 * t812;
    const vd t867 = t507 * t763;
    const vd t868 = t866 - t867;
    const vd t869 = t505 * t838;
    const vd t870 = t868 + t869;
    PUT(1, 35, t870);
    const vd t872 = 0.087999999999999995 * t763;
    const vd t873 = t817 + t872;
    const vd t874 = t527 * t873;
    const vd t875 = 0.087999999999999995 * t812;
    const vd t876 = t875 - t753;
    const vd t877 = sc[13 * VS] * t876;
    const vd t878 = sc[12 * VS] * t822;
    const vd t879 = t877 - t878;
    const vd t880 = t538 * t879;
    const vd t881 = t874 + t880;
    const vd t882 = sc[13 * VS] * t822;
    const vd t883 = sc[12 * VS] * t876;
    const vd t884 = t882 + t883;
    const vd t885 = t548 * t884;
    const vd t886 = t881 - t885;
    const vd t887 = t560 * t812;
    const vd t888 = t886 + t887;
    const vd t889 = sc[13 * VS] * t763;
    const vd t890 = sc[12 * VS] * t838;
    const vd t891 = t889 + t890;
    const vd t892 = t564 * t891;
    const vd t893 = t888 - t892;
    PUT(1, 36, t893);
    const vd t895 = t577 * t873;
    const vd t896 = t580 * t879;
    const vd t897 = t895 - t896;
    const vd t898 = t583 * t884;
    const vd t899 = t897 + t898;
    const vd t900 = t588 * t812;
    const vd t901 = t899 - t900;
    const vd t902 = sc[13 * VS] * t838;
    const vd t903 = sc[12 * VS] * t763;
    const vd t904 = t902 - t903;
    const vd t905 = t564 * t904;
    const vd t906 = t901 - t905;
    PUT(1, 37, t906);
    const vd t908 = t576 * t904;
    const vd t909 = t535 * t812;
    const vd t910 = t598 * t891;
    const vd t911 = t909 + t910;
    const vd t912 = t908 - t911;
    PUT(1, 38, t912);
    const vd t914 = t537 * t812;
    const vd t915 = t914 + t910;
    const vd t916 = t571 * t904;
    const vd t917 = t915 + t916;
    PUT(1, 39, t917);
    const vd t919 = t609 * t812;
    const vd t920 = t577 * t891;
    const vd t921 = t919 - t920;
    const vd t922 = t527 * t904;
    const vd t923 = t921 - t922;
    PUT(1, 40, t923);
    const vd t925 = t538 * t904;
    const vd t926 = t617 * t812;
    const vd t927 = t619 * t891;
    const vd t928 = t926 + t927;
    const vd t929 = t925 - t928;
    PUT(1, 41, t929);
    const vd t931 = t626 * t812;
    const vd t932 = t583 * t891;
    const vd t933 = t931 + t932;
    const vd t934 = t629 * t904;
    const vd t935 = t933 + t934;
    PUT(1, 42, t935);
    const vd t945 = -t72;
    PUT(2, 8, t945);
    const vd t947 = -t98;
    PUT(2, 9, t947);
    const vd t949 = -t77;
    PUT(2, 10, t949);
    PUT(2, 11, t79);
    PUT(2, 12, t126);
    const vd t953 = -t143;
    PUT(2, 13, t953);
    PUT(2, 14, t149);
    const vd t956 = t207 * sc[7 * VS];
    const vd t957 = t300 + t956;
    PUT(2, 15, t957);
    const vd t959 = (-0.082500000000000004) * t220;
    const vd t960 = t207 * sc[6 * VS];
    const vd t961 = t959 - t960;
    PUT(2, 16, t961);
    const vd t963 = t241 * sc[7 * VS];
    const vd t964 = t219 * sc[6 * VS];
    const vd t965 = t963 + t964;
    PUT(2, 17, t965);
    const vd t967 = t214 * sc[6 * VS];
    const vd t968 = t967 - t963;
    PUT(2, 18, t968);
    const vd t970 = t220 * sc[7 * VS];
    const vd t971 = t171 * sc[6 * VS];
    const vd t972 = t970 - t971;
    PUT(2, 19, t972);
    const vd t974 = t261 * sc[7 * VS];
    const vd t975 = t182 * sc[6 * VS];
    const vd t976 = t974 + t975;
    PUT(2, 20, t976);
    const vd t978 = t267 * sc[6 * VS];
    const vd t979 = t226 * sc[7 * VS];
    const vd t980 = t978 - t979;
    PUT(2, 21, t980);
    const vd t982 = (-0.082500000000000004) * sc[7 * VS];
    const vd t983 = 0.082500000000000004 + t982;
    const vd t984 = 0.38400000000000001 * sc[6 * VS];
    const vd t985 = t983 - t984;
    const vd t986 = sc[9 * VS] * t985;
    const vd t987 = t314 * t986;
    const vd t988 = t305 * sc[7 * VS];
    const vd t989 = t987 - t988;
    const vd t990 = sc[8 * VS] * t985;
    const vd t991 = t328 * t990;
    const vd t992 = t989 - t991;
    const vd t993 = sc[8 * VS] * sc[6 * VS];
    const vd t994 = t337 * t993;
    const vd t995 = t992 + t994;
    PUT(2, 22, t995);
    const vd t997 = sc[9 * VS] * sc[6 * VS];
    const vd t998 = t337 * t997;
    const vd t999 = t354 * sc[7 * VS];
    const vd t1000 = t358 * t986;
    const vd t1001 = t999 + t1000;
    const vd t1002 = t361 * t990;
    const vd t1003 = t1001 + t1002;
    const vd t1004 = t998 - t1003;
    PUT(2, 23, t1004);
    const vd t1006 = t313 * sc[7 * VS];
    const vd t1007 = t371 * t993;
    const vd t1008 = t1006 - t1007;
    const vd t1009 = t348 * t997;
    const vd t1010 = t1008 + t1009;
    PUT(2, 24, t1010);
    const vd t1012 = t309 * sc[7 * VS];
    const vd t1013 = t1012 + t1007;
    const vd t1014 = t349 * t997;
    const vd t1015 = t1013 - t1014;
    PUT(2, 25, t1015);
    const vd t1017 = t382 * sc[7 * VS];
    const vd t1018 = t350 * t993;
    const vd t1019 = t1017 - t1018;
    const vd t1020 = t289 * t997;
    const vd t1021 = t1019 - t1020;
    PUT(2, 26, t1021);
    const vd t1023 = t389 * sc[7 * VS];
    const vd t1024 = t391 * t993;
    const vd t1025 = t1023 - t1024;
    const vd t1026 = t314 * t997;
    const vd t1027 = t1025 + t1026;
    PUT(2, 27, t1027);
    const vd t1029 = t397 * sc[7 * VS];
    const vd t1030 = t361 * t993;
    const vd t1031 = t1029 - t1030;
    const vd t1032 = t401 * t997;
    const vd t1033 = t1031 + t1032;
    PUT(2, 28, t1033);
    const vd t1035 = t443 * t993;
    const vd t1036 = t430 * t986;
    const vd t1037 = sc[10 * VS] * t990;
    const vd t1038 = t417 * t1037;
    const vd t1039 = t1036 + t1038;
    const vd t1040 = sc[11 * VS] * t990;
    const vd t1041 = t435 * t1040;
    const vd t1042 = t1039 + t1041;
    const vd t1043 = t1035 - t1042;
    const vd t1044 = sc[11 * VS] * sc[7 * VS];
    const vd t1045 = sc[10 * VS] * t997;
    const vd t1046 = t1044 - t1045;
    const vd t1047 = t305 * t1046;
    const vd t1048 = t1043 - t1047;
    PUT(2, 29, t1048);
    const vd t1050 = t463 * t1037;
    const vd t1051 = t460 * t986;
    const vd t1052 = t1050 - t1051;
    const vd t1053 = t452 * t1040;
    const vd t1054 = t1052 + t1053;
    const vd t1055 = t469 * t993;
    const vd t1056 = t1054 - t1055;
    const vd t1057 = sc[10 * VS] * sc[7 * VS];
    const vd t1058 = sc[11 * VS] * t997;
    const vd t1059 = t1057 + t1058;
    const vd t1060 = t305 * t1059;
    const vd t1061 = t1056 + t1060;
    PUT(2, 30, t1061);
    const vd t1063 = t479 * t1046;
    const vd t1064 = t414 * t993;
    const vd t1065 = t1063 - t1064;
    const vd t1066 = t459 * t1059;
    const vd t1067 = t1065 + t1066;
    PUT(2, 31, t1067);
    const vd t1069 = t416 * t993;
    const vd t1070 = t1069 - t1063;
    const vd t1071 = t454 * t1059;
    const vd t1072 = t1070 + t1071;
    PUT(2, 32, t1072);
    const vd t1074 = t491 * t993;
    const vd t1075 = t460 * t1046;
    const vd t1076 = t1074 + t1075;
    const vd t1077 = t430 * t1059;
    const vd t1078 = t1076 - t1077;
    PUT(2, 33, t1078);
    const vd t1080 = t499 * t1046;
    const vd t1081 = t497 * t993;
    const vd t1082 = t1080 - t1081;
    const vd t1083 = t417 * t1059;
    const vd t1084 = t1082 + t1083;
    PUT(2, 34, t1084);
    const vd t1086 = t507 * t993;
    const vd t1087 = t452 * t1046;
    const vd t1088 = t1086 - t1087;
    const vd t1089 = t505 * t1059;
    const vd t1090 = t1088 + t1089;
    PUT(2, 35, t1090);
    const vd t1092 = 0.087999999999999995 * t993;
    const vd t1093 = t1037 - t1092;
    const vd t1094 = t527 * t1093;
    const vd t1095 = sc[12 * VS] * t1040;
    const vd t1096 = 0.087999999999999995 * t1046;
    const vd t1097 = t986 + t1096;
    const vd t1098 = sc[13 * VS] * t1097;
    const vd t1099 = t1095 + t1098;
    const vd t1100 = t538 * t1099;
    const vd t1101 = t1094 - t1100;
    const vd t1102 = sc[13 * VS] * t1040;
    const vd t1103 = sc[12 * VS] * t1097;
    const vd t1104 = t1102 - t1103;
    const vd t1105 = t548 * t1104;
    const vd t1106 = t1101 - t1105;
    const vd t1107 = t560 * t1046;
    const vd t1108 = t1106 - t1107;
    const vd t1109 = sc[13 * VS] * t993;
    const vd t1110 = sc[12 * VS] * t1059;
    const vd t1111 = t1109 - t1110;
    const vd t1112 = t564 * t1111;
    const vd t1113 = t1108 + t1112;
    PUT(2, 36, t1113);
    const vd t1115 = t577 * t1093;
    const vd t1116 = t580 * t1099;
    const vd t1117 = t1115 + t1116;
    const vd t1118 = t583 * t1104;
    const vd t1119 = t1117 + t1118;
    const vd t1120 = t588 * t1046;
    const vd t1121 = t1119 + t1120;
    const vd t1122 = sc[12 * VS] * t993;
    const vd t1123 = sc[13 * VS] * t1059;
    const vd t1124 = t1122 + t1123;
    const vd t1125 = t564 * t1124;
    const vd t1126 = t1121 - t1125;
    PUT(2, 37, t1126);
    const vd t1128 = t535 * t1046;
    const vd t1129 = t598 * t1111;
    const vd t1130 = t1128 + t1129;
    const vd t1131 = t576 * t1124;
    const vd t1132 = t1130 + t1131;
    PUT(2, 38, t1132);
    const vd t1134 = t571 * t1124;
    const vd t1135 = t537 * t1046;
    const vd t1136 = t1135 + t1129;
    const vd t1137 = t1134 - t1136;
    PUT(2, 39, t1137);
    const vd t1139 = t577 * t1111;
    const vd t1140 = t609 * t1046;
    const vd t1141 = t1139 - t1140;
    const vd t1142 = t527 * t1124;
    const vd t1143 = t1141 - t1142;
    PUT(2, 40, t1143);
    const vd t1145 = t617 * t1046;
    const vd t1146 = t619 * t1111;
    const vd t1147 = t1145 + t1146;
    const vd t1148 = t538 * t1124;
    const vd t1149 = t1147 + t1148;
    PUT(2, 41, t1149);
    const vd t1151 = t629 * t1124;
    const vd t1152 = t626 * t1046;
    const vd t1153 = t583 * t1111;
    const vd t1154 = t1152 + t1153;
    const vd t1155 = t1151 - t1154;
    PUT(2, 42, t1155);
    PUT(3, 15, t203);
    const vd t1173 = -t231;
    PUT(3, 16, t1173);
    const vd t1175 = -t179;
    PUT(3, 17, t1175);
    PUT(3, 18, t181);
    PUT(3, 19, t253);
    const vd t1179 = -t259;
    PUT(3, 20, t1179);
    PUT(3, 21, t269);
    const vd t1182 = (-0.082500000000000004) * t289;
    const vd t1183 = 0.38400000000000001 * sc[8 * VS];
    const vd t1184 = t314 * t1183;
    const vd t1185 = t1182 + t1184;
    const vd t1187 = (-0.38400000000000001) * sc[9 * VS];
    const vd t1188 = t328 * t1187;
    const vd t1189 = t1185 - t1188;
    const vd t1190 = t337 * sc[9 * VS];
    const vd t1191 = t1189 + t1190;
    PUT(3, 22, t1191);
    const vd t1193 = (-0.082500000000000004) * t350;
    const vd t1194 = t358 * t1183;
    const vd t1195 = t1193 - t1194;
    const vd t1196 = t361 * t1187;
    const vd t1197 = t1195 - t1196;
    const vd t1198 = t337 * sc[8 * VS];
    const vd t1199 = t1197 - t1198;
    PUT(3, 23, t1199);
    const vd t1201 = t371 * sc[9 * VS];
    const vd t1202 = t348 * sc[8 * VS];
    const vd t1203 = t1201 + t1202;
    const vd t1204 = -t1203;
    PUT(3, 24, t1204);
    const vd t1206 = t349 * sc[8 * VS];
    const vd t1207 = t1201 + t1206;
    PUT(3, 25, t1207);
    const vd t1209 = t289 * sc[8 * VS];
    const vd t1210 = t350 * sc[9 * VS];
    const vd t1211 = t1209 - t1210;
    PUT(3, 26, t1211);
    const vd t1213 = t391 * sc[9 * VS];
    const vd t1214 = t314 * sc[8 * VS];
    const vd t1215 = t1213 + t1214;
    const vd t1216 = -t1215;
    PUT(3, 27, t1216);
    const vd t1218 = t361 * sc[9 * VS];
    const vd t1219 = t401 * sc[8 * VS];
    const vd t1220 = t1218 + t1219;
    const vd t1221 = -t1220;
    PUT(3, 28, t1221);
    const vd t1223 = (-0.082500000000000004) * sc[11 * VS];
    const vd t1224 = sc[10 * VS] * t1187;
    const vd t1225 = t1223 - t1224;
    const vd t1226 = t417 * t1225;
    const vd t1227 = t430 * t1183;
    const vd t1228 = t1226 - t1227;
    const vd t1229 = (-0.082500000000000004) * sc[10 * VS];
    const vd t1230 = sc[11 * VS] * t1187;
    const vd t1231 = t1229 + t1230;
    const vd t1232 = t435 * t1231;
    const vd t1233 = t1228 - t1232;
    const vd t1234 = t443 * sc[9 * VS];
    const vd t1235 = t1233 + t1234;
    const vd t1236 = sc[10 * VS] * sc[8 * VS];
    const vd t1237 = t305 * t1236;
    const vd t1238 = t1235 - t1237;
    PUT(3, 29, t1238);
    const vd t1240 = t452 * t1231;
    const vd t1241 = t460 * t1183;
    const vd t1242 = t463 * t1225;
    const vd t1243 = t1241 + t1242;
    const vd t1244 = t1240 - t1243;
    const vd t1245 = t469 * sc[9 * VS];
    const vd t1246 = t1244 - t1245;
    const vd t1247 = sc[11 * VS] * sc[8 * VS];
    const vd t1248 = t305 * t1247;
    const vd t1249 = t1246 - t1248;
    PUT(3, 30, t1249);
    const vd t1251 = t479 * t1236;
    const vd t1252 = t414 * sc[9 * VS];
    const vd t1253 = t1251 - t1252;
    const vd t1254 = t459 * t1247;
    const vd t1255 = t1253 - t1254;
    PUT(3, 31, t1255);
    const vd t1257 = t416 * sc[9 * VS];
    const vd t1258 = t1257 - t1251;
    const vd t1259 = t454 * t1247;
    const vd t1260 = t1258 - t1259;
    PUT(3, 32, t1260);
    const vd t1262 = t491 * sc[9 * VS];
    const vd t1263 = t460 * t1236;
    const vd t1264 = t1262 + t1263;
    const vd t1265 = t430 * t1247;
    const vd t1266 = t1264 + t1265;
    PUT(3, 33, t1266);
    const vd t1268 = t499 * t1236;
    const vd t1269 = t497 * sc[9 * VS];
    const vd t1270 = t1268 - t1269;
    const vd t1271 = t417 * t1247;
    const vd t1272 = t1270 - t1271;
    PUT(3, 34, t1272);
    const vd t1274 = t507 * sc[9 * VS];
    const vd t1275 = t452 * t1236;
    const vd t1276 = t1274 - t1275;
    const vd t1277 = t505 * t1247;
    const vd t1278 = t1276 - t1277;
    PUT(3, 35, t1278);
    const vd t1280 = sc[13 * VS] * sc[9 * VS];
    const vd t1281 = sc[12 * VS] * t1247;
    const vd t1282 = t1280 + t1281;
    const vd t1283 = t564 * t1282;
    const vd t1284 = 0.087999999999999995 * sc[9 * VS];
    const vd t1285 = t1225 + t1284;
    const vd t1286 = t527 * t1285;
    const vd t1287 = sc[12 * VS] * t1231;
    const vd t1288 = 0.087999999999999995 * t1236;
    const vd t1289 = t1183 + t1288;
    const vd t1290 = sc[13 * VS] * t1289;
    const vd t1291 = t1287 + t1290;
    const vd t1292 = t538 * t1291;
    const vd t1293 = t1286 + t1292;
    const vd t1294 = sc[13 * VS] * t1231;
    const vd t1295 = sc[12 * VS] * t1289;
    const vd t1296 = t1294 - t1295;
    const vd t1297 = t548 * t1296;
    const vd t1298 = t1293 + t1297;
    const vd t1299 = t560 * t1236;
    const vd t1300 = t1298 + t1299;
    const vd t1301 = t1283 - t1300;
    PUT(3, 36, t1301);
    const vd t1303 = t580 * t1291;
    const vd t1304 = t577 * t1285;
    const vd t1305 = t1303 - t1304;
    const vd t1306 = t583 * t1296;
    const vd t1307 = t1305 + t1306;
    const vd t1308 = t588 * t1236;
    const vd t1309 = t1307 + t1308;
    const vd t1310 = sc[12 * VS] * sc[9 * VS];
    const vd t1311 = sc[13 * VS] * t1247;
    const vd t1312 = t1310 - t1311;
    const vd t1313 = t564 * t1312;
    const vd t1314 = t1309 - t1313;
    PUT(3, 37, t1314);
    const vd t1316 = t535 * t1236;
    const vd t1317 = t598 * t1282;
    const vd t1318 = t1316 + t1317;
    const vd t1319 = t576 * t1312;
    const vd t1320 = t1318 + t1319;
    PUT(3, 38, t1320);
    const vd t1322 = t571 * t1312;
    const vd t1323 = t537 * t1236;
    const vd t1324 = t1323 + t1317;
    const vd t1325 = t1322 - t1324;
    PUT(3, 39, t1325);
    const vd t1327 = t577 * t1282;
    const vd t1328 = t609 * t1236;
    const vd t1329 = t1327 - t1328;
    const vd t1330 = t527 * t1312;
    const vd t1331 = t1329 - t1330;
    PUT(3, 40, t1331);
    const vd t1333 = t617 * t1236;
    const vd t1334 = t619 * t1282;
    const vd t1335 = t1333 + t1334;
    const vd t1336 = t538 * t1312;
    const vd t1337 = t1335 + t1336;
    PUT(3, 41, t1337);
    const vd t1339 = t629 * t1312;
    const vd t1340 = t626 * t1236;
    const vd t1341 = t583 * t1282;
    const vd t1342 = t1340 + t1341;
    const vd t1343 = t1339 - t1342;
    PUT(3, 42, t1343);
    const vd t1367 = -t305;
    PUT(4, 22, t1367);
    const vd t1369 = -t354;
    PUT(4, 23, t1369);
    PUT(4, 24, t313);
    PUT(4, 25, t309);
    PUT(4, 26, t382);
    PUT(4, 27, t389);
    PUT(4, 28, t397);
    const vd t1376 = t305 * sc[11 * VS];
    const vd t1377 = -t1376;
    PUT(4, 29, t1377);
    const vd t1379 = t305 * sc[10 * VS];
    PUT(4, 30, t1379);
    const vd t1381 = t479 * sc[11 * VS];
    const vd t1382 = t459 * sc[10 * VS];
    const vd t1383 = t1381 + t1382;
    PUT(4, 31, t1383);
    const vd t1385 = t454 * sc[10 * VS];
    const vd t1386 = t1385 - t1381;
    PUT(4, 32, t1386);
    const vd t1388 = t460 * sc[11 * VS];
    const vd t1389 = t430 * sc[10 * VS];
    const vd t1390 = t1388 - t1389;
    PUT(4, 33, t1390);
    const vd t1392 = t499 * sc[11 * VS];
    const vd t1393 = t417 * sc[10 * VS];
    const vd t1394 = t1392 + t1393;
    PUT(4, 34, t1394);
    const vd t1396 = t505 * sc[10 * VS];
    const vd t1397 = t452 * sc[11 * VS];
    const vd t1398 = t1396 - t1397;
    PUT(4, 35, t1398);
    const vd t1400 = 0.087999999999999995 * sc[11 * VS];
    const vd t1401 = sc[12 * VS] * t1400;
    const vd t1402 = t548 * t1401;
    const vd t1403 = sc[13 * VS] * t1400;
    const vd t1404 = t538 * t1403;
    const vd t1405 = t1402 - t1404;
    const vd t1406 = t560 * sc[11 * VS];
    const vd t1407 = t1405 - t1406;
    const vd t1408 = sc[12 * VS] * sc[10 * VS];
    const vd t1409 = t564 * t1408;
    const vd t1410 = t1407 - t1409;
    PUT(4, 36, t1410);
    const vd t1412 = t580 * t1403;
    const vd t1413 = t583 * t1401;
    const vd t1414 = t1412 - t1413;
    const vd t1415 = t588 * sc[11 * VS];
    const vd t1416 = t1414 + t1415;
    const vd t1417 = sc[13 * VS] * sc[10 * VS];
    const vd t1418 = t564 * t1417;
    const vd t1419 = t1416 - t1418;
    PUT(4, 37, t1419);
    const vd t1421 = t535 * sc[11 * VS];
    const vd t1422 = t598 * t1408;
    const vd t1423 = t1421 - t1422;
    const vd t1424 = t576 * t1417;
    const vd t1425 = t1423 + t1424;
    PUT(4, 38, t1425);
    const vd t1427 = t537 * sc[11 * VS];
    const vd t1428 = t1422 - t1427;
    const vd t1429 = t571 * t1417;
    const vd t1430 = t1428 + t1429;
    PUT(4, 39, t1430);
    const vd t1432 = t609 * sc[11 * VS];
    const vd t1433 = t577 * t1408;
    const vd t1434 = t1432 + t1433;
    const vd t1435 = t527 * t1417;
    const vd t1436 = t1434 + t1435;
    const vd t1437 = -t1436;
    PUT(4, 40, t1437);
    const vd t1439 = t617 * sc[11 * VS];
    const vd t1440 = t619 * t1408;
    const vd t1441 = t1439 - t1440;
    const vd t1442 = t538 * t1417;
    const vd t1443 = t1441 + t1442;
    PUT(4, 41, t1443);
    const vd t1445 = t583 * t1408;
    const vd t1446 = t626 * sc[11 * VS];
    const vd t1447 = t1445 - t1446;
    const vd t1448 = t629 * t1417;
    const vd t1449 = t1447 + t1448;
    PUT(4, 42, t1449);
    PUT(5, 29, t443);
    const vd t1481 = -t469;
    PUT(5, 30, t1481);
    const vd t1483 = -t414;
    PUT(5, 31, t1483);
    PUT(5, 32, t416);
    PUT(5, 33, t491);
    const vd t1487 = -t497;
    PUT(5, 34, t1487);
    PUT(5, 35, t507);
    const vd t1491 = (-0.087999999999999995) * t527;
    const vd t1492 = t564 * sc[13 * VS];
    const vd t1493 = t1491 + t1492;
    PUT(5, 36, t1493);
    const vd t1495 = (-0.087999999999999995) * t577;
    const vd t1496 = t564 * sc[12 * VS];
    const vd t1497 = t1495 - t1496;
    PUT(5, 37, t1497);
    const vd t1499 = t598 * sc[13 * VS];
    const vd t1500 = t576 * sc[12 * VS];
    const vd t1501 = t1499 + t1500;
    PUT(5, 38, t1501);
    const vd t1503 = t571 * sc[12 * VS];
    const vd t1504 = t1503 - t1499;
    PUT(5, 39, t1504);
    const vd t1506 = t577 * sc[13 * VS];
    const vd t1507 = t527 * sc[12 * VS];
    const vd t1508 = t1506 - t1507;
    PUT(5, 40, t1508);
    const vd t1510 = t619 * sc[13 * VS];
    const vd t1511 = t538 * sc[12 * VS];
    const vd t1512 = t1510 + t1511;
    PUT(5, 41, t1512);
    const vd t1514 = t629 * sc[12 * VS];
    const vd t1515 = t583 * sc[13 * VS];
    const vd t1516 = t1514 - t1515;
    PUT(5, 42, t1516);
    PUT(6, 36, t560);
    const vd t1555 = -t588;
    PUT(6, 37, t1555);
    const vd t1557 = -t535;
    PUT(6, 38, t1557);
    PUT(6, 39, t537);
    PUT(6, 40, t609);
    const vd t1561 = -t617;
    PUT(6, 41, t1561);
    PUT(6, 42, t626);

}
#undef PUT

/* Row x number t of a window in time is turned into its difference from the mean of those before,
 * (t x - sum) / sqrt(t (t + 1)), and added to their sum. With the mean of all rows that is a product
 * with an orthogonal matrix. What changes slowly is small in the differences, and with it the rounding
 * of their products. `far` is the scale times t / sqrt(t (t + 1)), `near` is 1 / sqrt(t (t + 1)). */
INLINE vd difference(vd x, vd *sum, vd scale, vd far, vd near)
{
    const vd before = *sum;
    *sum = before + scale * x;
    return far * x - near * before;
}

/* The same rows as differences. */
#define PUT(joint, column, value) \
    to[(joint) * DEPTH + (column) * HEIGHT] = difference(value, sums + (column) * N + (joint), scale[joint], far[joint], near)
static APART void place_differences(const vu *restrict sc, const vu *restrict q, const vu *restrict dq, const vu *restrict ddq, const vd *restrict scale, const vd *restrict far, const vd near, vd *restrict sums, vd *restrict to)
{
    (void)q;
    PUT(0, 0, ddq[0 * VS]);
    const vd t9 = sc[2 * VS] * dq[0 * VS];
    const vd t10 = dq[1 * VS] * t9;
    const vd t12 = t10 * sc[3 * VS];
    const vd t13 = sc[2 * VS] * ddq[0 * VS];
    const vd t14 = sc[3 * VS] * dq[0 * VS];
    const vd t15 = t14 * dq[1 * VS];
    const vd t16 = t13 + t15;
    const vd t17 = t16 * sc[2 * VS];
    const vd t18 = t12 + t17;
    PUT(0, 3, t18);
    const vd t20 = t15 * sc[2 * VS];
    const vd t21 = t20 - t12;
    PUT(0, 4, t21);
    const vd t23 = t15 + t16;
    const vd t24 = t23 * sc[3 * VS];
    const vd t25 = t9 * dq[1 * VS];
    const vd t26 = sc[3 * VS] * ddq[0 * VS];
    const vd t27 = t25 - t26;
    const vd t28 = t25 + t27;
    const vd t29 = t28 * sc[2 * VS];
    const vd t30 = t24 - t29;
    PUT(0, 5, t30);
    const vd t32 = dq[1 * VS] * dq[1 * VS];
    const vd t33 = t9 * t9;
    const vd t34 = t32 - t33;
    const vd t35 = t34 * sc[3 * VS];
    const vd t36 = t9 * t14;
    const vd t38 = t36 + ddq[1 * VS];
    const vd t39 = t38 * sc[2 * VS];
    const vd t40 = t35 + t39;
    const vd t41 = -t40;
    PUT(0, 6, t41);
    const vd t43 = t36 - ddq[1 * VS];
    const vd t44 = t43 * sc[3 * VS];
    const vd t45 = t14 * t14;
    const vd t46 = t45 - t32;
    const vd t47 = t46 * sc[2 * VS];
    const vd t48 = t44 - t47;
    PUT(0, 7, t48);
    const vd t52 = sc[4 * VS] * t9;
    const vd t54 = sc[5 * VS] * dq[1 * VS];
    const vd t55 = t52 + t54;
    const vd t56 = t55 * t55;
    const vd t58 = t14 + dq[2 * VS];
    const vd t59 = t58 * t58;
    const vd t60 = t56 + t59;
    const vd t62 = (-0.316) * sc[2 * VS];
    const vd t63 = sc[4 * VS] * t62;
    const vd t64 = t60 * t63;
    const vd t65 = (-0.316) * t43;
    const vd t67 = 9.8100000000000005 * sc[2 * VS];
    const vd t68 = t65 - t67;
    const vd t69 = sc[4 * VS] * t68;
    const vd t70 = (-0.316) * t23;
    const vd t71 = sc[5 * VS] * t70;
    const vd t72 = t69 + t71;
    const vd t73 = t72 * sc[3 * VS];
    const vd t74 = sc[4 * VS] * dq[1 * VS];
    const vd t75 = sc[5 * VS] * t9;
    const vd t76 = t74 - t75;
    const vd t77 = t76 * t55;
    const vd t79 = ddq[2 * VS] - t27;
    const vd t80 = t77 + t79;
    const vd t81 = sc[5 * VS] * t62;
    const vd t82 = t80 * t81;
    const vd t83 = t73 + t82;
    const vd t84 = t64 - t83;
    const vd t85 = 9.8100000000000005 * sc[3 * VS];
    const vd t86 = t33 + t32;
    const vd t87 = (-0.316) * t86;
    const vd t88 = t85 + t87;
    const vd t89 = sc[4 * VS] * sc[2 * VS];
    const vd t90 = t88 * t89;
    const vd t91 = t84 - t90;
    PUT(0, 8, t91);
    const vd t93 = t76 * t76;
    const vd t94 = t93 + t59;
    const vd t95 = t94 * t81;
    const vd t96 = sc[5 * VS] * t68;
    const vd t97 = sc[4 * VS] * t70;
    const vd t98 = t96 - t97;
    const vd t99 = t98 * sc[3 * VS];
    const vd t100 = t95 - t99;
    const vd t101 = t77 - t79;
    const vd t102 = t101 * t63;
    const vd t103 = t100 - t102;
    const vd t104 = sc[5 * VS] * sc[2 * VS];
    const vd t105 = t88 * t104;
    const vd t106 = t103 - t105;
    PUT(0, 9, t106);
    const vd t108 = t58 * t76;
    const vd t109 = t108 * t89;
    const vd t110 = t77 * sc[3 * VS];
    const vd t111 = t109 - t110;
    const vd t112 = sc[4 * VS] * ddq[1 * VS];
    const vd t113 = sc[5 * VS] * t16;
    const vd t114 = t112 - t113;
    const vd t115 = t55 * dq[2 * VS];
    const vd t116 = t114 + t115;
    const vd t117 = t116 * t104;
    const vd t118 = t111 - t117;
    PUT(0, 10, t118);
    const vd t120 = t79 * sc[3 * VS];
    const vd t121 = t120 - t109;
    const vd t122 = t55 * t58;
    const vd t123 = t122 * t104;
    const vd t124 = t121 - t123;
    PUT(0, 11, t124);
    const vd t126 = t93 - t56;
    const vd t127 = t126 * sc[3 * VS];
    const vd t128 = t122 + t116;
    const vd t129 = t128 * t89;
    const vd t130 = t127 + t129;
    const vd t131 = t76 * t58;
    const vd t132 = sc[4 * VS] * t16;
    const vd t133 = sc[5 * VS] * ddq[1 * VS];
    const vd t134 = t132 + t133;
    const vd t135 = t76 * dq[2 * VS];
    const vd t136 = t134 - t135;
    const vd t137 = t131 - t136;
    const vd t138 = t137 * t104;
    const vd t139 = t130 + t138;
    PUT(0, 12, t139);
    const vd t141 = t59 - t93;
    const vd t142 = t141 * t89;
    const vd t143 = t122 - t116;
    const vd t144 = t143 * sc[3 * VS];
    const vd t145 = t142 - t144;
    const vd t146 = t80 * t104;
    const vd t147 = t145 - t146;
    PUT(0, 13, t147);
    const vd t149 = t131 + t136;
    const vd t150 = t149 * sc[3 * VS];
    const vd t151 = t101 * t89;
    const vd t152 = t150 - t151;
    const vd t153 = t56 - t59;
    const vd t154 = t153 * t104;
    const vd t155 = t152 - t154;
    PUT(0, 14, t155);
    const vd t159 = sc[7 * VS] * t76;
    const vd t161 = sc[6 * VS] * t58;
    const vd t162 = t159 + t161;
    const vd t164 = dq[3 * VS] - t55;
    const vd t165 = t162 * t164;
    const vd t166 = sc[7 * VS] * t79;
    const vd t167 = sc[6 * VS] * t116;
    const vd t168 = t166 - t167;
    const vd t169 = t162 * dq[3 * VS];
    const vd t170 = t168 - t169;
    const vd t171 = t165 - t170;
    const vd t173 = 0.082500000000000004 * sc[3 * VS];
    const vd t174 = t81 - t173;
    const vd t175 = t171 * t174;
    const vd t176 = sc[7 * VS] * t58;
    const vd t177 = sc[6 * VS] * t76;
    const vd t178 = t176 - t177;
    const vd t179 = t162 * t178;
    const vd t181 = ddq[3 * VS] - t136;
    const vd t182 = t179 + t181;
    const vd t183 = sc[6 * VS] * t63;
    const vd t184 = 0.082500000000000004 * t89;
    const vd t185 = sc[7 * VS] * t184;
    const vd t186 = t183 - t185;
    const vd t187 = t182 * t186;
    const vd t188 = t175 + t187;
    const vd t189 = t178 * t178;
    const vd t190 = t164 * t164;
    const vd t191 = t189 + t190;
    const vd t192 = sc[7 * VS] * t63;
    const vd t193 = sc[6 * VS] * t184;
    const vd t194 = t192 + t193;
    const vd t195 = t191 * t194;
    const vd t196 = t188 + t195;
    const vd t197 = 0.082500000000000004 * t137;
    const vd t198 = t88 + t197;
    const vd t199 = sc[7 * VS] * t198;
    const vd t200 = 0.082500000000000004 * t60;
    const vd t201 = t98 - t200;
    const vd t202 = sc[6 * VS] * t201;
    const vd t203 = t199 - t202;
    const vd t204 = t203 * t89;
    const vd t205 = t196 - t204;
    const vd t206 = 0.082500000000000004 * t80;
    const vd t207 = t206 - t72;
    const vd t208 = sc[7 * VS] * sc[3 * VS];
    const vd t209 = sc[6 * VS] * t104;
    const vd t210 = t208 + t209;
    const vd t211 = t207 * t210;
    const vd t212 = t205 + t211;
    PUT(0, 15, t212);
    const vd t214 = t178 * t164;
    const vd t215 = sc[7 * VS] * t116;
    const vd t216 = sc[6 * VS] * t79;
    const vd t217 = t215 + t216;
    const vd t218 = t178 * dq[3 * VS];
    const vd t219 = t217 + t218;
    const vd t220 = t214 + t219;
    const vd t221 = t220 * t174;
    const vd t222 = t162 * t162;
    const vd t223 = t222 + t190;
    const vd t224 = t223 * t186;
    const vd t225 = t221 - t224;
    const vd t226 = t179 - t181;
    const vd t227 = t226 * t194;
    const vd t228 = t225 - t227;
    const vd t229 = sc[7 * VS] * t201;
    const vd t230 = sc[6 * VS] * t198;
    const vd t231 = t229 + t230;
    const vd t232 = t231 * t89;
    const vd t233 = t228 + t232;
    const vd t234 = sc[6 * VS] * sc[3 * VS];
    const vd t235 = sc[7 * VS] * t104;
    const vd t236 = t234 - t235;
    const vd t237 = t207 * t236;
    const vd t238 = t233 - t237;
    PUT(0, 16, t238);
    const vd t240 = t179 * t89;
    const vd t241 = t164 * t162;
    const vd t242 = t241 * t210;
    const vd t243 = t240 + t242;
    const vd t244 = t219 * t236;
    const vd t245 = t243 + t244;
    PUT(0, 17, t245);
    const vd t247 = t214 * t236;
    const vd t248 = t181 * t89;
    const vd t249 = t248 + t242;
    const vd t250 = t247 - t249;
    PUT(0, 18, t250);
    const vd t252 = t220 * t210;
    const vd t253 = t222 - t189;
    const vd t254 = t253 * t89;
    const vd t255 = t252 - t254;
    const vd t256 = t171 * t236;
    const vd t257 = t255 - t256;
    PUT(0, 19, t257);
    const vd t259 = t214 - t219;
    const vd t260 = t259 * t89;
    const vd t261 = t190 - t222;
    const vd t262 = t261 * t210;
    const vd t263 = t260 + t262;
    const vd t264 = t182 * t236;
    const vd t265 = t263 + t264;
    PUT(0, 20, t265);
    const vd t267 = t189 - t190;
    const vd t268 = t267 * t236;
    const vd t269 = t165 + t170;
    const vd t270 = t269 * t89;
    const vd t271 = t226 * t210;
    const vd t272 = t270 + t271;
    const vd t273 = t268 - t272;
    PUT(0, 21, t273);
    const vd t277 = sc[9 * VS] * t162;
    const vd t279 = sc[8 * VS] * t164;
    const vd t280 = t277 - t279;
    const vd t282 = t178 + dq[4 * VS];
    const vd t283 = t280 * t282;
    const vd t284 = sc[8 * VS] * t219;
    const vd t285 = sc[9 * VS] * t181;
    const vd t286 = t284 + t285;
    const vd t287 = t280 * dq[4 * VS];
    const vd t288 = t286 + t287;
    const vd t289 = t283 + t288;
    const vd t291 = (-0.082500000000000004) * t89;
    const vd t292 = t186 - t291;
    const vd t293 = t289 * t292;
    const vd t295 = 0.38400000000000001 * t226;
    const vd t296 = (-0.082500000000000004) * t191;
    const vd t297 = t295 - t296;
    const vd t298 = t231 + t297;
    const vd t299 = sc[8 * VS] * t298;
    const vd t300 = (-0.082500000000000004) * t171;
    const vd t301 = 0.38400000000000001 * t220;
    const vd t302 = t300 + t301;
    const vd t303 = t302 - t207;
    const vd t304 = sc[9 * VS] * t303;
    const vd t305 = t299 + t304;
    const vd t306 = t305 * t210;
    const vd t307 = t293 - t306;
    const vd t309 = t170 + ddq[4 * VS];
    const vd t310 = sc[8 * VS] * t162;
    const vd t311 = sc[9 * VS] * t164;
    const vd t312 = t310 + t311;
    const vd t313 = t280 * t312;
    const vd t314 = t309 - t313;
    const vd t315 = (-0.082500000000000004) * t210;
    const vd t316 = t315 - t174;
    const vd t317 = 0.38400000000000001 * t236;
    const vd t318 = t316 - t317;
    const vd t319 = sc[9 * VS] * t318;
    const vd t320 = 0.38400000000000001 * t89;
    const vd t321 = t320 - t194;
    const vd t322 = sc[8 * VS] * t321;
    const vd t323 = t319 - t322;
    const vd t324 = t314 * t323;
    const vd t325 = t307 + t324;
    const vd t326 = t312 * t312;
    const vd t327 = t282 * t282;
    const vd t328 = t326 + t327;
    const vd t329 = sc[9 * VS] * t321;
    const vd t330 = sc[8 * VS] * t318;
    const vd t331 = t329 + t330;
    const vd t332 = t328 * t331;
    const vd t333 = t325 - t332;
    const vd t334 = (-0.082500000000000004) * t182;
    const vd t335 = 0.38400000000000001 * t223;
    const vd t336 = t334 - t335;
    const vd t337 = t203 + t336;
    const vd t338 = sc[9 * VS] * t89;
    const vd t339 = sc[8 * VS] * t236;
    const vd t340 = t338 - t339;
    const vd t341 = t337 * t340;
    const vd t342 = t333 - t341;
    PUT(0, 22, t342);
    const vd t344 = sc[9 * VS] * t219;
    const vd t345 = sc[8 * VS] * t181;
    const vd t346 = t344 - t345;
    const vd t347 = t312 * dq[4 * VS];
    const vd t348 = t346 - t347;
    const vd t349 = t312 * t282;
    const vd t350 = t348 - t349;
    const vd t351 = t350 * t292;
    const vd t352 = sc[9 * VS] * t298;
    const vd t353 = sc[8 * VS] * t303;
    const vd t354 = t352 - t353;
    const vd t355 = t354 * t210;
    const vd t356 = t351 - t355;
    const vd t357 = t280 * t280;
    const vd t358 = t357 + t327;
    const vd t359 = t358 * t323;
    const vd t360 = t356 - t359;
    const vd t361 = t313 + t309;
    const vd t362 = t361 * t331;
    const vd t363 = t360 - t362;
    const vd t364 = sc[8 * VS] * t89;
    const vd t365 = sc[9 * VS] * t236;
    const vd t366 = t364 + t365;
    const vd t367 = t337 * t366;
    const vd t368 = t363 + t367;
    PUT(0, 23, t368);
    const vd t370 = t313 * t210;
    const vd t371 = t282 * t280;
    const vd t372 = t371 * t340;
    const vd t373 = t370 + t372;
    const vd t374 = t348 * t366;
    const vd t375 = t373 + t374;
    PUT(0, 24, t375);
    const vd t377 = t309 * t210;
    const vd t378 = t377 - t372;
    const vd t379 = t349 * t366;
    const vd t380 = t378 - t379;
    PUT(0, 25, t380);
    const vd t382 = t357 - t326;
    const vd t383 = t382 * t210;
    const vd t384 = t350 * t340;
    const vd t385 = t383 + t384;
    const vd t386 = t289 * t366;
    const vd t387 = t385 - t386;
    PUT(0, 26, t387);
    const vd t389 = t349 + t348;
    const vd t390 = t389 * t210;
    const vd t391 = t327 - t357;
    const vd t392 = t391 * t340;
    const vd t393 = t390 + t392;
    const vd t394 = t314 * t366;
    const vd t395 = t393 + t394;
    PUT(0, 27, t395);
    const vd t397 = t283 - t288;
    const vd t398 = t397 * t210;
    const vd t399 = t361 * t340;
    const vd t400 = t398 + t399;
    const vd t401 = t326 - t327;
    const vd t402 = t401 * t366;
    const vd t403 = t400 + t402;
    PUT(0, 28, t403);
    const vd t407 = sc[11 * VS] * t280;
    const vd t409 = sc[10 * VS] * t282;
    const vd t410 = t407 + t409;
    const vd t411 = sc[11 * VS] * t282;
    const vd t412 = sc[10 * VS] * t280;
    const vd t413 = t411 - t412;
    const vd t414 = t410 * t413;
    const vd t416 = t288 + ddq[5 * VS];
    const vd t417 = t414 + t416;
    const vd t418 = sc[11 * VS] * t292;
    const vd t419 = sc[10 * VS] * t331;
    const vd t420 = t418 - t419;
    const vd t421 = t417 * t420;
    const vd t423 = t312 + dq[5 * VS];
    const vd t424 = t410 * t423;
    const vd t425 = sc[11 * VS] * t309;
    const vd t426 = sc[10 * VS] * t348;
    const vd t427 = t425 - t426;
    const vd t428 = t410 * dq[5 * VS];
    const vd t429 = t427 - t428;
    const vd t430 = t424 - t429;
    const vd t431 = t430 * t323;
    const vd t432 = t421 - t431;
    const vd t433 = t413 * t413;
    const vd t434 = t423 * t423;
    const vd t435 = t433 + t434;
    const vd t436 = sc[10 * VS] * t292;
    const vd t437 = sc[11 * VS] * t331;
    const vd t438 = t436 + t437;
    const vd t439 = t435 * t438;
    const vd t440 = t432 - t439;
    const vd t441 = sc[11 * VS] * t337;
    const vd t442 = sc[10 * VS] * t354;
    const vd t443 = t441 - t442;
    const vd t444 = t443 * t340;
    const vd t445 = t440 - t444;
    const vd t446 = sc[11 * VS] * t210;
    const vd t447 = sc[10 * VS] * t366;
    const vd t448 = t446 - t447;
    const vd t449 = t305 * t448;
    const vd t450 = t445 - t449;
    PUT(0, 29, t450);
    const vd t452 = t414 - t416;
    const vd t453 = t452 * t438;
    const vd t454 = t413 * t423;
    const vd t455 = sc[11 * VS] * t348;
    const vd t456 = sc[10 * VS] * t309;
    const vd t457 = t455 + t456;
    const vd t458 = t413 * dq[5 * VS];
    const vd t459 = t457 + t458;
    const vd t460 = t454 + t459;
    const vd t461 = t460 * t323;
    const vd t462 = t410 * t410;
    const vd t463 = t462 + t434;
    const vd t464 = t463 * t420;
    const vd t465 = t461 + t464;
    const vd t466 = t453 - t465;
    const vd t467 = sc[11 * VS] * t354;
    const vd t468 = sc[10 * VS] * t337;
    const vd t469 = t467 + t468;
    const vd t470 = t469 * t340;
    const vd t471 = t466 + t470;
    const vd t472 = sc[10 * VS] * t210;
    const vd t473 = sc[11 * VS] * t366;
    const vd t474 = t472 + t473;
    const vd t475 = t305 * t474;
    const vd t476 = t471 + t475;
    PUT(0, 30, t476);
    const vd t478 = t414 * t340;
    const vd t479 = t423 * t410;
    const vd t480 = t479 * t448;
    const vd t481 = t478 + t480;
    const vd t482 = t459 * t474;
    const vd t483 = t481 + t482;
    PUT(0, 31, t483);
    const vd t485 = t454 * t474;
    const vd t486 = t416 * t340;
    const vd t487 = t486 + t480;
    const vd t488 = t485 - t487;
    PUT(0, 32, t488);
    const vd t490 = t460 * t448;
    const vd t491 = t462 - t433;
    const vd t492 = t491 * t340;
    const vd t493 = t490 - t492;
    const vd t494 = t430 * t474;
    const vd t495 = t493 - t494;
    PUT(0, 33, t495);
    const vd t497 = t454 - t459;
    const vd t498 = t497 * t340;
    const vd t499 = t434 - t462;
    const vd t500 = t499 * t448;
    const vd t501 = t498 + t500;
    const vd t502 = t417 * t474;
    const vd t503 = t501 + t502;
    PUT(0, 34, t503);
    const vd t505 = t433 - t434;
    const vd t506 = t505 * t474;
    const vd t507 = t424 + t429;
    const vd t508 = t507 * t340;
    const vd t509 = t452 * t448;
    const vd t510 = t508 + t509;
    const vd t511 = t506 - t510;
    PUT(0, 35, t511);
    const vd t515 = sc[13 * VS] * t410;
    const vd t517 = sc[12 * VS] * t423;
    const vd t518 = t515 + t517;
    const vd t520 = dq[6 * VS] - t413;
    const vd t521 = t518 * t520;
    const vd t522 = sc[13 * VS] * t416;
    const vd t523 = sc[12 * VS] * t459;
    const vd t524 = t522 - t523;
    const vd t525 = t518 * dq[6 * VS];
    const vd t526 = t524 - t525;
    const vd t527 = t521 - t526;
    const vd t529 = 0.087999999999999995 * t340;
    const vd t530 = t529 - t420;
    const vd t531 = t527 * t530;
    const vd t532 = sc[13 * VS] * t423;
    const vd t533 = sc[12 * VS] * t410;
    const vd t534 = t532 - t533;
    const vd t535 = t518 * t534;
    const vd t537 = ddq[6 * VS] - t429;
    const vd t538 = t535 + t537;
    const vd t539 = sc[12 * VS] * t438;
    const vd t540 = 0.087999999999999995 * t448;
    const vd t541 = t323 + t540;
    const vd t542 = sc[13 * VS] * t541;
    const vd t543 = t539 + t542;
    const vd t544 = t538 * t543;
    const vd t545 = t531 - t544;
    const vd t546 = t534 * t534;
    const vd t547 = t520 * t520;
    const vd t548 = t546 + t547;
    const vd t549 = sc[13 * VS] * t438;
    const vd t550 = sc[12 * VS] * t541;
    const vd t551 = t549 - t550;
    const vd t552 = t548 * t551;
    const vd t553 = t545 - t552;
    const vd t554 = 0.087999999999999995 * t430;
    const vd t555 = t305 + t554;
    const vd t556 = sc[13 * VS] * t555;
    const vd t557 = 0.087999999999999995 * t435;
    const vd t558 = t469 - t557;
    const vd t559 = sc[12 * VS] * t558;
    const vd t560 = t556 - t559;
    const vd t561 = t560 * t448;
    const vd t562 = t553 - t561;
    const vd t563 = 0.087999999999999995 * t417;
    const vd t564 = t443 + t563;
    const vd t565 = sc[13 * VS] * t340;
    const vd t566 = sc[12 * VS] * t474;
    const vd t567 = t565 + t566;
    const vd t568 = t564 * t567;
    const vd t569 = t562 - t568;
    PUT(0, 36, t569);
    const vd t571 = t534 * t520;
    const vd t572 = sc[13 * VS] * t459;
    const vd t573 = sc[12 * VS] * t416;
    const vd t574 = t572 + t573;
    const vd t575 = t534 * dq[6 * VS];
    const vd t576 = t574 + t575;
    const vd t577 = t571 + t576;
    const vd t578 = t577 * t530;
    const vd t579 = t518 * t518;
    const vd t580 = t579 + t547;
    const vd t581 = t580 * t543;
    const vd t582 = t578 + t581;
    const vd t583 = t535 - t537;
    const vd t584 = t583 * t551;
    const vd t585 = t582 + t584;
    const vd t586 = sc[13 * VS] * t558;
    const vd t587 = sc[12 * VS] * t555;
    const vd t588 = t586 + t587;
    const vd t589 = t588 * t448;
    const vd t590 = t585 + t589;
    const vd t591 = sc[13 * VS] * t474;
    const vd t592 = sc[12 * VS] * t340;
    const vd t593 = t591 - t592;
    const vd t594 = t564 * t593;
    const vd t595 = t590 - t594;
    PUT(0, 37, t595);
    const vd t597 = t535 * t448;
    const vd t598 = t520 * t518;
    const vd t599 = t598 * t567;
    const vd t600 = t597 - t599;
    const vd t601 = t576 * t593;
    const vd t602 = t600 + t601;
    PUT(0, 38, t602);
    const vd t604 = t537 * t448;
    const vd t605 = t599 - t604;
    const vd t606 = t571 * t593;
    const vd t607 = t605 + t606;
    PUT(0, 39, t607);
    const vd t609 = t579 - t546;
    const vd t610 = t609 * t448;
    const vd t611 = t577 * t567;
    const vd t612 = t610 + t611;
    const vd t613 = t527 * t593;
    const vd t614 = t612 + t613;
    const vd t615 = -t614;
    PUT(0, 40, t615);
    const vd t617 = t571 - t576;
    const vd t618 = t617 * t448;
    const vd t619 = t547 - t579;
    const vd t620 = t619 * t567;
    const vd t621 = t618 - t620;
    const vd t622 = t538 * t593;
    const vd t623 = t621 + t622;
    PUT(0, 41, t623);
    const vd t625 = t583 * t567;
    const vd t626 = t521 + t526;
    const vd t627 = t626 * t448;
    const vd t628 = t625 - t627;
    const vd t629 = t546 - t547;
    const vd t630 = t629 * t593;
    const vd t631 = t628 + t630;
    PUT(0, 42, t631);
    const vd t634 = -t85;
    PUT(1, 1, t634);
    PUT(1, 2, t67);
    const vd t637 = -t36;
    PUT(1, 3, t637);
    PUT(1, 4, ddq[1 * VS]);
    const vd t640 = t33 - t45;
    PUT(1, 5, t640);
    const vd t642 = -t13;
    PUT(1, 6, t642);
    const vd t644 = t27 - t25;
    PUT(1, 7, t644);
    const vd t646 = (-0.316) * sc[4 * VS];
    const vd t647 = t80 * t646;
    const vd t649 = 0.316 * sc[5 * VS];
    const vd t650 = t60 * t649;
    const vd t651 = t647 - t650;
    const vd t652 = t88 * sc[5 * VS];
    const vd t653 = t651 - t652;
    PUT(1, 8, t653);
    const vd t655 = t101 * t649;
    const vd t656 = t94 * t646;
    const vd t657 = t655 - t656;
    const vd t658 = t88 * sc[4 * VS];
    const vd t659 = t657 + t658;
    PUT(1, 9, t659);
    const vd t661 = t108 * sc[5 * VS];
    const vd t662 = t116 * sc[4 * VS];
    const vd t663 = t661 + t662;
    PUT(1, 10, t663);
    const vd t665 = t122 * sc[4 * VS];
    const vd t666 = t665 - t661;
    PUT(1, 11, t666);
    const vd t668 = t128 * sc[5 * VS];
    const vd t669 = t137 * sc[4 * VS];
    const vd t670 = t668 - t669;
    PUT(1, 12, t670);
    const vd t672 = t141 * sc[5 * VS];
    const vd t673 = t80 * sc[4 * VS];
    const vd t674 = t672 + t673;
    PUT(1, 13, t674);
    const vd t676 = t153 * sc[4 * VS];
    const vd t677 = t101 * sc[5 * VS];
    const vd t678 = t676 - t677;
    PUT(1, 14, t678);
    const vd t680 = t171 * t646;
    const vd t681 = sc[6 * VS] * t649;
    const vd t682 = 0.082500000000000004 * sc[5 * VS];
    const vd t683 = sc[7 * VS] * t682;
    const vd t684 = t681 + t683;
    const vd t685 = t182 * t684;
    const vd t686 = t680 + t685;
    const vd t687 = sc[7 * VS] * t649;
    const vd t688 = sc[6 * VS] * t682;
    const vd t689 = t687 - t688;
    const vd t690 = t191 * t689;
    const vd t691 = t686 + t690;
    const vd t692 = t203 * sc[5 * VS];
    const vd t693 = t691 + t692;
    const vd t694 = sc[6 * VS] * sc[4 * VS];
    const vd t695 = t207 * t694;
    const vd t696 = t693 + t695;
    const vd t697 = -t696;
    PUT(1, 15, t697);
    const vd t699 = t223 * t684;
    const vd t700 = t220 * t646;
    const vd t701 = t699 - t700;
    const vd t702 = t226 * t689;
    const vd t703 = t701 + t702;
    const vd t704 = t231 * sc[5 * VS];
    const vd t705 = t703 + t704;
    const vd t706 = sc[7 * VS] * sc[4 * VS];
    const vd t707 = t207 * t706;
    const vd t708 = t705 - t707;
    PUT(1, 16, t708);
    const vd t710 = t179 * sc[5 * VS];
    const vd t711 = t241 * t694;
    const vd t712 = t710 - t711;
    const vd t713 = t219 * t706;
    const vd t714 = t712 + t713;
    PUT(1, 17, t714);
    const vd t716 = t181 * sc[5 * VS];
    const vd t717 = t711 - t716;
    const vd t718 = t214 * t706;
    const vd t719 = t717 + t718;
    PUT(1, 18, t719);
    const vd t721 = t253 * sc[5 * VS];
    const vd t722 = t220 * t694;
    const vd t723 = t721 + t722;
    const vd t724 = t171 * t706;
    const vd t725 = t723 + t724;
    const vd t726 = -t725;
    PUT(1, 19, t726);
    const vd t728 = t259 * sc[5 * VS];
    const vd t729 = t261 * t694;
    const vd t730 = t728 - t729;
    const vd t731 = t182 * t706;
    const vd t732 = t730 + t731;
    PUT(1, 20, t732);
    const vd t734 = t226 * t694;
    const vd t735 = t269 * sc[5 * VS];
    const vd t736 = t734 - t735;
    const vd t737 = t267 * t706;
    const vd t738 = t736 + t737;
    PUT(1, 21, t738);
    const vd t740 = t305 * t694;
    const vd t741 = (-0.082500000000000004) * sc[5 * VS];
    const vd t742 = t684 + t741;
    const vd t743 = t289 * t742;
    const vd t744 = t740 - t743;
    const vd t745 = (-0.082500000000000004) * t694;
    const vd t746 = t646 - t745;
    const vd t747 = 0.38400000000000001 * t706;
    const vd t748 = t746 - t747;
    const vd t749 = sc[9 * VS] * t748;
    const vd t750 = 0.38400000000000001 * sc[5 * VS];
    const vd t751 = t689 + t750;
    const vd t752 = sc[8 * VS] * t751;
    const vd t753 = t749 - t752;
    const vd t754 = t314 * t753;
    const vd t755 = t744 + t754;
    const vd t756 = sc[9 * VS] * t751;
    const vd t757 = sc[8 * VS] * t748;
    const vd t758 = t756 + t757;
    const vd t759 = t328 * t758;
    const vd t760 = t755 - t759;
    const vd t761 = sc[9 * VS] * sc[5 * VS];
    const vd t762 = sc[8 * VS] * t706;
    const vd t763 = t761 - t762;
    const vd t764 = t337 * t763;
    const vd t765 = t760 - t764;
    PUT(1, 22, t765);
    const vd t767 = t354 * t694;
    const vd t768 = t350 * t742;
    const vd t769 = t767 - t768;
    const vd t770 = t358 * t753;
    const vd t771 = t769 - t770;
    const vd t772 = t361 * t758;
    const vd t773 = t771 - t772;
    const vd t774 = sc[8 * VS] * sc[5 * VS];
    const vd t775 = sc[9 * VS] * t706;
    const vd t776 = t774 + t775;
    const vd t777 = t337 * t776;
    const vd t778 = t773 + t777;
    PUT(1, 23, t778);
    const vd t780 = t371 * t763;
    const vd t781 = t313 * t694;
    const vd t782 = t780 - t781;
    const vd t783 = t348 * t776;
    const vd t784 = t782 + t783;
    PUT(1, 24, t784);
    const vd t786 = t309 * t694;
    const vd t787 = t786 + t780;
    const vd t788 = t349 * t776;
    const vd t789 = t787 + t788;
    const vd t790 = -t789;
    PUT(1, 25, t790);
    const vd t792 = t350 * t763;
    const vd t793 = t382 * t694;
    const vd t794 = t792 - t793;
    const vd t795 = t289 * t776;
    const vd t796 = t794 - t795;
    PUT(1, 26, t796);
    const vd t798 = t391 * t763;
    const vd t799 = t389 * t694;
    const vd t800 = t798 - t799;
    const vd t801 = t314 * t776;
    const vd t802 = t800 + t801;
    PUT(1, 27, t802);
    const vd t804 = t361 * t763;
    const vd t805 = t397 * t694;
    const vd t806 = t804 - t805;
    const vd t807 = t401 * t776;
    const vd t808 = t806 + t807;
    PUT(1, 28, t808);
    const vd t810 = sc[11 * VS] * t694;
    const vd t811 = sc[10 * VS] * t776;
    const vd t812 = t810 + t811;
    const vd t813 = t305 * t812;
    const vd t814 = t430 * t753;
    const vd t815 = sc[11 * VS] * t742;
    const vd t816 = sc[10 * VS] * t758;
    const vd t817 = t815 + t816;
    const vd t818 = t417 * t817;
    const vd t819 = t814 + t818;
    const vd t820 = sc[11 * VS] * t758;
    const vd t821 = sc[10 * VS] * t742;
    const vd t822 = t820 - t821;
    const vd t823 = t435 * t822;
    const vd t824 = t819 + t823;
    const vd t825 = t443 * t763;
    const vd t826 = t824 + t825;
    const vd t827 = t813 - t826;
    PUT(1, 29, t827);
    const vd t829 = t463 * t817;
    const vd t830 = t460 * t753;
    const vd t831 = t829 - t830;
    const vd t832 = t452 * t822;
    const vd t833 = t831 + t832;
    const vd t834 = t469 * t763;
    const vd t835 = t833 + t834;
    const vd t836 = sc[11 * VS] * t776;
    const vd t837 = sc[10 * VS] * t694;
    const vd t838 = t836 - t837;
    const vd t839 = t305 * t838;
    const vd t840 = t835 + t839;
    PUT(1, 30, t840);
    const vd t842 = t414 * t763;
    const vd t843 = t479 * t812;
    const vd t844 = t842 - t843;
    const vd t845 = t459 * t838;
    const vd t846 = t844 + t845;
    PUT(1, 31, t846);
    const vd t848 = t416 * t763;
    const vd t849 = t843 - t848;
    const vd t850 = t454 * t838;
    const vd t851 = t849 + t850;
    PUT(1, 32, t851);
    const vd t853 = t491 * t763;
    const vd t854 = t460 * t812;
    const vd t855 = t853 + t854;
    const vd t856 = t430 * t838;
    const vd t857 = t855 + t856;
    const vd t858 = -t857;
    PUT(1, 33, t858);
    const vd t860 = t497 * t763;
    const vd t861 = t499 * t812;
    const vd t862 = t860 - t861;
    const vd t863 = t417 * t838;
    const vd t864 = t862 + t863;
    PUT(1, 34, t864);
    const vd t866 = t452 * t812;
    const vd t867 = t507 * t763;
    const vd t868 = t866 - t867;
    const vd t869 = t505 * t838;
    const vd t870 = t868 + t869;
    PUT(1, 35, t870);
    const vd t872 = 0.087999999999999995 * t763;
    const vd t873 = t817 + t872;
    const vd t874 = t527 * t873;
    const vd t875 = 0.087999999999999995 * t812;
    const vd t876 = t875 - t753;
    const vd t877 = sc[13 * VS] * t876;
    const vd t878 = sc[12 * VS] * t822;
    const vd t879 = t877 - t878;
    const vd t880 = t538 * t879;
    const vd t881 = t874 + t880;
    const vd t882 = sc[13 * VS] * t822;
    const vd t883 = sc[12 * VS] * t876;
    const vd t884 = t882 + t883;
    const vd t885 = t548 * t884;
    const vd t886 = t881 - t885;
    const vd t887 = t560 * t812;
    const vd t888 = t886 + t887;
    const vd t889 = sc[13 * VS] * t763;
    const vd t890 = sc[12 * VS] * t838;
    const vd t891 = t889 + t890;
    const vd t892 = t564 * t891;
    const vd t893 = t888 - t892;
    PUT(1, 36, t893);
    const vd t895 = t577 * t873;
    const vd t896 = t580 * t879;
    const vd t897 = t895 - t896;
    const vd t898 = t583 * t884;
    const vd t899 = t897 + t898;
    const vd t900 = t588 * t812;
    const vd t901 = t899 - t900;
    const vd t902 = sc[13 * VS] * t838;
    const vd t903 = sc[12 * VS] * t763;
    const vd t904 = t902 - t903;
    const vd t905 = t564 * t904;
    const vd t906 = t901 - t905;
    PUT(1, 37, t906);
    const vd t908 = t576 * t904;
    const vd t909 = t535 * t812;
    const vd t910 = t598 * t891;
    const vd t911 = t909 + t910;
    const vd t912 = t908 - t911;
    PUT(1, 38, t912);
    const vd t914 = t537 * t812;
    const vd t915 = t914 + t910;
    const vd t916 = t571 * t904;
    const vd t917 = t915 + t916;
    PUT(1, 39, t917);
    const vd t919 = t609 * t812;
    const vd t920 = t577 * t891;
    const vd t921 = t919 - t920;
    const vd t922 = t527 * t904;
    const vd t923 = t921 - t922;
    PUT(1, 40, t923);
    const vd t925 = t538 * t904;
    const vd t926 = t617 * t812;
    const vd t927 = t619 * t891;
    const vd t928 = t926 + t927;
    const vd t929 = t925 - t928;
    PUT(1, 41, t929);
    const vd t931 = t626 * t812;
    const vd t932 = t583 * t891;
    const vd t933 = t931 + t932;
    const vd t934 = t629 * t904;
    const vd t935 = t933 + t934;
    PUT(1, 42, t935);
    const vd t945 = -t72;
    PUT(2, 8, t945);
    const vd t947 = -t98;
    PUT(2, 9, t947);
    const vd t949 = -t77;
    PUT(2, 10, t949);
    PUT(2, 11, t79);
    PUT(2, 12, t126);
    const vd t953 = -t143;
    PUT(2, 13, t953);
    PUT(2, 14, t149);
    const vd t956 = t207 * sc[7 * VS];
    const vd t957 = t300 + t956;
    PUT(2, 15, t957);
    const vd t959 = (-0.082500000000000004) * t220;
    const vd t960 = t207 * sc[6 * VS];
    const vd t961 = t959 - t960;
    PUT(2, 16, t961);
    const vd t963 = t241 * sc[7 * VS];
    const vd t964 = t219 * sc[6 * VS];
    const vd t965 = t963 + t964;
    PUT(2, 17, t965);
    const vd t967 = t214 * sc[6 * VS];
    const vd t968 = t967 - t963;
    PUT(2, 18, t968);
    const vd t970 = t220 * sc[7 * VS];
    const vd t971 = t171 * sc[6 * VS];
    const vd t972 = t970 - t971;
    PUT(2, 19, t972);
    const vd t974 = t261 * sc[7 * VS];
    const vd t975 = t182 * sc[6 * VS];
    const vd t976 = t974 + t975;
    PUT(2, 20, t976);
    const vd t978 = t267 * sc[6 * VS];
    const vd t979 = t226 * sc[7 * VS];
    const vd t980 = t978 - t979;
    PUT(2, 21, t980);
    const vd t982 = (-0.082500000000000004) * sc[7 * VS];
    const vd t983 = 0.082500000000000004 + t982;
    const vd t984 = 0.38400000000000001 * sc[6 * VS];
    const vd t985 = t983 - t984;
    const vd t986 = sc[9 * VS] * t985;
    const vd t987 = t314 * t986;
    const vd t988 = t305 * sc[7 * VS];
    const vd t989 = t987 - t988;
    const vd t990 = sc[8 * VS] * t985;
    const vd t991 = t328 * t990;
    const vd t992 = t989 - t991;
    const vd t993 = sc[8 * VS] * sc[6 * VS];
    const vd t994 = t337 * t993;
    const vd t995 = t992 + t994;
    PUT(2, 22, t995);
    const vd t997 = sc[9 * VS] * sc[6 * VS];
    const vd t998 = t337 * t997;
    const vd t999 = t354 * sc[7 * VS];
    const vd t1000 = t358 * t986;
    const vd t1001 = t999 + t1000;
    const vd t1002 = t361 * t990;
    const vd t1003 = t1001 + t1002;
    const vd t1004 = t998 - t1003;
    PUT(2, 23, t1004);
    const vd t1006 = t313 * sc[7 * VS];
    const vd t1007 = t371 * t993;
    const vd t1008 = t1006 - t1007;
    const vd t1009 = t348 * t997;
    const vd t1010 = t1008 + t1009;
    PUT(2, 24, t1010);
    const vd t1012 = t309 * sc[7 * VS];
    const vd t1013 = t1012 + t1007;
    const vd t1014 = t349 * t997;
    const vd t1015 = t1013 - t1014;
    PUT(2, 25, t1015);
    const vd t1017 = t382 * sc[7 * VS];
    const vd t1018 = t350 * t993;
    const vd t1019 = t1017 - t1018;
    const vd t1020 = t289 * t997;
    const vd t1021 = t1019 - t1020;
    PUT(2, 26, t1021);
    const vd t1023 = t389 * sc[7 * VS];
    const vd t1024 = t391 * t993;
    const vd t1025 = t1023 - t1024;
    const vd t1026 = t314 * t997;
    const vd t1027 = t1025 + t1026;
    PUT(2, 27, t1027);
    const vd t1029 = t397 * sc[7 * VS];
    const vd t1030 = t361 * t993;
    const vd t1031 = t1029 - t1030;
    const vd t1032 = t401 * t997;
    const vd t1033 = t1031 + t1032;
    PUT(2, 28, t1033);
    const vd t1035 = t443 * t993;
    const vd t1036 = t430 * t986;
    const vd t1037 = sc[10 * VS] * t990;
    const vd t1038 = t417 * t1037;
    const vd t1039 = t1036 + t1038;
    const vd t1040 = sc[11 * VS] * t990;
    const vd t1041 = t435 * t1040;
    const vd t1042 = t1039 + t1041;
    const vd t1043 = t1035 - t1042;
    const vd t1044 = sc[11 * VS] * sc[7 * VS];
    const vd t1045 = sc[10 * VS] * t997;
    const vd t1046 = t1044 - t1045;
    const vd t1047 = t305 * t1046;
    const vd t1048 = t1043 - t1047;
    PUT(2, 29, t1048);
    const vd t1050 = t463 * t1037;
    const vd t1051 = t460 * t986;
    const vd t1052 = t1050 - t1051;
    const vd t1053 = t452 * t1040;
    const vd t1054 = t1052 + t1053;
    const vd t1055 = t469 * t993;
    const vd t1056 = t1054 - t1055;
    const vd t1057 = sc[10 * VS] * sc[7 * VS];
    const vd t1058 = sc[11 * VS] * t997;
    const vd t1059 = t1057 + t1058;
    const vd t1060 = t305 * t1059;
    const vd t1061 = t1056 + t1060;
    PUT(2, 30, t1061);
    const vd t1063 = t479 * t1046;
    const vd t1064 = t414 * t993;
    const vd t1065 = t1063 - t1064;
    const vd t1066 = t459 * t1059;
    const vd t1067 = t1065 + t1066;
    PUT(2, 31, t1067);
    const vd t1069 = t416 * t993;
    const vd t1070 = t1069 - t1063;
    const vd t1071 = t454 * t1059;
    const vd t1072 = t1070 + t1071;
    PUT(2, 32, t1072);
    const vd t1074 = t491 * t993;
    const vd t1075 = t460 * t1046;
    const vd t1076 = t1074 + t1075;
    const vd t1077 = t430 * t1059;
    const vd t1078 = t1076 - t1077;
    PUT(2, 33, t1078);
    const vd t1080 = t499 * t1046;
    const vd t1081 = t497 * t993;
    const vd t1082 = t1080 - t1081;
    const vd t1083 = t417 * t1059;
    const vd t1084 = t1082 + t1083;
    PUT(2, 34, t1084);
    const vd t1086 = t507 * t993;
    const vd t1087 = t452 * t1046;
    const vd t1088 = t1086 - t1087;
    const vd t1089 = t505 * t1059;
    const vd t1090 = t1088 + t1089;
    PUT(2, 35, t1090);
    const vd t1092 = 0.087999999999999995 * t993;
    const vd t1093 = t1037 - t1092;
    const vd t1094 = t527 * t1093;
    const vd t1095 = sc[12 * VS] * t1040;
    const vd t1096 = 0.087999999999999995 * t1046;
    const vd t1097 = t986 + t1096;
    const vd t1098 = sc[13 * VS] * t1097;
    const vd t1099 = t1095 + t1098;
    const vd t1100 = t538 * t1099;
    const vd t1101 = t1094 - t1100;
    const vd t1102 = sc[13 * VS] * t1040;
    const vd t1103 = sc[12 * VS] * t1097;
    const vd t1104 = t1102 - t1103;
    const vd t1105 = t548 * t1104;
    const vd t1106 = t1101 - t1105;
    const vd t1107 = t560 * t1046;
    const vd t1108 = t1106 - t1107;
    const vd t1109 = sc[13 * VS] * t993;
    const vd t1110 = sc[12 * VS] * t1059;
    const vd t1111 = t1109 - t1110;
    const vd t1112 = t564 * t1111;
    const vd t1113 = t1108 + t1112;
    PUT(2, 36, t1113);
    const vd t1115 = t577 * t1093;
    const vd t1116 = t580 * t1099;
    const vd t1117 = t1115 + t1116;
    const vd t1118 = t583 * t1104;
    const vd t1119 = t1117 + t1118;
    const vd t1120 = t588 * t1046;
    const vd t1121 = t1119 + t1120;
    const vd t1122 = sc[12 * VS] * t993;
    const vd t1123 = sc[13 * VS] * t1059;
    const vd t1124 = t1122 + t1123;
    const vd t1125 = t564 * t1124;
    const vd t1126 = t1121 - t1125;
    PUT(2, 37, t1126);
    const vd t1128 = t535 * t1046;
    const vd t1129 = t598 * t1111;
    const vd t1130 = t1128 + t1129;
    const vd t1131 = t576 * t1124;
    const vd t1132 = t1130 + t1131;
    PUT(2, 38, t1132);
    const vd t1134 = t571 * t1124;
    const vd t1135 = t537 * t1046;
    const vd t1136 = t1135 + t1129;
    const vd t1137 = t1134 - t1136;
    PUT(2, 39, t1137);
    const vd t1139 = t577 * t1111;
    const vd t1140 = t609 * t1046;
    const vd t1141 = t1139 - t1140;
    const vd t1142 = t527 * t1124;
    const vd t1143 = t1141 - t1142;
    PUT(2, 40, t1143);
    const vd t1145 = t617 * t1046;
    const vd t1146 = t619 * t1111;
    const vd t1147 = t1145 + t1146;
    const vd t1148 = t538 * t1124;
    const vd t1149 = t1147 + t1148;
    PUT(2, 41, t1149);
    const vd t1151 = t629 * t1124;
    const vd t1152 = t626 * t1046;
    const vd t1153 = t583 * t1111;
    const vd t1154 = t1152 + t1153;
    const vd t1155 = t1151 - t1154;
    PUT(2, 42, t1155);
    PUT(3, 15, t203);
    const vd t1173 = -t231;
    PUT(3, 16, t1173);
    const vd t1175 = -t179;
    PUT(3, 17, t1175);
    PUT(3, 18, t181);
    PUT(3, 19, t253);
    const vd t1179 = -t259;
    PUT(3, 20, t1179);
    PUT(3, 21, t269);
    const vd t1182 = (-0.082500000000000004) * t289;
    const vd t1183 = 0.38400000000000001 * sc[8 * VS];
    const vd t1184 = t314 * t1183;
    const vd t1185 = t1182 + t1184;
    const vd t1187 = (-0.38400000000000001) * sc[9 * VS];
    const vd t1188 = t328 * t1187;
    const vd t1189 = t1185 - t1188;
    const vd t1190 = t337 * sc[9 * VS];
    const vd t1191 = t1189 + t1190;
    PUT(3, 22, t1191);
    const vd t1193 = (-0.082500000000000004) * t350;
    const vd t1194 = t358 * t1183;
    const vd t1195 = t1193 - t1194;
    const vd t1196 = t361 * t1187;
    const vd t1197 = t1195 - t1196;
    const vd t1198 = t337 * sc[8 * VS];
    const vd t1199 = t1197 - t1198;
    PUT(3, 23, t1199);
    const vd t1201 = t371 * sc[9 * VS];
    const vd t1202 = t348 * sc[8 * VS];
    const vd t1203 = t1201 + t1202;
    const vd t1204 = -t1203;
    PUT(3, 24, t1204);
    const vd t1206 = t349 * sc[8 * VS];
    const vd t1207 = t1201 + t1206;
    PUT(3, 25, t1207);
    const vd t1209 = t289 * sc[8 * VS];
    const vd t1210 = t350 * sc[9 * VS];
    const vd t1211 = t1209 - t1210;
    PUT(3, 26, t1211);
    const vd t1213 = t391 * sc[9 * VS];
    const vd t1214 = t314 * sc[8 * VS];
    const vd t1215 = t1213 + t1214;
    const vd t1216 = -t1215;
    PUT(3, 27, t1216);
    const vd t1218 = t361 * sc[9 * VS];
    const vd t1219 = t401 * sc[8 * VS];
    const vd t1220 = t1218 + t1219;
    const vd t1221 = -t1220;
    PUT(3, 28, t1221);
    const vd t1223 = (-0.082500000000000004) * sc[11 * VS];
    const vd t1224 = sc[10 * VS] * t1187;
    const vd t1225 = t1223 - t1224;
    const vd t1226 = t417 * t1225;
    const vd t1227 = t430 * t1183;
    const vd t1228 = t1226 - t1227;
    const vd t1229 = (-0.082500000000000004) * sc[10 * VS];
    const vd t1230 = sc[11 * VS] * t1187;
    const vd t1231 = t1229 + t1230;
    const vd t1232 = t435 * t1231;
    const vd t1233 = t1228 - t1232;
    const vd t1234 = t443 * sc[9 * VS];
    const vd t1235 = t1233 + t1234;
    const vd t1236 = sc[10 * VS] * sc[8 * VS];
    const vd t1237 = t305 * t1236;
    const vd t1238 = t1235 - t1237;
    PUT(3, 29, t1238);
    const vd t1240 = t452 * t1231;
    const vd t1241 = t460 * t1183;
    const vd t1242 = t463 * t1225;
    const vd t1243 = t1241 + t1242;
    const vd t1244 = t1240 - t1243;
    const vd t1245 = t469 * sc[9 * VS];
    const vd t1246 = t1244 - t1245;
    const vd t1247 = sc[11 * VS] * sc[8 * VS];
    const vd t1248 = t305 * t1247;
    const vd t1249 = t1246 - t1248;
    PUT(3, 30, t1249);
    const vd t1251 = t479 * t1236;
    const vd t1252 = t414 * sc[9 * VS];
    const vd t1253 = t1251 - t1252;
    const vd t1254 = t459 * t1247;
    const vd t1255 = t1253 - t1254;
    PUT(3, 31, t1255);
    const vd t1257 = t416 * sc[9 * VS];
    const vd t1258 = t1257 - t1251;
    const vd t1259 = t454 * t1247;
    const vd t1260 = t1258 - t1259;
    PUT(3, 32, t1260);
    const vd t1262 = t491 * sc[9 * VS];
    const vd t1263 = t460 * t1236;
    const vd t1264 = t1262 + t1263;
    const vd t1265 = t430 * t1247;
    const vd t1266 = t1264 + t1265;
    PUT(3, 33, t1266);
    const vd t1268 = t499 * t1236;
    const vd t1269 = t497 * sc[9 * VS];
    const vd t1270 = t1268 - t1269;
    const vd t1271 = t417 * t1247;
    const vd t1272 = t1270 - t1271;
    PUT(3, 34, t1272);
    const vd t1274 = t507 * sc[9 * VS];
    const vd t1275 = t452 * t1236;
    const vd t1276 = t1274 - t1275;
    const vd t1277 = t505 * t1247;
    const vd t1278 = t1276 - t1277;
    PUT(3, 35, t1278);
    const vd t1280 = sc[13 * VS] * sc[9 * VS];
    const vd t1281 = sc[12 * VS] * t1247;
    const vd t1282 = t1280 + t1281;
    const vd t1283 = t564 * t1282;
    const vd t1284 = 0.087999999999999995 * sc[9 * VS];
    const vd t1285 = t1225 + t1284;
    const vd t1286 = t527 * t1285;
    const vd t1287 = sc[12 * VS] * t1231;
    const vd t1288 = 0.087999999999999995 * t1236;
    const vd t1289 = t1183 + t1288;
    const vd t1290 = sc[13 * VS] * t1289;
    const vd t1291 = t1287 + t1290;
    const vd t1292 = t538 * t1291;
    const vd t1293 = t1286 + t1292;
    const vd t1294 = sc[13 * VS] * t1231;
    const vd t1295 = sc[12 * VS] * t1289;
    const vd t1296 = t1294 - t1295;
    const vd t1297 = t548 * t1296;
    const vd t1298 = t1293 + t1297;
    const vd t1299 = t560 * t1236;
    const vd t1300 = t1298 + t1299;
    const vd t1301 = t1283 - t1300;
    PUT(3, 36, t1301);
    const vd t1303 = t580 * t1291;
    const vd t1304 = t577 * t1285;
    const vd t1305 = t1303 - t1304;
    const vd t1306 = t583 * t1296;
    const vd t1307 = t1305 + t1306;
    const vd t1308 = t588 * t1236;
    const vd t1309 = t1307 + t1308;
    const vd t1310 = sc[12 * VS] * sc[9 * VS];
    const vd t1311 = sc[13 * VS] * t1247;
    const vd t1312 = t1310 - t1311;
    const vd t1313 = t564 * t1312;
    const vd t1314 = t1309 - t1313;
    PUT(3, 37, t1314);
    const vd t1316 = t535 * t1236;
    const vd t1317 = t598 * t1282;
    const vd t1318 = t1316 + t1317;
    const vd t1319 = t576 * t1312;
    const vd t1320 = t1318 + t1319;
    PUT(3, 38, t1320);
    const vd t1322 = t571 * t1312;
    const vd t1323 = t537 * t1236;
    const vd t1324 = t1323 + t1317;
    const vd t1325 = t1322 - t1324;
    PUT(3, 39, t1325);
    const vd t1327 = t577 * t1282;
    const vd t1328 = t609 * t1236;
    const vd t1329 = t1327 - t1328;
    const vd t1330 = t527 * t1312;
    const vd t1331 = t1329 - t1330;
    PUT(3, 40, t1331);
    const vd t1333 = t617 * t1236;
    const vd t1334 = t619 * t1282;
    const vd t1335 = t1333 + t1334;
    const vd t1336 = t538 * t1312;
    const vd t1337 = t1335 + t1336;
    PUT(3, 41, t1337);
    const vd t1339 = t629 * t1312;
    const vd t1340 = t626 * t1236;
    const vd t1341 = t583 * t1282;
    const vd t1342 = t1340 + t1341;
    const vd t1343 = t1339 - t1342;
    PUT(3, 42, t1343);
    const vd t1367 = -t305;
    PUT(4, 22, t1367);
    const vd t1369 = -t354;
    PUT(4, 23, t1369);
    PUT(4, 24, t313);
    PUT(4, 25, t309);
    PUT(4, 26, t382);
    PUT(4, 27, t389);
    PUT(4, 28, t397);
    const vd t1376 = t305 * sc[11 * VS];
    const vd t1377 = -t1376;
    PUT(4, 29, t1377);
    const vd t1379 = t305 * sc[10 * VS];
    PUT(4, 30, t1379);
    const vd t1381 = t479 * sc[11 * VS];
    const vd t1382 = t459 * sc[10 * VS];
    const vd t1383 = t1381 + t1382;
    PUT(4, 31, t1383);
    const vd t1385 = t454 * sc[10 * VS];
    const vd t1386 = t1385 - t1381;
    PUT(4, 32, t1386);
    const vd t1388 = t460 * sc[11 * VS];
    const vd t1389 = t430 * sc[10 * VS];
    const vd t1390 = t1388 - t1389;
    PUT(4, 33, t1390);
    const vd t1392 = t499 * sc[11 * VS];
    const vd t1393 = t417 * sc[10 * VS];
    const vd t1394 = t1392 + t1393;
    PUT(4, 34, t1394);
    const vd t1396 = t505 * sc[10 * VS];
    const vd t1397 = t452 * sc[11 * VS];
    const vd t1398 = t1396 - t1397;
    PUT(4, 35, t1398);
    const vd t1400 = 0.087999999999999995 * sc[11 * VS];
    const vd t1401 = sc[12 * VS] * t1400;
    const vd t1402 = t548 * t1401;
    const vd t1403 = sc[13 * VS] * t1400;
    const vd t1404 = t538 * t1403;
    const vd t1405 = t1402 - t1404;
    const vd t1406 = t560 * sc[11 * VS];
    const vd t1407 = t1405 - t1406;
    const vd t1408 = sc[12 * VS] * sc[10 * VS];
    const vd t1409 = t564 * t1408;
    const vd t1410 = t1407 - t1409;
    PUT(4, 36, t1410);
    const vd t1412 = t580 * t1403;
    const vd t1413 = t583 * t1401;
    const vd t1414 = t1412 - t1413;
    const vd t1415 = t588 * sc[11 * VS];
    const vd t1416 = t1414 + t1415;
    const vd t1417 = sc[13 * VS] * sc[10 * VS];
    const vd t1418 = t564 * t1417;
    const vd t1419 = t1416 - t1418;
    PUT(4, 37, t1419);
    const vd t1421 = t535 * sc[11 * VS];
    const vd t1422 = t598 * t1408;
    const vd t1423 = t1421 - t1422;
    const vd t1424 = t576 * t1417;
    const vd t1425 = t1423 + t1424;
    PUT(4, 38, t1425);
    const vd t1427 = t537 * sc[11 * VS];
    const vd t1428 = t1422 - t1427;
    const vd t1429 = t571 * t1417;
    const vd t1430 = t1428 + t1429;
    PUT(4, 39, t1430);
    const vd t1432 = t609 * sc[11 * VS];
    const vd t1433 = t577 * t1408;
    const vd t1434 = t1432 + t1433;
    const vd t1435 = t527 * t1417;
    const vd t1436 = t1434 + t1435;
    const vd t1437 = -t1436;
    PUT(4, 40, t1437);
    const vd t1439 = t617 * sc[11 * VS];
    const vd t1440 = t619 * t1408;
    const vd t1441 = t1439 - t1440;
    const vd t1442 = t538 * t1417;
    const vd t1443 = t1441 + t1442;
    PUT(4, 41, t1443);
    const vd t1445 = t583 * t1408;
    const vd t1446 = t626 * sc[11 * VS];
    const vd t1447 = t1445 - t1446;
    const vd t1448 = t629 * t1417;
    const vd t1449 = t1447 + t1448;
    PUT(4, 42, t1449);
    PUT(5, 29, t443);
    const vd t1481 = -t469;
    PUT(5, 30, t1481);
    const vd t1483 = -t414;
    PUT(5, 31, t1483);
    PUT(5, 32, t416);
    PUT(5, 33, t491);
    const vd t1487 = -t497;
    PUT(5, 34, t1487);
    PUT(5, 35, t507);
    const vd t1491 = (-0.087999999999999995) * t527;
    const vd t1492 = t564 * sc[13 * VS];
    const vd t1493 = t1491 + t1492;
    PUT(5, 36, t1493);
    const vd t1495 = (-0.087999999999999995) * t577;
    const vd t1496 = t564 * sc[12 * VS];
    const vd t1497 = t1495 - t1496;
    PUT(5, 37, t1497);
    const vd t1499 = t598 * sc[13 * VS];
    const vd t1500 = t576 * sc[12 * VS];
    const vd t1501 = t1499 + t1500;
    PUT(5, 38, t1501);
    const vd t1503 = t571 * sc[12 * VS];
    const vd t1504 = t1503 - t1499;
    PUT(5, 39, t1504);
    const vd t1506 = t577 * sc[13 * VS];
    const vd t1507 = t527 * sc[12 * VS];
    const vd t1508 = t1506 - t1507;
    PUT(5, 40, t1508);
    const vd t1510 = t619 * sc[13 * VS];
    const vd t1511 = t538 * sc[12 * VS];
    const vd t1512 = t1510 + t1511;
    PUT(5, 41, t1512);
    const vd t1514 = t629 * sc[12 * VS];
    const vd t1515 = t583 * sc[13 * VS];
    const vd t1516 = t1514 - t1515;
    PUT(5, 42, t1516);
    PUT(6, 36, t560);
    const vd t1555 = -t588;
    PUT(6, 37, t1555);
    const vd t1557 = -t535;
    PUT(6, 38, t1557);
    PUT(6, 39, t537);
    PUT(6, 40, t609);
    const vd t1561 = -t617;
    PUT(6, 41, t1561);
    PUT(6, 42, t626);

}
#undef PUT

/* The numbers of LANES samples, `apart` from one lane to the next, before they are needed. */
static inline void fetch(const double *from, long size, long apart)
{
    for (long l = 0; l < LANES; ++l) {
        for (long i = 0; i < size; i += 8) {
            __builtin_prefetch(from + l * apart * size + i);
        }
    }
}

/* Tile t of a block: W of the samples that begin with i and are `apart`, from lane h of their tiles on.
 * With `sums`, rows are number `age` of their window and become differences. */
static void fill(const samples *s, long i, long apart, const double *sc, const double *q, const double *dq, const double *ddq, const double *tau, const double *columns, int h, vd *to, vd *sums, int age)
{
    vd scale[N], far[N], own; /* root of the weight of each sample */
    const double nearness = age ? 1.0 / sqrt(age * (age + 1.0)) : 0.0;
    const vd near = vd_all(nearness);
    for (int l = 0; l < W; ++l) {
        const long at = i + (h + l) * apart;
        own[l] = at >= s->n ? 0.0 : s->sample_weight ? sqrt(s->sample_weight[at]) : 1.0;
    }
#define ROW(tile, index) (*(const vd *)((tile) + (index) * LANES + h))
    for (int joint = 0; joint < N; ++joint) {
        vd *here = to + joint * DEPTH;
        scale[joint] = s->root[joint] * own;
        far[joint] = age * nearness * scale[joint];
        for (long c = 0; c <= s->k; ++c) {
            const vd x = c < s->k ? ROW(columns, joint * s->k + c) : ROW(tau, joint);
            const long column = c < s->k ? c : s->k + BASE;
            here[column * HEIGHT] = sums ? difference(x, sums + column * N + joint, scale[joint], far[joint], near) : scale[joint] * x;
        }
    }
#undef ROW
    if (sums) {
        place_differences((const vu *)(sc + h), (const vu *)(q + h), (const vu *)(dq + h), (const vu *)(ddq + h), scale, far, near, sums + s->k * N, to + s->k * HEIGHT);
    } else {
        place((const vu *)(sc + h), (const vu *)(q + h), (const vu *)(dq + h), (const vu *)(ddq + h), scale, to + s->k * HEIGHT);
    }
}

/* DEPTH LANES samples into a block, of which each vector of lanes has a `part`: that of lane l in tile
 * t is first + l apart + t further. Where there are no more, zeros up to the depth that is returned.
 * With `sums`, rows are turned into differences; the first is number `age` of its window. */
static int fill_block(const samples *s, long first, long apart, long further, double *b, long part, double *columns, double *sums, int age)
{
    TILE(q, DEPTH * N) = {0};
    TILE(sc, DEPTH * 2 * N);
    const long left = (s->n - first + further - 1) / further, tiles = left < DEPTH ? left : DEPTH, width = N * s->k;
    const int depth = whole_depth(tiles);
    for (long t = 0; t < tiles; ++t) {
        const long i = first + t * further, rest = s->n - i;
        load(q + t * N * LANES, s->q + i * N, apart * N, N, (rest + apart - 1) / apart, rest * N);
    }
    OWN(base_regressor_sines)(tiles, q, sc);
    for (long t = 0; t < tiles; ++t) {
        const long i = first + t * further, rest = s->n - i, have = (rest + apart - 1) / apart;
        TILE(dq, N);
        TILE(ddq, N);
        TILE(tau, N);
        if (rest > AHEAD * further + LANES * apart) {
            const long next = i + AHEAD * further;
            fetch(s->q + next * N, N, apart);
            fetch(s->dq + next * N, N, apart);
            fetch(s->ddq + next * N, N, apart);
            fetch(s->tau + next * N, N, apart);
            if (width) {
                fetch(s->columns + next * width, width, apart);
            }
        }
        load(dq, s->dq + i * N, apart * N, N, have, rest * N);
        load(ddq, s->ddq + i * N, apart * N, N, have, rest * N);
        load(tau, s->tau + i * N, apart * N, N, have, rest * N);
        if (width) {
            load(columns, s->columns + i * width, apart * width, (int)width, have, rest * width);
        }
        for (int h = 0; h < LANES; h += W) {
            fill(s, i, apart, sc + t * 2 * N * LANES, q + t * N * LANES, dq, ddq, tau, columns, h, (vd *)(b + h * part) + t, sums ? (vd *)(sums + h * N * (s->k + BASE + 1)) : 0, age + (int)t);
        }
    }
    for (int h = 0; h < LANES; h += W) {
        clear_rows((vd *)(b + h * part), s->k, (int)tiles, depth);
    }
    return depth;
}

/* What `statistics` works on: triangles r of rows and sums g of `products`, one per lane, a block b, a
 * block `up` of means, and sums of rows. */
typedef struct {
    double *r, *g, *b, *up, *sums;
    long k, size, step, packed, part;
    schedule products;
} workplace;

static void clear(double *x, long count)
{
    long i = 0;
    for (; i + W <= count; i += W) {
        *(vu *)(x + i) = vd_all(0.0);
    }
    for (; i < count; ++i) {
        x[i] = 0.0;
    }
}

/* Samples from `first` to `end`, whose rows are eliminated as they are. */
static void eliminate_samples(const workplace *w, const samples *s, long first, long end)
{
    samples until = *s;
    until.n = end;
    for (; first < end; first += DEPTH * LANES) {
        const int depth = fill_block(&until, first, 1, LANES, w->b, w->part, w->b + w->part * LANES, 0, 0);
        for (long h = 0; h < LANES; h += W) {
            eliminate((vd *)(w->b + h * w->part), (vd *)(w->r + h * w->packed), w->k, depth);
        }
    }
}

/* TRIAL of the `blocks` blocks of each lane, `apart` from one another, or with `others` all but those.
 * The samples of a lane follow one another in time. Means of `window` blocks are eliminated, the
 * differences from them multiplied. */
static void add_samples(const workplace *w, const samples *s, long blocks, long apart, int others, int window)
{
    int slot = 0, inside = 0;
    long left = others ? blocks - TRIAL : TRIAL;
    for (long i = 0; i < blocks; ++i) {
        const int chosen = i % apart == 0 && i / apart < TRIAL;
        if (chosen == others) {
            continue;
        }
        fill_block(s, i * DEPTH, blocks * DEPTH, 1, w->b, w->part, w->b + w->part * LANES, w->sums, inside * DEPTH);
        for (long h = 0; h < LANES; h += W) {
            add_products(w->products.items, w->products.count, (const vd *)(w->b + h * w->part), (vd *)(w->g + h * w->products.sums));
        }
        --left;
        if (++inside < window && left > 0) {
            continue;
        }
        for (long h = 0; h < LANES; h += W) {
            keep_means((vd *)(w->sums + h * N * (w->k + BASE + 1)), (vd *)(w->up + h * w->part), w->k, slot, 1.0 / sqrt((double)(inside * DEPTH)));
        }
        inside = 0;
        slot = (slot + 1) % DEPTH;
        if (slot == 0 || left == 0) {
            const int filled = slot ? slot : DEPTH, depth = whole_depth(filled);
            for (long h = 0; h < LANES; h += W) {
                clear_rows((vd *)(w->up + h * w->part), w->k, filled, depth);
                eliminate((vd *)(w->up + h * w->part), (vd *)(w->r + h * w->packed), w->k, depth);
            }
        }
    }
}

/* The triangles of all lanes as one, whose place is b. */
static double *joined_lanes(const workplace *w)
{
    double *result = w->b, *rows = result + w->size * w->step;
    clear(rows, w->size * LANES * w->step);
    for (long h = 0; h < LANES; h += W) {
        const double *from = w->r + h * w->packed;
        for (long c = 0; c < w->size; ++c) {
            double *to = rows + (c * LANES + h) * w->step;
            for (long j = c; j < w->size; ++j, from += W) {
                for (long l = 0; l < W; ++l) {
                    to[l * w->step + j] = from[l];
                }
            }
        }
    }
    join(result, rows, w->size, LANES, w->step, rows + w->size * LANES * w->step);
    return result;
}

/* The joined triangle with the products folded into it, or NULL where they are not accurate enough. */
static double *folded(const workplace *w, double *margin)
{
    double *result = joined_lanes(w), *g = result + w->size * w->step;
    clear(g, w->size * w->step);
    double *flat = g + w->size * w->step; /* sums of all lanes in the order of the products */
    clear(flat, w->products.sums);
    for (long h = 0; h < LANES; h += W) {
        const vd *from = (const vd *)(w->g + h * w->products.sums);
        for (long i = 0; i < w->products.sums; i += W) {
            vd each[W];
            UNROLL for (int l = 0; l < W; ++l) {
                each[l] = from[i + l];
            }
            *(vu *)(flat + i) += fold(each);
        }
    }
    for (long n = 0; n < w->products.count; ++n) {
        const product *p = w->products.items + n;
        for (long i = 0; i < p->tall && p->fresh; ++i) {
            for (long j = p->square ? i : 0; j < p->broad; ++j) {
                const long row = p->row + i, column = p->column + j;
                g[row * w->step + column] = g[column * w->step + row] = flat[p->sums + i * p->broad + j];
            }
        }
    }
    *margin = fold_into(result, g, g + w->size * w->step, w->size, w->step);
    return *margin >= 1.0 ? result : 0;
}

/* Differences from a mean grow with the length of its window, and what they round to with the square:
 * the most blocks of which as much remains as the trial may have missed. */
static int longest_window(double margin)
{
    int window = 1;
    while (window < WINDOW && RESERVE * (window + 1) * (window + 1) <= margin) {
        ++window;
    }
    return window;
}

/* The triangle of n samples, size x size and row-major with size = N k + BASE + 1 columns
 * [F Y_b tau]. Samples follow one another; columns holds N x k numbers per sample and is not read
 * when k = 0; weight one number per joint; sample_weight one per sample, or NULL for ones. Returns how
 * many samples were multiplied: with `products` those of long logs are, where that rounds no worse
 * than eliminating them. */
long OWN(statistics)(long n, const double *q, const double *dq, const double *ddq, const double *tau, long k, const double *columns, const double *weight, const double *sample_weight, double *work, double *triangle, long products);
long OWN(statistics)(long n, const double *q, const double *dq, const double *ddq, const double *tau, long k, const double *columns, const double *weight, const double *sample_weight, double *work, double *triangle, long products)
{
    const long size = N * k + BASE + 1, packed = size * (size + 1) / 2, part = HEIGHT * (k + BASE + 1);
    const long blocks = n / (DEPTH * LANES), apart = blocks / TRIAL;
    workplace w = {.k = k, .size = size, .step = step_of(size), .packed = packed, .part = part};
    enter_all(&w.products, k);
    w.r = aligned(work);
    w.g = w.r + packed * LANES;
    w.up = w.g + w.products.sums * LANES;
    w.sums = w.up + part * LANES;
    w.products.items = (product *)(void *)(w.sums + N * (k + BASE + 1) * LANES);
    w.b = (double *)w.products.items + items_size(&w.products);
    enter_all(&w.products, k);
    samples given = {n, k, q, dq, ddq, tau, columns, sample_weight, {0.0}};
    for (int i = 0; i < N; ++i) {
        given.root[i] = sqrt(weight[i]);
    }
    double *result = 0, margin;
    long multiplied = 0;
    clear(w.r, packed * LANES);
    clear(w.g, w.products.sums * LANES);
    clear(w.sums, N * (k + BASE + 1) * LANES);
    if (products && n >= LEAST) {
        add_samples(&w, &given, blocks, apart, 0, 1);
        if (folded(&w, &margin)) {
            multiplied = blocks * DEPTH * LANES;
            add_samples(&w, &given, blocks, apart, 1, longest_window(margin));
            eliminate_samples(&w, &given, multiplied, n);
            result = folded(&w, &margin);
        }
        if (!result) {
            clear(w.r, packed * LANES);
        }
    }
    if (!result) {
        multiplied = 0;
        eliminate_samples(&w, &given, 0, n);
        result = joined_lanes(&w);
    }
    for (long i = 0; i < size * size; ++i) {
        triangle[i] = result[i / size * w.step + i % size];
    }
    return multiplied;
}
