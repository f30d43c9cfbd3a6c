"""What earlier logs tell already: G₀ for a sequential design.

G₀ = Σ Y_bᵀ diag(σ⁻²) Y_b over the samples of the logs, less what friction takes of it (the Schur
complement of its columns, by orthogonal transformations): an inverse covariance of β.
"""

from collections.abc import Sequence

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression import compress
from runtime.estimators.regression.samples import samples_of
from runtime.excitation.search.prediction import FRICTION
from runtime.library import Array, Library
from runtime.recording import Friction, Recording
from runtime.recording.plausibility import require_plausible
from runtime.recording.preprocessing import prepare


def information_of_logs(
    lib: Library,
    recordings: Sequence[Recording],
    noise: Array,
    friction: tuple[str, ...] = FRICTION,
) -> Array:
    """G₀ over β, (n_b, n_b).

    Args:
        lib: of the robot.
        recordings: as read, or prepared; each with friction of its own.
        noise: σ of the torque, (n,) N·m or N.
        friction: its columns where a log brings none and its recipe names none.

    Raises:
        RuntimeFault: a log does not fit.
    """
    total = np.zeros((len(lib.base_columns),) * 2)
    for recording in recordings:
        require_plausible(recording, lib)
        terms = recording.recipe.friction if recording.recipe else None
        if recording.columns is not None:
            terms = Friction(())
        samples = samples_of(prepare(recording, None, terms or Friction(friction), lib=lib), lib)
        if not len(samples):
            raise IdentificationError(
                f"the log '{recording.name}' has no samples left after its preparation; "
                "leave out this --earlier-log"
            )
        found = compress(lib, samples, 1 / noise**2)
        size = len(found.target)
        # The columns of β come last in the triangle: their block is what friction leaves.
        own = found.triangle()[size - found.n_base : size, size - found.n_base : size]
        total += own.T @ own
    return total
