"""Typed access to one table of a TOML file, with messages that name the table and the key."""

import math
from dataclasses import dataclass
from typing import Any

from symgen.errors import UrdfError

Vector = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class MechanismTable:
    """A table and its name.

    Attributes:
        entry: keys and values.
        what: name of file and table, for messages.
    """

    entry: dict[str, Any]
    what: str

    def require_keys(self, keys: tuple[str, ...]) -> None:
        """Refuse keys other than these."""
        for key in self.entry:
            if key not in keys:
                raise UrdfError(
                    f"{self.what} has the unknown key '{key}'; known are {', '.join(keys)}"
                )

    def text(self, key: str) -> str:
        """A name that must be given."""
        value = self.entry.get(key)
        if not isinstance(value, str) or not value:
            raise UrdfError(f'{self.what} needs {key} = "NAME", got {value!r}')
        return value

    def factors(self) -> dict[str, float]:
        """Joint → factor, from `of`."""
        of = self.entry.get("of")
        if not isinstance(of, dict) or not of or not all(map(_is_number, of.values())):
            raise UrdfError(
                f"{self.what} needs of = {{JOINT = factor, …}} with finite factors, got {of!r}"
            )
        return {joint: float(factor) for joint, factor in of.items()}

    def along(self) -> dict[str, float]:
        """Factors of joints from `joint = "j"` or `of = {…}`."""
        if "joint" in self.entry and "of" not in self.entry:
            return {self.text("joint"): 1.0}
        return self.factors()

    def number(self, key: str, default: float | None = None) -> float:
        """A finite number."""
        value = self.entry.get(key, default)
        if value is None or not _is_number(value):
            raise UrdfError(f"{self.what} needs a finite number for {key}, got {value!r}")
        return float(value)

    def numbers(self, key: str, count: int | None = None) -> Vector:
        """A list of finite numbers."""
        value = self.entry.get(key)
        size = f"{count} finite numbers" if count else "a list of finite numbers"
        fits = isinstance(value, list) and value and all(map(_is_number, value))
        if not isinstance(value, list) or not fits or (count and len(value) != count):
            raise UrdfError(f"{self.what} needs {size} for {key}, got {value!r}")
        return tuple(float(x) for x in value)


def _is_number(value: Any) -> bool:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and math.isfinite(value)
