"""Read the YAML files of franka_description by PyYAML and put them into the URDF of the kernels."""

from collections.abc import Callable
from typing import Any

import numpy as np

from runtime.library import Library
from runtime.outputs.model_files.bodies import RigidBody
from runtime.outputs.model_files.engines.answer import Unreadable
from runtime.outputs.model_files.formats.urdf import document_text, set_friction, set_inertial
from runtime.outputs.model_files.urdf_tree import link_keys, read_tree, short_names

INSTALL = "pip install pyyaml"
ENTRIES = ("xx", "xy", "xz", "yy", "yz", "zz")


def urdf_with_inertials(text: str, lib: Library, urdf: str) -> str | None:
    """Replace all inertials of a URDF by those of inertials.yaml."""

    def apply(table: dict[str, Any]) -> str:
        tree = read_tree(lib, urdf)
        keys = link_keys(tree)
        for link in tree.links:
            entry = table.pop(keys[link], None) if link in keys else None
            set_inertial(tree, link, None if entry is None else _body(entry))
        _require_empty(table)
        return document_text(tree)

    return _applied(text, apply)


def urdf_with_friction(text: str, lib: Library, urdf: str) -> str | None:
    """Replace damping and dry friction of a URDF by those of dynamics.yaml."""

    def apply(table: dict[str, Any]) -> str:
        tree = read_tree(lib, urdf)
        keys = short_names(lib.joint_names)
        for name in lib.joint_names:
            entry = table.pop(keys[name])["dynamic"]
            set_friction(tree, name, _number(entry["damping"]), _number(entry["friction"]))
        _require_empty(table)
        return document_text(tree)

    return _applied(text, apply)


def tables_of(text: str) -> dict[str, Any] | None:
    """Tables of a YAML file; None where PyYAML is not installed."""
    try:
        import yaml
    except ImportError:
        return None
    try:
        tables = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise Unreadable(str(error)) from None
    if not isinstance(tables, dict):
        raise Unreadable("no tables")
    return tables


def _applied(text: str, apply: Callable[[dict[str, Any]], str]) -> str | None:
    try:
        import yaml
    except ImportError:
        return None
    try:
        return apply(dict(yaml.safe_load(text)))
    except (yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise Unreadable(error) from None


def _body(entry: dict[str, Any]) -> RigidBody:
    e = {key: _number(entry["inertia"][key]) for key in ENTRIES}
    rows = [[e["xx"], e["xy"], e["xz"]], [e["xy"], e["yy"], e["yz"]], [e["xz"], e["yz"], e["zz"]]]
    com = np.array([float(word) for word in entry["origin"]["xyz"].split()])
    return RigidBody(_number(entry["mass"]), com, np.array(rows))


def _number(value: Any) -> float:
    if not isinstance(value, float):  # YAML 1.1 reads 1e-05 as text
        raise ValueError(f"expected a number with a decimal point, got {value!r}")
    return value


def _require_empty(table: dict[str, Any]) -> None:
    if table:
        raise ValueError(f"unknown keys {', '.join(map(str, table))}")
