"""The best of several starts and of their variations, inside the limits at 1 kHz.

Ended starts are tried in an order: among nearly equal ones the most balanced comes first,

    max over i of (log f_i − min over the nearly equal starts of log f_i),   f = v, a, cond

since a weighted criterion is nearly the same for starts of which one is good in v alone, one in
cond alone.

Several motions that share a time are designed one by one, each with what those before it determine:
min over motion k of f(G₀ + G_1 + … + G_k), G_i the information of motion i over β, f the criterion,
G_0 that of earlier logs. Friction and offsets are estimated for every log apart, which counts them
more often than a fit of all logs does.
"""

import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import parent_process
from multiprocessing.connection import wait as wait_for
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from threadpoolctl import threadpool_limits

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.excitation.limits.safety import Safety, unchecked
from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.condition_cost import INFORMED_SAMPLES, ConditionCost
from runtime.excitation.search.criteria import unseen_joints
from runtime.excitation.search.design_settings import DesignKeywords, DesignSettings, settings_from
from runtime.excitation.search.finish import Ended, Finished, Task, behind_count, finished, rounds
from runtime.excitation.search.information import Information, in_time, projected
from runtime.excitation.search.measures import covariance
from runtime.excitation.search.single_start import Search
from runtime.library import Array, Library, load, require_library
from runtime.parallel import on_cluster

Sent = tuple[Path, str, DesignSettings]  # folder and level of a library, settings, for a worker
Started = tuple[int, float, Array]  # number of the task, its target, its coefficients
Rounds = Iterable[list[Task]]  # tasks round after round; one is made when the last has ended
SAFE_PATH = "PYTHONSAFEPATH"  # environment variable of `python -P`
_here: list[Search] = []  # search of a worker process, which loads its library once


def side_by_side(sent: Sent, rounds: Rounds, processes: int) -> Generator[Started, None, None]:
    """Do the tasks of every round on several processes, in the order in which they end.

    Workers are fresh interpreters (spawn) that ignore Ctrl-C: closing the iterator ends them with
    the tasks under way. They end by themselves when this process is killed.
    """
    context = _Spawning()
    with _safe_path():
        pool = ProcessPoolExecutor(processes, context, initializer=_prepare, initargs=(sent,))
    waiting: set[Future[Started]] = set()
    try:
        for tasks in rounds:
            left = tasks[::-1]
            while left or waiting:
                with _without_interrupts(), _safe_path():
                    while left and len(waiting) < processes:
                        waiting.add(pool.submit(_start, left.pop()))
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
    except BrokenProcessPool:
        raise IdentificationError(
            "a process of the search ended unexpectedly; give processes=1, and in a script of your "
            "own call design only under: if __name__ == '__main__'"
        ) from None
    finally:
        with (
            _without_interrupts()
        ):  # a second Ctrl-C in here would leave the workers waiting for ever
            if waiting:
                context.end()
            pool.shutdown(cancel_futures=True)


def _prepare(sent: Sent) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    threadpool_limits(limits=1, user_api="blas")
    _here[:] = [_search_of(sent)]


def _end_with_parent() -> None:
    """End this worker when the process that began it has ended, in whatever way.

    A killed parent closes nothing in order. Its worker would wait for the next task for ever,
    because it holds both ends of the queue of tasks itself.
    """
    parent = parent_process()
    if parent is not None:
        wait_for([parent.sentinel])
        os.kill(os.getpid(), signal.SIGTERM)  # this is not the main thread of the worker


def _start(task: Task) -> Started:
    return _done(_here[0], task)


class _Spawning(SpawnContext):
    """A context that keeps the processes which it has begun."""

    def __init__(self) -> None:
        super().__init__()
        self._begun: list[SpawnProcess] = []

    def Process(self, *args: Any, **options: Any) -> SpawnProcess:  # type: ignore[override]
        """As the class of that name."""
        self._begun.append(SpawnProcess(*args, **options))
        return self._begun[-1]

    def end(self) -> None:
        """Terminate all processes, whatever they are doing."""
        for process in self._begun:
            process.terminate()


@contextmanager
def _safe_path() -> Iterator[None]:
    """Interpreters that begin meanwhile import nothing from the working directory.

    A worker, and the process that counts semaphores, begin as `python -c`, whose path starts
    with that directory; the path of this process replaces it only after the first imports.
    """
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Delay Ctrl-C until the end; a worker that begins here inherits the mask and ignores it.

    The mask alone is not enough: a thread of BLAS without one takes the signal for all.
    """
    if threading.current_thread() is not threading.main_thread():  # Python interrupts only that one
        yield
        return
    received: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    masks = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masks else None
    try:
        yield
    finally:
        if before is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, handler)
        if received and callable(handler):
            handler(received[0], None)


def _search_of(sent: Sent) -> Search:
    folder, level, settings = sent
    return Search(load(folder, level), settings)


def _done(search: Search, task: Task) -> Started:
    return task.number, *task.done(search)


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
    running = _started(search, tasks, min(processes, settings.starts), scheduler)
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


def _started(
    search: Search, rounds: Rounds, processes: int, scheduler: str | None
) -> Generator[Started, None, None]:
    if processes == 1 and scheduler is None:
        return (_done(search, task) for tasks in rounds for task in tasks)
    # On a worker the working directory may be another one.
    sent = search.lib.folder.resolve(), search.lib.level, search.settings
    if scheduler is not None:
        prepare = partial(_search_of, sent)
        return on_cluster(prepare, _done, rounds, scheduler, "a start of the search")
    return side_by_side(sent, rounds, processes)


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
