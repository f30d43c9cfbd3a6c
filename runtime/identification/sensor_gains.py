"""Gain and bias of the torque sensors per joint from two runs and a known payload.

    τᵐ = G (Y_b β + F φ + [loaded run] Y_k π_L) + b_run + e,   G = diag g

Rows belong to the channels: the joints, or the motors where the gear couples them, τ_m = R⁻ᵀ τ. The
six entries of an unknown inertia of the payload are further unknowns. The payload determines the
factor that all g_j have in common, and β transfers it to joints that the payload hardly loads.
Solved is

    min over θ, g, b of Σ_j ‖τᵐ_j − g_j (X_j θ + y_j) − b_j‖²/σ_j²,   on one triangle per channel

where the unknown is g_j θ_k in place of θ_k if one channel alone has the column k, as of its
friction: a gain that noise hides may pass 0, where no friction φ makes g φ that of the log.

Divided by g_j the problem is linear in (θ, a = 1/g): a_j τᵐ_j − y_j = X_j θ (Gautier & Briot 2014).
There the noise of τᵐ is among the columns and biases the solution, so that this form only gives the
start. In the form above the noise is additive, so that Gauss–Newton on (θ, g) with σ_j from the
residuals is maximum likelihood. b_j, one per run, is eliminated by subtracting means. Correlated
residuals count as N_eff samples (`coloured_noise`); intervals contain scatter of blocks and torque
that no column has (`model_error`).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.gauss_newton import Linearised, gauss_newton
from runtime.estimators.regression.coloured_noise import ColouredNoise, coloured_noise_of_basis
from runtime.estimators.regression.model_error import FreeFit, with_model_error
from runtime.estimators.regression.posterior import ROUNDING, least_squares, posterior_of
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.current_gains import channels_of, of_gain_one
from runtime.identification.payload.body import KnownPayload, Mount, mount_of, pi_of_body
from runtime.library import Array, Library, Mask, require_library
from runtime.library.parameters import INERTIA
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.consistency import require_plausible
from runtime.recording.friction.columns import OFFSET
from runtime.recording.friction.coupled_motors import geared, spread
from runtime.recording.preprocessing import prepare
from runtime.recording.recording import require_recording

_ITERATIONS = 60
_CONVERGED = 1e-9
_HALVINGS = 30
_PERFECT = 1e-9  # noise relative to the largest channel below which data count as exact
RUNS = ("empty", "loaded")
FEWEST_ROWS = 50  # samples of a run below which neither noise nor correlation can be estimated
_BLOCK = 4096
MOST_ROWS = 6000  # rows of both runs above which the error of the model is estimated from as many
_DIGITS = 1e-4  # relative difference up to which torques are the same, written with fewer digits


@dataclass(frozen=True, slots=True)
class GainSolution:
    """Maximum likelihood solution."""

    theta: Array  # θ, (p,)
    g: Array  # gains, (n,)
    alone: Mask  # whether θ_k is of one channel alone, its gain in it, (p,)
    b: Array  # offsets of every run, (runs, n)
    root: Array  # R, R Rᵀ the covariance of (θ, g, b) for white noise, (p + n + runs n, ·)
    noise: Array  # σ_j, (n,) N·m or N
    converged: bool  # whether the steps became small

    def rest(self, block: Array) -> Array:
        """Residual τᵐ − g (X θ + y) − b of rows [1 per run, X, y, τᵐ], (n, N)."""
        runs = len(self.b)
        offsets = np.einsum("jik,kj->ji", block[:, :, :runs], self.b)
        return _rest(block[:, :, runs:], self.theta, self.g, self.alone) - offsets

    def slopes(self, block: Array) -> Array:
        """∂(g (X θ + y) + b)/∂(θ, g, b) of the same rows, (n, N, p + n + runs n)."""
        return _with_offsets(block, self.theta, self.g, self.alone, len(self.b))


def reduced(blocks: Iterable[Array]) -> Array:
    """Triangular factor of the rows of each channel, (n, w, w)."""
    pending = iter(blocks)
    triangle = np.asarray(np.linalg.qr(next(pending), mode="r"))
    for block in pending:
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, block], axis=1), mode="r"))
    return triangle


def solve(triangle: Array, n_samples: int, n_runs: int) -> GainSolution:
    """Gauss–Newton from the linear solution."""
    # Below the rows of the offsets, the triangle is that of the centred data.
    rows = triangle[:, n_runs:, n_runs:]
    n, p = len(rows), rows.shape[2] - 2
    has = rows[:, :, :-2].any(axis=1)
    alone, freedom = has.sum(axis=0) == 1, max(n_samples - n_runs - (p + n) / n, 1.0)
    floor = (_PERFECT * np.linalg.norm(rows[:, :, -1])) ** 2 + np.finfo(float).tiny

    def power(x: Array) -> Array:
        return np.asarray(np.sum(_rest(rows, x[:p], x[p:], alone) ** 2, axis=1) + floor)

    def linearise(x: Array) -> Linearised:
        # σ_j² = power_j / freedom: the log-likelihood is −½ freedom Σ_j ln power_j.
        weight = np.sqrt(freedom / power(x))[:, None]
        rest = weight * _rest(rows, x[:p], x[p:], alone)
        J = weight[:, :, None] * _slopes(rows, x[:p], x[p:], alone)
        step = posterior_of(J.reshape(rest.size, -1), rest.ravel()).mean
        unit = np.where(np.arange(p + n) < p, np.inf, np.linalg.norm(x[p:]))
        return Linearised(step, unit, lambda at: float(np.log(power(at)).sum()), order=2)

    theta, g = linear(rows)
    solution = gauss_newton(
        linearise,
        np.append(np.where(alone, g @ has, 1.0) * theta, g),
        passes=_ITERATIONS,
        done=_CONVERGED,
        halvings=_HALVINGS,
    )
    x = solution.x
    # The offsets are the residuals of the means; their rows stand above those of the others.
    theta, g, noise = x[:p], x[p:], np.sqrt(power(x) / freedom)
    ones, means = triangle[:, :n_runs, :n_runs], triangle[:, :n_runs, n_runs:]
    b = _rest(np.asarray(np.linalg.solve(ones, means)), theta, g, alone).T
    slopes = _with_offsets(triangle, theta, g, alone, n_runs) / noise[:, None, None]
    root = posterior_of(slopes.reshape(-1, slopes.shape[2]), is_wide=True).root
    return GainSolution(theta, g, alone, b, root, noise, solution.converged)


def linear(rows: Array) -> tuple[Array, Array]:
    """θ (p,) and g (n,) of min ‖a τᵐ − y − X θ‖², which noise biases."""
    n, p = len(rows), rows.shape[2] - 2
    matrix = np.zeros((*rows.shape[:2], p + n))
    matrix[:, :, :p] = -rows[:, :, :-2]
    matrix[np.arange(n), :, p + np.arange(n)] = rows[:, :, -1]
    x, _ = least_squares(matrix.reshape(-1, p + n), rows[:, :, -2].ravel())
    theta, a = np.split(x, [p])
    return theta, 1 / np.where(np.abs(a) > ROUNDING, a, 1.0)


def _rest(rows: Array, theta: Array, g: Array, alone: Mask) -> Array:
    """τᵐ − g (X θ + y), (n, rows); θ contains g where `alone`."""
    fitted = (rows[:, :, :-2] @ (theta * np.where(alone, 1.0, g[:, None]))[:, :, None])[:, :, 0]
    return np.asarray(rows[:, :, -1] - g[:, None] * rows[:, :, -2] - fitted)


def _slopes(rows: Array, theta: Array, g: Array, alone: Mask) -> Array:
    """∂(τᵐ − rest)/∂(θ, g), (n, rows, p + n)."""
    n, p = len(rows), len(theta)
    J = np.zeros((*rows.shape[:2], p + n))
    J[:, :, :p] = np.where(alone, 1.0, g[:, None, None]) * rows[:, :, :-2]
    J[np.arange(n), :, p + np.arange(n)] = rows[:, :, :-2] @ (theta * ~alone) + rows[:, :, -2]
    return J


def _with_offsets(rows: Array, theta: Array, g: Array, alone: Mask, n_runs: int) -> Array:
    """∂(τᵐ − rest)/∂(θ, g, b) of rows [1 per run, X, y, τᵐ]."""
    J = _slopes(rows[:, :, n_runs:], theta, g, alone)
    offsets = np.einsum("jik,jl->jikl", rows[:, :, :n_runs], np.eye(len(g)))
    return np.concatenate([J, offsets.reshape(*J.shape[:2], -1)], axis=2)


@dataclass(frozen=True, slots=True)
class GainProblem:
    """Samples and payload from which the gains are identified."""

    lib: Library  # library of the robot
    runs: tuple[Samples, ...]  # samples without and with the payload
    mount: Mount  # link and frame of the payload
    payload: KnownPayload  # known payload
    to_channels: Array  # R⁻ᵀ (n, n) where the gear couples joints, else 1
    channels: tuple[str, ...]  # names of the n channels

    @property
    def n_samples(self) -> int:
        """Number of samples of both runs."""
        return sum(map(len, self.runs))

    def blocks(self) -> Iterator[Array]:
        """Rows [1 per run, X, y, τᵐ] of every channel, (n, N, p + 4), with τᵐ = g (X θ + y) + b."""
        bodies, known = self.mount.bodies, self.payload
        to_link = np.linalg.inv(self.mount.to_frame)
        inertia = np.zeros((3, 3)) if known.inertia is None else known.inertia
        pi = to_link @ pi_of_body(bodies, known.mass, known.com, inertia)
        free = to_link[:, INERTIA] if known.inertia is None else to_link[:, :0]
        for k, samples in enumerate(self.runs):
            for start in range(0, len(samples), _BLOCK):
                s = samples.rows(slice(start, start + _BLOCK))
                Y = k * self.lib.regressor(s.q, s.dq, s.ddq)[:, :, self.mount.columns]
                base = self.lib.base_regressor(s.q, s.dq, s.ddq)
                friction = spread(s.columns, s.coupling)
                parts = [base, friction, Y @ free, (Y @ pi)[:, :, None], s.tau[:, :, None]]
                rows = self.to_channels @ np.concatenate(parts, axis=2)
                ones = np.zeros((*rows.shape[:2], len(RUNS)))
                ones[:, :, k] = 1.0
                yield np.swapaxes(np.concatenate([ones, rows], axis=2), 0, 1)


def problem_of(
    empty: Recording,
    loaded: Recording,
    lib: Library,
    payload: KnownPayload,
    link: str | None,
    friction: Friction | None,
    preparation: Preparation | None,
) -> GainProblem:
    """Check and prepare both recordings."""
    mount = mount_of(lib, link or payload.link)
    if payload.frame and payload.frame != mount.frame:
        raise IdentificationError(
            f"the payload is given in the frame of '{payload.frame}', but expected in that of "
            f"'{mount.frame}' for a payload on '{mount.link}'; name the link that carries it"
        )
    names = empty.joint_names, loaded.joint_names
    if empty.n_joints != loaded.n_joints or (all(names) and names[0] != names[1]):
        robots = [
            ", ".join(each) or f"{run.n_joints} joints"
            for each, run in zip(names, (empty, loaded), strict=True)
        ]
        raise IdentificationError(
            f"'{empty.name}' and '{loaded.name}' are of different robots ({robots[0]}; "
            f"{robots[1]}); give two runs of one"
        )
    if _same(empty.tau, loaded.tau):
        raise IdentificationError(
            f"'{empty.name}' and '{loaded.name}' hold the same torques; give one run without and "
            "one with the payload"
        )
    if _reading(empty) != _reading(loaded):
        raise IdentificationError(
            f"'{empty.name}' and '{loaded.name}' were read with different units, gains, signs or "
            "gears of torque; read both with one recipe"
        )
    terms = friction or Friction(("viscous", "coulomb"))
    terms = replace(terms, columns=tuple(name for name in terms.columns if name != OFFSET.name))
    runs = []
    for run in (empty, loaded):
        require_plausible(run, lib)
        bare = of_gain_one(run).replace(columns=None, column_names=())
        runs.append(samples_of(prepare(bare, preparation, geared(terms, run, lib), lib=lib), lib))
        if len(runs[-1]) < FEWEST_ROWS:
            raise IdentificationError(
                f"expected {FEWEST_ROWS} samples or more of '{run.name}' after its preparation, "
                f"got {len(runs[-1])}; record for longer"
            )
    return GainProblem(lib, tuple(runs), mount, payload, *channels_of(empty, lib))


def _same(one: Array | None, other: Array | None) -> bool:
    """Whether two torques are equal to the digits of a file."""
    if one is None or other is None or one.shape != other.shape:
        return False
    return bool(np.linalg.norm(one - other) <= _DIGITS * np.linalg.norm(one))


def _reading(run: Recording) -> tuple[object, ...]:
    """Gear, unit, gain, sign and order with which a torque was read."""
    if run.recipe is None:
        return ()
    torque = run.recipe.torque
    scaling = (torque.unit, torque.gain, torque.sign, torque.order) if torque else ()
    return (run.recipe.gear, *scaling)


LARGEST_SIGMA = 0.1  # relative σ above which a gain counts as not determined
_CLEAR = 3.0  # standard deviations from which on a difference is significant


@dataclass(frozen=True, slots=True)
class Gains:
    """Gain and bias of each channel.

    Attributes:
        channels: names of the joints, or of the motors where the gear couples them.
        gain: ĝ where it is determined, else 1, (n,) reading per true torque.
        estimate: ĝ of every channel, (n,).
        covariance: of ĝ for N_eff samples, (n, n).
        is_determined: whether σ is at most `LARGEST_SIGMA` of ĝ, (n,).
        bias: of the empty and the loaded run, (2, n) N·m or N of true torque.
        bias_sigma: standard deviations of the bias, (2, n) N·m or N.
        noise: σ_j of the channels, (n,) N·m or N.
        n_samples: N of both runs.
        n_effective: N_eff of both runs.
        status: one sentence.
        notes: sentences of advice.
    """

    channels: tuple[str, ...]
    gain: Array
    estimate: Array
    covariance: Array
    is_determined: Mask
    bias: Array
    bias_sigma: Array
    noise: Array
    n_samples: int
    n_effective: float
    status: str
    notes: tuple[str, ...]

    @property
    def sigma(self) -> Array:
        """Standard deviations of ĝ, (n,)."""
        return np.sqrt(np.diagonal(self.covariance))


@one_blas_thread
def identify_gains(
    empty: Recording,
    loaded: Recording,
    lib: Library,
    payload: KnownPayload,
    link: str | None = None,
    *,
    friction: Friction | None = None,
    preparation: Preparation | None = None,
) -> Gains:
    """Identify G of τᵐ = G (Y_b β + F φ + [loaded] Y_k π_L) + b + e; the motions may differ.

    Args:
        empty: run without the payload.
        loaded: run with the payload.
        lib: library of the robot.
        payload: known payload.
        link: link that carries it; None is that of the payload, else the link of the tip.
        friction: columns beside the offset of each run; None is viscous and coulomb.
        preparation: steps for both recordings; None is that of the recipe.

    Returns:
        Gain and bias of every channel.

    Raises:
        RuntimeFault: the recordings or the payload cannot be used, or determine no gain.
    """
    require_recording(empty, loaded)
    require_library(lib)
    problem = problem_of(empty, loaded, lib, payload, link, friction, preparation)
    solution = solve(reduced(problem.blocks()), problem.n_samples, len(RUNS))
    stretches = (_over_noise(solution, block) for block in problem.blocks())
    blocks = sum(-(-len(run) // _BLOCK) for run in problem.runs)
    return _gains(problem, solution, coloured_noise_of_basis(stretches, blocks))


def _over_noise(solution: GainSolution, block: Array) -> tuple[Array, Array]:
    """Orthonormal basis of the fitted rows, (N, n, ·), and residual over noise, (N, n)."""
    rest = solution.rest(block) / solution.noise[:, None]
    if not np.isfinite(rest).all():
        raise IdentificationError(
            "the values are too large to compute gains from; check the units in the recipe"
        )
    basis = solution.slopes(block) / solution.noise[:, None, None] @ solution.root
    return basis.transpose(1, 0, 2), rest.T


def _root(problem: GainProblem, solution: GainSolution, coloured: ColouredNoise) -> Array:
    """Root of the covariance of (θ, g, b); of joints as channels with the error of the model."""
    root = solution.root * np.sqrt(coloured.density)
    if any(run.coupling is not None for run in problem.runs):
        return root
    step = -(-problem.n_samples // MOST_ROWS)
    runs = tuple(run.rows(slice(None, None, step)) for run in problem.runs)
    parts = [_over_noise(solution, block) for block in replace(problem, runs=runs).blocks()]
    # As many rows of a low-passed log know as much: the basis of the fewer ones is longer.
    basis = np.concatenate([each for each, _ in parts]) * np.sqrt(step)
    rest = np.concatenate([each for _, each in parts])
    density = coloured_noise_of_basis([(basis, rest)], 1).density
    if not density > 0:
        return root
    flat, unit = basis.reshape(rest.size, -1), 1 / solution.noise
    longer, samples = solution.root * np.sqrt(step), Samples.joined(runs)
    fit = FreeFit(samples, unit, longer, flat, np.zeros(rest.size), rest.ravel(), ())
    return with_model_error(problem.lib, fit, problem.lib.pi0, density, root)


def _gains(problem: GainProblem, solution: GainSolution, coloured: ColouredNoise) -> Gains:
    n, names = len(solution.g), problem.channels
    root, p = _root(problem, solution, coloured), len(solution.theta)
    of_gains, of_offsets = root[p : p + n], root[p + n :].reshape(len(RUNS), n, -1)
    covariance = of_gains @ of_gains.T
    share = np.sqrt(np.diagonal(covariance)) / np.maximum(np.abs(solution.g), np.finfo(float).tiny)
    is_determined = share <= LARGEST_SIGMA
    if not (solution.converged and is_determined.any()):  # without a visible load g tends to 0
        raise IdentificationError(
            f"the payload of {problem.payload.mass:g} kg changes the torques of these runs too "
            "little to determine a gain; check that it was mounted in the loaded run, use a "
            "heavier one, or turn it against gravity"
        )
    if below := [names[j] for j in np.flatnonzero(is_determined & (solution.g < 0))]:
        raise IdentificationError(
            f"the loaded run carries less than the empty one ({', '.join(below)} would have "
            "negative gains); give the empty run first, and state the sign of torque in a recipe"
        )
    gain = np.where(is_determined, solution.g, 1.0)
    # The bias is b/g; its derivative contains that of 1/g where g is estimated.
    share_of_gain = np.where(is_determined, solution.b / gain, 0.0)
    spread = of_offsets - share_of_gain[:, :, None] * of_gains
    determined = ", ".join(names[j] for j in np.flatnonzero(is_determined))
    return Gains(
        channels=names,
        gain=gain,
        estimate=solution.g,
        covariance=covariance,
        is_determined=is_determined,
        bias=solution.b / gain,
        bias_sigma=np.linalg.norm(spread, axis=2) / np.abs(gain),
        noise=solution.noise * np.sqrt(coloured.variance),
        n_samples=problem.n_samples,
        n_effective=problem.n_samples / coloured.inflation,
        status=f"identified the gains of {'all ' if is_determined.all() else ''}{determined}",
        notes=_notes(problem, solution.g, covariance, share, is_determined),
    )


def _notes(
    problem: GainProblem, g: Array, covariance: Array, share: Array, is_determined: Mask
) -> tuple[str, ...]:
    notes, weak = [], np.flatnonzero(~is_determined)
    if unsure := [f"{problem.channels[j]} ({_percent(share[j])})" for j in weak]:
        notes.append(
            f"the payload causes too little torque to determine the gain of {', '.join(unsure)}, "
            "which stays at 1; use a heavier payload, or move these joints more"
        )
    common = _common(g[is_determined], covariance[np.ix_(is_determined, is_determined)])
    if common is not None:
        notes.append(
            f"all gains equal {common:.4f} within their uncertainty: sensors seldom have the same "
            f"error, and a payload of {problem.payload.mass * common:.4g} kg instead of "
            f"{problem.payload.mass:g} kg has the same effect; weigh it again"
        )
    if problem.payload.identified:
        notes.append(
            "the payload was identified from torques, so that these gains contain those of that "
            "run; give a mass from a scale"
        )
    if problem.payload.inertia is None:
        notes.append("the inertia of the payload was not given and was identified with the gains")
    return tuple(notes)


def _common(g: Array, covariance: Array) -> float | None:
    """Factor that several gains have in common, if it differs significantly from 1."""
    if len(g) < 2:
        return None
    inverse = np.linalg.pinv(covariance)
    total = float(inverse.sum())
    mean = float(inverse.sum(axis=0) @ g) / total
    apart = float((g - mean) @ inverse @ (g - mean))
    clear = abs(mean - 1) > _CLEAR / np.sqrt(total)
    return mean if clear and apart < chdtri(len(g) - 1, 0.05) else None


def _percent(share: float) -> str:
    return f"± {100 * share:.0f} %" if share < 10 else "not at all"
