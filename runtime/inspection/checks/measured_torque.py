"""Check for a torque that no sensor has measured: the output of a model (trap 4).

Three signs: a fit without constraints that is exact, noise below that of any sensor, and joints
without friction. Every real joint has friction; torque sensors behind the gears see a part of it.
"""

import numpy as np

from runtime.inspection.checks.torque_rows import TorqueRows, least_squares
from runtime.inspection.finding import WARNING, Finding
from runtime.library import Array

PERFECT = 5e-4
"""Residual over torque below which the torque cannot come from a sensor."""
SILENT, GOOD = 1e-5, 5e-3
"""Noise of the raw torque over its RMS, and residual over torque: below both, the torque cannot
come from a sensor."""
FRICTIONLESS, FITTED = 1.3, 0.03
"""Residual without friction columns over that with them, median over the joints, and residual over
torque: below both, the joints have no friction. Arms with torque sensors behind the gears reach
2.4 to 4, motor torques 4 to 20."""
_DIFFERENCES = 4


def not_measured(torque_rows: TorqueRows, matrix: Array, raw_tau: Array) -> list[Finding]:
    """A torque that fits a model better than a measurement can.

    raw_tau (N, n) [N·m, N].
    """
    tau = torque_rows.samples.tau
    _, rest = least_squares(matrix, tau.ravel())
    size = np.sqrt(np.mean(tau**2, axis=0))
    misfit = float(np.linalg.norm(rest) / np.linalg.norm(tau))
    noise = noise_floor(raw_tau) / np.maximum(size, 1e-300)
    floor = float(np.median(noise))
    friction = _share_of_friction(torque_rows, matrix, rest)
    frictionless = friction < FRICTIONLESS and misfit < FITTED
    if misfit > PERFECT and not (floor < SILENT and misfit < GOOD) and not frictionless:
        return []
    why = (
        f"the model fits it to {100 * misfit:.2g} %, and friction columns reduce the residual by a "
        f"factor of {friction:.2g} only, whereas real joints have friction"
        if frictionless
        else f"the model fits it to {100 * misfit:.2g} %, and its noise is {100 * floor:.2g} % of "
        "its RMS"
    )
    return [
        Finding(
            "not_measured",
            WARNING,
            f"the torque is not a measurement: {why}; it is the output of a model (commanded, "
            "feed-forward or simulated torque), from which only that model can be identified; log "
            "the measured torque or current",
            {
                "misfit": misfit,
                "noise_over_rms": [float(x) for x in noise],
                "without_friction_over_with": friction,
            },
            trap=4,
        )
    ]


def noise_floor(values: Array) -> Array:
    """σ of white noise per column from fourth differences: ‖Δ⁴x‖ / √(70 N)."""
    differences = np.diff(values, n=_DIFFERENCES, axis=0)
    return np.asarray(np.sqrt(np.mean(differences**2, axis=0) / 70.0))


def _share_of_friction(torque_rows: TorqueRows, matrix: Array, rest: Array) -> float:
    """Residual without viscous and Coulomb columns over that with them, median over the joints."""
    n = torque_rows.lib.n_joints
    n_base = len(torque_rows.lib.base_columns)
    offsets = np.tile(np.eye(n), (len(torque_rows.samples), 1))
    tau = torque_rows.samples.tau.ravel()
    _, without = least_squares(np.hstack([matrix[:, :n_base], offsets]), tau)
    powers = [np.sum(each.reshape(-1, n) ** 2, axis=0) for each in (without, rest)]
    return float(np.median(np.sqrt(powers[0] / np.maximum(powers[1], 1e-300))))
