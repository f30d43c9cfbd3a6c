"""Settings: preparation of a recording, its split, and friction columns with their registry.

τ_f,j = Σ_k C_jk φ_jk        C (N, n, k) columns of the motion, φ (n, k) their coefficients
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import RecordingError
from runtime.library import Array, Library
from runtime.registry import Registry


@dataclass(frozen=True, slots=True, eq=False)
class JointMotion:
    """Motion from which friction columns are computed; every column needs dq."""

    dq: Array  # (N, n) joint velocities [rad/s, m/s]
    q: Array | None = None  # (N, n) successive positions [rad, m]; for dahl, load, position
    ddq: Array | None = None  # (N, n) joint accelerations [rad/s², m/s²]; for rotor
    lib: Library | None = None  # library of the robot; for load and position
    zeta: Array | None = None  # (N, n) known state of friction with a memory; None: by path q
    signals: Mapping[str, Array] = field(default_factory=dict)  # name → (N, n) of the log


@dataclass(frozen=True, slots=True, eq=False)
class FrictionColumn:
    """One friction column and what the rooms of the package need of it."""

    name: str  # as a user writes it
    sentence: str  # its equation
    function: "Callable[[JointMotion, Friction], Array]"  # motion (N, n), widths → (N, n)
    widths: tuple[str, ...] = ()  # names of the widths of `Friction` that it depends on
    # names of the signals of a log that it needs beside the motion: those of [extra] in the recipe,
    # or of `runtime.recording.recording.DERIVED`
    signals: tuple[str, ...] = ()
    is_linear: bool = False  # in q, dq and ddq, so that it may follow linear filters
    is_constant: bool = False  # independent of the motion
    is_passive: bool = True  # takes power from the joint wherever φ ≥ 0
    is_nonnegative: bool = False  # φ of a real joint is ≥ 0, whatever the other columns are
    is_inertial: bool = False  # of the acceleration of joint or motor, not friction
    is_shared: bool = False  # one coefficient for all joints; a torque on each of them
    has_memory: bool = False  # depends on the path, not on the present motion alone
    takes_memory: bool = False  # depends on the path, too, where a column beside it does
    # the torque of the log itself; fits take that of the model instead
    # (`runtime.identification.single_log`)
    is_torque: bool = False
    needs_prior: bool = False  # its scale is that of the inertial prior, which is needed
    prior_sigma: float = inf  # standard deviation of φ about 0 without a log
    of_motors: bool = False  # of motors that drive several joints (`coupled_motors`)
    # term of simulators' joints that it stands for: "damping", "friction" (dry), "armature"; ""
    # where they have none
    model_term: str = ""
    in_closed_loop: bool = False  # the compiled closed loop has it, under this name
    # speed (n,) and ε → column/dq (n,) and constant part (n,), for the Kalman filters; None where
    # they cannot use it
    secant: Callable[[Array, float], tuple[Array, Array]] | None = None
    omitted: str = ""  # validity of a model file without this column; "" for nothing to say
    # joints, φ (n,) and σ (n,), NaN where unknown → sentences for a result
    sentences: Callable[[Sequence[str], Array, Array], tuple[str, ...]] | None = None


SPRING = "spring:"  # prefix of columns of springs: `spring:NAME`, one per spring of the mechanism

JOINT_VISCOUS, JOINT_COULOMB = "joint_viscous:", "joint_coulomb:"
"""Prefixes of friction columns of joints that follow others: `joint_viscous:NAME`."""

_BY_PREFIX = {  # prefix → function of `_ROOM` that makes the record
    SPRING: "spring_column",
    JOINT_VISCOUS: "dependent_joint_column",
    JOINT_COULOMB: "dependent_joint_column",
}

_ROOM = "runtime.recording.friction.columns"
_OF_ROOM = (
    *("viscous", "coulomb", "offset", "asymmetric", "stribeck", "dahl", "load", "dahl_load"),
    *("position", "rotor", "motor_viscous", "motor_coulomb", "motor_rotor"),
)


class ColumnRegistry(Registry[FrictionColumn]):
    """The friction columns by name, those of springs and dependent joints by prefix."""

    def __contains__(self, name: object) -> bool:
        return (
            isinstance(name, str) and name.startswith(tuple(_BY_PREFIX))
        ) or super().__contains__(name)

    def __getitem__(self, name: str) -> FrictionColumn:
        """The record of a name; see `Registry`."""
        for prefix, function in _BY_PREFIX.items():
            if name.startswith(prefix):
                column: FrictionColumn = getattr(import_module(_ROOM), function)(name)
                return column
        return super().__getitem__(name)


COLUMNS = ColumnRegistry(  # all friction columns, in the order of help and messages
    "symgen.friction_columns",
    FrictionColumn,
    "friction column",
    {
        **{name: f"{_ROOM}:{name.upper()}" for name in _OF_ROOM},
        "viscous_temperature": "runtime.recording.friction.warming:VISCOUS_TEMPERATURE",
        "viscous_uptime": "runtime.recording.friction.warming:VISCOUS_UPTIME",
        "law_gain": "runtime.recording.friction.law_gain:LAW_GAIN",
    },
    RecordingError,
)


def names_where(claim: Callable[[FrictionColumn], bool]) -> tuple[str, ...]:
    """Names of the columns for which a claim about the record is true."""
    return tuple(each.name for each in COLUMNS.records() if claim(each))


def has_memory(names: Iterable[str]) -> bool:
    """Whether one of some columns depends on the path."""
    return any(name in COLUMNS and COLUMNS[name].has_memory for name in names)


def widths_of(names: tuple[str, ...]) -> set[str]:
    """Names of the widths on which some columns depend; unknown columns have none."""
    return {width for name in names if name in COLUMNS for width in COLUMNS[name].widths}


def signals_for(names: Iterable[str]) -> tuple[str, ...]:
    """Names of the further signals that some columns need, each once."""
    return tuple(dict.fromkeys(s for name in names for s in COLUMNS[name].signals))


FILTERS = ("butterworth", "average", "savitzky-golay", "none")

DERIVATIVES = ("measured", "position")

REGRESSORS = ("acceleration", "momentum", "energy")

COULOMB_SPEED, STRIBECK_SPEED, DAHL_STROKE = 0.02, 0.1, 2e-3

WIDTHS = {  # width of friction columns → symbol and unit
    "coulomb_speed": ("ε", "rad/s"),
    "stribeck_speed": ("v_s", "rad/s"),
    "dahl_stroke": ("z_c", "rad"),
}

LEAST_SETTING = 1e-9  # smallest setting, 1 / the largest [SI]: no filter, rate, width beyond


@dataclass(frozen=True, slots=True)
class Preparation:
    """Steps of the preparation of a recording; None or "none" skips a step.

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
        rest_speed: drop rows in which every joint is slower; one number, or one per joint
            [rad/s, m/s].
        torque_delay_s: the log stamps τ this much later than q, below 0 earlier; one number, or
            one per joint [s].
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
    rest_speed: float | tuple[float, ...] | None = None
    torque_delay_s: float | tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):
            value = getattr(self, item.name)
            if value is None or isinstance(value, str) or item.name == "torque_delay_s":
                continue
            for each in value if isinstance(value, tuple) else (value,):
                positive(f"[preparation] {item.name}", each)
        delays = self.torque_delay_s
        if delays is not None and not all(map(isfinite, np.atleast_1d(delays))):
            raise RecordingError("[preparation] torque_delay_s expects a number of s; correct it")
        one_of("[preparation] filter", self.filter, FILTERS)
        one_of("[preparation] derivative", self.derivative, DERIVATIVES)
        one_of("[preparation] regressor", self.regressor, REGRESSORS)
        if self.filter == "butterworth" and self.cutoff_hz is None:
            raise RecordingError("the butterworth filter expects cutoff_hz, got none; write it")
        if self.filter in {"average", "savitzky-golay"} and self.window_s is None:
            raise RecordingError(f"the {self.filter} filter expects window_s, got none; write it")

    def at_rate(self, rate_hz: float) -> "Preparation":
        """The same steps for another log; gaps that are shorter than its steps become three."""
        if self.max_gap_s is None or self.max_gap_s * rate_hz > 1.5:  # as `resample` requires
            return self
        return dataclasses.replace(self, max_gap_s=3.0 / rate_hz)


