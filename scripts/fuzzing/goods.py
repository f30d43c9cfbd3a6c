"""Good files of every kind, for one robot, each in an empty folder."""

import gzip
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tomli_w

from runtime.common.files import write_json
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import write_motion
from runtime.experiments.storage import CONFIG, write_outcome
from runtime.experiments.study import Study, StudyOutcome, View
from runtime.identification.result_file import write_result
from runtime.identification.single_log import identify_recording
from runtime.identification.statistics_file import statistics_of, write_statistics
from runtime.library import Library
from runtime.monitoring.fleet.fleet_prior import fit_fleet, fit_friction, prior_text
from runtime.monitoring.fleet.gather import gather
from runtime.recording import Friction, Preparation, Recording, write_recording
from runtime.simulation import Controller, settings_of
from runtime.simulation.closed_loop import write_controller
from scripts.fuzzing import bags
from tests.symgen.sources.test_sdf import LOOP

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
BOX = 'mass = 1.5\ncom = [0.01, 0.02, 0.1]\nsize = [0.1, 0.1, 0.2]\nlink = "{link}"\n'
MJCF = """<mujoco model="arm">
 <compiler angle="radian" autolimits="true"/>
 <option gravity="0 0 -9.81"/>
 <default><joint damping="0.1"/><geom type="capsule" density="900"/></default>
 <asset><material name="grey" rgba="0.5 0.5 0.5 1"/></asset>
 <worldbody>
  <body name="upper" pos="0 0 0.3">
   <joint name="j1" axis="0 0 1" range="-2 2" armature="0.01" frictionloss="0.2"/>
   <inertial pos="0 0 0.1" mass="2" diaginertia="0.02 0.02 0.004"/>
   <geom name="g1" size="0.04" fromto="0 0 0 0 0 0.3" material="grey"/>
   <body name="lower" pos="0 0 0.3" quat="0.7071 0.7071 0 0">
    <joint name="j2" type="hinge" axis="0 1 0" range="-1.5 1.5"/>
    <inertial pos="0.02 0 0.1" mass="1" fullinertia="0.01 0.01 0.002 0 0.0001 0"/>
    <geom name="g2" type="box" size="0.03 0.03 0.1"/>
    <body name="rail" pos="0 0 0.2"><joint name="j3" type="slide"/><geom size="0.02 0.05"/></body>
   </body>
  </body>
 </worldbody>
 <actuator><motor name="m1" joint="j1" gear="100"/></actuator>
 <sensor><jointpos joint="j1"/></sensor>
</mujoco>
"""
MECHANISM = """independent = []
[[spring]]
name = "one"
joint = "{joint}"
rest = 0.1
stiffness = 5.0
[[spring]]
name = "unknown"
of = {"{joint}" = 1.0}
[[known_torque]]
joint = "{joint}"
x = [-1.0, 0.0, 1.0]
torque = [0.5, 0.0, -0.5]
[[friction]]
name = "motor"
of = {"{joint}" = 100.0}
"""
XACRO = """<?xml version="1.0"?>
<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="mass" default="1.5"/>
<xacro:property name="length" value="${0.2 + 0.1}"/>
<xacro:property name="box" value="${dict(x=0.01, y=0.02, z=0.02)}"/>
<xacro:macro name="rod" params="name parent mass:=1.0 *origin">
<joint name="${name}_joint" type="revolute"><xacro:insert_block name="origin"/>
<parent link="${parent}"/><child link="${name}"/><axis xyz="0 1 0"/>
<limit lower="${-pi/2}" upper="${pi/2}" velocity="3" effort="10"/></joint>
<link name="${name}"><inertial><origin xyz="0 0 ${length/2}"/><mass value="${mass}"/>
<inertia ixx="${box['x']}" ixy="0" ixz="0" iyy="${box['y']}" iyz="0" izz="${box['z']}"/></inertial>
</link></xacro:macro>
<link name="base"/>
<xacro:rod name="upper" parent="base" mass="$(arg mass)"><origin xyz="0 0 0.5"/></xacro:rod>
<xacro:if value="${length > 0.1}">
<xacro:rod name="lower" parent="upper"><origin xyz="0 0 ${length}"/></xacro:rod></xacro:if>
<xacro:unless value="true"><link name="none"/></xacro:unless>
</robot>"""
"""Macros, blocks, conditions and expressions of xacro."""
OPTIONS = {
    command: dict(each.split() for each in options.split(", "))
    for command, options in {
        "identify": "--cutoff 10, --settings=rate 50, --settings=coulomb_speed 0.02, "
        "--split 0.5,0.7, --settings=seed 1, --friction viscous,coulomb, --method ols",
        "excite": "--duration 3, --settings=harmonics 2, --settings=seed 1, --noise 0.05, "
        "--settings=log_rate 100, --settings=export_rate 100, --speed 50, --settings=starts 1",
        "simulate": "--settings=perturb 0.05, --settings=control_rate 100, "
        "--settings=torque_noise 0.05, --settings=viscous 0.1, --settings=coulomb 0.1, "
        "--settings=rotor 0.1, --settings=keep_every 2",
        "predict": "--noise 0.05, --settings=log_rate 100, --settings=friction viscous",
    }.items()
}
"""Options with numbers, by command."""
MARK = "ab" * 32
ROOT = Path(__file__).parents[2]
Furnish = Callable[[Path, Library], None]


