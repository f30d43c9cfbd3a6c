"""Friction torque of a motion or recording: C (N, n, k) columns times φ (n, k) coefficients.

    τ_f = Σ_k C[:, :, k] φ[:, k]

Columns of a filtered recording are computed from the unfiltered motion and then filtered with the
rest of the data, because the filtered tanh is not the tanh of the filtered speed. Linear columns
may be computed afterwards (`completed`).

Columns that are rounding are left out.

    C_jk is unresolved where 0 < rms C_jk < SHARE max_i rms C_ik,  or  rms C_jk < LEAST rms τ

Along gravity |τ_g| is 1e-17 N·m instead of zero, and a joint at rest has speeds of 1e-12 rad/s. A
coefficient of such a column would be 1e12 and fit the noise of the torque.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from runtime.errors import RecordingError
from runtime.library import Array, Library, Mask
from runtime.recording.friction.coupled_motors import Coupling, directions, geared, shape_of
from runtime.recording.recording import DERIVED, Recording, motion_for
from runtime.recording.settings import COLUMNS, Friction, JointMotion

DRIVE = ("viscous", "coulomb", "offset", "rotor")  # names of the columns of one drive
DAY, LARGE_DAY = 0.05, 0.07
"""Relative change of the friction of a healthy arm between days, in the mean and at most: 3 to 7 %
on a UR5."""


def columns(motion: JointMotion, *terms: Friction) -> Array:
    """Friction columns C of a motion, those of several terms side by side, (N, n, k)."""
    _require_known(terms)
    _require_signals(motion, terms)
    parts = [COLUMNS[name].function(motion, each) for each in terms for name in each.columns]
    if not parts:
        return np.zeros((*motion.dq.shape, 0))
    return np.stack(parts, axis=-1)


def _require_known(terms: tuple[Friction, ...]) -> None:
    for each in terms:
        if len({COLUMNS[name].name for name in each.columns}) < len(each.columns):
            raise RecordingError(
                f"the friction columns {', '.join(each.columns)} name one twice, so that their "
                "coefficients are not determined; name each once"
            )


def _require_signals(motion: JointMotion, terms: tuple[Friction, ...]) -> None:
    for name in (name for each in terms for name in each.columns):
        for signal in COLUMNS[name].signals:
            if signal not in motion.signals:
                where = DERIVED[signal].source if signal in DERIVED else f"[extra.{signal}]"
                raise RecordingError(
                    f"the friction column '{name}' needs the signal '{signal}' beside the motion, "
                    f"but there is none; give a log whose recipe has {where}, or leave the column "
                    "out"
                )


def torque(columns: Array, phi: Array, coupling: Coupling | None = None) -> Array:
    """Friction torque τ_f = Σ_k C[:, :, k] φ[:, k], (N, n) [N·m, N]; of coupled motors R̂ᵀ C φ."""
    columns, phi = np.asarray(columns), np.asarray(phi)
    shape = shape_of(columns, coupling)
    if shape != phi.shape:
        raise RecordingError(f"expected φ of shape {shape} (joints, columns), got {phi.shape}")
    if coupling is not None and coupling.has_one_row:
        return np.asarray(columns @ phi[0])
    total = np.zeros(columns.shape[:-1])
    for k in range(phi.shape[1]):  # ten times faster than einsum over the short axis
        if coupling is None:
            total += columns[..., k] * phi[:, k]
        else:
            total += coupling.torque(columns[..., k], phi[:, k], k)
    return total


def add_columns(
    recording: Recording, *terms: Friction, lib: Library | None = None, linear_later: bool = False
) -> Recording:
    """The recording with its friction columns (N, n, k), without the linear ones if requested."""
    if recording.dq is None:
        raise RecordingError("friction columns expect dq, but there is none; differentiate first")
    _require_known(terms)
    motion = motion_for(recording, (name for each in terms for name in each.columns), lib)
    terms = tuple(geared(each, recording, lib) for each in terms)
    now = tuple(
        replace(
            each,
            columns=tuple(
                name for name in each.columns if not (linear_later and COLUMNS[name].is_linear)
            ),
        )
        for each in terms
    )
    names = tuple(name for each in now for name in each.columns)
    gear = next((each.gear for each in terms if each.gear), None)
    listed = "; ".join(str(each) for each in terms)
    motors = None if gear is None else directions(gear)
    values = columns(motion, *now) if names or not linear_later else None
    if values is not None:
        values.setflags(write=False)  # the recording holds it as it lies
    changed = recording.replace(columns=values, column_names=names, motors=motors)
    return changed.noted(f"Added the friction columns {listed}.")


def completed(recording: Recording, *terms: Friction) -> Recording:
    """The recording with the linear columns that `add_columns` left out, of its present motion."""
    names = tuple(name for each in terms for name in each.columns)
    motion = motion_for(recording, names, None)
    terms = tuple(geared(each, recording) for each in terms)
    _require_signals(motion, terms)
    others = iter(() if recording.columns is None else np.moveaxis(recording.columns, -1, 0))
    parts = [
        COLUMNS[name].function(motion, each) if COLUMNS[name].is_linear else next(others)
        for each in terms
        for name in each.columns
    ]
    return recording.replace(columns=np.stack(parts, axis=-1), column_names=names)


def renewed_rotor(recording: Recording) -> Recording:
    """The recording with rotor columns from the filtered ddq, which passed the same steps."""
    if recording.columns is None or recording.ddq is None:
        return recording
    inertial = [name in COLUMNS and COLUMNS[name].is_inertial for name in recording.column_names]
    if not any(inertial):
        return recording
    values = recording.columns.copy()
    for k in np.flatnonzero(inertial):
        name = recording.column_names[k]
        if not COLUMNS[name].of_motors:
            values[..., k] = recording.ddq
        elif recording.motors is not None:
            values[..., k] = recording.ddq @ recording.motors.T
    return recording.replace(columns=values)


SHARE = 2.0**-16  # size over that of the same column of another joint: the resolution of 16 bits

LEAST = 1e-9
"""Size in SI units relative to the torque [N·m, N]: an effect below rounding in single precision
even for a coefficient of ten."""


def unresolved(columns: Array, tau: Array) -> Mask:
    """Flags (n, k) of columns whose values are rounding beside τ or power; not of zero columns."""
    if not columns.size:
        return np.zeros(columns.shape[1:], dtype=bool)
    flat = columns.reshape(len(columns), -1)
    square = np.einsum("ij,ij->j", flat, flat).reshape(columns.shape[1:])  # in one pass
    size = np.sqrt(square / len(columns))
    torque = float(np.sqrt(np.mean(np.square(tau))))
    least = np.maximum(SHARE * size.max(axis=0), LEAST * torque)
    return np.asarray((size > 0) & (size < least))


def without_columns(recording: Recording, left_out: Mask) -> Recording:
    """The recording with the friction columns of flags (n, k) set to zero."""
    if recording.columns is None or not left_out.any():
        return recording
    return recording.replace(columns=np.where(left_out, 0.0, recording.columns))


def left_out_note(left_out: Mask, joints: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """Sentence that names the columns left out, by flags (n, k); none where there are none."""
    parts = [
        f"{name} of {', '.join(np.array(joints)[left_out[:, k]])}"
        for k, name in enumerate(names)
        if left_out[:, k].any()
    ]
    if not parts:
        return ()
    return (
        f"left out the friction columns {'; '.join(parts)}: their values are rounding, below "
        f"{SHARE:.1e} of the same column of another joint or {LEAST:g} of the torque",
    )
