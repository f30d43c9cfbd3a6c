"""The tasks of a search on a dask cluster, with the same results as here."""

import threading
from collections.abc import Generator
from dataclasses import replace

from threadpoolctl import threadpool_limits

from runtime.excitation.search.processes import Rounds, Started
from runtime.excitation.search.search_problem import SearchProblem
from runtime.excitation.search.single_start import Search
from runtime.excitation.search.variations import Task
from runtime.parallel import on_cluster

_here = threading.local()
"""Last search of the thread of a worker, and its key: a library is loaded once per thread."""


def on_workers(
    problem: SearchProblem, rounds: Rounds, scheduler: str
) -> Generator[Started, None, None]:
    """Do the tasks of every round on a dask cluster, in the order in which they end."""
    # On a worker the working directory is another one.
    sent = replace(problem, folder=problem.folder.resolve())
    return on_cluster(_start, sent, rounds, scheduler, "a start of the search")


def _start(problem: SearchProblem, key: str, task: Task) -> Started:
    """Do one task, on a worker."""
    return task.number, *task.done(_search(problem, key))


def _search(problem: SearchProblem, key: str) -> Search:
    known: tuple[str, Search] | None = getattr(_here, "search", None)
    if known is None or known[0] != key:
        threadpool_limits(limits=1, user_api="blas")
        known = _here.search = key, Search.of(problem)
    return known[1]
