/* fr3: descents in lambda, the whole loop in C, written by symgen 0.1.0.
 *
 * x = [lambda; psi], psi the friction coefficients in units of their own. The loss is
 * L(x) = (||R y - r||^2 + rest) scale with y = [K pi(lambda); psi], which costs the same for any
 * number of samples; Adam may take the mean over a mini-batch of named samples instead.
 * The state lies in the job, so a run can be cut into pieces, and jobs share nothing.
 * Source: document Eqs. 4.32, 4.42-4.46; Madsen, Nielsen, Tingleff, Methods for non-linear least
 * squares problems, 2004, algorithm 3.16. */
#include <string.h>

#include "tiles.h"

#define LINKS 7
#define JOINTS 7
#define PARAMETERS 10
#define LAMBDA (PARAMETERS * LINKS)
#define BASE 43
#define LINK_TILES ((LINKS + LANES - 1) / LANES)
#define BLOCK 4 /* tiles of a mini-batch that are gathered together */

typedef fr3_least_squares least_squares;

void OWN(adam)(fr3_adam_job *jobs, long count, long iterations);
void OWN(levenberg)(fr3_levenberg_job *jobs, long count, long iterations);

/* Numbers of all links, PARAMETERS each, as tiles whose lanes are links, and back. */
static void spread(double *tiles, const double *numbers)
{
    for (long t = 0; t < LINK_TILES * LANES; t += LANES) {
        load(tiles + t * PARAMETERS, numbers + t * PARAMETERS, PARAMETERS, PARAMETERS, LINKS - t, 0);
    }
}

static void collect(double *numbers, const double *tiles)
{
    for (long t = 0; t < LINK_TILES * LANES; t += LANES) {
        store(numbers + t * PARAMETERS, tiles + t * PARAMETERS, PARAMETERS, LINKS - t);
    }
}

/* pi and d pi / d lambda (or theta) of all links, all as tiles whose lanes are links. */
static void bodies(const double *lam, long cholesky, double *pi, double *blocks)
{
    for (long t = 0; t < LINK_TILES * LANES; t += LANES) {
        double *own = pi + t * PARAMETERS, *block = blocks + t * PARAMETERS * PARAMETERS;
        if (cholesky) {
            OWN(cholesky_jacobian_tile)(NULL, lam + t * PARAMETERS, own, block);
        } else {
            OWN(pi_jacobian_tile)(NULL, lam + t * PARAMETERS, own, block);
        }
    }
}

/* y = [K pi; psi], zero up to the padded end. */
static void coordinates(const double *pi_tiles, const double *psi, long n_psi, double *y, long equations)
{
    double pi[LAMBDA];
    collect(pi, pi_tiles);
    fr3_base_parameters(pi, y);
    for (long i = 0; i < n_psi; ++i) {
        y[BASE + i] = psi[i];
    }
    for (long i = BASE + n_psi; i < equations; ++i) {
        y[i] = 0.0;
    }
}

