"""States, torques and parameters, the same for every contender, and operations of the kernels."""

from dataclasses import dataclass, replace
from typing import Any

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


@dataclass(frozen=True, slots=True)
class Symbolic:
    """Expressions of one kernel."""

    function: Any  # of CasADi
    inputs: tuple[str, ...]  # their names
    operations: int  # per sample, without what depends on shared inputs alone
    sines: int  # how many of them are sines and cosines


def symbolic(lib: Library, names: tuple[str, ...]) -> dict[str, Symbolic]:
    """Generate a library's kernels once more, from the URDF and options that it was built from."""
    from symgen.catalogue import make_catalogue
    from symgen.chain import read_chain
    from symgen.make.request import request_from_folder

    request = request_from_folder(lib.folder)
    catalogue = make_catalogue(read_chain(request.urdf, request.options))
    return {k.name: facts_of(k) for k in catalogue.kernels if k.name in names}


def facts_of(kernel: Any) -> Symbolic:
    """Counts of a kernel's instruction list; a sine or cosine is one operation."""
    import casadi as ca

    operations = sines = 0
    per_sample: dict[int, bool] = {}
    for op, ins, outs, _ in kernel.instructions:
        if op == ca.OP_INPUT:
            per_sample[outs[0]] = not kernel.inputs[ins[0]].shared
        elif op == ca.OP_CONST:
            per_sample[outs[0]] = False
        elif op != ca.OP_OUTPUT:
            per_sample[outs[0]] = any(per_sample[i] for i in ins)
            operations += per_sample[outs[0]]
            sines += per_sample[outs[0]] and op in {ca.OP_SIN, ca.OP_COS}
    return Symbolic(kernel.function, tuple(a.name for a in kernel.inputs), operations, sines)
