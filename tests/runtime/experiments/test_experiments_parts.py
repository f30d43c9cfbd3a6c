"""Parts of the document's experiments alone: the judge, the sines, the bands, the robot."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from runtime.estimators.regression.samples import samples_of
from runtime.experiments import storage as document_room
from runtime.experiments.studies.monte_carlo import band
from runtime.experiments.study import Row
from runtime.experiments.trials import document_robot, scorer_of, sinusoidal
from runtime.library import Library
from runtime.recording import Recording

pytest.importorskip("pyarrow", reason="pip install 'symgen[experiments]'")


def test_the_judge_measures_by_the_book(
    lib: Library, pi_true: np.ndarray, ideal_runs: tuple[Recording, ...]
) -> None:
    """Oracle: generalised eigenvalues by SciPy, Eq. 5.1 by hand; 1e-9 is their rounding."""
    test = samples_of(ideal_runs[2], lib)
    ours = scorer_of(lib, test, pi_true, 5)
    row = ours.row(lib.pi0)
    q = test.q[[0, 250, 500, 750, 1000]]
    pairs = [(lib.mass_matrix(x, pi_true), lib.mass_matrix(x, lib.pi0)) for x in q]
    logs = [np.log(scipy.linalg.eigh(b, a, eigvals_only=True)) for a, b in pairs]
    assert row["airm"] == pytest.approx(np.mean([np.linalg.norm(x) for x in logs]), rel=1e-9)
    frobenius = np.mean([np.sqrt(np.sum((a - b) ** 2)) for a, b in pairs])
    assert row["frobenius"] == pytest.approx(frobenius, rel=1e-9)
    assert row["frobenius_rms"] == pytest.approx(frobenius / 7, rel=1e-9)
    wrong = test.tau - lib.regressor(test.q, test.dq, test.ddq) @ lib.pi0
    for j in range(7):
        e = 100 * np.linalg.norm(wrong[:, j]) / np.linalg.norm(test.tau[:, j])
        assert row[f"tau_error_{j + 1}"] == pytest.approx(e, rel=1e-9)
    assert row["consistent"]
    broken = pi_true.copy()
    broken[-6] = -1.0
    impossible = ours.row(broken)
    assert not impossible["consistent"]
    assert "airm" not in impossible


def test_sines_keep_the_limits_and_have_exact_derivatives(lib: Library) -> None:
    """Oracle: central differences, which err by h²/6 of the third derivative, 1e-4 at 100 Hz."""
    log, amplitude = sinusoidal(lib, 10.0, 100.0, 1.0, 0)
    limits = lib.limits()
    assert (log.q >= limits["lower"]).all()
    assert (log.q <= limits["upper"]).all()
    assert (np.abs(log.dq) <= limits["velocity"] * (1 + 1e-12)).all()
    assert (np.abs(log.ddq) <= limits["acceleration"] * (1 + 1e-12)).all()
    for value, slope in ((log.q, log.dq), (log.dq, log.ddq)):
        differences = (value[2:] - value[:-2]) * 50
        assert np.abs(differences - slope[1:-1]).max() < 8 * amplitude.max() * 1e-4


def test_a_band_keeps_the_last_value_of_a_trial_that_has_ended() -> None:
    """Oracle: by hand."""
    rows: list[Row] = [
        {"case": "a", "method": "adam", "curve": [4.0, 2.0], "airm": 1.0},
        {"case": "a", "method": "adam", "curve": [8.0], "airm": 3.0},
        {"case": "b", "method": "adam", "curve": [9.0], "airm": 9.0},
    ]
    series = band(rows, "a", "adam", 25, 75)
    assert series["a/adam/iteration"].tolist() == [0, 25, 50, 75]
    assert series["a/adam/mean"].tolist() == [6.0, 2.5, 2.0, 2.0]
    assert series["a/adam/std"] == pytest.approx(np.sqrt([8, 0.5, 2, 2]))


def test_the_documents_numbers_stand_in_the_document(shared_data: Path) -> None:
    """Oracle: the thesis text; b_4 is the one number that the errata correct."""
    text = (shared_data / "reference" / "thesis.txt").read_text()
    printed = {float(x) for x in re.findall(r"-?\d+\.\d+", text.replace("- ", "-"))}
    tables = tomllib.loads(
        Path(document_room.__file__).with_name("document_numbers.toml").read_text()
    )
    numbers: list[float] = []
    for name, table in tables.items():
        if not name.startswith("fig-"):
            numbers += re.findall(r"-?\d+\.\d+", json.dumps(table["entries"]))
    unknown = {float(x) for x in numbers} - printed - {0.0, 1.0, 2.0}
    assert unknown == {1.0962}


def test_the_document_robot_is_the_fr3(lib: Library, pi_true: np.ndarray) -> None:
    """Oracle: the tests' own copy of the errata's digits; a robot of another name is refused."""
    assert np.array_equal(document_robot(lib), pi_true)
