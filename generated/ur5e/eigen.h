/* The two outermost eigenpairs of a symmetric matrix: Householder's tridiagonal form, sections of
 * an interval, twisted factors. Written by symgen; the same for every robot.
 *
 * Rows are `ld` numbers apart, a multiple of 8; numbers beyond the matrix may be anything finite. */
#ifndef SYMGEN_EIGEN_H
#define SYMGEN_EIGEN_H

#include <float.h>

#include "lanes.h"

#define PANEL (W == 8 ? 6 : 4)     /* vectors of a row that fit into the registers three times */
#define SHIFTS (W >= 4 ? 2 : 4)    /* vectors of shifts that are tried at once, per end */
#define NOTHING 1e-150             /* a square below which a row counts as reduced already: f*f is finite */

/* True in the first `count` lanes. */
INLINE vi first_lanes(int count)
{
    static const int64_t steps[16] = {-1, -1, -1, -1, -1, -1, -1, -1};
    typedef int64_t viu __attribute__((vector_size(8 * W), aligned(8)));
    const int inside = count < 0 ? 0 : count > W ? W : count;
    return *(const viu *)(steps + 8 - inside);
}

INLINE double sum_of(vd x)
{
#if W == 8
    x += SHUFFLE(x, x, 4, 5, 6, 7, 0, 1, 2, 3);
    x += SHUFFLE(x, x, 2, 3, 0, 1, 6, 7, 4, 5);
    x += SHUFFLE(x, x, 1, 0, 3, 2, 5, 4, 7, 6);
#elif W == 4
    x += SHUFFLE(x, x, 2, 3, 0, 1);
    x += SHUFFLE(x, x, 1, 0, 3, 2);
#elif W == 2
    x += SHUFFLE(x, x, 1, 0);
#endif
    return x[0];
}

/* Columns of `count` vectors from `c` on: A -= v w' + w v', then p = A x, for rows below m. */
INLINE void sweep_columns(int count, double *a, int ld, int m, int c, const double *v,
                          const double *w, const double *x, double *p)
{
    vd left[PANEL], right[PANEL], sum[PANEL];
    UNROLL for (int k = 0; k < count; ++k) {
        left[k] = *(const vu *)(v + c + k * W);
        right[k] = *(const vu *)(w + c + k * W);
        sum[k] = vd_all(0.0);
    }
    for (int i = 0; i < m; ++i) {
        double *row = a + (long)i * ld + c;
        const double vi_ = v[i], wi_ = w[i], xi_ = x[i];
        UNROLL for (int k = 0; k < count; ++k) {
            const vd r = *(const vu *)(row + k * W) - vi_ * right[k] - wi_ * left[k];
            *(vu *)(row + k * W) = r;
            sum[k] += xi_ * r;
        }
    }
    UNROLL for (int k = 0; k < count; ++k) {
        *(vu *)(p + c + k * W) = sum[k];
    }
}

static APART void sweep(double *a, int ld, int m, const double *v, const double *w, const double *x,
                        double *p)
{
    for (int c = 0; c < m; c += PANEL * W) {
        switch ((m - c + W - 1) / W) {
        case 1: sweep_columns(1, a, ld, m, c, v, w, x, p); break;
        case 2: sweep_columns(2, a, ld, m, c, v, w, x, p); break;
        case 3: sweep_columns(3, a, ld, m, c, v, w, x, p); break;
#if W == 8
        case 4: sweep_columns(4, a, ld, m, c, v, w, x, p); break;
        case 5: sweep_columns(5, a, ld, m, c, v, w, x, p); break;
#endif
        default: sweep_columns(PANEL, a, ld, m, c, v, w, x, p);
        }
    }
}

/* Q'AQ = T with diagonal d and off-diagonal e (n - 1), Q = H_{n-1} ... H_2; H_m = 1 - f_m v v' with
 * v in row m of A. From the last row upwards, so that what is left always begins at a vector; each
 * sweep applies the last reflection and multiplies by the next. `scratch`: 3 ld numbers. */
