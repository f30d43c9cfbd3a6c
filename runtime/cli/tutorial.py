"""`symgen tutorial`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markdown import Markdown

from runtime.common.terminal import console, say
from runtime.errors import RuntimeFault

FOLDER = Path(__file__).resolve().parents[1] / "tutorials"


def tutorial_command(
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="Name of a tutorial; default a list of all."),
    ] = None,
) -> None:
    r"""Show a tutorial.

    A terminal shows it formatted; a file or a pipe receives Markdown.

    \b
    symgen tutorial
    symgen tutorial fr3
    symgen tutorial fr3 > fr3.md
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
