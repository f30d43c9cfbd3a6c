"""Order of a search: random starts, then variations of the best ones.

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
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from runtime.excitation.search.criteria import CRITERIA
from runtime.excitation.search.single_start import TRIED, Search
from runtime.library import Array

FIRST = 3
"""Number of random starts of a smooth criterion in the first round; none of them is given up."""
DRAWN, FEWEST_DRAWN = 0.25, 4
"""Share and least number of the starts of a smooth criterion that are random."""
WARM_ROUNDS = 10
"""Number of rounds of the starts of a smooth criterion that begin near the best ones."""
SHARE, SMOOTH_SHARE = 1.0, 2.0
"""Variations per start where log cond decides, and where a smooth criterion does; one takes a third
of the time of a random start."""
FEWEST_STARTS = 8
"""Smallest number of starts after which variations follow, or among which some are warm."""
ROUNDS = 6
"""Number of rounds of variations."""
PARENTS = 8
"""Largest number of parents."""
DISTINCT = 1e-3
"""Difference of log cond below which two optima count as the same."""
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


def behind_count(criterion: str, starts: int, ended: Mapping[int, tuple[float, Array]]) -> int:
    """Number of descents of a smooth criterion that ended by the last bound of `TRIED` behind."""
    if CRITERIA[criterion].is_kinked:
        return 0
    count, behind = 0, TRIED[-1][1]
    for first, last in task_rounds(criterion, starts):
        best = min((ended[k][0] for k in range(first) if k in ended), default=np.inf)
        count += sum(ended[k][0] > best + behind for k in range(first, last) if k in ended)
    return count


def rounds(
    criterion: str, starts: int, ended: Mapping[int, tuple[float, Array]]
) -> Iterator[list[Task]]:
    """Tasks that may be done at once, round by round."""
    drawn = random_count(criterion, starts)
    apart = 0.0 if CRITERIA[criterion].is_kinked else SAME
    for first, last in task_rounds(criterion, starts):
        best, parents = _best(ended, apart) if first else (np.inf, ())
        near = parents if first >= drawn else ()
        yield [Task(number, near, best) for number in range(first, last)]


def _best(
    ended: Mapping[int, tuple[float, Array]], apart: float
) -> tuple[float, tuple[Array, ...]]:
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
