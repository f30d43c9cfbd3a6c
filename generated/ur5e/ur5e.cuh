/* ur5e: kernels for GPUs, written by symgen 0.1.0 with CasADi 3.8.2.
 * Model ce28a28f5d0c277be73f354f06d46ff2b57270d33e75be542f1238f09d292448.
 * C++11, no dependency: for nvcc, NVRTC and clang, and for the host, where a loop takes the place of
 * the threads. T is float or double. Do not edit: run symgen build.
 *
 * ur5e_cuda::KERNEL(inputs, outputs)        one sample, on plain arrays
 * ur5e_cuda::KERNEL_kernel<T><<<blocks, threads>>>(n, inputs, outputs)      one thread per sample
 * ur5e_cuda::KERNEL_samples<T>(n, inputs, outputs)                          the same on the host
 *
 * Entry k of sample i is data[k * entry + i * sample] of an array: {data, n, 1} is a structure of
 * arrays, which is read fastest, {data, 1, size} has sample after sample, and {data, 1, 0} serves
 * all samples. Outputs overlap no inputs. */
#ifndef SYMGEN_UR5E_CUH
#define SYMGEN_UR5E_CUH

#ifndef __CUDACC_RTC__
#include <math.h>
#endif

#ifndef SYMGEN_CUDA
#define SYMGEN_CUDA

#ifdef __CUDACC__
#define SYMGEN_BOTH __host__ __device__ __forceinline__
#define SYMGEN_UNROLL _Pragma("unroll")
#else
#define SYMGEN_BOTH inline
#define SYMGEN_UNROLL
#endif

template <typename T> struct symgen_array {
    T *data;
    long long entry, sample;
};

/* One sample of an array, read where it lies. */
template <typename T> struct symgen_sample {
    const T *data;
    long long entry;
    SYMGEN_BOTH T operator[](int k) const { return data[k * entry]; }
};

template <typename T> SYMGEN_BOTH void symgen_turn(T angle, T &sine, T &cosine)
{
#ifdef __CUDA_ARCH__
    sincos(angle, &sine, &cosine);
#else
    sine = sin(angle);
    cosine = cos(angle);
#endif
}

template <int SIZE, typename T> SYMGEN_BOTH void symgen_load(T *local, symgen_array<const T> array, long long i)
{
    SYMGEN_UNROLL
    for (int k = 0; k < SIZE; ++k) {
        local[k] = array.data[k * array.entry + i * array.sample];
    }
}

template <int SIZE, typename T> SYMGEN_BOTH void symgen_store(symgen_array<T> array, long long i, const T *local)
{
    SYMGEN_UNROLL
    for (int k = 0; k < SIZE; ++k) {
        array.data[k * array.entry + i * array.sample] = local[k];
    }
}
#endif

