"""Numerical pose of loop joints on the tree of a chain, and Newton's iteration that closes them.

Pinocchio gives frames and Jacobians. The same rows as expressions are in
`symgen.mechanics.closure`.
"""

from dataclasses import dataclass, replace

import numpy as np
import pinocchio
from numpy.typing import NDArray

from symgen.chain.loop import FREE_ROWS, IN_SHARED, Closure, Frame

Array = NDArray[np.float64]

CLOSED = 1e-10
"""Distance of two frames [m, rad] that counts as closed; Newton ends at rounding error."""
SINGULAR = 1e-6
"""Singular value of ∂φ/∂x, relative to the largest, below which a direction counts as lost."""
_NEWTON, _LONGEST = 60, 0.3
"""Iterations of Newton; longest step in a joint, rad or m."""
_EYE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Tree:
    """The chain without its loops: x_all = A x + b, frames by pinocchio.

    Attributes:
        model: of N joints.
        names: of the n joints whose positions are x.
        matrix: (N, n) A.
        offset: (N,) b [rad, m].
    """

    model: pinocchio.Model
    names: tuple[str, ...]
    matrix: Array
    offset: Array

    def rows(self, closures: list[Closure], x: Array) -> tuple[Array, Array]:
        """Rows of all loop joints.

        x (n,) [rad, m].
        """
        data = self.model.createData()
        positions = self.matrix @ x + self.offset
        pinocchio.computeJointJacobians(self.model, data, positions)
        values, slopes = [], []
        for closure in closures:
            value, slope = _apart(self.model, data, closure)
            values.append(value[list(closure.rows)])
            slopes.append(slope[list(closure.rows)] @ self.matrix)
        return np.concatenate(values), np.vstack(slopes)


def _apart(model: pinocchio.Model, data: pinocchio.Data, closure: Closure) -> tuple[Array, Array]:
    """Six components of the pose of the child's frame in the parent's, and their Jacobian."""
    (r_a, a, j_a), (r_c, c, j_c) = (
        _placed(model, data, frame) for frame in (closure.parent, closure.child)
    )
    if closure.kind in IN_SHARED:
        shared = _shared(model, closure)
        if shared:
            r_s, _, j_s = _placed(model, data, Frame(shared - 1, _EYE, (0.0, 0.0, 0.0)))
        else:
            r_s, j_s = np.eye(3), np.zeros((6, model.nv))
        slope = r_s.T @ (j_c[:3] - j_a[:3] + _cross(c - a) @ j_s[3:])
        return np.concatenate([r_s.T @ (c - a), np.zeros(3)]), np.vstack([slope, 0 * slope])
    r, p = r_a.T @ r_c, r_a.T @ (c - a)
    turn = r_a.T @ (j_c[3:] - j_a[3:])  # δ of dR = [δ×] R
    shift = r_a.T @ (j_c[:3] - j_a[:3] + _cross(c - a) @ j_a[3:])
    if 5 in FREE_ROWS[closure.kind] and 4 not in FREE_ROWS[closure.kind]:
        z = r[:, 2]  # d z = δ × z; to first order (−z_y, z_x) is the turn about x and y
        slope = -_cross(z) @ turn
        bent, slopes = np.array([-z[1], z[0], 0.0]), np.vstack([-slope[1], slope[0], 0 * slope[2]])
    else:  # vee of the skew part of R; d = (tr R 1 − R) δ / 2
        bent = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / 2
        slopes = (np.trace(r) * np.eye(3) - r) @ turn / 2
    return np.concatenate([p, bent]), np.vstack([shift, slopes])


def _shared(model: pinocchio.Model, closure: Closure) -> int:
    """Pinocchio's index of the last joint that moves both links, 0 for the base."""
    above, below = (
        set(model.supports[frame.joint + 1]) for frame in (closure.parent, closure.child)
    )
    return int(max(above & below))


def _placed(
    model: pinocchio.Model, data: pinocchio.Data, frame: Frame
) -> tuple[Array, Array, Array]:
    """R, origin and (6, N) Jacobian of a frame in axes of the base."""
    place = pinocchio.SE3(np.array(frame.rotation), np.array(frame.translation))
    if frame.joint < 0:
        return place.rotation, place.translation, np.zeros((6, model.nv))
    at = data.oMi[frame.joint + 1]
    jacobian = pinocchio.getJointJacobian(
        model, data, frame.joint + 1, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
    ).copy()
    world = at * place
    jacobian[:3] -= _cross(world.translation - at.translation) @ jacobian[3:]
    return world.rotation, world.translation, jacobian


def _cross(v: Array) -> Array:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0.0]])


def closed_pose(
    tree: Tree, closures: list[Closure], start: Array, columns: list[int]
) -> Array | None:
    """Close all loops by damped Newton.

    start (n,) [rad, m] → (n,).
    """
    x = newton_pose(tree, closures, start, columns)
    return x if np.abs(tree.rows(closures, x)[0]).max() < CLOSED else None


def newton_pose(tree: Tree, closures: list[Closure], start: Array, columns: list[int]) -> Array:
    """The pose where damped Newton ends, closed or not.

    start (n,) [rad, m] → (n,) [rad, m].
    """
    x = start.copy()
    for _ in range(_NEWTON):
        value, slope = tree.rows(closures, x)
        if np.abs(value).max() < CLOSED / 1e3:
            return x
        step = np.linalg.lstsq(slope[:, columns], -value, rcond=SINGULAR)[0]
        x[columns] += step * min(1.0, _LONGEST / max(np.abs(step).max(), 1e-300))
    return x


def apart_at(tree: Tree, closure: Closure, x: Array) -> str:
    """Distance of the frames of a loop at a pose, with the angle where the loop fixes it.

    x (n,) [rad, m].
    """
    value, _ = tree.rows([replace(closure, kind="fixed", rows=(0, 1, 2, 3, 4, 5))], x)
    along = ", ".join(f"{v:.3g}" for v in np.round(value[:3], 6) + 0.0)
    turn = ""
    if any(row > 2 for row in closure.rows):
        turn = f" and {np.arcsin(min(1.0, float(np.linalg.norm(value[3:])))):.3g} rad"
    return f"{np.linalg.norm(value[:3]):.3g} m ({along} in the parent's frame){turn}"
