"""What `symgen excite` writes and prints of a designed motion, and its progress before that."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.progress import Progress

from runtime.cli.approach_options import SessionPlan
from runtime.cli.common import console, say
from runtime.cli.design_tables import print_design
from runtime.cli.motion_output import (
    certified_stages,
    designed_by,
    export_stages,
    write_motion_log,
)
from runtime.excitation import Design, Information, predict
from runtime.excitation.motion_profile import profile_of
from runtime.excitation.proof.certified_motion import certified, pulled_inside
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import FRICTION
from runtime.excitation.search.unseen_parameters import without_unseen
from runtime.excitation.search.variations import variation_count
from runtime.excitation.trajectory_file import write_trajectory
from runtime.library import Library


@dataclass(frozen=True, slots=True)
class MotionFiles:
    """Files of a designed motion.

    Attributes:
        path: JSON of the motion, from which the other names follow.
        rate: of the sampled motion, Hz.
        formats: of --export; none writes a CSV.
        export_rate: of --export-rate, Hz; None is that of each format.
        speeds: stages, shares of the designed speed.
        pictures: PNG files too.
        accepted: limits that the user allowed to stay unchecked.
    """

    path: Path
    rate: float
    formats: Sequence[str]
    export_rate: float | None
    speeds: Sequence[float]
    pictures: bool
    accepted: Sequence[str]


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


def with_shown_unknowns(
    lib: Library, settings: DesignSettings, planned: Information
) -> tuple[DesignSettings, Information]:
    """Settings and information without parameters that no motion shows, which a note names."""
    settings, planned, note = without_unseen(lib, settings, planned)
    if note:
        say(note)
    return settings, planned


def write_design(
    lib: Library,
    optimum: Design,
    planned: Information,
    ways: SessionPlan,
    files: MotionFiles,
    *,
    promise: dict[str, Any] | None,
    note: str,
    sentences: Callable[[Design], Sequence[str]],
    margin: float,
) -> None:
    """Write a designed motion; print its criteria, certificate and the names of its files."""
    optimum = replace(optimum, trajectory=pulled_inside(lib, optimum.trajectory, share=margin))
    expected = predict(lib, optimum.trajectory, planned, planned.friction or FRICTION)
    write_trajectory(optimum, lib, files.path, expected, ways.parts, promise)
    motion = certified(lib, ways.around(optimum.trajectory), optimum.safety)
    written = [files.path]
    if not files.formats:
        table = files.path.with_suffix(".csv")
        written.append(write_motion_log(motion, files.rate, table, designed_by(optimum)))
    if files.pictures:
        from runtime.outputs.report.motion_figures import write_pictures  # matplotlib loads slowly

        written += write_pictures(profile_of(motion), files.path.with_suffix(".png"))
    print_design(optimum, expected, lib, note)
    for sentence in sentences(optimum):
        say(sentence)
    stages = certified_stages(motion, files.speeds)
    say(f"trajectory: {', '.join(map(str, written))}")
    if files.formats:
        base = files.path.with_suffix("")
        export_stages(stages, base, files.formats, files.export_rate, files.accepted)
