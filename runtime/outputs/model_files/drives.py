"""Drives of an identified robot, as simulators' actuators need them: gains, delay, bias, σ."""

from dataclasses import dataclass

from runtime.identification.result_record import PerJoint, ResultRecord

KEYS = ("armature", "viscous", "coulomb", "offset", "encoder_bias")
"""Values of one drive in result.json."""


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
