"""Experiments on a dask cluster of real processes, one of which is killed."""

import os
import signal
from pathlib import Path

import pytest

from runtime.experiments import STUDIES, Request, reproduce
from runtime.library import Library
from tests.runtime import small

pytest.importorskip("pyarrow", reason="pip install 'symgen[experiments]'")
distributed = pytest.importorskip("distributed", reason="pip install 'symgen[cluster]'")


def test_a_killed_worker_changes_no_digit(lib: Library, tmp_path: Path) -> None:
    """Property: chunks on two workers, one dies by SIGKILL in mid-run; rows as here, to the bit."""
    trials = 8
    with (
        small.small(1),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50
        ) as cluster,
    ):
        victim = cluster.workers[0]
        pid = victim.pid
        progress: list[int] = []

        def kill(study: str, done: int, total: int) -> None:
            if study == "ideal":
                progress.append(done)
                if done == 1:
                    os.kill(pid, signal.SIGKILL)

        far = Request(tmp_path / "far", trials, scheduler=cluster.scheduler_address, progress=kill)
        reproduce(lib, STUDIES["ideal"], far)
        assert victim.pid != pid
    assert progress == list(range(trials + 1))
    with small.small():
        reproduce(lib, STUDIES["ideal"], Request(tmp_path / "here", trials))
    assert small.rows_of(tmp_path / "far", "ideal") == small.rows_of(tmp_path / "here", "ideal")
