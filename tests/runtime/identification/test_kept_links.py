"""Friction of a later log with the links of an earlier result."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime import Library, Recording, write_recording
from runtime.errors import IdentificationError
from runtime.identification.kept_links import identify_friction
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import SavedResult, read_result
from runtime.identification.single_log import identify_recording
from runtime.recording import Friction
from runtime.simulation import Plant, ideal
from tests.runtime.conftest import Command

SIGMA = 0.05
COLUMNS = Friction(("viscous", "coulomb", "offset"), coulomb_speed=0.03)
THEN = {"viscous": 0.5, "coulomb": 0.3, "offset": 0.0}
NOW = {"viscous": 0.8, "coulomb": 0.15, "offset": 0.1}


@pytest.fixture(scope="module")
def folder(lib: Library, noisy: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Result of a robot with the friction `THEN`."""
    place = tmp_path_factory.mktemp("first")
    result = identify_recording(noisy, lib, friction=COLUMNS, certify=False)
    write_result(result, place, "test")
    return place


@pytest.fixture(scope="module")
def saved(folder: Path) -> SavedResult:
    return read_result(folder)


@pytest.fixture(scope="module")
def later(lib: Library, trajectories, pi_true: np.ndarray) -> Recording:
    """Four seconds of another motion of the same robot with the friction `NOW`."""
    plant = Plant(pi_true, **NOW, torque_noise=SIGMA)
    log = ideal(lib, trajectories[1], plant, rng=np.random.default_rng(3))
    return log.take(slice(0, round(4 * log.rate_hz)), "cut")


def test_a_few_seconds_determine_the_friction(
    lib: Library, saved: SavedResult, later: Recording
) -> None:
    """Oracle: the coefficients of the plant; the links are those of the result, bit by bit."""
    renewed = identify_friction(later, lib, saved)
    result = renewed.result
    assert np.array_equal(result.pi, saved.pi)
    true = np.tile(list(NOW.values()), (lib.n_joints, 1))
    before = np.abs(saved.phi - true) @ np.array([1.0, 1.0, 1.0])
    after = np.abs(result.phi - true) @ np.array([1.0, 1.0, 1.0])
    # Errors of the links (0.5 % of up to 40 N·m on 20 s) join the noise of 4 s.
    assert np.all(after < 0.35 * before)
    assert renewed.earlier.overall > 3 * 100 * _overall_rms(result)
    # The difference over σ: links are fixed, so that their error is not in σ.
    assert np.median(np.abs(result.phi - true) / renewed.sigma) < 2.5


def _overall_rms(result) -> float:  # type: ignore[no-untyped-def]
    test = result.test.required("tau")
    rest = test - result.predict_test()
    return float(np.linalg.norm(rest) / np.linalg.norm(test))


def test_a_joint_at_rest_keeps_its_friction(
    lib: Library, saved: SavedResult, later: Recording
) -> None:
    """Property: columns that the log does not excite have the coefficients of the result."""
    q, dq = later.q.copy(), later.required("dq").copy()
    ddq = later.required("ddq").copy()
    q[:, 0], dq[:, 0], ddq[:, 0] = q[0, 0], 0.0, 0.0
    tau = lib.inverse_dynamics(q, dq, ddq, saved.pi) + 0.8 * dq
    tau += np.random.default_rng(2).normal(0.0, SIGMA, tau.shape)
    renewed = identify_friction(later.replace(q=q, dq=dq, ddq=ddq, tau=tau), lib, saved)
    # Their rows are those of the prior alone: rounding × its condition.
    assert renewed.result.phi[0, :2] == pytest.approx(saved.phi[0, :2], rel=1e-6)
    assert not renewed.sigma[0, :2].any()
    assert not any("does not determine" in note for note in renewed.result.notes)
    assert renewed.result.phi[3, 0] == pytest.approx(0.8, abs=0.05)  # 10 σ of its viscous friction


def test_results_that_have_no_friction_are_refused(
    lib: Library, saved: SavedResult, later: Recording
) -> None:
    bare = replace(saved, friction=Friction(()), phi=saved.phi[:, :0])
    with pytest.raises(IdentificationError, match="without friction; identify the robot with"):
        identify_friction(later, lib, bare)


def test_command(
    lib: Library, folder: Path, later: Recording, command: Command, tmp_path: Path
) -> None:
    """The folder that the command writes is read like one of identify, with the same links."""
    write_recording(later, tmp_path / "today.npz")
    words = ("friction", folder, "today.npz", "--robot", lib.folder)
    ran = command(*words, "--out", "out")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["pi"] == json.loads((folder / "result.json").read_text())["pi"]
    assert facts["uncertainty"] is None
    assert (tmp_path / "out" / "report.html").is_file()
    read = command("evaluate", "out", "today.npz", "--robot", lib.folder, "--json")
    first = command("evaluate", folder, "today.npz", "--robot", lib.folder, "--json")
    errors = [
        json.loads(each.out)["torque_error_percent"]["after_overall"] for each in (read, first)
    ]
    assert errors[0] < errors[1] / 3
    again = command(*words, "--out", "out")
    assert again.code == 2
    assert "exist; choose another place with --out, or give --overwrite" in again.err
