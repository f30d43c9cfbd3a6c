"""Designs of `scripts/bench_excitation --goals`: results, times and certificates."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from bench.compiled import processor
from bench.front import Sheet, cpu_seconds
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
    relative_error: float | None = None  # relative_error, torque_error: bounds of A, %, and V, N·m
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
        torque_error=5.5e-3,
    ),
)


@dataclass(frozen=True, slots=True)
class Row:
    """What a design reached."""

    goal: Goal
    duration: float  # of the trajectory, s; longer than requested where the motion had to be slowed
    condition: float
    conditions: tuple[float, ...]  # of all starts
    wall: float  # wall, cpu: seconds of the design, all processes together
    cpu: float
    processes: int
    relative_error: float  # relative_error, torque_error: A, % and V, N·m
    torque_error: float
    certified: bool  # every limit holds for every instant
    unmet: tuple[str, ...]  # bounds that it missed


def measure(lib: Library, goals: tuple[Goal, ...], seed: int, say: Callable[[str], None]) -> Sheet:
    """Design for every goal, on as many processes as there are cores."""
    rows = []
    for goal in goals:
        row = _reached(lib, goal, seed, say)
        say(f"{goal.name}: cond {row.condition:.3f} in {row.wall:.0f} s")
        rows.append(row)
    title = f"{lib.name}: best of the starts, {processor()}"
    caption = (
        "cond: column-normalised base regressor at 80 samples. A: RMS relative error of the "
        "base parameters, V: RMS error of the torque on unseen motions, both expected of "
        f"least squares at {NOISE:g} N·m and {RATE:g} Hz. Wall time on as many processes as "
        "there are cores, their start included."
    )
    facts = {"robot": lib.name, "processor": processor(), "rows": rows}
    return Sheet("bench_excitation_goals", _HEAD, [*_lines(rows)], facts, title, caption)


def _reached(lib: Library, goal: Goal, seed: int, say: Callable[[str], None]) -> Row:
    def report(done: int, value: float, best: float) -> None:
        say(f"{goal.name}: descent {done}, {value:.4g}, best {best:.4g}")

    known = information(lib, NOISE, RATE)
    processes = cores()
    cpu, wall = cpu_seconds(), time.perf_counter()
    result = design(
        lib,
        duration=goal.duration,
        harmonics=goal.harmonics,
        starts=goal.starts,
        seed=seed,
        progress=report,
        processes=processes,
        criterion=goal.criterion,
        information=None if goal.criterion == "cond" else known,
        safety=goal.safety,
    )
    cpu, wall = cpu_seconds() - cpu, time.perf_counter() - wall
    trajectory = pulled_inside(lib, result.trajectory)
    scores = predict(lib, trajectory, known).scores
    score = next(s for s in scores if s.samples == SAMPLES and not s.friction)
    proof = certificate_of(lib, trajectory, goal.safety)
    relative, torque = 100 * score.relative_error, score.torque_error
    bounds = (
        ("cond", result.condition, goal.condition),
        ("seconds", wall, goal.seconds),
        ("A", relative, goal.relative_error),
        ("V", torque, goal.torque_error),
    )
    return Row(
        goal,
        trajectory.duration,
        result.condition,
        result.conditions,
        wall,
        cpu,
        processes,
        relative,
        torque,
        proof.holds,
        tuple(name for name, value, bound in bounds if bound is not None and value > bound),
    )


KEYS = 3  # number of first columns that name a row
_HEAD = (
    *("problem", "t_f s", "starts", "cond", "median", "A %", "V mN·m", "wall s", "CPU s"),
    *("certified", "goal"),
)


def _lines(rows: list[Row]) -> Iterator[tuple[str, ...]]:
    for row in rows:
        goal = row.goal
        bounds = (
            ("cond", goal.condition, 1.0, ""),
            ("", goal.seconds, 1.0, " s"),
            ("A", goal.relative_error, 1.0, " %"),
            ("V", goal.torque_error, 1e3, " mN·m"),
        )
        wanted = [
            f"{name} ≤ {bound * scale:g}{unit}".strip()
            for name, bound, scale, unit in bounds
            if bound is not None
        ]
        missed = f" (missed: {', '.join(row.unmet)})" if row.unmet else ""
        yield (
            goal.label,
            f"{row.duration:g}",
            str(goal.starts),
            f"{row.condition:.3f}",
            f"{np.median(row.conditions):.2f}",
            f"{row.relative_error:.2f}",
            f"{1e3 * row.torque_error:.2f}",
            f"{row.wall:.0f}",
            f"{row.cpu:.0f}",
            "yes" if row.certified else "NO",
            f"{', '.join(wanted)}{missed}",
        )
