"""One row of a comparison: outcome of a method and its figures, as JSON and as cells of a table."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.estimators.methods import METHODS
from runtime.library import Array

__all__ = [
    "HEAD",
    "Figures",
    "cells",
]

RAN, NOT_RUN, FAILED = "ran", "not run", "failed"
HEAD = (
    "method",
    "error %",
    "worst RMS",
    "base %",
    "s",
    "steps",
    "λ_min/tr",
    "gap %",
    "status",
)


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
class MethodRow:
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


def row_facts(row: MethodRow) -> dict[str, Any]:
    """A row of compare.json."""
    head = {
        "method": row.method,
        "about": METHODS[row.method].sentence,
        "outcome": row.outcome,
        "status": row.status,
    }
    return head | ({} if row.figures is None else _figure_facts(row.figures))


def _figure_facts(f: Figures) -> dict[str, Any]:
    return {
        "test_percent": f.test_percent,
        "validation_percent": f.validation_percent,
        "train_percent": f.train_percent,
        "rms": f.rms.tolist(),
        "base_error_percent": f.base_error,
        "seconds": f.seconds,
        "iterations": f.iterations,
        "smallest_relative_eigenvalue": f.smallest_eigenvalue,
        "consistent": f.is_consistent,
        "boundary": f.is_boundary,
        "gap_to_convex_optimum": finite(f.gap),
        "excited": f.excited,
        "determined": f.determined,
    }


def cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Cells of one line of the table, in the order of `HEAD`, rounded for reading."""
    if "rms" not in row:
        return (row["method"], *("–",) * (len(HEAD) - 2), row["outcome"])
    worst = int(np.argmax(row["rms"]))
    base, gap = row["base_error_percent"], row["gap_to_convex_optimum"]
    verdict = row["outcome"] if row["consistent"] else "unphysical"
    return (
        row["method"],
        f"{row['test_percent']:.3f}",
        f"j{worst + 1} {row['rms'][worst]:.3f}",
        "–" if base is None else f"{base:.3g}",
        f"{row['seconds']:.3f}",
        "–" if row["iterations"] is None else str(row["iterations"]),
        f"{row['smallest_relative_eigenvalue']:.1e}",
        "–" if gap is None else f"{100 * gap:.3g}",
        "boundary" if row["boundary"] else verdict,
    )


def finite(value: float) -> float | None:
    """A number for JSON; None where it is not finite."""
    return value if np.isfinite(value) else None
