"""sensor_gains: its formulas on problems small enough to solve by hand."""

import numpy as np
import pytest

from runtime.errors import RuntimeFault
from runtime.estimators.regression.coloured_noise import ColouredNoise
from runtime.identification import sensor_gains as estimate
from runtime.identification.payload.body import KnownPayload, mount_of, pi_of_body
from runtime.identification.sensor_gains import (
    _common,
    _percent,
    identify_gains,
    linear,
    reduced,
    solve,
)

BODY = KnownPayload(3.0, np.array([0.08, 0.02, 0.05]), np.diag([0.004, 0.005, 0.003]))


def channels(theta, gains, columns, known):
    """Rows [1, X, y, τᵐ] of exact sensors, (n, N, p + 3)."""
    torque = gains[:, None] * (columns @ theta + known)
    ones = np.ones((*known.shape, 1))
    return np.concatenate([ones, columns, known[..., None], torque[..., None]], axis=2)


def test_the_linear_start_is_exact_for_exact_data():
    """Closed form: without noise a τᵐ − y = X θ holds in θ and a = 1/g, whatever the channels."""
    rng = np.random.default_rng(0)
    theta, gains = np.array([0.7, -1.3]), np.array([2.0, 0.5, -3.0])
    block = channels(theta, gains, rng.normal(size=(3, 20, 2)), rng.normal(size=(3, 20)))
    found = linear(block[:, :, 1:])
    np.testing.assert_allclose(found[0], theta, rtol=1e-12)
    np.testing.assert_allclose(found[1], gains, rtol=1e-12)


def test_a_gain_that_noise_hides_keeps_no_other_from_convergence():
    """Oracle: the truth. The load of the third joint is a tenth of its noise, its friction plain.

    Noise among the columns leads its linear start to 100 and above, or to the other side of 0.
    """
    gains, noise = np.array([1.1, 0.95, 0.9]), np.array([[0.01], [0.01], [1.0]])
    load = np.array([[1.0], [1.0], [0.1]])
    z = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        columns = np.zeros((3, 400, 4))
        columns[:, :, 0], known = load * rng.normal(size=(2, 3, 400))
        columns[[0, 1, 2], :, [1, 2, 3]] = np.sign(rng.normal(size=(3, 400)))
        block = channels(np.array([0.7, 1.0, 0.5, 8.0]), gains, columns, known)
        block[..., -1] += noise * rng.normal(size=(3, 400))
        solution = solve(reduced([block]), 400, 1)
        assert solution.converged, seed
        z.append((solution.g - gains) / np.linalg.norm(solution.root[4:7], axis=1))
    np.testing.assert_allclose(np.mean(np.square(z), axis=0), 1.0, atol=0.6)  # 2.3 σ of 30


def test_a_direction_that_is_not_excited_has_the_sigma_of_the_bound():
    """Closed form: of two equal columns of length l the difference is unseen.

    Scaled to length 1 they have the singular values √2 and 0, for which 1e-9 √2 stands: the σ of
    (θ₁ − θ₂)/√2 is noise / (1e-9 √2 l). θ = 0 makes the column of g orthogonal to both.
    """
    wave = np.sqrt(2) * np.sin(2 * np.pi * np.arange(40) / 40)  # of power 1
    known = np.roll(wave, 10)
    ripple = 0.01 * np.sqrt(2) * np.sin(6 * np.pi * np.arange(40) / 40)
    block = channels(np.zeros(2), np.ones(1), np.stack([wave, wave], axis=1)[None], known[None])
    block[..., -1] += ripple
    solution = solve(reduced([block]), 40, 1)
    assert solution.noise[0] == pytest.approx(0.01 * np.sqrt(40 / (40 - 1 - 3)))
    apart = np.array([1, -1, 0, 0]) / np.sqrt(2) @ solution.root
    expected = solution.noise[0] / (1e-9 * np.sqrt(2) * np.sqrt(40))
    assert np.linalg.norm(apart) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("apart", "is_common"), [(2.7, True), (2.85, False)])
def test_two_gains_are_common_below_the_quantile_of_one_degree_of_freedom(apart, is_common):
    """Closed form: d²/2σ² against 3.84, the 95 % quantile of χ² with one: d = 2.77 σ."""
    g = 1.2 + 0.01 * np.array([-0.5, 0.5]) * apart
    common = _common(g, 1e-4 * np.eye(2))
    assert common == (pytest.approx(1.2) if is_common else None)


def test_a_gain_that_is_wide_open_is_stated_up_to_a_factor_of_ten():
    """Known cases: a σ of three times the gain is a number, of ten times none."""
    assert [_percent(share) for share in (0.25, 3.0, 10.0)] == ["± 25 %", "± 300 %", "not at all"]


def test_sigma_grows_with_the_root_of_the_density(measured_runs, lib, monkeypatch):
    """Closed form: noise of nine times the density at one variance triples every σ of noise."""
    monkeypatch.setattr(estimate, "with_model_error", lambda *given: given[-1])
    sigma = []
    for density in (0.01, 0.09):  # every gain is determined
        coloured = ColouredNoise(density=density, variance=1.0)
        monkeypatch.setattr(estimate, "coloured_noise_of_basis", lambda *_, c=coloured: c)
        result = identify_gains(*measured_runs, lib, BODY)
        sigma.append(np.concatenate([result.sigma, result.bias_sigma.ravel()]))
    np.testing.assert_allclose(sigma[1], 3 * sigma[0], rtol=1e-9)


def test_intervals_contain_what_returns_with_the_posture(measured_runs, lib, monkeypatch):
    """Property: cables of 0.5 N·m/rad, the same in both runs, which intervals of noise ignore."""
    pair = [run.replace(tau=run.tau + 0.5 * np.sin(run.q)) for run in measured_runs]
    without = identify_gains(*measured_runs, lib, BODY).estimate
    found = identify_gains(*pair, lib, BODY)
    off = np.abs(found.estimate - without)[found.is_determined]
    assert np.all(off < 2 * found.sigma[found.is_determined])
    monkeypatch.setattr(estimate, "with_model_error", lambda *given: given[-1])
    alone = identify_gains(*pair, lib, BODY)
    assert np.max(np.abs(alone.estimate - without) / alone.sigma) > 3


def test_two_runs_without_any_torque_are_the_same(measured_runs, lib):
    """Known case: a log whose torques were never written holds zeros."""
    pair = [run.replace(tau=np.zeros_like(run.tau)) for run in measured_runs]
    with pytest.raises(RuntimeFault, match="hold the same torques"):
        identify_gains(*pair, lib, BODY)


@pytest.fixture(scope="module")
def measured_runs(ideal_runs, lib):
    """Two motions, the second with the payload, and noise."""
    rng, mount = np.random.default_rng(1), mount_of(lib)
    pi = pi_of_body(mount.bodies, BODY.mass, BODY.com, BODY.inertia)
    short = [run.take(slice(0, None, 5), "Every fifth row.") for run in ideal_runs[:2]]
    Y = lib.regressor(short[1].q, short[1].dq, short[1].ddq)[:, :, mount.columns]
    added = (0.0, Y @ np.linalg.solve(mount.to_frame, pi))
    return [
        run.replace(tau=run.tau + extra + 0.01 * rng.normal(size=run.tau.shape))
        for run, extra in zip(short, added, strict=True)
    ]
