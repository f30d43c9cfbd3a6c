"""Joint friction, linear in its parameters: columns of the motion times coefficients.

    τ_f,j = Σ_k C_jk φ_jk     s = tanh(dq / ε) stands for the sign of dq and is smooth at rest

    offset 1 · viscous dq · coulomb s · asymmetric dq s · stribeck s exp(−(dq / v_s)²)
    load |τ_g| s · rotor ddq · dahl ζ, the Dahl state of the path: dζ = (dq − |dq| ζ) dt / z_c
    motor_viscous · motor_coulomb · motor_rotor: of motors that drive several joints (`motors`)

Offset and coulomb together differ between the directions already; asymmetric lets the viscous part
do so too. ζ ∈ [−1, 1] is the bent state of the contact, z_c the stroke within which it gives way.
Columns of a filtered recording are computed from the unfiltered motion and then filtered with the
rest of the data, because the filtered tanh is not the tanh of the filtered speed.
Source: Armstrong-Hélouvry 1994 (Stribeck), Dahl 1976, Hamon, Gautier & Garrec 2010 (load).
"""

from collections.abc import Callable, Set
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.library import Library
from runtime.recording.friction.coupled_motors import PREFIX, Coupling, directions, geared
from runtime.recording.recording import Recording
from runtime.recording.settings import Friction

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Motion:
    """What columns are made of, each (N, n); only "dq" is needed by all of them.

    Attributes:
        dq: rad/s.
        q: rad, of successive instants; for dahl.
        ddq: rad/s²; for rotor.
        lib: of the robot; for load.
    """

    dq: FloatArray
    q: FloatArray | None = None
    ddq: FloatArray | None = None
    lib: Library | None = None


def _sign(motion: Motion, terms: Friction) -> FloatArray:
    speed = motion.dq / terms.coulomb_speed
    return np.tanh(speed, out=speed)


def _stribeck(motion: Motion, terms: Friction) -> FloatArray:
    return _sign(motion, terms) * np.exp(-((motion.dq / terms.stribeck_speed) ** 2))


def _load(motion: Motion, terms: Friction) -> FloatArray:
    if motion.q is None or motion.lib is None:
        raise RecordingError("the friction column 'load' needs q and the library of the robot")
    return gravity_load(motion.lib, motion.q) * _sign(motion, terms)


def _rotor(motion: Motion, _: Friction) -> FloatArray:
    if motion.ddq is None:
        return np.zeros_like(motion.dq)  # `renewed_rotor` follows once ddq is there
    return motion.ddq


def _of_motors(name: str) -> Callable[[Motion, Friction], FloatArray]:
    """A column of coupled motors: that of joints, at the speed of the motors."""

    def column(motion: Motion, terms: Friction) -> FloatArray:
        n = motion.dq.shape[-1]
        if len(terms.gear) != n:
            raise RecordingError(
                f"the column '{PREFIX}{name}' needs the gear matrix of {n} motors, got "
                f"{len(terms.gear)} rows; write [gear] into the recipe"
            )
        return COLUMNS[name](Motion(motion.dq @ directions(terms.gear).T), terms)

    return column


def _motor_rotor(motion: Motion, terms: Friction) -> FloatArray:
    speed = _of_motors("viscous")(motion, terms)
    if motion.ddq is None:
        return np.zeros_like(speed)
    rows = directions(terms.gear)
    return np.asarray(motion.ddq @ rows.T)


def _dahl(motion: Motion, terms: Friction) -> FloatArray:
    """ζ after each step: exact for steps of one direction, ζ ← s + (ζ − s) exp(−|Δq| / z_c)."""
    if motion.q is None or len(motion.q) < 2:
        raise RecordingError(
            "the friction column 'dahl' remembers the path; give the motion of a whole recording"
        )
    step = np.diff(motion.q, axis=0)
    stay, drive = np.exp(-np.abs(step) / terms.dahl_stroke), np.sign(step)
    zeta = np.zeros_like(motion.q)
    for i in range(len(step)):
        zeta[i + 1] = drive[i] + (zeta[i] - drive[i]) * stay[i]
    return zeta


COLUMNS: dict[str, Callable[[Motion, Friction], FloatArray]] = {
    "viscous": lambda motion, _: motion.dq,
    "coulomb": _sign,
    "offset": lambda motion, _: np.ones_like(motion.dq),
    "asymmetric": lambda motion, terms: motion.dq * _sign(motion, terms),
    "stribeck": _stribeck,
    "dahl": _dahl,
    "load": _load,
    "rotor": _rotor,
    "motor_viscous": _of_motors("viscous"),
    "motor_coulomb": _of_motors("coulomb"),
    "motor_rotor": _motor_rotor,
}


LINEAR = frozenset({"viscous", "offset", "rotor", "motor_viscous", "motor_rotor"})
"""Columns that need no filter: after linear steps they are still what the motion makes of them."""


