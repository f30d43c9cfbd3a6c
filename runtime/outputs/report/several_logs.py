"""Several logs in one fit: how the others predict each, and what they repeat, in tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from runtime.outputs.report.layout import ReportTable, Section


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Overall torque errors [%] of one log: URDF, the others' answer, its own offset, own fit."""

    name: str
    payload: float
    errors: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class SeveralLogs:
    """What several logs say about each other.

    Attributes:
        left_out: one per log.
        masses: kg of every link by every log alone.
        spread: kg, standard deviation of these over the logs.
        sentence: what the spread says.
    """

    left_out: tuple[LeftOut, ...]
    masses: tuple[tuple[float, ...], ...]
    spread: tuple[float, ...]
    sentence: str


def read_several_logs(raw: Mapping[str, Any] | None, n_links: int) -> SeveralLogs | None:
    """The part `sessions` of result.json, where there is one.

    Raises:
        KeyError: a key is missing; TypeError or ValueError: a value is of another form.
    """
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
        raise ValueError("'sessions': expected one mass per link and log")
    return SeveralLogs(tuple(left_out), masses[:-1], masses[-1], str(repeated["sentence"]))


def several_logs_sections(several_logs: SeveralLogs, links: Sequence[str]) -> tuple[Section, ...]:
    """Leave one log out, and repeatability."""
    held = ReportTable(
        ("log", "payload [kg]", "URDF", "the others", "with its own offset", "its own fit"),
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
            "Each log as the others predict it",
            "Torque error over a whole log of the model that all other logs gave, with their mean "
            "offset or with that of the log; beside it the URDF and the log's own fit.",
            held,
        ),
        Section(
            "Repeatability",
            f"Masses [kg] by every log alone. {several_logs.sentence[:1].upper()}"
            f"{several_logs.sentence[1:]}.",
            ReportTable(("link", *names, "spread"), rows),
        ),
    )
