"""Controller file: a log's controller and reference as a file, and what identify makes of it."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.literature.iv_didim import read_controller
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import write_motion
from runtime.library import Library
from runtime.simulation import Controller
from runtime.simulation.closed_loop import write_controller
from tests.runtime.conftest import Command


@pytest.fixture
def motion(lib: Library, trajectories: tuple[Trajectory, ...], tmp_path: Path) -> Trajectory:
    """The training motion, written as motion.json."""
    write_motion(trajectories[0], lib, tmp_path / "motion.json")
    return trajectories[0]


def test_a_loop_returns_as_it_was_written(lib: Library, motion: Trajectory, tmp_path: Path) -> None:
    """Property: write and read keep every number."""
    gains = Controller(stiffness=np.linspace(200, 300, 7), damping=25.0)
    rotor = np.full(7, 0.2)
    write_controller(tmp_path / "log.loop.toml", "motion.json", gains, rotor, 500.0, 0.25)
    back = read_controller(tmp_path / "log.loop.toml", lib)
    assert np.array_equal(back.controller.stiffness, gains.stiffness)
    assert np.array_equal(back.controller.damping, np.full(7, 25.0))
    assert np.array_equal(back.rotor, rotor)
    assert (back.rate_hz, back.start) == (500.0, 0.25)
    assert np.array_equal(back.reference.coefficients, motion.coefficients)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[controller", "cannot be read as TOML"),
        ("[controller]\nstiffness = 1.0", "expects the key reference, got none; add it"),
        ("[reference]\nstart = 1.0", "expects the key trajectory in reference, got none; add it"),
        ("[controller]\ngain = 1.0", "unknown key 'gain' in controller; did you mean 'damping'"),
        ("stiffness = 1.0", "unknown key 'stiffness'; known are controller, reference"),
        (
            "[controller]\nstiffness = true",
            "controller.stiffness expects one number from 0 up, or one per joint, got True",
        ),
        (
            '[controller]\nstiffness = [1.0, 2.0]\n[reference]\ntrajectory = "motion.json"',
            "needs one number, or one for each of the 7 joints, got 2",
        ),
        (
            '[controller]\ndamping = -1.0\n[reference]\ntrajectory = "motion.json"',
            "controller.damping expects one number from 0 up, or one per joint, got -1.0",
        ),
        ('[reference]\ntrajectory = "other.json"', "is not a trajectory"),
        ('[reference]\ntrajectory = "../motion.json"', "does not lie beside it"),
        ('[reference]\ntrajectory = "/dev/zero"', "does not lie beside it"),
        (
            '[controller]\nrate_hz = [1.0]\n[reference]\ntrajectory = "motion.json"',
            r"controller.rate_hz expects a number, got \[1.0\]",
        ),
        (
            '[controller]\nrate_hz = 0\n[reference]\ntrajectory = "motion.json"',
            "controller.rate_hz expects a number above 0, got 0",
        ),
        (
            '[controller]\nrotor = inf\n[reference]\ntrajectory = "motion.json"',
            "controller.rotor expects a finite number",
        ),
    ],
)
def test_files_that_are_no_loop(
    lib: Library, motion: Trajectory, tmp_path: Path, text: str, sentence: str
) -> None:
    """Property: what is wrong with the file, in one sentence."""
    path = tmp_path / "loop.toml"
    path.write_text(text)
    with pytest.raises((IdentificationError, RecordingError), match=sentence):
        read_controller(path, lib)
    with pytest.raises(IdentificationError, match="cannot be read as TOML"):
        read_controller(tmp_path / "missing.toml", lib)


def test_simulate_and_identify_by_the_loop(
    lib: Library, motion: Trajectory, tmp_path: Path, command: Command
) -> None:
    """Property: the log, the loop and the truth that simulate writes serve DIDIM and IV."""
    robot = ("--robot", lib.folder)
    made = command(
        *("simulate", *robot, "--trajectory", "motion.json", "--out", "log.npz"),
        *("--settings", "viscous=0.3", "--settings", "coulomb=0.3", "--seed", "3"),
    )
    assert (made.code, made.err) == (0, "")
    truth = json.loads((tmp_path / "log.truth.json").read_text())
    beta = lib.base_matrix @ np.array(truth["pi"])
    common = (
        "log.npz",
        *robot,
        "--friction",
        "viscous,coulomb",
        "--settings",
        "coulomb_speed=0.03",
    )
    for method in ("didim", "iv"):
        folder = tmp_path / method
        options = ("--method", method, "--cutoff", "20", "--settings", "rate=100", "--out", folder)
        known = command("identify", *common, *options)
        assert known.code == 2
        assert (
            "give the controller's gains and the reference motion by --settings controller"
            in known.err
        )
        assert not folder.exists()
        ran = command("identify", *common, *options, "--settings", "controller=log.loop.toml")
        assert (ran.code, ran.err) == (0, "")
        facts = json.loads((folder / "result.json").read_text())
        # σ_q = 1e-5, σ_τ = 0.05, 48 % of the run: some tenths of a percent.
        error = np.linalg.norm(np.array(facts["beta"]) - beta) / np.linalg.norm(beta)
        assert error < 0.01
        assert "converged after" in facts["status"]
