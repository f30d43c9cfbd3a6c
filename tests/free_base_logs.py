"""Logs of virtual robots with a free base, computed by Pinocchio: motion, torques, wrenches."""

from dataclasses import dataclass

import numpy as np
import pinocchio
from numpy.typing import NDArray

from runtime.recording import Split

Array = NDArray[np.float64]
HALF = Split((0.0, 0.4), (0.4, 0.5), (0.5, 1.0))
"""The first half trains, by methods that nothing is tuned for."""


@dataclass(frozen=True, slots=True)
class VirtualLog:
    """A log and the robot it is of.

    Attributes:
        arrays: of the NPZ.
        pi: of the simulated bodies, in Pinocchio's order.
        feasible: share of the torques that are within the effort limits of the URDF.
    """

    arrays: dict[str, Array]
    pi: Array
    feasible: float


@dataclass(frozen=True, slots=True)
class Experiment:
    """Motion and sensors of a log. Base and joints follow sums of three sines.

    Attributes:
        count, rate_hz: number of instants, and their rate [Hz].
        position, rotation: size of the motion of the base [m], [rad].
        joint: size of the motion of a joint about zero [rad]; None for the middle of its limits
            and 95 % of their range.
        base_speed, joint_speed: largest frequencies of the sines [rad/s].
        changed: entries of G in P' = (1 + G) P (1 + G)ᵀ of every body's pseudo-inertia.
        torque_noise: standard deviation over the effort limit of the joint.
        force_noise, moment_noise: standard deviations of the wrenches [N], [N·m].
    """

    count: int = 600
    rate_hz: float = 100.0
    position: float = 0.05
    rotation: float = 0.3
    joint: float | None = 0.4
    base_speed: float = 9.0
    joint_speed: float = 9.0
    changed: float = 0.1
    torque_noise: float = 0.0
    force_noise: float = 0.0
    moment_noise: float = 0.0


