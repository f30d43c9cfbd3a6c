"""Builds on a full disk, of a bad URDF, with a refusing compiler: nothing is lost."""

import errno
import os
from pathlib import Path
from typing import NoReturn

import pytest

import symgen.make.pipeline
from symgen.errors import BuildError, CompilerError, UrdfError
from symgen.make.request import BuildRequest
from tests.conftest import TINY_URDF
from tests.symgen.builds import heavier, mass, rebuild, snapshot


def no_space(*_: object, **__: object) -> NoReturn:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("stage", ["_write_files", "compile_library", "replace_folder"])
def test_full_disk_leaves_the_old_library(
    tiny: Path, tiny_request: BuildRequest, stage: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: ENOSPC at any stage is one sentence; the old library and nothing else remains."""
    before = snapshot(tiny.parent)
    with monkeypatch.context() as patch:
        patch.setattr(symgen.make.pipeline, stage, no_space)
        with pytest.raises(BuildError, match=r"cannot write '.*tiny'.*previous library.*unchanged"):
            rebuild(heavier(tiny_request), tiny.parent)
    assert snapshot(tiny.parent) == before
    assert mass(tiny) == pytest.approx(1.5, rel=1e-14)
    assert rebuild(heavier(tiny_request), tiny.parent)


def test_half_written_file(
    tiny: Path, tiny_request: BuildRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: the disk fills up in the middle of the third file."""
    written, original = [], Path.write_text

    def write(path: Path, text: str, *args: object, **kwargs: object) -> int:
        written.append(path)
        if len(written) == 3:
            original(path, text[: len(text) // 2])
            no_space()
        return original(path, text, *args, **kwargs)

    before = snapshot(tiny.parent)
    monkeypatch.setattr(Path, "write_text", write)
    with pytest.raises(BuildError, match="No space left on device"):
        rebuild(heavier(tiny_request), tiny.parent)
    assert snapshot(tiny.parent) == before


def test_refused_compilation_leaves_the_old_library(
    tiny: Path, tiny_request: BuildRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a compiler that fails changes nothing."""
    before = snapshot(tiny.parent)
    monkeypatch.setenv("CC", "false")
    with pytest.raises(CompilerError, match="'false "):
        rebuild(heavier(tiny_request), tiny.parent)
    assert snapshot(tiny.parent) == before


def test_bad_urdf_leaves_the_old_library(tiny: Path) -> None:
    """Property: so does a URDF that cannot be read."""
    before = snapshot(tiny.parent)
    with pytest.raises(UrdfError):
        rebuild(BuildRequest("tiny", "<robot/>"), tiny.parent)
    assert snapshot(tiny.parent) == before


def test_folder_that_cannot_be_made(tmp_path: Path, tiny_request: BuildRequest) -> None:
    """Property: a file where the folder should be, or a name too long, is one sentence."""
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(BuildError, match="cannot write"):
        rebuild(tiny_request, tmp_path / "taken")
    with pytest.raises(BuildError, match="cannot write"):
        rebuild(BuildRequest("a" * 300, TINY_URDF), tmp_path)
    assert (tmp_path / "taken").read_text() == "a file"


def test_foreign_files_survive(tiny: Path, tiny_request: BuildRequest) -> None:
    """Property: a user's own files and folders beside the generated ones are kept."""
    (tiny / "notes.txt").write_text("mine")
    (tiny / "meshes").mkdir()
    (tiny / "meshes" / "rod.stl").write_text("solid")
    rebuild(heavier(tiny_request), tiny.parent)
    assert (tiny / "notes.txt").read_text() == "mine"
    assert (tiny / "meshes" / "rod.stl").read_text() == "solid"
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)


def test_exchange_without_renameat2(
    tiny: Path, tiny_request: BuildRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: where the system cannot exchange folders, two renames do, and undo themselves."""
    monkeypatch.setattr(symgen.make.pipeline, "_exchange", lambda a, b: False)
    assert rebuild(heavier(tiny_request), tiny.parent)
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)
    before = snapshot(tiny.parent)
    original = Path.rename

    def rename(path: Path, target: Path) -> Path:
        if target == tiny and not path.name.endswith(".old"):
            no_space()
        return original(path, target)

    monkeypatch.setattr(Path, "rename", rename)
    with pytest.raises(BuildError, match="No space left"):
        rebuild(tiny_request, tiny.parent)
    assert snapshot(tiny.parent) == before