namespace ur5e_cuda {

/* beta = K pi, Eq. 3.11. 104 operations. */
template <typename Of_pi, typename T>
SYMGEN_BOTH void base_parameters(const Of_pi &pi, T *beta)
{
    const T t5 = T(0.18062500000000001) * pi[20];
    const T t18 = (((((pi[6] + pi[15]) + t5) + pi[25]) + (T(0.35221472999999998) * pi[30])) + (T(0.2666) * pi[33])) + pi[35];
    beta[0] = (t18 + (T(0.35221472999999998) * pi[40])) + (T(0.35221472999999998) * pi[50]);
    const T t33 = ((pi[11] + (T(-0.42499999999999999) * pi[20])) + (T(-0.42499999999999999) * pi[30])) + (T(-0.42499999999999999) * pi[40]);
    beta[1] = t33 + (T(-0.42499999999999999) * pi[50]);
    beta[2] = pi[12];
    const T t47 = (((pi[14] - pi[15]) + (T(-0.18062500000000001) * pi[20])) + (T(-0.18062500000000001) * pi[30])) + (T(-0.18062500000000001) * pi[40]);
    beta[3] = t47 + (T(-0.18062500000000001) * pi[50]);
    const T t58 = (((pi[16] + t5) + (T(0.18062500000000001) * pi[30])) + (T(0.18062500000000001) * pi[40])) + (T(0.18062500000000001) * pi[50]);
    beta[4] = t58;
    beta[5] = pi[17];
    const T t71 = ((pi[18] + (T(0.42499999999999999) * pi[23])) + (T(0.056652500000000001) * pi[30])) + (T(0.42499999999999999) * pi[33]);
    beta[6] = (t71 + (T(0.056652500000000001) * pi[40])) + (T(0.056652500000000001) * pi[50]);
    beta[7] = pi[19];
    const T t86 = ((pi[21] + (T(-0.39219999999999999) * pi[30])) + (T(-0.39219999999999999) * pi[40])) + (T(-0.39219999999999999) * pi[50]);
    beta[8] = t86;
    beta[9] = pi[22];
    const T t98 = (((pi[24] - pi[25]) + (T(-0.15382083999999999) * pi[30])) + (T(-0.15382083999999999) * pi[40])) + (T(-0.15382083999999999) * pi[50]);
    beta[10] = t98;
    const T t107 = ((pi[26] + (T(0.15382083999999999) * pi[30])) + (T(0.15382083999999999) * pi[40])) + (T(0.15382083999999999) * pi[50]);
    beta[11] = t107;
    beta[12] = pi[27];
    const T t119 = ((pi[28] + (T(0.052280260000000002) * pi[30])) + (T(0.39219999999999999) * pi[33])) + (T(0.052280260000000002) * pi[40]);
    beta[13] = t119 + (T(0.052280260000000002) * pi[50]);
    beta[14] = pi[29];
    beta[15] = pi[31];
    beta[16] = ((pi[32] + (T(-0.099699999999999997) * pi[40])) - pi[43]) + (T(-0.099699999999999997) * pi[50]);
    const T t139 = T(0.0099400900000000004) * pi[40];
    const T t142 = T(0.19939999999999999) * pi[43];
    const T t146 = T(0.0099400900000000004) * pi[50];
    beta[17] = ((((pi[34] - pi[35]) + t139) + t142) + pi[45]) + t146;
    beta[18] = (((pi[36] + t139) + t142) + pi[45]) + t146;
    beta[19] = pi[37];
    beta[20] = pi[38];
    beta[21] = pi[39];
    beta[22] = pi[41];
    beta[23] = (pi[42] + (T(0.099599999999999994) * pi[50])) + pi[53];
    const T t173 = T(0.0099201600000000008) * pi[50];
    const T t176 = T(0.19919999999999999) * pi[53];
    beta[24] = (((pi[44] - pi[45]) + t173) + t176) + pi[55];
    beta[25] = ((pi[46] + t173) + t176) + pi[55];
    beta[26] = pi[47];
    beta[27] = pi[48];
    beta[28] = pi[49];
    beta[29] = pi[51];
    beta[30] = pi[52];
    beta[31] = pi[54] - pi[55];
    beta[32] = pi[56];
    beta[33] = pi[57];
    beta[34] = pi[58];
    beta[35] = pi[59];
}

template <typename T>
SYMGEN_BOTH void base_parameters_at(long long i, symgen_array<const T> pi_, symgen_array<T> beta_)
{
    T pi[60];
    symgen_load<60>(pi, pi_, i);
    T beta_of[36];
    base_parameters(pi, beta_of);
    symgen_store<36>(beta_, i, beta_of);
}

/* K' slope, the adjoint of beta = K pi. 53 operations. */
template <typename Of_slope, typename T>
SYMGEN_BOTH void base_adjoint(const Of_slope &slope, T *gradient)
{
    gradient[0] = T(0.0);
    gradient[1] = T(0.0);
    gradient[2] = T(0.0);
    gradient[3] = T(0.0);
    gradient[4] = T(0.0);
    gradient[5] = T(0.0);
    gradient[6] = slope[0];
    gradient[7] = T(0.0);
    gradient[8] = T(0.0);
    gradient[9] = T(0.0);
    gradient[10] = T(0.0);
    gradient[11] = slope[1];
    gradient[12] = slope[2];
    gradient[13] = T(0.0);
    gradient[14] = slope[3];
    gradient[15] = slope[0] - slope[3];
    gradient[16] = slope[4];
    gradient[17] = slope[5];
    gradient[18] = slope[6];
    gradient[19] = slope[7];
    const T t33 = T(-0.42499999999999999) * slope[1];
    const T t36 = T(-0.18062500000000001) * slope[3];
    const T t38 = T(0.18062500000000001) * slope[4];
    gradient[20] = (((T(0.18062500000000001) * slope[0]) + t33) + t36) + t38;
    gradient[21] = slope[8];
    gradient[22] = slope[9];
    const T t46 = T(0.42499999999999999) * slope[6];
    gradient[23] = t46;
    gradient[24] = slope[10];
    gradient[25] = slope[0] - slope[10];
    gradient[26] = slope[11];
    gradient[27] = slope[12];
    gradient[28] = slope[13];
    gradient[29] = slope[14];
    const T t70 = (((((T(0.35221472999999998) * slope[0]) + t33) + t36) + t38) + (T(0.056652500000000001) * slope[6])) + (T(-0.39219999999999999) * slope[8]);
    const T t79 = ((t70 + (T(-0.15382083999999999) * slope[10])) + (T(0.15382083999999999) * slope[11])) + (T(0.052280260000000002) * slope[13]);
    gradient[30] = t79;
    gradient[31] = slope[15];
    gradient[32] = slope[16];
    gradient[33] = ((T(0.2666) * slope[0]) + t46) + (T(0.39219999999999999) * slope[13]);
    gradient[34] = slope[17];
    gradient[35] = slope[0] - slope[17];
    gradient[36] = slope[18];
    gradient[37] = slope[19];
    gradient[38] = slope[20];
    gradient[39] = slope[21];
    const T t111 = ((t79 + (T(-0.099699999999999997) * slope[16])) + (T(0.0099400900000000004) * slope[17])) + (T(0.0099400900000000004) * slope[18]);
    gradient[40] = t111;
    gradient[41] = slope[22];
    gradient[42] = slope[23];
    gradient[43] = ((T(0.19939999999999999) * slope[17]) - slope[16]) + (T(0.19939999999999999) * slope[18]);
    gradient[44] = slope[24];
    gradient[45] = (slope[17] + slope[18]) - slope[24];
    gradient[46] = slope[25];
    gradient[47] = slope[26];
    gradient[48] = slope[27];
    gradient[49] = slope[28];
    const T t143 = ((t111 + (T(0.099599999999999994) * slope[23])) + (T(0.0099201600000000008) * slope[24])) + (T(0.0099201600000000008) * slope[25]);
    gradient[50] = t143;
    gradient[51] = slope[29];
    gradient[52] = slope[30];
    gradient[53] = (slope[23] + (T(0.19919999999999999) * slope[24])) + (T(0.19919999999999999) * slope[25]);
    gradient[54] = slope[31];
    gradient[55] = (slope[24] + slope[25]) - slope[31];
    gradient[56] = slope[32];
    gradient[57] = slope[33];
    gradient[58] = slope[34];
    gradient[59] = slope[35];
}

template <typename T>
SYMGEN_BOTH void base_adjoint_at(long long i, symgen_array<const T> slope_, symgen_array<T> gradient_)
{
    T slope[36];
    symgen_load<36>(slope, slope_, i);
    T gradient_of[60];
    base_adjoint(slope, gradient_of);
    symgen_store<60>(gradient_, i, gradient_of);
}

/* tau = Y_b(q, dq, ddq) beta, Eq. 3.11. 524 operations. */
template <typename Of_q, typename Of_dq, typename Of_ddq, typename Of_beta, typename T>
SYMGEN_BOTH void base_inverse_dynamics(const Of_q &q, const Of_dq &dq, const Of_ddq &ddq, const Of_beta &beta, T *tau)
{
    T s1, c1;
    symgen_turn(q[1], s1, c1);
    T s3, c3;
    symgen_turn(q[2], s3, c3);
    T s5, c5;
    symgen_turn(q[3], s5, c5);
    T s7, c7;
    symgen_turn(q[4], s7, c7);
    T s9, c9;
    symgen_turn(q[5], s9, c9);
    const T t12 = s1 * ddq[0];
    const T t15 = c1 * dq[0];
    const T t17 = t15 * dq[1];
    const T t18 = t12 + t17;
    const T t21 = c1 * ddq[0];
    const T t22 = s1 * dq[0];
    const T t23 = t22 * dq[1];
    const T t24 = t21 - t23;
    const T t29 = (c3 * t15) - (s3 * t22);
    const T t32 = ((c3 * t18) + (s3 * t24)) + (t29 * dq[2]);
    const T t40 = (c3 * t22) + (s3 * t15);
    const T t42 = ((c3 * t24) - (s3 * t18)) - (t40 * dq[2]);
    const T t47 = (c5 * t29) - (s5 * t40);
    const T t50 = ((c5 * t32) + (s5 * t42)) + (t47 * dq[3]);
    const T t55 = ddq[1] + ddq[2];
    const T t57 = t55 + ddq[3];
    const T t60 = dq[1] + dq[2];
    const T t61 = t60 + dq[3];
    const T t65 = (c5 * t40) + (s5 * t29);
    const T t67 = (c7 * t61) - (s7 * t65);
    const T t70 = ((c7 * t50) + (s7 * t57)) + (t67 * dq[4]);
    const T t78 = ((c5 * t42) - (s5 * t32)) - (t65 * dq[3]);
    const T t79 = ddq[4] - t78;
    const T t84 = (c7 * t65) + (s7 * t61);
    const T t86 = dq[4] - t47;
    const T t88 = (s9 * t84) + (c9 * t86);
    const T t91 = ((c9 * t70) - (s9 * t79)) - (t88 * dq[5]);
    const T t94 = t67 + dq[5];
    const T t95 = t88 * t94;
    const T t101 = (c9 * t84) - (s9 * t86);
    const T t102 = t101 * t94;
    const T t107 = ((s9 * t70) + (c9 * t79)) + (t101 * dq[5]);
    const T t108 = t102 + t107;
    const T t116 = ((c7 * t57) - (s7 * t50)) - (t84 * dq[4]);
    const T t118 = t116 + ddq[5];
    const T t119 = t101 * t88;
    const T t120 = t118 - t119;
    const T t124 = t88 * t88;
    const T t125 = t94 * t94;
    const T t128 = ((((beta[31] * t91) - (beta[32] * t95)) - (beta[33] * t108)) + (beta[34] * t120)) + (beta[35] * (t124 - t125));
    const T t131 = t23 - t24;
    const T t132 = T(-0.42499999999999999) * t131;
    const T t134 = t40 * t60;
    const T t135 = t134 - t42;
    const T t138 = t40 * t40;
    const T t139 = t29 * t29;
    const T t143 = t132 + ((T(-0.39219999999999999) * t135) - (T(0.1333) * (t138 + t139)));
    const T t145 = t47 * t61;
    const T t146 = t145 + t50;
    const T t148 = t143 + (T(-0.099699999999999997) * t146);
    const T t151 = T(9.8100000000000005) * s1;
    const T t152 = t15 * t15;
    const T t153 = dq[1] * dq[1];
    const T t156 = t151 - (T(-0.42499999999999999) * (t152 + t153));
    const T t158 = T(9.8100000000000005) * c1;
    const T t159 = t22 * t15;
    const T t160 = t159 + ddq[1];
    const T t162 = t158 + (T(-0.42499999999999999) * t160);
    const T t164 = (c3 * t156) + (s3 * t162);
    const T t165 = t134 + t42;
    const T t167 = t60 * t60;
    const T t168 = t139 + t167;
    const T t171 = t164 + ((T(0.1333) * t165) - (T(-0.39219999999999999) * t168));
    const T t175 = (c3 * t162) - (s3 * t156);
    const T t176 = t40 * t29;
    const T t177 = t176 + t55;
    const T t179 = t29 * t60;
    const T t180 = t179 - t32;
    const T t183 = t175 + ((T(-0.39219999999999999) * t177) + (T(0.1333) * t180));
    const T t185 = (c5 * t171) + (s5 * t183);
    const T t186 = t65 * t47;
    const T t187 = t186 - t57;
    const T t189 = t185 + (T(-0.099699999999999997) * t187);
    const T t191 = (c7 * t148) - (s7 * t189);
    const T t193 = t84 * t84;
    const T t194 = t86 * t86;
    const T t195 = t193 + t194;
    const T t197 = t191 - (T(0.099599999999999994) * t195);
    const T t199 = t128 + (beta[30] * t197);
    const T t204 = t119 + t118;
    const T t207 = t91 - t95;
    const T t210 = t101 * t101;
    const T t213 = ((((beta[31] - beta[32]) * (t94 * t101)) + (beta[35] * t204)) + (beta[33] * t207)) + (beta[34] * (t125 - t210));
    const T t216 = t213 - (beta[29] * t197);
    const T t222 = ((t124 + t125) * beta[29]) + (t204 * beta[30]);
    const T t227 = (t120 * beta[29]) - ((t210 + t125) * beta[30]);
    const T t229 = (s9 * t222) - (c9 * t227);
    const T t235 = t67 * t86;
    const T t239 = t84 * t86;
    const T t240 = t239 - t116;
    const T t244 = t84 * t67;
    const T t245 = t244 + t79;
    const T t249 = t67 * t67;
    const T t252 = ((((beta[24] * t70) + (beta[25] * t235)) - (beta[26] * t240)) + (beta[27] * t245)) + (beta[28] * (t249 - t194));
    const T t257 = (c5 * t183) - (s5 * t171);
    const T t258 = t65 * t65;
    const T t259 = t61 * t61;
    const T t260 = t258 + t259;
    const T t262 = t257 - (T(-0.099699999999999997) * t260);
    const T t264 = ((((c9 * t199) - (s9 * t216)) + (T(0.099599999999999994) * t229)) + t252) - (beta[23] * t262);
    const T t277 = ((((beta[32] * t118) + (beta[31] * t119)) + (beta[34] * (t95 + t91))) + (beta[35] * (t102 - t107))) + (beta[33] * (t210 - t124));
    const T t280 = (c7 * t189) + (s7 * t148);
    const T t281 = t244 - t79;
    const T t283 = t280 + (T(0.099599999999999994) * t281);
    const T t285 = t235 + t70;
    const T t287 = (T(0.099599999999999994) * t285) - t262;
    const T t296 = t277 - ((beta[29] * ((s9 * t283) + (c9 * t287))) + (beta[30] * ((c9 * t283) - (s9 * t287))));
    const T t306 = ((((beta[24] - beta[25]) * (t86 * t84)) - (beta[28] * t281)) + (beta[26] * t285)) + (beta[27] * (t194 - t193));
    const T t310 = (t296 + t306) + (beta[22] * t262);
    const T t319 = (c9 * t222) + (s9 * t227);
    const T t320 = ((t281 * beta[23]) - ((t249 + t194) * beta[22])) - t319;
    const T t328 = ((t108 * beta[29]) + (t207 * beta[30])) + ((t245 * beta[22]) - (t195 * beta[23]));
    const T t330 = (s7 * t320) + (c7 * t328);
    const T t339 = t65 * t61;
    const T t340 = t339 - t78;
    const T t344 = t186 + t57;
    const T t348 = t47 * t47;
    const T t351 = ((((beta[17] * t50) + (beta[18] * t145)) - (beta[19] * t340)) + (beta[20] * t344)) + (beta[21] * (t348 - t259));
    const T t355 = ((((c7 * t264) - (s7 * t310)) + (T(-0.099699999999999997) * t330)) + t351) + (beta[16] * t143);
    const T t366 = ((((beta[17] - beta[18]) * (t61 * t65)) - (beta[21] * t187)) + (beta[19] * t146)) + (beta[20] * (t259 - t258));
    const T t383 = ((((beta[25] * t79) - (beta[24] * t244)) - (beta[27] * (t235 - t70))) + (beta[28] * (t239 + t116))) + (beta[26] * (t193 - t249));
    const T t388 = (((T(0.099599999999999994) * t319) - ((s9 * t199) + (c9 * t216))) + t383) + ((beta[22] * t191) - (beta[23] * t280));
    const T t392 = (t366 - t388) - (beta[15] * t143);
    const T t397 = (c7 * t320) - (s7 * t328);
    const T t402 = t397 + ((t187 * beta[16]) - ((t348 + t259) * beta[15]));
    const T t411 = ((t344 * beta[15]) - (t260 * beta[16])) - (t229 + ((t240 * beta[22]) + (t285 * beta[23])));
    const T t413 = (s5 * t402) + (c5 * t411);
    const T t430 = ((((beta[10] * t32) + (beta[11] * t179)) - (beta[12] * t135)) + (beta[13] * t177)) + (beta[14] * (t139 - t167));
    const T t434 = ((((c5 * t355) - (s5 * t392)) - (T(0.1333) * t413)) + t430) + (beta[9] * t132);
    const T t441 = (c5 * t402) - (s5 * t411);
    const T t446 = t330 + ((t340 * beta[15]) + (t146 * beta[16]));
    const T t453 = t176 - t55;
    const T t456 = t179 + t32;
    const T t461 = ((((beta[10] - beta[11]) * (t60 * t40)) - (beta[14] * t453)) + (beta[12] * t456)) + (beta[13] * (t167 - t138));
    const T t465 = ((((s5 * t355) + (c5 * t392)) + ((T(0.1333) * t441) - (T(-0.39219999999999999) * t446))) + t461) - (beta[8] * t132);
    const T t482 = ((((beta[3] * t18) + (beta[4] * t17)) - (beta[5] * t131)) + (beta[6] * t160)) + (beta[7] * (t152 - t153));
    const T t493 = ((s3 * t434) + (c3 * t465)) - (T(-0.42499999999999999) * (t446 + ((t135 * beta[8]) + (t456 * beta[9]))));
    const T t503 = t22 * t22;
    const T t506 = ((((beta[3] - beta[4]) * (dq[1] * t22)) - (beta[7] * (t159 - ddq[1]))) + (beta[5] * (t17 + t18))) + (beta[6] * (t153 - t503));
    tau[0] = ((s1 * (((c3 * t434) - (s3 * t465)) + t482)) + (c1 * (t493 + t506))) + (beta[0] * ddq[0]);
    const T t530 = ((((beta[18] * t57) - (beta[17] * t186)) - (beta[20] * (t145 - t50))) + (beta[21] * (t339 + t78))) + (beta[19] * (t258 - t348));
    const T t535 = ((((s7 * t264) + (c7 * t310)) - (T(-0.099699999999999997) * t397)) + t530) + ((beta[15] * t257) - (beta[16] * t185));
    const T t547 = ((((beta[11] * t55) - (beta[10] * t176)) - (beta[13] * t180)) + (beta[14] * t165)) + (beta[12] * (t138 - t139));
    const T t552 = ((t535 + (T(-0.39219999999999999) * t413)) + t547) + ((beta[8] * t175) - (beta[9] * t164));
    const T t564 = (s3 * (t441 + ((t453 * beta[9]) - (t168 * beta[8])))) + (c3 * (t413 + ((t177 * beta[8]) - ((t138 + t167) * beta[9]))));
    const T t576 = ((((beta[4] * ddq[1]) - (beta[3] * t159)) + (beta[6] * t12)) + (beta[7] * t21)) + (beta[5] * (t503 - t152));
    tau[1] = ((t552 + (T(-0.42499999999999999) * t564)) + t576) + ((beta[1] * t158) - (beta[2] * t151));
    tau[2] = t552;
    tau[3] = t535;
    tau[4] = t388;
    tau[5] = t296;
}

template <typename T>
SYMGEN_BOTH void base_inverse_dynamics_at(long long i, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> beta_, symgen_array<T> tau_)
{
    T q[6];
    symgen_load<6>(q, q_, i);
    T dq[6];
    symgen_load<6>(dq, dq_, i);
    T ddq[6];
    symgen_load<6>(ddq, ddq_, i);
    const symgen_sample<T> beta = {beta_.data + i * beta_.sample, beta_.entry};
    T tau_of[6];
    base_inverse_dynamics(q, dq, ddq, beta, tau_of);
    symgen_store<6>(tau_, i, tau_of);
}

/* tau = Y(q, dq, ddq) pi, Eq. 4.3. 602 operations. */
template <typename Of_q, typename Of_dq, typename Of_ddq, typename Of_pi, typename T>
SYMGEN_BOTH void inverse_dynamics(const Of_q &q, const Of_dq &dq, const Of_ddq &ddq, const Of_pi &pi, T *tau)
{
    T beta[36];
    base_parameters(pi, beta);
    base_inverse_dynamics(q, dq, ddq, beta, tau);
}

template <typename T>
SYMGEN_BOTH void inverse_dynamics_at(long long i, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> pi_, symgen_array<T> tau_)
{
    T q[6];
    symgen_load<6>(q, q_, i);
    T dq[6];
    symgen_load<6>(dq, dq_, i);
    T ddq[6];
    symgen_load<6>(ddq, ddq_, i);
    const symgen_sample<T> pi = {pi_.data + i * pi_.sample, pi_.entry};
    T tau_of[6];
    inverse_dynamics(q, dq, ddq, pi, tau_of);
    symgen_store<6>(tau_, i, tau_of);
}

/* M(q), Eq. 2.34. 419 operations. */
template <typename Of_q, typename Of_pi, typename T>
SYMGEN_BOTH void mass_matrix(const Of_q &q, const Of_pi &pi, T *M)
{
    const T t7 = -(T(-0.099699999999999997) * pi[43]);
    const T t12 = pi[40] + pi[50];
    const T t14 = (t7 + t7) + (T(0.0099400899999999986) * t12);
    const T t16 = T(-0.099699999999999997) * t12;
    const T t22 = pi[35] + (t14 - (T(-0.19939999999999999) * ((t16 / T(2.0)) - pi[43])));
    const T t28 = pi[30] + t12;
    const T t30 = (T(0.2666) * pi[33]) + (T(0.17158973) * t28);
    const T t32 = pi[25] + (t22 + t30);
    const T t35 = pi[20] + t28;
    const T t36 = T(0.18062499999999998) * t35;
    const T t38 = pi[15] + (t32 + t36);
    T s41, c41;
    symgen_turn(q[1], s41, c41);
    const T t46 = T(-0.42499999999999999) * ((T(-0.42499999999999999) * t35) / T(2.0));
    T s53, c53;
    symgen_turn(q[2], s53, c53);
    const T t56 = T(-0.39219999999999999) * t28;
    const T t57 = t56 / T(2.0);
    const T t58 = T(-0.39219999999999999) * t57;
    T s65, c65;
    symgen_turn(q[3], s65, c65);
    const T t73 = (T(0.19919999999999999) * pi[53]) + (T(0.009920159999999999) * pi[50]);
    const T t75 = T(0.099599999999999994) * pi[50];
    const T t80 = pi[45] + (t73 - (T(0.19919999999999999) * (pi[53] + (t75 / T(2.0)))));
    const T t81 = t80 + t14;
    T s85, c85;
    symgen_turn(q[4], s85, c85);
    const T t88 = pi[55] + t73;
    T s92, c92;
    symgen_turn(q[5], s92, c92);
    const T t94 = pi[54] - pi[55];
    const T t98 = s92 * pi[57];
    const T t101 = c92 * pi[57];
    const T t104 = ((pi[44] + t88) - t80) + ((((c92 * t94) - t98) * c92) - (t101 * s92));
    const T t114 = c92 * pi[51];
    const T t116 = s92 * pi[52];
    const T t117 = t114 - t116;
    const T t120 = pi[47] + (((pi[58] * c92) - (pi[59] * s92)) - (T(0.099599999999999994) * t117));
    const T t121 = s85 * t120;
    const T t124 = c85 * t120;
    const T t126 = s85 * pi[56];
    const T t130 = s92 * pi[51];
    const T t131 = c92 * pi[52];
    const T t132 = t130 + t131;
    const T t133 = T(-0.19939999999999999) * t132;
    const T t135 = ((pi[34] + t81) - t22) + (((((c85 * t104) - t121) * c85) - ((t124 - t126) * s85)) + t133);
    const T t143 = (s92 * pi[58]) + (c92 * pi[59]);
    const T t145 = pi[49] + ((T(0.099599999999999994) * t132) - t143);
    const T t150 = (s92 * t94) + t101;
    const T t153 = pi[48] + ((t98 * s92) - (t150 * c92));
    const T t157 = pi[41] + t117;
    const T t161 = pi[42] + (pi[53] + t75);
    const T t163 = (c85 * t157) - (s85 * t161);
    const T t164 = T(-0.099699999999999997) * t163;
    const T t166 = pi[37] + (((t145 * s85) - (t153 * c85)) - t164);
    const T t167 = s65 * t166;
    const T t170 = c65 * t166;
    const T t176 = (pi[46] + t88) + ((t150 * s92) + (t98 * c92));
    const T t177 = T(-0.099699999999999997) * t132;
    const T t180 = ((t176 - t177) - t177) + t133;
    const T t186 = pi[31] + t163;
    const T t191 = (pi[32] + (t16 - pi[43])) + t132;
    const T t193 = (c65 * t186) - (s65 * t191);
    const T t194 = T(-0.39219999999999999) * t193;
    const T t198 = s85 * t157;
    const T t199 = c85 * t161;
    const T t200 = t198 + t199;
    const T t201 = T(0.1333) * t200;
    const T t202 = t194 + t201;
    const T t203 = t202 + t202;
    const T t205 = ((pi[24] + (((t22 - t58) - t58) + t30)) - t32) + (((((((c65 * t135) - t167) * c65) - ((t170 - (s65 * t180)) * s65)) - t194) - t194) + t203);
    const T t210 = (s65 * t135) + t170;
    const T t213 = t167 + (c65 * t180);
    const T t216 = s65 * t186;
    const T t217 = c65 * t191;
    const T t218 = t216 + t217;
    const T t221 = pi[27] + (((t210 * c65) - (t213 * s65)) - (T(-0.39219999999999999) * t218));
    const T t222 = s53 * t221;
    const T t225 = c53 * t221;
    const T t229 = ((t210 * s65) + (t213 * c65)) + t203;
    const T t236 = (pi[21] + t56) + t193;
    const T t239 = pi[22] + t218;
    const T t241 = (c53 * t236) - (s53 * t239);
    const T t242 = T(-0.42499999999999999) * t241;
    const T t246 = T(-0.84999999999999998) * t241;
    const T t248 = ((pi[14] + (((t32 - t46) - t46) + t36)) - t38) + (((((((c53 * t205) - t222) * c53) - ((t225 - (s53 * t229)) * s53)) - t242) - t242) + t246);
    const T t253 = (s53 * t205) + t225;
    const T t256 = t222 + (c53 * t229);
    const T t264 = pi[17] + (((t253 * c53) - (t256 * s53)) - (T(-0.42499999999999999) * ((s53 * t236) + (c53 * t239))));
    const T t276 = (((s41 * t248) + (c41 * t264)) * s41) + (((s41 * t264) + (c41 * (((t253 * s53) + (t256 * c53)) + t246))) * c41);
    M[0] = (pi[6] + t38) + t276;
    const T t281 = T(0.1333) * t28;
    const T t289 = pi[33] + (t281 / T(2.0));
    const T t295 = (s85 * t104) + t124;
    const T t297 = c85 * pi[56];
    const T t298 = t121 + t297;
    const T t301 = pi[38] + ((t295 * c85) - (t298 * s85));
    const T t306 = (s85 * t153) + (c85 * t145);
    const T t309 = pi[39] - (t306 + (T(-0.099699999999999997) * t200));
    const T t312 = T(0.1333) * t193;
    const T t316 = (pi[28] - ((T(0.1333) * t57) + (T(-0.39219999999999999) * t289))) + ((((t301 * c65) - (t309 * s65)) - t312) - (T(-0.39219999999999999) * t200));
    const T t324 = pi[29] + (((t301 * s65) + (t309 * c65)) - (T(0.1333) * t218));
    const T t329 = (pi[18] - (T(-0.42499999999999999) * (pi[23] + (pi[33] + t281)))) + (((t316 * c53) - (t324 * s53)) - (T(-0.42499999999999999) * t200));
    const T t337 = (s41 * t329) + (c41 * (pi[19] + ((t316 * s53) + (t324 * c53))));
    M[1] = t337;
    const T t347 = (s41 * ((c53 * t316) - (s53 * t324))) + (c41 * ((s53 * t316) + (c53 * t324)));
    M[2] = t347;
    const T t352 = ((c65 * t301) - (s65 * t309)) - t312;
    const T t357 = t217 + t216;
    const T t359 = ((s65 * t301) + (c65 * t309)) - (T(0.1333) * t357);
    const T t367 = (s41 * ((c53 * t352) - (s53 * t359))) + (c41 * ((s53 * t352) + (c53 * t359)));
    M[3] = t367;
    const T t372 = ((c85 * t153) - (s85 * t145)) + t164;
    const T t376 = t199 + t198;
    const T t377 = s65 * t376;
    const T t379 = ((c65 * t372) + (s65 * t176)) + (T(0.1333) * t377);
    const T t384 = c65 * t376;
    const T t388 = ((s65 * t372) - (c65 * t176)) - ((T(0.1333) * t384) + (T(-0.39219999999999999) * t163));
    const T t398 = (s41 * ((c53 * t379) - (s53 * t388))) + (c41 * (((s53 * t379) + (c53 * t388)) - (T(-0.42499999999999999) * t163)));
    M[4] = t398;
    const T t403 = t116 - t114;
    const T t405 = ((c92 * pi[58]) - (s92 * pi[59])) + (T(0.099599999999999994) * t403);
    const T t408 = t131 + t130;
    const T t409 = s85 * t408;
    const T t411 = ((c85 * t405) - t126) - (T(-0.099699999999999997) * t409);
    const T t414 = (T(0.099599999999999994) * t408) - t143;
    const T t417 = c85 * t408;
    const T t420 = (s65 * t417) + (c65 * t403);
    const T t422 = ((c65 * t411) + (s65 * t414)) + (T(0.1333) * t420);
    const T t429 = (s65 * t403) - (c65 * t417);
    const T t433 = ((s65 * t411) - (c65 * t414)) + ((T(0.1333) * t429) + (T(-0.39219999999999999) * t409));
    const T t443 = (s41 * ((c53 * t422) - (s53 * t433))) + (c41 * (((s53 * t422) + (c53 * t433)) + (T(-0.42499999999999999) * t409)));
    M[5] = t443;
    M[6] = t337;
    const T t458 = (pi[36] + t81) + (((t295 * s85) + (t298 * c85)) + t133);
    const T t462 = (pi[26] + (t30 - (T(0.2666) * t289))) + (((t458 - t201) - t201) + t203);
    M[7] = (pi[16] + t36) + (t462 + t246);
    const T t466 = t462 + t242;
    M[8] = t466;
    const T t468 = t458 + t194;
    const T t473 = t468 + (T(-0.42499999999999999) * ((c53 * t193) - (s53 * t357)));
    M[9] = t473;
    const T t476 = t306 + (T(-0.099699999999999997) * t376);
    const T t478 = t476 - (T(-0.39219999999999999) * t377);
    const T t483 = t478 - (T(-0.42499999999999999) * ((s53 * t384) + (c53 * t377)));
    M[10] = t483;
    const T t488 = ((s85 * t405) + t297) + (T(-0.099699999999999997) * t417);
    const T t490 = t488 - (T(-0.39219999999999999) * t420);
    const T t495 = t490 + (T(-0.42499999999999999) * ((s53 * t429) - (c53 * t420)));
    M[11] = t495;
    M[12] = t347;
    M[13] = t466;
    M[14] = t462;
    M[15] = t468;
    M[16] = t478;
    M[17] = t490;
    M[18] = t367;
    M[19] = t473;
    M[20] = t468;
    M[21] = t458;
    M[22] = t476;
    M[23] = t488;
    M[24] = t398;
    M[25] = t483;
    M[26] = t478;
    M[27] = t476;
    M[28] = t176;
    M[29] = t414;
    M[30] = t443;
    M[31] = t495;
    M[32] = t490;
    M[33] = t488;
    M[34] = t414;
    M[35] = pi[56];
}

template <typename T>
SYMGEN_BOTH void mass_matrix_at(long long i, symgen_array<const T> q_, symgen_array<const T> pi_, symgen_array<T> M_)
{
    T q[6];
    symgen_load<6>(q, q_, i);
    const symgen_sample<T> pi = {pi_.data + i * pi_.sample, pi_.entry};
    T M_of[36];
    mass_matrix(q, pi, M_of);
    symgen_store<36>(M_, i, M_of);
}

/* h = C(q, dq) dq - tau_grav, Eq. 2.34. 571 operations. */
template <typename Of_q, typename Of_dq, typename Of_pi, typename T>
SYMGEN_BOTH void bias_forces(const Of_q &q, const Of_dq &dq, const Of_pi &pi, T *h)
{
    const T ddq[6] = {0};
    inverse_dynamics(q, dq, ddq, pi, h);
}

template <typename T>
SYMGEN_BOTH void bias_forces_at(long long i, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> pi_, symgen_array<T> h_)
{
    T q[6];
    symgen_load<6>(q, q_, i);
    T dq[6];
    symgen_load<6>(dq, dq_, i);
    const symgen_sample<T> pi = {pi_.data + i * pi_.sample, pi_.entry};
    T h_of[6];
    bias_forces(q, dq, pi, h_of);
    symgen_store<6>(h_, i, h_of);
}

/* ddq = (M + diag(J))^-1 (tau - h), J of the rotors. 1067 operations. */
template <typename Of_q, typename Of_dq, typename Of_tau, typename Of_pi, typename Of_rotor, typename T>
SYMGEN_BOTH void forward_dynamics(const Of_q &q, const Of_dq &dq, const Of_tau &tau, const Of_pi &pi, const Of_rotor &rotor, T *ddq)
{
    T s2, c2;
    symgen_turn(q[1], s2, c2);
    T s4, c4;
    symgen_turn(q[2], s4, c4);
    T s6, c6;
    symgen_turn(q[3], s6, c6);
    T s8, c8;
    symgen_turn(q[4], s8, c8);
    T s10, c10;
    symgen_turn(q[5], s10, c10);
    const T t13 = pi[54] - pi[55];
    const T t16 = c2 * dq[0];
    const T t18 = t16 * dq[1];
    const T t21 = s2 * dq[0];
    const T t22 = t21 * dq[1];
    const T t27 = (c4 * t16) - (s4 * t21);
    const T t30 = ((c4 * t18) - (s4 * t22)) + (t27 * dq[2]);
    const T t38 = (c4 * t21) + (s4 * t16);
    const T t40 = ((s4 * t18) + (c4 * t22)) + (t38 * dq[2]);
    const T t45 = (c6 * t27) - (s6 * t38);
    const T t48 = ((c6 * t30) - (s6 * t40)) + (t45 * dq[3]);
    const T t50 = dq[1] + dq[2];
    const T t51 = t50 + dq[3];
    const T t56 = (c6 * t38) + (s6 * t27);
    const T t58 = (c8 * t51) - (s8 * t56);
    const T t61 = (c8 * t48) + (t58 * dq[4]);
    const T t68 = ((s6 * t30) + (c6 * t40)) + (t56 * dq[3]);
    const T t73 = (c8 * t56) + (s8 * t51);
    const T t75 = dq[4] - t45;
    const T t77 = (s10 * t73) + (c10 * t75);
    const T t80 = ((c10 * t61) - (s10 * t68)) - (t77 * dq[5]);
    const T t83 = t58 + dq[5];
    const T t84 = t77 * t83;
    const T t90 = (c10 * t73) - (s10 * t75);
    const T t91 = t90 * t83;
    const T t96 = ((s10 * t61) + (c10 * t68)) + (t90 * dq[5]);
    const T t97 = t91 + t96;
    const T t101 = t90 * t77;
    const T t104 = (s8 * t48) + (t73 * dq[4]);
    const T t105 = t101 + t104;
    const T t109 = t77 * t77;
    const T t110 = t83 * t83;
    const T t116 = T(-0.84999999999999998) * t22;
    const T t118 = t38 * t50;
    const T t119 = t118 + t40;
    const T t122 = t38 * t38;
    const T t123 = t27 * t27;
    const T t127 = t116 + ((T(-0.39219999999999999) * t119) - (T(0.1333) * (t122 + t123)));
    const T t129 = t45 * t51;
    const T t130 = t129 + t48;
    const T t132 = t127 + (T(-0.099699999999999997) * t130);
    const T t135 = T(9.8100000000000005) * s2;
    const T t137 = t16 * t16;
    const T t138 = dq[1] * dq[1];
    const T t141 = t135 - (T(-0.42499999999999999) * (t137 + t138));
    const T t143 = T(9.8100000000000005) * c2;
    const T t144 = t21 * t16;
    const T t146 = t143 + (T(-0.42499999999999999) * t144);
    const T t148 = (c4 * t141) + (s4 * t146);
    const T t149 = t118 - t40;
    const T t151 = t50 * t50;
    const T t152 = t123 + t151;
    const T t155 = t148 + ((T(0.1333) * t149) - (T(-0.39219999999999999) * t152));
    const T t159 = (c4 * t146) - (s4 * t141);
    const T t160 = t38 * t27;
    const T t162 = t27 * t50;
    const T t163 = t162 - t30;
    const T t166 = t159 + ((T(-0.39219999999999999) * t160) + (T(0.1333) * t163));
    const T t168 = (c6 * t155) + (s6 * t166);
    const T t169 = t56 * t45;
    const T t171 = t168 + (T(-0.099699999999999997) * t169);
    const T t173 = (c8 * t132) - (s8 * t171);
    const T t175 = t73 * t73;
    const T t176 = t75 * t75;
    const T t177 = t175 + t176;
    const T t179 = t173 - (T(0.099599999999999994) * t177);
    const T t181 = (((((t13 * t80) - (pi[56] * t84)) - (pi[57] * t97)) - (pi[58] * t105)) + (pi[59] * (t109 - t110))) + (pi[52] * t179);
    const T t186 = t104 - t101;
    const T t189 = t80 - t84;
    const T t192 = t90 * t90;
    const T t198 = (((((t13 - pi[56]) * (t83 * t90)) - (pi[59] * t186)) + (pi[57] * t189)) + (pi[58] * (t110 - t192))) - (pi[51] * t179);
    const T t204 = (t105 * pi[51]) + ((t192 + t110) * pi[52]);
    const T t209 = (t186 * pi[52]) - ((t109 + t110) * pi[51]);
    const T t211 = (c10 * t204) - (s10 * t209);
    const T t221 = (T(0.19919999999999999) * pi[53]) + (T(0.009920159999999999) * pi[50]);
    const T t222 = pi[55] + t221;
    const T t225 = T(0.099599999999999994) * pi[50];
    const T t231 = pi[45] + (t221 - (T(0.19919999999999999) * (pi[53] + (t225 / T(2.0)))));
    const T t232 = (pi[44] + t222) - t231;
    const T t235 = pi[46] + t222;
    const T t236 = t58 * t75;
    const T t240 = t73 * t75;
    const T t241 = t240 + t104;
    const T t245 = t73 * t58;
    const T t246 = t245 + t68;
    const T t250 = t58 * t58;
    const T t254 = (((c10 * t181) - (s10 * t198)) + (T(0.099599999999999994) * t211)) + (((((t232 * t61) + (t235 * t236)) - (pi[47] * t241)) + (pi[48] * t246)) + (pi[49] * (t250 - t176)));
    const T t257 = pi[42] + (pi[53] + t225);
    const T t260 = (c6 * t166) - (s6 * t155);
    const T t261 = t56 * t56;
    const T t262 = t51 * t51;
    const T t263 = t261 + t262;
    const T t265 = t260 - (T(-0.099699999999999997) * t263);
    const T t267 = t254 - (t257 * t265);
    const T t280 = ((((t13 * t101) - (pi[56] * t104)) + (pi[58] * (t84 + t80))) + (pi[59] * (t91 - t96))) + (pi[57] * (t192 - t109));
    const T t283 = (c8 * t171) + (s8 * t132);
    const T t284 = t245 - t68;
    const T t286 = t283 + (T(0.099599999999999994) * t284);
    const T t288 = t236 + t61;
    const T t290 = (T(0.099599999999999994) * t288) - t265;
    const T t299 = t280 - ((pi[51] * ((s10 * t286) + (c10 * t290))) + (pi[52] * ((c10 * t286) - (s10 * t290))));
    const T t310 = t299 + (((((t232 - t235) * (t75 * t73)) - (pi[49] * t284)) + (pi[47] * t288)) + (pi[48] * (t176 - t175)));
    const T t313 = t310 + (pi[41] * t265);
    const T t318 = (c10 * t209) + (s10 * t204);
    const T t323 = t318 + ((t284 * t257) - ((t250 + t176) * pi[41]));
    const T t331 = ((t97 * pi[51]) + (t189 * pi[52])) + ((t246 * pi[41]) - (t177 * t257));
    const T t333 = (s8 * t323) + (c8 * t331);
    const T t339 = -(T(-0.099699999999999997) * pi[43]);
    const T t343 = pi[40] + pi[50];
    const T t345 = (t339 + t339) + (T(0.0099400899999999986) * t343);
    const T t346 = t231 + t345;
    const T t350 = T(-0.099699999999999997) * t343;
    const T t355 = pi[35] + (t345 - (T(-0.19939999999999999) * ((t350 / T(2.0)) - pi[43])));
    const T t356 = (pi[34] + t346) - t355;
    const T t359 = pi[36] + t346;
    const T t363 = t56 * t51;
    const T t364 = t363 + t68;
    const T t371 = t45 * t45;
    const T t375 = (((c8 * t267) - (s8 * t313)) + (T(-0.099699999999999997) * t333)) + (((((t356 * t48) + (t359 * t129)) - (pi[37] * t364)) + (pi[38] * t169)) + (pi[39] * (t371 - t262)));
    const T t378 = pi[32] + (t350 - pi[43]);
    const T t380 = t375 + (t378 * t127);
    const T t403 = ((((t235 * t68) - (t232 * t245)) - (pi[48] * (t236 - t61))) + (pi[49] * (t240 - t104))) + (pi[47] * (t175 - t250));
    const T t413 = (t403 - (((s10 * t181) + (c10 * t198)) + (T(0.099599999999999994) * t318))) + ((pi[41] * t173) - (t257 * t283));
    const T t414 = (((((t356 - t359) * (t51 * t56)) - (pi[39] * t169)) + (pi[37] * t130)) + (pi[38] * (t262 - t261))) - t413;
    const T t417 = t414 - (pi[31] * t127);
    const T t422 = (c8 * t323) - (s8 * t331);
    const T t427 = t422 + ((t169 * t378) - ((t371 + t262) * pi[31]));
    const T t436 = ((t169 * pi[31]) - (t263 * t378)) - (t211 + ((t241 * pi[41]) + (t288 * t257)));
    const T t438 = (s6 * t427) + (c6 * t436);
    const T t443 = pi[30] + t343;
    const T t444 = T(-0.39219999999999999) * t443;
    const T t445 = t444 / T(2.0);
    const T t446 = T(-0.39219999999999999) * t445;
    const T t454 = (T(0.2666) * pi[33]) + (T(0.17158973) * t443);
    const T t459 = pi[25] + (t355 + t454);
    const T t460 = (pi[24] + (((t355 - t446) - t446) + t454)) - t459;
    const T t463 = T(0.1333) * t443;
    const T t465 = pi[33] + (t463 / T(2.0));
    const T t468 = pi[26] + (t454 - (T(0.2666) * t465));
    const T t478 = pi[28] - ((T(0.1333) * t445) + (T(-0.39219999999999999) * t465));
    const T t485 = (((c6 * t380) - (s6 * t417)) - (T(0.1333) * t438)) + (((((t460 * t30) + (t468 * t162)) - (pi[27] * t119)) + (t478 * t160)) + (pi[29] * (t123 - t151)));
    const T t488 = t485 + (pi[22] * t116);
    const T t495 = (c6 * t427) - (s6 * t436);
    const T t500 = t333 + ((t364 * pi[31]) + (t130 * t378));
    const T t509 = t162 + t30;
    const T t515 = (((s6 * t380) + (c6 * t417)) + ((T(0.1333) * t495) - (T(-0.39219999999999999) * t500))) + (((((t460 - t468) * (t50 * t38)) - (pi[29] * t160)) + (pi[27] * t509)) + (t478 * (t151 - t122)));
    const T t517 = pi[21] + t444;
    const T t519 = t515 - (t517 * t116);
    const T t524 = pi[20] + t443;
    const T t525 = T(-0.42499999999999999) * t524;
    const T t527 = T(-0.42499999999999999) * (t525 / T(2.0));
    const T t531 = T(0.18062499999999998) * t524;
    const T t536 = pi[15] + (t459 + t531);
    const T t537 = (pi[14] + (((t459 - t527) - t527) + t531)) - t536;
    const T t540 = pi[16] + t531;
    const T t552 = pi[18] - (T(-0.42499999999999999) * (pi[23] + (pi[33] + t463)));
    const T t558 = ((((t537 * t18) + (t540 * t18)) - (pi[17] * (t22 + t22))) + (t552 * t144)) + (pi[19] * (t137 - t138));
    const T t578 = t21 * t21;
    const T t581 = ((((t537 - t540) * (dq[1] * t21)) - (pi[19] * t144)) + (pi[17] * (t18 + t18))) + (t552 * (t138 - t578));
    const T t582 = (((s4 * t488) + (c4 * t519)) - (T(-0.42499999999999999) * (t500 + ((t119 * t517) + (t509 * pi[22]))))) + t581;
    const T t585 = tau[0] - ((s2 * (((c4 * t488) - (s4 * t519)) + t558)) + (c2 * t582));
    const T t589 = s10 * pi[57];
    const T t592 = c10 * pi[57];
    const T t595 = t232 + ((((c10 * t13) - t589) * c10) - (t592 * s10));
    const T t600 = c10 * pi[51];
    const T t601 = s10 * pi[52];
    const T t602 = t600 - t601;
    const T t605 = pi[47] + (((pi[58] * c10) - (pi[59] * s10)) - (T(0.099599999999999994) * t602));
    const T t606 = s8 * t605;
    const T t609 = c8 * t605;
    const T t610 = s8 * pi[56];
    const T t614 = s10 * pi[51];
    const T t615 = c10 * pi[52];
    const T t616 = t614 + t615;
    const T t617 = T(-0.19939999999999999) * t616;
    const T t619 = t356 + (((((c8 * t595) - t606) * c8) - ((t609 - t610) * s8)) + t617);
    const T t624 = (s10 * pi[58]) + (c10 * pi[59]);
    const T t626 = pi[49] + ((T(0.099599999999999994) * t616) - t624);
    const T t630 = (s10 * t13) + t592;
    const T t633 = pi[48] + ((t589 * s10) - (t630 * c10));
    const T t636 = pi[41] + t602;
    const T t639 = (c8 * t636) - (s8 * t257);
    const T t640 = T(-0.099699999999999997) * t639;
    const T t642 = pi[37] + (((t626 * s8) - (t633 * c8)) - t640);
    const T t643 = s6 * t642;
    const T t646 = c6 * t642;
    const T t650 = t235 + ((t630 * s10) + (t589 * c10));
    const T t651 = T(-0.099699999999999997) * t616;
    const T t654 = ((t650 - t651) - t651) + t617;
    const T t659 = pi[31] + t639;
    const T t661 = t378 + t616;
    const T t663 = (c6 * t659) - (s6 * t661);
    const T t664 = T(-0.39219999999999999) * t663;
    const T t667 = s8 * t636;
    const T t668 = c8 * t257;
    const T t669 = t667 + t668;
    const T t670 = T(0.1333) * t669;
    const T t671 = t664 + t670;
    const T t672 = t671 + t671;
    const T t674 = t460 + (((((((c6 * t619) - t643) * c6) - ((t646 - (s6 * t654)) * s6)) - t664) - t664) + t672);
    const T t677 = (s6 * t619) + t646;
    const T t680 = t643 + (c6 * t654);
    const T t683 = s6 * t659;
    const T t684 = c6 * t661;
    const T t685 = t683 + t684;
    const T t688 = pi[27] + (((t677 * c6) - (t680 * s6)) - (T(-0.39219999999999999) * t685));
    const T t689 = s4 * t688;
    const T t692 = c4 * t688;
    const T t696 = ((t677 * s6) + (t680 * c6)) + t672;
    const T t701 = t517 + t663;
    const T t703 = pi[22] + t685;
    const T t705 = (c4 * t701) - (s4 * t703);
    const T t706 = T(-0.42499999999999999) * t705;
    const T t709 = T(-0.84999999999999998) * t705;
    const T t714 = (s4 * t674) + t692;
    const T t717 = t689 + (c4 * t696);
    const T t725 = pi[17] + (((t714 * c4) - (t717 * s4)) - (T(-0.42499999999999999) * ((s4 * t701) + (c4 * t703))));
    const T t727 = (s2 * (t537 + (((((((c4 * t674) - t689) * c4) - ((t692 - (s4 * t696)) * s4)) - t706) - t706) + t709))) + (c2 * t725);
    const T t740 = ((pi[6] + t536) + ((t727 * s2) + (((s2 * t725) + (c2 * (((t714 * s4) + (t717 * c4)) + t709))) * c2))) + rotor[0];
    const T t743 = (s8 * t595) + t609;
    const T t745 = c8 * pi[56];
    const T t746 = t606 + t745;
    const T t749 = pi[38] + ((t743 * c8) - (t746 * s8));
    const T t753 = (s8 * t633) + (c8 * t626);
    const T t756 = pi[39] - (t753 + (T(-0.099699999999999997) * t669));
    const T t759 = T(0.1333) * t663;
    const T t763 = t478 + ((((t749 * c6) - (t756 * s6)) - t759) - (T(-0.39219999999999999) * t669));
    const T t770 = pi[29] + (((t749 * s6) + (t756 * c6)) - (T(0.1333) * t685));
    const T t782 = (s2 * (t552 + (((t763 * c4) - (t770 * s4)) - (T(-0.42499999999999999) * t669)))) + (c2 * (pi[19] + ((t763 * s4) + (t770 * c4))));
    const T t783 = t782 / t740;
    const T t800 = (((s8 * t267) + (c8 * t313)) - (T(-0.099699999999999997) * t422)) + (((pi[39] * (t363 - t68)) - ((t356 * t169) + (pi[38] * (t129 - t48)))) + (pi[37] * (t261 - t371)));
    const T t804 = t800 + ((pi[31] * t260) - (t378 * t168));
    const T t815 = (t804 + (T(-0.39219999999999999) * t438)) + (((pi[29] * t149) - ((t460 * t160) + (t478 * t163))) + (pi[27] * (t122 - t123)));
    const T t819 = t815 + ((t517 * t159) - (pi[22] * t148));
    const T t831 = (s4 * (t495 + ((t160 * pi[22]) - (t152 * t517)))) + (c4 * (t438 + ((t160 * t517) - ((t122 + t151) * pi[22]))));
    const T t845 = ((t819 + (T(-0.42499999999999999) * t831)) + ((pi[17] * (t578 - t137)) - (t537 * t144))) + (((pi[11] + t525) * t143) - (pi[12] * t135));
    const T t848 = (tau[1] - t845) - (t783 * t585);
    const T t853 = t359 + (((t743 * s8) + (t746 * c8)) + t617);
    const T t857 = t468 + (((t853 - t670) - t670) + t672);
    const T t863 = ((t540 + (t857 + t709)) + rotor[1]) - (t783 * t782);
    const T t874 = (s2 * ((c4 * t763) - (s4 * t770))) + (c2 * ((s4 * t763) + (c4 * t770)));
    const T t875 = t874 / t740;
    const T t877 = (t857 + t706) - (t875 * t782);
    const T t878 = t877 / t863;
    const T t884 = (tau[2] - t819) - ((t875 * t585) + (t878 * t848));
    const T t890 = (t857 + rotor[2]) - ((t875 * t874) + (t878 * t877));
    const T t892 = t853 + t664;
    const T t896 = ((c6 * t749) - (s6 * t756)) - t759;
    const T t901 = t684 + t683;
    const T t903 = ((s6 * t749) + (c6 * t756)) - (T(0.1333) * t901);
    const T t911 = (s2 * ((c4 * t896) - (s4 * t903))) + (c2 * ((s4 * t896) + (c4 * t903)));
    const T t912 = t911 / t740;
    const T t920 = (t892 + (T(-0.42499999999999999) * ((c4 * t663) - (s4 * t901)))) - (t912 * t782);
    const T t921 = t920 / t863;
    const T t924 = t892 - ((t912 * t874) + (t921 * t877));
    const T t925 = t924 / t890;
    const T t933 = (tau[3] - t804) - (((t912 * t585) + (t921 * t848)) + (t925 * t884));
    const T t941 = (t853 + rotor[3]) - (((t912 * t911) + (t921 * t920)) + (t925 * t924));
    const T t943 = t668 + t667;
    const T t945 = t753 + (T(-0.099699999999999997) * t943);
    const T t949 = ((c8 * t633) - (s8 * t626)) + t640;
    const T t953 = s6 * t943;
    const T t955 = ((c6 * t949) + (s6 * t650)) + (T(0.1333) * t953);
    const T t960 = c6 * t943;
    const T t964 = ((s6 * t949) - (c6 * t650)) - ((T(0.1333) * t960) + (T(-0.39219999999999999) * t639));
    const T t974 = (s2 * ((c4 * t955) - (s4 * t964))) + (c2 * (((s4 * t955) + (c4 * t964)) - (T(-0.42499999999999999) * t639)));
    const T t975 = t974 / t740;
    const T t978 = t945 - (T(-0.39219999999999999) * t953);
    const T t985 = (t978 - (T(-0.42499999999999999) * ((s4 * t960) + (c4 * t953)))) - (t975 * t782);
    const T t986 = t985 / t863;
    const T t992 = t978 - ((t975 * t874) + (t986 * t877));
    const T t993 = t992 / t890;
    const T t996 = t945 - (((t975 * t911) + (t986 * t920)) + (t993 * t924));
    const T t997 = t996 / t941;
    const T t1007 = (tau[4] - t413) - ((((t975 * t585) + (t986 * t848)) + (t993 * t884)) + (t997 * t933));
    const T t1017 = (t650 + rotor[4]) - ((((t975 * t974) + (t986 * t985)) + (t993 * t992)) + (t997 * t996));
    const T t1019 = t615 + t614;
    const T t1021 = (T(0.099599999999999994) * t1019) - t624;
    const T t1025 = t601 - t600;
    const T t1027 = ((c10 * pi[58]) - (s10 * pi[59])) + (T(0.099599999999999994) * t1025);
    const T t1030 = s8 * t1019;
    const T t1032 = ((c8 * t1027) - t610) - (T(-0.099699999999999997) * t1030);
    const T t1036 = c8 * t1019;
    const T t1039 = (s6 * t1036) + (c6 * t1025);
    const T t1041 = ((c6 * t1032) + (s6 * t1021)) + (T(0.1333) * t1039);
    const T t1048 = (s6 * t1025) - (c6 * t1036);
    const T t1052 = ((s6 * t1032) - (c6 * t1021)) + ((T(0.1333) * t1048) + (T(-0.39219999999999999) * t1030));
    const T t1062 = (s2 * ((c4 * t1041) - (s4 * t1052))) + (c2 * (((s4 * t1041) + (c4 * t1052)) + (T(-0.42499999999999999) * t1030)));
    const T t1063 = t1062 / t740;
    const T t1068 = ((s8 * t1027) + t745) + (T(-0.099699999999999997) * t1036);
    const T t1070 = t1068 - (T(-0.39219999999999999) * t1039);
    const T t1077 = (t1070 + (T(-0.42499999999999999) * ((s4 * t1048) - (c4 * t1039)))) - (t1063 * t782);
    const T t1078 = t1077 / t863;
    const T t1084 = t1070 - ((t1063 * t874) + (t1078 * t877));
    const T t1085 = t1084 / t890;
    const T t1093 = t1068 - (((t1063 * t911) + (t1078 * t920)) + (t1085 * t924));
    const T t1094 = t1093 / t941;
    const T t1097 = t1021 - ((((t1063 * t974) + (t1078 * t985)) + (t1085 * t992)) + (t1094 * t996));
    const T t1098 = t1097 / t1017;
    const T t1110 = (tau[5] - t299) - (((((t1063 * t585) + (t1078 * t848)) + (t1085 * t884)) + (t1094 * t933)) + (t1098 * t1007));
    const T t1122 = (pi[56] + rotor[5]) - (((((t1063 * t1062) + (t1078 * t1077)) + (t1085 * t1084)) + (t1094 * t1093)) + (t1098 * t1097));
    const T t1123 = t1110 / t1122;
    const T t1125 = (t1007 / t1017) - (t1098 * t1123);
    const T t1129 = (t933 / t941) - ((t997 * t1125) + (t1094 * t1123));
    const T t1135 = (t884 / t890) - (((t925 * t1129) + (t993 * t1125)) + (t1085 * t1123));
    const T t1143 = (t848 / t863) - ((((t878 * t1135) + (t921 * t1129)) + (t986 * t1125)) + (t1078 * t1123));
    const T t1153 = (t585 / t740) - (((((t783 * t1143) + (t875 * t1135)) + (t912 * t1129)) + (t975 * t1125)) + (t1063 * t1123));
    ddq[0] = t1153;
    ddq[1] = t1143;
    ddq[2] = t1135;
    ddq[3] = t1129;
    ddq[4] = t1125;
    ddq[5] = t1123;
}

template <typename T>
SYMGEN_BOTH void forward_dynamics_at(long long i, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> tau_, symgen_array<const T> pi_, symgen_array<const T> rotor_, symgen_array<T> ddq_)
{
    T q[6];
    symgen_load<6>(q, q_, i);
    T dq[6];
    symgen_load<6>(dq, dq_, i);
    T tau[6];
    symgen_load<6>(tau, tau_, i);
    const symgen_sample<T> pi = {pi_.data + i * pi_.sample, pi_.entry};
    const symgen_sample<T> rotor = {rotor_.data + i * rotor_.sample, rotor_.entry};
    T ddq_of[6];
    forward_dynamics(q, dq, tau, pi, rotor, ddq_of);
    symgen_store<6>(ddq_, i, ddq_of);
}

/* pose of the tip in the base frame, Eq. 2.15. 115 operations. */
template <typename Of_q, typename T>
SYMGEN_BOTH void end_effector(const Of_q &q, T *H)
{
    T s1, c1;
    symgen_turn(q[0], s1, c1);
    T s3, c3;
    symgen_turn(q[1], s3, c3);
    T s5, c5;
    symgen_turn(q[2], s5, c5);
    T s7, c7;
    symgen_turn(q[3], s7, c7);
    T s9, c9;
    symgen_turn(q[4], s9, c9);
    T s11, c11;
    symgen_turn(q[5], s11, c11);
    const T t12 = c9 * c11;
    const T t17 = (c7 * t12) - (s7 * s11);
    const T t22 = (s7 * t12) + (c7 * s11);
    const T t24 = (c5 * t17) - (s5 * t22);
    const T t29 = (s5 * t17) + (c5 * t22);
    const T t31 = (c3 * t24) - (s3 * t29);
    const T t35 = s9 * c11;
    H[0] = (c1 * t31) + (s1 * t35);
    const T t39 = c9 * s11;
    const T t42 = (c7 * t39) + (s7 * c11);
    const T t46 = (c7 * c11) - (s7 * t39);
    const T t48 = (c5 * t42) + (s5 * t46);
    const T t52 = (c5 * t46) - (s5 * t42);
    const T t54 = (c3 * t48) + (s3 * t52);
    const T t56 = s9 * s11;
    H[1] = -((c1 * t54) + (s1 * t56));
    const T t61 = s7 * s9;
    const T t63 = c7 * s9;
    const T t65 = (s5 * t61) - (c5 * t63);
    const T t69 = (s5 * t63) + (c5 * t61);
    const T t71 = (c3 * t65) + (s3 * t69);
    H[2] = (c1 * t71) + (s1 * c9);
    const T t79 = T(0.099599999999999994) * s9;
    const T t84 = T(-0.39219999999999999) - ((c7 * t79) + (T(-0.099699999999999997) * s7));
    const T t88 = (T(-0.099699999999999997) * c7) - (s7 * t79);
    const T t91 = T(-0.42499999999999999) + ((c5 * t84) - (s5 * t88));
    const T t95 = (s5 * t84) + (c5 * t88);
    const T t97 = (c3 * t91) - (s3 * t95);
    const T t101 = T(0.1333) + (T(0.099599999999999994) * c9);
    H[3] = (c1 * t97) + (s1 * t101);
    H[4] = (s1 * t31) - (c1 * t35);
    H[5] = (c1 * t56) - (s1 * t54);
    H[6] = (s1 * t71) - (c1 * c9);
    H[7] = (s1 * t97) - (c1 * t101);
    H[8] = (s3 * t24) + (c3 * t29);
    H[9] = (c3 * t52) - (s3 * t48);
    H[10] = (s3 * t65) - (c3 * t69);
    H[11] = T(0.16250000000000001) + ((s3 * t91) + (c3 * t95));
    H[12] = T(0.0);
    H[13] = T(0.0);
    H[14] = T(0.0);
    H[15] = T(1.0);
}

template <typename T>
SYMGEN_BOTH void end_effector_at(long long i, symgen_array<const T> q_, symgen_array<T> H_)
{
    T q[6];
    symgen_load<6>(q, q_, i);
    T H_of[16];
    end_effector(q, H_of);
    symgen_store<16>(H_, i, H_of);
}

/* Y_b with tau = Y_b beta, Eq. 3.11. 656 operations. */
template <typename Of_q, typename Of_dq, typename Of_ddq, typename T>
SYMGEN_BOTH void base_regressor(const Of_q &q, const Of_dq &dq, const Of_ddq &ddq, T *Y_b)
{
    Y_b[0] = ddq[0];
    Y_b[1] = T(0.0);
    Y_b[2] = T(0.0);
    T s7, c7;
    symgen_turn(q[1], s7, c7);
    const T t9 = s7 * dq[0];
    const T t12 = (dq[1] * t9) * c7;
    const T t13 = s7 * ddq[0];
    const T t14 = c7 * dq[0];
    const T t15 = t14 * dq[1];
    const T t16 = t13 + t15;
    Y_b[3] = t12 + (t16 * s7);
    Y_b[4] = (t15 * s7) - t12;
    const T t25 = t9 * dq[1];
    const T t26 = c7 * ddq[0];
    const T t27 = t26 - t25;
    const T t28 = t25 - t27;
    Y_b[5] = ((t15 + t16) * c7) - (t28 * s7);
    const T t32 = dq[1] * dq[1];
    const T t33 = t9 * t9;
    const T t36 = t9 * t14;
    const T t38 = t36 + ddq[1];
    Y_b[6] = ((t32 - t33) * c7) + (t38 * s7);
    const T t42 = t14 * t14;
    Y_b[7] = ((t42 - t32) * s7) - ((t36 - ddq[1]) * c7);
    T s50, c50;
    symgen_turn(q[2], s50, c50);
    const T t54 = (c50 * t9) + (s50 * t14);
    const T t56 = dq[1] + dq[2];
    const T t57 = t54 * t56;
    const T t62 = ((c50 * t27) - (s50 * t16)) - (t54 * dq[2]);
    const T t63 = t57 - t62;
    const T t65 = T(-0.42499999999999999) * c7;
    const T t67 = T(-0.42499999999999999) * t28;
    const T t70 = (c50 * c7) - (s50 * s7);
    Y_b[8] = -((t63 * t65) + (t67 * t70));
    const T t77 = (s50 * c7) + (c50 * s7);
    const T t81 = (c50 * t14) - (s50 * t9);
    const T t82 = t81 * t56;
    const T t87 = ((c50 * t16) + (s50 * t27)) + (t81 * dq[2]);
    const T t88 = t82 + t87;
    Y_b[9] = (t67 * t77) - (t88 * t65);
    const T t93 = (t56 * t54) * t70;
    Y_b[10] = t93 + (t87 * t77);
    Y_b[11] = (t82 * t77) - t93;
    Y_b[12] = (t88 * t70) - (t63 * t77);
    const T t104 = t56 * t56;
    const T t105 = t54 * t54;
    const T t108 = t54 * t81;
    const T t110 = ddq[1] + ddq[2];
    const T t111 = t108 + t110;
    Y_b[13] = ((t104 - t105) * t70) + (t111 * t77);
    const T t115 = t81 * t81;
    const T t118 = t108 - t110;
    Y_b[14] = ((t115 - t104) * t77) - (t118 * t70);
    T s123, c123;
    symgen_turn(q[3], s123, c123);
    const T t127 = (c123 * t54) + (s123 * t81);
    const T t129 = t56 + dq[3];
    const T t130 = t127 * t129;
    const T t135 = ((c123 * t62) - (s123 * t87)) - (t127 * dq[3]);
    const T t136 = t130 - t135;
    const T t139 = t65 + (T(-0.39219999999999999) * t70);
    const T t143 = (c123 * t81) - (s123 * t54);
    const T t144 = t127 * t143;
    const T t146 = t110 + ddq[3];
    const T t147 = t144 + t146;
    const T t149 = T(0.1333) * t70;
    const T t151 = T(0.1333) * t77;
    const T t153 = (s123 * t149) + (c123 * t151);
    const T t156 = t143 * t143;
    const T t157 = t129 * t129;
    const T t158 = t156 + t157;
    const T t161 = (c123 * t149) - (s123 * t151);
    const T t168 = t67 + ((T(-0.39219999999999999) * t63) - (T(0.1333) * (t105 + t115)));
    const T t171 = (c123 * t70) - (s123 * t77);
    Y_b[15] = -((((t136 * t139) + (t147 * t153)) + (t158 * t161)) + (t168 * t171));
    const T t176 = t127 * t127;
    const T t177 = t176 + t157;
    const T t179 = t143 * t129;
    const T t184 = ((c123 * t87) + (s123 * t62)) + (t143 * dq[3]);
    const T t185 = t179 + t184;
    const T t188 = t144 - t146;
    const T t193 = (s123 * t70) + (c123 * t77);
    Y_b[16] = (((t177 * t153) - (t185 * t139)) + (t188 * t161)) + (t168 * t193);
    const T t198 = (t129 * t127) * t171;
    Y_b[17] = t198 + (t184 * t193);
    Y_b[18] = (t179 * t193) - t198;
    Y_b[19] = (t185 * t171) - (t136 * t193);
    Y_b[20] = ((t157 - t176) * t171) + (t147 * t193);
    Y_b[21] = ((t156 - t157) * t193) - (t188 * t171);
    T s220, c220;
    symgen_turn(q[4], s220, c220);
    const T t224 = (c220 * t127) + (s220 * t129);
    const T t226 = dq[4] - t143;
    const T t227 = t224 * t226;
    const T t232 = ((c220 * t146) - (s220 * t184)) - (t224 * dq[4]);
    const T t233 = t227 - t232;
    const T t237 = t168 + (T(-0.099699999999999997) * t185);
    const T t240 = T(9.8100000000000005) * s7;
    const T t243 = t240 - (T(-0.42499999999999999) * (t42 + t32));
    const T t245 = T(9.8100000000000005) * c7;
    const T t247 = t245 + (T(-0.42499999999999999) * t38);
    const T t249 = (c50 * t243) + (s50 * t247);
    const T t250 = t57 + t62;
    const T t252 = t115 + t104;
    const T t255 = t249 + ((T(0.1333) * t250) - (T(-0.39219999999999999) * t252));
    const T t259 = (c50 * t247) - (s50 * t243);
    const T t261 = t82 - t87;
    const T t264 = t259 + ((T(-0.39219999999999999) * t111) + (T(0.1333) * t261));
    const T t266 = (c123 * t255) + (s123 * t264);
    const T t268 = t266 + (T(-0.099699999999999997) * t188);
    const T t270 = (c220 * t237) - (s220 * t268);
    const T t275 = (c220 * t129) - (s220 * t127);
    const T t276 = t224 * t275;
    const T t278 = ddq[4] - t135;
    const T t279 = t276 + t278;
    const T t281 = (T(-0.099699999999999997) * t193) - t139;
    const T t284 = (c220 * t281) - (s220 * t161);
    const T t287 = t275 * t275;
    const T t288 = t226 * t226;
    const T t289 = t287 + t288;
    const T t292 = (c220 * t161) + (s220 * t281);
    const T t297 = (c123 * t264) - (s123 * t255);
    const T t299 = t297 - (T(-0.099699999999999997) * t177);
    const T t300 = s220 * t193;
    Y_b[22] = ((((t233 * t153) - (t270 * t171)) + (t279 * t284)) - (t289 * t292)) - (t299 * t300);
    const T t304 = t275 * t226;
    const T t309 = ((c220 * t184) + (s220 * t146)) + (t275 * dq[4]);
    const T t310 = t304 + t309;
    const T t314 = (c220 * t268) + (s220 * t237);
    const T t317 = t224 * t224;
    const T t318 = t317 + t288;
    const T t321 = t276 - t278;
    const T t324 = c220 * t193;
    Y_b[23] = ((((t310 * t153) + (t314 * t171)) - (t318 * t284)) + (t321 * t292)) - (t299 * t324);
    const T t329 = t226 * t224;
    const T t330 = t329 * t300;
    Y_b[24] = ((t276 * t171) - t330) + (t309 * t324);
    Y_b[25] = (t330 - (t278 * t171)) + (t304 * t324);
    const T t340 = t317 - t287;
    Y_b[26] = -(((t340 * t171) + (t310 * t300)) + (t233 * t324));
    const T t348 = t304 - t309;
    const T t350 = t288 - t317;
    Y_b[27] = ((t348 * t171) - (t350 * t300)) + (t279 * t324);
    const T t357 = t227 + t232;
    const T t360 = t287 - t288;
    Y_b[28] = ((t321 * t300) - (t357 * t171)) + (t360 * t324);
    T s365, c365;
    symgen_turn(q[5], s365, c365);
    const T t369 = (c365 * t224) - (s365 * t226);
    const T t371 = t275 + dq[5];
    const T t372 = t369 * t371;
    const T t377 = ((s365 * t309) + (c365 * t278)) + (t369 * dq[5]);
    const T t378 = t372 + t377;
    const T t382 = t314 + (T(0.099599999999999994) * t321);
    const T t385 = (T(0.099599999999999994) * t310) - t299;
    const T t387 = (s365 * t382) + (c365 * t385);
    const T t391 = t232 + ddq[5];
    const T t394 = (s365 * t224) + (c365 * t226);
    const T t395 = t369 * t394;
    const T t396 = t391 - t395;
    const T t398 = (T(0.099599999999999994) * t171) + t292;
    const T t401 = t153 + (T(0.099599999999999994) * t324);
    const T t403 = (s365 * t398) + (c365 * t401);
    const T t406 = t394 * t394;
    const T t407 = t371 * t371;
    const T t408 = t406 + t407;
    const T t411 = (s365 * t401) - (c365 * t398);
    const T t415 = t270 - (T(0.099599999999999994) * t318);
    const T t418 = (c365 * t171) - (s365 * t324);
    Y_b[29] = ((((t378 * t284) + (t387 * t300)) - (t396 * t403)) + (t408 * t411)) - (t415 * t418);
    const T t426 = ((c365 * t309) - (s365 * t278)) - (t394 * dq[5]);
    const T t427 = t394 * t371;
    const T t428 = t426 - t427;
    const T t432 = (c365 * t382) - (s365 * t385);
    const T t435 = t369 * t369;
    const T t436 = t435 + t407;
    const T t439 = t395 + t391;
    const T t444 = (s365 * t171) + (c365 * t324);
    Y_b[30] = ((((t428 * t284) + (t432 * t300)) + (t436 * t403)) + (t439 * t411)) + (t415 * t444);
    const T t448 = t371 * t369;
    const T t449 = t448 * t418;
    Y_b[31] = (t449 - (t395 * t300)) + (t426 * t444);
    Y_b[32] = -(((t391 * t300) + t449) + (t427 * t444));
    const T t462 = t435 - t406;
    Y_b[33] = ((t428 * t418) - (t462 * t300)) - (t378 * t444);
    const T t468 = t407 - t435;
    const T t470 = t427 + t426;
    Y_b[34] = ((t468 * t418) - (t470 * t300)) + (t396 * t444);
    const T t477 = t372 - t377;
    const T t480 = t406 - t407;
    Y_b[35] = ((t439 * t418) - (t477 * t300)) + (t480 * t444);
    Y_b[36] = T(0.0);
    Y_b[37] = t245;
    Y_b[38] = -t240;
    Y_b[39] = -t36;
    Y_b[40] = ddq[1];
    Y_b[41] = t33 - t42;
    Y_b[42] = t13;
    Y_b[43] = t26;
    const T t495 = T(-0.42499999999999999) * c50;
    const T t497 = T(-0.42499999999999999) * s50;
    Y_b[44] = ((t111 * t495) - (t252 * t497)) + t259;
    Y_b[45] = ((t118 * t497) - ((t105 + t104) * t495)) - t249;
    const T t508 = -t108;
    Y_b[46] = t508;
    Y_b[47] = t110;
    const T t511 = t105 - t115;
    Y_b[48] = t511;
    const T t513 = -t261;
    Y_b[49] = t513;
    Y_b[50] = t250;
    const T t516 = t495 + T(-0.39219999999999999);
    const T t519 = (c123 * t516) - (s123 * t497);
    const T t524 = (c123 * t497) + (s123 * t516);
    Y_b[51] = (t297 + (t147 * t519)) - (t158 * t524);
    Y_b[52] = (t188 * t524) - (t266 + (t177 * t519));
    const T t533 = -t144;
    Y_b[53] = t533;
    Y_b[54] = t146;
    const T t536 = t176 - t156;
    Y_b[55] = t536;
    const T t539 = -(t179 - t184);
    Y_b[56] = t539;
    const T t541 = t130 + t135;
    Y_b[57] = t541;
    const T t543 = t299 * c220;
    const T t546 = T(0.099699999999999997) + t524;
    const T t547 = s220 * t546;
    const T t550 = c220 * t546;
    Y_b[58] = t543 - (((t233 * t519) + (t279 * t547)) + (t289 * t550));
    const T t560 = t299 * s220;
    Y_b[59] = (((t318 * t547) - (t310 * t519)) + (t321 * t550)) - t560;
    const T t563 = t329 * c220;
    const T t565 = t563 + (t309 * s220);
    Y_b[60] = t565;
    const T t568 = (t304 * s220) - t563;
    Y_b[61] = t568;
    const T t572 = (t310 * c220) - (t233 * s220);
    Y_b[62] = t572;
    const T t576 = (t350 * c220) + (t279 * s220);
    Y_b[63] = t576;
    const T t580 = (t360 * s220) - (t321 * c220);
    Y_b[64] = t580;
    const T t582 = T(0.099599999999999994) * s220;
    const T t583 = t582 - t519;
    const T t586 = (s365 * t583) - (c365 * t550);
    const T t589 = t387 * c220;
    const T t593 = (s365 * t550) + (c365 * t583);
    const T t597 = s365 * s220;
    const T t598 = t415 * t597;
    Y_b[65] = ((t408 * t586) - (((t378 * t547) + t589) + (t396 * t593))) + t598;
    const T t603 = t432 * c220;
    const T t608 = c365 * s220;
    const T t609 = t415 * t608;
    Y_b[66] = (((t436 * t593) - ((t428 * t547) + t603)) + (t439 * t586)) + t609;
    const T t613 = t448 * t597;
    const T t616 = ((t395 * c220) - t613) + (t426 * t608);
    Y_b[67] = t616;
    const T t621 = ((t391 * c220) + t613) - (t427 * t608);
    Y_b[68] = t621;
    const T t627 = ((t462 * c220) - (t428 * t597)) - (t378 * t608);
    Y_b[69] = t627;
    const T t633 = ((t470 * c220) - (t468 * t597)) + (t396 * t608);
    Y_b[70] = t633;
    const T t639 = ((t477 * c220) - (t439 * t597)) + (t480 * t608);
    Y_b[71] = t639;
    Y_b[72] = T(0.0);
    Y_b[73] = T(0.0);
    Y_b[74] = T(0.0);
    Y_b[75] = T(0.0);
    Y_b[76] = T(0.0);
    Y_b[77] = T(0.0);
    Y_b[78] = T(0.0);
    Y_b[79] = T(0.0);
    Y_b[80] = t259;
    Y_b[81] = -t249;
    Y_b[82] = t508;
    Y_b[83] = t110;
    Y_b[84] = t511;
    Y_b[85] = t513;
    Y_b[86] = t250;
    const T t657 = T(-0.39219999999999999) * c123;
    const T t660 = T(-0.39219999999999999) * s123;
    Y_b[87] = (t297 + (t147 * t657)) - (t158 * t660);
    Y_b[88] = (t188 * t660) - (t266 + (t177 * t657));
    Y_b[89] = t533;
    Y_b[90] = t146;
    Y_b[91] = t536;
    Y_b[92] = t539;
    Y_b[93] = t541;
    const T t675 = T(0.099699999999999997) + t660;
    const T t676 = s220 * t675;
    const T t679 = c220 * t675;
    Y_b[94] = t543 - (((t233 * t657) + (t279 * t676)) + (t289 * t679));
    Y_b[95] = (((t318 * t676) - (t310 * t657)) + (t321 * t679)) - t560;
    Y_b[96] = t565;
    Y_b[97] = t568;
    Y_b[98] = t572;
    Y_b[99] = t576;
    Y_b[100] = t580;
    const T t696 = t582 - t657;
    const T t699 = (s365 * t696) - (c365 * t679);
    const T t705 = (s365 * t679) + (c365 * t696);
    Y_b[101] = ((t408 * t699) - (((t378 * t676) + t589) + (t396 * t705))) + t598;
    Y_b[102] = (((t436 * t705) - ((t428 * t676) + t603)) + (t439 * t699)) + t609;
    Y_b[103] = t616;
    Y_b[104] = t621;
    Y_b[105] = t627;
    Y_b[106] = t633;
    Y_b[107] = t639;
    Y_b[108] = T(0.0);
    Y_b[109] = T(0.0);
    Y_b[110] = T(0.0);
    Y_b[111] = T(0.0);
    Y_b[112] = T(0.0);
    Y_b[113] = T(0.0);
    Y_b[114] = T(0.0);
    Y_b[115] = T(0.0);
    Y_b[116] = T(0.0);
    Y_b[117] = T(0.0);
    Y_b[118] = T(0.0);
    Y_b[119] = T(0.0);
    Y_b[120] = T(0.0);
    Y_b[121] = T(0.0);
    Y_b[122] = T(0.0);
    Y_b[123] = t297;
    Y_b[124] = -t266;
    Y_b[125] = t533;
    Y_b[126] = t146;
    Y_b[127] = t536;
    Y_b[128] = t539;
    Y_b[129] = t541;
    const T t747 = T(-0.099699999999999997) * s220;
    const T t749 = T(0.099699999999999997) * c220;
    Y_b[130] = ((t279 * t747) - (t289 * t749)) + t543;
    Y_b[131] = ((t321 * t749) - (t318 * t747)) - t560;
    Y_b[132] = t565;
    Y_b[133] = t568;
    Y_b[134] = t572;
    Y_b[135] = t576;
    Y_b[136] = t580;
    const T t768 = (s365 * t749) + (c365 * t582);
    const T t773 = (s365 * t582) - (c365 * t749);
    Y_b[137] = ((((t378 * t747) - t589) - (t396 * t768)) + (t408 * t773)) + t598;
    Y_b[138] = ((((t428 * t747) - t603) + (t436 * t768)) + (t439 * t773)) + t609;
    Y_b[139] = t616;
    Y_b[140] = t621;
    Y_b[141] = t627;
    Y_b[142] = t633;
    Y_b[143] = t639;
    Y_b[144] = T(0.0);
    Y_b[145] = T(0.0);
    Y_b[146] = T(0.0);
    Y_b[147] = T(0.0);
    Y_b[148] = T(0.0);
    Y_b[149] = T(0.0);
    Y_b[150] = T(0.0);
    Y_b[151] = T(0.0);
    Y_b[152] = T(0.0);
    Y_b[153] = T(0.0);
    Y_b[154] = T(0.0);
    Y_b[155] = T(0.0);
    Y_b[156] = T(0.0);
    Y_b[157] = T(0.0);
    Y_b[158] = T(0.0);
    Y_b[159] = T(0.0);
    Y_b[160] = T(0.0);
    Y_b[161] = T(0.0);
    Y_b[162] = T(0.0);
    Y_b[163] = T(0.0);
    Y_b[164] = T(0.0);
    Y_b[165] = T(0.0);
    Y_b[166] = t270;
    Y_b[167] = -t314;
    Y_b[168] = -t276;
    Y_b[169] = t278;
    Y_b[170] = t340;
    Y_b[171] = -t348;
    Y_b[172] = t357;
    const T t823 = T(0.099599999999999994) * s365;
    const T t825 = T(0.099599999999999994) * c365;
    Y_b[173] = ((t396 * t823) + (t408 * t825)) + (t415 * c365);
    Y_b[174] = ((t439 * t825) - (t436 * t823)) - (t415 * s365);
    const T t837 = t448 * c365;
    Y_b[175] = -(t837 + (t426 * s365));
    Y_b[176] = t837 + (t427 * s365);
    Y_b[177] = (t378 * s365) - (t428 * c365);
    Y_b[178] = -((t468 * c365) + (t396 * s365));
    Y_b[179] = -((t439 * c365) + (t480 * s365));
    Y_b[180] = T(0.0);
    Y_b[181] = T(0.0);
    Y_b[182] = T(0.0);
    Y_b[183] = T(0.0);
    Y_b[184] = T(0.0);
    Y_b[185] = T(0.0);
    Y_b[186] = T(0.0);
    Y_b[187] = T(0.0);
    Y_b[188] = T(0.0);
    Y_b[189] = T(0.0);
    Y_b[190] = T(0.0);
    Y_b[191] = T(0.0);
    Y_b[192] = T(0.0);
    Y_b[193] = T(0.0);
    Y_b[194] = T(0.0);
    Y_b[195] = T(0.0);
    Y_b[196] = T(0.0);
    Y_b[197] = T(0.0);
    Y_b[198] = T(0.0);
    Y_b[199] = T(0.0);
    Y_b[200] = T(0.0);
    Y_b[201] = T(0.0);
    Y_b[202] = T(0.0);
    Y_b[203] = T(0.0);
    Y_b[204] = T(0.0);
    Y_b[205] = T(0.0);
    Y_b[206] = T(0.0);
    Y_b[207] = T(0.0);
    Y_b[208] = T(0.0);
    Y_b[209] = -t387;
    Y_b[210] = -t432;
    Y_b[211] = t395;
    Y_b[212] = t391;
    Y_b[213] = t462;
    Y_b[214] = t470;
    Y_b[215] = t477;
}

template <typename T>
SYMGEN_BOTH void base_regressor_at(long long i, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<T> Y_b_)
{
    T q[6];
    symgen_load<6>(q, q_, i);
    T dq[6];
    symgen_load<6>(dq, dq_, i);
    T ddq[6];
    symgen_load<6>(ddq, ddq_, i);
    T Y_b_of[216];
    base_regressor(q, dq, ddq, Y_b_of);
    symgen_store<216>(Y_b_, i, Y_b_of);
}

/* sum of r'Wr/2 and of Y_b'Wr, r = Y_b beta - tau, Eqs. 4.6, 4.32. 812 operations. */
template <typename Of_q, typename Of_dq, typename Of_ddq, typename Of_tau, typename Of_weight, typename Of_beta, typename T>
SYMGEN_BOTH void loss_gradient(const Of_q &q, const Of_dq &dq, const Of_ddq &ddq, const Of_tau &tau, const Of_weight &weight, const Of_beta &beta, T *loss, T *gradient, T *residual)
{
    T s1, c1;
    symgen_turn(q[1], s1, c1);
    T s3, c3;
    symgen_turn(q[2], s3, c3);
    T s5, c5;
    symgen_turn(q[3], s5, c5);
    T s7, c7;
    symgen_turn(q[4], s7, c7);
    T s9, c9;
    symgen_turn(q[5], s9, c9);
    const T t12 = s1 * ddq[0];
    const T t15 = c1 * dq[0];
    const T t17 = t15 * dq[1];
    const T t18 = t12 + t17;
    const T t21 = c1 * ddq[0];
    const T t22 = s1 * dq[0];
    const T t23 = t22 * dq[1];
    const T t24 = t21 - t23;
    const T t29 = (c3 * t15) - (s3 * t22);
    const T t32 = ((c3 * t18) + (s3 * t24)) + (t29 * dq[2]);
    const T t40 = (c3 * t22) + (s3 * t15);
    const T t42 = ((c3 * t24) - (s3 * t18)) - (t40 * dq[2]);
    const T t47 = (c5 * t29) - (s5 * t40);
    const T t50 = ((c5 * t32) + (s5 * t42)) + (t47 * dq[3]);
    const T t55 = ddq[1] + ddq[2];
    const T t57 = t55 + ddq[3];
    const T t60 = dq[1] + dq[2];
    const T t61 = t60 + dq[3];
    const T t65 = (c5 * t40) + (s5 * t29);
    const T t67 = (c7 * t61) - (s7 * t65);
    const T t70 = ((c7 * t50) + (s7 * t57)) + (t67 * dq[4]);
    const T t78 = ((c5 * t42) - (s5 * t32)) - (t65 * dq[3]);
    const T t79 = ddq[4] - t78;
    const T t84 = (c7 * t65) + (s7 * t61);
    const T t86 = dq[4] - t47;
    const T t88 = (s9 * t84) + (c9 * t86);
    const T t91 = ((c9 * t70) - (s9 * t79)) - (t88 * dq[5]);
    const T t94 = t67 + dq[5];
    const T t95 = t88 * t94;
    const T t101 = (c9 * t84) - (s9 * t86);
    const T t102 = t101 * t94;
    const T t107 = ((s9 * t70) + (c9 * t79)) + (t101 * dq[5]);
    const T t108 = t102 + t107;
    const T t116 = ((c7 * t57) - (s7 * t50)) - (t84 * dq[4]);
    const T t118 = t116 + ddq[5];
    const T t119 = t101 * t88;
    const T t120 = t118 - t119;
    const T t124 = t88 * t88;
    const T t125 = t94 * t94;
    const T t126 = t124 - t125;
    const T t128 = ((((beta[31] * t91) - (beta[32] * t95)) - (beta[33] * t108)) + (beta[34] * t120)) + (beta[35] * t126);
    const T t131 = t23 - t24;
    const T t132 = T(-0.42499999999999999) * t131;
    const T t134 = t40 * t60;
    const T t135 = t134 - t42;
    const T t138 = t40 * t40;
    const T t139 = t29 * t29;
    const T t143 = t132 + ((T(-0.39219999999999999) * t135) - (T(0.1333) * (t138 + t139)));
    const T t145 = t47 * t61;
    const T t146 = t145 + t50;
    const T t148 = t143 + (T(-0.099699999999999997) * t146);
    const T t151 = T(9.8100000000000005) * s1;
    const T t152 = t15 * t15;
    const T t153 = dq[1] * dq[1];
    const T t156 = t151 - (T(-0.42499999999999999) * (t152 + t153));
    const T t158 = T(9.8100000000000005) * c1;
    const T t159 = t22 * t15;
    const T t160 = t159 + ddq[1];
    const T t162 = t158 + (T(-0.42499999999999999) * t160);
    const T t164 = (c3 * t156) + (s3 * t162);
    const T t165 = t134 + t42;
    const T t167 = t60 * t60;
    const T t168 = t139 + t167;
    const T t171 = t164 + ((T(0.1333) * t165) - (T(-0.39219999999999999) * t168));
    const T t175 = (c3 * t162) - (s3 * t156);
    const T t176 = t40 * t29;
    const T t177 = t176 + t55;
    const T t179 = t29 * t60;
    const T t180 = t179 - t32;
    const T t183 = t175 + ((T(-0.39219999999999999) * t177) + (T(0.1333) * t180));
    const T t185 = (c5 * t171) + (s5 * t183);
    const T t186 = t65 * t47;
    const T t187 = t186 - t57;
    const T t189 = t185 + (T(-0.099699999999999997) * t187);
    const T t191 = (c7 * t148) - (s7 * t189);
    const T t193 = t84 * t84;
    const T t194 = t86 * t86;
    const T t195 = t193 + t194;
    const T t197 = t191 - (T(0.099599999999999994) * t195);
    const T t199 = t128 + (beta[30] * t197);
    const T t202 = t94 * t101;
    const T t204 = t119 + t118;
    const T t207 = t91 - t95;
    const T t210 = t101 * t101;
    const T t211 = t125 - t210;
    const T t216 = (((((beta[31] - beta[32]) * t202) + (beta[35] * t204)) + (beta[33] * t207)) + (beta[34] * t211)) - (beta[29] * t197);
    const T t219 = t124 + t125;
    const T t222 = (t219 * beta[29]) + (t204 * beta[30]);
    const T t225 = t210 + t125;
    const T t227 = (t120 * beta[29]) - (t225 * beta[30]);
    const T t229 = (s9 * t222) - (c9 * t227);
    const T t235 = t67 * t86;
    const T t239 = t84 * t86;
    const T t240 = t239 - t116;
    const T t244 = t84 * t67;
    const T t245 = t244 + t79;
    const T t249 = t67 * t67;
    const T t250 = t249 - t194;
    const T t252 = ((((beta[24] * t70) + (beta[25] * t235)) - (beta[26] * t240)) + (beta[27] * t245)) + (beta[28] * t250);
    const T t257 = (c5 * t183) - (s5 * t171);
    const T t258 = t65 * t65;
    const T t259 = t61 * t61;
    const T t260 = t258 + t259;
    const T t262 = t257 - (T(-0.099699999999999997) * t260);
    const T t264 = ((((c9 * t199) - (s9 * t216)) + (T(0.099599999999999994) * t229)) + t252) - (beta[23] * t262);
    const T t269 = t95 + t91;
    const T t272 = t102 - t107;
    const T t275 = t210 - t124;
    const T t277 = ((((beta[32] * t118) + (beta[31] * t119)) + (beta[34] * t269)) + (beta[35] * t272)) + (beta[33] * t275);
    const T t280 = (c7 * t189) + (s7 * t148);
    const T t281 = t244 - t79;
    const T t283 = t280 + (T(0.099599999999999994) * t281);
    const T t285 = t235 + t70;
    const T t287 = (T(0.099599999999999994) * t285) - t262;
    const T t289 = (s9 * t283) + (c9 * t287);
    const T t293 = (c9 * t283) - (s9 * t287);
    const T t296 = t277 - ((beta[29] * t289) + (beta[30] * t293));
    const T t298 = t86 * t84;
    const T t304 = t194 - t193;
    const T t307 = t296 + (((((beta[24] - beta[25]) * t298) - (beta[28] * t281)) + (beta[26] * t285)) + (beta[27] * t304));
    const T t310 = t307 + (beta[22] * t262);
    const T t314 = t249 + t194;
    const T t319 = (c9 * t222) + (s9 * t227);
    const T t320 = ((t281 * beta[23]) - (t314 * beta[22])) - t319;
    const T t328 = ((t108 * beta[29]) + (t207 * beta[30])) + ((t245 * beta[22]) - (t195 * beta[23]));
    const T t330 = (s7 * t320) + (c7 * t328);
    const T t339 = t65 * t61;
    const T t340 = t339 - t78;
    const T t344 = t186 + t57;
    const T t348 = t47 * t47;
    const T t349 = t348 - t259;
    const T t351 = ((((beta[17] * t50) + (beta[18] * t145)) - (beta[19] * t340)) + (beta[20] * t344)) + (beta[21] * t349);
    const T t355 = ((((c7 * t264) - (s7 * t310)) + (T(-0.099699999999999997) * t330)) + t351) + (beta[16] * t143);
    const T t358 = t61 * t65;
    const T t364 = t259 - t258;
    const T t375 = t235 - t70;
    const T t378 = t239 + t116;
    const T t381 = t193 - t249;
    const T t383 = ((((beta[25] * t79) - (beta[24] * t244)) - (beta[27] * t375)) + (beta[28] * t378)) + (beta[26] * t381);
    const T t388 = (((T(0.099599999999999994) * t319) - ((s9 * t199) + (c9 * t216))) + t383) + ((beta[22] * t191) - (beta[23] * t280));
    const T t389 = (((((beta[17] - beta[18]) * t358) - (beta[21] * t187)) + (beta[19] * t146)) + (beta[20] * t364)) - t388;
    const T t392 = t389 - (beta[15] * t143);
    const T t397 = (c7 * t320) - (s7 * t328);
    const T t399 = t348 + t259;
    const T t402 = t397 + ((t187 * beta[16]) - (t399 * beta[15]));
    const T t411 = ((t344 * beta[15]) - (t260 * beta[16])) - (t229 + ((t240 * beta[22]) + (t285 * beta[23])));
    const T t413 = (s5 * t402) + (c5 * t411);
    const T t428 = t139 - t167;
    const T t430 = ((((beta[10] * t32) + (beta[11] * t179)) - (beta[12] * t135)) + (beta[13] * t177)) + (beta[14] * t428);
    const T t434 = ((((c5 * t355) - (s5 * t392)) - (T(0.1333) * t413)) + t430) + (beta[9] * t132);
    const T t441 = (c5 * t402) - (s5 * t411);
    const T t446 = t330 + ((t340 * beta[15]) + (t146 * beta[16]));
    const T t451 = t60 * t40;
    const T t453 = t176 - t55;
    const T t456 = t179 + t32;
    const T t459 = t167 - t138;
    const T t462 = (((s5 * t355) + (c5 * t392)) + ((T(0.1333) * t441) - (T(-0.39219999999999999) * t446))) + (((((beta[10] - beta[11]) * t451) - (beta[14] * t453)) + (beta[12] * t456)) + (beta[13] * t459));
    const T t465 = t462 - (beta[8] * t132);
    const T t480 = t152 - t153;
    const T t483 = ((c3 * t434) - (s3 * t465)) + (((((beta[3] * t18) + (beta[4] * t17)) - (beta[5] * t131)) + (beta[6] * t160)) + (beta[7] * t480));
    const T t493 = ((s3 * t434) + (c3 * t465)) - (T(-0.42499999999999999) * (t446 + ((t135 * beta[8]) + (t456 * beta[9]))));
    const T t495 = dq[1] * t22;
    const T t497 = t159 - ddq[1];
    const T t500 = t17 + t18;
    const T t503 = t22 * t22;
    const T t504 = t153 - t503;
    const T t508 = c1 * (t493 + (((((beta[3] - beta[4]) * t495) - (beta[7] * t497)) + (beta[5] * t500)) + (beta[6] * t504)));
    const T t514 = (((s1 * t483) + t508) + (beta[0] * ddq[0])) - tau[0];
    const T t516 = weight[0] * t514;
    const T t526 = t145 - t50;
    const T t529 = t339 + t78;
    const T t532 = t258 - t348;
    const T t534 = ((((beta[18] * t57) - (beta[17] * t186)) - (beta[20] * t526)) + (beta[21] * t529)) + (beta[19] * t532);
    const T t539 = ((((s7 * t264) + (c7 * t310)) - (T(-0.099699999999999997) * t397)) + t534) + ((beta[15] * t257) - (beta[16] * t185));
    const T t549 = t138 - t139;
    const T t551 = ((((beta[11] * t55) - (beta[10] * t176)) - (beta[13] * t180)) + (beta[14] * t165)) + (beta[12] * t549);
    const T t556 = ((t539 + (T(-0.39219999999999999) * t413)) + t551) + ((beta[8] * t175) - (beta[9] * t164));
    const T t563 = t138 + t167;
    const T t568 = (s3 * (t441 + ((t453 * beta[9]) - (t168 * beta[8])))) + (c3 * (t413 + ((t177 * beta[8]) - (t563 * beta[9]))));
    const T t578 = t503 - t152;
    const T t581 = (t556 + (T(-0.42499999999999999) * t568)) + (((((beta[4] * ddq[1]) - (beta[3] * t159)) + (beta[6] * t12)) + (beta[7] * t21)) + (beta[5] * t578));
    const T t589 = (t581 + ((beta[1] * t158) - (beta[2] * t151))) - tau[1];
    const T t591 = weight[1] * t589;
    const T t595 = t556 - tau[2];
    const T t597 = weight[2] * t595;
    const T t601 = t539 - tau[3];
    const T t603 = weight[3] * t601;
    const T t607 = t388 - tau[4];
    const T t609 = weight[4] * t607;
    const T t613 = t296 - tau[5];
    const T t615 = weight[5] * t613;
    const T t617 = (((((t514 * t516) + (t589 * t591)) + (t595 * t597)) + (t601 * t603)) + (t607 * t609)) + (t613 * t615);
    loss[0] = t617 / T(2.0);
    gradient[0] = ddq[0] * t516;
    gradient[1] = t158 * t591;
    gradient[2] = -(t151 * t591);
    const T t628 = c1 * t516;
    const T t629 = t495 * t628;
    const T t632 = s1 * t516;
    gradient[3] = (t629 - (t159 * t591)) + (t18 * t632);
    gradient[4] = ((ddq[1] * t591) - t629) + (t17 * t632);
    gradient[5] = ((t578 * t591) + (t500 * t628)) - (t131 * t632);
    gradient[6] = ((t12 * t591) + (t504 * t628)) + (t160 * t632);
    gradient[7] = ((t21 * t591) - (t497 * t628)) + (t480 * t632);
    const T t659 = T(-0.42499999999999999) * t591;
    const T t660 = c3 * t659;
    const T t662 = s3 * t659;
    const T t665 = t597 + t591;
    const T t668 = T(-0.42499999999999999) * t628;
    const T t673 = (c3 * t628) - (s3 * t632);
    gradient[8] = ((((t177 * t660) - (t168 * t662)) + (t175 * t665)) - (t135 * t668)) - (t132 * t673);
    const T t686 = (s3 * t628) + (c3 * t632);
    gradient[9] = ((((t453 * t662) - (t563 * t660)) - (t164 * t665)) - (t456 * t668)) + (t132 * t686);
    const T t690 = t451 * t673;
    gradient[10] = (t690 - (t176 * t665)) + (t32 * t686);
    gradient[11] = ((t55 * t665) - t690) + (t179 * t686);
    gradient[12] = ((t549 * t665) + (t456 * t673)) - (t135 * t686);
    gradient[13] = ((t459 * t673) - (t180 * t665)) + (t177 * t686);
    gradient[14] = ((t165 * t665) - (t453 * t673)) + (t428 * t686);
    const T t719 = t603 + t665;
    const T t722 = t668 + (T(-0.39219999999999999) * t673);
    const T t728 = (t660 + (T(-0.39219999999999999) * t665)) - (T(0.1333) * t686);
    const T t731 = t662 + (T(0.1333) * t673);
    const T t733 = (c5 * t728) - (s5 * t731);
    const T t738 = (c5 * t731) + (s5 * t728);
    const T t743 = (c5 * t673) - (s5 * t686);
    gradient[15] = ((((t257 * t719) - (t340 * t722)) + (t344 * t733)) - (t399 * t738)) - (t143 * t743);
    const T t756 = (s5 * t673) + (c5 * t686);
    gradient[16] = ((t187 * t738) - (((t185 * t719) + (t146 * t722)) + (t260 * t733))) + (t143 * t756);
    const T t760 = t358 * t743;
    gradient[17] = (t760 - (t186 * t719)) + (t50 * t756);
    gradient[18] = ((t57 * t719) - t760) + (t145 * t756);
    gradient[19] = ((t532 * t719) + (t146 * t743)) - (t340 * t756);
    gradient[20] = ((t364 * t743) - (t526 * t719)) + (t344 * t756);
    gradient[21] = ((t529 * t719) - (t187 * t743)) + (t349 * t756);
    const T t789 = t609 - t743;
    const T t794 = (T(-0.099699999999999997) * t756) - t722;
    const T t797 = t738 - (T(-0.099699999999999997) * t719);
    const T t799 = (c7 * t794) - (s7 * t797);
    const T t804 = (c7 * t797) + (s7 * t794);
    const T t809 = (c7 * t719) - (s7 * t756);
    gradient[22] = ((((t191 * t789) - (t240 * t733)) + (t245 * t799)) - (t314 * t804)) + (t262 * t809);
    const T t822 = (s7 * t719) + (c7 * t756);
    gradient[23] = ((t281 * t804) - (((t285 * t733) + (t280 * t789)) + (t195 * t799))) - (t262 * t822);
    const T t826 = t298 * t809;
    gradient[24] = (t826 - (t244 * t789)) + (t70 * t822);
    gradient[25] = ((t79 * t789) - t826) + (t235 * t822);
    gradient[26] = ((t381 * t789) + (t285 * t809)) - (t240 * t822);
    gradient[27] = ((t304 * t809) - (t375 * t789)) + (t245 * t822);
    gradient[28] = ((t378 * t789) - (t281 * t809)) + (t250 * t822);
    const T t856 = t615 + t809;
    const T t860 = (T(0.099599999999999994) * t789) - t804;
    const T t863 = (T(0.099599999999999994) * t822) - t733;
    const T t865 = (s9 * t860) - (c9 * t863);
    const T t870 = (c9 * t860) + (s9 * t863);
    const T t875 = (c9 * t789) + (s9 * t822);
    gradient[29] = ((((t108 * t799) - (t289 * t856)) + (t120 * t865)) + (t219 * t870)) + (t197 * t875);
    const T t888 = (c9 * t822) - (s9 * t789);
    gradient[30] = ((((t207 * t799) - (t293 * t856)) - (t225 * t865)) + (t204 * t870)) + (t197 * t888);
    const T t893 = t202 * t875;
    gradient[31] = ((t119 * t856) - t893) + (t91 * t888);
    gradient[32] = ((t118 * t856) + t893) - (t95 * t888);
    gradient[33] = ((t275 * t856) - (t207 * t875)) - (t108 * t888);
    gradient[34] = ((t269 * t856) - (t211 * t875)) + (t120 * t888);
    gradient[35] = ((t272 * t856) - (t204 * t875)) + (t126 * t888);
    residual[0] = t514;
    residual[1] = t589;
    residual[2] = t595;
    residual[3] = t601;
    residual[4] = t607;
    residual[5] = t613;
}

template <typename T>
SYMGEN_BOTH void loss_gradient_at(long long i, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> tau_, symgen_array<const T> weight_, symgen_array<const T> beta_, symgen_array<T> loss_, symgen_array<T> gradient_, symgen_array<T> residual_)
{
    T q[6];
    symgen_load<6>(q, q_, i);
    T dq[6];
    symgen_load<6>(dq, dq_, i);
    T ddq[6];
    symgen_load<6>(ddq, ddq_, i);
    T tau[6];
    symgen_load<6>(tau, tau_, i);
    const symgen_sample<T> weight = {weight_.data + i * weight_.sample, weight_.entry};
    const symgen_sample<T> beta = {beta_.data + i * beta_.sample, beta_.entry};
    T loss_of[1], gradient_of[36], residual_of[6];
    loss_gradient(q, dq, ddq, tau, weight, beta, loss_of, gradient_of, residual_of);
    symgen_store<1>(loss_, i, loss_of);
    symgen_store<36>(gradient_, i, gradient_of);
    symgen_store<6>(residual_, i, residual_of);
}

/* tau of Eq. 4.3 and its derivatives by q, dq and ddq, the last one M(q). 3278 operations. */
template <typename Of_q, typename Of_dq, typename Of_ddq, typename Of_pi, typename T>
SYMGEN_BOTH void torque_derivatives(const Of_q &q, const Of_dq &dq, const Of_ddq &ddq, const Of_pi &pi, T *tau, T *dtau_dq, T *dtau_dv, T *dtau_da)
{
    T s1, c1;
    symgen_turn(q[1], s1, c1);
    T s3, c3;
    symgen_turn(q[2], s3, c3);
    T s5, c5;
    symgen_turn(q[3], s5, c5);
    T s7, c7;
    symgen_turn(q[4], s7, c7);
    T s9, c9;
    symgen_turn(q[5], s9, c9);
    const T t12 = pi[54] - pi[55];
    const T t14 = s1 * ddq[0];
    const T t17 = c1 * dq[0];
    const T t19 = t17 * dq[1];
    const T t20 = t14 + t19;
    const T t23 = c1 * ddq[0];
    const T t24 = s1 * dq[0];
    const T t25 = t24 * dq[1];
    const T t26 = t23 - t25;
    const T t31 = (c3 * t17) - (s3 * t24);
    const T t34 = ((c3 * t20) + (s3 * t26)) + (t31 * dq[2]);
    const T t42 = (c3 * t24) + (s3 * t17);
    const T t44 = ((c3 * t26) - (s3 * t20)) - (t42 * dq[2]);
    const T t49 = (c5 * t31) - (s5 * t42);
    const T t52 = ((c5 * t34) + (s5 * t44)) + (t49 * dq[3]);
    const T t57 = ddq[1] + ddq[2];
    const T t59 = t57 + ddq[3];
    const T t62 = dq[1] + dq[2];
    const T t63 = t62 + dq[3];
    const T t67 = (c5 * t42) + (s5 * t31);
    const T t69 = (c7 * t63) - (s7 * t67);
    const T t72 = ((c7 * t52) + (s7 * t59)) + (t69 * dq[4]);
    const T t80 = ((c5 * t44) - (s5 * t34)) - (t67 * dq[3]);
    const T t81 = ddq[4] - t80;
    const T t86 = (c7 * t67) + (s7 * t63);
    const T t88 = dq[4] - t49;
    const T t90 = (s9 * t86) + (c9 * t88);
    const T t93 = ((c9 * t72) - (s9 * t81)) - (t90 * dq[5]);
    const T t96 = t69 + dq[5];
    const T t97 = t90 * t96;
    const T t103 = (c9 * t86) - (s9 * t88);
    const T t104 = t103 * t96;
    const T t109 = ((s9 * t72) + (c9 * t81)) + (t103 * dq[5]);
    const T t110 = t104 + t109;
    const T t118 = ((c7 * t59) - (s7 * t52)) - (t86 * dq[4]);
    const T t120 = t118 + ddq[5];
    const T t121 = t103 * t90;
    const T t122 = t120 - t121;
    const T t126 = t90 * t90;
    const T t127 = t96 * t96;
    const T t133 = t25 - t26;
    const T t134 = T(-0.42499999999999999) * t133;
    const T t136 = t42 * t62;
    const T t137 = t136 - t44;
    const T t140 = t42 * t42;
    const T t141 = t31 * t31;
    const T t145 = t134 + ((T(-0.39219999999999999) * t137) - (T(0.1333) * (t140 + t141)));
    const T t147 = t49 * t63;
    const T t148 = t147 + t52;
    const T t150 = t145 + (T(-0.099699999999999997) * t148);
    const T t153 = T(9.8100000000000005) * s1;
    const T t154 = t17 * t17;
    const T t155 = dq[1] * dq[1];
    const T t158 = t153 - (T(-0.42499999999999999) * (t154 + t155));
    const T t160 = T(9.8100000000000005) * c1;
    const T t161 = t24 * t17;
    const T t162 = t161 + ddq[1];
    const T t164 = t160 + (T(-0.42499999999999999) * t162);
    const T t166 = (c3 * t158) + (s3 * t164);
    const T t167 = t136 + t44;
    const T t169 = t62 * t62;
    const T t170 = t141 + t169;
    const T t173 = t166 + ((T(0.1333) * t167) - (T(-0.39219999999999999) * t170));
    const T t177 = (c3 * t164) - (s3 * t158);
    const T t178 = t42 * t31;
    const T t179 = t178 + t57;
    const T t181 = t31 * t62;
    const T t182 = t181 - t34;
    const T t185 = t177 + ((T(-0.39219999999999999) * t179) + (T(0.1333) * t182));
    const T t187 = (c5 * t173) + (s5 * t185);
    const T t188 = t67 * t49;
    const T t189 = t188 - t59;
    const T t191 = t187 + (T(-0.099699999999999997) * t189);
    const T t193 = (c7 * t150) - (s7 * t191);
    const T t195 = t86 * t86;
    const T t196 = t88 * t88;
    const T t197 = t195 + t196;
    const T t199 = t193 - (T(0.099599999999999994) * t197);
    const T t201 = (((((t12 * t93) - (pi[56] * t97)) - (pi[57] * t110)) + (pi[58] * t122)) + (pi[59] * (t126 - t127))) + (pi[52] * t199);
    const T t203 = t12 - pi[56];
    const T t206 = t121 + t120;
    const T t209 = t93 - t97;
    const T t212 = t103 * t103;
    const T t218 = ((((t203 * (t96 * t103)) + (pi[59] * t206)) + (pi[57] * t209)) + (pi[58] * (t127 - t212))) - (pi[51] * t199);
    const T t224 = ((t126 + t127) * pi[51]) + (t206 * pi[52]);
    const T t229 = (t122 * pi[51]) - ((t212 + t127) * pi[52]);
    const T t231 = (s9 * t224) - (c9 * t229);
    const T t241 = (T(0.19919999999999999) * pi[53]) + (T(0.009920159999999999) * pi[50]);
    const T t242 = pi[55] + t241;
    const T t245 = T(0.099599999999999994) * pi[50];
    const T t251 = pi[45] + (t241 - (T(0.19919999999999999) * (pi[53] + (t245 / T(2.0)))));
    const T t252 = (pi[44] + t242) - t251;
    const T t255 = pi[46] + t242;
    const T t256 = t69 * t88;
    const T t260 = t86 * t88;
    const T t261 = t260 - t118;
    const T t265 = t86 * t69;
    const T t266 = t265 + t81;
    const T t270 = t69 * t69;
    const T t274 = (((c9 * t201) - (s9 * t218)) + (T(0.099599999999999994) * t231)) + (((((t252 * t72) + (t255 * t256)) - (pi[47] * t261)) + (pi[48] * t266)) + (pi[49] * (t270 - t196)));
    const T t277 = pi[42] + (pi[53] + t245);
    const T t280 = (c5 * t185) - (s5 * t173);
    const T t281 = t67 * t67;
    const T t282 = t63 * t63;
    const T t283 = t281 + t282;
    const T t285 = t280 - (T(-0.099699999999999997) * t283);
    const T t287 = t274 - (t277 * t285);
    const T t300 = ((((pi[56] * t120) + (t12 * t121)) + (pi[58] * (t97 + t93))) + (pi[59] * (t104 - t109))) + (pi[57] * (t212 - t126));
    const T t303 = (c7 * t191) + (s7 * t150);
    const T t304 = t265 - t81;
    const T t306 = t303 + (T(0.099599999999999994) * t304);
    const T t308 = t256 + t72;
    const T t310 = (T(0.099599999999999994) * t308) - t285;
    const T t319 = t300 - ((pi[51] * ((s9 * t306) + (c9 * t310))) + (pi[52] * ((c9 * t306) - (s9 * t310))));
    const T t320 = t252 - t255;
    const T t333 = (t319 + ((((t320 * (t88 * t86)) - (pi[49] * t304)) + (pi[47] * t308)) + (pi[48] * (t196 - t195)))) + (pi[41] * t285);
    const T t342 = (c9 * t224) + (s9 * t229);
    const T t343 = ((t304 * t277) - ((t270 + t196) * pi[41])) - t342;
    const T t351 = ((t110 * pi[51]) + (t209 * pi[52])) + ((t266 * pi[41]) - (t197 * t277));
    const T t353 = (s7 * t343) + (c7 * t351);
    const T t359 = -(T(-0.099699999999999997) * pi[43]);
    const T t363 = pi[40] + pi[50];
    const T t365 = (t359 + t359) + (T(0.0099400899999999986) * t363);
    const T t366 = t251 + t365;
    const T t370 = T(-0.099699999999999997) * t363;
    const T t375 = pi[35] + (t365 - (T(-0.19939999999999999) * ((t370 / T(2.0)) - pi[43])));
    const T t376 = (pi[34] + t366) - t375;
    const T t379 = pi[36] + t366;
    const T t383 = t67 * t63;
    const T t384 = t383 - t80;
    const T t388 = t188 + t59;
    const T t392 = t49 * t49;
    const T t396 = (((c7 * t287) - (s7 * t333)) + (T(-0.099699999999999997) * t353)) + (((((t376 * t52) + (t379 * t147)) - (pi[37] * t384)) + (pi[38] * t388)) + (pi[39] * (t392 - t282)));
    const T t399 = pi[32] + (t370 - pi[43]);
    const T t401 = t396 + (t399 * t145);
    const T t403 = t376 - t379;
    const T t429 = ((((t255 * t81) - (t252 * t265)) - (pi[48] * (t256 - t72))) + (pi[49] * (t260 + t118))) + (pi[47] * (t195 - t270));
    const T t434 = (((T(0.099599999999999994) * t342) - ((s9 * t201) + (c9 * t218))) + t429) + ((pi[41] * t193) - (t277 * t303));
    const T t438 = (((((t403 * (t63 * t67)) - (pi[39] * t189)) + (pi[37] * t148)) + (pi[38] * (t282 - t281))) - t434) - (pi[31] * t145);
    const T t443 = (c7 * t343) - (s7 * t351);
    const T t448 = t443 + ((t189 * t399) - ((t392 + t282) * pi[31]));
    const T t457 = ((t388 * pi[31]) - (t283 * t399)) - (t231 + ((t261 * pi[41]) + (t308 * t277)));
    const T t459 = (s5 * t448) + (c5 * t457);
    const T t464 = pi[30] + t363;
    const T t465 = T(-0.39219999999999999) * t464;
    const T t466 = t465 / T(2.0);
    const T t467 = T(-0.39219999999999999) * t466;
    const T t475 = (T(0.2666) * pi[33]) + (T(0.17158973) * t464);
    const T t480 = pi[25] + (t375 + t475);
    const T t481 = (pi[24] + (((t375 - t467) - t467) + t475)) - t480;
    const T t484 = T(0.1333) * t464;
    const T t486 = pi[33] + (t484 / T(2.0));
    const T t489 = pi[26] + (t475 - (T(0.2666) * t486));
    const T t499 = pi[28] - ((T(0.1333) * t466) + (T(-0.39219999999999999) * t486));
    const T t506 = (((c5 * t401) - (s5 * t438)) - (T(0.1333) * t459)) + (((((t481 * t34) + (t489 * t181)) - (pi[27] * t137)) + (t499 * t179)) + (pi[29] * (t141 - t169)));
    const T t509 = t506 + (pi[22] * t134);
    const T t516 = (c5 * t448) - (s5 * t457);
    const T t521 = t353 + ((t384 * pi[31]) + (t148 * t399));
    const T t525 = t481 - t489;
    const T t528 = t178 - t57;
    const T t531 = t181 + t34;
    const T t537 = (((s5 * t401) + (c5 * t438)) + ((T(0.1333) * t516) - (T(-0.39219999999999999) * t521))) + ((((t525 * (t62 * t42)) - (pi[29] * t528)) + (pi[27] * t531)) + (t499 * (t169 - t140)));
    const T t539 = pi[21] + t465;
    const T t541 = t537 - (t539 * t134);
    const T t546 = pi[20] + t464;
    const T t547 = T(-0.42499999999999999) * t546;
    const T t549 = T(-0.42499999999999999) * (t547 / T(2.0));
    const T t553 = T(0.18062499999999998) * t546;
    const T t558 = pi[15] + (t480 + t553);
    const T t559 = (pi[14] + (((t480 - t549) - t549) + t553)) - t558;
    const T t562 = pi[16] + t553;
    const T t573 = pi[18] - (T(-0.42499999999999999) * (pi[23] + (pi[33] + t484)));
    const T t580 = ((c3 * t509) - (s3 * t541)) + (((((t559 * t20) + (t562 * t19)) - (pi[17] * t133)) + (t573 * t162)) + (pi[19] * (t154 - t155)));
    const T t591 = t559 - t562;
    const T t600 = t24 * t24;
    const T t603 = (((t591 * (dq[1] * t24)) - (pi[19] * (t161 - ddq[1]))) + (pi[17] * (t19 + t20))) + (t573 * (t155 - t600));
    const T t604 = (((s3 * t509) + (c3 * t541)) - (T(-0.42499999999999999) * (t521 + ((t137 * t539) + (t531 * pi[22]))))) + t603;
    const T t608 = pi[6] + t558;
    tau[0] = ((s1 * t580) + (c1 * t604)) + (t608 * ddq[0]);
    const T t628 = ((((t379 * t59) - (t376 * t188)) - (pi[38] * (t147 - t52))) + (pi[39] * (t383 + t80))) + (pi[37] * (t281 - t392));
    const T t633 = ((((s7 * t287) + (c7 * t333)) - (T(-0.099699999999999997) * t443)) + t628) + ((pi[31] * t280) - (t399 * t187));
    const T t646 = (t633 + (T(-0.39219999999999999) * t459)) + (((((t489 * t57) - (t481 * t178)) - (t499 * t182)) + (pi[29] * t167)) + (pi[27] * (t140 - t141)));
    const T t650 = t646 + ((t539 * t177) - (pi[22] * t166));
    const T t654 = t516 + ((t528 * pi[22]) - (t170 * t539));
    const T t660 = t459 + ((t179 * t539) - ((t140 + t169) * pi[22]));
    const T t675 = (t650 + (T(-0.42499999999999999) * ((s3 * t654) + (c3 * t660)))) + (((((t562 * ddq[1]) - (t559 * t161)) + (t573 * t14)) + (pi[19] * t23)) + (pi[17] * (t600 - t154)));
    const T t677 = pi[11] + t547;
    tau[1] = t675 + ((t677 * t160) - (pi[12] * t153));
    tau[2] = t650;
    tau[3] = t633;
    tau[4] = t434;
    tau[5] = t319;
    dtau_dq[0] = T(0.0);
    const T t692 = (c3 * c1) - (s3 * s1);
    const T t696 = (s3 * c1) + (c3 * s1);
    const T t698 = (s5 * t692) + (c5 * t696);
    const T t699 = s7 * t698;
    const T t701 = pi[51] * t699;
    const T t703 = pi[52] * t699;
    const T t705 = (c9 * t701) - (s9 * t703);
    const T t707 = c7 * t698;
    const T t709 = ((pi[41] * t699) + t705) + (t277 * t707);
    const T t713 = (c5 * t692) - (s5 * t696);
    const T t717 = (c9 * t703) + (s9 * t701);
    const T t718 = (t277 * t713) + t717;
    const T t722 = (s9 * t713) + (c9 * t707);
    const T t726 = (c9 * t713) - (s9 * t707);
    const T t728 = (pi[52] * t722) - (pi[51] * t726);
    const T t730 = t728 - (pi[41] * t713);
    const T t732 = (c7 * t718) - (s7 * t730);
    const T t734 = (s5 * t709) + (c5 * t732);
    const T t738 = (s5 * t732) - (c5 * t709);
    const T t740 = (c3 * t734) - (s3 * t738);
    const T t743 = t591 * c1;
    const T t745 = t24 + t24;
    const T t746 = t573 * c1;
    const T t752 = (c3 * t738) + (s3 * t734);
    const T t754 = (t573 * s1) + (T(-0.42499999999999999) * t752);
    const T t755 = pi[19] * c1;
    const T t756 = t754 - t755;
    const T t767 = (s7 * t718) + (c7 * t730);
    const T t768 = ((t399 * t698) - (pi[31] * t713)) + t767;
    const T t772 = (T(-0.42499999999999999) * (((pi[22] * t696) - (t539 * t692)) + t768)) - (pi[17] * s1);
    const T t775 = t525 * t692;
    const T t777 = t42 + t42;
    const T t778 = t499 * t692;
    const T t783 = (t499 * t696) + (T(-0.39219999999999999) * t738);
    const T t784 = pi[29] * t692;
    const T t785 = t783 - t784;
    const T t788 = T(0.1333) * t768;
    const T t791 = T(0.1333) * t734;
    const T t793 = T(-0.42499999999999999) * c1;
    const T t797 = (T(-0.39219999999999999) * t768) - ((t539 * t793) + (pi[27] * t696));
    const T t798 = t791 + t797;
    const T t801 = t403 * t713;
    const T t803 = t67 + t67;
    const T t804 = pi[38] * t713;
    const T t808 = t793 + (T(-0.39219999999999999) * t692);
    const T t811 = (pi[31] * t808) + (pi[37] * t698);
    const T t814 = T(0.1333) * t692;
    const T t816 = T(0.1333) * t696;
    const T t818 = (s5 * t814) + (c5 * t816);
    const T t821 = (t399 * t818) + (T(-0.099699999999999997) * t709);
    const T t826 = (pi[38] * t698) - (pi[31] * t818);
    const T t829 = (c5 * t814) - (s5 * t816);
    const T t834 = ((t399 * t829) - (pi[39] * t713)) + (T(-0.099699999999999997) * t732);
    const T t835 = t826 + t834;
    const T t838 = t252 * t713;
    const T t840 = t86 + t86;
    const T t841 = pi[47] * t713;
    const T t844 = pi[48] * t699;
    const T t847 = t320 * t699;
    const T t852 = (T(-0.099699999999999997) * t698) - t808;
    const T t854 = (c7 * t829) + (s7 * t852);
    const T t859 = ((t277 * t854) + (pi[49] * t699)) + (T(0.099599999999999994) * t717);
    const T t862 = (c7 * t852) - (s7 * t829);
    const T t865 = (pi[41] * t862) + (pi[48] * t707);
    const T t866 = t859 + t865;
    const T t871 = (pi[41] * t818) - (pi[47] * t707);
    const T t872 = pi[49] * t713;
    const T t873 = t871 - t872;
    const T t878 = (t277 * t862) + (T(0.099599999999999994) * t728);
    const T t880 = ((((((t69 * t838) - (t840 * t841)) + (t840 * t844)) - (t88 * t847)) + (t69 * t866)) + (t88 * t873)) - (t840 * t878);
    const T t882 = t818 + (T(0.099599999999999994) * t707);
    const T t885 = (T(0.099599999999999994) * t713) + t854;
    const T t887 = (s9 * t882) - (c9 * t885);
    const T t890 = (pi[52] * t887) + (pi[59] * t726);
    const T t896 = (s9 * t885) + (c9 * t882);
    const T t898 = (pi[58] * t722) - (pi[51] * t896);
    const T t899 = (t890 - (pi[56] * t699)) + t898;
    const T t901 = t899 - (t872 + t871);
    const T t904 = t103 + t103;
    const T t905 = pi[52] * t896;
    const T t907 = pi[57] * t699;
    const T t909 = t12 * t699;
    const T t913 = pi[58] * t726;
    const T t916 = t203 * t726;
    const T t919 = t890 - t898;
    const T t922 = pi[59] * t699;
    const T t925 = (pi[51] * t862) - (pi[57] * t722);
    const T t926 = t922 + t925;
    const T t928 = (((((t904 * t905) - ((t904 * t907) + (t90 * t909))) - (t904 * t913)) + (t96 * t916)) + (t90 * t919)) + (dq[5] * t926);
    const T t929 = t925 - t922;
    const T t931 = t928 + (t96 * t929);
    const T t934 = t90 + t90;
    const T t938 = pi[51] * t887;
    const T t941 = pi[58] * t699;
    const T t944 = (pi[52] * t862) + (pi[57] * t726);
    const T t945 = t941 + t944;
    const T t948 = pi[59] * t722;
    const T t953 = pi[56] * t722;
    const T t955 = ((((((t934 * t907) - (t103 * t909)) + (t934 * t938)) - (t96 * t945)) + (t934 * t948)) + (t103 * t919)) - (t96 * t953);
    const T t958 = (t944 - t941) + (t12 * t722);
    const T t960 = t955 - (dq[5] * t958);
    const T t962 = ((t880 - (dq[4] * t901)) + (c9 * t931)) + (s9 * t960);
    const T t971 = ((t865 - ((t255 * t713) + t859)) + (c9 * t926)) - (s9 * t958);
    const T t972 = t811 - t971;
    const T t974 = ((((((t63 * t801) - (t803 * t804)) - (t63 * t811)) + (t803 * t821)) + (t49 * t835)) + (c7 * t962)) - (dq[3] * t972);
    const T t975 = t69 + t69;
    const T t979 = pi[41] * t854;
    const T t982 = pi[48] * t713;
    const T t987 = ((t277 * t818) - (pi[47] * t699)) + (T(0.099599999999999994) * t705);
    const T t988 = t982 + t987;
    const T t991 = pi[49] * t707;
    const T t996 = t255 * t707;
    const T t998 = ((((((t975 * t841) + (t86 * t838)) - (t975 * t979)) + (t88 * t988)) + (t975 * t991)) + (t86 * t866)) + (t88 * t996);
    const T t999 = t96 + t96;
    const T t1012 = ((((((t999 * t905) + (t999 * t938)) + (t999 * t913)) - (t90 * t945)) + (t103 * t916)) - (t999 * t948)) + (t103 * t929);
    const T t1014 = t1012 - (t90 * t953);
    const T t1022 = (((t987 - t982) + (t252 * t707)) + (s9 * t926)) + (c9 * t958);
    const T t1024 = (t998 + t1014) + (dq[4] * t1022);
    const T t1026 = t974 - (s7 * t1024);
    const T t1029 = t49 + t49;
    const T t1030 = pi[39] * t698;
    const T t1032 = pi[31] * t829;
    const T t1035 = t379 * t698;
    const T t1044 = ((pi[37] * t713) - (t399 * t808)) + (T(-0.099699999999999997) * t767);
    const T t1048 = t88 + t88;
    const T t1058 = (((t69 * t988) - (((t1048 * t979) + (t1048 * t844)) + (t86 * t847))) - (t1048 * t991)) + (t86 * t873);
    const T t1066 = (((t1058 + (t69 * t996)) - (t1048 * t878)) - (s9 * t931)) + (c9 * t960);
    const T t1073 = (((t376 * t698) + t1044) - (s7 * t901)) + (c7 * t1022);
    const T t1075 = ((((((t1029 * t1030) - (t1029 * t1032)) + (t63 * t1035)) + (t67 * t835)) + (t63 * t1044)) - t1066) + (dq[3] * t1073);
    const T t1077 = ((((((t62 * t775) - (t777 * t778)) + (t31 * t785)) - (t777 * t788)) + (t62 * t798)) + (c5 * t1026)) - (s5 * t1075);
    const T t1082 = ((t791 - t797) + (c5 * t972)) + (s5 * t1073);
    const T t1084 = t1077 - (dq[2] * t1082);
    const T t1087 = t31 + t31;
    const T t1088 = pi[29] * t696;
    const T t1090 = t489 * t696;
    const T t1095 = (pi[27] * t692) - (pi[22] * t793);
    const T t1096 = T(0.1333) * t738;
    const T t1097 = t1095 + t1096;
    const T t1102 = T(-0.39219999999999999) * t734;
    const T t1106 = (((((t1087 * t1088) + (t62 * t1090)) + (t62 * t1097)) + (t42 * t785)) - (t1087 * t1102)) - (t1087 * t788);
    const T t1117 = (((t1095 + (t481 * t696)) - t1096) - (s5 * t972)) + (c5 * t1073);
    const T t1119 = ((t1106 + (s5 * t1026)) + (c5 * t1075)) + (dq[2] * t1117);
    const T t1125 = ((c3 * t1082) - t772) + (s3 * t1117);
    const T t1127 = ((((((dq[1] * t743) - (t745 * t746)) + (t17 * t756)) + (dq[1] * t772)) + (c3 * t1084)) - (s3 * t1119)) - (dq[1] * t1125);
    const T t1130 = pi[17] * c1;
    const T t1136 = ((t1130 + (t559 * s1)) - (s3 * t1082)) + (c3 * t1117);
    const T t1145 = t17 + t17;
    const T t1146 = pi[19] * s1;
    const T t1149 = t562 * s1;
    const T t1154 = T(-0.42499999999999999) * t740;
    const T t1158 = (((((dq[1] * t1130) + (t1145 * t1146)) + (dq[1] * t1149)) + (t24 * t756)) - (t1145 * t1154)) + (s3 * t1084);
    const T t1162 = (t1158 + (c3 * t1119)) + (dq[1] * t1136);
    const T t1166 = (c1 * (((t580 + (T(9.8100000000000005) * t740)) + (dq[0] * t1127)) + (ddq[0] * t1136))) - (s1 * (((t604 + (T(9.8100000000000005) * t752)) + (ddq[0] * t1125)) + (dq[0] * t1162)));
    dtau_dq[1] = t1166;
    const T t1180 = ((((((t509 * c1) - (t541 * s1)) - (t158 * t738)) + (t164 * t734)) + (t17 * t1084)) - (t20 * t1082)) - (t24 * t1119);
    const T t1196 = ((((((t541 * c1) + (t509 * s1)) + (t164 * t738)) + (t158 * t734)) + (t24 * t1084)) + (t26 * t1082)) + (t17 * t1119);
    dtau_dq[2] = (c3 * (t1180 + (t26 * t1117))) - (s3 * (t1196 + (t20 * t1117)));
    const T t1212 = (((((t401 * t692) - (t457 * t814)) - (t448 * t816)) - (t438 * t696)) + (t173 * t709)) + (t185 * t732);
    const T t1232 = (((((t448 * t814) + (t438 * t692)) - (t457 * t816)) + (t401 * t696)) - (t185 * t709)) + (t173 * t732);
    const T t1242 = (c5 * ((((t1212 - (t34 * t972)) + (t31 * t1026)) - (t42 * t1075)) + (t44 * t1073))) - (s5 * ((((t1232 + (t44 * t972)) + (t42 * t1026)) + (t31 * t1075)) + (t34 * t1073)));
    dtau_dq[3] = t1242;
    const T t1256 = ((((((t343 * t852) - (t351 * t829)) - (t333 * t698)) + (t150 * t718)) - (t191 * t730)) - (t52 * t901)) + (t63 * t962);
    const T t1274 = ((((((t343 * t829) + (t351 * t852)) + (t191 * t718)) + (t287 * t698)) + (t150 * t730)) + (t59 * t901)) + (t67 * t962);
    dtau_dq[4] = (c7 * ((t1256 - (t67 * t1024)) + (t59 * t1022))) - (s7 * ((t1274 + (t63 * t1024)) + (t52 * t1022)));
    const T t1292 = (((((t201 * t713) - (t229 * t885)) - (t310 * t703)) + (t306 * t701)) + (t224 * t882)) - (t218 * t707);
    const T t1312 = (((((t218 * t713) - (t224 * t885)) + (t306 * t703)) + (t310 * t701)) - (t229 * t882)) + (t201 * t707);
    const T t1322 = (c9 * ((((t1292 + (t72 * t926)) - (t88 * t931)) + (t86 * t960)) - (t81 * t958))) - (s9 * ((((t1312 + (t81 * t926)) + (t86 * t931)) + (t88 * t960)) + (t72 * t958)));
    dtau_dq[5] = t1322;
    dtau_dq[6] = T(0.0);
    const T t1329 = pi[52] * c7;
    const T t1331 = pi[51] * c7;
    const T t1333 = (s9 * t1329) - (c9 * t1331);
    const T t1336 = ((pi[41] * c7) - t1333) - (t277 * s7);
    const T t1337 = pi[31] + t1336;
    const T t1341 = (c9 * t1329) + (s9 * t1331);
    const T t1343 = s9 * s7;
    const T t1345 = c9 * s7;
    const T t1347 = (pi[51] * t1343) + (pi[52] * t1345);
    const T t1349 = (c7 * t1341) + (s7 * t1347);
    const T t1350 = t399 + t1349;
    const T t1352 = (c5 * t1337) - (s5 * t1350);
    const T t1353 = t539 + t1352;
    const T t1357 = (s5 * t1337) + (c5 * t1350);
    const T t1358 = pi[22] + t1357;
    const T t1360 = (c3 * t1353) - (s3 * t1358);
    const T t1361 = T(-0.42499999999999999) * t1360;
    const T t1362 = t17 * t1361;
    const T t1366 = (c7 * t1347) - (s7 * t1341);
    const T t1367 = T(-0.42499999999999999) * t1366;
    const T t1368 = dq[1] * t1367;
    const T t1370 = t777 * pi[27];
    const T t1371 = T(-0.42499999999999999) * c3;
    const T t1372 = pi[22] * t1371;
    const T t1375 = t31 * t481;
    const T t1377 = T(-0.42499999999999999) * s3;
    const T t1378 = pi[22] * t1377;
    const T t1380 = T(-0.39219999999999999) * t1352;
    const T t1381 = (t539 * t1371) + t1380;
    const T t1382 = t1378 + t1381;
    const T t1385 = T(0.1333) * t1366;
    const T t1386 = t777 * t1385;
    const T t1388 = T(0.1333) * t1357;
    const T t1389 = pi[29] - t1388;
    const T t1390 = T(-0.39219999999999999) * t1366;
    const T t1391 = t1389 + t1390;
    const T t1392 = t62 * t1391;
    const T t1398 = ((t803 * pi[37]) - (t49 * t376)) + (t63 * pi[39]);
    const T t1399 = t1371 + T(-0.39219999999999999);
    const T t1402 = (c5 * t1399) - (s5 * t1377);
    const T t1404 = T(-0.099699999999999997) * t1336;
    const T t1405 = (t399 * t1402) + t1404;
    const T t1408 = pi[31] * t1402;
    const T t1411 = (c5 * t1377) + (s5 * t1399);
    const T t1413 = T(-0.099699999999999997) * t1349;
    const T t1414 = (t399 * t1411) - t1413;
    const T t1415 = t1408 + t1414;
    const T t1418 = t320 * c7;
    const T t1420 = pi[48] * c7;
    const T t1422 = (t88 * t1418) - (t840 * t1420);
    const T t1424 = T(0.099699999999999997) + t1411;
    const T t1425 = c7 * t1424;
    const T t1427 = pi[49] * c7;
    const T t1429 = T(0.099599999999999994) * t1341;
    const T t1430 = ((t277 * t1425) - t1427) - t1429;
    const T t1431 = pi[48] * s7;
    const T t1432 = s7 * t1424;
    const T t1434 = t1431 - (pi[41] * t1432);
    const T t1435 = t1430 + t1434;
    const T t1439 = pi[47] * s7;
    const T t1440 = (pi[41] * t1402) + t1439;
    const T t1444 = T(0.099599999999999994) * t1347;
    const T t1445 = (t277 * t1432) - t1444;
    const T t1448 = pi[56] * c7;
    const T t1449 = T(0.099599999999999994) * s7;
    const T t1450 = t1449 - t1402;
    const T t1453 = (s9 * t1450) - (c9 * t1425);
    const T t1455 = pi[59] * t1343;
    const T t1456 = (pi[52] * t1453) - t1455;
    const T t1458 = pi[58] * t1345;
    const T t1461 = (s9 * t1425) + (c9 * t1450);
    const T t1463 = t1458 - (pi[51] * t1461);
    const T t1464 = (t1448 + t1456) + t1463;
    const T t1465 = t1440 + t1464;
    const T t1468 = pi[57] * c7;
    const T t1470 = t12 * c7;
    const T t1472 = (t904 * t1468) + (t90 * t1470);
    const T t1473 = pi[52] * t1461;
    const T t1476 = pi[58] * t1343;
    const T t1477 = t904 * t1476;
    const T t1479 = t203 * t1343;
    const T t1480 = t96 * t1479;
    const T t1482 = t1456 - t1463;
    const T t1485 = pi[59] * c7;
    const T t1487 = pi[57] * t1345;
    const T t1488 = (pi[51] * t1432) + t1487;
    const T t1489 = t1485 + t1488;
    const T t1492 = t1485 - t1488;
    const T t1494 = (((((t1472 + (t904 * t1473)) + t1477) - t1480) + (t90 * t1482)) - (dq[5] * t1489)) + (t96 * t1492);
    const T t1499 = (t103 * t1470) - (t934 * t1468);
    const T t1500 = pi[51] * t1453;
    const T t1503 = pi[58] * c7;
    const T t1505 = pi[57] * t1343;
    const T t1506 = (pi[52] * t1432) + t1505;
    const T t1507 = t1503 + t1506;
    const T t1510 = pi[59] * t1345;
    const T t1511 = t934 * t1510;
    const T t1515 = pi[56] * t1345;
    const T t1516 = t96 * t1515;
    const T t1519 = t12 * t1345;
    const T t1520 = (t1503 - t1506) + t1519;
    const T t1522 = (((((t1499 + (t934 * t1500)) + (t96 * t1507)) + t1511) + (t103 * t1482)) - t1516) - (dq[5] * t1520);
    const T t1524 = (((((t1422 + (t69 * t1435)) - (t88 * t1440)) + (t840 * t1445)) - (dq[4] * t1465)) + (c9 * t1494)) + (s9 * t1522);
    const T t1531 = ((t1434 - t1430) - (c9 * t1489)) - (s9 * t1520);
    const T t1532 = pi[39] - t1531;
    const T t1535 = pi[47] * c7;
    const T t1538 = T(0.099599999999999994) * t1333;
    const T t1539 = (t1535 - (t277 * t1402)) + t1538;
    const T t1541 = pi[41] * t1425;
    const T t1544 = pi[49] * s7;
    const T t1545 = t975 * t1544;
    const T t1549 = t255 * s7;
    const T t1550 = t88 * t1549;
    const T t1555 = t999 * t1476;
    const T t1559 = t103 * t1479;
    const T t1561 = t999 * t1510;
    const T t1565 = t90 * t1515;
    const T t1566 = (((((((t999 * t1473) + (t999 * t1500)) - t1555) + (t90 * t1507)) - t1559) - t1561) + (t103 * t1492)) - t1565;
    const T t1568 = t252 * s7;
    const T t1573 = ((t1539 + t1568) - (s9 * t1489)) + (c9 * t1520);
    const T t1575 = ((((((t88 * t1539) - (t975 * t1541)) + t1545) + (t86 * t1435)) + t1550) + t1566) + (dq[4] * t1573);
    const T t1577 = ((((t1398 - (t803 * t1405)) + (t49 * t1415)) + (c7 * t1524)) - (dq[3] * t1532)) - (s7 * t1575);
    const T t1583 = (t1029 * pi[37]) + (t67 * t376);
    const T t1584 = pi[31] * t1411;
    const T t1588 = T(-0.099699999999999997) * t1366;
    const T t1589 = t1588 - pi[38];
    const T t1590 = t63 * t1589;
    const T t1592 = t1048 * t1420;
    const T t1595 = t86 * t1418;
    const T t1599 = t1048 * t1544;
    const T t1603 = t69 * t1549;
    const T t1606 = ((((((t1592 - (t1048 * t1541)) + t1595) + (t69 * t1539)) - t1599) - (t86 * t1440)) + t1603) + (t1048 * t1445);
    const T t1610 = (t1606 - (s9 * t1494)) + (c9 * t1522);
    const T t1612 = pi[38] + t1588;
    const T t1616 = (t1612 - (s7 * t1465)) + (c7 * t1573);
    const T t1618 = ((((t67 * t1415) - (t1583 + (t1029 * t1584))) + t1590) - t1610) + (dq[3] * t1616);
    const T t1620 = ((((((t1370 - (t777 * t1372)) - t1375) + (t31 * t1382)) - t1386) + t1392) + (c5 * t1577)) - (s5 * t1618);
    const T t1621 = t1389 - t1390;
    const T t1625 = (t1621 + (c5 * t1532)) + (s5 * t1616);
    const T t1627 = t1620 - (dq[2] * t1625);
    const T t1630 = T(0.1333) * t1352;
    const T t1631 = t1630 - t499;
    const T t1636 = (t62 * t1631) - ((t1087 * pi[27]) + (t42 * t481));
    const T t1639 = T(-0.39219999999999999) * t1357;
    const T t1641 = t1639 - (t539 * t1377);
    const T t1644 = t1087 * t1385;
    const T t1653 = (c5 * t1616) - (t1631 + (s5 * t1532));
    const T t1655 = (((((t1636 + (t42 * t1382)) + (t1087 * t1641)) - t1644) + (s5 * t1577)) + (c5 * t1618)) + (dq[2] * t1653);
    const T t1661 = ((c3 * t1625) - t1367) + (s3 * t1653);
    const T t1663 = ((((((t745 * pi[17]) - (t17 * t559)) + t1362) + t1368) + (c3 * t1627)) - (s3 * t1655)) - (dq[1] * t1661);
    const T t1667 = (s3 * t1353) + (c3 * t1358);
    const T t1673 = (c3 * t1653) - (s3 * t1625);
    const T t1674 = t573 + t1673;
    const T t1680 = pi[19] + t1661;
    const T t1683 = t24 * t1361;
    const T t1688 = T(-0.42499999999999999) * t1667;
    const T t1689 = t1145 * t1688;
    const T t1696 = ((((t1683 - ((t1145 * pi[17]) + (t24 * t559))) + t1689) + (s3 * t1627)) + (c3 * t1655)) + (dq[1] * t1673);
    const T t1700 = (c1 * (((dq[0] * t1663) - (T(9.8100000000000005) * (pi[12] + t1667))) + (ddq[0] * t1674))) - (s1 * (((T(9.8100000000000005) * (t677 + t1360)) + (ddq[0] * t1680)) + (dq[0] * t1696)));
    dtau_dq[7] = t1700;
    const T t1703 = t158 * t1353;
    const T t1705 = t164 * t1358;
    const T t1712 = (((((T(-0.42499999999999999) * t654) - t1703) - t1705) + (t17 * t1627)) - (t20 * t1625)) - (t24 * t1655);
    const T t1717 = t164 * t1353;
    const T t1719 = t158 * t1358;
    const T t1726 = (((((T(-0.42499999999999999) * t660) + t1717) - t1719) + (t24 * t1627)) + (t26 * t1625)) + (t17 * t1655);
    dtau_dq[8] = (c3 * (t1712 + (t26 * t1653))) - (s3 * (t1726 + (t20 * t1653)));
    const T t1735 = t173 * t1337;
    const T t1737 = t185 * t1350;
    const T t1744 = ((((((t448 * t1399) - (t457 * t1377)) - t1735) - t1737) - (t34 * t1532)) + (t31 * t1577)) - (t42 * t1618);
    const T t1751 = t185 * t1337;
    const T t1753 = t173 * t1350;
    const T t1760 = ((((((t448 * t1377) + (t457 * t1399)) + t1751) - t1753) + (t44 * t1532)) + (t42 * t1577)) + (t31 * t1618);
    dtau_dq[9] = (c5 * (t1744 + (t44 * t1616))) - (s5 * (t1760 + (t34 * t1616)));
    const T t1768 = t150 * t1341;
    const T t1770 = t191 * t1347;
    const T t1779 = ((((((t287 - (t351 * t1424)) - t1768) - t1770) - (t52 * t1465)) + (t63 * t1524)) - (t67 * t1575)) + (t59 * t1573);
    const T t1783 = t191 * t1341;
    const T t1785 = t150 * t1347;
    const T t1794 = ((((((t333 + (t343 * t1424)) - t1783) + t1785) + (t59 * t1465)) + (t67 * t1524)) + (t63 * t1575)) + (t52 * t1573);
    dtau_dq[10] = (c7 * t1779) - (s7 * t1794);
    const T t1798 = t310 * t1329;
    const T t1801 = t306 * t1331;
    const T t1805 = t218 * s7;
    const T t1812 = ((((((t1798 - (t229 * t1425)) - t1801) + (t224 * t1450)) - t1805) - (t72 * t1489)) - (t88 * t1494)) + (t86 * t1522);
    const T t1816 = t201 * s7;
    const T t1818 = t306 * t1329;
    const T t1820 = t310 * t1331;
    const T t1830 = (((t1816 - ((((t224 * t1425) + t1818) + t1820) + (t229 * t1450))) - (t81 * t1489)) + (t86 * t1494)) + (t88 * t1522);
    dtau_dq[11] = (c9 * (t1812 - (t81 * t1520))) - (s9 * (t1830 + (t72 * t1520)));
    dtau_dq[12] = T(0.0);
    const T t1839 = t31 * t1380;
    const T t1843 = T(-0.39219999999999999) * c5;
    const T t1845 = (t399 * t1843) + t1404;
    const T t1848 = pi[31] * t1843;
    const T t1849 = T(-0.39219999999999999) * s5;
    const T t1851 = (t399 * t1849) - t1413;
    const T t1852 = t1848 + t1851;
    const T t1855 = T(0.099699999999999997) + t1849;
    const T t1856 = c7 * t1855;
    const T t1859 = ((t277 * t1856) - t1427) - t1429;
    const T t1860 = s7 * t1855;
    const T t1862 = t1431 - (pi[41] * t1860);
    const T t1863 = t1859 + t1862;
    const T t1867 = (pi[41] * t1843) + t1439;
    const T t1871 = (t277 * t1860) - t1444;
    const T t1874 = t1449 - t1843;
    const T t1877 = (s9 * t1874) - (c9 * t1856);
    const T t1879 = (pi[52] * t1877) - t1455;
    const T t1883 = (s9 * t1856) + (c9 * t1874);
    const T t1885 = t1458 - (pi[51] * t1883);
    const T t1886 = (t1448 + t1879) + t1885;
    const T t1887 = t1867 + t1886;
    const T t1890 = pi[52] * t1883;
    const T t1895 = t1879 - t1885;
    const T t1899 = (pi[51] * t1860) + t1487;
    const T t1900 = t1485 + t1899;
    const T t1903 = t1485 - t1899;
    const T t1905 = (((((t1472 + (t904 * t1890)) + t1477) - t1480) + (t90 * t1895)) - (dq[5] * t1900)) + (t96 * t1903);
    const T t1908 = pi[51] * t1877;
    const T t1912 = (pi[52] * t1860) + t1505;
    const T t1913 = t1503 + t1912;
    const T t1921 = (t1503 - t1912) + t1519;
    const T t1923 = (((((t1499 + (t934 * t1908)) + (t96 * t1913)) + t1511) + (t103 * t1895)) - t1516) - (dq[5] * t1921);
    const T t1925 = (((((t1422 + (t69 * t1863)) - (t88 * t1867)) + (t840 * t1871)) - (dq[4] * t1887)) + (c9 * t1905)) + (s9 * t1923);
    const T t1932 = ((t1862 - t1859) - (c9 * t1900)) - (s9 * t1921);
    const T t1933 = pi[39] - t1932;
    const T t1938 = (t1535 - (t277 * t1843)) + t1538;
    const T t1940 = pi[41] * t1856;
    const T t1957 = (((((((t999 * t1890) + (t999 * t1908)) - t1555) + (t90 * t1913)) - t1559) - t1561) + (t103 * t1903)) - t1565;
    const T t1963 = ((t1938 + t1568) - (s9 * t1900)) + (c9 * t1921);
    const T t1965 = ((((((t88 * t1938) - (t975 * t1940)) + t1545) + (t86 * t1863)) + t1550) + t1957) + (dq[4] * t1963);
    const T t1967 = ((((t1398 - (t803 * t1845)) + (t49 * t1852)) + (c7 * t1925)) - (dq[3] * t1933)) - (s7 * t1965);
    const T t1971 = pi[31] * t1849;
    const T t1986 = ((((((t1592 - (t1048 * t1940)) + t1595) + (t69 * t1938)) - t1599) - (t86 * t1867)) + t1603) + (t1048 * t1871);
    const T t1990 = (t1986 - (s9 * t1905)) + (c9 * t1923);
    const T t1995 = (t1612 - (s7 * t1887)) + (c7 * t1963);
    const T t1997 = ((((t67 * t1852) - (t1583 + (t1029 * t1971))) + t1590) - t1990) + (dq[3] * t1995);
    const T t2003 = (t1621 + (c5 * t1933)) + (s5 * t1995);
    const T t2005 = ((((((t1370 - t1375) + t1839) - t1386) + t1392) + (c5 * t1967)) - (s5 * t1997)) - (dq[2] * t2003);
    const T t2008 = t42 * t1380;
    const T t2010 = t1087 * t1639;
    const T t2020 = (c5 * t1995) - (t1631 + (s5 * t1933));
    const T t2022 = (((((t1636 + t2008) + t2010) - t1644) + (s5 * t1967)) + (c5 * t1997)) + (dq[2] * t2020);
    const T t2028 = ((c3 * t2003) - t1367) + (s3 * t2020);
    const T t2030 = (((t1362 + t1368) + (c3 * t2005)) - (s3 * t2022)) - (dq[1] * t2028);
    const T t2036 = (c3 * t2020) - (s3 * t2003);
    const T t2049 = (((t1683 + t1689) + (s3 * t2005)) + (c3 * t2022)) + (dq[1] * t2036);
    const T t2053 = (c1 * (((dq[0] * t2030) - (T(9.8100000000000005) * t1667)) + (ddq[0] * t2036))) - (s1 * (((T(9.8100000000000005) * t1360) + (ddq[0] * t2028)) + (dq[0] * t2049)));
    dtau_dq[13] = t2053;
    const T t2075 = (c3 * (((((t17 * t2005) - (t1703 + t1705)) - (t20 * t2003)) - (t24 * t2022)) + (t26 * t2020))) - (s3 * (((((t1717 - t1719) + (t24 * t2005)) + (t26 * t2003)) + (t17 * t2022)) + (t20 * t2020)));
    dtau_dq[14] = t2075;
    const T t2085 = (((((T(-0.39219999999999999) * t448) - t1735) - t1737) - (t34 * t1933)) + (t31 * t1967)) - (t42 * t1997);
    const T t2097 = (((((T(-0.39219999999999999) * t457) + t1751) - t1753) + (t44 * t1933)) + (t42 * t1967)) + (t31 * t1997);
    dtau_dq[15] = (c5 * (t2085 + (t44 * t1995))) - (s5 * (t2097 + (t34 * t1995)));
    const T t2114 = ((((((t287 - (t351 * t1855)) - t1768) - t1770) - (t52 * t1887)) + (t63 * t1925)) - (t67 * t1965)) + (t59 * t1963);
    const T t2127 = ((((((t333 + (t343 * t1855)) - t1783) + t1785) + (t59 * t1887)) + (t67 * t1925)) + (t63 * t1965)) + (t52 * t1963);
    dtau_dq[16] = (c7 * t2114) - (s7 * t2127);
    const T t2142 = ((((((t1798 - (t229 * t1856)) - t1801) + (t224 * t1874)) - t1805) - (t72 * t1900)) - (t88 * t1905)) + (t86 * t1923);
    const T t2157 = (((t1816 - ((((t224 * t1856) + t1818) + t1820) + (t229 * t1874))) - (t81 * t1900)) + (t86 * t1905)) + (t88 * t1923);
    dtau_dq[17] = (c9 * (t2142 - (t81 * t1921))) - (s9 * (t2157 + (t72 * t1921)));
    dtau_dq[18] = T(0.0);
    const T t2166 = (c3 * t1352) - (s3 * t1357);
    const T t2167 = T(-0.42499999999999999) * t2166;
    const T t2171 = t1390 - t1388;
    const T t2178 = T(0.099699999999999997) * c7;
    const T t2181 = ((t277 * t2178) - t1427) - t1429;
    const T t2182 = T(-0.099699999999999997) * s7;
    const T t2184 = (pi[41] * t2182) + t1431;
    const T t2185 = t2181 + t2184;
    const T t2191 = (t277 * t2182) + t1444;
    const T t2196 = (s9 * t1449) - (c9 * t2178);
    const T t2198 = (pi[52] * t2196) - t1455;
    const T t2202 = (s9 * t2178) + (c9 * t1449);
    const T t2204 = t1458 - (pi[51] * t2202);
    const T t2205 = (t1448 + t2198) + t2204;
    const T t2206 = t1439 + t2205;
    const T t2209 = pi[52] * t2202;
    const T t2214 = t2198 - t2204;
    const T t2218 = (pi[51] * t2182) - t1487;
    const T t2219 = t2218 - t1485;
    const T t2222 = t1485 + t2218;
    const T t2224 = (((((t1472 + (t904 * t2209)) + t1477) - t1480) + (t90 * t2214)) + (dq[5] * t2219)) + (t96 * t2222);
    const T t2227 = pi[51] * t2196;
    const T t2231 = (pi[52] * t2182) - t1505;
    const T t2232 = t1503 - t2231;
    const T t2240 = (t1503 + t2231) + t1519;
    const T t2242 = (((((t1499 + (t934 * t2227)) + (t96 * t2232)) + t1511) + (t103 * t2214)) - t1516) - (dq[5] * t2240);
    const T t2244 = (((((t1422 + (t69 * t2185)) - (t88 * t1439)) - (t840 * t2191)) - (dq[4] * t2206)) + (c9 * t2224)) + (s9 * t2242);
    const T t2251 = ((t2184 - t2181) + (c9 * t2219)) - (s9 * t2240);
    const T t2252 = pi[39] - t2251;
    const T t2255 = t1535 + t1538;
    const T t2257 = pi[41] * t2178;
    const T t2274 = (((((((t999 * t2209) + (t999 * t2227)) - t1555) + (t90 * t2232)) - t1559) - t1561) + (t103 * t2222)) - t1565;
    const T t2280 = ((t2255 + t1568) + (s9 * t2219)) + (c9 * t2240);
    const T t2282 = ((((((t88 * t2255) - (t975 * t2257)) + t1545) + (t86 * t2185)) + t1550) + t2274) + (dq[4] * t2280);
    const T t2284 = ((((t1398 - (t803 * t1404)) - (t49 * t1413)) + (c7 * t2244)) - (dq[3] * t2252)) - (s7 * t2282);
    const T t2300 = ((((((t1592 - (t1048 * t2257)) + t1595) + (t69 * t2255)) - t1599) - (t86 * t1439)) + t1603) - (t1048 * t2191);
    const T t2304 = (t2300 - (s9 * t2224)) + (c9 * t2242);
    const T t2309 = (t1612 - (s7 * t2206)) + (c7 * t2280);
    const T t2311 = ((t1590 - (t1583 + (t67 * t1413))) - t2304) + (dq[3] * t2309);
    const T t2318 = ((c5 * t2252) - (t1388 + t1390)) + (s5 * t2309);
    const T t2320 = ((((t1839 - t1386) + (t62 * t2171)) + (c5 * t2284)) - (s5 * t2311)) - (dq[2] * t2318);
    const T t2334 = (c5 * t2309) - (t1630 + (s5 * t2252));
    const T t2336 = ((((((t62 * t1630) + t2008) + t2010) - t1644) + (s5 * t2284)) + (c5 * t2311)) + (dq[2] * t2334);
    const T t2342 = ((c3 * t2318) - t1367) + (s3 * t2334);
    const T t2344 = ((((t17 * t2167) + t1368) + (c3 * t2320)) - (s3 * t2336)) - (dq[1] * t2342);
    const T t2348 = (s3 * t1352) + (c3 * t1357);
    const T t2353 = (c3 * t2334) - (s3 * t2318);
    const T t2361 = T(-0.42499999999999999) * t2348;
    const T t2369 = ((((t24 * t2167) + (t1145 * t2361)) + (s3 * t2320)) + (c3 * t2336)) + (dq[1] * t2353);
    const T t2373 = (c1 * (((dq[0] * t2344) - (T(9.8100000000000005) * t2348)) + (ddq[0] * t2353))) - (s1 * (((T(9.8100000000000005) * t2166) + (ddq[0] * t2342)) + (dq[0] * t2369)));
    dtau_dq[19] = t2373;
    const T t2385 = ((((t17 * t2320) - ((t158 * t1352) + (t164 * t1357))) - (t20 * t2318)) - (t24 * t2336)) + (t26 * t2334);
    const T t2397 = (((((t164 * t1352) - (t158 * t1357)) + (t24 * t2320)) + (t26 * t2318)) + (t17 * t2336)) + (t20 * t2334);
    dtau_dq[20] = (c3 * t2385) - (s3 * t2397);
    const T t2421 = (c5 * ((((t31 * t2284) - ((t1735 + t1737) + (t34 * t2252))) - (t42 * t2311)) + (t44 * t2309))) - (s5 * (((((t1751 - t1753) + (t44 * t2252)) + (t42 * t2284)) + (t31 * t2311)) + (t34 * t2309)));
    dtau_dq[21] = t2421;
    const T t2432 = (((((t287 + (T(-0.099699999999999997) * t351)) - t1768) - t1770) - (t52 * t2206)) + (t63 * t2244)) - (t67 * t2282);
    const T t2445 = (((((t333 + (T(0.099699999999999997) * t343)) - t1783) + t1785) + (t59 * t2206)) + (t67 * t2244)) + (t63 * t2282);
    dtau_dq[22] = (c7 * (t2432 + (t59 * t2280))) - (s7 * (t2445 + (t52 * t2280)));
    const T t2462 = ((((((t1798 - (t229 * t2178)) - t1801) + (t224 * t1449)) - t1805) + (t72 * t2219)) - (t88 * t2224)) + (t86 * t2242);
    const T t2477 = (((t1816 - ((((t224 * t2178) + t1818) + t1820) + (t229 * t1449))) + (t81 * t2219)) + (t86 * t2224)) + (t88 * t2242);
    dtau_dq[23] = (c9 * (t2462 - (t81 * t2240))) - (s9 * (t2477 + (t72 * t2240)));
    dtau_dq[24] = T(0.0);
    const T t2487 = (pi[51] * c9) - (pi[52] * s9);
    const T t2488 = pi[41] + t2487;
    const T t2490 = (c7 * t277) + (s7 * t2488);
    const T t2491 = s5 * t2490;
    const T t2493 = c5 * t2490;
    const T t2495 = (s3 * t2491) - (c3 * t2493);
    const T t2499 = (c7 * t2488) - (s7 * t277);
    const T t2500 = T(-0.42499999999999999) * t2499;
    const T t2504 = (c3 * t2491) + (s3 * t2493);
    const T t2505 = T(-0.42499999999999999) * t2504;
    const T t2508 = T(-0.39219999999999999) * t2499;
    const T t2509 = T(0.1333) * t2493;
    const T t2510 = t2508 - t2509;
    const T t2512 = T(-0.39219999999999999) * t2491;
    const T t2514 = T(0.1333) * t2499;
    const T t2523 = T(0.099599999999999994) * t2487;
    const T t2526 = T(0.099599999999999994) * c9;
    const T t2529 = (pi[52] * t2526) - (pi[59] * c9);
    const T t2530 = T(0.099599999999999994) * s9;
    const T t2533 = (pi[51] * t2530) - (pi[58] * s9);
    const T t2534 = t2529 + t2533;
    const T t2535 = pi[49] + t2534;
    const T t2538 = pi[58] * c9;
    const T t2540 = pi[52] * t2530;
    const T t2543 = t203 * c9;
    const T t2546 = t2529 - t2533;
    const T t2549 = pi[57] * s9;
    const T t2553 = (((((t904 * t2538) - (t904 * t2540)) - (t96 * t2543)) + (t90 * t2546)) + (dq[5] * t2549)) + (t96 * t2549);
    const T t2555 = (((((t840 * pi[47]) - (t69 * t252)) + (t88 * pi[49])) - (t840 * t2523)) - (dq[4] * t2535)) + (c9 * t2553);
    const T t2556 = pi[51] * t2526;
    const T t2558 = pi[57] * c9;
    const T t2561 = pi[59] * s9;
    const T t2566 = pi[56] * s9;
    const T t2570 = t2558 + (t12 * s9);
    const T t2572 = (((((t934 * t2556) + (t96 * t2558)) - (t934 * t2561)) + (t103 * t2546)) + (t96 * t2566)) + (dq[5] * t2570);
    const T t2574 = t2555 + (s9 * t2572);
    const T t2576 = T(-0.099699999999999997) * t2490;
    const T t2582 = (t255 + (c9 * t2549)) + (s9 * t2570);
    const T t2595 = (((((t999 * t2556) - (t999 * t2540)) - (t999 * t2538)) + (t90 * t2558)) - (t103 * t2543)) + (t999 * t2561);
    const T t2596 = t103 * t2549;
    const T t2599 = (t2595 + t2596) + (t90 * t2566);
    const T t2609 = (pi[48] + (s9 * t2549)) - (c9 * t2570);
    const T t2611 = (t2599 - (((t975 * pi[47]) + (t86 * t252)) + (t88 * pi[48]))) + (dq[4] * t2609);
    const T t2613 = (((c7 * t2574) - (t49 * t2576)) + (dq[3] * t2582)) - (s7 * t2611);
    const T t2616 = T(-0.099699999999999997) * t2499;
    const T t2628 = ((((t86 * pi[49]) - (t69 * pi[48])) - (t1048 * t2523)) - (s9 * t2553)) + (c9 * t2572);
    const T t2633 = (t2616 - (s7 * t2535)) + (c7 * t2609);
    const T t2635 = (((t63 * t2616) - (t67 * t2576)) - t2628) + (dq[3] * t2633);
    const T t2642 = (s5 * t2633) - ((t2509 + t2508) + (c5 * t2582));
    const T t2644 = ((((t62 * t2510) - ((t31 * t2512) + (t777 * t2514))) + (c5 * t2613)) - (s5 * t2635)) - (dq[2] * t2642);
    const T t2647 = T(-0.39219999999999999) * t2493;
    const T t2649 = T(0.1333) * t2491;
    const T t2659 = ((((t1087 * t2647) - ((t62 * t2649) + (t42 * t2512))) - (t1087 * t2514)) + (s5 * t2613)) + (c5 * t2635);
    const T t2663 = (t2649 + (s5 * t2582)) + (c5 * t2633);
    const T t2665 = t2659 + (dq[2] * t2663);
    const T t2671 = ((c3 * t2642) - t2500) + (s3 * t2663);
    const T t2673 = ((((dq[1] * t2500) - (t17 * t2505)) + (c3 * t2644)) - (s3 * t2665)) - (dq[1] * t2671);
    const T t2678 = (c3 * t2663) - (s3 * t2642);
    const T t2687 = T(-0.42499999999999999) * t2495;
    const T t2694 = (((s3 * t2644) - ((t24 * t2505) + (t1145 * t2687))) + (c3 * t2665)) + (dq[1] * t2678);
    const T t2698 = (c1 * (((T(9.8100000000000005) * t2495) + (dq[0] * t2673)) + (ddq[0] * t2678))) - (s1 * (((ddq[0] * t2671) - (T(9.8100000000000005) * t2504)) + (dq[0] * t2694)));
    dtau_dq[25] = t2698;
    const T t2710 = (((((t158 * t2491) - (t164 * t2493)) + (t17 * t2644)) - (t20 * t2642)) - (t24 * t2665)) + (t26 * t2663);
    const T t2722 = ((((t24 * t2644) - ((t164 * t2491) + (t158 * t2493))) + (t26 * t2642)) + (t17 * t2665)) + (t20 * t2663);
    dtau_dq[26] = (c3 * t2710) - (s3 * t2722);
    const T t2746 = (c5 * (((((t34 * t2582) - (t185 * t2490)) + (t31 * t2613)) - (t42 * t2635)) + (t44 * t2633))) - (s5 * ((((t42 * t2613) - ((t173 * t2490) + (t44 * t2582))) + (t31 * t2635)) + (t34 * t2633)));
    dtau_dq[27] = t2746;
    const T t2758 = (((t63 * t2574) - (((t150 * t277) + (t191 * t2488)) + (t52 * t2535))) - (t67 * t2611)) + (t59 * t2609);
    const T t2770 = (((((t150 * t2488) - (t191 * t277)) + (t59 * t2535)) + (t67 * t2574)) + (t63 * t2611)) + (t52 * t2609);
    dtau_dq[28] = (c7 * t2758) - (s7 * t2770);
    const T t2783 = (((((T(0.099599999999999994) * t229) - t201) + (t72 * t2549)) - (t88 * t2553)) + (t86 * t2572)) + (t81 * t2570);
    const T t2794 = (((((T(0.099599999999999994) * t224) - t218) + (t81 * t2549)) + (t86 * t2553)) + (t88 * t2572)) - (t72 * t2570);
    dtau_dq[29] = (c9 * t2783) - (s9 * t2794);
    dtau_dq[30] = T(0.0);
    const T t2801 = (s9 * pi[52]) - (c9 * pi[51]);
    const T t2805 = (c9 * pi[52]) + (s9 * pi[51]);
    const T t2806 = c7 * t2805;
    const T t2808 = (c5 * t2801) + (s5 * t2806);
    const T t2812 = (s5 * t2801) - (c5 * t2806);
    const T t2814 = (s3 * t2808) + (c3 * t2812);
    const T t2818 = (s3 * t2812) - (c3 * t2808);
    const T t2819 = T(-0.42499999999999999) * t2818;
    const T t2821 = s7 * t2805;
    const T t2822 = T(-0.42499999999999999) * t2821;
    const T t2825 = T(0.1333) * t2821;
    const T t2827 = T(-0.39219999999999999) * t2808;
    const T t2830 = T(0.1333) * t2812;
    const T t2831 = T(-0.39219999999999999) * t2821;
    const T t2832 = t2830 - t2831;
    const T t2835 = T(-0.099699999999999997) * t2801;
    const T t2837 = T(-0.099699999999999997) * t2806;
    const T t2846 = (((t904 * pi[57]) + (t90 * t12)) - (dq[5] * pi[59])) + (t96 * pi[59]);
    const T t2848 = T(0.099599999999999994) * t2805;
    const T t2859 = (((t103 * t12) - (t934 * pi[57])) + (t96 * pi[58])) - (dq[5] * pi[58]);
    const T t2861 = ((c9 * t2846) - ((t69 * t2848) + (dq[4] * pi[56]))) + (s9 * t2859);
    const T t2867 = (t2848 - (c9 * pi[59])) - (s9 * pi[58]);
    const T t2870 = T(0.099599999999999994) * t2801;
    const T t2881 = (t2870 - (s9 * pi[59])) + (c9 * pi[58]);
    const T t2883 = (((t88 * t2870) - (t86 * t2848)) + ((t90 * pi[58]) + (t103 * pi[59]))) + (dq[4] * t2881);
    const T t2885 = ((((t803 * t2835) - (t49 * t2837)) + (c7 * t2861)) + (dq[3] * t2867)) - (s7 * t2883);
    const T t2889 = T(-0.099699999999999997) * t2821;
    const T t2892 = (c7 * t2881) - (t2889 + (s7 * pi[56]));
    const T t2901 = ((t69 * t2870) - (s9 * t2846)) + (c9 * t2859);
    const T t2903 = (dq[3] * t2892) - (((t67 * t2837) + (t63 * t2889)) + t2901);
    const T t2910 = ((t2830 + t2831) - (c5 * t2867)) + (s5 * t2892);
    const T t2912 = (((((t777 * t2825) - (t31 * t2827)) + (t62 * t2832)) + (c5 * t2885)) - (s5 * t2903)) - (dq[2] * t2910);
    const T t2916 = T(0.1333) * t2808;
    const T t2920 = T(-0.39219999999999999) * t2812;
    const T t2927 = (((t1087 * t2825) - (((t62 * t2916) + (t42 * t2827)) + (t1087 * t2920))) + (s5 * t2885)) + (c5 * t2903);
    const T t2931 = (t2916 + (s5 * t2867)) + (c5 * t2892);
    const T t2933 = t2927 + (dq[2] * t2931);
    const T t2939 = (t2822 + (c3 * t2910)) + (s3 * t2931);
    const T t2941 = ((((t17 * t2819) - (dq[1] * t2822)) + (c3 * t2912)) - (s3 * t2933)) - (dq[1] * t2939);
    const T t2946 = (c3 * t2931) - (s3 * t2910);
    const T t2954 = T(-0.42499999999999999) * t2814;
    const T t2962 = ((((t24 * t2819) - (t1145 * t2954)) + (s3 * t2912)) + (c3 * t2933)) + (dq[1] * t2946);
    const T t2966 = (c1 * (((T(9.8100000000000005) * t2814) + (dq[0] * t2941)) + (ddq[0] * t2946))) - (s1 * (((T(9.8100000000000005) * t2818) + (ddq[0] * t2939)) + (dq[0] * t2962)));
    dtau_dq[31] = t2966;
    const T t2978 = (((((t158 * t2808) + (t164 * t2812)) + (t17 * t2912)) - (t20 * t2910)) - (t24 * t2933)) + (t26 * t2931);
    const T t2990 = (((((t158 * t2812) - (t164 * t2808)) + (t24 * t2912)) + (t26 * t2910)) + (t17 * t2933)) + (t20 * t2931);
    dtau_dq[32] = (c3 * t2978) - (s3 * t2990);
    const T t3004 = (((((t173 * t2801) - (t185 * t2806)) + (t34 * t2867)) + (t31 * t2885)) - (t42 * t2903)) + (t44 * t2892);
    const T t3016 = (((t42 * t2885) - (((t185 * t2801) + (t173 * t2806)) + (t44 * t2867))) + (t31 * t2903)) + (t34 * t2892);
    dtau_dq[33] = (c5 * t3004) - (s5 * t3016);
    const T t3040 = (c7 * ((((t63 * t2861) - ((t150 * t2805) + (t52 * pi[56]))) - (t67 * t2883)) + (t59 * t2881))) - (s7 * (((((t59 * pi[56]) - (t191 * t2805)) + (t67 * t2861)) + (t63 * t2883)) + (t52 * t2881)));
    dtau_dq[34] = t3040;
    const T t3052 = (((((t310 * pi[52]) - (t306 * pi[51])) - (t72 * pi[59])) - (t88 * t2846)) + (t86 * t2859)) - (t81 * pi[58]);
    const T t3064 = (((t86 * t2846) - (((t306 * pi[52]) + (t310 * pi[51])) + (t81 * pi[59]))) + (t88 * t2859)) + (t72 * pi[58]);
    dtau_dq[35] = (c9 * t3052) - (s9 * t3064);
    dtau_dv[0] = (s1 * t1127) + (c1 * t1162);
    const T t3072 = dq[1] + dq[1];
    const T t3083 = (((((t3072 * t746) + (t17 * t1130)) + (t24 * t743)) - (t3072 * t1146)) + (t17 * t1149)) - (t3072 * t1154);
    const T t3086 = t62 + t62;
    const T t3097 = (((((t3086 * t778) + (t42 * t775)) - (t3086 * t1088)) + (t31 * t1090)) + (t31 * t1097)) - (t3086 * t1102);
    const T t3100 = t63 + t63;
    const T t3111 = (((((t3100 * t804) - (t3100 * t1032)) + (t67 * t801)) - (t3100 * t1030)) - (t67 * t811)) + (t49 * t1035);
    const T t3119 = (((t3111 + (t3100 * t821)) + (t49 * t1044)) + (s7 * t962)) + (c7 * t1024);
    const T t3120 = (t3097 + (t42 * t798)) + t3119;
    dtau_dv[1] = (((t3083 + (t24 * t772)) + t3120) - (t24 * t1125)) + (t17 * t1136);
    dtau_dv[2] = (t3120 - (t42 * t1082)) + (t31 * t1117);
    dtau_dv[3] = (t3119 - (t67 * t972)) + (t49 * t1073);
    dtau_dv[4] = (t1066 - (t86 * t901)) + (t69 * t1022);
    dtau_dv[5] = ((t103 * t926) + t1014) - (t90 * t958);
    dtau_dv[6] = (s1 * t1663) + (c1 * t1696);
    const T t3152 = t24 * t1367;
    const T t3153 = (t3072 * t1688) + t3152;
    const T t3154 = t31 * t1631;
    const T t3159 = t42 * t1391;
    const T t3161 = t67 * pi[39];
    const T t3166 = t49 * t1589;
    const T t3171 = ((((t3161 - (t3100 * t1584)) - (t3100 * t1405)) + t3166) + (s7 * t1524)) + (c7 * t1575);
    const T t3172 = (((t3154 - (t3086 * t1372)) + (t3086 * t1641)) + t3159) + t3171;
    dtau_dv[7] = ((t3153 + t3172) - (t24 * t1661)) + (t17 * t1673);
    dtau_dv[8] = (t3172 - (t42 * t1625)) + (t31 * t1653);
    dtau_dv[9] = (t3171 - (t67 * t1532)) + (t49 * t1616);
    dtau_dv[10] = (t1610 - (t86 * t1465)) + (t69 * t1573);
    dtau_dv[11] = (t1566 - (t103 * t1489)) - (t90 * t1520);
    dtau_dv[12] = (s1 * t2030) + (c1 * t2049);
    const T t3203 = t3086 * t1639;
    const T t3214 = ((((t3161 - (t3100 * t1971)) - (t3100 * t1845)) + t3166) + (s7 * t1925)) + (c7 * t1965);
    const T t3215 = ((t3154 + t3203) + t3159) + t3214;
    dtau_dv[13] = ((t3153 + t3215) - (t24 * t2028)) + (t17 * t2036);
    dtau_dv[14] = (t3215 - (t42 * t2003)) + (t31 * t2020);
    dtau_dv[15] = (t3214 - (t67 * t1933)) + (t49 * t1995);
    dtau_dv[16] = (t1990 - (t86 * t1887)) + (t69 * t1963);
    dtau_dv[17] = (t1957 - (t103 * t1900)) - (t90 * t1921);
    dtau_dv[18] = (s1 * t2344) + (c1 * t2369);
    const T t3258 = (((t3161 - (t3100 * t1404)) + t3166) + (s7 * t2244)) + (c7 * t2282);
    const T t3259 = (((t31 * t1630) + t3203) + (t42 * t2171)) + t3258;
    dtau_dv[19] = ((((t3072 * t2361) + t3152) + t3259) - (t24 * t2342)) + (t17 * t2353);
    dtau_dv[20] = (t3259 - (t42 * t2318)) + (t31 * t2334);
    dtau_dv[21] = (t3258 - (t67 * t2252)) + (t49 * t2309);
    dtau_dv[22] = (t2304 - (t86 * t2206)) + (t69 * t2280);
    dtau_dv[23] = ((t103 * t2219) + t2274) - (t90 * t2240);
    dtau_dv[24] = (s1 * t2673) + (c1 * t2694);
    const T t3302 = ((t49 * t2616) + (s7 * t2574)) + (c7 * t2611);
    const T t3303 = (((t3086 * t2647) - (t31 * t2649)) + (t42 * t2510)) + t3302;
    dtau_dv[25] = ((((t24 * t2500) - (t3072 * t2687)) + t3303) - (t24 * t2671)) + (t17 * t2678);
    dtau_dv[26] = (t3303 - (t42 * t2642)) + (t31 * t2663);
    dtau_dv[27] = ((t67 * t2582) + t3302) + (t49 * t2633);
    dtau_dv[28] = (t2628 - (t86 * t2535)) + (t69 * t2609);
    dtau_dv[29] = (t2596 + t2599) + (t90 * t2570);
    dtau_dv[30] = (s1 * t2941) + (c1 * t2962);
    const T t3344 = (((t3100 * t2835) - (t49 * t2889)) + (s7 * t2861)) + (c7 * t2883);
    const T t3345 = ((t42 * t2832) - ((t31 * t2916) + (t3086 * t2920))) + t3344;
    dtau_dv[31] = ((t3345 - ((t3072 * t2954) + (t24 * t2822))) - (t24 * t2939)) + (t17 * t2946);
    dtau_dv[32] = (t3345 - (t42 * t2910)) + (t31 * t2931);
    dtau_dv[33] = ((t67 * t2867) + t3344) + (t49 * t2892);
    dtau_dv[34] = (t2901 - (t86 * pi[56])) + (t69 * t2881);
    dtau_dv[35] = T(0.0);
    dtau_da[0] = (t608 + (c1 * t1125)) + (s1 * t1136);
    const T t3382 = ((t826 - t834) + (c7 * t901)) + (s7 * t1022);
    const T t3383 = (t784 + t783) + t3382;
    dtau_da[1] = (t755 + t754) + t3383;
    dtau_da[2] = t3383;
    dtau_da[3] = t3382;
    dtau_da[4] = t971;
    dtau_da[5] = t899;
    dtau_da[6] = (c1 * t1680) + (s1 * t1674);
    const T t3402 = (((t379 + t1408) - t1414) + (c7 * t1465)) + (s7 * t1573);
    const T t3403 = ((t489 - t1378) + t1381) + t3402;
    dtau_da[7] = (t562 + t1361) + t3403;
    dtau_da[8] = t3403;
    dtau_da[9] = t3402;
    dtau_da[10] = t1531;
    dtau_da[11] = t1464;
    dtau_da[12] = (c1 * t2028) + (s1 * t2036);
    const T t3420 = (((t379 + t1848) - t1851) + (c7 * t1887)) + (s7 * t1963);
    const T t3421 = (t489 + t1380) + t3420;
    dtau_da[13] = t1361 + t3421;
    dtau_da[14] = t3421;
    dtau_da[15] = t3420;
    dtau_da[16] = t1932;
    dtau_da[17] = t1886;
    dtau_da[18] = (c1 * t2342) + (s1 * t2353);
    const T t3436 = ((t379 + t1413) + (c7 * t2206)) + (s7 * t2280);
    const T t3437 = t1380 + t3436;
    dtau_da[19] = t2167 + t3437;
    dtau_da[20] = t3437;
    dtau_da[21] = t3436;
    dtau_da[22] = t2251;
    dtau_da[23] = t2205;
    dtau_da[24] = (c1 * t2671) + (s1 * t2678);
    const T t3451 = (t2576 + (c7 * t2535)) + (s7 * t2609);
    const T t3452 = t3451 - t2512;
    dtau_da[25] = t3452 - t2505;
    dtau_da[26] = t3452;
    dtau_da[27] = t3451;
    dtau_da[28] = t2582;
    dtau_da[29] = t2534;
    dtau_da[30] = (c1 * t2939) + (s1 * t2946);
    const T t3466 = (t2837 + (c7 * pi[56])) + (s7 * t2881);
    const T t3467 = t3466 - t2827;
    dtau_da[31] = t2819 + t3467;
    dtau_da[32] = t3467;
    dtau_da[33] = t3466;
    dtau_da[34] = t2867;
    dtau_da[35] = pi[56];
}

template <typename T>
SYMGEN_BOTH void torque_derivatives_at(long long i, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> pi_, symgen_array<T> tau_, symgen_array<T> dtau_dq_, symgen_array<T> dtau_dv_, symgen_array<T> dtau_da_)
{
    T q[6];
    symgen_load<6>(q, q_, i);
    T dq[6];
    symgen_load<6>(dq, dq_, i);
    T ddq[6];
    symgen_load<6>(ddq, ddq_, i);
    const symgen_sample<T> pi = {pi_.data + i * pi_.sample, pi_.entry};
    T tau_of[6], dtau_dq_of[36], dtau_dv_of[36], dtau_da_of[36];
    torque_derivatives(q, dq, ddq, pi, tau_of, dtau_dq_of, dtau_dv_of, dtau_da_of);
    symgen_store<6>(tau_, i, tau_of);
    symgen_store<36>(dtau_dq_, i, dtau_dq_of);
    symgen_store<36>(dtau_dv_, i, dtau_dv_of);
    symgen_store<36>(dtau_da_, i, dtau_da_of);
}

/* Of the loss on many parameter vectors: 139 nonzeros of sqrt(W) Y_b, then sqrt(W) tau, joint by joint,
 * and zeros up to a multiple of four numbers. */
enum { ROW = 148, BASE = 36, TILE = 20 };

template <typename T>
SYMGEN_BOTH void weighted_row(const T *q, const T *dq, const T *ddq, const T *tau, const T *weight, T *row)
{
    T root[6];
    SYMGEN_UNROLL
    for (int j = 0; j < 6; ++j) {
        root[j] = sqrt(weight[j]);
        row[139 + j] = root[j] * tau[j];
    }
    SYMGEN_UNROLL
    for (int k = 145; k < ROW; ++k) {
        row[k] = T(0.0);
    }
    row[0] = root[0] * (ddq[0]);
    T s7, c7;
    symgen_turn(q[1], s7, c7);
    const T t9 = s7 * dq[0];
    const T t12 = (dq[1] * t9) * c7;
    const T t13 = s7 * ddq[0];
    const T t14 = c7 * dq[0];
    const T t15 = t14 * dq[1];
    const T t16 = t13 + t15;
    row[1] = root[0] * (t12 + (t16 * s7));
    row[2] = root[0] * ((t15 * s7) - t12);
    const T t25 = t9 * dq[1];
    const T t26 = c7 * ddq[0];
    const T t27 = t26 - t25;
    const T t28 = t25 - t27;
    row[3] = root[0] * (((t15 + t16) * c7) - (t28 * s7));
    const T t32 = dq[1] * dq[1];
    const T t33 = t9 * t9;
    const T t36 = t9 * t14;
    const T t38 = t36 + ddq[1];
    row[4] = root[0] * (((t32 - t33) * c7) + (t38 * s7));
    const T t42 = t14 * t14;
    row[5] = root[0] * (((t42 - t32) * s7) - ((t36 - ddq[1]) * c7));
    T s50, c50;
    symgen_turn(q[2], s50, c50);
    const T t54 = (c50 * t9) + (s50 * t14);
    const T t56 = dq[1] + dq[2];
    const T t57 = t54 * t56;
    const T t62 = ((c50 * t27) - (s50 * t16)) - (t54 * dq[2]);
    const T t63 = t57 - t62;
    const T t65 = T(-0.42499999999999999) * c7;
    const T t67 = T(-0.42499999999999999) * t28;
    const T t70 = (c50 * c7) - (s50 * s7);
    row[6] = root[0] * (-((t63 * t65) + (t67 * t70)));
    const T t77 = (s50 * c7) + (c50 * s7);
    const T t81 = (c50 * t14) - (s50 * t9);
    const T t82 = t81 * t56;
    const T t87 = ((c50 * t16) + (s50 * t27)) + (t81 * dq[2]);
    const T t88 = t82 + t87;
    row[7] = root[0] * ((t67 * t77) - (t88 * t65));
    const T t93 = (t56 * t54) * t70;
    row[8] = root[0] * (t93 + (t87 * t77));
    row[9] = root[0] * ((t82 * t77) - t93);
    row[10] = root[0] * ((t88 * t70) - (t63 * t77));
    const T t104 = t56 * t56;
    const T t105 = t54 * t54;
    const T t108 = t54 * t81;
    const T t110 = ddq[1] + ddq[2];
    const T t111 = t108 + t110;
    row[11] = root[0] * (((t104 - t105) * t70) + (t111 * t77));
    const T t115 = t81 * t81;
    const T t118 = t108 - t110;
    row[12] = root[0] * (((t115 - t104) * t77) - (t118 * t70));
    T s123, c123;
    symgen_turn(q[3], s123, c123);
    const T t127 = (c123 * t54) + (s123 * t81);
    const T t129 = t56 + dq[3];
    const T t130 = t127 * t129;
    const T t135 = ((c123 * t62) - (s123 * t87)) - (t127 * dq[3]);
    const T t136 = t130 - t135;
    const T t139 = t65 + (T(-0.39219999999999999) * t70);
    const T t143 = (c123 * t81) - (s123 * t54);
    const T t144 = t127 * t143;
    const T t146 = t110 + ddq[3];
    const T t147 = t144 + t146;
    const T t149 = T(0.1333) * t70;
    const T t151 = T(0.1333) * t77;
    const T t153 = (s123 * t149) + (c123 * t151);
    const T t156 = t143 * t143;
    const T t157 = t129 * t129;
    const T t158 = t156 + t157;
    const T t161 = (c123 * t149) - (s123 * t151);
    const T t168 = t67 + ((T(-0.39219999999999999) * t63) - (T(0.1333) * (t105 + t115)));
    const T t171 = (c123 * t70) - (s123 * t77);
    row[13] = root[0] * (-((((t136 * t139) + (t147 * t153)) + (t158 * t161)) + (t168 * t171)));
    const T t176 = t127 * t127;
    const T t177 = t176 + t157;
    const T t179 = t143 * t129;
    const T t184 = ((c123 * t87) + (s123 * t62)) + (t143 * dq[3]);
    const T t185 = t179 + t184;
    const T t188 = t144 - t146;
    const T t193 = (s123 * t70) + (c123 * t77);
    row[14] = root[0] * ((((t177 * t153) - (t185 * t139)) + (t188 * t161)) + (t168 * t193));
    const T t198 = (t129 * t127) * t171;
    row[15] = root[0] * (t198 + (t184 * t193));
    row[16] = root[0] * ((t179 * t193) - t198);
    row[17] = root[0] * ((t185 * t171) - (t136 * t193));
    row[18] = root[0] * (((t157 - t176) * t171) + (t147 * t193));
    row[19] = root[0] * (((t156 - t157) * t193) - (t188 * t171));
    T s220, c220;
    symgen_turn(q[4], s220, c220);
    const T t224 = (c220 * t127) + (s220 * t129);
    const T t226 = dq[4] - t143;
    const T t227 = t224 * t226;
    const T t232 = ((c220 * t146) - (s220 * t184)) - (t224 * dq[4]);
    const T t233 = t227 - t232;
    const T t237 = t168 + (T(-0.099699999999999997) * t185);
    const T t240 = T(9.8100000000000005) * s7;
    const T t243 = t240 - (T(-0.42499999999999999) * (t42 + t32));
    const T t245 = T(9.8100000000000005) * c7;
    const T t247 = t245 + (T(-0.42499999999999999) * t38);
    const T t249 = (c50 * t243) + (s50 * t247);
    const T t250 = t57 + t62;
    const T t252 = t115 + t104;
    const T t255 = t249 + ((T(0.1333) * t250) - (T(-0.39219999999999999) * t252));
    const T t259 = (c50 * t247) - (s50 * t243);
    const T t261 = t82 - t87;
    const T t264 = t259 + ((T(-0.39219999999999999) * t111) + (T(0.1333) * t261));
    const T t266 = (c123 * t255) + (s123 * t264);
    const T t268 = t266 + (T(-0.099699999999999997) * t188);
    const T t270 = (c220 * t237) - (s220 * t268);
    const T t275 = (c220 * t129) - (s220 * t127);
    const T t276 = t224 * t275;
    const T t278 = ddq[4] - t135;
    const T t279 = t276 + t278;
    const T t281 = (T(-0.099699999999999997) * t193) - t139;
    const T t284 = (c220 * t281) - (s220 * t161);
    const T t287 = t275 * t275;
    const T t288 = t226 * t226;
    const T t289 = t287 + t288;
    const T t292 = (c220 * t161) + (s220 * t281);
    const T t297 = (c123 * t264) - (s123 * t255);
    const T t299 = t297 - (T(-0.099699999999999997) * t177);
    const T t300 = s220 * t193;
    row[20] = root[0] * (((((t233 * t153) - (t270 * t171)) + (t279 * t284)) - (t289 * t292)) - (t299 * t300));
    const T t304 = t275 * t226;
    const T t309 = ((c220 * t184) + (s220 * t146)) + (t275 * dq[4]);
    const T t310 = t304 + t309;
    const T t314 = (c220 * t268) + (s220 * t237);
    const T t317 = t224 * t224;
    const T t318 = t317 + t288;
    const T t321 = t276 - t278;
    const T t324 = c220 * t193;
    row[21] = root[0] * (((((t310 * t153) + (t314 * t171)) - (t318 * t284)) + (t321 * t292)) - (t299 * t324));
    const T t329 = t226 * t224;
    const T t330 = t329 * t300;
    row[22] = root[0] * (((t276 * t171) - t330) + (t309 * t324));
    row[23] = root[0] * ((t330 - (t278 * t171)) + (t304 * t324));
    const T t340 = t317 - t287;
    row[24] = root[0] * (-(((t340 * t171) + (t310 * t300)) + (t233 * t324)));
    const T t348 = t304 - t309;
    const T t350 = t288 - t317;
    row[25] = root[0] * (((t348 * t171) - (t350 * t300)) + (t279 * t324));
    const T t357 = t227 + t232;
    const T t360 = t287 - t288;
    row[26] = root[0] * (((t321 * t300) - (t357 * t171)) + (t360 * t324));
    T s365, c365;
    symgen_turn(q[5], s365, c365);
    const T t369 = (c365 * t224) - (s365 * t226);
    const T t371 = t275 + dq[5];
    const T t372 = t369 * t371;
    const T t377 = ((s365 * t309) + (c365 * t278)) + (t369 * dq[5]);
    const T t378 = t372 + t377;
    const T t382 = t314 + (T(0.099599999999999994) * t321);
    const T t385 = (T(0.099599999999999994) * t310) - t299;
    const T t387 = (s365 * t382) + (c365 * t385);
    const T t391 = t232 + ddq[5];
    const T t394 = (s365 * t224) + (c365 * t226);
    const T t395 = t369 * t394;
    const T t396 = t391 - t395;
    const T t398 = (T(0.099599999999999994) * t171) + t292;
    const T t401 = t153 + (T(0.099599999999999994) * t324);
    const T t403 = (s365 * t398) + (c365 * t401);
    const T t406 = t394 * t394;
    const T t407 = t371 * t371;
    const T t408 = t406 + t407;
    const T t411 = (s365 * t401) - (c365 * t398);
    const T t415 = t270 - (T(0.099599999999999994) * t318);
    const T t418 = (c365 * t171) - (s365 * t324);
    row[27] = root[0] * (((((t378 * t284) + (t387 * t300)) - (t396 * t403)) + (t408 * t411)) - (t415 * t418));
    const T t426 = ((c365 * t309) - (s365 * t278)) - (t394 * dq[5]);
    const T t427 = t394 * t371;
    const T t428 = t426 - t427;
    const T t432 = (c365 * t382) - (s365 * t385);
    const T t435 = t369 * t369;
    const T t436 = t435 + t407;
    const T t439 = t395 + t391;
    const T t444 = (s365 * t171) + (c365 * t324);
    row[28] = root[0] * (((((t428 * t284) + (t432 * t300)) + (t436 * t403)) + (t439 * t411)) + (t415 * t444));
    const T t448 = t371 * t369;
    const T t449 = t448 * t418;
    row[29] = root[0] * ((t449 - (t395 * t300)) + (t426 * t444));
    row[30] = root[0] * (-(((t391 * t300) + t449) + (t427 * t444)));
    const T t462 = t435 - t406;
    row[31] = root[0] * (((t428 * t418) - (t462 * t300)) - (t378 * t444));
    const T t468 = t407 - t435;
    const T t470 = t427 + t426;
    row[32] = root[0] * (((t468 * t418) - (t470 * t300)) + (t396 * t444));
    const T t477 = t372 - t377;
    const T t480 = t406 - t407;
    row[33] = root[0] * (((t439 * t418) - (t477 * t300)) + (t480 * t444));
    row[34] = root[1] * (t245);
    row[35] = root[1] * (-t240);
    row[36] = root[1] * (-t36);
    row[37] = root[1] * (ddq[1]);
    row[38] = root[1] * (t33 - t42);
    row[39] = root[1] * (t13);
    row[40] = root[1] * (t26);
    const T t495 = T(-0.42499999999999999) * c50;
    const T t497 = T(-0.42499999999999999) * s50;
    row[41] = root[1] * (((t111 * t495) - (t252 * t497)) + t259);
    row[42] = root[1] * (((t118 * t497) - ((t105 + t104) * t495)) - t249);
    const T t508 = -t108;
    row[43] = root[1] * (t508);
    row[44] = root[1] * (t110);
    const T t511 = t105 - t115;
    row[45] = root[1] * (t511);
    const T t513 = -t261;
    row[46] = root[1] * (t513);
    row[47] = root[1] * (t250);
    const T t516 = t495 + T(-0.39219999999999999);
    const T t519 = (c123 * t516) - (s123 * t497);
    const T t524 = (c123 * t497) + (s123 * t516);
    row[48] = root[1] * ((t297 + (t147 * t519)) - (t158 * t524));
    row[49] = root[1] * ((t188 * t524) - (t266 + (t177 * t519)));
    const T t533 = -t144;
    row[50] = root[1] * (t533);
    row[51] = root[1] * (t146);
    const T t536 = t176 - t156;
    row[52] = root[1] * (t536);
    const T t539 = -(t179 - t184);
    row[53] = root[1] * (t539);
    const T t541 = t130 + t135;
    row[54] = root[1] * (t541);
    const T t543 = t299 * c220;
    const T t546 = T(0.099699999999999997) + t524;
    const T t547 = s220 * t546;
    const T t550 = c220 * t546;
    row[55] = root[1] * (t543 - (((t233 * t519) + (t279 * t547)) + (t289 * t550)));
    const T t560 = t299 * s220;
    row[56] = root[1] * ((((t318 * t547) - (t310 * t519)) + (t321 * t550)) - t560);
    const T t563 = t329 * c220;
    const T t565 = t563 + (t309 * s220);
    row[57] = root[1] * (t565);
    const T t568 = (t304 * s220) - t563;
    row[58] = root[1] * (t568);
    const T t572 = (t310 * c220) - (t233 * s220);
    row[59] = root[1] * (t572);
    const T t576 = (t350 * c220) + (t279 * s220);
    row[60] = root[1] * (t576);
    const T t580 = (t360 * s220) - (t321 * c220);
    row[61] = root[1] * (t580);
    const T t582 = T(0.099599999999999994) * s220;
    const T t583 = t582 - t519;
    const T t586 = (s365 * t583) - (c365 * t550);
    const T t589 = t387 * c220;
    const T t593 = (s365 * t550) + (c365 * t583);
    const T t597 = s365 * s220;
    const T t598 = t415 * t597;
    row[62] = root[1] * (((t408 * t586) - (((t378 * t547) + t589) + (t396 * t593))) + t598);
    const T t603 = t432 * c220;
    const T t608 = c365 * s220;
    const T t609 = t415 * t608;
    row[63] = root[1] * ((((t436 * t593) - ((t428 * t547) + t603)) + (t439 * t586)) + t609);
    const T t613 = t448 * t597;
    const T t616 = ((t395 * c220) - t613) + (t426 * t608);
    row[64] = root[1] * (t616);
    const T t621 = ((t391 * c220) + t613) - (t427 * t608);
    row[65] = root[1] * (t621);
    const T t627 = ((t462 * c220) - (t428 * t597)) - (t378 * t608);
    row[66] = root[1] * (t627);
    const T t633 = ((t470 * c220) - (t468 * t597)) + (t396 * t608);
    row[67] = root[1] * (t633);
    const T t639 = ((t477 * c220) - (t439 * t597)) + (t480 * t608);
    row[68] = root[1] * (t639);
    row[69] = root[2] * (t259);
    row[70] = root[2] * (-t249);
    row[71] = root[2] * (t508);
    row[72] = root[2] * (t110);
    row[73] = root[2] * (t511);
    row[74] = root[2] * (t513);
    row[75] = root[2] * (t250);
    const T t657 = T(-0.39219999999999999) * c123;
    const T t660 = T(-0.39219999999999999) * s123;
    row[76] = root[2] * ((t297 + (t147 * t657)) - (t158 * t660));
    row[77] = root[2] * ((t188 * t660) - (t266 + (t177 * t657)));
    row[78] = root[2] * (t533);
    row[79] = root[2] * (t146);
    row[80] = root[2] * (t536);
    row[81] = root[2] * (t539);
    row[82] = root[2] * (t541);
    const T t675 = T(0.099699999999999997) + t660;
    const T t676 = s220 * t675;
    const T t679 = c220 * t675;
    row[83] = root[2] * (t543 - (((t233 * t657) + (t279 * t676)) + (t289 * t679)));
    row[84] = root[2] * ((((t318 * t676) - (t310 * t657)) + (t321 * t679)) - t560);
    row[85] = root[2] * (t565);
    row[86] = root[2] * (t568);
    row[87] = root[2] * (t572);
    row[88] = root[2] * (t576);
    row[89] = root[2] * (t580);
    const T t696 = t582 - t657;
    const T t699 = (s365 * t696) - (c365 * t679);
    const T t705 = (s365 * t679) + (c365 * t696);
    row[90] = root[2] * (((t408 * t699) - (((t378 * t676) + t589) + (t396 * t705))) + t598);
    row[91] = root[2] * ((((t436 * t705) - ((t428 * t676) + t603)) + (t439 * t699)) + t609);
    row[92] = root[2] * (t616);
    row[93] = root[2] * (t621);
    row[94] = root[2] * (t627);
    row[95] = root[2] * (t633);
    row[96] = root[2] * (t639);
    row[97] = root[3] * (t297);
    row[98] = root[3] * (-t266);
    row[99] = root[3] * (t533);
    row[100] = root[3] * (t146);
    row[101] = root[3] * (t536);
    row[102] = root[3] * (t539);
    row[103] = root[3] * (t541);
    const T t747 = T(-0.099699999999999997) * s220;
    const T t749 = T(0.099699999999999997) * c220;
    row[104] = root[3] * (((t279 * t747) - (t289 * t749)) + t543);
    row[105] = root[3] * (((t321 * t749) - (t318 * t747)) - t560);
    row[106] = root[3] * (t565);
    row[107] = root[3] * (t568);
    row[108] = root[3] * (t572);
    row[109] = root[3] * (t576);
    row[110] = root[3] * (t580);
    const T t768 = (s365 * t749) + (c365 * t582);
    const T t773 = (s365 * t582) - (c365 * t749);
    row[111] = root[3] * (((((t378 * t747) - t589) - (t396 * t768)) + (t408 * t773)) + t598);
    row[112] = root[3] * (((((t428 * t747) - t603) + (t436 * t768)) + (t439 * t773)) + t609);
    row[113] = root[3] * (t616);
    row[114] = root[3] * (t621);
    row[115] = root[3] * (t627);
    row[116] = root[3] * (t633);
    row[117] = root[3] * (t639);
    row[118] = root[4] * (t270);
    row[119] = root[4] * (-t314);
    row[120] = root[4] * (-t276);
    row[121] = root[4] * (t278);
    row[122] = root[4] * (t340);
    row[123] = root[4] * (-t348);
    row[124] = root[4] * (t357);
    const T t823 = T(0.099599999999999994) * s365;
    const T t825 = T(0.099599999999999994) * c365;
    row[125] = root[4] * (((t396 * t823) + (t408 * t825)) + (t415 * c365));
    row[126] = root[4] * (((t439 * t825) - (t436 * t823)) - (t415 * s365));
    const T t837 = t448 * c365;
    row[127] = root[4] * (-(t837 + (t426 * s365)));
    row[128] = root[4] * (t837 + (t427 * s365));
    row[129] = root[4] * ((t378 * s365) - (t428 * c365));
    row[130] = root[4] * (-((t468 * c365) + (t396 * s365)));
    row[131] = root[4] * (-((t439 * c365) + (t480 * s365)));
    row[132] = root[5] * (-t387);
    row[133] = root[5] * (-t432);
    row[134] = root[5] * (t395);
    row[135] = root[5] * (t391);
    row[136] = root[5] * (t462);
    row[137] = root[5] * (t470);
    row[138] = root[5] * (t477);
}

/* Row i of `rows`, ROW numbers per sample. */
template <typename T>
SYMGEN_BOTH void weighted_rows_at(long long i, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> tau_, symgen_array<const T> weight_, T *rows)
{
    T q[6], dq[6], ddq[6], tau[6], weight[6], row[ROW];
    symgen_load<6>(q, q_, i);
    symgen_load<6>(dq, dq_, i);
    symgen_load<6>(ddq, ddq_, i);
    symgen_load<6>(tau, tau_, i);
    symgen_load<6>(weight, weight_, i);
    weighted_row(q, dq, ddq, tau, weight, row);
    SYMGEN_UNROLL
    for (int k = 0; k < ROW; ++k) {
        rows[i * ROW + k] = row[k];
    }
}

/* Loss and gradient of one more row, r = row beta - sqrt(W) tau: loss += r'r/2, gradient += row' r. */
template <typename T> SYMGEN_BOTH void add_row(const T *row, const T *beta, T &loss, T *gradient)
{
    {
        T even = -row[139], odd = T(0.0);
        even += row[0] * beta[0];
        odd += row[1] * beta[3];
        even += row[2] * beta[4];
        odd += row[3] * beta[5];
        even += row[4] * beta[6];
        odd += row[5] * beta[7];
        even += row[6] * beta[8];
        odd += row[7] * beta[9];
        even += row[8] * beta[10];
        odd += row[9] * beta[11];
        even += row[10] * beta[12];
        odd += row[11] * beta[13];
        even += row[12] * beta[14];
        odd += row[13] * beta[15];
        even += row[14] * beta[16];
        odd += row[15] * beta[17];
        even += row[16] * beta[18];
        odd += row[17] * beta[19];
        even += row[18] * beta[20];
        odd += row[19] * beta[21];
        even += row[20] * beta[22];
        odd += row[21] * beta[23];
        even += row[22] * beta[24];
        odd += row[23] * beta[25];
        even += row[24] * beta[26];
        odd += row[25] * beta[27];
        even += row[26] * beta[28];
        odd += row[27] * beta[29];
        even += row[28] * beta[30];
        odd += row[29] * beta[31];
        even += row[30] * beta[32];
        odd += row[31] * beta[33];
        even += row[32] * beta[34];
        odd += row[33] * beta[35];
        const T r = even + odd;
        loss += T(0.5) * r * r;
        gradient[0] += row[0] * r;
        gradient[3] += row[1] * r;
        gradient[4] += row[2] * r;
        gradient[5] += row[3] * r;
        gradient[6] += row[4] * r;
        gradient[7] += row[5] * r;
        gradient[8] += row[6] * r;
        gradient[9] += row[7] * r;
        gradient[10] += row[8] * r;
        gradient[11] += row[9] * r;
        gradient[12] += row[10] * r;
        gradient[13] += row[11] * r;
        gradient[14] += row[12] * r;
        gradient[15] += row[13] * r;
        gradient[16] += row[14] * r;
        gradient[17] += row[15] * r;
        gradient[18] += row[16] * r;
        gradient[19] += row[17] * r;
        gradient[20] += row[18] * r;
        gradient[21] += row[19] * r;
        gradient[22] += row[20] * r;
        gradient[23] += row[21] * r;
        gradient[24] += row[22] * r;
        gradient[25] += row[23] * r;
        gradient[26] += row[24] * r;
        gradient[27] += row[25] * r;
        gradient[28] += row[26] * r;
        gradient[29] += row[27] * r;
        gradient[30] += row[28] * r;
        gradient[31] += row[29] * r;
        gradient[32] += row[30] * r;
        gradient[33] += row[31] * r;
        gradient[34] += row[32] * r;
        gradient[35] += row[33] * r;
    }
    {
        T even = -row[140], odd = T(0.0);
        even += row[34] * beta[1];
        odd += row[35] * beta[2];
        even += row[36] * beta[3];
        odd += row[37] * beta[4];
        even += row[38] * beta[5];
        odd += row[39] * beta[6];
        even += row[40] * beta[7];
        odd += row[41] * beta[8];
        even += row[42] * beta[9];
        odd += row[43] * beta[10];
        even += row[44] * beta[11];
        odd += row[45] * beta[12];
        even += row[46] * beta[13];
        odd += row[47] * beta[14];
        even += row[48] * beta[15];
        odd += row[49] * beta[16];
        even += row[50] * beta[17];
        odd += row[51] * beta[18];
        even += row[52] * beta[19];
        odd += row[53] * beta[20];
        even += row[54] * beta[21];
        odd += row[55] * beta[22];
        even += row[56] * beta[23];
        odd += row[57] * beta[24];
        even += row[58] * beta[25];
        odd += row[59] * beta[26];
        even += row[60] * beta[27];
        odd += row[61] * beta[28];
        even += row[62] * beta[29];
        odd += row[63] * beta[30];
        even += row[64] * beta[31];
        odd += row[65] * beta[32];
        even += row[66] * beta[33];
        odd += row[67] * beta[34];
        even += row[68] * beta[35];
        const T r = even + odd;
        loss += T(0.5) * r * r;
        gradient[1] += row[34] * r;
        gradient[2] += row[35] * r;
        gradient[3] += row[36] * r;
        gradient[4] += row[37] * r;
        gradient[5] += row[38] * r;
        gradient[6] += row[39] * r;
        gradient[7] += row[40] * r;
        gradient[8] += row[41] * r;
        gradient[9] += row[42] * r;
        gradient[10] += row[43] * r;
        gradient[11] += row[44] * r;
        gradient[12] += row[45] * r;
        gradient[13] += row[46] * r;
        gradient[14] += row[47] * r;
        gradient[15] += row[48] * r;
        gradient[16] += row[49] * r;
        gradient[17] += row[50] * r;
        gradient[18] += row[51] * r;
        gradient[19] += row[52] * r;
        gradient[20] += row[53] * r;
        gradient[21] += row[54] * r;
        gradient[22] += row[55] * r;
        gradient[23] += row[56] * r;
        gradient[24] += row[57] * r;
        gradient[25] += row[58] * r;
        gradient[26] += row[59] * r;
        gradient[27] += row[60] * r;
        gradient[28] += row[61] * r;
        gradient[29] += row[62] * r;
        gradient[30] += row[63] * r;
        gradient[31] += row[64] * r;
        gradient[32] += row[65] * r;
        gradient[33] += row[66] * r;
        gradient[34] += row[67] * r;
        gradient[35] += row[68] * r;
    }
    {
        T even = -row[141], odd = T(0.0);
        even += row[69] * beta[8];
        odd += row[70] * beta[9];
        even += row[71] * beta[10];
        odd += row[72] * beta[11];
        even += row[73] * beta[12];
        odd += row[74] * beta[13];
        even += row[75] * beta[14];
        odd += row[76] * beta[15];
        even += row[77] * beta[16];
        odd += row[78] * beta[17];
        even += row[79] * beta[18];
        odd += row[80] * beta[19];
        even += row[81] * beta[20];
        odd += row[82] * beta[21];
        even += row[83] * beta[22];
        odd += row[84] * beta[23];
        even += row[85] * beta[24];
        odd += row[86] * beta[25];
        even += row[87] * beta[26];
        odd += row[88] * beta[27];
        even += row[89] * beta[28];
        odd += row[90] * beta[29];
        even += row[91] * beta[30];
        odd += row[92] * beta[31];
        even += row[93] * beta[32];
        odd += row[94] * beta[33];
        even += row[95] * beta[34];
        odd += row[96] * beta[35];
        const T r = even + odd;
        loss += T(0.5) * r * r;
        gradient[8] += row[69] * r;
        gradient[9] += row[70] * r;
        gradient[10] += row[71] * r;
        gradient[11] += row[72] * r;
        gradient[12] += row[73] * r;
        gradient[13] += row[74] * r;
        gradient[14] += row[75] * r;
        gradient[15] += row[76] * r;
        gradient[16] += row[77] * r;
        gradient[17] += row[78] * r;
        gradient[18] += row[79] * r;
        gradient[19] += row[80] * r;
        gradient[20] += row[81] * r;
        gradient[21] += row[82] * r;
        gradient[22] += row[83] * r;
        gradient[23] += row[84] * r;
        gradient[24] += row[85] * r;
        gradient[25] += row[86] * r;
        gradient[26] += row[87] * r;
        gradient[27] += row[88] * r;
        gradient[28] += row[89] * r;
        gradient[29] += row[90] * r;
        gradient[30] += row[91] * r;
        gradient[31] += row[92] * r;
        gradient[32] += row[93] * r;
        gradient[33] += row[94] * r;
        gradient[34] += row[95] * r;
        gradient[35] += row[96] * r;
    }
    {
        T even = -row[142], odd = T(0.0);
        even += row[97] * beta[15];
        odd += row[98] * beta[16];
        even += row[99] * beta[17];
        odd += row[100] * beta[18];
        even += row[101] * beta[19];
        odd += row[102] * beta[20];
        even += row[103] * beta[21];
        odd += row[104] * beta[22];
        even += row[105] * beta[23];
        odd += row[106] * beta[24];
        even += row[107] * beta[25];
        odd += row[108] * beta[26];
        even += row[109] * beta[27];
        odd += row[110] * beta[28];
        even += row[111] * beta[29];
        odd += row[112] * beta[30];
        even += row[113] * beta[31];
        odd += row[114] * beta[32];
        even += row[115] * beta[33];
        odd += row[116] * beta[34];
        even += row[117] * beta[35];
        const T r = even + odd;
        loss += T(0.5) * r * r;
        gradient[15] += row[97] * r;
        gradient[16] += row[98] * r;
        gradient[17] += row[99] * r;
        gradient[18] += row[100] * r;
        gradient[19] += row[101] * r;
        gradient[20] += row[102] * r;
        gradient[21] += row[103] * r;
        gradient[22] += row[104] * r;
        gradient[23] += row[105] * r;
        gradient[24] += row[106] * r;
        gradient[25] += row[107] * r;
        gradient[26] += row[108] * r;
        gradient[27] += row[109] * r;
        gradient[28] += row[110] * r;
        gradient[29] += row[111] * r;
        gradient[30] += row[112] * r;
        gradient[31] += row[113] * r;
        gradient[32] += row[114] * r;
        gradient[33] += row[115] * r;
        gradient[34] += row[116] * r;
        gradient[35] += row[117] * r;
    }
    {
        T even = -row[143], odd = T(0.0);
        even += row[118] * beta[22];
        odd += row[119] * beta[23];
        even += row[120] * beta[24];
        odd += row[121] * beta[25];
        even += row[122] * beta[26];
        odd += row[123] * beta[27];
        even += row[124] * beta[28];
        odd += row[125] * beta[29];
        even += row[126] * beta[30];
        odd += row[127] * beta[31];
        even += row[128] * beta[32];
        odd += row[129] * beta[33];
        even += row[130] * beta[34];
        odd += row[131] * beta[35];
        const T r = even + odd;
        loss += T(0.5) * r * r;
        gradient[22] += row[118] * r;
        gradient[23] += row[119] * r;
        gradient[24] += row[120] * r;
        gradient[25] += row[121] * r;
        gradient[26] += row[122] * r;
        gradient[27] += row[123] * r;
        gradient[28] += row[124] * r;
        gradient[29] += row[125] * r;
        gradient[30] += row[126] * r;
        gradient[31] += row[127] * r;
        gradient[32] += row[128] * r;
        gradient[33] += row[129] * r;
        gradient[34] += row[130] * r;
        gradient[35] += row[131] * r;
    }
    {
        T even = -row[144], odd = T(0.0);
        even += row[132] * beta[29];
        odd += row[133] * beta[30];
        even += row[134] * beta[31];
        odd += row[135] * beta[32];
        even += row[136] * beta[33];
        odd += row[137] * beta[34];
        even += row[138] * beta[35];
        const T r = even + odd;
        loss += T(0.5) * r * r;
        gradient[29] += row[132] * r;
        gradient[30] += row[133] * r;
        gradient[31] += row[134] * r;
        gradient[32] += row[135] * r;
        gradient[33] += row[136] * r;
        gradient[34] += row[137] * r;
        gradient[35] += row[138] * r;
    }
}

#ifdef __CUDACC__
template <typename T>
__global__ void base_parameters_kernel(long long n, symgen_array<const T> pi_, symgen_array<T> beta_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        base_parameters_at<T>(i, pi_, beta_);
    }
}

