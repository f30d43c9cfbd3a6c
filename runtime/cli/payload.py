"""`symgen payload`."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from runtime.cli.common import Robot, command_line, console, say
from runtime.cli.log_options import CarryingLink, Rate, Recipe, Run
from runtime.cli.prepared_log import preparation_of
from runtime.identification.payload import (
    Payload,
    arm_model,
    identify_payload,
    load_facts,
    read_arm_model,
    write_payload,
)
from runtime.identification.payload.body import NAMES
from runtime.identification.payload.output import NORMAL_95
from runtime.library import load
from runtime.recording import read_recording

_UNITS = ("kg", *("m",) * 3, *("kg·m²",) * 6)


def payload_command(
    log: Annotated[
        str, typer.Argument(metavar="LOG", help="A recording with the payload, as for identify.")
    ],
    robot: Robot = "fr3",
    link: CarryingLink = None,
    empty: Annotated[
        str | None,
        typer.Option(
            metavar="LOG0", help="The same motion without it: friction and bias cancel, whatever."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            help="Folder that identify wrote of the empty arm; default the URDF, no friction."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the result; default results/LOG-payload.")
    ] = None,
    recipe: Recipe = None,
    run: Run = None,
    empty_run: Annotated[str | None, typer.Option(help="Which run is the empty one.")] = None,
    cutoff: Annotated[
        float | None, typer.Option(help="Low-pass q, dq, tau at this frequency, Hz.")
    ] = None,
    rate: Rate = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print payload.json only.")] = False,
) -> None:
    r"""Identify mass, centre of mass and inertia of a payload.

    \b
    symgen payload loaded.csv --robot fr3 --link fr3_link7 --empty empty.csv
    symgen payload loaded.csv --robot fr3 --model results/first-map --cutoff 10

    Best: record one motion twice, with and without the payload, and give both (--empty). The wrist
    has to turn the payload against gravity; ten seconds weigh 1 kg to half a gram where the torque
    is good to 0.05 N·m. The values hold in the flange's frame where the link carries the flange.

    Written: payload.json (values, σ, intervals), set_load.json (arguments of libfranka's setLoad),
    endeffector-config.json (Franka Desk) and payload.urdf (a link to append).
    """
    lib = load(robot)
    loaded = read_recording(log, recipe, run, lib.joint_names)
    joints = lib.joint_names
    bare = read_recording(empty, recipe, empty_run or run, joints) if empty else None
    found = identify_payload(
        loaded,
        lib,
        link,
        arm=read_arm_model(model, lib) if model else arm_model(lib),
        empty=bare,
        preparation=preparation_of(loaded, cutoff, rate),
    )
    folder = out or Path("results") / f"{Path(log).stem}-payload"
    paths = write_payload(found, lib, folder, command_line())
    if as_json:
        print(json.dumps(load_facts(found, lib), indent=1, ensure_ascii=False))
        return
    console.print(_table(found))
    say(f"status: {found.status}")
    way = "against the empty run" if found.differential else f"arm: {found.arm}"
    say(f"{way}; {found.n_samples} samples count as {found.n_effective:.0f} independent ones")
    for note in found.notes:
        say(f"note: {note}")
    say(f"written: {', '.join(map(str, paths))}")


def _table(found: Payload) -> Table:
    title = f"Payload on {found.mount.link}, in the frame of {found.mount.frame}"
    table = Table("value", title=title)
    for head in ("found", "± 95 %", "± 95 % if white", "unit", ""):
        table.add_column(head, justify="left" if head in {"unit", ""} else "right")
    body, white = found.body, found.white
    for k, (name, unit) in enumerate(zip(NAMES, _UNITS, strict=True)):
        table.add_row(
            name,
            f"{body.values[k]:.6g}",
            f"{NORMAL_95 * body.sigma[k]:.2g}",
            f"{NORMAL_95 * white.sigma[k]:.2g}",
            unit,
            "the prior's" if name in found.prior_dominated else "",
        )
    return table
