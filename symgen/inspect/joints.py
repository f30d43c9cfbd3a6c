"""Checks of joints: limits, friction and damping that are missing, contradictory or unphysical."""

import numpy as np

from symgen.inspect.model import ERROR, WARNING, Finding, Joint

TURNS = 20.0
"""Largest plausible limit, rad, about three turns: larger ones are usually in degrees."""


def joint_findings(joint: Joint) -> list[Finding]:
    """Return all faults of one joint."""
    if not joint.moves:
        return []
    where = f"joint '{joint.name}'"
    findings = [
        Finding(ERROR, "dissipation", where, f"the {key} is {value:g}", "expected 0 or more")
        for key, value in (("damping", joint.damping), ("friction", joint.friction))
        if value is not None and value < 0
    ]
    if joint.kind in {"revolute", "continuous", "prismatic"} and not np.any(joint.axis):
        findings.append(Finding(ERROR, "axis", where, "its axis is 0 0 0", "expected a direction"))
    given = joint.lower, joint.upper, joint.velocity, joint.effort
    if joint.has_effort and joint.kind in {"revolute", "prismatic"} and given == (0, 0, 0, 0):
        text = "all limits are 0, which counts as not stated"
        return [*findings, Finding(WARNING, "limits", where, text, "expected lower < upper")]
    if joint.kind in {"revolute", "prismatic"}:
        findings += _range(joint, where)
    if joint.has_effort and joint.kind in {"revolute", "continuous", "prismatic"}:
        findings += _strength(joint, where)
    return findings


def _range(joint: Joint, where: str) -> list[Finding]:
    lower, upper = joint.lower, joint.upper
    if lower is None and upper is None:
        text = "no position limits"
        if joint.has_effort:
            text += ", which URDF parsers read as 0 … 0"
        return [Finding(WARNING, "limits", where, text, "expected lower < upper, or continuous")]
    low, high = lower or 0.0, upper or 0.0  # the value that URDF gives to a missing limit
    if low > high:
        text = f"the lower limit {low:g} lies above the upper limit {high:g}"
        return [Finding(ERROR, "limits", where, text, "expected lower < upper")]
    if low == high:
        text = f"both limits are {low:g}, so it cannot move"
        return [Finding(WARNING, "limits", where, text, "expected lower < upper, or fixed")]
    if joint.kind == "revolute" and max(abs(low), abs(high)) > TURNS:
        text = f"the limits {low:g} … {high:g} rad are many turns"
        return [Finding(WARNING, "limits", where, text, "expected radians; are these degrees?")]
    return []


def _strength(joint: Joint, where: str) -> list[Finding]:
    findings = []
    for key, value in (("velocity", joint.velocity), ("effort", joint.effort)):
        if value is not None and value < 0:
            text = f"the {key} limit is {value:g}"
            findings.append(Finding(ERROR, "limits", where, text, "expected a positive one"))
        elif not value:
            text = f"the {key} limit is {'missing' if value is None else '0'}"
            findings.append(Finding(WARNING, "limits", where, text, "expected a positive one"))
    return findings
