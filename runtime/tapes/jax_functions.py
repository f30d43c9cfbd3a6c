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

from runtime.errors import LibraryError
from runtime.library import Library
from runtime.library.compile_cache import compiled_file
from runtime.tapes.derivatives import DIFFERENTIABLE, KernelCall
from runtime.tapes.functions import TapeFunctions

TARGET = "symgen_kernel"
DERIVATIVES = ("torque_derivatives", "regressor", "pi_jacobian")  # called beside `DIFFERENTIABLE`


class Functions(TapeFunctions):
    """Differentiable functions of a robot on arrays of JAX; see `TapeFunctions`."""

    xp, cast = jnp, "astype"

    def __init__(self, lib: Library) -> None:
        super().__init__(lib)
        add = handler().symgen_add
        self.key = f"{lib.manifest.model_hash[:16]}.{lib.level}"
        for name in {*DIFFERENTIABLE, *DERIVATIVES} & lib.manifest.kernels.keys():
            if add(f"{self.key}.{name}".encode(), lib.binding.address(name)):
                raise LibraryError(f"no memory to enter the kernel '{name}'")
        names = DIFFERENTIABLE & lib.manifest.kernels.keys()
        self._recorded = {name: jax.jit(self._with_tangents(name)) for name in names}

    def _here(self, _: str, value: Any) -> jax.Array:
        given = isinstance(value, jax.Array)
        return value if given else jnp.asarray(np.asarray(value, dtype=float))

    def _constant(self, name: str, like: jax.Array) -> jax.Array:
        with jax.ensure_compile_time_eval():  # what is kept must not be a tracer of this call
            return super()._constant(name, like)

    def _call(self, kernel: str, *values: jax.Array) -> jax.Array:
        self.lib.binding.kernel(kernel)  # names what to use instead
        return self._recorded[kernel](*values)

    def _kernel(self, name: str, *values: jax.Array) -> Sequence[jax.Array]:
        """All outputs of a kernel, (..., *shape), from inputs (..., size)."""
        outputs = self.lib.binding.kernel(name).outputs
        lead = jnp.broadcast_shapes(*(x.shape[:-1] for x in values))
        aligned = [x.reshape(*(1,) * (len(lead) + 1 - x.ndim), *x.shape) for x in values]
        shapes = [a.shape if a.summed else (*lead, *a.shape) for a in outputs]
        results = [jax.ShapeDtypeStruct(shape, values[0].dtype) for shape in shapes]
        method = "sequential" if any(a.summed for a in outputs) else "expand_dims"
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
            called = KernelCall(jnp, self._kernel, self.lib, name, values, outputs)
            return outputs[0], called.tangent(known)

        return function


@cache
def handler() -> ctypes.CDLL:
    """The handler of XLA, compiled with the headers of jaxlib where it is not yet."""
    flags = ("-I", jax.ffi.include_dir(), f'-DJAXLIB="{jaxlib.__version__}"')
    path = compiled_file(Path(__file__).with_name("xla_call.c"), flags)
    library = ctypes.CDLL(str(path))
    library.symgen_add.argtypes = (ctypes.c_char_p, ctypes.c_void_p)
    jax.ffi.register_ffi_target(TARGET, jax.ffi.pycapsule(library.symgen_kernel), platform="cpu")
    return library
