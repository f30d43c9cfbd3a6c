"""Tables of a result, for the terminal, the report and notebooks alike."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from runtime.common.tables import NOTHING, Table, number, percent
from runtime.identification.metrics import CONSISTENCY_TOLERANCE
from runtime.identification.result_record import ErrorPercent, ErrorRms, LinkPart, ResultRecord
from runtime.library.parameters import PI_NAMES

NOT_RUN = "not run"  # outcome of a method that needs more than the log offers
MODELS = (  # models of the table of shares → keys of their torque errors
    ("URDF", "before_overall"),
    ("URDF with friction fitted", "urdf_friction_overall"),
    ("identified", "after_overall"),
)


def error_table(
    names: Sequence[str],
    units: Sequence[str],
    shares: ErrorPercent,
    rms: ErrorRms,
    title: str = "",
    note: str = "",
) -> Table:
    """Torque errors per row and overall: shares of the RMS torque, and RMS in its unit."""
    units = [unit.replace("*", "·") for unit in units]
    rows = zip(names, shares.before, shares.after, rms.before, rms.after, units, strict=True)
    means = [NOTHING, NOTHING, ""]
    if len(set(units)) == 1:  # N and N·m have no common mean
        sizes = (math.fsum(x * x for x in each) / len(each) for each in (rms.before, rms.after))
        means = [*(number(math.sqrt(x)) for x in sizes), units[0]]
    return Table(
        ("joint", "error before", "error after", "RMS before", "RMS after", "unit"),
        tuple(
            (name, percent(a), percent(b), number(c), number(d), unit)
            for name, a, b, c, d, unit in rows
        ),
        ("all joints", *map(percent, (shares.before_overall, shares.after_overall)), *means),
        title,
        note,
    )


def parameter_columns(links: Sequence[str], **values: Any) -> dict[str, list[Any]]:
    """Columns of a data frame: link, parameter and values [SI] that are there, a row per entry."""
    rows = [(link, name) for link in links for name in PI_NAMES]
    return {
        "link": [link for link, _ in rows],
        "parameter": [name for _, name in rows],
        **{key: list(map(float, each)) for key, each in values.items() if each is not None},
    }


def share_table(record: ResultRecord) -> Table | None:
    """Errors of the URDF, of the URDF with friction, and of the result; None without friction.

    The step from the first to the second row is the share of friction, the rest that of inertia.
    """
    shares = record.torque_error_percent
    if shares.urdf_friction_overall is None:
        return None
    rows = tuple((name, percent(getattr(shares, key), 3)) for name, key in MODELS)
    return Table(("model", f"torque error on {tested_on(record)} data"), rows)


def link_table(links: Sequence[LinkPart]) -> Table:
    """Mass, centre of mass and consistency of every link."""
    rows = tuple(
        (
            link.name,
            number(link.mass_before),
            number(link.mass),
            ", ".join(NOTHING if x is None else f"{round(1e3 * x, 1) + 0.0:.1f}" for x in link.com),
            NOTHING
            if None in link.com
            else f"{1e3 * math.dist([x or 0.0 for x in link.com], link.com_before):.1f}",
            NOTHING
            if link.min_relative_eigenvalue is None
            else f"{link.min_relative_eigenvalue:.1e}",
            "consistent" if is_consistent(link) else "inconsistent",
        )
        for link in links
    )
    return Table(
        (
            "link",
            "mass before [kg]",
            "mass after [kg]",
            "CoM x, y, z [mm]",
            "CoM shift [mm]",
            "λ_min(P)/tr P",
            "verdict",
        ),
        rows,
        flagged=frozenset(k for k, link in enumerate(links) if not is_consistent(link)),
    )


def is_consistent(link: LinkPart) -> bool:
    """Whether the pseudo-inertia of a link is positive to rounding."""
    smallest = link.min_relative_eigenvalue
    return smallest is not None and smallest >= -CONSISTENCY_TOLERANCE


def tested_on(record: ResultRecord) -> str:
    """Part of the log that errors are computed on, "test" or, without a test part, "training"."""
    return "training" if record.recording.samples.get("test") == 0 else "test"


def method_table(rows: Sequence[Mapping[str, Any]], title: str = "") -> Table:
    """Every method of compare.json; results that are not physically consistent are flagged."""
    head = ("method", "train %", "error %", "worst RMS", "base %", "s", "steps", "λ_min/tr")
    bad = (k for k, row in enumerate(rows) if not row.get("consistent", row["outcome"] == NOT_RUN))
    return Table(
        (*head, "gap %", "status"),
        tuple(map(_of_method, rows)),
        title=title,
        flagged=frozenset(bad),
        row_methods=tuple(str(row["method"]) for row in rows),
    )


def _of_method(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Cells of one method, rounded for reading."""
    if "rms" not in row:
        return (str(row["method"]), *(NOTHING,) * 8, str(row["outcome"]))
    worst = int(np.argmax(row["rms"]))
    base, gap = row["base_error_percent"], row["gap_to_convex_optimum"]
    return (
        str(row["method"]),
        f"{row['train_percent']:.3f}",
        f"{row['test_percent']:.3f}",
        f"j{worst + 1} {row['rms'][worst]:.3f}",
        NOTHING if base is None else f"{base:.3g}",
        f"{row['seconds']:.3f}",
        NOTHING if row["iterations"] is None else str(row["iterations"]),
        f"{row['smallest_relative_eigenvalue']:.1e}",
        NOTHING if gap is None else f"{100 * gap:.3g}",
        "boundary" if row["boundary"] else "consistent" if row["consistent"] else "inconsistent",
    )
