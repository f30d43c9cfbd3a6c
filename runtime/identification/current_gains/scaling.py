"""Torque of motor currents whose recipe states no gain: estimated gains times currents.

τ = Rᵀ diag(k) R⁻ᵀ i        R the gear matrix; τ_j = k_j i_j without coupled gears
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from runtime.identification.current_gains.one_log import Weighed, current_gains
from runtime.identification.settings import Settings
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.current_gains import CurrentGains
from runtime.recording.preprocessing import before_test


def with_current_gains(
    recording: Recording,
    lib: Library,
    weighed: Sequence[Weighed] = (),
    *,
    friction: Friction | None = None,
    preparation: Preparation | None = None,
    split: Split | None = None,
) -> Recording:
    """The recording with torques in place of currents with unknown gains."""
    if not recording.has_unknown_gains:
        return recording
    unit = of_gain_one(recording)
    shares = split or (unit.recipe.split if unit.recipe else None)
    seen = before_test(unit, shares)
    gains = current_gains(seen, lib, weighed, friction=friction, preparation=preparation)
    return scaled(recording, gains)


def of_gain_one(recording: Recording) -> Recording:
    """The recording with its currents counted as torques of gain 1."""
    recipe = recording.recipe
    if recipe is None or recipe.torque is None or not recording.has_unknown_gains:
        return recording
    torque = replace(recipe.torque, gain=1.0)
    return recording.replace(recipe=recipe.replace(torque=torque))


def scaled(recording: Recording, gains: CurrentGains) -> Recording:
    """The recording with torques of given gains."""
    if not recording.has_unknown_gains:
        return recording
    tau, k = recording.required("tau"), gains.gain
    R = np.array(recording.recipe.gear if recording.recipe else ())
    coupled = np.count_nonzero(R) > np.count_nonzero(np.diagonal(R)) if R.size else False
    tau = ((tau @ np.linalg.inv(R)) * k) @ R if coupled else tau * k
    listed = ", ".join(f"{each:.4g}" for each in k)
    sentence = f"Multiplied currents by estimated gains ({listed} N·m/A or N/A; {gains.scale})."
    return recording.replace(tau=tau, gains=gains).noted(sentence)


def in_torque(recording: Recording, lib: Library, settings: Settings) -> tuple[Recording, Settings]:
    """Torques in place of motor currents with unknown gains, in all recordings."""
    recording = with_current_gains(
        recording,
        lib,
        preparation=settings.preparation,
        split=settings.split,
    )
    gains = recording.gains
    if gains is None:
        return recording, settings
    validation, test = (
        None if each is None else scaled(each, gains)
        for each in (settings.validation, settings.test)
    )
    return recording, replace(settings, validation=validation, test=test)
