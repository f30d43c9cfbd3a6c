"""A library with a free base: rows, conventions of Pinocchio's free flyer, files, messages."""

import re
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio
import pytest
from numpy.typing import NDArray

from runtime.errors import LibraryError, ShapeError
from runtime.library import BaseMotion, Library, to_pinocchio_order
from runtime.library.free_base import coordinates_of_pose
from symgen.chain import ChainOptions, read_chain
from symgen.chain.mechanism import mechanism_from_table
from symgen.cli import main
from symgen.errors import UrdfError
from symgen.make.facts import initial_parameters
from symgen.make.pipeline import generate
from symgen.make.request import request_from_folder
from symgen.mechanics.dynamics import forward_dynamics, inverse_dynamics
from tests.robots import DATA

Array = NDArray[np.float64]

HOPPER = (DATA / "hopper.urdf").read_text()
EXACT = 1e-9  # the stated accuracy; rounding of sums of some hundred terms is 1e-12 of the largest
STATES = 1000


@pytest.fixture(scope="module")
def lib(hopper: Library) -> Library:
    return hopper


class FreeFlyer:
    """Pinocchio's model with a free flyer, and random states of it."""

    def __init__(self, urdf: str, count: int = STATES) -> None:
        self.model = pinocchio.buildModelFromXML(urdf, pinocchio.JointModelFreeFlyer())
        self.data = self.model.createData()
        rng, n = np.random.default_rng(0), self.model.nv - 6
        turns = rng.normal(size=(count, 4))
        turns /= np.linalg.norm(turns, axis=1)[:, None]
        self.pose = np.hstack([rng.uniform(-2, 2, (count, 3)), turns])
        self.q = rng.uniform(-3, 3, (count, n))
        self.v = rng.normal(0, 2, (count, 6 + n))
        self.a = rng.normal(0, 5, (count, 6 + n))
        self.base = BaseMotion(self.pose, self.v[:, :6], self.a[:, :6])
        self.state = (self.q, self.v[:, 6:], self.a[:, 6:])

    def each(self, function: str, *arguments: Array) -> Array:
        x = np.hstack([self.pose, self.q])
        call = getattr(pinocchio, function)
        rows = zip(x, *arguments, strict=True)
        return np.array([call(self.model, self.data, *row).copy() for row in rows])


@pytest.fixture(scope="module")
def flyer() -> FreeFlyer:
    return FreeFlyer(HOPPER)


def error(ours: Array, theirs: Array) -> float:
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


def test_rows_and_parameters(lib: Library) -> None:
    """Property: joints, rows, and the base link's ten parameters, which come first."""
    assert lib.joint_names == lib.all_joint_names == ("left_hip", "left_slide", "right_hip")
    assert lib.row_names[:6] == tuple(
        f"{kind} {axis}" for kind in ("force", "moment") for axis in "xyz"
    )
    assert lib.row_names[6:] == lib.joint_names
    assert lib.link_names == ("body", "left_thigh", "left_foot", "right_thigh")
    assert lib.pi0.shape == (40,)
    assert lib.pi0[0] == pytest.approx(6.4)  # with the box
    assert set(range(10)) <= set(lib.base_columns)


def test_inverse_dynamics_and_regressor_are_pinocchios(lib: Library, flyer: FreeFlyer) -> None:
    """Oracle: rnea and computeJointTorqueRegressor of the free flyer, LOCAL twists."""
    theirs = flyer.each("rnea", flyer.v, flyer.a)
    assert error(lib.inverse_dynamics(*flyer.state, lib.pi0, base=flyer.base), theirs) < EXACT
    assert error(lib.torque(*flyer.state, lib.lam0, base=flyer.base), theirs) < EXACT
    y = lib.regressor(*flyer.state, base=flyer.base)
    assert y.shape == (STATES, 9, 40)
    rows = flyer.each("computeJointTorqueRegressor", flyer.v, flyer.a)
    assert error(to_pinocchio_order(y), rows) < EXACT
    y_b, beta = lib.base_regressor(*flyer.state, base=flyer.base), lib.base_matrix @ lib.pi0
    assert error(y_b @ beta, theirs) < EXACT


