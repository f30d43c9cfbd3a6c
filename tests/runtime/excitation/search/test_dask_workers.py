"""A search on a dask cluster of real processes, one of which is killed."""

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime import parallel as room
from runtime.errors import IdentificationError
from runtime.excitation.search import workers as processes
from runtime.excitation.search.design import design
from runtime.library import Library
from tests.runtime.conftest import Command

distributed = pytest.importorskip("distributed", reason="pip install 'symgen[cluster]'")

SMALL = {"duration": 4.0, "harmonics": 2}
"""s and harmonics of a search whose start takes a tenth of a second."""


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50
    ) as result:
        yield result


def test_a_killed_worker_does_not_matter(lib: Library, cluster: Any) -> None:
    """Property: a worker dies by SIGKILL; all starts are told, the design is ours to the bit."""
    starts = 4
    victim = cluster.workers[0]
    pid = victim.pid
    reports: list[tuple[int, float, float]] = []

    def kill(*now: Any) -> None:
        reports.append(now)
        if len(reports) == 1:
            os.kill(pid, signal.SIGKILL)

    far = design(
        lib, **SMALL, starts=starts, seed=3, progress=kill, scheduler=cluster.scheduler_address
    )
    alone = design(lib, **SMALL, starts=starts, seed=3)
    assert np.array_equal(far.trajectory.coefficients, alone.trajectory.coefficients)
    assert far.conditions == alone.conditions
    assert [done for done, _, _ in reports] == list(range(1, starts + 1))
    assert victim.pid != pid


def test_the_command_on_a_cluster_and_interrupted(
    command: Command, lib: Library, cluster: Any, tmp_path: Path
) -> None:
    """Property: the setting scheduler works from any folder; Ctrl-C keeps what has ended."""
    address = cluster.scheduler_address
    folder = os.path.relpath(lib.folder, tmp_path)  # from where the command runs, not the workers
    words = (
        "--duration",
        4,
        "--settings",
        f"harmonics={2}",
        "--settings",
        f"starts={2}",
        "--settings",
        "document=true",
    )
    ran = command("excite", "--robot", folder, *words, "--settings", f"scheduler={address}")
    assert ran.code == 0, ran.err
    reports: list[float] = []

    def stop(done: int, condition: float, _: float) -> None:
        reports.append(condition)
        if done == 2:
            raise KeyboardInterrupt

    kept = design(lib, **SMALL, starts=500, progress=stop, scheduler=address)
    assert sorted(kept.conditions) == sorted(reports)
    assert len(reports) == 2


def test_errors_of_a_cluster_are_one_sentence(
    command: Command, lib: Library, cluster: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: no scheduler, no address, no room for a motion on a worker, no dask."""
    monkeypatch.setattr(room, "CONNECTED", 0.5)
    for address in ("tcp://127.0.0.1:9", "nonsense://x", ""):
        with pytest.raises(IdentificationError, match="there is no dask scheduler at"):
            design(lib, **SMALL, scheduler=address)
    monkeypatch.setattr(processes, "_done", os.listdir)  # on a worker: too many arguments
    with pytest.raises(IdentificationError, match=r"on a worker of the cluster: TypeError: .*see"):
        design(lib, **SMALL, scheduler=cluster.scheduler_address)
    monkeypatch.setitem(sys.modules, "distributed", None)
    words = ("--robot", lib.folder, "--settings", "scheduler=tcp://127.0.0.1:9")
    ran = command("excite", *words)
    assert ran.code == 2
    assert "pip install 'symgen[cluster]'" in ran.err


def test_a_cluster_without_workers_is_reported(
    lib: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a wait that ends."""
    monkeypatch.setattr(room, "PATIENCE", 0.2)
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=":0", silence_logs=50) as empty,
        pytest.raises(IdentificationError, match=r"has no worker after 0\.2 s"),
    ):
        design(lib, **SMALL, scheduler=empty.scheduler_address)
