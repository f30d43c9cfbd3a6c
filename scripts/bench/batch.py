"""Batch of states, torques and parameters, the same for every contender."""

from dataclasses import dataclass, replace

import numpy as np

from runtime.library import Array, Library


@dataclass(frozen=True, slots=True)
class Batch:
    """N states of one robot."""

    q: Array  # q, dq, ddq, tau: (N, n) [rad or m, ..., N·m or N]; tau is Y π with noise
    dq: Array
    ddq: Array
    tau: Array
    pi: Array  # pi, lam, beta: (10 n,), (10 n,), (n_b,) of the URDF
    lam: Array
    beta: Array
    weight: Array  # weight, rotor: (n,), ones and zeros
    rotor: Array

    @property
    def size(self) -> int:
        """N."""
        return len(self.q)

    def named(self, name: str) -> Array:
        """Array for the kernel input of this name."""
        return np.ascontiguousarray(getattr(self, name))

    def part(self, rows: slice) -> "Batch":
        """Only these samples."""
        parts = {key: self.named(key)[rows] for key in ("q", "dq", "ddq", "tau")}
        return replace(self, **parts)


def make_batch(lib: Library, samples: int, seed: int = 0) -> Batch:
    """Random positions, velocities and accelerations."""
    rng = np.random.default_rng(seed)
    n = lib.n_joints
    q = rng.uniform(-np.pi, np.pi, (samples, n))
    dq, ddq = rng.normal(0, 2, (samples, n)), rng.normal(0, 5, (samples, n))
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + rng.normal(0, 1, (samples, n))
    beta = lib.base_matrix @ lib.pi0
    return Batch(q, dq, ddq, tau, lib.pi0, lib.lam0, beta, np.ones(n), np.zeros(n))
