/* ur5e: maximum a posteriori with an entropic prior, and its limit PC-OLS, written by symgen 0.1.0.
 *
 * f(pi) = (||A pi - b||^2 + rest) / 2 N + sum_k gamma_k (slope_k.pi_k - log det P_k(pi_k)) is smooth
 * and convex where every P_k is positive definite, and infinite on the boundary. Newton's steps,
 * Jacobi-scaled, by Cholesky with a ridge on failure; Armijo's rule, no step leaves the cone; the
 * end is a decrement g'H^-1 g / 2 below `tolerance` gamma. Jobs share nothing.
 * Source: Lee, Wensing, Park, Geometric robot dynamic identification, 2019 (the prior); Boyd,
 * Vandenberghe, Convex optimization, 2004, Sec. 9.5. */
#include <float.h>
#include <string.h>

#include "tiles.h"

#define LINKS 6
#define PARAMETERS 10
#define LINK_TILES ((LINKS + LANES - 1) / LANES)
#define MOST_HALVINGS 60

typedef ur5e_convex_job convex_job;

void OWN(convex)(convex_job *jobs, long count);

/* Barrier of all bodies, as tiles whose lanes are bodies. */
typedef struct {
    TILE(pivot, LINK_TILES);
    TILE(log_det, LINK_TILES);
    TILE(traces, LINK_TILES * PARAMETERS);
    TILE(curvature, LINK_TILES * PARAMETERS * PARAMETERS);
} barrier;

/* The job's arrays within `work`. */
typedef struct {
    double *gram, *normal, *gradient, *step, *tried, *share, *linear, *residual, *next;
} scratch;

static double dot(const double *a, const double *b, long size)
{
    vd part[2] = { {0} };
    long c = 0;
    for (; c + 2 * W <= size; c += 2 * W) {
        part[0] += *(const vu *)(a + c) * *(const vu *)(b + c);
        part[1] += *(const vu *)(a + c + W) * *(const vu *)(b + c + W);
    }
    for (; c < size; c += W) {
        part[0] += *(const vu *)(a + c) * *(const vu *)(b + c);
    }
    part[0] += part[1];
#if W == 8
    const vd half = part[0] + SHUFFLE(part[0], part[0], 4, 5, 6, 7, 0, 1, 2, 3);
    return (half[0] + half[1]) + (half[2] + half[3]);
#else
    double sum = 0.0;
    for (int l = 0; l < W; ++l) {
        sum += part[0][l];
    }
    return sum;
#endif
}

static void add_times(double *y, double weight, const double *x, long size)
{
    for (long c = 0; c < size; c += W) {
        *(vu *)(y + c) += weight * *(const vu *)(x + c);
    }
}

/* G = A'A / N, the columns from the diagonal on. */
static void gram(const convex_job *job, double *out)
{
    const long width = job->width, end = job->rows * width;
    const double share = 1.0 / job->count;
    for (long i = 0; i < width; i += 4) {
        for (long c = i / W * W; c < width; c += W) {
            vd part[4] = { {0} };
            for (long r = 0; r < end; r += width) {
                const vd row = *(const vu *)(job->factor + r + c);
                UNROLL for (int k = 0; k < 4; ++k) {
                    part[k] += row * job->factor[r + i + k];
                }
            }
            UNROLL for (int k = 0; k < 4; ++k) {
                *(vu *)(out + (i + k) * width + c) = part[k] * share;
            }
        }
    }
}

/* A pi - b; returns the loss. */
static double misfit(const convex_job *job, const double *pi, double *residual)
{
    double sum = job->rest;
    for (long r = 0; r < job->rows; ++r) {
        residual[r] = dot(job->factor + r * job->width, pi, job->width) - job->target[r];
        sum += residual[r] * residual[r];
    }
    return sum / (2 * job->count);
}

