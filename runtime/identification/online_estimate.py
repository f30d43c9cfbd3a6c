"""Model of a robot after some samples of an online identification."""

from dataclasses import dataclass

from runtime.library import Array


@dataclass(frozen=True, slots=True)
class OnlineEstimate:
    """The model after some samples.

    Attributes:
        pi: standard parameters, (10 n,), strictly consistent.
        phi: friction coefficients, (n, k).
        samples: N, less the forgotten ones.
        rejected: number of samples left out because they were not finite.
        variance: s² of the weighted residual; 1 where the weights are 1/σ².
        steps: number of Newton steps.
        converged: whether Newton reached its tolerance.
        status: one sentence.
    """

    pi: Array
    phi: Array
    samples: float
    rejected: int
    variance: float
    steps: int
    converged: bool
    status: str


def status_of(steps: int, converged: bool, rejected: int) -> str:
    """How an estimate came about."""
    if converged:
        status = f"converged after {steps} Newton steps"
    elif steps:
        status = "not converged; check units and outliers of the torque"
    else:
        status = "too few samples, or no torque yet: this is the first guess"
    if rejected:
        status += f"; {rejected} samples were not finite and were left out"
    return status
