"""Checks of the URDF against a log whose signs, units and clock are right: gains, another robot.

Least squares on base parameters and friction explains the torque of any arm with the same axes.
The URDF is compared with the rigid part of that fit; friction is free in both.

    mismatch = (‖r_URDF‖² − ‖r_free‖²)^½ / (‖r_0‖² − ‖r_free‖²)^½

with the residuals r of friction alone (r_0), with the URDF and with free bodies.
"""

import numpy as np

from runtime.estimators.regression.gain_test import gain_test
from runtime.inspection.checks.torque_rows import TorqueRows, least_squares
from runtime.inspection.checks.torque_signs import slopes_to_model
from runtime.inspection.finding import WARNING, Finding
from runtime.library import Array

OTHER = 0.35
"""Mismatch from which on the log is of another robot: 0.03 to 0.13 for the URDFs of real logs, 0.26
for a tool of 1.5 kg that one of them lacks."""
OFF = 1.4
"""Factor between gains that is reported; the bodies of a URDF err by less."""


def joint_gain(torque_rows: TorqueRows, matrix: Array) -> list[Finding]:
    """Torque of one joint whose scale contradicts that of the others.

    Measured: test of the gains against each other, which needs no URDF, and the slope of τ on the
    torque of the URDF.
    """
    lib, s = torque_rows.lib, torque_rows.samples
    _, rest = least_squares(matrix, s.tau.ravel())
    power = rest.reshape(-1, lib.n_joints).var(axis=0)
    test = gain_test(lib, s, 1.0 / np.maximum(power, 1e-12 * power.max() + 1e-300))
    if test is None or not test.is_contradicted:
        return []
    slopes, is_used = slopes_to_model(torque_rows)
    others = is_used & (np.arange(lib.n_joints) != test.joint)
    if not is_used[test.joint] or not others.any():
        return []
    gain = float(slopes[test.joint] / np.median(slopes[others]))
    if gain <= 0 or (not (gain > OFF and test.gain > 1) and not (gain < 1 / OFF and test.gain < 1)):
        return []
    name = lib.joint_names[test.joint]
    return [
        Finding(
            "torque_gain",
            WARNING,
            f"the torque of {name} is about {gain:.2g} times too large beside that of the other "
            "joints: no bodies explain them together, and the slope on the torque of the URDF "
            f"differs by as much; check its torque constant and gear ratio, and set gain of {name} "
            f"to {1 / gain:.2g} times the present one under [torque]",
            {"joint": test.joint, "gain": gain, "statistic": test.statistic},
            trap=11,
        )
    ]


def other_robot(torque_rows: TorqueRows, matrix: Array) -> list[Finding]:
    """Bodies of the URDF that are far from those of the log."""
    s, lib = torque_rows.samples, torque_rows.lib
    tau, friction = s.tau.ravel(), torque_rows.friction_rows()
    urdf = lib.inverse_dynamics(s.q, s.dq, s.ddq, lib.pi0).ravel()
    free, by_urdf, none = (
        float(np.sum(least_squares(columns, target)[1] ** 2))
        for columns, target in ((matrix, tau), (friction, tau - urdf), (friction, tau))
    )
    mismatch = float(np.sqrt(max(by_urdf - free, 0.0) / max(none - free, 1e-300)))
    if mismatch < OTHER:
        return []
    return [
        Finding(
            "other_robot",
            WARNING,
            f"the bodies of the URDF miss {100 * mismatch:.0f} % of the rigid torque of this log, "
            "which other bodies on the same axes explain: the log is of another robot or variant, "
            "the arm carries something, or the masses of the URDF are placeholders; build the "
            "robot of the log",
            {"mismatch": mismatch},
        )
    ]