template <typename T>
__global__ void base_adjoint_kernel(long long n, symgen_array<const T> slope_, symgen_array<T> gradient_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        base_adjoint_at<T>(i, slope_, gradient_);
    }
}

template <typename T>
__global__ void base_inverse_dynamics_kernel(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> beta_, symgen_array<T> tau_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        base_inverse_dynamics_at<T>(i, q_, dq_, ddq_, beta_, tau_);
    }
}

template <typename T>
__global__ void inverse_dynamics_kernel(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> pi_, symgen_array<T> tau_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        inverse_dynamics_at<T>(i, q_, dq_, ddq_, pi_, tau_);
    }
}

template <typename T>
__global__ void mass_matrix_kernel(long long n, symgen_array<const T> q_, symgen_array<const T> pi_, symgen_array<T> M_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        mass_matrix_at<T>(i, q_, pi_, M_);
    }
}

template <typename T>
__global__ void bias_forces_kernel(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> pi_, symgen_array<T> h_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        bias_forces_at<T>(i, q_, dq_, pi_, h_);
    }
}

template <typename T>
__global__ void forward_dynamics_kernel(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> tau_, symgen_array<const T> pi_, symgen_array<const T> rotor_, symgen_array<T> ddq_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        forward_dynamics_at<T>(i, q_, dq_, tau_, pi_, rotor_, ddq_);
    }
}

