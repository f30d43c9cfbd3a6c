"""Friction nets and the NN-aided method: nets learn friction, and only friction."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime import Identification, Recording
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.literature.neural import UNITS, FrictionNet, _forward, _slopes, train
from runtime.estimators.regression.samples import samples_of
from runtime.excitation import Trajectory
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import read_result
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Split, write_recording
from runtime.recording.preprocessing import prepare
from runtime.simulation import Plant, ideal
from tests.runtime.conftest import Command
from tests.runtime.estimators.plant import SPEED, simulated_case
from tests.taylor import assert_second_order, taylor_slope

TERMS = Friction(("viscous", "coulomb", "dahl"), SPEED)
HALVES = Split((0.0, 0.6), (0.6, 0.95), (0.95, 1.0))


def stribeck(dq: np.ndarray) -> np.ndarray:
    """A friction that no linear column has: more at slow speeds, N·m."""
    return 0.6 * np.tanh(dq / SPEED) * np.exp(-((dq / 0.3) ** 2))


@pytest.fixture(scope="module")
def sticky(lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray) -> Recording:
    """Linear friction, Stribeck friction and 0.02 N·m of noise."""
    plant = Plant(pi_true, viscous=0.4, coulomb=0.4, coulomb_speed=SPEED, torque_noise=0.02)
    log = ideal(lib, trajectories[0], plant, 200.0, np.random.default_rng(3))
    return log.replace(tau=log.tau + stribeck(log.dq))


@pytest.fixture(scope="module")
def learned(sticky: Recording, lib: Library) -> Identification:
    return identify_recording(sticky, lib, "nn", friction=TERMS, split=HALVES, certify=False)


def rms(estimated: Identification, motion: tuple[np.ndarray, ...], tau: np.ndarray) -> float:
    return float(np.sqrt(np.mean((estimated.predict(*motion) - tau) ** 2)))


def test_the_net_learns_what_linear_friction_cannot(
    lib: Library,
    sticky: Recording,
    learned: Identification,
    trajectories: tuple[Trajectory, ...],
    pi_true: np.ndarray,
) -> None:
    """Oracle: the friction of the plant on another motion, far below the linear fit's error."""
    linear = identify_recording(sticky, lib, "pc-ols", friction=TERMS, split=HALVES, certify=False)
    motion = trajectories[2].at(lib, np.arange(0.0, 10.0, 0.02))[:3]
    truth = Plant(pi_true, viscous=0.4, coulomb=0.4, coulomb_speed=SPEED)
    tau = ideal(lib, trajectories[2], truth, 50.0).tau[:-1] + stribeck(motion[1])
    # Linear columns leave 0.09 N·m of the 0.6; the net a third of that, noise of 0.02 included.
    assert rms(linear, motion, tau) > 0.05
    assert rms(learned, motion, tau) < rms(linear, motion, tau) / 2
    assert learned.is_consistent
    assert learned.loss < linear.loss


def test_without_friction_the_net_is_silent(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Property: on a plant without friction the net stays below 3σ, and π a body."""
    plant = simulated_case(
        lib, trajectories[0], trajectories[2], pi_true, 1e-5, viscous=0.0, coulomb=0.0
    )
    estimated = plant.identify("nn", friction=TERMS, split=HALVES)
    samples = samples_of(estimated.train, lib)
    assert estimated.learned is not None
    # σ = 0.05 N·m.
    assert np.sqrt(np.mean(estimated.learned(samples.columns) ** 2, axis=0)).max() < 0.15
    assert estimated.is_consistent
    # As without nets, 0.13 %.
    assert plant.base_error(estimated) < 0.3


def test_slopes_of_the_net() -> None:
    """Derivative: the Taylor remainder of y(θ) falls as h²."""
    rng = np.random.default_rng(0)
    x, theta = rng.normal(size=(30, 3)), rng.normal(size=UNITS * 5 + 1)
    along = rng.normal(size=theta.size)
    slope = _slopes(theta, x, _forward(theta, x)[1]) @ along
    # Values of size 1 round at 1e-16, so the remainder h² is seen from 1e-1 to 1e-6.
    assert_second_order(taylor_slope(lambda at: _forward(at, x)[0], theta, along, slope), 4.0)


def test_training_fits_a_net_of_the_same_kind() -> None:
    """Oracle: a random net is learned from its outputs; a silent joint keeps the zero net."""
    rng = np.random.default_rng(1)
    x = rng.normal(size=(400, 2, 3))
    truth = FrictionNet(rng.normal(size=(2, UNITS * 5 + 1)), np.ones((2, 3)))
    y = truth(x) * [1.0, 0.0]
    estimated = train(x[:300], y[:300], x[300:], y[300:], np.random.default_rng(2))
    # The penalty of 1e-4 N ‖θ‖², ‖θ‖² = 20, leaves at most √(2e-3) of the output.
    assert np.std(estimated(x)[:, 0] - y[:, 0]) < 0.05 * np.std(y[:, 0])
    assert not estimated.theta[1].any()


def test_nets_need_columns(sticky: Recording, lib: Library) -> None:
    """Property: without friction columns there is nothing to learn from, in one sentence."""
    with pytest.raises(IdentificationError, match="the method nn needs friction columns"):
        identify_recording(sticky, lib, "nn", split=HALVES)


def test_results_keep_the_net(
    learned: Identification, sticky: Recording, tmp_path: Path, command: Command, lib: Library
) -> None:
    """Property: evaluate computes what the net said; export says what its formats omit."""
    record = write_result(learned, tmp_path / "found", "a test")
    write_recording(sticky, tmp_path / "log.npz")
    ran = command(
        "evaluate", tmp_path / "found", tmp_path / "log.npz", "--robot", lib.folder, "--json"
    )
    assert ran.code == 0
    seen = json.loads(ran.out)["torque_error_percent"]["after_overall"]
    whole = prepare(sticky, None, TERMS, lib=lib)
    error = learned.predict_recording(whole) - sticky.tau
    percent = 100 * np.linalg.norm(error) / np.linalg.norm(sticky.tau)
    # Numbers pass through JSON and NPZ unrounded.
    assert seen == pytest.approx(percent, rel=1e-9)
    assert record.friction.net
    ran = command("export", tmp_path / "found", "--to", "urdf", "--robot", lib.folder)
    assert ran.code == 0
    assert "note: friction that nn learned has no counterpart in these formats" in ran.out + ran.err


def test_other_commands_and_damaged_nets_are_refused(
    learned: Identification, tmp_path: Path
) -> None:
    """Property: what reads columns only refuses a net, and a net of other joints is damage."""
    write_result(learned, tmp_path, "a test")
    facts = json.loads((tmp_path / "result.json").read_text())
    with pytest.raises(RecordingError, match=r"method nn learned more.* another method"):
        read_result(tmp_path)
    assert read_result(tmp_path, with_learned=True).learned is not None
    net = facts["friction"]["net"]
    for damage in (
        {"theta": net["theta"][:-1]},
        {"theta": [[None] * len(row) for row in net["theta"]]},
        {"theta": "deep"},
        {"scale": [row[:-1] for row in net["scale"]]},
        {"scale": [[0.0] * len(row) for row in net["scale"]]},
        {key: rows[:-1] for key, rows in net.items()},
        {key: [*rows, rows[0]] for key, rows in net.items()},
    ):
        friction = {**facts["friction"], "net": {**net, **damage}}
        (tmp_path / "result.json").write_text(json.dumps({**facts, "friction": friction}))
        with pytest.raises(RecordingError, match=r"holds no valid result.json"):
            read_result(tmp_path, with_learned=True)