def virtual_log(
    urdf: str, feet: tuple[str, ...], seed: int, experiment: Experiment | None = None
) -> VirtualLog:
    """A log of a robot whose bodies differ from those of the URDF.

    The wrenches of the feet are sines beside what the six equations of the base need, which is
    spread over the feet with the least sum of squares.

    Args:
        urdf: text of the URDF.
        feet: names of links in contact.
        seed: of motion, bodies and noise.
        experiment: motion and sensors.

    Returns:
        The log, whose motion is exact.
    """
    experiment = experiment or Experiment()
    rng = np.random.default_rng(seed)
    model = pinocchio.buildModelFromXML(urdf, pinocchio.JointModelFreeFlyer())
    for i in range(1, model.njoints):
        pseudo = model.inertias[i].toPseudoInertia().toMatrix()
        turn = np.eye(4) + experiment.changed * rng.normal(size=(4, 4)) * _LENGTHS
        model.inertias[i] = pinocchio.Inertia.FromPseudoInertia(
            pinocchio.PseudoInertia.FromMatrix(turn @ pseudo @ turn.T)
        )
    data, n = model.createData(), model.nv - 6
    t = np.arange(experiment.count) / experiment.rate_hz
    middle, reach = _joint_motion(model, experiment.joint)
    size = np.concatenate([[experiment.position] * 3, [experiment.rotation] * 3, reach])
    fastest = np.concatenate([[experiment.base_speed] * 6, [experiment.joint_speed] * n])
    speed = rng.uniform(1.5, fastest, (3, 6 + n))
    phase = rng.uniform(0, 2 * np.pi, (3, 6 + n))
    scale = size / np.sqrt(3) * np.ones((3, 1))

    def course(at: Array, order: int) -> Array:
        angle = at[:, None, None] * speed + phase
        wave = (np.sin(angle), np.cos(angle), -np.sin(angle))[order]
        return np.asarray((scale * speed**order * wave).sum(axis=1))

    def omega(at: Array) -> Array:
        x, dx = course(at, 0)[:, 3:6], course(at, 1)[:, 3:6]
        return np.array([pinocchio.Jexp3(w) @ dw for w, dw in zip(x, dx, strict=True)])

    x, dx, ddx = (course(t, order) for order in range(3))
    x[:, 6:] += middle
    step = 1e-4  # central difference: error of step² and of rounding over step, both 1e-8
    alpha = (omega(t + step) - omega(t - step)) / (2 * step)
    turns = [pinocchio.exp3(w) for w in x[:, 3:6]]
    w = omega(t)
    v = np.array([r.T @ u for r, u in zip(turns, dx[:, :3], strict=True)])
    dv = np.array([r.T @ u for r, u in zip(turns, ddx[:, :3], strict=True)]) - np.cross(w, v)
    pose = np.array(
        [
            np.concatenate([p, pinocchio.Quaternion(r).coeffs()])
            for p, r in zip(x[:, :3], turns, strict=True)
        ]
    )
    wrench = _wrenches(rng, t, len(feet))
    tau = np.empty((len(t), n))
    ids = [model.getFrameId(foot, pinocchio.BODY) for foot in feet]
    for k in range(len(t)):
        state = np.concatenate([pose[k], x[k, 6:]])
        rates = np.concatenate([v[k], w[k], dx[k, 6:]])
        whole = pinocchio.rnea(
            model, data, state, rates, np.concatenate([dv[k], alpha[k], ddx[k, 6:]])
        ).copy()
        pinocchio.computeJointJacobians(model, data, state)
        pinocchio.updateFramePlacements(model, data)
        jacobians = np.vstack(
            [pinocchio.getFrameJacobian(model, data, i, pinocchio.LOCAL) for i in ids]
        )
        wrench[k] += _least(jacobians[:, :6], whole[:6] - jacobians[:, :6].T @ wrench[k].ravel())
        tau[k] = whole[6:] - jacobians[:, 6:].T @ wrench[k].ravel()
    errors = np.repeat([experiment.force_noise, experiment.moment_noise], 3)
    arrays = {
        "t": t,
        "q": x[:, 6:],
        "dq": dx[:, 6:],
        "ddq": ddx[:, 6:],
        "tau": tau + experiment.torque_noise * model.effortLimit[6:] * rng.normal(size=tau.shape),
        "joints": np.array(list(model.names[2:])),
        "base_pose": pose,
        "base_twist": np.hstack([v, w]),
        "base_acceleration": np.hstack([dv, alpha]),
        "contact_links": np.array(feet),
        "contact_wrench": wrench + errors * rng.normal(size=wrench.shape),
    }
    pi = np.concatenate([body.toDynamicParameters() for body in model.inertias[1:]])
    feasible = float(np.mean(np.abs(tau) <= model.effortLimit[6:]))
    return VirtualLog(arrays, pi, feasible)


_LENGTHS = np.array([[1, 1, 1, 0.1], [1, 1, 1, 0.1], [1, 1, 1, 0.1], [0.1, 0.1, 0.1, 1]])
"""Entries of G: m beside the first moments, 1/m beside the mass, as of a decimetre."""
_LEVER = np.repeat([1.0, 0.1], 3)
"""Newtons, and newton metres that count as much as ten newtons each."""


def _joint_motion(model: pinocchio.Model, size: float | None) -> tuple[Array, Array]:
    """Middle and size of the motion of the joints, (n,) each [rad]."""
    n = model.nv - 6
    if size is not None:
        return np.zeros(n), np.full(n, size)
    low, high = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
    # Three sines of size / √3 reach √3 size.
    return (low + high) / 2, 0.95 * (high - low) / 2 / np.sqrt(3)


def _least(base: Array, force: Array) -> Array:
    """Wrenches w (C, 6) with J_bᵀ w = force and the least Σ f² + (10 m)², J_b (6 C, 6)."""
    weights = np.tile(_LEVER, len(base) // 6) ** 2
    weighted = weights[:, None] * base
    return np.asarray(weighted @ np.linalg.solve(base.T @ weighted, force)).reshape(-1, 6)


def _wrenches(rng: np.random.Generator, t: Array, feet: int) -> Array:
    """Sines of 20 N and 2 N·m."""
    speed, phase = rng.uniform(1, 8, (feet, 6)), rng.uniform(0, 2 * np.pi, (feet, 6))
    size = np.repeat([20.0, 2.0], 3)
    return size * np.sin(t[:, None, None] * speed + phase)
