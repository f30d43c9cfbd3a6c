"""Designs of `scripts/bench_excitation --goals`: results, times and certificates."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.compiled import processor
from bench.front import Sheet, cpu_seconds, sheet_of
from runtime.common.threads import cores
from runtime.excitation.limits.safety import Safety
from runtime.excitation.proof.certificate import certificate_of
from runtime.excitation.proof.certified_motion import pulled_inside
from runtime.excitation.search.design import design
from runtime.excitation.search.information import information
from runtime.excitation.search.prediction import predict
from runtime.library import Library

NOISE, RATE = 0.05, 100.0  # torque noise, N·m, and rate, Hz, of the expected errors
SAMPLES = 1000  # samples of the expected errors; cond is of the cost's samples, as in the document
ALL = Safety(table=0.0)  # every limit of the robot and a table at the height of its base


@dataclass(frozen=True, slots=True)
class Goal:
    """A problem and what its design has to reach."""

    name: str  # for --only and in JSON
    label: str  # in tables
    duration: float  # duration, harmonics, starts, criterion, safety: of the design
    harmonics: int
    starts: int
    criterion: str = "cond"
    safety: Safety | None = None
    condition: float | None = None  # bound of its condition number
    seconds: float | None = None  # bound of the wall time
    relative_error: float | None = None  # relative_error, torque_error: bounds of A, %, and V, mN·m
    torque_error: float | None = None


GOALS = (
    Goal("v", "document's limits, M 5, criterion v", 10, 5, 8, "v"),
    Goal("a", "document's limits, M 5, criterion a", 10, 5, 8, "a"),
    Goal("d", "document's limits, M 5, criterion d", 10, 5, 8, "d"),
    Goal("mixed", "document's limits, M 5, criterion mixed", 10, 5, 8, "mixed"),
    Goal("document-24", "document's limits, M 5", 10, 5, 24, condition=4.25, seconds=20),
    Goal("document-100", "document's limits, M 5", 10, 5, 100, condition=4.0),
    Goal("document-100-20", "document's limits, M 5", 20, 5, 100, condition=3.4),
    Goal("document-10", "document's limits, M 10", 10, 10, 24, condition=3.1),
    Goal("document-10-20", "document's limits, M 10", 20, 10, 24, condition=2.55),
    Goal("safe", "all limits and a table, M 5", 10, 5, 24, "cond", ALL, 4.9, 60),
    Goal("safe-20", "all limits and a table, M 5", 20, 5, 24, "cond", ALL, 3.9, 60),
    Goal(
        *("default", "all limits and a table, M 8, default criterion", 20, 8, 24, "mixed", ALL),
        condition=4.0,
        relative_error=1.5,
        torque_error=5.5,
    ),
)


COLUMNS = {
    **{"problem": "{label}", "t_f s": "{duration:g}", "starts": "{starts}"},
    **{"cond": "{condition:.3f}", "median": "{median:.2f}", "A %": "{relative_error:.2f}"},
    **{"V mN·m": "{torque_error:.2f}", "wall s": "{wall:.0f}", "CPU s": "{cpu:.0f}"},
    **{"certified": "{certified}", "goal": "{goal}"},
}
KEYS = 3  # number of first columns that name a row


def measure(lib: Library, goals: tuple[Goal, ...], seed: int, say: Callable[[str], None]) -> Sheet:
    """Design for every goal, on as many processes as there are cores."""
    rows = []
    for goal in goals:
        row = _reached(lib, goal, seed, say)
        say(f"{goal.name}: cond {row['condition']:.3f} in {row['wall']:.0f} s")
        rows.append(row)
    title = f"{lib.name}: best of the starts, {processor()}"
    caption = (
        "cond: column-normalised base regressor at 80 samples. A: RMS relative error of the "
        "base parameters, V: RMS error of the torque on unseen motions, both expected of "
        f"least squares at {NOISE:g} N·m and {RATE:g} Hz. Wall time on as many processes as "
        "there are cores, their start included."
    )
    return sheet_of("bench_excitation_goals", COLUMNS, rows, title=title, caption=caption)


def _reached(lib: Library, goal: Goal, seed: int, say: Callable[[str], None]) -> dict[str, Any]:
    """What a design reached; its duration is longer where the motion had to be slowed."""

    def report(done: int, value: float, best: float) -> None:
        say(f"{goal.name}: descent {done}, {value:.4g}, best {best:.4g}")

    known = information(lib, NOISE, RATE)
    cpu, wall = cpu_seconds(), time.perf_counter()
    result = design(
        lib,
        duration=goal.duration,
        harmonics=goal.harmonics,
        starts=goal.starts,
        seed=seed,
        progress=report,
        processes=cores(),
        criterion=goal.criterion,
        information=None if goal.criterion == "cond" else known,
        safety=goal.safety,
    )
    cpu, wall = cpu_seconds() - cpu, time.perf_counter() - wall
    trajectory = pulled_inside(lib, result.trajectory)
    scores = predict(lib, trajectory, known).scores
    score = next(s for s in scores if s.samples == SAMPLES and not s.friction)
    relative, torque = 100 * score.relative_error, 1e3 * score.torque_error
    bounds = (
        ("cond", "", result.condition, goal.condition),
        ("", " s", wall, goal.seconds),
        ("A", " %", relative, goal.relative_error),
        ("V", " mN·m", torque, goal.torque_error),
    )
    wanted = [
        f"{name} ≤ {most:g}{unit}{' (missed)' if value > most else ''}".strip()
        for name, unit, value, most in bounds
        if most is not None
    ]
    return {
        **{
            "name": goal.name,
            "label": goal.label,
            "starts": goal.starts,
            "goal": ", ".join(wanted),
        },
        **{
            "duration": trajectory.duration,
            "condition": result.condition,
            "wall": wall,
            "cpu": cpu,
        },
        "median": float(np.median(result.conditions)),
        **{"relative_error": relative, "torque_error": torque},
        "certified": "yes" if certificate_of(lib, trajectory, goal.safety).holds else "NO",
    }
