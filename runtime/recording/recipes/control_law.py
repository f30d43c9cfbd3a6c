"""A control law that gives the torque of a robot without torque sensors.

    τ_m = kp (r q_des − r q) + kd (r dq_des − r dq) + τ_ff,  |τ_m| ≤ limit,   τ = r τ_m

r is the gear ratio where gains, feed-forward and limit belong to the motor side, else 1. Desired
positions and velocities have unit, order, sign and gear of the measured ones. This module states
the law; `runtime.recording.commanded_torque` computes the torque.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from runtime.errors import RecordingError
from runtime.recording.settings import one_of

if TYPE_CHECKING:  # a recipe holds a law
    from runtime.recording.recipes.recipe import Signal

LAWS = ("pd",)
"""Names of the laws."""
Gain = float | tuple[float, ...] | str
"""One number, one per joint, or the name of an array."""
Names = str | tuple[str | int, ...]
"""Name of an array, or of the columns of all joints."""
NUMBERS = ("kp", "kd", "effort_limit", "gear")
"""Keys whose value may be a number, a list or the name of an array."""


@dataclass(frozen=True, slots=True)
class ControlLaw:
    """A law that computes the torque from desired and measured motion.

    Attributes:
        law: name, one of `LAWS`.
        kp: stiffness [N·m/rad, N/m].
        kd: damping [N·m·s/rad, N·s/m].
        q_des: array or columns of the desired positions.
        dq_des: array or columns of the desired velocities; "" for zero.
        tau_ff: array or columns of the feed-forward torque [N·m, N]; "" for zero.
        effort_limit: largest |τ_m| [N·m, N]; 0 for none.
        gear: r, motor angle over joint angle, where the law acts on the motor side.
    """

    law: str
    kp: Gain
    kd: Gain
    q_des: Names
    dq_des: Names = ""
    tau_ff: Names = ""
    effort_limit: Gain = 0.0
    gear: Gain = 1.0

    def __post_init__(self) -> None:
        one_of("[torque] law", self.law, LAWS)
        if not self.q_des:
            raise RecordingError(
                "[torque] q_des expects the name of an array or a list of columns, got none; "
                "write where the desired positions are"
            )
        for key in NUMBERS:
            value = getattr(self, key)
            numbers = value if isinstance(value, tuple) else (value,)
            if not isinstance(value, str) and not all(0 <= x < 1e9 for x in numbers):
                raise RecordingError(
                    f"[torque] {key} expects numbers from 0 on, got {value}; correct it"
                )
            if key == "gear" and not isinstance(value, str) and not all(numbers):
                raise RecordingError("[torque] gear expects numbers above 0, got 0; correct it")

    def parts(self, position: "Signal", velocity: "Signal | None") -> dict[str, "Signal"]:
        """Signals of the law that have a row per instant."""
        parts = {"desired_position": _beside(position, self.q_des)}
        if velocity is None and (self.dq_des or self.needs_velocity):
            raise RecordingError(
                "[torque] law = 'pd' with kd expects [velocity], got none; describe the measured "
                "velocity, or write kd = 0"
            )
        if velocity is not None and self.dq_des:
            parts["desired_velocity"] = _beside(velocity, self.dq_des)
        if self.tau_ff:
            parts["feed_forward"] = replace(_bare(position, self.tau_ff), unit="N*m")
        for key in NUMBERS:
            value = getattr(self, key)
            if isinstance(value, str):
                parts[key] = _bare(position, value)
        return parts

    @property
    def needs_velocity(self) -> bool:
        """Whether kd is anything but zero."""
        return self.kd not in (0.0, ()) and not (isinstance(self.kd, tuple) and not any(self.kd))

    def __str__(self) -> str:
        """The law with its gains, for a sentence."""
        texts = [
            f"{key} = {_text(getattr(self, key))}"
            for key, usual in (("kp", None), ("kd", None), ("effort_limit", 0.0), ("gear", 1.0))
            if getattr(self, key) != usual
        ]
        return f"{self.law} law ({', '.join(texts)})"


def _text(value: Gain) -> str:
    if isinstance(value, str):
        return f"array '{value}'"
    numbers = value if isinstance(value, tuple) else (value,)
    distinct = numbers[:1] if len(set(numbers)) == 1 else numbers
    return "/".join(f"{x:g}" for x in distinct)


def _beside(measured: "Signal", names: Names) -> "Signal":
    """A signal with the conversion of a measured one."""
    if isinstance(names, tuple):
        return replace(measured, columns=names, key="")
    if measured.columns:  # one column per joint: the name is the stem of numbered titles
        titles = tuple(f"{names}{joint + 1}" for joint in range(len(measured.columns)))
        return replace(measured, columns=titles, key="")
    if not measured.key or measured.layout == "bag":
        raise RecordingError(
            f"[torque] expects '{names}' to be an array or columns beside those of the measured "
            "motion, but the layout of the log has neither; convert the log to CSV, Parquet or NPZ"
        )
    return replace(measured, key=names)


def _bare(measured: "Signal", names: Names) -> "Signal":
    """A signal beside a measured one, in the units of the law and in the order of the joints."""
    return replace(_beside(measured, names), sign=1.0, gain=None, offset=0.0)
