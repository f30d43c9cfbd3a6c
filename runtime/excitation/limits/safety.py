"""What a design keeps beyond position, velocity and acceleration: numbers of `Safety`.

By default all that the manifest of the robot states; a table, a box of the tip and obstacles on
request. A certificate does not check what neither states; an export needs consent for it.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from runtime.errors import ExportError, IdentificationError
from runtime.excitation.limits.carried_body import CarriedBody, Obstacle
from runtime.library import Library

TORQUE, BRAKING, RATE, TIP = "torque", "position-dependent velocity", "torque rate", "tip speed"
SELF_COLLISION, TABLE, CARRIED = "self-collision", "table", "carried body"
SPRINGS = "springs of unknown stiffness"
UNCHECKED = (TORQUE, BRAKING, RATE, TIP, SELF_COLLISION, TABLE, CARRIED, SPRINGS)
"""Kinds of limits that a certificate may leave out."""
EVERYTHING = "all"  # word that accepts all of them
_REMEDIES = {
    TABLE: "--table Z for a table at this height or --table none",
    SELF_COLLISION: "a library with collision proxies (python -m symgen proxies)",
    CARRIED: "a box in --carry",
    SPRINGS: "a library with their stiffness, which identify estimates",
}


@dataclass(frozen=True, slots=True)
class Safety:
    """Limits of a design beyond those of the joints; picklable."""

    torque_fraction: float = 0.95  # share of the effort limit that may be used, 0 < share ≤ 1
    # margin of pairs, table and obstacles, m; by default the margins of the pairs and
    # `TABLE_MARGIN` of `distances`. Pairs that the robot allows closer than its others keep their
    # margin
    clearance: float | None = None
    table: float | None = None  # nothing goes below this height, m in the base frame
    box: tuple[float, ...] | None = None  # xmin, xmax, … zmax of the tip, base frame, m; ±inf: open
    viscous: tuple[float, ...] = ()  # viscous, coulomb: per joint, N·m·s/rad and N·m, or empty
    coulomb: tuple[float, ...] = ()
    carried: CarriedBody | None = None  # body in the hand, part of torques and distances
    obstacles: tuple[Obstacle, ...] = ()  # fixed in the base frame; links keep away from them
    band: tuple[float, ...] = ()  # half-widths of π within which torques keep limits, (10 L,)
    friction_band: float = 0.0  # half-width of viscous and Coulomb friction, as a share of both

    @property
    def models(self) -> str:
        """Models whose torques keep the limits, for certificates; empty for one model."""
        masses = ", ".join(f"{1e3 * mass:.4g} g" for mass in self.band[::10] if mass > 0)
        stated = [f"masses ± {masses}"] if masses else []
        if self.friction_band:
            stated.append(f"friction ± {100 * self.friction_band:g} %")
        return " and ".join(stated)

    def __post_init__(self) -> None:
        require_share(self.torque_fraction, "a torque fraction", "the effort limit unused")
        if self.clearance is not None and not 0 <= self.clearance < np.inf:
            raise IdentificationError(
                f"a clearance from 0 m up is needed, got {self.clearance:g}; 0.02 is usual"
            )
        if self.table is not None and not np.isfinite(self.table):
            raise IdentificationError(
                f"the table needs a finite height in m in the base frame, got {self.table:g}"
            )
        if (box := self.box) is not None:
            if len(box) != 6 or np.isnan(box).any():
                raise IdentificationError(
                    "a box for the tip needs xmin, xmax, ymin, ymax, zmin, zmax in m, got "
                    + ", ".join(f"{x:g}" for x in box)
                )
            for axis, low, high in zip("xyz", box[::2], box[1::2], strict=True):
                if not low < high:
                    raise IdentificationError(
                        f"the box for the tip is empty: {axis} from {low:g} m to {high:g} m; "
                        f"give {axis}min below {axis}max"
                    )
        if not 0 <= self.friction_band < np.inf:
            raise IdentificationError(
                f"a band of friction from 0 up is needed, got {100 * self.friction_band:g} %; 20 % "
                "is usual"
            )
        given = {"viscous friction": self.viscous, "coulomb friction": self.coulomb}
        for name, numbers in (given | {"a band of models": self.band}).items():
            values = np.array(numbers, dtype=float)
            if not (np.isfinite(values) & (values >= 0)).all():
                raise IdentificationError(
                    f"{name} needs finite numbers from 0 up, got {values.tolist()}"
                )


def require_share(share: float, what: str, left: str) -> None:
    """Refuse a number that is no share above 0 and up to 1."""
    if not 0 < share <= 1:
        raise IdentificationError(
            f"{what} above 0 and up to 1 is needed, got {share:g}; 0.95 leaves 5 % of {left}"
        )


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
    of_torque = (limits[key] for key in ("effort", "torque_rate"))
    if lib.manifest.springs and any(np.isfinite(limit).any() for limit in of_torque):
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
            f"the setting unchecked takes {', '.join(sorted(known))} or {EVERYTHING}, got "
            f"'{unknown[0]}'"
        )
    left = [] if EVERYTHING in words else [kind for kind in missing if _word(kind) not in words]
    if left:
        remedies = [_REMEDIES[kind] for kind in left if kind in _REMEDIES]
        if {TORQUE, BRAKING, RATE, TIP} & set(left):
            remedies.insert(0, "--criterion cond in place of --settings document=true")
        consent = " ".join(f"--settings unchecked={_word(kind)}" for kind in left)
        raise ExportError(
            f"nothing is exported for a robot, these limits are not checked: {', '.join(left)}; "
            f"give {', '.join(remedies)}, or accept that with {consent}"
        )


def _word(kind: str) -> str:
    return kind.strip().replace(" ", "-")
