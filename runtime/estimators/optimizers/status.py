"""Reasons for which an optimiser stops."""

from enum import Enum


class Status(Enum):
    """Why the loop ended, as advice."""

    PATIENCE = "converged: the validation loss stopped improving"
    MAX_ITERATIONS = (
        "stopped at the iteration limit while still improving; "
        "allow more iterations, or take a larger step"
    )
    INTERRUPTED = "interrupted by the user; the best point so far is kept"
    CONVERGED = "converged: no step lowers the loss noticeably any more"
    STALLED = (
        "stalled: no step lowers the loss, however small; the optimum may lie at the edge of "
        "consistency, compare with pc-ols"
    )
    DIVERGED = "the loss became infinite or NaN; the best point before is kept, take a smaller step"
