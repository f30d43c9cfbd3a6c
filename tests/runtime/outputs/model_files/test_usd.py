"""USD: what usd-core reads is the identified robot, and simulators find their attributes."""

import numpy as np
import pytest

from runtime.errors import ExportError
from runtime.library import Library
from runtime.outputs.model_files.formats.usd import USD
from runtime.outputs.model_files.model import make_model
from runtime.recording import Friction
from tests.runtime.exporting import perturbed

TERMS = Friction(("viscous", "coulomb", "rotor"))


def physics_mass(prim: object) -> float:
    return prim.GetAttribute("physics:mass").Get()  # type: ignore[attr-defined]


def test_bodies_joints_and_friction(arm: Library) -> None:
    """Oracle: usd-core and its physics schema; units of PhysX and MuJoCo.

    Masses in double precision to the bit, of the schema to single precision, 2⁻²⁴.
    """
    usd = pytest.importorskip("pxr.Usd")
    from pxr import Gf, Sdf, UsdPhysics

    phi = np.random.default_rng(0).uniform(0.1, 1.0, (arm.n_joints, 3))
    model = make_model(arm, perturbed(arm), TERMS, phi)
    text = USD.write(model)
    assert USD.check(model, text).startswith("verified: reloaded by usd-core")
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(text)
    stage = usd.Stage.Open(layer)
    prims = {prim.GetName(): prim for prim in stage.Traverse()}
    upper = prims["upper"]
    assert upper.HasAPI(UsdPhysics.RigidBodyAPI)
    mass = model.bodies.by_link["upper"].mass
    assert upper.GetAttribute("symgen:mass").Get() == mass
    assert physics_mass(upper) == pytest.approx(mass, rel=2**-24)
    # A flange without mass is a frame on the link that carries it.
    assert not prims["flange"].HasAPI(UsdPhysics.RigidBodyAPI)
    assert prims["flange"].GetParent().GetName() == "slider"
    joint = prims["z_turn"]
    assert joint.IsA(UsdPhysics.RevoluteJoint)
    axis = Gf.Rotation(UsdPhysics.Joint(joint).GetLocalRot1Attr().Get()).TransformDir(
        Gf.Vec3d(1, 0, 0)
    )
    np.testing.assert_allclose(axis, np.array([0, 1, 1]) / np.sqrt(2), atol=1e-6)  # quatf
    viscous, dry, rotor = phi[arm.joint_names.index("z_turn")]
    assert joint.GetAttribute("mjc:damping").Get() == viscous
    assert joint.GetAttribute("mjc:frictionloss").Get() == dry
    physx = "physxJointAxis:angular"
    per_degree = joint.GetAttribute(f"{physx}:viscousFrictionCoefficient").Get()
    assert per_degree == pytest.approx(viscous * np.pi / 180, rel=1e-6)
    assert joint.GetAttribute(f"{physx}:armature").Get() == pytest.approx(rotor, rel=1e-6)
    slide = prims["m_slide"].GetAttribute("physxJointAxis:linear:viscousFrictionCoefficient")
    linear = phi[arm.joint_names.index("m_slide"), 0]
    assert slide.Get() == pytest.approx(linear, rel=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("custom double symgen:mass = ", "custom double symgen:mass = 1", "inertia of the link"),
        ("point3f physics:localPos0 = (", "point3f physics:localPos0 = (1", "placed differently"),
        ("double mjc:damping = ", "double mjc:damping = 1", "damping of joint"),
    ],
    ids=["mass", "place", "damping"],
)
def test_a_changed_file_is_refused(arm: Library, old: str, new: str, said: str) -> None:
    """Property: every quantity of the file is compared."""
    pytest.importorskip("pxr.Usd")
    phi = np.full((arm.n_joints, 3), 0.5)
    model = make_model(arm, perturbed(arm), TERMS, phi)
    text = USD.write(model)
    changed = text.replace(old, new)
    assert changed != text
    with pytest.raises(ExportError, match=said):
        USD.check(model, changed)
