"""Logs of virtual walking robots without force sensors, computed by Pinocchio.

A slow gait: feet on the ground stand still, the base sways over them and turns, and the legs follow
by inverse kinematics. Forces of the feet are the least ones that the six equations of the base
need, and grow from zero after every touch-down. The log holds encoders, an IMU and what a law of
position and velocity commanded; the motors deliver it later, less friction and armature.
"""

from dataclasses import dataclass, field

import numpy as np
import pinocchio
from numpy.typing import NDArray

from tests.free_base_logs import Array

WORLD = pinocchio.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, slots=True)
class Gait:
    """Steps of a robot and its sensors.

    Attributes:
        feet: links of the feet, in the order of `swings`.
        contact: point of a contact in the frame of its link [m].
        swings: first and last phase of the swing of each foot.
        pose: joint positions of the stance by part of the joints' names [rad]; others are 0.
        is_point: whether feet transmit no moment.
        period_s, seconds, rate_hz: of a step of every foot, of the log.
        speed, lift: of the robot [m/s], of a foot above the ground [m].
        sway: sideways motion of the base [m].
        shift, turn: further motion of the base [m], [rad].
        joint: motion of joints that belong to no leg [rad].
        friction: largest dry friction over the effort limit of a joint; viscous per 10 rad/s.
        armature: largest [kg·m²].
        delays_s: smallest and largest.
        torque_noise: standard deviation over the effort limit.
        changed: entries of G in P' = R (1 + G) (1 + G)ᵀ Rᵀ of every body's pseudo-inertia
            P = R Rᵀ, so that errors of the URDF are relative to the size of the body.
    """

    feet: tuple[str, ...]
    contact: tuple[float, float, float]
    swings: tuple[tuple[float, float], ...]
    pose: dict[str, float] = field(default_factory=dict)
    is_point: bool = False
    period_s: float = 2.4
    seconds: float = 30.0
    rate_hz: float = 200.0
    speed: float = 0.06
    lift: float = 0.06
    sway: float = 0.035
    shift: float = 0.012
    turn: float = 0.08
    joint: float = 0.5
    friction: float = 0.03
    armature: float = 0.02
    delays_s: tuple[float, float] = (0.005, 0.015)
    torque_noise: float = 0.003
    changed: float = 0.1


GO2 = Gait(
    feet=("RL_calf", "FL_calf", "RR_calf", "FR_calf"),
    contact=(0.0, 0.0, -0.213),
    swings=((0.05, 0.22), (0.28, 0.45), (0.55, 0.72), (0.78, 0.95)),
    pose={"thigh": 0.8, "calf": -1.5},
    is_point=True,
)
G1 = Gait(
    feet=("left_ankle_roll_link", "right_ankle_roll_link"),
    contact=(0.03, 0.0, -0.03),
    swings=((0.12, 0.38), (0.62, 0.88)),
    pose={"hip_pitch": -0.4, "knee": 0.8, "ankle_pitch": -0.4},
    period_s=3.2,
    sway=0.125,
)
ENCODER, SPEED, GYRO, ACCELEROMETER, ATTITUDE = 1e-4, 0.01, 0.005, 0.05, 1e-3
"""Standard deviations of the sensors [rad, rad/s, rad/s, m/s², rad]."""
_RAMP_S = 0.1
"""Time within which the load of a foot grows."""
_FINE = 2
"""Instants of the computation per row of the log."""
_SINES = 3


@dataclass(frozen=True, slots=True)
class WalkingLog:
    """A log and the robot it is of.

    Attributes:
        arrays: of the NPZ.
        pi: of the simulated bodies, in Pinocchio's order.
        viscous, coulomb, armature: of the joints.
        delay_s: of the command.
        touching: (N, C) whether a foot is on the ground.
        feasible: share of the vertical forces of loaded feet that push.
    """

    arrays: dict[str, NDArray]
    pi: Array
    viscous: Array
    coulomb: Array
    armature: Array
    delay_s: float
    touching: NDArray[np.bool_]
    feasible: float


