"""`symgen gains`."""

import dataclasses
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Column, Table

from runtime.cli.common import Robot, command_line, console, say
from runtime.cli.log_options import CarryingLink, CoulombSpeed, Rate, Recipe, Run
from runtime.cli.prepared_log import friction_of, preparation_of
from runtime.errors import RecordingError
from runtime.files import replacing
from runtime.identification.payload import read_known_payload
from runtime.identification.payload.output import NORMAL_95
from runtime.identification.sensor_gains import Gains, identify_gains
from runtime.library import load
from runtime.recording import Recipe as Plan
from runtime.recording import plan_of, read_recording, recipe_text

_UNTOLD = 100.0
"""Half an interval in N·m from which on it is no statement."""


def gains_command(
    empty: Annotated[str, typer.Argument(metavar="EMPTY", help="A recording without payload.")],
    loaded: Annotated[str, typer.Argument(metavar="LOADED", help="One with the known payload.")],
    payload: Annotated[
        str,
        typer.Option(
            metavar="KNOWN",
            help="MASS,CX,CY,CZ (kg, m from the flange), with IXX,IYY,IZZ,IXY,IXZ,IYZ about the "
            "centre of mass where they are known, or a JSON like payload.json.",
        ),
    ],
    robot: Robot = "fr3",
    link: CarryingLink = None,
    friction: Annotated[
        str | None,
        typer.Option(
            help="none, or names with commas; default from the recipe, else viscous,coulomb."
        ),
    ] = None,
    coulomb_speed: CoulombSpeed = None,
    recipe: Recipe = None,
    run: Run = None,
    loaded_run: Annotated[str | None, typer.Option(help="Which run is the loaded one.")] = None,
    cutoff: Annotated[float | None, typer.Option(help="Low-pass in Hz; the recipe's.")] = None,
    rate: Rate = None,
    recipe_out: Annotated[
        Path | None, typer.Option(help="Write the recipe with these gains, for identify --recipe.")
    ] = None,
) -> None:
    r"""Identify gain and bias of every torque sensor or drive.

    \b
    symgen gains empty.csv loaded.csv --robot fr3 --payload 3.021,0,0,0.045
    symgen gains empty.csv loaded.csv --payload payload.json --recipe-out recipe.toml
    symgen identify log.csv --recipe recipe.toml

    Record any exciting motion without and with a payload of known mass and centre of mass, the
    heavier the better. Gains, biases, friction and the arm's parameters are found together; a gain
    that is not told to 10 % is left as it is. For currents, write unit = "A" and gain = 1.0 into
    the recipe: the gains are then in N·m/A.
    """
    lib = load(robot)
    known = read_known_payload(payload)
    bare = read_recording(empty, recipe, run, lib.joint_names)
    full = read_recording(loaded, recipe, loaded_run or run, lib.joint_names)
    found = identify_gains(
        bare,
        full,
        lib,
        known,
        link,
        friction=friction_of(bare, friction, coulomb_speed),
        preparation=preparation_of(bare, cutoff, rate),
    )
    plan = plan_of(empty, recipe, run)
    factors = _factors(plan, found)
    console.print(_table(found, plan, factors))
    say(f"status: {found.status}")
    say(f"{found.n_samples} samples count as {found.n_effective:.0f} independent ones")
    for note in found.notes:
        say(f"note: {note}")
    say("note: a bias cannot be told from friction that differs between the directions; identify's "
        "column offset takes up both, the recipe takes the gains alone")  # fmt: skip
    if recipe_out is None:
        say(f"recipe: [torque] gain = [{', '.join(map(repr, factors))}]")
        return
    with replacing(recipe_out) as file:
        file.write(_recipe(plan, found, factors).encode())
    say(f"recipe: {recipe_out}")


def _factors(plan: Plan, found: Gains) -> tuple[float, ...]:
    """The recipe's gains, which turn what the file says into true torque: those before over g."""
    if plan.torque is None:
        raise RecordingError("the log has no torque, so that no recipe can scale it")
    before = 1.0 if plan.torque.gain is None else np.array(plan.torque.gain)
    return tuple(float(x) for x in np.broadcast_to(before, found.gain.shape) / found.gain)


def _recipe(plan: Plan, found: Gains, factors: tuple[float, ...]) -> str:
    torque = dataclasses.replace(plan.signals()["torque"], gain=factors)
    biases = [", ".join(f"{x:.4g}" for x in row) for row in found.bias]
    return recipe_text(
        dataclasses.replace(plan, torque=torque),
        f"Gains of torque: {found.status}.",
        f"Biases, not taken off: {biases[0]} N·m empty, {biases[1]} N·m loaded.",
        command_line(),
    )


def _table(found: Gains, plan: Plan, factors: tuple[float, ...]) -> Table:
    units = plan.signals()["torque"].unit
    units = (units,) * len(factors) if isinstance(units, str) else units
    table = Table(Column("joint", overflow="fold"), title="Torque read over true torque")
    for head in ("gain ± 95 %", "bias empty", "bias loaded"):
        table.add_column(head, justify="right")
    table.add_column("reads")
    for j, name in enumerate(found.channels):
        told = _interval(found.estimate[j], found.sigma[j], 4) if found.is_determined[j] else "-"
        biases = [_interval(found.bias[k, j], found.bias_sigma[k, j], 3) for k in range(2)]
        table.add_row(name, told, *biases, _meaning(found, j, units[j], factors[j]))
    return table


def _interval(value: float, sigma: float, digits: int) -> str:
    """A value with its 95 % interval; nothing where that says nothing."""
    half = NORMAL_95 * sigma
    return f"{value:.{digits}f} ± {half:.{digits}f}" if half < _UNTOLD else "-"


def _meaning(found: Gains, j: int, unit: str, factor: float) -> str:
    if not found.is_determined[j]:
        return "not told"
    if unit.endswith("A"):
        return f"{factor:.4g} N·m/A"
    percent = 100 * (found.gain[j] - 1)
    if abs(found.gain[j] - 1) < NORMAL_95 * found.sigma[j]:
        return "true within ±"
    return f"{abs(percent):.1f} % {'high' if percent > 0 else 'low'}"