/* d L / d lambda as tiles from d L / d y, Eq. 4.32: K', then the blocks, link by link. */
#define ENTRY(i, j) *(const vu *)(block + ((i) * PARAMETERS + (j)) * LANES) * *(const vu *)(from + (i) * LANES)
static void chain_rule(const double *slope, const double *blocks, double *gradient)
{
    double by_pi[LAMBDA];
    TILE(by_pi_tiles, LINK_TILES * PARAMETERS);
    fr3_base_adjoint(slope, by_pi);
    spread(by_pi_tiles, by_pi);
    for (long t = 0; t < LINK_TILES * LANES; t += LANES) {
        for (int h = 0; h < LANES; h += W) {
            const double *block = blocks + t * PARAMETERS * PARAMETERS + h, *from = by_pi_tiles + t * PARAMETERS + h;
            double *to = gradient + t * PARAMETERS + h;
            *(vu *)(to + 0 * LANES) = ENTRY(0, 0) + ENTRY(1, 0) + ENTRY(2, 0) + ENTRY(3, 0) + ENTRY(4, 0) + ENTRY(5, 0) + ENTRY(6, 0) + ENTRY(7, 0) + ENTRY(8, 0) + ENTRY(9, 0);
            *(vu *)(to + 1 * LANES) = ENTRY(1, 1) + ENTRY(5, 1) + ENTRY(6, 1) + ENTRY(7, 1) + ENTRY(8, 1);
            *(vu *)(to + 2 * LANES) = ENTRY(2, 2) + ENTRY(4, 2) + ENTRY(6, 2) + ENTRY(7, 2) + ENTRY(9, 2);
            *(vu *)(to + 3 * LANES) = ENTRY(3, 3) + ENTRY(4, 3) + ENTRY(5, 3) + ENTRY(8, 3) + ENTRY(9, 3);
            *(vu *)(to + 4 * LANES) = ENTRY(4, 4) + ENTRY(5, 4) + ENTRY(6, 4) + ENTRY(7, 4) + ENTRY(8, 4) + ENTRY(9, 4);
            *(vu *)(to + 5 * LANES) = ENTRY(4, 5) + ENTRY(5, 5) + ENTRY(6, 5) + ENTRY(7, 5) + ENTRY(8, 5) + ENTRY(9, 5);
            *(vu *)(to + 6 * LANES) = ENTRY(4, 6) + ENTRY(5, 6) + ENTRY(6, 6) + ENTRY(7, 6) + ENTRY(8, 6) + ENTRY(9, 6);
            *(vu *)(to + 7 * LANES) = ENTRY(4, 7) + ENTRY(5, 7) + ENTRY(6, 7) + ENTRY(7, 7) + ENTRY(8, 7) + ENTRY(9, 7);
            *(vu *)(to + 8 * LANES) = ENTRY(4, 8) + ENTRY(5, 8) + ENTRY(6, 8) + ENTRY(7, 8) + ENTRY(8, 8) + ENTRY(9, 8);
            *(vu *)(to + 9 * LANES) = ENTRY(4, 9) + ENTRY(5, 9) + ENTRY(6, 9) + ENTRY(7, 9) + ENTRY(8, 9) + ENTRY(9, 9);
        }
    }
}

/* residual = R y - r with R upper triangular, stored column after column; returns the loss. */
static double misfit(const least_squares *p, long equations, const double *y, double *residual)
{
    vd total = {0};
    for (long c = 0; c < equations; c += W) {
        vd part[4] = { -*(const vu *)(p->target + c) };
        for (long i = c / 4 * 4; i < equations; i += 4) {
            UNROLL for (int k = 0; k < 4; ++k) {
                part[k] += *(const vu *)(p->factor + (i + k) * equations + c) * y[i + k];
            }
        }
        const vd row = (part[0] + part[1]) + (part[2] + part[3]);
        *(vu *)(residual + c) = row;
        total += row * row;
    }
    double sum = p->rest;
    for (int l = 0; l < W; ++l) {
        sum += total[l];
    }
    return sum * p->scale;
}

/* d L / d y = 2 scale R' residual. */
static void pull_back(const least_squares *p, long equations, const double *residual, double *slope)
{
    for (long i = 0; i < equations; i += W) {
        vd part[W];
        UNROLL for (int k = 0; k < W; ++k) {
            part[k] = (vd){0};
        }
        for (long c = 0; c <= i; c += W) {
            const vd r = *(const vu *)(residual + c);
            UNROLL for (int k = 0; k < W; ++k) {
                part[k] += *(const vu *)(p->factor + (i + k) * equations + c) * r;
            }
        }
        transpose(part);
        vd sum = part[0];
        UNROLL for (int k = 1; k < W; ++k) {
            sum += part[k];
        }
        *(vu *)(slope + i) = 2 * p->scale * sum;
    }
}

/* Mean loss over the named samples and its slope in y; a sample is [q dq ddq tau columns],
 * filled up to a multiple of LANES numbers. */
