"""The runs behind `scripts/bench_excitation`: several optimisers, and designs with their goals.

The document's problem: min log cond of the column-normalised base regressor at 80 samples
(Eq. 3.29) under position, velocity and acceleration limits on a grid of 0.1 s. Every optimiser sets
out from the same random motions, in the same whitened unknowns, and ends with the motion pulled
inside the limits at 1 kHz. With `--goals`: designs, their times and certificates.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import minimize

from bench.compiled import processor
from bench.front import BenchError, Sheet, cpu_seconds, sheet_of
from bench.peers import parameter_order, pinocchio_in_order
from runtime.common.threads import cores, one_blas_thread
from runtime.excitation import COST_SAMPLES, ConditionCost
from runtime.excitation.limits.constraints import Limits, inside, whitening
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import fourier_basis
from runtime.excitation.proof.certificate import certificate_of, pulled_inside
from runtime.excitation.search.design import design
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import information
from runtime.excitation.search.prediction import predict
from runtime.excitation.search.single_start import START, Search
from runtime.library import Array, Library

DOCUMENT = 5.4178  # condition number that the document reached (Sec. 3.4.2)
DOCUMENT_SECONDS = 9 * 3600.0  # least time of one run of 50 iterations in the document
Cost = Callable[[Array], tuple[float, Array | None]]
"""Objective of the coefficients (n, M) and its gradient, where there is one."""
ITERATIONS = 200
"""Largest number of iterations of SLSQP on one objective; it stops at a relative change of 1e-6."""


def timed(work: Callable[[int], float], number: int) -> dict[str, float]:
    """Start `number` of an optimiser: cond within the limits at 1 kHz, processor and wall time."""
    wall, cpu = time.perf_counter(), time.process_time()
    condition = work(number)
    spent = {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}
    return {"condition": condition} | spent


def ours(lib: Library, problem: DesignSettings) -> Callable[[int], float]:
    """`runtime.excitation`'s search."""
    search = Search(lib, problem)
    finish = _finish(lib, problem)
    return lambda number: finish(search.start(number)[1])


def slsqp_exact(lib: Library, problem: DesignSettings) -> Callable[[int], float]:
    """SciPy's SLSQP with our compiled value and gradient."""
    cost = ConditionCost(lib, lib.home, problem.harmonics, problem.duration)
    return _slsqp(lib, problem, [(cost.value_gradient, ITERATIONS)])


def slsqp_staged(lib: Library, problem: DesignSettings) -> Callable[[int], float]:
    """SciPy's SLSQP through the smooth stages of our search, then on the kinked objective."""
    search = Search(lib, problem)
    stages: list[tuple[Cost, int]] = [
        (partial(search.cost.measure, measure=each), ITERATIONS) for each, _ in search.goal.stages
    ]
    return _slsqp(lib, problem, [*stages, (search.cost.value_gradient, ITERATIONS)])


def slsqp_differences(lib: Library, problem: DesignSettings) -> Callable[[int], float]:
    """SciPy's SLSQP with Pinocchio's regressor, NumPy's SVD and forward differences."""
    condition = _pinocchio_condition(lib, problem)
    return _slsqp(lib, problem, [(lambda a: (condition(a), None), ITERATIONS)])


def _slsqp(
    lib: Library, problem: DesignSettings, stages: Sequence[tuple[Cost, int]]
) -> Callable[[int], float]:
    """One start of SLSQP on objectives in turn, each from the end of the one before it."""
    matrix, bound = Limits(lib, lib.home, problem.harmonics, problem.duration).inequalities()
    spread = whitening(matrix, lib.n_joints)
    spread *= np.sqrt(len(matrix) / (3.0 * len(spread)))
    rows, shape = matrix @ spread, (lib.n_joints, problem.harmonics)
    finish = _finish(lib, problem)

    def value(cost: Cost, x: Array) -> float:
        return cost((spread @ x).reshape(shape))[0]

    def both(cost: Cost, x: Array) -> tuple[float, Array]:
        result, gradient = cost((spread @ x).reshape(shape))
        assert gradient is not None  # noqa: S101  requested only from a cost with a gradient
        return result, spread.T @ gradient.ravel()

    def start(number: int) -> float:
        rng = np.random.default_rng((problem.seed, number))
        x = rng.normal(size=len(spread))
        x *= START / np.max(rows @ x)
        limits = {"type": "ineq", "fun": lambda x: bound - rows @ x, "jac": lambda _: -rows}
        for cost, iterations in stages:
            exact = cost((spread @ x).reshape(shape))[1] is not None
            x = minimize(
                partial(both if exact else value, cost),
                x,
                jac=True if exact else None,
                method="SLSQP",
                constraints=[limits],
                options={"maxiter": iterations, "ftol": 1e-6},
            ).x
        return finish((spread @ x).reshape(shape))

    return start


