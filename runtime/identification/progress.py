"""What a caller sees of an identification while it runs."""

from collections.abc import Callable

from runtime.estimators.choice.friction_choice import FrictionChoice
from runtime.estimators.choice.regressor_choice import CutoffChoice


class Progress:
    """Steps, choices and iterations of an identification; this one shows nothing."""

    def step(self, sentence: str) -> None:
        """Show the present step.

        Args:
            sentence: the step, such as "choosing a cut-off".
        """

    def choice(self, made: CutoffChoice | FrictionChoice) -> None:
        """Show the candidates of a choice.

        Args:
            made: candidates with their errors, and the chosen one.
        """

    def iteration(self, done: int, best: float) -> None:
        """Show an iteration of a method that iterates.

        Args:
            done: number of iterations.
            best: best validation loss.
        """


SILENT = Progress()


class Iterations(Progress):
    """A callable that is shown the iterations alone."""

    def __init__(self, call: Callable[[int, float], None]) -> None:
        self._call = call

    def iteration(self, done: int, best: float) -> None:
        """Call it."""
        self._call(done, best)


def progress_of(given: Callable[[int, float], None] | Progress | None) -> Progress:
    """The progress that a caller gives: a callable, all steps, or None."""
    if given is None:
        return SILENT
    return given if isinstance(given, Progress) else Iterations(given)