static double mini_batch(const fr3_adam_job *job, const long *rows, const double *y, double *slope)
{
    const long n_psi = job->size - LAMBDA, k = job->columns_per_joint;
    const int width = (int)((4 + k) * JOINTS), stride = (width + LANES - 1) / LANES * LANES;
    double *samples = job->work, *rub = samples + BLOCK * width * LANES;
    double u[6], total[BASE + 1] = {0}; /* slope and loss, as in the tiles that add up */
    TILE(whole, BASE + 1) = {0};
    TILE(rest, BASE + 1) = {0};
    TILE(sc, BLOCK * 2 * JOINTS);
    TILE(residual, JOINTS);
    fr3_loss_gradient_prepare(job->weight, y, u);
    memset(rub, 0, sizeof(double) * (size_t)(n_psi * LANES));
    for (long first = 0; first < job->batch; first += BLOCK * LANES) {
        const long end = first + BLOCK * LANES < job->batch ? first + BLOCK * LANES : job->batch;
        for (long b = first; b < end; b += LANES) {
            double *tile = samples + (b - first) * width;
            pick(tile, job->samples, rows + b, stride, width, end - b);
            OWN(loss_gradient_sines)(1, tile, sc + (b - first) * 2 * JOINTS);
        }
        for (long b = first; b < end; b += LANES) {
            double *tile = samples + (b - first) * width, *tau = tile + 3 * JOINTS * LANES;
            const double *columns = tau + JOINTS * LANES;
            for (long i = 0; i < n_psi * LANES; i += W) {
                *(vu *)(tau + i / (k * LANES) * LANES + i % LANES) -= y[BASE + i / LANES] * *(const vu *)(columns + i);
            }
            double *sums = end - b < LANES ? rest : whole;
            OWN(loss_gradient_tile)(sc + (b - first) * 2 * JOINTS, tile, tile + JOINTS * LANES, tile + 2 * JOINTS * LANES, tau, job->weight, y, u, sums + BASE * LANES, sums, residual);
            for (long i = 0; i < JOINTS * LANES && n_psi; ++i) {
                residual[i] *= i % LANES < end - b ? job->weight[i / LANES] : 0.0;
            }
            for (long i = 0; i < n_psi * LANES; i += W) {
                *(vu *)(rub + i) += *(const vu *)(columns + i) * *(const vu *)(residual + i / (k * LANES) * LANES + i % LANES);
            }
        }
    }
    if (job->batch % LANES) {
        add(total, rest, BASE + 1, job->batch % LANES);
    }
    add(total, whole, BASE + 1, LANES);
    memset(slope, 0, sizeof(double) * (size_t)job->equations);
    memcpy(slope, total, sizeof(double) * BASE);
    add(slope + BASE, rub, (int)n_psi, LANES);
    const double share = 1.0 / (double)job->batch;
    for (long i = 0; i < BASE + n_psi; ++i) {
        slope[i] *= share;
    }
    return total[BASE] * share;
}

/* A step of Adam for `count` numbers of x. */
static void adam_step(const fr3_adam_job *job, const double *gradient, double *x, double *m, double *v, long count)
{
    const double keep1 = job->beta1, keep2 = job->beta2;
    const double mean = 1.0 / (1.0 - job->power1), spread = 1.0 / (1.0 - job->power2);
    for (long i = 0; i < count; i += W) {
        const vd g = *(const vu *)(gradient + i);
        const vd m_new = keep1 * *(const vu *)(m + i) + (1.0 - keep1) * g;
        const vd v_new = keep2 * *(const vu *)(v + i) + (1.0 - keep2) * (g * g);
        *(vu *)(m + i) = m_new;
        *(vu *)(v + i) = v_new;
        *(vu *)(x + i) -= job->rate * (m_new * mean) / (vd_sqrt(v_new * spread) + job->epsilon);
    }
}

/* The held-out loss is looked at: keep the best point, count the patience. */
static void validate(fr3_adam_job *job, double training, double loss)
{
    if (!isfinite(loss)) {
        job->finished = FR3_DIVERGED;
        return;
    }
    if (job->step) {
        job->training_trace[job->traced] = training;
        job->held_trace[job->traced++] = loss;
    }
    if (job->step == 0 || loss < job->best - job->threshold) {
        job->best = loss;
        job->improved_at = job->step;
        memcpy(job->best_x, job->x, sizeof(double) * (size_t)job->padded);
    }
}

/* Lambda, its moments and its gradient stay tiles throughout. What comes after lambda in x moves
 * where it is, with the rest of the row of LANES in which it begins; that rest is put right last. */
