"""Table of the drives of a result."""

from collections.abc import Iterator
from typing import Any

from runtime.common.tables import Table
from runtime.identification.friction_intervals import spring_lines
from runtime.identification.result_record import ResultRecord


def drive_table(record: ResultRecord) -> Table | None:
    """Drives of result.json, value ± standard deviation; None where none was estimated."""
    drives = record.drive or ()
    names = ("armature", "viscous", "coulomb", "offset", "encoder_bias")
    kept = [name for name in names if any(getattr(each, name) is not None for each in drives)]
    if not kept:
        return None
    rows = tuple(
        (each.joint, *(_cell(getattr(each, x), getattr(each.sigma, x)) for x in kept))
        for each in drives
    )
    head = ("joint", *(name.replace("_", " ") for name in kept))
    return Table(head, rows, title="Drives: value ± standard deviation, SI units")


def delay_lines(record: ResultRecord) -> Iterator[str]:
    """Delays of the torque, joints of unknown bias, and springs."""
    drives = record.drive or ()
    for delay in record.delays if drives else ():
        yield f"delay of the torque: {_cell(delay.value, delay.sigma, 1e3)} ms"
    unknown = [each.joint for each in drives if each.encoder_bias_verdict.startswith("not ident")]
    if unknown:
        yield f"encoder bias: not identifiable from this motion at {', '.join(unknown)}"
    yield from spring_lines(record.friction)


def _cell(value: Any, sigma: Any, factor: float = 1.0) -> str:
    if value is None:
        return "–"
    spread = "" if sigma is None else f" ± {factor * sigma:.2g}"
    return f"{factor * value:.4g}{spread}"
