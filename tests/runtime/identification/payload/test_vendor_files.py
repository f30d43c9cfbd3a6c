"""Payload files of UR, KUKA, Kinova and xArm, read back by the rules of their manuals."""

import json
import re
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from runtime.identification.payload.body import Body
from runtime.identification.payload.output import kuka_angles, principal_axes, vendor_texts
from runtime.library.parameters import inertia_matrix

NUMBER = r"[-+0-9.e]+"


def bodies() -> list[Body]:
    """Random turned bodies, and one whose axes need no turn."""
    rng = np.random.default_rng(4)
    turns = [Rotation.random(random_state=rng).as_matrix() for _ in range(20)]
    moments = np.array([3e-3, 1e-3, 2.5e-3])
    return [
        Body(1.3, rng.normal(size=3) / 10, R @ np.diag(moments) @ R.T, np.eye(10))
        for R in (np.eye(3), *turns)
    ]


@pytest.mark.parametrize("body", bodies())
def test_each_controller_gets_the_same_body(body):
    """Oracle: scipy's rotations and the order and units of each manual; 1e-15 kg·m² is rounding."""
    texts = vendor_texts(body)
    script = re.fullmatch(
        r"set_target_payload\((.+?), \[(.+?)\], \[(.+?)\]\)\n", texts["set_target_payload.script"]
    )
    assert float(script[1]) == body.mass
    assert [float(x) for x in script[2].split(",")] == body.com.tolist()
    entries = np.array([float(x) for x in script[3].split(",")])  # xx, yy, zz, xy, xz, yz
    np.testing.assert_allclose(inertia_matrix(entries), body.inertia, rtol=0, atol=1e-15)

    load = texts["load_data.krl"]
    fields = "".join(f"{{sep}}{name} ({NUMBER})" for name in "XYZABC").replace("{sep}", ",")[1:]
    moments = ",".join(f"{name} ({NUMBER})" for name in "XYZ")
    kuka = re.fullmatch(rf"LOAD_DATA\[1\]={{M ({NUMBER}),CM {{{fields}}},J {{{moments}}}}}\n", load)
    m, x, y, z, *rest = map(float, kuka.groups())
    R = Rotation.from_euler("ZYX", rest[:3], degrees=True).as_matrix()
    assert m == body.mass
    np.testing.assert_allclose([x, y, z], 1e3 * body.com, rtol=1e-15)
    np.testing.assert_allclose(R @ np.diag(rest[3:]) @ R.T, body.inertia, rtol=0, atol=1e-15)

    kinova = json.loads(texts["kinova_payload.json"])
    assert kinova["payload_mass"] == body.mass
    assert list(kinova["payload_mass_center"].values()) == body.com.tolist()
    xarm = json.loads(texts["xarm_tcp_load.json"])
    assert xarm["weight"] == body.mass
    np.testing.assert_allclose(xarm["center_of_gravity"], 1e3 * body.com, rtol=1e-15)


def test_axes_that_need_no_turn_keep_their_names():
    """Property: a diagonal inertia, in any order, has the angles 0 and keeps its moments."""
    load = vendor_texts(bodies()[0])["load_data.krl"]
    assert "A 0,B 0,C 0}" in load
    assert [float(v) for v in re.findall(rf" ({NUMBER})", load.split("J {")[1])] == [
        *(3e-3, 1e-3, 2.5e-3)
    ]


@pytest.mark.parametrize("b", [90.0, -90.0])
def test_angles_at_the_pole(b):
    """Property: at B = ± 90° the rotation is kept; 1e-12 is the bound of the pole."""
    R = Rotation.from_euler("ZYX", [20.0, b, 35.0], degrees=True).as_matrix()
    back = Rotation.from_euler("ZYX", kuka_angles(R)).as_matrix()
    np.testing.assert_allclose(back, R, rtol=0, atol=1e-12)


def test_angles_next_to_the_pole_keep_the_third():
    """Property: 5e-12 rad from B = 90° C is still told; without it the rotation is 5e-12 off."""
    away = 5e-12
    z, x = np.radians(20.0), np.radians(35.0)
    Rz = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    Ry = np.array([[away, 0, 1], [0, 1, 0], [-1, 0, away]])
    Rx = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    a, b, c = kuka_angles(Rz @ Ry @ Rx)
    np.testing.assert_allclose([a, c], [z, x], rtol=0, atol=1e-4)  # rounding 1e-16 over 5e-12
    assert np.pi / 2 - b == pytest.approx(away, rel=1e-4)


@pytest.mark.parametrize("body", bodies())
def test_principal_axes_turn_the_least(body):
    """Oracle: every sign of the axes that is a rotation; the largest trace turns the least."""
    _, R = principal_axes(body.inertia)
    signs = [np.array(each) for each in product((1.0, -1.0), repeat=3)]
    traces = [np.trace(R * sign) for sign in signs if np.linalg.det(R * sign) > 0]
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert np.trace(R) == pytest.approx(max(traces))
