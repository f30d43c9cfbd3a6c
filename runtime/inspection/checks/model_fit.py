"""What the torque says once units, signs and order are right: against a fit of the robot's model.

Delay of τ, a torque that is a model's output, a tool that the model lacks, coupled motors. Each
is asked of the residual of least squares on base parameters and friction, W x = T.
"""

import numpy as np

from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.inspection.checks.torque_rows import TorqueRows, least_squares
from runtime.inspection.finding import INFO, WARNING, Finding
from runtime.library import Array
from runtime.library.parameters import MASS, N_PARAMETERS, centre_of_mass, mass
from runtime.recording import Friction, Recipe

PERFECT = 5e-4
"""Residual over torque that no sensor reaches."""
SILENT, GOOD = 1e-5, 5e-3
"""Noise of the raw torque over its RMS that no sensor reaches, and a fit that goes with it."""
SHIFTS = 60
SURE = 4.0
LATE_GAIN = 0.1
"""Part of the squared residual that a delay must explain; a wrong width of friction feigns 5 %."""
TOOL_KG, TOOL_GAIN = 0.4, 0.6
"""Smallest tool that is told, and residual with it over the residual without. A CAD model's last
links err by 0.3 kg (the LWR 4+), a Franka hand weighs 0.73 kg."""
STRANGE = 0.3
"""Residual over torque above which the model is none of this log."""
COUPLED, INDEPENDENT = 0.35, 30.0
"""Part of a joint's squared residual that the speed of another joint explains, and the independent
samples that it takes to say so."""
_DIFFERENCES = 4


def fit_rows(torque_rows: TorqueRows) -> Array:
    """W over [β; φ], (N n, n_b + n k)."""
    s, lib = torque_rows.samples, torque_rows.lib
    base = lib.base_regressor(s.q, s.dq, s.ddq).reshape(len(s) * lib.n_joints, -1)
    return np.hstack([base, torque_rows.friction_rows()])


def delay(torque_rows: TorqueRows, matrix: Array, plan: Recipe) -> list[Finding]:
    """δ that minimises ‖T(t + δ) − W x‖, below a sample by a parabola: τ is stamped δ late."""
    whole, t = torque_rows.whole, torque_rows.whole.t[torque_rows.rows]
    step = 1.0 / whole.rate_hz
    cutoff = plan.preparation.cutoff_hz or 5.0
    grid = np.linspace(-1.0, 1.0, SHIFTS + 1) * max(0.25 / cutoff, 4 * step)
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

    now = rest(0.0)
    weights = 1.0 / np.maximum(now.var(axis=0), 1e-12 * now.var(axis=0).max() + 1e-300)
    cost = np.array([float(np.sum(rest(d) ** 2 @ weights)) for d in grid])
    k = int(np.argmin(cost))
    if not 0 < k < len(grid) - 1 or cost[k] <= 0:
        return []
    low, mid, high = cost[k - 1 : k + 2]
    curve = (low - 2 * mid + high) / (grid[1] - grid[0]) ** 2
    late = float(grid[k] - (high - low) / (2 * (grid[1] - grid[0]) * curve))
    stay = float(np.sum(now**2 @ weights))
    gain = 1.0 - mid / stay
    worth = _inflation(matrix[keep], now, weights)
    freedom = max(now.size / worth - 1.0, 1.0)
    sigma_late = float(np.sqrt(2.0 * mid / curve / freedom))
    if gain < LATE_GAIN or abs(late) < SURE * sigma_late or abs(late) < 0.3 * step:
        return []
    which = "later" if late > 0 else "earlier"
    return [
        Finding(
            "time_shift",
            WARNING,
            f"τ is stamped {1e3 * abs(late):.2f} ms {which} than q (± {1e3 * sigma_late:.2f} ms, "
            f"{abs(late) / step:.2g} samples): shifting it back takes {100 * gain:.0f} % of the "
            f"squared residual; set torque_delay_s = {late:.2g} under [preparation]",
            {"delay_s": late, "sigma_s": sigma_late, "gain": gain},
            trap=2,
        )
    ]


def too_good(torque_rows: TorqueRows, matrix: Array, raw_tau: Array) -> list[Finding]:
    """A fit, or a noise, that no sensor has (trap 4)."""
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
            f"the torque is too good to be measured: the model fits it to {100 * misfit:.2g} %, "
            f"its noise is {100 * floor:.2g} % of its size; this is the output of a model "
            "(commanded, feed-forward or simulated torque), from which only that model can be "
            "identified; log the measured torque or current",
            {"misfit": misfit, "noise_over_rms": [float(x) for x in noise]},
            trap=4,
        )
    ]


def unexplained(torque_rows: TorqueRows, matrix: Array) -> list[Finding]:
    """A torque that no parameters of this robot explain."""
    tau = torque_rows.samples.tau
    _, rest = least_squares(matrix, tau.ravel())
    misfit = float(np.linalg.norm(rest) / np.linalg.norm(tau))
    if misfit < STRANGE:
        return []
    return [
        Finding(
            "unexplained",
            WARNING,
            f"even the best parameters, possible or not, leave {100 * misfit:.0f} % of the torque "
            "unexplained: another robot, other units or order than found here, contact with "
            "something, or a torque of something else; nothing identified from this is to be "
            "trusted",
            {"misfit": misfit},
        )
    ]


