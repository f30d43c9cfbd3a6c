"""Distances that a design keeps: between links, to a table, to obstacles, of a carried box."""

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.excitation.limits.carried_limits import CarriedClearance, CarriedHeight
from runtime.excitation.limits.distance_limits import LinkClearance, TableClearance
from runtime.excitation.limits.nonlinear_limits import TimedConstraint
from runtime.excitation.limits.obstacles import ObstacleClearance, capsule_around
from runtime.excitation.limits.safety import Safety
from runtime.library import Array, Library

TABLE_MARGIN = 0.03
"""Margin between every moving proxy and the table or an obstacle, m."""
CARRIED_MARGIN = 0.02
"""Margin between a carried box and the links of a robot that states no margins, m."""
FIT_PROXIES = (
    "fit them with: python -m symgen proxies URDF --out X.toml, and build with --config X.toml"
)
_PROBES = 32
"""Number of random poses; between them every proxy that can move has moved."""


def distances(lib: Library, safety: Safety) -> tuple[TimedConstraint, ...]:
    """Constraints on distances."""
    if safety.clearance is not None and not lib.pairs:
        raise _no_proxies(lib, "a clearance between its links")
    if safety.table is not None and not lib.moving_proxies:
        raise _no_proxies(lib, "a table")
    chosen: list[TimedConstraint] = []
    if lib.pairs:
        names = tuple(f"{pair.first} and {pair.second}" for pair in lib.pairs)
        chosen.append(LinkClearance(lib, _margins(lib, safety.clearance), names))
    if safety.table is not None:
        margin = TABLE_MARGIN if safety.clearance is None else safety.clearance
        rows = _lifted(lib)
        proxies = tuple(lib.moving_proxies[row] for row in rows)
        chosen.append(TableClearance(lib, safety.table, margin, proxies, rows))
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
        proxies.append(capsule_around(body.box, body.link))
    margin = TABLE_MARGIN if safety.clearance is None else safety.clearance
    return (ObstacleClearance(lib, margin, safety.obstacles, tuple(proxies)),)


def _carried_distances(lib: Library, safety: Safety) -> tuple[TimedConstraint, ...]:
    """Distances of the carried box from links that it is not fixed to, and from the table."""
    body = safety.carried
    if body is None or body.box is None:
        return ()
    chosen: list[TimedConstraint] = []
    others = tuple(proxy for proxy in lib.proxies if proxy.joint != body.link)
    if others:
        stated = max((pair.margin for pair in lib.pairs), default=CARRIED_MARGIN)
        margin = stated if safety.clearance is None else safety.clearance
        chosen.append(CarriedClearance(lib, margin, body.link, body.box, others))
    if safety.table is not None:
        margin = TABLE_MARGIN if safety.clearance is None else safety.clearance
        chosen.append(CarriedHeight(lib, margin, body.link, body.box, safety.table))
    return tuple(chosen)


def _margins(lib: Library, clearance: float | None) -> Array:
    """Margin of every pair, (R,) m; pairs that are allowed closer than the others stay so."""
    stated = np.array([pair.margin for pair in lib.pairs])
    if clearance is None:
        return stated
    return np.where(stated < stated.max(), np.minimum(stated, clearance), clearance)


def _lifted(lib: Library) -> NDArray[np.intp]:
    """Indices of proxies whose height depends on some joint; the height of the others is fixed."""
    q = np.random.default_rng(0).uniform(-1, 1, (_PROBES, lib.n_joints))
    heights = lib.plane_clearance(q, np.array([0.0, 0.0, 1.0, 0.0]))[0]
    # A pose is known to rounding, 1e-15 of a metre.
    return np.flatnonzero(np.ptp(heights, axis=0) > 1e-9)


def _no_proxies(lib: Library, what: str) -> IdentificationError:
    return IdentificationError(
        f"'{lib.name}' has no collision proxies, so {what} cannot be checked; {FIT_PROXIES}"
    )
