"""Which cut-off do the data carry? Candidates judged by what they predict of the unfiltered torque.

Each candidate f_c is fitted (base parameters and friction) on the filtered rows of all blocks but
one, and that estimate predicts the torque of the one as it was logged:

    score_b = mean over rows and joints of w_j (τ_j − [Y(q_p, dq_p, ddq_p) β(f_c) + F_p φ(f_c)]_j)²

The motion of the prediction, p, is the same for all: the candidate whose own estimate predicts
best with its own motion. A motion of a wider band repeats more of an unfiltered torque with the
very same parameters; were each judged by its own, the widest would win wherever positions are good,
and what is looked for is the best β. So too low a cut-off is found out, which has not seen the
torque, and too high a one, whose noise in Y has bent β. Blocks are paired, which cancels the noise
of τ. What the best saves by less than half a percent is worth nothing; of those candidates the one
is taken whose rows are whitest, N_eff / N at `ROWS_PER_CUTOFF` f_c, N_eff by `coloured_noise`:
the covariances of its fit promise least too much.
"""

from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression import Statistics, compress
from runtime.estimators.regression.coloured_noise import coloured_noise_of
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.inspection.friction_choice import BLOCKS, LEAST_GAIN, solved
from runtime.library import Array, Library
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.preprocessing import prepare

CANDIDATES = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0, 80.0)
"""Hz; those below 0.4 of the rate are tried."""
BELOW_RATE = 0.4
ROWS_PER_CUTOFF = 10.0
"""Rate of the rows to keep over the cut-off."""
FEWEST = 100
"""Rows of a block that are kept all the same."""
EDGE = 0.05
"""Part of the duration that the trimming of both ends may take."""
_PASSES = 2


@dataclass(frozen=True, slots=True)
class CutoffCandidate:
    """One cut-off and how it did.

    Attributes:
        cutoff_hz: f_c.
        derivative: "measured", or "position" where dq was derived from q.
        score: cross-validated mean square error over the smallest of all candidates, per joint.
        excess: score minus the best.
        excess_error: standard error of that, from the differences of the blocks.
        white: independent rows over rows, by the colour of the residuals.
    """

    cutoff_hz: float
    derivative: str
    score: float
    excess: float
    excess_error: float
    white: float


@dataclass(frozen=True, slots=True)
class CutoffChoice:
    """The candidates with the chosen one.

    Attributes:
        candidates: all that were tried.
        chosen: one of them.
        preparation: with its filter, its derivative and trimmed edges.
        sentence: what was chosen and why, with the table of scores.
    """

    candidates: tuple[CutoffCandidate, ...]
    chosen: CutoffCandidate
    preparation: Preparation
    sentence: str


@one_blas_thread
def choose_cutoff(
    recording: Recording,
    lib: Library,
    preparation: Preparation | None = None,
    splitting: Split | None = None,
    friction: Friction | None = None,
) -> CutoffChoice:
    """Try the cut-offs on the training and validation parts of a recording.

    Measured velocities are kept, unless velocities from q predict better beyond chance. Edges
    that no preparation trims are cut by 1 / f_c.

    Args:
        recording: as read.
        lib: of the robot.
        preparation: everything but the cut-off; default is the recipe's.
        splitting: default is the recipe's, else the first 60 %.
        friction: columns of the fit; default is the recipe's, else viscous, coulomb and offset.

    Raises:
        IdentificationError: too few samples for five blocks, or a rate that leaves no candidate.
    """
    recipe = recording.recipe
    base = preparation or recording.preparation
    parts = splitting or (recipe.split if recipe else None) or Split()
    terms = friction or (recipe.friction if recipe else None) or Friction()
    bench = _Bench(recording.replace(columns=None, column_names=()), lib, base, parts, terms)
    fits = {(f_c, base.derivative): bench.fitted(f_c, base.derivative) for f_c in bench.cutoffs}
    if base.derivative == "measured" and recording.dq is not None:
        f_c, _ = _best({key: fit.own for key, fit in fits.items()})
        fits[f_c, "position"] = bench.fitted(f_c, "position")
    motion = _best({key: fit.own for key, fit in fits.items()})
    errors = bench.errors(*motion, {key: fit.held for key, fit in fits.items()})
    return _chosen(errors, {key: fit.white for key, fit in fits.items()}, base)


