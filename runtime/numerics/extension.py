"""Compiled extensions of SciPy, loaded without the package around them."""

import sys
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType


def extension(name: str, functions: tuple[str, ...]) -> ModuleType | None:
    """Load an extension."""
    module = sys.modules.get(name) or _loaded(name)
    return module if all(hasattr(module, function) for function in functions) else None


def _loaded(name: str) -> ModuleType | None:
    """The extension under its full name, so that a later import of its package uses it."""
    package, *folders = name.split(".")[:-1]
    place = Path(str(import_module(package).__file__)).parent.joinpath(*folders)
    spec = PathFinder.find_spec(name, [str(place)])
    if spec is None or spec.loader is None or not (spec.origin or "").endswith((".so", ".pyd")):
        return None
    try:
        sys.modules[name] = module = module_from_spec(spec)
        spec.loader.exec_module(module)
    except ImportError:
        sys.modules.pop(name, None)
        return None
    return module
