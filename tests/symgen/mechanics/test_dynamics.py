"""The compiled dynamics against Pinocchio and MuJoCo, and products of their Jacobians."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest

from runtime.library import Library, load, to_pinocchio_order
from symgen.chain import ChainOptions
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.oracle import (
    Answers,
    Array,
    ask_pinocchio,
    pinocchio_model,
    random_states,
    with_parameters,
)
from tests.robots import CASES, DATA, ONE_LEVEL

STATES = 1000

# Where a URDF's angles are exact, 2e-15 comes out: 10³ operations that each round 1e-16 of terms
# of the size of τ. URDFs that write π with 12 digits add up to 1e-12, the `ROUNDING` of the chain,
# inside which symgen takes entries of rotations as meant exactly 0 or ±1.
ROUNDING = 1e-12


@dataclass(frozen=True, slots=True)
class Checked:
    """A library and Pinocchio's answers for the same robot with the same π."""

    lib: Library
    answers: Answers


@pytest.fixture(scope="session", params=["fr3", *CASES])
def checked(request: pytest.FixtureRequest, robot: Callable[[str], Library]) -> Checked:
    """Every robot, compared at 1000 states with Pinocchio's reading of the same URDF."""
    lib = robot(request.param)
    model = pinocchio_model(lib.urdf(), lib.gravity)
    if projected_links(lib):
        model = with_parameters(model, lib, lib.pi0)
    return Checked(lib, ask_pinocchio(model, lib, STATES))


def projected_links(lib: Library) -> dict[str, float]:
    """Links whose inertia in the URDF is impossible, with the change that --settings project=true
    made.
    """
    manifest = json.loads((lib.folder / "manifest.json").read_text(encoding="utf-8"))
    return manifest["projected"]


def relative_error(ours: Array, theirs: Array) -> float:
    """Largest difference over the largest entry of all states."""
    assert ours.shape == theirs.shape
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


def test_joint_torques(checked: Checked) -> None:
    """Oracle: τ of the URDF's own inertias, and h at zero acceleration."""
    lib, a = checked.lib, checked.answers
    assert relative_error(lib.inverse_dynamics(a.q, a.dq, a.ddq, lib.pi0), a.tau) < ROUNDING
    assert relative_error(lib.torque(a.q, a.dq, a.ddq, lib.lam0), a.tau) < ROUNDING
    assert relative_error(lib.bias_forces(a.q, a.dq, lib.pi0), a.bias) < ROUNDING


def test_regressor(checked: Checked) -> None:
    """Oracle: every entry of Y, and Y π0 = τ."""
    lib, a = checked.lib, checked.answers
    y = lib.regressor(a.q, a.dq, a.ddq)
    assert relative_error(to_pinocchio_order(y), a.regressor) < ROUNDING
    assert relative_error(y @ lib.pi0, a.tau) < ROUNDING


def test_base_regressor(checked: Checked) -> None:
    """Oracle: Y_b is the chosen columns of Y, and Y_b K π0 = τ."""
    lib, a = checked.lib, checked.answers
    y_b = lib.base_regressor(a.q, a.dq, a.ddq)
    chosen = to_pinocchio_order(np.eye(10 * lib.n_joints))[list(lib.base_columns)].argmax(axis=1)
    assert relative_error(y_b, a.regressor[:, :, chosen]) < ROUNDING
    # K is known to rounding × the condition of the sampled base columns, here below 100.
    assert relative_error(y_b @ (lib.base_matrix @ lib.pi0), a.tau) < 1e-12


def test_mass_matrix(checked: Checked) -> None:
    """Oracle: M(q); symmetric to the bit."""
    lib, a = checked.lib, checked.answers
    m = lib.mass_matrix(a.q, lib.pi0)
    assert relative_error(m, a.mass) < ROUNDING
    np.testing.assert_array_equal(m, m.swapaxes(1, 2))


def test_forward_dynamics(checked: Checked) -> None:
    """Oracle: Pinocchio's τ gives back the acceleration, to rounding × cond M of each state."""
    lib, a = checked.lib, checked.answers
    ddq = lib.forward_dynamics(a.q, a.dq, a.tau, lib.pi0)
    error = np.linalg.norm(ddq - a.ddq, axis=1)
    smallest = np.linalg.eigvalsh(a.mass)[:, 0]
    # M δ = rounding of τ, so |δ| ≤ rounding · |τ| / λ_min(M).
    assert (error < ROUNDING * np.linalg.norm(a.tau, axis=1).max() / smallest).all()


