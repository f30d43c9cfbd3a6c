"""Several logs in one fit: leave-one-log-out errors and repeatability, in tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from runtime.outputs.report.page import ReportTable, Section


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Torque errors over all joints of one log that was left out of the fit.

    Attributes:
        name: of the log.
        payload: known mass that it carries [kg].
        errors: [%] by the URDF; by the fit of the other logs; by this with the offset of the
            log; by a fit of the log alone.
    """

    name: str
    payload: float
    errors: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class SeveralLogs:
    """Agreement of several logs.

    Attributes:
        left_out: one per log.
        masses: mass of every link identified from each log alone [kg].
        spread: standard deviation of these masses over the logs [kg].
        sentence: whether the logs agree within their noise.
    """

    left_out: tuple[LeftOut, ...]
    masses: tuple[tuple[float, ...], ...]
    spread: tuple[float, ...]
    sentence: str


def read_several_logs(raw: Mapping[str, Any] | None, n_links: int) -> SeveralLogs | None:
    """Read the entry `sessions` of result.json."""
    if not raw:
        return None
    keys = ("before_overall", "after_overall", "own_offset_overall", "alone_overall")
    left_out = []
    for held, payload in zip(raw["leave_one_out"], raw["payload_kg"], strict=True):
        a, b, c, d = (float(held[key]) for key in keys)
        left_out.append(LeftOut(str(held["name"]), float(payload), (a, b, c, d)))
    repeated = raw["repeatability"]
    rows = (*repeated["masses"], repeated["mass_spread"])
    masses = tuple(tuple(float(x) for x in row) for row in rows)
    if len(masses) != len(left_out) + 1 or any(len(row) != n_links for row in masses):
        raise ValueError(f"'sessions': expected {n_links} masses per log, got another number")
    return SeveralLogs(tuple(left_out), masses[:-1], masses[-1], str(repeated["sentence"]))


def several_logs_sections(several_logs: SeveralLogs, links: Sequence[str]) -> tuple[Section, ...]:
    """Tables of the leave-one-log-out errors and of the repeatability."""
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
            (each.name, f"{each.payload:.3g}", *(f"{error:.3f} %" for error in each.errors))
            for each in several_logs.left_out
        ),
    )
    names = tuple(each.name for each in several_logs.left_out)
    rows = tuple(
        (
            link,
            *(f"{masses[k]:.4f}" for masses in several_logs.masses),
            f"{several_logs.spread[k]:.4f}",
        )
        for k, link in enumerate(links)
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
            f"Masses [kg] identified from each log alone. {several_logs.sentence[:1].upper()}"
            f"{several_logs.sentence[1:]}.",
            ReportTable(("link", *names, "spread"), rows),
        ),
    )