@dataclass(frozen=True, slots=True)
class Split:
    """Parts of the duration as fractions, (from, to) in turn, or (0, 1) for all: `EVERYTHING`."""

    train: tuple[float, float] = (0.0, 0.48)
    validation: tuple[float, float] = (0.48, 0.6)
    test: tuple[float, float] = (0.6, 1.0)

    def __post_init__(self) -> None:
        edges = (*self.train, *self.validation, *self.test)
        pairs = (self.train, self.validation, self.test)
        if self.is_everything:
            return
        empty = any(len(pair) != 2 or pair[0] >= pair[1] for pair in pairs)
        if empty or list(edges) != sorted(edges) or edges[0] < 0.0 or edges[-1] > 1.0:
            raise RecordingError(
                "split expects train, validation and test as [from, to] in this order, not empty, "
                f"not overlapping, within [0, 1], got {[list(pair) for pair in pairs]}; correct it"
            )

    @property
    def is_everything(self) -> bool:
        """Whether all rows train and no part is left for a test."""
        return self.train == self.validation == self.test == (0.0, 1.0)

    def joined(self) -> tuple[float, float]:
        """Training and validation part as one, for methods that nothing is tuned for."""
        return self.train[0], self.validation[1]


EVERYTHING = Split((0.0, 1.0), (0.0, 1.0), (0.0, 1.0))  # all rows train; the test is another log


