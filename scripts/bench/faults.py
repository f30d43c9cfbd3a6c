"""Faults in the logs of two virtual robots, and defaults of `identify` beside other settings.

Robots and faults are those of the tests (`tests.runtime.virtual_arms`, `tests.runtime.faults`). The
arm on a wall and the robots of the real logs are built into a temporary folder. A setting is fitted
to one log of each robot and predicts the torque of another motion; the preparation of both is that
which `inspect` proposes for the first.
"""

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from bench.front import Sheet
from bench.real_logs import Row, inspected, library_of, loud
from runtime.errors import RuntimeFault
from runtime.estimators.choice.default_friction import DEFAULT_COLUMNS, choose_default_friction
from runtime.estimators.choice.friction_choice import choose_friction
from runtime.estimators.regression.samples import samples_of
from runtime.identification import metrics
from runtime.identification.identified import Identification
from runtime.identification.prepared_log import usable_columns
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify_recording as fit
from runtime.inspection import Finding, inspect_log
from runtime.library import Library, load
from runtime.recording import Friction, Recording, read_recording
from runtime.recording.preprocessing import prepare
from symgen.chain import ChainOptions
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.robots import ONE_LEVEL
from tests.runtime.faults import FAULTS
from tests.runtime.virtual_arms import WALL, Arm, cobot, wall_arm

CLEAN = "clean"
RIGHT, OTHER = "named", "not named"
REAL = (("panda_gaz", "fr3"), ("tx40_figaroh", "tx40"), ("lwr4_flobaroid", "kuka_lwr4"))
"""Published logs with their recipes, and the robots that they are of."""


def study(shared: Path, seed: int | None) -> list[Row]:
    """Inspect the clean logs and all faulty ones."""
    seeds = {} if seed is None else {"seed": seed}
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        arms = virtual_arms(shared / "models", root)
        rows = [row for name, arm_of in arms.items() for row in _rows(name, arm_of(**seeds))]
        for name, robot in REAL:
            lib = library_of(robot, shared, root)
            rows.append(
                _row(name, CLEAN, loud([*inspect_log(shared / "data" / name, lib, name).findings]))
            )
        return rows


def virtual_arms(models: Path, root: Path) -> dict[str, Callable[..., Arm]]:
    """What makes the two virtual robots."""
    ur10, xarm7 = models / "universal_robots/ur10_robot.urdf", models / "xarm7/xarm7.urdf"
    return {
        "cobot": partial(cobot, load("ur5e"), ur10),
        "arm on a wall": partial(wall_arm, on_a_wall(models, root), xarm7),
    }


def on_a_wall(models: Path, root: Path) -> Library:
    """A KUKA iiwa 14 with gravity along +x of its base."""
    options = ChainOptions(gravity=WALL, snap=1e-4)  # its URDF rounds angles to four digits
    urdf = (models / "iiwa14/iiwa14_uebersax.urdf").read_text(encoding="utf-8")
    return load(build(BuildRequest("iiwa14_wall", urdf, options), root, levels=ONE_LEVEL).folder)


def _rows(robot: str, arm: Arm) -> Iterator[Row]:
    """The clean log, then every fault."""
    yield _row(robot, CLEAN, loud(inspected(arm.log.arrays, arm.lib, arm.log.recipe)))
    for fault in FAULTS:
        log = fault.put(arm)
        findings = loud(inspected(log.arrays, arm.lib, log.recipe))
        right = any(f.kind in fault.kinds and fault.states(arm, f) for f in findings)
        yield _row(robot, fault.name, findings, right)


def _row(robot: str, fault: str, findings: list[Finding], right: bool = False) -> Row:
    is_right = right or (fault == CLEAN and not findings)
    return Row(robot, tuple(f.kind for f in findings), fault, RIGHT if is_right else OTHER)


def sheet(rows: list[Row]) -> Sheet:
    """One line per fault, one column per virtual robot, then the counts."""
    robots = list(dict.fromkeys(row.log for row in rows if row.fault != CLEAN))
    found = {(row.log, row.fault): row for row in rows}
    faults = [each.name for each in FAULTS]
    lines = [(name, *(_cell(found[r, name]) for r in robots)) for name in (CLEAN, *faults)]
    right = [sum(found[robot, name].outcome == RIGHT for name in faults) for robot in robots]
    lines.append(("named rightly", *(f"**{count} of {len(faults)}**" for count in right)))
    real = [row for row in rows if row.log not in robots]
    said = ", ".join(f"`{row.log}` {', '.join(row.kinds) or 'none'}" for row in real)
    below = f"\nWarnings and errors on real logs with their recipes: {said}."
    return Sheet("fault_table", ("fault", *robots), lines, rows, below=below)


def _cell(row: Row) -> str:
    """Findings of one log; those that do not name the fault are marked."""
    return (row.shown or "no warning") + ("" if row.outcome == RIGHT else f" ({OTHER})")


