"""Files that others wrote, read within bounds: regular, of a size, UTF-8, JSON or TOML.

A pipe blocks, a device never ends, deep nesting exhausts the stack, and a repeated key is
ambiguous; each of them raises OSError or ValueError here. The packages that read the documents
check the values.
"""

import errno
import hashlib
import json
import os
import re
import secrets
import shutil
import stat
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from runtime.common.errors import RuntimeFault

DRAFT = ".symgen."  # start of the names of incomplete files; a killed process leaves them behind
LARGEST_DOCUMENT = 2**26  # largest document [bytes]; the largest written here has a few million
LARGEST_JSON, LARGEST_TOML = 2**24, 2**22  # parsed text [characters]: lists take 60 times its size
_DIGITS = 19  # largest number of digits of an integer that is read
_KEY_PARTS = 32  # most parts of a dotted key; the time to read one grows with their square
_KEY_LENGTH = 1000  # largest length of a key [characters]
_TOML_LITERAL = re.compile(
    r'"""(?:[^\\]|\\.)*?(?:"""|\Z)|\'\'\'.*?(?:\'\'\'|\Z)|"(?:[^"\\\n]|\\.)*"?|\'[^\'\n]*\'?|#[^\n]*',
    re.DOTALL,
)
"""Texts and comments; unclosed ones too, or the search would begin anew at each of their quotes."""


def require_file(path: Path) -> Path:
    """Path of a regular file; links are followed."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    return path


def folder_of(place: Path) -> Path:
    """A folder itself, or the one that holds a file."""
    return place if place.is_dir() else place.parent


def bytes_of(path: Path) -> bytes:
    """Content of a document."""
    size = require_file(path).stat().st_size
    if size > LARGEST_DOCUMENT:
        raise ValueError(f"{size} bytes are more than the {LARGEST_DOCUMENT} of any document")
    return path.read_bytes()


def sha256_of(path: Path) -> str:
    """SHA-256 of a file as text; it is read in pieces, for which no new memory is needed."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def text_of(path: Path) -> str:
    """Text of a UTF-8 document, without a byte order mark; errors as for `bytes_of`."""
    return bytes_of(path).decode("utf-8-sig")


def json_of(document: Path | bytes) -> Any:
    """Value of a JSON document; errors as for `bytes_of`."""
    text = document.decode("utf-8-sig") if isinstance(document, bytes) else text_of(document)
    _require_short(text, LARGEST_JSON)
    try:
        return json.loads(text, object_pairs_hook=_once, parse_int=_whole)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def toml_of(path: Path) -> dict[str, Any]:
    """Tables of a TOML document; errors as for `bytes_of`."""
    return tables_of(text_of(path))


def tables_of(text: str) -> dict[str, Any]:
    """Tables of a TOML text; a `ValueError` says what is wrong with it."""
    _require_short(text, LARGEST_TOML)
    require_short_keys(text)
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    for value in values_of(tables):
        if isinstance(value, int) and abs(value) >= 10**_DIGITS:
            raise ValueError(f"an integer has more than {_DIGITS} digits")
    return tables


def require_short_keys(text: str) -> None:
    """Refuse a TOML text with long keys before it is parsed."""
    # Texts become one letter and comments nothing; then only keys, numbers and dates are left.
    plain = _TOML_LITERAL.sub(
        lambda match: "" if match[0][0] == "#" else "s" * min(len(match[0]), _KEY_LENGTH), text
    )
    for word in re.findall(r"[A-Za-z0-9_\-. \t]+", plain):
        if word.count(".") >= _KEY_PARTS:
            raise ValueError(f"a key has more than {_KEY_PARTS} parts")
    for name in re.findall(r"[A-Za-z0-9_\-]+", text):
        if len(name) > _KEY_LENGTH:
            raise ValueError(f"a key or number has more than {_KEY_LENGTH} characters")


