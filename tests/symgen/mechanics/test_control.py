"""Kernels of model-based controllers against Pinocchio, and their identities."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio
import pytest

from runtime.errors import LibraryError
from runtime.library import Library
from symgen.mechanics import dynamics
from tests.oracle import Array, pinocchio_model, random_states, with_parameters

STATES = 50
# Sums of some hundred terms of the size of the largest entry, each rounded to 1e-16; URDFs with
# twelve digits of π add 1e-12, as in test_dynamics.
ROUNDING = 1e-12


@dataclass(frozen=True, slots=True)
class Reference:
    """A library, Pinocchio's model with the same π, and the joints in Pinocchio's order."""

    lib: Library
    model: pinocchio.Model
    columns: Array
    q: Array
    dq: Array
    ddq: Array

    def states(self) -> list[tuple[Array, Array]]:
        """q and dq in Pinocchio's order."""
        rows = []
        for state in zip(self.q, self.dq, strict=True):
            pair = np.zeros((2, self.model.nv))
            pair[:, self.columns] = state
            rows.append((pair[0], pair[1]))
        return rows


@pytest.fixture(scope="module", params=["fr3", "tree", "gantry"])
def reference(request: pytest.FixtureRequest, robot: Callable[[str], Library]) -> Reference:
    lib = robot(request.param)
    model = with_parameters(pinocchio_model(lib.urdf(), lib.gravity), lib, lib.pi0)
    columns = np.array([model.joints[model.getJointId(j)].idx_v for j in lib.joint_names])
    return Reference(lib, model, columns, *random_states(lib.n_joints, STATES, 11))


def test_coriolis_matrix(reference: Reference) -> None:
    """Oracle: Pinocchio's Christoffel symbols; property: dM/dt − 2 C is skew-symmetric."""
    lib, data = reference.lib, reference.model.createData()
    ours = lib.coriolis_matrix(reference.q, reference.dq, lib.pi0)
    pick = np.ix_(reference.columns, reference.columns)
    theirs = np.array(
        [
            pinocchio.computeCoriolisMatrix(reference.model, data, q, dq)[pick].copy()
            for q, dq in reference.states()
        ]
    )
    # Pinocchio's factorisation is another one; C dq and C + Cᵀ = dM/dt are common to all.
    size = max(np.abs(theirs).max(), 1e-3)
    both = (ours, theirs)
    forces = [np.einsum("kij,kj->ki", c, reference.dq) for c in both]
    rates = [c + c.swapaxes(1, 2) for c in both]
    for mine, other in (forces, rates):
        np.testing.assert_allclose(mine, other, rtol=0, atol=10 * ROUNDING * size)
    slope = 1e-4  # central difference: h² of the third derivative and 1e-16 / h of rounding
    ahead, behind = (
        lib.mass_matrix(reference.q + s * reference.dq, lib.pi0) for s in (slope, -slope)
    )
    np.testing.assert_allclose((ahead - behind) / (2 * slope), rates[0], rtol=0, atol=1e-5 * size)


def test_coriolis_matrix_is_that_of_christoffel_symbols(fr3: Library) -> None:
    """Property: C(q, x) y = C(q, y) x, which holds for this factorisation alone."""
    q, x, y = random_states(7, 20, 12)
    both = [
        np.einsum("kij,kj->ki", fr3.coriolis_matrix(q, a, fr3.pi0), b) for a, b in ((x, y), (y, x))
    ]
    np.testing.assert_allclose(*both, rtol=0, atol=ROUNDING * np.abs(both[0]).max())


