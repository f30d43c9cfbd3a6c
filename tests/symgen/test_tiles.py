"""Tiles of eight samples: every level gives what CasADi's own C gives on robots."""

import ctypes
import shutil
import subprocess
import sys

import numpy as np
import pytest

from runtime.errors import LibraryError
from runtime.library import Library, load
from tests.robots import levels_here

# Kernels of 1000 operations on numbers of order one: rounding grows to a few hundred units in the
# last place of the largest entry; measured 6e-16.
SAME = 1e-13


def arguments_of(lib: Library, count: int, seed: int = 1) -> dict[str, list[np.ndarray]]:
    """Inputs of every kernel, one row per sample, as a robot may see them."""
    rng = np.random.default_rng(seed)
    lam = lib.lam0 * (1 + 0.05 * rng.normal(size=(count, lib.lam0.size)))
    pi = lib.pi_from_lam(lam)

    def numbers(name: str, size: int) -> np.ndarray:
        if name in {"lam", "pi"}:
            return np.ascontiguousarray({"lam": lam, "pi": pi}[name][:, :size])
        if name in {"weight", "rotor", "t_f", "floor"}:
            return rng.uniform(0.01, 0.02, (count, size)) * (100 if name == "t_f" else 1)
        return rng.normal(size=(count, size))

    return {
        kernel.name: [numbers(a.name, a.size) for a in kernel.inputs]
        for kernel in lib.manifest.kernels.values()
    }


def batch(
    lib: Library, level: str, kernel: str, inputs: list[np.ndarray], steps: list[int], n: int
) -> list[np.ndarray]:
    """The C function itself; what it leaves alone stays -7."""
    outputs = lib.manifest.kernels[kernel].outputs
    out = [np.full(a.size if a.summed else (n, a.size), -7.0) for a in outputs]
    dll = lib.binding._dll
    pairs = [
        item
        for x, step in zip(inputs, steps, strict=True)
        for item in (ctypes.c_void_p(x.ctypes.data), ctypes.c_long(step))
    ]
    handle = ctypes.CDLL(dll._name)
    name = f"{lib.name}_{level}_{kernel}_batch"
    rare = f"{lib.name}_{kernel}_batch"  # of kernels without a vector form
    function = handle[name if hasattr(handle, name) else rare]
    function(ctypes.c_long(n), *pairs, *(ctypes.c_void_p(x.ctypes.data) for x in out))
    return out


def assert_same(got: list[np.ndarray], wanted: list[np.ndarray], kernel: str, where: object):
    for one, other in zip(got, wanted, strict=True):
        if not other.size:
            continue
        np.testing.assert_array_equal(np.isnan(one), np.isnan(other), err_msg=f"{where} {kernel}")
        # forward dynamics divides by M: its rounding is multiplied by the condition of M
        slack = 1e4 if kernel == "forward_dynamics" else 1.0
        scale = np.nanmax(np.abs(other), initial=0.0) * slack
        assert np.nanmax(np.abs(one - other), initial=0.0) <= SAME * scale, (where, kernel)


ROBOTS = ["fr3", "ur5", "tree", "gantry"]
"""One branches (tree), one slides (gantry)."""


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("n", [0, 1, 8, 37])
def test_all_kernels_equal_casadi_on_all_levels(robot, name, n):
    """Oracle: CasADi's own C; N = 0, one, a full tile, no multiple of a tile; every step.

    Shared inputs once for all (step 0) and one per sample, then every input kept (step 0).
    """
    lib = robot(name)
    levels = levels_here(lib)
    assert lib.levels[:2] == ("casadi", "portable")
    for kernel, inputs in arguments_of(lib, max(n, 1)).items():
        facts = lib.manifest.kernels[kernel].inputs
        every = [a.size for a in facts]
        for steps in (every, [0 if a.shared else a.size for a in facts], [0] * len(every)):
            wanted = batch(lib, "casadi", kernel, inputs, steps, n)
            for level in levels:
                got = batch(lib, level, kernel, inputs, steps, n)
                assert_same(got, wanted, kernel, (level, n, steps))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["fr3", "gantry"])
def test_not_a_number_spoils_one_sample_only(robot, name, bad):
    """Oracle: CasADi's C; a NaN or infinity comes through, and the other lanes do not see it."""
    lib = robot(name)
    calls = arguments_of(lib, 9)
    for kernel in ("inverse_dynamics", "base_regressor", "mass_matrix", "pi_from_lam"):
        inputs = [x.copy() for x in calls[kernel]]
        for x in inputs:
            x[4, -1] = bad
        steps = [x.shape[1] for x in inputs]
        wanted = batch(lib, "casadi", kernel, inputs, steps, 9)
        assert not np.isfinite(wanted[0][4]).all()
        assert np.isfinite(np.delete(wanted[0], 4, axis=0)).all()
        for level in levels_here(lib):
            got = batch(lib, level, kernel, inputs, steps, 9)
            rest = [[np.delete(x, 4, axis=0) for x in side] for side in (got, wanted)]
            assert_same(*rest, kernel, (level, bad))
            # Which of inf and NaN comes out depends on the order of a sum; that it is bad does not.
            finite = np.isfinite(wanted[0][4])
            assert not np.isfinite(got[0][4][~finite]).any(), (level, kernel)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("count", [1, 4, 5])
