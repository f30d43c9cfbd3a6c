/* fr3: Adam in lambda, the whole loop in C, written by symgen 0.1.0.
 *
 * x = [lambda; psi] with psi the friction coefficients in units of their own. The loss is either
 * the quadratic L = y'Hy/2 - h'y + c in y = [pi(lambda); psi], which costs the same for any number
 * of samples, or the mean over a mini-batch of rows that are named beforehand.
 * The state lies in the job, so a run can be cut into pieces. Source: document Eqs. 4.32, 4.42-4.46. */
#include <string.h>

#include "fr3.h"

#ifndef W
#error "compile with -DLEVEL=v4 -DW=8 -march=x86-64-v4, see README.md"
#endif

#include "lanes.h"

#define JOIN(level, kernel) fr3_##level##_##kernel
#define AT(level, kernel) JOIN(level, kernel)
#define OWN(kernel) AT(LEVEL, kernel)
#define LINKS 7
#define JOINTS 7
#define PARAMETERS 10
#define LAMBDA (PARAMETERS * LINKS)

void OWN(pi_from_lam_batch)(long n, const double *lam, long lam_step, double *pi);
void OWN(pi_adjoint_batch)(long n, const double *lam, long lam_step, const double *slope, long slope_step, double *gradient);
void OWN(loss_gradient_batch)(long n, const double *q, long q_step, const double *dq, long dq_step, const double *ddq, long ddq_step, const double *tau, long tau_step, const double *weight, long weight_step, const double *pi, long pi_step, double *loss, double *gradient, double *residual);
void OWN(adam)(fr3_adam_job *job, long iterations);

/* out = H y - h and the value y'Hy/2 - h'y + c; `padded` is a multiple of 8. */
static double quadratic(const fr3_quadratic *p, long padded, const double *y, double *out)
{
    for (long c = 0; c < padded; c += W) {
        vd even = -*(const vu *)(p->linear + c), odd = {0};
        const double *column = p->hessian + c;
        for (long i = 0; i < padded; i += 2) {
            even += *(const vu *)(column + i * padded) * y[i];
            odd += *(const vu *)(column + (i + 1) * padded) * y[i + 1];
        }
        *(vu *)(out + c) = even + odd;
    }
    double value = 0.0;
    for (long i = 0; i < padded; ++i) {
        value += y[i] * (out[i] - p->linear[i]);
    }
    return value / 2 + p->constant;
}

/* Mean loss over one mini-batch, its slope in pi and in psi. */
static double mini_batch(const fr3_adam_job *job, const long *rows, const double *pi, const double *psi, double *slope)
{
    const long batch = job->batch, k = job->columns_per_joint;
    double *q = job->work, *dq = q + batch * JOINTS, *ddq = dq + batch * JOINTS;
    double *tau = ddq + batch * JOINTS, *residual = tau + batch * JOINTS;
    for (long b = 0; b < batch; ++b) {
        const long from = rows[b] * JOINTS, to = b * JOINTS;
        memcpy(q + to, job->q + from, sizeof(double) * JOINTS);
        memcpy(dq + to, job->dq + from, sizeof(double) * JOINTS);
        memcpy(ddq + to, job->ddq + from, sizeof(double) * JOINTS);
        for (long j = 0; j < JOINTS; ++j) {
            double rub = 0.0;
            for (long c = 0; c < k; ++c) {
                rub += job->columns[(from + j) * k + c] * job->unit[j * k + c] * psi[j * k + c];
            }
            tau[to + j] = job->tau[from + j] - rub;
        }
    }
    double loss[1], pi_slope[LAMBDA];
    OWN(loss_gradient_batch)(batch, q, JOINTS, dq, JOINTS, ddq, JOINTS, tau, JOINTS, job->weight, 0, pi, 0, loss, pi_slope, residual);
    const double share = 1.0 / (double)batch;
    for (long i = 0; i < LAMBDA; ++i) {
        slope[i] = pi_slope[i] * share;
    }
    for (long i = LAMBDA; i < job->padded; ++i) {
        slope[i] = 0.0;
    }
    for (long b = 0; b < batch; ++b) {
        for (long j = 0; j < JOINTS; ++j) {
            const double pull = residual[b * JOINTS + j] * job->weight[j] * share;
            for (long c = 0; c < k; ++c) {
                slope[LAMBDA + j * k + c] += job->columns[(rows[b] * JOINTS + j) * k + c] * pull * job->unit[j * k + c];
            }
        }
    }
    return loss[0] * share;
}

static double validate(const fr3_adam_job *job, double *y, double *out)
{
    OWN(pi_from_lam_batch)(LINKS, job->x, PARAMETERS, y);
    memcpy(y + LAMBDA, job->x + LAMBDA, sizeof(double) * (size_t)(job->padded - LAMBDA));
    return quadratic(&job->held, job->padded, y, out);
}

void OWN(adam)(fr3_adam_job *job, long iterations)
{
    const long padded = job->padded;
    double *y = job->work + 5 * job->batch * JOINTS, *slope = y + padded;
    const double keep1 = job->beta1, keep2 = job->beta2;
    if (job->step == 0) {
        job->best = validate(job, y, slope);
        memcpy(job->best_x, job->x, sizeof(double) * (size_t)padded);
        job->finished = isfinite(job->best) ? 0 : FR3_ADAM_DIVERGED;
    }
    for (long k = 0; k < iterations && !job->finished; ++k) {
        double training;
        OWN(pi_from_lam_batch)(LINKS, job->x, PARAMETERS, y);
        memcpy(y + LAMBDA, job->x + LAMBDA, sizeof(double) * (size_t)(padded - LAMBDA));
        if (job->batch) {
            training = mini_batch(job, job->rows + k * job->batch, y, y + LAMBDA, slope);
        } else {
            training = quadratic(&job->training, padded, y, slope);
        }
        double gradient[LAMBDA];
        OWN(pi_adjoint_batch)(LINKS, job->x, PARAMETERS, slope, PARAMETERS, gradient);
        memcpy(slope, gradient, sizeof gradient);
        job->step += 1;
        job->power1 *= keep1;
        job->power2 *= keep2;
        const double mean = 1.0 / (1.0 - job->power1), spread = 1.0 / (1.0 - job->power2);
        for (long i = 0; i < padded; i += W) {
            const vd g = *(const vu *)(slope + i);
            const vd m = keep1 * *(const vu *)(job->m + i) + (1.0 - keep1) * g;
            const vd v = keep2 * *(const vu *)(job->v + i) + (1.0 - keep2) * (g * g);
            *(vu *)(job->m + i) = m;
            *(vu *)(job->v + i) = v;
            *(vu *)(job->x + i) -= job->rate * (m * mean) / (vd_sqrt(v * spread) + job->epsilon);
        }
        if (job->step % job->validate_every == 0) {
            const double loss = validate(job, y, slope);
            if (!isfinite(loss)) {
                job->finished = FR3_ADAM_DIVERGED;
                break;
            }
            job->training_trace[job->traced] = training;
            job->held_trace[job->traced++] = loss;
            if (loss < job->best - job->threshold) {
                job->best = loss;
                job->improved_at = job->step;
                memcpy(job->best_x, job->x, sizeof(double) * (size_t)padded);
            }
        }
        if (job->step - job->improved_at >= job->patience) {
            job->finished = FR3_ADAM_PATIENCE;
        }
    }
}
