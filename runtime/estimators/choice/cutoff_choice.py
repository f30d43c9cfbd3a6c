"""Choice of the cut-off by cross-validation: candidates predict the unfiltered torque.

Each candidate f_c is fitted (base parameters and friction) to the filtered rows of all blocks but
one. The estimate predicts the logged torque of the block that is left out:

    score_b = mean over rows and joints of w_j (τ_j − [Y(q_p, dq_p, ddq_p) β(f_c) + F_p φ(f_c)]_j)²

The motion p of the prediction is the same for all candidates: that of the candidate which predicts
best with its motion. A motion of wider band reproduces more of an unfiltered torque with the same
parameters. With a motion per candidate the widest band would win wherever positions are precise,
but the aim is the best β. This score rejects too low a cut-off, whose rows lack part of the torque,
and too high a one, whose noise in Y biases β. The blocks are the same for all candidates, so that
the noise of τ cancels in differences.

Candidates within `LEAST_GAIN` of the best score count as equal. Of these the one with the largest
N_eff / N at `ROWS_PER_CUTOFF` f_c is chosen (N_eff by `coloured_noise`): the covariances of its fit
are the least optimistic.

This module and `cross_validation` are all of `--cutoff auto`.
"""

from dataclasses import dataclass, replace

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.choice.cross_validation import BLOCKS, LEAST_GAIN, predicted, solved
from runtime.estimators.regression.coloured_noise import coloured_noise_of
from runtime.estimators.regression.compression import compress
from runtime.estimators.regression.factor import Statistics
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import before_test

CANDIDATES = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0, 80.0)
"""Cut-offs that are tried where the rate allows it, Hz."""
BELOW_RATE = 0.4
"""Largest cut-off over the rate."""
ROWS_PER_CUTOFF = 10.0
"""Rate of the rows that are kept, over the cut-off."""
FEWEST_ROWS = 100
"""Least number of rows of a block."""
EDGE = 0.05
"""Largest share of the duration that is trimmed from both ends."""
_PASSES = 2
"""Passes in which the weights of the joints follow their residuals."""


@dataclass(frozen=True, slots=True)
class CutoffCandidate:
    """One cut-off with its score."""

    cutoff_hz: float  # f_c
    derivative: str  # "measured", or "position" where dq was derived from q
    score: float  # cross-validated mean square error over the smallest of all candidates, per joint
    excess: float  # score minus the best score
    excess_error: float  # standard error of `excess`, from the differences of the blocks
    white: float  # N_eff / N of the residuals


@dataclass(frozen=True, slots=True)
class CutoffChoice:
    """The candidates with the chosen one."""

    candidates: tuple[CutoffCandidate, ...]  # all that were tried
    chosen: CutoffCandidate  # the candidate that is taken
    preparation: Preparation  # the recipe's with this filter, its derivative and trimmed edges
    sentence: str  # the choice and its reason, with all scores


@one_blas_thread
def choose_cutoff(
    recording: Recording,
    lib: Library,
    preparation: Preparation | None = None,
    split: Split | None = None,
    friction: Friction | None = None,
) -> CutoffChoice:
    """Choose a cut-off on the training and validation parts of a recording.

    The test part is cut off before any filter, so that no sample of it has an effect.

    Measured velocities are kept unless velocities from q predict clearly better. Where the
    preparation trims no edges, 1 / f_c is trimmed from both.
    """
    recipe = recording.recipe
    base = preparation or recording.preparation
    terms = friction or (recipe.friction if recipe else None) or Friction()
    seen = before_test(recording, split).replace(columns=None, column_names=())
    trials = _Trials(seen, lib, base, terms)
    fits = {(f_c, base.derivative): trials.fitted(f_c, base.derivative) for f_c in trials.cutoffs}
    if base.derivative == "measured" and recording.dq is not None:
        f_c, _ = _best({key: fit.errors for key, fit in fits.items()})
        fits[f_c, "position"] = trials.fitted(f_c, "position")
    motion = _best({key: fit.errors for key, fit in fits.items()})
    errors = trials.errors(*motion, {key: fit.left_out for key, fit in fits.items()})
    return _chosen(errors, {key: fit.white for key, fit in fits.items()}, base)


_Key = tuple[float, str]
"""Cut-off and derivative."""


def _chosen(errors: dict[_Key, Array], white: dict[_Key, float], base: Preparation) -> CutoffChoice:
    """The choice from the errors per block and joint of every candidate."""
    scores = _scored(errors)
    best = _best(errors)
    candidates = []
    for key, blocks in scores.items():
        gap = blocks - scores[best]
        error = float(gap.std(ddof=1) / np.sqrt(len(gap)))
        candidates.append(
            CutoffCandidate(*key, float(blocks.mean()), float(gap.mean()), error, white[key])
        )
    alike = [c for c in candidates if c.excess <= LEAST_GAIN * scores[best].mean()]
    measured = [c for c in alike if c.derivative == base.derivative]
    chosen = max(measured or alike, key=lambda c: c.white)
    aside = "; velocities from q predict better than the measured ones, which are not used"
    sentence = (
        f"cut-off {chosen.cutoff_hz:g} Hz chosen by cross-validation on {BLOCKS} blocks: of the "
        "candidates that predict the unfiltered torque as well as the best one, it has the largest "
        f"share of independent rows ({100 * chosen.white:.0f} %)"
        f"{aside * (chosen.derivative != base.derivative)}"
    )
    ready = replace(
        base,
        filter="butterworth",
        cutoff_hz=chosen.cutoff_hz,
        derivative=chosen.derivative,
        trim_s=base.trim_s or 1.0 / chosen.cutoff_hz,
    )
    return CutoffChoice(tuple(candidates), chosen, ready, sentence)


