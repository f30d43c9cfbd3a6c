"""Limits of position, velocity and acceleration, linear in the coefficients of a trajectory."""

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.trajectory import COSINE
from runtime.library import Array, Library

LIMIT_STEP = 0.1
"""Step of the grid of limits in the descent, s (Sec. 3.4.2); the result is checked at 1 kHz."""
DEFAULT_ACCELERATION = 10.0
"""Acceleration limit of joints for which the robot states none, rad/s² or m/s²."""
DEFAULT_RANGE = np.pi
"""Range on both sides of home of a joint without position limits, rad or m."""


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
        self._up, self._down = share * (upper - home), share * (home - lower)
        self._rows = {"position": phi[..., 0], "velocity": phi[..., 1]}
        self._rows["acceleration"] = phi[..., 2]
        self._bounds = {"velocity": share * speed, "acceleration": share * accel}

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
        q = self._rows["position"] @ a.T
        shares = {"position": np.maximum((q / self._up).max(0), (-q / self._down).max(0))}
        for kind, bound in self._bounds.items():
            shares[kind] = np.abs(self._rows[kind] @ a.T).max(0) / bound
        return shares

    def inequalities(self) -> tuple[Array, Array]:
        """All limits as A vec(a) ≤ b: A (rows, n M) and b of ones."""
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


def whitening(matrix: Array, n: int) -> Array:
    """Linear change of coordinates in which the limits look alike in all directions.

    With a = S x, S Sᵀ is, joint by joint, the inverse Hessian of −Σ ln(1 − A a) at rest. The raw
    coefficients differ in scale by three orders of magnitude, which slows a quasi-Newton method.

    matrix (rows, n M) → (n M, n M).
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
    """Scale the coefficients of each joint back until no limit is exceeded.

    a (n, M) → (n, M).
    """
    rho = np.maximum(1.0, np.max(list(limits.use(a).values()), axis=0))
    return a / rho[:, None]
