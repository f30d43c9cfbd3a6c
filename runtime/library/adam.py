"""The compiled descent in λ: the job of `<robot>_<level>_adam` as NumPy arrays."""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LANES = 8
"""Arrays of a job are padded to a multiple of this, whatever the level."""
PATIENCE, DIVERGED = 1, 2


@dataclass(frozen=True, slots=True)
class Quadratic:
    """L = yᵀHy/2 − hᵀy + c in y = [π(λ); ψ]."""

    hessian: Array
    linear: Array
    constant: float


@dataclass(frozen=True, slots=True)
class Batches:
    """Samples for mini-batches and the unit of ψ per friction column, (n, k)."""

    size: int
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    columns: Array
    weights: Array
    unit: Array


_POINTER = ctypes.POINTER(ctypes.c_double)


class _QuadraticJob(ctypes.Structure):
    _fields_ = [("hessian", _POINTER), ("linear", _POINTER), ("constant", ctypes.c_double)]


class _Job(ctypes.Structure):
    """Field by field the struct of the generated header."""

    _fields_ = [
        *((name, ctypes.c_long) for name in ("size", "padded")),
        *((name, _QuadraticJob) for name in ("training", "held")),
        *((name, ctypes.c_double) for name in ("rate", "beta1", "beta2", "epsilon", "threshold")),
        *((name, ctypes.c_long) for name in ("validate_every", "patience")),
        *((name, _POINTER) for name in ("x", "m", "v", "best_x")),
        *((name, ctypes.c_double) for name in ("best", "power1", "power2")),
        *((name, ctypes.c_long) for name in ("step", "improved_at", "finished", "traced")),
        *((name, _POINTER) for name in ("training_trace", "held_trace")),
        *((name, ctypes.c_long) for name in ("batch", "columns_per_joint")),
        ("rows", ctypes.POINTER(ctypes.c_long)),
        *((name, _POINTER) for name in ("q", "dq", "ddq", "tau", "columns", "weight", "unit")),
        ("work", _POINTER),
    ]


class CompiledAdam:
    """One descent; `run` goes on where the last call stopped.

    Attributes:
        x, best_x: the current and the best validated point.
        training_trace, held_trace: losses at the validated iterations.
    """

    def __init__(
        self,
        function: Callable[..., None],
        start: Array,
        training: Quadratic,
        held: Quadratic,
        options: dict[str, float],
        traces: int,
        batches: Batches | None,
    ) -> None:
        self._function = function
        size = start.size
        padded = -(-size // LANES) * LANES
        self.x, self.best_x = _padded(start, padded), np.zeros(padded)
        self.training_trace, self.held_trace = np.zeros(traces), np.zeros(traces)
        self._size = size
        self._kept: list[NDArray[np.generic]] = []  # what the job points to must stay alive
        job = _Job(size=size, padded=padded, power1=1.0, power2=1.0)
        for name, value in options.items():
            setattr(job, name, value)
        for name, quadratic in (("training", training), ("held", held)):
            side = getattr(job, name)
            side.hessian = self._pointer(_padded(quadratic.hessian, padded))
            side.linear = self._pointer(_padded(quadratic.linear, padded))
            side.constant = quadratic.constant
        for name in ("x", "best_x", "training_trace", "held_trace"):
            setattr(job, name, self._pointer(getattr(self, name)))
        job.m, job.v = self._pointer(np.zeros(padded)), self._pointer(np.zeros(padded))
        scratch = 2 * padded
        if batches is not None:
            job.batch, job.columns_per_joint = batches.size, batches.columns.shape[2]
            scratch += 5 * batches.size * batches.q.shape[1]
            for name in ("q", "dq", "ddq", "tau", "columns", "unit"):
                setattr(job, name, self._pointer(getattr(batches, name)))
            job.weight = self._pointer(batches.weights)
        job.work = self._pointer(np.zeros(scratch))
        self._job = job

    def run(self, iterations: int, rows: NDArray[np.int64] | None = None) -> None:
        """Go on for so many iterations; with mini-batches rows is (iterations, batch)."""
        if rows is not None:
            whole = np.ascontiguousarray(rows, dtype=ctypes.c_long)
            self._job.rows = whole.ctypes.data_as(ctypes.POINTER(ctypes.c_long))
        self._function(ctypes.byref(self._job), iterations)

    @property
    def step(self) -> int:
        """Iterations done."""
        return int(self._job.step)

    @property
    def best(self) -> float:
        """Lowest validated loss."""
        return float(self._job.best)

    @property
    def finished(self) -> int:
        """0 while running, `PATIENCE` or `DIVERGED`."""
        return int(self._job.finished)

    @property
    def traced(self) -> int:
        """Number of validations in the traces."""
        return int(self._job.traced)

    def result(self) -> Array:
        """The best validated point."""
        return self.best_x[: self._size].copy()

    def _pointer(self, array: Array) -> object:
        whole = np.ascontiguousarray(array, dtype=np.float64)
        self._kept.append(whole)
        return whole.ctypes.data_as(_POINTER)


def _padded(array: Array, size: int) -> Array:
    return np.ascontiguousarray(np.pad(array, [(0, size - n) for n in array.shape]))
