"""Processor cores and threads of this process."""

import functools
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import ContextVar
from itertools import islice
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

_INSIDE: ContextVar[bool] = ContextVar("one_blas_thread", default=False)
"""Whether a call of this context has limited the threads already."""
P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")


def cores() -> int:
    """Number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def computed_ahead(work: Callable[[T], R], items: Iterable[T], most: int) -> Iterator[R]:
    """`work` of each item in order, `most` at a time on threads; this thread takes the items."""
    source, waiting = iter(items), deque[Future[R]]()
    with ThreadPoolExecutor(min(cores(), most)) as pool:
        while True:
            for item in islice(source, most - len(waiting)):
                waiting.append(pool.submit(work, item))
            if not waiting:
                return
            yield waiting.popleft().result()


def one_blas_thread(function: Callable[P, R]) -> Callable[P, R]:
    """Run a function with one BLAS thread; with a hundred columns further threads only wait.

    On a busy machine of two cores the second thread made identification ten times slower. Finding
    the libraries of the process takes 2 ms, so that only the outermost call does.
    """

    @functools.wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        if _INSIDE.get():
            return function(*args, **kwargs)
        token = _INSIDE.set(True)
        try:
            with threadpool_limits(limits=1, user_api="blas"):
                return function(*args, **kwargs)
        finally:
            _INSIDE.reset(token)

    return limited
