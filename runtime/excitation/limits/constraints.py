"""Constraints of a design that are not linear in its coefficients, from `Safety` and manifest."""

from collections.abc import Iterator

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits import carried_body as carried
from runtime.excitation.limits import distance_limits
from runtime.excitation.limits.dependent_joints import dependent_joints
from runtime.excitation.limits.nonlinear_limits import Braking, Constraint, Side, TimedConstraint
from runtime.excitation.limits.safety import Safety
from runtime.excitation.limits.torque_limits import ModelBand, TorqueLimit, known_torque_of
from runtime.library import Array, Indices, Library
from runtime.library.manifest import torque_units

TABLE_MARGIN = 0.03  # margin between every moving proxy and the table or an obstacle, m
CARRIED_MARGIN = 0.02  # margin between a carried box and links of a robot that states no margins, m
FIT_PROXIES = (
    "fit them with: python -m symgen proxies URDF --out X.toml, and build with --config X.toml"
)
_PROBES = 32  # number of random poses; between them every proxy that can move has moved
AT_LIMIT = 1e-9  # largest g of a robot at rest on a limit: rounding, 1e-10 m of places
_FRICTION = ("viscous", "coulomb")


def constraints(
    lib: Library, home: Array, safety: Safety | None
) -> tuple[Braking | TimedConstraint, ...]:
    """Limits that are not linear in the coefficients."""
    chosen: list[Braking | TimedConstraint] = [*dependent_joints(lib, home)]
    if safety is None:
        return tuple(chosen)
    if (facts := lib.braking) is not None:
        ends = (1.0, facts.upper), (-1.0, facts.lower)
        sides = tuple(Side(sign, facts.k, facts.c, end) for sign, end in ends)
        chosen.append(Braking(sides, home, lib.joint_names))
    return (*chosen, *_torques(lib, safety), *_tip(lib, safety), *distances(lib, safety))


def _torques(lib: Library, safety: Safety) -> Iterator[TimedConstraint]:
    limits, n = lib.limits(), lib.n_joints
    viscous, coulomb = (_per_joint(lib, name, getattr(safety, name)) for name in _FRICTION)
    coulomb = (1 + safety.friction_band) * coulomb
    pi, band = carried.with_load(lib.pi0, safety.carried), _band(lib, safety, viscous)
    rest = viscous, lib.joint_names, band, known_torque_of(lib)
    if np.isfinite(limits["effort"]).any():
        limit = safety.torque_fraction * limits["effort"] - coulomb
        if not (limit > 0).all():
            j = int(np.argmin(limit))
            unit = torque_units(lib.manifest)[j]
            raise IdentificationError(
                f"Coulomb friction of {coulomb[j]:g} {unit} exceeds the torque of "
                f"'{lib.joint_names[j]}', {100 * safety.torque_fraction:g} % of "
                f"{limits['effort'][j]:g} {unit}; lower the friction or raise the share"
            )
        yield TorqueLimit(0, lib, pi, limit, *rest)
    if np.isfinite(limits["torque_rate"]).any():
        yield TorqueLimit(1, lib, pi, np.broadcast_to(limits["torque_rate"], (n,)), *rest)


def _band(lib: Library, safety: Safety, viscous: Array) -> ModelBand | None:
    if not (safety.band or safety.friction_band):
        return None
    pi = np.array(safety.band or np.zeros(len(lib.pi0)))
    if pi.shape != lib.pi0.shape:
        raise IdentificationError(
            f"a band of models of '{lib.name}' needs {len(lib.pi0)} half-widths, got {len(pi)}"
        )
    return ModelBand(lib, pi, safety.friction_band * viscous)


def _per_joint(lib: Library, name: str, values: tuple[float, ...]) -> Array:
    if len(values) not in {0, 1, lib.n_joints}:
        raise IdentificationError(
            f"{name} friction needs one number or one per joint, {lib.n_joints}, got {len(values)}"
        )
    return np.broadcast_to(np.array(values or (0.0,), dtype=float), (lib.n_joints,)).copy()


def _tip(lib: Library, safety: Safety) -> Iterator[TimedConstraint]:
    if safety.box is not None:
        ends = np.array(safety.box, dtype=float)
        yield distance_limits.TipBox(lib, ends[::2], ends[1::2])
    speed = float(lib.limits()["tip_speed"])
    if np.isfinite(speed):
        yield distance_limits.TipSpeed(lib, speed)


