"""derivative_bounds: nothing along random motions exceeds them, for turns, slides and couplings."""

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from symgen.chain import Chain, read_chain
from symgen.make.facts import initial_parameters
from symgen.mechanics import derivative_bounds, dynamics, kinematics
from tests.coupled_chains import WRIST, coupled
from tests.robots import DATA

CHAINS: dict[str, Callable[[], Chain]] = {
    "tree": lambda: read_chain((DATA / "tree.urdf").read_text()),
    "gantry": lambda: read_chain((DATA / "gantry.urdf").read_text()),
    "coupled": lambda: coupled(WRIST),
}


@pytest.mark.parametrize("name", CHAINS)
def test_bounds_of_random_motions(name: str) -> None:
    """Oracle: τ, tip and link origins of polynomials in time, differentiated by CasADi."""
    chain = CHAINS[name]()
    n, rng = len(chain.coordinates), np.random.default_rng(1)
    pi = ca.DM(initial_parameters(chain, False)[0])
    t = ca.SX.sym("t")
    powers = ca.vertcat(*(t**k for k in range(6)))
    coefficients = ca.SX.sym("c", n, 6)
    moved = [ca.mtimes(coefficients, powers)]
    for _ in range(5):
        moved.append(ca.jacobian(moved[-1], t))
    tau = [dynamics.inverse_dynamics(chain, *moved[:3], pi)]
    place = [kinematics.end_effector(chain, moved[0])[:3, 3]]
    for _ in range(3):
        tau.append(ca.jacobian(tau[-1], t))
        place.append(ca.jacobian(place[-1], t))
    poses = kinematics.link_poses(chain, moved[0])
    origins = ca.horzcat(*(poses[4 * i : 4 * i + 3, 3] for i in range(len(chain.joints))))
    speeds = ca.reshape(ca.jacobian(ca.vec(origins), t), 3, -1)
    truth = ca.Function("truth", [coefficients, t], [ca.horzcat(*tau), *place, speeds, *moved])
    shape = ca.SX.sym("q_sup", 6, n)
    origin, turn = derivative_bounds.speed_bounds(chain, shape[:2, :])
    bounds = [derivative_bounds.torque_bounds(chain, shape, pi)]
    bounds += [derivative_bounds.tip_bounds(chain, shape[:4, :]), origin, turn]
    bounded = ca.Function("bounded", [shape], bounds)
    for size in (0.1, 1.0, 10.0):
        c = size * rng.normal(size=(n, 6))
        samples = [[np.array(x) for x in truth(c, s)] for s in np.linspace(0, 1, 21)]
        sup = np.max([np.hstack(row[6:]).T for row in np.abs(np.array(samples, dtype=object))], 0)
        torques, tip, origin_sup, turn_sup = (np.array(x) for x in bounded(sup.astype(float)))
        for row in samples:
            assert (torques >= np.abs(row[0]).T).all()
            lengths = [np.linalg.norm(x) for x in row[1:5]]
            assert (lengths <= tip.ravel()).all()
            assert (np.linalg.norm(row[5], axis=0) <= origin_sup.sum(axis=1)).all()
        slides = np.array([joint.kind == "prismatic" for joint in chain.joints])
        assert ((turn_sup.ravel() == 0) == slides).all()
