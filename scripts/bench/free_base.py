"""Robots with a free base: recovery of virtual bodies, and the vertical forces of a walking iCub.

The logs of Go2 and G1 are computed by Pinocchio (`tests.free_base_logs`): motion, torques and six
components of every contact wrench, with noise. iCub's log has vertical forces.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from bench.markdown import markdown_table
from runtime.identification.free_base.identify import identify_free_base
from runtime.identification.free_base.vertical_force import VerticalForce
from runtime.library import Library, load, to_pinocchio_order
from runtime.recording.formats.npz import open_npz
from runtime.recording.free_base import free_base_of
from symgen.build.pipeline import build
from symgen.build.request import BuildRequest
from symgen.chain import ChainOptions
from symgen.chain.document import MOVING, Document
from tests.free_base_logs import Experiment, virtual_log
from tests.robots import ONE_LEVEL

CUTOFFS = (1.0, 1.5, 2.0, 3.0, 5.0)
"""Low-passes of the walking log [Hz]."""
OFFSET_N = 6.6
"""Standard deviation of the offset of a foot's sensor, 2 % of the weight of the robot [N]."""
TRIM_S = 0.3
"""Rows at either end that are left out of the walking log [s]."""
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
    """Robot of example-robot-data whose bodies are recovered.

    Attributes:
        path: URDF.
        feet: links in contact.
        experiment: motion and sensors.
    """

    path: str
    feet: tuple[str, ...]
    experiment: Experiment


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
    """Recovery of the bodies of one robot over all trials.

    Attributes:
        robot: its name.
        joints: number of joints.
        base_parameters: number of base parameters.
        rows: choice of rows.
        trials: number of trials.
        relative: median of ‖β̂ − β‖/‖β‖.
        single: median over trials and base parameters of |β̂_i − β_i|/|β_i|.
        urdf: median of ‖β_URDF − β‖/‖β‖.
        consistent: share of trials whose links are all strictly consistent.
        mass_covered: share of trials whose 95 % interval holds the total mass.
        feasible: share of the torques that are within the effort limits of the URDF.
    """

    robot: str
    joints: int
    base_parameters: int
    rows: str
    trials: int
    relative: float
    single: float
    urdf: float
    consistent: float
    mass_covered: float
    feasible: float


@dataclass(frozen=True, slots=True)
class Walk:
    """Vertical forces of the walking iCub at one low-pass, in % of the weight.

    Attributes:
        cutoff: [Hz].
        urdf: RMS error of the URDF on the second half.
        identified: RMS error of the model that was fitted to the first half.
        constant: standard deviation of the measured sum on the second half.
        best_mass: RMS error of the URDF with the total mass that fits the second half best.
        mass, low, high: total mass and its 95 % interval [kg].
        determined: entries of π that the log determines, of all.
        entries: number of entries of π.
    """

    cutoff: float
    urdf: float
    identified: float
    constant: float
    best_mass: float
    mass: float
    low: float
    high: float
    determined: int
    entries: int


def library(urdf: str, name: str, folder: Path, locks: dict[str, float] | None = None) -> Library:
    """Library of a robot with a free base, of one instruction set.

    Args:
        urdf: text of the URDF.
        name: of the robot.
        folder: folder of generated robots.
        locks: joints that are fixed.

    Returns:
        The library.
    """
    options = ChainOptions(floating=True, locks=locks or {}, snap=1e-4)
    return load(
        build(BuildRequest(name, urdf, options, project=True), folder, levels=ONE_LEVEL).folder
    )


def recovery(robot: str, models: Path, folder: Path, trials: int, rows: str = "all") -> Trials:
    """Trials of one robot of `ROBOTS`.

    Args:
        robot: its name.
        models: folder `robots` of example-robot-data.
        folder: folder of generated robots.
        trials: number of trials.
        rows: choice of rows.

    Returns:
        Medians and shares.
    """
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
        covered += abs(total - true[::10].sum()) < 1.96 * sigma
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


