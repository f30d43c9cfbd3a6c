"""Kernels for the limits of a motion against Pinocchio and coal, and their derivatives."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import coal
import numpy as np
import pinocchio
import pytest

from runtime.errors import LibraryError, ShapeError
from runtime.library import Library, ProxyFacts, load
from tests.oracle import Array, pinocchio_model, random_states
from tests.taylor import assert_second_order, taylor_slope

STATES = 200
# Sums of some hundred terms of the size of the largest entry, each rounded to 1e-16; URDFs with
# twelve digits of π add 1e-12, as in test_dynamics.
ROUNDING = 1e-12
ROBOTS = ["fr3", "xarm7", "kinova_gen3", "tree", "gantry"]


@dataclass(frozen=True, slots=True)
class Reference:
    """A library, Pinocchio's reading of its URDF, and where its joints lie in Pinocchio's order."""

    lib: Library
    model: pinocchio.Model
    columns: Array
    state: tuple[Array, Array, Array, Array]

    def spread(self, rows: Array) -> Array:
        """(N, n) in Pinocchio's order."""
        out = np.empty_like(rows)
        out[:, self.columns] = rows
        return out


@pytest.fixture(scope="module", params=ROBOTS)
def reference(request: pytest.FixtureRequest, robot: Callable[[str], Library]) -> Reference:
    lib = robot(request.param)
    model = pinocchio_model(lib.urdf(), lib.gravity)
    columns = np.array([model.joints[model.getJointId(j)].idx_v for j in lib.joint_names])
    jerk = np.random.default_rng(7).normal(0, 20, (STATES, lib.n_joints))
    return Reference(lib, model, columns, (*random_states(lib.n_joints, STATES, 3), jerk))


def relative(ours: Array, theirs: Array) -> float:
    assert ours.shape == theirs.shape
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


def pinocchio_slopes(reference: Reference) -> tuple[Array, Array, Array, Array]:
    """τ, ∂τ/∂q, ∂τ/∂dq, M of Pinocchio's analytical derivatives."""
    data, pick = reference.model.createData(), np.ix_(reference.columns, reference.columns)
    slopes: list[list[Array]] = [[], [], [], []]
    states = zip(*(reference.spread(x) for x in reference.state[:3]), strict=True)
    for q, dq, ddq in states:
        pinocchio.computeRNEADerivatives(reference.model, data, q, dq, ddq)
        mass = np.triu(data.M) + np.triu(data.M, 1).T
        for rows, part in zip(slopes[1:], (data.dtau_dq, data.dtau_dv, mass), strict=True):
            rows.append(part[pick].copy())
        slopes[0].append(data.tau[reference.columns].copy())
    return tuple(np.array(rows) for rows in slopes)


def test_torque_derivatives(reference: Reference) -> None:
    """Oracle: Pinocchio's computeRNEADerivatives, entry by entry."""
    ours = reference.lib.torque_derivatives(*reference.state[:3], reference.lib.pi0)
    for mine, theirs in zip(ours, pinocchio_slopes(reference), strict=True):
        assert relative(mine, theirs) < ROUNDING


def test_torque_rate(reference: Reference) -> None:
    """Oracle: the chain rule with Pinocchio's derivatives, d τ/dt = τ_q dq + τ_dq ddq + M dddq."""
    _, dq, ddq, dddq = reference.state
    _, by_q, by_dq, mass = pinocchio_slopes(reference)
    terms = zip((by_q, by_dq, mass), (dq, ddq, dddq), strict=True)
    expected = sum(np.einsum("kij,kj->ki", slope, step) for slope, step in terms)
    assert (
        relative(reference.lib.torque_rate(*reference.state, reference.lib.pi0), expected)
        < ROUNDING
    )


def test_torque_with_rates(reference: Reference) -> None:
    """Oracle: the torque and its rate, which are Pinocchio's; Taylor of the rate along a motion."""
    lib, snap = reference.lib, np.random.default_rng(6).normal(0, 100, reference.state[0].shape)
    tau, dtau, ddtau = lib.torque_with_rates(*reference.state, snap, lib.pi0)
    assert relative(tau, lib.inverse_dynamics(*reference.state[:3], lib.pi0)) < ROUNDING
    assert relative(dtau, lib.torque_rate(*reference.state, lib.pi0)) < ROUNDING
    derivatives = [x[0] for x in (*reference.state, snap)]
    measured = taylor_slope(
        lambda y: lib.torque_rate(*np.split(y, 4), lib.pi0),
        np.concatenate(derivatives[:-1]),
        np.concatenate(derivatives[1:]),
        ddtau[0],
        largest=1e-2,
    )
    assert_second_order(measured, decades=3)  # a rate of 1e3 N·m/s rounds at 1e-13 of it


