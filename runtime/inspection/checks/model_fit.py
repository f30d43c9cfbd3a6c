"""Checks of the torque against a fit of the robot's model, once units, signs and order are right.

Delay of τ, a torque computed by a model, a tool that the model lacks, coupled motors. Each check
uses the residual of least squares on base parameters and friction, W x = T (traps 1, 2, 4, 6, 12).
"""

import numpy as np

from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.inspection.checks.torque_rows import TorqueRows, least_squares
from runtime.inspection.finding import INFO, WARNING, Finding
from runtime.library import Array
from runtime.library.parameters import MASS, N_PARAMETERS, centre_of_mass, mass
from runtime.recording import Friction, Recipe

PERFECT = 5e-4
"""Residual over torque below which the torque cannot come from a sensor."""
SILENT, GOOD = 1e-5, 5e-3
"""Noise of the raw torque over its RMS, and residual over torque: below both, the torque cannot
come from a sensor."""
SHIFTS = 60
"""Delays that are tried."""
SURE = 4.0
"""Standard deviations from which on a value is significant."""
LATE_GAIN = 0.1
"""Share of the squared residual that a delay must explain; a wrong width of friction explains 5
%."""
TOOL_KG, TOOL_GAIN = 0.4, 0.6
"""Smallest tool that is reported [kg], and residual with it over the residual without it. The last
links of a CAD model err by 0.3 kg (LWR 4+), a Franka hand weighs 0.73 kg."""
STRANGE = 0.3
"""Residual over torque above which the model does not fit the log at all."""
COUPLED, INDEPENDENT = 0.35, 30.0
"""Share of a joint's squared residual that the speed of another joint must explain, and the
effective sample size that this check needs."""
_DIFFERENCES = 4


def fit_rows(torque_rows: TorqueRows) -> Array:
    """Matrix W of the equations over [β; φ], (N n, n_b + n k)."""
    s, lib = torque_rows.samples, torque_rows.lib
    base = lib.base_regressor(s.q, s.dq, s.ddq).reshape(len(s) * lib.n_joints, -1)
    return np.hstack([base, torque_rows.friction_rows()])


def delay(torque_rows: TorqueRows, matrix: Array, plan: Recipe) -> list[Finding]:
    """Delay δ of the time stamps of τ: minimum of ‖T(t + δ) − W x‖ (trap 2).

    Args:
        torque_rows: prepared rows.
        matrix: W of `fit_rows`.
        plan: recipe so far, with the cut-off.

    Returns:
        "time_shift" where the delay explains `LATE_GAIN` of the squared residual, is significant
        and exceeds 0.3 samples.
    """
    whole, t = torque_rows.whole, torque_rows.whole.t[torque_rows.rows]
    step = 1.0 / whole.rate_hz
    cutoff = plan.preparation.cutoff_hz or 5.0
    grid = np.linspace(-1.0, 1.0, SHIFTS + 1) * max(0.25 / cutoff, 4 * step)
    # Orthonormal basis of W, so that a shifted torque costs one product.
    lengths = np.linalg.norm(matrix, axis=0)
    left, sigma, _ = np.linalg.svd(
        matrix / np.where(lengths > 0, lengths, 1.0), full_matrices=False
    )
    left = left[:, sigma > 1e-9 * sigma[0]]
    tau = whole.required("tau")
    inside = (t + grid[0] > whole.t[0]) & (t + grid[-1] < whole.t[-1])
    keep = np.repeat(inside, torque_rows.lib.n_joints)
    left = np.linalg.qr(left[keep])[0]

    def rest(shift: float) -> Array:
        moved = np.stack([np.interp(t[inside] + shift, whole.t, row) for row in tau.T], axis=1)
        target = moved.ravel()
        return np.asarray(target - left @ (left.T @ target)).reshape(moved.shape)

    # Joints are weighted by their residual without a delay.
    now = rest(0.0)
    weights = 1.0 / np.maximum(now.var(axis=0), 1e-12 * now.var(axis=0).max() + 1e-300)
    cost = np.array([float(np.sum(rest(d) ** 2 @ weights)) for d in grid])
    k = int(np.argmin(cost))
    if not 0 < k < len(grid) - 1 or cost[k] <= 0:
        return []
    # A parabola through the least value and its neighbours resolves fractions of a sample.
    low, mid, high = cost[k - 1 : k + 2]
    curve = (low - 2 * mid + high) / (grid[1] - grid[0]) ** 2
    late = float(grid[k] - (high - low) / (2 * (grid[1] - grid[0]) * curve))
    stay = float(np.sum(now**2 @ weights))
    gain = 1.0 - mid / stay
    inflation = _inflation(matrix[keep], now, weights)
    freedom = max(now.size / inflation - 1.0, 1.0)
    sigma_late = float(np.sqrt(2.0 * mid / curve / freedom))
    if gain < LATE_GAIN or abs(late) < SURE * sigma_late or abs(late) < 0.3 * step:
        return []
    which = "later" if late > 0 else "earlier"
    return [
        Finding(
            "time_shift",
            WARNING,
            f"τ is stamped {1e3 * abs(late):.2f} ms {which} than q (± {1e3 * sigma_late:.2f} ms, "
            f"{abs(late) / step:.2g} samples): shifting it back removes {100 * gain:.0f} % of the "
            f"squared residual; set torque_delay_s = {late:.2g} under [preparation]",
            {"delay_s": late, "sigma_s": sigma_late, "gain": gain},
            trap=2,
        )
    ]


