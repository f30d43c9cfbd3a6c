"""Table of the drives of a result."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from runtime.common.terminal import console, say


def print_drives(facts: Mapping[str, Any]) -> None:
    """Print delay and drives of result.json, value ± standard deviation."""
    drives = facts["drive"]
    if not drives:
        return
    names = ("armature", "viscous", "coulomb", "offset", "encoder_bias")
    kept = [name for name in names if any(drive[name] is not None for drive in drives)]
    table = Table("joint", title="Drives: value ± standard deviation, SI units")
    for name in kept:
        table.add_column(name.replace("_", " "), justify="right")
    for drive in drives:
        cells = (_cell(drive[name], drive["sigma"][name]) for name in kept)
        table.add_row(drive["joint"], *cells)
    if kept:
        console.print(table)
    delays = facts["delay_s"]
    for each in [delays] if isinstance(delays, dict) else delays or []:
        where = f" of {each['log']}" if "log" in each else ""
        say(f"delay of the torque{where}: {_cell(each['value'], each['sigma'], 1e3)} ms")
    unknown = [d["joint"] for d in drives if d["encoder_bias_verdict"].startswith("not ident")]
    if unknown:
        say(f"encoder bias: not identifiable from this motion at {', '.join(unknown)}")


def _cell(value: float | None, sigma: float | None, factor: float = 1.0) -> str:
    if value is None:
        return "–"
    spread = "" if sigma is None else f" ± {factor * sigma:.2g}"
    return f"{factor * value:.4g}{spread}"
