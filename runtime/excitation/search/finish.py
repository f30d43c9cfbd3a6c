"""Order of a search, and its end: the best start on a fine grid, strictly inside all limits.

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
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.distance_limits import use_of
from runtime.excitation.limits.limit_rows import Limits, inside
from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.criteria import CRITERIA
from runtime.excitation.search.single_start import TRIED, Search
from runtime.library import Array

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


@dataclass(frozen=True, slots=True)
class Task:
    """One descent, small enough to be sent to another process."""

    number: int  # of the random start; variations continue the count
    parents: tuple[Array, ...] = ()  # coefficients (n, M), best first; none for a random start
    best: float = np.inf  # least target of the rounds before

    def done(self, search: Search) -> tuple[float, Array]:
        """Target and coefficients (n, M) of the descent."""
        if not self.parents:
            return search.start(self.number, self.best)
        return search.variation(self.number, self.parents, self.best)


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
        best, parents = _best(ended, apart) if first else (np.inf, ())
        near = parents if first >= drawn else ()
        yield [Task(number, near, best) for number in range(first, last)]


def _best(ended: Ended, apart: float) -> tuple[float, tuple[Array, ...]]:
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


STEP = 1e-3  # step of the grid on which the limits hold, s
STRICT = 2e-4  # margin of nonlinear limits on that grid; their curvature between samples is smaller
SCALES = 1 - 1e-4 * np.concatenate([[0], 2.0 ** np.arange(10)])
"""Factors of the motion, down to 0.95."""
SLOWER = 1.01 ** np.arange(1, 41)  # factors of the duration, up to 1.5
SMALL = 0.9 ** np.arange(1, 23)
"""Factors of the motion where nothing else helps, down to 0.1: with a small share of the limits
(the setting margin) the cost of a search rises faster than its penalty of nonlinear limits."""


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
