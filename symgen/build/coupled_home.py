"""Home position of a robot whose coupled joints have limits: q with lower ≤ A q + b ≤ upper.

The share of half of its range by which every joint keeps away from both ends is as large as
possible, max t with lower + t r ≤ A q + b ≤ upper − t r, r = (upper − lower)/2; a linear programme.
"""

import numpy as np

from symgen.chain import Chain
from symgen.chain.coupling import Coupling

ROOM = 0.1
"""Share of half a range, or rad or m of a range with one end, that is room enough at home."""
_MOST = 1.0
"""Upper bound of t: the middle of the range."""


def within_couplings(
    chain: Chain, coupling: Coupling, usual: tuple[float, ...]
) -> tuple[float, ...]:
    """A home at which coupled joints have room to both sides.

    usual (n,) [rad, m] → (n,) [rad, m].
    """
    # A joint with one master has already narrowed the range of that one.
    rows = [
        k
        for k in range(len(coupling.matrix))
        if k in coupling.independent or len(coupling.masters(k)) > 1
    ]
    matrix, offset = np.array(coupling.matrix)[rows], np.array(coupling.offset)[rows]
    joints = [chain.single_joints[k] for k in rows]
    lower = np.array([-np.inf if joint.lower is None else joint.lower for joint in joints])
    upper = np.array([np.inf if joint.upper is None else joint.upper for joint in joints])
    both = np.isfinite(lower) & np.isfinite(upper)
    with np.errstate(invalid="ignore"):
        half = np.where(both, (upper - lower) / 2, 1.0)
    x = matrix @ np.array(usual) + offset
    several = ~np.isin(rows, coupling.independent)
    if (np.minimum(x - lower, upper - x) >= ROOM * half)[several].all():
        return usual
    return _middle(matrix, offset, lower, upper, half) or usual


def _middle(
    matrix: np.ndarray, offset: np.ndarray, lower: np.ndarray, upper: np.ndarray, half: np.ndarray
) -> tuple[float, ...] | None:
    """Solution q of the programme; None where no posture has room."""
    from scipy.optimize import linprog

    up, down = np.isfinite(upper), np.isfinite(lower)
    rows = np.vstack([np.column_stack([matrix, half])[up], np.column_stack([-matrix, half])[down]])
    ends = np.concatenate([(upper - offset)[up], (offset - lower)[down]])
    n = matrix.shape[1]
    answer = linprog(
        np.append(np.zeros(n), -1.0), rows, ends, bounds=[*[(None, None)] * n, (None, _MOST)]
    )
    if answer.x is None or not answer.x[-1] > 0:
        return None
    return tuple(float(f"{value:.6g}") for value in answer.x[:-1])
