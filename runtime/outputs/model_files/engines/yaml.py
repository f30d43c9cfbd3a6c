"""Read the YAML files of franka_description by PyYAML and put them into the URDF of the kernels."""

from collections.abc import Callable
from typing import Any

import numpy as np

from runtime.library import Library
from runtime.library.parameters import inertia_matrix
from runtime.outputs.model_files.engines.answer import Unreadable
from runtime.outputs.model_files.formats.urdf import document_text, set_friction, set_inertial
from runtime.outputs.model_files.urdf_tree import RigidBody, Tree, link_keys, read_tree, short_names

INSTALL = "pip install pyyaml"
ENTRIES = ("xx", "yy", "zz", "xy", "xz", "yz")
"""Entries of an inertia, in the order of π."""


def urdf_with_inertials(text: str, lib: Library, urdf: str) -> str | None:
    """Replace all inertials of a URDF by those of inertials.yaml."""

    def apply(table: dict[str, Any], tree: Tree) -> None:
        keys = link_keys(tree)
        for link in tree.links:
            entry = table.pop(keys[link], None) if link in keys else None
            set_inertial(tree, link, None if entry is None else _body(entry))

    return _applied(text, lib, urdf, apply)


def urdf_with_friction(text: str, lib: Library, urdf: str) -> str | None:
    """Replace damping and dry friction of a URDF by those of dynamics.yaml."""

    def apply(table: dict[str, Any], tree: Tree) -> None:
        keys = short_names(lib.joint_names)
        for name in lib.joint_names:
            entry = table.pop(keys[name])["dynamic"]
            set_friction(tree, name, _number(entry["damping"]), _number(entry["friction"]))

    return _applied(text, lib, urdf, apply)


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


def _applied(
    text: str, lib: Library, urdf: str, apply: Callable[[dict[str, Any], Tree], None]
) -> str | None:
    """The URDF after `apply` has put every table of a YAML file into it."""
    table, tree = tables_of(text), read_tree(lib, urdf)
    if table is None:
        return None
    try:
        apply(table, tree)
        if table:
            raise ValueError(f"unknown keys {', '.join(map(str, table))}")
    except (KeyError, TypeError, ValueError) as error:
        raise Unreadable(error) from None
    return document_text(tree)


def _body(entry: dict[str, Any]) -> RigidBody:
    inertia = inertia_matrix([_number(entry["inertia"][key]) for key in ENTRIES])
    com = np.array([float(word) for word in entry["origin"]["xyz"].split()])
    return RigidBody(_number(entry["mass"]), com, inertia)


def _number(value: Any) -> float:
    if not isinstance(value, float):  # YAML 1.1 reads 1e-05 as text
        raise ValueError(f"expected a number with a decimal point, got {value!r}")
    return value
