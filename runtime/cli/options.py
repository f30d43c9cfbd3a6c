"""The options on logs that several commands share, and what they mean."""

import dataclasses
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from runtime.cli.common import console, numbers_option, preparation_of
from runtime.errors import IdentificationError, RecordingError
from runtime.identification.long_logs import head_of
from runtime.inspection.cutoff_choice import CutoffChoice, choose_cutoff
from runtime.inspection.friction_choice import FrictionChoice, choose_friction
from runtime.inspection.regressor_choice import choose_regressor
from runtime.library import Library
from runtime.recording import (
    REGRESSORS,
    Friction,
    Preparation,
    Recording,
    Split,
    StreamedRecording,
    is_large,
    open_streamed,
    read_recording,
)
from runtime.recording.friction import COLUMNS

AUTO = "auto"
"""Instead of columns or a cut-off: let the data choose."""
_ANY_HZ = 1.0
"""Stands for the cut-off that is still to be chosen."""

Log = Annotated[
    str,
    typer.Argument(
        metavar="LOG",
        help="CSV, NPZ, Parquet, MCAP, a ROS bag, a folder with a recipe, or a known data set "
        "such as panda_gaz.",
    ),
]
Recipe = Annotated[
    str | None, typer.Option(help="TOML with columns, units, order, sign, gears, filters.")
]
Run = Annotated[str | None, typer.Option(help="Which run, where a recipe has several.")]
FrictionNames = Annotated[
    str | None,
    typer.Option(
        help=f"auto (chosen by cross-validation, 'auto,rotor' adds a column), none, or with commas "
        f"some of {', '.join(COLUMNS)}; default from the recipe, else none."
    ),
]
CoulombSpeed = Annotated[
    float | None,
    typer.Option(
        help="Width of the smooth Coulomb sign, rad/s; default from the recipe, else "
        f"{Friction(columns=()).coulomb_speed:g}."
    ),
]
Cutoff = Annotated[
    str | None,
    typer.Option(
        metavar="HZ|auto",
        help="Low-pass q, dq, tau at this frequency, Hz; auto lets cross-validation choose; "
        "default from the recipe, else no filter.",
    ),
]
CarryingLink = Annotated[
    str | None, typer.Option("--link", help="Link that carries it; default the link of the tip.")
]
Regressor = Annotated[
    str | None,
    typer.Option(
        metavar="|".join((*REGRESSORS, AUTO)),
        help="momentum needs no ddq: its rows are low-passed after all products; energy is weaker, "
        "one row for all joints; auto takes momentum where differentiation fails, and says so. "
        "Default from the recipe.",
    ),
]
Rate = Annotated[
    float | None,
    typer.Option(help="Decimate to this rate, Hz; default from the recipe, else every sample."),
]
Parts = Annotated[
    str | None,
    typer.Option(
        "--split",
        metavar="A,B",
        help="Train up to A, validate up to B of the duration, test on the rest; default from the "
        "recipe, else 0.48,0.6.",
    ),
]
Stream = Annotated[
    bool | None,
    typer.Option(
        "--stream/--no-stream",
        help="Leave the log in its file and pass over it block by block; default for NPZ, "
        "Parquet, CSV and bags above 200 MB.",
    ),
]
ControllerFile = Annotated[
    Path | None,
    typer.Option(
        help="TOML with the controller's gains and the reference motion, which the methods iv and "
        "didim need; simulate writes one as LOG.loop.toml."
    ),
]


@dataclass(frozen=True, slots=True)
class Asked:
    """What the options say about a log; None is nothing.

    Attributes:
        stream: leave it in its file; None does so where it is large.
    """

    recipe: str | None = None
    run: str | None = None
    friction: str | None = None
    coulomb_speed: float | None = None
    cutoff: str | None = None
    rate: float | None = None
    split: str | None = None
    stream: bool | None = False
    regressor: str | None = None


@dataclass(frozen=True, slots=True)
class Data:
    """A recording with how to prepare, split and model it, as asked for.

    Attributes:
        notes: sentences about what was chosen.
        streamed: the log in its file, of which `recording` is the head.
    """

    recording: Recording
    preparation: Preparation | None
    splitting: Split | None
    friction: Friction | None
    notes: tuple[str, ...] = ()
    streamed: StreamedRecording | None = None


