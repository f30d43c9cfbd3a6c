/* ur5e: descents in lambda, the whole loop in C, written by symgen 0.1.0.
 *
 * x = [lambda; psi], psi the friction coefficients in units of their own. The loss is
 * L(x) = (||R y - r||^2 + rest) scale with y = [K pi(lambda); psi], which costs the same for any
 * number of samples; Adam may take the mean over a mini-batch of named samples instead.
 * The state lies in the job, so a run can be cut into pieces, and jobs share nothing.
 * Source: document Eqs. 4.32, 4.42-4.46; Madsen, Nielsen, Tingleff, Methods for non-linear least
 * squares problems, 2004, algorithm 3.16. */
#include <string.h>

#include "tiles.h"

#define LINKS 6
#define JOINTS 6
#define PARAMETERS 10
#define FRAME 12
#define LAMBDA (PARAMETERS * LINKS)
#define BASE 36
#define LINK_TILES ((LINKS + LANES - 1) / LANES)
#define SIDE_BY_SIDE 6 /* vectors that add up a product with a matrix, enough to hide how long one takes */

typedef ur5e_least_squares least_squares;

void OWN(adam)(ur5e_adam_job *jobs, long count, long iterations);
void OWN(levenberg)(ur5e_levenberg_job *jobs, long count, long iterations);

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

/* pi of all links and what d pi / d lambda shares with it, as tiles whose lanes are links. */
static void masses(const double *lam, double *pi, double *frame)
{
    for (long t = 0; t < LINK_TILES * LANES; t += LANES) {
        OWN(pi_frame_tile)(NULL, lam + t * PARAMETERS, pi + t * PARAMETERS, frame + t * FRAME);
    }
}

