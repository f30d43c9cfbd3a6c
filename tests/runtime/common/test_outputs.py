"""Outputs that end early: a full disk, a closed pipe, few letters, a pipe as input."""

import errno
import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console

from runtime.common import files, terminal
from runtime.common.commands import run
from runtime.common.errors import RuntimeFault
from runtime.common.files import replacing, replacing_folder
from runtime.common.tables import Table
from runtime.errors import RecordingError
from runtime.recording.reader import locate
from symgen.cli.console import is_model

PROGRAM = "from runtime.common.commands import run; run(lambda: print('τ = 1'), 'symgen')"


def test_memory_that_does_not_suffice_is_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    """Property: as for any input that this machine cannot take."""

    def full() -> None:
        raise MemoryError("Unable to allocate 841. MiB")

    with pytest.raises(SystemExit) as end:
        run(full, "symgen")
    said = capsys.readouterr().err
    assert (end.value.code, said.count("\n")) == (2, 1)
    assert "the memory does not suffice (Unable to allocate 841. MiB); give a shorter log" in said


@pytest.mark.parametrize(
    ("place", "encoding", "code", "out", "sentence"),
    [
        ("/dev/full", "utf-8", 2, b"", b"symgen: cannot write the output"),
        (None, "latin-1", 0, b"? = 1\n", b""),
    ],
    ids=["full", "latin"],
)
def test_an_output_that_ends_is_a_sentence(
    place: str | None, encoding: str, code: int, out: bytes, sentence: bytes
) -> None:
    """Property: no traceback at a full disk; a letter that the terminal lacks becomes ?."""
    with open(place or os.devnull, "wb") as full:
        run = subprocess.run(
            [sys.executable, "-c", PROGRAM],
            stdout=full if place else subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | {"PYTHONIOENCODING": encoding},
            check=False,
        )
    assert (run.returncode, run.stdout or b"") == (code, out), run.stderr
    assert run.stderr.startswith(sentence)
    assert run.stderr.count(b"\n") == bool(sentence)


def test_a_folder_appears_complete_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: where the disk is full at the second file, the old folder stays as it was."""
    path = tmp_path / "package"

    def write(content: bytes) -> None:
        with replacing_folder(path) as folder:
            for name in ("a.c", "src/b.c"):
                with replacing(folder / name) as file:
                    file.write(content)

    write(b"old")
    calls: list[int] = []

    def full(number: int) -> None:
        calls.append(number)
        if len(calls) == 2:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(RuntimeFault, match="No space left on device"):
        write(b"new")
    assert {p.read_bytes() for p in (path / "a.c", path / "src/b.c")} == {b"old"}
    assert [each.name for each in tmp_path.iterdir()] == ["package"]


def test_a_pipe_is_no_log(tmp_path: Path) -> None:
    """Property: `inspect` neither waits for its other end nor opens it."""
    pipe = tmp_path / "log.csv"
    os.mkfifo(pipe)
    assert not is_model(pipe)
    with pytest.raises(RecordingError, match="is a pipe or a device"):
        locate(pipe)


def test_names_of_a_wide_table_stay_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: no name of a table that is wider than the terminal is broken or cut."""
    names = [f"caster_front_right_{k}_joint" for k in range(3)]
    text = io.StringIO()
    monkeypatch.setattr(terminal, "console", Console(file=text, width=50))
    terminal.show(Table(("joint", "link", "mass [kg]"), tuple((n, f"{n}_link", "") for n in names)))
    assert all(f" {name}_link" in text.getvalue() for name in names)
    assert "[kg]" in text.getvalue()
