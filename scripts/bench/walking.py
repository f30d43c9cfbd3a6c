"""Walking robots without force sensors: virtual Go2 and G1 recovered from encoders, IMU, commands.

Logs are those of `tests.walking_logs`; every trial has other bodies, friction, armature, delay and
motion. A trunk is the base link with the links that turn in it, at zero joint positions: mass that
moves along the axis of a joint changes no equation, so that the base link alone is less certain.
"""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.free_base import ROBOTS, library
from bench.front import Sheet, sheet_of
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification.free_base.identify import identify_free_base
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.library import Array, Library, to_pinocchio_order
from runtime.library.parameters import FIRST_MOMENT, MASS, links
from runtime.recording.free_base import free_base_of
from tests.walking_logs import G1, GO2, WalkingLog, walking_log

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
    result = identify_free_base(free_base_of(log.arrays, robot), lib, "all", cutoff_hz=CUTOFF_HZ)
    seconds = time.process_time() - start
    order = np.argsort(to_pinocchio_order(np.arange(10.0)))
    true = log.pi.reshape(-1, 10)[:, order].ravel()
    total, sigma = result.record.total_mass.value, result.record.total_mass.sigma
    mass = float(true[MASS::10].sum())
    trunk = [k for k, name in enumerate(lib.link_names) if any(t in name for t in TRUNKS[robot])]

    def off(pi: Array, chosen: list[int]) -> float:
        change = centre(lib, pi, chosen) - centre(lib, true, chosen)
        return 1e3 * float(np.linalg.norm(change))

    base, error = lib.base_matrix, result.pi - true
    pi_holds = np.abs(error) < NORMAL_95 * np.linalg.norm(result.posterior.pi_root, axis=1)
    beta_holds = np.abs(base @ error) < NORMAL_95 * np.linalg.norm(
        base @ result.posterior.pi_root, axis=1
    )
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
