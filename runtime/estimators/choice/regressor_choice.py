"""Check of the accelerations: share of noise in them, and distortion by the filter.

    noise share   ν_j = σ_j² · 2h ∫ |H|² |D|^2k df / mean ddq_j²
    distortion    δ = ‖Y(q_f, dq_f, ddq_f) π0 − F τ0‖ / ‖F τ0‖

σ_j² is the white part of q (k = 2) or of dq (k = 1), from its eighth differences; H the low-pass, D
the central difference. Noise in a regressor's column shrinks its coefficient by the factor 1 − ν
(Fuller 1987, Sec. 1.1), here the inertias of joint j. F τ0 is the low-passed torque of the URDF's
momentum, which needs no accelerations: δ is the effect of a cut-off inside the motion's band, or of
too low a rate, on the rows alone.

Choice of the cut-off by cross-validation: each candidate f_c is fitted to the filtered rows of all
blocks but one and predicts the logged, unfiltered torque of the block that is left out:

    score_b = mean over rows and joints of w_j (τ_j − [Y(q_p, dq_p, ddq_p) β(f_c) + F_p φ(f_c)]_j)²

The motion p is the same for all candidates, that of the one which predicts best with its own: with
a motion per candidate the widest band would win wherever positions are precise, but the aim is the
best β. Rows of too low a cut-off lack part of the torque, the noise in Y of too high a one biases
β, and the noise of τ cancels in differences, since the blocks are the same.

Candidates within `LEAST_GAIN` of the best score count as equal. Of these the one with the largest
N_eff / N at `ROWS_PER_CUTOFF` f_c is chosen (N_eff by `coloured_noise`): the covariances of its fit
are the least optimistic.
"""

from dataclasses import dataclass, replace
from math import comb

import numpy as np

from runtime.common.tables import significant
from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError, RuntimeFault
from runtime.estimators.choice import friction_choice
from runtime.estimators.regression.coloured_noise import coloured_noise_of
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.filters import butterworth_sections, scipy_signal
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.preprocessing.pipeline import momentum_torque
from runtime.recording.preprocessing.segments import on_grid, segments
from runtime.recording.recording import complete_arrays

CANDIDATES = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0, 80.0)
"""Cut-offs that are tried where the rate allows it, Hz."""
BELOW_RATE = 0.4  # largest cut-off over the rate
ROWS_PER_CUTOFF = 10.0  # rate of the rows that are kept, over the cut-off
FEWEST_ROWS = 100  # least number of rows of a block
EDGE = 0.05  # largest share of the duration that is trimmed from both ends


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
    blocks = trials.cut(*_best({key: fit.errors for key, fit in fits.items()}))
    errors = {key: trials.errors_of(blocks, fit.left_out) for key, fit in fits.items()}
    return _chosen(errors, {key: fit.white for key, fit in fits.items()}, base)


_Key = tuple[float, str]


def _chosen(errors: dict[_Key, Array], white: dict[_Key, float], base: Preparation) -> CutoffChoice:
    """The choice from the errors per block and joint of every candidate."""
    scores = _scored(errors)
    best = _best(errors)
    candidates = []
    for key, blocks in scores.items():
        excess = friction_choice.excess_of(blocks, scores[best])
        candidates.append(CutoffCandidate(*key, float(blocks.mean()), *excess, white[key]))
    alike = [c for c in candidates if c.excess <= friction_choice.LEAST_GAIN * scores[best].mean()]
    measured = [c for c in alike if c.derivative == base.derivative]
    chosen = max(measured or alike, key=lambda c: c.white)
    aside = "; velocities from q predict better than the measured ones, which are not used"
    sentence = (
        f"cut-off {chosen.cutoff_hz:g} Hz chosen by cross-validation on {friction_choice.BLOCKS} "
        "blocks: of the candidates that predict the unfiltered torque as well as the best one, it "
        f"has the largest share of independent rows ({100 * chosen.white:.0f} %)"
        f"{aside * (chosen.derivative != base.derivative)}"
    )
    trimmed = replace(base, trim_s=base.trim_s or 1.0 / chosen.cutoff_hz)
    ready = _low_passed(trimmed, chosen.cutoff_hz, chosen.derivative)
    return CutoffChoice(tuple(candidates), chosen, ready, sentence)


