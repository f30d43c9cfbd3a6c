"""Engines of a virtual robot: MuJoCo, or the kernels where joints follow others.

MuJoCo gets the tree of the manifest, as an engine that is independent of the kernels:

    (M(q) + diag J) ddq + h(q, dq) = τ,   implicit in the velocity ("implicitfast")

Bodies have the mass, centre of mass and principal inertia of a given π, joints their armature J and
their range; there are no shapes, no actuators, no compensation of gravity. MuJoCo sorts joints
depth first: `Engine.places` maps the joints of the library to it.

Plants whose joints follow others take the compiled kernels in the independent joints:

    (M(q) + diag J + h D) (dq⁺ − dq) = h (τ − h(q, dq) − p(q) − D dq),   q⁺ = q + h dq⁺

M and the bias forces h(q, dq) are those of the mechanism, Gᵀ M_all G and so on; p are torques of
springs and curves of known stiffness, D the damping of the step. The step is MuJoCo's, the
equations are those of the kernels, so that such a log does not check them.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from runtime.common.optional import optional
from runtime.errors import SimulationError
from runtime.library import Array, Integers, Library
from runtime.library.manifest import JointFacts
from runtime.library.parameters import lam_parts, links
from runtime.simulation.plant import has_mechanism


class PlantEngine:
    """State of a plant in the order of its engine: q, dq, torques and damping of the next step.

    The arrays (n,) are to be written to [rad, m, rad/s, m/s, N·m, N, N·m·s/rad, N·s/m].
    """

    def __init__(self, name: str, step: float, places: Integers, state: tuple[Array, ...]) -> None:
        """Take name and version, step of the integrator [s], place of each joint of the library."""
        self.name, self.step_s, self.places = name, step, places
        self.q, self.dq, self.applied, self.damping = state

    def sorted(self, values: Array) -> Array:
        """Values (…, n) in the order of the engine from those of the library."""
        return np.ascontiguousarray(values[..., np.argsort(self.places)])

    def restored(self, values: Array) -> Array:
        """Values (…, n) in the order of the library from those of the engine."""
        return np.ascontiguousarray(values[..., self.places])


class Engine(PlantEngine):
    """MuJoCo's model and state of one robot."""

    def __init__(self, mujoco: Any, model: Any, places: Integers) -> None:
        """Take the Python package and a model of MuJoCo."""
        data = mujoco.MjData(model)
        self.mujoco, self.model, self.data = mujoco, model, data
        state = (data.qpos, data.qvel, data.qfrc_applied, model.dof_damping)
        super().__init__(f"mujoco {mujoco.__version__}", float(model.opt.timestep), places, state)

    def advance(self) -> None:
        """Move the state by one step under the applied torques and the damping."""
        self.mujoco.mj_step(self.model, self.data)

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torque of one state by MuJoCo, rotors included; everything in MuJoCo's order."""
        data = self.data
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        self.mujoco.mj_inverse(self.model, data)
        return np.array(data.qfrc_inverse)

    def mass_diagonal(self, q: Array) -> Array:
        """Diagonal of M(q) with the rotors, in MuJoCo's order."""
        data, n = self.data, self.model.nv
        data.qpos[:], data.qvel[:] = q, 0.0
        self.mujoco.mj_forward(self.model, data)
        columns = np.zeros((n, n))
        for unit, column in zip(np.eye(n), columns, strict=True):
            self.mujoco.mj_mulM(self.model, data, column, unit)
        return np.array(np.diagonal(columns))


def engine(
    lib: Library, pi: Array, rotor: ArrayLike = 0.0, step: float = 2.5e-4, ranges: bool = True
) -> Engine:
    """Build MuJoCo's model of a robot with given parameters."""
    if lib.manifest.coupling is not None or lib.manifest.loops:
        raise SimulationError(
            f"joints of '{lib.name}' follow others, which this model in MuJoCo has no equalities "
            "for; use runtime.simulation.plant_engine, or lock the joints when you build"
        )
    mujoco = optional("mujoco", "the virtual robot", "simulation", SimulationError)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = step
    spec.option.gravity = lib.manifest.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Divergence raises an error in this package; MuJoCo would reset the state silently.
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    inertia = np.broadcast_to(np.asarray(rotor, dtype=float), (lib.n_joints,))
    bodies: list[Any] = []
    parts = lib.manifest.joints, links(lib.lam_from_pi(pi)), inertia
    for joint, lam, armature in zip(*parts, strict=True):
        parent = spec.worldbody if joint.parent < 0 else bodies[joint.parent]
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, np.ravel(joint.rotation))
        body = parent.add_body(pos=joint.translation, quat=quaternion)
        bodies.append(body)
        _add_joint(mujoco, body, joint, float(armature), ranges)
        _set_inertia(mujoco, body, lam)
    try:
        model = spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise SimulationError(f"MuJoCo refuses the robot '{lib.name}': {reason}") from None
    places = np.array([model.joint(name).dofadr[0] for name in lib.joint_names])
    return Engine(mujoco, model, places)


