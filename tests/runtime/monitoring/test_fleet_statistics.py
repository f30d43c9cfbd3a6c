"""Compressed statistics of units: files, parts of a run that was killed, and the commands."""

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import IdentificationError
from runtime.estimators.prior_file import read_prior
from runtime.identification.single_log import identify_recording
from runtime.identification.statistics_file import (
    MARK,
    UnitStatistics,
    read_statistics,
    statistics_of,
    write_statistics,
)
from runtime.library import Library
from runtime.monitoring.fleet import gather as room
from runtime.monitoring.fleet.gather import Unit, gather, statistics_files, unit_of
from tests.runtime.conftest import Command
from tests.runtime.monitoring.virtual_units import TERMS, Fleet


class Killed(Exception):
    """End of a run before its time."""


def test_a_log_gives_the_same_statistics_again(
    noisy: Recording, lib: Library, tmp_path: Path
) -> None:
    """Property: what is read is what was written, and is less than 60 kB."""
    result = identify_recording(noisy, lib, friction=TERMS)
    written = statistics_of(result, "u1")
    write_statistics(written, tmp_path / "statistics.npz")
    read = read_statistics(tmp_path / "statistics.npz")
    assert (read.unit, read.robot, read.joints) == ("u1", lib.name, lib.joint_names)
    assert (read.columns, read.widths) == (TERMS.columns, written.widths)
    np.testing.assert_array_equal(read.statistics.factor, written.statistics.factor)
    np.testing.assert_array_equal(read.statistics.target, written.statistics.target)
    assert read.density == written.density == result.uncertainty.information.density
    np.testing.assert_array_equal(read.noise, written.noise)
    np.testing.assert_allclose(read.noise, result.weights**-0.5, rtol=1e-15)  # two roundings
    assert (tmp_path / "statistics.npz").stat().st_size < 60_000
    older = dict(np.load(tmp_path / "statistics.npz"))
    del older["noise"]
    np.savez(tmp_path / "older.npz", **older)
    assert read_statistics(tmp_path / "older.npz").noise is None


@pytest.mark.parametrize(
    "damage", ["cut", "nan", "huge", "shape", "later", "robot", "pickle", "negative", "noise"]
)
def test_damaged_statistics_are_refused(damage: str, fleet: Fleet, tmp_path: Path) -> None:
    """Property: one sentence that says what to run."""
    path = tmp_path / "statistics.npz"
    write_statistics(fleet.statistics[0], path)
    arrays = dict(np.load(path))
    changes = {
        "nan": {"target": arrays["target"] * np.nan},
        "huge": {"factor": arrays["factor"] * 1e200},
        "shape": {"factor": arrays["factor"][:-1]},
        "later": {MARK: np.asarray(99)},
        "robot": {"robot": np.asarray("../../evil")},
        "pickle": {"joints": np.array([{}], dtype=object)},
        "negative": {"density": np.asarray(-1.0)},
        "noise": {"noise": -np.ones(7)},
        "cut": {},
    }
    np.savez(path, **(arrays | changes[damage]))  # type: ignore[arg-type]
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:700])
    with pytest.raises(IdentificationError, match=r"identify|install"):
        read_statistics(path)


