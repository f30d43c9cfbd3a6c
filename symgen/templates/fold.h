/* Sums of products folded into a triangle, and the bounds of rounding that say whether they may be.
 * Written by symgen; the same for every robot. Rows of matrices are `step` numbers apart, a multiple
 * of 8, and zero beyond their `size` numbers. */
#ifndef SYMGEN_FOLD_H
#define SYMGEN_FOLD_H

#include "lanes.h"

/* The bound of the sums may be so many times that of the elimination: random logs round to .08 of the
 * one and to .37 of the other. */
#define ALLOWED 4.0
/* The sums may have so many times the energy of the triangle in any of its directions. */
#define LARGEST 1e3

enum { ALL, UPPER_HALF, LOWER_TRIANGLE };

/* X := R^-T X, of which the upper half is enough, or whose lower triangle is all that is not zero. */
static APART void forward(const double *r, double *x, long size, long step, int kind)
{
    for (long i = 0; i < size; ++i) {
        const double inverse = 1.0 / r[i * step + i];
        const long end = kind == LOWER_TRIANGLE ? i + 1 : size;
        for (long j = kind == UPPER_HALF ? i / W * W : 0; j < end; j += 4 * W) {
            const long rest = (end - j + W - 1) / W, vectors = rest < 4 ? rest : 4;
            double *own = x + i * step + j;
            vd sum[4];
            for (long v = 0; v < vectors; ++v) {
                sum[v] = *(const vu *)(own + v * W);
            }
            for (long k = kind == LOWER_TRIANGLE ? j : 0; k < i; ++k) {
                const double *other = x + k * step + j, factor = r[k * step + i];
                if (vectors == 4) {
                    UNROLL for (int v = 0; v < 4; ++v) {
                        sum[v] -= factor * *(const vu *)(other + v * W);
                    }
                } else {
                    for (long v = 0; v < vectors; ++v) {
                        sum[v] -= factor * *(const vu *)(other + v * W);
                    }
                }
            }
            for (long v = 0; v < vectors; ++v) {
                *(vu *)(own + v * W) = inverse * sum[v];
            }
        }
    }
}

/* The transpose of a matrix. */
static void transposed(const double *from, double *to, long size, long step)
{
    for (long i = 0; i < size; ++i) {
        for (long j = 0; j < step; ++j) {
            to[i * step + j] = j < size ? from[j * step + i] : 0.0;
        }
    }
}

/* The triangle U of A = U'U in place of the upper half of A; 0 where A is not positive. */
static int cholesky(double *a, long size, long step)
{
    for (long i = 0; i < size; ++i) {
        double *row = a + i * step;
        if (!(row[i] > 0.0)) {
            return 0;
        }
        const double inverse = 1.0 / sqrt(row[i]);
        for (long j = i / W * W; j < size; j += W) {
            *(vu *)(row + j) *= inverse;
        }
        for (long k = i + 1; k < size; ++k) {
            for (long j = k / W * W; j < size; j += W) {
                *(vu *)(a + k * step + j) -= row[k] * *(const vu *)(row + j);
            }
        }
    }
    return 1;
}

/* Rounding of the sums G and of the elimination of the same rows, as changes of R'R in units of R:
 * || |R^-T| d ||^2 with d_i^2 = G_ii, and || |R^-T| a || with the lengths a of the columns of R.
 * `spare` holds a matrix. */
static double accuracy(const double *r, const double *g, double *spare, long size, long step)
{
    double sums = 0.0, eliminated = 0.0;
    for (long i = 0; i < size; ++i) {
        for (long j = 0; j < step; j += W) {
            *(vu *)(spare + i * step + j) = vd_all(0.0);
        }
        spare[i * step + i] = 1.0;
    }
    forward(r, spare, size, step, LOWER_TRIANGLE);
    double *own = spare + size * step, *whole = own + step;
    for (long j = 0; j < size; ++j) {
        double square = 0.0;
        for (long i = 0; i <= j; ++i) {
            square += r[i * step + j] * r[i * step + j];
        }
        own[j] = sqrt(g[j * step + j]);
        whole[j] = sqrt(square);
    }
    for (long i = 0; i < size; ++i) {
        double d = 0.0, a = 0.0;
        for (long j = 0; j <= i; ++j) {
            d += fabs(spare[i * step + j]) * own[j];
            a += fabs(spare[i * step + j]) * whole[j];
        }
        sums += d * d;
        eliminated += a * a;
    }
    return ALLOWED * sqrt(eliminated) / sums;
}

/* R'R + G = R'(I + E)R with E = R^-T G R^-1: the triangle of I + E = U'U times R, in place of R. The
 * columns of E are as long as the ratio of the sums to what R holds, so that nothing cancels. 0, and
 * no triangle, where rounding of the sums could exceed that of the elimination. */
static double fold_into(double *r, const double *g, double *spare, long size, long step)
{
    double *x = spare, *e = spare + size * step;
    for (long i = 0; i < size; ++i) {
        if (!(r[i * step + i] > 0.0)) {
            return 0.0;
        }
    }
    for (long i = 0; i < size * step; ++i) {
        x[i] = g[i];
    }
    forward(r, x, size, step, ALL);
    transposed(x, e, size, step);
    forward(r, e, size, step, UPPER_HALF);
    for (long i = 0; i < size; ++i) {
        if (!(e[i * step + i] <= LARGEST)) {
            return 0.0;
        }
        e[i * step + i] += 1.0;
    }
    if (!cholesky(e, size, step)) {
        return 0.0;
    }
    for (long i = 0; i < size; ++i) {
        for (long j = i / W * W; j < size; j += 4 * W) {
            const long rest = (size - j + W - 1) / W, vectors = rest < 4 ? rest : 4;
            double *own = r + i * step + j;
            vd sum[4] = { {0.0} };
            for (long k = i; k < size && k < j + 4 * W; ++k) {
                const double *other = r + k * step + j, factor = e[i * step + k];
                for (long v = 0; v < vectors; ++v) {
                    sum[v] += factor * *(const vu *)(other + v * W);
                }
            }
            for (long v = 0; v < vectors; ++v) {
                *(vu *)(own + v * W) = sum[v];
            }
        }
    }
    return accuracy(r, g, spare, size, step);
}

#endif
