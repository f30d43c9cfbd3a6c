"""A finding of an inspection: one sentence with its evidence."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from runtime.common.tables import Table
from runtime.library import Array
from runtime.recording import Recipe
from runtime.recording.notebook import Shown

ERROR, WARNING, INFO = "error", "warning", "info"
LEVELS = (ERROR, WARNING, INFO)


@dataclass(frozen=True, slots=True)
class Finding(Shown):
    """Property of a log to note or to correct."""

    kind: str  # short name of the check's result, stable between versions
    # error (the numbers have another meaning than assumed), warning (to be decided or corrected),
    # info
    level: str
    sentence: str  # what was measured, what it means, what to do
    evidence: dict[str, Any] = field(default_factory=dict)  # the numbers, JSON-ready

    def tables(self) -> tuple[Table, ...]:
        """The finding with its numbers."""
        rows = (("sentence", self.sentence), *((k, str(v)) for k, v in self.evidence.items()))
        return (Table((), rows, title=f"{self.level}: {self.kind}"),)


Checked = tuple[Recipe, list[Finding]]  # a recipe as a check corrects it, and what it has found


def joint_list(names: tuple[str, ...], index: list[int]) -> str:
    """Joint names for a sentence."""
    if len(index) == len(names) and len(names) > 1:
        return "every joint"
    return ", ".join(names[j] for j in index)


def numbers(values: Array) -> list[float | None]:
    """Values for JSON, with None for NaN and infinity."""
    return [float(x) if np.isfinite(x) else None for x in np.ravel(values)]
