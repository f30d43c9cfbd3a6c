"""The compiled library through ctypes: its functions, called with NumPy arrays."""

import ctypes
import math
import shutil
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from runtime.common.files import json_of, sha256_of
from runtime.common.threads import cores
from runtime.common.user_builds import is_user_build
from runtime.errors import LibraryError, ShapeError
from runtime.library.arrays import Array
from runtime.library.compile_cache import compiled_library
from runtime.library.manifest import ArgumentFacts, KernelFacts, Manifest

AGAIN = "run: python -m symgen build"


def open_library(folder: Path, manifest: Manifest, level: str | None = None) -> ctypes.CDLL:
    """Open the library in a generated folder, or else that of its C code in the cache.

    Checked: its bytes are those that were compiled, from this manifest, for this machine. The
    library of a folder is opened only if this user has built it; otherwise its C code is compiled.
    """
    name = f"lib{manifest.robot}.so"
    place = folder
    if not (folder / name).exists():
        place = compiled_library(folder, manifest.robot, level)
    digest = _checked_library(place, folder, name)
    if place == folder and not is_user_build(folder / name, digest):
        place = compiled_library(folder, manifest.robot, level)
        _checked_library(place, folder, name)
    path = place / name
    again = AGAIN if place == folder else "set SYMGEN_CACHE to another folder, or " + AGAIN
    try:
        dll = ctypes.CDLL(str(path.resolve()))
        model_hash = _model_hash(dll, manifest)
        if model_hash != manifest.model_hash:
            # For a known path the loader returns the older build that this process has open.
            with tempfile.TemporaryDirectory() as fresh:
                dll = ctypes.CDLL(shutil.copy(path, fresh))
            model_hash = _model_hash(dll, manifest)
    except (OSError, AttributeError) as error:
        raise LibraryError(f"the library '{path}' cannot be used here ({error}); {again}") from None
    if model_hash != manifest.model_hash:
        raise LibraryError(
            f"the library '{path}' belongs to the model {model_hash[:12]}, its manifest to "
            f"{manifest.model_hash[:12]}; {AGAIN}"
        )
    return dll


def _checked_library(place: Path, folder: Path, name: str) -> str:
    """SHA-256 of a library whose bytes agree with its build.json and the manifest."""
    path = place / name
    try:
        record = json_of(place / "build.json")
        sha256, sources = record["sha256"], record["sources"]
        stated = sources["manifest.json"]
    except (OSError, ValueError, KeyError, TypeError):
        raise LibraryError(
            f"'{place}' has no valid build.json beside its library; {AGAIN}"
        ) from None
    # Opening a truncated shared object kills the process, so its bytes are checked first.
    digest = sha256_of(path)
    if digest != sha256:
        raise LibraryError(f"the library '{path}' is damaged or not the one built here; {AGAIN}")
    if stated != sha256_of(folder / "manifest.json"):
        raise LibraryError(f"the library '{path}' is older than its manifest.json; {AGAIN}")
    return digest


def _model_hash(dll: ctypes.CDLL, manifest: Manifest) -> str:
    answer = dll[f"{manifest.robot}_model_hash"]
    answer.restype = ctypes.c_char_p
    return str(answer().decode())


LANES = 8


