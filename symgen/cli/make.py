"""`build`, `check` and `clean`: what writes and deletes generated folders."""

import difflib
import shutil
import sys
from pathlib import Path
from typing import Annotated

import typer

from symgen.build.config import RobotConfig, read_config
from symgen.build.pipeline import build, generate
from symgen.build.request import BuildRequest, bundled_request, bundled_robots, request_from_folder
from symgen.chain import ChainOptions
from symgen.cli.common import (
    DEFAULT_ROOT,
    Base,
    Config,
    Lock,
    Root,
    Tip,
    app,
    console,
    folders_of,
    read_locks,
    read_urdf,
)
from symgen.errors import BuildError


@app.command("build")
def build_command(
    robot: Annotated[str, typer.Option(help="A robot that ships with symgen.")] = "fr3",
    urdf: Annotated[
        Path | None, typer.Option(help="Your own robot instead; needs --name.", dir_okay=False)
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="Folder and C prefix of your robot: a-z, 0-9, _.")
    ] = None,
    base: Base = None,
    tip: Tip = None,
    gravity: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z", help="m/s² in the base frame; default 0,0,-9.81 at the root."
        ),
    ] = None,
    lock: Lock = None,
    snap: Annotated[
        float, typer.Option(help="Take rpy within this of a multiple of π/2 as exact, e.g. 1e-4.")
    ] = 0.0,
    project: Annotated[
        bool, typer.Option("--project", help="Replace impossible inertias by the nearest possible.")
    ] = False,
    config: Config = None,
    level: Annotated[
        list[str] | None,
        typer.Option(
            help="Compile for this instruction set only (v4: AVX-512, v3: AVX2, v2, portable, "
            "casadi: its own C to compare with; neon on ARM); repeatable. Default: all, and the "
            "processor decides at load."
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Rebuild although nothing changed.")
    ] = False,
    out: Root = DEFAULT_ROOT,
) -> None:
    r"""Generate and compile the C library of a robot arm.

    \b
    python -m symgen build                             the Franka Research 3
    python -m symgen build --urdf my.urdf --name my    your robot
    python -m symgen build --urdf my.urdf --name my --tip tool0 --gravity 0,9.81,0
    """
    options = ChainOptions(base, tip, _vector(gravity), read_locks(lock or []), snap)
    if urdf is None:
        if options != ChainOptions() or name or project or config:
            raise BuildError(
                "the options --name, --base, --tip, --gravity, --lock, --snap, --project and "
                "--config describe your own robot; give its --urdf too"
            )
        request = bundled_request(robot)
    else:
        request = _own_request(urdf, name, options, project, config)
    with console.status(f"building {request.name}"):
        result = build(request, out, force, level or ())
    for note in result.notes:
        console.print(f"note: {note}", highlight=False, soft_wrap=True)
    state = "built" if result.rebuilt else "up to date"
    console.print(f"{result.folder}: {state}", highlight=False, soft_wrap=True)


@app.command()
def check(
    robot: Annotated[str | None, typer.Argument(help="Default: every robot in the folder.")] = None,
    out: Root = DEFAULT_ROOT,
) -> None:
    """Compare generated files with the C code that symgen writes today.

    Exit code: 0 equal, 1 different.
    """
    different = []
    for folder in folders_of(out, robot):
        bundled = folder.name in bundled_robots()
        request = bundled_request(folder.name) if bundled else request_from_folder(folder)
        emitted, _ = generate(request)
        for file, text in emitted.files.items():
            path = folder / file
            old = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
            if old != text:
                different.append(folder)
                diff = difflib.unified_diff(
                    old.splitlines(), text.splitlines(), str(path), "regenerated", n=1, lineterm=""
                )
                sys.stdout.writelines(
                    f"{line}\n" for _, line in zip(range(200), diff, strict=False)
                )
        state = "differs, run: python -m symgen build" if folder in different else "in sync"
        console.print(f"{folder}: {state}", highlight=False, soft_wrap=True)
    raise typer.Exit(int(bool(different)))


@app.command()
def clean(
    robot: Annotated[str | None, typer.Argument(help="Default: every robot in the folder.")] = None,
    out: Root = DEFAULT_ROOT,
) -> None:
    """Delete compiled libraries and generated folders.

    Of a bundled robot the library is deleted, of your own robot the whole folder.
    """
    for folder in folders_of(out, robot):
        if folder.name in bundled_robots():
            for path in (folder / f"lib{folder.name}.so", folder / "build.json"):
                path.unlink(missing_ok=True)
        else:
            shutil.rmtree(folder)
        console.print(f"{folder}: clean", highlight=False, soft_wrap=True)


def _own_request(
    urdf: Path, name: str | None, options: ChainOptions, project: bool, config: list[Path] | None
) -> BuildRequest:
    if name is None:
        raise BuildError(
            "--urdf needs --name, which becomes the folder and the prefix of the C code"
        )
    if name in bundled_robots():
        raise BuildError(f"'{name}' is the name of a bundled robot; choose another --name")
    text = read_urdf(urdf)
    return BuildRequest(
        name, text, options, read_config(*config) if config else RobotConfig(), project
    )


def _vector(text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        raise BuildError(f"--gravity needs three numbers X,Y,Z, got '{text}'") from None
    return x, y, z
