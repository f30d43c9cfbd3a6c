"""Tables of the automatic choices of cut-off and friction model."""

from typing import TYPE_CHECKING

from rich.table import Table

if TYPE_CHECKING:
    from runtime.estimators.choice.cutoff_choice import CutoffChoice
    from runtime.estimators.choice.friction_choice import FrictionChoice


def cutoff_table(choice: "CutoffChoice") -> Table:
    """Candidates of --cutoff auto with their cross-validation errors; an arrow marks the choice."""
    table = Table("cut-off", title="Cut-off: cross-validation error on the unfiltered torque")
    for head in ("velocity", "error", "above the best", "independent rows"):
        table.add_column(head, justify="right")
    for c in choice.candidates:
        table.add_row(
            f"{'→ ' if c is choice.chosen else ''}{c.cutoff_hz:g} Hz",
            {"measured": "measured", "position": "from q"}[c.derivative],
            f"{c.score:.3f}",
            f"{c.excess:.3f} ± {c.excess_error:.3f}",
            f"{100 * c.white:.0f} %",
        )
    return table


def friction_table(choice: "FrictionChoice") -> Table:
    """Candidates of --friction auto with their cross-validation errors; an arrow marks the choice.

    The error is in units of the torque noise.
    """
    table = Table("friction model", title="Friction model: cross-validation error over noise")
    for head in ("error", "above the best", "AIC", "unknowns"):
        table.add_column(head, justify="right")
    for candidate in choice.candidates:
        table.add_row(
            f"{'→ ' if candidate is choice.chosen else ''}{candidate.name}: {candidate.terms}",
            f"{candidate.score:.3f}",
            f"{candidate.excess:.3f} ± {candidate.excess_error:.3f}",
            f"{candidate.aic:.1f}",
            str(candidate.parameters),
        )
    return table
