/* ur5e: cost and exact gradient of an excitation trajectory, written by symgen 0.1.0.
 *
 * q = home + sum_m a_m phi_m and two derivatives, W = the base regressors of all samples, columns of
 * W normalised: the cost is log cond W (Eq. 3.29) from the outermost eigenpairs of C = D^-1 W'W D^-1.
 * Its sensitivity to W is (W z+) z+'/l+ - (W z-) z-'/l- - W diag((v+^2 - v-^2)/d^2), z = v/d: two
 * vectors and a diagonal, which goes through the adjoint of one sample and the constant basis. */
#include "tiles.h"

#include "eigen.h"

#define JOINTS 6
#define COLUMNS 36
#define SIDE 4                                  /* columns of a block of the Gram matrix */
#define BLOCKS ((COLUMNS + SIDE - 1) / SIDE)
#define STRIDE ((COLUMNS + 7) / 8 * 8)
#define ACROSS (W == 8 ? 4 : 2)                 /* columns of the part that is summed in registers */
#define ROW(k) ((k) * LANES)
#define STATE ROW(JOINTS)
#define TILE_SIZE ROW(JOINTS * COLUMNS)

/* Filled columns of each joint's row of the regressor, from..to. */
static const int filled_from[JOINTS] = {0, 1, 8, 15, 22, 29};
static const int filled_to[JOINTS] = {36, 36, 36, 36, 36, 36};

/* Entries of the regressor that are written. */
static const int written[] = {0, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 37, 38, 39, 40, 41, 42, 43, 44, 45, 46, 47, 48, 49, 50, 51, 52, 53, 54, 55, 56, 57, 58, 59, 60, 61, 62, 63, 64, 65, 66, 67, 68, 69, 70, 71, 80, 81, 82, 83, 84, 85, 86, 87, 88, 89, 90, 91, 92, 93, 94, 95, 96, 97, 98, 99, 100, 101, 102, 103, 104, 105, 106, 107, 123, 124, 125, 126, 127, 128, 129, 130, 131, 132, 133, 134, 135, 136, 137, 138, 139, 140, 141, 142, 143, 166, 167, 168, 169, 170, 171, 172, 173, 174, 175, 176, 177, 178, 179, 209, 210, 211, 212, 213, 214, 215};

/* Joints whose rows count in each block I <= J of the Gram matrix, block after block. */
static const int block_end[] = {2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30, 32, 34, 37, 40, 43, 46, 49, 52, 55, 59, 63, 67, 71, 75, 79, 83, 87, 91, 95, 99, 104, 109, 114, 119, 124, 129, 134, 140, 146, 152};
static const int block_joints[] = {0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5};

typedef struct {
    double *q, *dq, *ddq, *sc, *regressor, *gram, *seed, *adjoint, *sums, *scratch;
    long size;
} parts;

/* The next `count` numbers of `work`, or nothing where `work` is not given yet. */
static double *place(double *work, long *size, long count)
{
    double *here = work ? work + *size : work;
    *size += count;
    return here;
}

/* Where everything lies in `work`; the regressors are cleared once and end with a spare block. */
static parts divide(double *work, long tiles, long harmonics)
{
    parts p;
    p.size = 0;
    p.regressor = place(work, &p.size, tiles * TILE_SIZE + ROW(SIDE));
    p.q = place(work, &p.size, tiles * STATE);
    p.dq = place(work, &p.size, tiles * STATE);
    p.ddq = place(work, &p.size, tiles * STATE);
    p.sc = place(work, &p.size, tiles * 2 * STATE);
    p.gram = place(work, &p.size, SIDE * BLOCKS * STRIDE);
    p.seed = place(work, &p.size, TILE_SIZE);
    p.adjoint = place(work, &p.size, 3 * STATE);
    p.sums = place(work, &p.size, ROW(JOINTS * harmonics));
    p.scratch = place(work, &p.size, 14 * STRIDE);
    return p;
}

long OWN(excitation_work)(const ur5e_excitation_job *job);
long OWN(excitation_work)(const ur5e_excitation_job *job)
{
    return divide(job->work, (job->samples + LANES - 1) / LANES, job->harmonics).size;
}

