"""The best start on a fine grid, then moved strictly inside all limits at 1 kHz.

What little is left over there is repaired by scaling the motion towards its home, which helps
against every limit, or by more time for the same path, rounded up to whole milliseconds, which
helps against speeds and torques.
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.joint_limits import Limits, inside
from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.single_start import Search
from runtime.library import Array, Library

STEP = 1e-3
"""s: of the grid on which the limits hold."""
STRICT = 2e-4
"""Of nonlinear limits there: room for what they bend between its samples."""
SCALES = 1 - 1e-4 * np.concatenate([[0], 2.0 ** np.arange(10)])
"""Of the motion, down to 0.95."""
SLOWER = 1.01 ** np.arange(1, 41)
"""Of the duration, up to 1.5 times."""


@dataclass(frozen=True, slots=True)
class Finished:
    """A trajectory that keeps its limits at 1 kHz.

    Attributes:
        trajectory: the motion.
        use: largest |value| / limit per kind of limit, 1 is the limit itself.
    """

    trajectory: Trajectory
    use: dict[str, float]


def finished(lib: Library, search: Search, a: Array) -> Finished:
    """Refined and repaired; Ctrl-C skips the refinement.

    Raises:
        IdentificationError: nothing repairs it.
    """
    with suppress(KeyboardInterrupt):
        a = search.refined(a)
    return repaired(lib, search, a)


def repaired(lib: Library, search: Search, a: Array) -> Finished:
    """Inside all limits at 1 kHz.

    Raises:
        IdentificationError: nothing repairs it.
    """
    problem = search.problem
    fine = _limits(lib, search, problem.duration)
    a = inside(fine, a)
    if not search.constraints:
        return _told(search, fine, a, problem.duration)
    rows = search.limit_rows(STEP)
    for scale in SCALES:
        if rows.worst(scale * a) <= -STRICT:
            return _told(search, fine, scale * a, problem.duration)
    for slower in SLOWER:
        duration = np.ceil(1e3 * slower * problem.duration) / 1e3
        if search.limit_rows(STEP, duration=duration).worst(a) <= -STRICT:
            return _told(search, _limits(lib, search, duration), a, duration)
    raise IdentificationError(
        f"the best motion found breaks the limits of {' and of '.join(rows.strongest(a))} and "
        "neither a smaller nor a slower one of its kind keeps them; try more starts"
    )


def _limits(lib: Library, search: Search, duration: float) -> Limits:
    problem, basis = search.problem, search.basis
    size = basis.size(problem.harmonics)
    return Limits(lib, problem.home, size, duration, step=STEP, basis=basis)


def _told(search: Search, fine: Limits, a: Array, duration: float) -> Finished:
    use = {kind: float(values.max()) for kind, values in fine.use(a).items()}
    by_constraint = search.limit_rows(STEP, duration=duration).by_constraint(a)
    for constraint, values in zip(search.constraints, by_constraint, strict=True):
        use[constraint.kind] = 1 + float(values.max())
    home = search.problem.home
    return Finished(Trajectory(home, a, duration, search.basis), use)
