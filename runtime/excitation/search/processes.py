"""Tasks of a search in turn, on several processes or on a dask cluster, with the same results."""

import os
import signal
import threading
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import parent_process
from multiprocessing.connection import wait as wait_for
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

from threadpoolctl import threadpool_limits

from runtime.errors import IdentificationError
from runtime.excitation.search.design_settings import SearchProblem
from runtime.excitation.search.single_start import Search
from runtime.excitation.search.variations import Task
from runtime.library import Array
from runtime.parallel import on_cluster

_here_of_cluster = threading.local()
"""Last search of the thread of a worker, and its key: a library is loaded once per thread."""
Started = tuple[int, float, Array]
"""Number of the task, its target, its coefficients."""
Rounds = Iterable[list[Task]]
"""Tasks of one round after another; a round is made when all tasks of the last have ended."""
SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable of `python -P`."""
_here: list[Search] = []
"""Search of a worker process, which loads its library once."""


def in_turn(search: Search, rounds: Rounds) -> Generator[Started, None, None]:
    """Do the tasks in order."""
    for tasks in rounds:
        for task in tasks:
            yield task.number, *task.done(search)


def side_by_side(
    problem: SearchProblem, rounds: Rounds, processes: int
) -> Generator[Started, None, None]:
    """Do the tasks of every round on several processes, in the order in which they end.

    Workers are fresh interpreters (spawn) that ignore Ctrl-C: closing the iterator ends them with
    the tasks under way. They end by themselves when this process is killed.
    """
    context = _Spawning()
    with _safe_path():
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


def _prepare(problem: SearchProblem) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    threadpool_limits(limits=1, user_api="blas")
    _here[:] = [Search.of(problem)]


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
    return task.number, *task.done(_here[0])


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


def on_workers(
    problem: SearchProblem, rounds: Rounds, scheduler: str
) -> Generator[Started, None, None]:
    """Do the tasks of every round on a dask cluster, in the order in which they end."""
    # On a worker the working directory is another one.
    sent = replace(problem, folder=problem.folder.resolve())
    return on_cluster(_start_on_cluster, sent, rounds, scheduler, "a start of the search")


def _start_on_cluster(problem: SearchProblem, key: str, task: Task) -> Started:
    """Do one task, on a worker."""
    return task.number, *task.done(_search_on_cluster(problem, key))


def _search_on_cluster(problem: SearchProblem, key: str) -> Search:
    known: tuple[str, Search] | None = getattr(_here_of_cluster, "search", None)
    if known is None or known[0] != key:
        threadpool_limits(limits=1, user_api="blas")
        known = _here_of_cluster.search = key, Search.of(problem)
    return known[1]
