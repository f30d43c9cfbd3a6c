"""`python -m runtime export`."""

from pathlib import Path
from typing import Annotated

import typer

from runtime.cli.common import say
from runtime.cli.options import listed
from runtime.errors import ExportError
from runtime.identification.saved_result import read_result, require_model
from runtime.library import load
from runtime.outputs.model_files import FORMATS, export_model


def export_command(
    result: Annotated[Path, typer.Argument(help="Folder that identify wrote.")],
    to: Annotated[
        str | None, typer.Option(metavar="A,B,…", help=f"Some of {', '.join(FORMATS)}; else all.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder; default RESULT/export.")] = None,
    robot: Annotated[
        str | None, typer.Option(help="Name or folder of the robot; default: the result's.")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace files that are there.")
    ] = False,
) -> None:
    r"""Write an identified model for simulators and controllers.

    \b
    python -m runtime export results/log-map
    python -m runtime export results/log-map --to urdf,mjcf --out robots/mine

    urdf, mjcf (MuJoCo), sdf (Gazebo, Drake), inertials and friction (inertials.yaml and
    dynamics.yaml as in franka_description), header (C arrays). Each file is read again by the
    program that it is for, and kept if that gives the library's torques at 1000 random states.
    """
    kinds = listed(to, tuple(FORMATS), "--to") if to else tuple(FORMATS)
    saved = read_result(result)
    lib = load(robot or saved.robot)
    notes = require_model(saved, lib, result, same_bodies=True)
    terms, folder = saved.friction, out or result / "export"
    done = export_model(
        lib, saved.pi, kinds, folder, terms=terms, phi=saved.phi, overwrite=overwrite
    )
    for each in done:
        say(f"{each.kind}: {f'{each.path} ({each.sentence})' if each.path else each.sentence}")
    for note in notes:
        say(f"note: {note}")
    if saved.net is not None:
        say("note: the friction network of the method nn has no counterpart in any of these")
    failed = [each.kind for each in done if each.path is None]
    # Without friction there is no file of friction, which is no failure unless it was asked for.
    if failed and (to or failed != ["friction"]):
        raise ExportError(f"{len(failed)} of {len(done)} not written: {', '.join(failed)}")