template <typename T>
__global__ void end_effector_kernel(long long n, symgen_array<const T> q_, symgen_array<T> H_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        end_effector_at<T>(i, q_, H_);
    }
}

template <typename T>
__global__ void base_regressor_kernel(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<T> Y_b_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        base_regressor_at<T>(i, q_, dq_, ddq_, Y_b_);
    }
}

template <typename T>
__global__ void loss_gradient_kernel(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> tau_, symgen_array<const T> weight_, symgen_array<const T> beta_, symgen_array<T> loss_, symgen_array<T> gradient_, symgen_array<T> residual_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        loss_gradient_at<T>(i, q_, dq_, ddq_, tau_, weight_, beta_, loss_, gradient_, residual_);
    }
}

template <typename T>
__global__ void torque_derivatives_kernel(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> pi_, symgen_array<T> tau_, symgen_array<T> dtau_dq_, symgen_array<T> dtau_dv_, symgen_array<T> dtau_da_)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        torque_derivatives_at<T>(i, q_, dq_, ddq_, pi_, tau_, dtau_dq_, dtau_dv_, dtau_da_);
    }
}

template <typename T>
__global__ void weighted_rows_kernel(long long n, symgen_array<const T> q, symgen_array<const T> dq, symgen_array<const T> ddq, symgen_array<const T> tau, symgen_array<const T> weight, T *rows)
{
    const long long i = blockIdx.x * (long long)blockDim.x + threadIdx.x;
    if (i < n) {
        weighted_rows_at<T>(i, q, dq, ddq, tau, weight, rows);
    }
}