_Key = tuple[float, str]
"""Cut-off and derivative."""


def _chosen(errors: dict[_Key, Array], white: dict[_Key, float], base: Preparation) -> CutoffChoice:
    scores = _scored(errors)
    best = _best(errors)
    found = []
    for key, blocks in scores.items():
        gap = blocks - scores[best]
        error = float(gap.std(ddof=1) / np.sqrt(len(gap)))
        found.append(
            CutoffCandidate(*key, float(blocks.mean()), float(gap.mean()), error, white[key])
        )
    alike = [c for c in found if c.excess <= LEAST_GAIN * scores[best].mean()]
    measured = [c for c in alike if c.derivative == base.derivative]
    chosen = max(measured or alike, key=lambda c: c.white)
    other = {c.derivative: " (velocity from q)" * (c.derivative != base.derivative) for c in found}
    told = ", ".join(f"{c.cutoff_hz:g} Hz{other[c.derivative]} {c.score:.3f}" for c in found)
    aside = " Velocities from q predict better than the measured ones, which are set aside."
    sentence = (
        f"cut-off {chosen.cutoff_hz:g} Hz chosen by cross-validation on {BLOCKS} blocks, the "
        f"whitest rows ({100 * chosen.white:.0f} % of them independent) of those whose parameters "
        f"predict the unfiltered torque as well as the best; scores: {told}."
        f"{aside * (chosen.derivative != base.derivative)}"
    )
    ready = replace(
        base,
        filter="butterworth",
        cutoff_hz=chosen.cutoff_hz,
        derivative=chosen.derivative,
        trim_s=base.trim_s or 1.0 / chosen.cutoff_hz,
    )
    return CutoffChoice(tuple(found), chosen, ready, sentence)


def _best(errors: dict[_Key, Array]) -> _Key:
    scores = _scored(errors)
    return min(scores, key=lambda key: float(scores[key].mean()))


def _scored(errors: dict[_Key, Array]) -> dict[_Key, Array]:
    """Score per block, in units of the smallest error of each joint."""
    least = np.min([each.mean(axis=0) for each in errors.values()], axis=0)
    unit = np.maximum(least, 1e-12 * least.max() + 1e-300)
    return {key: np.asarray((each / unit).mean(axis=1)) for key, each in errors.items()}


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """A candidate: per block the estimate without it and its own error there; whiteness."""

    held: tuple[Array, ...]
    own: Array
    white: float