def too_good(torque_rows: TorqueRows, matrix: Array, raw_tau: Array) -> list[Finding]:
    """A torque whose fit or noise is smaller than that of any sensor (trap 4).

    Args:
        torque_rows: prepared rows.
        matrix: W of `fit_rows`.
        raw_tau: (N, n) torque before any filter [N·m, N].

    Returns:
        "not_measured" below `PERFECT`, or below `SILENT` and `GOOD` together.
    """
    tau = torque_rows.samples.tau
    _, rest = least_squares(matrix, tau.ravel())
    size = np.sqrt(np.mean(tau**2, axis=0))
    misfit = float(np.linalg.norm(rest) / np.linalg.norm(tau))
    noise = noise_floor(raw_tau) / np.maximum(size, 1e-300)
    floor = float(np.median(noise))
    if misfit > PERFECT and not (floor < SILENT and misfit < GOOD):
        return []
    return [
        Finding(
            "not_measured",
            WARNING,
            f"the torque is not a measurement: the model fits it to {100 * misfit:.2g} %, and its "
            f"noise is {100 * floor:.2g} % of its RMS; it is the output of a model (commanded, "
            "feed-forward or simulated torque), from which only that model can be identified; log "
            "the measured torque or current",
            {"misfit": misfit, "noise_over_rms": [float(x) for x in noise]},
            trap=4,
        )
    ]


def unexplained(torque_rows: TorqueRows, matrix: Array) -> list[Finding]:
    """A torque that no parameters of this robot explain.

    Args:
        torque_rows: prepared rows.
        matrix: W of `fit_rows`.

    Returns:
        "unexplained" where the residual exceeds `STRANGE` of the torque.
    """
    tau = torque_rows.samples.tau
    _, rest = least_squares(matrix, tau.ravel())
    misfit = float(np.linalg.norm(rest) / np.linalg.norm(tau))
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


def noise_floor(values: Array) -> Array:
    """σ of white noise per column from fourth differences: ‖Δ⁴x‖ / √(70 N)."""
    differences = np.diff(values, n=_DIFFERENCES, axis=0)
    return np.asarray(np.sqrt(np.mean(differences**2, axis=0) / 70.0))


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
    inflation = _inflation(np.hstack([last, extra]), errors, weights)
    noise = np.sqrt(inflation * np.mean(rest**2))
    sigma = float(noise / max(float(np.linalg.norm(column)), 1e-300))
    if abs(mass_kg) < max(TOOL_KG, SURE * sigma) or gain > TOOL_GAIN:
        return []
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


def coupling(torque_rows: TorqueRows, matrix: Array, terms: Friction) -> list[Finding]:
    """Residual torque of one joint that follows the speed of a neighbour (trap 6).

    Args:
        torque_rows: prepared rows.
        matrix: W of `fit_rows`.
        terms: friction columns of the fit; columns of coupled motors end the check.

    Returns:
        "gear_coupling" where the neighbour explains `COUPLED` of a joint's squared residual.
    """
    s, lib = torque_rows.samples, torque_rows.lib
    if any(name.startswith("motor_") for name in terms.columns):
        return []
    _, rest = least_squares(matrix, s.tau.ravel())
    errors = rest.reshape(-1, lib.n_joints)
    findings = []
    inflation = _inflation(matrix, errors, 1.0 / np.maximum(errors.var(axis=0), 1e-300))
    if len(errors) / inflation < INDEPENDENT:
        return []
    for j in range(lib.n_joints):
        drive = _drive(s.dq[:, j], s.ddq[:, j])
        _, left = least_squares(drive, errors[:, j])
        power = float(left @ left)
        for k in (j - 1, j + 1):
            if not 0 <= k < lib.n_joints or power == 0:
                continue
            turns = [_drive(s.dq[:, k], s.ddq[:, k])]
            turns += [_drive(s.dq[:, k] + sign * s.dq[:, j], s.ddq[:, k]) for sign in (1, -1)]
            shares = []
            for other in turns:
                _, free = least_squares(drive, other)
                _, after = least_squares(free, left)
                shares.append(1.0 - float(after @ after) / power)
            if max(shares) > COUPLED:
                findings.append((j, k, max(shares)))
    if not findings:
        return []
    j, k, share = max(findings, key=lambda f: f[2])
    names = lib.joint_names
    return [
        Finding(
            "gear_coupling",
            WARNING,
            f"{100 * share:.0f} % of the squared residual at {names[j]} follows the speed of "
            f"{names[k]}: a gear couples their motors; give the full matrix under [gear] and add "
            "motor_viscous, motor_coulomb, motor_rotor to the columns of [friction]",
            {"pairs": [[a, b, c] for a, b, c in findings]},
            trap=6,
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


def _inflation(matrix: Array, errors: Array, weights: Array) -> float:
    """Variance inflation N / N_eff of the errors (N, n) of a fit with columns (N n, p)."""
    scale = np.sqrt(weights)
    rows = matrix.reshape(*errors.shape, -1) * scale[:, None]
    return coloured_noise_of_rows(rows, errors * scale).inflation


def _drive(dq: Array, ddq: Array) -> Array:
    """Columns of a drive: viscous and Coulomb friction, inertia, (N, 3)."""
    return np.column_stack([dq, np.tanh(dq / 0.05), ddq])