/* f at pi; HUGE_VAL outside the cone. */
static double cost(const convex_job *job, double gamma, const double *pi, const double *linear, barrier *b, double *residual)
{
    TILE(tile, PARAMETERS);
    for (long t = 0; t * LANES < job->links; ++t) {
        load(tile, pi + t * LANES * PARAMETERS, PARAMETERS, PARAMETERS, job->links - t * LANES, 0);
        OWN(barrier_tile)(NULL, tile, b->pivot + t * LANES, b->log_det + t * LANES, b->traces + t * PARAMETERS * LANES, b->curvature + t * PARAMETERS * PARAMETERS * LANES);
    }
    double logs = 0.0;
    for (long k = 0; k < job->links; ++k) {
        if (!(b->pivot[k] > 0.0)) {
            return HUGE_VAL;
        }
        logs += job->share[k] * b->log_det[k];
    }
    return misfit(job, pi, residual) + dot(linear, pi, job->width) - gamma * logs;
}

/* Gradient and Hessian from what `cost` has left. */
static void slope(const convex_job *job, double gamma, const barrier *b, const scratch *s)
{
    const long width = job->width;
    memcpy(s->gradient, s->linear, sizeof(double) * (size_t)width);
    for (long r = 0; r < job->rows; ++r) {
        add_times(s->gradient, s->residual[r] / job->count, job->factor + r * width, width);
    }
    for (long k = 0; k < width; ++k) {
        for (long c = k * width + k / W * W; c < (k + 1) * width; c += W) {
            *(vu *)(s->normal + c) = *(const vu *)(s->gram + c);
        }
    }
    for (long k = 0; k < job->links; ++k) {
        const double weight = gamma * job->share[k];
        const long lane = k / LANES * LANES * PARAMETERS + k % LANES;
        const double *block = b->curvature + (lane - k % LANES) * PARAMETERS + k % LANES;
        for (long i = 0; i < PARAMETERS; ++i) {
            double *column = s->normal + (k * PARAMETERS + i) * width + k * PARAMETERS;
            s->gradient[k * PARAMETERS + i] -= weight * b->traces[lane + i * LANES];
            for (long j = i; j < PARAMETERS; ++j) {
                column[j] += weight * block[(i * PARAMETERS + j) * LANES];
            }
        }
    }
    for (long i = job->links * PARAMETERS; i < width; ++i) {
        s->normal[i * width + i] = 1.0;
        s->gradient[i] = 0.0;
    }
}

/* matrix = L with L L' = matrix, its diagonal 1 + ridge times as large, which is a ridge on the
 * Jacobi-scaled matrix; `share` takes 1 / L_kk. 0 when a pivot is not positive. */
static int cholesky(double *matrix, double *share, double ridge, long size)
{
    for (long k = 0; k < size; ++k) {
        matrix[k * size + k] += ridge * matrix[k * size + k];
    }
    for (long k = 0; k < size; k += 4) {
        double *panel = matrix + k * size;
        for (long p = 0; p < 4; ++p) {
            double *column = panel + p * size;
            for (long o = 0; o < p; ++o) {
                const double weight = panel[o * size + k + p];
                for (long c = k / W * W; c < size; c += W) {
                    *(vu *)(column + c) -= weight * *(const vu *)(panel + o * size + c);
                }
            }
            if (!(column[k + p] > 0.0)) {
                return 0;
            }
            share[k + p] = 1.0 / sqrt(column[k + p]);
            for (long c = k / W * W; c < size; c += W) {
                *(vu *)(column + c) *= share[k + p];
            }
            for (long c = k / W * W; c < k + p; ++c) { /* what the lanes leave above the diagonal */
                column[c] = 0.0;
            }
        }
        for (long j = k + 4; j < size; j += 4) {
            double *target = matrix + j * size;
            vd weight[4][4];
            UNROLL for (int o = 0; o < 4; ++o) {
                UNROLL for (int i = 0; i < 4; ++i) {
                    weight[o][i] = vd_all(panel[o * size + j + i]);
                }
            }
            for (long c = j / W * W; c < size; c += W) {
                vd part[4];
                UNROLL for (int i = 0; i < 4; ++i) {
                    part[i] = *(const vu *)(target + i * size + c);
                }
                UNROLL for (int o = 0; o < 4; ++o) {
                    const vd from = *(const vu *)(panel + o * size + c);
                    UNROLL for (int i = 0; i < 4; ++i) {
                        part[i] -= weight[o][i] * from;
                    }
                }
                UNROLL for (int i = 0; i < 4; ++i) {
                    *(vu *)(target + i * size + c) = part[i];
                }
            }
        }
    }
    return 1;
}

