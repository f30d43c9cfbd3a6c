"""`symgen.inspect`: every crafted fault is flagged by its name, a good arm is not."""

import re

import numpy as np
import pytest

from symgen.inspect.geometry import groups_of
from symgen.inspect.model import ERROR
from tests.symgen.bodies import BOX, BRICK, GOOD, POINT, TILTED, arm, block, inspect, solid, steiner

WIDE = np.array([0.05, 0.03, 0.1])
ODD = 0.02 * np.eye(3) + 0.006 * (np.ones((3, 3)) - np.eye(3))
"""Moments 0.032, 0.014, 0.014: impossible; with one product negative 0.026, 0.026, 0.008."""
MIRROR = np.diag([1.0, -1.0, 1.0])

ZERO_LIMITS = 'lower="0" upper="0" velocity="0" effort="0"'

FLAGS = {
    "mass": (arm([block(-1.0, POINT, BRICK)]), ERROR, "mass", "the mass is -1 kg"),
    "no mass": (arm([block(0.0, POINT, BRICK)]), ERROR, "mass", "inertia but no mass"),
    "zero": (arm([block(2.0, POINT, 0 * BRICK)]), ERROR, "zero-inertia", "2 kg without inertia"),
    "missing": (arm([GOOD, ""]), ERROR, "massless", "neither it nor any link beyond has mass"),
    "hollow": (arm(["", GOOD]), "warning", "massless", "no mass of its own"),
    "negative": (arm([block(2.0, POINT, -BRICK)]), ERROR, "triangle", "is negative"),
    "no tensor": (
        arm(['<inertial><mass value="1"/></inertial>']),
        ERROR,
        "incomplete",
        "without <inertia>",
    ),
    "no number": (arm([GOOD.replace("2.0", "two")]), ERROR, "unreadable", "got 'two'"),
    "not finite": (arm([GOOD.replace("2.0", "nan")]), ERROR, "unreadable", "got 'nan'"),
    "huge": (arm([GOOD.replace("2.0", "1e200")]), ERROR, "unreadable", "the mass is 1e200"),
    "speck": (arm([GOOD.replace("2.0", "1e-200")]), ERROR, "mass", "more than 1e-09 kg"),
    "two inertials": (arm([GOOD + GOOD]), ERROR, "structure", "2 <inertial>"),
    "sign alone": (
        arm([block(1.0, POINT, ODD)]),
        "warning",
        "sign",
        "with the opposite sign of one product",
    ),
    "sign of a sister": (
        arm([block(2.0, WIDE, TILTED), block(2.0, MIRROR @ WIDE, TILTED)]),
        "warning",
        "sign",
        "no mirror explains the signs",
    ),
    "decimal of the tensor": (
        arm([block(2.0, POINT, 100 * BRICK)], {1: BOX}),
        "warning",
        "size",
        r"times 10\^-[12] \(a decimal point",
    ),
    "decimal without shapes": (
        arm([block(2.0, POINT, 1000 * BRICK), GOOD]),
        "warning",
        "size",
        r"times 10\^-[123] \(a decimal point",
    ),
    "decimal of the mass": (
        arm([block(2000.0, POINT, 1000 * BRICK)], {1: BOX}),
        "warning",
        "density",
        r"the mass times 10\^-[23]",
    ),
    "decimal of one entry": (
        arm([block(2.0, POINT, BRICK * [[1, 1, 1], [1, 1, 1], [1, 1, 0.01]])]),
        "warning",
        "decimal",
        "izz = .* is the only entry",
    ),
    "dense": (
        arm([block(2.0, POINT, BRICK / 1000)]),
        "warning",
        "dense",
        "require a density of at",
    ),
    "rod": (
        arm([block(2.0, POINT, np.diag([0.0, 0.05, 0.05]))]),
        "warning",
        "dense",
        "the mass lies on a line, without any thickness; expected less than osmium",
    ),
    "disc": (
        arm([block(2.0, POINT, np.diag([0.02, 0.03, 0.05]))]),
        "warning",
        "dense",
        "the mass lies in a plane, without any thickness",
    ),
    "airy": (arm([block(0.01, POINT, BRICK / 20)]), "warning", "airy", "more than packing foam"),
    "outside": (arm([block(2.0, POINT + 1, BRICK)], {1: BOX}), "warning", "outside", "mm outside"),
    "placeholder": (
        arm([block(2.0, POINT, 0.01 * np.eye(3))]),
        "warning",
        "placeholder",
        "0.01 times the identity",
    ),
    "copied": (
        arm([GOOD, block(1.0, POINT, BRICK)]),
        "warning",
        "copied",
        "that of 'link2' to the last digit, with different masses",
    ),
    "about the origin": (
        arm(
            [
                block(2.0, c, solid(2.0, (0.1, 0.12, 0.2)) + steiner(2.0, c))
                for c in (POINT, POINT * [1, -1, 1], POINT * [-1, 1, 1.5])
            ]
        ),
        "warning",
        "wrong-point",
        "about the link origin.*as for all links",
    ),
    "shifted twice": (
        arm([block(2.0, POINT, BRICK - steiner(1.5, POINT))]),
        "warning",
        "wrong-point",
        "shift to the centre of mass had been applied twice",
    ),
    "crossed limits": (
        arm([GOOD]).replace('lower="-2"', 'lower="3"'),
        ERROR,
        "limits",
        "lower limit 3 lies above the upper limit 2",
    ),
    "locked": (arm([GOOD]).replace('"-2" upper="2"', '"0" upper="0"'), "warning", "limits", "both"),
    "no limits at all": (
        arm([GOOD]).replace('lower="-2" upper="2" velocity="2" effort="50"', ZERO_LIMITS),
        "warning",
        "limits",
        "all limits are 0, which counts as not stated",
    ),
    "rounded moment": (
        arm([block(2.0, POINT, np.diag([-8e-19, 1e-3, 3e-3]))]),
        ERROR,
        "triangle",
        "the largest principal moment exceeds the sum of the others by 0.002",
    ),
    "no limits": (
        re.sub("<limit[^>]*/>", "", arm([GOOD])),
        "warning",
        "limits",
        "no position limits",
    ),
    "degrees": (
        arm([GOOD]).replace('"-2" upper="2"', '"-170" upper="170"'),
        "warning",
        "limits",
        "degrees",
    ),
    "no effort": (arm([GOOD]).replace('effort="50"', 'effort="0"'), "warning", "limits", "is 0"),
    "weak": (arm([GOOD]).replace('effort="50"', 'effort="-5"'), ERROR, "limits", "limit is -5"),
    "drives": (
        arm([GOOD]).replace("</joint>", '<dynamics damping="-1" friction="0.1"/></joint>'),
        ERROR,
        "dissipation",
        "the damping is -1",
    ),
    "axis": (arm([GOOD]).replace('xyz="0 1 0"', 'xyz="0 0 0"'), ERROR, "axis", "axis is 0 0 0"),
    "stray link": (
        arm([GOOD]).replace("</robot>", '<link name="stray"/></robot>'),
        ERROR,
        "structure",
        "exactly one root link",
    ),
    "loop": (
        arm([GOOD]).replace('parent link="base"', 'parent link="link1"'),
        ERROR,
        "structure",
        "loop",
    ),
}


