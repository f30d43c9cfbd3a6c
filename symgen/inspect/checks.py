"""Checks of links and joints: physical consistency, plausible density, limits, friction, copies.

A body of mass m and second moments Σ_com about its centre has at least the mean density of the
solid ellipsoid with the same m and Σ_com, ρ = m / (4/3 π 5^{3/2} √det(Σ_com/m)): among all bodies
no denser than ρ, the ellipsoid is the most compact one (rearrangement). The bounds are those of
materials: no solid is denser than osmium.

Two links are mirror images if their masses are equal and their centres of mass satisfy c₂ = S c₁
with S = diag(±1, ±1, ±1). Then I₂ = S I₁ S: signs of products of inertia that no such S explains
are wrong in one of the links.
"""

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from symgen.inspect.geometry import Extent, Group
from symgen.inspect.model import ERROR, POINT, WARNING, Body, Finding, Joint, Model
from symgen.kernel import Array
from symgen.mechanics.inertia import REALISABLE_TOLERANCE

FRAME = 1e-6  # mass up to which a link without inertia is a frame, kg: some tools need one there
OSMIUM = 22590.0  # density of the densest element, kg/m³
FOAM = 20.0  # density of packing foam, kg/m³: mass spread wider than that is not a robot's link
USUAL = (100.0, 12000.0)  # kg/m³ of links with motors and gears, to detect shifted decimal points
DECIMALS = (-1, 1, -2, 2, -3, 3, -4, 4, -5, 5, -6, 6)  # powers of ten of shifted decimal points
STRETCH = 1.2  # factor by which a body may exceed its shapes, since hulls are coarse
TREE_STRETCH = 3.0  # the same where only the distances of a link's joints show its size
FLAT = 1e-6  # smallest over largest spread of a mass below which it is flat: rounding of a file
STUB = 0.1  # smallest length of a link relative to the sum of all (joints of a wrist coincide)
TURNS = 20.0  # largest plausible limit, rad, about three turns: larger ones are usually in degrees


def _ellipsoid_density(body: Body) -> float:
    """ρ of the solid ellipsoid with the body's m and Σ_com, kg/m³; infinite for flat bodies."""
    moments = np.linalg.eigvalsh(body.sigma) / body.mass
    if not moments[0] > 0:
        return float("inf")
    return float(body.mass / (4 / 3 * np.pi * 5**1.5 * np.sqrt(np.prod(moments))))


def consistency_errors(model: Model, name: str) -> list[Finding]:
    """Errors of a link whose mass properties are not physically consistent."""
    body, where = model.links[name].body, f"link '{name}'"

    def error(kind: str, observed: str, expected: str) -> list[Finding]:
        return [Finding(ERROR, kind, where, observed, expected)]

    if body is None or body.is_empty or (0 < body.mass <= FRAME and not body.inertia.any()):
        return _massless(model, name)
    if body.mass < 0:
        return error("mass", f"the mass is {body.mass:g} kg", "expected a positive one")
    if body.mass == 0:
        return error("mass", "it has inertia but no mass", "expected both or neither")
    trace = float(np.trace(body.inertia))
    if abs(trace) <= POINT**2 * body.mass and np.abs(body.inertia).max() <= POINT**2 * body.mass:
        return error(
            "zero-inertia",
            f"{body.mass:g} kg without inertia",
            "expected the inertia of a body of some size",
        )
    if body.is_realisable:
        return []
    j = body.moments
    shown = ", ".join(f"{x:.4g}" for x in j)
    if j[0] < -REALISABLE_TOLERANCE * trace:  # else it is 0 up to rounding
        observed = f"the principal moment {j[0]:.3g} kg m² is negative (all: {shown})"
    else:
        observed = (
            f"the largest principal moment exceeds the sum of the others by {-body.slack:.3g} "
            f"kg m² ({shown})"
        )
    wanted = "expected J3 ≤ J1 + J2, as for every solid"
    return [*error("triangle", observed, wanted), *_causes(body, where)]


def _massless(model: Model, name: str) -> list[Finding]:
    """Check that a moving link or a link beyond it has mass: its joint must have inertia."""
    joint = model.joint_of(name)
    if joint is None or not joint.moves or _mass(model, model.subtree(name, rigid=True)) > 0:
        return []
    where = f"link '{name}'"
    if _mass(model, model.subtree(name)) > 0:
        observed = f"it moves with joint '{joint.name}' and has no mass of its own"
        return [Finding(WARNING, "massless", where, observed, "expected an <inertial>")]
    observed = f"it moves with joint '{joint.name}', and neither it nor any link beyond has mass"
    return [Finding(ERROR, "massless", where, observed, "expected an <inertial>, or a fixed joint")]


