"""Limits that a certificate does not check, and the consent that an export needs for them."""

from collections.abc import Collection

import numpy as np

from runtime.errors import ExportError
from runtime.excitation.limits.safety import Safety
from runtime.library import Library

TORQUE, BRAKING, RATE, TIP = "torque", "position-dependent velocity", "torque rate", "tip speed"
SELF_COLLISION, TABLE, CARRIED = "self-collision", "table", "carried body"
SPRINGS = "springs of unknown stiffness"
UNCHECKED = (TORQUE, BRAKING, RATE, TIP, SELF_COLLISION, TABLE, CARRIED, SPRINGS)
"""Kinds of limits that a certificate may leave out."""
EVERYTHING = "all"
"""Word that accepts all of them."""
_REMEDIES = {
    TABLE: "--table Z for a table at this height or --table none",
    SELF_COLLISION: "a library with collision proxies (python -m symgen proxies)",
    CARRIED: "a box in --carry",
    SPRINGS: "a library with their stiffness, which identify estimates",
}


def unchecked(lib: Library, safety: Safety | None) -> tuple[str, ...]:
    """Kinds of limits that are not checked although they exist."""
    limits = lib.limits()
    if safety is None:
        stated = {
            BRAKING: lib.braking is not None,
            RATE: bool(np.isfinite(limits["torque_rate"]).any()),
            TIP: bool(np.isfinite(limits["tip_speed"])),
        }
        known = (kind for kind, is_stated in stated.items() if is_stated)
        return (TORQUE, *known, SELF_COLLISION, TABLE)
    missing: list[str] = []
    if not lib.pairs:
        missing.append(SELF_COLLISION)
    if safety.table is None:
        missing.append(TABLE)
    if safety.carried is not None and safety.carried.box is None:
        missing.append(CARRIED)
    if lib.manifest.springs and any(
        np.isfinite(limits[key]).any() for key in ("effort", "torque_rate")
    ):
        missing.append(SPRINGS)
    return tuple(missing)


def unstated(lib: Library) -> tuple[str, ...]:
    """Limits beyond those of the joints' motion that the robot does not state."""
    limits, names = lib.limits(), np.array(lib.joint_names)
    missing = []
    for key, what in (("effort", TORQUE), ("torque_rate", RATE)):
        free = ~np.isfinite(limits[key])
        if free.any():
            missing.append(f"{what} of {', '.join(names[free])}")
    if lib.braking is None:
        missing.append(BRAKING)
    if not np.isfinite(limits["tip_speed"]):
        missing.append(TIP)
    return tuple(missing)


def require_consent(missing: Collection[str], accepted: Collection[str]) -> None:
    """Check that every limit which is not checked was accepted as such."""
    known = {_word(kind) for kind in UNCHECKED}
    words = {_word(kind) for kind in accepted}
    if unknown := sorted(words - known - {EVERYTHING}):
        raise ExportError(
            f"--unchecked takes {', '.join(sorted(known))} or {EVERYTHING}, got '{unknown[0]}'"
        )
    left = [] if EVERYTHING in words else [kind for kind in missing if _word(kind) not in words]
    if left:
        remedies = [_REMEDIES[kind] for kind in left if kind in _REMEDIES]
        if {TORQUE, BRAKING, RATE, TIP} & set(left):
            remedies.insert(0, "--criterion cond in place of --document")
        consent = " ".join(f"--unchecked {_word(kind)}" for kind in left)
        raise ExportError(
            f"nothing is exported for a robot, these limits are not checked: {', '.join(left)}; "
            f"give {', '.join(remedies)}, or accept that with {consent}"
        )


def _word(kind: str) -> str:
    return kind.strip().replace(" ", "-")
