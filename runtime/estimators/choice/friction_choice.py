"""Choice of the friction model by cross-validation of candidates in the order of complexity.

    offset → viscous → coulomb → asymmetric → stribeck → dahl → load → gear       (`friction`)

The training part is cut into contiguous blocks, which keep the correlation of neighbouring rows,
each compressed to a triangular factor. A candidate is fitted, with the base parameters, to all
blocks but one and predicts the one that is left out, in units of the noise of each joint:

    score = mean over blocks of ‖R_b x_b − r_b‖² + ρ_b over N_b n,  x_b from the other blocks

A width (ε, v_s or z_c) takes the best of a geometric grid, the only nonlinear part. The chosen
candidate is the simplest whose score is within one standard error of the best (Breiman et al. 1984,
Sec. 3.4.3) or within `LEAST_GAIN`. AIC = N_eff ln(χ²/N) + 2 p is reported beside it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.regression.coloured_noise import coloured_noise_of
from runtime.estimators.regression.factor import Statistics, compress
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.library import Array, Library, require_library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.friction.model import unresolved, without_columns
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.recording import require_recording

BLOCKS = 5
LEAST_GAIN = 0.005  # share of the mean square error that a candidate must save to count as better
_RANK = 1e-9  # singular value of unit columns, over the largest, below which it is 0


def solved(stats: Sequence[Statistics]) -> tuple[Array, int]:
    """Least squares on several factors with normalised columns: x of least length, and the rank.

    By singular values: pivots decide otherwise where columns nearly depend on each other. A column
    of zeros gets zero.
    """
    factor = np.concatenate([s.factor for s in stats])
    target = np.concatenate([s.target for s in stats])
    lengths = np.linalg.norm(factor, axis=0)
    lengths[lengths == 0] = np.inf
    x, _, rank, _ = np.linalg.lstsq(factor / lengths, target, rcond=_RANK)
    return x / lengths, int(rank)


def misfit(block: Statistics, x: Array) -> float:
    """Weighted sum of squared residuals of x on one block."""
    rest = block.factor @ x - block.target
    return float(rest @ rest + block.rest)


def weights_by_fits(
    lib: Library, blocks: Sequence[Samples], weights: Array, passes: int
) -> tuple[Array, Array]:
    """Weights 1/σ_j² of the joints by residuals of fits to all blocks, and the last ones (N, n)."""
    for _ in range(passes):
        x, _rank = solved([compress(lib, block, weights) for block in blocks])
        rest = np.concatenate([block.tau - block.base_torque(lib, x) for block in blocks])
        weights = inverse_of(np.mean(rest**2, axis=0))
    return weights, rest


def inverse_of(variance: Array) -> Array:
    """Weights 1/σ_j² of the joints, finite where a variance is rounding."""
    return np.asarray(1.0 / np.maximum(variance, 1e-12 * variance.max() + 1e-30))


def excess_of(scores: Array, best: Array) -> tuple[float, float]:
    """Mean difference of scores per block from the best ones, and its standard error."""
    gap = scores - best
    return float(gap.mean()), float(gap.std(ddof=1) / np.sqrt(len(gap)))


_BASE = ("offset", "viscous", "coulomb")
FRICTION_MODELS: dict[str, tuple[str, ...]] = {  # candidate → its columns, by complexity
    "none": (),
    "offset": ("offset",),
    "viscous": ("offset", "viscous"),
    "coulomb": _BASE,
    "asymmetric": (*_BASE, "asymmetric"),
    "stribeck": (*_BASE, "stribeck"),
    "dahl": ("offset", "viscous", "dahl"),
    "load": (*_BASE, "load"),
    "gear": ("offset", "viscous", "dahl", "load", "rotor"),
}

WIDTHS: dict[str, tuple[str, tuple[float, ...]]] = {  # column → width, and grid [rad/s or rad]
    "coulomb": ("coulomb_speed", tuple(0.005 * 2.0**k for k in range(6))),
    "stribeck": ("stribeck_speed", tuple(0.02 * 2.0**k for k in range(6))),
    "dahl": ("dahl_stroke", tuple(2e-4 * 2.0**k for k in range(8))),
}

_WIDTH = 0.02  # relative accuracy of a width
_PASSES = 3  # passes in which the noise of the joints is estimated from the residuals


@dataclass(frozen=True, slots=True)
class FrictionCandidate:
    """One friction model with its score."""

    name: str  # one of `FRICTION_MODELS`
    terms: Friction  # columns and widths
    score: float  # cross-validated mean square error over the variance of the noise
    excess: float  # score minus the best score
    excess_error: float  # standard error of `excess`, from the differences of the blocks
    aic: float  # Akaike's criterion; only differences have a meaning
    parameters: int  # number of base parameters and friction coefficients that the data determine


@dataclass(frozen=True, slots=True)
class FrictionChoice:
    """All candidates and the chosen one."""

    candidates: tuple[FrictionCandidate, ...]  # all that were tried, in the order of complexity
    chosen: FrictionCandidate  # the simplest within one standard error of the best
    sentence: str  # the choice and its reason


@one_blas_thread
def choose_friction(
    recording: Recording,
    lib: Library,
    preparation: Preparation | None = None,
    split: Split | None = None,
    coulomb_speed: float | None = None,
    names: Sequence[str] = tuple(FRICTION_MODELS),
    extra: tuple[str, ...] = (),
) -> FrictionChoice:
    """Choose the simplest friction model within one standard error of the best score.

    The training and validation parts of the recording are used. The test part is cut off before
    any filter, so that no sample of it has an effect.

    Args:
        recording: as read; friction columns that it holds are not used.
        lib: library of the robot.
        preparation: None is the recipe's.
        split: shares of the parts; None is the recipe's, else the first 60 % are used.
        coulomb_speed: ε [rad/s]; None searches it.
        names: candidates to try.
        extra: columns that every candidate has, such as "rotor".

    Returns:
        The candidates with their scores, and the chosen one.

    Raises:
        IdentificationError: an unknown candidate, or too few samples for five blocks.
    """
    require_recording(recording)
    require_library(lib)
    bare = before_test(recording, split).replace(columns=None, column_names=())

    made: Array | None = None  # rows without accelerations are by far the dearest part: kept

    def blocks(*terms: Friction) -> list[Samples]:
        nonlocal made
        done = prepare(bare, preparation, *terms, lib=lib, rows=made)
        made = done.rows
        if done.columns is not None and done.tau is not None:
            done = without_columns(done, unresolved(done.columns, done.tau))
        return in_blocks(samples_of(done, lib))

    return choose_among(lib, blocks, coulomb_speed, names, extra)


def in_blocks(whole: Samples) -> list[Samples]:
    """Contiguous blocks of samples."""
    cuts = np.array_split(np.arange(len(whole)), BLOCKS)
    return [whole.rows(slice(int(c[0]), int(c[-1]) + 1)) for c in cuts if c.size]


def choose_among(
    lib: Library,
    blocks: Callable[..., list[Samples]],
    coulomb_speed: float | None = None,
    names: Sequence[str] = tuple(FRICTION_MODELS),
    extra: tuple[str, ...] = (),
) -> FrictionChoice:
    """Choose a friction model for rows of any robot: terms → `BLOCKS` blocks of them."""
    wrong = [name for name in names if name not in FRICTION_MODELS]
    if wrong or not names:
        raise IdentificationError(
            f"there is no friction model '{wrong[0] if wrong else ''}'; choose from "
            f"auto, {', '.join(FRICTION_MODELS)}"
        )
    # Every candidate with its best widths; ε starts from that of the candidate "coulomb".
    trial, free, dry = _Trial(lib, blocks), coulomb_speed is None, _BASE[-1]
    start = Friction((*_BASE, *extra), *(() if free else (coulomb_speed,)))
    if free and any(dry in FRICTION_MODELS[name] for name in names):
        start = trial.best_width(start, dry)
    models = {}
    for name in names:
        model = replace(start, columns=tuple(dict.fromkeys((*FRICTION_MODELS[name], *extra))))
        wide = [each for each in FRICTION_MODELS[name] if each in WIDTHS and each != dry]
        for each in wide:
            model = trial.best_width(model, each)
        if free and len(FRICTION_MODELS[name]) > len(_BASE):
            for each in (dry, *wide):
                model = trial.best_width(model, each, near=True)
        models[name] = model
    first = {name: float(trial.score(each)[0].mean()) for name, each in models.items()}
    trial.weigh_by(models[min(first, key=lambda name: first[name])])
    return _chosen([(name, each, *trial.score(each)) for name, each in models.items()])


def _chosen(trials: list[tuple[str, Friction, Array, float, int]]) -> FrictionChoice:
    """The choice from name, terms, score per block, AIC and rank of every candidate."""
    best = min(trials, key=lambda item: float(item[2].mean()))[2]
    candidates = []
    for name, terms, scores, aic, parameters in trials:
        numbers = float(scores.mean()), *excess_of(scores, best), aic, parameters
        candidates.append(FrictionCandidate(name, terms, *numbers))
    least = float(best.mean())
    chosen = next(r for r in candidates if r.excess <= max(r.excess_error, LEAST_GAIN * least))
    top = min(candidates, key=lambda r: r.score)
    reason = f"the simplest that predicts as well as '{top.name}' within one standard error"
    reason = "which also predicts best" if chosen is top else reason
    sentence = (
        f"friction model '{chosen.name}' ({chosen.terms}) chosen by cross-validation on "
        f"{BLOCKS} blocks of the training part, {reason}"
    )
    return FrictionChoice(tuple(candidates), chosen, sentence)


class _Trial:
    def __init__(self, lib: Library, blocks: Callable[..., list[Samples]]) -> None:
        self._lib, self._blocks = lib, blocks
        plain = blocks(Friction(_BASE))
        equations = min(block.tau.size for block in plain) * (BLOCKS - 1)
        unknowns = len(lib.base_columns) + lib.n_joints * (len(_BASE) + 1)
        if len(plain) < BLOCKS or equations < 2 * unknowns:
            raise IdentificationError(
                f"the training part gives {equations} equations for {unknowns} unknowns, too few "
                "to choose a friction model by cross-validation; record for longer, or name the "
                "model with --friction"
            )
        self._weights, self._inflation = _noise(lib, plain)

    def weigh_by(self, terms: Friction) -> None:
        """Estimate the noise of the joints from the residuals of a fit with these terms."""
        self._weights, self._inflation = _noise(self._lib, self._blocks(terms))

    def best_width(self, terms: Friction, column: str, near: bool = False) -> Friction:
        """Search the width with the best score: on a grid, then between its points."""
        key, grid = WIDTHS[column]

        def score(log_width: float) -> float:
            return float(self.score(with_width(terms, key, np.exp(log_width)))[0].mean())

        logs = np.log(grid)
        scores = [] if near else [score(x) for x in logs]
        best = float(np.log(getattr(terms, key))) if near else logs[int(np.argmin(scores))]
        step = logs[1] - logs[0]
        low, high = max(best - step, logs[0]), min(best + step, logs[-1])
        search = {"bounds": (low, high), "method": "bounded", "options": {"xatol": _WIDTH}}
        x = float(minimize_scalar(score, **search).x)
        return with_width(terms, key, np.exp(x if score(x) < score(best) else best))

    def score(self, terms: Friction) -> tuple[Array, float, int]:
        """Score per block, AIC, and the number of parameters that the data determine."""
        stats = [compress(self._lib, block, self._weights) for block in self._blocks(terms)]
        n = len(self._weights)
        scores = []
        for k, block in enumerate(stats):
            x, _ = solved([s for i, s in enumerate(stats) if i != k])
            scores.append(misfit(block, x) / (block.n_samples * n))
        x, rank = solved(stats)
        count = sum(s.n_samples for s in stats) * n
        squares = sum(misfit(s, x) for s in stats)
        aic = count / self._inflation * np.log(squares / count) + 2 * rank
        return np.array(scores), float(aic), rank


def _noise(lib: Library, blocks: list[Samples]) -> tuple[Array, float]:
    """1/σ_j² per joint from the residuals of a fit, and N / N_eff of the residuals."""
    weights, _ = weights_by_fits(lib, blocks, np.ones(blocks[0].equations), _PASSES)
    first, *others = (compress(lib, block, weights) for block in blocks)
    return weights, coloured_noise_of(lib, blocks, first.merged(*others), weights).inflation


def with_width(terms: Friction, key: str, width: float) -> Friction:
    """Terms with another width."""
    changed: dict[str, Any] = {key: float(width)}
    return replace(terms, **changed)
