"""Bounded reading of files from outside: regular files of limited size, UTF-8 text, JSON."""

import errno
import json
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

LARGEST = 50 * 2**20
"""Largest file that is read, bytes. Robot descriptions have thousands of lines, not millions."""
LARGEST_TOML = 2**22
"""Largest size of a TOML text that is parsed [characters]."""
_DIGITS = 19
"""Largest number of digits of an integer that is read; a double has no room for 400 of them."""
_KEY_PARTS = 32
"""Largest number of parts of a dotted key; the time to read one grows with their square."""
_KEY_LENGTH = 1000
"""Largest length of a key [characters]."""
_TOML_LITERAL = re.compile(
    r'"""(?:[^\\]|\\.)*?(?:"""|\Z)|\'\'\'.*?(?:\'\'\'|\Z)|"(?:[^"\\\n]|\\.)*"?|\'[^\'\n]*\'?|#[^\n]*',
    re.DOTALL,
)
"""Texts and comments; unclosed ones too, or the search would begin anew at each of their quotes."""


def text_of(path: Path) -> str:
    """Return the text of a UTF-8 file, without its byte order mark.

    Pipes and devices are refused: reading them could block or never end.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    if status.st_size > LARGEST:
        raise ValueError(f"it has more than {LARGEST >> 20} MiB")
    return path.read_bytes().decode("utf-8-sig")


def json_of(path: Path) -> Any:
    """Return the value of a JSON file."""
    try:
        return json.loads(text_of(path), parse_int=_whole)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def toml_of(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file."""
    text = text_of(path)
    if len(text) > LARGEST_TOML:
        raise ValueError(f"it has more than {LARGEST_TOML >> 20} MiB")
    require_short_keys(text)
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    _require_short_integers(tables)
    return tables


def _whole(text: str) -> int:
    if len(text) > _DIGITS + 1:
        raise ValueError(f"an integer has more than {_DIGITS} digits")
    return int(text)


def _require_short_integers(tree: Any) -> None:
    pending = [tree]
    while pending:
        value = pending.pop()
        if isinstance(value, dict):
            pending += value.values()
        elif isinstance(value, list):
            pending += value
        elif isinstance(value, int) and abs(value) >= 10**_DIGITS:
            raise ValueError(f"an integer has more than {_DIGITS} digits")


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
