"""Units of joint torques: N·m of joints that turn, N of joints that slide."""

from collections.abc import Sequence

from runtime.library.binding import Array
from runtime.library.manifest import Manifest


def torque_units(manifest: Manifest) -> tuple[str, ...]:
    """Unit of the torque of every joint, "N·m" or "N", (n,)."""
    return tuple("N" if joint.kind == "prismatic" else "N·m" for joint in manifest.joints)


def file_units(manifest: Manifest) -> list[str]:
    """The same as written in files, "N*m" or "N"."""
    return [unit.replace("·", "*") for unit in torque_units(manifest)]


def common_unit(units: Sequence[str], prefix: str = "") -> str:
    """Unit of a number over several joints."""
    return "|".join(prefix + unit for unit in dict.fromkeys(units))


def listed_torques(values: Array, units: Sequence[str], digits: str, prefix: str = "") -> str:
    """Torques of several joints as text."""
    numbers = [f"{value:{digits}}" for value in values]
    if len(set(units)) == 1:
        return f"{', '.join(numbers)} {prefix}{units[0]}"
    return ", ".join(f"{n} {prefix}{unit}" for n, unit in zip(numbers, units, strict=True))
