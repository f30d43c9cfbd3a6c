"""A recording: motion and torque of a robot at N instants, and the history of the data.

All quantities are SI, joint side, in the joint order of the model. τ is the torque that the motors
apply, so that it has the sign of the inverse dynamics. `reader` makes recordings of log
files; `preprocessing` prepares them.
"""

import copy
import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from runtime.common.tables import Table
from runtime.errors import IdentificationError, RecordingError
from runtime.library import Array, Library
from runtime.recording.current_gains import CurrentGains
from runtime.recording.notebook import Framed
from runtime.recording.recipes.recipe import COMMANDED, MEASURED, ControlLaw, Recipe
from runtime.recording.settings import JointMotion, Preparation, signals_for

SHORTEST_STEP, LATEST = 1e-12, 1e12  # of a clock [s]; beyond, derivatives overflow


def require_clock(t: Array) -> None:
    """Refuse a clock that stands still, goes back or has another unit: t (N,) [s]."""
    steps = np.diff(t)
    near, far = float(steps.min(initial=np.inf)), float(np.abs(t[[0, -1]]).max())
    if not near > 0.0:  # nor where a step is NaN
        backward = np.flatnonzero(~(steps > 0.0))
        i = int(backward[0])
        raise RecordingError(
            f"expected time that increases, but it goes from {t[i]:.9g} s to {t[i + 1]:.9g} s at "
            f"row {i + 1} (and at {backward.size - 1} more); sort the log or cut it into runs"
        )
    if not (near >= SHORTEST_STEP and far <= LATEST):
        raise RecordingError(
            f"expected time in s, up to {LATEST:g} s in steps from {SHORTEST_STEP:g} s, got "
            f"{far:.3g} s and a step of {near:.3g} s; state the unit of time in a recipe"
        )


SIGNALS = ("q", "dq", "ddq", "tau")
ARRAYS = (*SIGNALS, "columns", "rows")  # names of the arrays with one entry per instant
ALL = (*ARRAYS, "signals")  # names of all fields with one entry per instant


