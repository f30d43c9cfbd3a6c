"""The best start on a fine grid, then moved strictly inside all limits at 1 kHz.

A small remaining violation is repaired by scaling the motion towards its home, which helps against
every limit, or by more time for the same path, rounded up to whole milliseconds, which helps
against speeds and torques. Where neither suffices, the motion is scaled by as much as it takes.
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.distance_limits import use_of
from runtime.excitation.limits.limit_rows import Limits, inside
from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.single_start import Search
from runtime.library import Array, Library

__all__ = ["repaired"]

STEP = 1e-3
"""Step of the grid on which the limits hold, s."""
STRICT = 2e-4
"""Margin of nonlinear limits on that grid: their curvature between its samples is smaller."""
SCALES = 1 - 1e-4 * np.concatenate([[0], 2.0 ** np.arange(10)])
"""Factors of the motion, down to 0.95."""
SLOWER = 1.01 ** np.arange(1, 41)
"""Factors of the duration, up to 1.5."""
SMALL = 0.9 ** np.arange(1, 23)
"""Factors of the motion where nothing else helps, down to 0.1: with a small share of the limits
(the setting margin) the cost of a search rises faster than its penalty of nonlinear limits."""


@dataclass(frozen=True, slots=True)
class Finished:
    """A trajectory that keeps its limits at 1 kHz."""

    trajectory: Trajectory  # the motion
    use: dict[str, float]  # largest |value| / limit per kind of limit, 1 is the limit itself


def finished(lib: Library, search: Search, a: Array) -> Finished:
    """Refine a start and repair it; Ctrl-C skips the refinement."""
    with suppress(KeyboardInterrupt):
        a = search.refined(a)
    return repaired(lib, search, a)


def repaired(lib: Library, search: Search, a: Array) -> Finished:
    """Move a motion inside all limits at 1 kHz.

    Args:
        lib: library of the robot.
        search: settings and limits.
        a: coefficients of the motion, (n, M) [rad, m].

    Returns:
        The motion, smaller or slower where limits ask for it, with its share of them.

    Raises:
        IdentificationError: no smaller and no slower motion keeps the limits.
    """
    designed = search.settings.duration
    fine = _limits(lib, search, designed)
    a = inside(fine, a)
    if not search.constraints:
        return _with_use(search, fine, a, designed)
    rows = search.limit_rows(STEP)
    # First a smaller motion of the same duration, then the same path in more time.
    for scale in SCALES:
        if rows.worst(scale * a) <= -STRICT:
            return _with_use(search, fine, scale * a, designed)
    for slower in SLOWER:
        duration = np.ceil(1e3 * slower * designed) / 1e3
        if search.limit_rows(STEP, duration=duration).worst(a) <= -STRICT:
            return _with_use(search, _limits(lib, search, duration), a, duration)
    for scale in SMALL:
        if rows.worst(scale * a) <= -STRICT:
            return _with_use(search, fine, scale * a, designed)
    raise IdentificationError(
        f"the best motion found breaks the limits of {' and of '.join(rows.strongest(a))} and "
        "neither a smaller nor a slower motion of the same shape keeps them; try more starts"
    )


def _limits(lib: Library, search: Search, duration: float) -> Limits:
    basis, share = search.basis, search.settings.margin
    size = basis.size(search.settings.harmonics)
    return Limits(lib, search.home, size, duration, step=STEP, basis=basis, share=share)


def _with_use(search: Search, fine: Limits, a: Array, duration: float) -> Finished:
    margin = search.settings.margin
    use = {kind: margin * float(values.max()) for kind, values in fine.use(a).items()}
    by_constraint = search.limit_rows(STEP, duration=duration, share=1.0).by_constraint(a)
    for constraint, values in zip(search.constraints, by_constraint, strict=True):
        largest = use_of(constraint, float(values.max()))
        use[constraint.kind] = max(largest, use.get(constraint.kind, largest))
    return Finished(Trajectory(search.home, a, duration, search.basis), use)
