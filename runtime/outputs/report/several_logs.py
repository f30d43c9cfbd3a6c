"""Several logs in one fit: leave-one-log-out errors and repeatability, in tables."""

from collections.abc import Sequence

from runtime.identification.result_record import SessionsPart
from runtime.outputs.report.page import ReportTable, Section


def several_logs_sections(logs: SessionsPart, links: Sequence[str]) -> tuple[Section, ...]:
    """Tables of the leave-one-log-out errors and of the repeatability."""
    repeated, left_out = logs.repeatability, logs.leave_one_out
    held = ReportTable(
        (
            "log",
            "payload [kg]",
            "URDF",
            "other logs",
            "other logs, offset of this log",
            "this log alone",
        ),
        tuple(
            (
                each.name,
                f"{payload:.3g}",
                f"{each.before_overall:.3f} %",
                f"{each.after_overall:.3f} %",
                f"{each.log_offset_overall:.3f} %",
                f"{each.single_log_overall:.3f} %",
            )
            for each, payload in zip(left_out, logs.payload_kg, strict=True)
        ),
    )
    columns = (*repeated.masses, repeated.mass_spread)
    rows = tuple(
        (link, *(f"{masses[k]:.4f}" for masses in columns)) for k, link in enumerate(links)
    )
    return (
        Section(
            "Leave-one-log-out prediction",
            "Torque error over a whole log, predicted by the fit of all other logs with their mean "
            "offset or with the offset of this log. For comparison: the URDF, and a fit of this "
            "log alone.",
            held,
        ),
        Section(
            "Repeatability",
            f"Masses [kg] identified from each log alone. {repeated.sentence[:1].upper()}"
            f"{repeated.sentence[1:]}.",
            ReportTable(("link", *(each.name for each in left_out), "spread"), rows),
        ),
    )
