"""Check of COLLADA meshes before loading: text among numbers makes the loader loop for ever.

Assimp, with which coal loads meshes, reads a list of indices until it has as many numbers as the
file announces. A character that is not a digit stops its position, but not its loop.
"""

from pathlib import Path
from xml.etree.ElementTree import ParseError

from defusedxml.ElementTree import iterparse

INDICES = frozenset({"p", "ph", "h", "v", "vcount"})
"""Elements that hold integers."""
FLOATS = frozenset({"float_array", "matrix", "translate", "rotate", "scale", "lookat", "skew"})
"""Elements that hold floating-point numbers."""
DEEPEST = 200
"""Largest depth of elements; exporters write about ten levels."""


def is_sound(path: Path) -> bool:
    """True for a .dae file of well-formed XML and moderate depth whose lists hold only numbers."""
    depth = 0
    try:
        for event, element in iterparse(path, events=("start", "end"), forbid_dtd=True):
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                return False
            if event == "end":
                _require_numbers(str(element.tag).rpartition("}")[2], element.text or "")
    except (ParseError, ValueError, OSError):
        return False
    return True


def _require_numbers(tag: str, text: str) -> None:
    if tag in INDICES and not all(word.isdecimal() and word.isascii() for word in text.split()):
        raise ValueError(tag)
    if tag in FLOATS:
        for word in text.split():
            float(word)
