"""A fleet on a dask cluster of real processes, one of which is killed."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from runtime.identification.statistics_file import statistics_of, write_statistics
from runtime.library import Library
from runtime.monitoring.fleet import gather as room
from runtime.monitoring.fleet.gather import gather
from tests.runtime.monitoring.conftest import Monitored

distributed = pytest.importorskip("distributed", reason="pip install 'symgen[cluster]'")


def test_a_killed_worker_loses_nothing(
    lib: Library, monitored: Monitored, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a worker dies by SIGKILL; the units are those computed here, to the bit."""
    known = statistics_of(monitored.result, "u")
    for k in range(12):
        write_statistics(known, tmp_path / "units" / f"u{k:02d}.npz")
    monkeypatch.setattr(room, "PART", 2)
    done: list[int] = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50
    ) as cluster:
        victim = cluster.workers[0]
        pid = victim.pid

        def kill(units: int, _: int) -> None:
            done.append(units)
            if units == 2:
                os.kill(pid, signal.SIGKILL)

        far = gather(
            lib,
            tmp_path / "units",
            tmp_path / "far",
            scheduler=cluster.scheduler_address,
            progress=kill,
        )
        assert victim.pid != pid
    assert done == [0, 2, 4, 6, 8, 10, 12]
    here = gather(lib, tmp_path / "units", tmp_path / "here")
    assert [unit.name for unit in far] == [f"u{k:02d}" for k in range(12)]
    for one, other in zip(far, here, strict=True):
        for key in ("factor", "target", "friction"):
            np.testing.assert_array_equal(getattr(one, key), getattr(other, key))
