"""Payload on a known arm: ten parameters, maximum a posteriori with a ball as the prior.

    τ − Y π_arm − F φ_arm = Y_k π + b + e,   e ~ N(0, diag σ_j²)

Y_k are the columns of the link that carries the payload. b is one offset per joint, eliminated by
subtracting means. The residual of a run of the same motion without the payload is subtracted first,
so that bias and friction cancel. Friction of a joint that rests does not: it holds any part of the
payload up to the dry friction, in the same direction in every rest. Rows in which a joint rests are
therefore left out for that joint, as rows of infinite noise, where enough others are left.
Correlated residuals count as N_eff samples (`coloured_noise`), in the weight of the prior too.
Source: Lee, Wensing & Park 2019 (prior); Swevers et al. 2002 (payload).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import NONE, prior_from, spread_of
from runtime.estimators.convex.newton import convex_problem, minimise_anywhere
from runtime.estimators.regression.coloured_noise import ColouredNoise, coloured_noise_of_rows
from runtime.estimators.regression.factor import reduced_of
from runtime.estimators.regression.samples import NORMAL_95, Samples, samples_of
from runtime.identification.payload import arm_error
from runtime.identification.payload.body import NAMES, Body, Mount, Payload, body_of, mount_of
from runtime.identification.settings import GAIN_SIGMA
from runtime.library import Array, Library, Mask, require_library
from runtime.library.parameters import N_PARAMETERS, pi_from_parts
from runtime.recording import Preparation, Recording
from runtime.recording.consistency import require_plausible
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.preprocessing import prepare
from runtime.recording.recording import require_recording
from runtime.recording.rest_speeds import rest_speeds
from runtime.recording.row_marks import same_rows

LENGTH = 0.1  # relative difference of durations above which the runs are not the same trajectory
APART = 0.05  # distance of positions over a joint's travel; controllers stay within 1 %
CERTAIN_BY_FEW = 6.620212 / arm_error.FEW  # mass over σ by groups, as probable by t as normal 3 σ

EXCHANGED = 0.5
"""Share of the squared torque that a payload in the loaded run leaves, above which one in the empty
run is tried; and the squared residual of that one over the other, below which the runs are
exchanged."""


def empty_residual(
    loaded: Recording, empty: Recording, residual: Array, names: Sequence[str]
) -> Array:
    """Interpolate the residual of the empty run at the instants of the loaded one, (N, n)."""
    if abs(empty.duration - loaded.duration) > LENGTH * loaded.duration:
        raise IdentificationError(
            f"the empty run lasts {empty.duration:.3g} s, the loaded one {loaded.duration:.3g} s; "
            "record the same trajectory twice, or leave the empty run out"
        )
    t, t0 = loaded.t - loaded.t[0], empty.t - empty.t[0]

    def at(values: Array) -> Array:
        return np.stack([np.interp(t, t0, column) for column in values.T], axis=1)

    travel = np.maximum(np.ptp(loaded.q, axis=0), arm_error.LEAST_TRAVEL)
    apart = np.max(np.abs(at(empty.q) - loaded.q), axis=0) / travel
    worst = int(np.argmax(apart))
    if apart[worst] > APART:
        raise IdentificationError(
            f"the empty run follows another trajectory: {names[worst]} differs by "
            f"{100 * apart[worst]:.0f} % of its travel at the same time; record the same "
            "trajectory from the same start, or leave the empty run out"
        )
    return at(residual)


BALL_MASS, BALL_RADIUS = 0.5, 0.06  # prior: a ball of 0.5 kg and 6 cm radius, centred at the mount
PASSES = 3  # passes in which the noise follows the residuals
FEWEST_ROWS = 50  # samples below which neither noise nor correlation can be estimated
_BLOCK = 4096
_PERFECT = 1e-6  # noise relative to the largest torque below which data count as exact
_SILENT = 1e-9  # varying part of the columns over the columns, below which it is rounding
_PRIOR_SHARE = 0.5  # σ of a value over σ of the prior, above which the prior dominates the value
_CERTAIN = 3.0  # mass over its σ from which on there is a payload
CHANGED = (
    "the residual is far from what the posterior of the arm expects: the arm has changed since it "
    "was identified, which the intervals contain, or is another one, which they do not; identify "
    "it again, or record a run without the payload"
)
GAIN_DAY, LIKELY_DAY = 0.004, 0.5
"""Usual change of a torque gain between two days; size of such changes from which it is said: the
residual of runs of one session shows .1 to .2 on another simulator, of two days .8 to 1."""
ANOTHER_DAY = (
    "friction or torque gains differ between the runs as from one day to another, which the "
    "intervals contain; record both runs in one session for narrower ones"
)
_MODEL_ERROR = 0.1  # residual over torque of the payload above which the arm dominates the error


@one_blas_thread
def identify_payload(
    recording: Recording,
    lib: Library,
    link: str | None = None,
    *,
    arm: arm_error.ArmModel | None = None,
    empty: Recording | None = None,
    preparation: Preparation | None = None,
    kappa: float = NONE,
    gain_error: float = GAIN_SIGMA,
) -> Payload:
    """Identify π and b of a payload: τ − Y π_arm − F φ_arm = Y_k π + b + e.

    Args:
        recording: run with the payload.
        lib: library of the robot.
        link: link that carries the payload; None is the link of the tip.
        arm: parameters and friction of the arm; None is the URDF without friction.
        empty: run of the same motion without the payload; None for none.
        preparation: steps for both recordings; None is that of the recipe.
        kappa: weight of the prior; 1 is next to none.
        gain_error: largest standard deviation of the torque gains of the joints, relative to one;
            the intervals include what the residual supports of it.

    Returns:
        The payload with its covariance and advice.

    Raises:
        RuntimeFault: the recordings are too short, do not fit the robot, or do not move the link.
    """
    require_recording(recording, *(() if empty is None else (empty,)))
    require_library(lib)
    if not 0.0 <= gain_error < 1.0:
        raise IdentificationError(
            f"expected a gain error from 0 up to 1, relative to the gain, got {gain_error:g}; "
            "0.05 stands for 5 %"
        )
    mount, model = mount_of(lib, link), arm or arm_error.arm_model(lib)
    run, samples, residual, columns = _rows(recording, lib, mount, model, preparation)
    if len(run) < FEWEST_ROWS:
        raise IdentificationError(
            f"the recording '{recording.name}' leaves {len(run)} samples, a payload needs "
            f"{FEWEST_ROWS} or more; record for longer"
        )
    days = None
    if empty is not None:
        bare, others, residual0, _ = _rows(empty, lib, mount, model, preparation)
        dry = residual0 + others.friction(model.phi)
        days = arm_error.day_changes(samples, others, dry, min(GAIN_DAY, gain_error))
        residual = residual - empty_residual(run, bare, residual0, lib.joint_names)
        if same_rows([("", independent_joints(each, lib)) for each in (empty, recording)]):
            raise IdentificationError(
                f"'{empty.name}' and '{recording.name}' hold the same rows; give one run without "
                "and one with the payload"
            )
    # A row counts for a joint that moves, or does so in too few rows, (N, n).
    moves = np.abs(samples.dq) >= rest_speeds(lib)
    is_used = np.asarray(moves | (moves.sum(axis=0) < FEWEST_ROWS))
    solution = _solved(mount, columns, residual, kappa, is_used)
    # Not over the noise: weights that follow the residuals excuse the joints that fit worst.
    left = float(np.sum(solution.left.errors**2))
    whole = float(np.sum(arm_error.centred(residual, solution.left.noise) ** 2))
    if empty is not None and left > EXCHANGED * whole:
        other = _solved(mount, columns, -residual, kappa, is_used)
        left, whole = (
            float(np.sum((each.left.errors / other.noise) ** 2)) for each in (other, solution)
        )
        if other.pi[0] > _CERTAIN * np.sqrt(other.covariance[0, 0]) and left < EXCHANGED * whole:
            raise IdentificationError(
                f"the difference of the runs is that of a negative mass: '{empty.name}' carries "
                f"the payload and '{recording.name}' none; exchange them"
            )
    solution, repeated, gain_error, changed = _with_model_error(
        solution, lib, model, run, samples, days=days, gains=gain_error
    )
    return _payload(solution, mount, model, empty is not None, gain_error, changed, repeated)


@dataclass(frozen=True, slots=True)
class _Solution:
    """Most probable π in the link's frame, with the covariances of prior, white and real noise."""

    pi: Array
    prior: Array
    noise: Array
    offsets: Array
    white: Array
    covariance: Array
    n_samples: int
    n_effective: float
    converged: bool
    left: arm_error.Residual


