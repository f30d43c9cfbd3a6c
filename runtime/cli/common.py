"""Parts that the commands share: console, common options, help text, table of torque errors."""

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer
from rich.console import Console
from rich.table import Column, Table

from runtime.errors import IdentificationError, RuntimeFault
from runtime.registry import Registry

console = Console()

MODELS = (
    ("URDF", "before_overall"),
    ("URDF with friction fitted", "urdf_friction_overall"),
    ("identified", "after_overall"),
)
"""Models of the table of shares → keys of their torque errors."""
INTERRUPTED = 130
"""Exit code after Ctrl-C, where no method returns its best result so far."""

Robot = Annotated[
    str,
    typer.Option("--robot", help="Name or folder of a generated robot."),
]
Seed = Annotated[
    int,
    typer.Option(help="Seed of the random numbers, below 2⁶³.", min=0, max=2**63 - 1),
]


def say(text: str) -> None:
    """Print one line to the terminal without markup, with commands as the user types them."""
    console.print(as_typed(text), highlight=False, soft_wrap=True, markup=False)


def flowing(doc: str) -> str:
    r"""Help text of a docstring; a paragraph after \b keeps its lines, others are refilled."""
    blocks = doc.split("\n\n")
    return "\n\n".join(
        block.removeprefix("\\b\n") if block.startswith("\\b\n") else " ".join(block.split("\n"))
        for block in blocks
    )


class Described(Protocol):
    """A record of a registry with a sentence for help texts."""

    @property
    def name(self) -> str:
        """Word by which a user selects it."""

    @property
    def sentence(self) -> str:
        """What it is."""


def sentences_of(registry: Registry[Any]) -> str:
    """`name: sentence` of every record for an option's help; a faulty plugin keeps its name."""
    parts = []
    for name in registry:
        try:
            record: Described = registry[name]
        except RuntimeFault:
            parts.append(f"{name}: a plugin that cannot be imported")
        else:
            parts.append(f"{name}: {record.sentence}")
    return "; ".join(parts)


def program() -> str:
    """Name by which the user started the program, `symgen` or `python -m runtime`."""
    return "symgen" if Path(sys.argv[0]).stem == "symgen" else "python -m runtime"


def as_typed(text: str) -> str:
    """A sentence whose commands begin with `symgen` where the user started that."""
    if program() != "symgen":
        return text
    return text.replace("python -m runtime ", "symgen ").replace("python -m symgen ", "symgen ")


def command_line() -> str:
    """Command line as it was typed, for the provenance of result files."""
    return shlex.join([*program().split(), *sys.argv[1:]])


def torque_table(facts: dict[str, Any]) -> Table:
    """Table of torque errors per joint and overall, before and after identification.

    The percentages are relative to the RMS torque of the joint, the RMS values in its unit.
    """
    percent, rms = facts["torque_error_percent"], facts["torque_rms"]
    table = Table(
        Column("joint", overflow="fold"),
        title=f"{facts['robot']}, {facts['method']}: torque error on {tested_on(facts)} data",
    )
    for head in ("before %", "after %", "before RMS", "after RMS", "unit"):
        table.add_column(head, justify="right")
    columns = zip(
        facts["joints"],
        percent["before"],
        percent["after"],
        rms["before"],
        rms["after"],
        facts["units"],
        strict=True,
    )
    for name, before, after, rms_before, rms_after, unit in columns:
        table.add_row(
            name,
            *("-" if x is None else f"{x:.2f}" for x in (before, after)),
            f"{rms_before:.4f}",
            f"{rms_after:.4f}",
            unit,
        )
    table.add_section()
    overall = (f"{percent['before_overall']:.3f}", f"{percent['after_overall']:.3f}")
    table.add_row("overall", *overall, "", "", "")
    return table


def tested_on(facts: dict[str, Any]) -> str:
    """Part of the log that errors are computed on, "test" or, without a test part, "training"."""
    samples = facts.get("recording", {}).get("samples", {})
    return "training" if samples.get("test") == 0 else "test"


def share_table(facts: dict[str, Any]) -> Table | None:
    """Torque errors of the URDF, of the URDF with friction fitted, and of the identified model.

    The step from the first to the second row is the share of friction, the rest that of inertia.
    None where no friction is fitted.
    """
    percent = facts["torque_error_percent"]
    if "urdf_friction_overall" not in percent:
        return None
    table = Table(
        Column("model"), Column(f"torque error on {tested_on(facts)} data %", justify="right")
    )
    for name, key in MODELS:
        table.add_row(name, f"{percent[key]:.3f}")
    return table


def numbers_option(text: str, count: int, option: str) -> tuple[float, ...]:
    """Numbers separated by commas."""
    try:
        values = tuple(float(word) for word in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count:
        raise IdentificationError(f"{option} needs {count} numbers with commas, got '{text}'")
    return values
