/* Sine and cosine of vectors of W doubles to 2 ulp, and of rows of tiles. Written by symgen; the same
 * for every robot.
 *
 * x = k step + r, with the step in three parts (Cody-Waite). With fused multiply-add the parts have
 * 53 bits each and the first difference is exact; without it they are short enough for their
 * products with k to be exact, and what a - b rounds off is carried along.
 *
 * Vectors of many lanes take steps of a quarter turn and the minimax polynomials of FreeBSD's k_sin
 * and k_cos on |r| <= pi/4. One or two lanes look up the sine of k pi/64 and have short polynomials
 * on |r| <= pi/128: Taylor's, with the rest spread evenly over the interval (Chebyshev). */
#ifndef SYMGEN_SINES_H
#define SYMGEN_SINES_H

#include "lanes.h"

#if W > 2
#define VD_PARTS 1
#else
#define VD_PARTS 32 /* steps per quarter turn */
static const double vd_table[VD_PARTS * 5] = {
    /* sin(k pi/64); cosines are a quarter turn on */
    0.0, 0.049067674327418015, 0.0980171403295606, 0.14673047445536175,
    0.19509032201612828, 0.2429801799032639, 0.2902846772544624, 0.33688985339222005,
    0.3826834323650898, 0.4275550934302821, 0.47139673682599764, 0.5141027441932218,
    0.5555702330196022, 0.5956993044924334, 0.6343932841636455, 0.6715589548470184,
    0.7071067811865476, 0.7409511253549591, 0.773010453362737, 0.8032075314806449,
    0.8314696123025452, 0.8577286100002721, 0.881921264348355, 0.9039892931234433,
    0.9238795325112867, 0.9415440651830208, 0.9569403357322088, 0.970031253194544,
    0.9807852804032304, 0.989176509964781, 0.9951847266721969, 0.9987954562051724,
    1.0, 0.9987954562051724, 0.9951847266721969, 0.989176509964781,
    0.9807852804032304, 0.970031253194544, 0.9569403357322088, 0.9415440651830208,
    0.9238795325112867, 0.9039892931234433, 0.881921264348355, 0.8577286100002721,
    0.8314696123025452, 0.8032075314806449, 0.773010453362737, 0.7409511253549591,
    0.7071067811865476, 0.6715589548470184, 0.6343932841636455, 0.5956993044924334,
    0.5555702330196022, 0.5141027441932218, 0.47139673682599764, 0.4275550934302821,
    0.3826834323650898, 0.33688985339222005, 0.2902846772544624, 0.2429801799032639,
    0.19509032201612828, 0.14673047445536175, 0.0980171403295606, 0.049067674327418015,
    0.0, -0.049067674327418015, -0.0980171403295606, -0.14673047445536175,
    -0.19509032201612828, -0.2429801799032639, -0.2902846772544624, -0.33688985339222005,
    -0.3826834323650898, -0.4275550934302821, -0.47139673682599764, -0.5141027441932218,
    -0.5555702330196022, -0.5956993044924334, -0.6343932841636455, -0.6715589548470184,
    -0.7071067811865476, -0.7409511253549591, -0.773010453362737, -0.8032075314806449,
    -0.8314696123025452, -0.8577286100002721, -0.881921264348355, -0.9039892931234433,
    -0.9238795325112867, -0.9415440651830208, -0.9569403357322088, -0.970031253194544,
    -0.9807852804032304, -0.989176509964781, -0.9951847266721969, -0.9987954562051724,
    -1.0, -0.9987954562051724, -0.9951847266721969, -0.989176509964781,
    -0.9807852804032304, -0.970031253194544, -0.9569403357322088, -0.9415440651830208,
    -0.9238795325112867, -0.9039892931234433, -0.881921264348355, -0.8577286100002721,
    -0.8314696123025452, -0.8032075314806449, -0.773010453362737, -0.7409511253549591,
    -0.7071067811865476, -0.6715589548470184, -0.6343932841636455, -0.5956993044924334,
    -0.5555702330196022, -0.5141027441932218, -0.47139673682599764, -0.4275550934302821,
    -0.3826834323650898, -0.33688985339222005, -0.2902846772544624, -0.2429801799032639,
    -0.19509032201612828, -0.14673047445536175, -0.0980171403295606, -0.049067674327418015,
    0.0, 0.049067674327418015, 0.0980171403295606, 0.14673047445536175,
    0.19509032201612828, 0.2429801799032639, 0.2902846772544624, 0.33688985339222005,
    0.3826834323650898, 0.4275550934302821, 0.47139673682599764, 0.5141027441932218,
    0.5555702330196022, 0.5956993044924334, 0.6343932841636455, 0.6715589548470184,
    0.7071067811865476, 0.7409511253549591, 0.773010453362737, 0.8032075314806449,
    0.8314696123025452, 0.8577286100002721, 0.881921264348355, 0.9039892931234433,
    0.9238795325112867, 0.9415440651830208, 0.9569403357322088, 0.970031253194544,
    0.9807852804032304, 0.989176509964781, 0.9951847266721969, 0.9987954562051724
};
#endif

/* Numbers of this size have a unit in the last place of 1: x / step + VD_SHIFT ends in k. */
#define VD_SHIFT 6755399441055744.0
#define VD_SHIFT_BITS INT64_C(0x4338000000000000)
#define VD_MOST (INT64_C(32768) * VD_PARTS) /* |k| up to here has 20 bits */

