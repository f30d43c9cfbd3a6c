"""The best of several starts and of their variations, inside the limits at 1 kHz.

Where a smooth criterion decides, random starts come in rounds of `FIRST`, as many again, twice as
many and so on. From the second round a start that is behind the best of the rounds before is given
up, see `TRIED`. With `FEWEST_STARTS` starts or more, `DRAWN` of them are random, at least
`FEWEST_DRAWN`, and the others are warm: they begin near one of the best so far and skip
D-optimality. Warm starts and `SMOOTH_SHARE` variations per start come in `WARM_ROUNDS` rounds.

Optima of log cond are many and the best of a hundred is a rare one, but good ones have much in
common. Where log cond decides, as many variations as starts follow in `ROUNDS`. Each inherits from
one of the `PARENTS` best so far (a geometric law favours the first), with the motion of one or two
joints new or with noise on all coefficients, and skips D-optimality. It is given up after the first
smooth stage unless it is new and close to the best by then. A round waits for the one before, so
that the design depends on the seed alone.

A small remaining violation is repaired by scaling the motion towards its home, which helps against
every limit, or by more time for the same path, rounded up to whole milliseconds, which helps
against speeds and torques. Where neither suffices, the motion is scaled by as much as it takes.

Ended starts are tried in an order: among nearly equal ones the most balanced comes first,

    max over i of (log f_i − min over the nearly equal starts of log f_i),   f = v, a, cond

since a weighted criterion is nearly the same for starts of which one is good in v alone, one in
cond alone.

Several motions that share a time are designed one by one, each with what those before it determine:
min over motion k of f(G₀ + G_1 + … + G_k), G_i the information of motion i over β, f the criterion,
G_0 that of earlier logs. Friction and offsets are estimated for every log apart, which counts them
more often than a fit of all logs does.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.excitation.limits.constraints import Limits, inside
from runtime.excitation.limits.distance_limits import use_of
from runtime.excitation.limits.safety import Safety, unchecked
from runtime.excitation.motion.trajectory import Trajectory, write_motion
from runtime.excitation.search.criteria import CRITERIA, covariance, unseen_joints
from runtime.excitation.search.design_settings import DesignKeywords, DesignSettings, settings_from
from runtime.excitation.search.information import (
    INFORMED_SAMPLES,
    ConditionCost,
    Information,
    in_time,
    projected,
)
from runtime.excitation.search.prediction import Prediction
from runtime.excitation.search.single_start import TRIED, Search
from runtime.excitation.search.workers import Task, descents
from runtime.library import Array, Library, require_library

Ended = dict[int, tuple[float, Array]]  # start or variation → target, coefficients (n, M)
FIRST = 3  # random starts of a smooth criterion in the first round; none of them is given up
DRAWN, FEWEST_DRAWN = 0.25, 4  # share and least number of random starts of a smooth criterion
WARM_ROUNDS = 10  # rounds of the starts of a smooth criterion that begin near the best ones
SHARE, SMOOTH_SHARE = 1.0, 2.0
"""Variations per start where log cond decides, and where a smooth criterion does; one takes a third
of the time of a random start."""
FEWEST_STARTS = 8  # fewest starts after which variations follow, or among which some are warm
ROUNDS = 6  # number of rounds of variations
PARENTS = 8  # largest number of parents
DISTINCT = 1e-3  # difference of log cond below which two optima count as the same
SAME = 0.05
"""Distance of coefficients over their length below which two ends of a smooth criterion count as
the same: descents end up to 0.02 from their optimum, and other optima are 0.1 or more away."""
STEP = 1e-3  # step of the grid on which the limits hold, s
STRICT = 2e-4  # margin of nonlinear limits on that grid; their curvature between samples is smaller
SCALES = 1 - 1e-4 * np.concatenate([[0], 2.0 ** np.arange(10)])
"""Factors of the motion, down to 0.95."""
SLOWER = 1.01 ** np.arange(1, 41)  # factors of the duration, up to 1.5
SMALL = 0.9 ** np.arange(1, 23)
"""Factors of the motion where nothing else helps, down to 0.1: with a small share of the limits
(the setting margin) the cost of a search rises faster than its penalty of nonlinear limits."""
NEARLY = 0.01  # log target above the best that is as good: the last polish changes it so


@dataclass(frozen=True, slots=True)
class Design:
    """The best trajectory over all starts and variations.

    Attributes:
        trajectory: the motion, within its limits at 1 kHz.
        condition: cond of the column-normalised base regressor at `COST_SAMPLES` samples.
        conditions: the same for every start that ended, in order.
        use: largest |value| / limit at 1 kHz per kind of limit; 1 is the limit.
        assumptions: limits that the robot does not state, and values used.
        criterion: quantity that was minimised, one of `CRITERIA`.
        values: exp of the target for every start that ended, in order.
        unit: unit of the values.
        safety: limits kept beyond the joints'; None as in the document.
        unchecked: kinds of limits that were not checked.
        variations: cond of every variation that ended, in order.
        behind: starts and variations that ended far behind the best of earlier rounds.
    """

    trajectory: Trajectory
    condition: float
    conditions: tuple[float, ...]
    use: dict[str, float]
    assumptions: tuple[str, ...]
    criterion: str = "cond"
    values: tuple[float, ...] = ()
    unit: str = "cond"
    safety: Safety | None = None
    unchecked: tuple[str, ...] = ()
    variations: tuple[float, ...] = ()
    behind: int = 0


def write_trajectory(
    designed: Design,
    lib: Library,
    path: Path,
    prediction: Prediction | None = None,
    ways: Mapping[str, Trajectory] | None = None,
    further: Mapping[str, Any] | None = None,
) -> None:
    """Write a design and its predicted accuracy, atomically."""
    known = {
        "condition_number": designed.condition,
        "condition_numbers_of_starts": list(designed.conditions),
        "condition_numbers_of_relatives": list(designed.variations),
        "criterion": designed.criterion,
        "criterion_of_starts": list(designed.values),
        "use_of_limits": designed.use,
        "assumptions": list(designed.assumptions),
        **(further or {}),
    }
    if prediction is not None:
        known["prediction"] = prediction.facts()
    write_motion(designed.trajectory, lib, path, known, ways)


def variation_count(criterion: str, starts: int) -> int:
    """Number of variations that follow the starts."""
    share = SHARE if CRITERIA[criterion].is_kinked else SMOOTH_SHARE
    return int(share * starts) if starts >= FEWEST_STARTS else 0


def random_count(criterion: str, starts: int) -> int:
    """Number of starts that are random."""
    if CRITERIA[criterion].is_kinked or starts < FEWEST_STARTS:
        return starts
    return max(FEWEST_DRAWN, int(DRAWN * starts))


def task_rounds(criterion: str, starts: int) -> list[tuple[int, int]]:
    """Rounds of starts and variations."""
    is_kinked = CRITERIA[criterion].is_kinked
    drawn, end = random_count(criterion, starts), starts + variation_count(criterion, starts)
    ends = [0, drawn if is_kinked else min(FIRST, drawn)]
    while ends[-1] < drawn:
        ends.append(min(2 * ends[-1], drawn))
    count = ROUNDS if is_kinked else WARM_ROUNDS
    later = (drawn + (end - drawn) * k // count for k in range(1, count + 1))
    return [(first, last) for first, last in pairwise([*ends, *later]) if first < last]


def behind_count(criterion: str, starts: int, ended: Ended) -> int:
    """Number of descents of a smooth criterion that ended by the last bound of `TRIED` behind."""
    if CRITERIA[criterion].is_kinked:
        return 0
    count, behind = 0, TRIED[-1][1]
    for first, last in task_rounds(criterion, starts):
        best = min((ended[k][0] for k in range(first) if k in ended), default=np.inf)
        count += sum(ended[k][0] > best + behind for k in range(first, last) if k in ended)
    return count


def rounds(criterion: str, starts: int, ended: Ended) -> Iterator[list[Task]]:
    """Tasks that may be done at once, round by round."""
    drawn = random_count(criterion, starts)
    apart = 0.0 if CRITERIA[criterion].is_kinked else SAME
    for first, last in task_rounds(criterion, starts):
        best, parents = _parents(ended, apart) if first else (np.inf, ())
        near = parents if first >= drawn else ()
        yield [Task(number, near, best) for number in range(first, last)]


def _parents(ended: Ended, apart: float) -> tuple[float, tuple[Array, ...]]:
    """Target of the best and coefficients of all parents, whose distances are `apart` or more."""
    chosen: list[tuple[float, Array]] = []
    for number in sorted(ended, key=lambda number: (ended[number][0], number)):
        value, a = ended[number]
        if len(chosen) == PARENTS:
            break
        if chosen and value < chosen[-1][0] + DISTINCT:
            continue
        if all(np.linalg.norm(a - other) >= apart * np.linalg.norm(other) for _, other in chosen):
            chosen.append((value, a))
    return chosen[0][0], tuple(a for _, a in chosen)


@dataclass(frozen=True, slots=True)
class Finished:
    """A trajectory that keeps its limits at 1 kHz."""

    trajectory: Trajectory  # the motion
    use: dict[str, float]  # largest |value| / limit per kind of limit, 1 is the limit itself


def finished(search: Search, a: Array) -> Finished:
    """Refine a start and repair it; Ctrl-C skips the refinement."""
    with suppress(KeyboardInterrupt):
        a = search.refined(a)
    return repaired(search, a)


def repaired(search: Search, a: Array) -> Finished:
    """Move a motion (n, M) [rad, m] inside all limits at 1 kHz, smaller or slower."""
    designed = search.settings.duration
    fine = search.joint_limits(STEP)
    a = inside(fine, a)
    if not search.constraints:
        return _with_use(search, fine, a, designed)
    rows = search.limit_rows(STEP)
    # First a smaller motion of the same duration, then the same path in more time.
    for scale in SCALES:
        if rows.worst(scale * a) <= -STRICT:
            return _with_use(search, fine, scale * a, designed)
    for slower in SLOWER:
        duration = np.ceil(1e3 * slower * designed) / 1e3
        if search.limit_rows(STEP, duration=duration).worst(a) <= -STRICT:
            return _with_use(search, search.joint_limits(STEP, duration), a, duration)
    for scale in SMALL:
        if rows.worst(scale * a) <= -STRICT:
            return _with_use(search, fine, scale * a, designed)
    raise IdentificationError(
        f"the best motion found breaks the limits of {' and of '.join(rows.strongest(a))} and "
        "neither a smaller nor a slower motion of the same shape keeps them; try more starts"
    )


def _with_use(search: Search, fine: Limits, a: Array, duration: float) -> Finished:
    margin = search.settings.margin
    use = {kind: margin * float(values.max()) for kind, values in fine.use(a).items()}
    by_constraint = search.limit_rows(STEP, duration=duration, share=1.0).by_constraint(a)
    for constraint, values in zip(search.constraints, by_constraint, strict=True):
        largest = use_of(constraint, float(values.max()))
        use[constraint.kind] = max(largest, use.get(constraint.kind, largest))
    return Finished(Trajectory(search.home, a, duration, search.basis), use)


@one_blas_thread
def design(
    lib: Library,
    settings: DesignSettings | None = None,
    *,
    progress: Callable[[int, float, float], None] | None = None,
    processes: int = 1,
    scheduler: str | None = None,
    budget: float | None = None,
    **keywords: Unpack[DesignKeywords],
) -> Design:
    """Best motion of several searches."""
    begin = time.monotonic()
    require_library(lib)
    settings = settings_from(settings, keywords)
    if budget is not None and not budget > 0:
        raise IdentificationError(f"expected a budget above 0 s, got {budget:g}; give more seconds")
    if processes < 1:
        raise IdentificationError(f"a search needs at least one process, got {processes}")
    search = Search(lib, settings)
    search.require_rank()
    ended: Ended = {}
    tasks = rounds(settings.criterion, settings.starts, ended)
    running = descents(search, tasks, min(processes, settings.starts), scheduler)
    try:
        with closing(running):
            for number, value, a in running:
                ended[number] = value, a
                if progress is not None:
                    best = min(value for value, _ in ended.values())
                    progress(len(ended), float(np.exp(value)), float(np.exp(best)))
                spent = time.monotonic() - begin
                if budget is not None and spent + spent / len(ended) > budget:
                    break
    except KeyboardInterrupt:
        if not ended:
            raise
    return _design(search, ended)


def excite(
    lib: Library,
    settings: DesignSettings | None = None,
    *,
    progress: Callable[[int, float, float], None] | None = None,
    processes: int = 1,
    budget: float | None = None,
    **keywords: Unpack[DesignKeywords],
) -> Design:
    """Motion that makes the base parameters visible, within all limits that the robot states.

    As `symgen excite`: without settings or `safety` of your own, torque, speed of the tip and
    distances between links keep their limits too, not those of joints alone.

    Args:
        lib: library of the robot.
        settings: duration, criterion, limits and the other options; None is the defaults.
        progress: called after each start with their number, its cost and the best one.
        processes: number of processes that search side by side; more than one need a main guard.
        budget: time for the search [s]; None searches to the end.
        **keywords: single fields of `DesignSettings`, which replace those of `settings`.

    Returns:
        The best motion (`trajectory`), with its cost, the use of every limit and what was not
        checked.

    Raises:
        RuntimeFault: no library; options or limits that leave no motion.
    """
    if settings is None and "safety" not in keywords:
        keywords["safety"] = Safety()
    return design(lib, settings, progress=progress, processes=processes, budget=budget, **keywords)


def _best(search: Search, ended: Ended) -> Finished:
    """First start, in the given order, that can be finished."""
    failure = None
    for a in in_order(search, [ended[number] for number in sorted(ended)]):
        try:
            return finished(search, a)
        except IdentificationError as error:
            failure = failure or error
    raise failure or IdentificationError("no start has ended")


def _design(search: Search, ended: Ended) -> Design:
    """The best start, finished, beside the condition numbers of all searches."""
    settings, basis, best = search.settings, search.basis, _best(search, ended)
    shape = (search.lib, search.home, basis.size(settings.harmonics))
    # Repairs may lengthen the motion: the starts keep the duration that they were searched with.
    durations = settings.duration, best.trajectory.duration
    starts_cost, cost = (ConditionCost(*shape, duration, basis) for duration in durations)

    def condition(number: int) -> float:
        return float(np.exp(starts_cost.value_gradient(ended[number][1])[0]))

    starts = sorted(number for number in ended if number < settings.starts)
    return Design(
        trajectory=best.trajectory,
        condition=float(np.exp(cost.value_gradient(best.trajectory.coefficients)[0])),
        conditions=tuple(condition(number) for number in starts),
        use=best.use,
        assumptions=tuple(search.limits.assumptions),
        criterion=settings.criterion,
        values=tuple(float(np.exp(ended[number][0])) for number in starts),
        unit=search.criterion.unit,
        safety=settings.safety,
        unchecked=unchecked(search.lib, settings.safety),
        variations=tuple(
            condition(number) for number in sorted(ended) if number >= settings.starts
        ),
        behind=behind_count(settings.criterion, settings.starts, ended),
    )


def in_order(search: Search, ended: Sequence[tuple[float, Array]]) -> list[Array]:
    """Coefficients (n, M) of starts in the order in which they are to be tried."""
    by_target = sorted(ended, key=lambda one: one[0])
    if not by_target:
        return []
    near = [a for value, a in by_target if value <= by_target[0][0] + NEARLY]
    logs = np.array([search.balanced(a) for a in near])
    worst = (logs - logs.min(axis=0)).max(axis=1)
    balanced = [near[k] for k in np.argsort(worst, kind="stable")]
    return balanced + [a for _, a in by_target[len(near) :]]


def design_several(
    lib: Library, settings: DesignSettings, count: int, **search: Any
) -> tuple[Design, ...]:
    """Design motions in a row, all of the same duration."""
    known = settings.information
    if count < 1:
        raise IdentificationError(f"expected one motion or more, got {count}")
    if known is None:
        raise IdentificationError(
            f"criterion {settings.criterion} counts no information, by which several motions "
            "complement each other; choose another one, such as v"
        )
    designs: list[Design] = []
    for k in range(count):
        duration = settings.duration / count
        one = replace(settings, duration=duration, seed=settings.seed + k, information=known)
        designs.append(design(lib, one, **search))
        known = with_motion(lib, designs[-1].trajectory, known)
    return tuple(designs)


def torque_sigma(lib: Library, home: Array, known: Information) -> float:
    """σ of the torque of motions never seen, all joints together, by what is known [N·m, N]."""
    seen = np.sum(unseen_joints(lib, home), axis=0)
    gram = np.zeros_like(seen) if known.earlier is None else known.earlier
    spread = covariance(known.of_unknowns(gram))
    return np.inf if spread is None else float(np.sqrt(np.sum(known.of_unknowns(seen) * spread)))


def with_motion(lib: Library, motion: Trajectory, known: Information) -> Information:
    """Information after the log of a motion."""
    t = np.linspace(0.0, motion.duration, INFORMED_SAMPLES)
    q, dq, ddq, _ = motion.at(lib, t)
    rows, filtered = lib.base_regressor(q, dq, ddq)[None], None
    if known.spectrum is not None:
        filtered = known.spectrum.weighted_cosines(len(t), float(t[1]))
        rows = in_time(filtered, rows)
    if known.friction:
        rows = projected(rows, dq[None], known.friction, filtered).rows
    flat = (rows[0] / known.noise[:, None]).reshape(-1, rows.shape[-1])
    gram: Array = flat.T @ flat * (known.rate * motion.duration / len(t))
    return replace(known, earlier=gram if known.earlier is None else known.earlier + gram)
