"""Build from memory: the URDF of a `pinocchio.Model`, and the request of every kind of model."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest

import symgen
from symgen.chain import read_chain
from symgen.errors import BuildError
from symgen.make import in_memory
from symgen.make.in_memory import urdf_of_model
from symgen.make.pipeline import BuildResult
from symgen.make.request import BuildRequest
from symgen.sources import Source, read_source
from tests.robots import DATA

JOINTS: dict[str, Callable[[], object]] = {
    "turn": pinocchio.JointModelRX,
    "endless": pinocchio.JointModelRUBY,
    "oblique": lambda: pinocchio.JointModelRevoluteUnaligned(0.6, 0.8, 0.0),
    "slide": pinocchio.JointModelPZ,
    "ramp": lambda: pinocchio.JointModelPrismaticUnaligned(0.0, 0.6, 0.8),
}


def branched(root: object | None = None) -> pinocchio.Model:
    """Every kind of joint, the last two on branches; on a free flyer or fixed."""
    pinocchio.seed(3)
    model, parents = pinocchio.Model(), [0, 1, 2, 2, 1]
    base = 0 if root is None else model.addJoint(0, root, pinocchio.SE3.Identity(), "root")
    if root is not None:
        model.appendBodyToJoint(base, pinocchio.Inertia.Random(), pinocchio.SE3.Identity())
    for parent, (name, make) in zip(parents, JOINTS.items(), strict=True):
        k = model.addJoint(parent + base, make(), pinocchio.SE3.Random(), name)
        model.appendBodyToJoint(k, pinocchio.Inertia.Random(), pinocchio.SE3.Random())
    model.lowerPositionLimit[-1], model.upperPositionLimit[-1] = -0.5, 0.25
    return model


@pytest.mark.parametrize("root", [None, pinocchio.JointModelFreeFlyer()])
def test_the_urdf_of_a_model_has_its_dynamics(root: object | None) -> None:
    """Oracle: pinocchio on its own URDF, joints matched by name."""
    model = branched(root)
    text, floats = urdf_of_model(model)
    assert floats == (root is not None)
    again = pinocchio.buildModelFromXML(text, *([] if root is None else [root]))
    start = {name: model.joints[model.getJointId(name)] for name in model.names[1:]}
    there = {name: again.joints[again.getJointId(name)] for name in JOINTS}
    if root is not None:
        there["root"] = again.joints[1]
    rng = np.random.default_rng(1)
    q = pinocchio.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
    v, a = rng.uniform(-1, 1, (2, model.nv))
    p, w, b = pinocchio.neutral(again), np.zeros(again.nv), np.zeros(again.nv)
    for name, joint in start.items():
        to, value = there[name], q[joint.idx_q : joint.idx_q + joint.nq]
        if (joint.nq, to.nq) == (1, 2):  # without limits it is a continuous joint there
            value = np.array([np.cos(value[0]), np.sin(value[0])])
        p[to.idx_q : to.idx_q + to.nq] = value
        w[to.idx_v : to.idx_v + to.nv] = v[joint.idx_v : joint.idx_v + joint.nv]
        b[to.idx_v : to.idx_v + to.nv] = a[joint.idx_v : joint.idx_v + joint.nv]
    tau = pinocchio.rnea(model, model.createData(), q, v, a)
    other = pinocchio.rnea(again, again.createData(), p, w, b)
    for name, joint in start.items():
        to = there[name]
        ours, theirs = other[to.idx_v : to.idx_v + to.nv], tau[joint.idx_v : joint.idx_v + joint.nv]
        np.testing.assert_allclose(ours, theirs, rtol=1e-11, atol=1e-11)
    joints = {joint.name: joint for joint in read_chain(text).joints}
    assert (joints["ramp"].lower, joints["ramp"].upper) == (-0.5, 0.25)
    assert joints["endless"].lower is None


def spherical() -> pinocchio.Model:
    """A ball joint on the ground."""
    model = pinocchio.Model()
    model.addJoint(0, pinocchio.JointModelSpherical(), pinocchio.SE3.Identity(), "ball")
    return model


@pytest.fixture
def requested(monkeypatch: pytest.MonkeyPatch) -> list[BuildRequest]:
    """Requests that would be built."""
    requests: list[BuildRequest] = []

    def keep(request: BuildRequest, root: Path, *_: object) -> BuildResult:
        requests.append(request)
        return BuildResult(root / request.name, True, ("of the build",))

    monkeypatch.setattr(in_memory, "build_request", keep)
    return requests


def test_every_kind_becomes_the_request_of_its_file(
    requested: list[BuildRequest], tmp_path: Path
) -> None:
    """Oracle: the file of the same robot, read by `read_source`."""
    text = (DATA / "gantry.urdf").read_text(encoding="utf-8")
    done = symgen.build(text, name="mine", out=tmp_path)
    assert done.folder == tmp_path / "mine"
    assert done.notes == ("of the build",)
    assert requested[0].urdf == text
    model = pinocchio.buildModelFromXML(text)
    model.gravity.linear = np.array([1.0, 2.0, -9.0])
    symgen.build(model, name="mine")
    assert requested[1].options.gravity == (1.0, 2.0, -9.0)
    assert [joint.name for joint in read_chain(requested[1].urdf).joints] == list(model.names[1:])
    mjcf = tmp_path / "mine.xml"
    mjcf.write_text(
        "<mujoco><worldbody><body name='arm'><joint name='turn' stiffness='3' range='-1 1'/>"
        "<geom size='0.1' mass='2'/></body></worldbody></mujoco>"
    )
    symgen.build(mujoco.MjSpec.from_file(str(mjcf)), name="mine")
    expected, mechanism = read_source(
        Source(mjcf), requested[2].options.mechanism.replace(spring=())
    )
    assert requested[2].urdf == expected
    assert requested[2].options.mechanism == mechanism


@pytest.mark.parametrize(
    ("model", "name", "sentence"),
    [
        (3, "mine", "expected a pinocchio.Model, a mujoco.MjSpec or the text of a URDF"),
        ("<robot/>", "fr3", "'fr3' is the name of a bundled robot"),
        ("<robot/>", "My Robot", "expected lower-case letters"),
        (spherical(), "mine", "expected joints of one axis behind the root, got 'ball'"),
    ],
)
def test_what_cannot_be_built_gets_a_sentence(model: object, name: str, sentence: str) -> None:
    """Property: a kind, a name or a joint that has no library; an unknown name of the package."""
    with pytest.raises((BuildError, symgen.errors.SymgenError), match=sentence):
        symgen.build(model, name=name)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = symgen.nothing