class _Base:
    """Motion of the base: a constant speed, a sway, and sines."""

    def __init__(self, gait: Gait, rng: np.random.Generator, height: float) -> None:
        self.gait, self.height = gait, height
        self.speed = rng.uniform(2.0, 9.0, (_SINES, 6))
        self.phase = rng.uniform(0, 2 * np.pi, (_SINES, 6))
        self.size = np.repeat([gait.shift, gait.turn], 3) / np.sqrt(_SINES)

    def at(self, t: Array, order: int) -> Array:
        """Position and rotation vector or their derivatives, (N, 6)."""
        angle = t[:, None, None] * self.speed + self.phase
        x = (self.size * self.speed**order * _wave(angle, order)).sum(axis=1)
        w = 2 * np.pi / self.gait.period_s
        for harmonic, size in ((1, 1.0), (3, 0.15)):
            rate = harmonic * w
            x[:, 1] -= self.gait.sway * size * rate**order * _wave(rate * t, order)
        x[:, 0] += self.gait.speed * (t if order == 0 else float(order == 1))
        if order == 0:
            x[:, 2] += self.height
        return np.asarray(x)

    def omega(self, t: Array) -> Array:
        """Angular velocity in axes of the base."""
        x, dx = self.at(t, 0)[:, 3:], self.at(t, 1)[:, 3:]
        return np.array([pinocchio.Jexp3(w) @ dw for w, dw in zip(x, dx, strict=True)])


def _wave(angle: Array, order: int) -> Array:
    return np.asarray((np.sin(angle), np.cos(angle), -np.sin(angle))[order])


def walking_log(urdf: str, gait: Gait, seed: int) -> WalkingLog:
    """A log of a walking robot whose bodies differ from those of the URDF.

    Args:
        urdf: text of the URDF.
        gait: steps and sensors.
        seed: of motion, bodies, friction and noise.

    Returns:
        The log without forces of the feet.
    """
    rng = np.random.default_rng(seed)
    model = pinocchio.buildModelFromXML(urdf, pinocchio.JointModelFreeFlyer())
    kinematic = model.copy()
    _change_bodies(model, gait.changed, rng)
    data, n = model.createData(), model.nv - 6
    limit = model.effortLimit[6:]
    coulomb = gait.friction * limit * rng.uniform(0.3, 1.0, n)
    viscous = gait.friction * limit / 10 * rng.uniform(0.3, 1.0, n)
    armature = gait.armature * rng.uniform(0.3, 1.0, n)
    step = 1 / (_FINE * gait.rate_hz)
    late = round(rng.uniform(*gait.delays_s) / step)
    t = np.arange(round(gait.seconds / step) + late) * step
    legs = _Legs(kinematic, gait)
    base = _Base(gait, rng, legs.height)
    x, dx, ddx = (base.at(t, order) for order in range(3))
    w = base.omega(t)
    alpha = (base.omega(t + 1e-4) - base.omega(t - 1e-4)) / 2e-4
    turns = np.array([pinocchio.exp3(each) for each in x[:, 3:]])
    v = np.einsum("nji,nj->ni", turns, dx[:, :3])
    dv = np.einsum("nji,nj->ni", turns, ddx[:, :3]) - np.cross(w, v)
    free = rng.uniform(1.5, 6.0, (_SINES, n)), rng.uniform(0, 2 * np.pi, (_SINES, n))
    q, dq, ddq, tau = (np.empty((len(t), n)) for _ in range(4))
    feet = [legs.foot(c, t) for c in range(len(gait.feet))]
    load = np.stack([each.load for each in feet], axis=1)
    state, pushing = legs.start(x[0], turns[0]), []
    for k in range(len(t)):
        state[:3], state[3:7] = x[k, :3], pinocchio.Quaternion(turns[k]).coeffs()
        rates, second = np.zeros(model.nv), np.zeros(model.nv)
        rates[:6], second[:6] = np.r_[v[k], w[k]], np.r_[dv[k], alpha[k]]
        for order, values in enumerate((state[7:], rates[6:], second[6:])):
            angle = t[k] * free[0] + free[1]
            wave = (gait.joint / np.sqrt(_SINES) * free[0] ** order * _wave(angle, order)).sum(0)
            values[legs.others] = wave[legs.others]
        jacobian = legs.follow(state, rates, second, feet, k)
        q[k], dq[k], ddq[k] = state[7:], rates[6:], second[6:]
        whole = pinocchio.rnea(model, data, state, rates, second).copy()
        rows = len(jacobian) // len(feet)
        weights = np.repeat(load[k], rows) * np.resize(np.repeat([1.0, 0.01], 3), len(jacobian))
        weighted = weights[:, None] * jacobian[:, :6]
        force = weighted @ np.linalg.solve(jacobian[:, :6].T @ weighted, whole[:6])
        tau[k] = whole[6:] - jacobian[:, 6:].T @ force
        vertical = force[2::rows][load[k] > 0.5]
        pushing.append(np.mean(vertical > 0))
    tau += viscous * dq + coulomb * np.tanh(dq / 0.02) + armature * ddq
    rows = slice(0, len(t) - late, _FINE)
    later = slice(late, None, _FINE)
    count = len(t[rows])
    place = np.array([0.02, 0.01, 0.05])

    def noise(size: float, width: int = n) -> Array:
        return size * rng.normal(size=(count, width))

    read, speed = q[rows] + noise(ENCODER), dq[rows] + noise(SPEED)
    command = tau[later] + limit * noise(gait.torque_noise)
    kp, kd = 4.0 * limit, 0.1 * limit
    origin = dv + np.cross(w, v) - np.einsum("nji,j->ni", turns, [0.0, 0.0, -9.81])
    felt = origin + np.cross(alpha, place) + np.cross(w, np.cross(w, place))
    tilt = np.array([pinocchio.exp3(each) for each in noise(ATTITUDE, 3)])
    rpy = np.array([pinocchio.rpy.matrixToRpy(each) for each in turns[rows] @ tilt])
    arrays = {
        "t": t[rows],
        "q": read,
        "dq": speed,
        "q_des": read + (command + kd * speed) / kp,
        "kp": kp,
        "kd": kd,
        "joints": np.array(list(model.names[2:])),
        "base_rpy": rpy,
        "imu_gyro": w[rows] + noise(GYRO, 3),
        "imu_acceleration": felt[rows] + noise(ACCELEROMETER, 3),
        "imu_position": place,
        "contact_links": np.array(gait.feet),
        "contact_position": np.tile(gait.contact, (len(gait.feet), 1)),
        "contact_kind": np.array("point" if gait.is_point else "surface"),
    }
    pi = np.concatenate([body.toDynamicParameters() for body in model.inertias[1:]])
    touching = load[rows] > 0
    feasible = float(np.mean(pushing))
    return WalkingLog(arrays, pi, viscous, coulomb, armature, late * step, touching, feasible)


