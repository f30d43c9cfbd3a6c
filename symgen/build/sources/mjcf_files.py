"""Files that an MJCF file names, looked at before MuJoCo opens them.

MuJoCo reads what `file` attributes name, however large, and waits at a pipe for ever. Here every
file that exists must be a regular one of bounded size, in included files too. Attributes are
searched in the text: MuJoCo accepts files that are not well-formed XML.
"""

import re
import stat
from html import unescape
from itertools import chain, product
from pathlib import Path

from symgen.documents import LARGEST
from symgen.errors import BuildError

LARGEST_ASSET = 2**28
"""Largest mesh, texture or height field, bytes."""
MOST = 50_000
"""Largest number of pairs of a folder and a name."""
_NAMED = re.compile(r"""\b(file\w*|meshdir|texturedir|assetdir)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
"""Names of files (file, fileright, fileup, … of a texture) and of their folders."""


def require_bounded_files(path: Path) -> None:
    """Refuse an MJCF file that names pipes, devices or files of hundreds of megabytes."""
    folders, names, known = set[Path](), set[str](), set[Path]()
    pending = [path]
    while pending:
        file = pending.pop()
        if file in known:
            continue
        known.add(file)
        listed, places = _named_in(_text_of(file))
        new = {path.parent, file.parent, *(f.parent / p for f in (path, file) for p in places)}
        fresh, more = new - folders, listed - names
        folders |= fresh
        names |= more
        if len(folders) * len(names) > MOST:
            raise BuildError(f"'{path}' names more than {MOST} files; leave some out")
        # An asset may lie in a folder that a later file names: each pair is looked at once.
        for folder, name in chain(product(fresh, names), product(folders - fresh, more)):
            if _is_bounded(path, folder / name):
                pending.append(folder / name)


def _named_in(text: str) -> tuple[set[str], set[str]]:
    """Names of files, and of their folders."""
    files, places = set[str](), set[str]()
    for key, *values in _NAMED.findall(text):
        (places if key.endswith("dir") else files).add(unescape("".join(values)))
    return files, places


def _is_bounded(path: Path, asset: Path) -> bool:
    """Whether a file exists."""
    try:
        status = asset.stat()
    except (OSError, ValueError):  # MuJoCo names what it does not find
        return False
    if stat.S_ISDIR(status.st_mode):
        return False
    if not stat.S_ISREG(status.st_mode):
        raise BuildError(f"'{path}' names '{asset}', which is not a regular file; remove it")
    if status.st_size > LARGEST_ASSET:
        raise BuildError(
            f"'{path}' names '{asset}' of more than {LARGEST_ASSET >> 20} MiB; remove it"
        )
    return True


def _text_of(file: Path) -> str:
    """Text of a file that may be XML; empty for a mesh, an image or a file of other text."""
    try:
        if file.stat().st_size > LARGEST:
            return ""
        data = file.read_bytes()
    except OSError:  # MuJoCo says why
        return ""
    head = data[:512].lstrip(b"\xef\xbb\xbf \t\r\n")
    return data.decode(errors="replace") if head.startswith(b"<") else ""
