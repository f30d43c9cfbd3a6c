"""The starts of a search one after another, or on several processes with the same results."""

import multiprocessing
import signal
from collections.abc import Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from threadpoolctl import threadpool_limits

from runtime.errors import IdentificationError
from runtime.excitation.search import Problem, Search
from runtime.library import Array

Started = tuple[int, float, Array]
"""Number of the start, the goal's target, coefficients."""

_here: list[Search] = []
"""The search of a worker process, which loads its library once."""


def in_turn(search: Search, starts: int) -> Generator[Started, None, None]:
    """The starts in order."""
    for number in range(starts):
        yield number, *search.start(number)


def side_by_side(problem: Problem, starts: int, processes: int) -> Generator[Started, None, None]:
    """The starts as they end.

    Workers are fresh interpreters (spawn) and do not hear Ctrl-C: closing the iterator waits for
    the starts under way and drops them.

    Raises:
        IdentificationError: a worker died.
    """
    pool = ProcessPoolExecutor(
        min(processes, starts),
        multiprocessing.get_context("spawn"),
        initializer=_prepare,
        initargs=(problem,),
    )
    waiting: set[Future[Started]] = set()
    submitted = 0
    try:
        while submitted < starts or waiting:
            with _deaf():
                while submitted < starts and len(waiting) < processes:
                    waiting.add(pool.submit(_start, submitted))
                    submitted += 1
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    except BrokenProcessPool:
        raise IdentificationError(
            "a process of the search died; try processes=1, and in a script of your own call "
            "design only under: if __name__ == '__main__'"
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)


def _prepare(problem: Problem) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threadpool_limits(limits=1, user_api="blas")
    _here[:] = [problem.search()]


def _start(number: int) -> Started:
    return number, *_here[0].start(number)


@contextmanager
def _deaf() -> Iterator[None]:
    """Ctrl-C waits: a worker that begins inherits the mask and never hears it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
