"""What the commands share: the application, the console, options and folders."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from symgen.documents import text_of
from symgen.errors import BuildError

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Write the physics of a robot arm as C and compile it: URDF in, generated/<robot>/ out.",
)
console = Console()

Root = Annotated[
    Path, typer.Option("--out", help="Folder that holds one folder per robot.", show_default=True)
]
DEFAULT_ROOT = Path("generated")

Base = Annotated[str | None, typer.Option(help="Link that is fixed to the world.")]
Tip = Annotated[str | None, typer.Option(help="Last link; whatever hangs beyond it is cut off.")]
Lock = Annotated[
    list[str] | None,
    typer.Option(metavar="JOINT=VALUE", help="Freeze a joint at rad or m; repeatable."),
]
Config = Annotated[
    list[Path] | None,
    typer.Option(
        help="TOML with home, limits, braking, proxies, pairs; repeatable.", dir_okay=False
    ),
]


def say(sentence: str) -> None:
    """One line to the terminal as it is."""
    console.print(sentence, highlight=False, soft_wrap=True)


def flowing(doc: str) -> str:
    r"""A docstring as help: a paragraph flows with the terminal, one after \b keeps its lines."""
    blocks = doc.split("\n\n")
    return "\n\n".join(
        block.removeprefix("\\b\n") if block.startswith("\\b\n") else " ".join(block.split("\n"))
        for block in blocks
    )


def read_urdf(urdf: Path) -> str:
    """Text of a URDF.

    Raises:
        BuildError: it cannot be read.
    """
    try:
        return text_of(urdf)
    except UnicodeDecodeError as error:
        raise BuildError(f"the URDF '{urdf}' is not UTF-8 text ({error.reason})") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise BuildError(f"cannot read the URDF '{urdf}': {reason}") from None


def read_locks(items: list[str]) -> dict[str, float]:
    """--lock JOINT=VALUE as a table."""
    locks = {}
    for item in items:
        joint, _, value = item.partition("=")
        try:
            locks[joint] = float(value)
        except ValueError:
            raise BuildError(f"--lock needs JOINT=VALUE with a number, got '{item}'") from None
    return locks


def folders_of(out: Path, robot: str | None) -> list[Path]:
    """The folder of a generated robot, or of all."""
    if robot is not None:
        if not (out / robot / "manifest.json").exists():
            raise BuildError(
                f"'{out / robot}' holds no generated robot; run: python -m symgen build"
            )
        return [out / robot]
    return sorted(f for f in out.glob("[a-z]*/") if (f / "manifest.json").exists())
