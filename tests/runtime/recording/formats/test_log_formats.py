"""The registry of log formats: what is built in, and a format that another package adds."""

import numpy as np
import pytest

from runtime import read_recording
from runtime.errors import RecordingError
from runtime.recording.formats import FORMATS, all_suffixes, format_of_suffix
from runtime.recording.formats.log_format import LogReader, RawFile
from runtime.recording.recipes.recipe import Recipe, Signal
from tests.conftest import REPOSITORY
from tests.plugins import add_toy

TOY = '''
import numpy as np
from runtime.recording.formats.log_format import LogFormat, LogReader
from runtime.recording.formats.tables import LogTable
from runtime.recording.recipes.recipe import Recipe, Signal, Time


class ToyReader(LogReader):
    """One line per instant: t | q | tau, numbers apart by blanks."""

    def convention(self):
        return Recipe(
            time=Time(unit="s", layout="toy"),
            position=Signal(unit="rad", layout="toy"),
            torque=Signal(unit="N*m", layout="toy"),
        )

    def table(self, kind, part):
        lines = self.raw.data().decode().splitlines()
        which = {"time": 0, "position": 1, "torque": 2}[kind]
        values = np.array([line.split("|")[which].split() for line in lines], dtype=float)
        return LogTable(values, np.arange(len(values), dtype=np.int64))


TOY = LogFormat(
    name="toy", sentence="a toy", suffixes=(".toy",), reader=ToyReader, reads_time_alone=True
)
'''


def test_names_and_suffixes_of_the_formats():
    """Oracle: the layouts of a recipe, and one format per suffix."""
    assert list(FORMATS) == ["csv", "flat", "npz", "parquet", "hdf5", "lerobot", "bag"]
    assert all(FORMATS[name].name == name for name in FORMATS)
    suffixes = all_suffixes()
    assert len(set(suffixes)) == len(suffixes)
    assert {format_of_suffix(f"x{each.upper()}").name for each in suffixes} == {
        *("csv", "npz", "parquet", "hdf5", "bag")
    }
    assert format_of_suffix("x.toy") is None


def test_a_bare_reader_names_what_it_lacks(tmp_path):
    """Property: what a format does not have is one sentence."""
    path = tmp_path / "log.toy"
    reader = LogReader(RawFile(path.name, path, Recipe(), (), False, {}))
    part = Signal(unit="rad")
    for call, words in [
        (reader.convention, "described by a recipe"),
        (lambda: reader.table("position", part), "holds no numbers of position"),
        (lambda: reader.rows({"position": part}), "--settings stream=false"),
    ]:
        with pytest.raises(RecordingError, match=words):
            call()
    assert reader.head() == []
    assert reader.arrays() == {}


def test_a_format_of_another_package_is_inspected_and_identified(
    tmp_path, lib, command, monkeypatch
):
    """Property: a toy format serves two commands; without its package it is one sentence."""
    log = read_recording(REPOSITORY / "runtime/examples/fr3_simulated.npz")
    rows = slice(0, len(log), 2)
    lines = (
        " | ".join(" ".join(f"{x:.17g}" for x in np.atleast_1d(part)) for part in row)
        for row in zip(log.t[rows], log.q[rows], log.tau[rows], strict=True)
    )
    path = tmp_path / "log.toy"
    path.write_text("\n".join(lines) + "\n")
    (tmp_path / "site").mkdir()
    with pytest.raises(RecordingError, match=r"ends in .csv.*got 'log.toy'"):
        read_recording(path)
    add_toy(tmp_path / "site", FORMATS, "toy", TOY, "TOY", monkeypatch)
    inspected = command("inspect", "log.toy", "--robot", lib.folder)
    assert inspected.code == 0, inspected.out + inspected.err
    words = ("--robot", lib.folder, "--method", "wls", "--cutoff", "10")
    out = command("identify", "log.toy", *words)
    assert out.code == 0, out.out + out.err