def test_slotine_li_regressor(reference: Reference) -> None:
    """Property: Y π = M ddq_r + C dq_r + g, for any π; with dq_r = dq it is the regressor."""
    lib = reference.lib
    rng = np.random.default_rng(2)
    dq_r, ddq_r = rng.normal(0, 2, (2, *reference.q.shape))
    pi = lib.pi0 * rng.uniform(0.5, 2, lib.pi0.shape)
    y = lib.slotine_li_regressor(reference.q, reference.dq, dq_r, ddq_r)
    still = np.zeros_like(dq_r)
    expected = (
        np.einsum("kij,kj->ki", lib.mass_matrix(reference.q, pi), ddq_r)
        + np.einsum("kij,kj->ki", lib.coriolis_matrix(reference.q, reference.dq, pi), dq_r)
        + lib.inverse_dynamics(reference.q, still, still, pi)
    )
    np.testing.assert_allclose(y @ pi, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
    same = lib.slotine_li_regressor(reference.q, reference.dq, reference.dq, reference.ddq)
    plain = lib.regressor(reference.q, reference.dq, reference.ddq)
    np.testing.assert_allclose(same, plain, rtol=0, atol=ROUNDING * np.abs(plain).max())


def test_frame_jacobians(reference: Reference) -> None:
    """Oracle: Pinocchio's Jacobians of every link and of the tip."""
    lib, model, data = reference.lib, reference.model, reference.model.createData()
    there = pinocchio.LOCAL_WORLD_ALIGNED
    for link in (*lib.link_names, None):
        name = lib.manifest.tip if link is None else link
        frame = model.getFrameId(name, pinocchio.BODY)
        theirs = [
            pinocchio.computeFrameJacobian(model, data, q, frame, there)[:, reference.columns]
            for q, _ in reference.states()
        ]
        # Lengths of order one.
        np.testing.assert_allclose(
            lib.frame_jacobian(reference.q, link), theirs, rtol=0, atol=ROUNDING
        )
    with pytest.raises(LibraryError, match=r"expected a moving link of '.*', got 'elbow'"):
        lib.frame_jacobian(reference.q, "elbow")


def test_derivatives_of_the_torque(fr3: Library) -> None:
    """Property: the derivatives that come with the torque, and 2 C = ∂τ/∂dq."""
    q, dq, ddq = random_states(7, 5, 13)
    expected = fr3.torque_derivatives(q, dq, ddq, fr3.pi0)[1:]
    for mine, theirs in zip(
        fr3.inverse_dynamics_derivatives(q, dq, ddq, fr3.pi0), expected, strict=True
    ):
        np.testing.assert_array_equal(mine, theirs)
    np.testing.assert_allclose(2 * fr3.coriolis_matrix(q, dq, fr3.pi0), expected[1], atol=1e-12)


def test_least_inertia(reference: Reference) -> None:
    """Property: no eigenvalue of M(q) + diag(J) is below the bound, for any consistent bodies."""
    lib, rng = reference.lib, np.random.default_rng(3)
    for _ in range(5):
        pi = lib.pi_from_lam(lib.lam0 + rng.normal(0, 0.2, lib.lam0.shape))
        rotor = rng.uniform(0, 0.1, lib.n_joints)
        mass = lib.mass_matrix(reference.q, pi) + np.diag(rotor)
        bound = lib.least_inertia(pi, rotor)
        assert 0 < bound <= np.linalg.eigvalsh(mass)[:, 0].min() * (1 + ROUNDING)
    broken = lib.pi0.copy()
    broken[0] = -1.0
    assert np.isnan(lib.least_inertia(broken))


def test_the_inverse_of_the_inertia_of_a_body() -> None:
    """Oracle: NumPy's inverse of [m 1, −[h×]; [h×], I], for a body of 2.5 kg off its frame."""
    mass, h = 2.5, np.array([0.3, -0.2, 0.1])
    across = np.array([[0, -h[2], h[1]], [h[2], 0, -h[0]], [-h[1], h[0], 0]])
    inertia = np.diag([0.3, 0.4, 0.5]) + across @ across.T / mass
    whole = np.block([[mass * np.eye(3), -across], [across, inertia]])
    inverse = dynamics._inverse_inertia(mass, ca.DM(h), ca.DM(inertia))
    values = np.array(ca.evalf(inverse))
    # Rounding of numbers of size 4 by a condition of 30.
    np.testing.assert_allclose(values, np.linalg.inv(whole), atol=1e-13)
