"""One row of a comparison: outcome of a method, with the figures that the advice uses."""

from dataclasses import dataclass

from runtime.library import Array

RAN, NOT_RUN, FAILED = "ran", "not run", "failed"


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of one result; the samples of every part are the same for every method.

    Attributes:
        train_percent, validation_percent, test_percent: torque error over all joints, Eq. 5.1.
        rms: of τ − τ̂ on test, (n,), N·m or N.
        squares: Σ_j (τ_j − τ̂_j)² per validation sample, (N,), (N·m)², for the choice.
        base_error: 100 ‖β̂ − β‖/‖β‖ where the truth is known, else None.
        seconds: time of the method alone, s.
        iterations: None for closed forms.
        smallest_eigenvalue: smallest λ_min(P_k)/tr P_k of all links.
        is_consistent: every link is physically consistent.
        is_boundary: a link is close to a plate or a rod.
        gap: (L − L*)/L* on the training samples, in the weights common to all.
        excited: number of base parameters that the motion excites.
        determined: combinations of them that the data determine better than the prior does.
        contradictions: sentences on priors, joints and results that the data contradict.
        model_errors: sentences on assumptions of the intervals that the residuals contradict.
    """

    train_percent: float
    validation_percent: float
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
    contradictions: tuple[str, ...] = ()
    model_errors: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Row:
    """Outcome of one method.

    Attributes:
        method: name in `METHODS`.
        outcome: "ran", "not run" or "failed".
        status: how the method ended, or why it did not run.
        figures: None unless it ran.
    """

    method: str
    outcome: str
    status: str
    figures: Figures | None = None
