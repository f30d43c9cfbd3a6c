"""HDF5 and MATLAB 7.3 → recordings; the files are h5py's, the layout of MATLAB's MathWorks'."""

import sys
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording import read_recording
from runtime.recording.recipes.recipe_file import recipe_from_table
from runtime.recording.streamed import open_streamed
from tests.runtime.logs import motion

h5py = pytest.importorskip("h5py", reason="HDF5 logs need h5py: pip install 'symgen[logs]'")


def arrays() -> dict[str, np.ndarray]:
    t, q, dq = motion()
    return {"t": t, "q": q, "dq": dq, "tau": q + 3.0}


def matlab(group, name: str, values: np.ndarray) -> None:
    """An array as MATLAB 7.3 stores it: at least two axes, in reverse order, with its class."""
    stored = group.create_dataset(name, data=np.atleast_2d(values).T)
    stored.attrs["MATLAB_class"] = np.bytes_("double")


def test_arrays_give_the_same_bits(tmp_path):
    """Oracle: the arrays that h5py has written, plain, compressed, and of a group."""
    truth = arrays()
    for group, options in (("", {}), ("run/arm", {"compression": "gzip", "chunks": True})):
        path = tmp_path / "x.h5"
        with h5py.File(path, "w") as file:
            place = file.require_group(group) if group else file
            for key, values in truth.items():
                place.create_dataset(key, data=values, **options)
            place["names"] = "text"
        log = read_recording(path)
        for key, values in truth.items():
            assert np.array_equal(getattr(log, key), values)
        assert set(log.source) == {"x.h5"}


@pytest.mark.parametrize("row", [True, False])
def test_matlab_is_read_as_matlab_shows_it(tmp_path, row):
    """Oracle: MATLAB's reversed axes; the time as a row or a column, in a struct."""
    truth, path = arrays(), tmp_path / "x.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for key, values in truth.items():
            matlab(file, f"log/{key}", values[:, None] if key == "t" and not row else values)
        matlab(file, "#refs#/a", np.ones((3, 3)))
    log = read_recording(path)
    for key, values in truth.items():
        assert np.array_equal(getattr(log, key), values)


def test_a_law_of_arrays_computes_the_torque(tmp_path):
    """Oracle: τ = kp (q_des − q) − kd dq, with gains as a row and a column of MATLAB."""
    t, q, dq = motion()
    kp, kd = np.array([[20.0, 30.0]]), np.array([[1.0], [2.0]])
    with h5py.File(tmp_path / "x.mat", "w") as file:
        for key, values in {"t": t, "q": q, "dq": dq, "q_des": q + 0.1, "kp": kp, "kd": kd}.items():
            matlab(file, key, values)
    log = read_recording(tmp_path / "x.mat")
    expected = kp * (q + 0.1 - q) - kd[:, 0] * dq
    assert log.tau == pytest.approx(expected, abs=1e-12)  # 30 roundings of numbers of size 10
    assert log.torque_source == "commanded"


def test_a_recipe_and_blocks(tmp_path):
    """Oracle: degrees and a sign by a recipe; the streamed blocks are the rows of the whole."""
    t, q, _ = motion()
    with h5py.File(tmp_path / "x.hdf5", "w") as file:
        file["arm/stamp"], file["arm/angle"], file["arm/m"] = t, np.degrees(q), -q
    recipe = recipe_from_table(
        {
            "time": {"key": "arm/stamp", "unit": "s"},
            "position": {"key": "arm/angle", "unit": "deg"},
            "torque": {"key": "arm/m", "unit": "N*m", "sign": -1},
        }
    )
    log = read_recording(tmp_path / "x.hdf5", recipe)
    assert log.q == pytest.approx(q, abs=1e-14)  # rounding of π/180
    assert np.array_equal(log.tau, q)
    streamed = open_streamed(tmp_path / "x.hdf5", recipe)
    assert streamed.rows == len(t)
    assert np.array_equal(streamed.block(30, 70).tau, q[30:70])


def external(path: Path) -> None:
    """Links, storage and views that lead to another file."""
    t, q, _ = motion()
    with h5py.File(path.parent / "other.h5", "w") as file:
        file["q"] = q
    q.tofile(path.parent / "raw.bin")
    with h5py.File(path, "w") as file:
        file["t"] = t
        file["linked"] = h5py.ExternalLink("other.h5", "q")
        file["soft"] = h5py.SoftLink("/linked")
        file.create_dataset(
            "stored",
            shape=q.shape,
            dtype="f8",
            external=[(str(path.parent / "raw.bin"), 0, 1 << 20)],
        )
        view = h5py.VirtualLayout(q.shape, "f8")
        view[...] = h5py.VirtualSource(str(path.parent / "other.h5"), "q", q.shape)
        file.create_virtual_dataset("view", view)
        file["references"] = np.array([file["t"].ref] * 3, dtype=h5py.ref_dtype)
        file.create_dataset("huge", shape=(1 << 40, 7), dtype="f8", chunks=(1024, 7))
        file["deep"] = np.ones((3, 3, 3))
        file["loop"] = file["/"]
        file["empty"] = np.zeros(0)


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("linked", "is a link.*not followed"),
        ("soft", "is a link.*not followed"),
        ("stored", "lie in another file"),
        ("view", "lie in another file"),
        ("references", "expected to hold real numbers"),
        ("huge", "decompression limit"),
        ("deep", r"\(samples, joints\)"),
        ("empty", r"hold samples, but is of shape \(0,\)"),
        ("nothing", "expected to hold the array 'nothing', but holds .*t"),
    ],
)
def test_what_leads_outside_is_one_sentence(tmp_path, key, words):
    """Property: nothing outside the file is opened, nothing but a matrix of numbers is read."""
    external(tmp_path / "x.h5")
    table = {"time": {"key": "t", "unit": "s"}, "position": {"key": key, "unit": "rad"}}
    with pytest.raises(RecordingError, match=words):
        read_recording(tmp_path / "x.h5", recipe_from_table(table))


def test_damaged_files_and_a_missing_library(tmp_path, monkeypatch):
    """Property: an older MATLAB file, a cut file and no h5py are one sentence each."""
    path = tmp_path / "x.mat"
    path.write_bytes(b"MATLAB 5.0 MAT-file" + bytes(600))
    with pytest.raises(RecordingError, match=r"-v7\.3"):
        read_recording(path)
    with h5py.File(path, "w") as file:
        file["q"] = np.ones((99, 2))
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(RecordingError, match="truncated, damaged or another"):
        read_recording(path)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(RecordingError, match=r"pip install 'symgen\[logs\]'"):
        read_recording(path)
