"""An estimator that another installed package adds, used through the command line."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import runtime
from runtime import METHODS
from runtime.errors import IdentificationError
from runtime.estimators.methods import DEFAULT, chosen_method, methods_from_statistics
from runtime.library import Library
from tests.plugins import add_toy
from tests.runtime.conftest import Command

EXAMPLE = Path(runtime.__file__).parent / "examples" / "fr3_simulated.npz"
RIDGE = '''
"""Ridge regression: min ‖R [β; φ] − r‖² + α ‖[β − β0; φ]‖², β0 of the first guess."""

import numpy as np

from runtime.estimators.classical.least_squares import fit_of_base
from runtime.estimators.methods import Method
from runtime.estimators.problem import Fit, Problem

ALPHA = 1e-3


def fit_ridge(problem: Problem) -> Fit:
    lib, s = problem.lib, problem.statistics()
    prior = np.zeros(len(s.target))
    prior[: s.n_base] = lib.base_matrix @ lib.pi_from_lam(problem.start)
    root = np.sqrt(ALPHA * s.n_samples) * np.eye(len(prior))
    rows = np.vstack([s.factor, root])
    target = np.concatenate([s.target, root @ prior])
    x = np.linalg.lstsq(rows, target, rcond=None)[0]
    phi = x[s.n_base :].reshape(lib.n_joints, -1)
    return fit_of_base(problem, x[: s.n_base], phi, "solved by ridge regression")


RIDGE = Method("ridge", "least squares with a quadratic penalty", fit_ridge, from_statistics=True)
'''


def test_an_estimator_of_another_package_is_a_method_like_any_other(
    lib: Library, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: `identify --method ridge` and a row of `compare`, with help and streamed logs."""
    site = tmp_path / "site"
    site.mkdir()
    environment = add_toy(site, METHODS, "ridge", RIDGE, "RIDGE", monkeypatch)
    words = [sys.executable, "-m", "runtime", "identify", "--help"]  # written at the import
    helped = subprocess.run(
        words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert helped.returncode == 0, helped.stderr
    assert "ridge" in helped.stdout
    ran = command("identify", EXAMPLE, "--robot", lib.folder, "--method", "ridge", "--out", "one")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "one" / "result.json").read_text())
    assert facts["method"] == "ridge"
    assert facts["status"] == "solved by ridge regression"
    ran = command("compare", EXAMPLE, "--robot", lib.folder, "--methods", "ols,ridge")
    assert ran.code == 0, ran.err
    assert "ridge" in ran.out
    rows = json.loads((tmp_path / "results/fr3_simulated-compare/compare.json").read_text())["rows"]
    assert [row["method"] for row in rows] == ["ols", "ridge"]
    assert rows[1]["about"] == "least squares with a quadratic penalty"
    assert rows[1]["outcome"] == "ran"


def test_records_agree_with_their_places() -> None:
    """Property: every record has the name it is listed under, and one sentence."""
    for name, record in zip(METHODS, METHODS.records(), strict=True):
        assert record.name == name
        assert record.sentence
        assert METHODS[name] is record
    assert methods_from_statistics() == tuple(METHODS)[:7]


def test_the_options_choose_the_method() -> None:
    """Property: the default without options, that of presets with one; others are refused."""
    assert chosen_method(None, None, None) == DEFAULT
    assert chosen_method(None, "real", None) == "adam"
    with pytest.raises(IdentificationError, match="a preset belongs to the method adam"):
        chosen_method("ols", "real", None)
    with pytest.raises(IdentificationError, match="there is no method 'magic'; choose one of map"):
        chosen_method("magic", None, None)
