"""`symgen excite`.

`symgen excite --settings static=true`: poses at rest in place of a motion.
"""

from collections.abc import Iterator
from pathlib import Path

from runtime.cli.approach import session_plan
from runtime.cli.common import open_robot
from runtime.cli.designed_motion import (
    design_notes,
    excite_several,
    search_notes,
    search_progress,
    searched,
    with_shown_unknowns,
    write_design,
)
from runtime.cli.excite_settings import POSES, ExciteSettings
from runtime.cli.motion_output import json_path
from runtime.cli.planned_log import planned_noise
from runtime.common.files import replacing, require_unused
from runtime.common.settings import settings_place
from runtime.common.terminal import say
from runtime.excitation.limits.safety import Safety, unchecked
from runtime.excitation.search.design import Design
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


def excite_command(given: ExciteSettings) -> None:
    r"""Design an excitation motion within all limits of a robot.

    \b
    symgen excite --robot fr3 --duration 10 --settings starts=10
    symgen excite --settings home=0,-0.79,0,-2.36,0,1.57,0.79 --table 0 --box 0.2,0.8,-0.5,0.5,0.1,1
    symgen excite --export libfranka --speed 10 --speed 50 --speed 100
    symgen excite --carry 1.8,0,0,0.1,0.1,0.1,0.2
    symgen excite --table 0 --obstacles cell.toml --from last.npz --return --export ros
    symgen excite --duration 40 --noise last.npz --settings motions=4 --settings cutoff=10
    symgen excite --settings static=true --settings poses=12 --table 0
    symgen excite --until "payload 5 g" --from home --return --table 0

    The motion makes the base parameters identifiable with the least error (--criterion). It
    respects every limit that the robot states: position, velocity (lower near the ends of the
    range), acceleration, torque and its rate, speed of the tip, distances between links; with
    --table, --box and --obstacles also those. --from adds the way from the present pose to the
    start under the same limits, --return the way back.

    Printed are all criteria with the standard deviations that a log will give, without and with
    friction (viscous, Coulomb, offset) as further unknowns; then the certificate: the largest use
    of every limit over continuous time, not only at the samples, and what was NOT checked.

    Written: the motion as JSON, and sampled as CSV or in the formats of --export. Ctrl-C keeps
    the best start so far. The result depends on the setting seed, not on processes.
    """
    given.require_meaning()
    lib = open_robot(given.robot, given.yes)
    safety = None if given.document else given.limits(lib)
    if given.static and safety is not None:
        given.write(excite_static(lib, safety, given))
        return
    path = json_path(given.out or Path("results") / f"{lib.name}-excite.json")
    chosen, planned, note = given.designed(lib, safety)
    given.require_possible(lib, given.duration, safety)
    chosen, planned = with_shown_unknowns(lib, chosen, planned)
    if given.motions > 1:
        excite_several(lib, given, chosen, planned, path)
        given.write(path)
        return
    given.require_new(path, given.pictures)
    ways = session_plan(lib, given, chosen.home, safety, given.share, given.zero_jerk)
    with search_progress(chosen.criterion, given.starts) as report:
        optimum, session, of_session = searched(lib, given, chosen, ways, planned, report)

    def sentences(best: Design) -> Iterator[str]:
        yield from search_notes(best, given.budget, given.starts)
        if given.until is None:
            yield from design_notes(lib, given.duration, best.trajectory.duration)
        yield from ways.sentences(best.trajectory)
        yield from of_session

    write_design(lib, optimum, planned, ways, given, path, session, note, sentences)
    given.write(path)
