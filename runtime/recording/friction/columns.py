"""Friction columns of this package: functions of the joint motion, and their records.

    s = tanh(dq / ε) stands for the sign of dq and is smooth at rest

    offset 1 · viscous dq · coulomb s · asymmetric dq s · stribeck s exp(−(dq / v_s)²)
    load |τ_g| s · position x s, x ∈ [−1, 1] between the limits, x ζ beside dahl · rotor ddq
    dahl ζ, the Dahl state of the path: dζ = (dq − |dq| ζ) dt / z_c
    motor_viscous · motor_coulomb · motor_rotor: of motors that drive several joints

Offset and coulomb together already differ between the directions; with asymmetric, the viscous part
does so too. ζ ∈ [−1, 1] is the deflection of the contact, z_c the stroke within which it yields.
Source: Armstrong-Hélouvry 1994 (Stribeck), Dahl 1976, Hamon, Gautier & Garrec 2010 (load).
"""

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.library import Library
from runtime.recording.friction.coupled_motors import directions
from runtime.recording.friction.dahl import dahl_state
from runtime.recording.friction_column import FrictionColumn, JointMotion
from runtime.recording.settings import Friction

FloatArray = NDArray[np.float64]


def _viscous(motion: JointMotion, _: Friction) -> FloatArray:
    return motion.dq


def _sign(motion: JointMotion, terms: Friction) -> FloatArray:
    speed = motion.dq / terms.coulomb_speed
    return np.tanh(speed, out=speed)


def _one(motion: JointMotion, _: Friction) -> FloatArray:
    return np.ones_like(motion.dq)


def _asymmetric(motion: JointMotion, terms: Friction) -> FloatArray:
    return motion.dq * _sign(motion, terms)


def _stribeck(motion: JointMotion, terms: Friction) -> FloatArray:
    return _sign(motion, terms) * np.exp(-((motion.dq / terms.stribeck_speed) ** 2))


def _load(motion: JointMotion, terms: Friction) -> FloatArray:
    if motion.q is None or motion.lib is None:
        raise RecordingError("the friction column 'load' needs q and the library of the robot")
    return gravity_load(motion.lib, motion.q) * _sign(motion, terms)


def gravity_load(lib: Library, q: FloatArray) -> FloatArray:
    """Size of the gravity torque |τ_g(q)| by the URDF.

    Args:
        lib: library of the robot.
        q: (N, n) joint positions [rad, m].

    Returns:
        (N, n) [N·m, N].
    """
    still = np.zeros_like(q)
    return np.abs(lib.inverse_dynamics(q, still, still, lib.pi0))


def _position(motion: JointMotion, terms: Friction) -> FloatArray:
    """Dry friction of a linkage, whose transmission ratio changes with the position."""
    if motion.q is None or motion.lib is None:
        raise RecordingError("the friction column 'position' needs q and the library of the robot")
    limits = motion.lib.limits()
    lower, upper = limits["lower"], limits["upper"]
    ends = np.isfinite(lower) & np.isfinite(upper) & (upper > lower)
    lower, upper = np.where(ends, lower, -np.pi), np.where(ends, upper, np.pi)
    place = (motion.q - (upper + lower) / 2) / ((upper - lower) / 2)
    dry = _dahl if DAHL.name in terms.columns else _sign
    return np.asarray(place * dry(motion, terms))


def _rotor(motion: JointMotion, _: Friction) -> FloatArray:
    if motion.ddq is None:
        return np.zeros_like(motion.dq)  # `renewed_rotor` follows once ddq is there
    return motion.ddq


def _dahl(motion: JointMotion, terms: Friction) -> FloatArray:
    if motion.zeta is not None:
        return motion.zeta
    if motion.q is None or len(motion.q) < 2:
        raise RecordingError(
            "the friction column 'dahl' depends on the path; give the motion of a whole recording, "
            "or identify with --friction offset,viscous,coulomb"
        )
    return dahl_state(motion.q, terms.dahl_stroke)


