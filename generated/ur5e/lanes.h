/* Vectors of W doubles: the arithmetic is the compiler's, the functions are here.
 * Written by symgen; the same for every robot. */
#ifndef SYMGEN_LANES_H
#define SYMGEN_LANES_H

#include <math.h>
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))

typedef double vd __attribute__((vector_size(8 * W)));
/* the same, wherever it starts in memory */
typedef double vu __attribute__((vector_size(8 * W), aligned(8)));
typedef int64_t vi __attribute__((vector_size(8 * W)));

static inline vd vd_all(double x)
{
    return x - (vd){0};
}

/* Compilers have no portable spelling for the square root of a vector. */
static inline vd vd_sqrt(vd x)
{
#if (W == 8 && defined(__AVX512F__)) || (W == 4 && defined(__AVX__)) || (W == 2 && defined(__AVX__))
    __asm__("vsqrtpd %1, %0" : "=v"(x) : "v"(x));
    return x;
#elif W == 2 && defined(__SSE2__)
    __asm__("sqrtpd %1, %0" : "=x"(x) : "x"(x));
    return x;
#elif W == 2 && defined(__aarch64__)
    __asm__("fsqrt %0.2d, %1.2d" : "=w"(x) : "w"(x));
    return x;
#endif
    for (int l = 0; l < W; ++l) {
        x[l] = sqrt(x[l]);
    }
    return x;
}

/* a / b to 1 ulp where a, b, 1 / b and the quotient are normal numbers. Eight lanes are divided in as
 * many cycles as 16 multiplications take; an estimate to 2^-14 needs five. */
