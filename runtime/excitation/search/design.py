"""The best of several starts and of their variations, inside the limits at 1 kHz."""

from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.safety import Safety, unchecked
from runtime.excitation.motion.basis import COSINE, Basis
from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.condition_cost import ConditionCost
from runtime.excitation.search.dask_workers import on_workers
from runtime.excitation.search.finish import Finished, finished
from runtime.excitation.search.information import Information
from runtime.excitation.search.processes import Rounds, Started, in_turn, side_by_side
from runtime.excitation.search.single_start import Search, SearchProblem
from runtime.excitation.search.variations import rounds
from runtime.library import Array, Library
from runtime.parallel import one_blas_thread

LONGEST = 3600.0
"""Duration in s beyond which the limits' grid outgrows the memory."""


@dataclass(frozen=True, slots=True)
class Design:
    """The best trajectory over all starts and variations.

    Attributes:
        condition: cond of the column-normalised base regressor at `COST_SAMPLES` samples.
        conditions: the same for every start that ended, in order.
        criterion: what was minimised, of `goals.CRITERIA`.
        values: exp of its target for every start that ended, in order.
        unit: of those.
        use: largest |value| / limit at 1 kHz per kind of limit, 1 is the limit itself.
        assumptions: limits that the robot does not state and what was taken instead.
        safety: limits that were kept beyond those of the joints; None as in the document.
        unchecked: kinds of limits that nobody looked at.
        variations: cond of every variation of good starts that ended, in order.
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


@one_blas_thread
def design(
    lib: Library,
    duration: float = 10.0,
    harmonics: int = 5,
    starts: int = 5,
    seed: int = 0,
    home: Array | None = None,
    progress: Callable[[int, float, float], None] | None = None,
    processes: int = 1,
    criterion: str = "cond",
    basis: Basis = COSINE,
    information: Information | None = None,
    safety: Safety | None = None,
    scheduler: str | None = None,
) -> Design:
    """Best of several searches for the best criterion from random admissible starts.

    Args:
        lib: of the robot.
        duration: s.
        harmonics: M, of which the basis makes its functions.
        starts: number of searches; see `variation_count` for what follows them.
        seed: of the random starts.
        home: start and end position, default is the robot's.
        progress: called after each start or variation with how many have ended, exp of its target
            and the best one. Ctrl-C stops and keeps the best so far.
        processes: that search side by side; the design does not depend on it, to the last bit.
            Each loads the library anew, so more than one asks for a script with a main guard.
        criterion: what to minimise, of `goals.CRITERIA`; all but cond need `information`.
        basis: of the motion.
        information: noise, rate, what is known already and which parameters are not.
        safety: limits beyond position, velocity and acceleration of the joints; None keeps these
            alone, as the document does.
        scheduler: address of a dask scheduler, as tcp://host:8786, whose workers search instead
            of `processes`; they need this package and the robot's folder under the same path.

    Raises:
        IdentificationError: options or home position make no trajectory, limits leave no room
            for one; a process died, or there is no cluster.
    """
    if not 0 < duration <= LONGEST or harmonics < 1 or starts < 1:
        raise IdentificationError(
            f"a trajectory needs a positive duration up to {LONGEST:g} s, at least one harmonic "
            f"and one start, got {duration:g} s, {harmonics}, {starts}"
        )
    if processes < 1:
        raise IdentificationError(f"a search needs at least one process, got {processes}")
    rest = lib.home if home is None else np.asarray(home, dtype=float)
    problem = SearchProblem(
        *(lib.folder, lib.level, rest, harmonics, duration, seed),
        *(basis, criterion, information, safety),
    )
    search = Search(lib, problem)
    search.require_rank()
    found: dict[int, tuple[float, Array]] = {}
    ended = _ended(search, rounds(criterion, starts, found), min(processes, starts), scheduler)
    try:
        with closing(ended):
            for number, value, a in ended:
                found[number] = value, a
                if progress is not None:
                    best = min(value for value, _ in found.values())
                    progress(len(found), float(np.exp(value)), float(np.exp(best)))
    except KeyboardInterrupt:
        if not found:
            raise
    ending = _best(lib, search, found)
    a, t_f = ending.trajectory.coefficients, ending.trajectory.duration
    shape = (lib, rest, basis.size(harmonics))
    starts_cost, cost = (ConditionCost(*shape, end, basis) for end in (duration, t_f))
    numbers = sorted(number for number in found if number < starts)

    def condition(number: int) -> float:
        return float(np.exp(starts_cost.value_gradient(found[number][1])[0]))

    return Design(
        ending.trajectory,
        float(np.exp(cost.value_gradient(a)[0])),
        tuple(condition(number) for number in numbers),
        ending.use,
        tuple(search.limits.assumptions),
        criterion,
        tuple(float(np.exp(found[k][0])) for k in numbers),
        search.goal.unit,
        safety,
        unchecked(lib, safety),
        tuple(condition(number) for number in sorted(found) if number >= starts),
    )


def _ended(
    search: Search, tasks: Rounds, processes: int, scheduler: str | None
) -> Generator[Started, None, None]:
    if scheduler is not None:
        return on_workers(search.problem, tasks, scheduler)
    if processes == 1:
        return in_turn(search, tasks)
    return side_by_side(search.problem, tasks, processes)


def _best(lib: Library, search: Search, found: dict[int, tuple[float, Array]]) -> Finished:
    """Of the starts the best one that can be finished.

    Raises:
        IdentificationError: none can.
    """
    failure = None
    for _, a in sorted(found.values(), key=lambda ended: ended[0]):
        try:
            return finished(lib, search, a)
        except IdentificationError as error:
            failure = failure or error
    raise failure or IdentificationError("no start has ended")
