"""Processes that search side by side, and Ctrl-C."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.workers import Sent
from runtime.library import load
from tests.conftest import REPOSITORY
from tests.runtime.processes import QUIET

WAITING = """
import atexit
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job inherits "ignore"
from runtime.excitation.search.workers import side_by_side
from tests.runtime.excitation.search.test_processes import Sleep, small_problem
atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # before exit hooks of libraries
for number, *_ in side_by_side(small_problem(), [[Sleep(0, 0), Sleep(1, 1000), Sleep(2, 1000)]], 2):
    print("waiting", flush=True)
"""


@dataclass(frozen=True)
class Sleep:
    """A task that takes its time."""

    number: int
    seconds: float

    def done(self, _: object) -> tuple[float, np.ndarray]:
        time.sleep(self.seconds)
        return 0.0, np.zeros(1)


def small_problem() -> Sent:
    """A problem that a worker is quick to prepare."""
    lib = load(REPOSITORY / "generated/fr3")
    return lib.folder, lib.level, DesignSettings(1.0, 1)


def test_ctrl_c_ends_the_workers_however_often_it_comes(tmp_path: Path) -> None:
    """Property: no waiting for tasks under way; a user who hammers leaves no process behind."""
    with subprocess.Popen(
        [sys.executable, "-c", WAITING],
        cwd=tmp_path,
        env=QUIET,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "waiting\n"
            for _ in range(3):
                process.send_signal(signal.SIGINT)
                time.sleep(0.01)
            # Workers hold stdout open: its end is theirs. A task lasts 1000 s, a loaded machine 40.
            _, err = process.communicate(timeout=300)
        finally:
            process.kill()
    assert process.returncode == -signal.SIGINT
    assert err.rstrip().endswith("KeyboardInterrupt")


def test_workers_end_with_a_killed_search(tmp_path: Path) -> None:
    """Property: SIGKILL of the search leaves no worker behind, busy or idle.

    Two workers: one does a task of 1000 s, the other has ended its task and waits for another.
    """
    with subprocess.Popen(
        [sys.executable, "-c", WAITING.replace(", Sleep(2, 1000)", "")],
        cwd=tmp_path,
        env=QUIET,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "waiting\n"
            process.kill()
            # Workers hold stdout open: its end is theirs. They end at once, a loaded machine in 40.
            process.communicate(timeout=300)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
