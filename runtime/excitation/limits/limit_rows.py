"""Constraints at the samples of a grid, as g(a) ≤ 0 of the coefficients.

Jacobian rows are computed on demand. Every derivative of the motion is linear in a: ∂g/∂a_jm = Σ_d
∂g/∂q_j^(d) φ_m^(d)(t). Limits of position, velocity and acceleration are linear in a.
"""

from collections.abc import Sequence

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.dependent_joints import DependentLimit
from runtime.excitation.limits.distance_limits import TipSpeed
from runtime.excitation.limits.nonlinear_limits import Braking, Constraint
from runtime.excitation.limits.torque_limits import TorqueLimit
from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.trajectory import COSINE
from runtime.library import Array, Indices, Library

LIMIT_STEP = 0.1  # grid of limits in the descent, s (Sec. 3.4.2); the check is at 1 kHz
DEFAULT_ACCELERATION = 10.0  # acceleration limit where the robot states none, rad/s² or m/s²
DEFAULT_RANGE = np.pi  # range on both sides of home of a joint without position limits, rad or m


class Limits:
    """Position, velocity and acceleration limits, linear in the coefficients."""

    def __init__(
        self,
        lib: Library,
        home: Array,
        harmonics: int,
        duration: float,
        step: float = LIMIT_STEP,
        basis: Basis = COSINE,
        share: float = 1.0,
    ) -> None:
        """Limits on a grid."""
        limits = lib.limits()
        self.assumptions: list[str] = []
        low, high = (f"{DEFAULT_RANGE:.4g} {side} home" for side in ("below", "above"))
        lower = self._or(limits["lower"], home - DEFAULT_RANGE, "lower position", lib, low)
        upper = self._or(limits["upper"], home + DEFAULT_RANGE, "upper position", lib, high)
        speed = self._or(limits["velocity"], np.pi, "velocity", lib)
        accel = self._or(limits["acceleration"], DEFAULT_ACCELERATION, "acceleration", lib)
        outside = (home <= lower) | (home >= upper)
        if outside.any():
            j = int(np.argmax(outside))
            raise IdentificationError(
                f"the home position {home[j]:.4g} of joint '{lib.joint_names[j]}' is not inside "
                f"its limits {lower[j]:.4g} to {upper[j]:.4g}; choose another home"
            )
        end = duration / 2 if basis.is_symmetric else duration
        t = np.linspace(0, end, int(np.ceil(end / step)) + 1)
        phi = basis.at(lib, harmonics, t, duration)
        self._kinds = {
            "position": (phi[..., 0], share * (upper - home), share * (home - lower)),
            "velocity": (phi[..., 1], share * speed, share * speed),
            "acceleration": (phi[..., 2], share * accel, share * accel),
        }

    def _or(
        self, values: Array, missing: float | Array, what: str, lib: Library, described: str = ""
    ) -> Array:
        unknown = ~np.isfinite(values)
        if unknown.any():
            names = ", ".join(np.array(lib.joint_names)[unknown])
            text = described or f"{missing:.4g}"
            self.assumptions.append(f"no {what} limit for {names}: {text} assumed")
        return np.where(unknown, missing, values)

    def use(self, a: Array) -> dict[str, Array]:
        """Largest |value| over the share of the limit, per joint (n,), for each kind of limit."""
        shares = {}
        for kind, (rows, up, down) in self._kinds.items():
            values = rows @ a.T
            shares[kind] = np.maximum((values / up).max(0), (-values / down).max(0))
        return shares

    def inequalities(self) -> tuple[Array, Array]:
        """All limits as A vec(a) ≤ b: A (rows, n M) and b of ones."""
        blocks = []
        for rows, up, down in self._kinds.values():
            for bound, signed in ((up, rows), (down, -rows)):
                for j, limit in enumerate(bound):
                    block = np.zeros((len(rows), len(bound), rows.shape[1]))
                    block[:, j] = signed / limit
                    blocks.append(block.reshape(len(rows), -1))
        matrix = np.vstack(blocks)
        matrix = matrix[np.abs(matrix).max(axis=1) > 0]
        return matrix, np.ones(len(matrix))


def whitening(matrix: Array, n: int) -> Array:
    """Linear change of coordinates (n M, n M) in which the limits look alike in all directions.

    With a = S x, S Sᵀ is, joint by joint, the inverse Hessian of −Σ ln(1 − A a) at rest. The raw
    coefficients differ in scale by three orders of magnitude, which slows a quasi-Newton method.
    """
    width = matrix.shape[1] // n
    result = np.zeros((matrix.shape[1], matrix.shape[1]))
    for j in range(n):
        part = slice(j * width, (j + 1) * width)
        try:
            lower = np.linalg.cholesky(matrix[:, part].T @ matrix[:, part])
        except np.linalg.LinAlgError:
            # Between samples such functions move without any limit.
            raise IdentificationError(
                f"the limits are sampled every {LIMIT_STEP:g} s, too seldom for {width} functions "
                "per joint in this duration; lower the setting harmonics or raise --duration"
            ) from None
        result[part, part] = np.linalg.inv(lower).T
    return result


