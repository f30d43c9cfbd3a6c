/* ur5e: kernels on tiles, written by symgen 0.1.0. Included by the files that are
 * compiled once per instruction set, with -DLEVEL=v4 -DW=8 (AVX-512), v3 and 4 (AVX2), v2 or neon
 * and 2, portable and 1. A vector wider than the instruction set has is slower than none: LEVEL, W
 * and -march go together. Never compile with -ffast-math: it breaks the range reduction of sine.
 *
 * A tile holds LANES samples: its row k is the LANES numbers from 8 k on, one per sample. Rows of
 * outputs that are zero by structure are never written: clear the array once. Outputs that a batch
 * sums over its samples are added to. */
#ifndef SYMGEN_TILES_H
#define SYMGEN_TILES_H

#ifndef W
#error "compile with -DLEVEL=v4 -DW=8 -march=x86-64-v4, see README.md"
#endif

#include "ur5e.h"
#include "lanes.h"

#define JOIN(level, function) ur5e_##level##_##function
#define AT(level, function) JOIN(level, function)
#define OWN(function) AT(LEVEL, function)
#define HIDDEN __attribute__((visibility("hidden")))

/* tau = Y_b(q, dq, ddq) beta, Eq. 3.11. 519 operations per sample. */
HIDDEN void OWN(base_inverse_dynamics_sines)(long tiles, const double *q, double *sc);
HIDDEN void ur5e_base_inverse_dynamics_prepare(const double *beta, double *u);
HIDDEN void OWN(base_inverse_dynamics_tile)(
const double *sc,const double *q, const double *dq, const double *ddq, const double *beta, const double *u, double *tau);

/* tau = Y(q, dq, ddq) pi, Eq. 4.3. 519 operations per sample. */
HIDDEN void OWN(inverse_dynamics_sines)(long tiles, const double *q, double *sc);
HIDDEN void ur5e_inverse_dynamics_prepare(const double *pi, double *u);
HIDDEN void OWN(inverse_dynamics_tile)(
const double *sc,const double *q, const double *dq, const double *ddq, const double *pi, const double *u, double *tau);

/* tau = Y(q, dq, ddq) pi(lam), Eq. 4.3. 519 operations per sample. */
HIDDEN void OWN(torque_sines)(long tiles, const double *q, double *sc);
HIDDEN void ur5e_torque_prepare(const double *lam, double *u);
HIDDEN void OWN(torque_tile)(
const double *sc,const double *q, const double *dq, const double *ddq, const double *lam, const double *u, double *tau);

/* Y with tau = Y pi, Eq. 3.1. 833 operations per sample. */
HIDDEN void OWN(regressor_sines)(long tiles, const double *q, double *sc);
HIDDEN void OWN(regressor_tile)(
const double *sc,const double *q, const double *dq, const double *ddq, double *Y);

/* d tau / d lam = Y blockdiag(d pi / d lam), Eqs. 4.34-4.36. 3185 operations per sample. */
HIDDEN void OWN(torque_jacobian_sines)(long tiles, const double *q, double *sc);
HIDDEN void ur5e_torque_jacobian_prepare(const double *lam, double *u);
HIDDEN void OWN(torque_jacobian_tile)(
const double *sc,const double *q, const double *dq, const double *ddq, const double *lam, const double *u, double *jacobian);

/* Y_b with tau = Y_b beta, Eq. 3.11. 656 operations per sample. */
HIDDEN void OWN(base_regressor_sines)(long tiles, const double *q, double *sc);
HIDDEN void OWN(base_regressor_tile)(
const double *sc,const double *q, const double *dq, const double *ddq, double *Y_b);

/* tau = d(P_b beta)/dt - R_b beta, p = M dq = P_b beta, r = d(T - U)/dq = R_b beta. 1160 operations per sample. */
HIDDEN void OWN(momentum_regressor_sines)(long tiles, const double *q, double *sc);
HIDDEN void OWN(momentum_regressor_tile)(
const double *sc,const double *q, const double *dq, double *P_b, double *R_b);

/* beta = K pi, Eq. 3.11. 104 operations per sample. */
HIDDEN void OWN(base_parameters_sines)(long tiles, const double *pi, double *sc);
HIDDEN void OWN(base_parameters_tile)(
const double *sc,const double *pi, double *beta);

/* K' slope, the adjoint of beta = K pi. 53 operations per sample. */
HIDDEN void OWN(base_adjoint_sines)(long tiles, const double *slope, double *sc);
HIDDEN void OWN(base_adjoint_tile)(
const double *sc,const double *slope, double *gradient);