/* q, dq, ddq of every tile from the coefficients a, JOINTS x harmonics. */
static APART void motion(const ur5e_excitation_job *job, const double *a, long tiles, const parts *p)
{
    const long harmonics = job->harmonics;
    for (long t = 0; t < tiles; ++t) {
        for (int j = 0; j < JOINTS; ++j) {
            for (int h = 0; h < LANES; h += W) {
                const double *phi = job->basis + t * 3 * ROW(harmonics) + h;
                vd q = vd_all(job->home[j]), dq = vd_all(0.0), ddq = vd_all(0.0);
                for (long m = 0; m < harmonics; ++m, phi += LANES) {
                    const double by = a[j * harmonics + m];
                    q += by * *(const vu *)phi;
                    dq += by * *(const vu *)(phi + ROW(harmonics));
                    ddq += by * *(const vu *)(phi + 2 * ROW(harmonics));
                }
                const long to = t * STATE + ROW(j) + h;
                *(vu *)(p->q + to) = q;
                *(vu *)(p->dq + to) = dq;
                *(vu *)(p->ddq + to) = ddq;
            }
        }
    }
}

static APART void regressors(long samples, long tiles, const parts *p)
{
    OWN(regressor_adjoint_sines)(tiles, p->q, p->sc);
    for (long t = 0; t < tiles; ++t) {
        OWN(base_regressor_tile)(p->sc + t * 2 * STATE, p->q + t * STATE, p->dq + t * STATE, p->ddq + t * STATE, p->regressor + t * TILE_SIZE);
    }
    double *ending = p->regressor + (tiles - 1) * TILE_SIZE;
    for (long l = samples - (tiles - 1) * LANES; l < LANES; ++l) {
        for (unsigned k = 0; k < sizeof written / sizeof *written; ++k) {
            ending[ROW(written[k]) + l] = 0.0;
        }
    }
}

#if W == 8
#define FOLD1(a, b) (SHUFFLE(a, b, 0, 8, 2, 10, 4, 12, 6, 14) + SHUFFLE(a, b, 1, 9, 3, 11, 5, 13, 7, 15))
#define FOLD2(a, b) (SHUFFLE(a, b, 0, 1, 8, 9, 4, 5, 12, 13) + SHUFFLE(a, b, 2, 3, 10, 11, 6, 7, 14, 15))
#define FOLD4(a, b) (SHUFFLE(a, b, 0, 1, 2, 3, 8, 9, 10, 11) + SHUFFLE(a, b, 4, 5, 6, 7, 12, 13, 14, 15))
#elif W == 4
#define FOLD1(a, b) (SHUFFLE(a, b, 0, 4, 2, 6) + SHUFFLE(a, b, 1, 5, 3, 7))
#define FOLD2(a, b) (SHUFFLE(a, b, 0, 1, 4, 5) + SHUFFLE(a, b, 2, 3, 6, 7))
#elif W == 2
#define FOLD1(a, b) (SHUFFLE(a, b, 0, 2) + SHUFFLE(a, b, 1, 3))
#endif

/* Lane l of the result is the sum over the lanes of r[l]. */
INLINE vd sums_of(const vd *r)
{
#if W == 8
    return FOLD4(FOLD2(FOLD1(r[0], r[1]), FOLD1(r[2], r[3])), FOLD2(FOLD1(r[4], r[5]), FOLD1(r[6], r[7])));
#elif W == 4
    return FOLD2(FOLD1(r[0], r[1]), FOLD1(r[2], r[3]));
#elif W == 2
    return FOLD1(r[0], r[1]);
#else
    return r[0];
#endif
}

