"""A recipe: how the raw files of one logger become a recording, and the defaults for its use.

A signal of the file passes, in this order: unit (and gain) → order → sign → gear → offset.

    x[:, i]  = sign_i · gain_i · unit_i · raw[:, order_i]
    q = R⁻¹ x + offset,   dq = R⁻¹ x,   ddq = R⁻¹ x,   τ = Rᵀ x      (R = 1 without [gear])

Nothing of this is guessed; a recipe states it. `recipe_file` reads recipes from TOML.

Without a torque sensor a control law gives the torque; `runtime.recording.unit_conversion` computes
it.

    τ_m = kp (r q_des − r q) + kd (r dq_des − r dq) + τ_ff,  |τ_m| ≤ limit,   τ = r τ_m

r is the gear ratio where gains, feed-forward and limit belong to the motor side, else 1. Desired
positions and velocities have unit, order, sign and gear of the measured ones.
"""

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, pi

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import RecordingError
from runtime.recording.settings import Friction, Preparation, Split, one_of, positive

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "position": {"rad": 1.0, "deg": pi / 180, "m": 1.0, "mm": 1e-3},
    "velocity": {"rad/s": 1.0, "deg/s": pi / 180, "rpm": pi / 30, "m/s": 1.0, "mm/s": 1e-3},
    "acceleration": {"rad/s^2": 1.0, "deg/s^2": pi / 180, "m/s^2": 1.0, "mm/s^2": 1e-3},
    "torque": {"N*m": 1.0, "mN*m": 1e-3, "N": 1.0, "A": 1.0, "mA": 1e-3},
}
SI = {kind: next(iter(units)) for kind, units in UNITS.items()}  # signal → SI unit of hinges
EXTRA_UNITS = {"degC": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0, "V": 1.0, "A": 1.0, "1": 1.0}
"""Units of further signals [°C, s, V, A]; kelvins are degC with offset = -273.15."""


@dataclass(frozen=True, slots=True)
class Source:
    """Source of public files: one address per file, pinned by commit and sha256.

    `base` is the address of the folder that holds the files; `{commit}` in it is filled in.
    """

    url: str = ""
    licence: str = ""
    commit: str = ""
    base: str = ""
    sha256: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Time:
    """The clock of the log: a column with its unit, or a constant rate instead of one."""

    file: str = ""
    layout: str = ""
    key: str = ""
    column: str | int = ""
    unit: str = ""
    rate_hz: float | None = None
    from_zero: bool = False

    def __post_init__(self) -> None:
        if self.rate_hz is not None:
            positive("[time] rate_hz", self.rate_hz)
            if self.unit or self.file or self.column != "":
                raise RecordingError(
                    "[time] expects either rate_hz or a column with a unit, but got both; "
                    "keep one of them"
                )
            return
        one_of("[time] unit", self.unit, tuple(UNITS["time"]))

    @property
    def columns(self) -> tuple[str | int, ...]:
        """The one column."""
        return (self.column,)

    @property
    def width(self) -> int:
        """Numbers per sample of flat text."""
        return 1


@dataclass(frozen=True, slots=True)
class Signal:
    """One measured quantity of all joints: its place in the files, unit, order and sign.

    `columns` are names or indices (of columns; with `key` of the numbers of an array), `width` the
    numbers per sample (flat), `key` the array (npz), the column of lists (parquet) or the field of
    JointState (bag); `cells` is "json" where one column of a CSV has a list per row. `offset` is in
    the unit of the file and is added after the gear.
    """

    unit: str | tuple[str, ...]
    file: str = ""
    layout: str = ""
    key: str = ""
    columns: tuple[str | int, ...] = ()
    width: int = 0
    cells: str = ""
    order: tuple[int, ...] = ()
    sign: float | tuple[float, ...] = 1.0
    gain: float | tuple[float, ...] | None = None
    offset: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        if self.order and sorted(self.order) != list(range(len(self.order))):
            raise RecordingError(
                f"order expects a permutation of 0 … {len(self.order) - 1}, got "
                f"{list(self.order)}; name every joint once"
            )
        signs = self.sign if isinstance(self.sign, tuple) else (self.sign,)
        if any(abs(s) != 1.0 for s in signs):
            raise RecordingError(f"sign expects 1 or -1, got {self.sign}; use gain to scale")
        if self.cells:
            one_of("cells", self.cells, (JSON_CELLS,))
            if len(self.columns) != 1:
                raise RecordingError(
                    'cells = "json" expects the one column of the lists, got '
                    f"{len(self.columns)} columns; name it under columns"
                )
        if self.layout == "flat" and self.width < 1:
            raise RecordingError(
                f"the flat layout expects width ≥ 1, got {self.width}; "
                "write how many numbers make one sample"
            )

    def reordered(self, places: Iterable[int]) -> "Signal":
        """The signal with the joints at these places of its present order."""
        order = tuple(self.order[k] if self.order else int(k) for k in places)
        return replace(self, order=order)

    def signed(self, signs: ArrayLike) -> "Signal":
        """The signal with further signs; offsets are added after the sign and change theirs."""
        products = [(np.multiply(each, signs) + 0.0).tolist() for each in (self.sign, self.offset)]
        sign, offset = (tuple(each) if isinstance(each, list) else each for each in products)
        return replace(self, sign=sign, offset=offset if np.any(offset) else 0.0)

    @property
    def units(self) -> tuple[str, ...]:
        """The unit of all joints, or one per joint."""
        return (self.unit,) if isinstance(self.unit, str) else self.unit


JSON_CELLS = "json"  # cells of a CSV that hold lists of numbers

MEASURED, COMMANDED, CURRENT = "measured", "commanded", "current"
"""Sources of a torque: a sensor or the robot's controller, a control law, a motor current."""

