"""The tasks of a search on a dask cluster, with the same results as here.

A worker loads the library from the robot's folder by itself, so it must see the same files. What a
lost worker had begun dask gives to another one. On other processors than ours sums may round
differently, and so may a design.
"""

import threading
import uuid
from collections.abc import Generator
from contextlib import suppress
from dataclasses import replace
from typing import Any

from threadpoolctl import threadpool_limits

from runtime.errors import IdentificationError, RuntimeFault
from runtime.excitation.processes import Rounds, Started
from runtime.excitation.relatives import Task
from runtime.excitation.search import Problem, Search

PATIENCE = 30.0
"""s that a cluster may take to get its first worker."""
CONNECTED = 5.0
"""s that a scheduler may take to answer."""

_here = threading.local()
"""The last search of a worker's thread and its key: a library is loaded once per thread."""


def on_cluster(problem: Problem, rounds: Rounds, scheduler: str) -> Generator[Started, None, None]:
    """The tasks of every round as they end.

    Closing the iterator cancels those that wait and drops those under way.

    Raises:
        IdentificationError: no dask here, no scheduler or worker there, a worker without the
            robot's files, or a start that took several workers down.
    """
    try:
        from distributed import as_completed
    except ImportError:
        raise IdentificationError(
            "a search on a cluster needs dask.distributed here and on every worker; "
            "install it with: pip install 'symgen[cluster]'"
        ) from None
    client = _connected(scheduler)
    # On a worker the working directory is another one.
    sent, key = replace(problem, folder=problem.folder.resolve()), f"excitation-{uuid.uuid4().hex}"
    futures = []
    try:
        for tasks in rounds:
            futures = [
                client.submit(_start, sent, key, task, key=f"{key}-{task.number}", pure=False)
                for task in tasks
            ]
            _require_workers(client, scheduler)
            for future in as_completed(futures, loop=client.loop):
                yield _result(future, scheduler)
    finally:
        # The scheduler may be the one that is lost.
        with suppress(Exception):
            client.cancel(futures)
        client.close()


def _result(future: Any, scheduler: str) -> Started:
    from distributed import KilledWorker

    if future.cancelled():
        raise IdentificationError(f"the scheduler at '{scheduler}' was lost; start again")
    failure = future.exception()
    if failure is None:
        started: Started = future.result()
        return started
    if isinstance(failure, KilledWorker):
        raise IdentificationError(
            "a start of the search took several workers of the cluster down; give them "
            "more memory, or leave --scheduler out"
        )
    raise _told(failure) from None


def _connected(scheduler: str) -> Any:
    from distributed import Client

    try:
        if not scheduler:
            raise ValueError(scheduler)  # Client would start a cluster of its own
        return Client(scheduler, timeout=CONNECTED, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise IdentificationError(
            f"there is no dask scheduler at '{scheduler}' ({type(error).__name__}); start one "
            "with: dask scheduler, and give its address as tcp://host:8786"
        ) from None


def _require_workers(client: Any, scheduler: str) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise IdentificationError(
            f"the scheduler at '{scheduler}' has no worker after {PATIENCE:g} s; start some with: "
            f"dask worker {scheduler}"
        ) from None


def _told(failure: BaseException) -> IdentificationError:
    if isinstance(failure, RuntimeFault):
        sentence = str(failure)
    else:
        sentence = f"{type(failure).__name__}: {failure}"
    return IdentificationError(
        f"on a worker of the cluster: {sentence}; every worker needs this version of symgen and "
        "must see the same files"
    )


def _start(problem: Problem, key: str, task: Task) -> Started:
    """One task, on a worker."""
    return task.number, *task.done(_search(problem, key))


def _search(problem: Problem, key: str) -> Search:
    known: tuple[str, Search] | None = getattr(_here, "search", None)
    if known is None or known[0] != key:
        threadpool_limits(limits=1, user_api="blas")
        known = _here.search = key, problem.search()
    return known[1]
