"""Compiled descents and convex estimators: jobs of `<robot>_<level>_adam` and others as arrays.

A call works off any number of jobs, each a problem of its own; `run` may spread them over threads,
and since jobs share nothing the answers do not depend on how many.
"""

import ctypes
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime.library.arrays import Array, Integers
from runtime.library.binding import LANES, Binding, padded, padded_size, zeros
from runtime.library.parameters import N_PARAMETERS

PATIENCE, DIVERGED, CONVERGED, STALLED = 1, 2, 3, 4
_GROWTH = 2.0

_POINTER, _LONGS = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_long)
_DESCENT = (ctypes.c_void_p, ctypes.c_long, ctypes.c_long)  # jobs, their number, and iterations


@dataclass(frozen=True, slots=True, eq=False)
class LeastSquares:
    """L = (‖R y − r‖² + ρ) · scale in y = [K π(λ); ψ]; R is upper triangular."""

    factor: Array
    target: Array
    rest: float
    scale: float


@dataclass(frozen=True, slots=True, eq=False)
class AdamProblem:
    """One descent by Adam."""

    start: Array  # x = [λ, ψ]
    training: LeastSquares  # training, held: what to descend on, without samples, and to stop
    held: LeastSquares
    # [q dq ddq tau columns], columns in units of ψ; None descends on `training`
    samples: Array | None
    weights: Array  # diagonal of W of the samples, (n,)


class _LeastSquaresJob(ctypes.Structure):
    _fields_ = [
        *((name, _POINTER) for name in ("factor", "target")),
        *((name, ctypes.c_double) for name in ("rest", "scale")),
    ]


class _AdamJob(ctypes.Structure):
    """Field by field the struct of the generated header."""

    _fields_ = [
        *((name, ctypes.c_long) for name in ("size", "padded", "equations")),
        *((name, _LeastSquaresJob) for name in ("training", "held")),
        *((name, ctypes.c_double) for name in ("rate", "beta1", "beta2", "epsilon", "threshold")),
        *((name, ctypes.c_long) for name in ("validate_every", "patience")),
        *((name, _POINTER) for name in ("x", "m", "v", "best_x")),
        *((name, ctypes.c_double) for name in ("best", "power1", "power2")),
        *((name, ctypes.c_long) for name in ("step", "improved_at", "finished", "traced")),
        *((name, _POINTER) for name in ("training_trace", "held_trace")),
        *((name, ctypes.c_long) for name in ("batch", "columns_per_joint")),
        ("rows", _LONGS),
        *((name, _POINTER) for name in ("samples", "weight", "work")),
    ]


class _LevenbergJob(ctypes.Structure):
    """Field by field the struct of the generated header."""

    _fields_ = [
        *((name, ctypes.c_long) for name in ("size", "equations", "cholesky")),
        ("training", _LeastSquaresJob),
        ("first_damping", ctypes.c_double),
        *((name, ctypes.c_double) for name in ("step_tolerance", "decrease_tolerance")),
        *((name, _POINTER) for name in ("x", "trace")),
        *((name, ctypes.c_double) for name in ("loss", "damping", "growth")),
        *((name, ctypes.c_long) for name in ("step", "finished", "traced")),
        ("work", _POINTER),
    ]


