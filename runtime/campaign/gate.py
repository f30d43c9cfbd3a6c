"""The gate before a stage: the certificate at its speed, and the logs recorded so far.

A stage is released where the motion keeps every limit at its speed, the last log has no error that
`inspect` finds, its torques follow the URDF and friction, and it agrees with the model that was
identified without it. That the URDF is wrong by some percent is no reason to refuse a campaign.

`torque_faults` compares the torque columns with the URDF, joint by joint:

    τ_j = r_j τ_URDF,j + φ₁ ζ_j + φ₂ dq_j + o_j + e_j

Dry friction opposes motion whatever the links weigh, so that φ₁ < 0 is a wrong sign. Torques of
another joint leave a large share of e. r_j far from 1 is a gain, a load, or a URDF that is wrong by
more than `RATIO`; it counts where τ_URDF,j outweighs the friction, or the part of it that friction
does not imitate outweighs e by far.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.campaign.estimation import PREPARATION
from runtime.campaign.gear_friction import FRICTION, GearFriction, prepared_columns, smoothed
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.proof.certificate import certificate_of
from runtime.inspection import ERROR, inspect_log
from runtime.library import Library
from runtime.recording import Recording, read_recording

AGREEMENT = 3.0
"""Largest RMS of the residual of a new log over the RMS of the band that the model states."""
EMPTY_CELL = Safety()
"""Limits of the robot alone."""
RATIO = 0.2
"""Largest deviation of r from 1; links that differ by 5 % from the URDF leave 0.04, a body of 1 kg
on the last link of an FR3 changes it by 0.4."""
UNEXPLAINED = 0.5
"""Largest RMS of e over the standard deviation of τ; sound logs stay below 0.25, exchanged columns
leave 0.74 and more on one of the two joints."""
DISTINCT = 10.0
"""Standard deviation of the part of τ_URDF,j that friction and an offset do not imitate, over that
of e, from which on r is known to 0.1. Sound joints with three times the usual friction reach 6 and
more, and their r is off by up to 0.06."""
SMALL = 0.1
"""Torques of wrists below this share of the largest one are left to the first rule."""
CLEAR = 2.0
"""Size of a torque over the one that it is compared with from which on it counts."""


@dataclass(frozen=True, slots=True)
class Release:
    """Decision on a stage."""

    reasons: tuple[str, ...]  # sentences on why the stage is refused; empty where it is released
    checked: tuple[str, ...]  # what was checked
    # RMS of the residual over that of the band, per joint; None without a model
    agreement: tuple[float, ...] | None = None

    @property
    def is_released(self) -> bool:
        """Whether the stage may run."""
        return not self.reasons

    def to_facts(self) -> dict[str, object]:
        """JSON-ready content."""
        return {
            "released": self.is_released,
            "reasons": list(self.reasons),
            "checked": list(self.checked),
            "agreement": None if self.agreement is None else list(self.agreement),
        }


def released(
    lib: Library,
    motion: Trajectory,
    log: Path | None,
    agreement: tuple[float, ...] | None = None,
    safety: Safety = EMPTY_CELL,
) -> Release:
    """Decide whether a stage may run."""
    reasons: list[str] = []
    checked = ["limits at every instant"]
    certificate = certificate_of(lib, motion, safety)
    reasons += [
        f"the motion uses {100 * use.bound:.4g} % of the limit of {use.kind}"
        for use in certificate.broken
    ]
    if log is not None:
        checked.append("faults of the last log")
        errors = inspect_log(log, lib).of_level(ERROR)
        reasons += [f"{log.name}: {each.sentence}" for each in errors]
        checked.append("torque of every joint against the URDF")
        reasons += [
            f"{log.name}: {each}"
            for each in torque_faults(
                lib, smoothed(read_recording(log, joints=lib.joint_names), lib)
            )
        ]
    if agreement is not None:
        checked.append("agreement of the last log with the model before it")
        worst = int(np.argmax(agreement))
        if not agreement[worst] <= AGREEMENT:
            reasons.append(
                f"the residual of the last log on {lib.joint_names[worst]} is "
                f"{agreement[worst]:.2g} times the band of the model, where {AGREEMENT:g} is "
                "allowed; has the load, the friction or a sensor changed?"
            )
    return Release(tuple(reasons), tuple(checked), agreement)


def torque_faults(lib: Library, motion: Recording) -> tuple[str, ...]:
    """Sentences on joints whose torque contradicts the URDF and its own friction."""
    usual = GearFriction.usual(lib.n_joints)
    columns, _, rows = prepared_columns(motion, usual, PREPARATION)
    tau = rows.required("tau")
    model = lib.inverse_dynamics(rows.q, rows.required("dq"), rows.required("ddq"), lib.pi0)
    dahl, viscous = FRICTION.index("dahl"), FRICTION.index("viscous")
    sentences, largest = [], float(model.std(axis=0).max())
    for j, name in enumerate(lib.joint_names):
        parts = np.column_stack(
            [model[:, j], columns[:, j, dahl], columns[:, j, viscous], np.ones(len(tau))]
        )
        x, *_ = np.linalg.lstsq(parts, tau[:, j], rcond=None)
        rest = float(np.std(tau[:, j] - parts @ x))
        rigid, dry = x[0] * model[:, j], x[1] * columns[:, j, dahl]
        others = parts[:, 1:] @ np.linalg.lstsq(parts[:, 1:], model[:, j], rcond=None)[0]
        apart = float(np.std(x[0] * (model[:, j] - others)))
        friction = float(np.std(dry + x[2] * columns[:, j, viscous]))
        if x[1] < 0 and np.std(dry) > CLEAR * rest:
            sentences.append(
                f"the torque of {name} has the wrong sign: its friction drives the joint"
            )
        elif rest > UNEXPLAINED * np.std(tau[:, j]):
            sentences.append(
                f"the torque of {name} follows neither the URDF nor its friction "
                f"({100 * rest / np.std(tau[:, j]):.0f} % of it is left); is it of another joint?"
            )
        elif abs(x[0] - 1) > RATIO and (
            np.std(rigid) > CLEAR * max(friction, rest)
            or (apart > DISTINCT * rest and np.std(model[:, j]) > SMALL * largest)
        ):
            sentences.append(
                f"the torque of {name} is {x[0]:.2f} times that of the URDF: a load that it does "
                "not contain, a gain of the sensor, or wrong inertias"
            )
    return tuple(sentences)
