"""`symgen locate`."""

from typing import Annotated

import typer

from runtime.cli.common import say
from runtime.recording.datasets import locate


def locate_command(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of a known data set, such as panda_gaz.")
    ],
) -> None:
    r"""Print the folder of a known data set.

    The examples that come with the package are single files; their path is printed. A data set that
    is not on this machine is downloaded once, to the cache of the user, and its checksum is
    verified.

    \b
    symgen locate panda_gaz
    """
    say(str(locate(name)))