def _mass(model: Model, names: list[str]) -> float:
    return float(sum(body.mass for name, body in model.bodies.items() if name in names))


def _causes(body: Body, where: str) -> Iterator[Finding]:
    """Likely causes of an inconsistent body: a sign, a decimal point, a shift with wrong sign."""
    flipped = body.inertia * (2 * np.eye(3) - 1)
    if Body(body.mass, body.com, flipped).is_realisable:
        text = "with the opposite sign of one product of inertia (or of all) it is consistent"
        wanted = "expected Ixy, Ixz, Iyz as integrals −∫xy dm, not mirrored"
        yield Finding(WARNING, "sign", where, text, wanted)
    shift = body.mass * (body.com @ body.com * np.eye(3) - np.outer(body.com, body.com))
    if Body(body.mass, body.com, body.inertia + shift).is_realisable:
        text = (
            "with m|c|² added it is consistent, as if the shift to the centre of mass had been "
            "applied twice"
        )
        wanted = "expected the inertia about the centre of mass"
        yield Finding(WARNING, "wrong-point", where, text, wanted)
    yield from _decimal_entry(body, where)


def _decimal_entry(body: Body, where: str) -> list[Finding]:
    """The entry that makes the tensor consistent if multiplied by 10^±1 or 10^±2, if unique."""
    candidates = []
    entries = [(i, j) for i in range(3) for j in range(i, 3)]
    for (i, j), k in itertools.product(entries, (-1, 1, -2, 2)):
        # |Ixy| ≤ Izz / 2 holds for every body: only products that violate it are candidates.
        if i != j and 2 * abs(body.inertia[i, j]) <= body.inertia[3 - i - j, 3 - i - j]:
            continue
        tensor = body.inertia.copy()
        tensor[i, j] *= 10.0**k
        tensor[j, i] = tensor[i, j]
        repaired = Body(body.mass, body.com, tensor)
        if body.inertia[i, j] and repaired.is_realisable and _ellipsoid_density(repaired) < OSMIUM:
            candidates.append((i, j, k))
    if len({(i, j) for i, j, _ in candidates}) != 1:
        return []
    i, j, k = candidates[0]
    entry = f"i{'xyz'[i]}{'xyz'[j]}"
    observed = (
        f"{entry} = {body.inertia[i, j]:g} is the only entry that makes it consistent when "
        f"multiplied by 10^{k}"
    )
    return [Finding(WARNING, "decimal", where, observed, "expected the decimal point elsewhere")]


def plausibility_warnings(model: Model, group: Group) -> Iterator[Finding]:
    """Warnings about a consistent body: density, size and place that links do not have."""
    body, where, extent = group.body, group.where, group.extent
    yield from _geometry(body, where, extent)
    density = _ellipsoid_density(body)
    # Without shapes: distance from the link origin to its joints and its centre of mass, at most.
    whole = sum(math.hypot(*joint.offset) for joint in model.joints)
    reach = extent.reach(body.com) if extent else max(STUB * whole, group.reach)
    slip = _slipped(body, reach)
    if density > OSMIUM:
        spread = np.sqrt(np.maximum(np.linalg.eigvalsh(body.sigma), 0.0) / body.mass)
        if spread[0] > FLAT * spread[-1]:
            text = (
                f"mass and inertia require a density of at least {density:.3g} kg/m³ (the mass "
                f"spreads only {1e3 * spread[0]:.2g} mm along its thinnest axis)"
            )
        else:
            place = "on a line" if spread[1] <= FLAT * spread[-1] else "in a plane"
            text = f"by its inertia the mass lies {place}, without any thickness"
        wanted = f"expected less than osmium, {OSMIUM:g} kg/m³{slip}"
        yield Finding(WARNING, "dense", where, text, wanted)
    bound = (STRETCH if extent else TREE_STRETCH) * reach
    if bound > 0 and body.size > bound:
        text = f"by its inertia the mass lies {body.size:.3g} m from its centre (root mean square)"
        source = "its shapes" if extent else "the distances of its joints"
        wanted = f"expected at most {bound:.2g} m by {source}{slip}"
        yield Finding(WARNING, "size", where, text, wanted)
    elif density < FOAM:
        text = f"mass and inertia are those of a solid of {density:.3g} kg/m³"
        wanted = f"expected more than packing foam, {FOAM:g} kg/m³{slip}"
        yield Finding(WARNING, "airy", where, text, wanted)
    tensor = body.inertia
    if np.array_equal(tensor, tensor[0, 0] * np.eye(3)) and _is_power_of_ten(tensor[0, 0]):
        text = f"the inertia is {tensor[0, 0]:g} times the identity, a placeholder"
        yield Finding(WARNING, "placeholder", where, text, "expected that of the part")


