"""Words of the text format of USD: identifiers, quoted names, tuples, indentation."""

import re

from runtime.library import Array
from runtime.outputs.model_files.bodies import digits


def prim_names(names: list[str]) -> dict[str, str]:
    """Name → identifier of USD; two names that become alike get numbers."""
    chosen: dict[str, str] = {}
    for name in names:
        word = re.sub(r"\W", "_", name, flags=re.ASCII) or "_"
        word = f"_{word}" if word[0].isdigit() else word
        used, count = set(chosen.values()), 1
        base = word
        while word in used and name not in chosen:
            count += 1
            word = f"{base}_{count}"
        chosen.setdefault(name, word)
    return chosen


def indented(lines: list[str], columns: int) -> list[str]:
    """Lines that begin some columns further right."""
    return [f"{' ' * columns}{line}" for line in lines]


def tuple_of(values: Array) -> str:
    """Tuple of numbers."""
    return f"({', '.join(map(digits, values))})"


def quoted(name: str) -> str:
    """Quoted text of USD."""
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