/* x = (L L')^-1 x. */
static void solve(const double *factor, const double *share, long size, double *x)
{
    for (long k = 0; k < size; ++k) {
        const double value = x[k] * share[k];
        const long from = k / W * W;
        add_times(x + from, -value, factor + k * size + from, size - from);
        x[k] = value;
    }
    for (long k = size - 1; k >= 0; --k) {
        const double own = x[k];
        const long from = k / W * W;
        x[k] = 0.0;
        x[k] = (own - dot(factor + k * size + from, x + from, size - from)) * share[k];
    }
}

/* step = -H^-1 g; the decrement, or -1 where no ridge helps. */
static double direction(const convex_job *job, double gamma, const barrier *b, const scratch *s)
{
    const long width = job->width;
    double ridge = 0.0;
    slope(job, gamma, b, s);
    while (!cholesky(s->normal, s->share, ridge, width)) {
        ridge = ridge == 0.0 ? 1e-14 : 10 * ridge;
        if (!(ridge < 1e-2)) {
            return -1.0;
        }
        slope(job, gamma, b, s);
    }
    for (long i = 0; i < width; ++i) {
        s->step[i] = -s->gradient[i];
    }
    solve(s->normal, s->share, width, s->step);
    return -dot(s->gradient, s->step, width) / 2;
}

/* One gamma from job->pi; 1 when the decrement became small. */
static int newton(convex_job *job, long at, const scratch *s)
{
    const long width = job->width;
    const double gamma = job->gamma[at];
    double least = HUGE_VAL;
    barrier b;
    memset(&b, 0, sizeof b);
    for (long i = 0; i < width; ++i) {
        const long k = i / PARAMETERS;
        s->linear[i] = k < job->links ? gamma * job->share[k] * job->slope[i] : 0.0;
    }
    for (long k = 0; k < job->links; ++k) {
        least = fmin(least, gamma * job->share[k]);
    }
    double value = cost(job, gamma, job->pi, s->linear, &b, s->residual);
    const double goal = fmax(job->tolerance * least, 4 * DBL_EPSILON * fabs(value));
    double decrement = HUGE_VAL;
    long steps = 0;
    int converged = 0;
    while (value < HUGE_VAL && steps < job->most_steps) {
        decrement = direction(job, gamma, &b, s);
        converged = decrement >= 0.0 && decrement < goal;
        if (converged || !(decrement >= 0.0)) {
            break;
        }
        double share = 1.0, found = HUGE_VAL;
        for (int half = 0; half < MOST_HALVINGS; ++half, share /= 2) {
            for (long c = 0; c < width; c += W) {
                *(vu *)(s->tried + c) = *(const vu *)(job->pi + c) + share * *(const vu *)(s->step + c);
            }
            found = cost(job, gamma, s->tried, s->linear, &b, s->next);
            if (found <= value - 2e-4 * share * decrement) {
                break;
            }
        }
        if (!(found <= value - 2e-4 * share * decrement)) {
            break;
        }
        memcpy(job->pi, s->tried, sizeof(double) * (size_t)width);
        memcpy(s->residual, s->next, sizeof(double) * (size_t)job->rows);
        value = found;
        ++steps;
    }
    memcpy(job->points + at * width, job->pi, sizeof(double) * (size_t)width);
    job->losses[at] = misfit(job, job->pi, s->residual);
    job->decrements[at] = decrement;
    job->steps[at] = steps;
    return converged;
}

void OWN(convex)(convex_job *jobs, long count)
{
    for (long i = 0; i < count; ++i) {
        convex_job *job = jobs + i;
        const long width = job->width;
        scratch s;
        s.gram = job->work;
        s.normal = s.gram + width * width;
        s.gradient = s.normal + width * width;
        s.step = s.gradient + width;
        s.tried = s.step + width;
        s.share = s.tried + width;
        s.linear = s.share + width;
        s.residual = s.linear + width;
        s.next = s.residual + job->rows;
        gram(job, s.gram);
        job->converged = 0;
        while (job->converged < job->gammas && newton(job, job->converged, &s)) {
            job->converged += 1;
        }
    }
}
