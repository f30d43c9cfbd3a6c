"""Campaigns that are killed: the same call continues from the files."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from runtime.campaign.campaign import Plan, run_campaign
from runtime.campaign.drivers.virtual import VirtualDriver
from runtime.campaign.shortest_session import target_of
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import write_motion
from runtime.library import Library, load

PLAN = Plan("v=1mNm", duration=0.5, stages=(50.0, 100.0), most_seconds=1.5, rehearses=False)
KILLED = f"""
import os, signal, sys
from pathlib import Path
from runtime.campaign.campaign import Plan, run_campaign
from runtime.campaign.shortest_session import target_of
from runtime.campaign.drivers.virtual import VirtualDriver
from runtime.library import load

plan = {PLAN!r}
robot, moment = VirtualDriver(load(sys.argv[1])), sys.argv[3]
kill = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
if moment == "state":
    os.replace = kill
else:
    usual, count = robot.exchange, []
    def exchange(reference):
        count.append(0)
        return kill() if len(count) == 1250 else usual(reference)
    robot.exchange = exchange
run_campaign(robot, plan, target_of(plan.target), Path(sys.argv[2]))
"""
"""Killed while the first file is written, or in the second stage."""


@pytest.fixture(scope="module")
def pendulum(tiny_built: Path) -> Library:
    return load(tiny_built)


def campaign(lib: Library, folder: Path) -> float:
    """Run or continue a campaign."""
    return run_campaign(VirtualDriver(lib), PLAN, target_of(PLAN.target), folder).sigma


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_killed_campaign_continues(pendulum: Library, tmp_path: Path) -> None:
    """Property: killed while a file is written, and in the middle of a stage, to the bit."""
    motion = Trajectory(pendulum.home, np.array([[0.06, -0.04, 0.02]]), PLAN.duration)
    folders = {name: tmp_path / name for name in ("undisturbed", "state", "stage")}
    for folder in folders.values():
        write_motion(motion, pendulum, folder / "motion-1.json", {})
    sigma = campaign(pendulum, folders["undisturbed"])
    expected = {path.relative_to(folders["undisturbed"]) for path in _files(folders["undisturbed"])}
    for moment in ("state", "stage"):
        folder = folders[moment]
        words = [sys.executable, "-c", KILLED, pendulum.folder, folder, moment]
        assert subprocess.run(words, check=False).returncode == -signal.SIGKILL
        assert any(".symgen." in path.name for path in _files(folder)) == (moment == "state")
        assert campaign(pendulum, folder) == sigma
        assert {path.relative_to(folder) for path in _files(folder)} == expected
        log, other = (np.load(f / "log-1-100.npz") for f in (folder, folders["undisturbed"]))
        for key in ("t", "q", "dq", "tau"):
            assert (log[key] == other[key]).all()


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]
