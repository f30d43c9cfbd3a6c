"""What comes with the package: `symgen locate` and `symgen tutorial`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markdown import Markdown

from runtime.cli.common import robots
from runtime.cli.log_options import bundled_logs
from runtime.common.terminal import completing, console, say
from runtime.common.user_builds import NAME
from runtime.errors import LibraryError, RuntimeFault
from runtime.library.library import find
from runtime.recording.log_files import known_names, locate

FOLDER = Path(__file__).resolve().parents[1] / "tutorials"


def _tutorials(incomplete: str) -> list[str]:
    """Names of tutorials, read when a shell asks."""
    return completing(path.stem for path in FOLDER.glob("*.md"))(incomplete)


def tutorial_command(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            autocompletion=_tutorials,
            help="Name of a tutorial; default a list of all.",
        ),
    ] = None,
) -> None:
    r"""Show a tutorial.

    \b
    symgen tutorial
    symgen tutorial fr3
    symgen tutorial fr3 > fr3.md

    A terminal shows it formatted; a file or a pipe receives Markdown.
    """
    texts = {path.stem: path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.md"))}
    if name is None:
        for stem, text in texts.items():
            title = text.partition("\n")[0].removeprefix("# ")
            say(f"{stem:12s} {title}")
        return
    if name not in texts:
        raise RuntimeFault(f"there is no tutorial '{name}'; there are {', '.join(texts)}")
    if console.is_terminal:
        console.print(Markdown(texts[name]))
    else:
        print(texts[name], end="")


def _places(incomplete: str) -> list[str]:
    return [*bundled_logs(incomplete), *robots(incomplete)]


def locate_command(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            autocompletion=_places,
            help="Known data set, such as panda_gaz, or robot, such as fr3.",
        ),
    ],
) -> None:
    r"""Print the folder of a known data set or of a robot.

    \b
    symgen locate panda_gaz
    cc -O1 -DQUICK -I"$(symgen locate fr3)" main.c "$(symgen locate fr3)/kernels.c" -lm

    The examples that come with the package are single files; their path is printed. A data set that
    is not on this machine is downloaded once, to the cache of the user, and its checksum is
    verified. The folder of a robot holds its C code and header.
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
