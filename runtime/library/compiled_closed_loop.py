"""The compiled closed loop: the job of `<robot>_closed_loop` as NumPy arrays."""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NOT_POSITIVE, RAN_AWAY = 1, 2
"""Reasons of an early stop: M + J is not positive definite; the motion diverged."""

_POINTER = ctypes.POINTER(ctypes.c_double)


class _Job(ctypes.Structure):
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
    """A simulation; `run` goes on where the last call stopped.

    Args:
        function: of the library.
        body: plant.
        law: controller.
        reference: q_d, dq_d, ddq_d per period, (N, 3, n).
        period: of the controller, s.
        substeps: of the plant per period.
        noise: what the controller sees too much of q and dq, (N, 2, n), or None.
    """

    def __init__(
        self,
        function: Callable[..., None],
        body: ClosedLoopPlant,
        law: ClosedLoopController,
        reference: Array,
        period: float,
        substeps: int,
        noise: Array | None = None,
    ) -> None:
        self._function = function
        count, _, n = reference.shape
        self._count = count
        self.log = np.zeros((count, 5, n))
        """q, dq, ddq, torque of the motors and behind the rotors, per period."""
        self._state = np.ascontiguousarray(reference[0, :2], dtype=float).copy()
        job = self._job = _Job(substeps=substeps, period=period, coulomb_speed=body.coulomb_speed)
        arrays: dict[str, Array] = {
            name: getattr(part, name)
            for part in (body, law)
            for name in part.__slots__
            if name != "coulomb_speed"
        }
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
        left = min(periods, self._count - self.done)
        self._function(ctypes.byref(self._job), left)

    @property
    def done(self) -> int:
        """Periods that are simulated."""
        return int(self._job.done)

    @property
    def status(self) -> int:
        """0, `NOT_POSITIVE` or `RAN_AWAY`."""
        return int(self._job.status)
