"""Steps, choices and iterations of an identification at the terminal."""

from rich.progress import Progress as Bar
from rich.table import Table

from runtime.common.terminal import VERBOSE, console, say
from runtime.estimators.choice.friction_choice import FrictionChoice
from runtime.estimators.choice.regressor_choice import CutoffChoice
from runtime.identification.settings import Progress


def shown_progress(bar: Bar, method: str, robot: str, total: int | None = None) -> Progress:
    """One bar: the present step, then the iterations of the method."""
    task = bar.add_task("reading the log", total=None, state="")

    def choice(made: CutoffChoice | FrictionChoice) -> None:
        """Print what was chosen above the bar; --verbose prints all cut-offs."""
        if isinstance(made, FrictionChoice):
            console.print(friction_table(made))
        elif VERBOSE.get():
            console.print(cutoff_table(made))
        else:
            say(f"cut-off: {made.chosen.cutoff_hz:g} Hz, chosen by cross-validation")

    def iteration(done: int, best: float) -> None:
        text, name = f"best validation loss {best:.6g}", f"{method} on {robot}"
        bar.update(task, description=name, total=total, completed=done, state=text)

    return Progress(lambda sentence: bar.update(task, description=sentence), choice, iteration)


def cutoff_table(choice: CutoffChoice) -> Table:
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


def friction_table(choice: FrictionChoice) -> Table:
    """Candidates of --friction auto, errors over the torque noise; an arrow marks the choice."""
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
