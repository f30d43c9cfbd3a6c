"""Contacts of a log: where the external torque exceeds its threshold, with time, joint and size.

The contact wrench at a link follows from the external joint torque,

    τ_ext = J(q)ᵀ w,   w = (force, moment) at the origin of the link, axes of the base

With fewer than six joints before the link, or in a singular posture, only some components follow
from τ_ext. w is the smallest one that explains it; lengths are scaled by `LENGTH`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Array, Library

LENGTH = 0.1
"""Length that makes moments comparable to forces [m]."""
DETERMINED = 0.02
"""Singular value of the scaled Jacobian, relative to the largest, from which one counts."""
RELEASE = 0.5
"""Share of the threshold below which a contact ends."""
PAUSE_S = 0.05
"""Shortest pause between two contacts of one joint [s]."""


@dataclass(frozen=True, slots=True)
class Wrench:
    """Contact wrench at the origin of a link, in axes of the base."""

    link: str  # name of the link
    force: tuple[float, ...]  # (3,) [N]
    moment: tuple[float, ...]  # (3,) [N·m]
    rank: int  # number of its six components that the external torque determines


def wrench_at(lib: Library, q: Array, external: Array, name: str) -> Wrench:
    """Contact wrench at a link by least squares.

    q (n,) [rad, m], external (n,) [N·m, N].
    """
    if name not in lib.link_names:
        raise IdentificationError(
            f"expected a moving link of '{lib.name}' ({', '.join(lib.link_names)}), got '{name}'; "
            "correct the setting link"
        )
    scale = np.repeat([1.0, LENGTH], 3)
    jacobian = lib.frame_jacobian(q, name) * scale[:, None]
    left, sizes, right = np.linalg.svd(jacobian.T, full_matrices=False)
    kept = sizes > DETERMINED * sizes[0]
    w = right[kept].T @ ((left[:, kept].T @ external) / sizes[kept]) * scale
    return Wrench(name, tuple(map(float, w[:3])), tuple(map(float, w[3:])), int(kept.sum()))


@dataclass(frozen=True, slots=True)
class Contact:
    """One contact at one joint."""

    time_s: float  # instant at which the threshold is exceeded [s]
    end_s: float  # instant from which r stays below half of it [s]
    joint: str  # name of the joint
    number: int  # index of the joint, from 0
    torque: float  # external torque [N·m, N]: median after the time of the observer, or the peak
    direction: int  # sign of it, 1 or −1
    sigma: float  # σ of r at the instant of detection [N·m, N]
    threshold: float  # at that instant [N·m, N]


def contacts_of(
    t: Array,
    r: Array,
    sigma: Array,
    threshold: Array,
    names: Sequence[str],
    within_s: float,
) -> tuple[Contact, ...]:
    """Contacts in the order of time.

    t (N,) [s], r (N, n) [N·m, N], sigma (N, n) [N·m, N], threshold (N, n) [N·m, N].
    """
    contacts = []
    sizes = np.abs(np.nan_to_num(r))
    for j, name in enumerate(names):
        size = sizes[:, j]
        for first, last in _intervals(t, size, threshold[:, j]):
            shown = first + int(np.searchsorted(t[first : last + 1] - t[first], within_s))
            inside = r[first : last + 1, j]
            held = size[shown : last + 1] > RELEASE * threshold[shown : last + 1, j]
            torque = float(inside[np.argmax(np.abs(inside))])
            if held.sum() > 2:
                torque = float(np.median(r[shown : last + 1, j][held]))
            contacts.append(
                Contact(
                    time_s=float(t[first]),
                    end_s=float(t[last]),
                    joint=name,
                    number=j,
                    torque=torque,
                    direction=1 if torque > 0 else -1,
                    sigma=float(sigma[first, j]),
                    threshold=float(threshold[first, j]),
                )
            )
    return tuple(sorted(contacts, key=lambda contact: contact.time_s))


def _intervals(t: Array, size: Array, threshold: Array) -> list[tuple[int, int]]:
    """First and last sample of each contact: from above the threshold to below half of it."""
    above = np.flatnonzero(size > threshold)
    below = np.flatnonzero(size < RELEASE * threshold)
    intervals: list[tuple[int, int]] = []
    for k in above:
        if intervals and (k <= intervals[-1][1] or t[k] - t[intervals[-1][1]] < PAUSE_S):
            if k <= intervals[-1][1]:
                continue
            first = intervals.pop()[0]
        else:
            first = int(k)
        after = np.searchsorted(below, k)
        last = int(below[after]) if after < len(below) else len(size) - 1
        intervals.append((first, last))
    return intervals
