"""Extended Kalman filter: state [q, dq, π, φ, δ], first-order covariance.

The derivatives of forward dynamics follow from the kernels of inverse dynamics:
∂ddq/∂x = −M⁻¹ ∂τ/∂x. Source: Gautier & Poignet 2001; the semi-implicit Jacobian is ours.
"""

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.classical.filter_input import (
    SPEED_VARIANCE,
    STATE_COLUMNS,
    FilterInput,
    filter_input_of,
    prior_covariance,
    process_noise,
)
from runtime.estimators.classical.ols import fit_of_pi
from runtime.estimators.method import Method
from runtime.estimators.problem import Fit, Problem
from runtime.library import Array, Library

_CHECK_EVERY = 100
"""Steps between two checks of the consistency of π."""


def fit_ekf(problem: Problem) -> Fit:
    """Identify π and φ by the extended Kalman filter, estimate after the last sample."""
    data = filter_input_of(problem, "ekf")
    return _fit(problem, data, *run_ekf(problem.lib, data, problem.start))


def _fit(problem: Problem, data: FilterInput, x: Array, covariance: Array, bad: int) -> Fit:
    lib = problem.lib
    n, n_pi = lib.n_joints, lib.pi0.size
    pi, phi = x[2 * n : 2 * n + n_pi], x[2 * n + n_pi : -n].reshape(n, -1)
    checks = 1 + (len(data.q) - 1) // _CHECK_EVERY
    base = lib.base_matrix @ covariance[2 * n : 2 * n + n_pi, 2 * n : 2 * n + n_pi]
    sigma = np.sqrt(np.einsum("ij,ij->i", base, lib.base_matrix).clip(0))
    notes = [
        f"noise estimated from the recording: position {data.sigma_q.max():.2g}, torque "
        f"{data.sigma_tau.max():.2g} at most"
    ]
    if bad:
        notes.append(
            f"links of the estimate were not physically consistent at {bad} of {checks} checks on "
            "the way, because the filter does not constrain them"
        )
    status = (
        f"filtered {len(data.q)} samples; largest standard deviation of a base parameter "
        f"{sigma.max():.2g}"
    )
    return fit_of_pi(problem, pi, phi, status, len(data.q), tuple(notes))


@np.errstate(over="ignore", invalid="ignore")  # checked at the end
def run_ekf(lib: Library, data: FilterInput, lam: Array) -> tuple[Array, Array, int]:
    """Run the filter over all samples."""
    n, n_pi = lib.n_joints, lib.pi0.size
    at = slice(2 * n, None)
    # First state and covariance: measured position, speed of a line, first guess, friction.
    x = np.concatenate([data.q[0], data.first_speed, lib.pi_from_lam(lam), data.first_extra])
    p = np.zeros((x.size, x.size))
    p[:n, :n] = np.diag(data.sigma_q**2)
    p[n : 2 * n, n : 2 * n] = SPEED_VARIANCE * np.eye(n)
    p[2 * n : 2 * n + n_pi, 2 * n : 2 * n + n_pi] = prior_covariance(lib, lam)
    tail = np.arange(2 * n + n_pi, x.size)
    p[tail, tail] = data.extra_variance
    late = tail[-n:]
    noise, bad = np.diag(data.sigma_q**2), 0
    top = np.zeros((2 * n, x.size))
    for step, q in enumerate(data.q):
        # Update: gain K = P Hᵀ (H P Hᵀ + R)⁻¹ with H = [1 0 …], the measured position.
        gain = np.linalg.solve(p[:n, :n] + noise, p[:n])
        x = x + gain.T @ (q - x[:n])
        p = p - gain.T @ p[:n]
        if not np.isfinite(x).all():
            break
        if step % _CHECK_EVERY == 0:
            bad += bool((lib.relative_eigenvalues(x[at][:n_pi]) < 0).any())
        if step == len(data.q) - 1:
            break
        x[: 2 * n], spread = _advance(lib, data, step, x, top)
        # Prediction P ← F P Fᵀ + Q. F is the identity below the first 2 n rows, `top`.
        rows = top @ p
        p[: 2 * n, 2 * n :] = rows[:, 2 * n :]
        p[2 * n :, : 2 * n] = rows[:, 2 * n :].T
        p[: 2 * n, : 2 * n] = rows @ top.T
        p[: 2 * n, : 2 * n] += spread
        p[late, late] += data.wander
        # Rounding would let P become asymmetric and then indefinite.
        p = (p + p.T) / 2
    if not (np.isfinite(x).all() and np.isfinite(p).all()):
        raise IdentificationError(
            f"the filter diverged after {step * data.dt:.2f} s; give a better first guess, or "
            "check the unit and the sign of the torque and the friction columns"
        )
    return x, p, bad