static APART void tridiagonal(int n, int ld, double *a, double *d, double *e, double *f,
                              double *scratch)
{
    double *w = scratch, *p = scratch + ld;
    const double *v = scratch + 2 * ld;
    for (int k = 0; k < 3 * ld; ++k) {
        scratch[k] = 0.0;
    }
    for (int m = n - 1; m > 0; --m) {
        double *row = a + (long)m * ld;
        const int last = (m - 1) / W * W; /* the vector that holds entry m - 1 */
        const double vm = v[m], wm = w[m];
        vd square = vd_all(0.0), r = vd_all(0.0);
        for (int k = 0; k <= m; k += W) {
            const vd here = *(const vu *)(row + k) - vm * *(const vu *)(w + k) - wm * *(const vu *)(v + k);
            *(vu *)(row + k) = here;
            const vd kept = k < last ? here : vd_choose(first_lanes(m - 1 - k), here, vd_all(0.0));
            square += kept * kept;
            r = k == last ? kept : r;
        }
        d[m] = row[m];
        const double alpha = row[m - 1], s = sum_of(square);
        if (m == 1 || !(s > NOTHING)) {
            e[m - 1] = alpha;
            f[m] = 0.0;
            for (int k = 0; k <= last; k += W) {
                *(vu *)(row + k) = vd_all(0.0);
            }
        } else {
            const double size = sqrt(alpha * alpha + s), beta = alpha > 0.0 ? -size : size;
            e[m - 1] = beta;
            f[m] = 1.0 / (beta * (beta - alpha));
            const vi one = first_lanes(m - last) & ~first_lanes(m - 1 - last);
            *(vu *)(row + last) = vd_choose(one, vd_all(alpha - beta), r);
        }
        sweep(a, ld, m, v, w, row, p);
        vd inner = vd_all(0.0);
        for (int k = 0; k < m; k += W) {
            inner += *(const vu *)(p + k) * *(const vu *)(row + k);
        }
        /* p beyond m holds what lies beyond the matrix; v is zero there */
        const vi inside = first_lanes(m - last);
        *(vu *)(p + last) = vd_choose(inside, *(const vu *)(p + last), vd_all(0.0));
        const double half = f[m] * f[m] / 2.0 * sum_of(inner);
        for (int k = 0; k < m; k += W) {
            *(vu *)(w + k) = f[m] * *(const vu *)(p + k) - half * *(const vu *)(row + k);
        }
        v = row;
    }
    d[0] = a[0] - 2.0 * (n > 1 ? v[0] * w[0] : 0.0);
}

/* x := Q x for two vectors at once. */
static APART void reflect(int n, int ld, const double *a, const double *f, double *x, double *y)
{
    for (int m = 2; m < n; ++m) {
        const double *v = a + (long)m * ld;
        vd inner_x = vd_all(0.0), inner_y = vd_all(0.0);
        for (int k = 0; k < m; k += W) {
            inner_x += *(const vu *)(v + k) * *(const vu *)(x + k);
            inner_y += *(const vu *)(v + k) * *(const vu *)(y + k);
        }
        const double by_x = f[m] * sum_of(inner_x), by_y = f[m] * sum_of(inner_y);
        for (int k = 0; k < m; k += W) {
            *(vu *)(x + k) -= by_x * *(const vu *)(v + k);
            *(vu *)(y + k) -= by_y * *(const vu *)(v + k);
        }
    }
}

/* Number of shifts s low + k width, k = 1 2 ..., below all eigenvalues of T, and of high - k width
 * above all of them. All leading minors of T - s, by p_i = (d_i - s) p_{i-1} - e_i^2 p_{i-2}, are
 * positive there; no division, so that the chain is short. Each eight steps the pair is scaled by
 * a power of two, by which it neither overflows nor vanishes. */
INLINE void count_outside(int n, const double *d, const double *squares, double low, double low_width,
                   double high, double high_width, int count[2])
{
    vd x[2][SHIFTS], p[2][SHIFTS], before[2][SHIFTS];
    vi bad[2][SHIFTS];
    UNROLL for (int k = 0; k < SHIFTS; ++k) {
        vd number;
        for (int l = 0; l < W; ++l) {
            number[l] = (double)(k * W + l + 1);
        }
        x[0][k] = low + number * low_width;
        x[1][k] = high - number * high_width;
        UNROLL for (int end = 0; end < 2; ++end) {
            before[end][k] = vd_all(0.0);
            p[end][k] = vd_all(1.0);
            bad[end][k] = (vi){0};
        }
    }
    for (int from = 0; from < n; from += 8) {
        const int to = from + 8 < n ? from + 8 : n;
        for (int i = from; i < to; ++i) {
            const double di = d[i], square = squares[i];
            UNROLL for (int k = 0; k < SHIFTS; ++k) {
                const vd up = (di - x[0][k]) * p[0][k] - square * before[0][k];
                const vd down = (x[1][k] - di) * p[1][k] - square * before[1][k];
                before[0][k] = p[0][k];
                before[1][k] = p[1][k];
                p[0][k] = up;
                p[1][k] = down;
                bad[0][k] |= (vi)up;
                bad[1][k] |= (vi)down;
            }
        }
        UNROLL for (int k = 0; k < SHIFTS; ++k) {
            UNROLL for (int end = 0; end < 2; ++end) {
                bad[end][k] |= ~(vi)(p[end][k] > 0.0); /* zero and NaN, too */
                const vi exponent = (vi)p[end][k] & (vi)vd_all(INFINITY);
                const vd scale = (vd)(0x7fe0000000000000 - exponent);
                p[end][k] *= scale;
                before[end][k] *= scale;
            }
        }
    }
    UNROLL for (int end = 0; end < 2; ++end) {
        vd good = vd_all(0.0);
        UNROLL for (int k = 0; k < SHIFTS; ++k) {
            good += vd_truth(bad[end][k] >= 0);
        }
        count[end] = (int)sum_of(good);
    }
}