def _low_passed(steps: Preparation, cutoff_hz: float, derivative: str) -> Preparation:
    return replace(steps, filter="butterworth", cutoff_hz=cutoff_hz, derivative=derivative)


def _best(errors: dict[_Key, Array]) -> _Key:
    scores = _scored(errors)
    return min(scores, key=lambda key: float(scores[key].mean()))


def _scored(errors: dict[_Key, Array]) -> dict[_Key, Array]:
    """Score per block: mean over the joints of the error over the least error of that joint."""
    least = np.min([each.mean(axis=0) for each in errors.values()], axis=0)
    unit = np.maximum(least, 1e-12 * least.max() + 1e-300)
    return {key: np.asarray((each / unit).mean(axis=1)) for key, each in errors.items()}


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
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
        self._blocks = np.array_split(np.flatnonzero(rows), friction_choice.BLOCKS)
        unknowns = len(lib.base_columns) + lib.n_joints * len(terms.columns)
        equations = min(len(b) for b in self._blocks) * lib.n_joints * (friction_choice.BLOCKS - 1)
        if equations < 2 * unknowns:
            raise IdentificationError(
                f"the training part gives {equations} equations for {unknowns} unknowns, too few "
                "to choose a cut-off by cross-validation; record for longer, or give --cutoff in Hz"
            )
        tau = self._raw.required("tau")
        self._tau = np.stack([np.interp(middle.t, self._raw.t, row) for row in tau.T], axis=1)

    def fitted(self, cutoff_hz: float, derivative: str) -> _Fit:
        """Fit one candidate to its rows, and predict every block with its motion."""
        whole = self.cut(cutoff_hz, derivative)
        needed = self._raw.rate_hz / (ROWS_PER_CUTOFF * cutoff_hz)
        step = max(1, int(min(needed, min(len(b) for b in whole) / FEWEST_ROWS)))
        blocks = [block.rows(slice(None, None, step)) for block in whole]
        weights = thesis_weights(np.concatenate([b.tau for b in blocks]))
        x, _ = friction_choice.solved([compress(self._lib, block, weights) for block in blocks])
        rests = [block.tau - block.base_torque(self._lib, x) for block in blocks]
        weights = friction_choice.inverse_of(np.concatenate(rests).var(axis=0))
        stats = [compress(self._lib, block, weights) for block in blocks]
        without = [[s for s in stats if s is not block] for block in stats]
        left_out = tuple(friction_choice.solved(rest)[0] for rest in without)
        noise = coloured_noise_of(self._lib, blocks, stats[0].merged(*stats[1:]), weights)
        white = min(1.0, max(1.0, needed / step) / noise.inflation)
        return _Fit(left_out, self.errors_of(whole, left_out), white)

    def cut(self, cutoff_hz: float, derivative: str) -> list[Samples]:
        """Blocks of the motion of one candidate."""
        whole = samples_of(self._prepared(cutoff_hz, derivative), self._lib)
        return [whole.rows(rows) for rows in self._blocks]

    def errors_of(self, blocks: list[Samples], estimates: tuple[Array, ...]) -> Array:
        """Mean of (τ − τ̂)² per block and joint, with the logged τ."""
        pairs = zip(blocks, estimates, self._blocks, strict=True)
        rests = [self._tau[rows] - b.base_torque(self._lib, x) for b, x, rows in pairs]
        return np.array([np.mean(rest**2, axis=0) for rest in rests])

    def _prepared(self, cutoff_hz: float, derivative: str) -> Recording:
        whole = replace(self._base, trim_s=self._trim, rest_speed=None)
        steps = _low_passed(whole, cutoff_hz, derivative)
        return prepare(self._recording, steps, self._terms, lib=self._lib)


