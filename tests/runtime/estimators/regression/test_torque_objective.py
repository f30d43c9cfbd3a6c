"""runtime.estimators.regression.samples: weights, loss and gradient on samples."""

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import IdentificationError
from runtime.estimators.regression.factor import TorqueObjective, friction_unit
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.library import Library
from runtime.recording import Friction
from runtime.recording.friction.model import add_columns
from tests.taylor import assert_second_order, taylor_slope


@pytest.fixture(scope="module")
def samples(noisy: Recording, lib: Library) -> Samples:
    return samples_of(add_columns(noisy, Friction()), lib)


@pytest.fixture(scope="module")
def objective(lib: Library, samples: Samples) -> TorqueObjective:
    return TorqueObjective(lib, samples, thesis_weights(samples.tau))


@pytest.fixture(scope="module")
def point(objective: TorqueObjective, lib: Library) -> np.ndarray:
    """λ and friction well away from any optimum."""
    rng = np.random.default_rng(3)
    lam = lib.lam0 * (1 + 0.1 * rng.normal(size=lib.lam0.size))
    return objective.join(lam, rng.uniform(0.1, 1.0, objective.shape))


def test_weights_of_eq_4_8_by_hand() -> None:
    """Oracle: τ_rms² of 0, 0.75 and 2.75 with σ² = 1/4 give 4, 1, 1/3 before the scaling."""
    tau = np.sqrt([0.0, 0.75, 2.75]) * np.array([[1.0], [-1.0]])
    # Four operations of rounding.
    assert thesis_weights(tau) == pytest.approx(np.array([12, 3, 1]) * 3 / 16, rel=1e-14)
    assert thesis_weights(tau).mean() == pytest.approx(1.0, rel=1e-15)


def test_loss_is_the_sum_it_says(
    lib: Library, samples: Samples, objective: TorqueObjective, point: np.ndarray
) -> None:
    """Oracle: (1/N) Σ ½ rᵀWr in a loop over samples, from Y π and the friction law."""
    lam, phi = objective.split(point)
    pi = lib.pi_from_lam(lam)
    total = 0.0
    for q, dq, ddq, tau in zip(samples.q, samples.dq, samples.ddq, samples.tau, strict=True):
        friction = phi[:, 0] * dq + phi[:, 1] * np.tanh(dq / 0.02) + phi[:, 2]
        residual = lib.regressor(q, dq, ddq) @ pi + friction - tau
        total += residual @ np.diag(objective.weights) @ residual / 2
    # Rounding of a sum of a thousand positive terms.
    assert objective.value(point) == pytest.approx(total / len(samples), rel=1e-12)
    assert objective.value_gradient(point)[0] == pytest.approx(total / len(samples), rel=1e-12)


def test_split_and_join_are_inverse(objective: TorqueObjective, point: np.ndarray) -> None:
    """Property: x → (λ, φ) → x; one unit of ψ moves its joint's torque by about its RMS."""
    # One product and one quotient.
    assert objective.join(*objective.split(point)) == pytest.approx(point, rel=1e-15)
    s = objective.samples
    moved = np.sqrt(np.mean(s.columns**2, axis=0)) * friction_unit(s)
    size = np.sqrt(np.mean(s.tau**2, axis=0) + 0.25)
    assert moved == pytest.approx(np.repeat(size[:, None], 3, axis=1), rel=1e-12)


@pytest.mark.parametrize("rows", [None, np.array([5, 900, 5, 17, 333])], ids=["all", "batch"])
@pytest.mark.parametrize("part", ["lam", "psi", "both"])
def test_gradient_by_taylor(
    objective: TorqueObjective, point: np.ndarray, rows: np.ndarray | None, part: str
) -> None:
    """Derivative: document Fig. 4.1, also with friction and on a mini-batch with repeats."""
    n_lam = objective.n_lam
    direction = np.random.default_rng(1).normal(size=point.size) * np.maximum(np.abs(point), 1e-2)
    if part != "both":
        direction[slice(n_lam, None) if part == "lam" else slice(0, n_lam)] = 0.0
    direction /= np.linalg.norm(direction)
    gradient = objective.value_gradient(point, rows)[1]
    measured = taylor_slope(
        lambda x: objective.value_gradient(x, rows)[0], point, direction, gradient @ direction
    )
    # In ψ the loss is a parabola: the slope is 2 from the first step to rounding.
    assert_second_order(measured)


def test_mini_batches_average_to_the_whole(objective: TorqueObjective, point: np.ndarray) -> None:
    """Property: the mean over a partition of the rows is the loss of all rows."""
    rows = np.random.default_rng(2).permutation(len(objective.samples))[:1000].reshape(10, 100)
    losses, gradients = zip(*(objective.value_gradient(point, r) for r in rows), strict=True)
    value, gradient = objective.value_gradient(point, rows.ravel())
    # Rounding of sums of a thousand terms; entries of the gradient cancel, hence the norm.
    assert np.mean(losses) == pytest.approx(value, rel=1e-12)
    difference = np.linalg.norm(np.mean(gradients, axis=0) - gradient)
    assert difference <= 1e-12 * np.linalg.norm(gradient)


def test_incomplete_recordings_are_refused(lib: Library, noisy: Recording) -> None:
    """Property: missing signals, another robot and NaN are one sentence each."""
    with pytest.raises(IdentificationError, match="has no ddq; let preprocessing"):
        samples_of(noisy.replace(ddq=None), lib)
    q = noisy.q[:, :6]
    with pytest.raises(IdentificationError, match="has 6 joints, the robot 'fr3' has 7"):
        samples_of(Recording(noisy.t, q, q, q, q), lib)
    tau = noisy.tau.copy()
    tau[3, 2] = np.nan
    with pytest.raises(IdentificationError, match="NaN or infinite"):
        samples_of(noisy.replace(tau=tau), lib)
