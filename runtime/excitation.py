"""Excitation trajectories that make base parameters visible: Fourier + quintic, best of starts.

q(t) = home + Σ_m a_m φ_m(t) per joint (Eqs. 3.24–3.28); the cost is log cond of the
column-normalised base regressor at equally spaced samples (Eq. 3.29) with its exact gradient from
the generated adjoint. Limits are linear in a and the admissible set is star-shaped about rest, so
every point is pulled back onto it along its ray and the descent itself is unconstrained.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from runtime.errors import IdentificationError
from runtime.library import Array, Library
from runtime.threads import one_blas_thread

COST_SAMPLES = 80
"""Samples of the cost over the whole duration (document Sec. 3.4.2)."""
LIMIT_STEP = 0.1
"""Grid of the limits during the descent, s (Sec. 3.4.2); the result is pulled inside at 1 kHz."""
START = 0.5
"""Limit use of a random start: far enough inside to choose its own basin."""
ITERATIONS = 150
"""Of the sequential quadratic program, per start."""
DEFAULT_ACCELERATION = 10.0
"""Used where the robot states none, rad/s² or m/s²."""
DEFAULT_RANGE = np.pi
"""± range of a joint without position limits, rad or m."""
LONGEST = 3600.0
"""Duration in s beyond which the limits' grid outgrows the memory."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """q(t) of n joints: out from `home` and back to it at rest.

    Attributes:
        home: (n,) rad or m.
        coefficients: a, (n, M) rad or m.
        duration: t_f, s.
    """

    home: Array
    coefficients: Array
    duration: float

    def at(self, lib: Library, t: Array) -> tuple[Array, Array, Array, Array]:
        """q, dq, ddq, dddq at times t, each (N, n)."""
        basis = fourier_basis(lib, self.coefficients.shape[1], t, self.duration)
        q, dq, ddq, dddq = np.einsum("jm,tmd->dtj", self.coefficients, basis)
        return q + self.home, dq, ddq, dddq


@dataclass(frozen=True, slots=True)
class Design:
    """The best trajectory over all starts.

    Attributes:
        condition: cond of the column-normalised base regressor at `COST_SAMPLES` samples.
        conditions: the same for every start, in order.
        use: largest |value| / limit at 1 kHz per kind of limit, 1 is the limit itself.
        assumptions: limits that the robot does not state and what was taken instead.
    """

    trajectory: Trajectory
    condition: float
    conditions: tuple[float, ...]
    use: dict[str, float]
    assumptions: tuple[str, ...]


def fourier_basis(lib: Library, harmonics: int, t: Array, duration: float) -> Array:
    """φ_m(t) and three derivatives, (N, M, 4)."""
    m = np.arange(1, harmonics + 1, dtype=float)
    times, orders = np.repeat(t, harmonics), np.tile(m, len(t))
    return lib.harmonic_basis(orders, times, duration).reshape(len(t), harmonics, 4)


class ConditionCost:
    """log cond W̄_b of a trajectory and its exact gradient in a (Eq. 3.29).

    Columns of no full rank, to rounding, count as cond = (n_b ε)^-½. Compiled where the library's
    level has it, else by NumPy.
    """

    def __init__(self, lib: Library, home: Array, harmonics: int, duration: float) -> None:
        self._lib, self._home = lib, home
        # Out and back passes every sample twice; half of them carry all the information.
        t = np.linspace(0.0, duration, COST_SAMPLES)[: COST_SAMPLES // 2]
        self._basis = fourier_basis(lib, harmonics, t, duration)[..., :3]
        self.compiled = lib.excitation_cost(home, self._basis)

    def value_gradient(self, coefficients: Array) -> tuple[float, Array]:
        """Cost and ∂cost/∂a, (n, M)."""
        if self.compiled is not None:
            return self.compiled.value_gradient(coefficients)
        return self.by_numpy(coefficients)

    def by_numpy(self, coefficients: Array) -> tuple[float, Array]:
        """The same with LAPACK's eigenpairs: the reference."""
        motion = np.einsum("jm,tmd->dtj", coefficients, self._basis)
        q, dq, ddq = motion[0] + self._home, motion[1], motion[2]
        y = self._lib.base_regressor(q, dq, ddq)
        value, slope = log_condition(y.reshape(-1, y.shape[-1]))
        adjoint = self._lib.regressor_adjoint(q, dq, ddq, y @ slope)
        return value, np.einsum("tdj,tmd->jm", adjoint, self._basis)


