"""Units of whatever all joints have together, turning or sliding."""

from symgen.chain import Chain

STATE = ("q", "dq", "ddq", "dddq", "ddddq")
"""Positions and their time derivatives."""


def state_unit(chain: Chain, power: int) -> str:
    """Unit of q (0) and its time derivatives dq (1), …, ddddq (4) of all joints."""
    kinds = {"m" if j.kind == "prismatic" else "rad" for j in chain.joints}
    return "|".join(sorted(kinds)) + ("", "/s", "/s^2", "/s^3", "/s^4")[power]


def effort_unit(chain: Chain) -> str:
    """Unit of τ of all joints."""
    return "|".join({True: "N", False: "N*m"}[s] for s in _slides(chain))


def inertia_unit(chain: Chain) -> str:
    """Unit of a rotor's inertia of all joints."""
    return "|".join({True: "kg", False: "kg*m^2"}[s] for s in _slides(chain))


def _slides(chain: Chain) -> list[bool]:
    return sorted({j.kind == "prismatic" for j in chain.joints})
