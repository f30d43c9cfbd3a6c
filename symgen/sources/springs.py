"""Springs that a robot file states, as springs of known stiffness.

    MJCF   <joint stiffness springref>, <tendon> with stiffness along joints or between two sites
    SDF    <dynamics> with <spring_stiffness> and <spring_reference>

A [[spring]] of the same joints in a mechanism file takes the place of that of the robot file; of
springs between sites, one of the same name.
"""

from dataclasses import replace
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from symgen.chain import ChainOptions, moving_joints
from symgen.chain.document import numbers
from symgen.chain.mechanism import Mechanism, Spring
from symgen.chain.normalise import Note
from symgen.errors import BuildError
from symgen.sources.compiled_mjcf import Bodies

_SAME = 1e-12  # largest difference of both ends of a tendon's length without force, m or rad


def springs_of_mjcf(bodies: Bodies) -> tuple[Spring, ...]:
    """Springs of joints and tendons."""
    model, springs = bodies.model, []
    for k in range(model.njnt):
        if int(model.jnt_bodyid[k]) not in bodies.shifts:  # of an object that is left out
            continue
        name = bodies.joint(k)
        _require_linear(model, "jnt", k, f"joint '{name}'")
        if stiffness := _stiffness(model.jnt_stiffness[k], f"joint '{name}'"):
            rest = float(model.qpos_spring[model.jnt_qposadr[k]])
            springs.append(Spring(_word(name), {name: 1.0}, rest=rest, stiffness=stiffness))
    for k in range(model.ntendon):
        name = bodies.tendon(k)
        _require_linear(model, "tendon", k, f"tendon '{name}'")
        if stiffness := _stiffness(model.tendon_stiffness[k], f"tendon '{name}'"):
            springs.append(_of_tendon(bodies, k, stiffness))
    return tuple(springs)


def spring_of_sdf(joint: Element) -> tuple[Spring, ...]:
    """Spring of a joint of SDF; none without stiffness."""
    name, axis = joint.get("name", ""), joint.find("axis")
    if axis is None:
        return ()
    stiffness, rest = (
        float(numbers(axis.findtext(f"dynamics/{key}", "0"), 1, f"joint '{name}': {key}")[0])
        for key in ("spring_stiffness", "spring_reference")
    )
    if not _stiffness(stiffness, f"joint '{name}'"):
        return ()
    return (Spring(_word(name), {name: 1.0}, rest=rest, stiffness=stiffness),)


def merged(of_file: tuple[Spring, ...], stated: tuple[Spring, ...]) -> tuple[Spring, ...]:
    """Springs of a mechanism file, and those of the robot file that these do not replace."""
    between, joints = {s.name for s in stated if not s.of}, [s.of.keys() for s in stated if s.of]
    springs, names = list(stated), {s.name for s in stated}
    for spring in of_file:
        if spring.of.keys() in joints or (not spring.of and spring.name in between):
            continue
        name, number = spring.name, 2
        while name in names:  # joints and tendons have names of their own in a robot file
            name, number = f"{spring.name}_{number}", number + 1
        names.add(name)
        springs.append(spring.replace(name=name))
    return tuple(springs)


def with_springs_of_file(
    text: str, options: ChainOptions, mechanism: Mechanism, note: Note
) -> ChainOptions:
    """Options with the mechanism of a robot file and those of its springs that a build takes.

    A free base takes no springs. A spring along locked joints alone, or along one that is cut off,
    does not act on the others. Locked joints of another one move its rest: Σ of[m] x_m − rest.
    The springs of `options` are stated beside the file, `mechanism` has both.
    """
    stated = tuple(s for s in mechanism.spring if s in options.mechanism.spring)
    of_file = tuple(s for s in mechanism.spring if s not in stated)
    options = replace(options, mechanism=mechanism)
    joints = set(moving_joints(text, options)) if of_file and not options.floating else None
    kept, left = [], []
    for spring in of_file:
        locked = set() if joints is None else spring.of.keys() - joints
        is_idle = locked == spring.of.keys() or not locked <= options.locks.keys()
        if joints is None or (spring.of and is_idle):
            left.append(spring.name)
            continue
        moved = sum(spring.of[name] * options.locks[name] for name in sorted(locked))
        of = {name: factor for name, factor in spring.of.items() if name in joints}
        kept.append(spring.replace(of=of, rest=spring.rest - moved))
    known = [
        f"{s.name} ({s.stiffness:g}, rest {s.rest:g})" for s in kept if s.stiffness is not None
    ]
    if known:
        note(f"springs of the file, whose torque counts as known: {', '.join(known)}")
    if left:
        note(f"springs of the file that are left out: {', '.join(left)}")
    return replace(options, mechanism=mechanism.replace(spring=(*stated, *kept)))


def factors_of_tendon(bodies: Bodies, k: int) -> dict[str, float] | None:
    """Joint → factor of the length of a tendon along joints; None for another tendon."""
    model, factors = bodies.model, dict[str, float]()
    for part in range(model.tendon_adr[k], model.tendon_adr[k] + model.tendon_num[k]):
        if int(model.wrap_type[part]) != int(bodies.mujoco.mjtWrap.mjWRAP_JOINT):
            return None
        key = bodies.joint(int(model.wrap_objid[part]))
        factors[key] = factors.get(key, 0.0) + float(model.wrap_prm[part])
    return factors


def _of_tendon(bodies: Bodies, k: int, stiffness: float) -> Spring:
    model, name = bodies.model, bodies.tendon(k)
    parts = range(model.tendon_adr[k], model.tendon_adr[k] + model.tendon_num[k])
    kinds = {int(model.wrap_type[p]) for p in parts}
    low, high = (float(x) for x in model.tendon_lengthspring[k])
    if high - low <= _SAME * max(1.0, abs(high)):
        if of := factors_of_tendon(bodies, k):
            return Spring(_word(name), of, rest=low, stiffness=stiffness)
        if kinds == {int(bodies.mujoco.mjtWrap.mjWRAP_SITE)} and len(parts) == 2:
            sites = [int(model.wrap_objid[p]) for p in parts]
            ends = [int(model.site_bodyid[s]) for s in sites]
            first, second = (
                tuple((model.site_pos[s] - bodies.shifts[b]).tolist())
                for s, b in zip(sites, ends, strict=True)
            )
            parent, child = (bodies.names[b] for b in ends)
            return Spring(_word(name), {}, parent, child, first, second, low, stiffness)
    raise BuildError(
        f"the tendon '{name}' is a spring, expected one without slack along joints or between two "
        "sites; remove its stiffness, or state [[spring]] or [[known_torque]] in a mechanism file"
    )


def _require_linear(model: Any, kind: str, k: int, what: str) -> None:
    """Refuse the polynomials of MuJoCo 4, which earlier versions do not have."""
    terms = getattr(model, f"{kind}_stiffnesspoly", None)
    if terms is not None and np.any(terms[k]):
        raise BuildError(
            f"{what} has a spring of degree 2 or more, expected a linear one; remove its "
            "polynomial, and state [[known_torque]] in a mechanism file"
        )


def _stiffness(value: Any, what: str) -> float:
    """Stiffness of a spring; 0 for none."""
    stiffness = float(value)
    if stiffness < 0:
        raise BuildError(
            f"{what} has the stiffness {stiffness:g}, expected at least 0; correct its sign, or "
            "describe the torque by [[known_torque]] in a mechanism file"
        )
    return stiffness


def _word(name: str) -> str:
    """Name of letters, digits and _."""
    return "".join(c if c.isalnum() else "_" for c in name) or "spring"
