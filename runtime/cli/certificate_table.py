"""Options of the limits of a motion, notes on a design, and the certificate as a table."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Column, Table

from runtime.cli.carry import carried_body
from runtime.cli.common import numbers_option
from runtime.cli.model_bands import band_of
from runtime.errors import RuntimeFault
from runtime.excitation import Safety
from runtime.excitation.limits.distances import FIT_PROXIES
from runtime.excitation.limits.obstacles import OBSTACLE, read_obstacles
from runtime.excitation.proof.certificate import DISTANCES, Certificate, Use
from runtime.library import Library

NO_TABLE = "none"
"""Value of --table where there is no table."""
BOX = 6
"""Count of the numbers of --box."""


@dataclass(frozen=True, slots=True)
class LimitValues:
    """Values of the options that state limits; None where an option is not given.

    Attributes:
        torque_fraction: fraction of the torque limits that may be used, 0 to 1.
        clearance: least distance of links from each other and the table, m.
        table: height of a table in the base frame, m.
        box: six numbers with commas, range of the tip along x, y and z, m.
        viscous: one number or one per joint, N·m·s/rad.
        coulomb: one number or one per joint, N·m.
        carry: body in the hand, value of --carry.
        obstacles: TOML of obstacles.
        payload_band: mass in kg and reach in m of what the payload may differ by.
        friction_band: half-width of friction in %.
        model_band: trust in the parameters of the links.
    """

    torque_fraction: float
    clearance: float | None = None
    table: float | None = None
    box: str | None = None
    viscous: str | None = None
    coulomb: str | None = None
    carry: str | None = None
    obstacles: Path | None = None
    payload_band: str | None = None
    friction_band: float | None = None
    model_band: str | None = None


def safety_of(lib: Library, values: LimitValues) -> Safety:
    """Limits of the options, which hold besides those that the robot states."""
    body, box = carried_body(lib, values.carry), values.box
    return Safety(
        torque_fraction=values.torque_fraction,
        clearance=values.clearance,
        table=values.table,
        box=None if box is None else numbers_option(box, BOX, "--box"),
        viscous=_per_joint(lib, values.viscous, "--viscous"),
        coulomb=_per_joint(lib, values.coulomb, "--coulomb"),
        carried=body,
        obstacles=() if values.obstacles is None else read_obstacles(values.obstacles),
        band=band_of(lib, values.payload_band, values.model_band, body),
        friction_band=(values.friction_band or 0.0) / 100,
    )


def table_height(text: str | None) -> tuple[float | None, bool]:
    """Height of the option --table."""
    if text is None or text == NO_TABLE:
        return None, text == NO_TABLE
    try:
        return float(text), False
    except ValueError:
        raise RuntimeFault(
            f"--table needs a height in m in the base frame, or none where there is no table, got "
            f"'{text}'"
        ) from None


def _per_joint(lib: Library, text: str | None, option: str) -> tuple[float, ...]:
    """One number or one per joint; empty where the option is not given."""
    if text is None:
        return ()
    return numbers_option(text, lib.n_joints if "," in text else 1, option)


def design_notes(lib: Library, requested: float, taken: float) -> tuple[str, ...]:
    """Notes on a designed motion: a longer duration, and a robot without collision proxies."""
    sentences = []
    if taken != requested:
        sentences.append(
            f"note: {requested:g} s would break a limit, so the motion takes {taken:g} s"
        )
    if not lib.pairs:
        sentences.append(
            f"note: '{lib.name}' has no collision proxies, so collisions between its links and "
            f"with its surroundings are not checked; {FIT_PROXIES}"
        )
    return tuple(sentences)


def certificate_headline(proof: Certificate, percent: float) -> tuple[str, ...]:
    """What a certificate states in two sentences: the limits that hold, and what it leaves out."""
    verdict = "holds at every instant" if proof.holds else "does NOT hold"
    checked = ", ".join(use.kind for use in proof.uses)
    others = "other obstacles" if any(use.kind == OBSTACLE for use in proof.uses) else "obstacles"
    missing = ", ".join((*proof.unchecked, "cables", "people", others))
    return (
        f"certificate at {percent:g} % speed: {verdict}; checked: {checked}",
        f"load: {proof.load}; NOT checked: {missing}",
    )


def certificate_table(proof: Certificate) -> Table:
    """Largest use of every limit: how much, where and when, and how it is shown."""
    table = Table(Column("limit", overflow="fold"))
    for head in ("use %", "margin %"):
        table.add_column(head, justify="right")
    table.add_column("where", overflow="fold")
    table.add_column("time s", justify="right")
    table.add_column("intervals", justify="right")
    for use in proof.uses:
        table.add_row(use.kind, *_amount(use), use.where, f"{use.time:.3f}", _proof(use))
    for missing in proof.unlimited:
        table.add_row(missing, "", "", "no limit stated")
    for missing in proof.unchecked:
        table.add_row(missing, "", "", "NOT checked")
    return table


def _proof(use: Use) -> str:
    return str(use.intervals) if use.is_proven else "measured"


def _amount(use: Use) -> tuple[str, str]:
    if use.kind in DISTANCES:
        # Rounded downwards, so that 19.996 mm is not printed as 20.00 mm.
        distance = np.floor(1e5 * use.value + 1e-6) / 100
        return f"{distance:.2f} mm", f"{distance - 1e3 * use.limit:.2f} mm"
    # Rounded upwards, so that 100.004 % is not printed as 100.00 %.
    bound = np.ceil(1e4 * use.bound - 1e-6) / 100
    return f"{bound:.2f}", f"{100 - bound:.2f}"
