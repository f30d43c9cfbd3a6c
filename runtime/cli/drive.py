"""Table of the drives of a result."""

from typing import Any

from rich.table import Table

from runtime.common.terminal import console, say
from runtime.identification.friction_intervals import spring_lines
from runtime.identification.result_record import ResultRecord


def print_drives(record: ResultRecord) -> None:
    """Print delay, drives and springs of result.json, value ± standard deviation."""
    drives = record.drive or ()
    names = ("armature", "viscous", "coulomb", "offset", "encoder_bias")
    kept = [name for name in names if any(getattr(each, name) is not None for each in drives)]
    if kept:
        table = Table("joint", title="Drives: value ± standard deviation, SI units")
        for name in kept:
            table.add_column(name.replace("_", " "), justify="right")
        for drive in drives:
            pairs = ((getattr(drive, name), getattr(drive.sigma, name)) for name in kept)
            table.add_row(drive.joint, *(_cell(*pair) for pair in pairs))
        console.print(table)
    for delay in record.delays if drives else ():
        say(f"delay of the torque: {_cell(delay.value, delay.sigma, 1e3)} ms")
    unknown = [each.joint for each in drives if each.encoder_bias_verdict.startswith("not ident")]
    if unknown:
        say(f"encoder bias: not identifiable from this motion at {', '.join(unknown)}")
    for line in spring_lines(record.friction):
        say(line)


def _cell(value: Any, sigma: Any, factor: float = 1.0) -> str:
    if value is None:
        return "–"
    spread = "" if sigma is None else f" ± {factor * sigma:.2g}"
    return f"{factor * value:.4g}{spread}"
