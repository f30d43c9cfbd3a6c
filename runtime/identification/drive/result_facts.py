"""Facts of result.json on the origin of the torque: source, control law, delay and drives."""

from typing import Any

from runtime.identification.identified import Identification
from runtime.recording.recipes.control_law import NUMBERS


def torque_facts(result: Identification) -> dict[str, Any]:
    """Keys of result.json on the torque: source, control law, gains, delay and drives."""
    drive, joints = result.drive, result.lib.joint_names
    columns = result.friction.columns
    return {
        "torque_source": result.train.torque_source,
        "control_law": _law_facts(result),
        "current_gains": None if result.train.gains is None else result.train.gains.facts(),
        "delay_s": None if drive is None else drive.delay_facts(),
        "symmetric": [each.facts() for each in result.symmetric] or None,
        "drive": None if drive is None else drive.facts(joints, result.phi, columns),
    }


def _law_facts(result: Identification) -> dict[str, Any] | None:
    """Numbers of the control law; a gain that varies over the log has none."""
    law = result.train.law
    if law is None:
        return None
    numbers = {key: getattr(law, key) for key in NUMBERS}
    known = {key: None if isinstance(each, str) else each for key, each in numbers.items()}
    return {"law": law.law} | {
        key: list(each) if isinstance(each, tuple) else each for key, each in known.items()
    }