def motion(lib: Library, rows: int = 60) -> Recording:
    """Log of a motion with the torque of the URDF and noise."""
    t = np.arange(rows) * 0.01
    phase = 2 * t[:, None] * np.linspace(1, 3, lib.n_joints)
    q, rates = lib.home + 0.2 * np.sin(phase), 2 * np.linspace(1, 3, lib.n_joints)
    dq, ddq = 0.2 * rates * np.cos(phase), -0.2 * rates**2 * np.sin(phase)
    noise = np.random.default_rng(0).normal(scale=0.05, size=q.shape)
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + noise
    return Recording(t=t, q=q, tau=tau, name="log")


def text(file: str, content: str) -> Furnish:
    """A document; {link} and {joint} are its last link and first joint of the robot."""

    def furnish(folder: Path, lib: Library) -> None:
        named = content.replace("{link}", lib.link_names[-1]).replace("{joint}", lib.joint_names[0])
        (folder / file).write_text(named)
        (folder / "robot.urdf").write_text(lib.urdf())

    return furnish


prior = text("prior.toml", PRIOR)
mjcf, sdf = text("robot.xml", MJCF), text("robot.sdf", LOOP)
xacro, mechanism = text("robot.xacro", XACRO), text("mechanism.toml", MECHANISM)
robot = text("robot.toml", (ROOT / "symgen/robots/fr3.toml").read_text())
_BODY = {"mass": 1.0, "com": [0.0, 0.0, 0.1], "inertia": [0.01, 0.01, 0.01, 0.0, 0.0, 0.0]}
_ROW = {"a": 0.0, "alpha": 0.0, "d": 0.0, "theta": 0.0} | _BODY
_ROWS = [
    _ROW | {"name": "upper", "parent": "base", "d": 0.3, "joint": "q1"},
    _ROW | {"name": "lower", "parent": "upper", "a": 0.2, "alpha": 1.57, "joint": "q2"},
    _ROW | {"name": "rail", "parent": "lower", "a": 0.1, "kind": "prismatic", "of": {"q1": 0.5}},
]
dh = text("rows.toml", tomli_w.dumps({"name": "two", "link": _ROWS}))


def urdf(folder: Path, lib: Library) -> None:
    """The robot's URDF."""
    (folder / "robot.urdf").write_text(lib.urdf())


