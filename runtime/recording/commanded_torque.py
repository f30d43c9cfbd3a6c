"""Torque of a control law, from desired and measured motion on the joint side.

    τ = r clip(kp r (q_des − q) + kd r (dq_des − dq) + τ_ff, ± limit)

The torque is commanded: what the motors deliver may be later (`Preparation.torque_delay_s`) and is
not known from the log. Source of the law: the drives of servo arms and legged robots.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from runtime.common.tables import significant
from runtime.errors import RecordingError
from runtime.library import Array
from runtime.recording.recipes.recipe import COMMANDED, ControlLaw
from runtime.recording.recording import Recording
from runtime.recording.settings import Preparation

MOST_TRIMMED = 0.05  # largest share of the duration that is left out at either end


def commanded_torque(
    law: ControlLaw, motion: Mapping[str, Array], parts: Mapping[str, Array]
) -> tuple[Array, str]:
    """Torque of a control law: motion (N, n) [rad, m], parts (N, n) → (N, n) [N·m, N]."""
    q = motion["q"]
    n = q.shape[1]
    for kind, values in parts.items():
        if values.shape != q.shape:
            raise RecordingError(
                f"[torque] {kind.replace('_', ' ')} is expected to have {n} columns like the "
                f"positions, got {values.shape[1]}; name one per joint"
            )
    kp, kd, limit, gear = (
        parts[key] if key in parts else per_joint("torque", key, getattr(law, key), n)
        for key in ("kp", "kd", "effort_limit", "gear")
    )
    tau = kp * gear * (parts["desired_position"] - q)
    if "dq" in motion and law.needs_velocity:
        tau += kd * gear * (parts.get("desired_velocity", 0.0) - motion["dq"])
    tau += parts.get("feed_forward", 0.0)
    bound = np.where(limit > 0, limit, np.inf)
    clipped = float(np.mean(np.any(np.abs(tau) > bound, axis=1)))
    percent = significant(100 * clipped)
    limits = f"; {percent} % of the rows are at the effort limit" if clipped else ""
    torque = gear * np.clip(tau, -bound, bound)
    return torque, f"Computed τ by the {law}: it is commanded, not measured{limits}."


def without_ends(recording: Recording, preparation: Preparation) -> Preparation:
    """The preparation without both ends of a commanded torque.

    There the low-pass extrapolates, and a robot that starts from rest holds any torque below its
    dry friction.
    """
    cutoff = preparation.cutoff_hz
    if recording.torque_source != COMMANDED or preparation.trim_s is not None or cutoff is None:
        return preparation
    trim = min(1.0 / cutoff, MOST_TRIMMED * recording.duration)
    return replace(preparation, trim_s=float(f"{trim:.3g}"))


def per_joint(kind: str, key: str, value: object, n: int) -> Array:
    """One value per joint (n,) from a scalar or a list."""
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if len(numbers) not in {1, n}:
        raise RecordingError(
            f"[{kind}] {key} expects one value or {n}, got {len(numbers)}; give one per joint"
        )
    return np.broadcast_to(numbers, (n,))
