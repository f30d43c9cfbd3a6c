"""New <inertial> blocks in the text of a URDF; every other byte is kept.

The XML parser gives the positions of the blocks. Writing the document back from its tree would lose
comments, white space and the order of attributes.
"""

import os
import secrets
from contextlib import suppress
from pathlib import Path
from xml.parsers import expat

from symgen.errors import BuildError, UrdfError
from symgen.inspect.model import Body

_AXES = "xyz"


def with_bodies(text: str, bodies: dict[str, Body]) -> str:
    """Return the URDF with the <inertial> of the named links replaced."""
    data = text.encode()
    places = _places(data)
    missing = [name for name in bodies if name not in places]
    if missing:
        raise UrdfError(f"link '{missing[0]}' has no <inertial> to replace; add one")
    for name in sorted(bodies, key=lambda name: places[name], reverse=True):
        start, end = places[name]
        line = data.rfind(b"\n", 0, start) + 1
        blank = data[line:start].decode()
        indent = blank if not blank.strip() else ""
        data = data[:start] + _block(bodies[name], indent).encode() + data[end:]
    return data.decode()


def _places(data: bytes) -> dict[str, tuple[int, int]]:
    """Position of the first <inertial> of each link: first byte, and one past the last byte."""
    parser = expat.ParserCreate("utf-8")  # the text is UTF-8 now, whatever its header states
    path: list[str] = []
    link, start = "", 0
    places: dict[str, tuple[int, int]] = {}

    def opened(tag: str, attributes: dict[str, str]) -> None:
        nonlocal link, start
        path.append(tag)
        if path == ["robot", "link"]:
            link = attributes.get("name", "")
        if path == ["robot", "link", "inertial"]:
            start = parser.CurrentByteIndex

    def closed(_: str) -> None:
        if path == ["robot", "link", "inertial"] and link not in places:
            # At an end tag the index is that of "</"; at <inertial/> it is that of the start.
            end = data.index(b">", parser.CurrentByteIndex) + 1
            places[link] = (start, end)
        path.pop()

    parser.StartElementHandler, parser.EndElementHandler = opened, closed
    parser.Parse(data, True)
    return places


def _block(body: Body, indent: str) -> str:
    step = "\n" + indent + "  "
    entries = " ".join(
        f'i{_AXES[i]}{_AXES[j]}="{_digits(body.inertia[i, j])}"'
        for i in range(3)
        for j in range(i, 3)
    )
    xyz = " ".join(_digits(x) for x in body.com)
    return (
        f'<inertial>{step}<origin xyz="{xyz}" rpy="0 0 0"/>'
        f'{step}<mass value="{_digits(body.mass)}"/>'
        f"{step}<inertia {entries}/>\n{indent}</inertial>"
    )


def _digits(value: float) -> str:
    return repr(float(value) + 0.0)  # the shortest text that reads back to the same number


def require_unused(path: Path, overwrite: bool) -> None:
    """Refuse to replace an existing file.

    Args:
        path: file that will be written.
        overwrite: True permits to replace it.

    Raises:
        BuildError: the file exists and may not be replaced.
    """
    if os.path.lexists(path) and not overwrite:
        raise BuildError(f"'{path}' exists; choose another file, or give --overwrite")


def write_text(path: Path, text: str, overwrite: bool) -> None:
    """Write a file atomically.

    Args:
        path: the file.
        text: its content, UTF-8.
        overwrite: True replaces a file that exists.

    Raises:
        BuildError: the file exists and may not be overwritten, or cannot be written.
    """
    draft = path.with_name(f".symgen.{secrets.token_hex(8)}")
    try:
        require_unused(path, overwrite)
        # O_EXCL follows no link that others have put there; the mode is that of open().
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
        with os.fdopen(os.open(draft, flags, 0o666), "w", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, path)
    except OSError as error:
        raise BuildError(f"cannot write '{path}' ({error.strerror}); choose another path") from None
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
