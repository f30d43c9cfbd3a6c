"""Pieces of work on a dask cluster, with the results of a single machine.

A worker loads the library from the robot's folder by itself, so it must see the same files. Dask
repeats the pieces of a lost worker on another one. Sums round differently on other processors, and
so may results.
"""

import os
import threading
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import suppress
from itertools import count
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from runtime.common.optional import optional
from runtime.errors import IdentificationError, RuntimeFault

PATIENCE = 30.0  # time limit for the first worker of a cluster [s]
CONNECTED = 5.0  # time limit for the answer of a scheduler [s]

T = TypeVar("T")


_here = threading.local()  # what a thread of a worker has prepared last, with the key of its call


def on_cluster(
    prepare: Callable[[], Any],
    work: Callable[[Any, Any], T],
    rounds: Iterable[Sequence[Any]],
    scheduler: str,
    of: str,
) -> Generator[T, None, None]:
    """Run `work(prepared, piece)` on every piece of work, on a dask cluster.

    Every thread of a worker prepares once. A round of pieces begins when the one before is done;
    results come in the order in which they end. Closing the iterator cancels pieces that wait and
    abandons those that run.
    """
    what = "work on a cluster, here and on every worker,"
    as_completed = optional("distributed", what, "cluster", IdentificationError).as_completed
    client = _connected(scheduler)
    key = f"symgen-{os.urandom(16).hex()}"
    futures: list[Any] = []
    numbers = count()
    try:
        for pieces in rounds:
            call = _on_worker, key, prepare, work
            futures = [
                client.submit(*call, piece, key=f"{key}-{next(numbers)}", pure=False)
                for piece in pieces
            ]
            try:
                client.wait_for_workers(1, timeout=PATIENCE)
            except TimeoutError:
                raise IdentificationError(
                    f"the scheduler at '{scheduler}' has no worker after {PATIENCE:g} s; start "
                    f"some with: dask worker {scheduler}"
                ) from None
            for future in as_completed(futures, loop=client.loop):
                yield _result(future, scheduler, of)
    finally:
        # The scheduler may be the one that is lost.
        with suppress(Exception):
            client.cancel(futures)
        client.close()


def _on_worker(
    key: str, prepare: Callable[[], Any], work: Callable[[Any, Any], T], piece: Any
) -> T:
    known: tuple[str, Any] | None = getattr(_here, "prepared", None)
    if known is None or known[0] != key:
        threadpool_limits(limits=1, user_api="blas")
        known = _here.prepared = key, prepare()
    return work(known[1], piece)


def _result(future: Any, scheduler: str, of: str) -> Any:
    from distributed import KilledWorker

    if future.cancelled():
        raise IdentificationError(f"the scheduler at '{scheduler}' was lost; start again")
    failure = future.exception()
    if failure is None:
        return future.result()
    if isinstance(failure, KilledWorker):
        raise IdentificationError(
            f"several workers of the cluster ended while they computed {of}; give them more "
            "memory, or leave the setting scheduler out"
        )
    sentence = "" if isinstance(failure, RuntimeFault) else f"{type(failure).__name__}: "
    raise IdentificationError(
        f"on a worker of the cluster: {sentence}{failure}; every worker needs this version of "
        "symgen and must see the same files"
    ) from None


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
