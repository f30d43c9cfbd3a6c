"""Friction of geared joints with a memory, as columns of the logs of a campaign.

    f = ζ (φ₁ + φ₂ s + φ₃ exp(−(dq/v_s)²) + φ₄ |τ|) + φ₅ dq + φ₆ sin(w q) + φ₇ cos(w q) + φ₈

ζ is Dahl's state with the stroke z_c, s the smooth sign of dq, |τ| the measured torque, and w the
number of waves of the gear per rad. Columns tanh(dq/ε), which have no memory, leave a pattern after
every reversal; on the virtual FR3 it moves the predicted torque by 0.15 N·m. z_c, v_s, w and the
delay of the torque differ between joints and are estimated by `gear_of`:

    min over θ = (delay, ln z_c, ln v_s, w) of ‖r(θ)‖²,   r the weighted residual of [Y_b F(θ)]

r contains a prior of friction that grows with the load: |τ| is the measured torque, so that where
friction outweighs the links its column is that of dry friction again.
Gauss–Newton: the columns ∂(F φ)/∂θ join the least squares, and their coefficients are the step
(variable projection). The waves of gears are found first, joint by joint: the w whose sine and
cosine take most of the residual.
Sources: Armstrong-Hélouvry 1994 (Stribeck), Dahl 1976, Hamon et al. 2010 (load); Golub & Pereyra
1973 (variable projection), Kaufman 1975.

`arm_model` fits the arm to all logs of a campaign; `agreement_of` compares a new log with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.campaign.shortest_session import posterior_in
from runtime.estimators.convex.entropic_prior import NONE
from runtime.estimators.convex.newton import Constraints
from runtime.estimators.gauss_newton import Linearised, gauss_newton
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import FrictionPrior
from runtime.estimators.regression.coloured_noise import coloured_noise_of
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.posterior import posterior_of
from runtime.estimators.regression.samples import samples_of
from runtime.estimators.uncertainty import Uncertainty, uncertainty_of
from runtime.identification.identified import Identification, torque_of
from runtime.identification.several_logs import joined
from runtime.identification.single_log import identify_recording
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction.columns import OFFSET, dahl_state
from runtime.recording.friction.coupled_motors import spread
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.filters import low_pass
from runtime.recording.preprocessing.segments import differentiate
from runtime.recording.settings import EVERYTHING

MOTION_HZ, BELOW_RATE = 60.0, 0.4
"""Cut-off of q before it is differentiated [Hz], and the same over the rate of a slow log: measured
speeds pass a filter of the robot, which delays them by more than a millisecond."""
SIGN_SPEED = 5e-3  # width of s [rad/s, m/s], above the noise of the differentiated position
FRICTION = (
    *("dahl", "dahl asymmetric", "dahl stribeck", "dahl load"),
    *("viscous", "ripple sine", "ripple cosine"),
)
MEMORY = 4  # number of columns with ζ, the first ones
ERRORS = ("delay error", "stroke error", "peak speed error", "waves error")
"""Columns whose coefficients are errors of the parameters that the others depend on."""
SPREAD = np.array([5e-3, 0.7, 0.7, 1.0])
"""σ of delay [s], ln z_c, ln v_s and w [1/rad], of joints whose motion hardly determines them."""
LOAD = 0.02  # σ of friction over the load
NAMES = (*FRICTION, *ERRORS, OFFSET.name)  # all columns; the offset, the last one, is one per log
STROKE, PEAK_SPEED = 2e-3, 0.1  # z_c and v_s before they are estimated [rad, rad/s]
STEP = 0.1  # step of ln z_c in the difference quotient of the columns
LOWEST, HIGHEST, SPACING = 3.0, 40.0, 0.1
"""Waves per rad that are tried: below, gravity has such periods; the spacing is finer than the
width of a line, 2π over the range of a joint."""
LEAST_SHARE, LEAST_ROWS = 0.1, 50.0
"""Share of the residual that a ripple takes at least, and the same times the number of rows: noise
of N_eff ≈ N/2.5 rows yields 2 ln(tried) / N_eff."""
SEARCHES, ITERATIONS = 2, 4
LARGEST_STEP = np.array([2e-3, 0.5, 0.5, 0.3])
"""Largest step of delay [s], ln z_c, ln v_s and w [1/rad]: the columns are linear so far."""
PASSES = 3  # passes in which the weights of the joints follow their residuals
RANK_TOLERANCE = 3.2e-5  # singular value, over the largest, below which unit columns are one


@dataclass(frozen=True, slots=True, eq=False)
class GearFriction:
    """Parameters of the friction columns, (n,) each."""

    delay: Array  # the log stamps τ this much later than q [s]
    stroke: Array  # z_c [rad, m]
    peak_speed: Array  # v_s [rad/s, m/s]
    waves: Array  # w [1/rad, 1/m]; 0 for a joint without a ripple
    phi: Array  # coefficients of `FRICTION`, (n, 7), from which errors of the others become torques

    @classmethod
    def usual(cls, n: int) -> "GearFriction":
        """Values before anything is estimated, of n joints."""
        zero = np.zeros(n)
        return cls(zero, zero + STROKE, zero + PEAK_SPEED, zero, np.zeros((n, len(FRICTION))))

    def facts(self) -> dict[str, list[float]]:
        """JSON-ready content."""
        others = {key: getattr(self, key).tolist() for key in ("stroke", "peak_speed", "waves")}
        return {"torque_delay_s": self.delay.tolist()} | others


def smoothed(recording: Recording, lib: Library) -> Recording:
    """The log with dq and ddq of the low-passed q, zero-phase."""
    bare = independent_joints(recording, lib).replace(dq=None, ddq=None)
    cutoff = min(MOTION_HZ, BELOW_RATE * recording.rate_hz)
    return differentiate(low_pass(bare, cutoff, only=("q",)))


def prepared_log(motion: Recording, gear: GearFriction, preparation: Preparation) -> Recording:
    """Rows of a log with the columns of `NAMES`."""
    friction, slopes, rows = prepared_columns(motion, gear, preparation)
    columns = (friction, errors_of(slopes, gear.phi), np.ones((*friction.shape[:2], 1)))
    return rows.replace(columns=np.concatenate(columns, axis=2), column_names=NAMES)


def prepared_columns(
    motion: Recording, gear: GearFriction, preparation: Preparation
) -> tuple[Array, Array, Recording]:
    """Columns of friction and their derivatives, at the rows of a prepared log."""
    columns = friction_columns(motion, gear)
    both = np.concatenate([columns, slope_columns(motion, gear, columns)], axis=2)
    names = tuple(f"column {k}" for k in range(both.shape[2]))
    steps = replace(preparation, torque_delay_s=tuple(gear.delay.tolist()))
    rows = prepare(motion.replace(columns=both, column_names=names), steps)
    done = np.asarray(rows.columns)
    return done[..., : len(FRICTION)], done[..., len(FRICTION) :], rows


def errors_of(slopes: Array, phi: Array) -> Array:
    """Torque per error of delay, ln z_c, ln v_s and w: slopes (N, n, 8), phi (n, 7) → (N, n, 4)."""
    by_stroke = np.einsum("tjm,jm->tj", slopes[..., :MEMORY], phi[:, :MEMORY])
    by_waves = slopes[..., 5] * phi[:, 5] + slopes[..., 6] * phi[:, 6]
    return np.stack([-slopes[..., 7], by_stroke, slopes[..., 4] * phi[:, 2], by_waves], axis=2)


def friction_columns(motion: Recording, gear: GearFriction) -> Array:
    """Columns of a log at its full rate: motion (N, n) → (N, n, 7)."""
    dq = motion.required("dq")
    angle = gear.waves * motion.q
    others = np.stack([dq, np.sin(angle), np.where(gear.waves > 0, np.cos(angle), 0.0)], axis=2)
    return np.concatenate([_with_memory(motion, gear, gear.stroke), others], axis=2)


def slope_columns(motion: Recording, gear: GearFriction, columns: Array) -> Array:
    """Derivatives of the columns by the parameters of the gear: motion (N, n) → (N, n, 8)."""
    further = _with_memory(motion, gear, gear.stroke * np.exp(STEP))
    by_stroke = (further - columns[..., :MEMORY]) / STEP
    ratio = (motion.required("dq") / gear.peak_speed) ** 2
    by_speed = 2 * ratio * columns[..., 2]
    turning = np.where(gear.waves > 0, motion.q, 0.0)
    by_waves = (turning * columns[..., 6], -turning * columns[..., 5])
    rate = np.gradient(motion.required("tau"), motion.t, axis=0)
    return np.concatenate([by_stroke, np.stack([by_speed, *by_waves, rate], axis=2)], axis=2)


def _with_memory(motion: Recording, gear: GearFriction, stroke: Array) -> Array:
    """The columns with ζ, (N, n, 4)."""
    dq = motion.required("dq")
    zeta = dahl_state(motion.q, stroke)
    sign, peak = np.tanh(dq / SIGN_SPEED), np.exp(-((dq / gear.peak_speed) ** 2))
    factors = np.stack([np.ones_like(dq), sign, peak, np.abs(motion.required("tau"))], axis=2)
    return zeta[..., None] * factors


def gear_of(
    motions: Sequence[Recording], lib: Library, preparation: Preparation, start: GearFriction
) -> GearFriction:
    """Estimate delay, strokes, peak speeds and waves."""

    def linearise(x: Array) -> Linearised:
        step = _step(motions, lib, preparation, _at(start, x))[0]
        return Linearised(step.ravel(), np.ones(step.size))

    most = np.tile(LARGEST_STEP, lib.n_joints)
    x = gauss_newton(linearise, np.zeros(len(most)), passes=1, most_step=most).x
    for _ in range(SEARCHES):  # ripples that others have covered show once these are columns
        waves = _step(motions, lib, preparation, _at(start, x), searches_waves=True)[1]
        start = replace(start, waves=np.where(start.waves > 0, start.waves, waves))
    x = gauss_newton(linearise, x, passes=ITERATIONS, most_step=most).x
    gear = _at(start, x)
    return replace(gear, phi=_step(motions, lib, preparation, gear)[2])


def _at(start: GearFriction, x: Array) -> GearFriction:
    """The parameters at changes x of the start, (4 n,)."""
    delay, stroke, speed, waves = x.reshape(-1, len(SPREAD)).T
    waves = np.where(start.waves > 0, start.waves + waves, 0.0)
    stroke, speed = start.stroke * np.exp(stroke), start.peak_speed * np.exp(speed)
    return GearFriction(start.delay + delay, stroke, speed, waves, start.phi)


def _step(
    motions: Sequence[Recording],
    lib: Library,
    preparation: Preparation,
    gear: GearFriction,
    searches_waves: bool = False,
) -> tuple[Array, Array, Array]:
    """Gauss–Newton step (n, 4), waves that the residual shows or 0 (n,), coefficients (n, 7)."""
    parts = [prepared_columns(each, gear, preparation) for each in motions]
    samples = [samples_of(rows.replace(columns=None, column_names=()), lib) for *_, rows in parts]
    slopes = np.concatenate([each[1] for each in parts])
    q, tau = (np.concatenate([getattr(s, key) for s in samples]) for key in ("q", "tau"))
    base = np.concatenate([each.base_rows(lib) for each in samples])
    log_of_row = np.repeat(np.arange(len(parts)), [len(each) for each in samples])
    offsets = (log_of_row[:, None] == np.arange(len(parts))).astype(float)  # one per log and joint
    friction = np.concatenate([each[0] for each in parts])
    count, n, k = friction.shape
    apart = np.broadcast_to(offsets[:, None], (count, n, len(parts)))
    rows = np.concatenate([base, spread(np.concatenate([friction, apart], axis=2), None)], axis=2)
    weight, phi, rest = np.ones(n), np.zeros((n, k)), tau
    basis = np.zeros((count * n, 0))
    known = np.zeros((1, n, rows.shape[2]))  # the prior of friction that grows with the load
    loads = base.shape[2] + FRICTION.index("dahl load") + (k + len(parts)) * np.arange(n)
    known[0, np.arange(n), loads] = 1 / LOAD
    for _ in range(PASSES):
        scaled, target = rows * weight[:, None], np.vstack([tau * weight, np.zeros(n)])
        fit = posterior_of(np.concatenate([scaled, known]), target, rank=RANK_TOLERANCE)
        phi = fit.mean[base.shape[2] :].reshape(n, -1)[:, :k]
        basis = scaled.reshape(count * n, -1) @ fit.root
        rest = tau - rows @ fit.mean
        weight = 1 / np.maximum(rest.std(axis=0), 1e-12)
    # Columns of the parameters without what the other columns explain, over σ of their prior.
    scale = np.tile(SPREAD, n)
    added = (spread(errors_of(slopes, phi), None) * weight[:, None]).reshape(count * n, -1) * scale
    added = added - basis @ (basis.T @ added)
    target = added.T @ (rest * weight).ravel()
    theta = scale * np.linalg.solve(np.eye(len(scale)) + added.T @ added, target)
    waves = _waves(q, rest * weight, basis) if searches_waves else np.zeros(n)
    return theta.reshape(n, len(SPREAD)), waves, phi


def _waves(q: Array, rest: Array, basis: Array) -> Array:
    """Waves per rad of the strongest ripple of every joint, 0 where there is none, (n,).

    The residual r explained by C = [sin wq, cos wq] beside the other columns is cᵀ G⁻¹ c with
    c = Cᵀ r and G = Cᵀ C − (Bᵀ C)ᵀ (Bᵀ C), B the orthonormal basis of these columns.
    """
    count, n = q.shape
    tried, waves = np.arange(LOWEST, HIGHEST, SPACING), np.zeros(n)
    by_joint = basis.reshape(count, n, -1)
    for j in range(n):
        angle = np.outer(q[:, j], tried)
        pair = np.sin(angle), np.cos(angle)
        known = [by_joint[:, j].T @ each for each in pair]
        on = [each.T @ rest[:, j] for each in pair]
        g = [[_dots(pair[a], pair[b]) - _dots(known[a], known[b]) for b in (0, 1)] for a in (0, 1)]
        least = 1e-3 * count  # what the other columns explain is absent
        size = np.maximum(g[0][0] * g[1][1] - g[0][1] ** 2, least**2)
        gained = g[1][1] * on[0] ** 2 - 2 * g[0][1] * on[0] * on[1] + g[0][0] * on[1] ** 2
        share = gained / size / float(rest[:, j] @ rest[:, j])
        best = int(np.argmax(share))
        if share[best] > max(LEAST_SHARE, LEAST_ROWS / count):
            waves[j] = tried[best]
    return waves


def _dots(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->j", a, b)


PREPARATION = Preparation(filter="butterworth", cutoff_hz=10.0, rate_hz=50.0, trim_s=0.1)
"""Of every log. Motions of five harmonics end below 3 Hz; above 10 Hz the accelerations of encoders
of 10 µrad are noisier than torque sensors."""
UNSEEN_RIPPLE, UNSEEN_FRICTION = 0.005, 0.3
"""σ of torques that logs so far have not shown, over the range of the torque of a joint and over
its friction: a slow stage shows the friction of full speed to a third."""
ASYMMETRY, PEAK, RIPPLE = 0.2, 0.5, 0.1
"""σ over the dry friction of a joint: difference between the directions, Stribeck peak, ripple."""
VAGUE = PriorFile(NONE, Constraints())  # the URDF may be wrong, and data determine all of β


@dataclass(frozen=True, slots=True)
class ArmModel:
    """Model of an arm and its joints."""

    result: Identification  # from all logs; its friction columns are those of the gear
    gear: GearFriction  # what these columns depend on


def arm_model(lib: Library, motions: Sequence[tuple[str, Recording]], first: int = 0) -> ArmModel:
    """Identify the arm from all rows of all logs, with one offset per joint and log."""
    usual = GearFriction.usual(lib.n_joints)
    gear = gear_of([each for _, each in motions[first:]], lib, PREPARATION, usual)
    names = [name for name, _ in motions]
    prepared = [prepared_log(each, gear, PREPARATION) for _, each in motions]
    known = gear_prior(gear, len(motions))
    result = identify_recording(
        joined(prepared, names, names),
        lib,
        method="map",
        prior=VAGUE,
        preparation=Preparation(),
        split=EVERYTHING,
        friction=Friction(NAMES),
        friction_prior=known,
    )
    spread = _uncertainty(result, known, [len(each.t) for each in prepared])
    return ArmModel(replace(result, log_names=tuple(names), uncertainty=spread), gear)


def _uncertainty(result: Identification, known: FrictionPrior, rows: list[int]) -> Uncertainty:
    """Uncertainty with the prior of the friction columns, and the noise of base parameters.

    What the friction columns do not describe has the frequencies of friction; averaged over all
    unknowns it would widen the intervals of β, which are orthogonal to these columns, by a third.
    """
    lib, tests = result.lib, posterior_in(result).tests
    samples = samples_of(result.train, lib)
    statistics = compress(lib, samples, result.weights)
    ends = np.cumsum(rows)
    parts = [samples.rows(slice(b - n, b)) for b, n in zip(ends.tolist(), rows, strict=True)]
    coloured = coloured_noise_of(lib, parts, statistics, result.weights, only_base=True)
    posterior = uncertainty_of(
        lib,
        samples,
        result.pi,
        result.phi,
        first_guess=lib.pi0,
        kappa=NONE,
        statistics=statistics.merged(known.statistics(statistics, coloured.density)),
        coloured_noise=coloured,
        tests=False,
    )
    return replace(posterior, tests=tests)


def gear_prior(gear: GearFriction, logs: int) -> FrictionPrior:
    """Prior of the columns that gears show beside viscous friction, as shares of the dry friction.

    Without it a short log leaves their sum with the torque of the links open. Errors of the
    parameters have the prior of their search, so that the posterior counts them.
    """
    dry = np.maximum(np.abs(gear.phi[:, 0]), 1e-9)
    free = np.full((len(dry), 1), np.inf)
    shares = dry[:, None] * np.array([ASYMMETRY, PEAK, RIPPLE, RIPPLE])
    load, errors = np.full_like(free, LOAD), np.tile(SPREAD, (len(dry), 1))
    parts = (free, shares[:, :2], load, free, shares[:, 2:], errors, *[free] * logs)
    sigma = np.concatenate(parts, axis=1)
    return FrictionPrior(np.zeros_like(sigma), sigma)


def agreement_of(model: ArmModel, motion: Recording, unseen: float = 1.0) -> tuple[float, ...]:
    """RMS of the residual of a new log over the RMS of the stated band, per joint."""
    result, shared = model.result, len(NAMES) - 1
    lib, known = result.lib, posterior_in(result)
    prepared = prepared_log(motion, model.gear, PREPARATION)
    # Offsets of sensors drift between logs: no offset, and a residual without its mean.
    prepared = prepared.replace(
        columns=np.asarray(prepared.columns)[..., :shared], column_names=NAMES[:shared]
    )
    samples = samples_of(prepared, lib)
    phi = result.phi[:, :shared]
    rest = samples.tau - torque_of(lib, samples, result.pi, phi, None)
    rest = rest - rest.mean(axis=0)
    band = np.hypot(known.band_of(lib, samples), known.noise)
    # What logs so far have not shown: friction at other speeds, ripple at other places.
    ripple = UNSEEN_RIPPLE * np.ptp(samples.tau, axis=0)
    friction = UNSEEN_FRICTION * np.sqrt(np.mean(samples.friction(phi) ** 2, axis=0))
    band = np.hypot(band, unseen * np.hypot(ripple, friction))
    return tuple(map(float, np.sqrt((rest**2).mean(axis=0) / (band**2).mean(axis=0))))
