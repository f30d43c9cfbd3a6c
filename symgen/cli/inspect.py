"""`python -m symgen inspect`: a model file in, a table, sentences and an exit code out."""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Column, Table

from symgen.cli.common import app, console
from symgen.errors import BuildError
from symgen.inspect import (
    ERROR,
    Inspection,
    Repair,
    facts,
    inspect_file,
    repaired,
    write_text,
)
from symgen.inspect.inspection import INERTIAL


@app.command("inspect")
def inspect_command(
    model: Annotated[Path, typer.Argument(help="URDF, expanded xacro, or MJCF.")],
    as_json: Annotated[bool, typer.Option("--json", help="Everything as JSON.")] = False,
    strict: Annotated[bool, typer.Option("--strict", help="Warnings count as well.")] = False,
    repair: Annotated[
        Path | None,
        typer.Option(help="Write a URDF here whose inertias can exist, for the same torques."),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Let --repair replace a file that exists.")
    ] = False,
    package_dir: Annotated[
        list[Path] | None,
        typer.Option(help="Folder that holds a package:// of the meshes; repeatable."),
    ] = None,
) -> None:
    r"""Check the inertial parameters of a robot model.

    Errors cannot exist: a mass below zero, a principal moment larger than the sum of the other
    two, friction that drives. Warnings can, but are seldom meant: matter denser than osmium or
    lighter than foam, copied inertias, a sign that its mirrored sister contradicts, a decimal
    point that slipped, inertia about the link origin, missing limits.

    --repair moves the inertias (and where it must, centres of mass, never masses) to the nearest
    ones that exist and give the same torques; where none do, the torques change as little as
    possible, and it says how much.

    \b
    python -m symgen inspect my.urdf
    python -m symgen inspect my.urdf --strict --json    (for a pipeline)
    python -m symgen inspect my.urdf --repair better.urdf
    Exit code: 0 fine, 1 findings (errors; with --strict warnings too), 2 not readable.
    """
    inspection = inspect_file(model, tuple(package_dir or ()))
    result: dict[str, Any] = facts(inspection)
    if not as_json:
        _show(inspection)
    if repair is not None:
        result["repair"] = _repair(inspection, model, repair, overwrite, as_json)
    if as_json:
        print(json.dumps(result, indent=1))
    raise typer.Exit(int(bool(inspection.findings if strict else inspection.errors)))


def _say(text: str) -> None:
    console.print(text, highlight=False, soft_wrap=True, markup=False)


def _show(inspection: Inspection) -> None:
    model = inspection.model
    table = Table(
        Column("link", overflow="fold"), title=f"{model.name} ({model.form}): kg, mm, kg m²"
    )
    for head in (
        "mass",
        "centre of mass",
        "principal moments",
        "slack",
        "λmin(P)",
        "/ tr",
        "kg/m³",
    ):
        table.add_column(head, justify="right")
    for row in inspection.rows:
        body = row.body
        table.add_row(
            row.link,
            f"{body.mass:.4g}",
            " ".join(f"{1e3 * x:.1f}" for x in body.com),
            " ".join(f"{x:.3g}" for x in body.moments),
            f"{body.slack:.2g}",
            f"{row.smallest:.2g}",
            f"{row.relative:.1g}",
            "-" if row.density is None else f"{row.density:.0f}",
        )
    console.print(table)
    base = inspection.base
    if base is not None:
        _say(f"{len(base.names)} base parameters, condition {base.condition:.3g} at random states:")
        for k, name in enumerate(base.names, 1):
            _say(f"  {k} {name}")
    for note in inspection.notes:
        _say(f"note: {note}")
    for finding in inspection.findings:
        _say(f"{finding.severity}: {finding.sentence}")
    errors = len(inspection.errors)
    _say(f"{errors} error(s), {len(inspection.findings) - errors} warning(s)")


def _repair(
    inspection: Inspection, model: Path, out: Path, overwrite: bool, quiet: bool
) -> dict[str, Any]:
    """Write the repaired file unless there is nothing to repair; returns what happened."""
    say = (lambda _: None) if quiet else _say
    if not any(f.kind in INERTIAL for f in inspection.errors):
        say("repair: no inertia of this file is impossible, so nothing was written")
        return {"written": None, "moved": []}
    if out.exists() and not overwrite:  # said before the work, not after it
        raise BuildError(f"'{out}' exists; name another file, or allow it with --overwrite")
    text, found, again = repaired(inspection, model)
    write_text(out, text, overwrite)
    if not quiet:
        console.print(_moves(inspection, found))
    _report(inspection, found, say)
    say(f"repair: wrote '{out}', read it again: {len(again.errors)} error(s) left")
    return {
        "written": str(out),
        "keeps_base_parameters": found.kept,
        "relative_torque_change": found.torque_change,
        "moved": sorted(found.bodies),
        "errors_left": [f.sentence for f in again.errors if f.severity == ERROR],
    }


def _report(inspection: Inspection, found: Repair, say: Any) -> None:
    if inspection.base is None:
        say("repair: without base parameters every link was projected on its own, torques change")
    elif found.kept:
        say("repair: all base parameters are kept, so every torque is the same as before")
    else:
        say(
            "repair: no consistent body has these base parameters; the smallest change was sought, "
            f"and torques change by {100 * found.torque_change:.2g} % (root mean square, each "
            "joint by its own)"
        )


def _moves(inspection: Inspection, found: Repair) -> Table:
    table = Table("link", "centre of mass by, mm", title="repair: what moved (no mass did)")
    for head in ("principal moments before", "after", "slack before", "after"):
        table.add_column(head, justify="right")
    for name, new in found.bodies.items():
        old = inspection.model.links[name].body
        if old is not None:
            moments = [" ".join(f"{x:.3g}" for x in body.moments) for body in (old, new)]
            table.add_row(
                name,
                f"{1e3 * float(np.linalg.norm(new.com - old.com)):.3g}",
                *moments,
                f"{old.slack:.2g}",
                f"{new.slack:.2g}",
            )
    return table
