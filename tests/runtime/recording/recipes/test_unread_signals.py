"""Columns and arrays that the default convention does not read are named where a signal lacks."""

from pathlib import Path

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.library import Library
from runtime.recording import read_recording, write_recording
from runtime.recording.consistency import require_plausible
from runtime.recording.recording import Recording
from runtime.recording.streamed import open_streamed


@pytest.fixture
def log() -> Recording:
    t = np.arange(50) / 100
    q = np.stack([np.sin(t), np.cos(t)], axis=1)
    return Recording(t, q, dq=np.gradient(q, t, axis=0), tau=3 * q)


@pytest.mark.parametrize("titles", ["qd1,qd2", "qd0,qd1", "vel_1,vel_2", "v[0],v[1]"])
def test_columns(tmp_path: Path, log: Recording, titles: str) -> None:
    """Property: velocities under other titles are named, which are read from nowhere else."""
    path = tmp_path / "log.csv"
    write_recording(log, path)
    path.write_text(path.read_text().replace("dq1,dq2", titles))
    read = read_recording(path)
    assert read.dq is None
    sentence = f"log.csv has no dq, and its columns {titles.replace(',', ', ')} are not read"
    assert any(sentence in step and step.startswith("Warning: ") for step in read.history)
    assert any(sentence in step for step in open_streamed(path).block(0, 20).history)


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_arrays(tmp_path: Path, log: Recording, suffix: str) -> None:
    """Property: arrays of the shape of q are named; texts, time and numbers are not."""
    path, arrays = tmp_path / f"log{suffix}", {"t": log.t, "q": log.q, "qd": log.dq, "tau": log.tau}
    if suffix == ".npz":
        np.savez(path, **arrays, names=np.array(["a", "b"]), rate=100.0)
    else:
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            for key, value in arrays.items():
                file[key] = value
    history = " ".join(read_recording(path).history)
    assert f"log{suffix} has no dq, and its arrays qd are not read" in history


def test_streamed_arrays(tmp_path: Path, log: Recording) -> None:
    """Property: a large log is read in parts with the same note."""
    path = tmp_path / "log.npz"
    np.savez(path, t=log.t, q=log.q, qd=log.dq, tau=log.tau)
    history = " ".join(open_streamed(path).block(0, 20).history)
    assert "log.npz has no dq, and its arrays qd are not read" in history


def test_arrays_of_one_joint(tmp_path: Path, log: Recording) -> None:
    """Property: the time, which has the shape of q there, is read; velocities are named."""
    path, one = tmp_path / "log.npz", log.q[:, 0]
    np.savez(path, t=log.t, q=one, tau=3 * one)
    for history in (read_recording(path).history, open_streamed(path).block(0, 20).history):
        assert not any("not read" in step for step in history)
    np.savez(path, t=log.t, q=one, tau=3 * one, qd=one)
    for history in (read_recording(path).history, open_streamed(path).block(0, 20).history):
        assert any("its arrays qd are not read" in step for step in history)


def test_complete_logs_and_others_are_silent(tmp_path: Path, log: Recording) -> None:
    """Property: temperatures beside all signals, or fewer columns than joints, are no finding."""
    path = tmp_path / "log.csv"
    write_recording(log, path)
    rows = path.read_text().splitlines()
    path.write_text("\n".join([f"{rows[0]},temp1,temp2", *(f"{row},20,21" for row in rows[1:])]))
    assert not any("not read" in step for step in read_recording(path).history)
    write_recording(log.replace(dq=None), path)
    rows = path.read_text().splitlines()
    path.write_text("\n".join([f"{rows[0]},gripper1", *(f"{row},0" for row in rows[1:])]))
    assert not any("not read" in step for step in read_recording(path).history)


def test_a_missing_torque_names_the_columns(
    double: Library, tmp_path: Path, log: Recording
) -> None:
    """Property: the refusal of a log without torque lists what could be it."""
    path = tmp_path / "log.csv"
    write_recording(log, path)
    path.write_text(path.read_text().replace("tau1,tau2", "effort1,effort2"))
    with pytest.raises(IdentificationError, match=r"no torque.* columns effort1, effort2 are not"):
        require_plausible(read_recording(path), double)
