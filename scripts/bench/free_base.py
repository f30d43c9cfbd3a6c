"""Free bases: virtual bodies of Go2 and G1 recovered, vertical forces of a walking iCub.

Virtual logs are computed by Pinocchio (`tests.free_base_logs`): motion, torques and six components
of every contact wrench, with noise. Of iCub the first half of the log predicts the second half.
Without force sensors (`tests.walking_logs`) Go2 and G1 are recovered from encoders, IMU and
commands; every trial has other bodies, friction, armature, delay and motion. A trunk is the base
link with the links that turn in it, at zero joint positions: mass that moves along the axis of a
joint changes no equation, so that the base link alone is less certain.
"""

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.front import Sheet, sheet_of
from bench.same_results_inputs import DRIVER_HZ, icub_arrays
from runtime import Settings, identify
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification.free_base import drives
from runtime.identification.free_base.identify import identify_free_base
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.identification.result_record import VerticalForcePart
from runtime.library import Array, Library, load, to_pinocchio_order
from runtime.library.parameters import FIRST_MOMENT, MASS, links
from runtime.recording.formats.npz import open_npz
from runtime.recording.free_base import FreeBaseRecording, free_base_of
from runtime.recording.preprocessing.free_base_motion import motion_of
from symgen.chain import ChainOptions
from symgen.chain.document import MOVING, Document
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.free_base_logs import HALF, Experiment, virtual_log
from tests.robots import ONE_LEVEL
from tests.walking_logs import G1, GO2, WalkingLog, walking_log

_LARGE = Experiment(
    count=12000,
    rate_hz=200.0,
    position=0.1,
    rotation=0.5,
    joint=None,
    base_speed=6.0,
    joint_speed=12.0,
    torque_noise=0.001,
    force_noise=0.25,
    moment_noise=0.005,
)
"""One minute of large motion. Noise: 0.1 % of the range of torque sensors; of wrenches the
resolution of a cell of 580 N and 20 N·m."""


@dataclass(frozen=True, slots=True)
class Robot:
    """Robot of example-robot-data whose bodies are recovered."""

    path: str
    feet: tuple[str, ...]  # links in contact
    experiment: Experiment  # motion and sensors


ROBOTS = {
    "Go2": Robot(
        "go2_description/urdf/go2.urdf",
        tuple(f"{leg}_calf" for leg in ("FL", "FR", "RL", "RR")),
        _LARGE,
    ),
    # The slower motion keeps the torques of ankles and waist within their limits.
    "G1": Robot(
        "g1_description/urdf/g1_29dof_rev_1_0.urdf",
        tuple(f"{side}_ankle_roll_link" for side in ("left", "right")),
        replace(_LARGE, count=4000, base_speed=4.0, joint_speed=9.0),
    ),
}


def library(urdf: str, name: str, folder: Path, locks: dict[str, float] | None = None) -> Library:
    """Library of a robot with a free base, of one instruction set."""
    options = ChainOptions(floating=True, locks=locks or {}, snap=1e-4)
    return load(
        build(BuildRequest(name, urdf, options, project=True), folder, levels=ONE_LEVEL).folder
    )


RECOVERY = {
    **dict.fromkeys(("robot", "joints", "β", "rows", "trials"), ""),
    **{"‖Δβ‖/‖β‖ %": ".4f", "URDF %": ".1f", "single βᵢ, median %": ".2f", "consistent %": ".0f"},
    **{"total mass in its 95 % interval, %": ".0f", "torques within limits, %": ".0f"},
}
"""Medians over trials of the errors of β̂ and of the URDF, shares of trials, and of torques."""


