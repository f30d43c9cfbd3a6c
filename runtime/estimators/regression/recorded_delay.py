"""Delay between the torque and the motion of a recording, from the profile of the loss.

    τ(t + δ) = Y π0 + F φ + e      links of the URDF, or free base parameters Y_b β instead of Y π0

A commanded torque is fitted with the links of the URDF: friction and rotor inertia dominate it, and
free links would imitate a delay (kp d dq like viscous friction, kd d ddq like inertia).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression.delay_profile import DelayProfile, delay_profile
from runtime.estimators.regression.samples import samples_of
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.commanded_torque import COMMANDED
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.interpolation import interpolate

ROWS = 900
"""Number of rows of the profile: some hundred of them are independent."""
FEWEST = 100
"""Rows below which no delay is estimated."""
STEP_S = 0.002
"""Step of the delays that are tried [s]; a parabola resolves fractions of it."""
LATEST_S, EARLIEST_S = 0.1, 0.03
"""Range of delays of a commanded torque behind its stamp, and before it [s]."""
CUTOFF_HZ, SHARE = 10.0, 0.2
"""Cut-off where the preparation has no filter [Hz], and the same over the rate of a slow log."""


class RecordedDelay(NamedTuple):
    """Delay of a recording.

    Attributes:
        profile: loss over δ = `Preparation.torque_delay_s`.
        sign: of the delay d in δ = sign · d: −1 for a commanded torque, which acts later than it
            is stamped, 1 for a measured one, which is stamped later than it acts.
    """

    profile: DelayProfile
    sign: float

    @property
    def delay_s(self) -> float:
        """d̂ [s]."""
        return self.sign * self.profile.best

    @property
    def interval_s(self) -> tuple[float, float]:
        """95 % interval of d [s]."""
        first, last = sorted(self.sign * end for end in self.profile.interval)
        return first, last


def sign_of_delay(recording: Recording) -> float:
    """Sign of the delay d in `Preparation.torque_delay_s` = sign · d."""
    return -1.0 if recording.torque_source == COMMANDED else 1.0


def recorded_delay(
    recording: Recording, lib: Library, preparation: Preparation, terms: Friction
) -> RecordedDelay:
    """Profile of the loss over the delay of a recording."""
    whole = prepare(
        recording.replace(columns=None, column_names=(), motors=None),
        filtered(recording, preparation),
        terms,
        lib=lib,
    )
    commanded = recording.torque_source == COMMANDED
    reach = 0.25 / (preparation.cutoff_hz or CUTOFF_HZ)
    reach = STEP_S * np.ceil(max(reach, 4 / recording.rate_hz) / STEP_S)
    first, last = (-LATEST_S, EARLIEST_S) if commanded else (-reach, reach)
    delays = STEP_S * np.arange(round(first / STEP_S), round(last / STEP_S) + 1)
    t = whole.t
    rows = np.flatnonzero((t + delays[0] >= t[0]) & (t + delays[-1] <= t[-1]))
    rows = rows[:: max(1, len(rows) // ROWS)]
    if len(rows) < FEWEST:
        raise IdentificationError(
            f"expected {FEWEST} rows or more to estimate a delay, got {len(rows)}; record for "
            "longer, or give the delay in the recipe (torque_delay_s under [preparation])"
        )
    samples = samples_of(whole, lib).rows(rows)
    columns = samples.friction_rows()
    model = samples.rigid(lib, lib.pi0) if commanded else np.zeros_like(samples.tau)
    if not commanded:
        columns = np.concatenate([samples.base_rows(lib), columns], axis=2)
    tau = whole.required("tau")

    def torque(delay: float) -> Array:
        return interpolate(t[rows] + delay, t, tau) - model

    return RecordedDelay(delay_profile(columns, torque, delays), sign_of_delay(recording))


def filtered(recording: Recording, preparation: Preparation) -> Preparation:
    """The preparation without delay, decimation and removal of rest, with a low-pass."""
    usual = replace(
        preparation, rate_hz=None, rest_speed=None, torque_delay_s=None, regressor="acceleration"
    )
    if usual.filter != "none":
        return usual
    cutoff = min(CUTOFF_HZ, SHARE * recording.rate_hz)
    grid = usual.max_gap_s or float(f"{4.0 / recording.rate_hz:.3g}")
    trim = float(f"{min(1.0 / cutoff, 0.05 * recording.duration):.3g}")
    return replace(usual, filter="butterworth", cutoff_hz=cutoff, max_gap_s=grid, trim_s=trim)
