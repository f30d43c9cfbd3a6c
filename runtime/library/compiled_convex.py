"""The compiled convex estimator: jobs of `<robot>_<level>_convex` as NumPy arrays.

A call works off any number of jobs over threads; jobs share nothing, so the answers do not depend
on how many threads there are.
"""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.library.binding import padded, padded_size, zeros
from runtime.library.compiled_descent import Jobs
from runtime.library.parameters import N_PARAMETERS

Array = NDArray[np.float64]

_DOUBLES, _LONGS = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_long)


@dataclass(frozen=True, slots=True, eq=False)
class ConvexTask:
    """(‖A π − b‖² + ρ)/2N + γ Σ share_k (slope_k·π_k − log det P_k), for each γ in turn.

    Attributes:
        factor, target, rest, count: A (m, 10 n), b (m,), ρ and N.
        slope: (10 n,).
        share: (n,), above 0.
        gammas: one or more.
        start: π, strictly inside.
    """

    factor: Array
    target: Array
    rest: float
    count: float
    slope: Array
    share: Array
    gammas: Array
    start: Array


@dataclass(frozen=True, slots=True, eq=False)
class ConvexAnswer:
    """Minimiser, loss, decrement and steps for each γ up to the first that failed."""

    points: Array
    losses: Array
    decrements: Array
    steps: NDArray[np.int64]
    converged: bool


class _Job(ctypes.Structure):
    """Field by field the struct of the generated header."""

    _fields_ = [
        *((name, ctypes.c_long) for name in ("links", "width", "rows")),
        *((name, _DOUBLES) for name in ("factor", "target")),
        *((name, ctypes.c_double) for name in ("rest", "count")),
        *((name, _DOUBLES) for name in ("slope", "share", "gamma")),
        *((name, ctypes.c_long) for name in ("gammas", "most_steps")),
        ("tolerance", ctypes.c_double),
        *((name, _DOUBLES) for name in ("pi", "points", "losses", "decrements")),
        ("steps", _LONGS),
        ("converged", ctypes.c_long),
        ("work", _DOUBLES),
    ]


class CompiledConvex(Jobs):
    """An array of jobs and the arrays they point to; every call of `run` solves them all anew.

    Args:
        function: of the library.
        tasks: one per job.
        tolerance: of the decrement, in units of the smallest γ · share.
        most_steps: per γ.
    """

    def __init__(
        self,
        function: Callable[..., None],
        tasks: Sequence[ConvexTask],
        tolerance: float,
        most_steps: int,
    ) -> None:
        super().__init__(function, _Job, len(tasks))
        self._starts: list[Array] = []
        self._answers: list[tuple[Array, Array, Array, NDArray[np.int64]]] = []
        self._pi: list[Array] = []
        for job, task in zip(self._jobs, tasks, strict=True):
            self._fill(job, task)
            job.tolerance, job.most_steps = tolerance, most_steps

    def run(self, threads: int = 1) -> list[ConvexAnswer]:
        """Solve all from their starts."""
        for pi, start in zip(self._pi, self._starts, strict=True):
            pi[:] = start
        if self._jobs:
            self._run(threads)
        return [
            ConvexAnswer(
                points[: _reached(job), : start.size - _spare(job)].copy(),
                losses[: _reached(job)].copy(),
                decrements[: _reached(job)].copy(),
                steps[: _reached(job)].astype(np.int64),
                bool(job.converged == job.gammas),
            )
            for job, start, (points, losses, decrements, steps) in zip(
                self._jobs, self._starts, self._answers, strict=True
            )
        ]

    def _fill(self, job: _Job, task: ConvexTask) -> None:
        rows, size = task.factor.shape
        width, gammas = padded_size(size), len(task.gammas)
        job.links, job.width, job.rows, job.gammas = len(task.share), width, rows, gammas
        job.rest, job.count = task.rest, task.count
        job.factor = self._pointer(padded(task.factor, width))
        job.target = self._pointer(task.target)
        job.slope, job.share = self._pointer(task.slope), self._pointer(task.share)
        job.gamma = self._pointer(task.gammas)
        self._starts.append(padded(np.asarray(task.start, dtype=float), width))
        self._pi.append(self._starts[-1].copy())
        answer = (np.zeros((gammas, width)), np.zeros(gammas), np.zeros(gammas))
        steps = np.zeros(gammas, dtype=ctypes.c_long)
        self._answers.append((*answer, steps))
        job.pi = self._pointer(self._pi[-1])
        job.points, job.losses, job.decrements = (self._pointer(a) for a in answer)
        job.steps = steps.ctypes.data_as(_LONGS)
        job.work = self._pointer(zeros(2 * width * width + 5 * width + 2 * rows))


def _reached(job: _Job) -> int:
    """γs that were tried: the converged ones and the first that was not."""
    return int(min(job.converged + 1, job.gammas))


def _spare(job: _Job) -> int:
    return int(job.width - N_PARAMETERS * job.links)
