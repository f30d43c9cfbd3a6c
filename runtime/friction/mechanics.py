"""What friction must know of the arm: gravity's load on each gear."""

import numpy as np

from runtime.library import Array, Library


def gravity_load(lib: Library, q: Array) -> Array:
    """|τ_g(q)| (N, n) by the URDF, N·m or N."""
    still = np.zeros_like(q)
    return np.abs(lib.inverse_dynamics(q, still, still, lib.pi0))