@dataclass(frozen=True, slots=True, eq=False)
class Recording(Framed):
    """Motion and torque of n joints at N instants; the arrays are read-only.

    Attributes:
        t: (N,) s, strictly increasing.
        q: (N, n) rad or m.
        dq: (N, n) rad/s or m/s, None where it was not measured.
        ddq: (N, n) rad/s² or m/s².
        tau: (N, n) N·m or N, the torque that the motor applies.
        signals: name → (N, n) further signals, such as temperatures, for columns that need them.
        start: first instant of the log, also where only later rows are held [s].
        columns: (N, n, k) friction columns that travel (and are filtered) with the data.
        column_names: k names of them.
        rows: (N, m, n_b), rows β = τ̂, where they were made without ddq (`preprocessing.momentum`);
            m = n, or 1 where they give the power of all joints together and τ holds dq τ.
        motors: (n, n) directions of coupled motors, where columns are theirs (`friction.motors`).
        name: what a report calls the recording.
        joint_names: n names, or none.
        history: one sentence per step, from the file on.
        source: file name → sha256 of the bytes that were read.
        recipe: the recipe it was read with; its defaults for preparation, split and friction.
        prepared: how it was prepared, None as read.
        torque_source: "measured", "commanded" by a control law, or "current" of the motors.
        law: control law of a commanded torque.
        gains: estimated gains of motor currents; None where the recipe states them.
    """

    t: Array
    q: Array
    dq: Array | None = None
    ddq: Array | None = None
    tau: Array | None = None
    signals: Mapping[str, Array] = field(default_factory=dict)
    start: float | None = None
    columns: Array | None = None
    column_names: tuple[str, ...] = ()
    rows: Array | None = None
    motors: Array | None = None
    name: str = ""
    joint_names: tuple[str, ...] = ()
    history: tuple[str, ...] = ()
    source: Mapping[str, str] = field(default_factory=dict)
    recipe: Recipe | None = None
    prepared: Preparation | None = None
    torque_source: str = MEASURED
    law: ControlLaw | None = None
    gains: CurrentGains | None = None
    _rate: list[float] = field(default_factory=list, init=False, repr=False)

    def __post_init__(self) -> None:
        self._check_signals()
        require_clock(self.t)
        if self.start is None:
            object.__setattr__(self, "start", float(self.t[0]))

    def _check_signals(self) -> None:
        def put(key: str, value: Any) -> None:
            object.__setattr__(self, key, value)

        put("t", _locked(self.t))
        put("q", _locked(self.q))
        if self.t.ndim != 1 or self.q.ndim != 2 or len(self.t) != len(self.q):
            raise RecordingError(
                f"expected t of shape (N,) and q of shape (N, n), "
                f"got {self.t.shape} and {self.q.shape}; give one row per instant"
            )
        if not self.q.size:
            raise RecordingError("the recording holds no sample; check the file and the steps")
        for key in SIGNALS[1:]:
            if getattr(self, key) is not None:
                put(key, self._of_joints(key, getattr(self, key)))
        if self.signals:
            put("signals", {key: self._of_joints(key, x) for key, x in self.signals.items()})
        if self.columns is not None:
            put("columns", _locked(self.columns))
            expected = (*self.q.shape, len(self.column_names))
            if self.columns.shape != expected:
                raise RecordingError(
                    f"expected columns of shape {expected}, got {self.columns.shape}; "
                    "give one name per column"
                )
        if self.rows is not None:
            put("rows", _locked(self.rows))
            if self.rows.ndim != 3 or self.rows.shape[:2] not in {self.q.shape, (len(self), 1)}:
                raise RecordingError(
                    f"expected rows of shape (N, n, n_b) or (N, 1, n_b), got {self.rows.shape}; "
                    "give one regressor per instant"
                )
        if self.motors is not None:
            put("motors", _locked(self.motors))
            if self.motors.shape != (self.n_joints,) * 2:
                raise RecordingError(
                    f"expected motors of shape {(self.n_joints,) * 2}, got {self.motors.shape}; "
                    "give one row per motor"
                )
        if self.joint_names and len(self.joint_names) != self.n_joints:
            raise RecordingError(
                f"expected {self.n_joints} joint names, got {len(self.joint_names)}; "
                "name every joint or none"
            )

    def _of_joints(self, key: str, values: ArrayLike) -> Array:
        locked = _locked(values)
        if locked.shape != self.q.shape:
            raise RecordingError(
                f"expected {key} of the shape {self.q.shape} of q, got {locked.shape}; give one "
                "row per instant"
            )
        return locked

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        held = " ".join(key for key in SIGNALS if getattr(self, key) is not None)
        rate = f" at {self.rate_hz:.6g} Hz" if len(self) > 1 else ""
        size = f"{len(self)} rows of {self.n_joints} joints, {self.duration:.4g} s{rate}"
        return f"Recording({self.name!r}: {size}; {held})"

    def tables(self) -> tuple[Table, ...]:
        """Range of every signal over all joints."""
        units = {"q": "rad, m", "dq": "rad/s, m/s", "ddq": "rad/s², m/s²", "tau": "N·m, N"}
        rate = f" at {self.rate_hz:.6g} Hz" if len(self) > 1 else ""
        rows = tuple(
            (key, unit, f"{values.min():.4g}", f"{values.max():.4g}")
            for key, unit in units.items()
            if (values := getattr(self, key)) is not None
        )
        title = f"{self.name or 'recording'}: {len(self)} rows of {self.n_joints} joints{rate}"
        return (Table(("signal", "unit", "least", "largest"), rows, title=title),)

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return int(self.q.shape[1])

    @property
    def has_unknown_gains(self) -> bool:
        """Whether τ holds motor currents, because neither the recipe nor an estimate has gains."""
        return self.gains is None and self.recipe is not None and self.recipe.has_unknown_gains

    @property
    def preparation(self) -> Preparation:
        """Preparation of its recipe; an empty one without a recipe."""
        return self.recipe.preparation if self.recipe else Preparation()

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def rate_hz(self) -> float:
        """Inverse of the median time step [Hz]."""
        if len(self) < 2:
            raise RecordingError("expected two samples or more, got one; a rate needs a step")
        if not self._rate:  # kept, also by copies with the same clock
            self._rate.append(float(1.0 / np.median(np.diff(self.t))))
        return self._rate[0]

    def titled(self) -> tuple[list[str], Array]:
        """Titles t, q1 … qn, … of all signals that are present, and their columns (N, m)."""
        titles, blocks = ["t"], [self.t[:, None]]
        motion = {key: getattr(self, key) for key in SIGNALS}
        for key, values in {**motion, **self.signals}.items():
            if values is not None:
                titles += [f"{key}{joint}" for joint in range(1, self.n_joints + 1)]
                blocks.append(values)
        return titles, np.hstack(blocks)

    def columns_of_frame(self) -> dict[str, Array]:
        """Columns t, q1 … qn, … of a data frame, SI units."""
        titles, values = self.titled()
        return dict(zip(titles, values.T, strict=True))

    def replace(self, **changes: Any) -> Self:
        """The same recording with some fields exchanged; a clock that stays was checked."""
        if "t" in changes:
            return dataclasses.replace(self, **changes)
        changed = copy.copy(self)
        for key, value in changes.items():
            object.__setattr__(changed, key, value)
        changed._check_signals()
        return changed

    def required(self, key: str) -> Array:
        """A signal that must be present.

        Args:
            key: "dq", "ddq", "tau", "columns", "rows" or "motors".

        Returns:
            The array of that name.

        Raises:
            RecordingError: the recording does not have it.
        """
        values: Array | None = getattr(self, key)
        if values is None:
            raise RecordingError(
                f"expected {key} in the recording '{self.name}', but there is none; log it, or let "
                "the preparation compute it"
            )
        return values

    def signal(self, key: str) -> Array | None:
        """A further signal (N, n): one of `signals`, else of `DERIVED`; None where it has none."""
        if key in self.signals:
            return self.signals[key]
        return DERIVED[key].function(self) if key in DERIVED else None

    def noted(self, sentence: str) -> Self:
        """The same recording with one more sentence of history."""
        return self.replace(history=(*self.history, sentence))

    def take(self, rows: ArrayLike | slice, sentence: str) -> Self:
        """Rows selected by a slice, a mask or indices.

        Args:
            rows: of the N instants.
            sentence: the reason, for the history.

        Returns:
            The recording with these rows.

        Raises:
            RecordingError: no row is left.
        """
        index = rows if isinstance(rows, slice) else np.asarray(rows)
        t = self.t[index]
        if not t.size:
            raise RecordingError(
                f"no sample is left after this step: {sentence} There were {len(self)} rows in "
                f"{self.duration:.3g} s before it; record for longer, or leave the step out"
            )
        kept = self._mapped(lambda a: a[index], ALL)
        return self.replace(t=t, history=(*self.history, sentence), **kept)

    def mapped(
        self,
        function: Callable[[Array], Array],
        sentence: str,
        only: tuple[str, ...] = ALL,
        t: Array | None = None,
    ) -> Self:
        """Apply a function to every signal that is present, along its first axis.

        A function that changes the number of rows needs the new instants t.

        Args:
            function: (N, …) → (M, …).
            sentence: for the history.
            only: names of the signals.
            t: (M,) new instants [s].

        Returns:
            The changed recording.
        """
        instants = self.t if t is None else t
        changed = self._mapped(function, only)
        return self.replace(t=instants, history=(*self.history, sentence), **changed)

    def _mapped(self, function: Callable[[Array], Array], only: tuple[str, ...]) -> dict[str, Any]:
        present = {key: getattr(self, key) for key in only if key in ARRAYS}
        changed = {key: function(value) for key, value in present.items() if value is not None}
        if "signals" in only and self.signals:
            further = {key: function(value) for key, value in self.signals.items()}
            return changed | {"signals": further}
        return changed


