"""`symgen undo`: the result that the last run into a folder replaced comes back."""

from dataclasses import dataclass
from pathlib import Path

from runtime.cli.common import EARLIER, swap_earlier
from runtime.common.settings import Choices, argument_field
from runtime.common.terminal import say
from runtime.errors import RuntimeFault


@dataclass(frozen=True, slots=True, kw_only=True)
class UndoSettings(Choices):
    """Settings of `symgen undo`."""

    options = ""
    result: Path = argument_field(metavar="RESULT", help="Folder whose result was replaced.")


def undo_command(given: UndoSettings) -> None:
    r"""Bring the result back that the last run replaced.

    \b
    symgen undo results/fr3_simulated-map

    A command that replaces its earlier result keeps that one in the hidden folder .earlier of the
    result. A second undo brings the newer result back.
    """
    if not (given.result / EARLIER).is_dir():
        raise RuntimeFault(
            f"expected a folder whose result was replaced, got '{given.result}', which keeps no "
            "earlier one"
        )
    for name in swap_earlier(given.result):
        say(f"back: {given.result / name}")