def padded_size(size: int) -> int:
    """The least multiple of `LANES` that holds `size`."""
    return -(-size // LANES) * LANES


def zeros(*shape: int) -> Array:
    """Zeros from a cache line on: a vector that lies across two lines is loaded as two."""
    size = math.prod(shape)
    room = np.zeros(size + LANES)
    first = -(room.ctypes.data // room.itemsize) % LANES
    return room[first : first + size].reshape(shape)


def padded(array: Array, size: int) -> Array:
    """The array with zeros behind its last axis; `np.pad` takes longer than a MAP estimate."""
    whole = zeros(*array.shape[:-1], size)
    whole[..., : array.shape[-1]] = array
    return whole


LEVELS = ("casadi", "portable", "v2", "v3", "v4", "neon")
"""Levels of batch functions: the C of CasADi, plain C, and instruction sets.

Sorted: a processor that runs one runs those before it."""

DOUBLE = 8  # bytes of a number
PART = 4096  # samples per piece of a batch; sums go piece by piece, whatever the threads
THREAD_OPERATIONS = 2e7  # operations per thread, 1 ms; a thread of fewer costs more than it saves


class Binding:
    """Calls `<robot>_<level>_<kernel>_batch` with NumPy arrays."""

    def __init__(
        self, folder: Path, manifest: Manifest, level: str | None, threads: int | None
    ) -> None:
        if threads is not None and threads < 1:
            raise LibraryError(
                f"threads must be at least 1, got {threads}; None lets symgen choose"
            )
        self._manifest = manifest
        self._threads = threads
        self._dll = open_library(folder, manifest, level)
        batch = f"{manifest.robot}_{{}}_torque_batch"
        self.levels = tuple(name for name in LEVELS if hasattr(self._dll, batch.format(name)))
        self.level = level or self._best_level()
        if self.level not in self.levels:
            raise LibraryError(
                f"the library of '{manifest.robot}' has no level '{self.level}', "
                f"it has {', '.join(self.levels)}"
            )
        self._functions = {name: self._bind(kernel) for name, kernel in manifest.kernels.items()}

    def program(self, name: str, *types: Any) -> Any:
        """Function of the level that works off jobs; LibraryError where the level has none."""
        function = self.of_level(name)
        if function is None:
            raise LibraryError(
                f"the level '{self.level}' of '{self._manifest.robot}' has no compiled descent"
            )
        return typed(function, None, *types)

    def of_level(self, name: str) -> Any:
        """Function of the level, without types; None where the library has none."""
        return getattr(self._dll, f"{self._manifest.robot}_{self.level}_{name}", None)

    def plain(self, name: str, *types: Any) -> Any:
        """Function without a result that all levels share."""
        return typed(self._symbol(f"{self._manifest.robot}_{name}"), None, *types)

    def _symbol(self, name: str) -> Any:
        try:
            return self._dll[name]
        except AttributeError:
            raise LibraryError(
                f"the library of '{self._manifest.robot}' has no function '{name}', so another "
                f"version of symgen built it; {AGAIN}"
            ) from None

    def _best_level(self) -> str:
        """Best level that the processor can run, by the check in the library."""
        answer = self._symbol(f"{self._manifest.robot}_level")
        answer.restype = ctypes.c_char_p
        best = LEVELS.index(str(answer().decode()))
        runs = [level for level in self.levels if LEVELS.index(level) <= best]
        if not runs:
            raise LibraryError(
                f"the library of '{self._manifest.robot}' has no batch functions; {AGAIN}"
            )
        return runs[-1]

    def _bind(self, kernel: KernelFacts) -> Callable[..., None]:
        robot = self._manifest.robot
        function = self.of_level(f"{kernel.name}_batch")
        if function is None:  # a rare kernel has no vector form
            function = self._symbol(f"{robot}_{kernel.name}_batch")
        pair = (ctypes.c_void_p, ctypes.c_long)
        taken, given = pair * len(kernel.inputs), pair[:1] * len(kernel.outputs)
        return typed(function, None, ctypes.c_long, *taken, *given)

    def call(self, name: str, *values: ArrayLike) -> tuple[Array, ...]:
        """All outputs (N, *shape) of a kernel over a batch (N, *shape)."""
        kernel = self.kernel(name)
        pairs = zip(kernel.inputs, values, strict=True)
        arrays = [_checked(name, argument, value) for argument, value in pairs]
        lengths = {len(array) for array in arrays if array.ndim == 2}
        if len(lengths) > 1:
            named = zip(kernel.inputs, arrays, strict=True)
            shown = ", ".join(f"{a.name} {x.shape}" for a, x in named)
            raise ShapeError(f"{name} needs inputs with equally many samples, got {shown}")
        batched = bool(lengths)
        n = lengths.pop() if batched else 1
        outputs = [np.empty((1 if a.summed else n, a.size)) for a in kernel.outputs]
        steps = [a.size if x.ndim == 2 else 0 for a, x in zip(kernel.inputs, arrays, strict=True)]
        places = [x.ctypes.data for x in arrays]
        self.run(name, n, places, steps, [out.ctypes.data for out in outputs])
        return tuple(
            out.reshape(a.shape if a.summed or not batched else (n, *a.shape))
            for a, out in zip(kernel.outputs, outputs, strict=True)
        )

    def run(
        self, name: str, n: int, places: Sequence[int], steps: Sequence[int], results: Sequence[int]
    ) -> None:
        """Call a kernel over n samples on memory that the caller holds, without a copy.

        places and results are addresses of contiguous doubles; steps the doubles from one sample of
        an input to the next, 0: one value for all.
        """
        kernel = self.kernel(name)
        function = self._functions[name]
        if n <= PART:
            function(n, *chain.from_iterable(zip(places, steps, strict=True)), *results)
            return
        starts = range(0, n, PART)
        sums = {
            k: np.empty((len(starts), a.size)) for k, a in enumerate(kernel.outputs) if a.summed
        }

        def part(k: int) -> None:
            first = starts[k]
            where: list[int] = []
            for place, step in zip(places, steps, strict=True):
                where += (place + first * step * DOUBLE, step)
            for index, (argument, result) in enumerate(zip(kernel.outputs, results, strict=True)):
                whole = sums[index].ctypes.data if argument.summed else result
                row = k if argument.summed else first
                where.append(whole + row * argument.size * DOUBLE)
            function(min(PART, n - first), *where)

        self._each(part, len(starts), n * kernel.operations)
        for index, parts in sums.items():
            total = parts.sum(axis=0)
            ctypes.memmove(results[index], total.ctypes.data, total.nbytes)

    def address(self, name: str) -> int:
        """Address of `void f(long n, const double *, long step, …, double *, …)` of a kernel."""
        self.kernel(name)
        return int(ctypes.cast(self._functions[name], ctypes.c_void_p).value or 0)  # type: ignore[arg-type]

    def kernel(self, name: str) -> KernelFacts:
        """Facts of a kernel; an omitted one raises an error that names what to use instead."""
        kernel = self._manifest.kernels.get(name)
        if kernel is None:
            robot = self._manifest.robot
            if name in self._manifest.omitted:
                instead = self._manifest.omitted[name]
                raise LibraryError(f"the library of '{robot}' has no kernel '{name}'; {instead}")
            raise LibraryError(
                f"the library of '{robot}' has no kernel '{name}', so another version of symgen "
                f"built it; {AGAIN}"
            )
        return kernel

    def _each(self, part: Callable[[int], None], count: int, operations: int) -> None:
        """Run all parts, on the requested number of threads or on as many as save time."""
        threads = self._threads or int(operations / THREAD_OPERATIONS)
        if threads > 1 and count > 1:  # only a long batch needs the number of cores
            threads = self._threads or min(cores(), threads)
        if threads <= 1 or count == 1:
            for k in range(count):
                part(k)
            return
        with ThreadPoolExecutor(min(threads, count)) as pool:
            list(pool.map(part, range(count)))


def typed(function: Any, result: Any, *arguments: Any) -> Any:
    """A function of the library with the types of its result and arguments."""
    function.restype, function.argtypes = result, arguments
    return function


def _checked(kernel: str, argument: ArgumentFacts, value: ArrayLike) -> Array:
    """Contiguous float64 as (size,) or (N, size)."""
    try:
        given = np.asarray(value)
    except ValueError:  # rows of unequal length
        given = np.array(None)
    if given.dtype.kind not in "fiub":
        raise ShapeError(f"{kernel}: {argument.name} needs real numbers, got {value!r:.80}")
    array = np.ascontiguousarray(given, dtype=np.float64).reshape(given.shape)
    shape = argument.shape
    if array.shape == shape or (argument.size == 1 and array.ndim == 0):
        return array.reshape(argument.size)
    if array.ndim == len(shape) + 1 and array.shape[1:] == shape:
        return array.reshape(len(array), argument.size)
    wanted = ", ".join(map(str, shape))
    raise ShapeError(
        f"{kernel}: {argument.name} needs the shape (N, {wanted}) or ({wanted},) "
        f"[{argument.unit}], got {array.shape}"
    )
