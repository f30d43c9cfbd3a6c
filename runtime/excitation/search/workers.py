"""Descents of a search in this process, on several side by side, or on the workers of a cluster.

Workers are fresh interpreters that load the library once. Ctrl-C stops the process that waits for
them; a worker ends with it, in whatever way that ends.
"""

import os
import signal
import threading
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import parent_process
from multiprocessing.connection import wait as wait_for
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from runtime.errors import IdentificationError
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.single_start import Search
from runtime.library import Array, load
from runtime.parallel import on_cluster

Sent = tuple[Path, str, DesignSettings]  # folder and level of a library, settings, for a worker
Started = tuple[int, float, Array]  # number of the task, its target, its coefficients
SAFE_PATH = "PYTHONSAFEPATH"  # environment variable of `python -P`
_here: list[Search] = []  # search of a worker process, which loads its library once


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


Rounds = Iterable[list[Task]]  # tasks round after round; one is made when the last has ended


def descents(
    search: Search, rounds: Rounds, processes: int, scheduler: str | None
) -> Generator[Started, None, None]:
    """Tasks as they end: in this process, on several, or on the workers of a cluster."""
    if processes == 1 and scheduler is None:
        return (_done(search, task) for tasks in rounds for task in tasks)
    # On a worker the working directory may be another one.
    sent = search.lib.folder.resolve(), search.lib.level, search.settings
    if scheduler is not None:
        prepare = partial(_search_of, sent)
        return on_cluster(prepare, _done, rounds, scheduler, "a start of the search")
    return side_by_side(sent, rounds, processes)


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
