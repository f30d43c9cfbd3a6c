"""Kernels that call others, compiled on tiles: maps of a shared input, and inputs that are zero."""

import ctypes
from pathlib import Path

import casadi as ca
import numpy as np

from runtime.library.binding import LEVELS
from symgen.kernel import Argument, Kernel, make_kernel
from tests.symgen.compiled_toys import assert_accepted, best_level, compiled_toy, write_toy

X, V, W = (Argument(name, (2,), "1") for name in "xvw")
K, P = Argument("k", (3,), "1", shared=True), Argument("p", (2,), "1", shared=True)
Y = Argument("y", (2,), "1")


def kernels() -> tuple[Kernel, ...]:
    """A map k(p), a function y(x, v, w, k), and y without v, with and without the map."""
    x, v, w, k, p = X.symbol(), V.symbol(), W.symbol(), K.symbol(), P.symbol()
    plain_p = Argument("p", (2,), "1")
    image = ca.vertcat(p[0] + p[1], p[0] * p[1], ca.exp(p[0]))

    def rows(v, k):
        return ca.vertcat(ca.sin(x[0]) * k[0] + v[0] + 3 * w[1], v[1] * k[1] + x[1] / k[2] - w[0])

    still = ca.DM.zeros(2)
    return (
        make_kernel("image", {plain_p: p}, {Argument("k", (3,), "1"): image}, "", per="link"),
        make_kernel("last", {X: x, V: v, W: w, K: k}, {Y: rows(v, k)}, ""),
        make_kernel("at_rest", {X: x, W: w, K: k}, {Y: rows(still, k)}, "", through=("last",)),
        make_kernel(
            "mapped", {X: x, W: w, P: p}, {Y: rows(still, image)}, "", through=("image", "last")
        ),
    )


def test_pointers_of_a_composition_have_the_type_of_the_call(tmp_path: Path) -> None:
    """Oracle: the compiler; GCC 14 refuses pointers of another type, earlier ones only warn."""
    write_toy(tmp_path, kernels())
    flags = ["-std=c99", "-Werror=incompatible-pointer-types", "-DLEVEL=portable", "-DW=2"]
    assert_accepted(tmp_path, [*flags, "tiles.c"])


def test_compositions_on_tiles_equal_casadi(tmp_path: Path) -> None:
    """Oracle: CasADi's C of the written-out function; a full tile and one of three samples."""
    dll = compiled_toy(tmp_path, kernels())
    rng = np.random.default_rng(1)
    x, w = rng.normal(size=(2, 11, 2))
    for name, shared in (("at_rest", rng.uniform(1, 2, 3)), ("mapped", rng.uniform(1, 2, 2))):
        results = []
        for level in LEVELS[: best_level(dll) + 1]:
            out = np.full((11, 2), -7.0)
            pairs = [(x, 2), (w, 2), (shared, 0)]  # step 0: one value for all samples
            numbers = [
                c for a, n in pairs for c in (ctypes.c_void_p(a.ctypes.data), ctypes.c_long(n))
            ]
            dll[f"toy_{level}_{name}_batch"](
                ctypes.c_long(11), *numbers, ctypes.c_void_p(out.ctypes.data)
            )
            results.append(out)
        assert np.isfinite(results[0]).all()
        for result in results[1:]:
            # A dozen operations on numbers below ten; a fused product rounds once less.
            np.testing.assert_allclose(result, results[0], rtol=0, atol=1e-14)
