"""Places that others can write: cache, drafts of files, locks; and names that others chose."""

import json
import os
import subprocess
from pathlib import Path

import pytest

from runtime.common.compiler import find_compiler
from runtime.common.files import replacing
from runtime.errors import LibraryError, RuntimeFault
from runtime.identification.comparison.output import _markdown
from runtime.library import load
from runtime.library.compile_cache import _roots, compiled_library, is_whole
from symgen.emit.files import in_code, in_comment, in_markdown
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.conftest import TINY_URDF

EVIL = (
    "a */ int x; /*",
    "a *??/\n/ int x; /*",  # a trigraph and a line splice spell */
    "a | b\n| --- |",
    "<script>alert(1)</script>",
    "![x](javascript:alert(1)) `id`",
    'q", "%s%n\\',
)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """One level per compilation."""
    monkeypatch.setenv("SYMGEN_LEVELS", "portable")


@pytest.mark.usefixtures("quick")
def test_a_cache_that_others_can_write_is_refused(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: anybody could have put a library there."""
    cache = tmp_path / "open"
    cache.mkdir()
    cache.chmod(0o777)
    monkeypatch.setenv("SYMGEN_CACHE", str(cache))
    with pytest.raises(LibraryError, match=r"expected SYMGEN_CACHE .*only you can write, got"):
        compiled_library(tiny, "tiny")
    assert not list(cache.iterdir())
    if os.getuid() == 0:  # only the administrator gives folders away
        cache.chmod(0o755)
        os.chown(cache, 12345, 12345)
        with pytest.raises(LibraryError, match="which others own"):
            compiled_library(tiny, "tiny")


@pytest.mark.usefixtures("quick")
def test_an_entry_that_others_can_write_is_compiled_again(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a library of the cache counts only while nobody else can replace it."""
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    entry = compiled_library(tiny, "tiny")
    assert is_whole(entry, "tiny")
    (entry / "libtiny.so").chmod(0o777)
    assert not is_whole(entry, "tiny")
    assert is_whole(compiled_library(tiny, "tiny"), "tiny")


def test_the_temporary_cache_is_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: its name can be guessed, so another user may have made the folder, or a link."""
    monkeypatch.delenv("SYMGEN_CACHE", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    place = tmp_path / f"symgen-{os.getuid()}"
    (tmp_path / "theirs").mkdir(mode=0o700)
    place.symlink_to(tmp_path / "theirs")
    assert place not in _roots()
    place.unlink()
    place.mkdir()
    place.chmod(0o777)
    assert place not in _roots()
    place.chmod(0o700)
    assert place in _roots()


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("word", ["cache", "./a/../cache", "~/cache"])
def test_the_cache_is_resolved(
    word: str, tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a relative path and ~ name one folder, whatever directory comes later."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SYMGEN_CACHE", word)
    assert compiled_library(tiny, "tiny").is_relative_to(tmp_path / "cache")
    assert not (tmp_path / "~").exists()


def test_drafts_follow_no_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: the name of a draft cannot be guessed, and a link in its place is an error."""
    precious, out = tmp_path / "precious", tmp_path / "out.txt"
    precious.write_text("mine")
    out.symlink_to(precious)  # where the file itself shall stand
    (tmp_path / f".{out.name}.{os.getpid()}").symlink_to(precious)  # the draft's earlier name

    def write() -> None:
        with replacing(out) as file:
            file.write(b"new")

    write()
    monkeypatch.setattr("secrets.token_hex", lambda size: "11")
    (tmp_path / ".symgen.11").symlink_to(precious)
    with pytest.raises(RuntimeFault, match="cannot write"):
        write()
    assert precious.read_text() == "mine"
    assert out.read_text() == "new"
    assert not out.is_symlink()


def test_files_have_the_usual_mode(tmp_path: Path) -> None:
    """Property: the draft's mode is that of any file of the user, 0666 less the mask."""
    usual = tmp_path / "usual"
    usual.write_text("")
    with replacing(tmp_path / "out") as file:
        file.write(b"")
    assert (tmp_path / "out").stat().st_mode == usual.stat().st_mode


@pytest.mark.parametrize("name", EVIL)
def test_names_stay_names(name: str, tmp_path: Path) -> None:
    """Property: a name ends no comment, no cell and no code span, and is no HTML."""
    comment, cell, code = in_comment(name), in_markdown(name), in_code(name)
    assert not {"*", "\\", "?", "\n"} & set(comment)
    assert "<" not in cell
    assert "\n" not in cell
    assert "|" not in cell.replace("\\|", "")
    assert not {"`", "\n"} & set(code)
    source = tmp_path / "x.c"
    source.write_text(f"/* {comment} */\nint y;\n")
    command = [*find_compiler(), "-std=c99", "-Wall", "-Werror", "-c", source]
    subprocess.run([*command, "-o", tmp_path / "x.o"], check=True)


@pytest.mark.parametrize("name", ["fr3_joint1", "panda/joint-1.a", "joint 1", "Gelenk_ä"])
def test_plain_names_stay_as_they_are(name: str) -> None:
    """Property: files of robots with usual names do not change."""
    assert in_comment(name) == in_markdown(name) == in_code(name) == name


def test_generated_text_of_a_hostile_robot(tmp_path: Path) -> None:
    """Property: its examples compile to nothing but the example; the README keeps its table."""
    attribute = EVIL[0] + "|&lt;b&gt;"
    urdf = TINY_URDF.replace('"rod"', f'"{attribute}"').replace('"swing"', '"a|b &lt;i&gt;"')
    folder = build(BuildRequest("hostile", urdf), tmp_path, levels=("portable",)).folder
    for name in ("example.c", "example_online.c", "hostile.h"):
        text = (folder / name).read_text()
        assert "*/ int x" not in text, name
    readme = (folder / "README.md").read_text()
    assert r"| a\|b &lt;i&gt; | revolute |" in readme
    assert "<b>" not in readme
    assert json.loads((folder / "manifest.json").read_text())["joints"][0]["name"] == "a|b <i>"
    assert load(folder).joint_names == ("a|b <i>",)


def test_the_table_of_a_comparison_keeps_its_cells() -> None:
    """Property: names of joints and logs do not end a cell of compare.md, and are no HTML."""
    facts = {
        "robot": "tiny",
        "joints": ["a|b\n<i>"],
        "units": ["N*m"],
        "recording": {"name": "<script>x</script>\n# head"},
        "before_percent": 1.0,
        "rows": [],
        "advice": {"sentences": ["see <b>"]},
        "notes": ["log\n# head"],
    }
    text = _markdown(facts)
    assert "<" not in text.replace("&lt;", "")
    assert sum(line.startswith("#") for line in text.splitlines()) == 1
    assert "| RMS on test | a/b_&lt;i&gt; |" in text
