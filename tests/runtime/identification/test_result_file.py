"""result_file: result.json says what it must, strictly JSON, wholly or not at all."""

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from runtime import Identification, Recording
from runtime.errors import RuntimeFault
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.samples import samples_of
from runtime.identification.identified import torque_errors
from runtime.identification.metrics import torque_error
from runtime.identification.result_file import record_of, write_result
from runtime.identification.single_log import identify_recording
from runtime.library import Library


@pytest.fixture
def folder(panda_adam: Identification, tmp_path: Path) -> Path:
    write_result(panda_adam, tmp_path / "new" / "out", "python -m runtime identify panda_gaz")
    return tmp_path / "new" / "out"


def test_predictions_are_stored_as_they_are(folder: Path) -> None:
    """Property: a million rows of noise took 2.4 s to compress, to nine tenths of their size."""
    with zipfile.ZipFile(folder / "predictions.npz") as archive:
        assert {member.compress_type for member in archive.infolist()} == {zipfile.ZIP_STORED}


def test_result_says_what_a_reader_needs(panda_adam: Identification, folder: Path) -> None:
    """Oracle, real data: every figure in the file is the one computed from the parts."""
    assert sorted(path.name for path in folder.iterdir()) == [
        "posterior.npz",
        "predictions.npz",
        "result.json",
    ]
    facts = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    r, tau = panda_adam, panda_adam.test.tau
    before, after = (torque_error(tau, x) for x in (r.before(r.test), r.predict_recording(r.test)))
    between = torque_errors(r)[2]
    assert between is not None
    assert (facts["method"], facts["robot"], facts["consistent"]) == ("adam", "fr3", True)
    # Written with all digits.
    assert facts["torque_error_percent"] == {
        "before": before.percent.tolist(),
        "after": after.percent.tolist(),
        "before_overall": before.overall,
        "after_overall": after.overall,
        "urdf_friction": between.percent.tolist(),
        "urdf_friction_overall": between.overall,
    }
    assert facts["torque_rms"] == {
        "before": before.rms.tolist(),
        "after": after.rms.tolist(),
        "urdf_friction": between.rms.tolist(),
    }
    assert facts["gap_to_convex_optimum"] == r.gap
    assert facts["seconds"] == r.seconds > 0
    assert facts["pi"] == r.pi.tolist()
    assert facts["beta"] == r.beta.tolist()
    assert facts["units"] == ["N*m"] * 7
    assert facts["friction"]["columns"] == ["viscous", "coulomb", "offset"]
    assert facts["friction"]["values"] == r.phi.tolist()
    assert facts["recording"]["samples"] == {
        name: len(getattr(r, name)) for name in ("train", "validation", "test")
    }
    assert len(facts["convergence"]["iteration"]) == len(facts["convergence"]["validation"])


def test_links_are_bodies_with_names(panda_adam: Identification, folder: Path) -> None:
    """Oracle: mass, centre of mass and smallest eigenvalue of P_k, by numpy from π."""
    facts = json.loads((folder / "result.json").read_text())["links"]
    lib = panda_adam.lib
    assert [link["name"] for link in facts] == list(lib.link_names)
    for link, pi in zip(facts, panda_adam.pi.reshape(7, 10), strict=True):
        m, h, (xx, yy, zz, xy, xz, yz) = pi[0], pi[1:4], pi[4:]
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        p = np.block([[np.trace(inertia) / 2 * np.eye(3) - inertia, h[:, None]], [h, m]])
        assert link["mass"] == m
        assert link["com"] == (h / m).tolist()
        # Rounding of an eigenvalue relative to the trace.
        expected = np.linalg.eigvalsh(p)[0] / np.trace(p)
        assert link["min_relative_eigenvalue"] == pytest.approx(expected, abs=1e-14)
        assert link["min_relative_eigenvalue"] > 0


