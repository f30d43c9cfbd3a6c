"""The options of limits, and the certificate as a table."""

import numpy as np
from rich.table import Column, Table

from runtime.cli.common import numbers_option
from runtime.excitation import Safety
from runtime.excitation.limits.safety import FIT_PROXIES
from runtime.excitation.proof.certificate import DISTANCES, Certificate, Use
from runtime.library import Library

BOX = 6
"""Numbers of --box."""


def safety_of(
    lib: Library,
    torque_fraction: float,
    clearance: float | None,
    table: float | None,
    box: str | None,
    viscous: str | None,
    coulomb: str | None,
) -> Safety:
    """The limits that the options ask for, on top of all that the robot states."""
    return Safety(
        torque_fraction=torque_fraction,
        clearance=clearance,
        table=table,
        box=None if box is None else numbers_option(box, BOX, "--box"),
        viscous=_per_joint(lib, viscous, "--viscous"),
        coulomb=_per_joint(lib, coulomb, "--coulomb"),
    )


def _per_joint(lib: Library, text: str | None, option: str) -> tuple[float, ...]:
    """One number or one per joint; empty where the option is not given."""
    if text is None:
        return ()
    return numbers_option(text, lib.n_joints if "," in text else 1, option)


def notes(lib: Library, asked: float, taken: float) -> tuple[str, ...]:
    """What else must be said: more time than was asked for, s, and a robot without proxies."""
    found = []
    if taken != asked:
        found.append(f"note: {asked:g} s would break a limit; it takes {taken:g} s")
    if not lib.pairs:
        found.append(
            f"note: '{lib.name}' has no collision proxies: nobody looked whether its links meet "
            f"each other or what is around them; {FIT_PROXIES}"
        )
    return tuple(found)


def certificate_table(proof: Certificate, percent: float) -> Table:
    """The largest use of every limit: how much, where and when."""
    verdict = "holds at every instant" if proof.holds else "does NOT hold"
    table = Table(
        Column("limit", overflow="fold"), title=f"certificate at {percent:g} % speed: {verdict}"
    )
    for head in ("largest use %", "margin %"):
        table.add_column(head, justify="right")
    table.add_column("where", overflow="fold")
    table.add_column("time s", justify="right")
    for use in proof.uses:
        table.add_row(use.kind, *_amount(use), use.where, f"{use.time:.3f}")
    for missing in proof.unlimited:
        table.add_row(missing, "no limit stated", "", "", "")
    for missing in proof.unchecked:
        table.add_row(missing, "NOT checked", "", "", "")
    return table


def _amount(use: Use) -> tuple[str, str]:
    if use.kind in DISTANCES:
        # Rounded downwards: 20.00 mm is never what is left of 19.996.
        distance = np.floor(1e5 * use.value + 1e-6) / 100
        return f"{distance:.2f} mm", f"{distance - 1e3 * use.limit:.2f} mm"
    # Rounded upwards: 100.00 is never what is left of 100.004.
    bound = np.ceil(1e4 * use.bound - 1e-6) / 100
    return f"{bound:.2f}", f"{100 - bound:.2f}"
