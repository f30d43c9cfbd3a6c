"""Kernels of the CUDA header: registers without a GPU; with one, digits and rates by the driver.

The roofline of a kernel is the smaller of two rates: memory of 4.8 TB/s over the bytes of a sample,
and 132 multiprocessors of 128 lanes (64 in double precision) at 1.98 GHz over its operations, one
instruction each. Sines count as one operation, so that no kernel with sines reaches it.
"""

import ctypes
import time
from typing import Any

import numpy as np

from bench.front import Sheet, sheet_of
from runtime.errors import LibraryError
from runtime.library import Library
from runtime.library.cuda import TYPES, Gpu, device_code
from runtime.library.manifest import KernelFacts

KERNELS = (
    *("base_inverse_dynamics", "inverse_dynamics", "bias_forces", "mass_matrix"),
    *("forward_dynamics", "torque_derivatives", "weighted_rows", "losses"),
)
BYTES_PER_S, CYCLES_PER_S = 4.8e12, 132 * 1.98e9
NUMPY = {"float": np.float32, "double": np.float64}
LANES = {"float": 128, "double": 64}
BOUND = {"float": 1e-5, "double": 1e-11}
"""Largest error of the digits, relative to the largest number."""
LAUNCHES = 20


COLUMNS = {
    **{"kernel": "", "precision": "", "registers": "", "spilled, bytes": ""},
    **{"roofline, 1/s": ".1e", "measured, 1/s": ""},
}
"""Rates per second, of losses per vector and sample."""


def measure(lib: Library, samples: int, sets: int, rows: int) -> Sheet:
    """Every kernel in both precisions, measured where there is a GPU."""
    try:
        device: _Device | None = _Device(Gpu(lib.folder))
    except LibraryError:
        device = None
    architecture = device.gpu.architecture if device else "sm_90"
    found = []
    for kernel in KERNELS:
        for dtype, precision in (("float", "single"), ("double", "double")):
            code = device_code(lib.folder, [kernel], dtype, architecture)
            roofline, measured = _roofline(lib, kernel, dtype, rows), None
            if device and kernel == "losses":
                measured = _losses(device, lib, dtype, sets, rows)
            elif device and kernel != "weighted_rows":
                measured = _samples(device, lib, kernel, dtype, samples)
            shown = f"{measured:.1e} ({measured / roofline:.0%})" if measured else "not measured"
            use = code.registers[kernel], code.spilled[kernel]
            found.append((kernel, precision, *use, roofline, shown))
    return sheet_of("bench_cuda", COLUMNS, found, title="Kernels of the CUDA header on an H200")


def _facts(lib: Library, kernel: str) -> KernelFacts:
    return lib.manifest.kernels[kernel]


def _roofline(lib: Library, kernel: str, dtype: str, rows: int) -> float:
    """Samples per second at most; of losses products of a vector and a sample."""
    facts = _facts(
        lib, {"weighted_rows": "base_regressor", "losses": "base_regressor"}.get(kernel, kernel)
    )
    filled = np.count_nonzero(_regressor(lib))
    operations, numbers = facts.operations, sum(a.size for a in facts.inputs if not a.shared)
    if kernel == "losses":  # per row: two multiply-adds per nonzero; vector and gradient once
        operations, numbers = 2 * filled, 2 * len(lib.base_columns) / rows
    elif kernel == "weighted_rows":
        numbers += filled + 2 * lib.n_joints
    else:
        numbers += sum(a.size for a in facts.outputs)
    issue = CYCLES_PER_S * LANES[dtype] / operations
    return min(issue, BYTES_PER_S / (numbers * TYPES[dtype]))


def _regressor(lib: Library) -> Any:
    rng = np.random.default_rng(0)
    return lib.base_regressor(*rng.uniform(0.1, 1.0, (3, lib.n_joints)))