def columns(motion: Motion, *terms: Friction) -> FloatArray:
    """C (N, n, k), one column per name, those of several terms side by side.

    Raises:
        RecordingError: an unknown name, one that terms repeat, or a motion that lacks what a
            column needs.
    """
    _require_known(terms)
    found = [COLUMNS[name](motion, each) for each in terms for name in each.columns]
    if not found:
        return np.zeros((*motion.dq.shape, 0))
    return np.stack(found, axis=-1)


def _require_known(terms: tuple[Friction, ...]) -> None:
    for each in terms:
        for name in each.columns:
            if name not in COLUMNS:
                raise RecordingError(
                    f"there is no friction column {name!r}; choose from {', '.join(COLUMNS)}"
                )
        if len(set(each.columns)) < len(each.columns):
            raise RecordingError(
                f"the friction columns {', '.join(each.columns)} name one twice, so that their "
                "coefficients cannot be told apart; name each once"
            )


def torque(columns: FloatArray, phi: FloatArray, coupling: Coupling | None = None) -> FloatArray:
    """τ_f (N, n) [N·m] = Σ_k C[:, :, k] φ[:, k], with φ (n, k) in N·m per unit of the column.

    With a coupling, row m of a motor's column is what motor m does to all its joints: Rᵀ C φ.

    Raises:
        RecordingError: φ does not have one row per joint and one entry per column.
    """
    columns, phi = np.asarray(columns), np.asarray(phi)
    if columns.shape[-2:] != phi.shape:
        raise RecordingError(
            f"expected φ of shape {columns.shape[-2:]} (joints, columns), got {phi.shape}"
        )
    total = np.zeros(columns.shape[:-1])
    for k in range(phi.shape[1]):  # ten times faster than einsum over the short axis
        share = columns[..., k] * phi[:, k]
        total += share if coupling is None else coupling.to_joints(share, k)
    return total


def add_columns(
    recording: Recording,
    *terms: Friction,
    lib: Library | None = None,
    later: Set[str] = frozenset(),
) -> Recording:
    """The recording with the friction columns of its motion.

    Args:
        recording: with dq.
        terms: names and widths.
        lib: of the robot, for the columns that need it.
        later: names of `LINEAR` that are left out, for `completed` to make.

    Raises:
        RecordingError: the recording has no dq, or a column cannot be had from it.
    """
    if recording.dq is None:
        raise RecordingError("friction columns expect dq, but there is none; differentiate first")
    motion = Motion(recording.dq, recording.q, recording.ddq, lib)
    terms = tuple(geared(each, recording) for each in terms)
    _require_known(terms)
    now = tuple(
        replace(each, columns=tuple(name for name in each.columns if name not in later))
        for each in terms
    )
    names = tuple(name for each in now for name in each.columns)
    gear = next((each.gear for each in terms if each.gear), None)
    told = "; ".join(str(each) for each in terms)
    motors = None if gear is None else directions(gear)
    values = columns(motion, *now) if names or not later else None
    return recording.replace(columns=values, column_names=names, motors=motors).noted(
        f"Added the friction columns {told}."
    )


def completed(recording: Recording, *terms: Friction) -> Recording:
    """With the columns of `LINEAR` that `add_columns` left out, of the motion as it is now."""
    assert recording.dq is not None  # noqa: S101  they were made of it
    motion = Motion(recording.dq, recording.q, recording.ddq)
    terms = tuple(geared(each, recording) for each in terms)
    others = iter(() if recording.columns is None else np.moveaxis(recording.columns, -1, 0))
    found = [
        COLUMNS[name](motion, each) if name in LINEAR else next(others)
        for each in terms
        for name in each.columns
    ]
    names = tuple(name for each in terms for name in each.columns)
    return recording.replace(columns=np.stack(found, axis=-1), column_names=names)


def renewed_rotor(recording: Recording) -> Recording:
    """Rotor columns made from the ddq of the rows: the same linear steps have made both."""
    names = recording.column_names
    rotors = {"rotor", "motor_rotor"} & set(names)
    if not rotors or recording.ddq is None:
        return recording
    assert recording.columns is not None  # noqa: S101  it has names
    values = recording.columns.copy()
    if "rotor" in rotors:
        values[..., names.index("rotor")] = recording.ddq
    if "motor_rotor" in rotors and recording.motors is not None:
        values[..., names.index("motor_rotor")] = recording.ddq @ recording.motors.T
    return recording.replace(columns=values)


def gravity_load(lib: Library, q: FloatArray) -> FloatArray:
    """|τ_g(q)| (N, n) by the URDF, N·m or N."""
    still = np.zeros_like(q)
    return np.abs(lib.inverse_dynamics(q, still, still, lib.pi0))
