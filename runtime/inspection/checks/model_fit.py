"""Checks of the torque against a fit of the robot's model, once units, signs and order are right.

A torque that no bodies of this robot explain, and a tool that the model lacks. The checks use the
residual of least squares on base parameters and friction, W x = T (traps 1, 12).
"""

import numpy as np

from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.inspection.checks.torque_rows import TorqueRows, least_squares
from runtime.inspection.finding import INFO, WARNING, Finding
from runtime.library import Array
from runtime.library.parameters import MASS, N_PARAMETERS, centre_of_mass, mass
from runtime.recording.rest_speeds import rest_speeds

SURE = 4.0
"""Standard deviations from which on a value is significant."""
TOOL_KG, TOOL_GAIN = 0.4, 0.6
"""Smallest tool that is reported [kg], and residual with it over the residual without it. The last
links of a CAD model err by 0.3 kg (LWR 4+), a Franka hand weighs 0.73 kg."""
STRANGE = 0.3
"""Residual over torque above which the model does not fit the log at all."""


def fit_rows(torque_rows: TorqueRows) -> Array:
    """Matrix W of the equations over [β; φ], (N n, n_b + n k)."""
    s, lib = torque_rows.samples, torque_rows.lib
    base = lib.base_regressor(s.q, s.dq, s.ddq).reshape(len(s) * lib.n_joints, -1)
    return np.hstack([base, torque_rows.friction_rows()])


def unexplained(torque_rows: TorqueRows, matrix: Array, *, has_gains: bool = True) -> list[Finding]:
    """A torque that no parameters of this robot explain."""
    tau = torque_rows.samples.tau
    if has_gains:
        _, rest = least_squares(matrix, tau.ravel())
        misfit = float(np.linalg.norm(rest) / np.linalg.norm(tau))
    else:
        misfit = _median_misfit(torque_rows, matrix)
    if misfit < STRANGE:
        return []
    return [
        Finding(
            "unexplained",
            WARNING,
            f"least squares without constraints leaves {100 * misfit:.0f} % of the torque "
            "unexplained: another robot, other units or another order than assumed here, contact, "
            "or another signal than the joint torque; do not use a model identified from this log",
            {"misfit": misfit},
        )
    ]


def _median_misfit(torque_rows: TorqueRows, matrix: Array) -> float:
    """Residual over torque of joints that are fitted one by one, median of the joints.

    Gains that are unknown scale the rows of each joint, so that joints share no parameters. The
    rows of a joint at rest are left out: Coulomb friction may take any value there.
    """
    s = torque_rows.samples
    of_joints = matrix.reshape(*s.tau.shape, -1)
    shares = []
    slowest = rest_speeds(torque_rows.lib)
    for j in range(s.tau.shape[1]):
        moves = np.abs(s.dq[:, j]) >= slowest[j]
        columns = of_joints[moves, j]
        columns = columns[:, np.any(columns != 0.0, axis=0)]
        if len(columns) <= 2 * columns.shape[1]:
            continue
        _, rest = least_squares(columns, s.tau[moves, j])
        size = max(float(np.linalg.norm(s.tau[moves, j])), 1e-300)
        shares.append(float(np.linalg.norm(rest)) / size)
    return float(np.median(shares)) if shares else 0.0


def tool(torque_rows: TorqueRows) -> list[Finding]:
    """A body at the last link that the URDF lacks, or has too much (trap 1).

    Measured: ten parameters of the last link, of either sign, fitted to the residual of the URDF.
    """
    s, lib = torque_rows.samples, torque_rows.lib
    n = lib.n_joints
    last = lib.regressor(s.q, s.dq, s.ddq)[:, :, -N_PARAMETERS:].reshape(len(s) * n, N_PARAMETERS)
    target = (s.tau - lib.inverse_dynamics(s.q, s.dq, s.ddq, lib.pi0)).ravel()
    extra = torque_rows.friction_rows()
    # Three passes: the weights of the joints follow their residuals.
    weights = np.ones(n)
    rest = before = target
    x = np.zeros(N_PARAMETERS)
    for _ in range(3):
        scale = np.tile(np.sqrt(weights), len(s))
        _, before = least_squares(extra * scale[:, None], target * scale)
        matrix = np.hstack([last, extra]) * scale[:, None]
        x, rest = least_squares(matrix, target * scale)
        errors = (rest / scale).reshape(-1, n)
        weights = 1.0 / np.maximum(errors.var(axis=0), 1e-9 * errors.var(axis=0).max() + 1e-300)
    body = x[:N_PARAMETERS]
    mass_kg = float(mass(body))
    gain = float(np.linalg.norm(rest) / max(float(np.linalg.norm(before)), 1e-300))
    # σ of the mass: its column less what the other columns explain, noise of N_eff samples.
    others = np.delete(last, MASS, axis=1)
    basis = np.linalg.qr(np.hstack([extra, others]) * scale[:, None])[0]
    column = last[:, MASS] * scale
    column = column - basis @ (basis.T @ column)
    inflation = inflation_of(np.hstack([last, extra]), errors, weights)
    noise = np.sqrt(inflation * np.mean(rest**2))
    sigma = float(noise / max(float(np.linalg.norm(column)), 1e-300))
    if abs(mass_kg) < max(TOOL_KG, SURE * sigma) or gain > TOOL_GAIN:
        return []
    if mass_kg < -1.5 * float(mass(lib.pi0[-N_PARAMETERS:])):
        return []  # no tool weighs less than nothing: gravity, signs or gains are wrong
    com = centre_of_mass(body)
    link, centre = lib.link_names[-1], ", ".join(f"{c:.3f}" for c in com)
    what = (
        "the model lacks a body that is mounted there: build the robot with the tool, or "
        "identify it with the command payload"
        if mass_kg > 0
        else "the model contains a body that is not mounted, such as a hand: build the robot with "
        "--tip set to the link before it"
    )
    return [
        Finding(
            "tool",
            WARNING,
            f"{mass_kg:+.2f} ± {2 * sigma:.2f} kg at {link} (centre {centre} m) "
            f"explain the residual of the model ({100 * gain:.0f} % remains); {what}",
            {"mass_kg": mass_kg, "sigma_kg": sigma, "com_m": [float(c) for c in com], "left": gain},
            trap=1,
        )
    ]


def one_run(duration_s: float) -> Finding:
    """Note that a test on a part of the same run of this duration [s] is optimistic (trap 12)."""
    return Finding(
        "one_run",
        INFO,
        f"this is one run of {duration_s:.3g} s: a test on a part of it "
        "underestimates the error of the model; record another motion for the test",
        {"duration_s": duration_s},
        trap=12,
    )


def inflation_of(matrix: Array, errors: Array, weights: Array) -> float:
    """Variance inflation N / N_eff of the errors of a fit."""
    scale = np.sqrt(weights)
    rows = matrix.reshape(*errors.shape, -1) * scale[:, None]
    return coloured_noise_of_rows(rows, errors * scale).inflation