def _best(errors: dict[_Key, Array]) -> _Key:
    """The candidate with the smallest mean score."""
    scores = _scored(errors)
    return min(scores, key=lambda key: float(scores[key].mean()))


def _scored(errors: dict[_Key, Array]) -> dict[_Key, Array]:
    """Score per block: mean over the joints of the error over the least error of that joint."""
    least = np.min([each.mean(axis=0) for each in errors.values()], axis=0)
    unit = np.maximum(least, 1e-12 * least.max() + 1e-300)
    return {key: np.asarray((each / unit).mean(axis=1)) for key, each in errors.items()}


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """A fitted candidate."""

    left_out: tuple[Array, ...]  # per block, the estimate from all other blocks
    errors: Array  # mean square error per block and joint, with the motion of this candidate
    white: float  # N_eff / N


class _Trials:
    """Fits of the candidates to one recording, on the same rows and the same logged torque."""

    def __init__(
        self, recording: Recording, lib: Library, base: Preparation, terms: Friction
    ) -> None:
        self._recording, self._lib, self._base, self._terms = recording, lib, base, terms
        bare = {"filter": "none", "cutoff_hz": None, "trim_s": None, "rest_speed": None}
        bare |= {"rate_hz": None, "regressor": "acceleration"}
        self._raw = prepare(recording, replace(base, **bare))  # type: ignore[arg-type]
        rate = min(self._raw.rate_hz, base.rate_hz or np.inf)
        self.cutoffs = [f_c for f_c in CANDIDATES if f_c < BELOW_RATE * rate]
        if not self.cutoffs:
            raise IdentificationError(
                f"expected a rate above {CANDIDATES[0] / BELOW_RATE:g} Hz to choose a cut-off, got "
                f"{rate:.3g} Hz; give --cutoff in Hz, or record faster"
            )
        self._trim = max(base.trim_s or 0.0, min(1.0, EDGE * recording.duration))
        middle = self._prepared(self.cutoffs[len(self.cutoffs) // 2], base.derivative)
        rows = np.ones(len(middle), dtype=bool)
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
        """Fit one candidate to its rows, and predict every block with its motion."""
        whole = self._cut(cutoff_hz, derivative)
        needed = self._raw.rate_hz / (ROWS_PER_CUTOFF * cutoff_hz)
        step = max(1, int(min(needed, min(len(b) for b in whole) / FEWEST_ROWS)))
        blocks = [block.rows(slice(None, None, step)) for block in whole]
        weights = thesis_weights(np.concatenate([b.tau for b in blocks]))
        stats: list[Statistics] = []
        weighted = weights
        for _ in range(_PASSES):
            weighted, stats = weights, [compress(self._lib, block, weights) for block in blocks]
            x, _rank = solved(stats)
            rest = np.concatenate([block.tau - predicted(self._lib, block, x) for block in blocks])
            power = rest.var(axis=0)
            weights = 1.0 / np.maximum(power, 1e-12 * power.max() + 1e-30)
        left_out = tuple(
            solved([s for i, s in enumerate(stats) if i != k])[0] for k in range(len(blocks))
        )
        noise = coloured_noise_of(self._lib, blocks, stats[0].merged(*stats[1:]), weighted)
        white = min(1.0, max(1.0, needed / step) / noise.inflation)
        return _Fit(left_out, self._errors_of(whole, left_out), white)

    def errors(
        self, cutoff_hz: float, derivative: str, estimates: dict[_Key, tuple[Array, ...]]
    ) -> dict[_Key, Array]:
        """Mean square errors of all estimates per block and joint, with the motion of one
        candidate.
        """
        blocks = self._cut(cutoff_hz, derivative)
        return {key: self._errors_of(blocks, each) for key, each in estimates.items()}

    def _cut(self, cutoff_hz: float, derivative: str) -> list[Samples]:
        whole = samples_of(self._prepared(cutoff_hz, derivative), self._lib)
        return [whole.rows(rows) for rows in self._blocks]

    def _errors_of(self, blocks: list[Samples], estimates: tuple[Array, ...]) -> Array:
        """Mean of (τ − τ̂)² per block and joint, with the logged τ."""
        pairs = zip(blocks, estimates, self._blocks, strict=True)
        return np.array(
            [
                np.mean((self._tau[rows] - predicted(self._lib, b, x)) ** 2, axis=0)
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
