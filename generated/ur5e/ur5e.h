/* ur5e: kernels written by symgen 0.1.0. Arrays are dense and row-major, units SI, outputs
 * overlap no inputs. No function allocates, locks or remembers: any thread may call any of them.
 *
 * joints, the order of q, dq [rad/s or m/s], ddq and tau:
 *     shoulder_pan_joint, shoulder_lift_joint, elbow_joint, wrist_1_joint, wrist_2_joint, wrist_3_joint
 * pi, of shoulder_link, upper_arm_link, forearm_link, wrist_1_link, wrist_2_link, wrist_3_link in turn:
 *     m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ [kg, kg m, kg m^2], inertia about the link's origin
 * lam, likewise: mu, x, y, z, omega1, omega2, omega3, a, b, c [ln kg, m, rad, kg^(1/2) m]
 * gravity: 0.0, 0.0, -9.81 m/s^2 in the frame of base
 * beta: the 36 combinations of pi that ur5e_base_parameters makes
 * Shapes, limits and the many-sample functions: README.md. */
#ifndef SYMGEN_UR5E_H
#define SYMGEN_UR5E_H

#ifdef __cplusplus
extern "C" {
#endif

/* Ties this code to the manifest.json beside it. */
const char *ur5e_model_hash(void);

/* Instruction set whose functions on many samples, see UR5E_MANY, are the fastest here. */
const char *ur5e_level(void);

/* tau = Y_b(q, dq, ddq) beta, Eq. 3.11. 524 operations, at most 11024 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], beta [SI] -> tau [N*m] */
void ur5e_base_inverse_dynamics(const double q[6], const double dq[6], const double ddq[6], const double beta[36], double tau[6]);

/* tau = Y(q, dq, ddq) pi, Eq. 4.3. 602 operations, at most 15448 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], pi [SI] -> tau [N*m] */
void ur5e_inverse_dynamics(const double q[6], const double dq[6], const double ddq[6], const double pi[60], double tau[6]);

/* tau = Y(q, dq, ddq) pi(lam), Eq. 4.3. 1214 operations, at most 16016 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], lam [lambda] -> tau [N*m] */
void ur5e_torque(const double q[6], const double dq[6], const double ddq[6], const double lam[60], double tau[6]);

/* Y with tau = Y pi, Eq. 3.1. 833 operations, at most 20224 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2] -> Y 6 x 60 [d tau / d pi] */
void ur5e_regressor(const double q[6], const double dq[6], const double ddq[6], double Y[360]);

/* d tau / d lam = Y blockdiag(d pi / d lam), Eqs. 4.34-4.36. 5113 operations, at most 28088 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], lam [lambda] -> jacobian 6 x 60 [d tau / d lam] */
void ur5e_torque_jacobian(const double q[6], const double dq[6], const double ddq[6], const double lam[60], double jacobian[360]);

/* Y_b with tau = Y_b beta, Eq. 3.11. 656 operations, at most 16192 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2] -> Y_b 6 x 36 [d tau / d beta] */
void ur5e_base_regressor(const double q[6], const double dq[6], const double ddq[6], double Y_b[216]);

/* tau = d(P_b beta)/dt - R_b beta, p = M dq = P_b beta, r = d(T - U)/dq = R_b beta. 1160 operations, at most 23944 bytes of stack.
 * q [rad], dq [rad/s] -> P_b 6 x 36 [d p / d beta], R_b 6 x 36 [d r / d beta] */
void ur5e_momentum_regressor(const double q[6], const double dq[6], double P_b[216], double R_b[216]);

/* dq.tau = d(E_b beta)/dt, T + U = E_b beta + const. 208 operations, at most 7376 bytes of stack.
 * q [rad], dq [rad/s] -> E_b [d (T + U) / d beta] */
void ur5e_energy_regressor(const double q[6], const double dq[6], double E_b[36]);

/* beta = K pi, Eq. 3.11. 104 operations, at most 5888 bytes of stack.
 * pi [SI] -> beta [SI] */
void ur5e_base_parameters(const double pi[60], double beta[36]);

/* K' slope, the adjoint of beta = K pi. 53 operations, at most 5664 bytes of stack.
 * slope [d cost / d beta] -> gradient [d cost / d pi] */
void ur5e_base_adjoint(const double slope[36], double gradient[60]);

/* M(q), Eq. 2.34. 419 operations, at most 10504 bytes of stack.
 * q [rad], pi [SI] -> M 6 x 6 [d tau / d ddq] */
void ur5e_mass_matrix(const double q[6], const double pi[60], double M[36]);

/* h = C(q, dq) dq - tau_grav, Eq. 2.34. 571 operations, at most 19568 bytes of stack.
 * q [rad], dq [rad/s], pi [SI] -> h [N*m] */
void ur5e_bias_forces(const double q[6], const double dq[6], const double pi[60], double h[6]);

/* ddq = (M + diag(J))^-1 (tau - h), J of the rotors. 1067 operations, at most 18232 bytes of stack.
 * q [rad], dq [rad/s], tau [N*m], pi [SI], rotor [kg*m^2] -> ddq [rad/s^2] */
void ur5e_forward_dynamics(const double q[6], const double dq[6], const double tau[6], const double pi[60], const double rotor[6], double ddq[6]);

/* pose of the tip in the base frame, Eq. 2.15. 115 operations, at most 5920 bytes of stack.
 * q [rad] -> H 4 x 4 [1, m] */
void ur5e_end_effector(const double q[6], double H[16]);

/* poses of the links in the base frame, one below the other, Eq. 2.15. 123 operations, at most 7336 bytes of stack.
 * q [rad] -> H 24 x 4 [1, m] */
void ur5e_link_poses(const double q[6], double H[96]);

/* sum of r'Wr/2 and of Y_b'Wr, r = Y_b beta - tau, Eqs. 4.6, 4.32. 812 operations, at most 15320 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], tau [N*m], weight [1], beta [SI] -> loss [1], gradient [d loss / d beta], residual [N*m] */
void ur5e_loss_gradient(const double q[6], const double dq[6], const double ddq[6], const double tau[6], const double weight[6], const double beta[36], double loss[1], double gradient[36], double residual[6]);

/* Eqs. 4.25-4.31. 108 operations, at most 5808 bytes of stack.
 * lam [lambda] -> pi [SI] */
void ur5e_pi_from_lam(const double lam[10], double pi[10]);

/* pi and d pi / d lam of one link. 551 operations, at most 13024 bytes of stack.
 * lam [lambda] -> pi [SI], jacobian 10 x 10 [d pi / d lam] */
void ur5e_pi_jacobian(const double lam[10], double pi[10], double jacobian[100]);

/* pi of one link, and its m, R, B, C for pi_adjoint. 111 operations, at most 6032 bytes of stack.
 * lam [lambda] -> pi [SI], frame [m, R by columns, B, C] */
void ur5e_pi_frame(const double lam[10], double pi[10], double frame[12]);

/* (d pi / d lam)' slope of one link, Eq. 4.32. 171 operations, at most 6136 bytes of stack.
 * lam [lambda], frame [m, R by columns, B, C], slope [d cost / d pi] -> gradient [d cost / d lam] */
void ur5e_pi_adjoint(const double lam[10], const double frame[12], const double slope[10], double gradient[10]);

/* pi and d pi / d theta of one link, P = U(theta) U(theta)'. 98 operations, at most 7064 bytes of stack.
 * theta [log-Cholesky] -> pi [SI], jacobian 10 x 10 [d pi / d theta] */
void ur5e_cholesky_jacobian(const double theta[10], double pi[10], double jacobian[100]);

/* smallest pivot and log det of P, tr(P^-1 B_i), tr(P^-1 B_i P^-1 B_j), B_i = dP/dpi_i. 558 operations, at most 12872 bytes of stack.
 * pi [SI] -> pivot [SI], log_det [1], traces [1/SI], curvature 10 x 10 [1/SI^2] */
void ur5e_barrier(const double pi[10], double pivot[1], double log_det[1], double traces[10], double curvature[100]);

/* theta with U(theta) U(theta)' = P; NaN unless P is positive definite. 58 operations, at most 4952 bytes of stack.
 * pi [SI] -> theta [log-Cholesky] */
void ur5e_cholesky_from_pi(const double pi[10], double theta[10]);

/* Eqs. 4.18-4.23. 1491 operations, at most 27464 bytes of stack.
 * pi [SI] -> lam [lambda] */
void ur5e_lam_from_pi(const double pi[10], double lam[10]);

/* pi with the eigenvalues of Sigma_com raised to floor * trace + m (1 mm)^2. 1396 operations, at most 25872 bytes of stack.
 * pi [SI], floor [1] -> realisable [SI] */
void ur5e_nearest_realisable(const double pi[10], const double floor[1], double realisable[10]);

/* M(lam), Eq. 4.14 (linear part first). 111 operations, at most 6368 bytes of stack.
 * lam [lambda] -> M 6 x 6 [SI] */
void ur5e_inertia_matrix(const double lam[10], double M[36]);

/* P(pi), Eqs. 3.9, 3.10. 9 operations, at most 4480 bytes of stack.
 * pi [SI] -> P 4 x 4 [SI] */
void ur5e_pseudo_inertia(const double pi[10], double P[16]);

/* cos(2 pi m s) - 1 + 2 pi^2 m^2 s^2 (1-s)^2, s = t/t_f, Eqs. 3.24-3.27. 54 operations, at most 4888 bytes of stack.
 * m [1], t [s], t_f [s] -> phi [1, 1/s, 1/s^2, 1/s^3] */
void ur5e_harmonic_basis(const double m[1], const double t[1], const double t_f[1], double phi[4]);

/* 10 s^3 - 15 s^4 + 6 s^5, s = t/t_f, Eqs. 3.25, 3.27. 46 operations, at most 4760 bytes of stack.
 * t [s], t_f [s] -> S [1, 1/s, 1/s^2, 1/s^3] */
void ur5e_transfer_basis(const double t[1], const double t_f[1], double S[4]);

/* d <seed, Y_b> / d (q, dq, ddq), the adjoint of Eq. 3.29. 1988 operations, at most 27680 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], seed 6 x 36 [d cost / d Y_b] -> gradient 3 x 6 [d cost / d (q, dq, ddq)] */
void ur5e_regressor_adjoint(const double q[6], const double dq[6], const double ddq[6], const double seed[216], double gradient[18]);

/* tau of Eq. 4.3 and its derivatives by q, dq and ddq, the last one M(q). 3278 operations, at most 45952 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], pi [SI] -> tau [N*m], dtau_dq 6 x 6 [d tau / d q], dtau_dv 6 x 6 [d tau / d dq], dtau_da 6 x 6 [d tau / d ddq] */
void ur5e_torque_derivatives(const double q[6], const double dq[6], const double ddq[6], const double pi[60], double tau[6], double dtau_dq[36], double dtau_dv[36], double dtau_da[36]);

/* d tau / d t = dtau_dq dq + dtau_dv ddq + dtau_da dddq. 1280 operations, at most 20264 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], dddq [rad/s^3], pi [SI] -> tau_rate [(N*m)/s] */
void ur5e_torque_rate(const double q[6], const double dq[6], const double ddq[6], const double dddq[6], const double pi[60], double tau_rate[6]);

/* d (seed . d tau / d t) / d (q, dq, ddq, dddq). 3429 operations, at most 44864 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], dddq [rad/s^3], pi [SI], seed [d cost / d tau_rate] -> gradient 4 x 6 [d cost / d (q, dq, ddq, dddq)] */
void ur5e_torque_rate_adjoint(const double q[6], const double dq[6], const double ddq[6], const double dddq[6], const double pi[60], const double seed[6], double gradient[24]);

/* tau of Eq. 4.3 and its two first derivatives in time along a motion. 2556 operations, at most 34384 bytes of stack.
 * q [rad], dq [rad/s], ddq [rad/s^2], dddq [rad/s^3], ddddq [rad/s^4], pi [SI] -> tau [N*m], dtau [(N*m)/s], ddtau [(N*m)/s^2] */
void ur5e_torque_course(const double q[6], const double dq[6], const double ddq[6], const double dddq[6], const double ddddq[6], const double pi[60], double tau[6], double dtau[6], double ddtau[6]);

/* place and velocity v = dp_dq dq of the tip in the base frame; d v / d dq is dp_dq. 355 operations, at most 8784 bytes of stack.
 * q [rad], dq [rad/s] -> p [m], v [m/s], dp_dq 3 x 6 [d p / d q], dv_dq 3 x 6 [d v / d q] */
void ur5e_tip_motion(const double q[6], const double dq[6], double p[3], double v[3], double dp_dq[18], double dv_dq[18]);

/* distance of the capsules of each pair, negative where they overlap. 1562 operations, at most 25008 bytes of stack.
 * q [rad] -> distance [m], jacobian 14 x 6 [d distance / d q] */
void ur5e_clearance(const double q[6], double distance[14], double jacobian[84]);

/* least n.x - d over each moving capsule, plane = (n, d) with a unit normal n. 527 operations, at most 11784 bytes of stack.
 * q [rad], plane [1, m] -> distance [m], jacobian 6 x 6 [d distance / d q] */
void ur5e_plane_clearance(const double q[6], const double plane[4], double distance[6], double jacobian[36]);

/* sup |tau| and of its derivatives in time, from q_sup[k] = sup |d^k q / dt^k|. 915 operations, at most 15040 bytes of stack.
 * q_sup 6 x 6 [(rad, rad/s, ...)], pi [SI] -> tau_sup 4 x 6 [(N*m, /s, /s^2, /s^3)] */
void ur5e_torque_bounds(const double q_sup[36], const double pi[60], double tau_sup[24]);

/* sup |p| of the tip and of its derivatives in time, from sup |d^k q / dt^k|. 110 operations, at most 5392 bytes of stack.
 * q_sup 4 x 6 [(rad, rad/s, ...)] -> p_sup [(m, m/s, m/s^2, m/s^3)] */
void ur5e_tip_bounds(const double q_sup[24], double p_sup[4]);

/* sup of the speed of the origin of link i by joint j, and of the joint's turning. 20 operations, at most 4952 bytes of stack.
 * q_sup 2 x 6 [(rad, rad/s, ...)] -> origin 6 x 6 [m/s], turn [rad/s] */
void ur5e_speed_bounds(const double q_sup[12], double origin[36], double turn[6]);

/* C(q, dq) of Christoffel symbols: h = C dq - tau_grav, dM/dt - 2 C is skew-symmetric. 1565 operations, at most 25096 bytes of stack.
 * q [rad], dq [rad/s], pi [SI] -> C 6 x 6 [d (C dq) / d dq / 2] */
void ur5e_coriolis_matrix(const double q[6], const double dq[6], const double pi[60], double C[36]);

/* Y pi = M(q) ddq_r + C(q, dq) dq_r - tau_grav(q), Slotine & Li 1987. 1508 operations, at most 28448 bytes of stack.
 * q [rad], dq [rad/s], dq_r [rad/s], ddq_r [rad/s^2] -> Y 6 x 60 [d tau / d pi] */
void ur5e_slotine_li_regressor(const double q[6], const double dq[6], const double dq_r[6], const double ddq_r[6], double Y[360]);

/* linear, then angular velocity J dq of the frames of all links and of the tip, in axes of the base, one below the other. 180 operations, at most 10544 bytes of stack.
 * q [rad] -> J 42 x 6 [m, 1] */
void ur5e_frame_jacobians(const double q[6], double J[252]);

/* S = B I^-1 B', the inverse of M(q) of all joints is at most S for every q. 339 operations, at most 8968 bytes of stack.
 * pi [SI] -> S 6 x 6 [d ddq / d tau] */
void ur5e_mobility_bound(const double pi[60], double S[36]);

/* Length of beta, and the side of the statistics' factor, whose last column is that of tau. */
enum { UR5E_BASE = 36, UR5E_STATISTICS = 37 };

/* One more sample: factor'factor becomes forgetting factor'factor + [Y_b tau]' W [Y_b tau]. The
 * factor is upper triangular, row-major, begins as zeros, and keeps its diagonal nonnegative;
 * forgetting lies in (0, 1], weight is the diagonal of W. The solution of least squares is that of
 * the triangular system factor[0..BASE)[0..BASE) beta = factor[0..BASE)[BASE]. See update.c. */
void ur5e_statistics_update(double factor[1369], double forgetting, const double q[6], const double dq[6], const double ddq[6], const double tau[6], const double weight[6]);

/* L = (||R y - r||^2 + rest) scale, y = [K pi; psi]; R is upper triangular, column after column. */
typedef struct {
    const double *factor, *target;
    double rest, scale;
} ur5e_least_squares;

enum {
    UR5E_PATIENCE = 1,
    UR5E_DIVERGED,
    UR5E_CONVERGED,
    UR5E_STALLED
};

/* Adam in x = [lambda; psi], see descent.c. x, m, v, best_x are `padded` long, a multiple of 8, and
 * zero beyond `size`; factors have `equations` rows and columns, a multiple of 8 too. batch = 0
 * descends on `training`, else on mini-batches: rows names batch samples per iteration,
 * each sin q1, cos q1, sin q2 ..., dq, ddq, tau, n columns_per_joint columns and q, filled up to a
 * multiple of 8, `width`. work holds 8 (width + size) + (4 + equations) equations + padded numbers.
 * Arrays that begin at a multiple of 64 bytes are read faster. */
typedef struct {
    long size, padded, equations;
    ur5e_least_squares training, held;
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
} ur5e_adam_job;

/* Levenberg-Marquardt in x = [lambda; psi], or [theta; psi] with the log-Cholesky coordinates theta
 * where `cholesky` is set, see descent.c; damping = 0 at the start, growth = 2.
 * work holds equations (size + 2 equations + 3) + 2 size numbers. */
typedef struct {
    long size, equations, cholesky;
    ur5e_least_squares training;
    double first_damping, step_tolerance, decrease_tolerance;
    double *x, *trace;
    double loss, damping, growth;
    long step, finished, traced;
    double *work;
} ur5e_levenberg_job;

/* The cost (||A pi - b||^2 + rest) / 2 count + gamma sum_k share_k (slope_k.pi_k - log det P_k) of
 * `links` bodies, minimised for one gamma after the other, each from the answer to the last; see
 * convex.c. pi is where the first begins, P > 0. A is stored row after row, 10 numbers per
 * body and each row filled with zeros to a multiple of 8, `width`; slope and points likewise. Of every gamma: the
 * minimiser, the loss there, the Newton decrement and the steps; `converged` counts those whose decrement fell below
 * `tolerance` gamma; the first that does not within `most_steps` is the last. work holds UR5E_CONVEX_WORK(rows, width) numbers. */
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
} ur5e_convex_job;

