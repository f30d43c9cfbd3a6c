"""Nuisance torque: intervals hold under cables that no column describes, and stay without them."""

import numpy as np

from runtime.estimators.regression.nuisance import SHAPES
from runtime.excitation import Trajectory
from runtime.identification.friction_intervals import friction_sigma
from runtime.identification.identified import Identification
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction
from runtime.simulation import Plant, ideal

NOISE = 0.05


def identified(
    lib: Library, trajectory: Trajectory, pi: np.ndarray, cable: float
) -> Identification:
    """An arm with cables that pull by `cable` N·m/rad, in turn to both sides."""
    plant = Plant(pi, viscous=0.5, coulomb=0.3, torque_noise=NOISE)
    log = ideal(lib, trajectory, plant, rng=np.random.default_rng(1))
    pull = cable * np.where(np.arange(lib.n_joints) % 2, 1, -1) * (log.q + np.sin(2 * log.q))
    return identify_recording(
        log.replace(tau=log.tau + pull), lib, friction=Friction(("viscous", "coulomb", "offset"))
    )


def test_intervals_hold_under_torque_that_no_column_describes(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Oracle: the true β of an arm with cables; without nuisance torque its σ is too small."""
    result = identified(lib, trajectories[0], pi_true, 1.0)
    posterior, n_pi = result.uncertainty, lib.pi0.size
    assert posterior is not None
    error = result.beta - lib.base_matrix @ pi_true
    bare = posterior.root[:, [*range(n_pi), -1]]
    bare_sigma = np.linalg.norm(lib.base_matrix @ bare, axis=1)
    first, second = (
        np.sqrt(np.mean((error / sigma) ** 2)) for sigma in (bare_sigma, posterior.beta_sigma)
    )
    assert first > 1.4
    assert second < 0.9 * first
    viscous = result.usual_phi[:, result.friction.columns.index("viscous")]
    sigma = friction_sigma(result)
    assert sigma is not None
    assert np.all(np.abs(viscous - 0.5) < 3 * sigma[:, result.friction.columns.index("viscous")])


def test_an_arm_without_nuisance_torque_has_none(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Property: white noise of a complete model widens nothing, but in one joint of 20."""
    posterior = identified(lib, trajectories[0], pi_true, 0.0).uncertainty
    assert posterior is not None
    assert posterior.root.shape[1] - lib.pi0.size - 1 <= SHAPES
    assert posterior.phi_nuisance.shape[1] == posterior.root.shape[1] - lib.pi0.size - 1
