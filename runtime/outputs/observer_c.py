"""observer.c: the observer with its thresholds in C99, for a control loop.

It needs kernels.c of the generated robot and <math.h>; it allocates nothing, and one state serves
one thread. The model's band is constant there, its median over the observed log; all other terms of
the thresholds follow the state. What a session changes is learnt as by an observation in Python.
"""

from string import Template

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array, Library
from runtime.monitoring import observation
from runtime.monitoring.noise import REVERSAL_S
from runtime.monitoring.observation import (
    SLOPE_STEPS,
    Detector,
    direct_steps,
    slow_speeds,
    unknown_dry_friction,
)
from runtime.recording.friction.columns import DAHL_LOAD, LOAD, OFFSET, ROTOR, VISCOUS

FILES = ("observer.h", "observer.c", "example_observer.c")
FORMS = {  # friction column → C of the speed v, its smooth sign s, a memory's state z, weight w
    "viscous": "v",
    "coulomb": "s",
    "offset": "1.0",
    "asymmetric": "v * s",
    "dahl": "z",
    "stribeck": "s * exp(-(v / STRIBECK) * (v / STRIBECK))",
    "load": "w * s",
    "dahl_load": "w * z",
}

HEADER = Template("""/* $robot: external joint torque by a momentum observer, written by symgen.
 * Model $model_hash. */
#ifndef ${upper}_OBSERVER_H
#define ${upper}_OBSERVER_H

/* Bias and relative changes of viscous and dry friction, with their covariance. */
typedef struct {
    double theta[3], p[3][3], sum_f[3], sum_r;
    int samples, taken, left_out, started;
} ${robot}_session;

/* All that the observer remembers; {0} is the first state. */
typedef struct {
    double window[$steps + 1][3 * $n];
    double torque[$lag + 1][$n];
    double p[$n], u[$n], r[$n];
    double place[$n], travel[$n], z[$n];
    double momentum[$over + 1][$n];
    ${robot}_session session[$n];
    long samples, means;
    int slow[$n];
} ${robot}_observer;

/* Adds one sample at $rate Hz: q [rad, m], dq, tau of the motors [N m, N]. Writes the external
 * torque r and the thresholds, and returns a bit per joint whose |r| is above its threshold. In
 * joints where that gives the smaller threshold r has the rate of the momentum over $over steps
 * and the torque as it is. */
unsigned ${robot}_observer_update(${robot}_observer *o, const double q[$n], const double dq[$n],
                                  const double tau[$n], double r[$n], double threshold[$n]);

#endif
""")
SOURCE = Template("""/* $robot: external joint torque by a momentum observer, written by symgen.
 *
 *     r_k = a r_(k-1) + (1 - a) ((p_k - p_(k-1)) / D - (u_k + u_(k-1)) / 2)
 *
 * with u = tau - tau_f + C' dq - g, of means over $steps steps; a = exp(-K_O D),
 * K_O = $bandwidth 1/s, D = 1 / ($rate Hz). */
#include <math.h>
#include <string.h>

#include "$robot.h"
#include "observer.h"

enum { N = $n, BASE = $base, STEPS = $steps, LAG = $lag, RESTS = $rests, OVER = $over,
       FIRST = $first_known, LOADED = $loaded };

#define RATE $rate
#define DECAY $decay
#define COULOMB $coulomb_speed
#define STRIBECK $stribeck_speed

static const double beta[BASE] = {$beta};
static const double urdf[BASE] = {$urdf}; /* of friction that grows with the load */
static const double friction[N][$columns] = {$phi};
static const double rotor[N] = {$rotor};
/* Thresholds: z sqrt(variance), with the floor of the largest slow residual, and dry friction. */
static const double variance[N] = {$variance};
static const double level[N] = {$level};
static const double least[N] = {$least};
static const double dry[N] = {$dry};
static const double still[N] = {$still};
static const double slow[N] = {$slow}; /* speed below which dry friction may act either way */
static const double lasting[N] = {$lasting};
static const double noise[N] = {$noise}; /* variance of r without the model, for the session */
static const double stroke[N] = {$strokes};
static const double share[N] = {$share}; /* of dry friction and timing in the thresholds */
static const int direct[N] = {$direct}; /* whether r is not low-passed, see observer.h */

/* Usual torque of the session for the features f, and its variance; takes r after its use. */
static double session_update(${robot}_session *s, double noise_of_r, const double f[3], double r,
                             double *spread)
{
    const double first[3] = {$first_bias * noise_of_r, $first_viscous, $first_dry};
    const double drift[3] = {$drift_bias * noise_of_r, $drift_viscous, $drift_dry};
    double usual = 0.0;
    if (!s->started) {
        s->started = 1;
        for (int i = 0; i < 3; ++i) {
            s->p[i][i] = first[i];
        }
    }
    *spread = 0.0;
    for (int i = 0; i < 3; ++i) {
        usual += f[i] * s->theta[i];
        s->sum_f[i] += f[i];
        for (int k = 0; k < 3; ++k) {
            *spread += f[i] * s->p[i][k] * f[k];
        }
    }
    s->sum_r += r;
    if (++s->samples < $block) {
        return usual;
    }
    double gain[3] = {0}, error = s->sum_r / s->samples, total = noise_of_r;
    for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) {
            gain[i] += s->p[i][k] * s->sum_f[k] / s->samples;
        }
        total += gain[i] * s->sum_f[i] / s->samples;
        error -= s->theta[i] * s->sum_f[i] / s->samples;
    }
    if (s->taken >= $starts && error * error > $outlier * total) {
        ++s->left_out;
    } else {
        s->left_out = 0;
        ++s->taken;
        for (int i = 0; i < 3; ++i) {
            s->theta[i] += gain[i] / total * error;
            for (int k = 0; k < 3; ++k) {
                s->p[i][k] -= gain[i] / total * gain[k];
            }
        }
    }
    for (int i = 0; i < 3; ++i) {
        s->p[i][i] += drift[i];
        s->sum_f[i] = 0.0;
    }
    s->sum_r = 0.0;
    s->samples = 0;
    if (s->left_out > (s->taken < $hold ? s->taken : $hold)) {
        s->taken = s->left_out = 0;
    }
    if (s->taken < $starts) {
        memset(s->p, 0, sizeof s->p);
        for (int i = 0; i < 3; ++i) {
            s->p[i][i] = first[i];
        }
    }
    return usual;
}

/* Momentum p and C' dq - g - tau_f; the weight is |g| by the URDF. */
static void balance(const double q[N], const double v[N], const double z[N], double weight[N],
                    double p[N], double force[N])
{
    double over_p[N * BASE], over_s[N * BASE];
    memset(over_p, 0, sizeof over_p);
    memset(over_s, 0, sizeof over_s);
    memset(weight, 0, sizeof(double) * N);
    if (LOADED) {
        const double rest[N] = {0};
        ${robot}_momentum_regressor(q, rest, over_p, over_s);
        for (int j = 0; j < N; ++j) {
            for (int k = 0; k < BASE; ++k) {
                weight[j] += over_s[j * BASE + k] * urdf[k];
            }
            weight[j] = fabs(weight[j]);
        }
    }
    ${robot}_momentum_regressor(q, v, over_p, over_s);
    for (int j = 0; j < N; ++j) {
        p[j] = rotor[j] * v[j];
        force[j] = -friction_torque(j, v[j], z[j], weight[j]);
        for (int k = 0; k < BASE; ++k) {
            p[j] += over_p[j * BASE + k] * beta[k];
            force[j] += over_s[j * BASE + k] * beta[k];
        }
    }
}

unsigned ${robot}_observer_update(${robot}_observer *o, const double q[N], const double dq[N],
                                  const double tau[N], double r[N], double threshold[N])
{
    double mean[3 * N], weight[N], p[N], force[N];
    double *now = o->window[o->samples % (STEPS + 1)];
    memcpy(now, q, sizeof(double) * N);
    memcpy(now + N, dq, sizeof(double) * N);
    memcpy(now + 2 * N, tau, sizeof(double) * N);
    memcpy(r, o->r, sizeof(double) * N);
    for (int j = 0; j < N; ++j) {
        threshold[j] = level[j] * sqrt(variance[j]);
    }
    if (o->samples++ < STEPS) {
        return 0; /* the window is not full */
    }
    const double *old = o->window[o->samples % (STEPS + 1)];
    for (int i = 0; i < 3 * N; ++i) { /* mean by the trapezoidal rule */
        double sum = STEPS ? -(now[i] + old[i]) / 2 : now[i];
        for (int k = 0; STEPS && k <= STEPS; ++k) {
            sum += o->window[k][i];
        }
        mean[i] = STEPS ? sum / STEPS : sum;
    }
    if ($from_position) {
        for (int j = 0; j < N; ++j) {
            mean[N + j] = (now[j] - old[j]) * (RATE / (STEPS ? STEPS : 1));
        }
    }
    for (int j = 0; j < N; ++j) { /* friction with a memory: its state follows the path */
        double step = o->means ? mean[j] - o->place[j] : 0.0;
        double drive = (step > 0) - (step < 0);
        o->z[j] = drive + (o->z[j] - drive) * exp(-fabs(step) / stroke[j]);
        o->travel[j] += fabs(step);
        o->place[j] = mean[j];
    }
    balance(mean, mean + N, o->z, weight, p, force);
    const double *before = o->torque[(o->means + 1) % (LAG + 1)];
    unsigned contacts = 0;
    const double *past = o->momentum[(o->means + 1) % (OVER + 1)];
    for (int j = 0; j < N; ++j) {
        double u = mean[2 * N + j] + force[j], extra = 0.0, rest = 0.0;
        double usual = 0.0, spread = 0.0;
        o->momentum[o->means % (OVER + 1)][j] = p[j];
        if (o->means) {
            double w = (p[j] - o->p[j]) * RATE - (u + o->u[j]) / 2;
            double viscous = viscous_torque(j, mean[N + j]);
            double dry_part = friction_torque(j, mean[N + j], o->z[j], weight[j]) - viscous
                              - offset[j];
            double f[3] = {1.0, viscous, dry_part};
            o->r[j] = DECAY * o->r[j] + (1 - DECAY) * w;
            if (o->means >= FIRST) { /* r of all joints is known */
                if (direct[j]) {
                    o->r[j] = (p[j] - past[j]) * (RATE / OVER) - (tau[j] + force[j]);
                }
                usual = session_update(&o->session[j], noise[j], f, o->r[j], &spread);
            }
        }
        o->p[j] = p[j];
        o->u[j] = u;
        r[j] = o->means >= FIRST ? o->r[j] - usual : 0.0;
        threshold[j] = fmax(level[j] * sqrt(variance[j] + spread), least[j]);
        if (fabs(mean[N + j]) < slow[j]) {
            o->slow[j] = RESTS + 1;
        }
        if (o->slow[j] > 0) { /* at rest or just reversed: dry friction may act either way */
            extra += 2 * dry[j];
            rest = still[j];
            --o->slow[j];
        }
        if (lasting[j] > 0) { /* the first state is unknown */
            extra += lasting[j] * exp(-o->travel[j] / stroke[j]);
        }
        if (o->means >= LAG) { /* torque and position lie up to a step apart */
            extra += fabs(mean[2 * N + j] - before[j]) / LAG;
        }
        threshold[j] += share[j] * extra + rest;
        o->torque[o->means % (LAG + 1)][j] = mean[2 * N + j];
        contacts |= (unsigned)(fabs(r[j]) > threshold[j]) << j;
    }
    ++o->means;
    return contacts;
}
""")
FRICTION = Template("""static double friction_torque(int j, double v, double z, double w)
{
    const double s = tanh(v / COULOMB);
    (void)s;
    (void)z;
    (void)w;
    (void)j;
    (void)friction;
    return 0.0$terms;
}

/* Part of it that a warm gear changes; the offset is no friction. */
static double viscous_torque(int j, double v)
{
    (void)j;
    (void)v;
    return 0.0$viscous;
}

static const double offset[N] = {$offset};

""")
EXAMPLE = Template("""/* $robot: the observer in a loop. Compile and run:
 *
 *     cc -O2 example_observer.c observer.c kernels.c update.c -lm -o observer && ./observer
 *
 * kernels.c, update.c and $robot.h are those of the generated robot. */
#include <stdio.h>

#include "$robot.h"
#include "observer.h"

enum { N = $n };

static ${robot}_observer state;

int main(void)
{
    const double q[N] = {$home}, dq[N] = {0};
    double tau[N] = {0}, r[N], threshold[N];
    unsigned contacts = 0;
    /* An arm at rest without torque: gravity is an external torque to the observer. */
    for (int k = 0; k < $loops; ++k) {
        contacts |= ${robot}_observer_update(&state, q, dq, tau, r, threshold);
    }
    for (int j = 0; j < N; ++j) {
        /* state.r is r before what is learnt of the session is subtracted. */
        printf("joint %d: r %.4f, threshold %.4f\\n", j + 1, state.r[j], threshold[j]);
    }
    printf("contacts: %u\\n", contacts);
    return 0;
}
""")