static inline vd vd_quotient(vd a, vd b)
{
#if W == 8 && defined(__AVX512F__)
    vd inverse;
    __asm__("vrcp14pd %1, %0" : "=v"(inverse) : "v"(b));
    inverse += (1.0 - b * inverse) * inverse; /* to 2^-28, and the quotient to 2^-56 */
    const vd quotient = a * inverse;
    return quotient + (a - quotient * b) * inverse;
#else
    return a / b;
#endif
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

/* The sum over the lanes, pair by pair. */
static inline double vd_sum(vd x)
{
    double sum[W];
    for (int l = 0; l < W; ++l) {
        sum[l] = x[l];
    }
    for (int l = W / 2; l > 0; l /= 2) {
        for (int i = 0; i < l; ++i) {
            sum[i] += sum[i + l];
        }
    }
    return sum[0];
}

/* Halves of two vectors, in blocks of 1, 2 and 4 lanes: those at even places, those at odd ones. */
#if W == 8
#define EVEN_1(a, b) SHUFFLE(a, b, 0, 8, 2, 10, 4, 12, 6, 14)
#define ODD_1(a, b) SHUFFLE(a, b, 1, 9, 3, 11, 5, 13, 7, 15)
#define EVEN_2(a, b) SHUFFLE(a, b, 0, 1, 8, 9, 4, 5, 12, 13)
#define ODD_2(a, b) SHUFFLE(a, b, 2, 3, 10, 11, 6, 7, 14, 15)
#define EVEN_4(a, b) SHUFFLE(a, b, 0, 1, 2, 3, 8, 9, 10, 11)
#define ODD_4(a, b) SHUFFLE(a, b, 4, 5, 6, 7, 12, 13, 14, 15)
#define LEVELS(step) step(1) step(2) step(4)
#elif W == 4
#define EVEN_1(a, b) SHUFFLE(a, b, 0, 4, 2, 6)
#define ODD_1(a, b) SHUFFLE(a, b, 1, 5, 3, 7)
#define EVEN_2(a, b) SHUFFLE(a, b, 0, 1, 4, 5)
#define ODD_2(a, b) SHUFFLE(a, b, 2, 3, 6, 7)
#define LEVELS(step) step(1) step(2)
#elif W == 2
#define EVEN_1(a, b) SHUFFLE(a, b, 0, 2)
#define ODD_1(a, b) SHUFFLE(a, b, 1, 3)
#define LEVELS(step) step(1)
#else
#define LEVELS(step) (void)r;
#endif

/* W rows of W numbers become W columns: butterflies of distance 1, 2, 4. */
INLINE void transpose(vd r[W])
{
#define BUTTERFLY(d)                                        \
    _Pragma("GCC unroll 8") for (int i = 0; i < W; ++i) {   \
        if (!(i & d)) {                                     \
            const vd a = r[i], b = r[i + d];                \
            r[i] = EVEN_##d(a, b);                          \
            r[i + d] = ODD_##d(a, b);                       \
        }                                                   \
    }
    LEVELS(BUTTERFLY)
#undef BUTTERFLY
}

/* The sum over the lanes of each of W vectors, which are used up. */
INLINE vd fold(vd r[W])
{
#define FOLD(d)                                                     \
    _Pragma("GCC unroll 8") for (int i = 0; i < W; i += 2 * d) {    \
        r[i] = EVEN_##d(r[i], r[i + d]) + ODD_##d(r[i], r[i + d]);  \
    }
    LEVELS(FOLD)
#undef FOLD
    return r[0];
}

/* exp to 1 ulp for |x| < 700: x = k ln 2 + r, then the rational form of FreeBSD's e_exp on
 * |r| <= ln 2 / 2; beyond, and for NaN and infinity, the C library answers lane by lane. */
static inline vd vd_exp(vd x)
{
    const double near = 700.0, shift = 6755399441055744.0;
    const vd t = x * 1.44269504088896338700 + shift;
    const vd k = t - shift;
    const vd high = x - k * 6.93147180369123816490e-01, low = k * 1.90821492927058770002e-10;
    const vd r = high - low, z = r * r;
    vd p = z * 4.13813679705723846039e-08 - 1.65339022054652515390e-06;
    p = p * z + 6.61375632143793436117e-05;
    p = p * z - 2.77777777770155933842e-03;
    p = p * z + 1.66666666666666019037e-01;
    const vd c = r - z * p;
    const vd y = 1.0 - ((low - (r * c) / (2.0 - c)) - high);
    vd result = (vd)((vi)y + ((vi)t << 52));
    const vi far = ~(vi)((x < near) & (x > -near));
    if (__builtin_expect(vi_any(far), 0)) {
        for (int l = 0; l < W; ++l) {
            result[l] = far[l] ? exp(x[l]) : result[l];
        }
    }
    return result;
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

/* Tiles: LANES samples side by side, whatever W is; row k of a tile begins at its number 8 k and
 * takes VECTORS vectors. */
#define LANES 8
#define VECTORS (LANES / W)
#define UNROLL _Pragma("GCC unroll 8")
#define APART __attribute__((noinline, unused))
#define TILE(name, rows) double name[(rows) * LANES] __attribute__((aligned(64)))

/* LANES samples of `size` numbers as one tile: W numbers of W samples are turned in registers.
 * `roomy` allows reading past the end of each sample up to a multiple of W. */
static inline void turn(double *tile, const double *const *one, int size, int roomy)
{
    for (int h = 0; h < LANES; h += W) {
        for (int k = 0; k < size; k += W) {
            if (k + W <= size || roomy) {
                vd block[W];
                UNROLL for (int l = 0; l < W; ++l) {
                    block[l] = *(const vu *)(one[h + l] + k);
                }
                transpose(block);
                UNROLL for (int i = 0; i < W; ++i) {
                    if (k + i < size) {
                        *(vu *)(tile + (k + i) * LANES + h) = block[i];
                    }
                }
            } else {
                for (int i = k; i < size; ++i) {
                    for (int l = h; l < h + W; ++l) {
                        tile[i * LANES + l] = one[l][i];
                    }
                }
            }
        }
    }
}

/* The samples from `from` on, `step` apart, as one tile; lanes beyond `have` repeat the last one.
 * `left` numbers may be read, counting whole steps. */
static APART void load(double *tile, const double *from, long step, int size, long have, long left)
{
    const double *one[LANES];
    const long last = (have < LANES ? have : LANES) - 1;
    UNROLL for (int l = 0; l < LANES; ++l) {
        one[l] = from + (l < last ? l : last) * step;
    }
    turn(tile, one, size, left - last * step >= (size + W - 1) / W * W);
}

/* The samples that `rows` names, `step` apart in `from`, as one tile; step is a multiple of LANES. */
static APART void pick(double *tile, const double *from, const long *rows, int step, int size, long have)
{
    const double *one[LANES];
    for (int l = 0; l < LANES; ++l) {
        one[l] = from + rows[l < have ? l : have - 1] * step;
    }
    turn(tile, one, size, 1);
}

/* One tile as `have` samples of `size` numbers, one after the other. A row shorter than W is written
 * with a tail that the next sample overwrites, the last one by numbers. */
static APART void store(double *to, const double *tile, int size, long have)
{
    const long last = (have < LANES ? have : LANES) - 1;
    const int width = size < W ? size : W;
    if (2 * size < W) {
        for (long l = 0; l <= last; ++l) {
            for (int k = 0; k < size; ++k) {
                to[l * size + k] = tile[k * LANES + l];
            }
        }
        return;
    }
    for (int h = 0; h <= last; h += W) {
        for (int k = 0; k < size; k += W) {
            const int first = k + W <= size || size < W ? k : size - W;
            vd block[W];
            for (int i = 0; i < W; ++i) {
                block[i] = *(const vu *)(tile + (first + (i < width ? i : 0)) * LANES + h);
            }
            transpose(block);
            for (int l = 0; l < W && h + l <= last; ++l) {
                double *one = to + (h + l) * size + first;
                if (size >= W || h + l < last) {
                    *(vu *)one = block[l];
                } else {
                    for (int i = 0; i < width; ++i) {
                        one[i] = block[l][i];
                    }
                }
            }
        }
    }
}

/* The first `have` lanes of a tile that kernels added to; it is cleared for the next sums. */
static APART void add(double *total, double *tile, int size, long have)
{
    int k = 0;
    for (; k + W <= size; k += W) {
        vd sum = *(const vu *)(total + k);
        for (int h = 0; h < LANES; h += W) {
            vd block[W];
            UNROLL for (int i = 0; i < W; ++i) {
                vu *row = (vu *)(tile + (k + i) * LANES + h);
                block[i] = *row;
                *row = vd_all(0.0);
            }
            if (have == LANES) {
                sum += fold(block);
                continue;
            }
            transpose(block);
            UNROLL for (int l = 0; l < W; ++l) {
                if (h + l < have) {
                    sum += block[l];
                }
            }
        }
        *(vu *)(total + k) = sum;
    }
    for (; k < size; ++k) {
        for (int l = 0; l < LANES; ++l) {
            total[k] += l < have ? tile[k * LANES + l] : 0.0;
            tile[k * LANES + l] = 0.0;
        }
    }
}

#endif
