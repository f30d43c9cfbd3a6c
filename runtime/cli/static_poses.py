"""`symgen excite --settings static=true`: poses at rest in place of a motion."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from runtime.cli.motion_output import CONSENT, json_path
from runtime.cli.planned_log import planned_noise
from runtime.common.files import replacing, require_unused
from runtime.common.settings import settings_place
from runtime.common.terminal import say
from runtime.errors import RuntimeFault
from runtime.excitation.limits.safety import Safety, unchecked
from runtime.excitation.static_poses import (
    RANDOM_SETS,
    PoseDesign,
    design_poses,
    pose_json,
    pose_table,
)
from runtime.library import Library
from runtime.library.manifest import common_unit, torque_units

POSES = 12
"""Default number of poses."""
Static = Annotated[
    bool,
    typer.Option(
        "--static",
        help="Poses at rest in place of a motion, for the gravity parameters of robots whose "
        "torque is coarse: each is reached from both sides, so that Coulomb friction cancels.",
    ),
]
Poses = Annotated[
    int | None,
    typer.Option(metavar="K", help=f"Number of poses of --settings static=true; default {POSES}."),
]
_APPLICABLE = {
    *("static", "poses", "robot", "yes", "starts", "seed", "out", "noise", "table", "box"),
    "obstacles",
    *("clearance", "carry", "torque_fraction", "margin", "viscous", "coulomb", "overwrite"),
    *("payload_band", "friction_band", "model_band"),
}


@dataclass(frozen=True, slots=True)
class PoseOptions:
    """Options of `excite` that apply to poses.

    Attributes:
        poses: value of the setting poses.
        out: value of --out.
        noise: value of --noise.
        margin: value of the setting margin.
        starts: value of the setting starts.
        seed: value of --seed.
        has_no_table: whether the user states that there is no table.
        overwrite: value of --overwrite.
    """

    poses: int | None
    out: Path | None
    noise: str
    margin: float | None
    starts: int
    seed: int
    has_no_table: bool
    overwrite: bool


def require_applicable(given: Mapping[str, str], static: bool) -> None:
    """Refuse choices that have no meaning beside `static`, and `poses` without it."""
    if not static:
        if "poses" in given:
            raise RuntimeFault(
                "the setting poses is the number of poses of --settings static=true; give "
                "--settings static=true too"
            )
        return
    if other := sorted(given.keys() - _APPLICABLE):
        option = given[other[0]]
        raise RuntimeFault(
            f"--settings static=true designs poses at rest, to which {option} does not apply; "
            f"leave it out"
        )


def excite_static(lib: Library, safety: Safety, options: PoseOptions) -> Path:
    """Design poses and write them as JSON and CSV; return the path of the JSON."""
    path = json_path(options.out or Path("results") / f"{lib.name}-static.json")
    table = path.with_suffix(".csv")
    require_unused((path, table, settings_place(path)), options.overwrite, consent=CONSENT)
    noise = planned_noise(lib, options.noise)
    designed = design_poses(
        lib,
        POSES if options.poses is None else options.poses,
        safety,
        noise.sigma,
        1.0 if options.margin is None else options.margin,
        options.starts,
        options.seed,
    )
    for place, content in ((path, pose_json(designed, lib)), (table, pose_table(designed, lib))):
        with replacing(place) as file:
            file.write(content)
    say(accuracy_sentence(designed, common_unit(torque_units(lib.manifest))))
    for sentence in designed.assumptions:
        say(f"assumed: {sentence}")
    left = [
        kind for kind in unchecked(lib, safety) if not (kind == "table" and options.has_no_table)
    ]
    for kind in (*left, "the way from one pose to the next"):
        say(f"NOT checked: {kind}")
    say(f"poses: {path}, {table}")
    return path


def accuracy_sentence(designed: PoseDesign, unit: str) -> str:
    """Sentence on the accuracy of a design against random poses."""
    return (
        f"{len(designed.poses)} poses, each reached from both sides, determine "
        f"{len(designed.columns)} gravity parameters to {designed.sigma:.3g} kg·m (RMS σ) and the "
        f"gravity torque to {designed.torque:.3g} {unit}; {RANDOM_SETS} sets of as many random "
        f"poses reach {designed.sigma_random:.3g} kg·m and {designed.torque_random:.3g} "
        f"{unit} (mean)"
    )
