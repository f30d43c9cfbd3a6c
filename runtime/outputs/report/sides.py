"""Left and right side of mirrored limbs, in one table of the report."""

from runtime.common.tables import Table
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification.result_record import MirroredPair
from runtime.outputs.report.page import Section


def sides_section(pairs: tuple[MirroredPair, ...] | None) -> tuple[Section, ...]:
    """The section; none without pairs."""
    if not pairs:
        return ()
    return (
        Section(
            "Left and right",
            "Values of mirrored joints with their 95 % intervals; friction is viscous and Coulomb. "
            "The distance is in standard deviations of the difference. Pairs that disagree are "
            "explained among the warnings.",
            Table(
                ("left", "right", "quantity", "value left", "value right", "agree"),
                tuple(map(_row, pairs)),
            ),
        ),
    )


def _row(pair: MirroredPair) -> tuple[str, ...]:
    sides = [
        ", ".join(f"{v:.4g} ± {NORMAL_95 * s:.2g}" for v, s in zip(values, sigma, strict=True))
        for values, sigma in zip(pair.values, pair.sigma, strict=True)
    ]
    verdict = "yes" if pair.agrees else "no"
    return (pair.left, pair.right, pair.quantity, *sides, f"{verdict} ({pair.distance:.1f} σ)")
