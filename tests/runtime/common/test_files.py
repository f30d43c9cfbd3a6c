"""runtime.common.files: what stands in the place of a file, and what JSON and TOML may not say."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from runtime.common.files import (
    LARGEST_DOCUMENT,
    bytes_of,
    json_of,
    require_file,
    text_of,
    toml_of,
    write_json,
)


def endless(path: Path) -> None:
    path.write_bytes(b"")
    os.truncate(path, LARGEST_DOCUMENT + 1)  # a hole: it takes no room


PLACES: dict[str, tuple[Callable[[Path], object], str]] = {
    "nothing": (lambda path: None, "No such file"),
    "a folder": (Path.mkdir, "not a regular file"),
    "a pipe": (os.mkfifo, "not a regular file"),
    "a device": (lambda path: path.symlink_to("/dev/zero"), "not a regular file"),
    "itself": (lambda path: path.symlink_to(path.name), "symbolic links"),
    "too much": (endless, "more than the"),
    "bytes": (lambda path: path.write_bytes(b"\xff\xfe"), "decode"),
}


@pytest.mark.parametrize("place", PLACES)
def test_what_is_no_document_is_told_at_once(tmp_path: Path, place: str) -> None:
    """Property: nothing is waited for, nothing is read without end."""
    make, words = PLACES[place]
    make(tmp_path / "file")
    with pytest.raises((OSError, ValueError), match=words):
        text_of(tmp_path / "file")


def test_links_to_files_are_files(tmp_path: Path) -> None:
    """Property: a link is as good as its file."""
    (tmp_path / "file").write_text("[1, 2.5]")
    (tmp_path / "link").symlink_to("file")
    assert require_file(tmp_path / "link") == tmp_path / "link"
    assert json_of(tmp_path / "link") == json_of(bytes_of(tmp_path / "file")) == [1, 2.5]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"a": 1, "a": 2}', "the key 'a' stands twice"),
        ("[" * 100_000, "nested too deeply"),
        ("1" + "0" * 400, "more than 19 digits"),
        ("{", "Expecting"),
    ],
)
def test_json_says_one_thing(tmp_path: Path, text: str, words: str) -> None:
    """Property: what two readers would understand differently is refused."""
    (tmp_path / "file.json").write_text(text)
    with pytest.raises(ValueError, match=words):
        json_of(tmp_path / "file.json")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = " + "[" * 100_000, "nested too deeply"),
        ("a = [{b = 1" + "0" * 400 + "}]", "more than 19 digits"),
        ("a = 1\na = 2", "overwrite"),
    ],
)
def test_toml_says_one_thing(tmp_path: Path, text: str, words: str) -> None:
    """Property: as for JSON."""
    (tmp_path / "file.toml").write_text(text)
    with pytest.raises(ValueError, match=words):
        toml_of(tmp_path / "file.toml")


def test_documents_of_windows_editors(tmp_path: Path) -> None:
    """Property: a byte order mark and CR LF change no value of TOML or JSON."""
    path = tmp_path / "prior.toml"
    path.write_bytes(b"\xef\xbb\xbftotal_mass = 2.5\r\n[link.arm]\r\nmass = 1.0\r\n")
    assert toml_of(path) == {"total_mass": 2.5, "link": {"arm": {"mass": 1.0}}}
    path.write_bytes(b'\xef\xbb\xbf{"mass": 1.0}\r\n')
    assert json_of(path) == json_of(path.read_bytes()) == {"mass": 1.0}


def test_json_with_numbers_that_are_none_is_not_written(tmp_path: Path) -> None:
    """Property: NaN leaves the file as it was, unless it is allowed; other text is read again."""
    path = tmp_path / "facts.json"
    write_json(path, facts := {"joint": "é", "values": [1.5, None]})
    assert json_of(path) == facts
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(path, {"sigma": float("nan")})
    assert json_of(path) == facts
    write_json(path, {"sigma": float("inf")}, allow_nan=True)
    assert json_of(path) == {"sigma": float("inf")}
