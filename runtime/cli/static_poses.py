"""`symgen excite --settings static=true`: poses at rest in place of a motion."""

from pathlib import Path

from runtime.cli.excite_settings import POSES, ExciteSettings
from runtime.cli.motion_output import json_path
from runtime.cli.planned_log import planned_noise
from runtime.common.files import replacing, require_unused
from runtime.common.settings import settings_place
from runtime.common.terminal import say
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


def excite_static(lib: Library, safety: Safety, given: ExciteSettings) -> Path:
    """Design poses and write them as JSON and CSV; return the path of the JSON."""
    path = json_path(given.out or Path("results") / f"{lib.name}-static.json")
    table = path.with_suffix(".csv")
    consent = "--settings overwrite=true"
    require_unused((path, table, settings_place(path)), given.overwrite, consent=consent)
    noise = planned_noise(lib, given.noise)
    designed = design_poses(
        lib,
        POSES if given.poses is None else given.poses,
        safety,
        noise.sigma,
        1.0 if given.margin is None else given.margin,
        given.starts,
        given.seed,
    )
    for place, content in ((path, pose_json(designed, lib)), (table, pose_table(designed, lib))):
        with replacing(place) as file:
            file.write(content)
    say(accuracy_sentence(designed, common_unit(torque_units(lib.manifest))))
    for sentence in designed.assumptions:
        say(f"assumed: {sentence}")
    left = [kind for kind in unchecked(lib, safety) if not (kind == "table" and given.has_no_table)]
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
