"""A recipe: how the raw files of one logger become a recording, and the defaults for its use.

A signal of the file passes, in this order: unit (and gain) → order → sign → gear → offset.

    x[:, i]  = sign_i · gain_i · unit_i · raw[:, order_i]
    q = R⁻¹ x + offset,   dq = R⁻¹ x,   ddq = R⁻¹ x,   τ = Rᵀ x      (R = 1 without [gear])

Nothing of this is ever guessed: a recipe states it. `recipe_file` reads recipes from TOML.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite, pi
from typing import Any

from runtime.errors import RecordingError

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "position": {"rad": 1.0, "deg": pi / 180, "m": 1.0, "mm": 1e-3},
    "velocity": {"rad/s": 1.0, "deg/s": pi / 180, "rpm": pi / 30, "m/s": 1.0, "mm/s": 1e-3},
    "acceleration": {"rad/s^2": 1.0, "deg/s^2": pi / 180, "m/s^2": 1.0, "mm/s^2": 1e-3},
    "torque": {"N*m": 1.0, "mN*m": 1e-3, "N": 1.0, "A": 1.0, "mA": 1e-3},
}
LAYOUTS = ("csv", "flat", "npz", "parquet", "bag")
FILTERS = ("butterworth", "average", "savitzky-golay", "none")
DERIVATIVES = ("measured", "position")
REGRESSORS = ("acceleration", "momentum", "energy")
COULOMB_SPEED, STRIBECK_SPEED, DAHL_STROKE = 0.02, 0.1, 2e-3
_WIDTHS = ("coulomb_speed", "stribeck_speed", "dahl_stroke")
_SIGNED = {"coulomb", "motor_coulomb", "asymmetric", "stribeck", "load"}


@dataclass(frozen=True, slots=True)
class Source:
    """Where the public files come from: one address per file, pinned by commit and sha256.

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
            _positive("[time] rate_hz", self.rate_hz)
            if self.unit or self.file or self.column != "":
                raise RecordingError(
                    "[time] expects either rate_hz or a column with a unit, but got both; "
                    "keep the one that is true"
                )
            return
        _one_of("[time] unit", self.unit, tuple(UNITS["time"]))
        _one_of("layout", self.layout, ("", *LAYOUTS))


@dataclass(frozen=True, slots=True)
class Signal:
    """One measured quantity of all joints: where it lies in the files, and what it means there.

    `columns` are names or indices (csv, parquet), `width` the numbers per sample (flat), `key` the
    array (npz), the column of lists (parquet) or the field of JointState (bag). `offset` is in the
    unit of the file and is added after the gear.
    """

    unit: str | tuple[str, ...]
    file: str = ""
    layout: str = ""
    key: str = ""
    columns: tuple[str | int, ...] = ()
    width: int = 0
    order: tuple[int, ...] = ()
    sign: float | tuple[float, ...] = 1.0
    gain: float | tuple[float, ...] | None = None
    offset: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        _one_of("layout", self.layout, ("", *LAYOUTS))
        if self.order and sorted(self.order) != list(range(len(self.order))):
            raise RecordingError(
                f"order expects a permutation of 0 … {len(self.order) - 1}, got "
                f"{list(self.order)}; name every joint once"
            )
        if any(abs(s) != 1.0 for s in _as_tuple(self.sign)):
            raise RecordingError(f"sign expects 1 or -1, got {self.sign}; use gain to scale")
        if self.layout == "flat" and self.width < 1:
            raise RecordingError(
                f"the flat layout expects width ≥ 1, got {self.width}; "
                "write how many numbers make one sample"
            )

    def check_unit(self, kind: str) -> None:
        """Raises if the unit is none of `kind`, or if amperes come without a gain."""
        units = (self.unit,) if isinstance(self.unit, str) else self.unit
        for unit in units:
            _one_of(f"[{kind}] unit", unit, tuple(UNITS[kind]))
        if {"A", "mA"} & set(units) and self.gain is None:
            raise RecordingError(
                "[torque] in ampere expects a gain in N·m/A, got none; write gain = [...]"
            )


