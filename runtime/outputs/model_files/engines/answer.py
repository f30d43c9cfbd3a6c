"""What an engine read from a file, in the order and with the names of the library."""

from dataclasses import dataclass

import numpy as np

from runtime.library import Array, Library

STATES = 1000  # number of random states at which torques are compared


class Unreadable(Exception):
    """Raised where the engine refuses the file; the text is its reason, on one line."""

    def __init__(self, reason: object) -> None:
        super().__init__(" ".join(str(reason).split()))


@dataclass(frozen=True, slots=True, eq=False)
class Reloaded:
    """A robot as an engine read it from a file."""

    engine: str  # name and version
    tau: Array  # (N, n) inverse dynamics at `random_states`, less damping and armature [N·m, N]
    damping: Array | None = None  # damping, friction, armature: (n,); None where it is not read
    friction: Array | None = None
    armature: Array | None = None


def random_states(lib: Library, count: int = STATES) -> tuple[Array, Array, Array]:
    """Random states, the same for every engine."""
    q, dq, ddq = np.random.default_rng(0).uniform(-np.pi, np.pi, (3, count, lib.n_rows))
    if lib.manifest.loops:  # postures that close
        limits = lib.limits()
        ends = (np.nan_to_num(limits[k], posinf=np.pi, neginf=-np.pi) for k in ("lower", "upper"))
        lower, upper = ends
        q = (lower + upper) / 2 + (upper - lower) * q / (2 * np.pi)
    return q, dq, ddq