def _add_joint(mujoco: Any, body: Any, joint: JointFacts, armature: float, ranges: bool) -> None:
    prismatic = joint.kind == "prismatic"
    kind = mujoco.mjtJoint.mjJNT_SLIDE if prismatic else mujoco.mjtJoint.mjJNT_HINGE
    made = body.add_joint(name=joint.name, type=kind, axis=joint.axis, armature=armature)
    made.limited = int(ranges and joint.lower is not None and joint.upper is not None)
    if made.limited:
        made.range = (joint.lower, joint.upper)


def _set_inertia(mujoco: Any, body: Any, lam: Array) -> None:
    """Set mass, centre and principal inertia from λ: m = e^μ, c, and R diag(…) Rᵀ about c."""
    log_mass, centre, rotation, axes = lam_parts(lam)
    a, b, c = axes**2
    angle = float(np.linalg.norm(rotation))
    quaternion = np.array([1.0, 0.0, 0.0, 0.0])
    if angle > 0:
        mujoco.mju_axisAngle2Quat(quaternion, rotation / angle, angle)
    body.mass = float(np.exp(log_mass))
    body.ipos = centre
    body.iquat = quaternion
    body.inertia = (b + c, c + a, a + b)
    body.explicitinertial = True


class ReducedEngine(PlantEngine):
    """A plant by the kernels, in the order of the library."""

    def __init__(self, lib: Library, pi: Array, rotor: ArrayLike, step: float) -> None:
        """A plant at rest at q = 0."""
        lib.lam_from_pi(pi)  # raises
        n = lib.n_joints
        self.lib, self.pi = lib, pi
        self.rotor = np.broadcast_to(np.asarray(rotor, dtype=float), (n,))
        super().__init__("symgen kernels", step, np.arange(n), tuple(np.zeros((4, n))))

    def advance(self) -> None:
        """Move the state by one step under the applied torques and the damping."""
        lib, h = self.lib, self.step_s
        lib.require_closed(self.q)
        inertia = self._mass(self.q) + np.diag(h * self.damping)
        bias = lib.bias_forces(self.q, self.dq, self.pi) + lib.known_torque(self.q)
        force = self.applied - bias - self.damping * self.dq
        try:
            self.dq += h * np.linalg.solve(inertia, force)
        except np.linalg.LinAlgError:
            raise SimulationError(
                f"the mass matrix of '{lib.name}' is singular, so its motion is not determined; "
                "give every moving link a mass, or rotor inertias"
            ) from None
        self.q += h * self.dq

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torque of one state, rotors, springs and curves included, (n,) [N·m, N]."""
        rigid = self.lib.inverse_dynamics(q, dq, ddq, self.pi)
        return np.asarray(rigid + self.rotor * ddq + self.lib.known_torque(q))

    def mass_diagonal(self, q: Array) -> Array:
        """Diagonal of M(q) + J, (n,) [kg·m², kg]."""
        return np.array(np.diagonal(self._mass(q)))

    def _mass(self, q: Array) -> Array:
        n = self.lib.n_joints
        return np.reshape(self.lib.mass_matrix(q, self.pi), (n, n)) + np.diag(self.rotor)


def plant_engine(
    lib: Library, pi: Array, rotor: ArrayLike = 0.0, step: float = 2.5e-4, ranges: bool = True
) -> Engine | ReducedEngine:
    """Engine of a robot with parameters (10 L,) and rotors (n,) [kg·m², kg]."""
    if has_mechanism(lib):
        return ReducedEngine(lib, pi, rotor, step)
    return engine(lib, pi, rotor, step, ranges)