/* Losses and gradients of `sets` vectors beta, one thread each, on `samples` rows. Blocks (x, y): y
 * takes every gridDim.y-th tile of the rows and writes its own sums, to be added by the caller:
 * losses[y][set], gradients[y][entry][set]. */
template <typename T>
__global__ void losses_kernel(long long sets, long long samples, const T *rows, symgen_array<const T> beta_, T *losses, T *gradients)
{
    __shared__ __align__(16) T tile[TILE * ROW];
    const long long set = blockIdx.x * (long long)blockDim.x + threadIdx.x, mine = set < sets ? set : sets - 1;
    T beta[BASE], gradient[BASE], loss = T(0.0);
    symgen_load<BASE>(beta, beta_, mine);
    SYMGEN_UNROLL
    for (int k = 0; k < BASE; ++k) {
        gradient[k] = T(0.0);
    }
    for (long long first = blockIdx.y * (long long)TILE; first < samples; first += gridDim.y * (long long)TILE) {
        const int count = samples - first < TILE ? (int)(samples - first) : (int)TILE;
        for (int k = threadIdx.x; k < count * ROW; k += blockDim.x) {
            tile[k] = rows[first * ROW + k];
        }
        __syncthreads();
        for (int s = 0; s < count; ++s) {
            add_row(tile + s * ROW, beta, loss, gradient);
        }
        __syncthreads();
    }
    if (set < sets) {
        losses[blockIdx.y * sets + set] = loss;
        SYMGEN_UNROLL
        for (int k = 0; k < BASE; ++k) {
            gradients[(blockIdx.y * (long long)BASE + k) * sets + set] = gradient[k];
        }
    }
}
#else
template <typename T>
inline void base_parameters_samples(long long n, symgen_array<const T> pi_, symgen_array<T> beta_)
{
    for (long long i = 0; i < n; ++i) {
        base_parameters_at<T>(i, pi_, beta_);
    }
}

