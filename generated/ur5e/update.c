/* ur5e: one more sample in the triangle of statistics.c, for a real-time loop; written by symgen
 * 0.1.0. Needs kernels.c and ur5e.h; no allocation, no globals, bounded time. */
#include <math.h>

#include "ur5e.h"

enum { N = 6, BASE = 36, SIZE = BASE + 1 };

/* Such a sum of squares counts as zero: below, its power 3/2, by which a reflection divides, leaves the
 * range of numbers. */
#define TINY 1e-200

/* Neighbouring columns and the joints whose rows take part when they are eliminated. */
static const struct {
    short first, width, rows, row_count;
} panels[] = {
    {0, 1, 0, 1},
    {1, 2, 1, 1},
    {3, 5, 2, 2},
    {8, 7, 4, 3},
    {15, 7, 7, 4},
    {22, 7, 11, 5},
    {29, 7, 16, 6},
};

static const short panel_rows[] = {0, 1, 0, 1, 0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 5};

/* Householder's reflection of column c of the factor and of the rows in `take`, as in statistics.c. */
static void reflect(double *factor, double rows[N][SIZE], int c, const short *take, int count)
{
    double *r = factor + c * SIZE, w[SIZE], s = 0.0;
    for (int i = 0; i < count; ++i) {
        s += rows[take[i]][c] * rows[take[i]][c];
    }
    if (s <= TINY) {
        return;
    }
    const double length = sqrt(r[c] * r[c] + s), both = r[c] + length;
    const double top = -s / both, inverse = both / (length * s);
    r[c] = length;
    for (int j = c + 1; j < SIZE; ++j) {
        w[j] = top * r[j];
    }
    for (int i = 0; i < count; ++i) {
        const double *row = rows[take[i]], u = row[c];
        for (int j = c + 1; j < SIZE; ++j) {
            w[j] += u * row[j];
        }
    }
    for (int j = c + 1; j < SIZE; ++j) {
        w[j] *= inverse;
        r[j] -= top * w[j];
    }
    for (int i = 0; i < count; ++i) {
        double *row = rows[take[i]];
        const double u = row[c];
        for (int j = c + 1; j < SIZE; ++j) {
            row[j] -= u * w[j];
        }
    }
}

void ur5e_statistics_update(double factor[SIZE * SIZE], double forgetting, const double q[N], const double dq[N], const double ddq[N], const double tau[N], const double weight[N])
{
    static const short all[] = {0, 1, 2, 3, 4, 5};
    double Y_b[N * BASE], rows[N][SIZE];
    const double keep = sqrt(forgetting);
    for (int i = 0; i < SIZE * SIZE; ++i) {
        factor[i] *= keep;
    }
    ur5e_base_regressor(q, dq, ddq, Y_b);
    for (int i = 0; i < N; ++i) {
        const double root = sqrt(weight[i]);
        for (int c = 0; c < BASE; ++c) {
            rows[i][c] = root * Y_b[i * BASE + c];
        }
        rows[i][BASE] = root * tau[i];
    }
    for (unsigned p = 0; p < sizeof panels / sizeof panels[0]; ++p) {
        for (int k = 0; k < panels[p].width; ++k) {
            reflect(factor, rows, panels[p].first + k, panel_rows + panels[p].rows, panels[p].row_count);
        }
    }
    reflect(factor, rows, BASE, all, N);
}