def _geometry(body: Body, where: str, extent: Extent | None) -> Iterator[Finding]:
    if extent is None:
        return
    density = body.mass / extent.volume
    if not FOAM < density < OSMIUM:
        k = _fitting(lambda power: density * 10.0**power)
        hint = f", such as the mass times 10^{k}" if k is not None else ""
        litres = 1e3 * extent.volume
        text = f"{body.mass:g} kg in a volume of {litres:.3g} l are {density:.3g} kg/m³"
        wanted = f"expected {FOAM:g} to {OSMIUM:g} kg/m³{hint}"
        yield Finding(WARNING, "density", where, text, wanted)
    low, high = extent.points.min(axis=0), extent.points.max(axis=0)
    outside = np.maximum(np.maximum(low - body.com, body.com - high), 0.0)
    if np.linalg.norm(outside) > 0.05 * np.linalg.norm(high - low):
        far = f"{1e3 * np.linalg.norm(outside):.3g} mm"
        text = f"the centre of mass lies {far} outside the box around its shapes"
        yield Finding(WARNING, "outside", where, text, "expected it inside")


def _slipped(body: Body, reach: float) -> str:
    """`, such as the inertia times 10^k`: the power of ten that gives usual density and size."""
    density = _ellipsoid_density(body)

    def fits(k: int) -> float:
        small = body.size * 10.0 ** (k / 2) <= STRETCH * reach
        return density * 10.0 ** (-1.5 * k) if small else 0.0

    k = _fitting(fits)
    return "" if k is None else f", such as the inertia times 10^{k} (a decimal point?)"


def _fitting(density: Callable[[int], float]) -> int | None:
    fits = [k for k in DECIMALS if USUAL[0] < density(k) < USUAL[1]]
    return fits[0] if fits else None


def _is_power_of_ten(value: float) -> bool:
    power = np.log10(value)
    return bool(abs(power - round(power)) < 1e-9)


def shifted_from_origin(body: Body) -> tuple[float, float]:
    """Indicators of an inertia about the link origin instead of the centre of mass."""
    trace = float(np.trace(body.sigma))
    moment: Array = body.mass * np.outer(body.com, body.com)
    smallest = float(np.linalg.eigvalsh(body.sigma - moment)[0])
    return float(np.trace(moment)) / trace, smallest / trace


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


def _strength(joint: Joint, where: str) -> Iterator[Finding]:
    for key, value in (("velocity", joint.velocity), ("effort", joint.effort)):
        if value is not None and value < 0:
            text = f"the {key} limit is {value:g}"
            yield Finding(ERROR, "limits", where, text, "expected a positive one")
        elif not value:
            text = f"the {key} limit is {'missing' if value is None else '0'}"
            yield Finding(WARNING, "limits", where, text, "expected a positive one")


_SAME_MASS = 1e-6
_SAME_COM = 1e-3  # m: mirrored parts differ by a washer
_SAME_INERTIA = 0.02  # of the trace
_PRODUCTS = np.triu_indices(3, 1)
_COUNTS = 0.005  # of the trace for products, of the size for offsets: above it signs count

SHARE = 0.1  # least share of m|c|² in tr Σ for which centre of mass and origin differ enough
EDGE = 1e-3  # |λ_min(Σ − m c cᵀ)| / tr Σ below which Σ is that of a flat body shifted to the origin
ENOUGH = 3  # least number of links that must look shifted before all of a robot are reported


def comparison_warnings(model: Model) -> list[Finding]:
    """Return warnings about links that contradict each other or share one error."""
    bodies = model.bodies.items()
    written = {name: body for name, body in bodies if body.mass > 0 and body.inertia.any()}
    consistent = {name: body for name, body in bodies if body.is_realisable}
    return [*_copies(model, written), *_mirrored(written), *_origin(consistent)]


