"""What a method trains on: the validation part too where nothing is tuned by it, or all rows."""

import json
from dataclasses import replace

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.estimators.methods import METHODS
from runtime.identification.identified import torque_errors
from runtime.identification.single_log import identify_recording
from runtime.recording import EVERYTHING, Friction, Split
from tests.runtime.diagnosis import EXAMPLE

PARTS = Split((0.0, 0.48), (0.48, 0.6), (0.6, 1.0))


@pytest.mark.parametrize("method", ["map", "pc-ols", "ols", "wls"])
def test_rows_that_nothing_is_tuned_by_are_trained_on(lib, noisy, method):
    """Oracle: the fit of a split whose training part ends where the test part begins.

    One row of a validation part is left there; the tolerance is its share of 600 rows.
    """
    settings = {"friction": Friction(), "certify": False}
    result = identify_recording(noisy, lib, method, split=PARTS, **settings)
    assert len(result.train) == 600
    wide = Split((0.0, 0.598), (0.598, 0.6), (0.6, 1.0))
    assert np.array_equal(
        result.beta, identify_recording(noisy, lib, method, split=wide, **settings).beta
    )


@pytest.mark.parametrize("method", ["adam", "lm", "log-cholesky"])
def test_methods_that_stop_by_the_validation_part_do_not_train_on_it(lib, noisy, method):
    """Property: 48 % of the rows."""
    assert METHODS[method].uses_validation
    result = identify_recording(noisy, lib, method, split=PARTS, certify=False)
    assert len(result.train) == 480


def test_a_validation_recording_stays_apart(lib, ideal_runs):
    """Property: recordings that are given one by one are not joined."""
    train, validation, test = ideal_runs
    result = identify_recording(train, lib, validation=validation, test=test, certify=False)
    assert len(result.train) == len(train)
    assert not result.is_joined


def test_a_test_recording_of_the_same_clock_tests(lib, noisy):
    """Property: a log of the same times is another log where its torque is another."""
    other = replace(noisy, tau=noisy.tau + 0.01)
    settings = {"friction": Friction(), "certify": False}
    assert identify_recording(noisy, lib, validation=other, test=other, **settings).has_test
    assert not identify_recording(noisy, lib, validation=other, test=noisy, **settings).has_test


def test_a_test_part_without_torque_is_refused(lib, noisy):
    """Property: of a drive without power in the last 40 % no error is stated as 0 %."""
    tau = np.where(noisy.t[:, None] < noisy.t[0] + 0.59 * noisy.duration, noisy.tau, 0.0)
    with pytest.raises(IdentificationError, match=r"throughout the test part.*\(leave_out"):
        identify_recording(noisy.replace(tau=tau), lib)


def test_a_split_trains_on_everything(lib, noisy):
    """Property: all rows train, and the error is that of the training, as the warnings say."""
    result = identify_recording(noisy, lib, split=EVERYTHING, friction=Friction(), certify=False)
    assert len(result.train) == len(noisy)
    assert not result.has_test
    assert result.is_joined
    rest = noisy.tau - result.predict_recording(result.train)
    expected = 100 * np.linalg.norm(rest) / np.linalg.norm(noisy.tau)
    assert torque_errors(result)[1].overall == pytest.approx(expected, rel=1e-12)  # rounding


@pytest.mark.parametrize("method", ["map", "pc-ols", "lm"])
def test_a_second_fit_takes_every_row_once(lib, noisy, method):
    """Oracle: the fit to everything; rows of the validation part do not count twice."""
    settings = {"friction": Friction()}
    again = identify_recording(noisy, lib, method, refit=True, split=PARTS, **settings)
    whole = identify_recording(noisy, lib, method, refit=True, split=EVERYTHING, **settings)
    assert again.trained is not None
    assert whole.trained is None
    # Weights of map and pc-ols start from other rows; the rows of the fit are the same.
    np.testing.assert_allclose(again.uncertainty.n_eff, whole.uncertainty.n_eff, rtol=0.02)


def test_the_command_says_what_was_trained_on(command, lib, tmp_path):
    """Property: rows per part, the sentence on the split, and titles of tables."""
    words = ("identify", EXAMPLE, "--robot", lib.folder, "--friction", "viscous", "--out", "out")
    assert "torque error on test data" in command(*words).out
    facts = json.loads((tmp_path / "out" / "result.json").read_text())["recording"]
    assert facts["samples"] == {"train": 600, "validation": 0, "test": 401}
    assert facts["split"] == "train 0.00–5.99 s, test 6.00–10.00 s"
    ran = command(*words, "--split", "all", "--verbose")
    assert ran.code == 0, ran.err
    assert "torque error on training data" in ran.out
    assert "all rows were used for the training" in ran.out
    facts = json.loads((tmp_path / "out" / "result.json").read_text())["recording"]
    assert facts["samples"] == {"train": 1001, "validation": 0, "test": 0}
    assert "training data (no test split)" in (tmp_path / "out" / "report.html").read_text()
    assert command("evaluate", "out", EXAMPLE, "--robot", lib.folder).code == 0
