"""Values of options that need no conversion by Typer.

Typer converts every value by pydantic, whose import takes as long as that of NumPy. Text, flags,
defaults and paths without conditions are what they are; anything else is left to Typer with its
messages.
"""

import os
from pathlib import Path
from typing import Any

from typer.core import TyperGroup

_CONDITIONS = ("exists", "writable", "executable", "resolve_path", "allow_dash", "path_type")
_LEFT = object()


class _Plain:
    """Conversion of one parameter; Typer's own is built when it is needed."""

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """Value of the parameter."""
        several = param.multiple or param.nargs == -1
        ready = (() if several else None) if value is None else _ready(value, param)
        if ready is not _LEFT:
            return ready
        param._runtime_param = None
        return param.get_runtime_param().coerce(value, param=param, ctx=ctx)


class PlainGroup(TyperGroup):
    """A group of commands whose options take plain values as they are."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Parameters of the group."""
        return without_conversion(super().get_params(ctx))


def without_conversion(params: list[Any]) -> list[Any]:
    """Let parameters take plain values as they are."""
    for param in params:
        if getattr(param, "_runtime_param", _LEFT) is None and hasattr(param, "type_descriptor"):
            param._runtime_param = _Plain()
    return params


def _ready(value: Any, param: Any) -> Any:
    """The value that Typer would return, or `_LEFT`."""
    kind, info = param.type_descriptor.annotation, param.type_descriptor.parameter_info
    if getattr(info, "parser", None) is not None:
        return _LEFT
    if kind == list[str] and isinstance(value, (list, tuple)):
        return list(value) if all(type(each) is str for each in value) else _LEFT
    if kind is Path and type(value) is str:
        free = not any(getattr(info, condition, None) for condition in _CONDITIONS)
        usable = not os.path.exists(value) or os.access(value, os.R_OK)
        return Path(value) if free and usable and info.file_okay and info.dir_okay else _LEFT
    if kind not in {str, bool, int, float} or type(value) is not kind:
        return _LEFT
    low, high = getattr(info, "min", None), getattr(info, "max", None)
    inside = (low is None or value >= low) and (high is None or value <= high)
    return value if inside else _LEFT