def inside(limits: Limits, a: Array) -> Array:
    """Scale the coefficients (n, M) of each joint back until no limit is exceeded."""
    rho = np.maximum(1.0, np.max(list(limits.use(a).values()), axis=0))
    return a / rho[:, None]


NEAR = -0.35  # rows above this value are linearised; what lies lower stays below 0 within a step


def spared(constraint: Constraint, share: float) -> float:
    """Amount by which g is raised so that g ≤ 0 leaves a share of the limit unused."""
    if isinstance(constraint, TipSpeed):
        return (1 - share**2) / 2
    uses = Braking | TorqueLimit | DependentLimit
    return 1 - share if isinstance(constraint, uses) else 0.0


def unit_of(constraint: Constraint, share: float) -> float:
    """Part of the limit that is the unit of g, so that g is use − 1 of the share.

    Coefficients at the bounds are as small as the share. In units of the whole limit a motion far
    beyond the share of another one has a small g, and a penalty that outweighs the cost for whole
    limits does not outweigh it.
    """
    return share**2 if isinstance(constraint, TipSpeed) else share


class LimitRows:
    """Values g(a) of constraints on a grid, (R, N) each; of a share (use − share) / share."""

    def __init__(
        self,
        constraints: Sequence[Constraint],
        home: Array,
        basis: Array,
        half: bool,
        tightened: float = 0.0,
        share: float = 1.0,
    ) -> None:
        """Rows of constraints on a grid."""
        self._constraints, self._home, self._basis = tuple(constraints), home, basis
        self._tightened = tightened
        self._spared = [spared(each, share) for each in self._constraints]
        self._units = [unit_of(each, share) for each in self._constraints]
        middle = (len(basis) + 1) // 2
        # The merit comes first and the rows of the same point after it: values are computed once.
        self._seen: tuple[Array, list[Array]] = np.zeros(0), []
        self._counts = [
            middle if half and constraint.even else len(basis) for constraint in self._constraints
        ]

    def motion(self, a: Array) -> Array:
        """Values q, dq, ddq, dddq on the grid, (4, N, n)."""
        motion = np.tensordot(self._basis, a, axes=(1, 1)).transpose(1, 0, 2)
        motion[0] += self._home
        return motion

    def by_constraint(self, a: Array) -> list[Array]:
        """Values g per constraint, (R, N) each."""
        if not self._constraints:  # a long grid of the motion takes a gigabyte for nothing
            return []
        if not np.array_equal(self._seen[0], a):
            motion = self.motion(a)
            parts = [
                (constraint.values(motion[:, :count]).T + more) / unit + self._tightened
                for constraint, count, more, unit in zip(
                    self._constraints, self._counts, self._spared, self._units, strict=True
                )
            ]
            self._seen = a.copy(), parts
        return list(self._seen[1])

    def values(self, a: Array) -> Array:
        """All values g, one constraint after another."""
        parts = [values.ravel() for values in self.by_constraint(a)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def worst(self, a: Array) -> float:
        """Largest g; −1 where there are no constraints."""
        return float(self.values(a).max(initial=-1.0))

    def linearised(self, a: Array, near: float = NEAR) -> tuple[Indices, Array, Array]:
        """Rows that a step could violate: numbers (m,), values and slopes."""
        values = self.values(a)
        chosen = np.flatnonzero(values > near)
        return chosen, values[chosen], self.jacobian(a, chosen)

    def jacobian(self, a: Array, chosen: Indices) -> Array:
        """Slopes ∂g/∂vec(a), (m, n M), of chosen rows (m,)."""
        motion = self.motion(a)
        blocks, first = [np.zeros((0, a.size))], 0
        for constraint, count, unit in zip(
            self._constraints, self._counts, self._units, strict=True
        ):
            last = first + count * len(constraint.labels)
            row, sample = np.divmod(chosen[(chosen >= first) & (chosen < last)] - first, count)
            first = last
            if not row.size:
                continue
            samples, back = np.unique(sample, return_inverse=True)
            slopes = constraint.slopes(motion[:, samples])[back, row] / unit  # (rows, orders, n)
            # Chain rule over the derivatives of the motion: Σ_d ∂g/∂q^(d) φ^(d), (rows, M, n).
            chain = np.matmul(self._basis[sample][:, :, : constraint.orders], slopes)
            blocks.append(chain.transpose(0, 2, 1).reshape(len(row), -1))
        return np.concatenate(blocks)

    def strongest(self, a: Array, count: int = 2) -> list[str]:
        """Names of the rows with the largest g, each of another constraint or joint."""
        named = [
            (float(g), f"{constraint.kind} ({label})")
            for constraint, values in zip(self._constraints, self.by_constraint(a), strict=True)
            for label, g in zip(constraint.labels, values.max(axis=1), strict=True)
        ]
        return [name for _, name in sorted(named, reverse=True)[:count]]
