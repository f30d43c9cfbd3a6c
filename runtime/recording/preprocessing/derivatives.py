"""Derivatives of q and dq by central differences, segment by segment: none crosses a hole."""

import numpy as np

from runtime.recording import Recording
from runtime.recording.preprocessing.filters import without_short
from runtime.recording.preprocessing.segments import holes
from runtime.recording.recording import FloatArray


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
        result = result.replace(dq=_gradient(result.t, result.q)).noted(
            "Differentiated q to dq by central differences."
        )
    if from_position or recording.ddq is None:
        result = without_short(result, 3)
        result = result.replace(ddq=_gradient(result.t, result.required("dq"))).noted(
            "Differentiated dq to ddq by central differences."
        )
    return result


def _gradient(t: FloatArray, values: FloatArray) -> FloatArray:
    """The slope of the parabola through three neighbours: the row itself, or next to an edge."""
    hole = holes(t)
    centre = np.arange(len(t))
    centre[0] += 1
    centre[1:] += hole
    centre[:-1] -= hole
    centre[-1] -= 1
    before, after = t[centre] - t[centre - 1], t[centre + 1] - t[centre]
    off = 2.0 * (t - t[centre])  # 0 but at edges
    left = (off - after) / (before * (before + after))
    right = (off + before) / (after * (before + after))
    here = values.take(centre, axis=0)
    slope = left[:, None] * (values.take(centre - 1, axis=0) - here)
    slope += right[:, None] * (values.take(centre + 1, axis=0) - here)
    return slope
