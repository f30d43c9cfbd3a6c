"""Where data sets are found; and the real logs, where they are."""

import hashlib
import urllib.error
from pathlib import Path

import numpy as np
import pooch
import pytest

from runtime.errors import RecordingError
from runtime.recording import Friction, log_files, read_recording
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import split
from runtime.recording.preprocessing.segments import repair_clock, segments
from runtime.recording.recipes.recipe_file import bundled_names, load_recipe


def real(name: str) -> Path:
    """The folder of a real data set, or a loud skip; tests never download."""
    for folder in log_files._local_folders(name):
        if folder.is_dir():
            return folder
    pytest.skip(f"REAL DATA ABSENT: {name} is not under $SYMGEN_DATA/data nor ../shared/data")


def test_symgen_data_decides(tmp_path, monkeypatch):
    """Oracle: SYMGEN_DATA wins over the folder beside the repository."""
    (tmp_path / "data" / "panda_gaz").mkdir(parents=True)
    monkeypatch.setenv("SYMGEN_DATA", str(tmp_path))
    assert log_files.locate("panda_gaz") == tmp_path / "data" / "panda_gaz"
    with pytest.raises(RecordingError, match=r"no data set 'panda'; the known ones are fr3_sim"):
        log_files.locate("panda")


def test_downloads_are_pinned_and_cached(tmp_path, monkeypatch):
    """Property: only bytes of the pinned sha256 are accepted, from the pinned commit."""
    recipe = load_recipe("panda_gaz")
    asked: list[str] = []

    class Net:
        content = b"not the published bytes"

        def __call__(self, url: str, output_file: str, _: object) -> None:
            asked.append(url)
            Path(output_file).write_bytes(self.content)

    monkeypatch.setenv("SYMGEN_DATA", str(tmp_path / "none"))
    monkeypatch.setattr(pooch, "os_cache", lambda name: tmp_path / name)
    monkeypatch.setattr("pooch.core.choose_downloader", lambda *_, **__: Net())
    with pytest.raises(RecordingError, match=r"could not be downloaded .*set SYMGEN_DATA"):
        log_files.locate("panda_gaz")
    assert recipe.source.commit in asked[0]
    assert asked[0].endswith("/rbt_log/exciting_traj_positions.txt")
    digest = hashlib.sha256(Net.content).hexdigest()
    pins = dict.fromkeys(recipe.source.sha256, digest)
    pinned = recipe.replace(source=type(recipe.source)(base=recipe.source.base, sha256=pins))
    monkeypatch.setattr(log_files, "load_recipe", lambda _: pinned)
    folder = log_files.locate("panda_gaz")
    assert {path.name for path in folder.iterdir()} == set(pins)
    count = len(asked)
    assert log_files.locate("panda_gaz") == folder
    assert len(asked) == count


def test_no_net_is_one_sentence(tmp_path, monkeypatch):
    """Property: neither a folder nor a network gives a sentence with both remedies."""

    def offline(*_: object, **__: object) -> None:
        raise urllib.error.URLError("offline")

    monkeypatch.setenv("SYMGEN_DATA", str(tmp_path))
    monkeypatch.setattr(pooch, "os_cache", lambda name: tmp_path / name)
    monkeypatch.setattr("pooch.core.choose_downloader", lambda *_, **__: offline)
    with pytest.raises(RecordingError, match=r"not in .* set SYMGEN_DATA to the folder") as caught:
        read_recording("panda_gaz")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", bundled_names())
def test_pinned_hashes_are_those_of_the_real_files(name):
    """Real data: every file on disk has the sha256 that its recipe pins."""
    folder = real(name)
    for file, digest in load_recipe(name).source.sha256.items():
        assert hashlib.sha256((folder / file).read_bytes()).hexdigest() == digest


def test_panda_clock():
    """Real data: 1255 stale rows; the rebuilt clock never leaves the jittering PC clock.

    Rebuilt and logged time differ by less than 3 ms over 21 s, although every step in motion was
    counted from dq = v·dt alone. Counting each step at rest as one tick instead gives 20.972 s,
    the duration without the rest at both ends.
    """
    raw = read_recording(real("panda_gaz"))
    assert (len(raw), raw.n_joints) == (20544, 7)
    fixed = repair_clock(raw, 1e-3)
    assert len(raw) - len(fixed) == 1255
    assert any("Dropped 1255 rows" in sentence for sentence in fixed.history)
    rows = np.searchsorted(raw.t, fixed.t)
    logged = raw.t[np.concatenate([[True], np.any(np.diff(raw.q, axis=0) != 0, axis=1)])]
    assert rows[-1] > 20000
    assert np.abs(fixed.t - logged).max() < 3e-3
    assert fixed.duration == pytest.approx(21.0, abs=2e-3)
    ticks = np.round(np.diff(fixed.t) / 1e-3)
    assert np.abs(np.diff(fixed.t) / 1e-3 - ticks).max() < 1e-6
    speed = np.linalg.norm(0.5 * (fixed.dq[1:] + fixed.dq[:-1]), axis=1)
    moving = speed > 0.2
    assert ticks[moving].sum() + np.sum(~moving) == 20972


