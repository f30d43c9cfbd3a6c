"""Files that a command writes: an existing file is replaced with --overwrite only.

Two exceptions, both printed: the folder of a result is replaced by a later result of the same
command, and the page that `report` derives from a folder by a later one. `reproduce` continues
the trials of its folder and refuses those of another configuration.
"""

import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from runtime.common.files import bytes_of, json_of, replacing, require_unused
from runtime.common.terminal import program
from runtime.errors import RuntimeFault

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files that exist.")]

PAGE = b'<meta name="generator" content="symgen">'
"""Mark of an HTML page of this package."""


class ResultFolder(NamedTuple):
    """What a command writes into the folder of its result.

    Attributes:
        command: name of the command.
        files: names of all files that it writes.
        key: key of the first file, a JSON document, by which the result is recognised.
    """

    command: str
    files: tuple[str, ...]
    key: str


def require_result_folder(folder: Path, kind: ResultFolder, overwrite: bool) -> None:
    """Refuse to replace files of a folder, except an earlier result of the same command."""
    with suppress(OSError, ValueError):
        facts = json_of(folder / kind.files[0])
        if isinstance(facts, dict) and kind.key in facts:
            _announce(f"the earlier result of {kind.command} in '{folder}' will be replaced")
            return
    require_unused((folder / name for name in kind.files), overwrite)


def require_page(path: Path, overwrite: bool) -> None:
    """Refuse to replace the default page of a folder, except a page of this package."""
    with suppress(OSError, ValueError):
        if PAGE in bytes_of(path)[:2000]:
            _announce(f"the earlier page '{path}' will be replaced")
            return
    require_unused([path], overwrite)


def write_recipe(path: Path, text: str, overwrite: bool) -> None:
    """Write a proposed recipe unless it would replace a different one."""
    data = text.encode()
    if path.is_file() and path.read_bytes() != data and not overwrite:
        raise RuntimeFault(
            f"'{path}' exists and differs from the proposed recipe; choose another place with "
            "--recipe-out and compare them, or give --overwrite"
        )
    with replacing(path) as file:
        file.write(data)


def _announce(sentence: str) -> None:
    sys.stderr.write(f"{program().split()[-1]}: {sentence}\n")