/* M(q), Eq. 2.34. 342 operations per sample. */
HIDDEN void OWN(mass_matrix_sines)(long tiles, const double *q, double *sc);
HIDDEN void ur5e_mass_matrix_prepare(const double *pi, double *u);
HIDDEN void OWN(mass_matrix_tile)(
const double *sc,const double *q, const double *pi, const double *u, double *M);

/* h = C(q, dq) dq - tau_grav, Eq. 2.34. 519 operations per sample. */
HIDDEN void OWN(bias_forces_sines)(long tiles, const double *q, double *sc);
HIDDEN void ur5e_bias_forces_prepare(const double *pi, double *u);
HIDDEN void OWN(bias_forces_tile)(
const double *sc,const double *q, const double *dq, const double *pi, const double *u, double *h);

/* ddq = (M + diag(J))^-1 (tau - h), J of the rotors. 983 operations per sample. */
HIDDEN void OWN(forward_dynamics_sines)(long tiles, const double *q, double *sc);
HIDDEN void ur5e_forward_dynamics_prepare(const double *pi, const double *rotor, double *u);
HIDDEN void OWN(forward_dynamics_tile)(
const double *sc,const double *q, const double *dq, const double *tau, const double *pi, const double *rotor, const double *u, double *ddq);

/* pose of the tip in the base frame, Eq. 2.15. 115 operations per sample. */
HIDDEN void OWN(end_effector_sines)(long tiles, const double *q, double *sc);
HIDDEN void OWN(end_effector_tile)(
const double *sc,const double *q, double *H);

/* sum of r'Wr/2 and of Y_b'Wr, r = Y_b beta - tau, Eqs. 4.6, 4.32. 807 operations per sample. */
HIDDEN void OWN(loss_gradient_sines)(long tiles, const double *q, double *sc);
HIDDEN void ur5e_loss_gradient_prepare(const double *weight, const double *beta, double *u);
HIDDEN void OWN(loss_gradient_tile)(
const double *sc,const double *q, const double *dq, const double *ddq, const double *tau, const double *weight, const double *beta, const double *u, double *loss, double *gradient, double *residual);

/* Eqs. 4.25-4.31. 108 operations per sample. */
HIDDEN void OWN(pi_from_lam_sines)(long tiles, const double *lam, double *sc);
HIDDEN void OWN(pi_from_lam_tile)(
const double *sc,const double *lam, double *pi);

/* pi and d pi / d lam of one link. 551 operations per sample. */
HIDDEN void OWN(pi_jacobian_sines)(long tiles, const double *lam, double *sc);
HIDDEN void OWN(pi_jacobian_tile)(
const double *sc,const double *lam, double *pi, double *jacobian);

/* pi of one link, and its m, R, B, C for pi_adjoint. 111 operations per sample. */
HIDDEN void OWN(pi_frame_sines)(long tiles, const double *lam, double *sc);
HIDDEN void OWN(pi_frame_tile)(
const double *sc,const double *lam, double *pi, double *frame);

/* (d pi / d lam)' slope of one link, Eq. 4.32. 171 operations per sample. */
HIDDEN void OWN(pi_adjoint_sines)(long tiles, const double *lam, double *sc);
HIDDEN void OWN(pi_adjoint_tile)(
const double *sc,const double *lam, const double *frame, const double *slope, double *gradient);

/* pi and d pi / d theta of one link, P = U(theta) U(theta)'. 98 operations per sample. */
HIDDEN void OWN(cholesky_jacobian_sines)(long tiles, const double *theta, double *sc);
HIDDEN void OWN(cholesky_jacobian_tile)(
const double *sc,const double *theta, double *pi, double *jacobian);

/* smallest pivot and log det of P, tr(P^-1 B_i), tr(P^-1 B_i P^-1 B_j), B_i = dP/dpi_i. 558 operations per sample. */
HIDDEN void OWN(barrier_sines)(long tiles, const double *pi, double *sc);
HIDDEN void OWN(barrier_tile)(
const double *sc,const double *pi, double *pivot, double *log_det, double *traces, double *curvature);

/* d <seed, Y_b> / d (q, dq, ddq), the adjoint of Eq. 3.29. 1988 operations per sample. */
HIDDEN void OWN(regressor_adjoint_sines)(long tiles, const double *q, double *sc);
HIDDEN void OWN(regressor_adjoint_tile)(
const double *sc,const double *q, const double *dq, const double *ddq, const double *seed, double *gradient);

/* distance of the capsules of each pair, negative where they overlap. 1562 operations per sample. */
HIDDEN void OWN(clearance_sines)(long tiles, const double *q, double *sc);
HIDDEN void OWN(clearance_tile)(
const double *sc,const double *q, double *distance, double *jacobian);

#endif
