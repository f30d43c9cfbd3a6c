"""`runtime.torch` and `runtime.jax`: the functions of a library on arrays of either."""

import importlib.util
from importlib import import_module
from typing import TYPE_CHECKING, Any

from runtime.errors import LibraryError
from runtime.library import Library

if TYPE_CHECKING:
    from runtime.tapes.jax_functions import JaxFunctions
    from runtime.tapes.torch_functions import TorchFunctions


def torch(lib: Library) -> "TorchFunctions":
    """Dynamics of a robot as differentiable functions of torch, on the CPU.

    Args:
        lib: library of the robot.

    Returns:
        `inverse_dynamics`, `mass_matrix`, `bias`, `gravity`, `forward_dynamics` and
        `regressor_loss` on tensors (..., n), with autograd, vmap and torch.compile.

    Raises:
        LibraryError: torch is not installed, or the argument is no library.
    """
    functions: TorchFunctions = _of("torch").TorchFunctions(lib)
    return functions


def jax(lib: Library) -> "JaxFunctions":
    """Dynamics of a robot as differentiable functions of JAX, on the CPU.

    Args:
        lib: library of the robot.

    Returns:
        `inverse_dynamics`, `mass_matrix`, `bias`, `gravity`, `forward_dynamics` and
        `regressor_loss` on arrays (..., n), with grad, vmap and jit.

    Raises:
        LibraryError: JAX is not installed, or the argument is no library.
    """
    functions: JaxFunctions = _of("jax").JaxFunctions(lib)
    return functions


def _of(name: str) -> Any:
    if importlib.util.find_spec(name) is None:
        raise LibraryError(
            f"expected {name} to be installed, found none; run: pip install 'symgen[{name}]'"
        )
    return import_module(f"runtime.tapes.{name}_functions")
