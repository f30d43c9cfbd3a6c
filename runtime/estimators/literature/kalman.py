"""Kalman filters whose state holds the parameters, on the unfiltered recording.

Extended: state [q, dq, π, φ, δ], first-order covariance. The derivatives of forward dynamics follow
from the kernels of inverse dynamics: ∂ddq/∂x = −M⁻¹ ∂τ/∂x. Source: Gautier & Poignet 2001; the
semi-implicit Jacobian is ours.

Unscented: state [q, dq, β, φ, δ], covariance from sigma points: 2 L + 1 points x ± h columns of the
Cholesky factor of P, h = α √L, α = 0.1, β = 2, κ = 0. Base parameters, because unidentifiable
directions would let the points drift. Points whose mass matrix falls below a fifth of that of the
mean belong to robots that cannot be simulated; their pair is taken with a smaller h, whose weights
1/(2 h²) preserve mean and covariance. All points move under the torque that gives their mean the
acceleration ā of the smoothed positions; the difference to the measured torque moves all of them
together (below is the reason). Source: Julier & Uhlmann 1997; van der Merwe 2004.

Input of the filters: the recording at its full rate, its noise, friction in the state.

Measured torque is their input and measured position their output; the state is
[q, dq, parameters, δ], and one step of dt is

    (M + dt/2 S) a = τ + δ τ̇ − h − S dq − offset,   dq⁺ = dq + dt a,   q⁺ = q + dt (dq + dq⁺)/2

with M and h in the middle of the step. It is implicit in friction because smooth Coulomb friction
on a light wrist is far too fast for an explicit step; S = f(v̄)/v̄, its secant, keeps its sign and
cannot push a joint through rest. δ, one per joint, is the unknown time within a step at which the
torque acts (held or not, sampled before or after): an omitted δ of 0.2 ms biases the parameters by
many standard deviations.

v̄ and ā come from the smoothed positions, and the derivative of a step by the parameters is taken
there: the noise of τ over a small inertia is a large a that the robot never had, and a filter that
takes it for motion becomes overconfident about the inertia. Source: instruments against errors in
variables (Söderström 2018, Ch. 6); their use in a filter is ours.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from runtime.errors import IdentificationError, NeedsError, RecordingError
from runtime.estimators.classical.least_squares import fit_of_base, fit_of_pi
from runtime.estimators.methods import Method
from runtime.estimators.problem import Fit, Origin, Problem
from runtime.library import Array, Library
from runtime.library.parameters import lam_from_parts, link_columns, links
from runtime.recording import Friction, Recording
from runtime.recording.preprocessing.filters import low_pass
from runtime.recording.preprocessing.segments import differentiate, segments, uniform_step
from runtime.recording.recording import complete_arrays
from runtime.recording.settings import COLUMNS, names_where

STATE_COLUMNS = names_where(lambda column: column.secant is not None)
SLOWEST = 200.0  # rate, Hz, below which a step of a filter is too long for the friction of a wrist
LEAST_NOISE = (1e-6, 1e-3)  # least σ of position [rad, m] and torque [N·m]; filters diverge below
FIRST_FRICTION = 0.3  # viscous and Coulomb friction at the start, and its σ, N·m (s/rad)
LAM_FLOOR = lam_from_parts(log_mass=0.3, centre=0.02, rotation=0.3, axes=0.02)
"""Least |λ| for the relative standard deviation of the first guess."""
TRUST = 0.05  # relative standard deviation of the first guess in λ
SPEED_VARIANCE = 1e-4  # variance of the first velocity, (rad/s)²
SMOOTH_HZ = 20.0  # cut-off of ā and τ̇, Hz, at most a fifth of the rate: above motions, below noise
DELAY, WANDER = 0.5, 0.5
"""Standard deviation of δ, in steps, and of its change in a second: behind a rotor J it is
(M + J)⁻¹ M of half a step, and M depends on the posture."""
JITTER = 1e-10  # process noise of every velocity and step, (rad/s)², so no covariance is singular


@dataclass(frozen=True, slots=True)
class FilterInput:
    """Samples for a filter."""

    dt: float  # step, s
    q: Array  # q, tau: (N, n)
    tau: Array
    speed: Array  # speed, acceleration, torque_rate: v̄, ā and τ̇ mid-step, (N − 1, n)
    acceleration: Array
    torque_rate: Array
    sigma_q: Array  # sigma_q, sigma_tau: standard deviations of their noise, (n,)
    sigma_tau: Array
    names: tuple[str, ...]  # friction columns
    width: float  # ε of the Coulomb column

    def friction(self, step: int) -> tuple[Array, Array]:
        """Secants column/dq at the smoothed speed of a step, and constant columns, each (n, k)."""
        speed = self.speed[step]
        secants_of = (COLUMNS[name].secant for name in self.names)
        parts = [secant(speed, self.width) for secant in secants_of if secant is not None]
        secants, constants = (
            np.array([part[i] for part in parts]).reshape(len(parts), speed.size).T for i in (0, 1)
        )
        return secants, constants

    @property
    def first_extra(self) -> Array:
        """φ joint by joint, and δ, before the first sample, (n k + n,)."""
        n = self.q.shape[1]
        start = [FIRST_FRICTION if COLUMNS[name].is_passive else 0.0 for name in self.names]
        return np.concatenate([np.tile(start, n), np.zeros(n)])

    def passive(self, phi: Array) -> Array:
        """φ (…, n, k) with negative dissipation set to 0, which would drive the joints."""
        least = [0.0 if COLUMNS[name].is_passive else -np.inf for name in self.names]
        return np.maximum(phi, least)


def filter_input_of(log: Origin | None, method: str) -> FilterInput:
    """Return the training part of the recording at its full rate."""
    if log is None or log.recording.tau is None:
        raise NeedsError(
            f"the method {method} expects the recording with its torque, got neither; give the "
            "log itself"
        )
    first, last = log.span
    rows = (log.recording.t >= first) & (log.recording.t <= last)
    part = log.recording.take(rows, "Took the span of the training samples.")
    try:
        dt = uniform_step(part, f"run the {method}")
    except RecordingError:
        raise NeedsError(
            f"the method {method} works sample by sample and expects a uniform clock; "
            "resample the recording (max_gap_s in a recipe), or choose another method"
        ) from None
    if dt * SLOWEST > 1.0 + 1e-9 or len(segments(part.t)) > 1:
        raise NeedsError(
            f"the method {method} works sample by sample and expects a recording "
            f"without gaps at {SLOWEST:g} Hz or more, got {len(segments(part.t)) - 1} gaps at "
            f"{1 / dt:g} Hz; record at the controller's rate, or choose another method"
        )
    return filter_input_from(part, dt, log.friction)


def filter_input_from(part: Recording, dt: float, terms: Friction) -> FilterInput:
    """Return a recording with torque and a uniform clock as input of a filter."""
    tau = part.required("tau")
    bare = part.replace(dq=None, ddq=None, columns=None, column_names=())
    low_passed = low_pass(bare, min(SMOOTH_HZ, 0.2 / dt))
    smooth = complete_arrays(differentiate(low_passed), "dq", "ddq", "tau")
    speed, acceleration = ((a[1:] + a[:-1]) / 2 for a in (smooth["dq"], smooth["ddq"]))
    return FilterInput(
        dt=dt,
        q=part.q,
        tau=tau,
        speed=speed,
        acceleration=acceleration,
        torque_rate=np.diff(smooth["tau"], axis=0) / dt,
        sigma_q=np.maximum(noise_of(part.q), LEAST_NOISE[0]),
        sigma_tau=np.maximum(noise_of(tau), LEAST_NOISE[1]),
        names=terms.columns,
        width=terms.coulomb_speed,
    )


def noise_of(values: Array) -> Array:
    """Standard deviation of white noise on a smooth signal, from third differences of 20 σ²."""
    return np.asarray(np.sqrt(np.mean(np.diff(values, 3, axis=0) ** 2, axis=0) / 20))


def prior_covariance(lib: Library, lam: Array) -> Array:
    """Covariance of π (10 n, 10 n) through ∂π/∂λ from relative standard deviations of λ."""
    jacobian = lib.pi_jacobian(lam)
    sigma = TRUST * np.maximum(np.abs(links(lam)), LAM_FLOOR)
    blocks = jacobian * sigma[:, None, :]
    whole = np.zeros((lam.size, lam.size))
    for k, block in enumerate(blocks):
        whole[link_columns(k), link_columns(k)] = block @ block.T
    return whole


def process_noise(spread: Array, dt: float) -> Array:
    """Process noise of [q, dq] after a step: spread (n, n) → (2 n, 2 n)."""
    both = np.concatenate([dt / 2 * spread, spread])
    noise = np.asarray(both @ both.T)
    n = len(spread)
    noise[range(n, 2 * n), range(n, 2 * n)] += JITTER
    return noise


ALPHA, BETA = 0.1, 2.0  # spread of the points, and the weight of the centre for Gaussian states
_LIGHTEST = 0.2  # smallest mass matrix of a sigma point, relative to that of the mean
_NEAREST = 1e-3  # smallest h; below it a pair is a difference quotient
_RIDGE = 1e-12  # least relative eigenvalue of a covariance that rounding has made indefinite
_CHECK_EVERY = 100  # steps between two checks of the consistency of π


def fit_ekf(problem: Problem, log: Origin | None = None) -> Fit:
    """Identify π and φ by the extended Kalman filter, estimate after the last sample."""
    lib, data = problem.lib, filter_input_of(log, "ekf")
    x, covariance, bad = run_ekf(lib, data, problem.start)
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
    facts = {"iterations": len(data.q), "notes": tuple(notes)}
    return fit_of_pi(problem, pi, phi, _status(data, sigma), **facts)


def _status(data: FilterInput, sigma: Array) -> str:
    return (
        f"filtered {len(data.q)} samples; largest standard deviation of a base parameter "
        f"{sigma.max():.2g}"
    )


@np.errstate(over="ignore", invalid="ignore")  # checked at the end
def _filtered(
    data: FilterInput,
    guess: Array,
    spread: Array,
    predict: Callable[[int, Array, Array], tuple[Array, Array]],
) -> tuple[Array, Array]:
    """State and covariance after the last sample, from first parameters and their covariance."""
    n, dt, count = data.q.shape[1], data.dt, min(20, len(data.q))
    # First state: measured position, speed of a line, first guess, friction and delay.
    speed = np.polyfit(np.arange(count) * dt, data.q[:count], 1)[0]
    x = np.concatenate([data.q[0], speed, guess, data.first_extra])
    noise, late = np.diag(data.sigma_q**2), np.arange(x.size - n, x.size)
    friction = np.full(n * len(data.names), FIRST_FRICTION**2)
    extra = np.concatenate([friction, np.full(n, (DELAY * dt) ** 2)])
    p = block_diag(noise, SPEED_VARIANCE * np.eye(n), spread, np.diag(extra))
    for step, q in enumerate(data.q):
        # Update: gain K = P Hᵀ (H P Hᵀ + R)⁻¹ with H = [1 0 …], the measured position.
        gain = np.linalg.solve(p[:n, :n] + noise, p[:n])
        x = x + gain.T @ (q - x[:n])
        p = p - gain.T @ p[:n]
        if step == len(data.q) - 1 or not (np.isfinite(x).all() and np.isfinite(p).all()):
            break
        x, p = predict(step, x, p)
        p[late, late] += (WANDER * dt) ** 2 * dt
    if not (np.isfinite(x).all() and np.isfinite(p).all()):
        raise IdentificationError(
            f"the filter diverged after {step * data.dt:.2f} s; give a better first guess, or "
            "check the unit and the sign of the torque and the friction columns"
        )
    return x, p


def run_ekf(lib: Library, data: FilterInput, lam: Array) -> tuple[Array, Array, int]:
    """Run the filter over all samples."""
    n, bad = lib.n_joints, list[bool]()
    top = np.zeros((2 * n, 2 * n + lam.size + data.first_extra.size))

    def checked(step: int, x: Array) -> None:
        if step % _CHECK_EVERY == 0:
            bad.append(bool((lib.relative_eigenvalues(x[2 * n :][: lam.size]) < 0).any()))

    def predict(step: int, x: Array, p: Array) -> tuple[Array, Array]:
        checked(step, x)
        x[: 2 * n], spread = _advance(lib, data, step, x, top)
        # Prediction P ← F P Fᵀ + Q. F is the identity below the first 2 n rows, `top`.
        rows = top @ p
        p[: 2 * n, 2 * n :] = rows[:, 2 * n :]
        p[2 * n :, : 2 * n] = rows[:, 2 * n :].T
        p[: 2 * n, : 2 * n] = rows @ top.T
        p[: 2 * n, : 2 * n] += spread
        # Rounding would let P become asymmetric and then indefinite.
        return x, (p + p.T) / 2

    x, p = _filtered(data, lib.pi_from_lam(lam), prior_covariance(lib, lam), predict)
    checked(len(data.q) - 1, x)
    return x, p, sum(bad)


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


def fit_ukf(problem: Problem, log: Origin | None = None) -> Fit:
    """Identify β and φ by the unscented Kalman filter, estimate after the last sample."""
    lib, data = problem.lib, filter_input_of(log, "ukf")
    n, n_b = lib.n_joints, len(lib.base_columns)
    x, covariance = run_ukf(lib, data, problem.start)
    sigma = np.sqrt(np.diag(covariance)[2 * n : 2 * n + n_b])
    beta, phi = x[2 * n : 2 * n + n_b], x[2 * n + n_b : -n].reshape(n, -1)
    return fit_of_base(problem, beta, phi, _status(data, sigma), iterations=len(data.q))


def run_ukf(lib: Library, data: FilterInput, lam: Array) -> tuple[Array, Array]:
    """Run the filter over all samples."""
    n, size = lib.n_joints, 2 * lib.n_joints + len(lib.base_columns) + data.first_extra.size
    far = reach = np.full(size, ALPHA * np.sqrt(size))

    def predict(step: int, x: Array, p: Array) -> tuple[Array, Array]:
        nonlocal reach
        # All points after a step. h may grow by half per step, back to its full size.
        points, reach = _points(lib, x, _root(p), np.minimum(1.5 * reach, far))
        moved, inverse = _advance_points(lib, data, step, points)
        points[:, : 2 * n] = moved
        # Offsets from the image of the mean, whose large weight then multiplies zero.
        offsets = points[1:] - points[0]
        weights = np.tile(0.5 / reach**2, 2)
        shift = weights @ offsets
        centre = 2 - weights.sum() - ALPHA**2 + BETA
        centred = offsets - shift
        p = (centred * weights[:, None]).T @ centred + centre * np.outer(shift, shift)
        p[: 2 * n, : 2 * n] += process_noise(data.dt * inverse * data.sigma_tau, data.dt)
        return points[0] + shift, p

    spread = lib.base_matrix @ prior_covariance(lib, lam) @ lib.base_matrix.T
    return _filtered(data, lib.base_matrix @ lib.pi_from_lam(lam), spread, predict)


def _root(p: Array) -> Array:
    """Root R of P, R Rᵀ = P: the Cholesky factor, or from eigenvalues where P is indefinite."""
    p = (p + p.T) / 2
    try:
        return np.asarray(np.linalg.cholesky(p), dtype=float)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(p)
        return np.asarray(vectors * np.sqrt(np.maximum(values, _RIDGE * values[-1])))


def _points(lib: Library, x: Array, root: Array, reach: Array) -> tuple[Array, Array]:
    """Mean, x + h L and x − h L as rows, and h (size,), halved where M is too small."""
    n, n_b = lib.n_joints, len(lib.base_columns)
    while True:
        offsets = (root * reach).T
        points = np.concatenate([x[None], x + offsets, x - offsets])
        mass = lib.mass_matrix(points[:, :n], _pi(lib, points[:, 2 * n : 2 * n + n_b]))
        rest = mass[1:] - _LIGHTEST * mass[0]
        try:
            np.linalg.cholesky(rest)
            return points, reach
        except np.linalg.LinAlgError:
            light = np.linalg.eigvalsh(rest)[:, 0] <= 0
            pairs = light.reshape(2, -1).any(axis=0) & (reach > _NEAREST)
            if not pairs.any():
                return points, reach
            reach = np.where(pairs, reach / 2, reach)


def _pi(lib: Library, beta: Array) -> Array:
    """A π with these base parameters: β in the base columns, zero elsewhere."""
    pi = np.zeros((len(beta), lib.pi0.size))
    pi[:, lib.base_columns] = beta
    return pi


def _advance_points(
    lib: Library, data: FilterInput, step: int, points: Array
) -> tuple[Array, Array]:
    """[q, dq] (points, 2 n) of all points after a step, and (M + dt/2 S)⁻¹ of the first one."""
    n, n_b, dt = lib.n_joints, len(lib.base_columns), data.dt
    q, dq, beta, phi, delay = np.split(points, [n, 2 * n, 2 * n + n_b, points.shape[1] - n], axis=1)
    push = data.acceleration[step]
    middle, speed = q + dt / 2 * dq, dq + dt / 2 * push
    secants, constants = data.friction(step)
    phi = phi.reshape(len(points), n, -1)
    columns = secants * data.speed[step][:, None] + constants
    pi, drag = _pi(lib, beta), np.sum(secants * data.passive(phi[0]), axis=1)
    late = delay * data.torque_rate[step] - np.sum(columns * phi, axis=2) + drag * data.speed[step]
    # Torque that gives the mean the smoothed acceleration; all points move under it.
    smooth = lib.inverse_dynamics(middle[0], speed[0], push, pi[0]) + drag * speed[0] - late[0]
    ddq = lib.forward_dynamics(middle, speed, smooth + late - drag * dq, pi, dt / 2 * drag)
    # The measured torque beyond it moves all points alike, by the inertia of the mean.
    inverse = np.linalg.inv(lib.mass_matrix(middle[0], pi[0]) + dt / 2 * np.diag(drag))
    ddq = ddq + inverse @ (data.tau[step] - smooth)
    moved = np.concatenate([q + dt * (dq + dt / 2 * ddq), dq + dt * ddq], axis=1)
    return moved, np.asarray(inverse, dtype=float)


EKF = Method(
    "ekf",
    "extended Kalman filter over q, dq, pi and friction, on the unfiltered recording",
    fit_ekf,
    takes_log=True,
    unfiltered=True,
    columns=STATE_COLUMNS,
    objective="follows the unfiltered recording",
)
UKF = replace(
    EKF,
    name="ukf",
    sentence="unscented Kalman filter over q, dq, beta and friction, on the unfiltered recording",
    fit=fit_ukf,
)