def recovery(robot: str, models: Path, folder: Path, trials: int, rows: str = "all") -> tuple:
    """Values of `RECOVERY` of one robot of `ROBOTS`."""
    chosen = ROBOTS[robot]
    lib = library((models / chosen.path).read_text(), robot.lower(), folder)
    order = np.argsort(to_pinocchio_order(np.arange(10.0)))
    errors, singles, before, consistent, covered, feasible = [], [], [], 0, 0, []
    for seed in range(trials):
        log = virtual_log(lib.urdf(), chosen.feet, seed, chosen.experiment)
        result = identify(free_base_of(log.arrays, robot), lib, rows=rows)
        true = log.pi.reshape(-1, 10)[:, order].ravel()
        beta = lib.base_matrix @ true
        change = lib.base_matrix @ result.pi - beta
        errors.append(np.linalg.norm(change) / np.linalg.norm(beta))
        singles.append(np.abs(change) / np.abs(beta))
        before.append(np.linalg.norm(lib.base_matrix @ (lib.pi0 - true)) / np.linalg.norm(beta))
        consistent += result.record.consistent
        total, sigma = result.record.total_mass.value, result.record.total_mass.sigma
        covered += abs(total - true[::10].sum()) < NORMAL_95 * sigma
        feasible.append(log.feasible)
    sizes = (robot, lib.n_joints, len(lib.base_columns), rows, trials)
    medians = (float(np.median(each)) for each in (errors, before, singles))
    shares = (consistent / trials, covered / trials, float(np.mean(feasible)))
    return (*sizes, *(100 * each for each in (*medians, *shares)))


def sheet(rows: list[tuple]) -> Sheet:
    """One line per robot."""
    title = "bodies recovered from virtual logs"
    return sheet_of("free_base_table recovery", RECOVERY, rows, title=title)


CUTOFFS = (1.0, 1.5, 2.0, 3.0, 5.0)  # low-passes of the walking log [Hz]
SHARE_OF_URDF, MOST = 0.8, 2.0
"""Goal of the error: share of the URDF's, and largest value [% of the weight]."""
TRIM_S = 0.3  # rows at either end that are left out of the walking log [s]

_WALK = ("URDF %", "goal %", "identified at 3 Hz %", "without lag %", "without crosstalk %",
         "identified in this band %", "crosstalk in this band N/(N·m)", "URDF of the best mass %",
         "best constant %", "mass kg")  # fmt: skip
WALK = {"low-pass Hz": "g", **dict.fromkeys(_WALK, ".2f"), "95 % interval": ""}
"""RMS errors of the vertical force on the second half of the log in % of the weight: of the URDF,
of models that were fitted to the first half at `DRIVER_HZ` or in the band, without one error each
of the sensors, of the URDF with the mass that fits best, and of a constant; total mass."""


def icub(data: Path, folder: Path) -> Library:
    """iCub with the joints that its walking log holds; the others are locked."""
    urdf = (data / "model.urdf").read_text()
    document = Document(urdf)
    logged = set(map(str, open_npz((data / "walking.npz").read_bytes(), "walking.npz")["joints"]))
    moving = {name for name in document.joints if document.kind(name) in MOVING}
    return library(urdf, "icub", folder, dict.fromkeys(sorted(moving - logged), 0.0))


def walking(data: Path, folder: Path) -> Sheet:
    """iCub: first half of the log for the second half, at several low-passes."""
    lib = icub(data, folder)
    arrays = icub_arrays(data / "walking.npz")
    recording = free_base_of(arrays, "walking.npz")

    def identified(read: FreeBaseRecording, cutoff: float = DRIVER_HZ) -> FreeBaseIdentification:
        settings = Settings(rows="base", cutoff=cutoff, split=HALF, refit=False)
        return identify_free_base([read], lib, settings, trim_s=TRIM_S)

    result = identified(recording)
    without = []
    for key in ("contact_force_z_cutoff", "contact_force_z_crosstalk"):
        fewer = {name: values for name, values in arrays.items() if name != key}
        part = free_base_of(fewer, "walking.npz")
        without.append((part, identified(part)))
    mass, sigma = result.record.total_mass.value, result.record.total_mass.sigma
    rows = []
    for cutoff in CUTOFFS:
        (vertical, sums), here = (
            _predicted(recording, result, cutoff),
            identified(recording, cutoff),
        )
        others = [_predicted(part, fit, cutoff)[0] for part, fit in (*without, (recording, here))]
        of_urdf, spread = vertical.before_percent, 100 * sums[0].std() / vertical.mean
        goal = min(SHARE_OF_URDF * of_urdf, MOST)
        no_lag, no_crosstalk, same_band = (each.after_percent for each in others)
        percent = [of_urdf, goal, vertical.after_percent, no_lag, no_crosstalk, same_band]
        percent += [100 * _best_mass(*sums) / vertical.mean, spread]
        interval = f"{mass - NORMAL_95 * sigma:.2f} to {mass + NORMAL_95 * sigma:.2f}"
        crosstalk = here.record.sensors["crosstalk_y"].value
        rows.append((cutoff, *percent[:6], crosstalk, *percent[6:], mass, interval))
    title = "iCub walking: error of ΣF_z on the second half"
    return sheet_of("free_base_table walking", WALK, rows, title=title)


