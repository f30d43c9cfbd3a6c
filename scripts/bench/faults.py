"""The run behind `scripts/fault_table`: faults in the logs of two virtual robots, and real logs.

Robots and faults are those of the tests (`tests.runtime.virtual_arms`, `tests.runtime.faults`). The
arm on a wall and the robots of the real logs are built into a temporary folder.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.front import Sheet
from runtime.inspection import INFO, inspect_log
from runtime.library import Library, load
from symgen.chain import ChainOptions
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.robots import CASES, ONE_LEVEL
from tests.runtime.faults import FAULTS, Fault
from tests.runtime.virtual_arms import WALL, Arm, Log, cobot, wall_arm

CLEAN = "clean"
REAL = (("panda_gaz", "fr3"), ("tx40_figaroh", "tx40"), ("lwr4_flobaroid", "kuka_lwr4"))
"""Published logs with their recipes, and the robots that they are of."""


@dataclass(frozen=True, slots=True)
class Row:
    """Result of one log."""

    robot: str
    fault: str  # name of the fault, "clean" for none
    is_right: bool  # joint, size or place is right
    kinds: tuple[str, ...]  # warnings and errors


def study(shared: Path, seed: int | None) -> list[Row]:
    """Inspect the clean logs and all faulty ones."""
    models = shared / "models"
    seeds = {} if seed is None else {"seed": seed}
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        wall = on_a_wall(models, root)
        arms = {
            "cobot": cobot(load("ur5e"), models / "universal_robots/ur10_robot.urdf", **seeds),
            "arm on a wall": wall_arm(wall, models / "xarm7/xarm7.urdf", **seeds),
        }
        rows = [row for name, arm in arms.items() for row in _rows(name, arm, root)]
        return rows + [_real(name, robot, shared, root) for name, robot in REAL]


def on_a_wall(models: Path, root: Path) -> Library:
    """A KUKA iiwa 14 with gravity along +x of its base."""
    options = ChainOptions(gravity=WALL, snap=1e-4)  # its URDF rounds angles to four digits
    urdf = (models / "iiwa14/iiwa14_uebersax.urdf").read_text(encoding="utf-8")
    return load(build(BuildRequest("iiwa14_wall", urdf, options), root, levels=ONE_LEVEL).folder)


def _rows(robot: str, arm: Arm, root: Path) -> Iterator[Row]:
    """The clean log, then every fault."""
    kinds = tuple(f.kind for f in _loud(arm, arm.log, root))
    yield Row(robot, CLEAN, not kinds, kinds)
    for fault in FAULTS:
        yield _row(robot, arm, fault, root)


def _row(robot: str, arm: Arm, fault: Fault, root: Path) -> Row:
    findings = _loud(arm, fault.put(arm), root)
    right = any(f.kind in fault.kinds and fault.states(arm, f) for f in findings)
    return Row(robot, fault.name, right, tuple(f.kind for f in findings))


def _loud(arm: Arm, log: Log, root: Path) -> list:
    """Warnings and errors of one log."""
    np.savez(root / "log.npz", **log.arrays)
    findings = inspect_log(root / "log.npz", arm.lib, log.recipe).findings
    return [f for f in findings if f.level != INFO]


def _real(name: str, robot: str, shared: Path, root: Path) -> Row:
    """A published log, read with its recipe."""
    if robot == "fr3":
        lib = load("fr3")
    else:
        request = CASES[robot].request(robot, shared / "models")
        lib = load(build(request, root, levels=ONE_LEVEL).folder)
    found = inspect_log(shared / "data" / name, lib, name).findings
    kinds = tuple(f.kind for f in found if f.level != INFO)
    return Row(name, CLEAN, not kinds, kinds)


def sheet(rows: list[Row]) -> Sheet:
    """One line per fault, one column per virtual robot, then the counts."""
    robots = list(dict.fromkeys(row.robot for row in rows if row.fault != CLEAN))
    found = {(row.robot, row.fault): row for row in rows}
    faults = [each.name for each in FAULTS]
    lines = [(name, *(_cell(found[r, name]) for r in robots)) for name in (CLEAN, *faults)]
    right = [sum(found[robot, name].is_right for name in faults) for robot in robots]
    lines.append(("named rightly", *(f"**{count} of {len(faults)}**" for count in right)))
    real = [row for row in rows if row.robot not in robots]
    said = ", ".join(f"`{row.robot}` {', '.join(row.kinds) or 'none'}" for row in real)
    below = f"\nWarnings and errors on real logs with their recipes: {said}."
    return Sheet("fault_table", ("fault", *robots), lines, rows, below=below)


def _cell(row: Row) -> str:
    """Findings of one log; those that do not name the fault are marked."""
    kinds = ", ".join(f"`{kind}`" for kind in row.kinds) or "no warning"
    return kinds if row.is_right else f"{kinds} (not named)"
