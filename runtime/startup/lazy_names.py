"""Names of a package that are imported at their first use.

A package lists its names under `TYPE_CHECKING` for readers and type checkers, and once more as a
table for the interpreter:

    __getattr__ = lazy_names(__name__, {"Safety": "runtime.excitation.limits.safety"})
"""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_names(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package."""

    def attribute(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(modules[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return attribute
