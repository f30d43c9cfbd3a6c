"""Free bases: virtual bodies of Go2 and G1 recovered, vertical forces of a walking iCub.

Virtual logs are computed by Pinocchio (`tests.free_base_logs`): motion, torques and six components
of every contact wrench, with noise. Of iCub the first half of the log predicts the second half.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.front import Sheet, sheet_of
from bench.same_results_inputs import DRIVER_HZ, icub_arrays
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification.free_base.drives import (
    measured_vertical,
    needed_vertical,
    vertical_force,
)
from runtime.identification.free_base.identify import identify_free_base
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.identification.result_record import VerticalForcePart
from runtime.library import Array, Library, load, to_pinocchio_order
from runtime.recording.formats.npz import open_npz
from runtime.recording.free_base import FreeBaseRecording, free_base_of
from runtime.recording.preprocessing.free_base_motion import motion_of
from symgen.chain import ChainOptions
from symgen.chain.document import MOVING, Document
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
        result = identify_free_base(free_base_of(log.arrays, robot), lib, rows)
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
        return identify_free_base(read, lib, "base", cutoff_hz=cutoff, share=0.5, trim_s=TRIM_S)

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
    phi = np.array([[each.value for each in result.record.sensors.values()]])
    rows = motion.rows(np.flatnonzero(second))
    vertical = vertical_force(result.lib, rows, result.pi, phi)
    measured = measured_vertical(result.lib, rows)
    if vertical is None or measured is None:
        raise RuntimeError("expected vertical forces of both feet in walking.npz")
    return vertical, (measured, needed_vertical(result.lib, rows, result.lib.pi0))


def _best_mass(f: Array, p: Array) -> float:
    """RMS of f − s p at the best factor s of the URDF's force p [N]."""
    return float(np.sqrt(np.mean((f - p * (p @ f) / (p @ p)) ** 2)))
