"""Kernels of the CUDA header on a GPU: compiled when first used by NVRTC, launched by the driver.

NVRTC comes from a wheel (`pip install symgen[cuda]`, or beside torch), from a toolkit or from the
system; it needs no GPU. The driver runs a kernel in the primary context of a device, which torch
and JAX use too: addresses and streams of theirs are taken as they are, and nothing is copied.

    gpu = Gpu(lib.folder)
    gpu.launch("mass_matrix", n, (q, n, 1), (pi, 1, 0), (M, n, 1), dtype="float", stream=stream)

An array is (address, step between entries, step between samples), in numbers. A launch does not
wait for its end.
"""

import ctypes
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from runtime.errors import LibraryError

__all__ = ["DeviceArray", "DeviceCode", "Gpu", "device_code"]

TYPES = {"float": 4, "double": 8}  # types of numbers and their bytes
THREADS = 128  # threads per block; kernels of arms need up to 255 registers of its 65,536
_NVRTC = ("libnvrtc.so.12", "libnvrtc.so.13", "libnvrtc.so", "/usr/local/cuda/lib64/libnvrtc.so")
_LISTED = re.compile(r"(\d+) bytes spill stores.*?Used (\d+) reg", re.DOTALL)


class DeviceArray(ctypes.Structure):
    """`symgen_array` of the header."""

    _fields_ = (("data", ctypes.c_void_p), *((k, ctypes.c_longlong) for k in ("entry", "sample")))


@dataclass(frozen=True, slots=True)
class DeviceCode:
    """Machine code of some kernels."""

    cubin: bytes  # code for one architecture
    symbols: dict[str, str]  # name such as "mass_matrix" → name of its function in the code
    registers: dict[str, int]  # of a thread, per kernel
    spilled: dict[str, int]  # bytes that a thread stores beside its registers


def device_code(
    folder: Path, kernels: Sequence[str], dtype: str = "float", architecture: str = "sm_90"
) -> DeviceCode:
    """Compile kernels of the header of a generated folder.

    Args:
        folder: generated folder.
        kernels: names as in the manifest, or "weighted_rows" and "losses".
        dtype: "float" or "double".
        architecture: of the GPU; sm_90 is Hopper.

    Returns:
        Code, and registers as the assembler of NVRTC states them.

    Raises:
        LibraryError: no NVRTC, no header, or it refuses the code.
    """
    headers = sorted(folder.glob("*.cuh"))
    if not headers or dtype not in TYPES:
        raise LibraryError(
            f"expected the CUDA header of a robot in '{folder}' and float or double, got "
            f"{len(headers)} headers and '{dtype}'; run: symgen build"
        )
    space = f"{headers[0].stem}_cuda"
    nvrtc, program = _nvrtc(), ctypes.c_void_p()
    source = headers[0].read_bytes()
    nvrtc.nvrtcCreateProgram(ctypes.byref(program), source, headers[0].name.encode(), 0, None, None)
    try:
        expressions = {name: f"{space}::{name}_kernel<{dtype}>".encode() for name in kernels}
        for expression in expressions.values():
            nvrtc.nvrtcAddNameExpression(program, expression)
        options = (f"--gpu-architecture={architecture}", "--std=c++17", "--ptxas-options=-v")
        given = (ctypes.c_char_p * len(options))(*(option.encode() for option in options))
        refused = nvrtc.nvrtcCompileProgram(program, len(options), given)
        log = _bytes(nvrtc, "ProgramLog", program).decode(errors="replace")
        if refused:
            problem = next((line for line in log.splitlines() if "error" in line), "no message")
            raise LibraryError(
                f"NVRTC cannot compile {', '.join(kernels)} for {architecture}: {problem}; the "
                f"kernels of '{headers[0]}' are named in the header"
            )
        symbols = {}
        for name, expression in expressions.items():
            lowered = ctypes.c_char_p()
            nvrtc.nvrtcGetLoweredName(program, expression, ctypes.byref(lowered))
            symbols[name] = (lowered.value or b"").decode()
        return DeviceCode(_bytes(nvrtc, "CUBIN", program), symbols, *_use(log, symbols))
    finally:
        nvrtc.nvrtcDestroyProgram(ctypes.byref(program))


def _use(log: str, symbols: dict[str, str]) -> tuple[dict[str, int], dict[str, int]]:
    """Registers and spilled bytes per kernel from the assembler's log."""
    blocks = {k: _LISTED.search(log.partition(f"'{symbol}'")[2]) for k, symbol in symbols.items()}
    uses = [(k, block.groups()) for k, block in blocks.items() if block is not None]
    return {k: int(used) for k, (_, used) in uses}, {k: int(spilt) for k, (spilt, _) in uses}