#define UR5E_CONVEX_WORK(rows, width) (2 * (width) * (width) + 5 * (width) + 2 * (rows))

/* Identification while the robot moves, see online.c. `pi` are the parameters found last, `count` the
 * samples that are not forgotten, `rejected` those that were not finite, `variance` the weighted
 * residual's, `steps` Newton's last ones. */
typedef struct {
    double forgetting, trust, count, variance;
    long steps, rejected;
    double factor[1369];
    double pi[64], point[64], slope[64], share[6];
    double rows[2304], target[36];
    double work[UR5E_CONVEX_WORK(36, 64)];
} ur5e_online;

/* An empty state around a first guess, whose thin axes are thickened; trust is 16 for a model from CAD,
 * 1 for none. 0 if a body of pi0 cannot exist, or forgetting lies outside (0, 1]. */
int ur5e_online_start(ur5e_online *state, const double pi0[60], double forgetting, double trust);

/* One more sample; 0 if it was not finite and left out. */
int ur5e_online_sample(ur5e_online *state, const double q[6], const double dq[6], const double ddq[6], const double tau[6], const double weight[6]);

/* New `pi` by ur5e_<level>_convex of convex.c in at most `most_steps` steps of Newton; 1 when it
 * converged, else pi is the best so far (0 also with too few samples, pi is then as it was). */
