"""ROS 2 package: generated C, a plugin of inverse_dynamics_solver, parameters, an example node.

    τ = M(q) ddq + C(q, dq) dq + g(q),   τ_f = damping dq + dry tanh(dq / ε) + offset

The interface is that of `inverse_dynamics_solver` (Petrone, Ferrentino, Chiacchio; ROS 2 Humble and
Jazzy). The templates are in `ros2_package`; @{name} stands for a value of `_values`.
"""

import re
from collections.abc import Mapping
from importlib.resources import files
from string import Template

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array
from runtime.library.parameters import PI_NAMES
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.formats.header import INSTALL, c_header, comment_text, read_arrays
from runtime.outputs.model_files.model import IdentifiedModel, springs_left_out
from runtime.outputs.model_files.reload_check import unchecked
from runtime.outputs.model_files.urdf_tree import digits, quoted, row

PLACES = {  # template → place in the package
    "package.xml": "package.xml",
    "CMakeLists.txt": "CMakeLists.txt",
    "plugins.xml": "plugins.xml",
    "README.md": "README.md",
    "solver.hpp": "include/@{package}/solver.hpp",
    "solver.cpp": "src/solver.cpp",
    "gravity_compensation.cpp": "src/gravity_compensation.cpp",
    "gravity_compensation.launch.py": "launch/gravity_compensation.launch.py",
}


class _Text(Template):
    """Templates whose values are marked by @, since CMake and shells use $."""

    delimiter = "@"


def ros2_files(model: IdentifiedModel) -> dict[str, str]:
    """Files of the package by their path in it."""
    lib = model.lib
    if springs_left_out(lib):
        raise ExportError(
            "not written: springs and torque curves have no place in the ROS 2 package; export "
            "header, and add lib.known_torque(q) and the springs of unknown stiffness, "
            "lib.spring_columns(q) @ k"
        )
    values = _values(model)
    templates = files("runtime.outputs.model_files") / "ros2_package"
    written = {
        _Text(place).substitute(values): _Text(
            (templates / f"{name}.in").read_text(encoding="utf-8")
        ).substitute(values)
        for name, place in PLACES.items()
    }
    include = f"include/{values['package']}"
    arrays = {f"{lib.name}_parameters_{key}": each for key, each in _arrays(model).items()}
    guard, comment = f"{lib.name.upper()}_PARAMETERS_H", model.comment("Parameters")
    written[f"{include}/parameters.h"] = c_header(guard, comment, arrays)
    written["config/parameters.yaml"] = _yaml(model)
    header = f"{lib.name}.h"
    for name, place in (("kernels.c", "src/kernels.c"), (header, f"{include}/{header}")):
        try:
            written[place] = (lib.folder / name).read_text(encoding="utf-8")
        except OSError:
            raise ExportError(
                f"not written: expected the generated code '{lib.folder / name}', and there is "
                "none; run: python -m symgen build"
            ) from None
    return written


def check_ros2(model: IdentifiedModel, written: Mapping[str, str]) -> str:
    """Compile the header of the parameters; its numbers must be the identified ones bit for bit."""
    lib = model.lib
    (header,) = (text for place, text in written.items() if place.endswith("/parameters.h"))
    if lib.manifest.model_hash not in written["src/kernels.c"]:
        raise ExportError(
            "not written: expected kernels.c of the model of the library, and it belongs to "
            "another; run: python -m symgen build"
        )
    arrays = {f"{lib.name}_parameters_{key}": each for key, (_, each) in _arrays(model).items()}
    if read_arrays(header, arrays, "parameters") is None:
        return unchecked(INSTALL)
    return "verified: reloaded by a C compiler, all parameters equal; colcon builds the package"


def _values(model: IdentifiedModel) -> dict[str, str]:
    lib = model.lib
    notes = "".join(f"\n- {note}" for note in (*model.bodies.notes, *model.friction.notes))
    return {
        "robot": lib.name,
        # lower case, one underscore at a time, as ROS requires
        "package": re.sub(r"_+", "_", f"{lib.name}_identified_dynamics"),
        "model_hash": lib.manifest.model_hash,
        "n": str(lib.n_joints),
        "links": str(lib.n_links),
        "parameters": str(model.pi.size),
        "joints": ", ".join(quoted(name) for name in lib.joint_names),
        "joint_list": ", ".join(f"`{name}`" for name in lib.joint_names),
        "friction_speed": digits(model.friction.terms.coulomb_speed),
        "gravity": row(lib.gravity),
        "notes": notes,
    }


def _arrays(model: IdentifiedModel) -> dict[str, tuple[str, Array]]:
    """End of the name in C → meaning and values."""
    friction, unit = model.friction, "N m or N per joint"
    offset = np.zeros(model.lib.n_joints)
    if friction.values is not None and "offset" in friction.terms.columns:
        offset = friction.values[:, friction.terms.columns.index("offset")]
    return {
        "pi": (
            f"per link: {', '.join(PI_NAMES)}; kg, kg m, kg m^2 about the link origin",
            model.pi,
        ),
        "damping": ("N m s/rad or N s/m per joint", friction.filled("damping")),
        "dry_friction": (unit, friction.filled("friction")),
        "offset": (unit, offset),
    }


def _yaml(model: IdentifiedModel) -> str:
    arrays = {key: values for key, (_, values) in _arrays(model).items()}
    arrays["friction_speed"] = np.array([model.friction.terms.coulomb_speed])
    lines = [
        *(f"# {comment_text(line)}" for line in model.comment("Parameters")),
        "gravity_compensation:",
        "  ros__parameters:",
        "    solver:",
        *(f"      {key}: [{', '.join(map(digits, v))}]" for key, v in arrays.items()),
    ]
    return "\n".join([*lines, ""])


ROS2 = ExportFormat(
    "ros2",
    "ROS 2 package with an inverse_dynamics_solver plugin and a gravity-compensation node",
    "{robot}_identified_dynamics",
    ros2_files,
    check_ros2,
    is_folder=True,
)
