"""The compiled statistics of a level: `<robot>_<level>_statistics` and `_join` on NumPy arrays."""

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_POINTER, _LONG = ctypes.c_void_p, ctypes.c_long


class CompiledStatistics:
    """Triangles R of samples, and of triangles; columns are [F; Y_b; τ], friction joint by joint.

    The calls leave Python's lock, so that several threads may run them at once.
    """

    def __init__(self, of_level: Callable[[str], Any], update: Any, joints: int, base: int) -> None:
        self._joints, self._base = joints, base
        pointers = (_POINTER,) * 5
        self._update = _typed(update, None, _POINTER, ctypes.c_double, *pointers)
        self._work = _typed(of_level("statistics_work"), _LONG, _LONG)
        self._join_work = _typed(of_level("statistics_join_work"), _LONG, _LONG, _LONG)
        state = (_POINTER,) * 4
        ends = (*(_POINTER,) * 5, _LONG)
        self._run = _typed(of_level("statistics"), _LONG, _LONG, *state, _LONG, *ends)
        self._join = _typed(of_level("statistics_join"), None, _LONG, _LONG, *(_POINTER,) * 3)

    def triangle(
        self,
        q: Array,
        dq: Array,
        ddq: Array,
        tau: Array,
        columns: Array,
        weights: Array,
        sample_weights: Array | None,
        products: bool = True,
    ) -> tuple[Array, int]:
        """Triangle R with RᵀR = Σ s [F Y_b τ]ᵀ W [F Y_b τ] and a diagonal ≥ 0, of contiguous
        arrays.

        q (N, n) [rad, m], dq (N, n) [rad/s, m/s], ddq (N, n) [rad/s², m/s²], tau (N, n) [N·m, N],
        columns (N, n, k), weights (n,), sample_weights (N,).
        """
        k = columns.shape[2]
        size = self._joints * k + self._base + 1
        work, triangle = np.empty(self._work(k)), np.empty((size, size))
        state = (a.ctypes.data for a in (q, dq, ddq, tau))
        extra = None if sample_weights is None else sample_weights.ctypes.data
        ends = (weights.ctypes.data, extra, work.ctypes.data, triangle.ctypes.data)
        multiplied = self._run(len(q), *state, k, columns.ctypes.data, *ends, int(products))
        return triangle, int(multiplied)

    def update(
        self,
        triangle: Array,
        forgetting: float,
        q: Array,
        dq: Array,
        ddq: Array,
        tau: Array,
        weights: Array,
    ) -> None:
        """Add one sample to a triangle over [β; τ], in place.

        triangle (n_b + 1, n_b + 1), q (n,) [rad, m], dq (n,) [rad/s, m/s], ddq (n,) [rad/s², m/s²],
        tau (n,) [N·m, N], weights (n,).
        """
        state = (a.ctypes.data for a in (q, dq, ddq, tau, weights))
        self._update(triangle.ctypes.data, forgetting, *state)

    def join(self, triangles: Array) -> Array:
        """One triangle (p, p) for the rows of several, (count, p, p) and contiguous."""
        count, size = triangles.shape[:2]
        work, triangle = np.empty(self._join_work(size, count)), np.empty((size, size))
        ends = (triangles.ctypes.data, work.ctypes.data, triangle.ctypes.data)
        self._join(size, count, *ends)
        return triangle


def _typed(function: Any, result: Any, *arguments: Any) -> Any:
    function.restype, function.argtypes = result, arguments
    return function