template <typename T>
inline void base_adjoint_samples(long long n, symgen_array<const T> slope_, symgen_array<T> gradient_)
{
    for (long long i = 0; i < n; ++i) {
        base_adjoint_at<T>(i, slope_, gradient_);
    }
}

template <typename T>
inline void base_inverse_dynamics_samples(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> beta_, symgen_array<T> tau_)
{
    for (long long i = 0; i < n; ++i) {
        base_inverse_dynamics_at<T>(i, q_, dq_, ddq_, beta_, tau_);
    }
}

template <typename T>
inline void inverse_dynamics_samples(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> pi_, symgen_array<T> tau_)
{
    for (long long i = 0; i < n; ++i) {
        inverse_dynamics_at<T>(i, q_, dq_, ddq_, pi_, tau_);
    }
}

template <typename T>
inline void mass_matrix_samples(long long n, symgen_array<const T> q_, symgen_array<const T> pi_, symgen_array<T> M_)
{
    for (long long i = 0; i < n; ++i) {
        mass_matrix_at<T>(i, q_, pi_, M_);
    }
}

template <typename T>
inline void bias_forces_samples(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> pi_, symgen_array<T> h_)
{
    for (long long i = 0; i < n; ++i) {
        bias_forces_at<T>(i, q_, dq_, pi_, h_);
    }
}

