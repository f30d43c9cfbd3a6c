"""Nuisance torque: intervals hold under cables that no column describes, and stay without them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from runtime.estimators.regression import model_error
from runtime.estimators.regression.model_error import (
    KINDS,
    SHAPES,
    SLOW,
    common_size,
    free_fit,
    nuisance_columns,
    nuisance_of,
    nuisance_sizes,
    size_posterior,
)
from runtime.estimators.regression.samples import Samples
from runtime.excitation import Trajectory
from runtime.identification.identified import Identification
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Recording
from runtime.recording.settings import DAHL_STROKE, STRIBECK_SPEED
from runtime.simulation import Plant, ideal

NOISE = 0.05
TERMS = Friction(("viscous", "coulomb", "offset"))


def identified(
    lib: Library, trajectory: Trajectory, pi: np.ndarray, cable: float
) -> Identification:
    """An arm with cables that pull by `cable` N·m/rad, in turn to both sides."""
    plant = Plant(pi, viscous=0.5, coulomb=0.3, torque_noise=NOISE)
    log = ideal(lib, trajectory, plant, rng=np.random.default_rng(1))
    pull = cable * np.where(np.arange(lib.n_joints) % 2, 1, -1) * (log.q + np.sin(2 * log.q))
    return identify_recording(log.replace(tau=log.tau + pull), lib, friction=TERMS, gain_sigma=0)


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
    sigma = result.friction_sigma
    assert sigma is not None
    assert np.all(np.abs(viscous - 0.5) < 3 * sigma[:, result.friction.columns.index("viscous")])


def test_intervals_hold_under_friction_that_depends_on_the_position(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Oracle: the mean viscous friction over a turn, of an arm whose friction varies by 20 %."""
    plant = Plant(pi_true, viscous=0.5, coulomb=0.3, torque_noise=NOISE)
    log = ideal(lib, trajectories[0], plant, rng=np.random.default_rng(1))
    friction = 0.5 * log.dq + 0.3 * np.tanh(log.dq / 0.02)
    tau = log.tau + 0.2 * np.sin(log.q + np.arange(lib.n_joints)) * friction
    result = identify_recording(log.replace(tau=tau), lib, friction=TERMS, gain_sigma=0)
    sigma, column = result.friction_sigma, result.friction.columns.index("viscous")
    assert sigma is not None
    error = (result.usual_phi[:, column] - 0.5) / sigma[:, column]
    assert np.sqrt(np.mean(error**2)) < 1.5


