"""Gain and bias of the torque sensors per joint, with intervals and notes.

The reading of a joint is g_j times the true torque. Without a known load, parameters and friction
absorb any factor that all g_j have in common. The payload determines this factor, and β, which the
joints share, transfers it to joints that the payload hardly loads. Correlated residuals count as
N_eff samples (`coloured_noise`). Source: Gautier & Briot 2014 for the joint problem.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.regression.coloured_noise import ColouredNoise, coloured_noise_of_basis
from runtime.identification.payload.known import KnownPayload
from runtime.identification.sensor_gains.problem import (
    RUNS,
    GainProblem,
    GainSolution,
    problem_of,
    reduced,
    solve,
)
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording

Claims = NDArray[np.bool_]
LARGEST_SIGMA = 0.1
"""Relative σ above which a gain counts as not determined."""
_CLEAR = 3.0
"""Standard deviations from which on a difference is significant."""


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
    is_determined: Claims
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
    problem = problem_of(empty, loaded, lib, payload, link, friction, preparation)
    solution = solve(reduced(problem.blocks()), problem.n_samples, len(RUNS))
    stretches = (_over_noise(problem, solution, block) for block in problem.blocks())
    return _gains(problem, solution, coloured_noise_of_basis(stretches, problem.n_blocks))


def _over_noise(problem: GainProblem, solution: GainSolution, block: Array) -> tuple[Array, Array]:
    """Orthonormal basis of the fitted rows, (N, n, ·), and residual over noise, (N, n)."""
    rest = solution.rest(block) / solution.noise[:, None]
    if not np.isfinite(rest).all():
        raise IdentificationError(
            "the values are too large to compute gains from; check the units in the recipe"
        )
    basis = solution.slopes(block) / solution.noise[:, None, None] @ solution.root
    return basis.transpose(1, 0, 2), rest.T


def _gains(problem: GainProblem, solution: GainSolution, coloured: ColouredNoise) -> Gains:
    """Gains and bias with their standard deviations, status and notes."""
    n, names = len(solution.g), problem.channels
    root = solution.root * np.sqrt(coloured.density)
    p = len(solution.theta)
    of_gains, of_offsets = root[p : p + n], root[p + n :].reshape(len(RUNS), n, -1)
    covariance = of_gains @ of_gains.T
    sigma = np.sqrt(np.diagonal(covariance))
    share = sigma / np.maximum(np.abs(solution.g), np.finfo(float).tiny)
    is_determined = share <= LARGEST_SIGMA
    _require_determined(problem, solution, is_determined)
    gain = np.where(is_determined, solution.g, 1.0)
    # The bias is b/g; its derivative contains that of 1/g where g is estimated.
    share_of_gain = np.where(is_determined, solution.b / gain, 0.0)
    spread = of_offsets - share_of_gain[:, :, None] * of_gains
    bias_sigma = np.linalg.norm(spread, axis=2) / np.abs(gain)
    notes = _notes(problem, solution.g, covariance, share, is_determined)
    determined = ", ".join(name for name, ok in zip(names, is_determined, strict=True) if ok)
    return Gains(
        channels=names,
        gain=gain,
        estimate=solution.g,
        covariance=covariance,
        is_determined=is_determined,
        bias=solution.b / gain,
        bias_sigma=bias_sigma,
        noise=solution.noise * np.sqrt(coloured.variance),
        n_samples=problem.n_samples,
        n_effective=problem.n_samples / coloured.inflation,
        status=f"identified the gains of {'all ' if is_determined.all() else ''}{determined}",
        notes=notes,
    )


def _require_determined(
    problem: GainProblem, solution: GainSolution, is_determined: Claims
) -> None:
    """Refuse a result without a determined gain, or with a negative one."""
    if not (solution.converged and is_determined.any()):  # without a visible load g tends to 0
        raise IdentificationError(
            f"the payload of {problem.payload.mass:g} kg changes the torques of these runs too "
            "little to determine a gain; check that it was mounted in the loaded run, use a "
            "heavier one, or turn it against gravity"
        )
    below = [
        name
        for name, x in zip(problem.channels, is_determined & (solution.g < 0), strict=True)
        if x
    ]
    if below:
        raise IdentificationError(
            f"the loaded run carries less than the empty one ({', '.join(below)} would have "
            "negative gains); give the empty run first, and state the sign of torque in a recipe"
        )


def _notes(
    problem: GainProblem, g: Array, covariance: Array, share: Array, is_determined: Claims
) -> tuple[str, ...]:
    notes = []
    unsure = [
        f"{problem.channels[j]} ({_percent(share[j])})" for j in np.flatnonzero(~is_determined)
    ]
    if unsure:
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
