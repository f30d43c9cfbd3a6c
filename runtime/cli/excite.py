"""`symgen excite`: one motion, the shortest session, several motions, or poses at rest."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.progress import Progress

from runtime.campaign.shortest_session import (
    ModelError,
    PlannedSession,
    shortest_session,
    target_of,
)
from runtime.cli.common import open_robot
from runtime.cli.excite_settings import (
    POSES,
    ExciteSettings,
    planned_noise,
    require_gain_error,
    torque_sentence,
)
from runtime.cli.motion_output import (
    SAMPLED,
    SessionPlan,
    certified_stages,
    json_path,
    session_plan,
)
from runtime.common.files import replacing, require_unused
from runtime.common.settings import settings_place
from runtime.common.tables import Table
from runtime.common.terminal import console, say, show
from runtime.excitation import COST_SAMPLES, Trajectory
from runtime.excitation.limits.constraints import FIT_PROXIES
from runtime.excitation.limits.safety import Safety, unchecked
from runtime.excitation.proof.certificate import certified, pulled_inside
from runtime.excitation.search.design import (
    Design,
    design,
    design_several,
    torque_sigma,
    variation_count,
    with_motion,
    write_trajectory,
)
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import FRICTION, Information
from runtime.excitation.search.prediction import (
    Prediction,
    predict,
    unit_payload_sentence,
    without_unseen,
)
from runtime.excitation.search.single_start import TRIED
from runtime.excitation.static_poses import RANDOM_SETS, design_poses, pose_json, pose_table
from runtime.library import Library
from runtime.library.manifest import common_unit, torque_units
from runtime.outputs.report.motion_figures import profile_of, write_pictures


@contextmanager
def search_progress(criterion: str, starts: int) -> Iterator[Callable[[int, float, float], None]]:
    """Bar of a search."""
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("excitation", total=starts + variation_count(criterion, starts))

        def report(done: int, value: float, best: float) -> None:
            after = f", {done - starts} variations of the best" if done > starts else ""
            text = f"{min(done, starts)} starts{after}: {criterion} {value:.4g}, best {best:.4g}"
            progress.update(task, completed=done, description=text)

        yield report


def search_notes(best: Design, budget: float | None, starts: int) -> tuple[str, ...]:
    """Sentences about starts that were not made, and about starts that were given up."""
    notes, count = [], len(best.conditions)
    descents = count + len(best.variations)
    if count < starts:
        reason = "interrupted" if budget is None else f"budget of {budget:g} s"
        first = "; the first start is made in full however long it takes" if count == 1 else ""
        notes.append(f"{reason}: {count} of {starts} starts" + first * (budget is not None))
    if best.behind:
        bounds = " or ".join(f"{100 * far:g} % after {steps} steps" for steps, far in TRIED)
        notes.append(
            f"given up: {best.behind} of {descents} starts and variations, behind the best of the "
            f"rounds before by more than {bounds}"
        )
    return tuple(notes)


def print_design(optimum: Design, expected: Prediction, lib: Library, note: str) -> None:
    """Print the criteria of a design, their spread over the starts, and the expected accuracy."""
    say(
        f"condition number {optimum.condition:.4f} of the column-normalised base regressor "
        f"({len(lib.base_columns)} columns, {COST_SAMPLES} samples)"
    )
    spreads = {"cond": optimum.conditions}
    if optimum.criterion != "cond":
        spreads = {f"{optimum.criterion} ({optimum.unit})": optimum.values, **spreads}
    for label, values in spreads.items():
        say(
            f"starts, {label}: best {min(values):.4g}, median {np.median(values):.4g}, "
            f"worst {max(values):.4g}"
        )
    if optimum.variations:
        best = min(optimum.variations)
        say(f"{len(optimum.variations)} variations of the best starts, cond: best {best:.4g}")
    units = torque_units(lib.manifest)
    show(criteria_table(expected, units))
    say(torque_sentence(expected.torque, units))
    if expected.payload_mass is not None and expected.payload_com is not None:
        say(unit_payload_sentence(expected.payload_mass, expected.payload_com))
    for sentence in expected.notes:
        say(f"note: {sentence}")
    if note:
        say(note)
    for assumption in optimum.assumptions:
        say(f"note: {assumption}")


def criteria_table(prediction: Prediction, units: Sequence[str]) -> Table:
    """All criteria, for each set of unknowns and each number of samples."""
    unknowns = "payload" if prediction.payload_only else "base"
    prior = ", with earlier logs" if prediction.known.earlier is not None else ""
    sigma = prediction.known.noise
    noise = f"{sigma.min():g}" + ("" if np.ptp(sigma) == 0 else f"–{sigma.max():g}")
    rows = tuple(
        (
            f"{score.columns} = {unknowns}" + (" + friction" if score.friction else ""),
            str(score.samples),
            f"{score.condition:.3f}",
            f"{100 * score.relative_error:.2f}",
            f"{1000 * score.torque_error:.2f}",
            f"{score.half_axis:.3g}",
        )
        for score in prediction.scores
    )
    return Table(
        ("columns", "samples", "cond", "A %", f"V {common_unit(units, 'm')}", "D"),
        rows,
        title=f"expected at {noise} {common_unit(units)} of torque noise, "
        f"{prediction.known.rate:g} Hz{prior}; cond: unit columns",
    )


def excite_one(
    lib: Library,
    given: ExciteSettings,
    chosen: DesignSettings,
    planned: Information,
    path: Path,
    note: str,
) -> None:
    """Design one motion with its ways and write it; print what its log will show."""
    given.require_new(path, given.pictures)
    ways = session_plan(lib, given, chosen.home, chosen.safety, given.share, given.zero_jerk)
    session: PlannedSession | None = None
    with search_progress(chosen.criterion, given.starts) as report:
        search = {"progress": report, **given.search}
        if given.until is None:
            best = design(lib, chosen, **search)
        else:
            require_gain_error(given.gain_error)
            error, target = ModelError(gain=given.gain_error), target_of(given.until)
            session = shortest_session(lib, target, chosen, planned, error, ways.around, **search)
            best = session.design
    facts = None
    if session is not None:
        whole = ways.around(best.trajectory).duration
        facts = {"promise": session.facts() | {"session_s": whole}}
    optimum = replace(best, trajectory=pulled_inside(lib, best.trajectory, share=given.share))
    expected = predict(lib, optimum.trajectory, planned, planned.friction or FRICTION)
    write_trajectory(optimum, lib, path, expected, ways.parts, facts)
    motion = certified(lib, ways.around(optimum.trajectory), optimum.safety)
    sentence = f"Designed by symgen, condition number {optimum.condition:.4f}."
    written = [path, *given.write_samples(motion, path, sentence)]
    if given.pictures:
        written += write_pictures(profile_of(motion), path.with_suffix(".png"))
    print_design(optimum, expected, lib, note)
    notes = [*search_notes(optimum, given.budget, given.starts)]
    taken = optimum.trajectory.duration
    if session is None and taken != given.duration:
        notes.append(
            f"note: {given.duration:g} s would break a limit, so the motion takes {taken:g} s"
        )
    if session is None and not lib.pairs:
        notes.append(
            f"note: '{lib.name}' has no collision proxies, so collisions between its links and "
            f"with its surroundings are not checked; {FIT_PROXIES}"
        )
    notes += ways.sentences(optimum.trajectory)
    if session is not None:
        notes += session_notes(ways, session)
    for each in notes:
        say(each)
    given.write_stages(motion, path, written)


def session_notes(ways: SessionPlan, session: PlannedSession) -> tuple[str, ...]:
    """Sentences on the shortest session: its error, its duration, and what was tried."""
    motion = session.design.trajectory
    whole = ways.around(motion).duration
    seconds = f"session: {_times(ways, motion)} = {whole:.3g} s"
    if session.facts()["runs"] > 1:
        seconds += f", twice: {2 * whole:.3g} s"
    shown, attempts = session.target.shown, sorted(session.attempts.items())
    tried = ", ".join(f"{taken:.3g} s {shown(sigma)}" for taken, sigma in attempts)
    return (session.sentence(), seconds, f"tried: {tried}")


def _times(ways: SessionPlan, motion: Trajectory) -> str:
    parts = {"approach": ways.parts.get("approach"), "motion": motion}
    parts["return"] = ways.parts.get("return")
    return " + ".join(
        f"{name} {0.0 if part is None else part.duration:.3g} s" for name, part in parts.items()
    )


def excite_several(
    lib: Library, given: ExciteSettings, settings: DesignSettings, known: Information, place: Path
) -> None:
    """Design several motions, print what their logs will show together, and write them."""
    count = given.motions
    paths = [place.with_name(f"{place.stem}-{k}.json") for k in range(1, count + 1)]
    names = [p for one in paths for p in (one, one.with_suffix(SAMPLED))]
    consent = "--settings overwrite=true"
    require_unused([*names, settings_place(place)], given.overwrite, consent=consent)
    written = []
    designs = design_several(lib, settings, count, **given.search)
    unit = common_unit(torque_units(lib.manifest), "m")
    for k, (path, designed) in enumerate(zip(paths, designs, strict=True), 1):
        optimum = replace(
            designed, trajectory=pulled_inside(lib, designed.trajectory, share=settings.margin)
        )
        expected = predict(lib, optimum.trajectory, known, known.friction or FRICTION)
        known = with_motion(lib, optimum.trajectory, known)
        write_trajectory(optimum, lib, path, expected)
        motion = certified(lib, optimum.trajectory, settings.safety)
        sentence = f"Designed by symgen, motion {k} of {count}."
        written += [path, *given.write_samples(motion, path, sentence)]
        sigma = torque_sigma(lib, optimum.trajectory.home, known)
        say(
            f"motion {k}: {optimum.trajectory.duration:.4g} s; expected σ of the torque of motions "
            f"never seen, by the logs so far: {1e3 * sigma:.4g} {unit}"
        )
        certified_stages(motion, given.percents)
    say(f"trajectories: {', '.join(map(str, written))}")


def excite_static(lib: Library, safety: Safety, given: ExciteSettings) -> Path:
    """Design poses and write them as JSON and CSV; return the path of the JSON."""
    path = json_path(given.out or Path("results") / f"{lib.name}-static.json")
    table = path.with_suffix(".csv")
    consent = "--settings overwrite=true"
    require_unused((path, table, settings_place(path)), given.overwrite, consent=consent)
    noise, count = planned_noise(lib, given.noise), POSES if given.poses is None else given.poses
    share = 1.0 if given.margin is None else given.margin
    designed = design_poses(lib, count, safety, noise.sigma, share, given.starts, given.seed)
    for place, content in ((path, pose_json(designed, lib)), (table, pose_table(designed, lib))):
        with replacing(place) as file:
            file.write(content)
    unit = common_unit(torque_units(lib.manifest))
    say(
        f"{len(designed.poses)} poses, each reached from both sides, determine "
        f"{len(designed.columns)} gravity parameters to {designed.sigma:.3g} kg·m (RMS σ) and the "
        f"gravity torque to {designed.torque:.3g} {unit}; {RANDOM_SETS} sets of as many random "
        f"poses reach {designed.sigma_random:.3g} kg·m and {designed.torque_random:.3g} "
        f"{unit} (mean)"
    )
    for sentence in designed.assumptions:
        say(f"assumed: {sentence}")
    left = [kind for kind in unchecked(lib, safety) if not (kind == "table" and given.has_no_table)]
    for kind in (*left, "the way from one pose to the next"):
        say(f"NOT checked: {kind}")
    say(f"poses: {path}, {table}")
    return path


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
    chosen, planned, unseen = without_unseen(lib, chosen, planned)
    if unseen:
        say(unseen)
    if given.motions > 1:
        excite_several(lib, given, chosen, planned, path)
    else:
        excite_one(lib, given, chosen, planned, path, note)
    given.write(path)
