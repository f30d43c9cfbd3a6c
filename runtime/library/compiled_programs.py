"""Compiled programs of a level on NumPy arrays: cost of a trajectory, closed loop.

`<robot>_<level>_excitation_cost`, `<robot>_closed_loop`.
"""

import ctypes
import threading
from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.library.arrays import Array
from runtime.library.binding import LANES, Binding, padded_size, typed, zeros

_ADDRESS, _LONG = ctypes.c_void_p, ctypes.c_long


_POINTER = ctypes.POINTER(ctypes.c_double)


class _CostJob(ctypes.Structure):
    """Field by field the struct of the generated header."""

    _fields_ = [
        *((name, ctypes.c_long) for name in ("samples", "harmonics")),
        *((name, _POINTER) for name in ("basis", "home", "work")),
        *((name, ctypes.c_double) for name in ("value", "lowest", "highest")),
        ("deficient", ctypes.c_long),
    ]


class CompiledExcitation:
    """log cond W̄_b and its gradient in a; threads may share it, each has its own work."""

    def __init__(self, cost: Any, work: Any, home: Array, basis: Array) -> None:
        """Take home (n,) [rad, m] and basis (N, M, 3), φ, φ', φ'' at the samples."""
        self._cost = typed(cost, ctypes.c_double, *(_ADDRESS,) * 3)
        self._work = typed(work, _LONG, _ADDRESS)
        self._home = np.array(home, dtype=float)
        self._samples, self._harmonics, _ = basis.shape
        self._basis = tiled(basis)
        self._local = threading.local()

    @classmethod
    def of(cls, binding: Binding, home: Array, basis: Array) -> "CompiledExcitation | None":
        """The cost of the level; None where the level has none."""
        cost, work = binding.of_level("excitation_cost"), binding.of_level("excitation_work")
        return None if cost is None or work is None else cls(cost, work, home, basis)

    def value(self, coefficients: Array) -> float:
        """The cost alone; coefficients (n, M)."""
        return self._workplace(coefficients).run(False)

    def value_gradient(self, coefficients: Array) -> tuple[float, Array]:
        """The cost and ∂cost/∂a, (n, M)."""
        place = self._workplace(coefficients)
        return place.run(True), place.gradient.copy()

    def _workplace(self, coefficients: Array) -> "_Workplace":
        place = getattr(self._local, "place", None)
        if place is None:
            shape = len(self._home), self._harmonics
            place = self._local.place = _Workplace(self._cost, self._work, self._job(), shape)
        place.coefficients[...] = coefficients
        return place

    def _job(self) -> _CostJob:
        job = _CostJob(samples=self._samples, harmonics=self._harmonics)
        job.basis, job.home = _pointer(self._basis), _pointer(self._home)
        return job


class _Workplace:
    """Arrays that one thread writes to; their addresses are looked up once."""

    def __init__(self, cost: Any, work: Any, job: _CostJob, shape: tuple[int, int]) -> None:
        self.job, self._cost = job, cost
        self._work = zeros(work(ctypes.byref(job)))
        job.work = _pointer(self._work)
        self.coefficients, self.gradient = np.zeros(shape), np.zeros(shape)
        arrays = (each.ctypes.data for each in (self.coefficients, self.gradient))
        self._arguments = (ctypes.byref(job), *arrays)

    def run(self, slope: bool) -> float:
        job, a, gradient = self._arguments
        return float(self._cost(job, a, gradient if slope else None))


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


NOT_POSITIVE, RAN_AWAY = 1, 2  # early stops: M + J is not positive definite; the motion diverged


class _LoopJob(ctypes.Structure):
    """Field by field the struct of the generated header."""

    _fields_ = [
        ("substeps", ctypes.c_long),
        *((name, ctypes.c_double) for name in ("period", "coulomb_speed")),
        *((name, _POINTER) for name in ("reference", "noise")),
        *((name, _POINTER) for name in ("pi", "rotor", "viscous", "coulomb", "offset")),
        *((name, _POINTER) for name in ("model", "model_rotor", "stiffness", "damping")),
        *((name, _POINTER) for name in ("state", "log")),
        *((name, ctypes.c_long) for name in ("done", "status")),
    ]


@dataclass(frozen=True, slots=True)
class ClosedLoopPlant:
    """The plant: (M(π) + J) ddq + h + viscous dq + coulomb tanh(dq/ε) + offset = τ; (n,) each."""

    pi: Array
    rotor: Array
    viscous: Array
    coulomb: Array
    offset: Array
    coulomb_speed: float


@dataclass(frozen=True, slots=True)
class ClosedLoopController:
    """The controller: τ = ID(q, dq, u; model) + J_c u, u of computed torque; gains (n,)."""

    model: Array
    model_rotor: Array
    stiffness: Array
    damping: Array


class CompiledClosedLoop:
    """A plant under its controller; `run` goes on where the last call stopped.

    reference: q_d, dq_d, ddq_d per period [s], (N, 3, n). substeps: of the plant per period.
    noise: on the measured q and dq, (N, 2, n).
    """

    def __init__(
        self,
        binding: Binding,
        body: ClosedLoopPlant,
        law: ClosedLoopController,
        reference: Array,
        period: float,
        substeps: int,
        noise: Array | None = None,
    ) -> None:
        self._function = binding.plain("closed_loop", ctypes.c_void_p, ctypes.c_long)
        count, _, n = reference.shape
        self._count = count
        self.log = np.zeros((count, 5, n))
        """q, dq, ddq, torque of the motors and behind the rotors, per period."""
        self._state = np.ascontiguousarray(reference[0, :2], dtype=float).copy()
        job = self._job = _LoopJob(
            substeps=substeps, period=period, coulomb_speed=body.coulomb_speed
        )
        values = {name: getattr(part, name) for part in (body, law) for name in part.__slots__}
        arrays: dict[str, Array] = {k: x for k, x in values.items() if k != "coulomb_speed"}
        arrays |= {"reference": reference, "state": self._state, "log": self.log}
        if noise is not None:
            arrays["noise"] = noise
        self._kept = {
            name: np.ascontiguousarray(array, dtype=float) for name, array in arrays.items()
        }
        for name, array in self._kept.items():
            setattr(job, name, array.ctypes.data_as(_POINTER))

    def run(self, periods: int) -> None:
        """Continue for a number of periods, at most to the end of the reference."""
        self._function(ctypes.byref(self._job), min(periods, self._count - self.done))

    @property
    def done(self) -> int:
        """Periods that are simulated."""
        return int(self._job.done)

    @property
    def status(self) -> int:
        """0, `NOT_POSITIVE` or `RAN_AWAY`."""
        return int(self._job.status)