def read_data(lib: Library, log: str, asked: Asked) -> Data:
    """Read the log; choose the cut-off and climb the ladder of friction where that is asked for.

    The accelerations are judged, and the sentence about them is among the notes.

    Raises:
        RuntimeFault: the log or an option is none.
    """
    streamed = _streamed(lib, log, asked)
    if streamed is not None:
        recording = head_of(streamed)
    else:
        recording = read_recording(log, asked.recipe, asked.run, lib.joint_names)
    parts = _split(asked.split)
    terms = friction_of(recording, asked.friction, asked.coulomb_speed)
    climbs = terms is not None and terms.columns[:1] == (AUTO,)
    if streamed is not None and (climbs or asked.cutoff == AUTO):
        raise IdentificationError(
            "a cut-off or a friction model is chosen on a log that is read as a whole, but this "
            "one is streamed; give --cutoff and --friction themselves, or use --no-stream"
        )
    notes: tuple[str, ...] = ()
    form = None if asked.regressor == AUTO else asked.regressor
    prepared = preparation_of(recording, _hz(asked.cutoff), asked.rate, form)
    if asked.cutoff == AUTO:
        base = preparation_of(recording, _ANY_HZ, asked.rate, form)
        with console.status("choosing a cut-off"):
            found = choose_cutoff(recording, lib, base, parts, None if climbs else terms)
        console.print(_cutoff_table(found))
        prepared, notes = found.preparation, (found.sentence,)
    with console.status("judging the accelerations"):
        prepared, told = choose_regressor(recording, lib, prepared, asked.regressor == AUTO)
    notes += told
    if terms is None or not climbs:
        return Data(recording, prepared, parts, terms, notes, streamed=streamed)
    with console.status("choosing a friction model"):
        choice = choose_friction(
            recording, lib, prepared, parts, asked.coulomb_speed, extra=terms.columns[1:]
        )
    console.print(_ladder_table(choice))
    return Data(recording, prepared, parts, choice.chosen.terms, (*notes, choice.sentence))


def _streamed(lib: Library, log: str, asked: Asked) -> StreamedRecording | None:
    """The log in its file, where that was asked for, or is possible and worth while."""
    if asked.stream:
        return open_streamed(log, asked.recipe, asked.run, lib.joint_names)
    if asked.stream is None and is_large(log):
        with suppress(RecordingError):  # compressed, or no log at all, as reading it will tell
            return open_streamed(log, asked.recipe, asked.run, lib.joint_names)
    return None


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


def _hz(text: str | None) -> float | None:
    """The number of --cutoff; None where there is none to take from it."""
    if text is None or text == AUTO:
        return None
    try:
        return float(text)
    except ValueError:
        raise IdentificationError(
            f"--cutoff needs a frequency in Hz or auto, got '{text}'"
        ) from None


def _cutoff_table(choice: CutoffChoice) -> Table:
    table = Table("cut-off", title="Cut-off: cross-validated error on the unfiltered torque")
    for head in ("velocity", "score", "above the best", "independent rows"):
        table.add_column(head, justify="right")
    for c in choice.candidates:
        table.add_row(
            f"{'→ ' if c is choice.chosen else ''}{c.cutoff_hz:g} Hz",
            {"measured": "measured", "position": "from q"}[c.derivative],
            f"{c.score:.3f}",
            f"{c.excess:.3f} ± {c.excess_error:.3f}",
            f"{100 * c.white:.0f} %",
        )
    return table


def _ladder_table(choice: FrictionChoice) -> Table:
    table = Table("friction model", title="Friction ladder: cross-validated error over noise")
    for head in ("score", "above the best", "AIC", "unknowns"):
        table.add_column(head, justify="right")
    for candidate in choice.candidates:
        table.add_row(
            f"{'→ ' if candidate is choice.chosen else ''}{candidate.name}: {candidate.terms}",
            f"{candidate.score:.3f}",
            f"{candidate.excess:.3f} ± {candidate.excess_error:.3f}",
            f"{candidate.aic:.1f}",
            str(candidate.parameters),
        )
    return table


def _split(text: str | None) -> Split | None:
    if text is None:
        return None
    a, b = numbers_option(text, 2, "--split")
    if not 0 < a < b < 1:
        raise IdentificationError(f"--split needs 0 < A < B < 1, got '{text}'")
    return Split((0.0, a), (a, b), (b, 1.0))
