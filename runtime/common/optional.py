"""Packages that only some commands need: extras of the package symgen."""

from importlib import import_module
from typing import Any

from runtime.common.errors import RuntimeFault


def optional(
    module: str, purpose: str, extra: str, error: type[RuntimeFault] = RuntimeFault
) -> Any:
    """Module of an extra; where it is missing, the command that installs it."""
    try:
        return import_module(module)
    except ImportError:
        raise error(
            f"{purpose} needs {module.partition('.')[0]}, which is not installed; run: "
            f"pip install 'symgen[{extra}]'"
        ) from None
