/* Vectors of W doubles: the arithmetic is the compiler's, the functions are here.
 * Written by symgen; the same for every robot. */
#ifndef SYMGEN_LANES_H
#define SYMGEN_LANES_H

#include <math.h>
#include <stdint.h>

typedef double vd __attribute__((vector_size(8 * W)));
/* the same, wherever it starts in memory */
typedef double vu __attribute__((vector_size(8 * W), aligned(8)));
typedef int64_t vi __attribute__((vector_size(8 * W)));

static inline vd vd_all(double x)
{
    return x - (vd){0};
}

static inline vd vd_sqrt(vd x)
{
    for (int l = 0; l < W; ++l) {
        x[l] = sqrt(x[l]);
    }
    return x;
}

/* Truth is 1.0 or 0.0 per lane, as in the scalar code. */
static inline vd vd_truth(vi mask)
{
    return (vd)(mask & (vi)vd_all(1.0));
}

static inline vd vd_if(vd truth, vd value)
{
    return (vd)((truth != 0.0) & (vi)value);
}

static inline vd vd_choose(vi mask, vd a, vd b)
{
    return (vd)((mask & (vi)a) | (~mask & (vi)b));
}

/* Lanes of a and b in the order of the constants; GCC before 12 spells it differently. */
#if defined(__clang__) || __GNUC__ >= 12
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (vi){__VA_ARGS__})
#endif

/* True when a mask is set in any lane: fold the vector in halves. */
static inline int vi_any(vi m)
{
#if W == 8
    m |= SHUFFLE(m, m, 4, 5, 6, 7, 0, 1, 2, 3);
    m |= SHUFFLE(m, m, 2, 3, 0, 1, 6, 7, 4, 5);
    m |= SHUFFLE(m, m, 1, 0, 3, 2, 5, 4, 7, 6);
#elif W == 4
    m |= SHUFFLE(m, m, 2, 3, 0, 1);
    m |= SHUFFLE(m, m, 1, 0, 3, 2);
#elif W == 2
    m |= SHUFFLE(m, m, 1, 0);
#endif
    return m[0] != 0;
}

/* W rows of W numbers become W columns: butterflies of distance 1, 2, 4. */
static inline void transpose(vd r[W])
{
#define BUTTERFLY(d, low, high)                     \
    for (int i = 0; i < W; ++i) {                   \
        if (!(i & d)) {                             \
            const vd a = r[i], b = r[i + d];        \
            r[i] = low;                             \
            r[i + d] = high;                        \
        }                                           \
    }
#if W == 8
    BUTTERFLY(1, SHUFFLE(a, b, 0, 8, 2, 10, 4, 12, 6, 14), SHUFFLE(a, b, 1, 9, 3, 11, 5, 13, 7, 15))
    BUTTERFLY(2, SHUFFLE(a, b, 0, 1, 8, 9, 4, 5, 12, 13), SHUFFLE(a, b, 2, 3, 10, 11, 6, 7, 14, 15))
    BUTTERFLY(4, SHUFFLE(a, b, 0, 1, 2, 3, 8, 9, 10, 11), SHUFFLE(a, b, 4, 5, 6, 7, 12, 13, 14, 15))
#elif W == 4
    BUTTERFLY(1, SHUFFLE(a, b, 0, 4, 2, 6), SHUFFLE(a, b, 1, 5, 3, 7))
    BUTTERFLY(2, SHUFFLE(a, b, 0, 1, 4, 5), SHUFFLE(a, b, 2, 3, 6, 7))
#elif W == 2
    BUTTERFLY(1, SHUFFLE(a, b, 0, 2), SHUFFLE(a, b, 1, 3))
#endif
#undef BUTTERFLY
}

/* For arguments that the range reduction below cannot take. */
static __attribute__((noinline, cold)) void vd_sincos_far(vd x, vi far, vd *s, vd *c)
{
    for (int l = 0; l < W; ++l) {
        if (far[l]) {
            (*s)[l] = sin(x[l]);
            (*c)[l] = cos(x[l]);
        }
    }
}

/* sin and cos to 2 ulp: x - k pi/2 with pi/2 in three parts (Cody-Waite; the products with k are
 * exact below the limit), then the minimax polynomials of FreeBSD's k_sin and k_cos on |r| <= pi/4.
 * Beyond the limit, and for NaN and infinity, the C library answers lane by lane. */
static inline void vd_sincos(vd x, vd *s, vd *c)
{
    const double limit = 1e5, shift = 6755399441055744.0;
    const vd t = x * 0.63661977236758134308 + shift;
    const vi n = (vi)t;
    const vd k = t - shift;
    const vd a = x - k * 1.57079632673412561417e+00, b = k * 6.07710050630396597660e-11;
    const vd most = a - b;
    const vd rest = (a - most) - b; /* what the line above rounded off */
    const vd r = most + (rest - k * 2.02226624879595063154e-21);
    const vd z = r * r;
    vd p = z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08;
    p = p * z + 2.75573137070700676789e-06;
    p = p * z - 1.98412698298579493134e-04;
    p = p * z + 8.33333333332248946124e-03;
    p = p * z - 1.66666666666666324348e-01;
    const vd sine = r + r * z * p;
    vd q = z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09;
    q = q * z - 2.75573143513906633035e-07;
    q = q * z + 2.48015872894767294178e-05;
    q = q * z - 1.38888888888741095749e-03;
    q = q * z + 4.16666666666666019037e-02;
    const vd cosine = 1.0 - (0.5 * z - z * z * q);
    const vi odd = -(n & 1), flip_sine = (n & 2) << 62, flip_cosine = ((n + 1) & 2) << 62;
    *s = (vd)((vi)vd_choose(odd, cosine, sine) ^ flip_sine);
    *c = (vd)((vi)vd_choose(odd, sine, cosine) ^ flip_cosine);
    const vi far = ~(vi)((x < limit) & (x > -limit));
    if (__builtin_expect(vi_any(far), 0)) {
        vd_sincos_far(x, far, s, c);
    }
}

/* The C library, lane by lane: for what runs once per link, not once per sample. */
#define LANEWISE(name, call)      \
    static inline vd name(vd x)   \
    {                             \
        for (int l = 0; l < W; ++l) { \
            x[l] = call(x[l]);    \
        }                         \
        return x;                 \
    }
LANEWISE(vd_exp, exp)
LANEWISE(vd_log, log)
LANEWISE(vd_tanh, tanh)
LANEWISE(vd_abs, fabs)
#undef LANEWISE

#define LANEWISE2(name, call)           \
    static inline vd name(vd x, vd y)   \
    {                                   \
        for (int l = 0; l < W; ++l) {   \
            x[l] = call(x[l], y[l]);    \
        }                               \
        return x;                       \
    }
LANEWISE2(vd_atan2, atan2)
LANEWISE2(vd_min, fmin)
LANEWISE2(vd_max, fmax)
#undef LANEWISE2

#endif