def require_rest(limits: tuple[Constraint, ...], home: Array) -> None:
    """Check that the robot may rest at home."""
    rest = np.zeros((4, 1, len(home)))
    rest[0] = home
    for constraint in limits:
        g = constraint.values(rest)[0]
        worst = int(np.argmax(g))  # the first NaN, where there is one
        if g[worst] < 0:
            continue
        if isinstance(constraint, Braking):
            side, joint = constraint.sides[worst // len(home)], worst % len(home)
            raise IdentificationError(
                f"at the home position {home[joint]:.4g} of '{constraint.labels[worst]}' its "
                f"velocity limit, which ends at {side.end[joint]:.4g}, leaves no speed; choose "
                "another home"
            )
        value, limit, unit = constraint.measured(worst, float(g[worst]))
        if g[worst] <= AT_LIMIT:
            raise IdentificationError(
                f"at rest at home the {constraint.kind} limit of {constraint.labels[worst]}, "
                f"{limit:.4g} {unit}, is already reached and leaves no room for a motion; choose "
                "another home or limit"
            )
        raise IdentificationError(
            f"at rest at home the {constraint.kind} limit of {constraint.labels[worst]} is already "
            f"broken: {value:.4g} {unit} where {limit:.4g} {unit} is allowed, "
            f"{abs(value - limit):.3g} {unit} too far; choose another home or limit"
        )


def distances(lib: Library, safety: Safety) -> tuple[TimedConstraint, ...]:
    """Constraints on distances."""
    if safety.clearance is not None and not lib.pairs:
        raise _no_proxies(lib, "a clearance between its links")
    if safety.table is not None and not lib.moving_proxies:
        raise _no_proxies(lib, "a table")
    chosen: list[TimedConstraint] = []
    if lib.pairs:
        names = tuple(f"{pair.first} and {pair.second}" for pair in lib.pairs)
        chosen.append(distance_limits.LinkClearance(lib, _margins(lib, safety.clearance), names))
    if safety.table is not None:
        margin = TABLE_MARGIN if safety.clearance is None else safety.clearance
        rows = _lifted(lib)
        proxies = tuple(lib.moving_proxies[row] for row in rows)
        chosen.append(distance_limits.TableClearance(lib, safety.table, margin, proxies, rows))
    return (*chosen, *_obstacle_distances(lib, safety), *_carried_distances(lib, safety))


def _obstacle_distances(lib: Library, safety: Safety) -> tuple[TimedConstraint, ...]:
    """Distances of the moving capsules and of the carried box from obstacles."""
    if not safety.obstacles:
        return ()
    proxies = [proxy for proxy in lib.proxies if proxy.joint >= 0]
    if not proxies:
        raise _no_proxies(lib, "the distance from obstacles")
    body = safety.carried
    if body is not None and body.box is not None:
        proxies.append(carried.capsule_around(body.box.placed(body.link)))
    margin = TABLE_MARGIN if safety.clearance is None else safety.clearance
    labels = (f"{p.name} and {each.name}" for each in safety.obstacles for p in proxies)
    boxes = tuple(each.placed for each in safety.obstacles)
    return (
        carried.BoxClearance(carried.OBSTACLE, tuple(labels), lib, margin, boxes, tuple(proxies)),
    )


def _carried_distances(lib: Library, safety: Safety) -> Iterator[TimedConstraint]:
    """Distances of the carried box from links that it is not fixed to, and from the table."""
    body = safety.carried
    if body is None or body.box is None:
        return
    box = body.box.placed(body.link)
    others = tuple(proxy for proxy in lib.proxies if proxy.joint != body.link)
    if others:
        stated = max((pair.margin for pair in lib.pairs), default=CARRIED_MARGIN)
        margin = stated if safety.clearance is None else safety.clearance
        labels = tuple(f"{carried.LABEL} and {proxy.name}" for proxy in others)
        yield carried.BoxClearance("self-collision", labels, lib, margin, (box,), others)
    if safety.table is not None:
        margin = TABLE_MARGIN if safety.clearance is None else safety.clearance
        yield carried.CarriedHeight(lib, margin, box, safety.table)


def _margins(lib: Library, clearance: float | None) -> Array:
    """Margin of every pair, (R,) m; pairs that are allowed closer than the others stay so."""
    stated = np.array([pair.margin for pair in lib.pairs])
    if clearance is None:
        return stated
    return np.where(stated < stated.max(), np.minimum(stated, clearance), clearance)


def _lifted(lib: Library) -> Indices:
    """Indices of proxies whose height depends on some joint; the height of the others is fixed."""
    q = np.random.default_rng(0).uniform(-1, 1, (_PROBES, lib.n_joints))
    heights = lib.plane_clearance(q, np.array([0.0, 0.0, 1.0, 0.0]))[0]
    # A pose is known to rounding, 1e-15 of a metre.
    return np.flatnonzero(np.ptp(heights, axis=0) > 1e-9)


def _no_proxies(lib: Library, what: str) -> IdentificationError:
    return IdentificationError(
        f"'{lib.name}' has no collision proxies, so {what} cannot be checked; {FIT_PROXIES}"
    )
