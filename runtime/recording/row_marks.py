"""Recognise rows of a log in another one: under another name, in another format, in part.

A row is marked by a hash of its rounded positions and torques. The smallest `COUNT` hashes of a log
are a random choice of its rows, the same in every log that holds them (Broder, On the resemblance
and containment of documents, 1997):

    share of the rows of a log that another one holds ≈ |marks ∩ hashes| / |hashes ≤ largest mark|
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from runtime.recording.recipes.recipe import CURRENT
from runtime.recording.recording import Recording

Marks = NDArray[np.uint64]

COUNT = 512  # number of marks of a log
SAME = 0.05  # share of equal rows above which logs depend; two logs of one motion have none
_STEP = 1e-4  # step of rounding [rad, m, N·m, N]
_ASIDE = 0.2371  # shift of the rounding, in steps: printed decimals do not lie between two steps


def row_marks(*logs: Recording) -> Marks:
    """Marks of logs as read, at most `COUNT`; of a log of currents those of its positions."""
    return np.unique(np.concatenate([row_hashes(log) for log in logs]))[:COUNT]


def row_hashes(recording: Recording, with_torque: bool = True) -> Marks:
    """Hashes of all different rows, ascending."""
    tau = recording.tau if with_torque and recording.torque_source != CURRENT else None
    values = recording.q if tau is None else np.hstack([recording.q, tau])
    whole = np.floor(np.asarray(values) / _STEP + _ASIDE).astype(np.int64).view(np.uint64)
    state = np.full(len(whole), 0x9E3779B97F4A7C15, dtype=np.uint64)
    for column in whole.T:
        state = (state ^ column) * np.uint64(0xFF51AFD7ED558CCD)
        state ^= state >> np.uint64(32)
    return np.unique(state)


def share_of_rows(marks: Marks, hashes: Marks) -> float:
    """Share of the rows of `hashes` that the log of `marks` holds."""
    among = hashes[: np.searchsorted(hashes, marks[-1], side="right")] if len(marks) else marks
    if len(marks) < COUNT:  # all rows are marked
        among = hashes
    return float(np.isin(among, marks).mean()) if len(among) else 0.0


def same_rows(logs: Sequence[tuple[str, Recording]]) -> tuple[tuple[str, str, float], ...]:
    """Pairs of logs that share more than `SAME` of their rows, and the larger share."""
    hashes = [(name, row_hashes(log)) for name, log in logs]
    pairs = []
    for (a, of_a), (b, of_b) in combinations(hashes, 2):
        share = max(share_of_rows(of_a[:COUNT], of_b), share_of_rows(of_b[:COUNT], of_a))
        if share > SAME:
            pairs.append((a, b, share))
    return tuple(pairs)
