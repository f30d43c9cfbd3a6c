"""Information of earlier logs, G₀, for a sequential design.

G₀ = Σ Y_bᵀ diag(σ⁻²) Y_b over the samples of the logs, less the part that friction explains (the
Schur complement of its columns, by orthogonal transformations). G₀ is an inverse covariance of β.
"""

from collections.abc import Sequence

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression import compress
from runtime.estimators.regression.samples import samples_of
from runtime.excitation.search.information import FRICTION
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
    """Information G₀ on β in earlier logs.

    noise (n,) → (n_b, n_b).
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
        statistics = compress(lib, samples, 1 / noise**2)
        size = len(statistics.target)
        # The columns of β come last in the triangle: their block is the Schur complement.
        first = size - statistics.n_base
        block = statistics.triangle()[first:size, first:size]
        total += block.T @ block
    return total
