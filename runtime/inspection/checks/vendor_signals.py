"""Kind of torque signal of a known maker, by the name of its column.

Makers publish currents, model torques, compensated torques and sensor torques under names that
do not say so. A record per name states what it is and what to write. Sources: RTDE guide and
Universal_Robots_ROS2_Driver #1551, libfranka `RobotState`, kortex `ActuatorFeedback` and
kinova-ros #366, xarm_ros2 #98, piper_sdk #73 and its Q&A.
"""

import re
from dataclasses import dataclass, replace

from runtime.inspection.finding import ERROR, INFO, WARNING, Checked, Finding
from runtime.library import Library
from runtime.recording import Recipe

CURRENT, MEASURED, COMPENSATED, MODEL = "current", "measured", "compensated", "model"
"""A motor current; the whole torque of a joint; a torque without gravity (and friction); the output
of the controller's model."""
_LEVELS = {CURRENT: WARNING, MEASURED: INFO, COMPENSATED: ERROR, MODEL: WARNING}


@dataclass(frozen=True, slots=True)
class VendorSignal:
    """One column name of one maker."""

    vendor: str  # maker and interface
    title: str  # name of the column without index, lower case
    meaning: str  # one of `CURRENT`, `MEASURED`, `COMPENSATED`, `MODEL`
    sentence: str  # what it is and what to do
    robots: str = ""  # pattern of names of robot and joints, where the title alone is not specific


_UR = r"(?<![a-z])ur(3|5|7|8|10|12|15|16|18|20|30)e?(?![a-z0-9])|shoulder_lift_joint.*wrist_3_joint"
_UNKNOWN_GAIN = "read it in A without gain: identify estimates gains, symgen gains fixes them"
_LISTED: dict[tuple[str, str], dict[str, tuple[str, str]]] = {
    ("UR RTDE", ""): {
        "actual_current": (CURRENT, f"motor current in A; {_UNKNOWN_GAIN}"),
        "joint_control_output": (CURRENT, f"control current in A; {_UNKNOWN_GAIN}"),
        "actual_current_as_torque": (
            COMPENSATED,
            "torque that the controller computes from currents (PolyScope 5.23/10.11 and later), "
            "without gravity: 0 at rest without load; log actual_current instead",
        ),
        "target_moment": (
            MODEL,
            "torque of the controller's model, not a measurement; log actual_current",
        ),
        "target_current": (
            MODEL,
            "current of the controller's model, not a measurement; log actual_current",
        ),
    },
    ("UR ROS driver", _UR): {
        "effort": (
            CURRENT,
            "motor current in A up to PolyScope 5.22/10.10 and with use_currents_as_efforts = "
            "true; from 5.23/10.11 it may be a torque in N·m without gravity, which identifies no "
            f"masses: check the driver's parameter. For currents, {_UNKNOWN_GAIN}",
        )
    },
    ("Franka", ""): {
        "tau_j": (MEASURED, "torque of the sensors behind the gears in N·m, with gravity"),
        "tau_j_d": (MODEL, "commanded torque without the gravity that the robot adds; log tau_J"),
        "tau_ext_hat_filtered": (
            COMPENSATED,
            "estimate of the external torque: the model of the maker is subtracted; log tau_J",
        ),
        "dtau_j": (MODEL, "derivative of the torque in N·m/s, not a torque; log tau_J"),
    },
    ("Kinova", ""): {
        "current_motor": (
            CURRENT,
            "motor current in A; the Gen3 has torque sensors (torque), the Gen3 lite has none: "
            f"{_UNKNOWN_GAIN}",
        ),
        "joint_torques_gravity_free": (
            COMPENSATED,
            "torque without the controller's gravity; log joint_torques",
        ),
    },
    ("Kinova", r"kinova|gen3|kortex|jaco|\bj2[ns]"): {
        "torque": (
            MEASURED,
            "torque of the actuators' sensors in N·m, with offsets of its own: set the zero in the "
            "web application or identify the column offset",
        ),
        "effort": (
            MEASURED,
            "torque of the actuators' sensors in N·m on the Gen3; the Gen3 lite has no sensors, "
            "and its values are scaled motor currents with unknown gains: there "
            f"{_UNKNOWN_GAIN}",
        ),
    },
    ("xArm", r"xarm|lite6|uf850"): {
        "effort": (
            CURRENT,
            "torque that the controller estimates from motor currents, as the arm has no torque "
            f"sensors; its gains are unknown: {_UNKNOWN_GAIN}",
        )
    },
    ("Piper", r"piper"): {
        "effort": (
            CURRENT,
            "motor current times a constant (1.18125 for joints 1-3, 0.95844 for 4-6), in mN·m in "
            "the SDK; firmware and documentation differ by a factor of 4 at joints 1-3, so that "
            f"the gains are unknown: {_UNKNOWN_GAIN}",
        ),
        "current": (CURRENT, f"motor current in mA; {_UNKNOWN_GAIN}"),
    },
    ("PAL TIAGo", r"tiago"): {
        "effort": (CURRENT, f"raw motor current, although the message states N·m; {_UNKNOWN_GAIN}")
    },
}
"""Maker and pattern of the robot → title of the column → its meaning, and what to do."""
SIGNALS = tuple(
    VendorSignal(vendor, title, *known, robots)
    for (vendor, robots), listed in _LISTED.items()
    for title, known in listed.items()
)


def vendor_signal(plan: Recipe, lib: Library) -> VendorSignal | None:
    """The record of the torque column."""
    if plan.torque is None:
        return None
    signal = plan.torque
    title = plain_title(str(signal.columns[0]) if signal.columns else signal.key or signal.file)
    robot = " ".join([lib.name, plan.robot, *lib.joint_names]).lower()
    known = [
        each
        for each in sorted(SIGNALS, key=lambda each: -len(each.title))
        if f"_{title}".endswith(f"_{each.title}") and re.search(each.robots, robot)
    ]
    return known[0] if known else None


def plain_title(title: str) -> str:
    """Title in lower case without prefix, unit, suffix and index."""
    bare = re.sub(r"\s*[\[(][^\])]*[\])]", "", title.strip())
    bare = re.split(r"[/.\s]", re.sub(r"\.(csv|txt|npz|npy|gz|mat)$", "", bare))[-1]
    return re.sub(r"[_\-]*\d*$", "", bare).lower()


def vendor_torque(plan: Recipe, lib: Library, is_drafted: bool) -> Checked:
    """Meaning of the torque column of a known maker."""
    known = vendor_signal(plan, lib)
    if known is None or plan.torque is None:
        return plan, []
    in_torque = plan.torque_source != CURRENT
    level = _LEVELS[known.meaning]
    if known.meaning == CURRENT:
        level = INFO if not in_torque and not is_drafted else WARNING
        if is_drafted:
            unit = "mA" if plan.torque.unit == "mA" else "A"
            plan = plan.replace(torque=replace(plan.torque, unit=unit, gain=None))
    evidence = {"vendor": known.vendor, "signal": known.title, "meaning": known.meaning}
    sentence = f"{known.vendor}: '{known.title}' is {known.sentence}"
    return plan, [Finding("vendor_signal", level, sentence, evidence)]