def mesh(folder: Path, lib: Library) -> None:
    """A URDF of one link whose shape is a mesh, in three formats."""
    import trimesh

    solid = trimesh.creation.icosphere(1, 0.1)
    for form in ("stl", "obj", "dae"):
        data = solid.export(file_type=form)
        text = data.decode("latin1") if isinstance(data, bytes) else data
        text = re.sub(r"[0-9a-f]{32}|<(created|modified)>[^<]*</\1>", "", text)  # once and for all
        (folder / f"mesh.{form}").write_bytes(text.encode("latin1"))
        text = lib.urdf().replace(
            "</inertial>",
            "</inertial>"
            + "".join(
                f'<{tag}><geometry><mesh filename="mesh.{form}"/></geometry></{tag}>'
                for tag in ("visual", "collision")
            ),
            1,
        )
        (folder / f"{form}.urdf").write_text(text)


def masses(folder: Path, lib: Library) -> None:
    """Masses of links, and a URDF without <inertial>."""
    text = "".join(f'"{name}" = 1.5\n' for name in lib.link_names)
    (folder / "masses.toml").write_text(text)
    bare = re.sub(r"<inertial>.*?</inertial>", "", lib.urdf(), flags=re.DOTALL)
    (folder / "robot.urdf").write_text(bare)


def generated(folder: Path, lib: Library) -> None:
    """A generated folder; its name is the robot's."""
    shutil.copytree(lib.folder, folder, dirs_exist_ok=True)
    (folder / f"{folder.name}.urdf").write_text(lib.urdf())


def headless(folder: Path, lib: Library) -> None:
    """A log without a header line."""
    write_recording(motion(lib, 300), folder / "log.csv")
    text = (folder / "log.csv").read_text()
    (folder / "log.csv").write_text(text.partition("\n")[2])


def options(folder: Path, lib: Library) -> None:
    """A log, a motion, and options of commands with their values."""
    write_recording(motion(lib, 120), folder / "log.csv")
    trajectory(folder, lib)
    (folder / "options.json").write_text(json.dumps(OPTIONS))


def trajectory(folder: Path, lib: Library) -> None:
    """A motion, and the closed loop that follows it."""
    coefficients = 0.01 * np.ones((lib.n_joints, 4))
    designed = Trajectory(lib.home, coefficients, 5.0)
    write_motion(designed, lib, folder / "motion.json")
    rotor = np.full(lib.n_joints, 0.1)
    write_controller(folder / "loop.toml", "motion.json", Controller(), rotor, 1000.0)


def virtual(folder: Path, lib: Library) -> None:
    """Settings of a virtual robot, and its payload."""
    (folder / "settings.toml").write_text(tomli_w.dumps(settings_of(lib).facts()))
    text("box.toml", BOX)(folder, lib)


def log(file: str, rows: int = 60) -> Furnish:
    """A log in a file of one name."""
    return lambda folder, lib: write_recording(motion(lib, rows), folder / file)


def zipped(folder: Path, lib: Library) -> None:
    """A compressed CSV."""
    write_recording(motion(lib), folder / "log.csv")
    (folder / "log.csv.gz").write_bytes(gzip.compress((folder / "log.csv").read_bytes(), 1))


def mcap(folder: Path, lib: Library) -> None:
    """Joint states as JSON and as CDR."""
    for name, encoding in (("log.mcap", "json"), ("log.cdr.mcap", "cdr")):
        messages = bags.payloads(motion(lib), encoding)
        (folder / name).write_bytes(bags.mcap(messages, encoding))


def ros1(folder: Path, lib: Library) -> None:
    """A ROS 1 bag."""
    (folder / "log.bag").write_bytes(bags.ros1(bags.payloads(motion(lib), "ros1")))


def ros2(mode: str = "NONE") -> Furnish:
    """A ROS 2 bag; mode is NONE, FILE or MESSAGE."""
    return lambda folder, lib: bags.furnish_ros2(folder, motion(lib), mode)


def franka(folder: Path, lib: Library) -> None:
    """Log in the format of libfranka's logToCSV."""
    log = motion(lib)
    names = [f"state.{key}[{i}]" for key in ("q", "dq", "tau_J") for i in range(lib.n_joints)]
    values = np.hstack([log.q, 0 * log.q, log.tau])
    rows = [
        f"{round(1000 * t)},1.0," + ",".join(map(str, row))
        for t, row in zip(log.t, values, strict=True)
    ]
    header = ",".join(["time", "success_rate", *names])
    (folder / "log.csv").write_text("\n".join([header, *rows]) + "\n")