def test_mass_matrix_and_forward_dynamics_are_pinocchios(lib: Library, flyer: FreeFlyer) -> None:
    """Oracle: crba; the accelerations of rnea's wrench and torques come back."""
    mass = flyer.each("crba")
    mass = np.triu(mass) + np.swapaxes(np.triu(mass, 1), 1, 2)
    ours = lib.mass_matrix(flyer.q, lib.pi0, base=flyer.base)
    assert error(ours, mass) < EXACT
    assert np.array_equal(ours, np.swapaxes(ours, 1, 2))
    tau = flyer.each("rnea", flyer.v, flyer.a)
    a = lib.forward_dynamics(*flyer.state[:2], tau, lib.pi0, base=flyer.base)
    assert error(a, flyer.a) < EXACT
    rotor = np.array([0.1, 0.2, 0.3])
    tau[:, 6:] += rotor * flyer.a[:, 6:]
    a = lib.forward_dynamics(*flyer.state[:2], tau, lib.pi0, rotor, base=flyer.base)
    assert error(a, flyer.a) < EXACT


def test_poses_are_pinocchios_in_the_world(lib: Library, flyer: FreeFlyer) -> None:
    """Oracle: forwardKinematics; a pose may be a matrix or position and quaternion."""
    x = np.hstack([flyer.pose, flyer.q])
    ours = lib.link_poses(flyer.q, base=flyer.base)
    for k in range(5):
        pinocchio.forwardKinematics(flyer.model, flyer.data, x[k])
        theirs = [flyer.data.oMi[i].homogeneous for i in range(1, flyer.model.njoints)]
        np.testing.assert_allclose(ours[k], theirs, rtol=0, atol=1e-12)  # rounding of metres
        for i, link in enumerate(lib.link_names, start=1):
            theirs = pinocchio.computeJointJacobian(flyer.model, flyer.data, x[k], i)
            turn = flyer.data.oMi[i].rotation
            jacobian = lib.frame_jacobian(flyer.q[k], link, base=BaseMotion(flyer.pose[k]))
            local = np.vstack([turn.T @ jacobian[:3], turn.T @ jacobian[3:]])
            np.testing.assert_allclose(local, theirs, rtol=0, atol=1e-12)
    matrices = BaseMotion(ours[:, 0], *flyer.base[1:])
    tau = lib.inverse_dynamics(*flyer.state, lib.pi0, base=matrices)
    assert error(tau, lib.inverse_dynamics(*flyer.state, lib.pi0, base=flyer.base)) < EXACT


def test_torque_jacobian_is_the_derivative(lib: Library, flyer: FreeFlyer) -> None:
    """Derivative: the Taylor remainder of τ(λ) falls with h²."""
    few = slice(0, 4)
    base = BaseMotion(*(part[few] for part in flyer.base))
    state = [part[few] for part in flyer.state]
    way = np.random.default_rng(1).normal(size=40)
    slope = lib.torque_jacobian(*state, lib.lam0, base=base) @ way
    value = lib.torque(*state, lib.lam0, base=base)

    def remainder(h: float) -> float:
        moved = lib.torque(*state, lib.lam0 + h * way, base=base)
        return float(np.abs(moved - value - h * slope).max())

    steps = np.array([1e-2, 3e-3, 1e-3])
    sizes = [remainder(h) for h in steps]
    assert 1.9 < np.polyfit(np.log(steps), np.log(sizes), 1)[0] < 2.1