@dataclass(frozen=True, slots=True)
class Preparation:
    """What is done to a recording before it is identified; None or "none" skips a step.

    Attributes:
        clock_tick: rebuild the clock in integer ticks of this length [s].
        max_gap_s: bring onto a uniform grid, interpolating gaps up to this length [s].
        grid_hz: rate of that grid; by default one over the tick, or the median rate [Hz].
        filter: "butterworth", "average", "savitzky-golay" or "none".
        cutoff_hz: cut-off of the Butterworth filter [Hz].
        order: its order, or the degree of the Savitzky–Golay polynomial.
        window_s: window of the average or of Savitzky–Golay [s].
        derivative: "measured" fills in only what is missing, "position" derives dq from q.
        regressor: "acceleration" evaluates τ = Y β at every instant, "momentum" low-passes
            τ = dp/dt − r and "energy" dq·τ = d(T + U)/dt instead, which need no ddq.
        motion_hz: cut-off of q and dq before they enter momentum or energy [Hz].
        trim_s: cut from both ends of every segment [s].
        rate_hz: decimate to this rate [Hz].
        rest_speed: drop rows in which every joint is slower [rad/s].
        torque_delay_s: the log stamps τ this much later than q; below 0 earlier [s].
    """

    clock_tick: float | None = None
    max_gap_s: float | None = None
    grid_hz: float | None = None
    filter: str = "none"
    cutoff_hz: float | None = None
    order: int = 4
    window_s: float | None = None
    derivative: str = "measured"
    regressor: str = "acceleration"
    motion_hz: float | None = None
    trim_s: float | None = None
    rate_hz: float | None = None
    rest_speed: float | None = None
    torque_delay_s: float | None = None

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):
            value = getattr(self, item.name)
            if value is not None and not isinstance(value, str) and item.name != "torque_delay_s":
                _positive(f"[preparation] {item.name}", value)
        if self.torque_delay_s is not None and not isfinite(self.torque_delay_s):
            raise RecordingError("[preparation] torque_delay_s expects a number of s; correct it")
        _one_of("[preparation] filter", self.filter, FILTERS)
        _one_of("[preparation] derivative", self.derivative, DERIVATIVES)
        _one_of("[preparation] regressor", self.regressor, REGRESSORS)
        if self.filter == "butterworth" and self.cutoff_hz is None:
            raise RecordingError("the butterworth filter expects cutoff_hz, got none; write it")
        if self.filter in {"average", "savitzky-golay"} and self.window_s is None:
            raise RecordingError(f"the {self.filter} filter expects window_s, got none; write it")


@dataclass(frozen=True, slots=True)
class Split:
    """Which part of the duration is for what: (from, to) as fractions, one after the other."""

    train: tuple[float, float] = (0.0, 0.48)
    validation: tuple[float, float] = (0.48, 0.6)
    test: tuple[float, float] = (0.6, 1.0)

    def __post_init__(self) -> None:
        edges = (*self.train, *self.validation, *self.test)
        pairs = (self.train, self.validation, self.test)
        if (
            any(len(pair) != 2 or pair[0] >= pair[1] for pair in pairs)
            or list(edges) != sorted(edges)
            or edges[0] < 0.0
            or edges[-1] > 1.0
        ):
            raise RecordingError(
                "split expects train, validation and test as [from, to] in this order, not empty, "
                f"not overlapping, within [0, 1], got {[list(pair) for pair in pairs]}; correct it"
            )


