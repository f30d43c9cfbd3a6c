"""C code of the rigid-body model of a robot arm: URDF → chain → kernels → generated/<robot>/.

Build time only (casadi, pinocchio, jinja2); the `runtime` package never imports it.
"""

import os
import sys

# `python -m symgen` puts the working directory first on the path, where a file numpy.py beside a
# log would be run as a module. os and sys are loaded before any of them.
if (
    sys.orig_argv[1:3] == ["-m", "symgen"]
    and sys.path[:1] == [os.getcwd()]
    and os.path.dirname(os.path.dirname(os.path.abspath(__file__))) != sys.path[0]
):
    del sys.path[0]

from importlib import import_module
from typing import TYPE_CHECKING, Any

from symgen.make import VERSION

if TYPE_CHECKING:
    from symgen.make.in_memory import build

__version__ = VERSION

__all__ = ["build"]


def __getattr__(name: str) -> Any:
    """Import `build` at its first use: it needs CasADi and Pinocchio."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("symgen.make.in_memory"), name)