def _finish(lib: Library, problem: DesignSettings) -> Callable[[Array], float]:
    fine = Limits(lib, lib.home, problem.harmonics, problem.duration, step=1e-3)
    cost = ConditionCost(lib, lib.home, problem.harmonics, problem.duration)
    return lambda a: float(np.exp(cost.value_gradient(inside(fine, a))[0]))


def _pinocchio_condition(lib: Library, problem: DesignSettings) -> Callable[[Array], float]:
    pin, model, ids, _, order = pinocchio_in_order(lib)
    data = model.createData()
    kept = parameter_order(ids)[list(lib.base_columns)]
    half = np.linspace(0.0, problem.duration, COST_SAMPLES)[: COST_SAMPLES // 2]
    basis = fourier_basis(lib, problem.harmonics, half, problem.duration)[..., :3]

    def condition(a: Array) -> float:
        motion = np.einsum("jm,tmd->dtj", a, basis)
        motion[0] += lib.home
        rows = [
            pin.computeJointTorqueRegressor(model, data, q[order], dq[order], ddq[order])[:, kept]
            for q, dq, ddq in zip(*motion, strict=True)
        ]
        w = np.vstack(rows)
        values = np.linalg.svd(w / np.linalg.norm(w, axis=0), compute_uv=False)
        return float(np.log(values[0] / values[-1]))

    return condition


OPTIMISERS = (
    ("ours", "D-opt → Schatten → semidefinite polish", ours),
    ("staged", "SLSQP, our stages and exact gradient", slsqp_staged),
    ("slsqp", "SLSQP, our exact gradient", slsqp_exact),
    ("differences", "SLSQP, differences on Pinocchio", slsqp_differences),
)


@one_blas_thread
def measure(
    lib: Library,
    starts: int,
    duration: float,
    harmonics: int,
    seed: int,
    report: Callable[[str], None],
) -> Sheet:
    """Run every optimiser from the same random motions, one start after another."""
    problem = DesignSettings(duration, harmonics, seed=seed)
    rows, skipped = list[dict[str, Any]](), dict[str, str]()
    for name, label, make in OPTIMISERS:
        try:
            work = make(lib, problem)
        except BenchError as error:
            skipped[label] = str(error)
            continue
        result = list[dict[str, float]]()
        for number in range(starts):
            result.append(timed(work, number))
            report(f"{label}: start {number + 1} of {starts}, cond {result[-1]['condition']:.3f}")
        rows.append({"name": name, "label": label, "starts": result})
    title = (
        f"{lib.name}: condition numbers, t_f {duration:g} s, M {harmonics}, {lib.level}, "
        f"{processor()}"
    )
    caption = (
        f"Column-normalised base regressor at {COST_SAMPLES} samples; position, velocity and "
        "acceleration limits kept at 1 kHz; the same random starts for all, one process. "
        "Document: five starts of 50 iterations, its own machine, t_f not stated."
    )
    head = ("optimiser", "starts", "best", "median", "worst", "CPU s / start", "wall s / start")
    head = (*head, f"wall s to < {DOCUMENT}")
    notes = [f"skipped: {label}: {why}." for label, why in skipped.items()]
    facts = {"robot": lib.name, "level": lib.level, "processor": processor(), "rows": rows}
    facts |= {"duration": duration, "harmonics": harmonics, "skipped": skipped}
    return Sheet("bench_excitation", head, [*_lines(rows)], facts, title, caption, notes)


def _lines(rows: list[dict[str, Any]]) -> Iterator[tuple[str, ...]]:
    """Best, median and worst, medians of the times, and time until a start beats the document."""
    for row in rows:
        keys = ("condition", "cpu", "wall")
        cond, cpu, wall = (np.array([start[key] for start in row["starts"]]) for key in keys)
        values = (cond.min(), np.median(cond), cond.max(), np.median(cpu), np.median(wall))
        better = np.flatnonzero(cond < DOCUMENT)
        passed = f"{wall[: better[0] + 1].sum():.1f}" if better.size else "never"
        yield row["label"], str(len(cond)), *(f"{value:.2f}" for value in values), passed
    yield "the document", "5", f"{DOCUMENT}", "", "", "", f"> {DOCUMENT_SECONDS:.0f}", ""


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


def designed(lib: Library, goals: tuple[Goal, ...], seed: int, say: Callable[[str], None]) -> Sheet:
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
