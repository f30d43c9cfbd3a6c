"""Estimate of the drives of a robot: delay, encoder bias, armature and friction of every joint."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.identification.result_key import Key
from runtime.library import Array

COLUMNS = {
    "armature": ("rotor",),
    "viscous": ("viscous",),
    "coulomb": ("coulomb", "dahl"),
    "offset": ("offset",),
}
"""Key of a drive in result.json → friction column; one of them is fitted. Both columns of dry
friction are ±1 in steady motion."""
DETERMINED = 0.5
"""σ of an encoder bias over that of its prior below which the motion counts as informative."""


def places_of(columns: tuple[str, ...]) -> dict[str, int]:
    """Key of a drive → place of its column, where it is fitted."""
    return {
        key: columns.index(name)
        for key, names in COLUMNS.items()
        for name in names
        if name in columns
    }


@dataclass(frozen=True, slots=True)
class DriveRequest:
    """Quantities of the drives that are estimated beside the parameters.

    Attributes:
        delay: whether a delay is estimated.
        per_joint: one delay per joint instead of one for the log.
        bias: whether the encoder biases are estimated.
        tied: "left:right" parts of names of joints whose drives are tied, see `tied_drives`.
    """

    delay: bool = False
    per_joint: bool = False
    bias: bool = False
    tied: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class DriveFit:
    """Drives of a robot with standard deviations; NaN where a value is not determined.

    Attributes:
        delay: d, (1,) for the log or (n,) per joint [s]; empty where it was not estimated.
        delay_sigma: of the same shape [s].
        bias: b of q_true = q + b, (n,) [rad, m]; NaN where it was not estimated.
        bias_sigma: (n,) [rad, m].
        bias_prior: standard deviation of the prior of b [rad, m].
        phi_sigma: standard deviations of φ, (n, k).
        phi_covariance: of the coefficients of every joint, (n, k, k).
    """

    delay: Array
    delay_sigma: Array
    bias: Array
    bias_sigma: Array
    bias_prior: float
    phi_sigma: Array
    phi_covariance: Array

    def verdicts(self) -> tuple[str, ...]:
        """Per joint: whether gravity and motion determine the encoder bias."""
        return tuple(
            "not estimated"
            if not np.isfinite(sigma)
            else "identified"
            if sigma < DETERMINED * self.bias_prior
            else "not identifiable from this motion"
            for sigma in self.bias_sigma
        )

    def delay_facts(self) -> Any:
        """`delay_s` of result.json: {value, sigma}, one per joint in a list, or None."""
        each = [
            {"value": _number(d), "sigma": _number(s)}
            for d, s in zip(self.delay, self.delay_sigma, strict=True)
        ]
        return None if not each else each[0] if len(each) == 1 else each

    def facts(
        self, joints: tuple[str, ...], phi: Array, columns: tuple[str, ...]
    ) -> list[dict[str, Any]]:
        """`drive` of result.json."""
        place = places_of(columns)
        tables, verdicts = [], self.verdicts()
        for j, joint in enumerate(joints):
            sigma = {
                key: _number(self.phi_sigma[j, place[key]]) if key in place else None
                for key in COLUMNS
            }
            values = {
                key: None if sigma[key] is None else _number(phi[j, place[key]]) for key in COLUMNS
            }
            values["encoder_bias"] = _number(self.bias[j])
            sigma["encoder_bias"] = _number(self.bias_sigma[j])
            verdict = {"encoder_bias_verdict": verdicts[j]}
            tables.append({"joint": joint, **values, "sigma": sigma, **verdict})
        return tables


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


TORQUE_KEYS: tuple[Key, ...] = (
    Key(
        "torque_source",
        "text",
        "measured, commanded (by a control law) or current (times a gain)",
        is_optional=True,
    ),
    Key(
        "control_law",
        "table?",
        "law, kp, kd, effort_limit and gear of a commanded torque, one "
        "number per joint or for all; null for a measured one",
        is_optional=True,
    ),
    Key(
        "current_gains",
        "list?",
        "estimated gains of motor currents, one table per joint or "
        "motor; null where the recipe states them",
        is_optional=True,
    ),
    Key("current_gains[].channel", "text", "joint, or motor where the gear couples joints"),
    Key("current_gains[].gain", "number", "torque over current", unit="N·m/A"),
    Key(
        "current_gains[].sigma",
        "number?",
        "standard deviation with the URDF as prior; null where "
        "the current shows no torque of the links",
        unit="N·m/A",
    ),
    Key("current_gains[].ratio_to", "text", "channel to which the ratio is taken"),
    Key(
        "current_gains[].ratio_sigma",
        "number?",
        "relative standard deviation of that ratio without the URDF",
    ),
    Key(
        "current_gains[].verdict",
        "text",
        "determined, determined up to the common factor, from "
        "the masses of the URDF, or not identifiable from this motion",
    ),
    Key(
        "delay_s",
        "any",
        "{value, sigma} of the delay of the torque; one per joint in a list, or "
        "{log, value, sigma} per log; null where it was not estimated",
        unit="s",
        is_optional=True,
    ),
    Key(
        "symmetric",
        "list?",
        "armature and friction of mirrored joints, one table per pair and quantity; null where "
        "--symmetric was not given",
        is_optional=True,
    ),
    Key("symmetric[].left", "text", "left joint"),
    Key("symmetric[].right", "text", "right joint"),
    Key("symmetric[].quantity", "text", "armature or friction"),
    Key("symmetric[].values", "list", "left and right, per coefficient", "(2, m)"),
    Key("symmetric[].sigma", "list", "standard deviations", "(2, m)"),
    Key("symmetric[].distance", "number", "difference in its standard deviations"),
    Key("symmetric[].agrees", "boolean", "whether it is within the 95 % interval"),
    Key(
        "symmetric[].rise",
        "number?",
        "error of the held-out torque with exchanged drives over "
        "that with theirs; null where the sides agree",
    ),
    Key("symmetric[].sentence", "text?", "where the sides disagree and why; null where they agree"),
    Key(
        "drive",
        "list?",
        "drive of every joint; null where the torque is measured and no delay was estimated",
        "(n,)",
        is_optional=True,
    ),
    Key("drive[].joint", "text", "name of the joint"),
    Key("drive[].armature", "number?", "inertia of rotor and gear", unit="kg·m²"),
    Key("drive[].viscous", "number?", "viscous friction", unit="N·m·s/rad"),
    Key("drive[].coulomb", "number?", "Coulomb friction, with or without a memory", unit="N·m"),
    Key("drive[].offset", "number?", "torque offset", unit="N·m"),
    Key("drive[].encoder_bias", "number?", "b of q_true = q + b", unit="rad"),
    Key(
        "drive[].sigma",
        "table",
        "standard deviations under the same names; null where the "
        "motion does not determine the value",
    ),
    Key(
        "drive[].encoder_bias_verdict",
        "text",
        "identified, not identifiable from this motion, or not estimated",
    ),
)
"""Keys of result.json on the origin of the torque: source, law, gains, delay and drives."""
