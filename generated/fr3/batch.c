/* fr3: every kernel over n samples, written by symgen 0.1.0.
 * Each input comes with its step in doubles from one sample to the next; 0 keeps it for all.
 * Outputs are contiguous, sample after sample; those marked "summed" are added up in order. */
#include "fr3.h"

/* Best level of tiles.c that this processor can run; "portable" is this file. */
const char *fr3_level(void)
{
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw")) {
        return "v4";
    }
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
        return "v3";
    }
    return __builtin_cpu_supports("sse4.2") ? "v2" : "portable";
#elif defined(__aarch64__)
    return "neon";
#else
    return "portable";
#endif
}

void fr3_inverse_dynamics_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *pi, long pi_step, double *tau)
{
    for (long i = 0; i < n; ++i) {
        fr3_inverse_dynamics(q + i * q_step, dq + i * dq_step, ddq + i * ddq_step, pi + i * pi_step, tau + i * 7);
    }
}

void fr3_torque_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *lam, long lam_step, double *tau)
{
    for (long i = 0; i < n; ++i) {
        fr3_torque(q + i * q_step, dq + i * dq_step, ddq + i * ddq_step, lam + i * lam_step, tau + i * 7);
    }
}

void fr3_torque_jacobian_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *lam, long lam_step, double *jacobian)
{
    for (long i = 0; i < n; ++i) {
        fr3_torque_jacobian(q + i * q_step, dq + i * dq_step, ddq + i * ddq_step, lam + i * lam_step, jacobian + i * 490);
    }
}

void fr3_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, double *Y)
{
    for (long i = 0; i < n; ++i) {
        fr3_regressor(q + i * q_step, dq + i * dq_step, ddq + i * ddq_step, Y + i * 490);
    }
}

void fr3_base_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, double *Y_b)
{
    for (long i = 0; i < n; ++i) {
        fr3_base_regressor(q + i * q_step, dq + i * dq_step, ddq + i * ddq_step, Y_b + i * 301);
    }
}

void fr3_mass_matrix_batch(long n, const double *q, long q_step, const double *pi, long pi_step, double *M)
{
    for (long i = 0; i < n; ++i) {
        fr3_mass_matrix(q + i * q_step, pi + i * pi_step, M + i * 49);
    }
}

void fr3_bias_forces_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *pi, long pi_step, double *h)
{
    for (long i = 0; i < n; ++i) {
        fr3_bias_forces(q + i * q_step, dq + i * dq_step, pi + i * pi_step, h + i * 7);
    }
}

void fr3_forward_dynamics_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *tau, long tau_step, const double *pi, long pi_step, const double *rotor, long rotor_step, double *ddq)
{
    for (long i = 0; i < n; ++i) {
        fr3_forward_dynamics(q + i * q_step, dq + i * dq_step, tau + i * tau_step, pi + i * pi_step, rotor + i * rotor_step, ddq + i * 7);
    }
}

void fr3_end_effector_batch(long n, const double *q, long q_step, double *H)
{
    for (long i = 0; i < n; ++i) {
        fr3_end_effector(q + i * q_step, H + i * 16);
    }
}

void fr3_loss_gradient_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *tau, long tau_step, const double *weight, long weight_step, const double *pi, long pi_step, double *loss, double *gradient, double *residual)
{
    double loss_one[1];
    for (long k = 0; k < 1; ++k) {
        loss[k] = 0.0;
    }
    double gradient_one[70];
    for (long k = 0; k < 70; ++k) {
        gradient[k] = 0.0;
    }
    for (long i = 0; i < n; ++i) {
        fr3_loss_gradient(q + i * q_step, dq + i * dq_step, ddq + i * ddq_step, tau + i * tau_step, weight + i * weight_step, pi + i * pi_step, loss_one, gradient_one, residual + i * 7);
        for (long k = 0; k < 1; ++k) {
            loss[k] += loss_one[k];
        }
        for (long k = 0; k < 70; ++k) {
            gradient[k] += gradient_one[k];
        }
    }
}

void fr3_pi_from_lam_batch(long n, const double *lam, long lam_step, double *pi)
{
    for (long i = 0; i < n; ++i) {
        fr3_pi_from_lam(lam + i * lam_step, pi + i * 10);
    }
}

void fr3_pi_jacobian_batch(long n, const double *lam, long lam_step, double *jacobian)
{
    for (long i = 0; i < n; ++i) {
        fr3_pi_jacobian(lam + i * lam_step, jacobian + i * 100);
    }
}

void fr3_pi_adjoint_batch(long n, const double *lam, long lam_step, const double *slope, long slope_step, double *gradient)
{
    for (long i = 0; i < n; ++i) {
        fr3_pi_adjoint(lam + i * lam_step, slope + i * slope_step, gradient + i * 10);
    }
}

void fr3_lam_from_pi_batch(long n, const double *pi, long pi_step, double *lam)
{
    for (long i = 0; i < n; ++i) {
        fr3_lam_from_pi(pi + i * pi_step, lam + i * 10);
    }
}

void fr3_nearest_realisable_batch(long n, const double *pi, long pi_step, const double *floor, long floor_step, double *realisable)
{
    for (long i = 0; i < n; ++i) {
        fr3_nearest_realisable(pi + i * pi_step, floor + i * floor_step, realisable + i * 10);
    }
}

void fr3_inertia_matrix_batch(long n, const double *lam, long lam_step, double *M)
{
    for (long i = 0; i < n; ++i) {
        fr3_inertia_matrix(lam + i * lam_step, M + i * 36);
    }
}

void fr3_pseudo_inertia_batch(long n, const double *pi, long pi_step, double *P)
{
    for (long i = 0; i < n; ++i) {
        fr3_pseudo_inertia(pi + i * pi_step, P + i * 16);
    }
}

void fr3_harmonic_basis_batch(long n, const double *m, long m_step, const double *t, long t_step, const double *t_f, long t_f_step, double *phi)
{
    for (long i = 0; i < n; ++i) {
        fr3_harmonic_basis(m + i * m_step, t + i * t_step, t_f + i * t_f_step, phi + i * 4);
    }
}

void fr3_transfer_basis_batch(long n, const double *t, long t_step, const double *t_f, long t_f_step, double *S)
{
    for (long i = 0; i < n; ++i) {
        fr3_transfer_basis(t + i * t_step, t_f + i * t_f_step, S + i * 4);
    }
}

void fr3_regressor_adjoint_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *seed, long seed_step, double *gradient)
{
    for (long i = 0; i < n; ++i) {
        fr3_regressor_adjoint(q + i * q_step, dq + i * dq_step, ddq + i * ddq_step, seed + i * seed_step, gradient + i * 21);
    }
}