@dataclass(frozen=True, slots=True)
class Friction:
    """Friction columns to fit, and the widths of those that are not linear in the motion.

    Attributes:
        columns: names, see `runtime.recording.settings.COLUMNS`.
        coulomb_speed: ε, below which the smooth sign of dq gives way [rad/s].
        stribeck_speed: v_s, above which the Stribeck peak is gone [rad/s].
        dahl_stroke: z_c, travel of a reversal within which friction turns round, or each [rad].
        gear: rows of the gear matrix, for columns of motors; the recipe's [gear] fills it in.
    """

    columns: tuple[str, ...] = ("viscous", "coulomb", "offset")
    coulomb_speed: float = COULOMB_SPEED
    stribeck_speed: float = STRIBECK_SPEED
    dahl_stroke: float | tuple[float, ...] = DAHL_STROKE
    gear: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        for key in WIDTHS:
            for each in np.atleast_1d(getattr(self, key)).tolist():
                positive(f"[friction] {key}", each)

    @classmethod
    def from_facts(cls, facts: Mapping[str, Any]) -> "Friction":
        """Terms from the facts in a file; missing widths have their defaults."""
        widths: dict[str, Any] = {key: width_of(facts[key]) for key in WIDTHS if key in facts}
        gear = tuple(tuple(map(float, row)) for row in facts.get("gear", ()))
        return cls(tuple(map(str, facts["columns"])), **widths, gear=gear)

    def facts(self) -> dict[str, Any]:
        """Columns, widths and gear as JSON values."""
        facts = {"columns": list(self.columns)} | {key: getattr(self, key) for key in WIDTHS}
        return facts | ({"gear": [list(row) for row in self.gear]} if self.gear else {})

    def __str__(self) -> str:
        """Columns and the widths that they depend on."""
        needed = widths_of(self.columns)
        widths = [
            f"{symbol} = {np.mean(getattr(self, key)):.3g} {unit}"
            for key, (symbol, unit) in WIDTHS.items()
            if key in needed
        ]
        listed = ", ".join(self.columns) or "none"
        return f"{listed} ({', '.join(widths)})" if widths else listed


def width_of(values: ArrayLike) -> float | tuple[float, ...]:
    """One width where those of all joints are equal, else one per joint."""
    each = np.ravel(np.asarray(values, dtype=float)).tolist()
    return each[0] if len(set(each)) == 1 else tuple(each)


def positive(what: str, value: float) -> None:
    """Require a finite number above 0 whose products with a clock are finite, too."""
    if isinstance(value, bool) or not (isfinite(value) and value > 0):
        raise RecordingError(f"{what} expects a number above 0, got {value}; correct it")
    if not LEAST_SETTING <= value <= 1.0 / LEAST_SETTING:
        raise RecordingError(
            f"{what} expects a number from {LEAST_SETTING:g} to {1.0 / LEAST_SETTING:g}, got "
            f"{value}; correct it"
        )


def one_of(what: str, value: str, valid: tuple[str, ...]) -> None:
    """Require one of several words."""
    if value not in valid:
        choices = ", ".join(each for each in valid if each)
        raise RecordingError(f"{what} expects one of {choices}; got {value!r}")
