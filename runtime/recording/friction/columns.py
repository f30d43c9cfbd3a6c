"""Friction columns of this package: functions of the joint motion, and their records.

    s = tanh(dq / ε) stands for the sign of dq and is smooth at rest

    offset 1 · viscous dq · coulomb s · asymmetric dq s · stribeck s exp(−(dq / v_s)²)
    load |τ_g| s · position x s, x ∈ [−1, 1] between the limits, x ζ beside dahl · rotor ddq
    dahl ζ, the Dahl state of the path: dζ = (dq − |dq| ζ) dt / z_c · dahl_load |τ_g| ζ
    motor_viscous · motor_coulomb · motor_rotor: of motors that drive several joints

Offset and coulomb together already differ between the directions; with asymmetric, the viscous part
does so too. ζ ∈ [−1, 1] is the deflection of the contact, z_c the stroke within which it yields.
Source: Armstrong-Hélouvry 1994 (Stribeck), Dahl 1976, Hamon, Gautier & Garrec 2010 (load).

Columns that the name of a part selects: `spring:NAME`, τ = S(q) k for a spring of unknown
stiffness, and `joint_…:NAME`, τ = Gᵀ c(G dq) φ for a joint that follows others. G = ∂x/∂q is the
row of the joint in ∂q_all/∂q, which depends on the posture where a loop is closed. With couplings
it is constant, and the columns motor_… have the rows of several masters as well.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import RecordingError
from runtime.library import Array, Library
from runtime.recording.friction.coupled_motors import directions
from runtime.recording.settings import (
    JOINT_COULOMB,
    JOINT_VISCOUS,
    SPRING,
    Friction,
    FrictionColumn,
    JointMotion,
)

_BLOCK = 64  # samples of one block; all blocks are stepped through side by side


def dahl_state(q: Array, stroke: ArrayLike) -> Array:
    """ζ (N, n) of a path q (N, n), first 0: ζ ← s + (ζ − s) exp(−|Δq| / z_c), exact per step."""
    step = np.diff(q, axis=0)
    count, n = step.shape
    blocks = max(1, -(-count // _BLOCK))
    stay, gained = np.ones((blocks * _BLOCK, n)), np.zeros((blocks * _BLOCK, n))
    stay[:count] = np.exp(-np.abs(step) / stroke)
    gained[:count] = np.sign(step) * (1 - stay[:count])
    # Within a block ζ = a ζ₀ + b: all blocks step by step, then from block to block.
    a, b = stay.reshape(blocks, _BLOCK, n), gained.reshape(blocks, _BLOCK, n)
    for i in range(1, _BLOCK):
        b[:, i] += a[:, i] * b[:, i - 1]
        a[:, i] *= a[:, i - 1]
    first = np.zeros((blocks, 1, n))
    for i in range(1, blocks):
        first[i, 0] = a[i - 1, -1] * first[i - 1, 0] + b[i - 1, -1]
    zeta = (a * first + b).reshape(blocks * _BLOCK, n)[:count]
    return np.concatenate([np.zeros((1, n)), zeta])


def _sign(motion: JointMotion, terms: Friction) -> Array:
    speed = motion.dq / terms.coulomb_speed
    return np.tanh(speed, out=speed)


def _load(
    motion: JointMotion, terms: Friction, dry: Callable[[JointMotion, Friction], Array] = _sign
) -> Array:
    if motion.q is None or motion.lib is None:
        raise RecordingError("friction of the load needs q and the library of the robot; give both")
    return gravity_load(motion.lib, motion.q) * dry(motion, terms)


def gravity_load(lib: Library, q: Array) -> Array:
    """Size of the gravity torque |τ_g(q)| by the URDF, (N, n) [N·m, N]."""
    still = np.zeros_like(q)
    return np.abs(lib.inverse_dynamics(q, still, still, lib.pi0))


def _position(motion: JointMotion, terms: Friction) -> Array:
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


def _rotor(motion: JointMotion, _: Friction) -> Array:
    if motion.ddq is None:
        return np.zeros_like(motion.dq)  # `renewed_rotor` follows once ddq is there
    return motion.ddq


def _dahl(motion: JointMotion, terms: Friction) -> Array:
    if motion.zeta is not None:
        return motion.zeta
    if motion.q is None or len(motion.q) < 2:
        raise RecordingError(
            "the friction column 'dahl' depends on the path; give the motion of a whole recording, "
            "or identify with --friction offset,viscous,coulomb"
        )
    return dahl_state(motion.q, terms.dahl_stroke)


def _coulomb_secant(speed: Array, width: float) -> tuple[Array, Array]:
    slow = np.abs(speed) < 1e-3 * width  # there tanh(v/ε)/v is 1/ε to rounding
    quotient = np.tanh(speed / width) / np.where(slow, 1.0, speed)
    return np.where(slow, 1 / width, quotient), np.zeros_like(speed)


VISCOUS = FrictionColumn(
    "viscous",
    "dq",
    lambda motion, _: motion.dq,
    is_linear=True,
    is_nonnegative=True,
    model_term="damping",
    in_closed_loop=True,
    secant=lambda speed, _: (np.ones_like(speed), np.zeros_like(speed)),
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
    lambda motion, _: np.ones_like(motion.dq),
    is_linear=True,
    is_constant=True,
    is_passive=False,
    in_closed_loop=True,
    secant=lambda speed, _: (np.zeros_like(speed), np.ones_like(speed)),
)
ASYMMETRIC = FrictionColumn(
    "asymmetric",
    "dq tanh(dq / ε)",
    lambda motion, terms: motion.dq * _sign(motion, terms),
    widths=("coulomb_speed",),
    is_passive=False,
)
STRIBECK = FrictionColumn(
    "stribeck",
    "tanh(dq / ε) exp(−(dq / v_s)²)",
    lambda motion, terms: _sign(motion, terms) * np.exp(-((motion.dq / terms.stribeck_speed) ** 2)),
    widths=("coulomb_speed", "stribeck_speed"),
)
DAHL = FrictionColumn(
    "dahl",
    "ζ with dζ = (dq − |dq| ζ) dt / z_c",
    _dahl,
    widths=("dahl_stroke",),
    is_nonnegative=True,
    has_memory=True,
    model_term="friction",
)
LOAD = FrictionColumn(
    "load", "|τ_g(q)| tanh(dq / ε)", _load, widths=("coulomb_speed",), is_nonnegative=True
)
DAHL_LOAD = replace(
    DAHL, name="dahl_load", sentence="|τ_g(q)| ζ", function=partial(_load, dry=_dahl), model_term=""
)
POSITION = FrictionColumn(
    "position",
    "x tanh(dq / ε), beside dahl x ζ; x from −1 to 1 between the limits",
    _position,
    widths=("coulomb_speed",),
    is_passive=False,
    takes_memory=True,
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


def _of_motors(column: FrictionColumn, sentence: str) -> FrictionColumn:
    """The column of the motion R̂ dq, R̂ ddq of the motors that drive several joints."""
    name = f"motor_{column.name}"

    def function(motion: JointMotion, terms: Friction) -> Array:
        n = motion.dq.shape[-1]
        if len(terms.gear) != n:
            raise RecordingError(
                f"the column '{name}' needs the gear matrix of {n} motors, got "
                f"{len(terms.gear)} rows; write [gear] into the recipe"
            )
        to_motors = directions(terms.gear).T
        ddq = None if motion.ddq is None else np.asarray(motion.ddq @ to_motors)
        return column.function(JointMotion(motion.dq @ to_motors, ddq=ddq), terms)

    motors = replace(column, name=name, sentence=sentence, function=function, of_motors=True)
    return replace(motors, model_term="", in_closed_loop=False, secant=None)


MOTOR_VISCOUS = _of_motors(VISCOUS, "R̂ dq")
MOTOR_COULOMB = _of_motors(COULOMB, "tanh(R̂ dq / ε)")
MOTOR_ROTOR = _of_motors(ROTOR, "R̂ ddq")


def spring_column(name: str) -> FrictionColumn:
    """The record of `spring:NAME`; the library decides whether the robot has that spring."""
    spring = name.removeprefix(SPRING)
    return FrictionColumn(
        name,
        f"(x − rest) ∂x/∂q of the spring {spring}",
        partial(_spring_torque, spring),
        is_passive=False,
        is_shared=True,
    )


def _spring_torque(spring: str, motion: JointMotion, _: Friction) -> Array:
    if motion.q is None or motion.lib is None:
        raise RecordingError(
            f"the column 'spring:{spring}' needs q and the library of the robot; give lib"
        )
    names = motion.lib.manifest.springs
    if spring not in names:
        listed = ", ".join(f"spring:{name}" for name in names) or "none"
        raise RecordingError(
            f"'{motion.lib.name}' has no spring '{spring}' of unknown stiffness (there are: "
            f"{listed}); name one of them, or build the robot with [[spring]] in --mechanism"
        )
    return np.ascontiguousarray(motion.lib.spring_columns(motion.q)[..., names.index(spring)])


def dependent_joint_column(name: str) -> FrictionColumn:
    """The record of `joint_viscous:NAME` or `joint_coulomb:NAME`."""
    prefix = JOINT_COULOMB if name.startswith(JOINT_COULOMB) else JOINT_VISCOUS
    joint = name.removeprefix(prefix)
    is_dry = prefix == JOINT_COULOMB
    return FrictionColumn(
        name,
        f"Gᵀ tanh(G dq / ε) of the joint {joint}" if is_dry else f"Gᵀ G dq of the joint {joint}",
        partial(_dependent_torque, name, joint, is_dry),
        widths=("coulomb_speed",) if is_dry else (),
        is_nonnegative=True,
        is_shared=True,
    )


def _dependent_torque(
    name: str, joint: str, is_dry: bool, motion: JointMotion, terms: Friction
) -> Array:
    lib = motion.lib
    if motion.q is None or lib is None:
        raise RecordingError(f"the column '{name}' needs q and the library of the robot; give lib")
    dependent = [each for each in lib.all_joint_names if each not in lib.joint_names]
    if joint not in dependent:
        listed = ", ".join(dependent) or "none"
        raise RecordingError(
            f"'{lib.name}' has no joint '{joint}' that follows others (there are: {listed}); name "
            "one of them; the columns viscous and coulomb are those of the independent joints"
        )
    row = lib.joint_jacobian(motion.q)[..., lib.all_joint_names.index(joint), :]
    speed = np.einsum("...n,...n->...", row, motion.dq)
    if is_dry:
        widths = np.broadcast_to(np.asarray(terms.coulomb_speed, dtype=float), row.shape[-1:])
        speed = np.tanh(speed / widths.min())
    return np.ascontiguousarray(row * speed[..., None])