/* (d pi / d lambda)' slope of all links. */
static void masses_back(const double *lam, const double *frame, const double *slope, double *gradient)
{
    for (long t = 0; t < LINK_TILES * LANES; t += LANES) {
        const long at = t * PARAMETERS;
        OWN(pi_adjoint_tile)(NULL, lam + at, frame + t * FRAME, slope + at, gradient + at);
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

/* beta = K pi, Eq. 3.11, of tiles whose lanes are links. */
static void to_base(const double *restrict pi, double *restrict beta)
{
    const double t5 = 0.18062500000000001 * pi[2];
    const double t21 = ((((((pi[48] + pi[41]) + t5) + pi[42]) + (0.35221472999999998 * pi[3])) + (0.2666 * pi[27])) + pi[43]) + (0.35221472999999998 * pi[4]);
    beta[0] = t21 + (0.35221472999999998 * pi[5]);
    const double t33 = ((pi[9] + ((-0.42499999999999999) * pi[2])) + ((-0.42499999999999999) * pi[3])) + ((-0.42499999999999999) * pi[4]);
    beta[1] = t33 + ((-0.42499999999999999) * pi[5]);
    beta[2] = pi[17];
    const double t47 = (((pi[33] - pi[41]) + ((-0.18062500000000001) * pi[2])) + ((-0.18062500000000001) * pi[3])) + ((-0.18062500000000001) * pi[4]);
    beta[3] = t47 + ((-0.18062500000000001) * pi[5]);
    const double t58 = (((pi[49] + t5) + (0.18062500000000001 * pi[3])) + (0.18062500000000001 * pi[4])) + (0.18062500000000001 * pi[5]);
    beta[4] = t58;
    beta[5] = pi[57];
    const double t71 = ((pi[65] + (0.42499999999999999 * pi[26])) + (0.056652500000000001 * pi[3])) + (0.42499999999999999 * pi[27]);
    beta[6] = (t71 + (0.056652500000000001 * pi[4])) + (0.056652500000000001 * pi[5]);
    beta[7] = pi[73];
    const double t86 = ((pi[10] + ((-0.39219999999999999) * pi[3])) + ((-0.39219999999999999) * pi[4])) + ((-0.39219999999999999) * pi[5]);
    beta[8] = t86;
    beta[9] = pi[18];
    const double t98 = (((pi[34] - pi[42]) + ((-0.15382083999999999) * pi[3])) + ((-0.15382083999999999) * pi[4])) + ((-0.15382083999999999) * pi[5]);
    beta[10] = t98;
    const double t107 = ((pi[50] + (0.15382083999999999 * pi[3])) + (0.15382083999999999 * pi[4])) + (0.15382083999999999 * pi[5]);
    beta[11] = t107;
    beta[12] = pi[58];
    const double t119 = ((pi[66] + (0.052280260000000002 * pi[3])) + (0.39219999999999999 * pi[27])) + (0.052280260000000002 * pi[4]);
    beta[13] = t119 + (0.052280260000000002 * pi[5]);
    beta[14] = pi[74];
    beta[15] = pi[11];
    beta[16] = ((pi[19] + ((-0.099699999999999997) * pi[4])) - pi[28]) + ((-0.099699999999999997) * pi[5]);
    const double t139 = 0.0099400900000000004 * pi[4];
    const double t142 = 0.19939999999999999 * pi[28];
    const double t146 = 0.0099400900000000004 * pi[5];
    beta[17] = ((((pi[35] - pi[43]) + t139) + t142) + pi[44]) + t146;
    beta[18] = (((pi[51] + t139) + t142) + pi[44]) + t146;
    beta[19] = pi[59];
    beta[20] = pi[67];
    beta[21] = pi[75];
    beta[22] = pi[12];
    beta[23] = (pi[20] + (0.099599999999999994 * pi[5])) + pi[29];
    const double t173 = 0.0099201600000000008 * pi[5];
    const double t176 = 0.19919999999999999 * pi[29];
    beta[24] = (((pi[36] - pi[44]) + t173) + t176) + pi[45];
    beta[25] = ((pi[52] + t173) + t176) + pi[45];
    beta[26] = pi[60];
    beta[27] = pi[68];
    beta[28] = pi[76];
    beta[29] = pi[13];
    beta[30] = pi[21];
    beta[31] = pi[37] - pi[45];
    beta[32] = pi[53];
    beta[33] = pi[61];
    beta[34] = pi[69];
    beta[35] = pi[77];
}

/* K' slope, the adjoint of beta = K pi, into such tiles; unused lanes stay what they are. */
static void from_base(const double *restrict slope, double *restrict gradient)
{
    gradient[0] = 0.0;
    gradient[8] = 0.0;
    gradient[16] = 0.0;
    gradient[24] = 0.0;
    gradient[32] = 0.0;
    gradient[40] = 0.0;
    gradient[48] = slope[0];
    gradient[56] = 0.0;
    gradient[64] = 0.0;
    gradient[72] = 0.0;
    gradient[1] = 0.0;
    gradient[9] = slope[1];
    gradient[17] = slope[2];
    gradient[25] = 0.0;
    gradient[33] = slope[3];
    gradient[41] = slope[0] - slope[3];
    gradient[49] = slope[4];
    gradient[57] = slope[5];
    gradient[65] = slope[6];
    gradient[73] = slope[7];
    const double t33 = (-0.42499999999999999) * slope[1];
    const double t36 = (-0.18062500000000001) * slope[3];
    const double t38 = 0.18062500000000001 * slope[4];
    gradient[2] = (((0.18062500000000001 * slope[0]) + t33) + t36) + t38;
    gradient[10] = slope[8];
    gradient[18] = slope[9];
    const double t46 = 0.42499999999999999 * slope[6];
    gradient[26] = t46;
    gradient[34] = slope[10];
    gradient[42] = slope[0] - slope[10];
    gradient[50] = slope[11];
    gradient[58] = slope[12];
    gradient[66] = slope[13];
    gradient[74] = slope[14];
    const double t70 = (((((0.35221472999999998 * slope[0]) + t33) + t36) + t38) + (0.056652500000000001 * slope[6])) + ((-0.39219999999999999) * slope[8]);
    const double t79 = ((t70 + ((-0.15382083999999999) * slope[10])) + (0.15382083999999999 * slope[11])) + (0.052280260000000002 * slope[13]);
    gradient[3] = t79;
    gradient[11] = slope[15];
    gradient[19] = slope[16];
    gradient[27] = ((0.2666 * slope[0]) + t46) + (0.39219999999999999 * slope[13]);
    gradient[35] = slope[17];
    gradient[43] = slope[0] - slope[17];
    gradient[51] = slope[18];
    gradient[59] = slope[19];
    gradient[67] = slope[20];
    gradient[75] = slope[21];
    const double t111 = ((t79 + ((-0.099699999999999997) * slope[16])) + (0.0099400900000000004 * slope[17])) + (0.0099400900000000004 * slope[18]);
    gradient[4] = t111;
    gradient[12] = slope[22];
    gradient[20] = slope[23];
    gradient[28] = ((0.19939999999999999 * slope[17]) - slope[16]) + (0.19939999999999999 * slope[18]);
    gradient[36] = slope[24];
    gradient[44] = (slope[17] + slope[18]) - slope[24];
    gradient[52] = slope[25];
    gradient[60] = slope[26];
    gradient[68] = slope[27];
    gradient[76] = slope[28];
    const double t143 = ((t111 + (0.099599999999999994 * slope[23])) + (0.0099201600000000008 * slope[24])) + (0.0099201600000000008 * slope[25]);
    gradient[5] = t143;
    gradient[13] = slope[29];
    gradient[21] = slope[30];
    gradient[29] = (slope[23] + (0.19919999999999999 * slope[24])) + (0.19919999999999999 * slope[25]);
    gradient[37] = slope[31];
    gradient[45] = (slope[24] + slope[25]) - slope[31];
    gradient[53] = slope[32];
    gradient[61] = slope[33];
    gradient[69] = slope[34];
    gradient[77] = slope[35];
}

/* y = [K pi; psi], zero up to the padded end. */
static void coordinates(const double *pi, const double *psi, long n_psi, double *y, long equations)
{
    to_base(pi, y);
    for (long i = 0; i < n_psi; ++i) {
        y[BASE + i] = psi[i];
    }
    for (long i = BASE + n_psi; i < equations; ++i) {
        y[i] = 0.0;
    }
}

/* Entries [c, c + W blocks) of M y - r, M stored column after column, `columns` of them; of an upper
 * triangular one only what is above the diagonal is read. */
INLINE void affine_part(const double *matrix, const double *right, const double *y, long columns, long equations, double *out, long c, const int blocks, const int triangular)
{
    vd part[SIDE_BY_SIDE];
    long i = 0;
    UNROLL for (int b = 0; b < blocks; ++b) {
        part[b] = -*(const vu *)(right + c + b * W);
    }
    if (triangular) {
        i = c;
        UNROLL for (int corner = 0; corner < blocks; ++corner) {
            for (const long end = i + W; i < end; ++i) {
                UNROLL for (int b = 0; b <= corner; ++b) {
                    part[b] += *(const vu *)(matrix + i * equations + c + b * W) * y[i];
                }
            }
        }
    }
    for (; i < columns; ++i) {
        UNROLL for (int b = 0; b < blocks; ++b) {
            part[b] += *(const vu *)(matrix + i * equations + c + b * W) * y[i];
        }
    }
    UNROLL for (int b = 0; b < blocks; ++b) {
        *(vu *)(out + c + b * W) = part[b];
    }
}

INLINE void affine(const double *matrix, const double *right, const double *y, long columns, long equations, double *out, const int triangular)
{
    long c = 0;
    for (; c + SIDE_BY_SIDE * W <= equations; c += SIDE_BY_SIDE * W) {
        affine_part(matrix, right, y, columns, equations, out, c, SIDE_BY_SIDE, triangular);
    }
    for (; c + 2 * W <= equations; c += 2 * W) {
        affine_part(matrix, right, y, columns, equations, out, c, 2, triangular);
    }
    if (c < equations) {
        affine_part(matrix, right, y, columns, equations, out, c, 1, triangular);
    }
}

/* residual = R y - r; returns the loss. */
static double misfit(const least_squares *p, long equations, const double *y, double *residual)
{
    affine(p->factor, p->target, y, equations, equations, residual, 1);
    vd total = {0};
    for (long c = 0; c < equations; c += W) {
        total += *(const vu *)(residual + c) * *(const vu *)(residual + c);
    }
    return (p->rest + vd_sum(total)) * p->scale;
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

/* A = 2 scale R' R, whole, and b = 2 scale R' r: the slope of the loss is A y - b. The products
 * round as R' (R y - r) does, relative to |R'| |R|; only solving with A would lose digits. */
static void normal_equations(const least_squares *p, long equations, double *matrix, double *right)
{
    for (long i = 0; i < equations; ++i) {
        const double *own = p->factor + i * equations;
        for (long j = 0; j <= i; ++j) {
            const double product = 2 * p->scale * dot(own, p->factor + j * equations, j / W * W + W);
            matrix[i * equations + j] = matrix[j * equations + i] = product;
        }
        right[i] = 2 * p->scale * dot(own, p->target, i / W * W + W);
    }
}

/* Mean loss over the named samples and its slope in y; a sample is [sines and cosines in pairs, dq,
 * ddq, tau, columns, q], filled up to a multiple of LANES numbers. `later` names those of the next
 * mini-batch, which arrive from memory meanwhile. */
static double mini_batch(const ur5e_adam_job *job, const long *rows, const long *later, const double *y, double *slope)
{
    const long n_psi = job->size - LAMBDA, k = job->columns_per_joint;
    const int q_at = (int)((5 + k) * JOINTS), stride = (q_at + JOINTS + LANES - 1) / LANES * LANES;
    const int width = q_at + JOINTS;
    double *tile = job->work, *dq = tile + 2 * JOINTS * LANES, *ddq = dq + JOINTS * LANES;
    double *tau = ddq + JOINTS * LANES, *rub = tile + stride * LANES;
    const double *columns = tau + JOINTS * LANES, *q = tile + q_at * LANES;
    double u[5], total[BASE + 1] = {0}; /* slope and loss, as in the tiles that add up */
    TILE(whole, BASE + 1) = {0};
    TILE(rest, BASE + 1);
    TILE(residual, JOINTS);
    ur5e_loss_gradient_prepare(job->weight, y, u);
    memset(rub, 0, sizeof(double) * (size_t)(n_psi * LANES));
    if (job->batch % LANES) {
        memset(rest, 0, sizeof(rest));
    }
    for (long b = 0; b < job->batch; b += LANES) {
        const long have = job->batch - b < LANES ? job->batch - b : LANES;
        double *sums = have < LANES ? rest : whole;
        pick(tile, job->samples, rows + b, stride, width, have);
        for (long i = b; i < b + have; ++i) {
            for (int line = 0; line < width; line += LANES) {
                __builtin_prefetch(job->samples + later[i] * stride + line, 0, 2);
            }
        }
        for (long i = 0; i < n_psi * LANES; i += W) {
            *(vu *)(tau + i / (k * LANES) * LANES + i % LANES) -= y[BASE + i / LANES] * *(const vu *)(columns + i);
        }
        OWN(loss_gradient_tile)(tile, q, dq, ddq, tau, job->weight, y, u, sums + BASE * LANES, sums, residual);
        for (long i = 0; i < JOINTS * LANES && n_psi; ++i) {
            residual[i] *= i % LANES < have ? job->weight[i / LANES] : 0.0;
        }
        for (long i = 0; i < n_psi * LANES; i += W) {
            *(vu *)(rub + i) += *(const vu *)(columns + i) * *(const vu *)(residual + i / (k * LANES) * LANES + i % LANES);
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
static void adam_step(const ur5e_adam_job *job, const double *gradient, double *x, double *m, double *v, long count)
{
    const double keep1 = job->beta1, keep2 = job->beta2;
    const double mean = 1.0 / (1.0 - job->power1), spread = 1.0 / (1.0 - job->power2);
    for (long i = 0; i < count; i += W) {
        const vd g = *(const vu *)(gradient + i);
        const vd m_new = keep1 * *(const vu *)(m + i) + (1.0 - keep1) * g;
        const vd v_new = keep2 * *(const vu *)(v + i) + (1.0 - keep2) * (g * g);
        *(vu *)(m + i) = m_new;
        *(vu *)(v + i) = v_new;
        *(vu *)(x + i) -= vd_quotient(job->rate * (m_new * mean), vd_sqrt(v_new * spread) + job->epsilon);
    }
}

/* The held-out loss is looked at: keep the best point, count the patience. lam: as tiles. */
static void validate(ur5e_adam_job *job, double training, double loss, const double *lam)
{
    if (!isfinite(loss)) {
        job->finished = UR5E_DIVERGED;
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
        collect(job->best_x, lam);
    }
}

/* Lambda, its moments and its gradient stay tiles throughout. What comes after lambda in x moves
 * where it is, with the rest of the row of LANES in which it begins; that rest is put right last. */
static void adam(ur5e_adam_job *job, long iterations)
{
    enum { ROOM = LINK_TILES * PARAMETERS, AFTER = LAMBDA / LANES * LANES };
    const long equations = job->equations, n_psi = job->size - LAMBDA;
    const long width = (6 + job->columns_per_joint) * JOINTS;
    double *y = job->work + ((width + LANES - 1) / LANES * LANES + n_psi) * LANES;
    double *residual = y + equations, *slope = residual + equations, *gradient = slope + equations;
    double *right = gradient + job->padded, *matrix = right + equations;
    TILE(pi, ROOM);
    TILE(lam, ROOM);
    TILE(frame, LINK_TILES * FRAME);
    TILE(m, ROOM);
    TILE(v, ROOM);
    TILE(by_lam, ROOM);
    TILE(by_pi, ROOM) = {0};
    spread(lam, job->x);
    spread(m, job->m);
    spread(v, job->v);
    masses(lam, pi, frame);
    coordinates(pi, job->x + LAMBDA, n_psi, y, equations);
    if (!job->batch) {
        normal_equations(&job->training, equations, matrix, right);
    }
    memset(gradient, 0, sizeof(double) * (size_t)job->padded);
    if (job->step == 0) {
        validate(job, 0.0, misfit(&job->held, equations, y, residual), lam);
    }
    for (long k = 0; k < iterations && !job->finished; ++k) {
        const int look = (job->step + 1) % job->validate_every == 0;
        double training = 0.0;
        if (job->batch) {
            const long *rows = job->rows + k * job->batch;
            training = mini_batch(job, rows, k + 1 < iterations ? rows + job->batch : rows, y, slope);
        } else {
            training = look ? misfit(&job->training, equations, y, residual) : 0.0;
            affine(matrix, right, y, BASE + n_psi, equations, slope, 0);
        }
        job->step += 1;
        job->power1 *= job->beta1;
        job->power2 *= job->beta2;
        from_base(slope, by_pi);
        masses_back(lam, frame, by_pi, by_lam);
        adam_step(job, by_lam, lam, m, v, ROOM * LANES);
        if (n_psi) {
            memcpy(gradient + LAMBDA, slope + BASE, sizeof(double) * (size_t)n_psi);
            adam_step(job, gradient + AFTER, job->x + AFTER, job->m + AFTER, job->v + AFTER, job->padded - AFTER);
        }
        masses(lam, pi, frame);
        coordinates(pi, job->x + LAMBDA, n_psi, y, equations);
        if (look) {
            validate(job, training, misfit(&job->held, equations, y, residual), lam);
        }
        if (!job->finished && job->step - job->improved_at >= job->patience) {
            job->finished = UR5E_PATIENCE;
        }
    }
    collect(job->x, lam);
    collect(job->m, m);
    collect(job->v, v);
}

void OWN(adam)(ur5e_adam_job *jobs, long count, long iterations)
{
    for (long i = 0; i < count; ++i) {
        adam(jobs + i, iterations);
    }
}

/* J = d (R y) / d x, one column of length `equations` after the other. */
static void jacobian(const ur5e_levenberg_job *job, const double *blocks, double *out)
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
        ur5e_base_parameters(by_pi, y);
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

/* Loss at x, its residual and the blocks that J needs. */
static double evaluate(const ur5e_levenberg_job *job, const double *x, double *blocks, double *y, double *residual)
{
    TILE(lam, LINK_TILES * PARAMETERS);
    TILE(pi, LINK_TILES * PARAMETERS);
    spread(lam, x);
    bodies(lam, job->cholesky, pi, blocks);
    coordinates(pi, x + LAMBDA, job->size - LAMBDA, y, job->equations);
    return misfit(&job->training, job->equations, y, residual);
}

static void levenberg(ur5e_levenberg_job *job, long iterations)
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
        job->finished = isfinite(loss) ? 0 : UR5E_DIVERGED;
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
            job->finished = UR5E_CONVERGED;
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
                job->finished = UR5E_CONVERGED;
            }
        } else {
            job->damping *= job->growth;
            job->growth *= 2;
            if (!(job->damping < 1e200)) {
                job->finished = UR5E_STALLED;
            }
        }
    }
}

void OWN(levenberg)(ur5e_levenberg_job *jobs, long count, long iterations)
{
    for (long i = 0; i < count; ++i) {
        levenberg(jobs + i, iterations);
    }
}
