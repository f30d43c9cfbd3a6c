"""Checks that compare links: copied inertias, mirror images, inertias about the wrong point.

Two links are mirror images if their masses are equal and their centres of mass satisfy c₂ = S c₁
with S = diag(±1, ±1, ±1). Then I₂ = S I₁ S: signs of products of inertia that no such S explains
are wrong in one of the links.
"""

import itertools

import numpy as np

from symgen.inspect.checks import shifted_from_origin
from symgen.inspect.model import WARNING, Array, Body, Finding, Model

_SAME_MASS = 1e-6
_SAME_COM = 1e-3  # m: mirrored parts differ by a washer
_SAME_INERTIA = 0.02  # of the trace
_PRODUCTS = np.triu_indices(3, 1)
_COUNTS = 0.005  # of the trace for products, of the size for offsets: above it signs count

SHARE = 0.1
"""Least share of m|c|² in tr Σ for which the centre of mass and the link origin differ enough."""
EDGE = 1e-3
"""|λ_min(Σ − m c cᵀ)| / tr Σ below which Σ is that of a flat body shifted to the origin."""
ENOUGH = 3
"""Least number of links that must look shifted before all of a robot are reported."""


def comparison_warnings(model: Model) -> list[Finding]:
    """Return warnings about links that contradict each other or share one error."""
    bodies = {
        name: link.body
        for name, link in model.links.items()
        if link.body is not None and link.body.is_realisable
    }
    written = {
        name: link.body
        for name, link in model.links.items()
        if link.body is not None and link.body.mass > 0 and link.body.inertia.any()
    }
    return [*_copies(model, written), *_mirrored(written), *_origin(bodies)]


def _copies(model: Model, bodies: dict[str, Body]) -> list[Finding]:
    groups: dict[bytes, list[str]] = {}
    for name, body in bodies.items():
        groups.setdefault((body.inertia + 0.0).tobytes(), []).append(name)
    findings = []
    for names in groups.values():
        first = names[0]
        others = [name for name in names[1:] if _differ(model, first, name)]
        if others:
            mass = {f"{bodies[name].mass:g}" for name in (first, *others)}
            shapes = "different masses" if len(mass) > 1 else "different shapes"
            listed = ", ".join(f"'{name}'" for name in others)
            text = f"its inertia equals that of {listed} to the last digit, with {shapes}"
            wanted = "expected different inertias for different bodies"
            findings.append(Finding(WARNING, "copied", f"link '{first}'", text, wanted))
    return findings


def _differ(model: Model, a: str, b: str) -> bool:
    first, second = model.links[a], model.links[b]
    if first.body is None or second.body is None:
        return False
    if first.body.mass != second.body.mass:
        return True
    keys = [sorted(map(repr, {s.key for s in link.shapes})) for link in (first, second)]
    return bool(keys[0] and keys[1] and keys[0] != keys[1])


def _mirrored(bodies: dict[str, Body]) -> list[Finding]:
    findings = []
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
        findings.append(Finding(WARNING, "sign", f"link '{b}'", text, wanted))
    return findings


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