class Jobs:
    """An array of jobs and the arrays they point to."""

    def __init__(self, function: Callable[..., None], kind: Any, count: int) -> None:
        self._function = function
        self._jobs = (kind * count)()
        self._kept: list[NDArray[np.generic]] = []

    def __len__(self) -> int:
        return len(self._jobs)

    def __getitem__(self, index: int) -> Any:
        """State of one job: step, finished, traced, and best or loss."""
        return self._jobs[index]

    def __iter__(self) -> Iterator[Any]:
        return iter(self._jobs)

    def _pointer(self, array: Array) -> Any:
        whole = np.ascontiguousarray(array, dtype=np.float64)
        self._kept.append(whole)
        return whole.ctypes.data_as(_POINTER)

    def _factor(self, side: Any, problem: LeastSquares, equations: int) -> None:
        side.factor = self._pointer(_padded(problem.factor.T, equations))
        side.target = self._pointer(_padded(problem.target, equations))
        side.rest, side.scale = problem.rest, problem.scale

    def _run(self, threads: int, *arguments: int) -> None:
        def part(bounds: tuple[int, int]) -> None:
            first, end = bounds
            self._function(ctypes.byref(self._jobs[first]), end - first, *arguments)

        count = max(1, min(threads, len(self)))
        edges = [len(self) * k // count for k in range(count + 1)]
        if count == 1:
            part((0, len(self)))
            return
        with ThreadPoolExecutor(count) as pool:
            list(pool.map(part, pairwise(edges)))


class CompiledAdam(Jobs):
    """Descents by Adam; `run` goes on where the last call stopped.

    options: rate, beta1, beta2, epsilon, threshold, validate_every, patience. traces: the largest
    number of validations per job. batch: samples per mini-batch; 0 descends on compressed data.
    """

    def __init__(
        self,
        binding: Binding,
        problems: Sequence[AdamProblem],
        options: dict[str, float],
        traces: int,
        batch: int,
    ) -> None:
        super().__init__(binding.program("adam", *_DESCENT), _AdamJob, len(problems))
        self.training_trace = np.zeros((len(problems), traces))
        self.held_trace = np.zeros((len(problems), traces))
        self._x: list[Array] = []
        self._best: list[Array] = []
        for k, problem in enumerate(problems):
            self._fill(k, problem, options, batch)

    def _fill(self, k: int, problem: AdamProblem, options: dict[str, float], batch: int) -> None:
        job, size = self._jobs[k], problem.start.size
        job.size, job.padded = size, padded_size(size)
        job.equations = padded_size(len(problem.training.target))
        job.power1 = job.power2 = 1.0
        for name, value in options.items():
            setattr(job, name, value)
        self._factor(job.training, problem.training, job.equations)
        self._factor(job.held, problem.held, job.equations)
        self._x.append(_padded(problem.start, job.padded))
        self._best.append(zeros(job.padded))
        job.x, job.best_x = self._pointer(self._x[k]), self._pointer(self._best[k])
        job.m, job.v = self._pointer(zeros(job.padded)), self._pointer(zeros(job.padded))
        job.training_trace = self._pointer(self.training_trace[k])
        job.held_trace = self._pointer(self.held_trace[k])
        n = problem.weights.size
        if batch and problem.samples is not None:
            job.batch, job.columns_per_joint = batch, problem.samples.shape[1] // n - 4
            # Rows [q dq ddq tau columns] in the order of `mini_batch` in descent.c.
            q, rest = problem.samples[:, :n], problem.samples[:, n:]
            pairs = np.stack((np.sin(q), np.cos(q)), axis=2).reshape(len(q), 2 * n)
            rows = np.hstack([pairs, rest, q])
            job.samples = self._pointer(padded(rows, padded_size(rows.shape[1])))
            job.weight = self._pointer(problem.weights)
        width, equations = padded_size((6 + job.columns_per_joint) * n), job.equations
        scratch = LANES * (width + size) + (4 + equations) * equations + job.padded
        job.work = self._pointer(zeros(scratch))

    def run(
        self, iterations: int, rows: Sequence[Integers] | None = None, threads: int = 1
    ) -> None:
        """Continue all jobs; rows: indices of samples per job, (iterations, batch)."""
        kept = [np.ascontiguousarray(r, dtype=ctypes.c_long) for r in rows or ()]
        for job, named in zip(self._jobs, kept, strict=False):
            job.rows = named.ctypes.data_as(_LONGS)
        self._run(threads, iterations)

    def x(self, index: int) -> Array:
        """The current point of a job."""
        return self._x[index][: self._jobs[index].size].copy()

    def best_x(self, index: int) -> Array:
        """The best validated point of a job."""
        return self._best[index][: self._jobs[index].size].copy()


class CompiledLevenberg(Jobs):
    """Levenberg–Marquardt descents in λ or log-Cholesky θ; `run` continues them.

    options: first_damping, step_tolerance, decrease_tolerance. traces: the largest number of
    accepted steps per job. cholesky: x begins with θ instead of λ.
    """

    def __init__(
        self,
        binding: Binding,
        starts: Sequence[Array],
        problems: Sequence[LeastSquares],
        options: dict[str, float],
        traces: int,
        cholesky: bool = False,
    ) -> None:
        super().__init__(binding.program("levenberg", *_DESCENT), _LevenbergJob, len(problems))
        self.trace = np.zeros((len(problems), traces))
        self._x: list[Array] = []
        for k, (start, problem) in enumerate(zip(starts, problems, strict=True)):
            job, size, equations = self._jobs[k], start.size, padded_size(len(problem.target))
            job.size, job.equations, job.growth = size, equations, _GROWTH
            job.cholesky = int(cholesky)
            for name, value in options.items():
                setattr(job, name, value)
            self._factor(job.training, problem, equations)
            self._x.append(np.array(start, dtype=float))
            job.x, job.trace = self._pointer(self._x[k]), self._pointer(self.trace[k])
            scratch = equations * (size + 2 * equations + 3) + 2 * size
            job.work = self._pointer(zeros(scratch))

    def run(self, iterations: int, threads: int = 1) -> None:
        """Continue all jobs for a number of iterations."""
        self._run(threads, iterations)

    def x(self, index: int) -> Array:
        """The current point of a job."""
        return self._x[index].copy()


def _padded(array: Array, size: int) -> Array:
    whole = zeros(*(size for _ in array.shape))
    whole[tuple(slice(n) for n in array.shape)] = array
    return whole


@dataclass(frozen=True, slots=True, eq=False)
class ConvexTask:
    """(‖A π − b‖² + ρ)/2N + γ Σ share_k (slope_k·π_k − log det P_k), for each γ in turn."""

    factor: Array  # factor, target, rest, count: A (m, 10 n), b (m,), ρ and N
    target: Array
    rest: float
    count: float
    slope: Array  # (10 n,)
    share: Array  # (n,), above 0
    gammas: Array  # one or more
    start: Array  # π, strictly inside


@dataclass(frozen=True, slots=True, eq=False)
class ConvexAnswer:
    """Minimiser, loss, decrement and steps for each γ up to the first that failed."""

    points: Array
    losses: Array
    decrements: Array
    steps: Integers
    converged: bool


class _ConvexJob(ctypes.Structure):
    """Field by field the struct of the generated header."""

    _fields_ = [
        *((name, ctypes.c_long) for name in ("links", "width", "rows")),
        *((name, _POINTER) for name in ("factor", "target")),
        *((name, ctypes.c_double) for name in ("rest", "count")),
        *((name, _POINTER) for name in ("slope", "share", "gamma")),
        *((name, ctypes.c_long) for name in ("gammas", "most_steps")),
        ("tolerance", ctypes.c_double),
        *((name, _POINTER) for name in ("pi", "points", "losses", "decrements")),
        ("steps", _LONGS),
        ("converged", ctypes.c_long),
        ("work", _POINTER),
    ]


class CompiledConvex(Jobs):
    """Convex estimators; every call of `run` solves them all anew.

    tolerance: of the Newton decrement, in units of the smallest γ · share. most_steps: per γ.
    """

    def __init__(
        self, binding: Binding, tasks: Sequence[ConvexTask], tolerance: float, most_steps: int
    ) -> None:
        function = binding.program("convex", ctypes.c_void_p, ctypes.c_long)
        super().__init__(function, _ConvexJob, len(tasks))
        self._starts: list[Array] = []
        self._answers: list[tuple[Array, Array, Array, Integers]] = []
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
                points[: _reached(job), : start.size - job.width + N_PARAMETERS * job.links].copy(),
                losses[: _reached(job)].copy(),
                decrements[: _reached(job)].copy(),
                steps[: _reached(job)].astype(np.int64),
                bool(job.converged == job.gammas),
            )
            for job, start, (points, losses, decrements, steps) in zip(
                self._jobs, self._starts, self._answers, strict=True
            )
        ]

    def _fill(self, job: _ConvexJob, task: ConvexTask) -> None:
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


def _reached(job: _ConvexJob) -> int:
    """γs that were tried: the converged ones and the first that was not."""
    return int(min(job.converged + 1, job.gammas))
