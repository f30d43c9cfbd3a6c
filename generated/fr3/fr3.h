/* fr3: kernels written by symgen 0.1.0. Arrays are dense and row-major, units SI, outputs
 * overlap no inputs. No function allocates, locks or remembers: any thread may call any of them.
 *
 * joints, the order of q, dq [rad/s or m/s], ddq and tau:
 *     fr3_joint1, fr3_joint2, fr3_joint3, fr3_joint4, fr3_joint5, fr3_joint6, fr3_joint7
 * pi, of fr3_link1, fr3_link2, fr3_link3, fr3_link4, fr3_link5, fr3_link6, fr3_link7 in turn:
 *     m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ [kg, kg m, kg m^2], inertia about the link's origin
 * lam, likewise: mu, x, y, z, omega1, omega2, omega3, a, b, c [ln kg, m, rad, kg^(1/2) m]
 * gravity: 0.0, 0.0, -9.81 m/s^2 in the frame of fr3_link0
 * beta: the 43 combinations of pi that fr3_base_parameters makes
 * Shapes, limits and the many-sample functions: README.md. */
#ifndef SYMGEN_FR3_H
#define SYMGEN_FR3_H

#ifdef __cplusplus
extern "C" {
#endif

/* Ties this code to the manifest.json beside it. */
const char *fr3_model_hash(void);

/* Instruction set whose functions on many samples, see FR3_MANY, are the fastest here. */
const char *fr3_level(void);

/* tau = Y_b(q, dq, ddq) beta, Eq. 3.11. 628 operations, at most 12264 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], beta [SI] -> tau [N*m] */
void fr3_base_inverse_dynamics(const double q[7], const double dq[7], const double ddq[7], const double beta[43], double tau[7]);

/* tau = Y(q, dq, ddq) pi, Eq. 4.3. 713 operations, at most 16744 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], pi [SI] -> tau [N*m] */
void fr3_inverse_dynamics(const double q[7], const double dq[7], const double ddq[7], const double pi[70], double tau[7]);

/* tau = Y(q, dq, ddq) pi(lam), Eq. 4.3. 1437 operations, at most 17392 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], lam [lambda] -> tau [N*m] */
void fr3_torque(const double q[7], const double dq[7], const double ddq[7], const double lam[70], double tau[7]);

/* Y with tau = Y pi, Eq. 3.1. 1538 operations, at most 29272 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2] -> Y 7 x 70 [d tau / d pi] */
void fr3_regressor(const double q[7], const double dq[7], const double ddq[7], double Y[490]);

/* d tau / d lam = Y blockdiag(d pi / d lam), Eqs. 4.34-4.36. 7673 operations, at most 38176 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], lam [lambda] -> jacobian 7 x 70 [d tau / d lam] */
void fr3_torque_jacobian(const double q[7], const double dq[7], const double ddq[7], const double lam[70], double jacobian[490]);

/* Y_b with tau = Y_b beta, Eq. 3.11. 1233 operations, at most 23144 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2] -> Y_b 7 x 43 [d tau / d beta] */
void fr3_base_regressor(const double q[7], const double dq[7], const double ddq[7], double Y_b[301]);

/* tau = d(P_b beta)/dt - R_b beta, p = M dq = P_b beta, r = d(T - U)/dq = R_b beta. 1965 operations, at most 34464 bytes of stack.
 * q [rad], dq [rad/s] -> P_b 7 x 43 [d p / d beta], R_b 7 x 43 [d r / d beta] */
void fr3_momentum_regressor(const double q[7], const double dq[7], double P_b[301], double R_b[301]);

/* dq.tau = d(E_b beta)/dt, T + U = E_b beta + const. 249 operations, at most 8016 bytes of stack.
 * q [rad], dq [rad/s] -> E_b [d (T + U) / d beta] */
void fr3_energy_regressor(const double q[7], const double dq[7], double E_b[43]);

/* beta = K pi, Eq. 3.11. 115 operations, at most 6056 bytes of stack.
 * pi [SI] -> beta [SI] */
void fr3_base_parameters(const double pi[70], double beta[43]);

/* K' slope, the adjoint of beta = K pi. 63 operations, at most 5856 bytes of stack.
 * slope [d cost / d beta] -> gradient [d cost / d pi] */
void fr3_base_adjoint(const double slope[43], double gradient[70]);

/* M(q), Eq. 2.34. 536 operations, at most 12224 bytes of stack.
 * q [rad], pi [SI] -> M 7 x 7 [d tau / d ddq] */
void fr3_mass_matrix(const double q[7], const double pi[70], double M[49]);

/* h = C(q, dq) dq - tau_grav, Eq. 2.34. 689 operations, at most 20864 bytes of stack.
 * q [rad], dq [rad/s], pi [SI] -> h [N*m] */
void fr3_bias_forces(const double q[7], const double dq[7], const double pi[70], double h[7]);

/* ddq = (M + diag(J))^-1 (tau - h), J of the rotors. 1367 operations, at most 21944 bytes of stack.
 * q [rad], dq [rad/s], tau [N*m], pi [SI], rotor [kg*m^2] -> ddq [rad/s^2] */
void fr3_forward_dynamics(const double q[7], const double dq[7], const double tau[7], const double pi[70], const double rotor[7], double ddq[7]);

/* pose of the tip in the base frame, Eq. 2.15. 141 operations, at most 6296 bytes of stack.
 * q [rad] -> H 4 x 4 [1, m] */
void fr3_end_effector(const double q[7], double H[16]);

/* poses of the links in the base frame, one below the other, Eq. 2.15. 151 operations, at most 7840 bytes of stack.
 * q [rad] -> H 28 x 4 [1, m] */
void fr3_link_poses(const double q[7], double H[112]);

/* sum of r'Wr/2 and of Y_b'Wr, r = Y_b beta - tau, Eqs. 4.6, 4.32. 976 operations, at most 17392 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], tau [N*m], weight [1], beta [SI] -> loss [1], gradient [d loss / d beta], residual [N*m] */
void fr3_loss_gradient(const double q[7], const double dq[7], const double ddq[7], const double tau[7], const double weight[7], const double beta[43], double loss[1], double gradient[43], double residual[7]);

/* Eqs. 4.25-4.31. 108 operations, at most 5808 bytes of stack.
 * lam [lambda] -> pi [SI] */
void fr3_pi_from_lam(const double lam[10], double pi[10]);

/* pi and d pi / d lam of one link. 551 operations, at most 13024 bytes of stack.
 * lam [lambda] -> pi [SI], jacobian 10 x 10 [d pi / d lam] */
void fr3_pi_jacobian(const double lam[10], double pi[10], double jacobian[100]);

/* pi of one link, and its m, R, B, C for pi_adjoint. 111 operations, at most 6032 bytes of stack.
 * lam [lambda] -> pi [SI], frame [m, R by columns, B, C] */
void fr3_pi_frame(const double lam[10], double pi[10], double frame[12]);

/* (d pi / d lam)' slope of one link, Eq. 4.32. 171 operations, at most 6136 bytes of stack.
 * lam [lambda], frame [m, R by columns, B, C], slope [d cost / d pi] -> gradient [d cost / d lam] */
void fr3_pi_adjoint(const double lam[10], const double frame[12], const double slope[10], double gradient[10]);

/* pi and d pi / d theta of one link, P = U(theta) U(theta)'. 98 operations, at most 7064 bytes of stack.
 * theta [log-Cholesky] -> pi [SI], jacobian 10 x 10 [d pi / d theta] */
void fr3_cholesky_jacobian(const double theta[10], double pi[10], double jacobian[100]);

/* smallest pivot and log det of P, tr(P^-1 B_i), tr(P^-1 B_i P^-1 B_j), B_i = dP/dpi_i. 558 operations, at most 12872 bytes of stack.
 * pi [SI] -> pivot [SI], log_det [1], traces [1/SI], curvature 10 x 10 [1/SI^2] */
void fr3_barrier(const double pi[10], double pivot[1], double log_det[1], double traces[10], double curvature[100]);

/* theta with U(theta) U(theta)' = P; NaN unless P is positive definite. 58 operations, at most 4952 bytes of stack.
 * pi [SI] -> theta [log-Cholesky] */
void fr3_cholesky_from_pi(const double pi[10], double theta[10]);

/* Eqs. 4.18-4.23. 1491 operations, at most 27464 bytes of stack.
 * pi [SI] -> lam [lambda] */
void fr3_lam_from_pi(const double pi[10], double lam[10]);

/* pi with the eigenvalues of Sigma_com raised to floor * trace + m (1 mm)^2. 1396 operations, at most 25872 bytes of stack.
 * pi [SI], floor [1] -> realisable [SI] */
void fr3_nearest_realisable(const double pi[10], const double floor[1], double realisable[10]);

/* M(lam), Eq. 4.14 (linear part first). 111 operations, at most 6368 bytes of stack.
 * lam [lambda] -> M 6 x 6 [SI] */
void fr3_inertia_matrix(const double lam[10], double M[36]);

/* P(pi), Eqs. 3.9, 3.10. 9 operations, at most 4480 bytes of stack.
 * pi [SI] -> P 4 x 4 [SI] */
void fr3_pseudo_inertia(const double pi[10], double P[16]);

/* cos(2 pi m s) - 1 + 2 pi^2 m^2 s^2 (1-s)^2, s = t/t_f, Eqs. 3.24-3.27. 54 operations, at most 4888 bytes of stack.
 * m [1], t [s], t_f [s] -> phi [1, 1/s, 1/s^2, 1/s^3] */
void fr3_harmonic_basis(const double m[1], const double t[1], const double t_f[1], double phi[4]);

/* 10 s^3 - 15 s^4 + 6 s^5, s = t/t_f, Eqs. 3.25, 3.27. 46 operations, at most 4760 bytes of stack.
 * t [s], t_f [s] -> S [1, 1/s, 1/s^2, 1/s^3] */
void fr3_transfer_basis(const double t[1], const double t_f[1], double S[4]);

/* d <seed, Y_b> / d (q, dq, ddq), the adjoint of Eq. 3.29. 3183 operations, at most 40848 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], seed 7 x 43 [d cost / d Y_b] -> gradient 3 x 7 [d cost / d (q, dq, ddq)] */
void fr3_regressor_adjoint(const double q[7], const double dq[7], const double ddq[7], const double seed[301], double gradient[21]);

/* tau of Eq. 4.3 and its derivatives by q, dq and ddq, the last one M(q). 5174 operations, at most 67976 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], pi [SI] -> tau [N*m], dtau_dq 7 x 7 [d tau / d q], dtau_dv 7 x 7 [d tau / d dq], dtau_da 7 x 7 [d tau / d ddq] */
void fr3_torque_derivatives(const double q[7], const double dq[7], const double ddq[7], const double pi[70], double tau[7], double dtau_dq[49], double dtau_dv[49], double dtau_da[49]);

/* d tau / d t = dtau_dq dq + dtau_dv ddq + dtau_da dddq. 1588 operations, at most 23888 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], dddq [rad/s^3], pi [SI] -> tau_rate [(N*m)/s] */
void fr3_torque_rate(const double q[7], const double dq[7], const double ddq[7], const double dddq[7], const double pi[70], double tau_rate[7]);

/* d (seed . d tau / d t) / d (q, dq, ddq, dddq). 4305 operations, at most 54976 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], dddq [rad/s^3], pi [SI], seed [d cost / d tau_rate] -> gradient 4 x 7 [d cost / d (q, dq, ddq, dddq)] */
void fr3_torque_rate_adjoint(const double q[7], const double dq[7], const double ddq[7], const double dddq[7], const double pi[70], const double seed[7], double gradient[28]);

/* tau of Eq. 4.3 and its two first derivatives in time along a motion. 3109 operations, at most 40440 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], dddq [rad/s^3], ddddq [rad/s^4], pi [SI] -> tau [N*m], dtau [(N*m)/s], ddtau [(N*m)/s^2] */
void fr3_torque_course(const double q[7], const double dq[7], const double ddq[7], const double dddq[7], const double ddddq[7], const double pi[70], double tau[7], double dtau[7], double ddtau[7]);

/* place and velocity v = dp_dq dq of the tip in the base frame; d v / d dq is dp_dq. 497 operations, at most 10392 bytes of stack.
 * q [rad], dq [rad/s] -> p [m], v [m/s], dp_dq 3 x 7 [d p / d q], dv_dq 3 x 7 [d v / d q] */
void fr3_tip_motion(const double q[7], const double dq[7], double p[3], double v[3], double dp_dq[21], double dv_dq[21]);

/* distance of the capsules of each pair, negative where they overlap. 1795 operations, at most 27632 bytes of stack.
 * q [rad] -> distance [m], jacobian 12 x 7 [d distance / d q] */
void fr3_clearance(const double q[7], double distance[12], double jacobian[84]);

/* least n.x - d over each moving capsule, plane = (n, d) with a unit normal n. 707 operations, at most 13800 bytes of stack.
 * q [rad], plane [1, m] -> distance [m], jacobian 7 x 7 [d distance / d q] */
void fr3_plane_clearance(const double q[7], const double plane[4], double distance[7], double jacobian[49]);

/* sup |tau| and of its derivatives in time, from q_sup[k] = sup |d^k q / dt^k|. 1077 operations, at most 16928 bytes of stack.
 * q_sup 6 x 7 [(rad, rad/s, ...)], pi [SI] -> tau_sup 4 x 7 [(N*m, /s, /s^2, /s^3)] */
void fr3_torque_bounds(const double q_sup[42], const double pi[70], double tau_sup[28]);

/* sup |p| of the tip and of its derivatives in time, from sup |d^k q / dt^k|. 154 operations, at most 5888 bytes of stack.
 * q_sup 4 x 7 [(rad, rad/s, ...)] -> p_sup [(m, m/s, m/s^2, m/s^3)] */
void fr3_tip_bounds(const double q_sup[28], double p_sup[4]);

/* sup of the speed of the origin of link i by joint j, and of the joint's turning. 22 operations, at most 5256 bytes of stack.
 * q_sup 2 x 7 [(rad, rad/s, ...)] -> origin 7 x 7 [m/s], turn [rad/s] */
void fr3_speed_bounds(const double q_sup[14], double origin[49], double turn[7]);

/* C(q, dq) of Christoffel symbols: h = C dq - tau_grav, dM/dt - 2 C is skew-symmetric. 2702 operations, at most 38176 bytes of stack.
 * q [rad], dq [rad/s], pi [SI] -> C 7 x 7 [d (C dq) / d dq / 2] */
void fr3_coriolis_matrix(const double q[7], const double dq[7], const double pi[70], double C[49]);

/* Y pi = M(q) ddq_r + C(q, dq) dq_r - tau_grav(q), Slotine & Li 1987. 2793 operations, at most 43640 bytes of stack.
 * q [rad], dq [rad/s], dq_r [rad/s], ddq_r [rad/s^2] -> Y 7 x 70 [d tau / d pi] */
void fr3_slotine_li_regressor(const double q[7], const double dq[7], const double dq_r[7], const double ddq_r[7], double Y[490]);

/* linear, then angular velocity J dq of the frames of all links and of the tip, in axes of the base, one below the other. 300 operations, at most 13440 bytes of stack.
 * q [rad] -> J 48 x 7 [m, 1] */
void fr3_frame_jacobians(const double q[7], double J[336]);

/* S = B I^-1 B', the inverse of M(q) of all joints is at most S for every q. 415 operations, at most 10056 bytes of stack.
 * pi [SI] -> S 7 x 7 [d ddq / d tau] */
void fr3_mobility_bound(const double pi[70], double S[49]);

/* Length of beta, and the side of the statistics' factor, whose last column is that of tau. */
enum { FR3_BASE = 43, FR3_STATISTICS = 44 };

/* One more sample: factor'factor becomes forgetting factor'factor + [Y_b tau]' W [Y_b tau]. The
 * factor is upper triangular, row-major, begins as zeros, and keeps its diagonal nonnegative;
 * forgetting lies in (0, 1], weight is the diagonal of W. The solution of least squares is that of
 * the triangular system factor[0..BASE)[0..BASE) beta = factor[0..BASE)[BASE]. See update.c. */
void fr3_statistics_update(double factor[1936], double forgetting, const double q[7], const double dq[7], const double ddq[7], const double tau[7], const double weight[7]);

/* L = (||R y - r||^2 + rest) scale, y = [K pi; psi]; R is upper triangular, column after column. */
typedef struct {
    const double *factor, *target;
    double rest, scale;
} fr3_least_squares;

enum {
    FR3_PATIENCE = 1,
    FR3_DIVERGED,
    FR3_CONVERGED,
    FR3_STALLED
};

/* Adam in x = [lambda; psi], see descent.c. x, m, v, best_x are `padded` long, a multiple of 8, and
 * zero beyond `size`; factors have `equations` rows and columns, a multiple of 8 too. batch = 0
 * descends on `training`, else on mini-batches: rows names batch samples per iteration,
 * each sin q1, cos q1, sin q2 ..., dq, ddq, tau, n columns_per_joint columns and q, filled up to a
 * multiple of 8, `width`. work holds 8 (width + size) + (4 + equations) equations + padded numbers.
 * Arrays that begin at a multiple of 64 bytes are read faster. */
typedef struct {
    long size, padded, equations;
    fr3_least_squares training, held;
    double rate, beta1, beta2, epsilon, threshold;
    long validate_every, patience;
    double *x, *m, *v, *best_x;
    double best, power1, power2;
    long step, improved_at, finished, traced;
    double *training_trace, *held_trace;
    long batch, columns_per_joint;
    const long *rows;
    const double *samples, *weight;
    double *work;
} fr3_adam_job;

/* Levenberg-Marquardt in x = [lambda; psi], or [theta; psi] with the log-Cholesky coordinates theta
 * where `cholesky` is set, see descent.c; damping = 0 at the start, growth = 2.
 * work holds equations (size + 2 equations + 3) + 2 size numbers. */
typedef struct {
    long size, equations, cholesky;
    fr3_least_squares training;
    double first_damping, step_tolerance, decrease_tolerance;
    double *x, *trace;
    double loss, damping, growth;
    long step, finished, traced;
    double *work;
} fr3_levenberg_job;

/* The cost (||A pi - b||^2 + rest) / 2 count + gamma sum_k share_k (slope_k.pi_k - log det P_k) of
 * `links` bodies, minimised for one gamma after the other, each from the answer to the last; see
 * convex.c. pi is where the first begins, P > 0. A is stored row after row, 10 numbers per
 * body and each row filled with zeros to a multiple of 8, `width`; slope and points likewise. Of every gamma: the
 * minimiser, the loss there, the Newton decrement and the steps; `converged` counts those whose decrement fell below
 * `tolerance` gamma; the first that does not within `most_steps` is the last. work holds FR3_CONVEX_WORK(rows, width) numbers. */
typedef struct {
    long links, width, rows;
    const double *factor, *target;
    double rest, count;
    const double *slope, *share, *gamma;
    long gammas, most_steps;
    double tolerance;
    double *pi, *points, *losses, *decrements;
    long *steps;
    long converged;
    double *work;
} fr3_convex_job;

#define FR3_CONVEX_WORK(rows, width) (2 * (width) * (width) + 5 * (width) + 2 * (rows))

/* Identification while the robot moves, see online.c. `pi` are the parameters found last, `count` the
 * samples that are not forgotten, `rejected` those that were not finite, `variance` the weighted
 * residual's, `steps` Newton's last ones. */
typedef struct {
    double forgetting, trust, count, variance;
    long steps, rejected;
    double factor[1936];
    double pi[72], point[72], slope[72], share[7];
    double rows[3096], target[43];
    double work[FR3_CONVEX_WORK(43, 72)];
} fr3_online;

/* An empty state around a first guess, whose thin axes are thickened; trust is 16 for a model from CAD,
 * 1 for none. 0 if a body of pi0 cannot exist, or forgetting lies outside (0, 1]. */
int fr3_online_start(fr3_online *state, const double pi0[70], double forgetting, double trust);

/* One more sample; 0 if it was not finite and left out. */
int fr3_online_sample(fr3_online *state, const double q[7], const double dq[7], const double ddq[7], const double tau[7], const double weight[7]);

/* New `pi` by fr3_<level>_convex of convex.c in at most `most_steps` steps of Newton; 1 when it
 * converged, else pi is the best so far (0 also with too few samples, pi is then as it was). */
int fr3_online_solve(fr3_online *state, void (*convex)(fr3_convex_job *jobs, long count), long most_steps);

/* A trajectory's cost, see excitation.c. `basis` holds phi, phi' and phi'' of every harmonic at the
 * samples, by tiles of 8 samples: tile, derivative, harmonic, sample; samples beyond the last are 0.
 * `work`: as many numbers as <level>_excitation_work says, zeros before the first call. One job
 * serves one thread at a time. `deficient`: the regressor has no full rank, to rounding. */
typedef struct {
    long samples, harmonics;
    const double *basis, *home;
    double *work;
    double value, lowest, highest;
    long deficient;
} fr3_excitation_job;

enum {
    FR3_NOT_POSITIVE = 1, /* M + J has no positive pivots: no body moves like that */
    FR3_RAN_AWAY
};

/* The robot under computed torque, see closed_loop.c. n joints; per period `reference` holds q_d,
 * dq_d, ddq_d, `noise` what the controller sees too much of q and dq (0: nothing), and `log`
 * receives q, dq, ddq, the torque of the motors and that behind the rotors, tau - J ddq.
 * `state` is q, dq at the beginning and goes on; done = status = 0 at the start. Stops with a
 * status before the period that fails. rotor: J of the plant; model and model_rotor: what the
 * controller believes. */
typedef struct {
    long substeps;
    double period, coulomb_speed;
    const double *reference, *noise;
    const double *pi, *rotor, *viscous, *coulomb, *offset;
    const double *model, *model_rotor, *stiffness, *damping;
    double *state, *log;
    long done, status;
} fr3_closed_loop_job;

/* Goes on for so many periods. */
void fr3_closed_loop(fr3_closed_loop_job *job, long periods);

void fr3_energy_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, double *E_b);
void fr3_link_poses_batch(long n, const double *q, long q_step, double *H);
void fr3_cholesky_from_pi_batch(long n, const double *pi, long pi_step, double *theta);
void fr3_lam_from_pi_batch(long n, const double *pi, long pi_step, double *lam);
void fr3_nearest_realisable_batch(long n, const double *pi, long pi_step, const double *floor, long floor_step, double *realisable);
void fr3_inertia_matrix_batch(long n, const double *lam, long lam_step, double *M);
void fr3_pseudo_inertia_batch(long n, const double *pi, long pi_step, double *P);
void fr3_harmonic_basis_batch(long n, const double *m, long m_step, const double *t, long t_step, const double *t_f, long t_f_step, double *phi);
void fr3_transfer_basis_batch(long n, const double *t, long t_step, const double *t_f, long t_f_step, double *S);
void fr3_torque_derivatives_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *pi, long pi_step, double *tau, double *dtau_dq, double *dtau_dv, double *dtau_da);
void fr3_torque_rate_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *dddq, long dddq_step, const double *pi, long pi_step, double *tau_rate);
void fr3_torque_rate_adjoint_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *dddq, long dddq_step, const double *pi, long pi_step, const double *seed, long seed_step, double *gradient);
void fr3_torque_course_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *dddq, long dddq_step, const double *ddddq, long ddddq_step, const double *pi, long pi_step, double *tau, double *dtau, double *ddtau);
void fr3_tip_motion_batch(long n, const double *q, long q_step, const double *dq, long dq_step, double *p, double *v, double *dp_dq, double *dv_dq);
void fr3_plane_clearance_batch(long n, const double *q, long q_step, const double *plane, long plane_step, double *distance, double *jacobian);
void fr3_torque_bounds_batch(long n, const double *q_sup, long q_sup_step, const double *pi, long pi_step, double *tau_sup);
void fr3_tip_bounds_batch(long n, const double *q_sup, long q_sup_step, double *p_sup);
void fr3_speed_bounds_batch(long n, const double *q_sup, long q_sup_step, double *origin, double *turn);
void fr3_coriolis_matrix_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *pi, long pi_step, double *C);
void fr3_slotine_li_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *dq_r, long dq_r_step, const double *ddq_r, long ddq_r_step, double *Y);
void fr3_frame_jacobians_batch(long n, const double *q, long q_step, double *J);
void fr3_mobility_bound_batch(long n, const double *pi, long pi_step, double *S);

