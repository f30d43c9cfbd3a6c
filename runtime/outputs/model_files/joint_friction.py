"""Identified friction → what simulators know: damping, dry friction and rotor inertia of a joint.

viscous dq → damping      coulomb tanh(dq/ε), dahl ζ → friction (both are ±1 in steady motion)
rotor ddq → armature      all else has no counterpart and is named
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array, Library
from runtime.recording import Friction

Values = tuple[float | None, ...]
"""One per joint; None where nothing is known, or where a coefficient would drive the joint."""

MEANING = {
    "damping": ("viscous",),
    "friction": ("coulomb", "dahl"),
    "armature": ("rotor",),
}


@dataclass(frozen=True, slots=True)
class Drive:
    """Per joint of the library.

    Attributes:
        damping: N·m s/rad or N s/m.
        friction: dry friction, N·m or N.
        armature: rotor inertia on the joint side, kg·m² or kg.
        notes: what could not be said in these three, sentences.
        names, values: the columns as identified and φ (n, k).
    """

    damping: Values
    friction: Values
    armature: Values
    notes: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    values: Array | None = None

    @property
    def is_known(self) -> bool:
        """Some joint has damping or dry friction."""
        return any(value is not None for value in (*self.damping, *self.friction))

    def filled(self, what: str) -> Array:
        """damping, friction or armature with 0 where nothing is known, (n,)."""
        return np.array([value or 0.0 for value in getattr(self, what)])


def read_drive(lib: Library, terms: Friction | None, phi: Array | None) -> Drive:
    """What identified coefficients mean to a simulator.

    Args:
        lib: the robot.
        terms: the columns that were fitted; None: none.
        phi: (n, k) in N·m per unit of the column.

    Raises:
        ExportError: φ does not fit the columns and joints.
    """
    n = lib.n_joints
    nothing = (None,) * n
    if terms is None or not terms.columns or phi is None:
        return Drive(nothing, nothing, nothing)
    if phi.shape != (n, len(terms.columns)) or not np.isfinite(phi).all():
        raise ExportError(
            f"friction needs finite coefficients of {n} joints and {len(terms.columns)} columns, "
            f"got the shape {phi.shape}"
        )
    notes: list[str] = []
    found: dict[str, Values] = {}
    for what, columns in MEANING.items():
        present = [k for k, name in enumerate(terms.columns) if name in columns]
        if not present:
            found[what] = nothing
            continue
        total = phi[:, present].sum(axis=1)
        found[what] = tuple(float(x) if x >= 0 else None for x in total)
        notes += [
            f"{what} of {joint} was identified as {x:.3g}, which would drive it, and is left out"
            for joint, x in zip(lib.joint_names, total, strict=True)
            if x < 0
        ]
    known = {column for columns in MEANING.values() for column in columns}
    others = [name for name in terms.columns if name not in known]
    if others:
        notes.append(f"friction without a counterpart here, left out: {', '.join(others)}")
    if found["friction"] != nothing:
        notes.append(
            "dry friction was identified as a smooth function of the velocity "
            f"(tanh(dq / {terms.coulomb_speed:.3g})); simulators take it as stiction too"
        )
    return Drive(**found, notes=tuple(notes), names=terms.columns, values=phi)