def _with_model_error(
    solution: _Solution,
    lib: Library,
    model: arm_error.ArmModel,
    run: Recording,
    samples: Samples,
    *,
    days: Array | None,
    gains: float,
) -> tuple[_Solution, arm_error.PostureDeviation | None, float, tuple[str, ...]]:
    """Covariance with errors of the arm, of gains and of postures; these, σ of gains, and notes.

    days: changes from the run without the payload, where it is subtracted.
    """
    noise, extra, repeated = solution.covariance, np.zeros_like(solution.covariance), None
    notes, left, is_alone = tuple[str, ...](), solution.left, days is not None
    if not (is_alone or model.is_exact):
        if model.root is None:
            level = np.where(np.isfinite(left.noise), solution.noise, np.inf)
            of_arm = replace(left, noise=level, shape=solution.white)
            extra = arm_error.arm_covariance(lib, model, run, of_arm)
        else:
            extra, is_expected = arm_error.posterior_covariance(lib, model.root, samples, left)
            notes = () if is_expected else (CHANGED,)
    # A model by the same sensors has their gains, and takes up what repeats: the rest is news.
    is_alone = is_alone or model.root is not None
    if is_alone:
        parts = left.rows, left.errors / left.noise, left.shape, noise
        repeated = arm_error.posture_error(run, lib.joint_names, *parts)
    gains = gains if left.density > _PERFECT**2 else 0.0  # rounding shows nothing of them
    if gains:
        torque = left.columns @ solution.pi if is_alone else run.required("tau")
        of_gains, gains = arm_error.change_covariance(left, torque[..., None], gains)
        extra = extra + of_gains
    if days is not None and left.density > _PERFECT**2:
        of_days, size = arm_error.change_covariance(left, days, 1.0)
        extra = extra + of_days
        notes = (ANOTHER_DAY,) if size > LIKELY_DAY else ()
    if repeated is not None:
        noise = repeated.widened(noise)
    changed = replace(solution, covariance=noise + extra, white=solution.white + extra)
    return changed, repeated, gains, notes