def _samples(device: "_Device", lib: Library, kernel: str, dtype: str, n: int) -> float:
    facts, rng = _facts(lib, kernel), np.random.default_rng(1)
    known = {"pi": lib.pi0, "beta": lib.base_matrix @ lib.pi0, "rotor": np.full(lib.n_joints, 0.1)}
    inputs = [known.get(a.name, rng.uniform(-1.0, 1.0, (a.size, 1000))) for a in facts.inputs]
    arrays = []
    for values in inputs:
        tiled = values if values.ndim == 1 else np.tile(values, -(-n // 1000))[:, :n]
        place = device.put(np.ascontiguousarray(tiled, NUMPY[dtype]))
        arrays.append((place, 1, 0) if values.ndim == 1 else (place, n, 1))
    outputs = [device.room(a.size * n * TYPES[dtype]) for a in facts.outputs]
    arrays += [(place, n, 1) for place in outputs]
    took = device.seconds(lambda: device.gpu.launch(kernel, n, *arrays, dtype=dtype))
    exact = getattr(lib, kernel)(*(x if x.ndim == 1 else x.T for x in inputs))
    exact = exact if isinstance(exact, tuple) else (exact,)
    for argument, place, theirs in zip(facts.outputs, outputs, exact, strict=True):
        mine = device.get(place, (argument.size, n), dtype)[:, : min(n, 1000)].T
        _require_digits(kernel, mine, theirs.reshape(1000, -1)[: min(n, 1000)], dtype)
    device.free()
    return n / took


def _losses(device: "_Device", lib: Library, dtype: str, sets: int, rows: int) -> float:
    rng, b = np.random.default_rng(2), len(lib.base_columns)
    states = [rng.uniform(-1.0, 1.0, (lib.n_joints, rows)) for _ in range(4)]
    weight = np.ones(lib.n_joints)
    drawn = (lib.base_matrix @ lib.pi0)[:, None] * (1 + 0.01 * rng.standard_normal((b, 1000)))
    beta = np.tile(drawn, -(-sets // 1000))[:, :sets]
    arrays = [(device.put(np.ascontiguousarray(x, NUMPY[dtype])), rows, 1) for x in states]
    arrays.append((device.put(weight.astype(NUMPY[dtype])), 1, 0))
    padded = -(-(np.count_nonzero(_regressor(lib)) + lib.n_joints) // 4) * 4
    stored = ctypes.c_void_p(device.room(rows * padded * TYPES[dtype]))
    device.gpu.launch("weighted_rows", rows, *arrays, stored, dtype=dtype)
    given = (device.put(np.ascontiguousarray(beta, NUMPY[dtype])), sets, 1)
    losses, gradients = (device.room(size * sets * TYPES[dtype]) for size in (1, b))
    words = (rows, stored, given, ctypes.c_void_p(losses), ctypes.c_void_p(gradients))
    took = device.seconds(lambda: device.gpu.launch("losses", sets, *words, dtype=dtype))
    count = min(sets, 8)
    Y = lib.base_regressor(*(x.T for x in states[:3])).reshape(-1, b)
    exact = Y.T @ (Y @ drawn[:, :count] - states[3].T.reshape(-1, 1))
    mine = device.get(gradients, (b, sets), dtype)[:, :count].T
    _require_digits("losses", mine, exact.T, dtype)
    device.free()
    return sets * rows / took


def _require_digits(kernel: str, mine: Any, theirs: Any, dtype: str) -> None:
    error = np.abs(mine - theirs).max() / np.abs(theirs).max()
    if not error <= BOUND[dtype]:
        raise LibraryError(f"{kernel} in {dtype} differs from the C kernel by {error:.1e}")


class _Device:
    """Memory of a GPU and the time of launches."""

    def __init__(self, gpu: Gpu) -> None:
        self.gpu, self._places = gpu, list[int]()
        self._do("cuCtxSetCurrent", gpu.context)

    def _do(self, name: str, *arguments: Any) -> None:
        self.gpu.call(name, *arguments)

    def room(self, size: int) -> int:
        place = ctypes.c_uint64()
        self._do("cuMemAlloc_v2", ctypes.byref(place), ctypes.c_size_t(size))
        self._places.append(place.value)
        return place.value

    def put(self, values: Any) -> int:
        place = self.room(values.nbytes)
        here = ctypes.c_void_p(values.ctypes.data)
        self._do("cuMemcpyHtoD_v2", ctypes.c_uint64(place), here, ctypes.c_size_t(values.nbytes))
        return place

    def get(self, place: int, shape: tuple[int, ...], dtype: str) -> Any:
        values = np.empty(shape, NUMPY[dtype])
        here = ctypes.c_void_p(values.ctypes.data)
        self._do("cuMemcpyDtoH_v2", here, ctypes.c_uint64(place), ctypes.c_size_t(values.nbytes))
        return values

    def free(self) -> None:
        for place in self._places:
            self._do("cuMemFree_v2", ctypes.c_uint64(place))
        self._places.clear()

    def seconds(self, launch: Any) -> float:
        """Time of one launch, the mean of many in a row."""
        launch()
        self._do("cuCtxSynchronize")
        start = time.perf_counter()
        for _ in range(LAUNCHES):
            launch()
        self._do("cuCtxSynchronize")
        return (time.perf_counter() - start) / LAUNCHES