def test_a_killed_run_continues(
    lib: Library, fleet: Fleet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: parts that ended before the end are not computed again; the units are the same."""
    for each in fleet.statistics:
        write_statistics(each, tmp_path / "units" / each.unit / "statistics.npz")
    monkeypatch.setattr(room, "PART", 4)
    monkeypatch.setattr(room, "cores", lambda: 1)
    seen: list[str] = []
    parts = tmp_path / "parts"

    def counted(known: UnitStatistics, library: Library, name: str) -> Unit:
        if name == "u09" and not parts.joinpath("part-damaged.npz").exists():
            raise Killed
        seen.append(name)
        return unit_of(known, library, name)

    monkeypatch.setattr(room, "unit_of", counted)
    with pytest.raises(Killed):
        gather(lib, tmp_path / "units", parts)
    kept = len(list(parts.glob("part-*.npz")))
    assert kept == 2
    (parts / "part-damaged.npz").write_bytes(b"half")
    first = set(seen)
    seen.clear()
    units = gather(lib, tmp_path / "units", parts)
    assert not {"u00", "u01", "u07"} & set(seen)
    assert "u00" in first
    for ours, theirs in zip(units, fleet.units, strict=True):
        assert (ours.name, ours.columns, ours.widths) == (
            theirs.name,
            theirs.columns,
            theirs.widths,
        )
        for key in ("factor", "target", "friction"):
            np.testing.assert_array_equal(getattr(ours, key), getattr(theirs, key))


def test_the_commands_from_log_to_prior(
    command: Command,
    lib: Library,
    fleet: Fleet,
    log: Path,
    noisy: Recording,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Property: identify --settings save_statistics=true, fleet, identify --prior; nothing is
    overwritten.
    """
    monkeypatch.setattr("runtime.outputs.report.report.write_report", lambda folder: folder)  # slow
    words = (
        "--friction",
        "viscous,coulomb",
        "--out",
        "units/real",
        "--settings",
        "save_statistics=true",
    )
    ran = command("identify", log, "--robot", lib.folder, *words)
    assert ran.code == 0, ran.err
    assert read_statistics(tmp_path / "units/real/statistics.npz").unit == "real"
    for each in fleet.statistics[:6]:
        write_statistics(each, tmp_path / "units" / f"{each.unit}.npz")
    ran = command("fleet", "units", "--robot", lib.folder, "--out", "fleet.toml", "--json")
    assert ran.code == 0, ran.err
    facts = json.loads(ran.out)
    assert facts["units"] == 7
    assert [each["unit"] for each in facts["stand_out"]] == ["real"]
    assert not (tmp_path / "fleet.toml.parts").exists()
    with np.load(tmp_path / "fleet.npz") as arrays:
        assert arrays["pi"].shape == (7, lib.pi0.size)
    prior = read_prior(tmp_path / "fleet.toml", lib)
    assert prior.units == 6
    assert prior.kappa == facts["trust"]
    assert prior.noise is None  # one unit of seven states its noise
    result = identify_recording(noisy, lib, friction=TERMS, prior=prior, certify=False)
    assert result.is_consistent
    assert "6 units of the fleet" in result.notes[0]
    ran = command("fleet", "units", "--robot", lib.folder, "--out", "fleet.toml")
    assert ran.code == 2
    assert "--overwrite" in ran.err
    ran = command("fleet", "units", "--robot", lib.folder, "--out", "fleet")
    assert ran.code == 2
    assert "ends in .toml" in ran.err


@pytest.mark.parametrize("case", ["none", "empty", "damaged", "other"])
def test_bad_folders(
    case: str, command: Command, fleet: Fleet, lib: Library, tmp_path: Path
) -> None:
    """Property: exit code 2, one sentence, no file."""
    place = tmp_path / "units"
    if case != "none":
        place.mkdir()
    if case in {"damaged", "other"}:
        for each in fleet.statistics[:3]:
            write_statistics(each, place / each.unit / "statistics.npz")
    if case == "damaged":
        (place / "u01" / "statistics.npz").write_bytes(b"not an archive")
    if case == "other":
        odd = dataclasses.replace(fleet.statistics[1], joints=tuple("abcdefg"))
        write_statistics(odd, place / "u01" / "statistics.npz")
    ran = command("fleet", "units", "--robot", lib.folder, "--out", "fleet.toml")
    assert ran.code == 2
    sentence = ran.err.splitlines()[-1]
    assert "units" in sentence
    assert "Traceback" not in ran.err
    assert not (tmp_path / "fleet.toml").exists()


def test_a_pipe_among_the_units_is_refused(tmp_path: Path) -> None:
    """Property: opening a pipe would wait for its other end for ever; other pipes do not count."""
    (tmp_path / "u0").mkdir()
    os.mkfifo(tmp_path / "u0" / "statistics.npz")
    os.mkfifo(tmp_path / "other.npz")
    (path,) = statistics_files(tmp_path)
    with pytest.raises(IdentificationError, match="is damaged or holds no compressed statistics"):
        read_statistics(path)
