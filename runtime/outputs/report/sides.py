"""Left and right side of mirrored limbs, in one table of the report."""

from collections.abc import Mapping
from typing import Any

from runtime.estimators.regression.samples import NORMAL_95
from runtime.outputs.report.page import ReportTable, Section

SideRow = tuple[str, str, str, str, str, str]


def read_sides(raw: Any) -> tuple[SideRow, ...]:
    """Rows of the entry `symmetric` of result.json."""
    return tuple(_row(each) for each in raw or ())


def sides_section(rows: tuple[SideRow, ...]) -> tuple[Section, ...]:
    """The section; none without rows."""
    if not rows:
        return ()
    return (
        Section(
            "Left and right",
            "Values of mirrored joints with their 95 % intervals; friction is viscous and Coulomb. "
            "The distance is in standard deviations of the difference. Pairs that disagree are "
            "explained among the warnings.",
            ReportTable(("left", "right", "quantity", "value left", "value right", "agree"), rows),
        ),
    )


def _row(each: Mapping[str, Any]) -> SideRow:
    sides = [
        ", ".join(f"{float(v):.4g} ± {NORMAL_95 * float(s):.2g}" for v, s in zip(v, s, strict=True))
        for v, s in zip(each["values"], each["sigma"], strict=True)
    ]
    verdict = "yes" if each["agrees"] else "no"
    distance = f"{verdict} ({float(each['distance']):.1f} σ)"
    left, right, quantity = (str(each[key]) for key in ("left", "right", "quantity"))
    return (left, right, quantity, sides[0], sides[1], distance)
