/* ur5e: identification while the robot moves, written by symgen 0.1.0.
 *
 * Every sample joins a triangle of fixed size with a forgetting factor (update.c); from time to time
 * the most probable physically consistent parameters follow from it (convex.c), warm started:
 *
 *     min over pi of (||R K pi - r||^2 + rest) / 2 N + gamma sum_k (slope_k.pi_k - log det P_k),
 *     gamma = trust s^2 / N,  s^2 = rest / (joints N - 36),  N the samples that are not forgotten.
 *
 * No allocation, no globals, bounded time: a sample costs one rank-6 update, a solution a bounded
 * number of Newton steps. Needs kernels.c, update.c, and a level of convex.c with its tiles.c. */
#include <math.h>
#include <string.h>

#include "ur5e.h"

enum { N = 6, BASE = 36, SIZE = BASE + 1, LINKS = 6, PARAMETERS = 10 };
enum { ALL = LINKS * PARAMETERS, WIDTH = (ALL + 7) / 8 * 8 };

/* Noise relative to the torque's size below which data count as exact, squared. */
#define PERFECT 1e-12

/* Thinnest axis of a body of the prior, a share of the sum of the three: a thin axis that is wrong in
 * the first guess would outweigh the data. */
#define THIN 0.05

/* Newton's end, the decrement in units of gamma: so close that the start leaves no trace. */
#define TOLERANCE 1e-12

int ur5e_online_start(ur5e_online *state, const double pi0[ALL], double forgetting, double trust)
{
    const double thin[1] = {THIN};
    double pivot[1], log_det[1], curvature[PARAMETERS * PARAMETERS];
    memset(state, 0, sizeof *state);
    state->forgetting = forgetting;
    state->trust = trust;
    for (int k = 0; k < LINKS; ++k) {
        double *pi = state->pi + k * PARAMETERS;
        ur5e_nearest_realisable(pi0 + k * PARAMETERS, thin, pi);
        ur5e_barrier(pi, pivot, log_det, state->slope + k * PARAMETERS, curvature);
        if (!(pivot[0] > 0.0)) {
            return 0;
        }
        state->share[k] = 1.0;
    }
    return forgetting > 0.0 && forgetting <= 1.0 && trust > 0.0;
}

int ur5e_online_sample(ur5e_online *state, const double q[N], const double dq[N], const double ddq[N], const double tau[N], const double weight[N])
{
    double sum = 0.0;
    for (int i = 0; i < N; ++i) {
        sum += fabs(q[i]) + fabs(dq[i]) + fabs(ddq[i]) + fabs(tau[i]);
    }
    if (!(sum <= 1e30)) { /* a corrupt sample would stay in the triangle for good */
        state->rejected += 1;
        return 0;
    }
    ur5e_statistics_update(state->factor, state->forgetting, q, dq, ddq, tau, weight);
    state->count = state->forgetting * state->count + 1.0;
    return 1;
}

int ur5e_online_solve(ur5e_online *state, void (*convex)(ur5e_convex_job *jobs, long count), long most_steps)
{
    const double corner = state->factor[SIZE * SIZE - 1], rest = corner * corner;
    const double freedom = N * state->count - BASE;
    double explained = 0.0, gamma, loss, decrement;
    long steps;
    if (!(freedom >= 1.0)) {
        return 0;
    }
    for (int r = 0; r < BASE; ++r) {
        ur5e_base_adjoint(state->factor + r * SIZE, state->rows + r * WIDTH);
        state->target[r] = state->factor[r * SIZE + BASE];
        explained += state->target[r] * state->target[r];
    }
    gamma = state->trust * fmax(rest / freedom, PERFECT * explained / state->count) / state->count;
    if (!(gamma > 0.0)) { /* no torque at all */
        return 0;
    }
    ur5e_convex_job job;
    memset(&job, 0, sizeof job);
    job.links = LINKS;
    job.width = WIDTH;
    job.rows = BASE;
    job.factor = state->rows;
    job.target = state->target;
    job.rest = rest;
    job.count = state->count;
    job.slope = state->slope;
    job.share = state->share;
    job.gamma = &gamma;
    job.gammas = 1;
    job.most_steps = most_steps;
    job.tolerance = TOLERANCE;
    job.pi = state->pi;
    job.points = state->point;
    job.losses = &loss;
    job.decrements = &decrement;
    job.steps = &steps;
    job.work = state->work;
    convex(&job, 1);
    state->variance = rest / freedom;
    state->steps = steps;
    return job.converged == 1;
}
