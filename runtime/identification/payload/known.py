"""A payload that is known from a scale and a drawing: mass, centre of mass, inertia.

It is given as numbers MASS,CX,CY,CZ[,IXX,IYY,IZZ,IXY,IXZ,IYZ] or as a JSON in the form of
`payload.json`: mass [kg], com [m], inertia [3 × 3 kg·m²] or none, link; all in the frame of the
mount.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import json_of
from runtime.errors import IdentificationError, RecordingError
from runtime.library import Array
from runtime.library.parameters import inertia_matrix

FORMAT = 1
"""Number of the format of payload.json; it is raised by a change that readers would misread."""
_ROUNDING = 1e-9
"""Negative part of a principal moment, over the trace, that counts as rounding."""


@dataclass(frozen=True, slots=True)
class KnownPayload:
    """A payload of known mass and centre of mass."""

    mass: float  # kg
    com: Array  # centre of mass in the frame of the mount, (3,) m
    # about the centre of mass, axes of that frame, (3, 3) kg·m²; None where unknown
    inertia: Array | None = None
    link: str | None = None  # link that carries it; None is the link of the tip
    frame: str = ""  # frame of com and inertia; empty is that of the mount
    identified: bool = False  # True when it was identified from torques and cannot calibrate them

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass > 0):
            raise IdentificationError(
                f"expected a mass above 0 kg of the known payload, got {self.mass:g}; weigh it"
            )
        if np.shape(self.com) != (3,) or not np.isfinite(self.com).all():
            raise IdentificationError(
                "expected three finite numbers in m as centre of mass of the known payload, got "
                f"{np.asarray(self.com).tolist()}; measure it in the frame of the flange"
            )
        if self.inertia is not None:
            _require_body(self.inertia)


def read_known_payload(text: str) -> KnownPayload:
    """Read a payload from an option: numbers, or the path of a JSON."""
    path = Path(text)
    if path.suffix == ".json":
        return _from_json(path)
    try:
        values = np.array([float(word) for word in text.split(",")])
    except ValueError:
        values = np.zeros(0)
    if len(values) not in {4, 10}:
        raise RecordingError(
            "expected the payload as MASS,CX,CY,CZ, or these and IXX,IYY,IZZ,IXY,IXZ,IYZ about the "
            f"centre of mass, or a file that ends in .json, got '{text}'; correct it"
        )
    inertia = inertia_matrix(values[4:]) if len(values) > 4 else None
    return KnownPayload(float(values[0]), values[1:4], inertia)


def read_payload_facts(path: Path) -> dict[str, Any]:
    """Facts of a payload.json, or of a JSON in its form that is written by hand."""
    facts = dict(json_of(path))
    number = facts.get("format", FORMAT)
    if isinstance(number, int) and number > FORMAT:
        raise RecordingError(
            f"'{path}' has the format {number}, expected {FORMAT}; update symgen, or identify the "
            "payload again with this version"
        )
    return facts


def _from_json(path: Path) -> KnownPayload:
    try:
        facts = read_payload_facts(path)
        inertia = facts.get("inertia")
        return KnownPayload(
            mass=float(facts["mass"]),
            com=np.array(facts["com"], dtype=float),
            inertia=None if inertia is None else np.array(inertia, dtype=float),
            link=None if facts.get("link") is None else str(facts["link"]),
            frame=str(facts.get("frame", "")),
            identified="sigma" in facts,
        )
    except (OSError, ValueError, KeyError, TypeError):
        raise RecordingError(
            f"'{path}' holds no payload; write a JSON with mass in kg, com = three numbers in m "
            "and, where it is known, inertia = three rows of three in kg·m²"
        ) from None


def _require_body(inertia: Array) -> None:
    """Refuse an inertia that is not physically consistent: Σ_com = ½ tr(I) 1 − I needs
    eigenvalues ≥ 0.
    """
    tensor = np.asarray(inertia, dtype=float)
    wrong = tensor.shape != (3, 3) or not np.isfinite(tensor).all() or (tensor != tensor.T).any()
    if not wrong:
        trace = float(np.trace(tensor))
        smallest = np.linalg.eigvalsh(trace / 2 * np.eye(3) - tensor)[0]
        wrong = bool(smallest < -_ROUNDING * abs(trace))
    if wrong:
        raise IdentificationError(
            "the inertia of the known payload is not physically consistent (expected three rows of "
            "three in kg·m² about the centre of mass, symmetric, no principal moment above the sum "
            "of the others); correct it, or leave it out so that it is identified"
        )