def _motor_motion(motion: JointMotion, terms: Friction, name: str) -> JointMotion:
    """Motion R̂ dq, R̂ ddq of the motors that drive several joints."""
    n = motion.dq.shape[-1]
    if len(terms.gear) != n:
        raise RecordingError(
            f"the column '{name}' needs the gear matrix of {n} motors, got "
            f"{len(terms.gear)} rows; write [gear] into the recipe"
        )
    to_motors = directions(terms.gear).T
    ddq = None if motion.ddq is None else np.asarray(motion.ddq @ to_motors)
    return JointMotion(motion.dq @ to_motors, ddq=ddq)


def _motor_viscous(motion: JointMotion, terms: Friction) -> FloatArray:
    return _viscous(_motor_motion(motion, terms, "motor_viscous"), terms)


def _motor_coulomb(motion: JointMotion, terms: Friction) -> FloatArray:
    return _sign(_motor_motion(motion, terms, "motor_coulomb"), terms)


def _motor_rotor(motion: JointMotion, terms: Friction) -> FloatArray:
    return _rotor(_motor_motion(motion, terms, "motor_rotor"), terms)


def _viscous_secant(speed: FloatArray, _: float) -> tuple[FloatArray, FloatArray]:
    return np.ones_like(speed), np.zeros_like(speed)


def _coulomb_secant(speed: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    slow = np.abs(speed) < 1e-3 * width  # there tanh(v/ε)/v is 1/ε to rounding
    quotient = np.tanh(speed / width) / np.where(slow, 1.0, speed)
    return np.where(slow, 1 / width, quotient), np.zeros_like(speed)


def _offset_secant(speed: FloatArray, _: float) -> tuple[FloatArray, FloatArray]:
    return np.zeros_like(speed), np.ones_like(speed)


VISCOUS = FrictionColumn(
    "viscous",
    "dq",
    _viscous,
    is_linear=True,
    is_nonnegative=True,
    model_term="damping",
    in_closed_loop=True,
    secant=_viscous_secant,
)
COULOMB = FrictionColumn(
    "coulomb",
    "tanh(dq / ε)",
    _sign,
    widths=("coulomb_speed",),
    is_nonnegative=True,
    model_term="friction",
    in_closed_loop=True,
    secant=_coulomb_secant,
)
OFFSET = FrictionColumn(
    "offset",
    "1",
    _one,
    is_linear=True,
    is_constant=True,
    is_passive=False,
    in_closed_loop=True,
    secant=_offset_secant,
)
ASYMMETRIC = FrictionColumn(
    "asymmetric", "dq tanh(dq / ε)", _asymmetric, widths=("coulomb_speed",), is_passive=False
)
STRIBECK = FrictionColumn(
    "stribeck",
    "tanh(dq / ε) exp(−(dq / v_s)²)",
    _stribeck,
    widths=("coulomb_speed", "stribeck_speed"),
)
DAHL = FrictionColumn(
    "dahl",
    "ζ with dζ = (dq − |dq| ζ) dt / z_c",
    _dahl,
    widths=("dahl_stroke",),
    is_nonnegative=True,
    model_term="friction",
)
LOAD = FrictionColumn("load", "|τ_g(q)| tanh(dq / ε)", _load, widths=("coulomb_speed",))
POSITION = FrictionColumn(
    "position",
    "x tanh(dq / ε), beside dahl x ζ; x from −1 to 1 between the limits",
    _position,
    widths=("coulomb_speed",),
    is_passive=False,
)
ROTOR = FrictionColumn(
    "rotor",
    "ddq",
    _rotor,
    is_linear=True,
    is_nonnegative=True,
    is_inertial=True,
    model_term="armature",
)
MOTOR_VISCOUS = FrictionColumn(
    "motor_viscous",
    "R̂ dq",
    _motor_viscous,
    is_linear=True,
    is_nonnegative=True,
    of_motors=True,
)
MOTOR_COULOMB = FrictionColumn(
    "motor_coulomb",
    "tanh(R̂ dq / ε)",
    _motor_coulomb,
    widths=("coulomb_speed",),
    is_nonnegative=True,
    of_motors=True,
)
MOTOR_ROTOR = FrictionColumn(
    "motor_rotor",
    "R̂ ddq",
    _motor_rotor,
    is_linear=True,
    is_nonnegative=True,
    is_inertial=True,
    of_motors=True,
)
