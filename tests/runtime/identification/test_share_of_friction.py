"""The share of friction in an improvement: the URDF with friction fitted, between both models."""

import json

import numpy as np
import pytest

from runtime.identification.identified import torque_errors
from runtime.identification.single_log import identify_recording
from runtime.recording import Friction
from tests.runtime.diagnosis import EXAMPLE


def test_friction_is_fitted_to_the_urdf(lib, noisy):
    """Oracle: NumPy's least squares of τ − Y π₀ on the columns of each joint."""
    result = identify_recording(noisy, lib, "pc-ols", friction=Friction(), certify=False)

    def rest(part):
        return part.tau - lib.inverse_dynamics(part.q, part.dq, part.ddq, lib.pi0)

    squares = 0.0
    for j in range(lib.n_joints):
        phi = np.linalg.lstsq(result.train.columns[:, j], rest(result.train)[:, j])[0]
        squares += np.sum((rest(result.test)[:, j] - result.test.columns[:, j] @ phi) ** 2)
    expected = 100 * np.sqrt(squares) / np.linalg.norm(result.test.tau)
    # Both are least squares of 480 rows; condition numbers of 10.
    assert torque_errors(result)[2].overall == pytest.approx(expected, rel=1e-9)
    assert len(torque_errors(identify_recording(noisy, lib, "pc-ols", certify=False))) == 2


def test_a_real_log_is_half_friction(lib, panda):
    """Real data: 4.46 → 2.98 → 1.43 % on a Franka Panda; the first two are in closed form."""
    result = identify_recording(panda, lib, certify=False)
    before, after, between = (each.overall for each in torque_errors(result))
    assert (before, between) == pytest.approx((4.457, 2.977), abs=0.005)
    assert after <= 1.43


def test_the_table_has_three_rows_everywhere(command, lib, tmp_path):
    """Property: console, report.html and result.json; no third row without friction."""
    words = ("identify", EXAMPLE, "--robot", lib.folder, "--out", "out")
    ran = command(*words, "--friction", "viscous,coulomb")
    facts = json.loads((tmp_path / "out" / "result.json").read_text())["torque_error_percent"]
    between = facts["urdf_friction_overall"]
    assert facts["after_overall"] < between < facts["before_overall"]
    assert len(facts["urdf_friction"]) == 7
    row = next(line for line in ran.out.splitlines() if "URDF with friction fitted" in line)
    assert f"{between:.3f}" in row
    assert len(ran.out.splitlines()) <= 10
    assert "note: " not in ran.out
    page = (tmp_path / "out" / "report.html").read_text()
    assert "URDF with friction fitted" in page
    ran = command(*words, "--friction", "none")
    assert "URDF with friction fitted" not in ran.out
    facts = json.loads((tmp_path / "out" / "result.json").read_text())["torque_error_percent"]
    assert "urdf_friction_overall" not in facts
