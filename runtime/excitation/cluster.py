"""The starts of a search on a dask cluster, with the same results as here."""

import threading
from collections.abc import Generator
from dataclasses import replace

from threadpoolctl import threadpool_limits

from runtime.cluster import on_cluster
from runtime.excitation.processes import Started
from runtime.excitation.search import Problem, Search

_here = threading.local()
"""The last search of a worker's thread and its key: a library is loaded once per thread."""


def on_workers(problem: Problem, starts: int, scheduler: str) -> Generator[Started, None, None]:
    """The starts as they end.

    Raises:
        IdentificationError: see `runtime.cluster.on_cluster`.
    """
    # On a worker the working directory is another one.
    sent = replace(problem, folder=problem.folder.resolve())
    return on_cluster(_start, sent, range(starts), scheduler, "a start of the search")


def _start(problem: Problem, key: str, number: int) -> Started:
    """One start, on a worker."""
    return number, *_search(problem, key).start(number)


def _search(problem: Problem, key: str) -> Search:
    known: tuple[str, Search] | None = getattr(_here, "search", None)
    if known is None or known[0] != key:
        threadpool_limits(limits=1, user_api="blas")
        known = _here.search = key, problem.search()
    return known[1]
