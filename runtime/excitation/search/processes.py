"""The tasks of a search one after another, or on several processes with the same results."""

import signal
import threading
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

from threadpoolctl import threadpool_limits

from runtime.errors import IdentificationError
from runtime.excitation.search.single_start import Search, SearchProblem
from runtime.excitation.search.variations import Task
from runtime.library import Array

Started = tuple[int, float, Array]
"""Number of the task, the goal's target, coefficients."""
Rounds = Iterable[list[Task]]
"""The next one is asked for when all tasks of the last have been told."""

_here: list[Search] = []
"""The search of a worker process, which loads its library once."""


def in_turn(search: Search, rounds: Rounds) -> Generator[Started, None, None]:
    """The tasks in order."""
    for tasks in rounds:
        for task in tasks:
            yield task.number, *task.done(search)


def side_by_side(
    problem: SearchProblem, rounds: Rounds, processes: int
) -> Generator[Started, None, None]:
    """The tasks of every round as they end.

    Workers are fresh interpreters (spawn) and do not hear Ctrl-C: closing the iterator ends them
    with the tasks under way.

    Raises:
        IdentificationError: a worker died.
    """
    context = _Spawning()
    pool = ProcessPoolExecutor(
        processes,
        context,
        initializer=_prepare,
        initargs=(problem,),
    )
    waiting: set[Future[Started]] = set()
    try:
        for tasks in rounds:
            left = tasks[::-1]
            while left or waiting:
                with _deaf():
                    while left and len(waiting) < processes:
                        waiting.add(pool.submit(_start, left.pop()))
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
    except BrokenProcessPool:
        raise IdentificationError(
            "a process of the search died; try processes=1, and in a script of your own call "
            "design only under: if __name__ == '__main__'"
        ) from None
    finally:
        with _deaf():  # a second Ctrl-C in here would leave the workers waiting for ever
            if waiting:
                context.end()
            pool.shutdown(cancel_futures=True)


def _prepare(problem: SearchProblem) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threadpool_limits(limits=1, user_api="blas")
    _here[:] = [problem.search()]


def _start(task: Task) -> Started:
    return task.number, *task.done(_here[0])


class _Spawning(SpawnContext):
    """Knows the processes that it has begun."""

    def __init__(self) -> None:
        super().__init__()
        self._begun: list[SpawnProcess] = []

    def Process(self, *args: Any, **options: Any) -> SpawnProcess:  # type: ignore[override]
        """As the class of that name."""
        self._begun.append(SpawnProcess(*args, **options))
        return self._begun[-1]

    def end(self) -> None:
        """Whatever they are doing."""
        for process in self._begun:
            process.terminate()


@contextmanager
def _deaf() -> Iterator[None]:
    """Ctrl-C waits for the end: a worker that begins inherits the mask and never hears it.

    The mask alone is not enough: a thread of BLAS that has none takes the signal for all.
    """
    if threading.current_thread() is not threading.main_thread():  # Python interrupts only that one
        yield
        return
    heard: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    masks = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masks else None
    try:
        yield
    finally:
        if before is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, handler)
        if heard and callable(handler):
            handler(heard[0], None)