def _copies(model: Model, bodies: dict[str, Body]) -> Iterator[Finding]:
    groups: dict[bytes, list[str]] = {}
    for name, body in bodies.items():
        groups.setdefault((body.inertia + 0.0).tobytes(), []).append(name)
    for names in groups.values():
        first = names[0]
        others = [name for name in names[1:] if _differ(model, first, name)]
        if others:
            mass = {f"{bodies[name].mass:g}" for name in (first, *others)}
            shapes = "different masses" if len(mass) > 1 else "different shapes"
            listed = ", ".join(f"'{name}'" for name in others)
            text = f"its inertia equals that of {listed} to the last digit, with {shapes}"
            wanted = "expected different inertias for different bodies"
            yield Finding(WARNING, "copied", f"link '{first}'", text, wanted)


def _differ(model: Model, a: str, b: str) -> bool:
    first, second = model.links[a], model.links[b]
    if first.body is None or second.body is None:
        return False
    if first.body.mass != second.body.mass:
        return True
    keys = [sorted(map(repr, {s.key for s in link.shapes})) for link in (first, second)]
    return bool(keys[0] and keys[1] and keys[0] != keys[1])


def _mirrored(bodies: dict[str, Body]) -> Iterator[Finding]:
    for (a, one), (b, two) in itertools.combinations(bodies.items(), 2):
        if not _are_mirror_images(one, two) or _explained(one, two):
            continue
        products = ", ".join(
            f"i{key} {one.inertia[i, j]:.3g} and {two.inertia[i, j]:.3g}"
            for key, i, j in (("xy", 0, 1), ("xz", 0, 2), ("yz", 1, 2))
        )
        text = (
            f"it is a mirror image of link '{a}', but no mirror explains the signs of its "
            f"products of inertia ({products})"
        )
        wanted = "expected signs that follow those of the centre of mass"
        yield Finding(WARNING, "sign", f"link '{b}'", text, wanted)


def _are_mirror_images(one: Body, two: Body) -> bool:
    trace = float(np.trace(np.abs(one.inertia)))
    return bool(
        abs(one.mass - two.mass) <= _SAME_MASS * one.mass
        and np.abs(np.abs(one.com) - np.abs(two.com)).max() <= _SAME_COM
        and np.abs(np.abs(one.inertia) - np.abs(two.inertia)).max() <= _SAME_INERTIA * trace
        and _signs(one.inertia[_PRODUCTS], _COUNTS * trace).any()
    )


def _explained(one: Body, two: Body) -> bool:
    """True if some S gives c₂ = S c₁ and I₂ = S I₁ S, for entries above the tolerance."""
    trace = float(np.trace(np.abs(one.inertia)))
    place = max(2 * _SAME_COM, _COUNTS * one.size)
    a, b = _signs(one.com, place), _signs(two.com, place)
    p, q = (_signs(body.inertia[_PRODUCTS], _COUNTS * trace) for body in (one, two))
    for s in itertools.product((-1, 1), repeat=3):
        signs = np.array(s)
        turned = np.outer(signs, signs)[_PRODUCTS]
        if (a * b * (signs * a * b - 1) == 0).all() and (p * q * (turned * p * q - 1) == 0).all():
            return True
    return False


def _signs(values: Array, least: float) -> Array:
    return np.where(np.abs(values) > least, np.sign(values), 0.0)


def _origin(bodies: dict[str, Body]) -> list[Finding]:
    """Links whose inertia may be about the link origin, since Σ − m c cᵀ ⪰ 0.

    For one link that proves nothing unless Σ − m c cᵀ is singular. If it holds for every link of a
    robot whose centre of mass is far enough from its origin, it is a systematic error.
    """
    shifts = {name: shifted_from_origin(body) for name, body in bodies.items()}
    far = {name: smallest for name, (share, smallest) in shifts.items() if share > SHARE}
    edge = {name for name, smallest in far.items() if abs(smallest) < EDGE}
    moved = [name for name, smallest in far.items() if smallest > -EDGE]
    whole = len(moved) >= ENOUGH and len(moved) >= 0.8 * len(far)
    return [
        Finding(
            WARNING,
            "wrong-point",
            f"link '{name}'",
            "the inertia seems to be about the link origin: with m|c|² "
            f"({shifts[name][0]:.0%} of it) subtracted it is still that of a "
            f"{'consistent body, as for all links' if whole else 'flat body'}",
            "expected it about the centre of mass",
        )
        for name in moved
        if whole or name in edge
    ]