class _Bench:
    """One recording, the same rows and the same raw torque for every candidate."""

    def __init__(
        self, recording: Recording, lib: Library, base: Preparation, parts: Split, terms: Friction
    ) -> None:
        self._recording, self._lib, self._base, self._terms = recording, lib, base, terms
        bare = {"filter": "none", "cutoff_hz": None, "trim_s": None, "rest_speed": None}
        bare |= {"rate_hz": None, "regressor": "acceleration"}
        self._raw = prepare(recording, replace(base, **bare))  # type: ignore[arg-type]
        rate = min(self._raw.rate_hz, base.rate_hz or np.inf)
        self.cutoffs = [f_c for f_c in CANDIDATES if f_c < BELOW_RATE * rate]
        if not self.cutoffs:
            raise IdentificationError(
                f"a rate of {rate:.3g} Hz leaves no cut-off to choose from; give --cutoff in Hz, "
                "or record faster"
            )
        self._trim = max(base.trim_s or 0.0, min(1.0, EDGE * recording.duration))
        middle = self._prepared(self.cutoffs[len(self.cutoffs) // 2], base.derivative)
        share = (middle.t - middle.t[0]) / (middle.duration or 1.0)
        rows = share < parts.validation[1]
        if base.rest_speed is not None and middle.dq is not None:
            rows &= np.any(np.abs(middle.dq) >= base.rest_speed, axis=1)
        self._blocks = np.array_split(np.flatnonzero(rows), BLOCKS)
        unknowns = len(lib.base_columns) + lib.n_joints * len(terms.columns)
        equations = min(len(b) for b in self._blocks) * lib.n_joints * (BLOCKS - 1)
        if equations < 2 * unknowns:
            raise IdentificationError(
                f"the training part gives {equations} equations for {unknowns} unknowns, too few "
                "to choose a cut-off by cross-validation; record for longer, or give --cutoff in Hz"
            )
        tau = self._raw.required("tau")
        self._tau = np.stack([np.interp(middle.t, self._raw.t, row) for row in tau.T], axis=1)

    def fitted(self, cutoff_hz: float, derivative: str) -> _Fit:
        """The estimates of one candidate from its rows, and how they do with its own motion."""
        whole = self._cut(cutoff_hz, derivative)
        needed = self._raw.rate_hz / (ROWS_PER_CUTOFF * cutoff_hz)
        step = max(1, int(min(needed, min(len(b) for b in whole) / FEWEST)))
        blocks = [block.rows(slice(None, None, step)) for block in whole]
        weights = thesis_weights(np.concatenate([b.tau for b in blocks]))
        stats: list[Statistics] = []
        weighted = weights
        for _ in range(_PASSES):
            weighted, stats = weights, [compress(self._lib, block, weights) for block in blocks]
            x, _rank = solved(stats)
            rest = np.concatenate([block.tau - self._predicted(block, x) for block in blocks])
            power = rest.var(axis=0)
            weights = 1.0 / np.maximum(power, 1e-12 * power.max() + 1e-30)
        held = tuple(
            solved([s for i, s in enumerate(stats) if i != k])[0] for k in range(len(blocks))
        )
        coloured = coloured_noise_of(self._lib, blocks, stats[0].merged(*stats[1:]), weighted)
        white = min(1.0, max(1.0, needed / step) / coloured.inflation)
        return _Fit(held, self._missed(whole, held), white)

    def errors(
        self, cutoff_hz: float, derivative: str, held: dict[_Key, tuple[Array, ...]]
    ) -> dict[_Key, Array]:
        """Mean square errors of all estimates per block and joint, with the motion of one."""
        blocks = self._cut(cutoff_hz, derivative)
        return {key: self._missed(blocks, each) for key, each in held.items()}

    def _cut(self, cutoff_hz: float, derivative: str) -> list[Samples]:
        whole = samples_of(self._prepared(cutoff_hz, derivative), self._lib)
        return [whole.rows(rows) for rows in self._blocks]

    def _missed(self, blocks: list[Samples], held: tuple[Array, ...]) -> Array:
        """Mean of (τ − τ̂)² per block and joint, τ as it was logged."""
        pairs = zip(blocks, held, self._blocks, strict=True)
        return np.array(
            [
                np.mean((self._tau[rows] - self._predicted(b, x)) ** 2, axis=0)
                for b, x, rows in pairs
            ]
        )

    def _prepared(self, cutoff_hz: float, derivative: str) -> Recording:
        filtered = replace(
            self._base,
            filter="butterworth",
            cutoff_hz=cutoff_hz,
            derivative=derivative,
            trim_s=self._trim,
            rest_speed=None,
        )
        return prepare(self._recording, filtered, self._terms, lib=self._lib)

    def _predicted(self, block: Samples, x: Array) -> Array:
        n_base = len(self._lib.base_columns)
        rigid = block.base_rigid(self._lib, x[:n_base])
        phi = x[n_base:].reshape(block.columns.shape[1:])
        return np.asarray(rigid + block.friction(phi) if phi.size else rigid)