def test_torque_rate_jacobian(reference: Reference) -> None:
    """Derivative: Taylor in a random direction of all four; oracle: the last block is M."""
    lib, n = reference.lib, reference.lib.n_joints
    x = np.concatenate([part[0] for part in reference.state])
    jacobian = lib.torque_rate_jacobian(*(part[:2] for part in reference.state), lib.pi0)[1][0]
    assert jacobian.shape == (n, 4 * n)
    direction = np.random.default_rng(1).normal(size=4 * n)
    measured = taylor_slope(
        lambda y: lib.torque_rate(*np.split(y, 4), lib.pi0),
        x,
        direction,
        jacobian @ direction,
        largest=1e-1,
    )
    assert_second_order(measured, decades=4)  # a rate of 1e3 N·m/s rounds at 1e-13 of it
    mass = lib.mass_matrix(x[:n], lib.pi0)
    np.testing.assert_allclose(
        jacobian[:, 3 * n :], mass, rtol=0, atol=ROUNDING * np.abs(mass).max()
    )
    seed = np.random.default_rng(5).normal(size=n)
    gradient = lib.torque_rate_adjoint(*np.split(x, 4), lib.pi0, seed)
    assert relative(gradient, (seed @ jacobian).reshape(4, n)) < ROUNDING


def test_tip_motion(reference: Reference) -> None:
    """Oracle: Pinocchio's frame placement, velocity and Jacobian; Taylor for d v / d q."""
    lib, model = reference.lib, reference.model
    data, frame = model.createData(), model.getFrameId(lib.manifest.tip, pinocchio.BODY)
    q, dq = reference.state[:2]
    p, v, dp_dq, dv_dq = lib.tip_motion(q, dq)
    there = pinocchio.LOCAL_WORLD_ALIGNED
    for k, (x, y) in enumerate(zip(reference.spread(q), reference.spread(dq), strict=True)):
        pinocchio.forwardKinematics(model, data, x, y)
        pinocchio.updateFramePlacements(model, data)
        velocity = pinocchio.getFrameVelocity(model, data, frame, there).linear
        jacobian = pinocchio.computeFrameJacobian(model, data, x, frame, there)[
            :3, reference.columns
        ]
        # Lengths of a metre, velocities of ten.
        np.testing.assert_allclose(p[k], data.oMf[frame].translation, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(v[k], velocity, rtol=0, atol=10 * ROUNDING)
        np.testing.assert_allclose(dp_dq[k], jacobian, rtol=0, atol=ROUNDING)
    direction = np.random.default_rng(2).normal(size=lib.n_joints)
    if np.abs(dv_dq[0]).max() > 0:  # of an arm that only slides, v does not depend on q
        measured = taylor_slope(
            lambda x: lib.tip_motion(x, dq[0])[1], q[0], direction, dv_dq[0] @ direction
        )
        assert_second_order(measured)


def place(lib: Library, model: pinocchio.Model, q: Array) -> dict[str, coal.Transform3s]:
    """Pose of every proxy's capsule by Pinocchio's kinematics."""
    data = model.createData()
    pinocchio.forwardKinematics(model, data, q)
    poses = {}
    for proxy in lib.proxies:
        name = lib.joint_names[proxy.joint] if proxy.joint >= 0 else "universe"
        link = data.oMi[model.getJointId(name)]
        start, end = np.array(proxy.start), np.array(proxy.end)
        axis = end - start
        rotation = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix()
        pose = link * pinocchio.SE3(rotation, (start + end) / 2)
        poses[proxy.name] = coal.Transform3s(pose.rotation, pose.translation)
    return poses


def capsule(proxy: ProxyFacts) -> coal.Capsule:
    return coal.Capsule(proxy.radius, float(np.linalg.norm(np.subtract(proxy.end, proxy.start))))


def test_clearance(fr3: Library) -> None:
    """Oracle: coal's signed distance of the capsules, placed by Pinocchio."""
    model = pinocchio_model(fr3.urdf())
    q = random_states(7, STATES, 5)[0]
    ours, _ = fr3.clearance(q)
    shapes = {proxy.name: capsule(proxy) for proxy in fr3.proxies}
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    theirs = np.empty_like(ours)
    for k, x in enumerate(q):
        poses = place(fr3, model, x)
        for i, pair in enumerate(fr3.pairs):
            ends = [
                part for name in (pair.first, pair.second) for part in (shapes[name], poses[name])
            ]
            theirs[k, i] = coal.distance(*ends, request, coal.DistanceResult())
    assert (ours < 0).any()
    assert (ours > 0.1).any()
    # coal computes the distance of capsules in closed form; places of a metre are rounded.
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


def test_plane_clearance(fr3: Library) -> None:
    """Oracle: coal's distance of a capsule to a half-space, for slanted planes."""
    model = pinocchio_model(fr3.urdf())
    q = random_states(7, 50, 6)[0]
    normal = np.array([0.48, -0.6, 0.64])
    ground = coal.Halfspace(normal, -0.1)
    ours, _ = fr3.plane_clearance(q, [*normal, -0.1])
    moving = [proxy for proxy in fr3.proxies if proxy.joint >= 0]
    assert tuple(proxy.name for proxy in moving) == fr3.moving_proxies
    request, still = coal.DistanceRequest(), coal.Transform3s()
    request.enable_signed_distance = True
    for k, x in enumerate(q):
        poses = place(fr3, model, x)
        theirs = [
            coal.distance(capsule(p), poses[p.name], ground, still, request, coal.DistanceResult())
            for p in moving
        ]
        np.testing.assert_allclose(ours[k], theirs, rtol=0, atol=1e-9)  # as above


@pytest.mark.parametrize("kernel", ["clearance", "plane_clearance"])
def test_gradients_of_distances(fr3: Library, kernel: str) -> None:
    """Derivative: every row by Taylor, from several postures, the first one home."""
    more = [[0.0, 0.6, 0.8, 0.1]] if kernel == "plane_clearance" else []
    call = getattr(fr3, kernel)
    rng = np.random.default_rng(4)
    for q in (fr3.home, *random_states(7, 3, 8)[0]):
        direction, *others = rng.normal(size=(3, 7))
        distance, jacobian = call(q, *more)
        for row in range(len(distance)):
            slope = jacobian[row] @ direction
            if np.abs(jacobian[row]).max() < 1e-3:
                # A capsule that turns about its own axis, up to its grain of 0.1 mm: the remainder
                # is at most h²/2 of such a radius and drowns in rounding.
                step = call(q + 1e-3 * direction, *more)[0][row] - distance[row]
                assert step == pytest.approx(1e-3 * slope, abs=1e-9)
                continue
            # Steps below 1e-2: closest points that come to an end of a segment bend the second
            # derivative; from there on distances of a metre round at 1e-16, which leaves 3 decades
            # in the direction of three that bends the distance most against its third derivative.
            measured = [
                taylor_slope(
                    lambda x, row=row: call(x, *more)[0][row], q, v, jacobian[row] @ v, largest=1e-2
                )
                for v in (direction, *others)
            ]
            assert_second_order(max(measured, key=lambda m: m.decades), decades=3)


def test_robots_without_proxies_say_so(tiny_built: Path) -> None:
    """Property: one sentence that names the command."""
    tiny = load(tiny_built)
    assert tiny.proxies == tiny.pairs == tiny.moving_proxies == ()
    for call in (lambda: tiny.clearance([0.0]), lambda: tiny.plane_clearance([0.0], [0, 0, 1, 0])):
        with pytest.raises(LibraryError, match="python -m symgen proxies"):
            call()


def test_planes_need_a_unit_normal(fr3: Library) -> None:
    """Property: a plane that is none is refused."""
    for plane in ([0, 0, 2, 0], [0, 0, 1], [0, 0, np.nan, 0], [0, 0, 1, np.nan]):
        with pytest.raises(ShapeError, match="unit normal"):
            fr3.plane_clearance(fr3.home, plane)


def test_braking_is_the_manufacturers_limit(fr3: Library) -> None:
    """Oracle: the convex form bounds dq where libfranka's square root does, at any q.

    Numbers of the first, fourth and sixth joint from rate_limiting.h, written as there.
    """
    b = fr3.braking
    assert b is not None
    rng = np.random.default_rng(9)
    limits = fr3.limits()
    for q in rng.uniform(limits["lower"], limits["upper"], (50, 7)):
        upper = {
            0: max(0.0, -0.30 + np.sqrt(max(0.0, 12.0 * (2.75010 - q[0])))),
            3: max(0.0, -0.30 + np.sqrt(max(0.0, 8.00 * (-0.1458 - q[3])))),
            5: max(0.0, -0.35 + np.sqrt(max(0.0, 11.0 * (4.52050 - q[5])))),
        }
        lower = {
            0: min(0.0, 0.30 - np.sqrt(max(0.0, 12.0 * (2.750100 + q[0])))),
            3: min(0.0, 0.30 - np.sqrt(max(0.0, 8.00 * (3.048100 + q[3])))),
            5: min(0.0, 0.35 - np.sqrt(max(0.0, 11.0 * (-0.54092 + q[5])))),
        }
        # On the boundary both sides agree to rounding of numbers of about ten.
        for j, dq in upper.items():
            if dq > 0:
                assert (dq + b.c[j]) ** 2 == pytest.approx(b.k[j] * (b.upper[j] - q[j]), abs=1e-12)
        for j, dq in lower.items():
            if dq < 0:
                assert (b.c[j] - dq) ** 2 == pytest.approx(b.k[j] * (q[j] - b.lower[j]), abs=1e-12)
    assert limits["torque_rate"].tolist() == [1000.0] * 7
    assert limits["tip_speed"] == 3.0