/* Block of the Gram matrix: columns i.. times columns j.., of the rows of some joints. */
INLINE void gram_block(const double *regressor, long tiles, int i, int j, const int *joints, int count, double *gram)
{
    vd sum[SIDE * ACROSS];
    double block[SIDE * ACROSS];
    UNROLL for (int k = 0; k < SIDE; ++k) {
        UNROLL for (int l = 0; l < ACROSS; ++l) {
            sum[k * ACROSS + l] = vd_all(0.0);
        }
    }
    for (long t = 0; t < tiles; ++t) {
        for (int r = 0; r < count; ++r) {
            const double *row = regressor + t * TILE_SIZE + ROW(joints[r] * COLUMNS);
            for (int h = 0; h < LANES; h += W) {
                vd x[ACROSS];
                UNROLL for (int l = 0; l < ACROSS; ++l) {
                    x[l] = *(const vu *)(row + ROW(j + l) + h);
                }
                UNROLL for (int k = 0; k < SIDE; ++k) {
                    const vd y = *(const vu *)(row + ROW(i + k) + h);
                    UNROLL for (int l = 0; l < ACROSS; ++l) {
                        sum[k * ACROSS + l] += y * x[l];
                    }
                }
            }
        }
    }
    UNROLL for (int k = 0; k < SIDE * ACROSS / W; ++k) {
        *(vu *)(block + k * W) = sums_of(sum + k * W);
    }
    for (int k = 0; k < SIDE; ++k) {
        for (int l = 0; l < ACROSS; ++l) {
            gram[(i + k) * STRIDE + j + l] = block[k * ACROSS + l];
            gram[(j + l) * STRIDE + i + k] = block[k * ACROSS + l];
        }
    }
}

static APART void gram_matrix(long tiles, const parts *p)
{
    int pair = 0, from = 0;
    for (int i = 0; i < COLUMNS; i += SIDE) {
        for (int j = i; j < COLUMNS; j += SIDE) {
            const int to = block_end[pair++];
            for (int part = 0; part < SIDE; part += ACROSS) {
                gram_block(p->regressor, tiles, i, j + part, block_joints + from, to - from, p->gram);
            }
            from = to;
        }
    }
}

/* C = D^-1 W'W D^-1 in place, 1/d in `scale`; a column of zeros stays one. */
static APART void normalise(double *gram, double *scale)
{
    for (int i = 0; i < STRIDE; ++i) {
        const double square = i < COLUMNS ? gram[i * STRIDE + i] : 0.0;
        scale[i] = square > DBL_MIN ? 1.0 / sqrt(square) : square * 0.0; /* NaN stays */
    }
    for (int i = 0; i < COLUMNS; ++i) {
        const double own = scale[i];
        for (int k = 0; k < STRIDE; k += W) {
            vu *at = (vu *)(gram + i * STRIDE + k);
            /* what lies beyond the matrix must be finite, whatever was there before */
            *at = vd_choose(first_lanes(COLUMNS - k), *at * own * *(const vu *)(scale + k), vd_all(0.0));
        }
    }
}

/* The sensitivity of the cost to one tile's regressor; `z` are z+ and z-, both over their l's root. */
static APART void seeds(const double *regressor, const double *z_high, const double *z_low, const double *diagonal, double *seed)
{
    for (int j = 0; j < JOINTS; ++j) {
        const int from = filled_from[j], to = filled_to[j];
        for (int h = 0; h < LANES; h += W) {
            const double *row = regressor + ROW(j * COLUMNS) + h;
            double *out = seed + ROW(j * COLUMNS) + h;
            vd high[4], low[4];
            UNROLL for (int k = 0; k < 4; ++k) {
                high[k] = low[k] = vd_all(0.0);
            }
            int c = from;
            for (; c + 4 <= to; c += 4) {
                UNROLL for (int k = 0; k < 4; ++k) {
                    const vd y = *(const vu *)(row + ROW(c + k));
                    high[k] += z_high[c + k] * y;
                    low[k] += z_low[c + k] * y;
                }
            }
            for (; c < to; ++c) {
                const vd y = *(const vu *)(row + ROW(c));
                high[0] += z_high[c] * y;
                low[0] += z_low[c] * y;
            }
            const vd all_high = (high[0] + high[1]) + (high[2] + high[3]);
            const vd all_low = (low[0] + low[1]) + (low[2] + low[3]);
            for (c = from; c < to; ++c) {
                *(vu *)(out + ROW(c)) = all_high * z_high[c] - all_low * z_low[c] - diagonal[c] * *(const vu *)(row + ROW(c));
            }
        }
    }
}