NOISY, BENT = 0.01, 0.005
"""Bounds of ν and δ: ν that biases an inertia as much as its uncertainty in a good log, and δ that
is visible beside the least torque errors of real logs, 1 to 1.5 %."""
UNBENT = 0.001
"""δ from which on a low-pass is a change of the robot: where the cut-off is 1 Hz, healthy logs of
δ = 0.4 % and more are."""
LONGEST = 30000  # rows that are used: half a minute at 1 kHz
STILL = 0.02  # RMS speed [rad/s] below which a motion does not determine the inertia of a joint
_ORDER = 8


@dataclass(frozen=True, slots=True, eq=False)
class Differentiation:
    """Quality of the accelerations of a preparation."""

    noise: Array  # ν, (n,); 0 for a joint that stands still
    distortion: float  # δ
    cutoff_hz: float  # cut-off of the filter [Hz], else the peak gain of central differences
    derivatives: int  # k, the number of derivatives taken

    @property
    def fails(self) -> bool:
        """Whether ν of a joint or δ exceeds its bound."""
        return self.is_noisy or self.distortion > BENT

    @property
    def is_noisy(self) -> bool:
        """Whether ν of a joint exceeds its bound."""
        return bool(self.noise.max() > NOISY)

    @property
    def harmless_hz(self) -> float:
        """Cut-off that leaves noise within the bound [Hz]; its power grows with f_c^(2k + 1)."""
        worst = min(float(self.noise.max()), 1.0 - NOISY)
        excess = max(1.0, worst / (1.0 - worst) * (1.0 - NOISY) / NOISY)
        return self.cutoff_hz * float(excess ** (-1.0 / (2 * self.derivatives + 1)))

    def noise_in(self, lib: Library) -> str:
        """Words on the joint with the largest ν."""
        worst = int(np.argmax(self.noise))
        share = significant(100 * self.noise[worst])
        return f"{share} % of the power of ddq of {lib.joint_names[worst]} is noise"


def differentiation_of(
    recording: Recording, lib: Library, preparation: Preparation
) -> Differentiation | None:
    """ν and δ of the beginning of a recording."""
    from_q = preparation.derivative == "position" or recording.dq is None
    measured = recording.ddq is not None and preparation.derivative != "position"
    known = preparation.filter in {"butterworth", "none"}
    if not known or measured or preparation.regressor != "acceleration":
        return None
    head = recording.take(slice(0, LONGEST), "Took the head.").replace(
        columns=None, column_names=(), motors=None
    )
    full = replace(preparation, rate_hz=None, rest_speed=None)
    later = replace(full, clock_tick=None, max_gap_s=None, torque_delay_s=None)
    try:
        head = on_grid(head, full)
        done = prepare(head, later)
        data = complete_arrays(done, "dq", "ddq", "tau")
        smooth = momentum_torque(head, later, lib, lib.base_matrix @ lib.pi0)
        bare = prepare(head, replace(later, filter="none", cutoff_hz=None, trim_s=None))
        torque, speeds = smooth.required("tau"), bare.required("dq")
    except RuntimeFault:  # the preparation of the whole log states the reason
        return None
    dq, ddq = data["dq"], data["ddq"]
    rigid = lib.inverse_dynamics(data["q"], dq, ddq, lib.pi0)
    common, here, there = np.intersect1d(done.t, smooth.t, return_indices=True)
    if len(common) <= _ORDER:
        return None
    whole = torque[there]
    bent = float(np.linalg.norm(rigid[here] - whole) / max(float(np.linalg.norm(whole)), 1e-300))
    if preparation.cutoff_hz is None:
        bent = 0.0  # without a filter the two differ only by noise
    derivatives = 2 if from_q else 1
    gain = _noise_gain(preparation, 1.0 / bare.rate_hz, derivatives)
    noise = _white_variance(bare.t, bare.q if from_q else speeds) * gain
    power, speed = (np.mean(a**2, axis=0) for a in (ddq, dq))
    share = np.where(speed > STILL**2, np.minimum(noise / np.maximum(power, 1e-300), 1.0), 0.0)
    return Differentiation(share, bent, preparation.cutoff_hz or bare.rate_hz / 4, derivatives)