#ifdef __cplusplus
}
#define FR3_C extern "C"
#else
#define FR3_C extern
#endif

/* FR3_MANY(v3); outside of a function declares the functions on many samples of a level (v4, v3, v2,
 * neon, portable), see README.md: sample i of input x begins at x + i x_step, and a tile is 8 samples. */
#define FR3_MANY(level) \
    FR3_C void fr3_##level##_base_inverse_dynamics_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *beta, long beta_step, double *tau); \
    FR3_C void fr3_##level##_base_inverse_dynamics_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, const double *beta, double *tau); \
    FR3_C void fr3_##level##_inverse_dynamics_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *pi, long pi_step, double *tau); \
    FR3_C void fr3_##level##_inverse_dynamics_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, const double *pi, double *tau); \
    FR3_C void fr3_##level##_torque_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *lam, long lam_step, double *tau); \
    FR3_C void fr3_##level##_torque_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, const double *lam, double *tau); \
    FR3_C void fr3_##level##_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, double *Y); \
    FR3_C void fr3_##level##_regressor_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, double *Y); \
    FR3_C void fr3_##level##_torque_jacobian_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *lam, long lam_step, double *jacobian); \
    FR3_C void fr3_##level##_torque_jacobian_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, const double *lam, double *jacobian); \
    FR3_C void fr3_##level##_base_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, double *Y_b); \
    FR3_C void fr3_##level##_base_regressor_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, double *Y_b); \
    FR3_C void fr3_##level##_momentum_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, double *P_b, double *R_b); \
    FR3_C void fr3_##level##_momentum_regressor_tiles(long tiles, const double *sc, const double *q, const double *dq, double *P_b, double *R_b); \
    FR3_C void fr3_##level##_base_parameters_batch(long n, const double *pi, long pi_step, double *beta); \
    FR3_C void fr3_##level##_base_parameters_tiles(long tiles, const double *sc, const double *pi, double *beta); \
    FR3_C void fr3_##level##_base_adjoint_batch(long n, const double *slope, long slope_step, double *gradient); \
    FR3_C void fr3_##level##_base_adjoint_tiles(long tiles, const double *sc, const double *slope, double *gradient); \
    FR3_C void fr3_##level##_mass_matrix_batch(long n, const double *q, long q_step, const double *pi, long pi_step, double *M); \
    FR3_C void fr3_##level##_mass_matrix_tiles(long tiles, const double *sc, const double *q, const double *pi, double *M); \
    FR3_C void fr3_##level##_bias_forces_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *pi, long pi_step, double *h); \
    FR3_C void fr3_##level##_bias_forces_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *pi, double *h); \
    FR3_C void fr3_##level##_forward_dynamics_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *tau, long tau_step, const double *pi, long pi_step, const double *rotor, long rotor_step, double *ddq); \
    FR3_C void fr3_##level##_forward_dynamics_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *tau, const double *pi, const double *rotor, double *ddq); \
    FR3_C void fr3_##level##_end_effector_batch(long n, const double *q, long q_step, double *H); \
    FR3_C void fr3_##level##_end_effector_tiles(long tiles, const double *sc, const double *q, double *H); \
    FR3_C void fr3_##level##_loss_gradient_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *tau, long tau_step, const double *weight, long weight_step, const double *beta, long beta_step, double *loss, double *gradient, double *residual); \
    FR3_C void fr3_##level##_pi_from_lam_batch(long n, const double *lam, long lam_step, double *pi); \
    FR3_C void fr3_##level##_pi_from_lam_tiles(long tiles, const double *sc, const double *lam, double *pi); \
    FR3_C void fr3_##level##_pi_jacobian_batch(long n, const double *lam, long lam_step, double *pi, double *jacobian); \
    FR3_C void fr3_##level##_pi_jacobian_tiles(long tiles, const double *sc, const double *lam, double *pi, double *jacobian); \
    FR3_C void fr3_##level##_pi_frame_batch(long n, const double *lam, long lam_step, double *pi, double *frame); \
    FR3_C void fr3_##level##_pi_frame_tiles(long tiles, const double *sc, const double *lam, double *pi, double *frame); \
    FR3_C void fr3_##level##_pi_adjoint_batch(long n, const double *lam, long lam_step, const double *frame, long frame_step, const double *slope, long slope_step, double *gradient); \
    FR3_C void fr3_##level##_pi_adjoint_tiles(long tiles, const double *sc, const double *lam, const double *frame, const double *slope, double *gradient); \
    FR3_C void fr3_##level##_cholesky_jacobian_batch(long n, const double *theta, long theta_step, double *pi, double *jacobian); \
    FR3_C void fr3_##level##_cholesky_jacobian_tiles(long tiles, const double *sc, const double *theta, double *pi, double *jacobian); \
    FR3_C void fr3_##level##_barrier_batch(long n, const double *pi, long pi_step, double *pivot, double *log_det, double *traces, double *curvature); \
    FR3_C void fr3_##level##_barrier_tiles(long tiles, const double *sc, const double *pi, double *pivot, double *log_det, double *traces, double *curvature); \
    FR3_C void fr3_##level##_regressor_adjoint_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *seed, long seed_step, double *gradient); \
    FR3_C void fr3_##level##_regressor_adjoint_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, const double *seed, double *gradient); \
    FR3_C void fr3_##level##_clearance_batch(long n, const double *q, long q_step, double *distance, double *jacobian); \
    FR3_C void fr3_##level##_clearance_tiles(long tiles, const double *sc, const double *q, double *distance, double *jacobian)

#endif