def _bytes(nvrtc: Any, what: str, program: ctypes.c_void_p) -> bytes:
    size = ctypes.c_size_t()
    getattr(nvrtc, f"nvrtcGet{what}Size")(program, ctypes.byref(size))
    text = ctypes.create_string_buffer(size.value)
    getattr(nvrtc, f"nvrtcGet{what}")(program, text)
    return text.raw.rstrip(b"\0") if what == "ProgramLog" else text.raw


def _nvrtc() -> Any:
    # of the wheels nvidia-cuda-nvrtc-cu12 and nvidia-cuda-nvrtc
    folders = (Path(root, "nvidia") for root in sys.path)
    places = [str(p) for each in folders for p in sorted(each.glob("c*/lib/libnvrtc.so.*"))[::-1]]
    for place in (*places, *_NVRTC):
        try:
            return ctypes.CDLL(place)
        except OSError:
            continue
    raise LibraryError(
        "expected NVRTC, the compiler of CUDA at run time, and found none; install it with: "
        "pip install 'symgen[cuda]'"
    )


@dataclass
class Gpu:
    """One GPU and the kernels of one robot on it; kernels are compiled at their first launch.

    Args:
        folder: generated folder.
        device: number of the GPU.
        driver: the CUDA driver; None opens the one of the system.

    Raises:
        LibraryError: no driver, no such device, or the driver refuses a call.
    """

    folder: Path
    device: int = 0
    driver: Any = None
    architecture: str = field(init=False)
    context: ctypes.c_void_p = field(init=False)
    _functions: dict[tuple[str, str], ctypes.c_void_p] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        """Open the driver and the primary context of the device."""
        if self.driver is None:
            try:
                self.driver = ctypes.CDLL("libcuda.so.1")
            except OSError:
                raise LibraryError(
                    "expected the driver of an NVIDIA GPU, and this machine has none (libcuda.so.1)"
                    "; use the library of this processor: runtime.load"
                ) from None
        self.call("cuInit", 0)
        number = ctypes.c_int()
        self.context = ctypes.c_void_p()
        self.call("cuDeviceGet", ctypes.byref(number), self.device)
        self.call("cuDevicePrimaryCtxRetain", ctypes.byref(self.context), number)
        version = []
        for attribute in (75, 76):  # major and minor number of the architecture
            value = ctypes.c_int()
            self.call("cuDeviceGetAttribute", ctypes.byref(value), attribute, number)
            version.append(str(value.value))
        self.architecture = f"sm_{''.join(version)}"

    def launch(
        self,
        kernel: str,
        n: int,
        *arguments: tuple[int, int, int] | int | ctypes.c_void_p,
        dtype: str = "float",
        stream: int = 0,
        slices: int = 1,
    ) -> None:
        """Launch a kernel with one thread per sample, or per parameter vector for "losses".

        Args:
            kernel: name of the kernel.
            n: threads.
            arguments: the others in the order of the header: arrays as (address, step between
                entries, step between samples), counts as integers, plain pointers as `c_void_p`.
            dtype: "float" or "double".
            stream: handle of a CUDA stream, such as `torch.cuda.current_stream().cuda_stream`.
            slices: blocks in the second dimension, which share the rows of "losses".

        Raises:
            LibraryError: the kernel cannot be compiled, or the driver refuses it.
        """
        if n == 0:
            return
        self.call("cuCtxSetCurrent", self.context)
        values: list[Any] = [n]
        for each in arguments:
            if isinstance(each, tuple):
                values.append(DeviceArray(*each))
            else:
                values.append(
                    each if isinstance(each, ctypes.c_void_p) else ctypes.c_longlong(each)
                )
        values = [ctypes.c_longlong(x) if isinstance(x, int) else x for x in values]
        pointers = (ctypes.c_void_p * len(values))(*(ctypes.addressof(value) for value in values))
        grid = (-(-n // THREADS), slices, 1, THREADS, 1, 1)
        function = self._function(kernel, dtype)
        handle = ctypes.c_void_p(stream or None)
        self.call("cuLaunchKernel", function, *grid, 0, handle, pointers, None)

    def _function(self, kernel: str, dtype: str) -> ctypes.c_void_p:
        if (kernel, dtype) not in self._functions:
            code = device_code(self.folder, [kernel], dtype, self.architecture)
            module, function = ctypes.c_void_p(), ctypes.c_void_p()
            self.call("cuModuleLoadData", ctypes.byref(module), code.cubin)
            symbol = code.symbols[kernel].encode()
            self.call("cuModuleGetFunction", ctypes.byref(function), module, symbol)
            self._functions[kernel, dtype] = function
        return self._functions[kernel, dtype]

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function of the driver.

        Args:
            name: such as "cuCtxSynchronize".
            arguments: as in C.

        Raises:
            LibraryError: the driver refuses.
        """
        status = getattr(self.driver, name)(*arguments)
        if status:
            raise LibraryError(
                f"the CUDA driver refuses {name} with status {status}; expected a GPU with room "
                "for the arrays, see the page of the driver's error codes"
            )