def walking(data: Path, folder: Path) -> list[Walk]:
    """iCub: first half of the log for the second half, at several low-passes.

    Args:
        data: folder of walking.npz and model.urdf.
        folder: folder of generated robots.

    Returns:
        One row per low-pass.
    """
    log = open_npz((data / "walking.npz").read_bytes(), "walking.npz")
    urdf = (data / "model.urdf").read_text()
    document = Document(urdf)
    still = [
        name
        for name in document.joints
        if document.kind(name) in MOVING and name not in set(map(str, log["joints"]))
    ]
    lib = library(urdf, "icub", folder, dict.fromkeys(still, 0.0))
    arrays = {key: log[key] for key in ("q", "joints", "base_rpy")} | {
        "t": log["t"] - log["t"][0],
        "base_position": log["base_pos"],
        "contact_links": np.array(["l_ankle_2", "r_ankle_2"]),
        "contact_force_z": np.stack([log["lf_fz"], log["rf_fz"]], axis=1),
        "contact_force_z_sigma": np.full(2, OFFSET_N),
    }
    recording = free_base_of(arrays, "walking.npz")
    rows = []
    for cutoff in CUTOFFS:
        result = identify_free_base(
            recording, lib, "base", cutoff_hz=cutoff, share=0.5, trim_s=TRIM_S
        )
        vertical, (mass, sigma) = result.vertical, result.mass
        if vertical is None:
            raise RuntimeError("expected vertical forces of both feet in walking.npz")
        weight = vertical.weight
        rows.append(
            Walk(
                cutoff,
                100 * vertical.before / weight,
                100 * vertical.after / weight,
                100 * vertical.spread / weight,
                100 * _best_mass(vertical) / weight,
                mass,
                mass - 1.96 * sigma,
                mass + 1.96 * sigma,
                sum(verdict == "identified" for verdict in result.verdicts),
                len(result.verdicts),
            )
        )
    return rows


def _best_mass(vertical: VerticalForce) -> float:
    """RMS of f − s p at the best factor s of the URDF's force p [N]."""
    p, f = vertical.predicted, vertical.measured
    return float(np.sqrt(np.mean((f - p * (p @ f) / (p @ p)) ** 2)))


_RECOVERY = ("robot", "joints", "β", "rows", "trials", "‖Δβ‖/‖β‖ %", "URDF %",
             "single βᵢ, median %", "consistent %",
             "total mass in its 95 % interval, %", "torques within limits, %")  # fmt: skip
_WALK = ("low-pass Hz", "URDF %", "identified %", "URDF of the best mass %", "best constant %",
         "mass kg", "95 % interval")  # fmt: skip


def _recovery_cells(r: Trials) -> tuple[str, ...]:
    sizes = (r.robot, str(r.joints), str(r.base_parameters), r.rows, str(r.trials))
    errors = (f"{100 * r.relative:.4f}", f"{100 * r.urdf:.1f}", f"{100 * r.single:.2f}")
    shares = (r.consistent, r.mass_covered, r.feasible)
    return (*sizes, *errors, *(f"{100 * share:.0f}" for share in shares))


def _walk_cells(r: Walk) -> tuple[str, ...]:
    numbers = (r.urdf, r.identified, r.best_mass, r.constant)
    errors = tuple(f"{number:.2f}" for number in numbers)
    return (f"{r.cutoff:g}", *errors, f"{r.mass:.2f}", f"{r.low:.2f} to {r.high:.2f}")


def recovery_table(rows: list[Trials]) -> Table:
    """Table of `recovery`."""
    return _table("bodies recovered from virtual logs", _RECOVERY, map(_recovery_cells, rows))


def walking_table(rows: list[Walk]) -> Table:
    """Table of `walking`."""
    title = "iCub walking: error of ΣF_z on the second half"
    return _table(title, _WALK, map(_walk_cells, rows))


def recovery_markdown(rows: list[Trials]) -> str:
    """Table of `recovery` for docs/."""
    return markdown_table(_RECOVERY, map(_recovery_cells, rows))


def walking_markdown(rows: list[Walk]) -> str:
    """Table of `walking` for docs/."""
    return markdown_table(_WALK, map(_walk_cells, rows))


def _table(title: str, heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Table:
    table = Table(heads[0], title=title)
    for head in heads[1:]:
        table.add_column(head, justify="right")
    for row in rows:
        table.add_row(*row)
    return table


def facts(recovered: list[Trials], walks: list[Walk]) -> dict[str, Any]:
    """Everything as JSON.

    Args:
        recovered: rows of `recovery`.
        walks: rows of `walking`.

    Returns:
        JSON-ready facts.
    """
    return {"recovery": [asdict(r) for r in recovered], "walking": [asdict(w) for w in walks]}
