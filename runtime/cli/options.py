"""The options that `identify` and `compare` share, and what they mean."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from runtime.cli.common import console, numbers_option, preparation_of
from runtime.errors import IdentificationError
from runtime.friction import COLUMNS
from runtime.ladder import Choice, choose_friction
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording, Split, read_recording

AUTO = "auto"
"""Instead of columns: let the ladder choose them."""

Log = Annotated[
    str,
    typer.Argument(
        metavar="LOG",
        help="CSV, NPZ, a folder with a recipe, or a known data set such as panda_gaz.",
    ),
]
Recipe = Annotated[
    str | None, typer.Option(help="TOML with columns, units, order, sign, gears, filters.")
]
Run = Annotated[str | None, typer.Option(help="Which run, where a recipe has several.")]
FrictionNames = Annotated[
    str | None,
    typer.Option(
        help=f"auto (chosen by cross-validation, 'auto,rotor' adds a column), none, or a list "
        f"of {','.join(COLUMNS)}; default from the recipe."
    ),
]
CoulombSpeed = Annotated[
    float | None, typer.Option(help="Width of the smooth Coulomb sign, rad/s.")
]
Cutoff = Annotated[float | None, typer.Option(help="Low-pass q, dq, tau at this frequency, Hz.")]
Rate = Annotated[float | None, typer.Option(help="Decimate to this rate, Hz.")]
Parts = Annotated[
    str | None,
    typer.Option("--split", metavar="A,B", help="Train up to A, validate up to B of the duration."),
]
LoopFile = Annotated[
    Path | None,
    typer.Option(
        help="TOML with the controller's gains and the reference motion, for iv and didim; "
        "simulate writes one."
    ),
]


@dataclass(frozen=True, slots=True)
class Data:
    """A recording with how to prepare, split and model it, as asked for.

    Attributes:
        notes: sentences about what was chosen.
    """

    recording: Recording
    preparation: Preparation | None
    splitting: Split | None
    friction: Friction | None
    notes: tuple[str, ...] = ()


def read_data(
    lib: Library,
    log: str,
    *,
    recipe: str | None,
    run: str | None,
    friction: str | None,
    coulomb_speed: float | None,
    cutoff: float | None,
    rate: float | None,
    split: str | None,
) -> Data:
    """Read the log, and climb the ladder of friction where that is asked for.

    Raises:
        RuntimeFault: the log or an option is none.
    """
    recording = read_recording(log, recipe, run)
    prepared, parts = preparation_of(recording, cutoff, rate), _split(split)
    terms = friction_of(recording, friction, coulomb_speed)
    if terms is None or terms.columns[:1] != (AUTO,):
        return Data(recording, prepared, parts, terms)
    with console.status("choosing a friction model"):
        choice = choose_friction(
            recording, lib, prepared, parts, coulomb_speed, extra=terms.columns[1:]
        )
    console.print(_ladder_table(choice))
    return Data(recording, prepared, parts, choice.chosen.terms, (choice.sentence,))


def listed(text: str, known: Sequence[str], option: str) -> tuple[str, ...]:
    """Names with commas, each known, none twice.

    Raises:
        IdentificationError: something else was given.
    """
    names = tuple(dict.fromkeys(word.strip() for word in text.split(",")))
    wrong = [name for name in names if name not in known]
    if wrong:
        raise IdentificationError(
            f"{option} needs names with commas of {', '.join(known)}; got '{text}'"
        )
    return names


def friction_of(recording: Recording, names: str | None, speed: float | None) -> Friction | None:
    """The terms that --friction and --coulomb-speed ask for, else those of the recipe."""
    default = recording.recipe.friction if recording.recipe else None
    if names is None and speed is None:
        return default
    known = default or Friction(columns=())
    columns, width = known.columns, known.coulomb_speed if speed is None else speed
    if names is not None:
        columns = () if names == "none" else tuple(names.split(","))
    return dataclasses.replace(known, columns=columns, coulomb_speed=width)


def _ladder_table(choice: Choice) -> Table:
    table = Table("friction model", title="Friction ladder: cross-validated error over noise")
    for head in ("score", "above the best", "AIC", "unknowns"):
        table.add_column(head, justify="right")
    for rung in choice.rungs:
        table.add_row(
            f"{'→ ' if rung is choice.chosen else ''}{rung.name}: {rung.terms}",
            f"{rung.score:.3f}",
            f"{rung.excess:.3f} ± {rung.excess_error:.3f}",
            f"{rung.aic:.1f}",
            str(rung.parameters),
        )
    return table


def _split(text: str | None) -> Split | None:
    if text is None:
        return None
    a, b = numbers_option(text, 2, "--split")
    if not 0 < a < b < 1:
        raise IdentificationError(f"--split needs 0 < A < B < 1, got '{text}'")
    return Split((0.0, a), (a, b), (b, 1.0))