int ur5e_online_solve(ur5e_online *state, void (*convex)(ur5e_convex_job *jobs, long count), long most_steps);

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
} ur5e_excitation_job;

enum {
    UR5E_NOT_POSITIVE = 1, /* M + J has no positive pivots: no body moves like that */
    UR5E_RAN_AWAY
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
} ur5e_closed_loop_job;

/* Goes on for so many periods. */
void ur5e_closed_loop(ur5e_closed_loop_job *job, long periods);

void ur5e_energy_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, double *E_b);
void ur5e_link_poses_batch(long n, const double *q, long q_step, double *H);
void ur5e_cholesky_from_pi_batch(long n, const double *pi, long pi_step, double *theta);
void ur5e_lam_from_pi_batch(long n, const double *pi, long pi_step, double *lam);
void ur5e_nearest_realisable_batch(long n, const double *pi, long pi_step, const double *floor, long floor_step, double *realisable);
void ur5e_inertia_matrix_batch(long n, const double *lam, long lam_step, double *M);
void ur5e_pseudo_inertia_batch(long n, const double *pi, long pi_step, double *P);
void ur5e_harmonic_basis_batch(long n, const double *m, long m_step, const double *t, long t_step, const double *t_f, long t_f_step, double *phi);
void ur5e_transfer_basis_batch(long n, const double *t, long t_step, const double *t_f, long t_f_step, double *S);
void ur5e_torque_derivatives_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *pi, long pi_step, double *tau, double *dtau_dq, double *dtau_dv, double *dtau_da);
void ur5e_torque_rate_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *dddq, long dddq_step, const double *pi, long pi_step, double *tau_rate);
void ur5e_torque_rate_adjoint_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *dddq, long dddq_step, const double *pi, long pi_step, const double *seed, long seed_step, double *gradient);
void ur5e_torque_course_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *dddq, long dddq_step, const double *ddddq, long ddddq_step, const double *pi, long pi_step, double *tau, double *dtau, double *ddtau);
void ur5e_tip_motion_batch(long n, const double *q, long q_step, const double *dq, long dq_step, double *p, double *v, double *dp_dq, double *dv_dq);
void ur5e_plane_clearance_batch(long n, const double *q, long q_step, const double *plane, long plane_step, double *distance, double *jacobian);
void ur5e_torque_bounds_batch(long n, const double *q_sup, long q_sup_step, const double *pi, long pi_step, double *tau_sup);
void ur5e_tip_bounds_batch(long n, const double *q_sup, long q_sup_step, double *p_sup);
void ur5e_speed_bounds_batch(long n, const double *q_sup, long q_sup_step, double *origin, double *turn);
void ur5e_coriolis_matrix_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *pi, long pi_step, double *C);
void ur5e_slotine_li_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *dq_r, long dq_r_step, const double *ddq_r, long ddq_r_step, double *Y);
void ur5e_frame_jacobians_batch(long n, const double *q, long q_step, double *J);
void ur5e_mobility_bound_batch(long n, const double *pi, long pi_step, double *S);

