"""Logs of poses at rest that are reached from both sides: pairs of visits found in the data.

    q = (q₊ + q₋)/2,    τ = (τ₊ + τ₋)/2 = g(q)

Coulomb friction has opposite signs after two approaches from opposite sides, so that it cancels in
the mean. The rows have dq = ddq = 0 and contain gravity alone.
"""

import numpy as np

from runtime.library import Array
from runtime.recording.preprocessing.segments import runs
from runtime.recording.recording import Recording

REST_SPEED = 0.02  # speed below which a joint rests [rad/s or m/s]: two counts of a servo in 0.2 s
WINDOW_S = 0.1  # time before and after a row over which its speed is computed [s]
LEAST_S = 0.2  # shortest rest [s]
APPROACH_S = 0.5  # time before a rest whose motion gives the side of the approach [s]
LEAST_TRAVEL = 2e-3  # of every joint on an approach [rad, m]: above a servo encoder's counts
SAME = 0.01
"""Largest distance of two visits of one pose [rad, m]: the error of a controller against friction,
and far below the length of an approach."""
SHARE = 0.3  # share of the log that the arm rests, below which the log is one of motion
FEWEST_PAIRS = 3  # number of pairs from which on a log is one of poses


def static_poses(recording: Recording) -> Recording | None:
    """One row per pose that was reached from both sides."""
    if recording.tau is None or recording.columns is not None or len(recording) < 10:
        return None
    still = _still(recording)
    if still.mean() < SHARE:
        return None
    ends, rests, torques, approaches = _visits(recording, still)
    pairs = _pairs(rests, approaches)
    if len(pairs) < FEWEST_PAIRS:
        return None
    first, second = np.array(pairs).T
    q, tau = ((each[first] + each[second]) / 2 for each in (rests, torques))
    at_rest = np.zeros_like(q)
    return recording.replace(t=ends[second], q=q, dq=at_rest, ddq=at_rest, tau=tau).noted(
        f"Took {len(pairs)} poses that were reached from both sides, each the mean of two rests; "
        f"{len(rests) - 2 * len(pairs)} of {len(rests)} rests belong to no pair."
    )


def _still(recording: Recording) -> np.ndarray:
    """Rows in which every joint rests, (N,)."""
    t, last = recording.t, len(recording) - 1
    behind = np.searchsorted(t, t - WINDOW_S)
    ahead = np.minimum(np.searchsorted(t, t + WINDOW_S), last)
    span = np.maximum(t[ahead] - t[behind], 1e-12)
    speed = np.abs(recording.q[ahead] - recording.q[behind]).max(axis=1) / span
    return np.asarray(speed < REST_SPEED)


def _visits(recording: Recording, still: np.ndarray) -> tuple[Array, Array, Array, Array]:
    """Last instants (v,), means of q and τ, displacements of the approach, (v, n), in order.

    Of the rests of at least `LEAST_S`.
    """
    t, q, tau = recording.t, recording.q, recording.required("tau")
    visits = []
    for first, end in runs(still):
        if t[end - 1] - t[first] < LEAST_S:
            continue
        mean = q[first:end].mean(axis=0)
        before = int(np.searchsorted(t, t[first] - APPROACH_S))
        visits.append((t[end - 1], mean, tau[first:end].mean(axis=0), mean - q[before]))
    ends, *others = zip(*visits, strict=True) if visits else ([],) * 4
    rests, torques, approaches = (np.reshape(each, (-1, q.shape[1])) for each in others)
    return np.array(ends), rests, torques, approaches


def _pairs(q: Array, approach: Array) -> list[tuple[int, int]]:
    """Visits of one pose from opposite sides, the closest first; each belongs to one pair."""
    if not len(q):
        return []
    is_far = np.abs(approach).min(axis=1) > LEAST_TRAVEL
    # Along the joint of the widest range, visits of one pose are neighbours of the sorted ones.
    widest = int(np.argmax(np.ptp(q, axis=0)))
    order = np.argsort(q[:, widest], kind="stable")
    last = np.searchsorted(q[order, widest], q[order, widest] + SAME)
    near = []
    for place, end in enumerate(last.tolist()):
        a, others = int(order[place]), order[place + 1 : end]
        gaps = np.abs(q[others] - q[a]).max(axis=1)
        opposite = (approach[others] * approach[a] < 0).all(axis=1)
        fits = (gaps < SAME) & opposite & is_far[others] & is_far[a]
        near += [
            (float(gap), min(a, int(b)), max(a, int(b)))
            for gap, b in zip(gaps[fits], others[fits], strict=True)
        ]
    taken: set[int] = set()
    pairs = []
    for _, a, b in sorted(near):
        if not {a, b} & taken:
            taken |= {a, b}
            pairs.append((a, b))
    return sorted(pairs, key=lambda pair: pair[1])