def test_provenance_names_its_sources(panda_adam: Identification, folder: Path) -> None:
    """Property: command, hashes of the raw files, hash of the model, versions and seed."""
    facts = json.loads((folder / "result.json").read_text())["provenance"]
    assert facts["command"] == "python -m runtime identify panda_gaz"
    assert len(facts["files"]) == 4
    assert all(len(digest) == 64 for digest in facts["files"].values())
    assert facts["model_hash"] == panda_adam.lib.manifest.model_hash
    assert facts["seed"] == 0
    assert facts["versions"] == panda_adam.lib.versions


def test_predictions_reproduce_the_errors(panda_adam: Identification, folder: Path) -> None:
    """Property: the errors can be computed again from predictions.npz alone."""
    facts = json.loads((folder / "result.json").read_text())
    with np.load(folder / "predictions.npz") as arrays:
        for key in ("before", "after"):
            error = torque_error(arrays["measured"], arrays[key])
            assert error.percent.tolist() == facts["torque_error_percent"][key]
        assert np.array_equal(arrays["t"], panda_adam.test.t)


def test_condition_number_against_numpy(panda_adam: Identification) -> None:
    """Oracle: numpy's cond of the normalised [Y_b F], joint by joint."""
    lib = panda_adam.lib
    train = samples_of(panda_adam.train, lib)
    y = lib.regressor(train.q, train.dq, train.ddq)[:, :, lib.base_columns]
    blocks = [np.kron(np.eye(7)[j], train.columns[:, j]) for j in range(7)]
    rows = np.concatenate([y, np.stack(blocks, axis=1)], axis=2).reshape(-1, y.shape[2] + 21)
    expected = np.linalg.cond(rows / np.linalg.norm(rows, axis=0))
    # Rounding × the condition number itself (below 1000).
    statistics = compress(lib, train, np.ones(lib.n_joints))
    assert statistics.condition() == pytest.approx(expected, rel=1e-10)
    assert record_of(panda_adam, "").condition_number == statistics.condition()


def test_perfect_fits_are_doubted(
    lib: Library, ideal_runs: tuple[Recording, ...], noisy: Recording
) -> None:
    """Property: noise-free torque is reported not to be a measurement; noisy torque is not."""
    train, validation, test = ideal_runs
    perfect = identify_recording(train, lib, "ols", validation=validation, test=test)
    warnings = record_of(perfect, "").warnings
    assert any("exact to rounding" in text for text in warnings)
    assert not any("one run" in text for text in warnings)
    ordinary = record_of(identify_recording(noisy, lib, "ols"), "").warnings
    assert not any("exact to rounding" in text for text in ordinary)
    assert any("one run" in text for text in ordinary)


def test_inconsistent_models_are_reported(lib: Library, panda: Recording) -> None:
    """Property, real data: least squares gives bodies that cannot exist, and the file says so."""
    record = record_of(identify_recording(panda, lib, "ols"), "")
    assert record.consistent is False
    assert record.lam is None
    assert min(link.min_relative_eigenvalue for link in record.links) < 0
    assert any("not physically consistent" in text for text in record.warnings)


def test_a_silent_joint_is_still_json(lib: Library, noisy: Recording, tmp_path: Path) -> None:
    """Property: an error relative to nothing is null, never Infinity, and no crash."""
    tau = noisy.tau.copy()
    tau[:, 6] = 0.0
    result = identify_recording(noisy.replace(tau=tau), lib)
    write_result(result, tmp_path, "")

    def refuse(word: str) -> None:
        raise AssertionError(word)

    facts = json.loads((tmp_path / "result.json").read_text(), parse_constant=refuse)
    assert facts["torque_error_percent"]["before"][6] is None
    assert facts["torque_rms"]["before"][6] > 0


def test_a_place_that_cannot_be_written(panda_adam: Identification, tmp_path: Path) -> None:
    """Property: a file in the way is reported, and nothing is left behind."""
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(RuntimeFault, match="cannot write"):
            write_result(panda_adam, place, "")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "mine"
