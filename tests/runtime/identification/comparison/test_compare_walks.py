"""Comparison of methods on walks: the rows of Pinocchio, and what a method lacks."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest

from runtime.library import Library
from tests.free_base_logs import Experiment, virtual_log
from tests.robots import DATA
from tests.runtime.conftest import Command

Arrays = dict[str, Any]
HOPPER = (DATA / "hopper.urdf").read_text()
FEET = ("left_foot", "right_thigh")
COUNT = 600


@pytest.fixture(scope="module")
def noisy() -> Arrays:
    log, rng = (
        virtual_log(HOPPER, FEET, 0, Experiment(count=COUNT)).arrays,
        np.random.default_rng(2),
    )
    noise = rng.normal(size=log["contact_wrench"].shape) * np.repeat([0.2, 0.01], 3)
    return log | {"contact_wrench": log["contact_wrench"] + noise}


def base_rows(arrays: Arrays) -> np.ndarray:
    """Rows of the base and their right side by Pinocchio, (N, 6, 10 L + 1)."""
    model = pinocchio.buildModelFromXML(HOPPER, pinocchio.JointModelFreeFlyer())
    data, rows = model.createData(), []
    ids = [model.getFrameId(foot, pinocchio.BODY) for foot in FEET]
    for k in range(len(arrays["t"])):
        q = np.concatenate([arrays["base_pose"][k], arrays["q"][k]])
        dq = np.concatenate([arrays["base_twist"][k], arrays["dq"][k]])
        ddq = np.concatenate([arrays["base_acceleration"][k], arrays["ddq"][k]])
        regressor = pinocchio.computeJointTorqueRegressor(model, data, q, dq, ddq)[:6].copy()
        pinocchio.computeJointJacobians(model, data, q)
        pinocchio.updateFramePlacements(model, data)
        force = sum(
            pinocchio.getFrameJacobian(model, data, i, pinocchio.LOCAL)[:, :6].T @ wrench
            for i, wrench in zip(ids, arrays["contact_wrench"][k], strict=True)
        )
        rows.append(np.column_stack([regressor, force]))
    return np.array(rows)


@pytest.mark.parametrize("names", [("walk",), ("one", "two")])
def test_errors_are_those_of_least_squares(
    hopper: Library, noisy: Arrays, names: tuple[str, ...], tmp_path: Path, command: Command
) -> None:
    """Oracle: least squares over Pinocchio's regressor of the training rows of all logs."""
    count, trained, tested = COUNT // len(names), [], []
    for k, name in enumerate(names):
        part = slice(k * count, (k + 1) * count)
        log = {key: x[part] if len(x) == COUNT else x for key, x in noisy.items()}
        np.savez(tmp_path / f"{name}.npz", **log)
        share = np.arange(count) / (count - 1)
        rows = base_rows(log)
        trained.append(rows[share < 0.48].reshape(-1, rows.shape[2]))
        tested.append(rows[share >= 0.6].reshape(-1, rows.shape[2]))
    fitted, unseen = np.concatenate(trained), np.concatenate(tested)
    pi = np.linalg.lstsq(fitted[:, :-1], fitted[:, -1], rcond=1e-10)[0]
    rest = unseen[:, -1] - unseen[:, :-1] @ pi
    error = 100 * np.linalg.norm(rest) / np.linalg.norm(unseen[:, -1])
    words = (*(f"{name}.npz" for name in names), "--robot", hopper.folder, "--methods", "map,ols")
    done = command("compare", *words, "--settings", "rows=base", "--out", "compared")
    assert done.code == 0, done.err
    facts = json.loads((tmp_path / "compared" / "compare.json").read_text())
    # Both solve normal equations of one condition number, some 100, to rounding.
    assert facts["rows"][1]["test_percent"] == pytest.approx(error, rel=1e-8)
    assert facts["joints"][:3] == ["force x", "force y", "force z"]
    assert facts["recording"]["name"] == " + ".join(f"{name}.npz" for name in names)
    assert facts["advice"]["take"] == "map"
    assert any("parts of one run" in note for note in facts["notes"]) == (len(names) == 1)
    assert "comparison of methods" in (tmp_path / "compared" / "report.html").read_text()


def test_methods_without_a_prior_are_rows_with_the_reason(
    hopper: Library, noisy: Arrays, tmp_path: Path, command: Command
) -> None:
    """Property: errors of sensors have a prior, which only map takes; others are not run."""
    log = {key: x for key, x in noisy.items() if key not in {"contact_wrench", "tau"}}
    log["contact_force_z"] = noisy["contact_wrench"][:, :, 2]
    np.savez(tmp_path / "walk.npz", **log, contact_force_z_sigma=np.array([1.0, 1.0]))
    words = ("walk.npz", "--robot", hopper.folder, "--out", "compared")
    done = command("compare", *words, "--methods", "map,pc-ols", "--cutoff", "5")
    assert done.code == 0, done.err
    rows = json.loads((tmp_path / "compared" / "compare.json").read_text())["rows"]
    assert [row["outcome"] for row in rows] == ["ran", "not run"]
    assert "use map, or leave contact_force_z_sigma" in rows[1]["status"]
    done = command("compare", *words, "--overwrite", "--settings", "stream=true")
    assert (done.code, "does not apply to a robot with a free base" in done.err) == (2, True)
