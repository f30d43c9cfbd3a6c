"""Kernels for GPUs: compiled without one, and launched by a driver that only takes notes."""

import ctypes
import importlib.util
from typing import Any

import pytest

from runtime.errors import LibraryError
from runtime.library import Library
from runtime.library.cuda import DeviceArray, Gpu, device_code


@pytest.fixture
def nvrtc() -> None:
    """Skips where no wheel of NVRTC is installed; the gate installs one."""
    if importlib.util.find_spec("nvidia") is None:
        pytest.skip("SKIPPED LOUDLY: no NVRTC; install it with: pip install 'symgen[cuda]'")


class Notes:
    """A driver that answers every call with success, and keeps the last launch."""

    def __init__(self) -> None:
        self.launched: tuple[Any, ...] = ()
        self.status = 0

    def __getattr__(self, name: str) -> Any:
        """Any function of the driver."""
        return lambda *_: self.status if name == "cuLaunchKernel" else 0

    def cuDeviceGetAttribute(self, value: Any, attribute: int, _: Any) -> int:
        """Architecture 9.0."""
        value._obj.value = {75: 9, 76: 0}[attribute]
        return 0

    def cuLaunchKernel(self, _: Any, *arguments: Any) -> int:
        """Read the packed arguments where the driver would."""
        *grid, _shared, stream, pointers, _extra = arguments
        n = ctypes.c_longlong.from_address(pointers[0]).value
        arrays = [DeviceArray.from_address(pointers[k]) for k in range(1, 4)]
        fields = [(a.data, a.entry, a.sample) for a in arrays]
        self.launched = (grid, stream.value, n, fields)
        return self.status


def test_kernels_compile_for_hopper_without_spills(fr3: Library, nvrtc: None) -> None:
    """Oracle: the assembler's own log, in single precision; every number stays in a register."""
    names = ["base_inverse_dynamics", "mass_matrix", "losses"]
    code = device_code(fr3.folder, names)
    assert code.cubin.startswith(b"\x7fELF")
    assert set(code.symbols) == set(names)
    assert code.spilled == dict.fromkeys(names, 0)
    assert all(16 < code.registers[name] <= 168 for name in names), (
        code.registers
    )  # 3 blocks of 128


def test_a_launch_packs_arrays_as_the_header_reads_them(fr3: Library, nvrtc: None) -> None:
    """Property: grid, stream and steps arrive; a refusal of the driver becomes a sentence."""
    driver = Notes()
    gpu = Gpu(fr3.folder, driver=driver)
    assert gpu.architecture == "sm_90"
    arrays = ((0x100, 1000, 1), (0x200, 1, 0), (0x300, 1, 49))
    gpu.launch("mass_matrix", 1000, *arrays, stream=7)
    assert driver.launched == ([8, 1, 1, 128, 1, 1], 7, 1000, list(arrays))
    driver.status = 700
    with pytest.raises(LibraryError, match="cuLaunchKernel with status 700"):
        gpu.launch("mass_matrix", 1000, *arrays)


def test_what_cannot_be_compiled_is_named(fr3: Library, nvrtc: None) -> None:
    """Property: the message names the kernel; another type is refused before."""
    with pytest.raises(LibraryError, match="cannot compile no_such for sm_90"):
        device_code(fr3.folder, ["no_such"])
    with pytest.raises(LibraryError, match="float or double, got 1 headers and 'half'"):
        device_code(fr3.folder, ["mass_matrix"], "half")


def test_a_machine_without_a_gpu_says_so(fr3: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: one sentence."""

    def missing(name: str) -> None:
        raise OSError(name)

    monkeypatch.setattr(ctypes, "CDLL", missing)
    with pytest.raises(LibraryError, match="this machine has none"):
        Gpu(fr3.folder)
    with pytest.raises(LibraryError, match=r"pip install 'symgen\[cuda\]'"):
        device_code(fr3.folder, ["mass_matrix"])