def log_condition(rows: Array) -> tuple[float, Array]:
    """log cond W̄ and S with ∂/∂W = W S, (n_b, n_b); W̄ is W (N, n_b) with columns of unit length."""
    gram = rows.T @ rows
    size = np.sqrt(np.diag(gram))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    values, vectors = np.linalg.eigh(gram * np.outer(scale, scale))
    high = values[-1]
    low = max(values[0], len(gram) * np.finfo(float).eps * high)
    z_low, z_high = vectors[:, 0] * scale, vectors[:, -1] * scale
    slope = np.outer(z_high, z_high) / high - np.outer(z_low, z_low) / low
    slope -= np.diag(z_high**2 - z_low**2)
    return float(np.log(high / low) / 2), slope


class Limits:
    """Position, velocity and acceleration limits, linear in the coefficients."""

    def __init__(
        self, lib: Library, home: Array, harmonics: int, duration: float, step: float = LIMIT_STEP
    ) -> None:
        limits = lib.limits()
        self.assumptions: list[str] = []
        lower = self._or(limits["lower"], -DEFAULT_RANGE, "lower position", lib)
        upper = self._or(limits["upper"], DEFAULT_RANGE, "upper position", lib)
        speed = self._or(limits["velocity"], np.pi, "velocity", lib)
        accel = self._or(limits["acceleration"], DEFAULT_ACCELERATION, "acceleration", lib)
        outside = (home <= lower) | (home >= upper)
        if outside.any():
            j = int(np.argmax(outside))
            raise IdentificationError(
                f"the home position {home[j]:.4g} of joint '{lib.joint_names[j]}' is not inside "
                f"its limits {lower[j]:.4g} to {upper[j]:.4g}; choose another home"
            )
        count = int(np.ceil(duration / 2 / step)) + 1
        basis = fourier_basis(lib, harmonics, np.linspace(0, duration / 2, count), duration)
        self._up, self._down = upper - home, home - lower
        self._rows = {"position": basis[..., 0], "velocity": basis[..., 1]}
        self._rows["acceleration"] = basis[..., 2]
        self._bounds = {"velocity": speed, "acceleration": accel}

    def _or(self, values: Array, missing: float, what: str, lib: Library) -> Array:
        unknown = ~np.isfinite(values)
        if unknown.any():
            names = ", ".join(np.array(lib.joint_names)[unknown])
            self.assumptions.append(f"no {what} limit for {names}: {missing:.4g} assumed")
        return np.where(unknown, missing, values)

    def use(self, a: Array) -> dict[str, Array]:
        """Largest |value| / limit per joint, for each kind of limit."""
        q = self._rows["position"] @ a.T
        found = {"position": np.maximum((q / self._up).max(0), (-q / self._down).max(0))}
        for kind, bound in self._bounds.items():
            found[kind] = np.abs(self._rows[kind] @ a.T).max(0) / bound
        return found

    def inequalities(self) -> tuple[Array, Array]:
        """A and b of all limits as A vec(a) ≤ b, rows of unit bound."""
        blocks, n = [], len(self._up)
        for kind, rows in self._rows.items():
            pairs = [(self._up, rows), (self._down, -rows)]
            if kind != "position":
                pairs = [(self._bounds[kind], rows), (self._bounds[kind], -rows)]
            for bound, signed in pairs:
                for j in range(n):
                    block = np.zeros((len(rows), n, rows.shape[1]))
                    block[:, j] = signed / bound[j]
                    blocks.append(block.reshape(len(rows), -1))
        matrix = np.vstack(blocks)
        matrix = matrix[np.abs(matrix).max(axis=1) > 0]
        return matrix, np.ones(len(matrix))


