"""The run behind `scripts/default_table`: defaults of `identify` beside other settings.

A setting is fitted to one log of each virtual robot (`tests.runtime.virtual_arms`) and predicts the
torque of another motion of the same robot. Preparation of both logs is that which `inspect`
proposes for the first.
"""

import dataclasses
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.faults import on_a_wall
from bench.front import Sheet
from runtime.cli.prepared_log import usable_columns
from runtime.errors import RuntimeFault
from runtime.estimators.choice.default_friction import DEFAULT_COLUMNS, choose_default_friction
from runtime.estimators.choice.friction_choice import choose_friction
from runtime.estimators.regression.samples import samples_of
from runtime.identification import metrics
from runtime.identification.identified import Identification
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify
from runtime.inspection import inspect_log
from runtime.library import load
from runtime.recording import Friction, Recording, read_recording
from runtime.recording.preprocessing import prepare
from tests.runtime.virtual_arms import Arm, cobot, wall_arm

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
OTHER_MOTION = 100
"""Added to the seed of a robot for the motion that is predicted."""


@dataclass(frozen=True, slots=True)
class Row:
    """Error of one setting on one robot."""

    robot: str
    method: str
    friction: str  # name of the friction model
    columns: tuple[str, ...]  # its columns
    error: float  # of the torque on the other motion, percent; NaN where the method refuses


def study(shared: Path, methods: tuple[str, ...] = METHODS) -> list[Row]:
    """Fit every setting to the training log of both robots."""
    models = shared / "models"
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        wall = on_a_wall(models, root)
        ur10, xarm7 = models / "universal_robots/ur10_robot.urdf", models / "xarm7/xarm7.urdf"

        def first(motion_seed: int | None) -> Arm:
            return cobot(load("ur5e"), ur10, motion_seed=motion_seed)

        def second(motion_seed: int | None) -> Arm:
            return wall_arm(wall, xarm7, motion_seed=motion_seed)

        return [
            *_rows("cobot", first, 1 + OTHER_MOTION, methods, root),
            *_rows("arm on a wall", second, 2 + OTHER_MOTION, methods, root),
        ]


def _rows(
    robot: str,
    arm_of: Callable[[int | None], Arm],
    other: int,
    methods: tuple[str, ...],
    root: Path,
) -> Iterator[Row]:
    """Every setting on one robot."""
    arm, unseen = arm_of(None), arm_of(other)
    lib = arm.lib
    train, test = (_recording(each, arm, root) for each in (arm, unseen))
    default = choose_default_friction(train, lib, allowed=usable_columns(["map"])).terms
    coulomb = choose_default_friction(train, lib, allowed=DEFAULT_COLUMNS).terms
    plain = Friction(COLUMNS["+ rotor"], coulomb.coulomb_speed)
    models = {DEFAULT: default} | {
        name: dataclasses.replace(plain, columns=names) for name, names in COLUMNS.items()
    }
    models[AUTO] = choose_friction(train, lib, extra=("rotor",)).chosen.terms
    for name, terms in models.items():
        for method in methods if name != DEFAULT else ("map",):
            try:
                wanted = Settings(method=method, friction_columns=terms, certify=False, refit=True)
                error = _error(identify(train, lib, wanted), test)
            except RuntimeFault:
                error = float("nan")
            yield Row(robot, method, name, terms.columns, error)


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


def sheet(rows: list[Row]) -> Sheet:
    """One line per friction model, one column per robot and method, then the distances."""
    robots = list(dict.fromkeys(row.robot for row in rows))
    methods = list(dict.fromkeys(row.method for row in rows))
    errors = {(row.robot, row.friction, row.method): row.error for row in rows}
    pairs = [(robot, method) for robot in robots for method in methods]
    lines = [
        (name, *(_cell(errors.get((robot, name, method))) for robot, method in pairs))
        for name in dict.fromkeys(row.friction for row in rows)
    ]
    said = [_distance(robot, [row for row in rows if row.robot == robot]) for robot in robots]
    head = ("friction", *(f"{robot}, {method}" for robot, method in pairs))
    return Sheet("default_table", head, lines, rows, below="\n".join(["", *said]))


def _cell(error: float | None) -> str:
    return "" if error is None else "refused" if np.isnan(error) else f"{error:.2f}"


def _distance(robot: str, rows: list[Row]) -> str:
    """Default against the best setting of one robot."""
    default = next(row for row in rows if row.friction == DEFAULT)
    best = min((row for row in rows if not np.isnan(row.error)), key=lambda row: row.error)
    return (
        f"On the {robot} the default ({', '.join(default.columns) or 'no friction'}) has "
        f"{default.error:.2f} %, the best setting ({best.method}, {best.friction}) "
        f"{best.error:.2f} %: {100 * (default.error / best.error - 1):.1f} % above the best."
    )
