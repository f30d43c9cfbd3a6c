"""Torques of 1,000 environments of mjlab by MuJoCo Warp on the CPU; runs where mjlab is installed.

argv: folder of the files, file of states (q, dq, ddq), file of torques to write.
"""

import sys
from types import SimpleNamespace

import mujoco
import mujoco_warp
import numpy as np
import torch
from mjlab.entity import EntityCfg
from mjlab.scene import Scene, SceneCfg
from mjlab.sim import Simulation, SimulationCfg

folder, states, target = sys.argv[1:]
sys.path.insert(0, folder)
from randomise_mjlab import COUNT, randomize  # noqa: E402  written by symgen sample

ENVIRONMENTS = 1000
if COUNT < ENVIRONMENTS:
    sys.exit("expected 1,000 draws: symgen sample --count 1000")
robot = EntityCfg(spec_fn=lambda: mujoco.MjSpec.from_file(f"{folder}/model_0001.xml"))
scene = Scene(SceneCfg(num_envs=ENVIRONMENTS, entities={"robot": robot}), "cpu")
model = scene.compile()
sim = Simulation(ENVIRONMENTS, SimulationCfg(), model, "cpu")
scene.initialize(model, sim.model, sim.data)
sim.expand_model_fields(randomize.model_fields)
env = SimpleNamespace(
    scene=scene, sim=sim, num_envs=ENVIRONMENTS, device="cpu", physics_dt=model.opt.timestep
)
randomize(env, None)
sim.recompute_constants(randomize.recompute)
# MuJoCo's dry friction is a soft constraint, which light joints do not saturate: compared as it is
friction = sim.model.dof_frictionloss[:].cpu().numpy().copy()
sim.model.dof_frictionloss[:] = 0.0
torques = []
with np.load(states) as file:
    for q, dq, ddq in zip(file["q"], file["dq"], file["ddq"], strict=True):
        for field, value in (("qpos", q), ("qvel", dq), ("qacc", ddq)):
            getattr(sim.data, field)[:] = torch.as_tensor(value, dtype=torch.float32)
        mujoco_warp.inverse(sim.wp_model, sim.wp_data)
        torques.append(sim.data.qfrc_inverse[:].cpu().numpy() + friction * np.sign(dq))
np.save(target, np.stack(torques))
