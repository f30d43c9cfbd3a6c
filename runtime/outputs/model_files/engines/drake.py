"""Read SDF by Drake, which has the parser of Gazebo (libsdformat) and an inverse dynamics."""

from importlib.metadata import version
from typing import Any

import numpy as np

from runtime.library import Library
from runtime.outputs.model_files.engines.answer import STATES, Reloaded, Unreadable, random_states

INSTALL = "pip install 'symgen[export]'"


def reload(text: str, lib: Library, count: int = STATES) -> Reloaded | None:
    """Read an SDF by libsdformat and Drake."""
    try:
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant
        from pydrake.multibody.tree import MultibodyForces

        engine = f"Drake {version('drake')}"
    except ImportError:
        return None
    plant: Any = MultibodyPlant(0.0)
    try:
        Parser(plant).AddModelsFromString(text, "sdf")
        plant.mutable_gravity_field().set_gravity_vector(lib.gravity)
        plant.Finalize()
        joints = [plant.GetJointByName(name) for name in lib.joint_names]
    except (RuntimeError, ValueError) as error:
        raise Unreadable(error) from None
    if plant.num_velocities() != lib.n_joints or any(j.num_velocities() != 1 for j in joints):
        raise Unreadable(f"expected the joints {', '.join(lib.joint_names)}, got others")
    at = [joint.velocity_start() for joint in joints]
    context, states = plant.CreateDefaultContext(), random_states(lib, count)
    tau = np.empty_like(states[0])
    forces = MultibodyForces(plant)
    for k, rows in enumerate(zip(*states, strict=True)):
        q, dq, ddq = (row[np.argsort(at)] for row in rows)
        plant.SetPositions(context, q)
        plant.SetVelocities(context, dq)
        plant.CalcForceElementsContribution(context, forces)
        tau[k] = plant.CalcInverseDynamics(context, ddq, forces)[at]
    damping = np.array([joint.default_damping_vector()[0] for joint in joints])
    return Reloaded(engine, tau - damping * states[1], damping=damping)
