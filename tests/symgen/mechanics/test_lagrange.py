"""Momentum, ∂(T − U)/∂q and energy in base parameters against Pinocchio."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio
import pytest

from runtime.library import Library
from tests.oracle import Array, pinocchio_model, random_states, with_parameters

STATES = 200
# As in test_dynamics: URDFs that write π with 12 digits differ by 1e-12 from the exact angles that
# symgen takes them for; K is known to rounding × the condition of the base columns, below 100.
ROUNDING = 1e-12


@dataclass(frozen=True, slots=True)
class Answers:
    """States, a π that is not the URDF's, and what Pinocchio says of p, r and T + U."""

    lib: Library
    q: Array
    dq: Array
    pi: Array
    p: Array
    r: Array
    energy: Array


@pytest.fixture(scope="module", params=["fr3", "iiwa14", "tree", "gantry"])
def answers(request: pytest.FixtureRequest, robot: Callable[[str], Library]) -> Answers:
    """Serial with upright and tilted gravity, branching, sliding.

    π is drawn around the URDF's and fills every entry, those of no base column as well.
    """
    lib = robot(request.param)
    rng = np.random.default_rng(5)
    pi = lib.pi0 * rng.uniform(0.5, 1.5, lib.pi0.size) + rng.normal(0, 0.01, lib.pi0.size)
    model = with_parameters(pinocchio_model(lib.urdf(), lib.gravity), lib, pi)
    data = model.createData()
    columns = np.array([model.joints[model.getJointId(name)].idx_v for name in lib.joint_names])
    q, dq, _ = random_states(lib.n_joints, STATES, seed=5)
    momenta, forces, energy = [], [], []
    for state in zip(q, dq, strict=True):
        x, v = (np.empty(len(columns)) for _ in range(2))
        x[columns], v[columns] = state
        upper = np.triu(pinocchio.crba(model, data, x))
        mass = upper + np.triu(upper, 1).T  # crba leaves the lower triangle undefined
        momenta.append((mass @ v)[columns])
        # dM/dt = C + Cᵀ, so that Cᵀ dq = dM/dt dq − C dq = ∂T/∂q.
        coriolis = pinocchio.computeCoriolisMatrix(model, data, x, v).copy()
        weight = pinocchio.computeGeneralizedGravity(model, data, x).copy()
        forces.append((coriolis.T @ v - weight)[columns])
        kinetic = pinocchio.computeKineticEnergy(model, data, x, v)
        energy.append(kinetic + pinocchio.computePotentialEnergy(model, data, x))
    return Answers(lib, q, dq, pi, *map(np.array, (momenta, forces, energy)))


def test_momentum_and_the_force_of_the_lagrangian(answers: Answers) -> None:
    """Oracle: p = M dq and Cᵀ dq − g by Pinocchio are P_b K π and R_b K π for any π."""
    a = answers
    momentum, force = a.lib.momentum_regressor(a.q, a.dq)
    beta = a.lib.base_matrix @ a.pi
    assert momentum.shape == force.shape == (STATES, a.lib.n_joints, len(beta))
    assert np.abs(momentum @ beta - a.p).max() < ROUNDING * np.abs(a.p).max()
    assert np.abs(force @ beta - a.r).max() < ROUNDING * np.abs(a.r).max()


def test_energy_up_to_a_constant(answers: Answers) -> None:
    """Oracle: T + U by Pinocchio; base parameters lose nothing but the energy of one pose."""
    a = answers
    ours = a.lib.energy_regressor(a.q, a.dq) @ (a.lib.base_matrix @ a.pi)
    gap = ours - a.energy
    assert np.ptp(gap) < ROUNDING * np.abs(a.energy).max()


def test_equations_of_motion(answers: Answers) -> None:
    """Property: dp/dt − r is the torque of the recursion, and d(T + U)/dt its power.

    dp/dt by a Taylor step of the state: the error of central differences falls as h².
    """
    a, lib = answers, answers.lib
    beta = lib.base_matrix @ a.pi
    ddq = np.random.default_rng(6).normal(0, 5, a.q.shape)
    tau = lib.inverse_dynamics(a.q, a.dq, ddq, a.pi)
    power = np.sum(a.dq * tau, axis=1)
    errors = []
    for h in (1e-3, 5e-4):
        ends = [(a.q + s * a.dq + s * s / 2 * ddq, a.dq + s * ddq) for s in (h, -h)]
        after, before = (lib.momentum_regressor(*end)[0] @ beta for end in ends)
        made = (after - before) / (2 * h) - lib.momentum_regressor(a.q, a.dq)[1] @ beta
        high, low = (lib.energy_regressor(*end) @ beta for end in ends)
        worst = np.abs(made - tau).max() / np.abs(tau).max()
        errors.append((worst, np.abs((high - low) / (2 * h) - power).max() / np.abs(power).max()))
    coarse, fine = np.array(errors)
    # A quarter but for terms of h⁴; the fine errors themselves are of order h² · speed².
    assert (fine < 0.3 * coarse).all()
    assert (fine < 1e-3).all()