def _predicted(
    recording: FreeBaseRecording, result: FreeBaseIdentification, cutoff_hz: float
) -> tuple[VerticalForcePart, tuple[Array, Array]]:
    """Errors on the second half, behind another low-pass; ΣF_z as measured and by the URDF."""
    motion = motion_of(recording, result.lib.joint_names, cutoff_hz)
    second = (motion.t >= (motion.t[0] + motion.t[-1]) / 2) & (motion.t <= motion.t[-1] - TRIM_S)
    phi = np.array([each.value for each in result.record.sensors.values()])
    rows = motion.rows(np.flatnonzero(second))
    vertical = drives.vertical_force(result.lib, rows, result.pi, phi)
    measured = drives.measured_vertical(result.lib, rows)
    if vertical is None or measured is None:
        raise RuntimeError("expected vertical forces of both feet in walking.npz")
    return vertical, (measured, drives.needed_vertical(result.lib, rows, result.lib.pi0))


def _best_mass(f: Array, p: Array) -> float:
    """RMS of f − s p at the best factor s of the URDF's force p [N]."""
    return float(np.sqrt(np.mean((f - p * (p @ f) / (p @ p)) ** 2)))


GAITS = {"Go2": GO2, "G1": G1}
TRUNKS = {"Go2": ("base", "hip"), "G1": ("pelvis", "waist", "torso")}
"""Parts of the names of the links of a trunk."""
CUTOFF_HZ = 10.0
"""Above it the noise of accelerations biases armatures and, by 0.1 %, the mass of G1."""

TRIAL = {
    **dict.fromkeys(("robot", "seed"), ""),
    **{"mass kg": ".3f", "σ": ".3f", "mass error %": ".3f", "URDF %": ".2f"},
    **dict.fromkeys(("base CoM mm", "trunk CoM mm", "URDF trunk mm", "robot CoM mm"), ".2f"),
    **dict.fromkeys(("π in 95 %", "β in 95 %", "drives in 95 %"), ".1f"),
    **{"delay error ms": ".3f", "CPU s": ".1f"},
}
SUMMARY = {
    **dict.fromkeys(("robot", "trials"), ""),
    **{"largest mass error %": ".3f", "mass in 95 %": ".0f"},
    **dict.fromkeys(("trunk CoM mm, median", "largest"), ".2f"),
    **{"parameters in 95 % in 9 of 10 trials, %": ".1f", "β in 95 %": ".1f", "CPU s": ".1f"},
}


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """Cells of a trial, and whether each parameter is within its interval."""

    cells: tuple
    holds: Array