def _require_short(text: str, largest: int) -> None:
    if len(text) > largest:
        raise ValueError(f"{len(text)} characters are more than the {largest} of any such file")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice, _ = Counter(name for name, _ in pairs).most_common(1)[0]
        raise ValueError(f"the key {twice[:40]!r} stands twice")
    return table


def _whole(text: str) -> int:
    if len(text) > _DIGITS + 1:
        raise ValueError(f"an integer has more than {_DIGITS} digits")
    return int(text)


def values_of(tree: Any) -> Iterator[Any]:
    """Yield the values of nested tables and lists."""
    pending = [tree]
    while pending:
        value = pending.pop()
        if isinstance(value, dict):
            pending += value.values()
        elif isinstance(value, list):
            pending += value
        else:
            yield value


def require_unused(
    paths: Iterable[Path],
    overwrite: bool,
    option: str | None = "--out",
    consent: str = "--overwrite",
) -> None:
    """Refuse to replace existing files unless `overwrite` is set.

    The sentence names the option of another place, if any, and the consent: how the user allows it.
    """
    existing = [path for path in paths if os.path.lexists(path)]
    if existing and not overwrite:
        more = f" and {len(existing) - 1} more files exist" if existing[1:] else " exists"
        elsewhere = f"choose another place with {option}" if option else "choose another file"
        raise RuntimeFault(f"'{existing[0]}'{more}; {elsewhere}, or give {consent}")


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """Binary file that takes the place of `path`, or of a link there, at the end without errors."""
    if not path.name:
        raise RuntimeFault(f"cannot write '{path}': it names no file")
    draft = path.with_name(f"{DRAFT}{secrets.token_hex(8)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # In a folder that others write, a name that they can guess may be a link of theirs: O_EXCL
        # follows none. The mode is that of open(), less the user's mask.
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
        with os.fdopen(os.open(draft, flags, 0o666), "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, path)
    except OSError as error:
        reason = error.strerror or error
        raise RuntimeFault(f"cannot write '{path}' ({reason}); choose another place") from None
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8, completely or not at all."""
    with replacing(path) as file:
        file.write(text.encode())


def json_text(facts: Any, allow_nan: bool = False) -> str:
    """Indented JSON that ends with a line feed; NaN and infinity only where allowed."""
    return json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=allow_nan) + "\n"


def write_json(path: Path, facts: Any, allow_nan: bool = False) -> None:
    """Write indented JSON, completely or not at all; only Python reads NaN and infinity in it."""
    write_text(path, json_text(facts, allow_nan))


def toml_value(value: Any) -> str:
    """A number, a text, a truth value or a list of them as TOML; rows of a matrix have lines."""
    if isinstance(value, list | tuple):
        rows = value and isinstance(value[0], list | tuple)
        inner = (",\n    " if rows else ", ").join(map(toml_value, value))
        return f"[\n    {inner},\n]" if rows else f"[{inner}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    # TOML has no \/ and JSON no DEL; all other escapes are the same.
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_lines(table: Mapping[str, Any], *path: str) -> Iterator[str]:
    """Lines of a table of TOML at a path of keys: its values first, then the tables within."""
    for key, value in table.items():
        if not isinstance(value, Mapping):
            yield f"{_toml_key(key)} = {toml_value(value)}"
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield f"\n[{'.'.join(map(_toml_key, (*path, key)))}]"
            yield from toml_lines(value, *path, key)


def _toml_key(key: str) -> str:
    bare = key.replace("_", "").replace("-", "")
    return key if bare.isascii() and bare.isalnum() else toml_value(key)


@contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """Folder whose files move to `path` at the end without errors; other files there stay."""
    draft = path.with_name(f"{DRAFT}{secrets.token_hex(8)}")
    try:
        yield draft
        for file in sorted(each for each in draft.rglob("*") if each.is_file()):
            place = path / file.relative_to(draft)
            place.parent.mkdir(parents=True, exist_ok=True)
            os.replace(file, place)
    except OSError as error:
        reason = error.strerror or error
        raise RuntimeFault(f"cannot write '{path}' ({reason}); choose another place") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)
