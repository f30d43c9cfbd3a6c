"""The CUDA header, compiled for the host, gives the digits of the C kernels."""

import ctypes
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.library import Library
from tests.compiling import compile_program

N = 3
"""Samples."""
TYPES = {"double": (np.float64, 1e-12), "float": (np.float32, 1e-5)}
"""Type of C++ → that of NumPy and the largest difference, relative to the largest number."""
LOSSES = """
extern "C" void losses_{type}(long n, Array<const {type}> q, Array<const {type}> dq,
    Array<const {type}> ddq, Array<const {type}> tau, Array<const {type}> weight,
    const {type} *beta, {type} *loss, {type} *gradient)
{{
    static {type} rows[{n} * {space}::ROW];
    for (long i = 0; i < n; ++i) {{
        {space}::weighted_rows_at<{type}>(i, q, dq, ddq, tau, weight, rows);
        {space}::add_row(rows + i * {space}::ROW, beta, *loss, gradient);
    }}
}}
"""


class Array(ctypes.Structure):
    """`symgen_array` of the header."""

    _fields_ = (
        ("data", ctypes.c_void_p),
        ("entry", ctypes.c_longlong),
        ("sample", ctypes.c_longlong),
    )


def columns(values: Any) -> Array:
    """An array (N, size) of columns, or (size,) for all samples."""
    entry, sample = (values.strides[-1], values.strides[0] if values.ndim > 1 else 0)
    return Array(values.ctypes.data, entry // values.itemsize, sample // values.itemsize)


def compiled(folder: Path, space: str, kernels: list[Any], tmp_path: Path) -> ctypes.CDLL:
    """The header of a folder with one C function per kernel and type."""
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("g++ is not installed")
    name = space.removesuffix("_cuda")
    text = f'#include "{name}.cuh"\ntemplate <typename T> using Array = symgen_array<T>;\n'
    for type_ in TYPES:
        for kernel in kernels:
            words = [f"Array<const {type_}> {a['name']}" for a in kernel["inputs"]]
            words += [f"Array<{type_}> {a['name']}" for a in kernel["outputs"]]
            given = ", ".join(word.rpartition(" ")[2] for word in words)
            function = f"{space}::{kernel['name']}_samples<{type_}>(n, {given})"
            arguments = f"long n, {', '.join(words)}"
            head = f'extern "C" void {kernel["name"]}_{type_}({arguments})'
            text += f"{head} {{ {function}; }}\n"
        text += LOSSES.format(type=type_, space=space, n=N)
    source, library = tmp_path / "host.cpp", tmp_path / "host.so"
    source.write_text(text)
    flags = ("-std=c++11", "-O0", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC")
    compile_program([compiler, *flags, f"-I{folder}", source, "-o", library], tmp_path)
    return ctypes.CDLL(str(library))


def test_every_kernel_of_the_header_has_the_digits_of_c(fr3: Library, tmp_path: Path) -> None:
    """Oracle: the functions of kernels.c, and loss_gradient for the loss on many parameters."""
    manifest = json.loads((fr3.folder / "manifest.json").read_text())
    header = (fr3.folder / "fr3.cuh").read_text()
    shipped = set(re.findall(r"inline void (\w+)_samples\(", header))
    kernels = [kernel for kernel in manifest["kernels"] if kernel["name"] in shipped]
    assert {"inverse_dynamics", "mass_matrix", "forward_dynamics"} < shipped
    host = compiled(fr3.folder, "fr3_cuda", kernels, tmp_path)
    c = ctypes.CDLL(str(fr3.folder / "libfr3.so"))
    rng = np.random.default_rng(3)
    known = {"pi": fr3.pi0, "beta": fr3.base_matrix @ fr3.pi0, "rotor": np.full(7, 0.1)}
    for kernel in kernels:
        inputs = []
        for a in kernel["inputs"]:
            size = int(np.prod(a["shape"]))
            values = known.get(a["name"], rng.uniform(0.1, 1.0, size))
            is_shared = a["name"] in known
            inputs.append(values if is_shared else rng.uniform(0.1, 1.0, (N, size)))
        sizes = [int(np.prod(a["shape"])) for a in kernel["outputs"]]
        exact = [np.zeros((N, size)) for size in sizes]
        for i in range(N):
            one = [np.ascontiguousarray(x if x.ndim == 1 else x[i]) for x in inputs]
            rows = [x.ctypes.data_as(ctypes.c_void_p) for x in one]
            rows += [ctypes.c_void_p(x[i].ctypes.data) for x in exact]
            getattr(c, f"fr3_{kernel['name']}")(*rows)
        for type_, (dtype, bound) in TYPES.items():
            given = [np.asfortranarray(x, dtype=dtype) for x in inputs]  # structure of arrays
            found = [np.zeros((N, size), dtype, order="F") for size in sizes]
            call = getattr(host, f"{kernel['name']}_{type_}")
            call(ctypes.c_long(N), *map(columns, given), *map(columns, found))
            for mine, theirs in zip(found, exact, strict=True):
                assert np.abs(mine - theirs).max() <= bound * np.abs(theirs).max(), kernel["name"]
                assert theirs.any()
        if kernel["name"] == "loss_gradient":
            _compare_losses(host, inputs, exact)


def _compare_losses(host: ctypes.CDLL, inputs: list[Any], exact: list[Any]) -> None:
    *states, weight, beta = inputs
    states.append(np.broadcast_to(weight, states[0].shape) if weight.ndim == 1 else weight)
    for type_, (dtype, bound) in TYPES.items():
        given = [np.asfortranarray(x, dtype=dtype) for x in states]
        found = [np.zeros(1, dtype), np.zeros(beta.size, dtype)]
        lists = [x.ctypes.data_as(ctypes.c_void_p) for x in (beta.astype(dtype), *found)]
        getattr(host, f"losses_{type_}")(ctypes.c_long(N), *map(columns, given), *lists)
        for mine, theirs in zip(found, exact, strict=False):
            total = theirs.sum(axis=0)
            assert np.abs(mine - total).max() <= bound * np.abs(total).max()
