"""What an engine says about a file, in the order and the names of the library."""

from dataclasses import dataclass

import numpy as np

from runtime.library import Array, Library

STATES = 1000


class Unreadable(Exception):
    """The engine refuses the file; the text is its reason, on one line."""

    def __init__(self, reason: object) -> None:
        super().__init__(" ".join(str(reason).split()))


@dataclass(frozen=True, slots=True)
class Reloaded:
    """A robot as an engine holds it after reading a file.

    Attributes:
        engine: name and version.
        tau: what its inverse dynamics gives at `random_states`, less damping and armature, (N, n).
        pi: its bodies, those fixed together summed up in the moving link's frame, (n, 10).
        damping, friction, armature: as it read them, (n,); None where it reads none.
    """

    engine: str
    tau: Array
    pi: Array
    damping: Array | None = None
    friction: Array | None = None
    armature: Array | None = None


def random_states(lib: Library) -> tuple[Array, Array, Array]:
    """q, dq, ddq, each (1000, n), the same for every engine."""
    q, dq, ddq = np.random.default_rng(0).uniform(-np.pi, np.pi, (3, STATES, lib.n_joints))
    return q, dq, ddq


def pi_of(P: Array) -> Array:
    """π (10,) of a pseudo-inertia: m, m c, XX, YY, ZZ, XY, XZ, YZ about the origin."""
    inertia = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
    entries = [inertia[e] for e in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return np.array([P[3, 3], *P[:3, 3], *entries])