def recipe(folder: Path, lib: Library) -> None:
    """Folder with a CSV and its recipe."""
    names = range(1, lib.n_joints + 1)
    text = RECIPE.format(
        joints=json.dumps(list(lib.joint_names)),
        q=[f"q{i}" for i in names],
        tau=[f"tau{i}" for i in names],
        gear=np.eye(lib.n_joints).tolist(),
    )
    (folder / "recipe.toml").write_text(text)
    write_recording(motion(lib), folder / "log.csv")


def result(folder: Path, lib: Library) -> None:
    """Result of `identify`, and a log for evaluate."""
    log = motion(lib, 400)
    terms = Friction(("viscous", "coulomb", "offset"))
    identified = identify_recording(log, lib, preparation=Preparation(), friction=terms)
    write_result(identified, folder, "a test")
    write_recording(motion(lib), folder / "log.csv")


def truth(folder: Path, lib: Library) -> None:
    """True parameters as `simulate` writes them."""
    facts = {"robot": lib.name, "seed": 0, "pi": lib.pi0.tolist(), "lam": lib.lam0.tolist()}
    (folder / "log.truth.json").write_text(json.dumps(facts))


def payload(folder: Path, lib: Library) -> None:
    """Result of `payload`."""
    facts = {
        "format": 1,
        "robot": lib.name,
        "link": lib.link_names[-1],
        "frame": "flange",
        "mass": 1.5,
        "com": [0.01, 0.0, 0.1],
        "inertia": (0.01 * np.eye(3)).tolist(),
        "sigma": [0.01] * 10,
        "pi_in_link": [1.5, 0.015, 0.0, 0.15, 0.03, 0.03, 0.01, 0.0, 0.0, 0.0],
    }
    (folder / "payload.json").write_text(json.dumps(facts))


def units(folder: Path, lib: Library) -> None:
    """Compressed logs of three units."""
    log, terms = motion(lib, 300), Friction(("viscous", "coulomb"))
    for k in range(3):
        noise = np.random.default_rng(k + 1).normal(scale=0.05, size=log.tau.shape)
        unit = log.replace(tau=log.tau + noise)
        result = identify_recording(unit, lib, preparation=Preparation(), friction=terms)
        place = folder / "units" / f"u{k}"
        place.mkdir(parents=True)
        write_statistics(statistics_of(result, place.name), place / "statistics.npz")


def fleet(folder: Path, lib: Library) -> None:
    """Prior of a type of robot."""
    units(folder, lib)
    known = gather(lib, folder / "units", folder / "parts")
    shutil.rmtree(folder / "parts")
    fit = fit_fleet(lib, known)
    text = prior_text(lib, [unit.name for unit in known], fit, fit_friction(lib, known, fit))
    (folder / "fleet.toml").write_text(text)
    shutil.rmtree(folder / "units")


def comparison(folder: Path, lib: Library) -> None:
    """Result of `compare`."""
    n = lib.n_joints
    row = {"method": "map", "outcome": "consistent", "status": "converged", "rms": [0.1] * n}
    figures = ("test_percent", "train_percent", "base_error_percent", "seconds")
    row |= dict.fromkeys((*figures, "smallest_relative_eigenvalue", "gap_to_convex_optimum"), 0.5)
    row |= {"iterations": 5, "consistent": True, "boundary": False}
    facts = {
        "format": 1,
        "robot": lib.name,
        "recording": {"name": "log"},
        "joints": list(lib.joint_names),
        "units": ["N*m"] * n,
        "before_percent": 5.0,
        "rows": [row, row | {"method": "ols"}, {"method": "iv", "outcome": "not run"}],
        "advice": {"take": "map", "sentences": ["take map", "ols is no better"]},
        "notes": ["one run"],
        "provenance": {
            "command": "compare",
            "seed": 0,
            "model_hash": MARK,
            "versions": {"numpy": "2"},
            "files": {"log.csv": MARK},
        },
    }
    facts["rows"][2]["status"] = "needs --loop"
    (folder / "compare.json").write_text(json.dumps(facts))


