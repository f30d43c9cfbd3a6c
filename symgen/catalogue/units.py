"""Units of joint quantities of a chain with revolute and prismatic joints."""

from symgen.chain import Chain

STATE = ("q", "dq", "ddq", "dddq", "ddddq")
"""Positions and their time derivatives."""


def state_unit(chain: Chain, power: int) -> str:
    """Unit of a time derivative of q of all joints."""
    kinds = {"m" if slides else "rad" for slides in _slides(chain)}
    return "|".join(sorted(kinds)) + ("", "/s", "/s^2", "/s^3", "/s^4")[power]


def effort_unit(chain: Chain) -> str:
    """Unit of τ of all joints: "N*m", "N" or both."""
    return "|".join({True: "N", False: "N*m"}[s] for s in _slides(chain))


def inertia_unit(chain: Chain) -> str:
    """Unit of the inertia of the rotors of all joints: "kg*m^2", "kg" or both."""
    return "|".join({True: "kg", False: "kg*m^2"}[s] for s in _slides(chain))


def _slides(chain: Chain) -> list[bool]:
    if chain.floating:  # slides and turns
        return [False, True]
    return sorted({j.kind == "prismatic" for j in chain.coordinates})