def _advance(
    lib: Library, data: FilterInput, step: int, x: Array, top: Array
) -> tuple[Array, Array]:
    """Next [q, dq] (2 n,) and its process noise; `top` (2 n, size) receives ∂[q, dq]/∂state."""
    n, n_pi, dt = lib.n_joints, lib.pi0.size, data.dt
    q, dq, pi, phi, delay = np.split(x, [n, 2 * n, 2 * n + n_pi, x.size - n])
    speed, push, drift = data.speed[step], data.acceleration[step], data.torque_rate[step]
    middle = q + dt / 2 * dq
    # Friction F φ = S dq + rest: S dissipates and is implicit, the rest is taken at v̄.
    secants, constants = data.friction(step)
    phi = phi.reshape(n, -1)
    drag = np.sum(secants * data.passive(phi), axis=1)
    steady = np.sum((secants * speed[:, None] + constants) * phi, axis=1) - drag * speed
    # (M + dt/2 S) a = τ + δ τ̇ − h − S dq − rest, all at the middle of the step.
    implicit = lib.mass_matrix(middle, pi) + dt / 2 * np.diag(drag)
    force = data.tau[step] + delay * drift - steady - drag * dq
    ddq = np.linalg.solve(implicit, force - lib.bias_forces(middle, dq + dt / 2 * push, pi))
    # ∂a/∂state = (M + dt/2 S)⁻¹ [−∂τ/∂q, −∂τ/∂dq − S, −Y, −F, τ̇], at the smoothed v̄ and ā.
    _, by_q, by_dq, _ = lib.torque_derivatives(middle, speed, push, pi)
    k = secants.shape[1]
    right = np.zeros((n, x.size + n))
    right[:, :n] = -by_q
    right[:, n : 2 * n] = -dt / 2 * by_q - by_dq - np.diag(drag)
    right[:, 2 * n : 2 * n + n_pi] = -lib.regressor(middle, speed, push)
    columns = secants * speed[:, None] + constants
    for j in range(n):
        right[j, 2 * n + n_pi + j * k : 2 * n + n_pi + (j + 1) * k] = -columns[j]
    right[:, x.size - n : x.size] = np.diag(drift)
    right[:, x.size :] = np.diag(data.sigma_tau)
    # The last n columns are the effect of one standard deviation of each torque.
    solved = dt * np.linalg.solve(implicit, right)
    # dq⁺ = dq + dt a and q⁺ = q + dt (dq + dq⁺)/2.
    top[n:] = solved[:, : x.size]
    top[n:, n : 2 * n] += np.eye(n)
    top[:n] = dt / 2 * top[n:]
    top[:n, : 2 * n] += np.concatenate([np.eye(n), dt / 2 * np.eye(n)], axis=1)
    after = dq + dt * ddq
    moved = np.concatenate([q + dt / 2 * (dq + after), after])
    return moved, process_noise(np.asarray(solved[:, x.size :], dtype=float), dt)


EKF = Method(
    "ekf",
    "extended Kalman filter over q, dq, pi and friction, on the unfiltered recording",
    fit_ekf,
    unfiltered=True,
    columns=STATE_COLUMNS,
    objective="follows the unfiltered recording",
)
