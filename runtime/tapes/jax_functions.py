"""Kernels as functions of JAX: a handler of XLA in C, and derivatives as custom_jvp.

A rule for tangents that is linear in them serves both modes: JAX transposes it for the reverse one.
The handler is compiled once per machine and works inside jit, on the memory of the buffers.
"""

import ctypes
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import jaxlib
import numpy as np
from jax.custom_derivatives import SymbolicZero

from runtime.errors import LibraryError, ShapeError
from runtime.library import Library
from runtime.library.compile_cache import compiled_file
from runtime.tapes.derivatives import DIFFERENTIABLE, tangent_of
from runtime.tapes.functions import TapeFunctions

TARGET = "symgen_kernel"
DERIVATIVES = ("torque_derivatives", "regressor", "pi_jacobian")
"""Kernels that the rules call beside `DIFFERENTIABLE`."""


class JaxFunctions(TapeFunctions):
    """Differentiable functions of a robot on arrays of JAX; see `TapeFunctions`."""

    def __init__(self, lib: Library) -> None:
        super().__init__(lib)
        add = handler().symgen_add
        self.key = f"{lib.manifest.model_hash[:16]}.{lib.level}"
        for name in {*DIFFERENTIABLE, *DERIVATIVES} & lib.manifest.kernels.keys():
            if add(f"{self.key}.{name}".encode(), lib.batch_address(name)):
                raise LibraryError(f"no memory to enter the kernel '{name}'")
        self._recorded = {
            name: jax.jit(self._with_tangents(name))
            for name in DIFFERENTIABLE & lib.manifest.kernels.keys()
        }

    def _array(self, name: str, value: Any, like: jax.Array | None = None) -> jax.Array:
        if not isinstance(value, jax.Array):
            try:
                value = jnp.asarray(np.asarray(value, dtype=float))
            except (TypeError, ValueError):
                raise ShapeError(f"{name} needs an array of numbers, got {value!r:.60}") from None
        if like is not None:
            return value if value.dtype == like.dtype else value.astype(like.dtype)
        if value.dtype not in (jnp.float64, jnp.float32):
            raise ShapeError(f"{name} needs float64 or float32, got {value.dtype}")
        return value

    def _call(self, kernel: str, *values: jax.Array) -> jax.Array:
        self.lib.kernel_facts(kernel)  # names what to use instead
        return self._recorded[kernel](*values)

    @staticmethod
    def _zeros(like: jax.Array) -> jax.Array:
        return jnp.zeros(like.shape[-1], like.dtype)

    @staticmethod
    def _rows(value: jax.Array, lead: tuple[int, ...]) -> jax.Array:
        return jnp.broadcast_to(value, (*lead, value.shape[-1])).reshape(-1, value.shape[-1])

    def _kernel(self, name: str, *values: jax.Array) -> Sequence[jax.Array]:
        """All outputs of a kernel, (..., *shape), from inputs (..., size)."""
        outputs = self.lib.kernel_facts(name).outputs
        lead = jnp.broadcast_shapes(*(x.shape[:-1] for x in values))
        aligned = [x.reshape(*(1,) * (len(lead) + 1 - x.ndim), *x.shape) for x in values]
        shapes = [a.shape if a.summed else (*lead, *a.shape) for a in outputs]
        results = [jax.ShapeDtypeStruct(shape, values[0].dtype) for shape in shapes]
        is_summed = any(a.summed for a in outputs)
        method = "sequential" if is_summed else "expand_dims"
        call = jax.ffi.ffi_call(TARGET, results, vmap_method=method)
        return tuple(call(*aligned, function=f"{self.key}.{name}"))

    def _with_tangents(self, name: str) -> Callable[..., jax.Array]:
        """First output of a kernel with its rule for tangents."""

        @jax.custom_jvp
        def function(*values: jax.Array) -> jax.Array:
            return self._kernel(name, *values)[0]

        @partial(function.defjvp, symbolic_zeros=True)
        def rule(values: Sequence[jax.Array], tangents: Sequence[Any]) -> Any:
            outputs = self._kernel(name, *values)
            known = [None if isinstance(each, SymbolicZero) else each for each in tangents]
            change = tangent_of(jnp, self._kernel, name, values, outputs, known, self.lib)
            return outputs[0], change

        return function


@cache
def handler() -> ctypes.CDLL:
    """The handler of XLA, compiled with the headers of jaxlib where it is not yet."""
    flags = ("-I", jax.ffi.include_dir(), f'-DJAXLIB="{jaxlib.__version__}"')
    path = compiled_file(Path(__file__).with_name("xla_call.c"), flags)
    library = ctypes.CDLL(str(path))
    library.symgen_add.argtypes = (ctypes.c_char_p, ctypes.c_void_p)
    capsule = jax.ffi.pycapsule(library.symgen_kernel)
    jax.ffi.register_ffi_target(TARGET, capsule, platform="cpu")
    return library