def test_end_effector(checked: Checked) -> None:
    """Oracle: pose of the tip in the base frame."""
    lib, a = checked.lib, checked.answers
    # Lengths of order one.
    np.testing.assert_allclose(lib.end_effector(a.q), a.pose, rtol=0, atol=ROUNDING)


def test_link_poses(checked: Checked) -> None:
    """Oracle: pose of every joint's frame in the base frame."""
    lib, a = checked.lib, checked.answers
    # Lengths of order one.
    np.testing.assert_allclose(lib.link_poses(a.q), a.links, rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(lib.link_poses(a.q[3]), lib.link_poses(a.q)[3])


def test_parameters_are_those_of_the_urdf(checked: Checked) -> None:
    """Oracle: π0, with fixed links counted in, is what Pinocchio reads from the file."""
    lib, model = checked.lib, pinocchio_model(checked.lib.urdf())
    ours = to_pinocchio_order(lib.pi0).reshape(-1, 10)
    for joint, link, pi in zip(lib.joint_names, lib.link_names, ours, strict=True):
        theirs = model.inertias[model.getJointId(joint)].toDynamicParameters()
        # One parallel-axis shift per entry; lengths inside the chain's rounding become 0.
        tolerance = projected_links(lib).get(link, 1e-12)
        np.testing.assert_allclose(pi, theirs, rtol=0, atol=tolerance * (1 + 1e-12))


def test_any_parameters(fr3: Library) -> None:
    """Oracle: τ and M of inertias far from the URDF's."""
    rng = np.random.default_rng(3)
    lam = fr3.lam0 + rng.normal(0, 0.3, fr3.lam0.shape)
    pi = fr3.pi_from_lam(lam)
    a = ask_pinocchio(with_parameters(pinocchio_model(fr3.urdf()), fr3, pi), fr3, 100)
    assert relative_error(fr3.inverse_dynamics(a.q, a.dq, a.ddq, pi), a.tau) < ROUNDING
    assert relative_error(fr3.torque(a.q, a.dq, a.ddq, lam), a.tau) < ROUNDING
    assert relative_error(fr3.mass_matrix(a.q, pi), a.mass) < ROUNDING


def test_mujoco_agrees_on_fr3(fr3: Library) -> None:
    """Oracle: MuJoCo's mj_inverse at 1000 states, no armature, damping, friction or limits."""
    keep = '<mujoco><compiler fusestatic="false" balanceinertia="false"/></mujoco></robot>'
    model = mujoco.MjModel.from_xml_string(fr3.urdf().replace("</robot>", keep))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    assert not model.dof_armature.any()
    assert not model.dof_damping.any()
    model.opt.gravity[:] = fr3.gravity
    order = [model.joint(name).dofadr[0] for name in fr3.joint_names]
    data = mujoco.MjData(model)
    q, dq, ddq = random_states(fr3.n_joints, STATES, 1)
    theirs = np.empty_like(q)
    for k in range(STATES):
        data.qpos[order], data.qvel[order], data.qacc[order] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(model, data)
        theirs[k] = data.qfrc_inverse[order]
    assert relative_error(fr3.inverse_dynamics(q, dq, ddq, fr3.pi0), theirs) < ROUNDING


# --- cutting and locking ------------------------------------------------------------------


def test_tip_drops_the_hand(robot: Callable[[str], Library], shared_data: Path) -> None:
    """Oracle: the panda to panda_link8 weighs 0.76 kg less than Pinocchio's whole file."""
    lib = robot("panda")
    whole = pinocchio_model((shared_data / "models" / CASES["panda"].file).read_text())
    heavy = sum(inertia.mass for inertia in whole.inertias[1:])
    # Masses have 7 digits and are simply added.
    assert heavy - lib.pi0[::10].sum() == pytest.approx(0.76, abs=1e-12)
    assert lib.manifest.tip == "panda_link8"
    removed = json.loads((lib.folder / "manifest.json").read_text())["removed"]
    assert removed == ["panda_hand", "panda_hand_tcp", "panda_leftfinger", "panda_rightfinger"]


def one_level(name: str, urdf: str, options: ChainOptions, root: Path) -> Library:
    request = BuildRequest(name, urdf, options)
    return load(build(request, root, levels=ONE_LEVEL).folder)


def test_lock_equals_the_reduced_model(tmp_path: Path) -> None:
    """Oracle: pinocchio's buildReducedModel at the locked values."""
    text = (DATA / "gantry.urdf").read_text()
    locks = {"turn": 0.7, "plunge": 0.12}
    lib = one_level("locked", text, ChainOptions(locks=locks), tmp_path)
    full = pinocchio_model(text)
    reference = pinocchio.neutral(full)
    for name, value in locks.items():
        reference[full.joints[full.getJointId(name)].idx_q] = value
    reduced = pinocchio.buildReducedModel(full, [full.getJointId(j) for j in locks], reference)
    a = ask_pinocchio(reduced, lib, 100)
    assert lib.joint_names == ("slide", "spin")
    assert relative_error(lib.inverse_dynamics(a.q, a.dq, a.ddq, lib.pi0), a.tau) < ROUNDING
    assert relative_error(lib.mass_matrix(a.q, lib.pi0), a.mass) < ROUNDING
    np.testing.assert_allclose(lib.end_effector(a.q), a.pose, rtol=0, atol=ROUNDING)


def test_base_turns_gravity_with_it(tmp_path: Path) -> None:
    """Oracle: the arm from --base rail feels the gravity of the whole file's world."""
    text = (DATA / "gantry.urdf").read_text()
    lib = one_level("rail", text, ChainOptions(base="rail"), tmp_path)
    a = ask_pinocchio(pinocchio_model(text), lib, 100)
    assert lib.manifest.base == "rail"
    assert lib.gravity == pytest.approx(
        pinocchio.rpy.rpyToMatrix(0.5, -0.4, 0.3).T @ [0, 0, -9.81], abs=1e-14
    )
    assert relative_error(lib.inverse_dynamics(a.q, a.dq, a.ddq, lib.pi0), a.tau) < ROUNDING


def test_gravity_option(tmp_path: Path, tiny_request: BuildRequest) -> None:
    """Oracle: a wall-mounted arm, and an arm without gravity."""
    for name, gravity in {"wall": (9.81, 0.0, 0.0), "space": (0.0, 0.0, 0.0)}.items():
        lib = one_level(name, tiny_request.urdf, ChainOptions(gravity=gravity), tmp_path)
        a = ask_pinocchio(pinocchio_model(lib.urdf(), np.array(gravity)), lib, 20)
        ours = lib.inverse_dynamics(a.q, a.dq, a.ddq, lib.pi0)
        assert relative_error(ours, a.tau) < ROUNDING


# --- derivatives --------------------------------------------------------------------------


def test_torque_jacobian_factorises(fr3: Library) -> None:
    """Property: ∂τ/∂λ = Y · blockdiag(∂π/∂λ)."""
    q, dq, ddq = random_states(fr3.n_joints, 50, 6)
    y = fr3.regressor(q, dq, ddq).reshape(50, 7, 7, 10)
    chained = np.einsum("snkp,kpl->snkl", y, fr3.pi_jacobian(fr3.lam0)).reshape(50, 7, 70)
    assert relative_error(fr3.torque_jacobian(q, dq, ddq, fr3.lam0), chained) < ROUNDING


def test_loss_is_what_its_equation_says(fr3: Library) -> None:
    """Oracle: NumPy's Σ ½ rᵀWr, Σ YᵀWr and r from the regressor."""
    rng = np.random.default_rng(10)
    q, dq, ddq = random_states(fr3.n_joints, 200, 11)
    tau, weight = rng.normal(0, 20, q.shape), rng.uniform(0.5, 2, fr3.n_joints)
    y = fr3.regressor(q, dq, ddq)
    r = y @ fr3.pi0 - tau
    loss, gradient, residual = fr3.loss_gradient(q, dq, ddq, tau, weight, fr3.pi0)
    # Sums of 1400 products.
    assert loss == pytest.approx(0.5 * np.sum(weight * r**2), rel=1e-12)
    expected = np.einsum("snp,n,sn->p", y, weight, r)
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    assert relative_error(residual, r) < ROUNDING