def trial(robot: str, seed: int, lib: Library, urdf: str) -> Trial:
    """One virtual robot."""
    log = walking_log(urdf, GAITS[robot], seed)
    start = time.process_time()
    result = identify(free_base_of(log.arrays, robot), lib, rows="all", cutoff=CUTOFF_HZ)
    seconds = time.process_time() - start
    order = np.argsort(to_pinocchio_order(np.arange(10.0)))
    true = log.pi.reshape(-1, 10)[:, order].ravel()
    total, sigma = result.record.total_mass.value, result.record.total_mass.sigma
    mass = float(true[MASS::10].sum())
    trunk = [k for k, name in enumerate(lib.link_names) if any(t in name for t in TRUNKS[robot])]

    def off(pi: Array, chosen: list[int]) -> float:
        change = centre(lib, pi, chosen) - centre(lib, true, chosen)
        return 1e3 * float(np.linalg.norm(change))

    base, error, root = lib.base_matrix, result.pi - true, result.posterior.pi_root
    pi_holds = np.abs(error) < NORMAL_95 * np.linalg.norm(root, axis=1)
    beta_holds = np.abs(base @ error) < NORMAL_95 * np.linalg.norm(base @ root, axis=1)
    cells = (
        *(robot, seed, total, sigma, 100 * (total / mass - 1)),
        100 * (float(lib.pi0[MASS::10].sum()) / mass - 1),
        *(off(result.pi, [0]), off(result.pi, trunk), off(lib.pi0, trunk)),
        off(result.pi, list(range(lib.n_links))),
        *(100 * float(each.mean()) for each in (pi_holds, beta_holds, drives_hold(result, log))),
        1e3 * (result.record.delay_s.value - log.delay_s),
        seconds,
    )
    mass_holds = abs(total - mass) < NORMAL_95 * sigma
    return Trial(cells, np.concatenate([[mass_holds], pi_holds]))


def centre(lib: Library, pi: Array, chosen: list[int]) -> Array:
    """Centre of mass of some links at zero joint positions, (3,) [m]."""
    poses, bodies = lib.link_poses(np.zeros((1, lib.n_rows)))[0], links(pi)
    moments = [
        poses[k, :3, :3] @ bodies[k][FIRST_MOMENT] + poses[k, :3, 3] * bodies[k][MASS]
        for k in chosen
    ]
    return np.asarray(np.sum(moments, axis=0) / sum(bodies[k][MASS] for k in chosen))


def drives_hold(result: FreeBaseIdentification, log: WalkingLog) -> Array:
    """Whether friction, armature and delay are within their intervals."""
    friction, late = result.record.friction, result.record.delay_s
    true = {"viscous": log.viscous, "coulomb": log.coulomb, "rotor": log.armature}
    rows = [result.lib.joint_names.index(joint) for joint in log.arrays["joints"]]
    holds = [abs(late.value - log.delay_s) < NORMAL_95 * late.sigma]
    for name, each in true.items():
        at = friction.columns.index(name)
        pairs = [(friction.values[j][at], friction.sigma[j][at]) for j in rows]
        holds += [abs(x - v) < NORMAL_95 * s for (x, s), v in zip(pairs, each, strict=True)]
    return np.array(holds)


def tables(robots: list[str], seeds: range, models: Path, folder: Path) -> list[Sheet]:
    """Every trial, and a line per robot."""
    cells, lines = [], []
    for robot in robots:
        urdf = (models / ROBOTS[robot].path).read_text()
        lib = library(urdf, robot.lower(), folder)
        trials = [trial(robot, seed, lib, urdf) for seed in seeds]
        rows = [each.cells for each in trials]
        cells += rows
        holds = np.mean([each.holds for each in trials], axis=0)
        column = {name: np.array([row[k] for row in rows]) for k, name in enumerate(TRIAL) if k}
        trunk = column["trunk CoM mm"]
        largest = float(np.abs(column["mass error %"]).max())
        means = (float(column[name].mean()) for name in ("β in 95 %", "CPU s"))
        often = 100 * float(np.mean(holds[1:] >= 0.9))
        middle = (float(np.median(trunk)), float(trunk.max()))
        lines.append((robot, len(rows), largest, 100 * float(holds[0]), *middle, often, *means))
    return [
        sheet_of("walking_table trials", TRIAL, cells, title="walking robots, trial by trial"),
        sheet_of("walking_table", SUMMARY, lines, title="walking robots without force sensors"),
    ]