def _change_bodies(model: pinocchio.Model, size: float, rng: np.random.Generator) -> None:
    """Change every body, in place."""
    for i in range(1, model.njoints):
        root = np.linalg.cholesky(model.inertias[i].toPseudoInertia().toMatrix())
        turn = root @ (np.eye(4) + size * rng.normal(size=(4, 4)))
        model.inertias[i] = pinocchio.Inertia.FromPseudoInertia(
            pinocchio.PseudoInertia.FromMatrix(turn @ turn.T)
        )


@dataclass(frozen=True, slots=True)
class _Foot:
    """Place of a contact with its derivatives, (N, 3) each, and its share of load (N,)."""

    place: tuple[Array, Array, Array]
    load: Array


class _Legs:
    """Inverse kinematics of the feet."""

    def __init__(self, model: pinocchio.Model, gait: Gait) -> None:
        self.model, self.data, self.gait = model, model.createData(), gait
        names = list(model.names[2:])
        pose = [next((v for k, v in gait.pose.items() if k in name), 0.0) for name in names]
        self.pose, offset = np.array(pose), pinocchio.SE3(np.eye(3), np.array(gait.contact))
        self.frames, self.joints = [], []
        for foot in gait.feet:
            joint = model.frames[model.getFrameId(foot, pinocchio.BODY)].parentJoint
            self.frames.append(
                model.addFrame(
                    pinocchio.Frame(f"contact {foot}", joint, offset, pinocchio.FrameType.OP_FRAME)
                )
            )
            path = [j for j in model.supports[joint] if j > 1]
            self.joints.append([model.idx_vs[j] for j in path])
        self.data = model.createData()
        legs = {v - 6 for each in self.joints for v in each}
        self.others = np.array([k for k in range(len(names)) if k not in legs], dtype=int)
        state = np.concatenate([np.zeros(6), [1.0], self.pose])
        pinocchio.framesForwardKinematics(model, self.data, state)
        self.first = np.array([self.data.oMf[f].translation for f in self.frames])
        self.height = -float(self.first[0, 2])
        self.first[:, 2] = 0.0

    def start(self, x: Array, turn: Array) -> Array:
        """Configuration near the first one."""
        return np.concatenate([x[:3], pinocchio.Quaternion(turn).coeffs(), self.pose])

    def foot(self, c: int, t: Array) -> _Foot:
        """Motion of a contact: stands, and swings by polynomials with continuous acceleration."""
        gait = self.gait
        first, last = (gait.period_s * phase for phase in gait.swings[c])
        cycle = np.floor((t - first) / gait.period_s)
        u = np.clip((t - first - cycle * gait.period_s) / (last - first), 0.0, 1.0)
        rate = 1 / (last - first)
        stride = gait.speed * gait.period_s
        forth = (
            10 * u**3 - 15 * u**4 + 6 * u**5,
            rate * (30 * u**2 - 60 * u**3 + 30 * u**4),
            rate**2 * (60 * u - 180 * u**2 + 120 * u**3),
        )
        bump = np.polynomial.Polynomial([0, 0, 0, 64, -192, 192, -64])
        place = []
        for order in range(3):
            lift = gait.lift * rate**order * (bump.deriv(order) if order else bump)(u)
            x = stride * forth[order]
            if order == 0:
                x = x + self.first[c, 0] + stride * cycle
            side = np.full(len(t), self.first[c, 1] if order == 0 else 0.0)
            place.append(np.stack([x, side, lift], axis=1))
        since = t - first - cycle * gait.period_s - (last - first)
        until = gait.period_s - (last - first) - since
        ramp = np.clip(np.minimum(since, until) / _RAMP_S, 0.0, 1.0)
        return _Foot((place[0], place[1], place[2]), ramp**2 * (3 - 2 * ramp))

    def follow(self, state: Array, rates: Array, second: Array, feet: list, k: int) -> Array:
        """Legs of the feet's motion, in place; returns the Jacobian of the contacts."""
        model, data = self.model, self.data
        size = 3 if self.gait.is_point else 6
        for _ in range(8):
            pinocchio.framesForwardKinematics(model, data, state)
            pinocchio.computeJointJacobians(model, data)
            worst = 0.0
            for c, frame in enumerate(self.frames):
                error = np.zeros(6)
                error[:3] = feet[c].place[0][k] - data.oMf[frame].translation
                error[3:] = pinocchio.log3(data.oMf[frame].rotation.T)
                error[3:] = data.oMf[frame].rotation @ error[3:]
                worst = max(worst, float(np.abs(error[:size]).max()))
                j = pinocchio.getFrameJacobian(model, data, frame, WORLD)[:size, self.joints[c]]
                state[np.array(self.joints[c]) + 1] += np.linalg.solve(j, error[:size])
            if worst < 1e-9:
                break
        else:
            raise ValueError("the feet are out of reach; lower the speed of the gait")
        pinocchio.forwardKinematics(model, data, state, rates, second)
        pinocchio.computeJointJacobians(model, data, state)
        pinocchio.updateFramePlacements(model, data)
        jacobians = []
        for c, frame in enumerate(self.frames):
            j = pinocchio.getFrameJacobian(model, data, frame, WORLD)[:size]
            jacobians.append(j)
            wanted = np.zeros(size)
            wanted[:3] = feet[c].place[1][k]
            own = self.joints[c]
            rates[own] = np.linalg.solve(j[:, own], wanted - j @ rates)
        pinocchio.forwardKinematics(model, data, state, rates, second)
        pinocchio.updateFramePlacements(model, data)
        for c, frame in enumerate(self.frames):
            felt = pinocchio.getFrameClassicalAcceleration(model, data, frame, WORLD).vector[:size]
            wanted = np.zeros(size)
            wanted[:3] = feet[c].place[2][k]
            own = self.joints[c]
            second[own] = np.linalg.solve(jacobians[c][:, own], wanted - felt)
        return np.vstack(jacobians)
