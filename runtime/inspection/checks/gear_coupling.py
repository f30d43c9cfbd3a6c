"""Check for gears that couple the motors of two joints (trap 6).

A motor that turns with two joints loads both with its friction, R being its row of the gear matrix:
the residual of each joint follows the speed of the other. Motions with common harmonics let the
residual of one joint resemble the speed of another by chance, but not both ways.
"""

import numpy as np

from runtime.inspection.checks.model_fit import inflation_of
from runtime.inspection.checks.torque_rows import TorqueRows, least_squares
from runtime.inspection.finding import WARNING, Finding
from runtime.library import Array
from runtime.recording import Friction

COUPLED, INDEPENDENT = 0.35, 30.0
"""Share of a joint's squared residual that the speed of the other joint must explain, in both
directions, and the effective sample size that this check needs."""
ALONE = 0.5
"""Largest share of any joint beside the two, over that of the pair."""


def coupling(torque_rows: TorqueRows, matrix: Array, terms: Friction) -> list[Finding]:
    """Residual torques of two neighbours that follow the speed of each other."""
    s, lib = torque_rows.samples, torque_rows.lib
    if any(name.startswith("motor_") for name in terms.columns):
        return []
    _, rest = least_squares(matrix, s.tau.ravel())
    errors = rest.reshape(-1, lib.n_joints)
    inflation = inflation_of(matrix, errors, 1.0 / np.maximum(errors.var(axis=0), 1e-300))
    if len(errors) / inflation < INDEPENDENT:
        return []
    shares = _shares(s.dq, s.ddq, errors)
    pairs = []
    for j in range(lib.n_joints - 1):
        k = j + 1
        others = [m for m in range(lib.n_joints) if m not in (j, k)]
        by_chance = float(shares[np.ix_([j, k], others)].max(initial=0.0))
        least = min(shares[j, k], shares[k, j])
        if least > COUPLED and by_chance < ALONE * least:
            pairs.append((j, k, float(least)))
    if not pairs:
        return []
    j, k, share = max(pairs, key=lambda pair: pair[2])
    names = lib.joint_names
    return [
        Finding(
            "gear_coupling",
            WARNING,
            f"the residuals of {names[j]} and {names[k]} follow the speed of each other "
            f"({100 * share:.0f} % of their squares or more), as where a gear couples their "
            "motors; if it does, give the full matrix under [gear] and add motor_viscous, "
            "motor_coulomb, motor_rotor to the columns of [friction]",
            {"pairs": [[a, b, c] for a, b, c in pairs]},
            trap=6,
        )
    ]


def _shares(dq: Array, ddq: Array, errors: Array) -> Array:
    """Share of the squared residual of joint j that the drive of joint k explains, (n, n)."""
    n = errors.shape[1]
    shares = np.zeros((n, n))
    for j in range(n):
        drive = _drive(dq[:, j], ddq[:, j])
        _, left = least_squares(drive, errors[:, j])
        power = float(left @ left)
        for k in range(n):
            if k == j or power == 0:
                continue
            speeds = (dq[:, k], dq[:, k] + dq[:, j], dq[:, k] - dq[:, j])
            for speed in speeds:
                _, free = least_squares(drive, _drive(speed, ddq[:, k]))
                _, after = least_squares(free, left)
                shares[j, k] = max(shares[j, k], 1.0 - float(after @ after) / power)
    return shares


def _drive(dq: Array, ddq: Array) -> Array:
    """Columns of a drive: viscous and Coulomb friction, inertia, (N, 3)."""
    return np.column_stack([dq, np.tanh(dq / 0.05), ddq])
