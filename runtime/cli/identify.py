"""`python -m runtime identify`."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from runtime.baselines import INPUTS
from runtime.cli.common import (
    Robot,
    Seed,
    command_line,
    console,
    numbers_option,
    preparation_of,
    say,
    torque_table,
)
from runtime.errors import IdentificationError
from runtime.export import write_urdf
from runtime.fitting import PRESETS
from runtime.friction import COLUMNS
from runtime.identification import Identification, identify
from runtime.ladder import Choice, choose_friction
from runtime.library import Library, load
from runtime.loop import read_loop
from runtime.methods import METHODS
from runtime.prior_file import read_prior
from runtime.recording import Friction, Recording, Split, read_recording
from runtime.results import write_result

AUTO = "auto"
"""Instead of columns: let the ladder choose them."""


def identify_command(
    log: Annotated[
        str,
        typer.Argument(
            metavar="LOG",
            help="CSV, NPZ, a folder with a recipe, or a known data set such as panda_gaz.",
        ),
    ],
    robot: Robot = "fr3",
    method: Annotated[
        str | None,
        typer.Option(help=f"{' | '.join(METHODS)}; default map, with a preset adam."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the result; default results/LOG-METHOD.")
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help=f"Settings of adam: {' | '.join(PRESETS)}; simulation and real are the "
            "document's Tables 5.1 and 5.8, full takes all samples at every step."
        ),
    ] = None,
    prior: Annotated[
        Path | None,
        typer.Option(help="TOML: trust in the URDF, masses, centres of mass, symmetries."),
    ] = None,
    recipe: Annotated[
        str | None, typer.Option(help="TOML with columns, units, order, sign, gears, filters.")
    ] = None,
    run: Annotated[str | None, typer.Option(help="Which run, where a recipe has several.")] = None,
    friction: Annotated[
        str | None,
        typer.Option(
            help=f"auto (chosen by cross-validation, 'auto,rotor' adds a column), none, or a list "
            f"of {','.join(COLUMNS)}; default from the recipe."
        ),
    ] = None,
    coulomb_speed: Annotated[
        float | None, typer.Option(help="Width of the smooth Coulomb sign, rad/s.")
    ] = None,
    cutoff: Annotated[
        float | None, typer.Option(help="Low-pass q, dq, tau at this frequency, Hz.")
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Decimate to this rate, Hz.")] = None,
    split: Annotated[
        str | None,
        typer.Option(metavar="A,B", help="Train up to A, validate up to B of the duration."),
    ] = None,
    loop: Annotated[
        Path | None,
        typer.Option(
            help="TOML with the controller's gains and the reference motion, for iv and didim; "
            "simulate writes one."
        ),
    ] = None,
    seed: Seed = 0,
) -> None:
    r"""Identify a robot from a log: result.json, identified.urdf and report.html.

    \b
    python -m runtime identify panda_gaz --robot fr3
    python -m runtime identify log.csv --robot my --friction viscous,coulomb --cutoff 10
    python -m runtime identify log.csv --robot my --friction auto --cutoff 10
    python -m runtime identify log.csv --robot my --method pc-ols --out results/convex
    python -m runtime identify log.csv --robot my --prior my-arm.toml
    python -m runtime identify log.csv --method didim --loop log.loop.toml --friction viscous

    A CSV has the header t,q1…,dq1…,ddq1…,tau1… in SI units (dq and ddq optional); anything else
    is described by a recipe. Ctrl-C keeps the best point so far. A report of the same folder is
    replaced.
    """
    lib = load(robot)
    recording = read_recording(log, recipe, run)
    prepared, parts = preparation_of(recording, cutoff, rate), _split(split)
    terms = _friction(recording, friction, coulomb_speed)
    notes: tuple[str, ...] = ()
    if terms is not None and terms.columns[:1] == (AUTO,):
        with console.status("choosing a friction model"):
            choice = choose_friction(
                recording, lib, prepared, parts, coulomb_speed, extra=terms.columns[1:]
            )
        console.print(_ladder_table(choice))
        terms, notes = choice.chosen.terms, (choice.sentence,)
    if terms is None and method == "nn":
        terms = Friction(INPUTS)
    result = _with_progress(
        recording,
        lib,
        method,
        preset=preset,
        prior=None if prior is None else read_prior(prior, lib),
        preparation=prepared,
        splitting=parts,
        friction_columns=terms,
        loop=read_loop(loop, lib) if loop else None,
        seed=seed,
    )
    result = dataclasses.replace(result, notes=(*notes, *result.notes))
    folder = out or Path("results") / f"{Path(log).stem}-{result.method}"
    _finish(result, folder)


def _with_progress(
    recording: Recording, lib: Library, method: str | None, **options: object
) -> Identification:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("best validation loss {task.fields[best]}"),
        TimeElapsedColumn(),
    )
    named = options.get("preset")
    method = method or ("map" if named is None else "adam")
    chosen = PRESETS.get(str(named or "full"))
    with Progress(*columns, console=console, transient=True) as progress:
        total = chosen.rule.max_iterations if chosen and method == "adam" else None
        task = progress.add_task(f"{method} on {lib.name}", total=total, best="-")

        def report(iteration: int, best: float) -> None:
            progress.update(task, completed=iteration, best=f"{best:.6g}")

        return identify(recording, lib, method, progress=report, **options)  # type: ignore[arg-type]


def _finish(result: Identification, folder: Path) -> None:
    from runtime.report import write_report  # matplotlib is slow to import

    facts = write_result(result, folder, command_line())
    console.print(torque_table(facts))
    say(f"status: {result.status}")
    verdict = "consistent" if result.is_consistent else "NOT consistent"
    smallest = float(result.relative_eigenvalues.min())
    say(f"links: all {len(facts['links'])} {verdict}, smallest relative eigenvalue {smallest:.1e}"
        if result.is_consistent
        else f"links: {verdict}, smallest relative eigenvalue {smallest:.1e}")  # fmt: skip
    say(
        f"gap to the convex optimum (PC-OLS on the same rows and weights): {100 * result.gap:.3f} %"
    )
    if result.uncertainty is not None:
        say(f"advice: {result.uncertainty.advice()}")
    say(f"time of the method: {result.seconds:.3f} s")
    for warning in facts["warnings"]:
        say(f"note: {warning}")
    if result.is_consistent:
        say(f"URDF:   {folder / 'identified.urdf'} ({_exported(result, folder)})")
    else:
        say("URDF:   not written, because a simulator could not use an inconsistent model")
    say(f"report: {write_report(folder)}")


def _exported(result: Identification, folder: Path) -> str:
    return write_urdf(result.lib, result.pi, folder / "identified.urdf")


def _friction(recording: Recording, names: str | None, speed: float | None) -> Friction | None:
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