METHODS = ("map", "pc-ols", "adam", "ols", "wls")
COLUMNS: dict[str, tuple[str, ...]] = {
    "none": (),
    "viscous,coulomb": ("viscous", "coulomb"),
    "+ offset": ("offset", "viscous", "coulomb"),
    "+ rotor": ("offset", "viscous", "coulomb", "rotor"),
    "+ rotor, stribeck": ("offset", "viscous", "coulomb", "rotor", "stribeck"),
    "+ rotor, load": ("offset", "viscous", "coulomb", "rotor", "load"),
    "+ rotor, asymmetric": ("offset", "viscous", "coulomb", "rotor", "asymmetric"),
}
DEFAULT, AUTO = "default", "auto"
OTHER_MOTION = 100  # added to the seed of a robot for the motion that is predicted


@dataclass(frozen=True, slots=True)
class Error:
    """Error of one setting on one robot."""

    robot: str
    method: str
    friction: str  # name of the friction model
    columns: tuple[str, ...]  # its columns
    error: float  # of the torque on the other motion, percent; NaN where the method refuses


def defaults(shared: Path, methods: tuple[str, ...] = METHODS) -> list[Error]:
    """Fit every setting to the training log of both robots."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        arms = virtual_arms(shared / "models", root).items()
        return [
            error
            for seed, (robot, arm_of) in enumerate(arms, 1)
            for error in _errors(
                robot, arm_of(), arm_of(motion_seed=seed + OTHER_MOTION), methods, root
            )
        ]


def _errors(
    robot: str, arm: Arm, unseen: Arm, methods: tuple[str, ...], root: Path
) -> Iterator[Error]:
    """Every setting on one robot."""
    lib = arm.lib
    train, test = (_recording(each, arm, root) for each in (arm, unseen))
    default = choose_default_friction(train, lib, allowed=usable_columns(["map"])).terms
    coulomb = choose_default_friction(train, lib, allowed=DEFAULT_COLUMNS).terms
    plain = Friction(COLUMNS["+ rotor"], coulomb.coulomb_speed)
    models = {DEFAULT: default} | {
        name: replace(plain, columns=names) for name, names in COLUMNS.items()
    }
    models[AUTO] = choose_friction(train, lib, extra=("rotor",)).chosen.terms
    for name, terms in models.items():
        for method in methods if name != DEFAULT else ("map",):
            try:
                wanted = Settings(method=method, friction=terms, certify=False, refit=True)
                error = _error(fit(train, lib, wanted), test)
            except RuntimeFault:
                error = float("nan")
            yield Error(robot, method, name, terms.columns, error)


def _recording(arm: Arm, first: Arm, root: Path) -> Recording:
    """The log of an arm, with the preparation that `inspect` proposes for the first one."""
    np.savez(root / "first.npz", **first.log.arrays)
    plan = inspect_log(root / "first.npz", arm.lib, first.log.recipe).plan.replace(friction=None)
    np.savez(root / "log.npz", **arm.log.arrays)
    return read_recording(root / "log.npz", plan)


def _error(result: Identification, test: Recording) -> float:
    """Overall torque error on another recording, percent."""
    rows = prepare(test, None, result.friction, lib=result.lib)
    samples = samples_of(rows, result.lib)
    return float(metrics.torque_error(samples.tau, result.predict_samples(samples)).overall)


def defaults_sheet(rows: list[Error]) -> Sheet:
    """One line per friction model, one column per robot and method, then the distances."""
    robots = list(dict.fromkeys(row.robot for row in rows))
    methods = list(dict.fromkeys(row.method for row in rows))
    errors = {(row.robot, row.friction, row.method): row.error for row in rows}
    pairs = [(robot, method) for robot in robots for method in methods]
    lines = [
        (name, *(_percent(errors.get((robot, name, method))) for robot, method in pairs))
        for name in dict.fromkeys(row.friction for row in rows)
    ]
    said = [_distance(robot, [row for row in rows if row.robot == robot]) for robot in robots]
    head = ("friction", *(f"{robot}, {method}" for robot, method in pairs))
    return Sheet("default_table", head, lines, rows, below="\n".join(["", *said]))


def _percent(error: float | None) -> str:
    return "" if error is None else "refused" if np.isnan(error) else f"{error:.2f}"


def _distance(robot: str, rows: list[Error]) -> str:
    """Default against the best setting of one robot."""
    default = next(row for row in rows if row.friction == DEFAULT)
    best = min((row for row in rows if not np.isnan(row.error)), key=lambda row: row.error)
    return (
        f"On the {robot} the default ({', '.join(default.columns) or 'no friction'}) has "
        f"{default.error:.2f} %, the best setting ({best.method}, {best.friction}) "
        f"{best.error:.2f} %: {100 * (default.error / best.error - 1):.1f} % above the best."
    )
