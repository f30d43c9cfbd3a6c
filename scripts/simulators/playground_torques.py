"""Torques of 1,000 environments of MJX by mjx.inverse; runs where playground is installed.

argv: folder of the files, file of states (q, dq, ddq), file of torques to write.
"""

import sys

import jax
import mujoco
import numpy as np
from mujoco import mjx

folder, states, target = sys.argv[1:]
sys.path.insert(0, folder)
from randomise_playground import COUNT, randomizer  # noqa: E402  written by symgen sample

model = mujoco.MjModel.from_xml_path(f"{folder}/model_0001.xml")
model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
device = mjx.put_model(model)
keys = jax.random.split(jax.random.PRNGKey(0), 1000)
batch, axes = randomizer(model)(device, keys)
if COUNT < 1000:
    sys.exit("expected 1,000 draws: symgen sample --count 1000")
# MuJoCo's dry friction is a soft constraint, which light joints do not saturate: compared as it is
friction = np.asarray(batch.dof_frictionloss)
batch = batch.tree_replace({"dof_frictionloss": 0.0 * batch.dof_frictionloss})


def torque(one, q, dq, ddq):
    """τ of one environment in one state."""
    data = mjx.make_data(one).replace(qpos=q, qvel=dq, qacc=ddq)
    return mjx.inverse(one, data).qfrc_inverse


every = jax.jit(jax.vmap(torque, in_axes=(axes, None, None, None)))
torques = []
with np.load(states) as file:
    for q, dq, ddq in zip(file["q"], file["dq"], file["ddq"], strict=True):
        torques.append(np.asarray(every(batch, q, dq, ddq)) + friction * np.sign(dq))
np.save(target, np.stack(torques))