def study(folder: Path, lib: Library) -> None:
    """A finished experiment of three trials."""
    t = np.linspace(0, 1, 30)
    series = {"t": t, "one": t**2, "two": np.sin(t[:, None] * [1.0, 2.0])}
    rows = [
        {"case": "p", "method": method, "trial": k, "status": "ok", "airm": 0.1 * (k + 1)}
        | {"tau_error_1": 1.0 + k, "tau_error_2": 2.0 + k}
        for method in ("adam", "map")
        for k in range(3)
    ]
    columns = ("airm", "tau_error_1", "tau_error_2")
    views = (
        View("table-5.2", "table", "AIRM", ("p",), columns),
        View("fig-5.2", "band", "curves", series=("t", "one", "one"), axes=("iteration", "AIRM")),
        View("fig-5.8", "bars", "bars", ("p",), columns[1:]),
    )
    toy = Study(
        name="toy",
        title="A toy study",
        config=None,  # type: ignore[arg-type]
        prepare=None,  # type: ignore[arg-type]
        run=None,  # type: ignore[arg-type]
        finish=None,  # type: ignore[arg-type]
        views=views,
        cases={"p": "perturbed"},
        methods={"adam": "the document's", "map": "ours"},
    )
    place = folder / "toy"
    place.mkdir()
    config = {"seed": 5}
    write_json(place / CONFIG, {"config_hash": MARK, "trials": 3, "config": config})
    finished = StudyOutcome(series, {"rate_hz": 100.0})
    write_outcome(toy, place, lib, config, MARK, 3, rows, finished, "reproduce")


def hdf5(folder: Path, lib: Library) -> None:
    """A log as arrays of HDF5, at the top and in a struct of MATLAB."""
    import h5py

    log = motion(lib)
    with h5py.File(folder / "log.h5", "w") as file:
        for name in ("t", "q", "tau"):
            file.create_dataset(name, data=getattr(log, name), track_times=False)
    with h5py.File(folder / "log.mat", "w", userblock_size=512) as file:
        arm = file.create_group("arm", track_times=False)
        for name in ("t", "q", "tau"):
            values = np.atleast_2d(getattr(log, name).T)
            arm.create_dataset(name, data=values, track_times=False)
            arm[name].attrs["MATLAB_class"] = np.bytes_("double")


def lerobot(folder: Path, lib: Library) -> None:
    """A data set of version 3 with one episode, and its recipe."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    log = motion(lib)
    joints = [f"joint{k}.pos" for k in range(1, lib.n_joints + 1)]
    rows = {
        "observation.state": pa.array(np.degrees(log.q).tolist()),
        "action": pa.array(np.degrees(log.q + 0.01).tolist()),
        "timestamp": pa.array(log.t),
        "episode_index": pa.array(np.zeros(len(log.t), dtype=int)),
    }
    (folder / "data/chunk-000").mkdir(parents=True)
    (folder / "meta").mkdir()
    pq.write_table(pa.table(rows), folder / "data/chunk-000/file-000.parquet")
    wide = {"dtype": "float32", "shape": [len(joints)], "names": joints}
    one = {"dtype": "float32", "shape": [1], "names": None}
    features = {key: one if key[0] in "te" else wide for key in rows}
    info = {"codebase_version": "v3.0", "fps": 100, "features": features}
    (folder / "meta/info.json").write_text(json.dumps(info))
    (folder / "recipe.toml").write_text(
        f'[time]\nkey = "timestamp"\nunit = "s"\n'
        f'[position]\nkey = "observation.state"\ncolumns = {json.dumps(joints)}\nunit = "deg"\n'
        f'[torque]\nlaw = "pd"\nkp = {[2.0] * len(joints)}\nkd = 0.0\n'
        f"q_des = {json.dumps(joints)}\n"
    )