@dataclass(frozen=True, slots=True)
class DerivedSignal:
    """A further signal that follows from a recording."""

    function: Callable[[Recording], Array | None]  # → (N, n); None without the signal
    source: str  # table of the recipe that gives it, for messages


def require_recording(*values: object) -> None:
    """Raise RecordingError for what is no log in memory."""
    for value in values:
        if not isinstance(value, Recording):
            raise RecordingError(
                f"expected a log, as runtime.read_recording gives it, got {value!r:.60}"
            )


def complete_arrays(recording: Recording, *keys: str) -> dict[str, Array]:
    """Dense arrays of q, the friction columns and other signals, all of them there and finite."""
    missing = [key for key in keys if getattr(recording, key) is None]
    if missing:
        raise IdentificationError(
            f"identification needs q, dq, ddq and tau, the recording '{recording.name}' has no "
            f"{', '.join(missing)}; let preprocessing.prepare differentiate it"
        )
    columns = recording.columns
    arrays = {"columns": np.zeros((*recording.q.shape, 0)) if columns is None else columns}
    arrays |= {key: recording.required(key) for key in ("q", *keys)}
    dense = {key: np.ascontiguousarray(each, dtype=float) for key, each in arrays.items()}
    if not all(np.isfinite(each).all() for each in dense.values()):
        raise IdentificationError(
            f"the recording '{recording.name}' holds NaN or infinite values; "
            "drop those rows before identifying"
        )
    return dense


def motion_for(recording: Recording, columns: Iterable[str], lib: Library | None) -> JointMotion:
    """Motion with the further signals that some friction columns need, where it has them."""
    signals = {each: recording.signal(each) for each in signals_for(columns)}
    present = {each: values for each, values in signals.items() if values is not None}
    return JointMotion(recording.required("dq"), recording.q, recording.ddq, lib, signals=present)


DERIVED = {
    "uptime": DerivedSignal(
        lambda r: np.repeat((r.t - (r.start or 0.0))[:, None], r.n_joints, axis=1), "[time]"
    ),
    "commanded_torque": DerivedSignal(
        lambda r: r.tau if r.torque_source == COMMANDED else None, "[torque] with a law"
    ),
}
"""Signals that need no table [extra]: time since the start of the log [s], unless the recipe
gives that since power-on, and the torque of a control law [N·m, N]."""


def _locked(values: ArrayLike) -> Array:
    """A read-only float64 view by rows; a read-only array is taken as it lies, by columns too."""
    flags = values.flags if isinstance(values, np.ndarray) and values.dtype == np.float64 else None
    if flags is not None and not flags.writeable and (flags.c_contiguous or flags.f_contiguous):
        return np.asarray(values)
    view = np.ascontiguousarray(values, dtype=np.float64).view()
    view.setflags(write=False)
    return view
