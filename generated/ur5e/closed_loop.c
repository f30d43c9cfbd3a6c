/* ur5e: the robot under computed-torque control, simulated; written by symgen 0.1.0.
 * Needs kernels.c and ur5e.h; no allocation, no globals.
 *
 * Once per period the controller sets tau = ID(q, dq, u; pi_c) + J_c u, u = ddq_d + K_d (dq_d - dq) +
 * K_p (q_d - q), and holds it. The plant (M + J) ddq + h + f(dq) = tau, f = viscous dq + coulomb
 * tanh(dq / coulomb_speed) + offset, goes on by the linearly implicit midpoint rule: order 2 in the
 * step, and stable for friction of any stiffness, whose slope joins the inertia. */
#include <math.h>

#include "ur5e.h"

enum { N = 6 };

/* Beyond, rad or rad/s, m or m/s, the motion has run away. */
#define FAR 1e3

/* x := A^-1 x by A = L D L', overwriting the lower triangle; 0 when A is not positive definite. */
static int solve(double A[N * N], double x[N])
{
    for (int j = 0; j < N; ++j) {
        double d = A[j * N + j];
        for (int k = 0; k < j; ++k) {
            d -= A[j * N + k] * A[j * N + k] * A[k * N + k];
        }
        if (!(d > 0.0 && d < HUGE_VAL)) {
            return 0;
        }
        A[j * N + j] = d;
        for (int i = j + 1; i < N; ++i) {
            double s = A[i * N + j];
            for (int k = 0; k < j; ++k) {
                s -= A[i * N + k] * A[j * N + k] * A[k * N + k];
            }
            A[i * N + j] = s / d;
        }
    }
    for (int i = 0; i < N; ++i) {
        for (int k = 0; k < i; ++k) {
            x[i] -= A[i * N + k] * x[k];
        }
    }
    for (int i = N - 1; i >= 0; --i) {
        x[i] /= A[i * N + i];
        for (int k = i + 1; k < N; ++k) {
            x[i] -= A[k * N + i] * x[k];
        }
    }
    return 1;
}

/* M + J, the force tau - h - f that accelerates it, and the slope of f in dq. */
static void forces(const ur5e_closed_loop_job *job, const double q[N], const double dq[N], const double tau[N], double M[N * N], double force[N], double slope[N])
{
    double h[N];
    ur5e_mass_matrix(q, job->pi, M);
    ur5e_bias_forces(q, dq, job->pi, h);
    for (int i = 0; i < N; ++i) {
        const double t = tanh(dq[i] / job->coulomb_speed);
        M[i * N + i] += job->rotor[i];
        force[i] = tau[i] - h[i] - job->viscous[i] * dq[i] - job->coulomb[i] * t - job->offset[i];
        slope[i] = job->viscous[i] + job->coulomb[i] * (1.0 - t * t) / job->coulomb_speed;
    }
}

/* One step of length 2 `half`; `ddq` receives the acceleration at its beginning where asked for. */
static int step(const ur5e_closed_loop_job *job, double half, const double tau[N], double *q, double *dq, double *ddq)
{
    double M[N * N], A[N * N], a[N], slope[N], q_mid[N], dq_mid[N], a_mid[N];
    forces(job, q, dq, tau, M, a, slope);
    for (int i = 0; i < N * N; ++i) {
        A[i] = M[i];
    }
    if (ddq) {
        for (int i = 0; i < N; ++i) {
            ddq[i] = a[i];
        }
        if (!solve(M, ddq)) {
            return UR5E_NOT_POSITIVE;
        }
    }
    for (int i = 0; i < N; ++i) {
        A[i * N + i] += half * slope[i];
    }
    if (!solve(A, a)) {
        return UR5E_NOT_POSITIVE;
    }
    for (int i = 0; i < N; ++i) {
        dq_mid[i] = dq[i] + half * a[i];
        q_mid[i] = q[i] + half * (dq[i] + dq_mid[i]) / 2.0;
    }
    forces(job, q_mid, dq_mid, tau, A, a_mid, slope);
    for (int i = 0; i < N; ++i) {
        A[i * N + i] += half * slope[i];
        a_mid[i] += half * slope[i] * a[i]; /* f is linearised about dq_mid */
    }
    if (!solve(A, a_mid)) {
        return UR5E_NOT_POSITIVE;
    }
    for (int i = 0; i < N; ++i) {
        const double before = dq[i];
        dq[i] += 2.0 * half * a_mid[i];
        q[i] += half * (before + dq[i]);
        if (!(fabs(q[i]) < FAR && fabs(dq[i]) < FAR)) {
            return UR5E_RAN_AWAY;
        }
    }
    return 0;
}

void ur5e_closed_loop(ur5e_closed_loop_job *job, long periods)
{
    double *q = job->state, *dq = job->state + N;
    const double half = job->period / (2.0 * (double)job->substeps);
    for (const long end = job->done + periods; job->done < end && !job->status; ++job->done) {
        const double *wanted = job->reference + job->done * 3 * N;
        double *log = job->log + job->done * 5 * N, *motor = log + 3 * N;
        double seen[2 * N], u[N];
        for (int i = 0; i < 2 * N; ++i) {
            log[i] = job->state[i];
            seen[i] = log[i] + (job->noise ? job->noise[job->done * 2 * N + i] : 0.0);
        }
        for (int i = 0; i < N; ++i) {
            u[i] = wanted[2 * N + i] + job->damping[i] * (wanted[N + i] - seen[N + i]) + job->stiffness[i] * (wanted[i] - seen[i]);
        }
        ur5e_inverse_dynamics(seen, seen + N, u, job->model, motor);
        for (int i = 0; i < N; ++i) {
            motor[i] += job->model_rotor[i] * u[i];
        }
        for (long s = 0; s < job->substeps && !job->status; ++s) {
            job->status = step(job, half, motor, q, dq, s ? 0 : log + 2 * N);
        }
        if (job->status) {
            break;
        }
        for (int i = 0; i < N; ++i) {
            log[4 * N + i] = motor[i] - job->rotor[i] * log[2 * N + i];
        }
    }
}