@dataclass(frozen=True, slots=True)
class Friction:
    """The friction columns to fit, and the widths of those that are not linear in the motion.

    Attributes:
        columns: names, see `runtime.friction.columns`.
        coulomb_speed: ε, below which the smooth sign of dq gives way [rad/s].
        stribeck_speed: v_s, above which the Stribeck peak is gone [rad/s].
        dahl_stroke: z_c, travel after a reversal within which friction turns round [rad].
        gear: rows of the gear matrix, for columns of motors; the recipe's [gear] fills it in.
    """

    columns: tuple[str, ...] = ("viscous", "coulomb", "offset")
    coulomb_speed: float = COULOMB_SPEED
    stribeck_speed: float = STRIBECK_SPEED
    dahl_stroke: float = DAHL_STROKE
    gear: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        for key in _WIDTHS:
            _positive(f"[friction] {key}", getattr(self, key))

    @classmethod
    def from_facts(cls, facts: Mapping[str, Any]) -> "Friction":
        """What `facts` said, in a file; widths that it does not name are the usual ones."""
        widths = {key: float(facts[key]) for key in _WIDTHS if key in facts}
        gear = tuple(tuple(map(float, row)) for row in facts.get("gear", ()))
        return cls(tuple(map(str, facts["columns"])), **widths, gear=gear)

    def facts(self) -> dict[str, Any]:
        """JSON-ready."""
        told = {"columns": list(self.columns)} | {key: getattr(self, key) for key in _WIDTHS}
        return told | ({"gear": [list(row) for row in self.gear]} if self.gear else {})

    def __str__(self) -> str:
        """The columns, and the widths that these have."""
        names = set(self.columns)
        widths = [f"ε = {self.coulomb_speed:.3g} rad/s"] if names & _SIGNED else []
        widths += [f"v_s = {self.stribeck_speed:.3g} rad/s"] if "stribeck" in names else []
        widths += [f"z_c = {self.dahl_stroke:.3g} rad"] if "dahl" in names else []
        told = ", ".join(self.columns) or "none"
        return f"{told} ({', '.join(widths)})" if widths else told


@dataclass(frozen=True, slots=True)
class Recipe:
    """How to read the logs of one robot, and defaults for what follows.

    Without `position` the files follow the default convention of `read_recording`, and only the
    defaults (and a rate) are taken from here. `{run}` in a file name is filled with `run`. In a
    bag, `topic` is that of the joint states, and `joints` picks and orders them by name.
    """

    name: str = ""
    description: str = ""
    robot: str = ""
    run: str = ""
    topic: str = ""
    joints: tuple[str, ...] = ()
    source: Source = field(default_factory=Source)
    time: Time | None = None
    position: Signal | None = None
    velocity: Signal | None = None
    acceleration: Signal | None = None
    torque: Signal | None = None
    gear: tuple[tuple[float, ...], ...] = ()
    preparation: Preparation = field(default_factory=Preparation)
    split: Split | None = None
    friction: Friction | None = None

    def __post_init__(self) -> None:
        for kind, signal in self.signals().items():
            signal.check_unit(kind)
        if self.position is None and self.signals():
            raise RecordingError(
                f"a recipe with [{next(iter(self.signals()))}] expects [position] too, got none; "
                "describe every signal, or none for the default convention"
            )
        if self.position is not None and self.time is None:
            raise RecordingError("expected a table [time] with a unit or rate_hz, got none; add it")

    def signals(self) -> dict[str, Signal]:
        """The signals that the recipe describes, by kind."""
        kinds = {name: getattr(self, name) for name in UNITS if name != "time"}
        return {kind: signal for kind, signal in kinds.items() if signal is not None}

    def replace(self, **changes: object) -> "Recipe":
        """The same recipe with some fields exchanged, e.g. another run."""
        return dataclasses.replace(self, **changes)  # type: ignore[arg-type]


def _as_tuple(value: float | tuple[float, ...]) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)


def _positive(what: str, value: float) -> None:
    if isinstance(value, bool) or not (isfinite(value) and value > 0):
        raise RecordingError(f"{what} expects a number above 0, got {value}; correct it")


def _one_of(what: str, value: str, valid: tuple[str, ...]) -> None:
    if value not in valid:
        choices = ", ".join(each for each in valid if each)
        raise RecordingError(f"{what} expects one of {choices}; got {value!r}")