def noise_floor(values: Array) -> Array:
    """σ of white noise per column from fourth differences: ‖Δ⁴x‖ / √(70 N)."""
    differences = np.diff(values, n=_DIFFERENCES, axis=0)
    return np.asarray(np.sqrt(np.mean(differences**2, axis=0) / 70.0))


def tool(torque_rows: TorqueRows) -> list[Finding]:
    """Ten unknowns at the last link on top of the URDF, of either sign (trap 1)."""
    s, lib = torque_rows.samples, torque_rows.lib
    n = lib.n_joints
    last = lib.regressor(s.q, s.dq, s.ddq)[:, :, -N_PARAMETERS:].reshape(len(s) * n, N_PARAMETERS)
    target = (s.tau - lib.inverse_dynamics(s.q, s.dq, s.ddq, lib.pi0)).ravel()
    extra = torque_rows.friction_rows()
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
    others = np.delete(last, MASS, axis=1)
    basis = np.linalg.qr(np.hstack([extra, others]) * scale[:, None])[0]
    own = last[:, MASS] * scale
    own = own - basis @ (basis.T @ own)
    worth = _inflation(np.hstack([last, extra]), errors, weights)
    sigma = float(np.sqrt(worth * np.mean(rest**2)) / max(float(np.linalg.norm(own)), 1e-300))
    if abs(mass_kg) < max(TOOL_KG, SURE * sigma) or gain > TOOL_GAIN:
        return []
    com = centre_of_mass(body)
    link, centre = lib.link_names[-1], ", ".join(f"{c:.3f}" for c in com)
    what = (
        "something hangs there that the model does not know: build the robot with the tool, or "
        "weigh it with the command payload"
        if mass_kg > 0
        else "the model carries something that is not mounted, a hand for example: build it with "
        "--tip before it"
    )
    return [
        Finding(
            "tool",
            WARNING,
            f"{mass_kg:+.2f} ± {2 * sigma:.2f} kg at {link} (centre {centre} m) "
            f"explain what the model leaves of the torque ({100 * gain:.0f} % remains); {what}",
            {"mass_kg": mass_kg, "sigma_kg": sigma, "com_m": [float(c) for c in com], "left": gain},
            trap=1,
        )
    ]


def coupling(torque_rows: TorqueRows, matrix: Array, terms: Friction) -> list[Finding]:
    """Friction and inertia of one joint that follow the speed of another (trap 6)."""
    s, lib = torque_rows.samples, torque_rows.lib
    if any(name.startswith("motor_") for name in terms.columns):
        return []
    _, rest = least_squares(matrix, s.tau.ravel())
    errors = rest.reshape(-1, lib.n_joints)
    findings = []
    worth = _inflation(matrix, errors, 1.0 / np.maximum(errors.var(axis=0), 1e-300))
    if len(errors) / worth < INDEPENDENT:
        return []
    for j in range(lib.n_joints):
        own = _drive(s.dq[:, j], s.ddq[:, j])
        _, left = least_squares(own, errors[:, j])
        power = float(left @ left)
        for k in (j - 1, j + 1):
            if not 0 <= k < lib.n_joints or power == 0:
                continue
            turns = [_drive(s.dq[:, k], s.ddq[:, k])]
            turns += [_drive(s.dq[:, k] + sign * s.dq[:, j], s.ddq[:, k]) for sign in (1, -1)]
            shares = []
            for other in turns:
                _, free = least_squares(own, other)
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
            f"{100 * share:.0f} % of what the model leaves at {names[j]} follows the speed of "
            f"{names[k]}: a gear couples their motors; give the full matrix under [gear] and add "
            "motor_viscous, motor_coulomb, motor_rotor to the columns of [friction]",
            {"pairs": [[a, b, c] for a, b, c in findings]},
            trap=6,
        )
    ]


def one_run(torque_rows: TorqueRows) -> Finding:
    """A split of one run flatters (trap 12)."""
    return Finding(
        "one_run",
        INFO,
        f"this is one run of {torque_rows.whole.duration:.3g} s: a test on a part of it "
        "underestimates the error of the model; record another motion for the test",
        {"duration_s": torque_rows.whole.duration},
        trap=12,
    )


def _inflation(matrix: Array, errors: Array, weights: Array) -> float:
    """N / N_eff of errors (N, n) that the columns (N n, p) leave."""
    scale = np.sqrt(weights)
    rows = matrix.reshape(*errors.shape, -1) * scale[:, None]
    return coloured_noise_of_rows(rows, errors * scale).inflation


def _drive(dq: Array, ddq: Array) -> Array:
    return np.column_stack([dq, np.tanh(dq / 0.05), ddq])