def passing(recording: Recording, lib: Library, preparation: Preparation) -> Preparation:
    """The preparation with the lowest cut-off from its own on that hardly bends the torque.

    A model of slow motions may have a cut-off inside the band of a faster one; its own is kept
    where no other one that is tried leaves the torque as it is without noise in ddq.
    """
    if preparation.filter != "butterworth" or preparation.cutoff_hz is None:
        return preparation
    first, limit = preparation.cutoff_hz, BELOW_RATE * recording.rate_hz
    for cutoff in (first, *(f_c for f_c in CANDIDATES if first < f_c < limit)):
        tried = replace(preparation, cutoff_hz=cutoff)
        quality = differentiation_of(recording, lib, tried)
        if quality is None or (quality.is_noisy and cutoff > first):
            break
        if quality.distortion <= UNBENT:
            return tried
    return preparation


def noisy_accelerations(
    recording: Recording, lib: Library, preparation: Preparation | None
) -> tuple[str, ...]:
    """Sentence where noise of the accelerations biases a fit that has no other regressor."""
    quality = differentiation_of(recording, lib, preparation or recording.preparation)
    if quality is None or not quality.is_noisy:
        return ()
    return (
        f"{quality.noise_in(lib)}, by which the values are biased beyond their intervals; give "
        f"--settings cutoff={float(f'{quality.harmless_hz:.2g}'):g} or less",
    )


def choose_regressor(
    recording: Recording,
    lib: Library,
    preparation: Preparation | None,
    replaces: bool = False,
    quality: Differentiation | None = None,
) -> tuple[Preparation | None, tuple[str, ...]]:
    """Choose between the regressors of accelerations and of momentum; `quality` if it is known."""
    usual = preparation or recording.preparation
    quality = quality or differentiation_of(recording, lib, usual)
    if quality is None or not quality.fails:
        return preparation, ()
    reasons = []
    if quality.is_noisy:
        reasons.append(
            f"{quality.noise_in(lib)}, which reduces its identified inertia by about the same share"
        )
    if quality.distortion > BENT:
        reasons.append(
            "the low-pass of q and dq changes the torque by "
            f"{significant(100 * quality.distortion)} %, because the motion is too fast for the "
            "cut-off or the rate"
        )
    cutoff = float(f"{quality.harmless_hz:.2g}")
    remedy = f"--settings regressor=momentum --cutoff {cutoff:g}"
    where = "without a low-pass" if usual.cutoff_hz is None else f"at {usual.cutoff_hz:g} Hz"
    reason = f"differentiation fails {where}: {' and '.join(reasons)}"
    if not replaces:
        return preparation, (f"{reason}; use {remedy}, which needs no accelerations",)
    taken = replace(usual, regressor="momentum", filter="butterworth", cutoff_hz=cutoff)
    return taken, (f"{reason}; {remedy} was taken",)


def _white_variance(t: Array, values: Array) -> Array:
    """Variance of white noise, (n,): mean square of the eighth differences over Σ binomial²."""
    whole = np.concatenate([np.diff(values[part], _ORDER, axis=0) for part in segments(t)])
    power = np.sum(whole**2, axis=0) / max(len(whole), 1)
    return np.asarray(power / comb(2 * _ORDER, _ORDER))


def _noise_gain(preparation: Preparation, step: float, derivatives: int) -> float:
    """Variance of unit white noise after the filter and central differences."""
    if preparation.cutoff_hz is None:
        return float(comb(2 * derivatives, derivatives)) / (2 * step) ** (2 * derivatives)
    sections = butterworth_sections(preparation.order, preparation.cutoff_hz * 2.0 * step)
    w, transfer = scipy_signal().sosfreqz(sections, 4096)
    return float(np.mean(np.abs(transfer) ** 4 * (np.sin(w) / step) ** (2 * derivatives)))
