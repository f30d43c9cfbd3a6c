"""Unknown gain of the control law of every joint, for logs whose torque is commanded.

    k τ_law = Y π + F φ   ⇔   τ_law = Y π + F φ + C g,   C = −τ_law,   g = k − 1

k is what stands between the law and the torque at the joint: a wrong kp and kd, a wrong torque
constant or efficiency of the motor. The recipe states the law; g = 0 where it is right.
"""

from collections.abc import Sequence

import numpy as np

from runtime.library import Array
from runtime.recording.settings import FrictionColumn


def _sentences(joints: Sequence[str], g: Array, sigma: Array) -> tuple[str, ...]:
    listed = ", ".join(
        f"{name} {1 + x:.3g}" + (f" ± {s:.2g}" if is_known else "")
        for name, x, s, is_known in zip(joints, g, sigma, np.isfinite(sigma), strict=True)
    )
    return (
        f"gains of the control law, torque over the commanded one: {listed}; with torque, gains "
        "and torque constants unknown only ratios are determined: a common factor of these gains, "
        "all masses, inertias and friction coefficients changes no equation, and the prior of the "
        "links alone fixes it; the standard deviations contain its error",
    )


LAW_GAIN = FrictionColumn(
    "law_gain",
    "−τ of the control law; its gain is 1 + φ",
    lambda motion, _: -motion.signals["commanded_torque"],
    signals=("commanded_torque",),
    is_linear=True,
    is_passive=False,
    is_torque=True,
    needs_prior=True,
    # Where friction is all of the torque, every gain explains it as well.
    prior_sigma=10.0,
    omitted="torques are those at the joints; the law has to command them over its gains, 1 + φ of "
    "law_gain",
    sentences=_sentences,
)