def test_panda_prepared():
    """Real data: prepared by its recipe, q, dq and ddq are one motion, without holes or rest."""
    raw = read_recording(real("panda_gaz"))
    data = prepare(raw, None, raw.recipe.friction)
    assert len(data) == 2081
    assert data.columns.shape == (2081, 7, 3)
    assert len(segments(data.t)) == 1
    for x, dx in ((data.q, data.dq), (data.dq, data.ddq)):
        slope = np.sum(np.gradient(x, data.t, axis=0) * dx, axis=0) / np.sum(dx**2, axis=0)
        np.testing.assert_allclose(slope, 1.0, atol=0.01)
    error = np.gradient(data.q, data.t, axis=0) - data.dq
    assert (np.linalg.norm(error, axis=0) < 0.015 * np.linalg.norm(data.dq, axis=0)).all()
    sizes = [len(part) for part in split(data, raw.recipe.split)]
    assert sum(sizes) == 2081
    assert min(sizes) > 200


def test_panda_without_clock_repair_is_refused_or_worse():
    """Real data: q and dq disagree ten times more on the logged clock than on the rebuilt one."""
    raw = read_recording(real("panda_gaz"))
    fixed = repair_clock(raw, 1e-3)

    def scatter(recording):
        slope = np.diff(recording.q, axis=0) / np.diff(recording.t)[:, None]
        middle = 0.5 * (recording.dq[1:] + recording.dq[:-1])
        return np.linalg.norm(slope - middle) / np.linalg.norm(middle)

    assert scatter(fixed) < 0.1 * scatter(raw)
    with pytest.raises(RecordingError, match="set max_gap_s to resample first"):
        prepare(raw, raw.recipe.preparation.__class__(filter="butterworth", cutoff_hz=10.0))


def test_tx40_joint_side():
    """Real data: at rest the arm stands where its controller says, to the precision of the file."""
    data = read_recording(real("tx40_figaroh"))
    assert (len(data), data.n_joints) == (45000, 6)
    assert data.duration == pytest.approx(8.9998)
    assert data.dq is None
    np.testing.assert_allclose(data.q[-1], 0.0, atol=1e-4)
    prepared = prepare(data, None, Friction())
    assert prepared.rate_hz == pytest.approx(200.0)
    assert prepared.columns.shape == (len(prepared), 6, 3)
    assert np.abs(prepared.dq).max(axis=1).min() >= 0.02


def test_lwr4_runs():
    """Real data: each run of the LWR4 is read, and run 3 is twice as fast as run 1."""
    folder = real("lwr4_flobaroid")
    first, third = read_recording(folder), read_recording(folder, run="3")
    assert (len(first), len(third)) == (5027, 5027)
    assert first.t[0] == 0.0
    prepared = prepare(first)
    assert prepared.rate_hz == pytest.approx(50.0)
    ratio = np.linalg.norm(third.dq[:, 0]) / np.linalg.norm(first.dq[:, 0])
    assert ratio == pytest.approx(2.0, abs=0.15)
    with pytest.raises(RecordingError, match="has no runs to choose '3' from"):
        read_recording(folder / "measurements_3.npz", run="3")
    named = read_recording(folder / "measurements_3.npz", "lwr4_flobaroid")
    assert np.array_equal(named.q, third.q)


def test_examples_of_the_package_are_known_by_name(tmp_path, monkeypatch):
    """Property: a bundled log is read by its name in any folder."""
    monkeypatch.chdir(tmp_path)
    log = read_recording("fr3_simulated")
    assert log.n_joints == 7
    assert log_files.locate("fr3_simulated") == log_files.EXAMPLES / "fr3_simulated.npz"
    assert set(log_files.known_names()) > set(bundled_names())
    with pytest.raises(RecordingError, match="the known ones are fr3_simulated"):
        log_files.locate("fr3_simulate")
