"""The gate before a stage: the certificate at its speed, and the logs recorded so far.

A stage is released where the motion keeps every limit at its speed, the last log has no error that
`inspect` finds, its torques follow the URDF and friction, and it agrees with the model that was
identified without it. That the URDF is wrong by some percent is no reason to refuse a campaign.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.campaign.gear_friction import smoothed
from runtime.campaign.torque_faults import torque_faults
from runtime.excitation import Safety, Trajectory
from runtime.excitation.proof.certificate import certificate_of
from runtime.inspection import ERROR, inspect_log
from runtime.library import Library
from runtime.recording import read_recording

AGREEMENT = 3.0
"""Largest RMS of the residual of a new log over the RMS of the band that the model states."""


EMPTY_CELL = Safety()
"""Limits of the robot alone."""


@dataclass(frozen=True, slots=True)
class Release:
    """Decision on a stage.

    Attributes:
        reasons: sentences on why the stage is refused; empty where it is released.
        checked: what was checked.
        agreement: RMS of the residual over that of the band, per joint; None without a model.
    """

    reasons: tuple[str, ...]
    checked: tuple[str, ...]
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
            f"{log.name}: {each}" for each in torque_faults(lib, smoothed(read_recording(log), lib))
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