def test_tiles_in_place_equal_batches(robot, name, count):
    """Property: `_tiles` on 8-sample tiles gives what `_batch` gives, with stored sines or none."""
    lib = robot(name)
    n = 8 * count
    for kernel, inputs in arguments_of(lib, n).items():
        facts = lib.manifest.kernels[kernel]
        tiles_h = (lib.folder / "tiles.h").read_text(encoding="utf-8")
        if any(a.summed for a in facts.outputs) or f"OWN({kernel}_tile)" not in tiles_h:
            continue
        steps = [0 if a.shared else a.size for a in facts.inputs]
        wanted = batch(lib, "casadi", kernel, inputs, steps, n)
        tiled = [
            x[0].copy() if a.shared else in_tiles(x)
            for a, x in zip(facts.inputs, inputs, strict=True)
        ]
        stored = [in_tiles(sines_of(x)) for x in inputs[:1]]
        for level in levels_here(lib):
            function = ctypes.CDLL(lib.binding._dll._name)[f"{lib.name}_{level}_{kernel}_tiles"]
            for sc in ([None], [ctypes.c_void_p(stored[0].ctypes.data)]):
                out = [np.zeros((count, a.size, 8)) for a in facts.outputs]
                pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*tiled, *out)]
                function(ctypes.c_long(count), *sc, *pointers)
                got = [x.transpose(0, 2, 1).reshape(n, -1) for x in out]
                assert_same(got, wanted, kernel, (level, "NULL" if sc == [None] else "stored"))


def in_tiles(x: np.ndarray) -> np.ndarray:
    """(8 m, k) samples as m tiles of k rows."""
    return np.ascontiguousarray(x.reshape(len(x) // 8, 8, -1).transpose(0, 2, 1))


def sines_of(q: np.ndarray) -> np.ndarray:
    """Two columns per joint: sine, cosine."""
    return np.stack([np.sin(q), np.cos(q)], axis=2).reshape(len(q), -1)


@pytest.mark.parametrize("name", ["fr3", "tree"])
def test_rows_that_are_not_filled_are_not_written(robot, name):
    """Property: `filled` is what the tile form writes; the rest is zero in CasADi's C."""
    lib = robot(name)
    inputs = arguments_of(lib, 8)["base_regressor"]
    (wanted,) = batch(lib, "casadi", "base_regressor", inputs, [lib.n_joints] * 3, 8)
    out = np.full((1, wanted.shape[1], 8), -7.0)
    function = ctypes.CDLL(lib.binding._dll._name)[f"{lib.name}_portable_base_regressor_tiles"]
    tiled = [in_tiles(x) for x in inputs]
    pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*tiled, out)]
    function(ctypes.c_long(1), None, *pointers)
    left = (out[0] == -7.0).all(axis=1)
    assert left.any()
    assert (wanted[:, left] == 0).all()


def test_casadi_is_never_chosen_where_there_is_another(robot):
    """Property: by name only."""
    lib = robot("gantry")
    assert lib.levels[0] == "casadi"
    assert lib.level != "casadi"
    assert load(lib.folder, "casadi").level == "casadi"


def test_unknown_level_is_refused(fr3):
    """Property: the message lists the levels that there are."""
    with pytest.raises(LibraryError, match=r"no level 'v9', it has casadi, portable"):
        load(fr3.folder, "v9")


def test_tiles_compile_for_arm(robot, tmp_path):
    """Oracle: zig's cross compiler for 64-bit Arm; the code cannot run here."""
    pytest.importorskip("ziglang", reason="the ziglang wheel is the cross compiler")
    for file in ("tiles.c", "tiles.h", "lanes.h", "sines.h", "gantry.h"):
        shutil.copy(robot("gantry").folder / file, tmp_path)
    command = [sys.executable, "-m", "ziglang", "cc", "-target", "aarch64-linux-gnu", "-O1", "-c"]
    subprocess.run(
        [*command, "-std=c99", "-DLEVEL=neon", "-DW=2", "tiles.c", "-o", "tiles.o"],
        cwd=tmp_path,
        check=True,
        capture_output=True,
    )
    head = (tmp_path / "tiles.o").read_bytes()[:20]
    assert head[:4] == b"\x7fELF"
    assert head[18] == 0xB7  # EM_AARCH64
