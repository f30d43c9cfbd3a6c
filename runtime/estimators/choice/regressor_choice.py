"""Check of the accelerations: share of noise in them, and distortion by the filter.

    noise share   ν_j = σ_j² · 2h ∫ |H|² |D|^2k df / mean ddq_j²
    distortion    δ = ‖Y(q_f, dq_f, ddq_f) π0 − F τ0‖ / ‖F τ0‖

σ_j² is the white part of q (k = 2) or of dq (k = 1), from its eighth differences; H the low-pass, D
the central difference. Noise in a regressor's column shrinks its coefficient by the factor 1 − ν
(Fuller 1987, Sec. 1.1), here the inertias of joint j. F τ0 is the low-passed torque of the URDF's
momentum, which needs no accelerations. δ is therefore the effect of a cut-off inside the motion's
band, or of too low a rate, on the rows alone; the noise of q and dq is in both.
"""

from dataclasses import dataclass, replace
from math import comb

import numpy as np

from runtime.common.tables import significant
from runtime.errors import RuntimeFault
from runtime.library import Array, Library
from runtime.recording import Preparation, Recording
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.filters import butterworth_sections, scipy_signal
from runtime.recording.preprocessing.pipeline import momentum_torque, on_grid
from runtime.recording.preprocessing.segments import segments
from runtime.recording.recording import complete_arrays

NOISY, BENT = 0.01, 0.005
"""Bounds of ν and δ: ν that biases an inertia as much as its uncertainty in a good log, and δ that
is visible beside the least torque errors of real logs, 1 to 1.5 %."""
LONGEST = 30000
"""Rows that are used: half a minute at 1 kHz."""
STILL = 0.02
"""RMS speed [rad/s] below which a motion does not determine the inertia of a joint."""
_ORDER = 8


@dataclass(frozen=True, slots=True, eq=False)
class Differentiation:
    """Quality of the accelerations of a preparation."""

    noise: Array  # ν, (n,); 0 for a joint that stands still
    distortion: float  # δ
    # cut-off of the filter [Hz]; without one, the frequency at which central differences amplify
    # most
    cutoff_hz: float
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
    """Choose between the regressors of accelerations and of momentum.

    quality: that of the preparation, where it is known.
    """
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
    parts = [np.diff(values[part], _ORDER, axis=0) for part in segments(t)]
    whole = np.concatenate(parts)
    power = np.sum(whole**2, axis=0) / max(len(whole), 1)
    return np.asarray(power / comb(2 * _ORDER, _ORDER))


def _noise_gain(preparation: Preparation, step: float, derivatives: int) -> float:
    """Variance of unit white noise after the filter and central differences."""
    if preparation.cutoff_hz is None:
        return float(comb(2 * derivatives, derivatives)) / (2 * step) ** (2 * derivatives)
    sections = butterworth_sections(preparation.order, preparation.cutoff_hz * 2.0 * step)
    w, transfer = scipy_signal().sosfreqz(sections, 4096)
    return float(np.mean(np.abs(transfer) ** 4 * (np.sin(w) / step) ** (2 * derivatives)))
