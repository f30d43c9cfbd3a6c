"""Files of robots with couplings and loops: read again by their engines, refused by name."""

import re
from copy import copy
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from runtime.errors import ExportError, RuntimeFault
from runtime.library import Library
from runtime.library.manifest import CouplingFacts
from runtime.outputs.model_files.engines.answer import Unreadable
from runtime.outputs.model_files.formats.header import GRAVITY
from runtime.outputs.model_files.formats.mjcf import MJCF
from runtime.outputs.model_files.formats.ros2 import ROS2
from runtime.outputs.model_files.formats.sdf import SDF
from runtime.outputs.model_files.formats.urdf import URDF
from runtime.outputs.model_files.formats.usd import USD
from runtime.outputs.model_files.model import make_model, springs_left_out
from runtime.recording import Friction


def test_loops_are_written(palletizer: Library) -> None:
    """Oracle: torques of the exported tree by Pinocchio and MuJoCo, projected, and MuJoCo's
    equality. A kind of loop joint that MuJoCo lacks is refused. Friction belongs to joints by name,
    also where the independent joints have another order than the tree.
    """
    lib, turned = palletizer, copy(palletizer)
    turned.joint_names = lib.joint_names[::-1]
    model = make_model(turned, lib.pi0, Friction(("viscous",)), np.array([[0.1], [0.2], [0.3]]))
    assert "verified" in URDF.check(model, URDF.write(model))
    model = make_model(lib, lib.pi0)
    text = MJCF.write(model)
    sentence = MJCF.check(model, text)
    assert "verified" in sentence
    # A site 10 mm away: the loop of the file closes elsewhere.
    site = re.search(r'<site name="loop1b1" pos="(\S+) ', text)
    assert site is not None
    shifted = text.replace(site[0], site[0].replace(site[1], str(float(site[1]) + 0.01)))
    with pytest.raises(Unreadable, match="its equalities leave other motions"):
        MJCF.check(model, shifted)
    slides = replace(lib.manifest.loop_joints[0], kind="cylindrical")
    manifest = replace(lib.manifest, loop_joints=(slides,))
    with pytest.raises(ExportError, match="is cylindrical, which no equality of MuJoCo states"):
        MJCF.write(replace(model, lib=cast(Library, SimpleNamespace(manifest=manifest))))


def test_export_writes_couplings_and_refuses_formats_without(wrist: Library) -> None:
    """Oracle: torques of the exported tree by Pinocchio and MuJoCo, projected; MuJoCo's equalities,
    of a joint with two masters and of one that follows it. SDF is refused by name.
    """
    model = make_model(wrist, wrist.pi0)
    assert "verified" in URDF.check(model, URDF.write(model))
    text = MJCF.write(model)
    assert "verified" in MJCF.check(model, text)
    assert "<fixed" in text
    wrong = text.replace('joint="left_lift" coef="1.25"', 'joint="left_lift" coef="1.5"')
    assert wrong != text
    with pytest.raises(Unreadable, match="its equalities leave other motions"):
        MJCF.check(model, wrong)
    with pytest.raises(RuntimeFault, match=r"sdf files .* export urdf or mjcf"):
        SDF.write(model)
    with pytest.raises(RuntimeFault, match="springs and torque curves have no place"):
        ROS2.write(model)
    assert "springs and torque curves are not included" in GRAVITY.write(model)
    assert "lib.known_torque(q) + lib.spring_columns(q) @ k" in springs_left_out(wrist)


def test_sdf_names_the_formats_that_state_loops(palletizer: Library) -> None:
    """Property: a URDF holds the tree alone, so that it is no remedy."""
    assert not springs_left_out(palletizer)
    with pytest.raises(RuntimeFault, match=r"sdf files .* export mjcf or usd"):
        SDF.write(make_model(palletizer, palletizer.pi0))


def test_usd_closes_loops_outside_the_articulation(palletizer: Library) -> None:
    """Oracle: poses by usd-core. The bodies stand where the two frames of the loop joint coincide
    and the joint has no part in the articulation; a joint that was moved is refused.
    """
    usd = pytest.importorskip("pxr.Usd")
    from pxr import Gf, Sdf, UsdGeom, UsdPhysics

    bent = copy(palletizer)
    bent.home = np.array([0.3, 0.4, -0.2])
    model = make_model(bent, bent.pi0)
    text = USD.write(model)
    assert USD.check(model, text).startswith("verified: reloaded by usd-core")
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(text)
    stage = usd.Stage.Open(layer)
    (loop,) = [prim for prim in stage.Traverse() if prim.IsA(UsdPhysics.SphericalJoint)]
    joint, ends = UsdPhysics.Joint(loop), []
    assert joint.GetExcludeFromArticulationAttr().Get()
    for bodies, local in (
        (joint.GetBody0Rel(), joint.GetLocalPos0Attr()),
        (joint.GetBody1Rel(), joint.GetLocalPos1Attr()),
    ):
        (path,) = bodies.GetTargets()
        place = UsdGeom.Xformable(stage.GetPrimAtPath(path)).ComputeLocalToWorldTransform(0)
        ends.append(place.Transform(Gf.Vec3d(local.Get())))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)  # single precision of the frames
    assert stage.GetPrimAtPath("/palletizer/joints/rod").GetAttribute(
        "state:angular:physics:position"
    ).Get() == pytest.approx(np.degrees(0.6), rel=1e-6)  # arm − crank
    moved = text.replace("physics:localPos0 = (0.0, -0.07", "physics:localPos0 = (0.0, -0.06")
    assert moved != text
    with pytest.raises(ExportError, match="the loop of 'R' and 'F' differs"):
        USD.check(model, moved)


def test_usd_states_joints_that_follow_one_joint(wrist: Library) -> None:
    """Oracle: x + gearing x_m + offset = 0 of PhysX, in degrees; several masters are refused."""
    pytest.importorskip("pxr.Usd")
    model = make_model(wrist, wrist.pi0)
    with pytest.raises(ExportError, match=r"'left_roll' .* follows trunk_turn, left_lift.* mjcf"):
        USD.write(model)
    single = copy(wrist)
    matrix, offset = np.array([[1, 0], [0, 1], [0, -1.25], [1, 0]]), np.array([0, 0, 0.2, 0])
    coupling = CouplingFacts((0, 1), matrix, offset)
    single.manifest = replace(wrist.manifest, coupling=coupling)
    model = make_model(single, single.pi0)
    text = USD.write(model)
    assert USD.check(model, text).startswith("verified")
    assert "float physxMimicJoint:rotX:gearing = 1.25" in text
    assert f"float physxMimicJoint:rotX:offset = {-np.degrees(0.2):.13g}"[:-2] in text
    wrong = text.replace("rotX:gearing = 1.25", "rotX:gearing = 1.5")
    with pytest.raises(ExportError, match="'left_roll' does not follow 'left_lift'"):
        USD.check(model, wrong)
