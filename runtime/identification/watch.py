"""What a caller sees of an identification while it runs."""

from runtime.estimators.choice.cutoff_choice import CutoffChoice
from runtime.estimators.choice.friction_choice import FrictionChoice


class Watch:
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


SILENT = Watch()
