"""Derivatives of q and dq by central differences, segment by segment: none crosses a hole."""

import numpy as np
from numpy.typing import NDArray

from runtime.recording import Recording
from runtime.recording.preprocessing.filters import without_short
from runtime.recording.preprocessing.segments import holes
from runtime.recording.recording import FloatArray

SENTENCES = {
    "dq": "Differentiated q to dq by central differences.",
    "ddq": "Differentiated dq to ddq by central differences.",
}
"""Derivative → sentence of the history."""


def differentiate(recording: Recording, from_position: bool = False) -> Recording:
    """Fill in dq from q and ddq from dq by central differences, of second order at the ends as
    well.

    Args:
        recording: with q.
        from_position: replace measured dq and ddq too.

    Returns:
        The recording with dq and ddq.
    """
    result = recording
    if from_position or recording.dq is None:
        result = without_short(result, 3)
        result = result.replace(dq=slopes(result.t, result.q)).noted(SENTENCES["dq"])
    if from_position or recording.ddq is None:
        result = without_short(result, 3)
        result = result.replace(ddq=slopes(result.t, result.required("dq"))).noted(SENTENCES["ddq"])
    return result


def slopes(t: FloatArray, values: FloatArray, rows: NDArray[np.int64] | None = None) -> FloatArray:
    """Derivative by central differences: the slope of the parabola through three neighbours.

    The middle one is the row itself, or next to an edge the neighbour inside.

    t (N,), values (N, m), rows (M,) → (M, m).
    """
    hole = holes(t)
    centre = np.arange(len(t))
    centre[0] += 1
    centre[1:] += hole
    centre[:-1] -= hole
    centre[-1] -= 1
    if rows is not None:
        centre = centre[rows]
    instants = t if rows is None else t[rows]
    before, after = t[centre] - t[centre - 1], t[centre + 1] - t[centre]
    off = 2.0 * (instants - t[centre])  # 0 but at edges
    left = (off - after) / (before * (before + after))
    right = (off + before) / (after * (before + after))
    here = values.take(centre, axis=0)
    slope = left[:, None] * (values.take(centre - 1, axis=0) - here)
    slope += right[:, None] * (values.take(centre + 1, axis=0) - here)
    return slope