def _rows(
    run: Recording, lib: Library, mount: Mount, model: arm_error.ArmModel, steps: Preparation | None
) -> tuple[Recording, Samples, Array, Array]:
    """Prepared run and samples, residual τ − Y π_arm − F φ_arm (N, n), columns Y_k (N, n, 10)."""
    run = independent_joints(run, lib)
    require_plausible(run, lib)
    prepared = prepare(run.replace(columns=None, column_names=()), steps, model.friction, lib=lib)
    s = samples_of(prepared, lib)
    residual = s.tau - lib.inverse_dynamics(s.q, s.dq, s.ddq, model.pi)
    if model.phi.size:
        residual = residual - s.friction(model.phi)
    columns = [
        lib.regressor(*(a[i : i + _BLOCK] for a in (s.q, s.dq, s.ddq)))[:, :, mount.columns]
        for i in range(0, len(s), _BLOCK)
    ]
    return prepared, s, residual, np.concatenate(columns)


def _solved(
    mount: Mount, columns: Array, residual: Array, kappa: float, is_used: Mask
) -> _Solution:
    """Maximum a posteriori in `PASSES` passes of weights."""
    count, n, _ = columns.shape
    n_samples = round(float(is_used.sum()) / n)
    left_out, counts = np.where(is_used, 0.0, np.inf), is_used.sum(axis=0)
    means, level = (arm_error.means_of(each, left_out) for each in (columns, residual))
    rows, target = (arm_error.centred(each, left_out) for each in (columns, residual))
    size = 0.4 * BALL_MASS * BALL_RADIUS**2
    ball = pi_from_parts(BALL_MASS, 0.0, [size, size, size, 0, 0, 0])  # in the mount's frame
    prior = prior_from(mount.bodies, np.asarray(np.linalg.solve(mount.to_frame, ball)))
    if np.linalg.norm(rows) <= _SILENT * np.linalg.norm(columns):
        raise IdentificationError(
            f"the link '{mount.link}' does not move in this recording, so that a payload on it "
            "cannot be separated from a torque offset; record a motion that turns "
            "it against gravity"
        )
    noise, spread = np.ones(n), float(np.abs(residual).max())
    used, pi, errors = 1 + N_PARAMETERS / n, prior.centre, target
    for done in range(PASSES + 1):
        fitted = noise + left_out  # of the rows of this pass
        # Rows over their noise, reduced to a triangle: later steps do not depend on N.
        scaled = (rows / noise[:, None]).reshape(-1, rows.shape[2])
        aim = (target / noise).ravel()
        data = reduced_of(scaled, aim, count, int(counts.sum()) - N_PARAMETERS - n)
        coloured = ColouredNoise(data.variance, data.variance)
        # The first pass takes all torque as noise: far from the minimum Newton needs the prior.
        if done == 0:
            whole = float(aim @ aim) / int(counts.sum())
            coloured = ColouredNoise(whole, whole)
        elif done == PASSES:
            levels = is_used[:, :, None] * np.eye(n) / np.sqrt(counts)
            # Only the last pass pays for N_eff; its basis contains the eliminated offsets.
            basis = np.concatenate([rows / noise[:, None], levels], axis=2)
            coloured = coloured_noise_of_rows(basis, target / noise)
            coloured = _of_used_rows(coloured, scaled.reshape(rows.shape), counts / count)
        gamma = kappa * max(coloured.density, _PERFECT**2) / count
        minimum = minimise_anywhere(convex_problem(data, prior, gamma), pi)
        pi = minimum.pi
        errors = target - rows @ pi
        # Noise of each joint, with the degrees of freedom that N_eff leaves.
        power = np.sum(errors**2, axis=0) / np.maximum(counts - used * coloured.inflation, 1.0)
        noise = np.sqrt(np.maximum(power, (_PERFECT * spread) ** 2 + 1e-300))
    # With the density as the noise; (κ B)⁻¹ by its root, as B is near singular at the boundary.
    density = max(coloured.density, _PERFECT**2)
    posterior = spread_of(mount.bodies, pi, data.factor / np.sqrt(density), kappa)
    shape = posterior.covariance / density
    return _Solution(
        pi=pi,
        prior=posterior.prior_root @ posterior.prior_root.T,
        noise=noise,
        offsets=level - means @ pi,
        white=coloured.variance * shape,
        covariance=coloured.density * shape,
        n_samples=n_samples,
        n_effective=n_samples / coloured.inflation,
        converged=minimum.converged,
        left=arm_error.Residual(columns, errors, fitted, shape, density),
    )


