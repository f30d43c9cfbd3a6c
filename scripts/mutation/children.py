"""Forked processes that run tests on one mutant each, and end at the first failure."""

import os
import resource
import signal
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

MEMORY = 8 << 30
"""Limit of the data of a child [bytes]: a mutant may ask for any size of array."""
WALL_S = 900.0
"""After this time a child counts as hanging [s]; that it computes without end shows earlier."""


@dataclass(frozen=True, slots=True)
class Ended:
    """Outcome of a child.

    Attributes:
        noticed: True unless every test passed.
        by: the test that failed or exceeded its time; empty if none or before the first one.
        n_tests: number of tests started.
        seconds: CPU time [s].
    """

    noticed: bool
    by: str
    n_tests: int
    seconds: float = 0.0


class Watch:
    """Pytest plugin of a child: limits the CPU time of tests and ends the process at a failure.

    Args:
        journal: receives the name of each test before it starts.
        seconds: expected CPU time by test [s]; tests that are not in it count as 1 s.
    """

    def __init__(self, journal: Path, seconds: dict[str, float]) -> None:
        self.journal, self.seconds = journal, seconds

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Name the test and set its alarm, whose default action ends the process."""
        with self.journal.open("a", encoding="utf-8") as file:
            file.write(item.nodeid + "\n")
        signal.setitimer(signal.ITIMER_PROF, 20 + 10 * self.seconds.get(item.nodeid, 1.0))
        return (yield)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """End the process: the mutant is noticed."""
        if report.failed:
            os._exit(1)


def ended(
    jobs: Iterable[Any], work: Callable[[Any, Path], object], processes: int
) -> Iterator[tuple[Any, Ended]]:
    """Run jobs in forked children, a few at a time.

    Args:
        jobs: taken one by one, each only when a child is free.
        work: called in the child with the job and its journal; a return value or an exception
            ends the child, 0 and None mean that every test passed.
        processes: number of children at a time.

    Returns:
        Jobs with their outcome, in the order in which they end.
    """
    waiting = iter(jobs)
    running: dict[int, tuple[Any, Path, float]] = {}
    with tempfile.TemporaryDirectory(prefix="mutate-journals-") as folder:
        count = 0
        while True:
            while len(running) < processes:
                try:
                    job = next(waiting)
                except StopIteration:
                    break
                count += 1
                journal = Path(folder, str(count))
                running[_fork(work, job, journal)] = (job, journal, time.monotonic())
            if not running:
                return
            pid, status, seconds = _wait(running)
            job, journal, _ = running.pop(pid)
            _end_group(pid)
            names = journal.read_text("utf-8").splitlines() if journal.exists() else []
            noticed = os.waitstatus_to_exitcode(status) != 0
            by = names[-1] if noticed and names else ""
            yield job, Ended(noticed, by, len(names), seconds)


def _fork(work: Callable[[Any, Path], object], job: object, journal: Path) -> int:
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        os.setsid()
        silent = os.open(os.devnull, os.O_RDWR)
        for number in (0, 1, 2):
            os.dup2(silent, number)
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        code = int(work(job, journal) or 0)  # type: ignore[call-overload]
    except BaseException:  # a mutant may raise anything, in a plugin or at import
        code = 1
    finally:
        os._exit(code)


def _wait(running: dict[int, tuple[Any, Path, float]]) -> tuple[int, int, float]:
    """Wait for one of the children; one that takes too long is killed."""
    while True:
        for pid, (_, _, start) in running.items():
            done, status, usage = os.wait4(pid, os.WNOHANG)
            if done:
                return pid, status, usage.ru_utime + usage.ru_stime
            if time.monotonic() - start > WALL_S:
                _end_group(pid)
        time.sleep(0.02)


def _end_group(pid: int) -> None:
    """Kill a child and the processes that it started."""
    try:
        os.killpg(pid, signal.SIGKILL)
    except ProcessLookupError:
        return