template <typename T>
inline void forward_dynamics_samples(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> tau_, symgen_array<const T> pi_, symgen_array<const T> rotor_, symgen_array<T> ddq_)
{
    for (long long i = 0; i < n; ++i) {
        forward_dynamics_at<T>(i, q_, dq_, tau_, pi_, rotor_, ddq_);
    }
}

template <typename T>
inline void end_effector_samples(long long n, symgen_array<const T> q_, symgen_array<T> H_)
{
    for (long long i = 0; i < n; ++i) {
        end_effector_at<T>(i, q_, H_);
    }
}

template <typename T>
inline void base_regressor_samples(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<T> Y_b_)
{
    for (long long i = 0; i < n; ++i) {
        base_regressor_at<T>(i, q_, dq_, ddq_, Y_b_);
    }
}

template <typename T>
inline void loss_gradient_samples(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> tau_, symgen_array<const T> weight_, symgen_array<const T> beta_, symgen_array<T> loss_, symgen_array<T> gradient_, symgen_array<T> residual_)
{
    for (long long i = 0; i < n; ++i) {
        loss_gradient_at<T>(i, q_, dq_, ddq_, tau_, weight_, beta_, loss_, gradient_, residual_);
    }
}

template <typename T>
inline void torque_derivatives_samples(long long n, symgen_array<const T> q_, symgen_array<const T> dq_, symgen_array<const T> ddq_, symgen_array<const T> pi_, symgen_array<T> tau_, symgen_array<T> dtau_dq_, symgen_array<T> dtau_dv_, symgen_array<T> dtau_da_)
{
    for (long long i = 0; i < n; ++i) {
        torque_derivatives_at<T>(i, q_, dq_, ddq_, pi_, tau_, dtau_dq_, dtau_dv_, dtau_da_);
    }
}

#endif
} // namespace ur5e_cuda
#endif
