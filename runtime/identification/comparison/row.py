"""What one method achieved: a line of the table, with the figures that advice is made of."""

from dataclasses import dataclass

from runtime.library import Array

RAN, NOT_RUN, FAILED = "ran", "not run", "failed"


@dataclass(frozen=True, slots=True)
class Figures:
    """Measures of one answer; train and test are the same samples for every method.

    Attributes:
        train_percent, test_percent: torque error over all joints, Eq. 5.1.
        rms: of τ − τ̂ on test, (n,), N·m or N.
        squares: Σ_j (τ_j − τ̂_j)² per test sample, (N,), (N·m)².
        base_error: 100 ‖β̂ − β‖/‖β‖ where the truth is known, else None.
        seconds: of the method alone.
        iterations: None for closed forms.
        smallest_eigenvalue: of all P_k, over their traces.
        is_consistent: every link can exist.
        is_boundary: a link is next to a plate or a rod.
        gap: (L − L*)/L* on the training samples, in the weights common to all.
        excited: base parameters that the motion excites.
        determined: combinations of them of which the data say more than the prior.
    """

    train_percent: float
    test_percent: float
    rms: Array
    squares: Array
    base_error: float | None
    seconds: float
    iterations: int | None
    smallest_eigenvalue: float
    is_consistent: bool
    is_boundary: bool
    gap: float
    excited: int
    determined: int


@dataclass(frozen=True, slots=True)
class Row:
    """A method, whether it ran, and its own sentence; figures where it ran."""

    method: str
    outcome: str
    status: str
    figures: Figures | None = None
