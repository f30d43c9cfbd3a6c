"""Model file formats by name: those of this package and those that plugins add.

A format is one module with an `ExportFormat` and one line of `EXPORT_FORMATS`, or an entry point
of the group "symgen.export_formats" in another package.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.common.files import replacing_folder, write_text
from runtime.errors import ExportError
from runtime.library import Library
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.registry import Registry


@dataclass(frozen=True, slots=True, eq=False)
class ExportFormat:
    """A model file format."""

    name: str  # word by which a user selects it
    sentence: str  # what the file holds and who reads it, without a full stop
    # file name, in which {robot} stands for the name of the robot; of a folder, where `write`
    # returns several files
    file: str
    write: Callable[[IdentifiedModel], str | Mapping[str, str]]  # text, or texts by path
    # model, what `write` returned → one sentence on how it was verified. It raises ExportError
    # where it does not describe the model, Unreadable where it cannot be read
    check: Callable[[IdentifiedModel, Any], str]
    # False for a file of joint friction alone. It is written for a model that is not physically
    # consistent too, and refused for a model without friction
    holds_inertia: bool = True
    is_folder: bool = False  # whether `write` returns several files
    takes_free_base: bool = False  # whether the file can hold a robot with a free base
    on_request: bool = False  # whether it is written only where it is named, since it takes seconds


_FORMATS = "runtime.outputs.model_files.formats"
EXPORT_FORMATS = Registry(
    "symgen.export_formats",
    ExportFormat,
    "model file format",
    {
        "urdf": f"{_FORMATS}.urdf:URDF",
        "mjcf": f"{_FORMATS}.mjcf:MJCF",
        "sdf": f"{_FORMATS}.sdf:SDF",
        "usd": f"{_FORMATS}.usd:USD",
        "inertials": f"{_FORMATS}.yaml_files:INERTIALS",
        "actuators": f"{_FORMATS}.yaml_files:ACTUATORS",
        "ros2": f"{_FORMATS}.ros2:ROS2",
        "gravity": f"{_FORMATS}.header:GRAVITY",
        "friction": f"{_FORMATS}.yaml_files:FRICTION",
        "header": f"{_FORMATS}.header:HEADER",
        "casadi": f"{_FORMATS}.casadi:CASADI",
    },
    ExportError,
)


def usual_formats() -> tuple[str, ...]:
    """Names of the formats that an export without names writes."""
    return tuple(each.name for each in EXPORT_FORMATS.records() if not each.on_request)


def require_base(lib: Library, chosen: ExportFormat) -> None:
    """Refuse a robot with a free base in a format that states fixed ones."""
    if lib.manifest.floating and not chosen.takes_free_base:
        known = ", ".join(each.name for each in EXPORT_FORMATS.records() if each.takes_free_base)
        raise ExportError(
            f"not written: the base of '{lib.name}' is free, and {chosen.name} states a fixed one; "
            f"use --to {known}"
        )


def save(path: Path, written: str | Mapping[str, str]) -> None:
    """Write what `ExportFormat.write` returned; file and folder appear complete or not at all."""
    if isinstance(written, str):
        write_text(path, written)
        return
    with replacing_folder(path) as folder:
        for place, text in written.items():
            write_text(folder / place, text)