/* sums += what one tile adds to the gradient in a, lane by lane. */
static APART void add_gradient(const double *basis, long harmonics, const double *adjoint, double *sums)
{
    for (int h = 0; h < LANES; h += W) {
        for (int j = 0; j < JOINTS; ++j) {
            const vd by_q = *(const vu *)(adjoint + ROW(j) + h);
            const vd by_dq = *(const vu *)(adjoint + ROW(JOINTS + j) + h);
            const vd by_ddq = *(const vu *)(adjoint + ROW(2 * JOINTS + j) + h);
            const double *phi = basis + h;
            for (long m = 0; m < harmonics; ++m, phi += LANES) {
                *(vu *)(sums + ROW(j * harmonics + m) + h) += by_q * *(const vu *)phi + by_dq * *(const vu *)(phi + ROW(harmonics)) + by_ddq * *(const vu *)(phi + 2 * ROW(harmonics));
            }
        }
    }
}

double OWN(excitation_cost)(ur5e_excitation_job *job, const double *a, double *gradient);
double OWN(excitation_cost)(ur5e_excitation_job *job, const double *a, double *gradient)
{
    const long tiles = (job->samples + LANES - 1) / LANES, harmonics = job->harmonics;
    const parts p = divide(job->work, tiles, harmonics);
    double *d = p.scratch, *e = d + STRIDE, *f = e + STRIDE, *scale = f + STRIDE;
    double *vector[2] = {scale + STRIDE, scale + 2 * STRIDE}, *diagonal = scale + 3 * STRIDE;
    double *spare = scale + 4 * STRIDE;

    motion(job, a, tiles, &p);
    regressors(job->samples, tiles, &p);
    gram_matrix(tiles, &p);
    normalise(p.gram, scale);
    tridiagonal(COLUMNS, STRIDE, p.gram, d, e, f, spare);
    outermost(COLUMNS, d, e, spare, &job->lowest, &job->highest);
    /* What is lower cannot be told from 0: the cost stays finite, its slope that of the vectors. */
    const double least = COLUMNS * DBL_EPSILON * job->highest;
    const double low = job->lowest < least ? least : job->lowest;
    job->deficient = !(job->lowest >= least);
    job->value = log(job->highest / low) / 2.0;
    if (!gradient) {
        return job->value;
    }
    const double values[2] = {job->lowest, job->highest};
    for (int i = 0; i < STRIDE; ++i) {
        vector[0][i] = vector[1][i] = 0.0;
    }
    eigenvectors(COLUMNS, d, e, values, vector, spare);
    reflect(COLUMNS, STRIDE, p.gram, f, vector[0], vector[1]);
    const double root_low = 1.0 / sqrt(low), root_high = 1.0 / sqrt(job->highest);
    for (int i = 0; i < COLUMNS; ++i) {
        const double v_low = vector[0][i], v_high = vector[1][i];
        diagonal[i] = (v_high * v_high - v_low * v_low) * scale[i] * scale[i];
        vector[0][i] = v_low * scale[i] * root_low;
        vector[1][i] = v_high * scale[i] * root_high;
    }
    for (long k = 0; k < ROW(JOINTS * harmonics); ++k) {
        p.sums[k] = 0.0;
    }
    for (int k = 0; k < 3 * STATE; ++k) {
        p.adjoint[k] = 0.0; /* its rows that are zero by structure */
    }
    for (long t = 0; t < tiles; ++t) {
        seeds(p.regressor + t * TILE_SIZE, vector[1], vector[0], diagonal, p.seed);
        OWN(regressor_adjoint_tile)(p.sc + t * 2 * STATE, p.q + t * STATE, p.dq + t * STATE, p.ddq + t * STATE, p.seed, p.adjoint);
        add_gradient(job->basis + t * 3 * ROW(harmonics), harmonics, p.adjoint, p.sums);
    }
    for (long k = 0; k < JOINTS * harmonics; ++k) {
        gradient[k] = 0.0;
        for (int l = 0; l < LANES; ++l) {
            gradient[k] += p.sums[ROW(k) + l];
        }
    }
    return job->value;
}
