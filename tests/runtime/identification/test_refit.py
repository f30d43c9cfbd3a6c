"""The second fit to all rows, and the test part of a motion out and back."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording
from runtime.estimators.regression.samples import samples_of
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import basis_of
from runtime.excitation.search.criteria import unseen_joints
from runtime.identification.expected_accuracy.expected import Knowledge, expected, unseen_torque
from runtime.identification.expected_accuracy.planned_samples import (
    motion_samples_of,
    planned_recording,
)
from runtime.identification.identified import Identification, torque_errors
from runtime.identification.metrics import torque_error
from runtime.identification.result_file import retraced, write_result
from runtime.identification.several_logs import NamedLog
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, Split, read_recording
from runtime.recording.preprocessing.parts import split
from runtime.simulation import Plant, ideal, sample_times
from runtime.simulation.closed_loop import perturbed_lam
from tests.runtime.conftest import Command

SIGMA = 0.05
DRAWS = 16


@pytest.fixture(scope="module")
def pair(lib: Library, noisy: Recording) -> tuple[Identification, Identification]:
    """Fit to the training part, and the same fitted again to all rows."""
    return tuple(
        identify_recording(noisy, lib, "ols", friction=Friction(), refit=again, certify=again)
        for again in (False, True)
    )  # type: ignore[return-value]


def test_parameters_are_those_of_all_rows(
    lib: Library, pair: tuple[Identification, Identification]
) -> None:
    """Oracle: numpy's least squares on the rows of both parts; validation is in the training."""
    alone, whole = pair
    parts = [samples_of(part, lib) for part in (alone.train, alone.test)]
    rows = [np.concatenate([s.base_rows(lib), s.friction_rows()], axis=2) for s in parts]
    matrix = np.concatenate([r.reshape(-1, r.shape[2]) for r in rows])
    target = np.concatenate([s.tau.ravel() for s in parts])
    solution = np.linalg.lstsq(matrix, target, rcond=None)[0]
    count = len(lib.base_columns)
    # Rounding × the square of the raw columns' condition number.
    assert whole.beta == pytest.approx(solution[:count], rel=1e-6, abs=1e-9)
    assert whole.phi.ravel() == pytest.approx(solution[count:], rel=1e-6, abs=1e-9)
    assert np.abs(whole.beta - alone.beta).max() > 1e-4
    assert whole.uncertainty is not None
    assert whole.uncertainty.n_samples == sum(map(len, parts))
    assert any("fitted to all" in note for note in whole.notes)


def test_errors_are_those_of_the_training_fit(
    pair: tuple[Identification, Identification], tmp_path: Path
) -> None:
    """Property: equal to the bit, and computable from result.json alone."""
    alone, whole = pair
    assert torque_errors(whole)[1].overall == torque_errors(alone)[1].overall
    assert whole.loss == alone.loss
    write_result(whole, tmp_path, "a test")
    facts = json.loads((tmp_path / "result.json").read_text())
    assert facts["pi"] == whole.pi.tolist()
    trained = replace(
        whole,
        pi=np.array(facts["trained"]["pi"]),
        phi=np.array(facts["trained"]["friction_values"]),
    )
    recomputed = torque_error(whole.test.tau, trained.predict_recording(whole.test)).overall
    assert facts["torque_error_percent"]["after_overall"] == recomputed
    predictions = np.load(tmp_path / "predictions.npz")
    assert torque_error(predictions["measured"], predictions["after"]).overall == recomputed


def test_methods_that_stop_by_validation_keep_the_training_fit(
    lib: Library, noisy: Recording
) -> None:
    """Property: so do results with a test recording of their own, and several logs."""
    for settings in ({"preset": "real"}, {"validation": noisy, "test": noisy}):
        result = identify_recording(noisy, lib, refit=True, certify=False, **settings)
        assert result.trained is None
    logs = [NamedLog(name, noisy, Preparation()) for name in ("one", "two")]
    result = identify_recording(logs, lib, refit=True, preset="real")
    assert result.trained is None


def test_the_real_error_is_the_predicted_one(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Monte Carlo: torque error on other motions over what `predict` expects of the motion."""
    joints = unseen_joints(lib, lib.home)
    t = sample_times(trajectories[0].duration, 100.0)
    planned = planned_recording(trajectories[0], t, lib, "planned")
    samples = motion_samples_of(planned, lib, None, Friction())
    statistics = samples.statistics(lib, np.full(lib.n_joints, SIGMA))
    expectation = expected(lib, statistics, Knowledge.of(lib), 1.0, samples.columns)
    errors = []
    for seed in range(DRAWS):
        rng = np.random.default_rng(seed)
        plant = Plant(
            lib.pi_from_lam(perturbed_lam(lib, 0.05, rng)),
            *(0.3, 0.5, 0.1),
            coulomb_speed=Friction().coulomb_speed,
            torque_noise=SIGMA,
        )
        log = ideal(lib, trajectories[0], plant, rng=rng)
        result = identify_recording(log, lib, friction=Friction(), refit=True, certify=False)
        errors.append(result.beta - lib.base_matrix @ plant.pi)
    real = np.einsum("ik,jkl,il->", errors, joints, errors) / DRAWS
    # 16 draws of some ten independent directions: ± 8 %. The training part alone gives 0.62.
    stated = np.linalg.norm(unseen_torque(lib.base_matrix @ expectation.root, joints))
    assert 0.85 < stated / np.sqrt(real) < 1.15


def test_a_motion_out_and_back_tests_on_its_training_rows(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Property: nearly all test rows were in training; those of a Fourier series were not."""
    bent = np.hstack([trajectories[0].coefficients, 0.7 * trajectories[1].coefficients]) / 2
    series = Trajectory(lib.home, bent, 10.0, basis_of("fourier"))
    shares = []
    for motion in (trajectories[0], series):
        log = ideal(lib, motion, Plant(lib.pi0))
        train, _, test = split(log, Split())
        shares.append(retraced(train, test))
    assert shares[0] > 0.95
    assert shares[1] < 0.3


def test_the_command_refits(command: Command, lib: Library, tmp_path: Path) -> None:
    """Property: by default, not with --settings refit=false; retraced rows are named; --settings
    report=false holds.
    """
    log = "fr3_simulated"
    assert command("identify", log, "--robot", lib.folder, "--out", "a").code == 0
    ran = command(
        "identify",
        log,
        "--robot",
        lib.folder,
        "--out",
        "b",
        "--settings",
        "refit=false",
        "--settings",
        "report=false",
    )
    assert ran.code == 0
    assert "report" not in ran.out
    assert [(tmp_path / name / "report.html").exists() for name in "ab"] == [True, False]
    facts = [json.loads((tmp_path / name / "result.json").read_text()) for name in "ab"]
    assert facts[0]["trained"]["pi"] == facts[1]["pi"] != facts[0]["pi"]
    assert facts[1]["trained"] is None
    assert facts[0]["torque_error_percent"] == facts[1]["torque_error_percent"]
    assert any("repeat positions and speeds" in warning for warning in facts[0]["warnings"])


def test_more_rows_of_one_log_accuse_no_joint(lib: Library, shared_data: Path) -> None:
    """Real data: the training rows of panda_gaz contradict neither torques nor URDF, nor do all.

    With the rows of all parts the friction that no column has exceeds the margin of both tests.
    """
    log = read_recording(shared_data / "data/panda_gaz", "panda_gaz")
    result = identify_recording(log, lib, refit=True)
    assert result.uncertainty is not None
    assert result.trained is not None
    assert result.uncertainty.contradictions == ()
