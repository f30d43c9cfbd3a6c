"""Prior of rotor inertia: stated per joint, or read from the armature of an MJCF or URDF.

    [armature]
    joint1 = 0.15                 # kg·m², σ half of it
    joint2 = [0.057, 0.01]        # value and σ

    armature_from = "robot.xml"   # <joint name="…" armature="…"/>, or armature of its <dynamics>

σ of half the value stands for a rotor inertia from a data sheet times the square of a gear ratio.
"""

import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from runtime.common.files import text_of
from runtime.errors import IdentificationError
from runtime.estimators.problem import FrictionPrior
from runtime.library import Array, Library
from runtime.recording.friction import ROTOR

LARGEST = 1e6
"""Limit of a rotor inertia [kg·m², kg]."""
SHARE = 0.5
"""Standard deviation over the value where none is stated."""


def read_armature(facts: dict[str, Any], path: Path, lib: Library) -> Array | None:
    """Rotor inertia that a file of priors states.

    Returns (n, 2) [kg·m², kg].
    """
    stated: dict[str, Any] = {}
    if "armature_from" in facts:
        stated |= _from_model(path, facts["armature_from"], lib)
    given = facts.get("armature", {})
    if not isinstance(given, dict):
        raise IdentificationError(
            f"the prior '{path}' expects a table [armature] with joint = kg·m², got {given!r:.40}"
        )
    unknown = [name for name in given if name not in lib.joint_names]
    if unknown:
        raise IdentificationError(
            f"the prior '{path}' has the unknown joint '{unknown[0]}' under [armature]; known are "
            f"{', '.join(lib.joint_names)}"
        )
    stated |= given
    if not stated:
        return None
    values = np.tile([0.0, np.inf], (lib.n_joints, 1))
    for name, value in stated.items():
        values[lib.joint_names.index(name)] = _pair(name, value, path)
    return values


def friction_prior_of(armature: Array, columns: tuple[str, ...]) -> FrictionPrior:
    """Prior of the friction coefficients.

    armature (n, 2) [kg·m², kg] → (n, k).
    """
    if ROTOR.name not in columns:
        raise IdentificationError(
            "the prior states armature, but rotor inertia is not among the friction columns "
            f"{', '.join(columns) or 'none'}; add rotor to --friction"
        )
    shape = (len(armature), len(columns))
    mean, sigma = np.zeros(shape), np.full(shape, np.inf)
    k = columns.index(ROTOR.name)
    mean[:, k], sigma[:, k] = armature.T
    return FrictionPrior(mean, sigma)


def _from_model(path: Path, name: object, lib: Library) -> dict[str, float]:
    """Armature per joint of this robot that an MJCF or URDF states."""
    place = path.parent / name if isinstance(name, str) else path
    try:
        text = text_of(place)
        if not isinstance(name, str) or "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise ValueError("a document type is not read")
        tree = ElementTree.fromstring(text)  # noqa: S314  without entities
    except (OSError, ValueError, ElementTree.ParseError) as error:
        raise IdentificationError(
            f"armature_from of the prior '{path}' expects an MJCF or URDF beside it, but '{place}' "
            f"cannot be read ({error}); correct the name"
        ) from None
    values: dict[str, float] = {}
    for joint in tree.iter("joint"):
        dynamics = joint.find("dynamics")
        written = joint.get("armature") or (dynamics is not None and dynamics.get("armature"))
        if joint.get("name") in lib.joint_names and written:
            try:
                values[str(joint.get("name"))] = float(written)
            except ValueError:
                values[str(joint.get("name"))] = math.nan  # refused with its joint
    if not values:
        raise IdentificationError(
            f"'{place}' states no armature for a joint of '{lib.name}' "
            f"({', '.join(lib.joint_names)}); leave out armature_from"
        )
    return {joint: value for joint, value in values.items() if value != 0}


def _pair(joint: str, given: Any, path: Path) -> tuple[float, float]:
    """Value and standard deviation of one entry."""
    pair = given if isinstance(given, list) else [given, given]
    if len(pair) == 2 and all(_is_positive(each) for each in pair):
        sigma = pair[1] if isinstance(given, list) else SHARE * given
        return float(pair[0]), float(sigma)
    raise IdentificationError(
        f"the prior '{path}' expects kg·m² above 0, or [kg·m², σ], as armature of {joint}, got "
        f"{given!r:.40}; correct it"
    )


def _is_positive(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and 0 < value < LARGEST
