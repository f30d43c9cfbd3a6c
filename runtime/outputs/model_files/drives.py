"""Drives of an identified robot, as simulators' actuators need them: gains, delay, bias, σ."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from runtime.errors import ExportError

KEYS = ("armature", "viscous", "coulomb", "offset", "encoder_bias")
"""Values of one drive in result.json."""


@dataclass(frozen=True, slots=True)
class Drives:
    """Drives of all joints in SI units; None where a value is unknown.

    Attributes:
        joints: names.
        values: key of `KEYS` → one value per joint.
        sigma: the same for standard deviations.
        delay: of the torque, per joint [s].
        delay_sigma: likewise [s].
        kp: stiffness of the control law, per joint [N·m/rad, N/m].
        kd: damping of the control law, per joint [N·m·s/rad, N·s/m].
    """

    joints: tuple[str, ...]
    values: dict[str, tuple[float | None, ...]]
    sigma: dict[str, tuple[float | None, ...]]
    delay: tuple[float | None, ...]
    delay_sigma: tuple[float | None, ...]
    kp: tuple[float | None, ...]
    kd: tuple[float | None, ...]

    def delay_note(self) -> str:
        """Sentence on the delay for the head of a model file; "" without one."""
        known = [d for d in self.delay if d is not None]
        if not known:
            return ""
        shown = ", ".join(f"{1e3 * d:.3g}" for d in dict.fromkeys(known))
        return f"delay: the commanded torque acts {shown} ms late; the file cannot state it."


def drives_of(facts: Mapping[str, Any]) -> Drives | None:
    """Drives of a result.json."""
    tables, joints = facts.get("drive"), tuple(map(str, facts["joints"]))
    if not tables:
        return None
    n = len(joints)
    delays = facts.get("delay_s")
    each = delays if isinstance(delays, list) else [delays or {}] * n
    law = facts.get("control_law") or {}
    try:
        if len(each) != n or len(tables) != n:
            raise ValueError("another number of joints")
        return Drives(
            joints,
            {key: tuple(_number(table[key]) for table in tables) for key in KEYS},
            {key: tuple(_number(table["sigma"][key]) for table in tables) for key in KEYS},
            tuple(_number(delay.get("value")) for delay in each),
            tuple(_number(delay.get("sigma")) for delay in each),
            _per_joint(law.get("kp"), n),
            _per_joint(law.get("kd"), n),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ExportError(
            f"the drives of the result are damaged ({error}); identify the robot again"
        ) from None


def _number(value: Any) -> float | None:
    return None if value is None else float(value)


def _per_joint(value: Any, n: int) -> tuple[float | None, ...]:
    values = value if isinstance(value, list) else [value] * n
    if len(values) != n:
        raise ValueError("another number of gains")
    return tuple(_number(each) for each in values)
