"""Several logs in one fit: leave-one-log-out errors and repeatability, in tables."""

from collections.abc import Sequence

from runtime.common.tables import Table, percent
from runtime.identification.result_record import SessionsPart
from runtime.outputs.report.page import Section


def several_logs_sections(logs: SessionsPart, links: Sequence[str]) -> tuple[Section, ...]:
    """Tables of the leave-one-log-out errors and of the repeatability."""
    repeated = logs.repeatability
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
            left_out_table(logs),
        ),
        Section(
            "Repeatability",
            f"Masses [kg] identified from each log alone. {repeated.sentence[:1].upper()}"
            f"{repeated.sentence[1:]}.",
            Table(("link", *(each.name for each in logs.leave_one_out), "spread"), rows),
        ),
    )


def left_out_table(logs: SessionsPart) -> Table:
    """Torque errors of every log by the fit of all others, and for comparison."""
    head = ("log", "payload [kg]", "URDF", "other logs", "with its offset", "this log alone")
    rows = (
        (
            each.name,
            f"{payload:.3g}",
            *(
                percent(x, 3)
                for x in (
                    each.before_overall,
                    each.after_overall,
                    each.log_offset_overall,
                    each.single_log_overall,
                )
            ),
        )
        for each, payload in zip(logs.leave_one_out, logs.payload_kg, strict=True)
    )
    return Table(head, tuple(rows))