static void adam(fr3_adam_job *job, long iterations)
{
    enum { ROOM = LINK_TILES * PARAMETERS, AFTER = LAMBDA / LANES * LANES };
    const long equations = job->equations, n_psi = job->size - LAMBDA;
    double *y = job->work + (BLOCK * (4 + job->columns_per_joint) * JOINTS + n_psi) * LANES;
    double *residual = y + equations, *slope = residual + equations, *gradient = slope + equations;
    TILE(pi, ROOM);
    TILE(blocks, ROOM * PARAMETERS) = {0};
    TILE(lam, ROOM);
    TILE(m, ROOM);
    TILE(v, ROOM);
    TILE(by_lam, ROOM);
    spread(lam, job->x);
    spread(m, job->m);
    spread(v, job->v);
    bodies(lam, 0, pi, blocks);
    coordinates(pi, job->x + LAMBDA, n_psi, y, equations);
    memset(gradient, 0, sizeof(double) * (size_t)job->padded);
    if (job->step == 0) {
        validate(job, 0.0, misfit(&job->held, equations, y, residual));
    }
    for (long k = 0; k < iterations && !job->finished; ++k) {
        double training;
        if (job->batch) {
            training = mini_batch(job, job->rows + k * job->batch, y, slope);
        } else {
            training = misfit(&job->training, equations, y, residual);
            pull_back(&job->training, equations, residual, slope);
        }
        job->step += 1;
        job->power1 *= job->beta1;
        job->power2 *= job->beta2;
        chain_rule(slope, blocks, by_lam);
        adam_step(job, by_lam, lam, m, v, ROOM * LANES);
        if (n_psi) {
            memcpy(gradient + LAMBDA, slope + BASE, sizeof(double) * (size_t)n_psi);
            adam_step(job, gradient + AFTER, job->x + AFTER, job->m + AFTER, job->v + AFTER, job->padded - AFTER);
        }
        bodies(lam, 0, pi, blocks);
        coordinates(pi, job->x + LAMBDA, n_psi, y, equations);
        if (job->step % job->validate_every == 0) {
            collect(job->x, lam);
            validate(job, training, misfit(&job->held, equations, y, residual));
        }
        if (!job->finished && job->step - job->improved_at >= job->patience) {
            job->finished = FR3_PATIENCE;
        }
    }
    collect(job->x, lam);
    collect(job->m, m);
    collect(job->v, v);
}

void OWN(adam)(fr3_adam_job *jobs, long count, long iterations)
{
    for (long i = 0; i < count; ++i) {
        adam(jobs + i, iterations);
    }
}

/* J = d (R y) / d x, one column of length `equations` after the other. */
static void jacobian(const fr3_levenberg_job *job, const double *blocks, double *out)
{
    const long equations = job->equations;
    const double *factor = job->training.factor;
    double by_pi[LAMBDA] = {0}, y[BASE];
    for (long j = 0; j < LAMBDA; ++j) {
        const long link = j / PARAMETERS, first = link * PARAMETERS;
        const double *block = blocks + (link / LANES * PARAMETERS * PARAMETERS + j - first) * LANES + link % LANES;
        for (long i = 0; i < PARAMETERS; ++i) {
            by_pi[first + i] = block[i * PARAMETERS * LANES];
        }
        fr3_base_parameters(by_pi, y);
        memset(by_pi + first, 0, sizeof(double) * PARAMETERS);
        for (long c = 0; c < equations; c += W) {
            vd part[2] = { {0} };
            for (long i = c; i < BASE; ++i) {
                part[i % 2] += *(const vu *)(factor + i * equations + c) * y[i];
            }
            *(vu *)(out + j * equations + c) = part[0] + part[1];
        }
    }
    memcpy(out + LAMBDA * equations, factor + BASE * equations, sizeof(double) * (size_t)((job->size - LAMBDA) * equations));
}

/* N = J J', the columns from the diagonal on. */
static void gram(const double *columns, long count, long equations, double *out)
{
    for (long i = 0; i < equations; i += 4) {
        for (long c = i / W * W; c < equations; c += W) {
            vd part[4] = { {0} };
            for (long j = 0; j < count * equations; j += equations) {
                const vd rows = *(const vu *)(columns + j + c);
                UNROLL for (int k = 0; k < 4; ++k) {
                    part[k] += rows * columns[j + i + k];
                }
            }
            UNROLL for (int k = 0; k < 4; ++k) {
                *(vu *)(out + (i + k) * equations + c) = part[k];
            }
        }
    }
}

/* out = L with L L' = N + damping I, column by column; 0 when a pivot is not positive. */
static int cholesky(const double *matrix, double damping, long size, double *out)
{
    memcpy(out, matrix, sizeof(double) * (size_t)(size * size));
    for (long k = 0; k < size; ++k) {
        double *column = out + k * size;
        const double pivot = column[k] + damping;
        if (!(pivot > 0.0)) {
            return 0;
        }
        const double root = sqrt(pivot), share = 1.0 / root;
        for (long c = k / W * W; c < size; c += W) {
            *(vu *)(column + c) *= share;
        }
        column[k] = root;
        for (long j = k + 1; j < size; ++j) {
            const double weight = column[j];
            for (long c = j / W * W; c < size; c += W) {
                *(vu *)(out + j * size + c) -= weight * *(const vu *)(column + c);
            }
        }
    }
    return 1;
}

