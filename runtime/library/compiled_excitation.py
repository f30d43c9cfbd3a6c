"""The compiled cost of a trajectory: the job of `<robot>_<level>_excitation_cost`."""

import ctypes
import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.library.binding import LANES, padded_size, zeros

Array = NDArray[np.float64]


_POINTER = ctypes.POINTER(ctypes.c_double)


class _Job(ctypes.Structure):
    """Field by field the struct of the generated header."""

    _fields_ = [
        *((name, ctypes.c_long) for name in ("samples", "harmonics")),
        *((name, _POINTER) for name in ("basis", "home", "work")),
        *((name, ctypes.c_double) for name in ("value", "lowest", "highest")),
        ("deficient", ctypes.c_long),
    ]


@dataclass(frozen=True, slots=True, eq=False)
class ExcitationFunctions:
    """`excitation_cost` and `excitation_work` of one level."""

    cost: Callable[..., float]
    work: Callable[..., int]


class CompiledExcitation:
    """log cond W̄_b and its gradient in a; threads may share it, each has its own work."""

    def __init__(self, functions: ExcitationFunctions, home: Array, basis: Array) -> None:
        """Take home (n,) [rad, m] and basis (N, M, 3), φ, φ', φ'' at the samples."""
        self._functions = functions
        self._home = np.array(home, dtype=float)
        self._samples, self._harmonics, _ = basis.shape
        self._basis = tiled(basis)
        self._local = threading.local()

    def value(self, coefficients: Array) -> float:
        """The cost alone; coefficients (n, M)."""
        return self._workplace(coefficients).run(False)

    def value_gradient(self, coefficients: Array) -> tuple[float, Array]:
        """The cost and ∂cost/∂a, (n, M)."""
        place = self._workplace(coefficients)
        return place.run(True), place.gradient.copy()

    def deficient(self) -> bool:
        """Whether the last regressor of this thread was rank-deficient to rounding."""
        return bool(self._local.place.job.deficient)

    def _workplace(self, coefficients: Array) -> "_Workplace":
        place = getattr(self._local, "place", None)
        if place is None:
            place = self._local.place = _Workplace(self._functions, self._job())
            place.keep(np.zeros((len(self._home), self._harmonics)))
        place.coefficients[...] = coefficients
        return place

    def _job(self) -> _Job:
        job = _Job(samples=self._samples, harmonics=self._harmonics)
        job.basis, job.home = _pointer(self._basis), _pointer(self._home)
        return job


class _Workplace:
    """Arrays that one thread writes to; their addresses are looked up once."""

    def __init__(self, functions: ExcitationFunctions, job: _Job) -> None:
        self.job, self._cost = job, functions.cost
        self._work = zeros(functions.work(ctypes.byref(job)))
        job.work = _pointer(self._work)

    def keep(self, like: Array) -> None:
        """Arrays for a and the gradient."""
        self.coefficients, self.gradient = like, np.zeros_like(like)
        self._arguments = (
            ctypes.byref(self.job),
            self.coefficients.ctypes.data,
            self.gradient.ctypes.data,
        )

    def run(self, slope: bool) -> float:
        job, a, gradient = self._arguments
        return self._cost(job, a, gradient if slope else None)


def tiled(basis: Array) -> Array:
    """(N, M, 3) as tiles of 8 samples, (tiles, 3, M, 8), zero beyond the last sample."""
    samples, harmonics, orders = basis.shape
    tiles = padded_size(samples) // LANES
    result = zeros(tiles, orders, harmonics, LANES)
    padded = np.zeros((padded_size(samples), harmonics, orders))
    padded[:samples] = basis
    result[...] = padded.reshape(tiles, LANES, harmonics, orders).transpose(0, 3, 2, 1)
    return result


def _pointer(array: Array) -> object:
    return array.ctypes.data_as(_POINTER)
