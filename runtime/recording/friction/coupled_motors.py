"""Friction and rotor inertia of motors that drive several joints at once.

    q_m = R q,   τ = Rᵀ τ_m:   a column c(R̂_m dq) of motor m moves the joints by R̂_mᵀ c(R̂_m dq)

R̂_m is row m of the gear matrix over its largest entry, so that speed, ε and φ are in units of the
joint. The friction of a motor that drives one joint is that of the joint; its R̂_m is 0 and its
columns are zero. Source: Gautier 1997 (coupled wrists), Khalil & Dombre 2002, Sec. 12.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import RecordingError
from runtime.library import Array, Library
from runtime.recording.recording import Recording
from runtime.recording.settings import COLUMNS, Friction


def directions(gear: ArrayLike) -> Array:
    """R̂ (n, n): rows of the gear matrix over their largest entry; 0 for a motor of one joint."""
    R = np.atleast_2d(np.asarray(gear, dtype=np.float64))
    rows = np.zeros_like(R)
    for m, row in enumerate(R):
        if np.count_nonzero(row) > 1:
            rows[m] = row / row[np.argmax(np.abs(row))]
    return rows


@dataclass(frozen=True, slots=True, eq=False)
class Coupling:
    """Friction columns that belong to motors, and the joints that these drive."""

    directions: Array  # R̂, (n, n)
    of_motors: tuple[bool, ...]  # (k,) whether each column belongs to motors
    shared: tuple[bool, ...]  # (k,) whether φ's first row is one coefficient for all joints
    has_one_row: bool = False  # whether all are shared and φ is (1, k): rows that mix joints

    def torque(self, values: Array, phi: Array, column: int) -> Array:
        """Torques (…, n) of one column c: R̂ᵀ c φ of motors, c φ_1 of a spring, else c φ."""
        if self.shared[column]:
            return np.asarray(values * phi[0])
        torques = values * phi
        return torques @ self.directions if self.of_motors[column] else np.asarray(torques)

    def sizes(self, rms: Array) -> Array:
        """RMS by coefficient from RMS by joint and column, (n, k): a shared column has one."""
        if self.has_one_row:
            return np.asarray(np.linalg.norm(rms, axis=0, keepdims=True))
        sizes = rms.copy()
        for c in np.flatnonzero(self.shared):
            sizes[:, c] = 0.0
            sizes[0, c] = np.linalg.norm(rms[:, c])
        return sizes

    def slope(self, columns: Array, weighted: Array) -> Array:
        """Adjoint of `torque`: Σ_N ∂(τ · weighted)/∂φ, (n, k), of columns (N, n, k)."""
        motors = weighted @ self.directions.T
        slope = np.zeros(shape_of(columns, self))
        for c, of_motor in enumerate(self.of_motors):
            each = np.einsum("ij,ij->j", columns[..., c], motors if of_motor else weighted)
            if self.shared[c]:
                slope[0, c] = each.sum()
            else:
                slope[:, c] = each
        return slope


def shape_of(columns: Array, coupling: Coupling | None) -> tuple[int, int]:
    """Shape of φ for columns (…, n, k): (n, k), or (1, k) where rows mix joints."""
    one = coupling is not None and coupling.has_one_row
    return 1 if one else columns.shape[-2], columns.shape[-1]


def coupling_of(recording: Recording) -> Coupling | None:
    """Coupling of the columns of a recording by their names and R̂; None without motor columns."""
    if recording.columns is None:
        return None
    if recording.motors is None and has_motors(recording.column_names):
        raise RecordingError(
            f"the recording '{recording.name}' has columns of motors but no gear directions; "
            "prepare it again from the log and its recipe"
        )
    rows = np.zeros((recording.n_joints,) * 2) if recording.motors is None else recording.motors
    return _coupling(recording.column_names, rows)


def coupling_of_terms(terms: Friction) -> Coupling | None:
    """Coupling of friction terms; None without columns of motors and springs."""
    return _coupling(terms.columns, directions(terms.gear) if terms.gear else np.zeros((1, 1)))


def _coupling(names: tuple[str, ...], rows: Array) -> Coupling | None:
    shared = tuple(name in COLUMNS and COLUMNS[name].is_shared for name in names)
    of_motors = tuple(name in COLUMNS and COLUMNS[name].of_motors for name in names)
    return Coupling(rows, of_motors, shared) if any(shared + of_motors) else None


def has_motors(names: tuple[str, ...]) -> bool:
    """Whether some of the columns belong to motors."""
    return any(name in COLUMNS and COLUMNS[name].of_motors for name in names)


def geared(terms: Friction, recording: Recording, lib: Library | None = None) -> Friction:
    """The terms with R̂ of the gear, and with coupled coordinates in place of uncoupled motors."""
    if terms.gear or not has_motors(terms.columns):
        return terms
    gear = recording.recipe.gear if recording.recipe else ()
    rows = directions(gear) if gear else np.zeros((recording.n_joints,) * 2)
    if recording.motors is not None:
        rows = recording.motors
    elif lib is not None:
        coordinates = iter(lib.manifest.friction_coordinates.values())
        for row, free in zip(rows, np.atleast_1d(~rows.any(axis=1)), strict=True):
            if free:
                row[:] = next(coordinates, 0.0)
    if not rows.any():
        raise RecordingError(
            "friction columns of motors expect a [gear] matrix in the recipe with a motor that "
            "drives several joints, or a robot with coupled joints, but there is none; leave out "
            "the columns motor_…"
        )
    return replace(terms, gear=tuple(tuple(map(float, row)) for row in rows))


def spread(columns: Array, coupling: Coupling | None) -> Array:
    """Matrix F with F φ = τ_f: the columns for φ joint by joint, or motor by motor.

    columns (N, n, k) → (N, n, n k); (N, n, k) where φ has one row.
    """
    if coupling is not None and coupling.has_one_row:
        return columns
    count, n, k = columns.shape
    rows = np.zeros((count, n, n * k))
    for j in range(n):
        rows[:, j, j * k : (j + 1) * k] = columns[:, j]
    if coupling is not None:
        for c in np.flatnonzero(coupling.shared):
            rows[:, :, c::k] = 0.0
            rows[:, :, c] = columns[:, :, c]
        for c in np.flatnonzero(coupling.of_motors):
            # Entry (j, m) is R̂_mj c_m.
            rows[:, :, c::k] = columns[:, None, :, c] * coupling.directions.T
    return rows
