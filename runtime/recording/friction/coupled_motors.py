"""Friction and rotor inertia of motors that drive several joints at once.

    q_m = R q,   τ = Rᵀ τ_m:   a column c(R̂_m dq) of motor m moves the joints by R̂_mᵀ c(R̂_m dq)

R̂_m is row m of the gear matrix over its largest entry, so that speed, ε and φ are in units of the
joint. The friction of a motor that drives one joint is that of the joint; its R̂_m is 0 and its
columns are zero. Source: Gautier 1997 (coupled wrists), Khalil & Dombre 2002, Sec. 12.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from runtime.errors import RecordingError
from runtime.recording.friction_column import COLUMNS
from runtime.recording.recording import Recording
from runtime.recording.settings import Friction

FloatArray = NDArray[np.float64]


def directions(gear: ArrayLike) -> FloatArray:
    """R̂ (n, n): rows of the gear matrix over their largest entry; 0 for a motor that drives one
    joint.
    """
    R = np.atleast_2d(np.asarray(gear, dtype=np.float64))
    rows = np.zeros_like(R)
    for m, row in enumerate(R):
        if np.count_nonzero(row) > 1:
            rows[m] = row / row[np.argmax(np.abs(row))]
    return rows


@dataclass(frozen=True, slots=True, eq=False)
class Coupling:
    """Friction columns that belong to motors, and the joints that these drive.

    Attributes:
        directions: R̂, (n, n).
        of_motors: (k,) whether each column belongs to motors.
    """

    directions: FloatArray
    of_motors: tuple[bool, ...]

    def to_joints(self, values: FloatArray, column: int) -> FloatArray:
        """Torques of one column on the joints: R̂ᵀ x for a motor's column, else x.

        Args:
            values: (…, n) torques of motors or joints [N·m, N].
            column: its index.

        Returns:
            (…, n) [N·m, N].
        """
        return values @ self.directions if self.of_motors[column] else values

    def to_columns(self, values: FloatArray) -> FloatArray:
        """Adjoint of `to_joints`: torques (N, n) of the joints for each column, (N, n, k)."""
        motors = values @ self.directions.T
        return np.stack([motors if of_motor else values for of_motor in self.of_motors], axis=-1)


def coupling_of(recording: Recording) -> Coupling | None:
    """Coupling of the columns of a recording by their names and R̂; None without motor columns.

    Raises:
        RecordingError: there are motor columns but no directions of motors.
    """
    if recording.columns is None or not has_motors(recording.column_names):
        return None
    if recording.motors is None:
        raise RecordingError(
            f"the recording '{recording.name}' has columns of motors but no gear directions; "
            "prepare it again from the log and its recipe"
        )
    return Coupling(recording.motors, _of_motors(recording.column_names))


def coupling_of_terms(terms: Friction) -> Coupling | None:
    """Coupling of friction terms with a gear matrix; None without motor columns."""
    if not has_motors(terms.columns):
        return None
    return Coupling(directions(terms.gear), _of_motors(terms.columns))


def has_motors(names: tuple[str, ...]) -> bool:
    """Whether some of the columns belong to motors."""
    return any(_of_motors(names))


def _of_motors(names: tuple[str, ...]) -> tuple[bool, ...]:
    return tuple(name in COLUMNS and COLUMNS[name].of_motors for name in names)


def geared(terms: Friction, recording: Recording) -> Friction:
    """The terms with the gear of the recording's recipe, where they have columns of motors.

    Args:
        terms: names and widths.
        recording: the data.

    Returns:
        The terms with R̂ of the recording, or unchanged.

    Raises:
        RecordingError: they have columns of motors, and no motor of the recording is coupled.
    """
    if terms.gear or not has_motors(terms.columns):
        return terms
    gear = recording.recipe.gear if recording.recipe else ()
    rows = directions(gear) if gear else np.zeros((0, 0))
    if recording.motors is not None:
        rows = recording.motors
    if not rows.any():
        raise RecordingError(
            "friction columns of motors expect a [gear] matrix in the recipe with a motor that "
            "drives several joints, but there is none; leave out the columns motor_…"
        )
    return replace(terms, gear=tuple(tuple(map(float, row)) for row in rows))


def spread(columns: FloatArray, coupling: Coupling | None) -> FloatArray:
    """Matrix F with F φ = τ_f: the columns for φ joint by joint, or motor by motor.

    Args:
        columns: (N, n, k).
        coupling: of motors and joints; None without columns of motors.

    Returns:
        (N, n, n k).
    """
    count, n, k = columns.shape
    rows = np.zeros((count, n, n * k))
    for j in range(n):
        rows[:, j, j * k : (j + 1) * k] = columns[:, j]
    if coupling is not None:
        for c in np.flatnonzero(coupling.of_motors):
            # Entry (j, m) is R̂_mj c_m.
            rows[:, :, c::k] = columns[:, None, :, c] * coupling.directions.T
    return rows