LAWS = ("pd",)  # names of the laws

Gain = float | tuple[float, ...] | str  # one number, one per joint, or the name of an array

Names = str | tuple[str | int, ...]  # name of an array, or of the columns of all joints

NUMBERS = ("kp", "kd", "effort_limit", "gear")  # a number, a list or the name of an array


@dataclass(frozen=True, slots=True)
class ControlLaw:
    """A law that computes the torque from desired and measured motion."""

    law: str  # name, one of `LAWS`
    kp: Gain  # stiffness [N·m/rad, N/m]
    kd: Gain  # damping [N·m·s/rad, N·s/m]
    q_des: Names  # array or columns of the desired positions
    dq_des: Names = ""  # array or columns of the desired velocities; "" for zero
    tau_ff: Names = ""  # array or columns of the feed-forward torque [N·m, N]; "" for zero
    effort_limit: Gain = 0.0  # largest |τ_m| [N·m, N]; 0 for none
    gear: Gain = 1.0  # r, motor angle over joint angle, where the law acts on the motor side

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

    def parts(self, position: Signal, velocity: Signal | None) -> dict[str, Signal]:
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
    def numbers(self) -> dict[str, float | tuple[float, ...] | None]:
        """Gains of `NUMBERS`; None for one that varies over the log."""
        values = {key: getattr(self, key) for key in NUMBERS}
        return {key: None if isinstance(value, str) else value for key, value in values.items()}

    def reordered(self, places: Iterable[int]) -> "ControlLaw":
        """The law of the joints at these places of its present order."""
        joints = list(places)
        of_joints = {
            key: tuple(value[k] for k in joints)
            for key, value in self.numbers.items()
            if isinstance(value, tuple)
        }
        return replace(self, **of_joints)  # type: ignore[arg-type]

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


def _beside(measured: Signal, names: Names) -> Signal:
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


def _bare(measured: Signal, names: Names) -> Signal:
    """A signal beside a measured one, in the units of the law and in the order of the joints."""
    return replace(_beside(measured, names), sign=1.0, gain=None, offset=0.0)


@dataclass(frozen=True, slots=True)
class Recipe:
    """Description of the logs of one robot, and defaults for their preparation.

    Without `position` the files follow the default convention of `read_recording`, and only the
    defaults (and a rate) are taken from here. `{run}` in a file name is filled with `run`. In a
    bag, `topic` is that of the joint states, and `joints` picks and orders them by name. `law` is
    [torque] of a robot that measures no torque. `extra` holds further signals by name, one column
    per joint or one for the robot, for friction columns that need them.
    """

    name: str = ""
    description: str = ""
    robot: str = ""
    run: str = ""
    topic: str = ""
    joints: tuple[str, ...] = ()
    leave_out: tuple[tuple[float, float], ...] = ()
    source: Source = field(default_factory=Source)
    time: Time | None = None
    position: Signal | None = None
    velocity: Signal | None = None
    acceleration: Signal | None = None
    torque: Signal | None = None
    law: ControlLaw | None = None
    extra: dict[str, Signal] = field(default_factory=dict)
    gear: tuple[tuple[float, ...], ...] = ()
    preparation: Preparation = field(default_factory=Preparation)
    split: Split | None = None
    friction: Friction | None = None

    def __post_init__(self) -> None:
        for each in self.leave_out:
            if not all(map(isfinite, each)) or each[0] > each[1]:
                raise RecordingError(
                    "leave_out expects intervals [from, to] in s with from ≤ to, got "
                    f"{list(each)}; write leave_out = [[1.0, 1.5]]"
                )
        for kind, signal in self.signals().items():
            for unit in signal.units:
                one_of(f"[{kind}] unit", unit, tuple(UNITS[kind]))
        for name, signal in self.extra.items():
            for unit in signal.units:
                one_of(f"[extra.{name}] unit", unit, tuple(EXTRA_UNITS))
        if self.position is None and self.signals():
            raise RecordingError(
                f"a recipe with [{next(iter(self.signals()))}] expects [position] too, got none; "
                "describe every signal, or none for the default convention"
            )
        if self.position is not None and self.time is None:
            raise RecordingError("expected a table [time] with a unit or rate_hz, got none; add it")

    def signals(self) -> dict[str, Signal]:
        """Signals of the recipe by kind."""
        kinds = {name: getattr(self, name) for name in UNITS if name != "time"}
        return {kind: signal for kind, signal in kinds.items() if signal is not None}

    def reordered(self, places: Sequence[int], joints: tuple[str, ...]) -> "Recipe":
        """The recipe of some joints in another order.

        Args:
            places: of the joints in the present order.
            joints: their names.

        Returns:
            The recipe whose signals and law are in that order.
        """
        parts = {kind: signal.reordered(places) for kind, signal in self.signals().items()}
        law = None if self.law is None else self.law.reordered(places)
        return self.replace(joints=joints, law=law, **parts)

    def of_law(self) -> dict[str, Signal]:
        """Signals of the control law by kind; none without a law."""
        if self.law is None or self.position is None:
            return {}
        return self.law.parts(self.position, self.velocity)

    @property
    def torque_source(self) -> str:
        """Origin of the torque: "measured", "commanded" (a law) or "current" (unit A or mA)."""
        if self.law is not None:
            return COMMANDED
        return CURRENT if self.torque and {"A", "mA"} & {*self.torque.units} else MEASURED

    @property
    def has_unknown_gains(self) -> bool:
        """Whether the torque is a motor current without gain."""
        return self.torque_source == CURRENT and getattr(self.torque, "gain", None) is None

    def replace(self, **changes: object) -> "Recipe":
        """The same recipe with some fields exchanged, e.g. another run."""
        return dataclasses.replace(self, **changes)  # type: ignore[arg-type]
