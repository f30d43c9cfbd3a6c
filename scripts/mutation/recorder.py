"""Pytest plugin: which test executes which line, and how long each test takes.

Each process (one per worker of pytest-xdist) writes into the folder of `MUTATION_MAP` a file of
coverage data, whose contexts are the tests, and the CPU time of each test.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path

import coverage
import pytest

FOLDER = "MUTATION_MAP"
"""Environment variable: where the recording goes."""
PACKAGES = ("runtime", "symgen")


class Recorder:
    """Coverage of one process, with the running test as its context."""

    def __init__(self, folder: Path, worker: str) -> None:
        self.times = folder / f"times.{worker}.jsonl"
        root = Path(__file__).resolve().parents[2]
        self.coverage = coverage.Coverage(
            data_file=str(folder / f"lines.{worker}"),
            source=[str(root / package) for package in PACKAGES],
            config_file=False,
            messages=False,
        )
        self.coverage.start()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Name the context after the test, its fixtures included."""
        self.coverage.switch_context(item.nodeid)
        start = sum(os.times()[:4])  # with that of compilers
        result = yield
        with self.times.open("a", encoding="utf-8") as file:
            file.write(json.dumps([item.nodeid, sum(os.times()[:4]) - start]) + "\n")
        return result

    def pytest_unconfigure(self) -> None:
        """Write the coverage data."""
        self.coverage.stop()
        self.coverage.save()


def pytest_configure(config: pytest.Config) -> None:
    """Record in the workers; without workers, in this process."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "")
    if worker or not config.getoption("numprocesses", None):
        config.pluginmanager.register(Recorder(Path(os.environ[FOLDER]), worker or "main"))