/* x = (L L')^-1 x. */
static void solve(const double *factor, long size, double *x)
{
    for (long k = 0; k < size; ++k) {
        const double *column = factor + k * size;
        x[k] /= column[k];
        for (long i = k + 1; i < size; ++i) {
            x[i] -= x[k] * column[i];
        }
    }
    for (long k = size - 1; k >= 0; --k) {
        const double *column = factor + k * size;
        double sum = x[k];
        for (long i = k + 1; i < size; ++i) {
            sum -= column[i] * x[i];
        }
        x[k] = sum / column[k];
    }
}

static double dot(const double *a, const double *b, long size)
{
    vd part = {0};
    for (long c = 0; c < size; c += W) {
        part += *(const vu *)(a + c) * *(const vu *)(b + c);
    }
    double sum = 0.0;
    for (int l = 0; l < W; ++l) {
        sum += part[l];
    }
    return sum;
}

/* Loss at x, its residual and the blocks that J needs. */
static double evaluate(const fr3_levenberg_job *job, const double *x, double *blocks, double *y, double *residual)
{
    TILE(lam, LINK_TILES * PARAMETERS);
    TILE(pi, LINK_TILES * PARAMETERS);
    spread(lam, x);
    bodies(lam, job->cholesky, pi, blocks);
    coordinates(pi, x + LAMBDA, job->size - LAMBDA, y, job->equations);
    return misfit(&job->training, job->equations, y, residual);
}

static void levenberg(fr3_levenberg_job *job, long iterations)
{
    const long size = job->size, equations = job->equations;
    double *columns = job->work, *normal = columns + size * equations, *factor = normal + equations * equations;
    double *y = factor + equations * equations, *residual = y + equations, *target = residual + equations;
    double *tried = target + equations, *step = tried + size;
    const double two_scale = 2 * job->training.scale;
    TILE(blocks, LINK_TILES * PARAMETERS * PARAMETERS) = {0};
    double loss = evaluate(job, job->x, blocks, y, residual);
    int fresh = 1;
    if (job->step == 0) {
        job->loss = loss;
        job->finished = isfinite(loss) ? 0 : FR3_DIVERGED;
    }
    for (long k = 0; k < iterations && !job->finished; ++k) {
        if (fresh) {
            jacobian(job, blocks, columns);
            gram(columns, size, equations, normal);
            fresh = 0;
        }
        if (job->damping == 0.0) {
            for (long j = 0; j < size; ++j) {
                const double length = dot(columns + j * equations, columns + j * equations, equations);
                job->damping = fmax(job->damping, job->first_damping * length);
            }
        }
        job->step += 1;
        double length = 0.0, from = 0.0, predicted = 0.0;
        const int solved = cholesky(normal, job->damping, equations, factor);
        if (solved) {
            memcpy(target, residual, sizeof(double) * (size_t)equations);
            solve(factor, equations, target);
            for (long j = 0; j < size; ++j) {
                const double *column = columns + j * equations;
                step[j] = -dot(column, target, equations);
                tried[j] = job->x[j] + step[j];
                length += step[j] * step[j];
                from += job->x[j] * job->x[j];
                predicted += step[j] * (job->damping * step[j] - dot(column, residual, equations));
            }
            predicted *= two_scale / 2;
        }
        if (solved && sqrt(length) <= job->step_tolerance * (sqrt(from) + job->step_tolerance)) {
            job->finished = FR3_CONVERGED;
            break;
        }
        loss = solved ? evaluate(job, tried, blocks, y, target) : HUGE_VAL;
        const double gain = (job->loss - loss) / predicted;
        if (solved && loss < job->loss && gain > 0.0) {
            const double before = job->loss, ease = 2 * gain - 1;
            memcpy(job->x, tried, sizeof(double) * (size_t)size);
            memcpy(residual, target, sizeof(double) * (size_t)equations);
            job->loss = loss;
            job->trace[job->traced++] = loss;
            job->damping *= fmax(1.0 / 3, 1 - ease * ease * ease);
            job->growth = 2.0;
            fresh = 1;
            if (before - loss <= job->decrease_tolerance * before && predicted <= job->decrease_tolerance * before) {
                job->finished = FR3_CONVERGED;
            }
        } else {
            job->damping *= job->growth;
            job->growth *= 2;
            if (!(job->damping < 1e200)) {
                job->finished = FR3_STALLED;
            }
        }
    }
}

void OWN(levenberg)(fr3_levenberg_job *jobs, long count, long iterations)
{
    for (long i = 0; i < count; ++i) {
        levenberg(jobs + i, iterations);
    }
}