def observer_c(lib: Library, detector: Detector, band: Array) -> dict[str, str]:
    """Texts of observer.h, observer.c and example_observer.c; band: (n,) [N·m, N]."""
    model, s = detector.model, detector.settings
    inertial = model.inertial
    names = [
        name for name, is_rotor in zip(model.terms.columns, inertial, strict=True) if not is_rotor
    ]
    foreign = [name for name in names if name not in FORMS]
    foreign += [n for n in np.array(model.terms.columns)[inertial].tolist() if n != ROTOR.name]
    if foreign or model.delay_s or "known_torque" in lib.manifest.kernels:
        what = ", ".join(foreign) or "a delay or a known torque"
        raise ExportError(f"observer.c is not written: there is no C code for {what}")
    n = lib.n_joints
    kept = model.phi[:, ~inertial]
    values = {
        "robot": lib.name,
        "upper": lib.name.upper(),
        "model_hash": lib.manifest.model_hash,
        "n": n,
        "base": len(model.beta),
        "steps": s.steps,
        "lag": max(s.steps, SLOPE_STEPS),
        "rests": round(REVERSAL_S * s.rate_hz),
        "rate": repr(float(s.rate_hz)),
        "bandwidth": f"{s.bandwidth:.6g}",
        "decay": repr(s.decay),
        "coulomb_speed": repr(model.terms.coulomb_speed),
        "stribeck_speed": repr(model.terms.stribeck_speed),
        "beta": _row(model.beta),
        "urdf": _row(lib.base_matrix @ lib.pi0),
        "loaded": int(not {LOAD.name, DAHL_LOAD.name}.isdisjoint(names)),
        "columns": max(kept.shape[1], 1),
        "phi": ", ".join(f"{{{_row(each) or '0.0'}}}" for each in kept),
        "rotor": _row(model.phi[:, inertial].sum(axis=1)),
        "over": direct_steps(s.rate_hz),
        "first_known": direct_steps(s.rate_hz) if np.any(detector.is_direct) else 1,
        "variance": _row(detector.noise.sigma**2 + band**2),
        "level": _row(detector.levels),
        "least": _row(detector.noise.least),
        "still": _row(unknown_dry_friction(lib, model)),
        "noise": _row(detector.noise.sigma**2),
        "direct": ", ".join(str(int(each)) for each in np.broadcast_to(detector.is_direct, n)),
        "share": _row(np.broadcast_to(detector.share, n)),
        "block": observation.block_steps(s.rate_hz),
        "hold": observation.HOLD_BLOCKS,
        "starts": observation.START_BLOCKS,
        "outlier": repr(observation.OUTLIER**2),
        **_parts("first", observation.first_covariance(np.ones(1))),
        **_parts("drift", observation.drift_of_block(np.ones(1))),
        "dry": _row(model.dry_friction),
        "lasting": _row(model.lasting_friction),
        "strokes": _row(np.broadcast_to(model.terms.dahl_stroke, n)),
        "slow": _row(slow_speeds(lib, model)),
        "from_position": int(s.velocity == "position"),
        "home": _row(lib.home),
        "loops": 10 * (s.steps + 1) + round(s.rate_hz),
    }
    terms = "".join(f" + friction[j][{k}] * ({FORMS[name]})" for k, name in enumerate(names))
    source = SOURCE.substitute(values)
    place = source.index("/* Momentum p")
    where = {name: f"friction[j][{k}]" for k, name in enumerate(names)}
    parts = {
        "terms": terms,
        "viscous": f" + {where[VISCOUS.name]} * v" if VISCOUS.name in where else "",
        "offset": _row(kept[:, names.index(OFFSET.name)] if OFFSET.name in names else np.zeros(n)),
    }
    source = source[:place] + FRICTION.substitute(parts) + source[place:]
    texts = (HEADER.substitute(values), source, EXAMPLE.substitute(values))
    return dict(zip(FILES, texts, strict=True))


def _parts(name: str, variances: Array) -> dict[str, str]:
    """Variances (1, 3) of bias, viscous and dry friction, for σ = 1."""
    parts = ("bias", "viscous", "dry")
    return {f"{name}_{part}": repr(float(x)) for part, x in zip(parts, variances[0], strict=True)}


def _row(values: Array) -> str:
    return ", ".join(repr(float(value)) for value in values)
