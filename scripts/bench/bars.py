"""Required speed and accuracy of the FR3 kernels on one thread, and whether they are met."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

CPP = "Pinocchio C++"

RATIOS = (
    ("base_inverse_dynamics", "v4", "tiles", 50.0),
    ("base_inverse_dynamics", "v4", "stored", 80.0),
    ("base_regressor", "v4", "tiles", 75.0),
    ("base_inverse_dynamics", "v3", "tiles", 20.0),
    ("base_regressor", "v3", "tiles", 35.0),
    ("base_inverse_dynamics", "portable", "tiles", 5.0),
)
"""Kernel, level, layout, how many times longer Pinocchio in C++ takes at least."""
LONGEST = (("torque_jacobian", "v4", "tiles", 65.0),)
"""Kernel, level, layout, ns per sample at most."""
DEVIATION = 1e-12
"""Relative difference from Pinocchio at most, every kernel at every level."""


class _Against(Protocol):
    @property
    def ratio(self) -> float: ...


class _Row(Protocol):
    """Part of a row that a requirement uses."""

    kernel: str
    level: str
    layout: str
    ns: float
    deviation: float | None
    peers: dict[str, _Against]


@dataclass(frozen=True, slots=True)
class Bar:
    """A requirement, its measured value, and whether it is met."""

    text: str
    measured: float
    met: bool


def bars(rows: Sequence[_Row]) -> tuple[Bar, ...]:
    """All bars whose row and whose peer were measured."""
    by_key = {(row.kernel, row.level, row.layout): row for row in rows}
    result = []
    for *key, least in RATIOS:
        row = by_key.get(tuple(key))
        if row is not None and CPP in row.peers:
            times = row.peers[CPP].ratio
            text = f"{' '.join(key)}: at least {least:.0f} times as fast as {CPP}"
            result.append(Bar(text, times, times >= least))
    for *key, most in LONGEST:
        row = by_key.get(tuple(key))
        if row is not None:
            result.append(Bar(f"{' '.join(key)}: at most {most:.0f} ns", row.ns, row.ns <= most))
    known = [row.deviation for row in rows if row.deviation is not None]
    if known:
        worst = max(known)
        text = f"every kernel and level: within {DEVIATION:.0e} of Pinocchio"
        result.append(Bar(text, worst, worst <= DEVIATION))
    return tuple(result)
