"""`symgen identify` of a robot with a free base."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from runtime.cli.common import ResultFolder, require_result_folder
from runtime.cli.log_options import fractions_of
from runtime.common.terminal import command_line, console, say
from runtime.errors import IdentificationError
from runtime.estimators.prior_file import PriorFile
from runtime.identification.free_base.identify import SHARE, identify_free_base, write_free_base
from runtime.identification.free_base.rows import CROSSTALK
from runtime.library import Library
from runtime.outputs.model_files import write_urdf
from runtime.recording.free_base import read_free_base

EquationRows = Annotated[
    str | None,
    typer.Option(
        "--rows",
        metavar="base|joints|all",
        help="Equations of a robot with a free base: the six of the base, those of the joints, or "
        "all; default all, and base without torques.",
    ),
]
TAKEN = ("logs", "robot", "yes", "rows", "cutoff", "split", "prior", "out", "overwrite")
"""Parameters of the command that apply to a robot with a free base."""
WRITTEN = ResultFolder("identify", ("result.json", "identified.urdf"), "free_base")


def require_fixed_base(lib: Library, rows: str | None) -> None:
    """Refuse --rows for a robot whose base is fixed."""
    if rows is not None:
        raise IdentificationError(
            f"--rows belongs to robots with a free base, and that of '{lib.name}' is fixed; leave "
            "it out, or build the robot with --floating"
        )


def identify_free_base_log(
    lib: Library,
    logs: list[str],
    rows: str | None,
    cutoff: str | None,
    split: str | None,
    prior: PriorFile | None,
    out: Path | None,
    overwrite: bool,
    given: dict[str, str],
) -> None:
    """Read a log, identify, write result.json and identified.urdf, and print the errors."""
    unused = [option for name, option in given.items() if name not in TAKEN]
    if unused:
        raise IdentificationError(
            f"{unused[0]} does not apply to a robot with a free base; leave it out"
        )
    if len(logs) != 1:
        raise IdentificationError(
            f"expected one log of a robot with a free base, got {len(logs)}; identify each alone"
        )
    path = Path(logs[0])
    recording = read_free_base(path)
    choice = rows or ("base" if recording.tau is None else "all")
    folder = out or Path("results") / f"{path.stem}-{choice}"
    require_result_folder(folder, WRITTEN, overwrite)
    result = identify_free_base(
        recording,
        lib,
        choice,
        cutoff_hz=None if cutoff is None else _number(cutoff, "--cutoff"),
        share=SHARE if split is None else _share(split),
        prior=prior,
    )
    facts = write_free_base(result, folder, command_line())
    table = Table("row", title=f"{lib.name}: errors on the last {result.seconds:.3g} s")
    for head in ("RMS", "before RMS", "after RMS"):
        table.add_column(head, justify="right")
    for row in facts["errors"]:
        table.add_row(row["row"], *(f"{row[key]:.4g}" for key in ("rms", "before", "after")))
    console.print(table)
    mass = facts["total_mass"]
    low, high = mass["interval"]
    say(
        f"total mass: {mass['value']:.3f} kg, 95 % interval {low:.3f} to {high:.3f}, URDF "
        f"{mass['urdf']:.3f}"
    )
    if facts["vertical_force"] is not None:
        force = facts["vertical_force"]
        say(
            f"sum of vertical forces: error {force['after_percent']:.2f} % of {force['mean']:.1f} "
            f"N, of the URDF {force['before_percent']:.2f} %"
        )
    for name, value in facts["sensors"].items():
        if name == "sharing":
            say(f"sensors: γ = {value:+.3f} while contacts share the load")
        elif name in CROSSTALK:
            say(f"sensors: {value:+.3f} N per N·m about {name[-1]} of the link")
        else:
            say(f"sensors: offset of {name} {value:+.2f} N")
    for link in facts["links"]:
        if link["not_identifiable"]:
            say(f"link {link['link']}: not identifiable {', '.join(link['not_identifiable'])}")
    for note in facts["notes"]:
        say(f"note: {note}")
    urdf = folder / "identified.urdf"
    say(f"URDF:   {urdf} ({write_urdf(lib, result.pi, urdf)})")
    say(f"result: {folder / 'result.json'}")


def _share(text: str) -> float:
    """Share of the training: B of "A,B", since map trains on the validation part as well."""
    if "," not in text:
        return _number(text, "--split")
    return fractions_of(text)[1]


def _number(text: str, option: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 < value < float("inf"):
        raise IdentificationError(f"{option} needs a number above 0 here, got '{text}'")
    return value