@pytest.mark.parametrize("name", FLAGS)
def test_flags(name: str) -> None:
    """Property: a crafted fault is named, once where it is, in one sentence."""
    text, severity, kind, pattern = FLAGS[name]
    hits = [f for f in inspect(text).findings if (f.severity, f.kind) == (severity, kind)]
    assert any(re.search(pattern, f.sentence) for f in hits), [
        f.sentence for f in inspect(text).findings
    ]
    assert all("\n" not in f.sentence for f in hits)


def test_good_arm_has_no_finding() -> None:
    """Property: none of the checks fires on ordinary bodies, mirrored sisters among them."""
    bricks = [
        block(2.0, POINT, BRICK),
        block(1.5, POINT * [1, -1, 1], 1.1 * TILTED),
        block(1.5, POINT, MIRROR @ (1.1 * TILTED) @ MIRROR),
    ]
    placed = BOX.replace("<geometry>", '<origin xyz="0.05 0.01 0.1"/><geometry>')
    hits = inspect(arm(bricks, {1: placed}))
    assert hits.findings == ()
    assert hits.rows[0].density == pytest.approx(2.0 / 0.0036)


def fixed(inertial: str) -> str:
    """The good arm with a turned body fixed to its last link."""
    mount = (
        '<joint name="mount" type="fixed"><origin xyz="0 0.02 0.1" rpy="0.3 0.2 0.1"/>'
        f'<parent link="link2"/><child link="part"/></joint><link name="part">{inertial}</link>'
    )
    return arm([GOOD, GOOD]).replace("</robot>", mount + "</robot>")


def test_links_fixed_to_each_other_are_one_body() -> None:
    """Property: a placeholder of a gram in a fixed link has no effect; a decimal slip has.

    Oracle: the sum of pseudo-inertias, the fixed one placed by its joint.
    """
    gram = fixed(block(0.001, POINT, 1e-6 * np.eye(3)))
    assert not inspect(gram).findings
    (slipped,) = inspect(fixed(block(2.0, POINT, 1000 * BRICK))).findings
    assert slipped.kind == "size"
    assert slipped.where == "link 'link2' with what is fixed to it (1 more)"
    model = inspect(fixed(GOOD)).model
    (whole,) = (g for g in groups_of(model, dict.fromkeys(model.links)) if "link2" in g.where)
    carrier, part = (model.links[name].body for name in ("link2", "part"))
    mount = model.joint_of("part")
    assert carrier is not None
    assert part is not None
    assert mount is not None
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = mount.rotation, mount.offset
    expected = carrier.pseudo_inertia + pose @ part.pseudo_inertia @ pose.T
    # Some ten operations on numbers of size 4.
    np.testing.assert_allclose(whole.body.pseudo_inertia, expected, rtol=0, atol=1e-14)
