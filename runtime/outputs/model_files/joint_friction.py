"""Identified friction and drives → joints of simulators: damping, dry friction, rotor inertia.

viscous dq → damping      coulomb tanh(dq/ε), dahl ζ → friction (both are ±1 in steady motion)
rotor ddq → armature      other columns have no counterpart and are listed in a note

Drives, as actuators need them: gains, delay, bias and their σ.
"""

from dataclasses import dataclass, field

import numpy as np

from runtime.errors import ExportError
from runtime.identification.result_record import PerJoint, ResultRecord
from runtime.library import Array, Library
from runtime.recording import Friction
from runtime.recording.friction.columns import DAHL
from runtime.recording.settings import COLUMNS

KEYS = ("armature", "viscous", "coulomb", "offset", "encoder_bias")  # of one drive in result.json


@dataclass(frozen=True, slots=True)
class Drives:
    """Drives of all joints in SI units; None where a value is unknown."""

    joints: tuple[str, ...]  # names
    values: dict[str, tuple[float | None, ...]]  # key of `KEYS` → one value per joint
    sigma: dict[str, tuple[float | None, ...]]  # the same for standard deviations
    delay: tuple[float | None, ...]  # of the torque, per joint [s]
    delay_sigma: tuple[float | None, ...]  # likewise [s]
    kp: tuple[float | None, ...]  # stiffness of the control law, per joint [N·m/rad, N/m]
    kd: tuple[float | None, ...]  # damping of the control law, per joint [N·m·s/rad, N·s/m]

    def delay_note(self) -> str:
        """Sentence on the delay for the head of a model file; "" without one."""
        known = [d for d in self.delay if d is not None]
        if not known:
            return ""
        shown = ", ".join(f"{1e3 * d:.3g}" for d in dict.fromkeys(known))
        return f"delay: the commanded torque acts {shown} ms late; the file cannot state it."


def drives_of(record: ResultRecord) -> Drives | None:
    """Drives of a result.json."""
    if not record.drive:
        return None
    tables, joints, law = record.drive, record.joints, record.control_law
    delays = record.delays if isinstance(record.delay_s, tuple) else record.delays * len(joints)
    none = (None,) * len(joints)
    return Drives(
        joints,
        {key: tuple(getattr(table, key) for table in tables) for key in KEYS},
        {key: tuple(getattr(table.sigma, key) for table in tables) for key in KEYS},
        tuple(_number(delay.value) for delay in delays) or none,
        tuple(_number(delay.sigma) for delay in delays) or none,
        none if law is None else _per_joint(law.kp, joints),
        none if law is None else _per_joint(law.kd, joints),
    )


def _number(value: PerJoint) -> float | None:
    """A delay of the whole log or of one joint."""
    return value if isinstance(value, float) else None


def _per_joint(value: PerJoint, joints: tuple[str, ...]) -> tuple[float | None, ...]:
    return value if isinstance(value, tuple) else (value,) * len(joints)


Values = tuple[float | None, ...]  # per joint; None: unknown, or negative, which would drive it

TERMS = ("damping", "friction", "armature")  # of a simulator's joint, `FrictionColumn.model_term`


@dataclass(frozen=True, slots=True, eq=False)
class JointFriction:
    """Joint friction as simulators describe it, per joint of the library."""

    damping: Values  # viscous coefficient [N·m·s/rad, N·s/m]
    friction: Values  # dry friction [N·m, N]
    armature: Values  # rotor inertia on the joint side [kg·m², kg]
    notes: tuple[str, ...] = ()  # what these three do not represent, sentences
    terms: Friction = field(default_factory=lambda: Friction(columns=()))  # terms, values: φ (n, k)
    values: Array | None = None

    @property
    def is_known(self) -> bool:
        """Whether some joint has damping or dry friction."""
        return any(value is not None for value in (*self.damping, *self.friction))

    def filled(self, quantity: str) -> Array:
        """Return damping, friction or armature (n,) with 0 where it is unknown."""
        return np.array([value or 0.0 for value in getattr(self, quantity)])


def joint_friction(lib: Library, terms: Friction | None, phi: Array | None) -> JointFriction:
    """Joint friction of simulators from identified coefficients phi (n, k) of the columns."""
    n = lib.n_joints
    unknown = (None,) * n
    if terms is None or not terms.columns or phi is None:
        return JointFriction(unknown, unknown, unknown)
    if phi.shape != (n, len(terms.columns)) or not np.isfinite(phi).all():
        raise ExportError(
            f"expected finite friction coefficients of {n} joints and {len(terms.columns)} "
            f"columns, got the shape {phi.shape}; identify the robot again"
        )
    notes: list[str] = []
    values: dict[str, Values] = {}
    term_of = {name: COLUMNS[name].model_term for name in terms.columns if name in COLUMNS}
    for quantity in TERMS:
        present = [k for k, name in enumerate(terms.columns) if term_of.get(name) == quantity]
        if not present:
            values[quantity] = unknown
            continue
        total = phi[:, present].sum(axis=1)
        values[quantity] = tuple(float(x) if x >= 0 else None for x in total)
        notes += [
            f"{quantity} of {joint} was identified as {x:.3g}; it is negative and omitted"
            for joint, x in zip(lib.joint_names, total, strict=True)
            if x < 0
        ]
    others = [name for name in terms.columns if not term_of.get(name)]
    if others:
        notes.append(f"friction columns without a counterpart here, omitted: {', '.join(others)}")
        notes += [COLUMNS[n].omitted for n in others if n in COLUMNS and COLUMNS[n].omitted]
    if values["friction"] != unknown:
        kind = f"as a smooth function of the velocity (tanh(dq / {terms.coulomb_speed:.3g}))"
        if DAHL.name in terms.columns:
            kind = f"with a memory of {np.mean(terms.dahl_stroke):.3g} rad or m of travel"
        notes.append(f"dry friction was identified {kind}; simulators use it for stiction as well")
    return JointFriction(**values, notes=tuple(notes), terms=terms, values=phi)
