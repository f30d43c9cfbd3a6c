"""Which friction model do the data carry? A ladder of them, judged by cross-validation.

    offset → viscous → coulomb → asymmetric → stribeck → dahl → load       (`friction`)

The training part is cut into contiguous blocks. Each rung is fitted, with the base parameters, on
all blocks but one and tried on that one, in units of the noise of each joint:

    score = mean over blocks of ‖R_b x_b − r_b‖² + ρ_b over N_b n,  x_b from the other blocks

All of it happens on triangular factors, one per block (`regression`). A rung with a width
(ε, v_s or z_c) takes the best of a geometric grid, the only part that is not linear. The chosen
rung is the lowest whose score is within one standard error of the best (Breiman et al. 1984,
Sec. 3.4.3) or half a percent; AIC = N_eff ln(χ²/N) + 2 p stands beside it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from runtime.errors import IdentificationError
from runtime.estimators.regression import Statistics, compress
from runtime.estimators.regression.coloured_noise import coloured_noise_of
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.library import Array, Library
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.preprocessing import prepare

_BASE = ("offset", "viscous", "coulomb")
FRICTION_MODELS: dict[str, tuple[str, ...]] = {
    "none": (),
    "offset": ("offset",),
    "viscous": ("offset", "viscous"),
    "coulomb": _BASE,
    "asymmetric": (*_BASE, "asymmetric"),
    "stribeck": (*_BASE, "stribeck"),
    "dahl": ("offset", "viscous", "dahl"),
    "load": (*_BASE, "load"),
}
"""Name → columns, in the order of complexity."""

WIDTHS: dict[str, tuple[str, tuple[float, ...]]] = {
    "coulomb": ("coulomb_speed", tuple(0.005 * 2.0**k for k in range(6))),
    "stribeck": ("stribeck_speed", tuple(0.02 * 2.0**k for k in range(6))),
    "dahl": ("dahl_stroke", tuple(2e-4 * 2.0**k for k in range(8))),
}
"""Rung → its one width and the grid to search, in rad/s or rad."""

BLOCKS = 5
LEAST_GAIN = 0.005
"""Part of the mean square error that a richer rung must save to be worth its coefficients."""
_RANK = 1e-9
_WIDTH = 0.02
"""Relative accuracy of a width."""
_PASSES = 3
"""Passes in which the noise of the joints is estimated from residuals."""


@dataclass(frozen=True, slots=True)
class FrictionCandidate:
    """One friction model and how it did.

    Attributes:
        name: one of `FRICTION_MODELS`.
        terms: its columns and widths.
        score: cross-validated mean square error over the noise's variance.
        excess: score minus the best of all rungs.
        excess_error: standard error of that, from the differences of the blocks.
        aic: Akaike's criterion; only differences mean something.
        parameters: identified base parameters and friction coefficients.
    """

    name: str
    terms: Friction
    score: float
    excess: float
    excess_error: float
    aic: float
    parameters: int


@dataclass(frozen=True, slots=True)
class FrictionChoice:
    """The ladder with its chosen rung.

    Attributes:
        rungs: all that were tried, in order.
        chosen: the lowest within one standard error of the best.
        sentence: what was chosen and why.
    """

    candidates: tuple[FrictionCandidate, ...]
    chosen: FrictionCandidate
    sentence: str


@one_blas_thread
def choose_friction(
    recording: Recording,
    lib: Library,
    preparation: Preparation | None = None,
    splitting: Split | None = None,
    coulomb_speed: float | None = None,
    names: Sequence[str] = tuple(FRICTION_MODELS),
    extra: tuple[str, ...] = (),
) -> FrictionChoice:
    """The lowest rung whose cross-validated score is within one standard error of the best one.

    Training and validation parts of the recording are tried, the test part is not looked at.

    Args:
        recording: as read; its columns, if it has any, are not used.
        lib: of the robot.
        preparation: default is the recipe's.
        splitting: default is the recipe's, else the first 60 %.
        coulomb_speed: ε; None searches it.
        names: rungs to try.
        extra: columns that every rung has, such as "rotor".

    Raises:
        IdentificationError: an unknown rung, or too few samples for five blocks.
    """
    wrong = [name for name in names if name not in FRICTION_MODELS]
    if wrong or not names:
        raise IdentificationError(
            f"there is no friction model '{wrong[0] if wrong else ''}'; choose from "
            f"auto, {', '.join(FRICTION_MODELS)}"
        )
    parts = splitting or (recording.recipe.split if recording.recipe else None) or Split()
    bare = recording.replace(columns=None, column_names=())

    made: Array | None = None  # rows without accelerations cost more than anything else

    def blocks(*terms: Friction) -> list[Samples]:
        nonlocal made
        done = prepare(bare, preparation, *terms, lib=lib, rows=made)
        made = done.rows
        share = (done.t - done.t[0]) / (done.duration or 1.0)
        rows = np.flatnonzero(share < parts.validation[1])
        cuts = np.array_split(rows, BLOCKS)
        whole = samples_of(done, lib)
        return [whole.rows(slice(int(c[0]), int(c[-1]) + 1)) for c in cuts if c.size]

    trial = _Trial(lib, blocks)
    terms = _climbed(trial, names, coulomb_speed, extra)
    first = {name: float(trial.score(each)[0].mean()) for name, each in terms.items()}
    trial.weigh_by(terms[min(first, key=lambda name: first[name])])
    return _chosen([(name, each, *trial.score(each)) for name, each in terms.items()])


def _climbed(
    trial: "_Trial", names: Sequence[str], coulomb_speed: float | None, extra: tuple[str, ...]
) -> dict[str, Friction]:
    """Every rung with its best widths; ε starts from that of the Coulomb rung."""
    free = coulomb_speed is None
    start = Friction((*_BASE, *extra), *(() if free else (coulomb_speed,)))
    if free and any("coulomb" in FRICTION_MODELS[name] for name in names):
        start = trial.best_width(start, "coulomb")
    found = {}
    for name in names:
        terms = replace(start, columns=(*FRICTION_MODELS[name], *extra))
        if name in WIDTHS and name != "coulomb":
            terms = trial.best_width(terms, name)
        if free and name in {"asymmetric", "stribeck", "load"}:
            terms = trial.best_width(terms, "coulomb", near=True)
            terms = trial.best_width(terms, name, near=True) if name in WIDTHS else terms
        found[name] = terms
    return found


def _chosen(found: list[tuple[str, Friction, Array, float, int]]) -> FrictionChoice:
    best = min(found, key=lambda item: float(item[2].mean()))[2]
    candidates = []
    for name, terms, scores, aic, parameters in found:
        gap = scores - best
        error = float(gap.std(ddof=1) / np.sqrt(len(gap)))
        score = float(scores.mean())
        candidates.append(
            FrictionCandidate(name, terms, score, float(gap.mean()), error, aic, parameters)
        )
    least = float(best.mean())
    chosen = next(r for r in candidates if r.excess <= max(r.excess_error, LEAST_GAIN * least))
    top = min(candidates, key=lambda r: r.score)
    reason = (
        "which also predicts best"
        if chosen is top
        else f"the simplest that predicts as well as '{top.name}' within one standard error"
    )
    sentence = (
        f"friction model '{chosen.name}' ({chosen.terms}) chosen by cross-validation on "
        f"{BLOCKS} blocks of the training part, {reason}"
    )
    return FrictionChoice(tuple(candidates), chosen, sentence)


class _Trial:
    """Cross-validation of friction terms on the blocks of one recording."""

    def __init__(self, lib: Library, blocks: Callable[..., list[Samples]]) -> None:
        self._lib, self._blocks = lib, blocks
        plain = blocks(Friction(_BASE))
        equations = min(len(block) for block in plain) * lib.n_joints * (BLOCKS - 1)
        unknowns = len(lib.base_columns) + lib.n_joints * (len(_BASE) + 1)
        if len(plain) < BLOCKS or equations < 2 * unknowns:
            raise IdentificationError(
                f"the training part gives {equations} equations for {unknowns} unknowns, too few "
                "to choose a friction model by cross-validation; record for longer, or name the "
                "model with --friction"
            )
        self._weights, self._inflation = _noise(lib, plain)

    def weigh_by(self, terms: Friction) -> None:
        """Take the noise of the joints from the residuals of these terms."""
        self._weights, self._inflation = _noise(self._lib, self._blocks(terms))

    def best_width(self, terms: Friction, candidate: str, near: bool = False) -> Friction:
        """The terms with the width of a rung that scores best: a grid, then between its points.

        `near` looks only around the width that the terms have, a step of the grid on each side.
        """
        key, grid = WIDTHS[candidate]

        def score(log_width: float) -> float:
            return float(self.score(_with(terms, key, log_width))[0].mean())

        logs = np.log(grid)
        scores = [] if near else [score(x) for x in logs]
        best = float(np.log(getattr(terms, key))) if near else logs[int(np.argmin(scores))]
        step = logs[1] - logs[0]
        low, high = max(best - step, logs[0]), min(best + step, logs[-1])
        search = {"bounds": (low, high), "method": "bounded", "options": {"xatol": _WIDTH}}
        x = float(minimize_scalar(score, **search).x)
        return _with(terms, key, x if score(x) < score(best) else best)

    def score(self, terms: Friction) -> tuple[Array, float, int]:
        """Score per block, AIC, and the number of parameters that the data determine."""
        stats = [compress(self._lib, block, self._weights) for block in self._blocks(terms)]
        n = self._lib.n_joints
        scores = []
        for k, held in enumerate(stats):
            x, _ = solved([s for i, s in enumerate(stats) if i != k])
            scores.append(_misfit(held, x) / (held.n_samples * n))
        x, rank = solved(stats)
        count = sum(s.n_samples for s in stats) * n
        misfit = sum(_misfit(s, x) for s in stats)
        aic = count / self._inflation * np.log(misfit / count) + 2 * rank
        return np.array(scores), float(aic), rank


def _noise(lib: Library, blocks: list[Samples]) -> tuple[Array, float]:
    """1/σ_j² per joint from the residuals of a fit, and samples per independent one."""
    weights = np.ones(lib.n_joints)
    for _ in range(_PASSES):
        x, _rank = solved([compress(lib, block, weights) for block in blocks])
        beta, phi = x[: len(lib.base_columns)], x[len(lib.base_columns) :]
        residuals = [_residual(lib, block, beta, phi) for block in blocks]
        variance = np.mean(np.concatenate(residuals) ** 2, axis=0)
        weights = 1.0 / np.maximum(variance, 1e-12 * variance.max() + 1e-30)
    first, *others = (compress(lib, block, weights) for block in blocks)
    return weights, coloured_noise_of(lib, blocks, first.merged(*others), weights).inflation


def _residual(lib: Library, block: Samples, beta: Array, phi: Array) -> Array:
    rigid = block.base_rigid(lib, beta)
    phi = phi.reshape(block.columns.shape[1:])
    if block.coupling is not None:
        return rigid + block.friction(phi) - block.tau
    return rigid + np.einsum("ijk,jk->ij", block.columns, phi) - block.tau


def solved(stats: list[Statistics]) -> tuple[Array, int]:
    """x of least length in normalised columns that fits all the factors, and the rank."""
    factor = np.concatenate([s.factor for s in stats])
    target = np.concatenate([s.target for s in stats])
    lengths = np.linalg.norm(factor, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    x, _, rank, _ = np.linalg.lstsq(factor / lengths, target, rcond=_RANK)
    return x / lengths, int(rank)


def _with(terms: Friction, key: str, log_width: float) -> Friction:
    width: dict[str, Any] = {key: float(np.exp(log_width))}
    return replace(terms, **width)


def _misfit(held: Statistics, x: Array) -> float:
    rest = held.factor @ x - held.target
    return float(rest @ rest + held.rest)
