"""xacro → URDF by the package xacro, with $(find PACKAGE) from `Packages`."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from symgen.build.sources.packages import Packages
from symgen.errors import BuildError, SymgenError


def expanded(path: Path, arguments: Mapping[str, str], packages: Packages) -> str:
    """Expand a xacro file.

    Args:
        path: the file.
        arguments: name → value of <xacro:arg>.
        packages: where $(find PACKAGE) searches.

    Returns:
        Text of the URDF.

    Raises:
        BuildError: xacro is not installed, or it refuses the file: an argument is missing, a macro
            is unknown, a file is not found.
    """
    try:
        import xacro
    except ImportError:
        raise BuildError(
            f"'{path}' is a xacro file, which the package xacro expands; run: pip install xacro"
        ) from None
    if not path.is_file():
        raise BuildError(f"cannot read the xacro file '{path}': there is no such file")
    try:
        with _packages_from(packages):
            return str(xacro.process_file(str(path), mappings=dict(arguments)).toxml())
    except SymgenError:
        raise
    except Exception as error:  # xacro raises what the file's expressions raise
        cause: BaseException | None = getattr(error, "exc", None)
        if isinstance(cause, SymgenError):
            raise cause from None
        reason = " ".join(str(error).split()) or type(error).__name__
        hint = "; give it by --arg NAME=VALUE" if "ndefined substitution arg" in reason else ""
        raise BuildError(f"xacro cannot expand '{path}': {reason}{hint}") from None


@contextmanager
def _packages_from(packages: Packages) -> Iterator[None]:
    """Resolve $(find PACKAGE) by `packages` instead of the index of a ROS installation."""
    module: Any = import_module("xacro.substitution_args")
    usual = module._eval_find
    module._eval_find = lambda name: str(packages.folder(name).resolve())
    try:
        yield
    finally:
        module._eval_find = usual
