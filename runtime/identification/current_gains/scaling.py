"""Torque of motor currents whose recipe states no gain: estimated gains times currents."""

from collections.abc import Sequence
from dataclasses import replace

from runtime.identification.current_gains.one_log import Weighed, current_gains
from runtime.identification.settings import Settings
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.preprocessing import before_test
from runtime.recording.unit_conversion import scaled


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
