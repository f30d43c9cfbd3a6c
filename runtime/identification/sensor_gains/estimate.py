"""Gain and bias per joint with their intervals, and what can be said of them.

What a joint reads is g_j times the true torque. Without a known load, parameters and friction take
up any factor that all g_j have in common; the payload settles it, and β, which the joints share,
hands it on to joints that the payload hardly moves. Correlated residuals count as N_eff samples
(`coloured_noise`). Source: Gautier & Briot 2014 for the joint problem.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from runtime.errors import IdentificationError
from runtime.estimators.regression.coloured_noise import ColouredNoise, coloured_noise_of_basis
from runtime.identification.payload import KnownPayload
from runtime.identification.sensor_gains.problem import RUNS, Problem, problem_of
from runtime.identification.sensor_gains.solve import Solution, reduced, solve
from runtime.library import Array, Library
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recording

Claims = NDArray[np.bool_]
LARGEST = 0.1
"""Relative σ above which a gain is not told."""
_CLEAR = 3.0
"""σ by which something differs beyond doubt."""


@dataclass(frozen=True, slots=True)
class Gains:
    """What each channel reads per true torque.

    Attributes:
        channels: names of the joints, or of the motors where the gear couples them.
        gain: ĝ where it is told, else 1, (n,).
        estimate: ĝ, however unsure, (n,).
        covariance: of ĝ by N_eff samples, (n, n).
        is_told: σ is at most `LARGEST` of ĝ, (n,) claims.
        bias: of the empty and the loaded run, (2, n) N·m or N of true torque.
        bias_sigma: (2, n).
        noise: σ_j of the channels, (n,).
        n_samples, n_effective: N and N_eff of both runs.
        status: a sentence.
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
    """G of τᵐ = G (Y_b β + F φ + [loaded] Y_k π_L) + b + e, from two runs whose motions may differ.

    Args:
        empty: without it.
        loaded: with it.
        lib: of the robot.
        payload: what was weighed.
        link: that carries it; default is the payload's own word, else the link of the tip.
        friction: columns beside the offset of each run; default viscous and coulomb.
        preparation: of both recordings; default is that of the recipe.

    Raises:
        RuntimeFault: recordings and payload do not make a problem, or tell no gain; the message
            says what to do.
    """
    problem = problem_of(empty, loaded, lib, payload, link, friction, preparation)
    found = solve(reduced(problem.blocks()), problem.n_samples, len(RUNS))
    stretches = (_over_noise(problem, found, block) for block in problem.blocks())
    return _told(problem, found, coloured_noise_of_basis(stretches, problem.n_blocks))


def _over_noise(problem: Problem, found: Solution, block: Array) -> tuple[Array, Array]:
    """An orthonormal basis of what the fit takes up, (N, n, ·), and what it leaves, (N, n)."""
    rest = found.rest(block) / found.noise[:, None]
    if not np.isfinite(rest).all():
        raise IdentificationError(
            "the gains cannot be computed from values this large; check the units in the recipe"
        )
    slopes = found.slopes(block) / found.noise[:, None, None] @ found.root
    n, count, _ = slopes.shape
    levels = np.zeros((n, count, len(RUNS) * n))
    for run, samples in enumerate(problem.runs):
        own = block[0, :, run] / np.sqrt(len(samples))
        levels[range(n), :, run * n + np.arange(n)] = own
    basis = np.concatenate([slopes, levels], axis=2)
    return basis.transpose(1, 0, 2), rest.T


def _told(problem: Problem, found: Solution, coloured: ColouredNoise) -> Gains:
    n, names = len(found.g), problem.channels
    root = found.root * np.sqrt(coloured.density)
    covariance = root[-n:] @ root[-n:].T
    sigma = np.sqrt(np.diagonal(covariance))
    share = sigma / np.maximum(np.abs(found.g), np.finfo(float).tiny)
    is_determined = share <= LARGEST
    _require_told(problem, found, is_determined)
    gain = np.where(is_determined, found.g, 1.0)
    offsets, slopes = found.offsets()
    # b/g, with the error of g where g divides.
    slopes[:, np.arange(n), np.arange(n) - n] -= np.where(is_determined, offsets / gain, 0.0)
    spread = np.sum((slopes @ root) ** 2, axis=2)
    counts = np.array([[len(run)] for run in problem.runs])
    bias_sigma = np.sqrt(spread + found.noise**2 * coloured.density / counts) / np.abs(gain)
    notes = _notes(problem, found.g, covariance, share, is_determined)
    told = ", ".join(name for name, told in zip(names, is_determined, strict=True) if told)
    return Gains(
        channels=names,
        gain=gain,
        estimate=found.g,
        covariance=covariance,
        is_determined=is_determined,
        bias=offsets / gain,
        bias_sigma=bias_sigma,
        noise=found.noise * np.sqrt(coloured.variance),
        n_samples=problem.n_samples,
        n_effective=problem.n_samples / coloured.inflation,
        status=f"found the gains of {'all ' if is_determined.all() else ''}{told}",
        notes=notes,
    )


def _require_told(problem: Problem, found: Solution, is_determined: Claims) -> None:
    """At least one gain, and none below zero."""
    if not (found.converged and is_determined.any()):  # without a load that shows, g sinks to 0
        raise IdentificationError(
            f"the payload of {problem.payload.mass:g} kg does not show in these runs clearly "
            "enough to tell a gain; check that it was mounted in the loaded run, take a heavier "
            "one, or turn it against gravity"
        )
    below = [
        name for name, x in zip(problem.channels, is_determined & (found.g < 0), strict=True) if x
    ]
    if below:
        raise IdentificationError(
            f"the loaded run carries less than the empty one ({', '.join(below)} would have "
            "negative gains); give the empty run first, and state the sign of torque in a recipe"
        )


def _notes(
    problem: Problem, g: Array, covariance: Array, share: Array, is_determined: Claims
) -> tuple[str, ...]:
    notes = []
    unsure = [
        f"{problem.channels[j]} ({_percent(share[j])})" for j in np.flatnonzero(~is_determined)
    ]
    if unsure:
        notes.append(
            f"the payload moves too little torque to tell the gain of {', '.join(unsure)}, which "
            "is left at 1; a heavier payload, or a motion with more of these joints, would"
        )
    common = _common(g[is_determined], covariance[np.ix_(is_determined, is_determined)])
    if common is not None:
        notes.append(
            f"all gains agree on {common:.4f}: sensors seldom err alike, and a payload of "
            f"{problem.payload.mass * common:.4g} kg instead of {problem.payload.mass:g} kg would "
            "look the same; weigh it again"
        )
    if problem.payload.identified:
        notes.append(
            "the payload was identified from torques, so that gains found with it repeat those of "
            "that run; give a mass from a scale"
        )
    if problem.payload.inertia is None:
        notes.append("the inertia of the payload was not given and was found along with the gains")
    return tuple(notes)


def _common(g: Array, covariance: Array) -> float | None:
    """The factor that several gains have in common, if it is clearly none of 1."""
    if len(g) < 2:
        return None
    inverse = np.linalg.pinv(covariance)
    total = float(inverse.sum())
    mean = float(inverse.sum(axis=0) @ g) / total
    apart = float((g - mean) @ inverse @ (g - mean))
    clear = abs(mean - 1) > _CLEAR / np.sqrt(total)
    return mean if clear and apart < chi2.ppf(0.95, len(g) - 1) else None


def _percent(share: float) -> str:
    return f"± {100 * share:.0f} %" if share < 10 else "not at all"
