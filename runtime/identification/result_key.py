"""One key of result.json: path, kind, shape, unit and the value of older files."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


class _Missing:
    """Marks a key without a value for older files."""


MISSING = _Missing()


@dataclass(frozen=True, slots=True)
class Key:
    """One key of result.json.

    Attributes:
        path: names from the top, joined by dots; `[]` marks a list of tables.
        kind: text, number, integer, boolean, list, table or any; with `?` it may be null.
        meaning: what the value is.
        shape: of a list; n joints, k friction columns, n_b base parameters.
        unit: SI unit of the numbers.
        older: value that a file of format 1 without this key is read with.
        is_optional: the key may be absent in the present format, too.
    """

    path: str
    kind: str
    meaning: str
    shape: str = ""
    unit: str = ""
    older: Any = MISSING
    is_optional: bool = False

    def accepts(self, value: object) -> bool:
        """Whether a JSON value is of this kind."""
        if value is None:
            return self.kind.endswith("?") or self.kind == "any"
        return _KINDS[self.kind.rstrip("?")](value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


_KINDS: dict[str, Callable[[object], bool]] = {
    "text": lambda value: isinstance(value, str),
    "number": _is_number,
    "integer": lambda value: isinstance(value, int) and not isinstance(value, bool),
    "boolean": lambda value: isinstance(value, bool),
    "list": lambda value: isinstance(value, list),
    "table": lambda value: isinstance(value, dict),
    "any": lambda value: True,
}