#ifdef __cplusplus
}
#define UR5E_C extern "C"
#else
#define UR5E_C extern
#endif

/* UR5E_MANY(v3); outside of a function declares the functions on many samples of a level (v4, v3, v2,
 * neon, portable), see README.md: sample i of input x begins at x + i x_step, and a tile is 8 samples. */
#define UR5E_MANY(level) \
    UR5E_C void ur5e_##level##_base_inverse_dynamics_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *beta, long beta_step, double *tau); \
    UR5E_C void ur5e_##level##_base_inverse_dynamics_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, const double *beta, double *tau); \
    UR5E_C void ur5e_##level##_inverse_dynamics_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *pi, long pi_step, double *tau); \
    UR5E_C void ur5e_##level##_inverse_dynamics_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, const double *pi, double *tau); \
    UR5E_C void ur5e_##level##_torque_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *lam, long lam_step, double *tau); \
    UR5E_C void ur5e_##level##_torque_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, const double *lam, double *tau); \
    UR5E_C void ur5e_##level##_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, double *Y); \
    UR5E_C void ur5e_##level##_regressor_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, double *Y); \
    UR5E_C void ur5e_##level##_torque_jacobian_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *lam, long lam_step, double *jacobian); \
    UR5E_C void ur5e_##level##_torque_jacobian_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, const double *lam, double *jacobian); \
    UR5E_C void ur5e_##level##_base_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, double *Y_b); \
    UR5E_C void ur5e_##level##_base_regressor_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, double *Y_b); \
    UR5E_C void ur5e_##level##_momentum_regressor_batch(long n, const double *q, long q_step, const double *dq, long dq_step, double *P_b, double *R_b); \
    UR5E_C void ur5e_##level##_momentum_regressor_tiles(long tiles, const double *sc, const double *q, const double *dq, double *P_b, double *R_b); \
    UR5E_C void ur5e_##level##_base_parameters_batch(long n, const double *pi, long pi_step, double *beta); \
    UR5E_C void ur5e_##level##_base_parameters_tiles(long tiles, const double *sc, const double *pi, double *beta); \
    UR5E_C void ur5e_##level##_base_adjoint_batch(long n, const double *slope, long slope_step, double *gradient); \
    UR5E_C void ur5e_##level##_base_adjoint_tiles(long tiles, const double *sc, const double *slope, double *gradient); \
    UR5E_C void ur5e_##level##_mass_matrix_batch(long n, const double *q, long q_step, const double *pi, long pi_step, double *M); \
    UR5E_C void ur5e_##level##_mass_matrix_tiles(long tiles, const double *sc, const double *q, const double *pi, double *M); \
    UR5E_C void ur5e_##level##_bias_forces_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *pi, long pi_step, double *h); \
    UR5E_C void ur5e_##level##_bias_forces_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *pi, double *h); \
    UR5E_C void ur5e_##level##_forward_dynamics_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *tau, long tau_step, const double *pi, long pi_step, const double *rotor, long rotor_step, double *ddq); \
    UR5E_C void ur5e_##level##_forward_dynamics_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *tau, const double *pi, const double *rotor, double *ddq); \
    UR5E_C void ur5e_##level##_end_effector_batch(long n, const double *q, long q_step, double *H); \
    UR5E_C void ur5e_##level##_end_effector_tiles(long tiles, const double *sc, const double *q, double *H); \
    UR5E_C void ur5e_##level##_loss_gradient_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *tau, long tau_step, const double *weight, long weight_step, const double *beta, long beta_step, double *loss, double *gradient, double *residual); \
    UR5E_C void ur5e_##level##_pi_from_lam_batch(long n, const double *lam, long lam_step, double *pi); \
    UR5E_C void ur5e_##level##_pi_from_lam_tiles(long tiles, const double *sc, const double *lam, double *pi); \
    UR5E_C void ur5e_##level##_pi_jacobian_batch(long n, const double *lam, long lam_step, double *pi, double *jacobian); \
    UR5E_C void ur5e_##level##_pi_jacobian_tiles(long tiles, const double *sc, const double *lam, double *pi, double *jacobian); \
    UR5E_C void ur5e_##level##_pi_frame_batch(long n, const double *lam, long lam_step, double *pi, double *frame); \
    UR5E_C void ur5e_##level##_pi_frame_tiles(long tiles, const double *sc, const double *lam, double *pi, double *frame); \
    UR5E_C void ur5e_##level##_pi_adjoint_batch(long n, const double *lam, long lam_step, const double *frame, long frame_step, const double *slope, long slope_step, double *gradient); \
    UR5E_C void ur5e_##level##_pi_adjoint_tiles(long tiles, const double *sc, const double *lam, const double *frame, const double *slope, double *gradient); \
    UR5E_C void ur5e_##level##_cholesky_jacobian_batch(long n, const double *theta, long theta_step, double *pi, double *jacobian); \
    UR5E_C void ur5e_##level##_cholesky_jacobian_tiles(long tiles, const double *sc, const double *theta, double *pi, double *jacobian); \
    UR5E_C void ur5e_##level##_barrier_batch(long n, const double *pi, long pi_step, double *pivot, double *log_det, double *traces, double *curvature); \
    UR5E_C void ur5e_##level##_barrier_tiles(long tiles, const double *sc, const double *pi, double *pivot, double *log_det, double *traces, double *curvature); \
    UR5E_C void ur5e_##level##_regressor_adjoint_batch(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *seed, long seed_step, double *gradient); \
    UR5E_C void ur5e_##level##_regressor_adjoint_tiles(long tiles, const double *sc, const double *q, const double *dq, const double *ddq, const double *seed, double *gradient); \
    UR5E_C void ur5e_##level##_clearance_batch(long n, const double *q, long q_step, double *distance, double *jacobian); \
    UR5E_C void ur5e_##level##_clearance_tiles(long tiles, const double *sc, const double *q, double *distance, double *jacobian)

#endif
