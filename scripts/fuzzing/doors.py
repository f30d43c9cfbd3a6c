"""The doors through which files come: a good file for each, and the function that reads it."""

import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import runtime
from runtime.excitation import Trajectory
from runtime.library import Library, load
from runtime.library.manifest import read_manifest
from runtime.library.recipe import read_recipe
from runtime.loop import read_loop
from runtime.prior_file import read_prior
from runtime.recording import Recording, load_recipe, read_recording, write_recording
from runtime.trajectory_file import read_trajectory, write_motion

URDF = Path(__file__).parents[2] / "symgen" / "robots" / "fr3.urdf"
PRIOR = """trust = "cad"
total_mass = [1.0, 30.0]

[link.{link}]
mass = [0.5, 2.5]
com_box = [[-0.3, -0.3, -0.3], [0.3, 0.3, 0.3]]
com_hull = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]
symmetry = ["xz"]
"""
RECIPE = """joints = {joints}
[time]
file = "log.csv"
column = "t"
unit = "s"
[position]
file = "log.csv"
columns = {q}
unit = "rad"
[torque]
file = "log.csv"
columns = {tau}
unit = "N*m"
sign = 1
[gear]
matrix = {gear}
[preparation]
filter = "butterworth"
cutoff_hz = 10.0
rate_hz = 50.0
[friction]
columns = ["viscous", "coulomb", "offset"]
[split]
train = [0.0, 0.48]
validation = [0.48, 0.6]
test = [0.6, 1.0]
"""
LOOP = """[controller]
stiffness = 225.0
damping = 30.0
rotor = {rotor}
rate_hz = 1000.0
[reference]
trajectory = "motion.json"
start = 0.0
"""


@dataclass(frozen=True, slots=True)
class Door:
    """The file that is damaged, and what reads it: (folder of the file, the robot) → anything."""

    file: str
    read: Callable[[Path, Library], Any]


def _log(file: str) -> Door:
    return Door(file, lambda folder, _: read_recording(folder / file))


def _urdf(folder: Path, _: Library) -> None:
    from symgen.chain import read_chain

    read_chain((folder / "robot.urdf").read_text(encoding="utf-8", errors="replace"))


def _inspected(folder: Path, _: Library) -> None:
    from symgen.inspect import inspect_file

    inspect_file(folder / "robot.urdf")


def _robot(folder: Path, _: Library) -> None:
    from symgen.config import read_config

    read_config(folder / "robot.toml")


def _request(folder: Path, _: Library) -> None:
    from symgen.request import request_from_folder

    request_from_folder(folder)


DOORS = {
    "csv": _log("log.csv"),
    "npz": _log("log.npz"),
    "parquet": _log("log.parquet"),
    "mcap": _log("log.mcap"),
    "urdf": Door("robot.urdf", _urdf),
    "inspect": Door("robot.urdf", _inspected),
    "recipe": Door("recipe.toml", lambda folder, _: load_recipe(folder / "recipe.toml")),
    "folder": Door("recipe.toml", lambda folder, _: read_recording(folder)),
    "robot": Door("robot.toml", _robot),
    "prior": Door("prior.toml", lambda folder, lib: read_prior(folder / "prior.toml", lib)),
    "loop": Door("loop.toml", lambda folder, lib: read_loop(folder / "loop.toml", lib)),
    "trajectory": Door("motion.json", lambda f, lib: read_trajectory(f / "motion.json", lib)),
    "manifest": Door("manifest.json", lambda f, _: read_manifest(f / "manifest.json")),
    "library": Door("manifest.json", lambda folder, _: load(folder)),
    "request": Door("manifest.json", _request),
    "compile": Door("compile.json", lambda folder, _: read_recipe(folder)),
    "build": Door("build.json", lambda folder, _: load(folder)),
}


def furnish(kind: str, folder: Path, lib: Library) -> None:
    """Write a good file of a kind, and what belongs beside it."""
    folder.mkdir(parents=True)
    if kind in {"library", "request", "manifest", "compile", "build"}:
        shutil.copytree(lib.folder, folder, dirs_exist_ok=True)
        (folder / f"{folder.name}.urdf").write_text(lib.urdf())  # the folder's name is the robot's
    elif kind in {"urdf", "inspect"}:
        (folder / "robot.urdf").write_text(lib.urdf())
    elif kind == "robot":
        shutil.copy(URDF.with_suffix(".toml"), folder / "robot.toml")
    elif kind == "prior":
        (folder / "prior.toml").write_text(PRIOR.format(link=lib.link_names[-1]))
    elif kind in {"loop", "trajectory"}:
        coefficients = 0.1 * np.ones((lib.n_joints, 4))
        write_motion(Trajectory(lib.home, coefficients, 5.0), lib, folder / "motion.json")
        (folder / "loop.toml").write_text(LOOP.format(rotor=[0.1] * lib.n_joints))
    elif kind == "mcap":
        (folder / "log.mcap").write_bytes(_mcap(_motion(lib)))
    elif kind in {"recipe", "folder"}:
        names = range(1, lib.n_joints + 1)
        text = RECIPE.format(
            joints=json.dumps(list(lib.joint_names)),
            q=[f"q{i}" for i in names],
            tau=[f"tau{i}" for i in names],
            gear=np.eye(lib.n_joints).tolist(),
        )
        (folder / "recipe.toml").write_text(text)
        write_recording(_motion(lib), folder / "log.csv")
    else:
        write_recording(_motion(lib), folder / DOORS[kind].file)


def _motion(lib: Library) -> Recording:
    t = np.arange(60) * 0.01
    phase = t[:, None] * np.linspace(1, 3, lib.n_joints)
    q = lib.home + 0.2 * np.sin(phase)
    return runtime.Recording(t=t, q=q, tau=np.cos(3 * q), name="log")


def _mcap(log: Recording) -> bytes:
    from mcap.writer import Writer

    out = io.BytesIO()
    writer = Writer(out, chunk_size=4096)
    writer.start()
    schema = writer.register_schema("sensor_msgs/msg/JointState", "jsonschema", b"{}")
    channel = writer.register_channel("/joint_states", "json", schema)
    names = [f"joint{i}" for i in range(log.q.shape[1])]
    for t, q, tau in zip(log.t, log.q, log.tau, strict=True):
        stamp = {"sec": 1_700_000_000, "nanosec": round(1e9 * t)}
        told = {"header": {"stamp": stamp}, "name": names, "position": [*q], "effort": [*tau]}
        nanos = 1_700_000_000 * 10**9 + stamp["nanosec"]
        writer.add_message(channel, nanos, json.dumps(told).encode(), nanos)
    writer.finish()
    return out.getvalue()