@one_blas_thread
def design(
    lib: Library,
    duration: float = 10.0,
    harmonics: int = 5,
    starts: int = 5,
    seed: int = 0,
    home: Array | None = None,
    progress: Callable[[int, float, float], None] | None = None,
) -> Design:
    """Best of several descents on log cond from random admissible starts.

    Args:
        lib: of the robot.
        duration: s.
        harmonics: M.
        starts: number of descents.
        seed: of the random starts.
        home: start and end position, default is the robot's.
        progress: called after each start with its number, its condition number and the best one.
            Ctrl-C stops and keeps the best start so far.

    Raises:
        IdentificationError: options or home position make no trajectory.
    """
    if not 0 < duration <= LONGEST or harmonics < 1 or starts < 1:
        raise IdentificationError(
            f"a trajectory needs a positive duration up to {LONGEST:g} s, at least one harmonic "
            f"and one start, got {duration:g} s, {harmonics}, {starts}"
        )
    rest = lib.home if home is None else np.asarray(home, dtype=float)
    n = lib.n_joints
    cost = ConditionCost(lib, rest, harmonics, duration)
    limits = Limits(lib, rest, harmonics, duration)
    rng = np.random.default_rng(seed)
    found: list[tuple[float, Array]] = []

    matrix, bound = limits.inequalities()
    spread = whitening(matrix, n)
    matrix = matrix @ spread
    admissible = {"type": "ineq", "fun": lambda x: bound - matrix @ x, "jac": lambda _: -matrix}

    def objective(x: Array) -> tuple[float, Array]:
        value, gradient = cost.value_gradient((spread @ x).reshape(n, harmonics))
        return value, spread.T @ gradient.ravel()

    try:
        for k in range(starts):
            x = rng.normal(size=n * harmonics)
            x *= START / np.max(matrix @ x)
            result = minimize(
                objective,
                x,
                jac=True,
                method="SLSQP",
                constraints=[admissible],
                options={"maxiter": ITERATIONS, "ftol": 1e-6},
            )
            a = _inside(limits, (spread @ result.x).reshape(n, harmonics))
            found.append((cost.value_gradient(a)[0], a))
            if progress is not None:
                best = min(value for value, _ in found)
                progress(k + 1, float(np.exp(found[-1][0])), float(np.exp(best)))
    except KeyboardInterrupt:
        if not found:
            raise
    a = found[int(np.argmin([value for value, _ in found]))][1]
    fine = Limits(lib, rest, harmonics, duration, step=1e-3)
    a = _inside(fine, a)
    use = {kind: float(values.max()) for kind, values in fine.use(a).items()}
    return Design(
        Trajectory(rest, a, duration),
        float(np.exp(cost.value_gradient(a)[0])),
        tuple(float(np.exp(v)) for v, _ in found),
        use,
        tuple(limits.assumptions),
    )


def whitening(matrix: Array, n: int) -> Array:
    """S with a = S x: the limits A a ≤ 1 look alike in all directions of x.

    S Sᵀ is, joint by joint, the inverse Hessian of −Σ ln(1 − A a) at rest; the raw coefficients
    differ in scale by three orders of magnitude, which a quasi-Newton method would have to learn.
    """
    width = matrix.shape[1] // n
    result = np.zeros((matrix.shape[1], matrix.shape[1]))
    for j in range(n):
        part = slice(j * width, (j + 1) * width)
        lower = np.linalg.cholesky(matrix[:, part].T @ matrix[:, part])
        result[part, part] = np.linalg.inv(lower).T
    return result


def _inside(limits: Limits, a: Array) -> Array:
    """Each joint scaled back until no limit is exceeded."""
    rho = np.maximum(1.0, np.max(list(limits.use(a).values()), axis=0))
    return a / rho[:, None]
