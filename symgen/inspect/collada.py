"""COLLADA meshes looked at before they are loaded: what is no number makes loaders run for ever.

Assimp, which coal loads meshes with, reads a list of indices until it has read as many numbers as
it was promised; a character that is none stops it from moving on, but not from reading.
"""

from pathlib import Path
from xml.etree.ElementTree import ParseError

from defusedxml.ElementTree import iterparse

INDICES = frozenset({"p", "ph", "h", "v", "vcount"})
FLOATS = frozenset({"float_array", "matrix", "translate", "rotate", "scale", "lookat", "skew"})
DEEPEST = 200
"""Levels of elements; exporters make ten."""


def is_sound(path: Path) -> bool:
    """Whether a .dae file is XML of moderate depth whose lists hold numbers alone."""
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
