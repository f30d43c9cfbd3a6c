"""Springs, torque curves and friction coordinates of a mechanism, as functions of q.

    spring   τ = k (x − rest) ∂x/∂q,   x = Σ of[m] x_m or the distance of two points
    curve    τ = p(x) ∂x/∂q

Both are torques that the drives must apply, so they stand on the side of Y π.
"""

from itertools import pairwise

import casadi as ca
import numpy as np

from symgen.chain import Chain
from symgen.chain.coupling import require_joints
from symgen.chain.document import listing
from symgen.chain.mechanism import KnownTorque, Spring
from symgen.errors import UrdfError
from symgen.kernel import Matrix
from symgen.mechanics.kinematics import all_positions, link_poses

_PARALLEL = 1e-9  # distance of two unit rows below which they are the same friction coordinate
_POSTURES, _ROUNDING = 3, 1e-12  # random postures; slope of a distance [1] that is constant there


def unknown_springs(chain: Chain) -> tuple[Spring, ...]:
    """Springs whose stiffness is to be identified."""
    return tuple(s for s in chain.mechanism.spring if s.stiffness is None)


def spring_columns(chain: Chain, q: Matrix) -> Matrix:
    """Torques of the springs of unknown stiffness for k = 1, (n, s)."""
    return ca.horzcat(*(_unit_torque(chain, s, q) for s in unknown_springs(chain)))


def known_torque(chain: Chain, q: Matrix) -> Matrix:
    """Torque of all curves and of the springs of stated stiffness, (n,) [N·m, N]."""
    total = ca.SX(len(chain.coordinates), 1)
    for spring in chain.mechanism.spring:
        if spring.stiffness is not None:
            total = total + spring.stiffness * _unit_torque(chain, spring, q)
    for curve in chain.mechanism.known_torque:
        x = _along(chain, curve.of, q)
        total = total + _curve(curve, x) * ca.gradient(x, q)
    return total


def friction_coordinates(chain: Chain) -> dict[str, tuple[float, ...]]:
    """Coordinates y = row · q, beside the joints themselves, at whose speed friction acts.

    They belong to dependent joints with several masters and to the mechanism file. The friction of
    a joint with one master has the same columns as that of the master.
    """
    named = {}
    if chain.coupling is not None and chain.loops is None:
        named = {j.name: chain.coupling.matrix[k] for k, j in enumerate(chain.single_joints)}
    if chain.loops is not None and chain.mechanism.friction:
        raise UrdfError(
            "[[friction]] of a closed chain would depend on the posture; remove it, the columns of "
            "the independent joints remain"
        )
    named |= {each.name: tuple(_row(chain, each.of)) for each in chain.mechanism.friction}
    rows: dict[str, tuple[float, ...]] = {}
    for name, values in named.items():
        row = np.array(values)
        if np.count_nonzero(row) < 2:
            continue
        row = row / row[int(np.argmax(np.abs(row)))]
        if all(np.abs(row - other).max() > _PARALLEL for other in rows.values()):
            rows[name] = tuple(row.tolist())
    return rows


def _unit_torque(chain: Chain, spring: Spring, q: Matrix) -> Matrix:
    x = _along(chain, spring.of, q) if spring.of else _distance(chain, spring, q)
    return (x - spring.rest) * ca.gradient(x, q)


def _along(chain: Chain, of: dict[str, float], q: Matrix) -> Matrix:
    """Σ of[m] x_m as a function of the independent coordinates."""
    names = [joint.name for joint in chain.joints]
    require_joints(of, names, "the mechanism")
    positions = all_positions(chain, q)
    return sum(factor * positions[names.index(name)] for name, factor in of.items())


def _row(chain: Chain, of: dict[str, float]) -> np.ndarray:
    q = ca.SX.sym("q", len(chain.coordinates))
    slope = ca.Function("row", [q], [ca.densify(ca.gradient(_along(chain, of, q), q))])
    return np.asarray(slope(0)).ravel()


def _distance(chain: Chain, spring: Spring, q: Matrix) -> Matrix:
    ends = []
    poses = link_poses(chain, q)
    links = [joint.link for joint in chain.joints]
    for link, point in ((spring.parent, spring.parent_xyz), (spring.child, spring.child_xyz)):
        at = ca.DM(point)
        if link in links:
            k = 4 * links.index(link)
            at = ca.mtimes(poses[k : k + 3, :3], at) + poses[k : k + 3, 3]
        elif link != chain.base:
            raise UrdfError(
                f"the spring '{spring.name}' names the link '{link}', which is neither the base "
                f"nor a moving link; name one of {listing([chain.base, *links])} in [[spring]] "
                f"'{spring.name}' of a mechanism file, and the point in its frame"
            )
        ends.append(at)
    between = ca.SX(ends[1] - ends[0])
    distance = ca.sqrt(ca.dot(between, between))
    if _is_constant(distance):
        raise UrdfError(
            f"the spring '{spring.name}' is between points of '{spring.parent}' and "
            f"'{spring.child}' whose distance no joint changes; move a point off the axis, name "
            "two links that move relative to each other, or remove the spring"
        )
    return distance


def _is_constant(value: ca.SX) -> bool:
    """Whether an expression has no slope at some random postures."""
    variables = ca.vertcat(*ca.symvar(value))
    if not variables.numel():
        return True
    slope = ca.Function("slope", [variables], [ca.jacobian(value, variables)])
    draws = np.random.default_rng(0).uniform(-1, 1, (_POSTURES, variables.numel()))
    slopes = np.array([np.asarray(slope(draw)) for draw in draws])
    return bool(np.abs(slopes).max() < _ROUNDING)


def _curve(curve: KnownTorque, x: Matrix) -> Matrix:
    """p(x): Horner's rule, or y_0 + Σ slope_i · (x clamped to segment i, less its start)."""
    if curve.polynomial:
        value = ca.SX(0)
        for coefficient in reversed(curve.polynomial):
            value = value * x + coefficient
        return value
    value = ca.SX(curve.torque[0])
    points = list(zip(curve.x, curve.torque, strict=True))
    for (a, y), (b, z) in pairwise(points):
        value = value + (z - y) / (b - a) * (ca.fmin(ca.fmax(x, a), b) - a)
    return value
