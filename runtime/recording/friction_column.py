"""A friction column: one record per column, and the registry of all columns.

    τ_f,j = Σ_k C_jk φ_jk        C (N, n, k) columns of the motion, φ (n, k) their coefficients

A column is one record in `runtime.recording.friction.columns` and one line in `COLUMNS` (or an
entry point of the group "symgen.friction_columns" of another package).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from runtime.registry import Registry

if TYPE_CHECKING:  # settings name the widths of the columns by this registry
    from runtime.library import Library
    from runtime.recording.settings import Friction

FloatArray = NDArray[np.float64]


class JointMotion(NamedTuple):
    """Motion from which friction columns are computed; every column needs dq.

    Attributes:
        dq: (N, n) joint velocities [rad/s, m/s].
        q: (N, n) joint positions of successive instants [rad, m]; for dahl, load and position.
        ddq: (N, n) joint accelerations [rad/s², m/s²]; for rotor.
        lib: library of the robot; for load and position.
        zeta: (N, n) state of friction with a memory where it is known; None for that of the path q.
    """

    dq: FloatArray
    q: FloatArray | None = None
    ddq: FloatArray | None = None
    lib: "Library | None" = None
    zeta: FloatArray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FrictionColumn:
    """One friction column and what the rooms of the package need of it.

    Attributes:
        name: as a user writes it.
        sentence: its equation.
        function: motion (N, n) and widths → (N, n) column.
        widths: names of the widths of `Friction` that it depends on.
        is_linear: linear in q, dq and ddq, so that it may be computed after linear filters.
        is_constant: independent of the motion.
        is_passive: takes power from the joint wherever φ ≥ 0.
        is_nonnegative: φ of a real joint is ≥ 0, whatever the other columns are.
        is_inertial: the acceleration of the joint or motor, an inertia rather than friction.
        is_shared: one coefficient for all joints, the column is a torque on each of them.
        of_motors: at the speed of motors that drive several joints (`friction.coupled_motors`).
        model_term: term of simulators' joints that it stands for: "damping", "friction" (dry),
            "armature"; "" where they have none.
        in_closed_loop: the compiled simulation of the closed loop has it, under this name.
        secant: speed (n,) and ε → column/dq (n,) and constant part (n,), for the Kalman filters;
            None where they cannot use it.
    """

    name: str
    sentence: str
    function: "Callable[[JointMotion, Friction], FloatArray]"
    widths: tuple[str, ...] = ()
    is_linear: bool = False
    is_constant: bool = False
    is_passive: bool = True
    is_nonnegative: bool = False
    is_inertial: bool = False
    is_shared: bool = False
    of_motors: bool = False
    model_term: str = ""
    in_closed_loop: bool = False
    secant: Callable[[FloatArray, float], tuple[FloatArray, FloatArray]] | None = None


SPRING = "spring:"
"""Prefix of the columns of springs: `spring:NAME`, one per spring of the robot's mechanism."""


JOINT_VISCOUS, JOINT_COULOMB = "joint_viscous:", "joint_coulomb:"
"""Prefixes of friction columns of joints that follow others: `joint_viscous:NAME`."""
_PREFIXES = (SPRING, JOINT_VISCOUS, JOINT_COULOMB)


class ColumnRegistry(Registry[FrictionColumn]):
    """The friction columns by name, those of springs and dependent joints by prefix."""

    def __contains__(self, name: object) -> bool:
        return (isinstance(name, str) and name.startswith(_PREFIXES)) or super().__contains__(name)

    def __getitem__(self, name: str) -> FrictionColumn:
        """The record of a name; see `Registry`."""
        if name.startswith(SPRING):
            from runtime.recording.friction.springs import spring_column

            return spring_column(name)
        if name.startswith((JOINT_VISCOUS, JOINT_COULOMB)):
            from runtime.recording.friction.dependent_joints import dependent_joint_column

            return dependent_joint_column(name)
        return super().__getitem__(name)


_ROOM = "runtime.recording.friction.columns"
COLUMNS = ColumnRegistry(
    "symgen.friction_columns",
    FrictionColumn,
    "friction column",
    {
        "viscous": f"{_ROOM}:VISCOUS",
        "coulomb": f"{_ROOM}:COULOMB",
        "offset": f"{_ROOM}:OFFSET",
        "asymmetric": f"{_ROOM}:ASYMMETRIC",
        "stribeck": f"{_ROOM}:STRIBECK",
        "dahl": f"{_ROOM}:DAHL",
        "load": f"{_ROOM}:LOAD",
        "position": f"{_ROOM}:POSITION",
        "rotor": f"{_ROOM}:ROTOR",
        "motor_viscous": f"{_ROOM}:MOTOR_VISCOUS",
        "motor_coulomb": f"{_ROOM}:MOTOR_COULOMB",
        "motor_rotor": f"{_ROOM}:MOTOR_ROTOR",
    },
)
"""All friction columns, in the order of help and messages."""


def names_where(claim: Callable[[FrictionColumn], bool]) -> tuple[str, ...]:
    """Names of the columns for which a claim about the record is true."""
    return tuple(each.name for each in COLUMNS.records() if claim(each))


def widths_of(names: tuple[str, ...]) -> set[str]:
    """Names of the widths on which some columns depend; unknown columns have none."""
    return {width for name in names if name in COLUMNS for width in COLUMNS[name].widths}
