"""Commands that write and delete generated folders: `build`, `check`, `clean`."""

import difflib
import gc
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from runtime.common.terminal import completing, console, say
from symgen.chain import ChainOptions
from symgen.cli.build_request import changed_request, levels_of, request_from_urdf, vector_of
from symgen.cli.common import (
    DEFAULT_ROOT,
    ArgumentOption,
    BaseOption,
    ConfigOption,
    LockOption,
    MechanismOption,
    OverwriteOption,
    PackageOption,
    RootOption,
    TipOption,
    folders_of,
    read_arguments,
    read_locks,
    read_mechanism,
)
from symgen.errors import BuildError
from symgen.make import bundled_robots
from symgen.make.config import read_masses
from symgen.make.pipeline import build, generate
from symgen.make.request import bundled_request, request_from_folder
from symgen.make.sources import Packages, Source, published_urdf


def build_command(
    robot: Annotated[
        str,
        typer.Option(
            autocompletion=completing(bundled_robots()),
            help="Name of a bundled robot, see `symgen list`.",
        ),
    ] = "fr3",
    urdf: Annotated[
        Path | None,
        typer.Option(
            help="File of your own robot: URDF, xacro, MJCF, SDF or TOML of modified DH rows; "
            "package://PACKAGE/path is searched in ROS packages. Needs --name.",
            dir_okay=False,
        ),
    ] = None,
    description: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Published robot of robot_descriptions or example-robot-data, where installed.",
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="Name of the folder and prefix of the C functions: a-z, 0-9, _."),
    ] = None,
    base: BaseOption = None,
    tip: TipOption = None,
    gravity: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="Gravity in the base frame, m/s². Default: 0,0,-9.81 in the root frame.",
        ),
    ] = None,
    lock: LockOption = None,
    snap: Annotated[
        float,
        typer.Option(
            help="Replace rpy angles within this distance, rad, of a multiple of π/2 by the "
            "multiple; 1e-4 for a URDF that rounds its angles."
        ),
    ] = 0.0,
    project: Annotated[
        bool,
        typer.Option(
            "--project",
            help="Replace physically inconsistent inertias by the nearest consistent ones.",
        ),
    ] = False,
    floating: Annotated[
        bool,
        typer.Option(
            "--floating",
            help="Free the base link: kernels take its pose, velocity and acceleration and have "
            "six rows for it before those of the joints. Gravity is in the world's frame.",
        ),
    ] = False,
    masses: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="TOML file of masses (link = kg) of links without <inertial>. Without it, a URDF "
            "without any <inertial> gets placeholders, which are no prior.",
            dir_okay=False,
        ),
    ] = None,
    densities: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="TOML file of densities (link = kg/m^3, default = kg/m^3 for all others) of links "
            "without <inertial>, whose bodies are computed from their closed meshes.",
            dir_okay=False,
        ),
    ] = None,
    mechanism: MechanismOption = None,
    arg: ArgumentOption = None,
    package: PackageOption = None,
    config: ConfigOption = None,
    level: Annotated[
        list[str] | None,
        typer.Option(
            help="Instruction set to compile for: v4 (AVX-512), v3 (AVX2), v2 (SSE), neon (ARM), "
            "portable, or casadi (reference code by CasADi); repeatable. Default: this processor's "
            "and portable, for bundled robots all; the best that the processor supports is chosen "
            "when the library is loaded."
        ),
    ] = None,
    all_levels: Annotated[
        bool,
        typer.Option(
            "--all-levels",
            help="Compile every level of this machine, for a library that others will load.",
        ),
    ] = False,
    watch_size: Annotated[
        bool,
        typer.Option(
            "--watch-size",
            help="Print operations, CPU time and memory to expect before the compilation starts.",
        ),
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Rebuild even if the folder is up to date.")
    ] = False,
    out: RootOption = DEFAULT_ROOT,
    overwrite: OverwriteOption = False,
) -> None:
    r"""Generate and compile the C library of a robot arm.

    Reads a URDF, derives the kernels (torques, regressor, base parameters, derivatives), writes
    them as C to OUT/NAME/ and compiles one library: of your own robot for the instruction set of
    this processor and a portable one, with --all-levels for every one of this machine.
    Nothing is done if the folder is up to date; the files of an earlier build are replaced.

    \b
    python -m symgen build                             the Franka Research 3
    python -m symgen build --urdf my.urdf --name my    your robot
    python -m symgen build --urdf my.urdf --name my --tip tool0 --gravity 0,9.81,0
    python -m symgen build --robot fr3 --name fr3_six --lock fr3_joint7=0
    """
    options = ChainOptions(
        base, tip, vector_of(gravity), read_locks(lock or []), snap, floating=floating
    )
    if description is not None:
        if urdf is not None:
            raise BuildError("--urdf and --description both name a robot; give one of them")
        urdf, name = published_urdf(description), name or description.lower()
    if urdf is None:
        if project or config or masses or densities or mechanism or arg or package:
            raise BuildError(
                "the options --project, --masses, --densities, --mechanism, --arg, --package and "
                "--config belong to your own robot; give its --urdf too"
            )
        request = bundled_request(robot)
        if options != ChainOptions() or name:
            request = changed_request(request, name, options)
    else:
        options = replace(
            options,
            masses=read_masses(masses) if masses else {},
            mechanism=read_mechanism(mechanism),
        )
        source = Source(urdf, read_arguments(arg or []), Packages(tuple(package or ())))
        request = request_from_urdf(source, name, options, project, config, densities)
    levels = levels_of(level, all_levels, request.name)
    with console.status(f"building {request.name}"), _without_collector():
        watch = (lambda cost: say(f"{request.name}: {cost}")) if watch_size else None
        result = build(request, out, force, levels, overwrite, watch)
    for note in result.notes:
        say(f"note: {note}")
    state = "built" if result.rebuilt else "up to date"
    say(f"{result.folder}: {state}")


@contextmanager
def _without_collector() -> Iterator[None]:
    """Expressions and statements stay to the end; passes of the collector free nothing."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def check_command(
    robot: Annotated[
        str | None, typer.Argument(help="Name of a robot. Default: all in the folder.")
    ] = None,
    out: RootOption = DEFAULT_ROOT,
) -> None:
    """Compare generated files with the C code that symgen writes today.

    Nothing is written. Differences are printed as a unified diff. Exit code: 0 equal, 1 different.
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
        say(f"{folder}: {state}")
    raise typer.Exit(int(bool(different)))


def clean_command(
    robot: Annotated[
        str | None, typer.Argument(help="Name of a robot. Default: all in the folder.")
    ] = None,
    out: RootOption = DEFAULT_ROOT,
) -> None:
    """Delete compiled libraries and generated folders.

    Of a bundled robot only the library is deleted, of your own robot the whole folder.
    """
    for folder in folders_of(out, robot):
        if folder.name in bundled_robots():
            for path in (folder / f"lib{folder.name}.so", folder / "build.json"):
                path.unlink(missing_ok=True)
        else:
            shutil.rmtree(folder)
        say(f"{folder}: clean")
