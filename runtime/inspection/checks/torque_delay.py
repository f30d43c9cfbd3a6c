"""Check of the time stamps of a measured torque: its delay as `identify` estimates it."""

from typing import Any

from runtime.estimators.regression.recorded_delay import recorded_delay, stated_delay
from runtime.estimators.regression.samples import NORMAL_95
from runtime.inspection.finding import INFO, WARNING, Finding
from runtime.library import Library
from runtime.recording import Friction, Recipe, Recording

LONGEST_S, SHARE = 1.0, 0.1
"""Largest delay that is searched [s], and its largest share of the duration."""
SURE = 4.0
"""Standard deviations from which on a delay is significant."""
LATE_GAIN = 0.03
"""Share of the squared residual, geometric mean of the joints, that a delay must explain: 0.05 of
30 ms in motor currents; smaller ones change the result less than errors of the friction model."""
LEAST_STEPS = 0.3
"""Delay in steps of the log from which on it is to be corrected."""


def delay(
    recording: Recording, lib: Library, plan: Recipe, terms: Friction, *, has_gains: bool = True
) -> list[Finding]:
    """Delay of τ behind q: a warning where it is to be corrected, and the estimate in any case."""
    reach, step = min(LONGEST_S, SHARE * recording.duration), 1.0 / recording.rate_hz
    seen = recorded_delay(recording, lib, plan.preparation, terms, reach, has_gains=has_gains)
    profile, late = seen.profile, seen.profile.best
    low, high = seen.interval_s
    sigma, gain = profile.sigma, profile.gain
    evidence: dict[str, Any] = {
        "delay_s": None,
        "interval_s": [low, high],
        "profile": {
            "delay_s": [float(x) for x in profile.delays],
            "loss": [float(x) for x in profile.loss],
        },
    }
    if profile.is_flat:
        sentence = (
            "the delay of the measured torque is not determined: the loss is flat or least at an "
            f"end of the range (interval {1e3 * low:.0f} to {1e3 * high:.0f} ms); record a faster "
            "motion to estimate it"
        )
        return [Finding("delay", INFO, sentence, evidence)]
    evidence |= {"delay_s": late, "sigma_s": sigma, "gain": gain}
    sentence = (
        f"the measured torque is stamped {1e3 * late:.1f} ms after the motion (95 % interval "
        f"{1e3 * low:.1f} to {1e3 * high:.1f} ms); friction with a memory looks like a delay of "
        "some ms"
    )
    stated = Finding("delay", INFO, sentence, evidence)
    excess = late - stated_delay(plan.preparation)
    if gain < LATE_GAIN or abs(excess) < max(SURE * sigma, LEAST_STEPS * step):
        return [stated]
    which = "later" if late > 0 else "earlier"
    return [
        Finding(
            "time_shift",
            WARNING,
            f"τ is stamped {1e3 * abs(late):.2f} ms {which} than q (± {1e3 * NORMAL_95 * sigma:.2f}"
            f" ms, {abs(late) / step:.2g} samples; up to {reach:.2g} s were searched): shifting it "
            f"back removes {100 * gain:.0f} % of the squared residual; set torque_delay_s = "
            f"{late:.2g} under [preparation]",
            {"delay_s": late, "sigma_s": sigma, "gain": gain, "searched_s": reach},
        ),
        stated,
    ]
