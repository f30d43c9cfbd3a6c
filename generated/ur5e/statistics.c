/* ur5e: N samples -> the triangular factor of their weighted rows, written by symgen 0.1.0.
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
    N = 6,
    BASE = 36,
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
    {0, 1, 0, 1, 0, 34},
    {1, 2, 1, 1, 34, 34},
    {3, 5, 2, 2, 68, 29},
    {8, 7, 4, 3, 97, 22},
    {15, 7, 7, 4, 119, 15},
    {22, 7, 11, 5, 134, 8},
    {29, 7, 16, 6, 142, 1},
};
enum { PANELS = sizeof panels / sizeof panels[0], TEAMS = 2 };

static const short panel_rows[] = {0, 1, 0, 1, 0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 5};
static const short panel_columns[] = {3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 29, 30, 31, 32, 33, 34, 35, 36, 36};

/* Columns of Y_b in the row of a joint, and tau. */
static const short joint_columns[] = {0, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 29, 30, 31, 32, 33, 34, 35, 36};
static const short joint_at[] = {0, 35, 71, 100, 122, 137, 145};

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
    {29, 8, 7, 1},
};
enum { RUNS = sizeof runs / sizeof runs[0] };

static const sharing ranges[] = {
    {0, 1, 0, 1},
    {3, 37, 1, 1},
    {1, 37, 2, 1},
    {3, 37, 3, 2},
    {8, 37, 5, 3},
    {15, 37, 8, 4},
    {22, 37, 12, 5},
    {29, 37, 17, 6},
};
static const short range_rows[] = {0, 0, 1, 0, 1, 0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 5};

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
    const vd t27 = t26 - t25;
    const vd t28 = t25 - t27;
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
    PUT(0, 6, t40);
    const vd t42 = t14 * t14;
    const vd t43 = t42 - t32;
    const vd t44 = t43 * sc[2 * VS];
    const vd t45 = t36 - ddq[1 * VS];
    const vd t46 = t45 * sc[3 * VS];
    const vd t47 = t44 - t46;
    PUT(0, 7, t47);
    const vd t51 = sc[5 * VS] * t9;
    const vd t53 = sc[4 * VS] * t14;
    const vd t54 = t51 + t53;
    const vd t56 = dq[1 * VS] + dq[2 * VS];
    const vd t57 = t54 * t56;
    const vd t58 = sc[5 * VS] * t27;
    const vd t59 = sc[4 * VS] * t16;
    const vd t60 = t58 - t59;
    const vd t61 = t54 * dq[2 * VS];
    const vd t62 = t60 - t61;
    const vd t63 = t57 - t62;
    const vd t65 = (-0.42499999999999999) * sc[3 * VS];
    const vd t66 = t63 * t65;
    const vd t67 = (-0.42499999999999999) * t28;
    const vd t68 = sc[5 * VS] * sc[3 * VS];
    const vd t69 = sc[4 * VS] * sc[2 * VS];
    const vd t70 = t68 - t69;
    const vd t71 = t67 * t70;
    const vd t72 = t66 + t71;
    const vd t73 = -t72;
    PUT(0, 8, t73);
    const vd t75 = sc[4 * VS] * sc[3 * VS];
    const vd t76 = sc[5 * VS] * sc[2 * VS];
    const vd t77 = t75 + t76;
    const vd t78 = t67 * t77;
    const vd t79 = sc[5 * VS] * t14;
    const vd t80 = sc[4 * VS] * t9;
    const vd t81 = t79 - t80;
    const vd t82 = t81 * t56;
    const vd t83 = sc[5 * VS] * t16;
    const vd t84 = sc[4 * VS] * t27;
    const vd t85 = t83 + t84;
    const vd t86 = t81 * dq[2 * VS];
    const vd t87 = t85 + t86;
    const vd t88 = t82 + t87;
    const vd t89 = t88 * t65;
    const vd t90 = t78 - t89;
    PUT(0, 9, t90);
    const vd t92 = t56 * t54;
    const vd t93 = t92 * t70;
    const vd t94 = t87 * t77;
    const vd t95 = t93 + t94;
    PUT(0, 10, t95);
    const vd t97 = t82 * t77;
    const vd t98 = t97 - t93;
    PUT(0, 11, t98);
    const vd t100 = t88 * t70;
    const vd t101 = t63 * t77;
    const vd t102 = t100 - t101;
    PUT(0, 12, t102);
    const vd t104 = t56 * t56;
    const vd t105 = t54 * t54;
    const vd t106 = t104 - t105;
    const vd t107 = t106 * t70;
    const vd t108 = t54 * t81;
    const vd t110 = ddq[1 * VS] + ddq[2 * VS];
    const vd t111 = t108 + t110;
    const vd t112 = t111 * t77;
    const vd t113 = t107 + t112;
    PUT(0, 13, t113);
    const vd t115 = t81 * t81;
    const vd t116 = t115 - t104;
    const vd t117 = t116 * t77;
    const vd t118 = t108 - t110;
    const vd t119 = t118 * t70;
    const vd t120 = t117 - t119;
    PUT(0, 14, t120);
    const vd t124 = sc[7 * VS] * t54;
    const vd t126 = sc[6 * VS] * t81;
    const vd t127 = t124 + t126;
    const vd t129 = t56 + dq[3 * VS];
    const vd t130 = t127 * t129;
    const vd t131 = sc[7 * VS] * t62;
    const vd t132 = sc[6 * VS] * t87;
    const vd t133 = t131 - t132;
    const vd t134 = t127 * dq[3 * VS];
    const vd t135 = t133 - t134;
    const vd t136 = t130 - t135;
    const vd t138 = (-0.39219999999999999) * t70;
    const vd t139 = t65 + t138;
    const vd t140 = t136 * t139;
    const vd t141 = sc[7 * VS] * t81;
    const vd t142 = sc[6 * VS] * t54;
    const vd t143 = t141 - t142;
    const vd t144 = t127 * t143;
    const vd t146 = t110 + ddq[3 * VS];
    const vd t147 = t144 + t146;
    const vd t149 = 0.1333 * t70;
    const vd t150 = sc[6 * VS] * t149;
    const vd t151 = 0.1333 * t77;
    const vd t152 = sc[7 * VS] * t151;
    const vd t153 = t150 + t152;
    const vd t154 = t147 * t153;
    const vd t155 = t140 + t154;
    const vd t156 = t143 * t143;
    const vd t157 = t129 * t129;
    const vd t158 = t156 + t157;
    const vd t159 = sc[7 * VS] * t149;
    const vd t160 = sc[6 * VS] * t151;
    const vd t161 = t159 - t160;
    const vd t162 = t158 * t161;
    const vd t163 = t155 + t162;
    const vd t164 = (-0.39219999999999999) * t63;
    const vd t165 = t105 + t115;
    const vd t166 = 0.1333 * t165;
    const vd t167 = t164 - t166;
    const vd t168 = t67 + t167;
    const vd t169 = sc[7 * VS] * t70;
    const vd t170 = sc[6 * VS] * t77;
    const vd t171 = t169 - t170;
    const vd t172 = t168 * t171;
    const vd t173 = t163 + t172;
    const vd t174 = -t173;
    PUT(0, 15, t174);
    const vd t176 = t127 * t127;
    const vd t177 = t176 + t157;
    const vd t178 = t177 * t153;
    const vd t179 = t143 * t129;
    const vd t180 = sc[7 * VS] * t87;
    const vd t181 = sc[6 * VS] * t62;
    const vd t182 = t180 + t181;
    const vd t183 = t143 * dq[3 * VS];
    const vd t184 = t182 + t183;
    const vd t185 = t179 + t184;
    const vd t186 = t185 * t139;
    const vd t187 = t178 - t186;
    const vd t188 = t144 - t146;
    const vd t189 = t188 * t161;
    const vd t190 = t187 + t189;
    const vd t191 = sc[6 * VS] * t70;
    const vd t192 = sc[7 * VS] * t77;
    const vd t193 = t191 + t192;
    const vd t194 = t168 * t193;
    const vd t195 = t190 + t194;
    PUT(0, 16, t195);
    const vd t197 = t129 * t127;
    const vd t198 = t197 * t171;
    const vd t199 = t184 * t193;
    const vd t200 = t198 + t199;
    PUT(0, 17, t200);
    const vd t202 = t179 * t193;
    const vd t203 = t202 - t198;
    PUT(0, 18, t203);
    const vd t205 = t185 * t171;
    const vd t206 = t136 * t193;
    const vd t207 = t205 - t206;
    PUT(0, 19, t207);
    const vd t209 = t157 - t176;
    const vd t210 = t209 * t171;
    const vd t211 = t147 * t193;
    const vd t212 = t210 + t211;
    PUT(0, 20, t212);
    const vd t214 = t156 - t157;
    const vd t215 = t214 * t193;
    const vd t216 = t188 * t171;
    const vd t217 = t215 - t216;
    PUT(0, 21, t217);
    const vd t221 = sc[9 * VS] * t127;
    const vd t223 = sc[8 * VS] * t129;
    const vd t224 = t221 + t223;
    const vd t226 = dq[4 * VS] - t143;
    const vd t227 = t224 * t226;
    const vd t228 = sc[9 * VS] * t146;
    const vd t229 = sc[8 * VS] * t184;
    const vd t230 = t228 - t229;
    const vd t231 = t224 * dq[4 * VS];
    const vd t232 = t230 - t231;
    const vd t233 = t227 - t232;
    const vd t234 = t233 * t153;
    const vd t236 = (-0.099699999999999997) * t185;
    const vd t237 = t168 + t236;
    const vd t238 = sc[9 * VS] * t237;
    const vd t240 = 9.8100000000000005 * sc[2 * VS];
    const vd t241 = t42 + t32;
    const vd t242 = (-0.42499999999999999) * t241;
    const vd t243 = t240 - t242;
    const vd t244 = sc[5 * VS] * t243;
    const vd t245 = 9.8100000000000005 * sc[3 * VS];
    const vd t246 = (-0.42499999999999999) * t38;
    const vd t247 = t245 + t246;
    const vd t248 = sc[4 * VS] * t247;
    const vd t249 = t244 + t248;
    const vd t250 = t57 + t62;
    const vd t251 = 0.1333 * t250;
    const vd t252 = t115 + t104;
    const vd t253 = (-0.39219999999999999) * t252;
    const vd t254 = t251 - t253;
    const vd t255 = t249 + t254;
    const vd t256 = sc[7 * VS] * t255;
    const vd t257 = sc[5 * VS] * t247;
    const vd t258 = sc[4 * VS] * t243;
    const vd t259 = t257 - t258;
    const vd t260 = (-0.39219999999999999) * t111;
    const vd t261 = t82 - t87;
    const vd t262 = 0.1333 * t261;
    const vd t263 = t260 + t262;
    const vd t264 = t259 + t263;
    const vd t265 = sc[6 * VS] * t264;
    const vd t266 = t256 + t265;
    const vd t267 = (-0.099699999999999997) * t188;
    const vd t268 = t266 + t267;
    const vd t269 = sc[8 * VS] * t268;
    const vd t270 = t238 - t269;
    const vd t271 = t270 * t171;
    const vd t272 = t234 - t271;
    const vd t273 = sc[9 * VS] * t129;
    const vd t274 = sc[8 * VS] * t127;
    const vd t275 = t273 - t274;
    const vd t276 = t224 * t275;
    const vd t278 = ddq[4 * VS] - t135;
    const vd t279 = t276 + t278;
    const vd t280 = (-0.099699999999999997) * t193;
    const vd t281 = t280 - t139;
    const vd t282 = sc[9 * VS] * t281;
    const vd t283 = sc[8 * VS] * t161;
    const vd t284 = t282 - t283;
    const vd t285 = t279 * t284;
    const vd t286 = t272 + t285;
    const vd t287 = t275 * t275;
    const vd t288 = t226 * t226;
    const vd t289 = t287 + t288;
    const vd t290 = sc[9 * VS] * t161;
    const vd t291 = sc[8 * VS] * t281;
    const vd t292 = t290 + t291;
    const vd t293 = t289 * t292;
    const vd t294 = t286 - t293;
    const vd t295 = sc[7 * VS] * t264;
    const vd t296 = sc[6 * VS] * t255;
    const vd t297 = t295 - t296;
    const vd t298 = (-0.099699999999999997) * t177;
    const vd t299 = t297 - t298;
    const vd t300 = sc[8 * VS] * t193;
    const vd t301 = t299 * t300;
    const vd t302 = t294 - t301;
    PUT(0, 22, t302);
    const vd t304 = t275 * t226;
    const vd t305 = sc[9 * VS] * t184;
    const vd t306 = sc[8 * VS] * t146;
    const vd t307 = t305 + t306;
    const vd t308 = t275 * dq[4 * VS];
    const vd t309 = t307 + t308;
    const vd t310 = t304 + t309;
    const vd t311 = t310 * t153;
    const vd t312 = sc[9 * VS] * t268;
    const vd t313 = sc[8 * VS] * t237;
    const vd t314 = t312 + t313;
    const vd t315 = t314 * t171;
    const vd t316 = t311 + t315;
    const vd t317 = t224 * t224;
    const vd t318 = t317 + t288;
    const vd t319 = t318 * t284;
    const vd t320 = t316 - t319;
    const vd t321 = t276 - t278;
    const vd t322 = t321 * t292;
    const vd t323 = t320 + t322;
    const vd t324 = sc[9 * VS] * t193;
    const vd t325 = t299 * t324;
    const vd t326 = t323 - t325;
    PUT(0, 23, t326);
    const vd t328 = t276 * t171;
    const vd t329 = t226 * t224;
    const vd t330 = t329 * t300;
    const vd t331 = t328 - t330;
    const vd t332 = t309 * t324;
    const vd t333 = t331 + t332;
    PUT(0, 24, t333);
    const vd t335 = t278 * t171;
    const vd t336 = t330 - t335;
    const vd t337 = t304 * t324;
    const vd t338 = t336 + t337;
    PUT(0, 25, t338);
    const vd t340 = t317 - t287;
    const vd t341 = t340 * t171;
    const vd t342 = t310 * t300;
    const vd t343 = t341 + t342;
    const vd t344 = t233 * t324;
    const vd t345 = t343 + t344;
    const vd t346 = -t345;
    PUT(0, 26, t346);
    const vd t348 = t304 - t309;
    const vd t349 = t348 * t171;
    const vd t350 = t288 - t317;
    const vd t351 = t350 * t300;
    const vd t352 = t349 - t351;
    const vd t353 = t279 * t324;
    const vd t354 = t352 + t353;
    PUT(0, 27, t354);
    const vd t356 = t321 * t300;
    const vd t357 = t227 + t232;
    const vd t358 = t357 * t171;
    const vd t359 = t356 - t358;
    const vd t360 = t287 - t288;
    const vd t361 = t360 * t324;
    const vd t362 = t359 + t361;
    PUT(0, 28, t362);
    const vd t366 = sc[11 * VS] * t224;
    const vd t368 = sc[10 * VS] * t226;
    const vd t369 = t366 - t368;
    const vd t371 = t275 + dq[5 * VS];
    const vd t372 = t369 * t371;
    const vd t373 = sc[10 * VS] * t309;
    const vd t374 = sc[11 * VS] * t278;
    const vd t375 = t373 + t374;
    const vd t376 = t369 * dq[5 * VS];
    const vd t377 = t375 + t376;
    const vd t378 = t372 + t377;
    const vd t379 = t378 * t284;
    const vd t381 = 0.099599999999999994 * t321;
    const vd t382 = t314 + t381;
    const vd t383 = sc[10 * VS] * t382;
    const vd t384 = 0.099599999999999994 * t310;
    const vd t385 = t384 - t299;
    const vd t386 = sc[11 * VS] * t385;
    const vd t387 = t383 + t386;
    const vd t388 = t387 * t300;
    const vd t389 = t379 + t388;
    const vd t391 = t232 + ddq[5 * VS];
    const vd t392 = sc[10 * VS] * t224;
    const vd t393 = sc[11 * VS] * t226;
    const vd t394 = t392 + t393;
    const vd t395 = t369 * t394;
    const vd t396 = t391 - t395;
    const vd t397 = 0.099599999999999994 * t171;
    const vd t398 = t397 + t292;
    const vd t399 = sc[10 * VS] * t398;
    const vd t400 = 0.099599999999999994 * t324;
    const vd t401 = t153 + t400;
    const vd t402 = sc[11 * VS] * t401;
    const vd t403 = t399 + t402;
    const vd t404 = t396 * t403;
    const vd t405 = t389 - t404;
    const vd t406 = t394 * t394;
    const vd t407 = t371 * t371;
    const vd t408 = t406 + t407;
    const vd t409 = sc[10 * VS] * t401;
    const vd t410 = sc[11 * VS] * t398;
    const vd t411 = t409 - t410;
    const vd t412 = t408 * t411;
    const vd t413 = t405 + t412;
    const vd t414 = 0.099599999999999994 * t318;
    const vd t415 = t270 - t414;
    const vd t416 = sc[11 * VS] * t171;
    const vd t417 = sc[10 * VS] * t324;
    const vd t418 = t416 - t417;
    const vd t419 = t415 * t418;
    const vd t420 = t413 - t419;
    PUT(0, 29, t420);
    const vd t422 = sc[11 * VS] * t309;
    const vd t423 = sc[10 * VS] * t278;
    const vd t424 = t422 - t423;
    const vd t425 = t394 * dq[5 * VS];
    const vd t426 = t424 - t425;
    const vd t427 = t394 * t371;
    const vd t428 = t426 - t427;
    const vd t429 = t428 * t284;
    const vd t430 = sc[11 * VS] * t382;
    const vd t431 = sc[10 * VS] * t385;
    const vd t432 = t430 - t431;
    const vd t433 = t432 * t300;
    const vd t434 = t429 + t433;
    const vd t435 = t369 * t369;
    const vd t436 = t435 + t407;
    const vd t437 = t436 * t403;
    const vd t438 = t434 + t437;
    const vd t439 = t395 + t391;
    const vd t440 = t439 * t411;
    const vd t441 = t438 + t440;
    const vd t442 = sc[10 * VS] * t171;
    const vd t443 = sc[11 * VS] * t324;
    const vd t444 = t442 + t443;
    const vd t445 = t415 * t444;
    const vd t446 = t441 + t445;
    PUT(0, 30, t446);
    const vd t448 = t371 * t369;
    const vd t449 = t448 * t418;
    const vd t450 = t395 * t300;
    const vd t451 = t449 - t450;
    const vd t452 = t426 * t444;
    const vd t453 = t451 + t452;
    PUT(0, 31, t453);
    const vd t455 = t391 * t300;
    const vd t456 = t455 + t449;
    const vd t457 = t427 * t444;
    const vd t458 = t456 + t457;
    const vd t459 = -t458;
    PUT(0, 32, t459);
    const vd t461 = t428 * t418;
    const vd t462 = t435 - t406;
    const vd t463 = t462 * t300;
    const vd t464 = t461 - t463;
    const vd t465 = t378 * t444;
    const vd t466 = t464 - t465;
    PUT(0, 33, t466);
    const vd t468 = t407 - t435;
    const vd t469 = t468 * t418;
    const vd t470 = t427 + t426;
    const vd t471 = t470 * t300;
    const vd t472 = t469 - t471;
    const vd t473 = t396 * t444;
    const vd t474 = t472 + t473;
    PUT(0, 34, t474);
    const vd t476 = t439 * t418;
    const vd t477 = t372 - t377;
    const vd t478 = t477 * t300;
    const vd t479 = t476 - t478;
    const vd t480 = t406 - t407;
    const vd t481 = t480 * t444;
    const vd t482 = t479 + t481;
    PUT(0, 35, t482);
    PUT(1, 1, t245);
    const vd t486 = -t240;
    PUT(1, 2, t486);
    const vd t488 = -t36;
    PUT(1, 3, t488);
    PUT(1, 4, ddq[1 * VS]);
    const vd t491 = t33 - t42;
    PUT(1, 5, t491);
    PUT(1, 6, t13);
    PUT(1, 7, t26);
    const vd t495 = (-0.42499999999999999) * sc[5 * VS];
    const vd t496 = t111 * t495;
    const vd t497 = (-0.42499999999999999) * sc[4 * VS];
    const vd t498 = t252 * t497;
    const vd t499 = t496 - t498;
    const vd t500 = t499 + t259;
    PUT(1, 8, t500);
    const vd t502 = t118 * t497;
    const vd t503 = t105 + t104;
    const vd t504 = t503 * t495;
    const vd t505 = t502 - t504;
    const vd t506 = t505 - t249;
    PUT(1, 9, t506);
    const vd t508 = -t108;
    PUT(1, 10, t508);
    PUT(1, 11, t110);
    const vd t511 = t105 - t115;
    PUT(1, 12, t511);
    const vd t513 = -t261;
    PUT(1, 13, t513);
    PUT(1, 14, t250);
    const vd t516 = t495 + (-0.39219999999999999);
    const vd t517 = sc[7 * VS] * t516;
    const vd t518 = sc[6 * VS] * t497;
    const vd t519 = t517 - t518;
    const vd t520 = t147 * t519;
    const vd t521 = t297 + t520;
    const vd t522 = sc[7 * VS] * t497;
    const vd t523 = sc[6 * VS] * t516;
    const vd t524 = t522 + t523;
    const vd t525 = t158 * t524;
    const vd t526 = t521 - t525;
    PUT(1, 15, t526);
    const vd t528 = t188 * t524;
    const vd t529 = t177 * t519;
    const vd t530 = t266 + t529;
    const vd t531 = t528 - t530;
    PUT(1, 16, t531);
    const vd t533 = -t144;
    PUT(1, 17, t533);
    PUT(1, 18, t146);
    const vd t536 = t176 - t156;
    PUT(1, 19, t536);
    const vd t538 = t179 - t184;
    const vd t539 = -t538;
    PUT(1, 20, t539);
    const vd t541 = t130 + t135;
    PUT(1, 21, t541);
    const vd t543 = t299 * sc[9 * VS];
    const vd t544 = t233 * t519;
    const vd t546 = 0.099699999999999997 + t524;
    const vd t547 = sc[8 * VS] * t546;
    const vd t548 = t279 * t547;
    const vd t549 = t544 + t548;
    const vd t550 = sc[9 * VS] * t546;
    const vd t551 = t289 * t550;
    const vd t552 = t549 + t551;
    const vd t553 = t543 - t552;
    PUT(1, 22, t553);
    const vd t555 = t318 * t547;
    const vd t556 = t310 * t519;
    const vd t557 = t555 - t556;
    const vd t558 = t321 * t550;
    const vd t559 = t557 + t558;
    const vd t560 = t299 * sc[8 * VS];
    const vd t561 = t559 - t560;
    PUT(1, 23, t561);
    const vd t563 = t329 * sc[9 * VS];
    const vd t564 = t309 * sc[8 * VS];
    const vd t565 = t563 + t564;
    PUT(1, 24, t565);
    const vd t567 = t304 * sc[8 * VS];
    const vd t568 = t567 - t563;
    PUT(1, 25, t568);
    const vd t570 = t310 * sc[9 * VS];
    const vd t571 = t233 * sc[8 * VS];
    const vd t572 = t570 - t571;
    PUT(1, 26, t572);
    const vd t574 = t350 * sc[9 * VS];
    const vd t575 = t279 * sc[8 * VS];
    const vd t576 = t574 + t575;
    PUT(1, 27, t576);
    const vd t578 = t360 * sc[8 * VS];
    const vd t579 = t321 * sc[9 * VS];
    const vd t580 = t578 - t579;
    PUT(1, 28, t580);
    const vd t582 = 0.099599999999999994 * sc[8 * VS];
    const vd t583 = t582 - t519;
    const vd t584 = sc[10 * VS] * t583;
    const vd t585 = sc[11 * VS] * t550;
    const vd t586 = t584 - t585;
    const vd t587 = t408 * t586;
    const vd t588 = t378 * t547;
    const vd t589 = t387 * sc[9 * VS];
    const vd t590 = t588 + t589;
    const vd t591 = sc[10 * VS] * t550;
    const vd t592 = sc[11 * VS] * t583;
    const vd t593 = t591 + t592;
    const vd t594 = t396 * t593;
    const vd t595 = t590 + t594;
    const vd t596 = t587 - t595;
    const vd t597 = sc[10 * VS] * sc[8 * VS];
    const vd t598 = t415 * t597;
    const vd t599 = t596 + t598;
    PUT(1, 29, t599);
    const vd t601 = t436 * t593;
    const vd t602 = t428 * t547;
    const vd t603 = t432 * sc[9 * VS];
    const vd t604 = t602 + t603;
    const vd t605 = t601 - t604;
    const vd t606 = t439 * t586;
    const vd t607 = t605 + t606;
    const vd t608 = sc[11 * VS] * sc[8 * VS];
    const vd t609 = t415 * t608;
    const vd t610 = t607 + t609;
    PUT(1, 30, t610);
    const vd t612 = t395 * sc[9 * VS];
    const vd t613 = t448 * t597;
    const vd t614 = t612 - t613;
    const vd t615 = t426 * t608;
    const vd t616 = t614 + t615;
    PUT(1, 31, t616);
    const vd t618 = t391 * sc[9 * VS];
    const vd t619 = t618 + t613;
    const vd t620 = t427 * t608;
    const vd t621 = t619 - t620;
    PUT(1, 32, t621);
    const vd t623 = t462 * sc[9 * VS];
    const vd t624 = t428 * t597;
    const vd t625 = t623 - t624;
    const vd t626 = t378 * t608;
    const vd t627 = t625 - t626;
    PUT(1, 33, t627);
    const vd t629 = t470 * sc[9 * VS];
    const vd t630 = t468 * t597;
    const vd t631 = t629 - t630;
    const vd t632 = t396 * t608;
    const vd t633 = t631 + t632;
    PUT(1, 34, t633);
    const vd t635 = t477 * sc[9 * VS];
    const vd t636 = t439 * t597;
    const vd t637 = t635 - t636;
    const vd t638 = t480 * t608;
    const vd t639 = t637 + t638;
    PUT(1, 35, t639);
    PUT(2, 8, t259);
    const vd t650 = -t249;
    PUT(2, 9, t650);
    PUT(2, 10, t508);
    PUT(2, 11, t110);
    PUT(2, 12, t511);
    PUT(2, 13, t513);
    PUT(2, 14, t250);
    const vd t657 = (-0.39219999999999999) * sc[7 * VS];
    const vd t658 = t147 * t657;
    const vd t659 = t297 + t658;
    const vd t660 = (-0.39219999999999999) * sc[6 * VS];
    const vd t661 = t158 * t660;
    const vd t662 = t659 - t661;
    PUT(2, 15, t662);
    const vd t664 = t188 * t660;
    const vd t665 = t177 * t657;
    const vd t666 = t266 + t665;
    const vd t667 = t664 - t666;
    PUT(2, 16, t667);
    PUT(2, 17, t533);
    PUT(2, 18, t146);
    PUT(2, 19, t536);
    PUT(2, 20, t539);
    PUT(2, 21, t541);
    const vd t674 = t233 * t657;
    const vd t675 = 0.099699999999999997 + t660;
    const vd t676 = sc[8 * VS] * t675;
    const vd t677 = t279 * t676;
    const vd t678 = t674 + t677;
    const vd t679 = sc[9 * VS] * t675;
    const vd t680 = t289 * t679;
    const vd t681 = t678 + t680;
    const vd t682 = t543 - t681;
    PUT(2, 22, t682);
    const vd t684 = t318 * t676;
    const vd t685 = t310 * t657;
    const vd t686 = t684 - t685;
    const vd t687 = t321 * t679;
    const vd t688 = t686 + t687;
    const vd t689 = t688 - t560;
    PUT(2, 23, t689);
    PUT(2, 24, t565);
    PUT(2, 25, t568);
    PUT(2, 26, t572);
    PUT(2, 27, t576);
    PUT(2, 28, t580);
    const vd t696 = t582 - t657;
    const vd t697 = sc[10 * VS] * t696;
    const vd t698 = sc[11 * VS] * t679;
    const vd t699 = t697 - t698;
    const vd t700 = t408 * t699;
    const vd t701 = t378 * t676;
    const vd t702 = t701 + t589;
    const vd t703 = sc[10 * VS] * t679;
    const vd t704 = sc[11 * VS] * t696;
    const vd t705 = t703 + t704;
    const vd t706 = t396 * t705;
    const vd t707 = t702 + t706;
    const vd t708 = t700 - t707;
    const vd t709 = t708 + t598;
    PUT(2, 29, t709);
    const vd t711 = t436 * t705;
    const vd t712 = t428 * t676;
    const vd t713 = t712 + t603;
    const vd t714 = t711 - t713;
    const vd t715 = t439 * t699;
    const vd t716 = t714 + t715;
    const vd t717 = t716 + t609;
    PUT(2, 30, t717);
    PUT(2, 31, t616);
    PUT(2, 32, t621);
    PUT(2, 33, t627);
    PUT(2, 34, t633);
    PUT(2, 35, t639);
    PUT(3, 15, t297);
    const vd t740 = -t266;
    PUT(3, 16, t740);
    PUT(3, 17, t533);
    PUT(3, 18, t146);
    PUT(3, 19, t536);
    PUT(3, 20, t539);
    PUT(3, 21, t541);
    const vd t747 = (-0.099699999999999997) * sc[8 * VS];
    const vd t748 = t279 * t747;
    const vd t749 = 0.099699999999999997 * sc[9 * VS];
    const vd t750 = t289 * t749;
    const vd t751 = t748 - t750;
    const vd t752 = t751 + t543;
    PUT(3, 22, t752);
    const vd t754 = t321 * t749;
    const vd t755 = t318 * t747;
    const vd t756 = t754 - t755;
    const vd t757 = t756 - t560;
    PUT(3, 23, t757);
    PUT(3, 24, t565);
    PUT(3, 25, t568);
    PUT(3, 26, t572);
    PUT(3, 27, t576);
    PUT(3, 28, t580);
    const vd t764 = t378 * t747;
    const vd t765 = t764 - t589;
    const vd t766 = sc[10 * VS] * t749;
    const vd t767 = sc[11 * VS] * t582;
    const vd t768 = t766 + t767;
    const vd t769 = t396 * t768;
    const vd t770 = t765 - t769;
    const vd t771 = sc[10 * VS] * t582;
    const vd t772 = sc[11 * VS] * t749;
    const vd t773 = t771 - t772;
    const vd t774 = t408 * t773;
    const vd t775 = t770 + t774;
    const vd t776 = t775 + t598;
    PUT(3, 29, t776);
    const vd t778 = t428 * t747;
    const vd t779 = t778 - t603;
    const vd t780 = t436 * t768;
    const vd t781 = t779 + t780;
    const vd t782 = t439 * t773;
    const vd t783 = t781 + t782;
    const vd t784 = t783 + t609;
    PUT(3, 30, t784);
    PUT(3, 31, t616);
    PUT(3, 32, t621);
    PUT(3, 33, t627);
    PUT(3, 34, t633);
    PUT(3, 35, t639);
    PUT(4, 22, t270);
    const vd t814 = -t314;
    PUT(4, 23, t814);
    const vd t816 = -t276;
    PUT(4, 24, t816);
    PUT(4, 25, t278);
    PUT(4, 26, t340);
    const vd t820 = -t348;
    PUT(4, 27, t820);
    PUT(4, 28, t357);
    const vd t823 = 0.099599999999999994 * sc[10 * VS];
    const vd t824 = t396 * t823;
    const vd t825 = 0.099599999999999994 * sc[11 * VS];
    const vd t826 = t408 * t825;
    const vd t827 = t824 + t826;
    const vd t828 = t415 * sc[11 * VS];
    const vd t829 = t827 + t828;
    PUT(4, 29, t829);
    const vd t831 = t439 * t825;
    const vd t832 = t436 * t823;
    const vd t833 = t831 - t832;
    const vd t834 = t415 * sc[10 * VS];
    const vd t835 = t833 - t834;
    PUT(4, 30, t835);
    const vd t837 = t448 * sc[11 * VS];
    const vd t838 = t426 * sc[10 * VS];
    const vd t839 = t837 + t838;
    const vd t840 = -t839;
    PUT(4, 31, t840);
    const vd t842 = t427 * sc[10 * VS];
    const vd t843 = t837 + t842;
    PUT(4, 32, t843);
    const vd t845 = t378 * sc[10 * VS];
    const vd t846 = t428 * sc[11 * VS];
    const vd t847 = t845 - t846;
    PUT(4, 33, t847);
    const vd t849 = t468 * sc[11 * VS];
    const vd t850 = t396 * sc[10 * VS];
    const vd t851 = t849 + t850;
    const vd t852 = -t851;
    PUT(4, 34, t852);
    const vd t854 = t439 * sc[11 * VS];
    const vd t855 = t480 * sc[10 * VS];
    const vd t856 = t854 + t855;
    const vd t857 = -t856;
    PUT(4, 35, t857);
    const vd t888 = -t387;
    PUT(5, 29, t888);
    const vd t890 = -t432;
    PUT(5, 30, t890);
    PUT(5, 31, t395);
    PUT(5, 32, t391);
    PUT(5, 33, t462);
    PUT(5, 34, t470);
    PUT(5, 35, t477);

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
    const vd t27 = t26 - t25;
    const vd t28 = t25 - t27;
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
    PUT(0, 6, t40);
    const vd t42 = t14 * t14;
    const vd t43 = t42 - t32;
    const vd t44 = t43 * sc[2 * VS];
    const vd t45 = t36 - ddq[1 * VS];
    const vd t46 = t45 * sc[3 * VS];
    const vd t47 = t44 - t46;
    PUT(0, 7, t47);
    const vd t51 = sc[5 * VS] * t9;
    const vd t53 = sc[4 * VS] * t14;
    const vd t54 = t51 + t53;
    const vd t56 = dq[1 * VS] + dq[2 * VS];
    const vd t57 = t54 * t56;
    const vd t58 = sc[5 * VS] * t27;
    const vd t59 = sc[4 * VS] * t16;
    const vd t60 = t58 - t59;
    const vd t61 = t54 * dq[2 * VS];
    const vd t62 = t60 - t61;
    const vd t63 = t57 - t62;
    const vd t65 = (-0.42499999999999999) * sc[3 * VS];
    const vd t66 = t63 * t65;
    const vd t67 = (-0.42499999999999999) * t28;
    const vd t68 = sc[5 * VS] * sc[3 * VS];
    const vd t69 = sc[4 * VS] * sc[2 * VS];
    const vd t70 = t68 - t69;
    const vd t71 = t67 * t70;
    const vd t72 = t66 + t71;
    const vd t73 = -t72;
    PUT(0, 8, t73);
    const vd t75 = sc[4 * VS] * sc[3 * VS];
    const vd t76 = sc[5 * VS] * sc[2 * VS];
    const vd t77 = t75 + t76;
    const vd t78 = t67 * t77;
    const vd t79 = sc[5 * VS] * t14;
    const vd t80 = sc[4 * VS] * t9;
    const vd t81 = t79 - t80;
    const vd t82 = t81 * t56;
    const vd t83 = sc[5 * VS] * t16;
    const vd t84 = sc[4 * VS] * t27;
    const vd t85 = t83 + t84;
    const vd t86 = t81 * dq[2 * VS];
    const vd t87 = t85 + t86;
    const vd t88 = t82 + t87;
    const vd t89 = t88 * t65;
    const vd t90 = t78 - t89;
    PUT(0, 9, t90);
    const vd t92 = t56 * t54;
    const vd t93 = t92 * t70;
    const vd t94 = t87 * t77;
    const vd t95 = t93 + t94;
    PUT(0, 10, t95);
    const vd t97 = t82 * t77;
    const vd t98 = t97 - t93;
    PUT(0, 11, t98);
    const vd t100 = t88 * t70;
    const vd t101 = t63 * t77;
    const vd t102 = t100 - t101;
    PUT(0, 12, t102);
    const vd t104 = t56 * t56;
    const vd t105 = t54 * t54;
    const vd t106 = t104 - t105;
    const vd t107 = t106 * t70;
    const vd t108 = t54 * t81;
    const vd t110 = ddq[1 * VS] + ddq[2 * VS];
    const vd t111 = t108 + t110;
    const vd t112 = t111 * t77;
    const vd t113 = t107 + t112;
    PUT(0, 13, t113);
    const vd t115 = t81 * t81;
    const vd t116 = t115 - t104;
    const vd t117 = t116 * t77;
    const vd t118 = t108 - t110;
    const vd t119 = t118 * t70;
    const vd t120 = t117 - t119;
    PUT(0, 14, t120);
    const vd t124 = sc[7 * VS] * t54;
    const vd t126 = sc[6 * VS] * t81;
    const vd t127 = t124 + t126;
    const vd t129 = t56 + dq[3 * VS];
    const vd t130 = t127 * t129;
    const vd t131 = sc[7 * VS] * t62;
    const vd t132 = sc[6 * VS] * t87;
    const vd t133 = t131 - t132;
    const vd t134 = t127 * dq[3 * VS];
    const vd t135 = t133 - t134;
    const vd t136 = t130 - t135;
    const vd t138 = (-0.39219999999999999) * t70;
    const vd t139 = t65 + t138;
    const vd t140 = t136 * t139;
    const vd t141 = sc[7 * VS] * t81;
    const vd t142 = sc[6 * VS] * t54;
    const vd t143 = t141 - t142;
    const vd t144 = t127 * t143;
    const vd t146 = t110 + ddq[3 * VS];
    const vd t147 = t144 + t146;
    const vd t149 = 0.1333 * t70;
    const vd t150 = sc[6 * VS] * t149;
    const vd t151 = 0.1333 * t77;
    const vd t152 = sc[7 * VS] * t151;
    const vd t153 = t150 + t152;
    const vd t154 = t147 * t153;
    const vd t155 = t140 + t154;
    const vd t156 = t143 * t143;
    const vd t157 = t129 * t129;
    const vd t158 = t156 + t157;
    const vd t159 = sc[7 * VS] * t149;
    const vd t160 = sc[6 * VS] * t151;
    const vd t161 = t159 - t160;
    const vd t162 = t158 * t161;
    const vd t163 = t155 + t162;
    const vd t164 = (-0.39219999999999999) * t63;
    const vd t165 = t105 + t115;
    const vd t166 = 0.1333 * t165;
    const vd t167 = t164 - t166;
    const vd t168 = t67 + t167;
    const vd t169 = sc[7 * VS] * t70;
    const vd t170 = sc[6 * VS] * t77;
    const vd t171 = t169 - t170;
    const vd t172 = t168 * t171;
    const vd t173 = t163 + t172;
    const vd t174 = -t173;
    PUT(0, 15, t174);
    const vd t176 = t127 * t127;
    const vd t177 = t176 + t157;
    const vd t178 = t177 * t153;
    const vd t179 = t143 * t129;
    const vd t180 = sc[7 * VS] * t87;
    const vd t181 = sc[6 * VS] * t62;
    const vd t182 = t180 + t181;
    const vd t183 = t143 * dq[3 * VS];
    const vd t184 = t182 + t183;
    const vd t185 = t179 + t184;
    const vd t186 = t185 * t139;
    const vd t187 = t178 - t186;
    const vd t188 = t144 - t146;
    const vd t189 = t188 * t161;
    const vd t190 = t187 + t189;
    const vd t191 = sc[6 * VS] * t70;
    const vd t192 = sc[7 * VS] * t77;
    const vd t193 = t191 + t192;
    const vd t194 = t168 * t193;
    const vd t195 = t190 + t194;
    PUT(0, 16, t195);
    const vd t197 = t129 * t127;
    const vd t198 = t197 * t171;
    const vd t199 = t184 * t193;
    const vd t200 = t198 + t199;
    PUT(0, 17, t200);
    const vd t202 = t179 * t193;
    const vd t203 = t202 - t198;
    PUT(0, 18, t203);
    const vd t205 = t185 * t171;
    const vd t206 = t136 * t193;
    const vd t207 = t205 - t206;
    PUT(0, 19, t207);
    const vd t209 = t157 - t176;
    const vd t210 = t209 * t171;
    const vd t211 = t147 * t193;
    const vd t212 = t210 + t211;
    PUT(0, 20, t212);
    const vd t214 = t156 - t157;
    const vd t215 = t214 * t193;
    const vd t216 = t188 * t171;
    const vd t217 = t215 - t216;
    PUT(0, 21, t217);
    const vd t221 = sc[9 * VS] * t127;
    const vd t223 = sc[8 * VS] * t129;
    const vd t224 = t221 + t223;
    const vd t226 = dq[4 * VS] - t143;
    const vd t227 = t224 * t226;
    const vd t228 = sc[9 * VS] * t146;
    const vd t229 = sc[8 * VS] * t184;
    const vd t230 = t228 - t229;
    const vd t231 = t224 * dq[4 * VS];
    const vd t232 = t230 - t231;
    const vd t233 = t227 - t232;
    const vd t234 = t233 * t153;
    const vd t236 = (-0.099699999999999997) * t185;
    const vd t237 = t168 + t236;
    const vd t238 = sc[9 * VS] * t237;
    const vd t240 = 9.8100000000000005 * sc[2 * VS];
    const vd t241 = t42 + t32;
    const vd t242 = (-0.42499999999999999) * t241;
    const vd t243 = t240 - t242;
    const vd t244 = sc[5 * VS] * t243;
    const vd t245 = 9.8100000000000005 * sc[3 * VS];
    const vd t246 = (-0.42499999999999999) * t38;
    const vd t247 = t245 + t246;
    const vd t248 = sc[4 * VS] * t247;
    const vd t249 = t244 + t248;
    const vd t250 = t57 + t62;
    const vd t251 = 0.1333 * t250;
    const vd t252 = t115 + t104;
    const vd t253 = (-0.39219999999999999) * t252;
    const vd t254 = t251 - t253;
    const vd t255 = t249 + t254;
    const vd t256 = sc[7 * VS] * t255;
    const vd t257 = sc[5 * VS] * t247;
    const vd t258 = sc[4 * VS] * t243;
    const vd t259 = t257 - t258;
    const vd t260 = (-0.39219999999999999) * t111;
    const vd t261 = t82 - t87;
    const vd t262 = 0.1333 * t261;
    const vd t263 = t260 + t262;
    const vd t264 = t259 + t263;
    const vd t265 = sc[6 * VS] * t264;
    const vd t266 = t256 + t265;
    const vd t267 = (-0.099699999999999997) * t188;
    const vd t268 = t266 + t267;
    const vd t269 = sc[8 * VS] * t268;
    const vd t270 = t238 - t269;
    const vd t271 = t270 * t171;
    const vd t272 = t234 - t271;
    const vd t273 = sc[9 * VS] * t129;
    const vd t274 = sc[8 * VS] * t127;
    const vd t275 = t273 - t274;
    const vd t276 = t224 * t275;
    const vd t278 = ddq[4 * VS] - t135;
    const vd t279 = t276 + t278;
    const vd t280 = (-0.099699999999999997) * t193;
    const vd t281 = t280 - t139;
    const vd t282 = sc[9 * VS] * t281;
    const vd t283 = sc[8 * VS] * t161;
    const vd t284 = t282 - t283;
    const vd t285 = t279 * t284;
    const vd t286 = t272 + t285;
    const vd t287 = t275 * t275;
    const vd t288 = t226 * t226;
    const vd t289 = t287 + t288;
    const vd t290 = sc[9 * VS] * t161;
    const vd t291 = sc[8 * VS] * t281;
    const vd t292 = t290 + t291;
    const vd t293 = t289 * t292;
    const vd t294 = t286 - t293;
    const vd t295 = sc[7 * VS] * t264;
    const vd t296 = sc[6 * VS] * t255;
    const vd t297 = t295 - t296;
    const vd t298 = (-0.099699999999999997) * t177;
    const vd t299 = t297 - t298;
    const vd t300 = sc[8 * VS] * t193;
    const vd t301 = t299 * t300;
    const vd t302 = t294 - t301;
    PUT(0, 22, t302);
    const vd t304 = t275 * t226;
    const vd t305 = sc[9 * VS] * t184;
    const vd t306 = sc[8 * VS] * t146;
    const vd t307 = t305 + t306;
    const vd t308 = t275 * dq[4 * VS];
    const vd t309 = t307 + t308;
    const vd t310 = t304 + t309;
    const vd t311 = t310 * t153;
    const vd t312 = sc[9 * VS] * t268;
    const vd t313 = sc[8 * VS] * t237;
    const vd t314 = t312 + t313;
    const vd t315 = t314 * t171;
    const vd t316 = t311 + t315;
    const vd t317 = t224 * t224;
    const vd t318 = t317 + t288;
    const vd t319 = t318 * t284;
    const vd t320 = t316 - t319;
    const vd t321 = t276 - t278;
    const vd t322 = t321 * t292;
    const vd t323 = t320 + t322;
    const vd t324 = sc[9 * VS] * t193;
    const vd t325 = t299 * t324;
    const vd t326 = t323 - t325;
    PUT(0, 23, t326);
    const vd t328 = t276 * t171;
    const vd t329 = t226 * t224;
    const vd t330 = t329 * t300;
    const vd t331 = t328 - t330;
    const vd t332 = t309 * t324;
    const vd t333 = t331 + t332;
    PUT(0, 24, t333);
    const vd t335 = t278 * t171;
    const vd t336 = t330 - t335;
    const vd t337 = t304 * t324;
    const vd t338 = t336 + t337;
    PUT(0, 25, t338);
    const vd t340 = t317 - t287;
    const vd t341 = t340 * t171;
    const vd t342 = t310 * t300;
    const vd t343 = t341 + t342;
    const vd t344 = t233 * t324;
    const vd t345 = t343 + t344;
    const vd t346 = -t345;
    PUT(0, 26, t346);
    const vd t348 = t304 - t309;
    const vd t349 = t348 * t171;
    const vd t350 = t288 - t317;
    const vd t351 = t350 * t300;
    const vd t352 = t349 - t351;
    const vd t353 = t279 * t324;
    const vd t354 = t352 + t353;
    PUT(0, 27, t354);
    const vd t356 = t321 * t300;
    const vd t357 = t227 + t232;
    const vd t358 = t357 * t171;
    const vd t359 = t356 - t358;
    const vd t360 = t287 - t288;
    const vd t361 = t360 * t324;
    const vd t362 = t359 + t361;
    PUT(0, 28, t362);
    const vd t366 = sc[11 * VS] * t224;
    const vd t368 = sc[10 * VS] * t226;
    const vd t369 = t366 - t368;
    const vd t371 = t275 + dq[5 * VS];
    const vd t372 = t369 * t371;
    const vd t373 = sc[10 * VS] * t309;
    const vd t374 = sc[11 * VS] * t278;
    const vd t375 = t373 + t374;
    const vd t376 = t369 * dq[5 * VS];
    const vd t377 = t375 + t376;
    const vd t378 = t372 + t377;
    const vd t379 = t378 * t284;
    const vd t381 = 0.099599999999999994 * t321;
    const vd t382 = t314 + t381;
    const vd t383 = sc[10 * VS] * t382;
    const vd t384 = 0.099599999999999994 * t310;
    const vd t385 = t384 - t299;
    const vd t386 = sc[11 * VS] * t385;
    const vd t387 = t383 + t386;
    const vd t388 = t387 * t300;
    const vd t389 = t379 + t388;
    const vd t391 = t232 + ddq[5 * VS];
    const vd t392 = sc[10 * VS] * t224;
    const vd t393 = sc[11 * VS] * t226;
    const vd t394 = t392 + t393;
    const vd t395 = t369 * t394;
    const vd t396 = t391 - t395;
    const vd t397 = 0.099599999999999994 * t171;
    const vd t398 = t397 + t292;
    const vd t399 = sc[10 * VS] * t398;
    const vd t400 = 0.099599999999999994 * t324;
    const vd t401 = t153 + t400;
    const vd t402 = sc[11 * VS] * t401;
    const vd t403 = t399 + t402;
    const vd t404 = t396 * t403;
    const vd t405 = t389 - t404;
    const vd t406 = t394 * t394;
    const vd t407 = t371 * t371;
    const vd t408 = t406 + t407;
    const vd t409 = sc[10 * VS] * t401;
    const vd t410 = sc[11 * VS] * t398;
    const vd t411 = t409 - t410;
    const vd t412 = t408 * t411;
    const vd t413 = t405 + t412;
    const vd t414 = 0.099599999999999994 * t318;
    const vd t415 = t270 - t414;
    const vd t416 = sc[11 * VS] * t171;
    const vd t417 = sc[10 * VS] * t324;
    const vd t418 = t416 - t417;
    const vd t419 = t415 * t418;
    const vd t420 = t413 - t419;
    PUT(0, 29, t420);
    const vd t422 = sc[11 * VS] * t309;
    const vd t423 = sc[10 * VS] * t278;
    const vd t424 = t422 - t423;
    const vd t425 = t394 * dq[5 * VS];
    const vd t426 = t424 - t425;
    const vd t427 = t394 * t371;
    const vd t428 = t426 - t427;
    const vd t429 = t428 * t284;
    const vd t430 = sc[11 * VS] * t382;
    const vd t431 = sc[10 * VS] * t385;
    const vd t432 = t430 - t431;
    const vd t433 = t432 * t300;
    const vd t434 = t429 + t433;
    const vd t435 = t369 * t369;
    const vd t436 = t435 + t407;
    const vd t437 = t436 * t403;
    const vd t438 = t434 + t437;
    const vd t439 = t395 + t391;
    const vd t440 = t439 * t411;
    const vd t441 = t438 + t440;
    const vd t442 = sc[10 * VS] * t171;
    const vd t443 = sc[11 * VS] * t324;
    const vd t444 = t442 + t443;
    const vd t445 = t415 * t444;
    const vd t446 = t441 + t445;
    PUT(0, 30, t446);
    const vd t448 = t371 * t369;
    const vd t449 = t448 * t418;
    const vd t450 = t395 * t300;
    const vd t451 = t449 - t450;
    const vd t452 = t426 * t444;
    const vd t453 = t451 + t452;
    PUT(0, 31, t453);
    const vd t455 = t391 * t300;
    const vd t456 = t455 + t449;
    const vd t457 = t427 * t444;
    const vd t458 = t456 + t457;
    const vd t459 = -t458;
    PUT(0, 32, t459);
    const vd t461 = t428 * t418;
    const vd t462 = t435 - t406;
    const vd t463 = t462 * t300;
    const vd t464 = t461 - t463;
    const vd t465 = t378 * t444;
    const vd t466 = t464 - t465;
    PUT(0, 33, t466);
    const vd t468 = t407 - t435;
    const vd t469 = t468 * t418;
    const vd t470 = t427 + t426;
    const vd t471 = t470 * t300;
    const vd t472 = t469 - t471;
    const vd t473 = t396 * t444;
    const vd t474 = t472 + t473;
    PUT(0, 34, t474);
    const vd t476 = t439 * t418;
    const vd t477 = t372 - t377;
    const vd t478 = t477 * t300;
    const vd t479 = t476 - t478;
    const vd t480 = t406 - t407;
    const vd t481 = t480 * t444;
    const vd t482 = t479 + t481;
    PUT(0, 35, t482);
    PUT(1, 1, t245);
    const vd t486 = -t240;
    PUT(1, 2, t486);
    const vd t488 = -t36;
    PUT(1, 3, t488);
    PUT(1, 4, ddq[1 * VS]);
    const vd t491 = t33 - t42;
    PUT(1, 5, t491);
    PUT(1, 6, t13);
    PUT(1, 7, t26);
    const vd t495 = (-0.42499999999999999) * sc[5 * VS];
    const vd t496 = t111 * t495;
    const vd t497 = (-0.42499999999999999) * sc[4 * VS];
    const vd t498 = t252 * t497;
    const vd t499 = t496 - t498;
    const vd t500 = t499 + t259;
    PUT(1, 8, t500);
    const vd t502 = t118 * t497;
    const vd t503 = t105 + t104;
    const vd t504 = t503 * t495;
    const vd t505 = t502 - t504;
    const vd t506 = t505 - t249;
    PUT(1, 9, t506);
    const vd t508 = -t108;
    PUT(1, 10, t508);
    PUT(1, 11, t110);
    const vd t511 = t105 - t115;
    PUT(1, 12, t511);
    const vd t513 = -t261;
    PUT(1, 13, t513);
    PUT(1, 14, t250);
    const vd t516 = t495 + (-0.39219999999999999);
    const vd t517 = sc[7 * VS] * t516;
    const vd t518 = sc[6 * VS] * t497;
    const vd t519 = t517 - t518;
    const vd t520 = t147 * t519;
    const vd t521 = t297 + t520;
    const vd t522 = sc[7 * VS] * t497;
    const vd t523 = sc[6 * VS] * t516;
    const vd t524 = t522 + t523;
    const vd t525 = t158 * t524;
    const vd t526 = t521 - t525;
    PUT(1, 15, t526);
    const vd t528 = t188 * t524;
    const vd t529 = t177 * t519;
    const vd t530 = t266 + t529;
    const vd t531 = t528 - t530;
    PUT(1, 16, t531);
    const vd t533 = -t144;
    PUT(1, 17, t533);
    PUT(1, 18, t146);
    const vd t536 = t176 - t156;
    PUT(1, 19, t536);
    const vd t538 = t179 - t184;
    const vd t539 = -t538;
    PUT(1, 20, t539);
    const vd t541 = t130 + t135;
    PUT(1, 21, t541);
    const vd t543 = t299 * sc[9 * VS];
    const vd t544 = t233 * t519;
    const vd t546 = 0.099699999999999997 + t524;
    const vd t547 = sc[8 * VS] * t546;
    const vd t548 = t279 * t547;
    const vd t549 = t544 + t548;
    const vd t550 = sc[9 * VS] * t546;
    const vd t551 = t289 * t550;
    const vd t552 = t549 + t551;
    const vd t553 = t543 - t552;
    PUT(1, 22, t553);
    const vd t555 = t318 * t547;
    const vd t556 = t310 * t519;
    const vd t557 = t555 - t556;
    const vd t558 = t321 * t550;
    const vd t559 = t557 + t558;
    const vd t560 = t299 * sc[8 * VS];
    const vd t561 = t559 - t560;
    PUT(1, 23, t561);
    const vd t563 = t329 * sc[9 * VS];
    const vd t564 = t309 * sc[8 * VS];
    const vd t565 = t563 + t564;
    PUT(1, 24, t565);
    const vd t567 = t304 * sc[8 * VS];
    const vd t568 = t567 - t563;
    PUT(1, 25, t568);
    const vd t570 = t310 * sc[9 * VS];
    const vd t571 = t233 * sc[8 * VS];
    const vd t572 = t570 - t571;
    PUT(1, 26, t572);
    const vd t574 = t350 * sc[9 * VS];
    const vd t575 = t279 * sc[8 * VS];
    const vd t576 = t574 + t575;
    PUT(1, 27, t576);
    const vd t578 = t360 * sc[8 * VS];
    const vd t579 = t321 * sc[9 * VS];
    const vd t580 = t578 - t579;
    PUT(1, 28, t580);
    const vd t582 = 0.099599999999999994 * sc[8 * VS];
    const vd t583 = t582 - t519;
    const vd t584 = sc[10 * VS] * t583;
    const vd t585 = sc[11 * VS] * t550;
    const vd t586 = t584 - t585;
    const vd t587 = t408 * t586;
    const vd t588 = t378 * t547;
    const vd t589 = t387 * sc[9 * VS];
    const vd t590 = t588 + t589;
    const vd t591 = sc[10 * VS] * t550;
    const vd t592 = sc[11 * VS] * t583;
    const vd t593 = t591 + t592;
    const vd t594 = t396 * t593;
    const vd t595 = t590 + t594;
    const vd t596 = t587 - t595;
    const vd t597 = sc[10 * VS] * sc[8 * VS];
    const vd t598 = t415 * t597;
    const vd t599 = t596 + t598;
    PUT(1, 29, t599);
    const vd t601 = t436 * t593;
    const vd t602 = t428 * t547;
    const vd t603 = t432 * sc[9 * VS];
    const vd t604 = t602 + t603;
    const vd t605 = t601 - t604;
    const vd t606 = t439 * t586;
    const vd t607 = t605 + t606;
    const vd t608 = sc[11 * VS] * sc[8 * VS];
    const vd t609 = t415 * t608;
    const vd t610 = t607 + t609;
    PUT(1, 30, t610);
    const vd t612 = t395 * sc[9 * VS];
    const vd t613 = t448 * t597;
    const vd t614 = t612 - t613;
    const vd t615 = t426 * t608;
    const vd t616 = t614 + t615;
    PUT(1, 31, t616);
    const vd t618 = t391 * sc[9 * VS];
    const vd t619 = t618 + t613;
    const vd t620 = t427 * t608;
    const vd t621 = t619 - t620;
    PUT(1, 32, t621);
    const vd t623 = t462 * sc[9 * VS];
    const vd t624 = t428 * t597;
    const vd t625 = t623 - t624;
    const vd t626 = t378 * t608;
    const vd t627 = t625 - t626;
    PUT(1, 33, t627);
    const vd t629 = t470 * sc[9 * VS];
    const vd t630 = t468 * t597;
    const vd t631 = t629 - t630;
    const vd t632 = t396 * t608;
    const vd t633 = t631 + t632;
    PUT(1, 34, t633);
    const vd t635 = t477 * sc[9 * VS];
    const vd t636 = t439 * t597;
    const vd t637 = t635 - t636;
    const vd t638 = t480 * t608;
    const vd t639 = t637 + t638;
    PUT(1, 35, t639);
    PUT(2, 8, t259);
    const vd t650 = -t249;
    PUT(2, 9, t650);
    PUT(2, 10, t508);
    PUT(2, 11, t110);
    PUT(2, 12, t511);
    PUT(2, 13, t513);
    PUT(2, 14, t250);
    const vd t657 = (-0.39219999999999999) * sc[7 * VS];
    const vd t658 = t147 * t657;
    const vd t659 = t297 + t658;
    const vd t660 = (-0.39219999999999999) * sc[6 * VS];
    const vd t661 = t158 * t660;
    const vd t662 = t659 - t661;
    PUT(2, 15, t662);
    const vd t664 = t188 * t660;
    const vd t665 = t177 * t657;
    const vd t666 = t266 + t665;
    const vd t667 = t664 - t666;
    PUT(2, 16, t667);
    PUT(2, 17, t533);
    PUT(2, 18, t146);
    PUT(2, 19, t536);
    PUT(2, 20, t539);
    PUT(2, 21, t541);
    const vd t674 = t233 * t657;
    const vd t675 = 0.099699999999999997 + t660;
    const vd t676 = sc[8 * VS] * t675;
    const vd t677 = t279 * t676;
    const vd t678 = t674 + t677;
    const vd t679 = sc[9 * VS] * t675;
    const vd t680 = t289 * t679;
    const vd t681 = t678 + t680;
    const vd t682 = t543 - t681;
    PUT(2, 22, t682);
    const vd t684 = t318 * t676;
    const vd t685 = t310 * t657;
    const vd t686 = t684 - t685;
    const vd t687 = t321 * t679;
    const vd t688 = t686 + t687;
    const vd t689 = t688 - t560;
    PUT(2, 23, t689);
    PUT(2, 24, t565);
    PUT(2, 25, t568);
    PUT(2, 26, t572);
    PUT(2, 27, t576);
    PUT(2, 28, t580);
    const vd t696 = t582 - t657;
    const vd t697 = sc[10 * VS] * t696;
    const vd t698 = sc[11 * VS] * t679;
    const vd t699 = t697 - t698;
    const vd t700 = t408 * t699;
    const vd t701 = t378 * t676;
    const vd t702 = t701 + t589;
    const vd t703 = sc[10 * VS] * t679;
    const vd t704 = sc[11 * VS] * t696;
    const vd t705 = t703 + t704;
    const vd t706 = t396 * t705;
    const vd t707 = t702 + t706;
    const vd t708 = t700 - t707;
    const vd t709 = t708 + t598;
    PUT(2, 29, t709);
    const vd t711 = t436 * t705;
    const vd t712 = t428 * t676;
    const vd t713 = t712 + t603;
    const vd t714 = t711 - t713;
    const vd t715 = t439 * t699;
    const vd t716 = t714 + t715;
    const vd t717 = t716 + t609;
    PUT(2, 30, t717);
    PUT(2, 31, t616);
    PUT(2, 32, t621);
    PUT(2, 33, t627);
    PUT(2, 34, t633);
    PUT(2, 35, t639);
    PUT(3, 15, t297);
    const vd t740 = -t266;
    PUT(3, 16, t740);
    PUT(3, 17, t533);
    PUT(3, 18, t146);
    PUT(3, 19, t536);
    PUT(3, 20, t539);
    PUT(3, 21, t541);
    const vd t747 = (-0.099699999999999997) * sc[8 * VS];
    const vd t748 = t279 * t747;
    const vd t749 = 0.099699999999999997 * sc[9 * VS];
    const vd t750 = t289 * t749;
    const vd t751 = t748 - t750;
    const vd t752 = t751 + t543;
    PUT(3, 22, t752);
    const vd t754 = t321 * t749;
    const vd t755 = t318 * t747;
    const vd t756 = t754 - t755;
    const vd t757 = t756 - t560;
    PUT(3, 23, t757);
    PUT(3, 24, t565);
    PUT(3, 25, t568);
    PUT(3, 26, t572);
    PUT(3, 27, t576);
    PUT(3, 28, t580);
    const vd t764 = t378 * t747;
    const vd t765 = t764 - t589;
    const vd t766 = sc[10 * VS] * t749;
    const vd t767 = sc[11 * VS] * t582;
    const vd t768 = t766 + t767;
    const vd t769 = t396 * t768;
    const vd t770 = t765 - t769;
    const vd t771 = sc[10 * VS] * t582;
    const vd t772 = sc[11 * VS] * t749;
    const vd t773 = t771 - t772;
    const vd t774 = t408 * t773;
    const vd t775 = t770 + t774;
    const vd t776 = t775 + t598;
    PUT(3, 29, t776);
    const vd t778 = t428 * t747;
    const vd t779 = t778 - t603;
    const vd t780 = t436 * t768;
    const vd t781 = t779 + t780;
    const vd t782 = t439 * t773;
    const vd t783 = t781 + t782;
    const vd t784 = t783 + t609;
    PUT(3, 30, t784);
    PUT(3, 31, t616);
    PUT(3, 32, t621);
    PUT(3, 33, t627);
    PUT(3, 34, t633);
    PUT(3, 35, t639);
    PUT(4, 22, t270);
    const vd t814 = -t314;
    PUT(4, 23, t814);
    const vd t816 = -t276;
    PUT(4, 24, t816);
    PUT(4, 25, t278);
    PUT(4, 26, t340);
    const vd t820 = -t348;
    PUT(4, 27, t820);
    PUT(4, 28, t357);
    const vd t823 = 0.099599999999999994 * sc[10 * VS];
    const vd t824 = t396 * t823;
    const vd t825 = 0.099599999999999994 * sc[11 * VS];
    const vd t826 = t408 * t825;
    const vd t827 = t824 + t826;
    const vd t828 = t415 * sc[11 * VS];
    const vd t829 = t827 + t828;
    PUT(4, 29, t829);
    const vd t831 = t439 * t825;
    const vd t832 = t436 * t823;
    const vd t833 = t831 - t832;
    const vd t834 = t415 * sc[10 * VS];
    const vd t835 = t833 - t834;
    PUT(4, 30, t835);
    const vd t837 = t448 * sc[11 * VS];
    const vd t838 = t426 * sc[10 * VS];
    const vd t839 = t837 + t838;
    const vd t840 = -t839;
    PUT(4, 31, t840);
    const vd t842 = t427 * sc[10 * VS];
    const vd t843 = t837 + t842;
    PUT(4, 32, t843);
    const vd t845 = t378 * sc[10 * VS];
    const vd t846 = t428 * sc[11 * VS];
    const vd t847 = t845 - t846;
    PUT(4, 33, t847);
    const vd t849 = t468 * sc[11 * VS];
    const vd t850 = t396 * sc[10 * VS];
    const vd t851 = t849 + t850;
    const vd t852 = -t851;
    PUT(4, 34, t852);
    const vd t854 = t439 * sc[11 * VS];
    const vd t855 = t480 * sc[10 * VS];
    const vd t856 = t854 + t855;
    const vd t857 = -t856;
    PUT(4, 35, t857);
    const vd t888 = -t387;
    PUT(5, 29, t888);
    const vd t890 = -t432;
    PUT(5, 30, t890);
    PUT(5, 31, t395);
    PUT(5, 32, t391);
    PUT(5, 33, t462);
    PUT(5, 34, t470);
    PUT(5, 35, t477);

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