def test_couplings_and_a_free_base() -> None:
    """Oracle: the free flyer projected on the independent joints, Aᵀ τ_all(A q + b)."""
    row = {"joint": "left_slide", "of": {"right_hip": 0.1, "left_hip": -0.2}, "offset": 0.05}
    mechanism = mechanism_from_table({"coupling": [row]}, "M")
    chain = read_chain(HOPPER, ChainOptions(mechanism=mechanism, floating=True))
    assert [joint.name for joint in chain.coordinates] == ["left_hip", "right_hip"]
    a = np.zeros((9, 8))
    a[:7, :7] = np.eye(7)
    a[7, 6:], a[8, 7] = [-0.2, 0.1], 1.0
    pi0, _ = initial_parameters(chain, False)
    symbols = [ca.SX.sym(name, 8) for name in ("q", "dq", "ddq")]
    tau = ca.Function("tau", symbols, [inverse_dynamics(chain, *symbols, ca.DM(pi0))])
    back = ca.Function(
        "a", symbols, [forward_dynamics(chain, *symbols, ca.DM(pi0), ca.DM.zeros(8))]
    )
    flyer, rng = FreeFlyer(HOPPER, 20), np.random.default_rng(2)
    q = np.hstack([coordinates_of_pose(flyer.pose), rng.uniform(-2, 2, (20, 2))])
    dq, ddq = rng.normal(size=(2, 20, 8))
    flyer.q = (q @ a.T)[:, 6:] + [0, 0.05, 0]
    theirs = flyer.each("rnea", dq @ a.T, ddq @ a.T) @ a
    ours = np.array([np.asarray(tau(*row)).ravel() for row in zip(q, dq, ddq, strict=True)])
    assert error(ours, theirs) < EXACT
    again = [np.asarray(back(*row)).ravel() for row in zip(q, dq, theirs, strict=True)]
    assert error(np.array(again), ddq) < EXACT


def test_a_kernel_that_a_free_base_does_not_have_is_named(lib: Library) -> None:
    """Property: the message names the kernel and what to use instead."""
    with pytest.raises(LibraryError, match=r"no kernel 'clearance'.*without --floating"):
        lib.clearance(np.zeros(3))
    with pytest.raises(LibraryError, match=r"momentum_regressor'.*use base_regressor"):
        lib.momentum_regressor(np.zeros(9), np.zeros(9))
    assert not set(lib.manifest.omitted) & set(lib.manifest.kernels)


def test_wrong_motions_of_the_base_are_refused(lib: Library, fr3: Library) -> None:
    """Property: one sentence each."""
    zero = np.zeros(3)
    with pytest.raises(ShapeError, match=r"base of 'hopper' is free: give base="):
        lib.inverse_dynamics(zero, zero, zero, lib.pi0)
    with pytest.raises(ShapeError, match="position and quaternion"):
        lib.regressor(zero, zero, zero, base=BaseMotion(np.zeros(6)))
    with pytest.raises(ShapeError, match="another length than 1"):
        lib.regressor(zero, zero, zero, base=BaseMotion(np.zeros(7)))
    with pytest.raises(ShapeError, match="not a rigid transform"):
        lib.regressor(zero, zero, zero, base=BaseMotion(2 * np.eye(4)))
    with pytest.raises(ShapeError, match="expected equally many samples"):
        lib.regressor(
            *np.zeros((3, 5, 3)), base=BaseMotion(np.eye(4), np.zeros((4, 6)), np.zeros(6))
        )
    with pytest.raises(ShapeError, match="base of 'fr3' is fixed"):
        fr3.end_effector(np.zeros(7), base=BaseMotion(np.eye(4)))


def test_the_folder_regenerates_itself(lib: Library) -> None:
    """Property: `symgen check` writes the same files from URDF and manifest."""
    files, _ = generate(request_from_folder(lib.folder))
    assert files["manifest.json"] == (lib.folder / "manifest.json").read_text()


def test_refused_builds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: a base without mass, springs, and a floating joint get a sentence."""
    light = re.sub(r'<link name="body">.*?</link>', '<link name="body"/>', HOPPER, flags=re.S)
    light = re.sub(r'<link name="box">.*?</link>', '<link name="box"/>', light, flags=re.S)
    with pytest.raises(UrdfError, match="free base 'body' has no mass"):
        read_chain(light, ChainOptions(floating=True))
    spring = mechanism_from_table({"spring": [{"name": "s", "joint": "left_hip"}]}, "M")
    with pytest.raises(UrdfError, match="takes couplings of a mechanism only"):
        read_chain(HOPPER, ChainOptions(mechanism=spring, floating=True))
    world = HOPPER.replace(
        '<link name="body">',
        '<link name="w"/><joint name="free" type="floating"><parent link="w"/>'
        '<child link="body"/></joint><link name="body">',
    )
    (tmp_path / "w.urdf").write_text(world)
    command = ["build", "--urdf", str(tmp_path / "w.urdf"), "--name", "w", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["symgen", *command])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "give --floating --base body for a free base" in " ".join(
        capsys.readouterr().err.split()
    )
    chain = read_chain(world, ChainOptions(base="body", floating=True))
    assert chain.joints[0].link == "body"