def _of_used_rows(noise: ColouredNoise, rows: Array, shares: Array) -> ColouredNoise:
    """Noise of the rows that are used, a share (n,) of each joint's; the others hold zeros.

    The zeros lower the spectrum of a joint by its share. Joints count by what the fit takes of
    them.
    """
    flat = rows.reshape(-1, rows.shape[2])
    inverse = np.linalg.pinv(flat.T @ flat, hermitian=True)
    taken = np.einsum("ijk,kl,ijl->j", rows, inverse, rows, optimize=True)
    share = float(taken @ shares / taken.sum())
    return ColouredNoise(noise.density / share, noise.variance / float(shares.mean()))


def _moment_note(mount: Mount, solution: _Solution) -> str:
    """Sentence on the direction u of the first moment h = m c with the most σ, u ∝ C_h⁻¹ h."""
    turn = mount.to_frame[1:4]
    moment, covariance = turn @ solution.pi, turn @ solution.covariance @ turn.T
    along = np.linalg.lstsq(covariance, moment, rcond=None)[0]
    along /= max(float(np.linalg.norm(along)), 1e-300)
    size, sigma = float(along @ moment), float(np.sqrt(along @ covariance @ along))
    lever = size / max(float((mount.to_frame @ solution.pi)[0]), 1e-300)
    direction = ", ".join(f"{x:.2f}" for x in along)
    return (
        f"best determined is mass × lever along ({direction}) of {mount.frame}: {size:.3g} ± "
        f"{NORMAL_95 * sigma:.1g} kg·m (95 %), a lever of {lever:.3g} m at the stated mass; mass "
        "and lever alone are known as their own intervals state"
    )


