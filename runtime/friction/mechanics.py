"""What friction must know of the arm: gravity's load on each gear, and which rotors show.

A rotor's inertia J_j adds J_j ddq_j to the torque of joint j alone. On some joints, the first of an
arm above all, a link's inertia does exactly the same; its rotor is then counted in that link.
"""

import numpy as np
from numpy.typing import NDArray

from runtime.library import Array, Library

_STATES = 60
_SAME = 1e-9
"""Part of a rotor's column that base parameters leave unexplained, below which they are one."""


def gravity_load(lib: Library, q: Array) -> Array:
    """|τ_g(q)| (N, n) by the URDF, N·m or N."""
    still = np.zeros_like(q)
    return np.abs(lib.inverse_dynamics(q, still, still, lib.pi0))


def separate_rotors(lib: Library, directions: Array | None = None) -> NDArray[np.bool_]:
    """(n,): whether a rotor can be told from the links, by the rank at random states.

    The rotors are those of the joints, or of motors that turn at directions (n, n) · dq; where a
    row of directions is zero, there is nothing to tell.
    """
    n = lib.n_joints
    turns = np.eye(n) if directions is None else directions
    q, dq, ddq = np.random.default_rng(0).uniform(-2.0, 2.0, (3, _STATES, n))
    base = lib.base_regressor(q, dq, ddq).reshape(_STATES * n, -1)
    columns = (ddq @ turns.T)[:, None, :] * turns.T
    rotors = columns.reshape(_STATES * n, n)
    rest = rotors - base @ np.linalg.lstsq(base, rotors, rcond=None)[0]
    return np.linalg.norm(rest, axis=0) > _SAME * np.linalg.norm(rotors, axis=0)
