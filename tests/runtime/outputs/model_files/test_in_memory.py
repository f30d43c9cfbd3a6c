"""runtime.to_pinocchio and runtime.to_mujoco: the identified robot in memory."""

from pathlib import Path

import msgspec
import mujoco
import numpy as np
import pinocchio
import pytest

import runtime
from runtime.errors import ExportError, RuntimeFault
from runtime.identification.result_record import ResultRecord
from runtime.identification.saved_result import SavedResult, migrated, model_part
from runtime.library import Library, to_pinocchio_order
from runtime.recording import Friction, Preparation
from tests.runtime import pages
from tests.runtime.exporting import perturbed

TERMS = Friction(("viscous", "coulomb", "offset", "rotor"))


def saved(lib: Library, scale: float = 1.0) -> SavedResult:
    """A result of consistent bodies with four columns of friction."""
    phi = np.random.default_rng(2).uniform(0.1, 1.0, (lib.n_joints, 4))
    facts = migrated(pages.result() | {"robot": lib.name, "joints": list(lib.joint_names)})
    record = msgspec.convert(facts, ResultRecord).replace(model=model_part(lib))
    return SavedResult(record, scale * perturbed(lib), TERMS, phi, Preparation())


def test_both_engines_hold_the_identified_robot(arm: Library) -> None:
    """Oracle: Pinocchio and MuJoCo; π with fixed links, rotor inertia, friction, torques."""
    result = saved(arm)
    tree = runtime.to_pinocchio(result, arm)
    model = runtime.to_mujoco(result, arm).compile()
    data, ids = mujoco.MjData(model), [tree.getJointId(name) for name in arm.joint_names]
    read = np.concatenate([tree.inertias[i].toDynamicParameters() for i in ids])
    np.testing.assert_allclose(read, to_pinocchio_order(result.pi), rtol=1e-9, atol=1e-12)
    assert tree.inertias[0].mass == pytest.approx(5.0)  # what is fixed to the base
    at = [tree.joints[i].idx_v for i in ids]
    there = [int(model.joint(name).dofadr[0]) for name in arm.joint_names]
    pairs = ((tree.damping, model.dof_damping), (tree.friction, model.dof_frictionloss))
    for column, (one, other) in zip(
        (0, 1, 3), (*pairs, (tree.armature, model.dof_armature)), strict=True
    ):
        np.testing.assert_allclose(one[at], result.phi[:, column], rtol=1e-12)
        np.testing.assert_allclose(other[there], result.phi[:, column], rtol=1e-12)
    rng = np.random.default_rng(3)
    q, dq, ddq = rng.normal(size=(3, arm.n_joints))
    expected = arm.inverse_dynamics(q, dq, ddq, result.pi) + result.phi[:, 3] * ddq
    position, v, a = pinocchio.neutral(tree), *np.zeros((2, tree.nv))
    v[at], a[at] = dq, ddq
    for i, angle in zip(ids, q, strict=True):
        joint = tree.joints[i]
        one = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
        position[joint.idx_q : joint.idx_q + joint.nq] = one
    tau = pinocchio.rnea(tree, tree.createData(), position, v, a)
    np.testing.assert_allclose(tau[at], expected, rtol=1e-9, atol=1e-9)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data.qpos[there], data.qvel[there], data.qacc[there] = q, dq, ddq
    mujoco.mj_inverse(model, data)
    expected += result.phi[:, 0] * dq
    np.testing.assert_allclose(data.qfrc_inverse[there], expected, rtol=1e-9, atol=1e-9)


def test_joints_without_limits_have_none_in_pinocchio(arm: Library) -> None:
    """Property: the limits of the library, not those that the parser requires."""
    model, limits = runtime.to_pinocchio(saved(arm), arm), arm.limits()
    for k, name in enumerate(arm.joint_names):
        joint = model.joints[model.getJointId(name)]
        assert model.effortLimit[joint.idx_v] == limits["effort"][k]
        assert model.velocityLimit[joint.idx_v] == limits["velocity"][k]
        if joint.nq == 1:
            assert model.lowerPositionLimit[joint.idx_q] == limits["lower"][k]
            assert model.upperPositionLimit[joint.idx_q] == limits["upper"][k]


@pytest.mark.parametrize("door", [runtime.to_pinocchio, runtime.to_mujoco])
def test_what_is_no_result_ends_in_a_sentence(door, arm: Library, tmp_path: Path) -> None:
    """Property: a library, a folder without result.json, and bodies that cannot exist."""
    with pytest.raises(
        RuntimeFault, match=r"expected a result of runtime\.identify or .*, got Lib"
    ):
        door(arm)
    with pytest.raises(RuntimeFault, match=r"cannot read .*result\.json"):
        door(tmp_path)
    with pytest.raises(ExportError, match=r"^expected a positive mass of the link"):
        door(saved(arm, -1.0), arm)


def test_a_free_base(hopper: Library) -> None:
    """Oracle: Pinocchio's free flyer; MuJoCo's file states a fixed base and is refused."""
    model = runtime.to_pinocchio(saved(hopper), hopper)
    assert model.nv == hopper.n_rows
    assert model.inertias[1].mass == pytest.approx(saved(hopper).pi[0], rel=1e-12)
    with pytest.raises(ExportError, match="the base of 'hopper' is free"):
        runtime.to_mujoco(saved(hopper), hopper)
