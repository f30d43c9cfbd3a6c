"""`symgen locate`."""

from typing import Annotated

import typer

from runtime.common.user_builds import NAME
from runtime.errors import LibraryError, RuntimeFault
from runtime.library.library import find
from runtime.recording.datasets import known_names, locate


def locate_command(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="Known data set, such as panda_gaz, or robot, such as fr3."
        ),
    ],
) -> None:
    r"""Print the folder of a known data set or of a robot.

    The examples that come with the package are single files; their path is printed. A data set that
    is not on this machine is downloaded once, to the cache of the user, and its checksum is
    verified. The folder of a robot holds its C code and header.

    \b
    symgen locate panda_gaz
    cc -O1 -DQUICK -I"$(symgen locate fr3)" main.c "$(symgen locate fr3)/kernels.c" -lm
    """
    is_robot = NAME.fullmatch(name) and name not in known_names()
    try:
        place = find(name).folder.resolve() if is_robot else locate(name)
    except LibraryError as error:
        raise RuntimeFault(
            f"there is no data set or robot '{name}'; data sets are {', '.join(known_names())}, "
            f"and of robots {error}"
        ) from None
    print(place)
