"""Robots with a free base: recovery of virtual bodies of Go2 and G1.

The logs are computed by Pinocchio (`tests.free_base_logs`): motion, torques and six components of
every contact wrench, with noise.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.front import Sheet
from runtime.estimators.regression.residuals import NORMAL_95
from runtime.identification.free_base.identify import identify_free_base
from runtime.library import Library, load, to_pinocchio_order
from runtime.recording.free_base import free_base_of
from symgen.chain import ChainOptions
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.free_base_logs import Experiment, virtual_log
from tests.robots import ONE_LEVEL

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


@dataclass(frozen=True, slots=True)
class Trials:
    """Recovery of the bodies of one robot over all trials."""

    robot: str
    joints: int
    base_parameters: int
    rows: str  # choice of rows
    trials: int
    relative: float  # median of ‖β̂ − β‖/‖β‖
    single: float  # median over trials and base parameters of |β̂_i − β_i|/|β_i|
    urdf: float  # median of ‖β_URDF − β‖/‖β‖
    consistent: float  # share of trials whose links are all strictly consistent
    mass_covered: float  # share of trials whose 95 % interval holds the total mass
    feasible: float  # share of the torques that are within the effort limits of the URDF


def library(urdf: str, name: str, folder: Path, locks: dict[str, float] | None = None) -> Library:
    """Library of a robot with a free base, of one instruction set."""
    options = ChainOptions(floating=True, locks=locks or {}, snap=1e-4)
    return load(
        build(BuildRequest(name, urdf, options, project=True), folder, levels=ONE_LEVEL).folder
    )


def recovery(robot: str, models: Path, folder: Path, trials: int, rows: str = "all") -> Trials:
    """Trials of one robot of `ROBOTS`."""
    chosen = ROBOTS[robot]
    lib = library((models / chosen.path).read_text(), robot.lower(), folder)
    order = np.argsort(to_pinocchio_order(np.arange(10.0)))
    errors, singles, before, consistent, covered, feasible = [], [], [], 0, 0, []
    for seed in range(trials):
        log = virtual_log(lib.urdf(), chosen.feet, seed, chosen.experiment)
        result = identify_free_base(free_base_of(log.arrays, robot), lib, rows)
        true = log.pi.reshape(-1, 10)[:, order].ravel()
        beta = lib.base_matrix @ true
        change = lib.base_matrix @ result.pi - beta
        errors.append(np.linalg.norm(change) / np.linalg.norm(beta))
        singles.append(np.abs(change) / np.abs(beta))
        before.append(np.linalg.norm(lib.base_matrix @ (lib.pi0 - true)) / np.linalg.norm(beta))
        consistent += result.is_consistent
        total, sigma = result.mass
        covered += abs(total - true[::10].sum()) < NORMAL_95 * sigma
        feasible.append(log.feasible)
    return Trials(
        robot,
        lib.n_joints,
        len(lib.base_columns),
        rows,
        trials,
        float(np.median(errors)),
        float(np.median(singles)),
        float(np.median(before)),
        consistent / trials,
        covered / trials,
        float(np.mean(feasible)),
    )


_RECOVERY = ("robot", "joints", "β", "rows", "trials", "‖Δβ‖/‖β‖ %", "URDF %",
             "single βᵢ, median %", "consistent %",
             "total mass in its 95 % interval, %", "torques within limits, %")  # fmt: skip


def sheet(rows: list[Trials]) -> Sheet:
    """One line per robot."""
    lines = []
    for r in rows:
        sizes = (r.robot, str(r.joints), str(r.base_parameters), r.rows, str(r.trials))
        errors = (f"{100 * r.relative:.4f}", f"{100 * r.urdf:.1f}", f"{100 * r.single:.2f}")
        shares = (f"{100 * share:.0f}" for share in (r.consistent, r.mass_covered, r.feasible))
        lines.append((*sizes, *errors, *shares))
    title = "bodies recovered from virtual logs"
    return Sheet("free_base_table recovery", _RECOVERY, lines, rows, title)
