"""The record by which an estimator is known: its name, what it needs, and what solves a problem.

Each estimator states one `Method` in its own module. `methods.METHODS` lists the modules; another
package adds one by an entry point of the group `symgen.estimators`:

    RIDGE = Method("ridge", "least squares with a quadratic penalty", fit_ridge)
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from runtime.estimators.problem import Fit
from runtime.library import Library


@dataclass(frozen=True, slots=True, eq=False)
class Method:
    """One estimator.

    Attributes:
        name: word by which a user selects it.
        sentence: what it is, for `--help`, tables and reports.
        fit: solves a `Problem`. It gets the keyword `preset` where `takes_preset` and the keyword
            `prior`, a `PriorFile` or None, where `takes_prior`.
        label: heading of its column in tables; the name in capitals where empty.
        from_statistics: compressed statistics are all that it needs of the samples. It then takes
            streamed logs, several logs, and rows without accelerations.
        bounds_friction: its viscous, Coulomb and rotor coefficients are ≥ 0.
        every_joint: needs an equation per joint, not the power of all joints.
        uses_validation: stops or chooses by the validation part, which it does not train on.
        takes_log: gets the keyword `log`, the `Origin` of the samples or None.
        files: name of an input that only this method needs → reader of its file.
        unfiltered: works on the unfiltered recording, so that no low-pass is missed.
        columns: friction columns that it can use; None for any.
        default_columns: friction columns that it is given where none are named.
        objective: what it does instead of minimising the weighted loss L; empty where it does.
        when_recommended: half a sentence that follows where a comparison recommends it.
        takes_preset: has settings to choose from.
        takes_prior: uses a file of inertial priors.
        is_most_probable: returns the most probable model under the inertial prior, so that the
            posterior is centred at its answer.
        in_batches: whether a preset (a name, settings or None) draws samples one by one; None
            where no preset does.
    """

    name: str
    sentence: str
    fit: Callable[..., Fit]
    label: str = ""
    from_statistics: bool = False
    bounds_friction: bool = False
    every_joint: bool = False
    uses_validation: bool = False
    takes_log: bool = False
    files: Mapping[str, Callable[[Path, Library], Any]] = field(default_factory=dict)
    unfiltered: bool = False
    columns: tuple[str, ...] | None = None
    default_columns: tuple[str, ...] = ()
    objective: str = ""
    when_recommended: str = ""
    takes_preset: bool = False
    takes_prior: bool = False
    is_most_probable: bool = False
    in_batches: Callable[[Any], bool] | None = None

    @property
    def heading(self) -> str:
        """Heading of its column in tables."""
        return self.label or self.name.upper()

    def needs_samples(self, preset: Any = None) -> bool:
        """Whether it needs the samples one by one, with a preset or without."""
        if not self.from_statistics:
            return True
        return self.in_batches is not None and self.in_batches(preset)
