"""Command `inspect`: a model file in; a table, sentences and an exit code out."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from runtime.common.files import json_text, require_unused, write_text
from runtime.common.settings import Choices, argument_field, data_field, method_field, output_field
from runtime.common.tables import Table, significant
from runtime.common.terminal import VERBOSE, say, show
from symgen.cli.common import ArgumentOption, ModelOption, OverwriteOption, read_arguments
from symgen.inspect.inspection import INERTIAL, Inspection, facts, inspect_file, repaired
from symgen.inspect.model import ERROR
from symgen.inspect.repair import Repair


@dataclass(frozen=True, slots=True, kw_only=True)
class InspectSettings(Choices):
    """Settings of `symgen inspect`."""

    options = "as_json strict repair overwrite robot_model"
    model: Path = argument_field(help="URDF, xacro, MJCF, SDF or TOML of DH rows.")
    as_json: bool = output_field(False, "--json", help="Print JSON.")
    strict: bool = output_field(False, help="Exit code 1 for warnings too.")
    repair: Path | None = method_field(
        help="Write a physically consistent URDF with the same joint torques to this file."
    )
    overwrite: OverwriteOption = False
    package_dir: list[Path] | None = data_field(
        help="Folder in which package:// meshes are searched; repeatable."
    )
    arg: ArgumentOption = None
    robot_model: ModelOption = None


def inspect_command(given: InspectSettings) -> None:
    r"""Check the inertial parameters of a robot model.

    \b
    python -m symgen inspect "$(symgen locate fr3)/fr3.urdf"
    python -m symgen inspect my.urdf
    python -m symgen inspect my.urdf --strict --json    (in a pipeline)
    python -m symgen inspect my.urdf --repair better.urdf

    The page of a log: symgen inspect LOG --help.

    Errors are physically impossible: a negative mass, a principal moment larger than the sum of the
    other two, negative friction. Warnings are possible but rarely intended: a density above osmium
    or below foam, copied inertias, signs that contradict those of a mirrored link, a shifted
    decimal point, inertia about the link origin, missing limits.

    The table lists per link mass, centre of mass, principal moments, slack J1 + J2 − J3 of the
    triangle inequality, smallest eigenvalue of the pseudo-inertia P, the same relative to its
    trace, and density.

    --repair changes inertias (and if necessary centres of mass, never masses) to the nearest
    consistent ones with the same joint torques. If there are none, the torques change as little as
    possible, and the change is reported.

    Exit code: 0 no findings, 1 errors (with --strict also warnings), 2 unreadable file.
    """
    packages, arguments = tuple(given.package_dir or ()), read_arguments(given.arg or [])
    inspection = inspect_file(given.model, packages, True, arguments, given.robot_model)
    result: dict[str, Any] = facts(inspection)
    if not given.as_json:
        _show(inspection)
    if given.repair is not None:
        result["repair"] = _repair(
            inspection, given.model, given.repair, given.overwrite, given.as_json
        )
    if given.as_json:
        print(json_text(result, allow_nan=True), end="")
    raise typer.Exit(int(bool(inspection.findings if given.strict else inspection.errors)))


def _show(inspection: Inspection) -> None:
    model = inspection.model
    heads = ("mass", "centre of mass", "principal moments", "slack", "λmin(P)", "/ tr", "kg/m³")
    rows = tuple(
        (
            row.link,
            f"{row.body.mass:.4g}",
            " ".join(f"{1e3 * x:.1f}" for x in row.body.com),
            " ".join(f"{x:.3g}" for x in row.body.moments),
            f"{row.body.slack:.2g}",
            f"{row.smallest:.2g}",
            f"{row.relative:.1g}",
            "-" if row.density is None else f"{row.density:.0f}",
        )
        for row in inspection.rows
    )
    show(Table(("link", *heads), rows, title=f"{model.name} ({model.form}): kg, mm, kg m²"))
    base = inspection.base
    if base is not None:
        say(f"{len(base.names)} base parameters, condition {base.condition:.3g} at random states")
        for k, name in enumerate(base.names if VERBOSE.get() else (), 1):
            say(f"  {k} {name}")
    for note in inspection.notes:
        say(f"note: {note}")
    for finding in inspection.findings:
        say(f"{finding.severity}: {finding.sentence}")
    errors = len(inspection.errors)
    say(f"{errors} error(s), {len(inspection.findings) - errors} warning(s)")


def _repair(
    inspection: Inspection, model: Path, out: Path, overwrite: bool, quiet: bool
) -> dict[str, Any]:
    """Write the repaired file if there is anything to repair; return the facts."""
    report = (lambda _: None) if quiet else say
    if not any(f.kind in INERTIAL for f in inspection.errors):
        left = [f for f in inspection.errors if f.where.startswith("link ")]
        report(
            f"repair: nothing was written; correct by hand: {left[0].sentence}"
            if left
            else "repair: all inertias are physically consistent, nothing was written"
        )
        return {"written": None, "moved": []}
    require_unused([out], overwrite, None)  # before the work, not after it
    text, changes, again = repaired(inspection, model)
    write_text(out, text)
    if not quiet:
        show(_moves(inspection, changes))
    _report(inspection, changes, report)
    report(f"repair: wrote '{out}', checked again: {len(again.errors)} error(s) left")
    return {
        "written": str(out),
        "keeps_base_parameters": changes.kept,
        "relative_torque_change": changes.torque_change,
        "moved": sorted(changes.bodies),
        "errors_left": [f.sentence for f in again.errors if f.severity == ERROR],
    }


def _report(inspection: Inspection, changes: Repair, report: Any) -> None:
    if inspection.base is None:
        report(
            "repair: without base parameters each link was projected separately, so torques change"
        )
    elif changes.kept:
        report("repair: all base parameters are kept, so the joint torques are unchanged")
    else:
        report(
            "repair: no consistent bodies have these base parameters; the torques change by "
            f"{significant(100 * changes.torque_change)} % (root mean square, each relative to "
            "its joint)"
        )


def _moves(inspection: Inspection, changes: Repair) -> Table:
    rows = []
    for name, new in changes.bodies.items():
        old = inspection.model.links[name].body
        if old is not None:
            moments = [" ".join(f"{x:.3g}" for x in body.moments) for body in (old, new)]
            moved = f"{1e3 * float(np.linalg.norm(new.com - old.com)):.3g}"
            rows.append((name, moved, *moments, f"{old.slack:.2g}", f"{new.slack:.2g}"))
    head = ("principal moments before", "after", "slack before", "after")
    title = "repair: changes (masses are kept)"
    return Table(("link", "centre of mass moved, mm", *head), tuple(rows), title=title)