/* Smallest and largest eigenvalue of a positive semidefinite T, to rounding of the largest; what
 * is below 0 by rounding counts as 0. NaN when T is not finite. `squares`: n numbers. */
static APART void outermost(int n, const double *d, const double *e, double *squares, double *lowest,
                            double *highest)
{
    double low[2] = {0.0, d[0]}, high[2] = {d[0], 0.0}; /* of each eigenvalue */
    squares[0] = 0.0;
    for (int i = 0; i < n; ++i) {
        const double left = i > 0 ? e[i - 1] : 0.0, right = i < n - 1 ? e[i] : 0.0;
        const double reach = d[i] + fabs(left) + fabs(right);
        squares[i] = left * left;
        high[0] = d[i] < high[0] ? d[i] : high[0];
        low[1] = d[i] > low[1] ? d[i] : low[1];
        high[1] = reach <= high[1] ? high[1] : reach; /* so that NaN stays */
    }
    if (!(high[1] < INFINITY)) {
        *lowest = *highest = NAN;
        return;
    }
    high[1] *= 1.0 + 4.0 * DBL_EPSILON;
    for (int pass = 0; pass < 64; ++pass) {
        const double widths[2] = {high[0] - low[0], high[1] - low[1]};
        const double enough = 2.0 * DBL_EPSILON * high[1];
        if (!(widths[0] > enough || widths[1] > enough)) {
            break;
        }
        const double parts = SHIFTS * W + 1;
        const double steps[2] = {widths[0] / parts, widths[1] / parts};
        int count[2];
        count_outside(n, d, squares, low[0], steps[0], high[1], steps[1], count);
        low[0] += count[0] * steps[0];
        high[1] -= count[1] * steps[1];
        high[0] = count[0] < SHIFTS * W ? low[0] + steps[0] : high[0];
        low[1] = count[1] < SHIFTS * W ? high[1] - steps[1] : low[1];
    }
    *lowest = (low[0] + high[0]) / 2.0;
    *highest = (low[1] + high[1]) / 2.0;
}

INLINE double apart_from_zero(double x, double least)
{
    return fabs(x) < least ? (x < 0.0 ? -least : least) : x;
}

/* Unit eigenvectors of T for two eigenvalues: factors from above and from below meet where they
 * leave the smallest remainder (the twisted factorisation). `scratch`: 4 n numbers. */
static APART void eigenvectors(int n, const double *d, const double *e, const double value[2],
                               double *vector[2], double *scratch)
{
    double *above[2] = {scratch, scratch + n}, *below[2] = {scratch + 2 * n, scratch + 3 * n};
    const double least = DBL_EPSILON * DBL_EPSILON * (fabs(value[0]) + fabs(value[1]) + DBL_MIN);
    double a[2] = {0.0, 0.0}, b[2] = {0.0, 0.0};
    for (int i = 0; i < n; ++i) {
        const int j = n - 1 - i;
        const double left = i > 0 ? e[i - 1] : 0.0, right = j < n - 1 ? e[j] : 0.0;
        for (int end = 0; end < 2; ++end) {
            /* a and b: e / pivot of the step before, the multipliers */
            const double top = apart_from_zero(d[i] - value[end] - left * a[end], least);
            const double bottom = apart_from_zero(d[j] - value[end] - right * b[end], least);
            a[end] = i < n - 1 ? e[i] / top : 0.0;
            b[end] = j > 0 ? e[j - 1] / bottom : 0.0;
            above[end][i] = a[end];
            below[end][j] = b[end];
        }
    }
    for (int end = 0; end < 2; ++end) {
        int twist = 0;
        double smallest = INFINITY;
        for (int i = 0; i < n; ++i) {
            double remainder = d[i] - value[end];
            remainder -= i > 0 ? e[i - 1] * above[end][i - 1] : 0.0;
            remainder -= i < n - 1 ? e[i] * below[end][i + 1] : 0.0;
            if (fabs(remainder) < smallest) {
                smallest = fabs(remainder);
                twist = i;
            }
        }
        double *z = vector[end], square = 1.0;
        z[twist] = 1.0;
        for (int i = twist - 1; i >= 0; --i) {
            z[i] = -above[end][i] * z[i + 1];
            square += z[i] * z[i];
        }
        for (int i = twist + 1; i < n; ++i) {
            z[i] = -below[end][i] * z[i - 1];
            square += z[i] * z[i];
        }
        const double scale = 1.0 / sqrt(square);
        for (int i = 0; i < n; ++i) {
            z[i] *= scale;
        }
    }
}

#endif