def _payload(
    solution: _Solution,
    mount: Mount,
    model: arm_error.ArmModel,
    differential: bool,
    gains: float,
    changed: tuple[str, ...],
    repeated: arm_error.PostureDeviation | None,
) -> Payload:
    turn = mount.to_frame

    def body(covariance: Array) -> Body:
        return body_of(mount.bodies, turn @ solution.pi, turn @ covariance @ turn.T)

    known, prior = body(solution.covariance), body(solution.prior)
    weak = tuple(
        name
        for name, sigma, before in zip(NAMES, known.sigma, prior.sigma, strict=True)
        if sigma > _PRIOR_SHARE * before
    )
    size = float(np.linalg.norm(solution.left.columns @ solution.pi))
    share = float(np.linalg.norm(solution.left.errors)) / max(size, 1e-300)
    status = status_of(known, weak, solution.converged)
    notes = (*notes_of(weak, share, model, differential, gains), *changed)
    notes += (_moment_note(mount, solution),)
    if repeated is not None:
        notes += (repeated.sentence,) * repeated.is_sure
        if known.mass < CERTAIN_BY_FEW * known.sigma[0]:
            status = (
                f"mass not determined: errors that repeat with the position of '{repeated.joint}' "
                f"leave {known.mass:.4f} kg ± {NORMAL_95 * known.sigma[0]:.4f} kg (95 %)"
            )
    return Payload(
        mount=mount,
        pi=solution.pi,
        covariance=solution.covariance,
        body=known,
        white=body(solution.white),
        offsets=solution.offsets,
        noise=solution.noise,
        n_samples=solution.n_samples,
        n_effective=solution.n_effective,
        differential=differential,
        prior_dominated=weak,
        arm=model.origin,
        gain_error=gains,
        status=status,
        notes=notes,
    )


def status_of(body: Body, weak: tuple[str, ...], converged: bool) -> str:
    """Status of the identification: the reason why it ended."""
    if not converged:
        return "not converged; check the recording for outliers and the unit of the torque"
    if body.mass < _CERTAIN * body.sigma[0]:
        return f"no significant payload ({1e3 * body.mass:.1f} g, σ {1e3 * body.sigma[0]:.1f} g)"
    if "mass" in weak:
        return "the recording does not determine the mass; move the payload against gravity"
    return f"identified {body.mass:.4f} kg ± {NORMAL_95 * body.sigma[0]:.4f} kg (95 %)"


def notes_of(
    weak: tuple[str, ...], share: float, model: arm_error.ArmModel, differential: bool, gains: float
) -> tuple[str, ...]:
    """Assumptions and limits of the result."""
    notes = []
    if gains:
        notes.append(
            "the intervals include independent errors of the torque gains, by the residual of "
            f"{100 * gains:.2g} % per joint"
        )
    else:
        notes.append(
            "the intervals assume that the torque gains are exact: a gain that is 10 % too large "
            "makes the mass 10 % too large; --settings gain_error=0.1 includes such errors"
        )
    if weak:
        notes.append(
            f"the prior rather than the data determines {', '.join(weak)}; record a motion with "
            "faster rotations about all axes of the payload"
        )
    if not (differential or model.is_exact):
        source = "estimated from the residual" if model.root is None else "by its posterior"
        notes.append(
            f"the intervals include the error of the arm's model, {source}; against a run without "
            "the payload it cancels, and they are far narrower"
        )
    if share > _MODEL_ERROR and not differential:
        other = ", or give a model identified on the empty arm" if model.root is None else ""
        notes.append(
            f"the residual is {100 * share:.0f} % of the payload's torque, so that the error of "
            "the arm's model exceeds that of the sensors; record the same motion without the "
            f"payload{other}"
        )
    if not model.phi.size and not differential:
        notes.append("friction of the arm is taken as zero; give a model or an empty run")
    return tuple(notes)