def test_an_arm_without_nuisance_torque_has_none(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Property: white noise of a complete model widens σ by a tenth at most."""
    posterior = identified(lib, trajectories[0], pi_true, 0.0).uncertainty
    assert posterior is not None
    bare = np.linalg.norm(lib.base_matrix @ posterior.root[:, [*range(lib.pi0.size), -1]], axis=1)
    assert np.median(posterior.beta_sigma / bare) < 1.1
    assert posterior.phi_nuisance.shape[1] == posterior.root.shape[1] - lib.pi0.size - 1


def test_intervals_contain_errors_of_torque_gains(
    lib: Library,
    trajectories: tuple[Trajectory, ...],
    pi_true: np.ndarray,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Oracles: a common factor of all torques scales β; single gains are seen in the residual.

    Of gains N(0, σ²) each, the factor in common has σ/√7, and is all that a log of little noise
    leaves open: the largest β have it to 20 %, and the friction of a joint, whose columns are of
    that joint alone, at least that. Where gains differ by σ, the intervals hold, and without the
    gains they do not. Joints that agree show that σ is smaller than stated: a quarter of it or less
    at 6 degrees of freedom and hardly any noise. What predicts readings of the same sensors has no
    columns of gains.
    """
    sigma, steps = 0.02, {"friction": TERMS, "refit": False}
    rng = np.random.default_rng(1)
    log = ideal(lib, trajectories[0], Plant(pi_true, viscous=0.5, coulomb=0.3, torque_noise=1e-3))
    shown = identify_recording(log, lib, gain_sigma=sigma, **steps).uncertainty
    assert 0 < shown.gain_sigma < sigma / 4
    with monkeypatch.context() as as_stated:
        as_stated.setattr(model_error, "common_size", lambda *given: given[-1])
        exact = identify_recording(log, lib, gain_sigma=sigma, **steps)
    known, size = exact.uncertainty, np.abs(exact.beta)
    gains = lib.base_matrix @ known.root[:, -1 - known.gains : -1]
    large = size > 0.1 * size.max()
    common = np.linalg.norm(gains, axis=1)[large] / (sigma / np.sqrt(lib.n_joints) * size[large])
    assert np.abs(common - 1).max() < 0.2
    bare = identify_recording(log, lib, gain_sigma=0, **steps)
    rounding = {"rtol": 1e-9, "atol": 1e-12}
    np.testing.assert_allclose(known.readings_root, bare.uncertainty.root, **rounding)
    posterior = exact.posterior
    assert posterior is not None
    phi = posterior.phi_over(posterior.reduced(lib)[1])[:, -1 - known.gains : -1]
    viscous = np.linalg.norm(phi, axis=1).reshape(exact.phi.shape)[:, 0]
    assert np.all(viscous > 0.99 * 0.5 * sigma / np.sqrt(lib.n_joints))
    assert np.all(viscous < 0.5 * sigma)
    assert posterior.of_readings().pi_root.shape == bare.uncertainty.root.shape

    true, scores = lib.base_matrix @ pi_true, {0.0: [], sigma: []}
    for _ in range(4):
        wrong = log.replace(tau=log.tau * (1 + sigma * rng.normal(size=lib.n_joints)))
        for assumed, errors in scores.items():
            result = identify_recording(wrong, lib, gain_sigma=assumed, **steps)
            is_known = np.array(result.uncertainty.beta_verdicts) == "identified"
            errors.append(((result.beta - true) / result.uncertainty.beta_sigma)[is_known])
    held = {each: np.mean(np.abs(np.concatenate(e)) < 1.96) for each, e in scores.items()}
    assert held[sigma] > 0.9
    assert held[0.0] < 0.85


def test_the_size_in_common_is_that_of_the_scores() -> None:
    """Oracles: known shapes s of 40 directions, seen nearly without noise; no data, and large s."""
    rng, zero = np.random.default_rng(4), np.zeros((3, 3))
    assert common_size(zero, zero[0], 1.0, 0.02) == pytest.approx(0.02, rel=1e-12)
    shapes = rng.normal(size=(60, 40))
    gram = shapes.T @ shapes
    for true, stated in ((0.005, 0.005), (0.02, 0.02), (0.1, 0.02)):
        s = true * rng.normal(size=40)
        z = gram @ s + shapes.T @ (1e-4 * rng.normal(size=60))
        # σ of 40 directions: 1/√80 of it, three times.
        assert common_size(gram, z, 1e-8, 0.02) == pytest.approx(stated, rel=3 / 80**0.5)


def test_a_peak_follows_the_presliding_state_and_a_bend_has_no_slope(double: Library) -> None:
    """Oracles: the Dahl state, step by step and in closed form; normal equations of a line.

    On the way s back from a reversal the state is ζ = −1 + (1 + ζ₀) e^(−s/σ), with the stroke σ; a
    peak at constant speed follows it. Of a root of the speed, least squares over ζ, dq and 1 leaves
    nothing: a bend changes neither the viscous coefficient nor the peak. Friction of the load is
    the share of the largest weight, with the sign of the motion. Of states of half and twice the
    stroke the difference is that of two exponential functions of the way.
    """
    step = DAHL_STROKE / 100
    there = step * np.arange(1000.0)
    way = step * np.arange(1.0, 1000.0)
    t = np.arange(1000.0)
    for path, rate in (
        (np.concatenate([there, there[-1] - way]), 10.0),
        (0.3 * np.sin(t / 100) + np.sin(t / 30), 100.0),
    ):
        q = np.tile(path[:, None], 2)
        dq = rate * np.gradient(q, axis=0)
        rows = Samples(q, dq, 0 * q, 0 * q, np.zeros((*q.shape, 0)))
        every = nuisance_columns(double, double.pi0, rows)
        load, bend, peak, lag = every[:, 0, -4:].T
        strokes = DAHL_STROKE * np.array([1.0, 0.5, 2.0])
        states = np.zeros((len(path), 3))
        for k, move in enumerate(np.diff(path)):
            stays = np.exp(-abs(move) / strokes)
            states[k + 1] = np.sign(move) + (states[k] - np.sign(move)) * stays
        state, early, late = states.T
        np.testing.assert_allclose(lag, early - late, rtol=0, atol=1e-12)
        assert np.abs(lag).max() > 0.4  # of ζ = 1 − e^(−s/σ) from rest
        if rate < 100:
            behind = -1 + (1 + state[999]) * np.exp(-way / DAHL_STROKE)
            np.testing.assert_allclose(state[1000:], behind, rtol=0, atol=1e-12)
        weight = np.abs(double.inverse_dynamics(q, 0 * q, 0 * q, double.pi0)[:, 0])
        slides = np.abs(dq[:, 0]) > 4 * SLOW  # tanh 4 = 1 − 7e-4
        share = np.sign(dq[:, 0]) * weight / weight.max()
        np.testing.assert_allclose(load[slides], share[slides], rtol=1e-3, atol=1e-12)
        assert slides.sum() > 500 or rate < 100
        at_speed = np.exp(-((dq[:, 0] / STRIBECK_SPEED) ** 2))
        np.testing.assert_allclose(peak, state * at_speed, rtol=0, atol=1e-12)
        line = np.column_stack([state, dq[:, 0], np.ones(len(path))])
        line /= np.linalg.norm(line, axis=0)
        # Rounding of as many samples.
        assert np.abs(line.T @ bend).max() < 1e-12 * len(path)
        assert np.linalg.norm(bend) > 0.1 or rate < 100


def test_rows_of_momenta_have_no_nuisance_torque(double: Library) -> None:
    """Property: its shapes are torques of instants; the same rows of instants have some."""
    t = np.arange(2000)[:, None] / 100.0
    q = np.sin(t * [1.0, 1.7])
    dq = np.gradient(q, 0.01, axis=0)
    motion = q, dq, np.gradient(dq, 0.01, axis=0)
    tau = double.inverse_dynamics(*motion, double.pi0) + np.sin(2 * q)
    tau += 0.01 * np.random.default_rng(0).normal(size=q.shape)
    instants = Samples(*motion, tau, np.zeros((*q.shape, 0)))
    momenta = replace(instants, acceleration=None, base=instants.base_rows(double))
    found = [
        nuisance_of(double, free_fit(double, each, np.ones(2)), double.pi0, 1e-4).scores.shape[1]
        for each in (instants, momenta)
    ]
    assert found[0] > 0
    assert found[1] == 0


def test_the_posterior_of_sizes_is_that_of_their_scores() -> None:
    """Oracle: C⁻¹ = G/S + Λ⁻¹ and s̄ = C z/S by inverses, with sizes of three scales."""
    rng = np.random.default_rng(3)
    gram, z, sizes = (
        np.cov(rng.normal(size=(3, 9))),
        rng.normal(size=3),
        np.array([0.01, 1.0, 30.0]),
    )
    root, mean = size_posterior(gram, z, 0.2, sizes)
    covariance = np.linalg.inv(gram / 0.2 + np.diag(sizes**-2.0))
    np.testing.assert_allclose(root @ root.T, covariance, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(mean, covariance @ z / 0.2, rtol=1e-9)


def test_shapes_of_a_kind_have_one_size() -> None:
    """Oracle: orthogonal shapes of 0.03, 0.3 and 0.1 by their kind, with noise of 0.001.

    The mean of five squares has an error of √(2/5), of which a size has half; candidates are 1.6
    apart. A joint whose other columns take up all of its shapes has the size of the others.
    """
    rng, ranges = np.random.default_rng(6), np.full(7, 30.0)
    true = np.array([0.03, 0.3, 0.1])[KINDS]
    grams = np.repeat(np.eye(SHAPES)[None], 7, axis=0)
    scores = true * rng.normal(size=(7, SHAPES))
    sizes = nuisance_sizes(grams, scores, 1e-6, ranges)
    assert np.abs(np.log(sizes.mean(axis=0) / true)).max() < np.log(1.6) / 2
    assert len(set(sizes[0].tolist())) == 3
    grams[0], scores[0] = 1e-6 * grams[0], 1e-6 * scores[0]
    hidden = nuisance_sizes(grams, scores, 1e-6, ranges)
    assert np.abs(np.log(hidden[0] / true)).max() < np.log(1.6)  # √(2/5)/2, and 1/√6 of the law
    np.testing.assert_allclose(hidden[1:], sizes[1:], rtol=0.05)
    nothing = nuisance_sizes(grams[1:], 1e-3 * rng.normal(size=(6, SHAPES)), 1e-6, ranges[1:])
    assert nothing.max() < 1e-4 * 30


def test_intervals_contain_a_cable_that_the_columns_take_up(double: Library) -> None:
    """Oracle: the true β; within ±0.5 rad, a cable is a mass beside the link and an offset.

    The other joint moves far, and shows that there are cables.
    """
    t, z = np.arange(3000) / 100.0, []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        small = 0.5 * np.sin(2 * t + seed) + 0.06 * np.sin(5 * t)
        q = np.column_stack([small, 2.5 * np.sin(3 * t)])
        dq = np.gradient(q, t, axis=0)
        ddq = np.gradient(dq, t, axis=0)
        tau = double.inverse_dynamics(q, dq, ddq, double.pi0) + 0.3 * np.tanh(dq / 0.01) + 0.2 * dq
        tau = tau + 0.5 * q * rng.choice([-1, 1], 2) + 0.1 * rng.normal(size=q.shape)
        log = Recording(t, q, dq, ddq, tau, joint_names=double.joint_names)
        result = identify_recording(log, double, friction=TERMS, gain_sigma=0)
        is_known = np.array(result.uncertainty.beta_verdicts) == "identified"
        error = result.beta - double.base_matrix @ double.pi0
        z.append((error / result.uncertainty.beta_sigma)[is_known])
    assert np.mean(np.abs(np.concatenate(z)) < 1.96) > 0.85


def test_a_placeholder_of_a_limit_is_no_torque_range() -> None:
    """Oracle: by hand; limits of 0, below the torque, and all of a hundred times as much."""
    tau = np.array([[1.0, -2.0, 3.0, 4.0, 5.0], [-2.0, 1.0, -4.0, 1.0, 0.0]])
    for effort, ranges in (
        ([30.0, 0.0, 1.0, 1000.0, np.inf], [30.0, 2.0, 4.0, 1000.0, 5.0]),
        ([2000.0, 0.0, 1.0, 1000.0, np.inf], [2.0, 2.0, 4.0, 4.0, 5.0]),
    ):
        lib = SimpleNamespace(limits=lambda effort=effort: {"effort": np.array(effort)})
        assert model_error.torque_ranges(lib, tau).tolist() == ranges