static inline vd vd_steps(vd x)
{
    return x * (0.63661977236758134308 * VD_PARTS) + VD_SHIFT;
}

/* Lanes or-ed together have no bit of VD_FAR unless |k| > VD_MOST in one of them, NaN included. */
#define VD_FAR (-2 * VD_MOST)
static inline vi vd_reach(vd x)
{
    return (vi)vd_steps(x) - (VD_SHIFT_BITS - VD_MOST);
}

/* r, and what it leaves of x - k step. */
static inline vd vd_rest(vd x, vd k, vd *low)
{
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
    const vd r = x - k * (1.57079632679489655800e+00 / VD_PARTS);
    *low = k * (1.49738490485916983294e-33 / VD_PARTS);
    return r - k * (6.12323399573676603587e-17 / VD_PARTS);
#else
    const vd a = x - k * (1.57079632673412561417e+00 / VD_PARTS);
    const vd b = k * (6.07710050630396597660e-11 / VD_PARTS), r = a - b;
    *low = ((a - r) - b) - k * (2.02226624879595063154e-21 / VD_PARTS);
    return r;
#endif
}

/* Where `vd_reach` finds nothing. */
static inline void vd_sincos_near(vd x, vd *s, vd *c)
{
    const vd t = vd_steps(x);
    const vi n = (vi)t;
    vd low, r = vd_rest(x, t - VD_SHIFT, &low);
#if VD_PARTS == 1
    r += low;
    const vd z = r * r;
    vd p = z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08;
    vd q = z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09;
    p = p * z + 2.75573137070700676789e-06;
    q = q * z - 2.75573143513906633035e-07;
    p = p * z - 1.98412698298579493134e-04;
    q = q * z + 2.48015872894767294178e-05;
    p = p * z + 8.33333333332248946124e-03;
    q = q * z - 1.38888888888741095749e-03;
    p = p * z - 1.66666666666666324348e-01;
    q = q * z + 4.16666666666666019037e-02;
    const vd sine = (r * z) * p + r;
    const vd cosine = (q * z - 0.5) * z + 1.0;
    const vi sign = (vi)vd_all(-0.0), swap = ((vi)sine ^ (vi)cosine) & -(n & 1);
    *s = (vd)((vi)sine ^ swap ^ ((n << 62) & sign));
    *c = (vd)((vi)cosine ^ swap ^ (((n + 1) << 62) & sign));
#else
    const vd z = r * r;
    const vd p = (z * -0.000198410203396285 + 0.0083333333327685888) * z - 0.16666666666666666;
    const vd q = (z * -0.0013888664337731132 + 0.04166666666158398) * z - 0.49999999999999983;
    const vd more = (r * z) * p + low, less = z * q; /* sin - r, cos - 1; r itself is exact */
    vd at = {0}, ahead = {0};
    for (int l = 0; l < W; ++l) {
        const double *node = vd_table + (n[l] & (4 * VD_PARTS - 1));
        at[l] = node[0];
        ahead[l] = node[VD_PARTS];
    }
    *s = at + (ahead * r + (ahead * more + at * less));
    *c = ahead - (at * r + (at * more - ahead * less));
#endif
}

/* The others: the C library, lane by lane; NaN and infinity give NaN. */
static __attribute__((noinline, cold)) void vd_sincos_far(vd x, vd *s, vd *c)
{
    const vi reach = vd_reach(x);
    for (int l = 0; l < W; ++l) {
        if (reach[l] & VD_FAR) {
            (*s)[l] = sin(x[l]);
            (*c)[l] = cos(x[l]);
        }
    }
}

static inline void vd_sincos(vd x, vd *s, vd *c)
{
    vd_sincos_near(x, s, c);
    if (__builtin_expect(vi_any(vd_reach(x) & VD_FAR), 0)) {
        vd_sincos_far(x, s, c);
    }
}

/* Those too large for `vd_sincos_near`: the C library, one by one. */
static __attribute__((noinline, cold)) void sines_far(double *sc, const double *q, const int *turns, int count, int rows, long tiles)
{
    for (long t = 0; t < tiles * rows * LANES; t += rows * LANES) {
        for (int i = 0; i < count; ++i) {
            for (int h = 0; h < LANES; h += W) {
                double *to = sc + 2 * (t + turns[i] * LANES) + h;
                vd s = *(const vu *)to, c = *(const vu *)(to + LANES);
                vd_sincos_far(*(const vu *)(q + t + turns[i] * LANES + h), &s, &c);
                *(vu *)to = s;
                *(vu *)(to + LANES) = c;
            }
        }
    }
}

/* Rows 2 r and 2 r + 1 of each tile of `sc`: sine and cosine of row r of `q`, for the r in `turns`. */
static APART void sines(double *sc, const double *q, const int *turns, int count, int rows, long tiles)
{
    vi reach = {0};
    for (long t = 0; t < tiles * rows * LANES; t += rows * LANES) {
        for (int i = 0; i < count; ++i) {
            const double *from = q + t + turns[i] * LANES;
            double *to = sc + 2 * (t + turns[i] * LANES);
            for (int h = 0; h < LANES; h += W) {
                const vd x = *(const vu *)(from + h);
                vd s, c;
                reach |= vd_reach(x);
                vd_sincos_near(x, &s, &c);
                *(vu *)(to + h) = s;
                *(vu *)(to + h + LANES) = c;
            }
        }
    }
    if (__builtin_expect(vi_any(reach & VD_FAR), 0)) {
        sines_far(sc, q, turns, count, rows, tiles);
    }
}

#endif
