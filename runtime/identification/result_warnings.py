"""What a reader of a result must know before trusting it: a sentence each, with what to do."""

import numpy as np

from runtime.estimators.methods import METHODS
from runtime.identification import metrics
from runtime.identification.identified import Identification
from runtime.recording.preprocessing import is_filtered

SUSPICIOUSLY_GOOD = 1e-4
"""Overall error in percent below which a real torque sensor is hard to believe."""
WORSE = 1.1
"""Error of the answer over that of the URDF which chance hardly makes."""
UNEXPLAINED = 20.0
"""Overall error in percent above which something is wrong that no method mends: real logs of the
arms we have end below 10 % once units, filter and friction are right."""
STILL = 1e-3
"""rad or m: travel that sensors and vibration make of a joint at rest."""


def warnings_of(
    result: Identification, before: metrics.TorqueError, after: metrics.TorqueError
) -> list[str]:
    """A sentence each, of an answer and the torque errors of the first guess and of it."""
    warnings = list(result.notes)
    if after.overall > max(WORSE * before.overall, SUSPICIOUSLY_GOOD):
        warnings.append(
            f"on the test data this model is worse than the URDF ({before.overall:.3g} % became "
            f"{after.overall:.3g} %): keep the URDF, and record a longer motion to train on"
        )
    if after.overall > UNEXPLAINED:
        warnings.append(_unexplained(result, after))
    if still := _still(result):
        warnings.append(
            f"{', '.join(still)} never moved in training: what only such a motion shows is the "
            "URDF's word; record a motion that moves every joint"
        )
    if result.one_run:
        warnings.append(
            "training, validation and test are parts of one run, which flatters; "
            "record a second trajectory to test on"
        )
    if result.test.rows is not None:
        seen = "the power of all joints together" if result.weights.size == 1 else "momenta"
        warnings.append(
            f"the fit has seen {seen} and no accelerations; errors are those of the torque, which "
            "passed the same filter"
        )
    if not result.is_consistent:
        warnings.append("some links are no bodies that can exist; use map for a model to simulate")
    if objective := METHODS[result.method].objective:
        warnings.append(
            f"{result.method} {objective}; its gap is measured in the weighted "
            "loss of the other methods"
        )
    if after.overall < SUSPICIOUSLY_GOOD:
        warnings.append(
            "the fit is perfect to rounding: the torque is simulated or the output of a model, "
            "not a measurement"
        )
    unexcited = result.lib.base_matrix.shape[0]
    if len(result.train) * result.lib.n_joints < 3 * unexcited:
        warnings.append("there are hardly more rows than unknowns; record for longer")
    return warnings


def _unexplained(result: Identification, after: metrics.TorqueError) -> str:
    """What to try first, in the order of what it costs."""
    filtered = METHODS[result.method].unfiltered or is_filtered(result.train.history)
    advice = ["no low-pass was asked for: --cutoff auto"] * (not filtered)
    advice += ["no friction was: --friction auto"] * (not result.phi.size)
    return (
        f"{after.overall:.3g} % of the test torque is unexplained, too much for a model to use; "
        f"{'; '.join(advice)}{'; ' if advice else ''}"
        "wrong units, order or signs are found by: python -m runtime inspect LOG"
    )


def _still(result: Identification) -> list[str]:
    """Joints that keep their place in all of the training part; of a streamed log nobody knows."""
    if result.streamed is not None:
        return []
    spans = np.ptp(result.train.q, axis=0)
    return [name for name, span in zip(result.lib.joint_names, spans, strict=True) if span < STILL]
