"""Score test of columns that a fit lacks: χ² distributed without them, and large with them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from runtime.estimators.contradictions import friction_test, score_test
from runtime.estimators.regression import coloured_noise
from runtime.estimators.regression.causes import causes_of_rows
from runtime.estimators.regression.coloured_noise import coloured_noise_of_basis
from runtime.estimators.regression.model_error import free_fit
from runtime.estimators.regression.samples import samples_of
from runtime.library import Library
from runtime.recording import Recording

DRAWS = 16


def test_the_statistic_is_chi_square(lib: Library, noisy: Recording) -> None:
    """Oracle: mean of χ² with 14 degrees of freedom; 4 standard errors of 16 draws are 5.3."""
    samples = samples_of(noisy, lib)
    n, count = lib.n_joints, len(samples)
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(count * n, 14))
    statistics = []
    for _ in range(DRAWS):
        drawn = replace(samples, tau=rng.normal(size=(count, n)))
        test = score_test(free_fit(lib, drawn, np.ones(n)), columns)
        statistics.append(test.statistic)
        assert test.density == pytest.approx(1.0, abs=0.15)
    assert np.mean(statistics) == pytest.approx(14.0, abs=4 * np.sqrt(2 * 14 / DRAWS))


def test_the_basis_of_a_fit_is_transformed_once(
    lib: Library, noisy: Recording, monkeypatch
) -> None:
    """Property: a test transforms its own columns only. Oracle: noise of all columns together."""
    samples = samples_of(noisy, lib)
    n = lib.n_joints
    fit = free_fit(lib, samples, np.ones(n))
    columns = np.random.default_rng(3).normal(size=(len(samples) * n, 5))
    widths = []
    whole = coloured_noise._taken_up
    with monkeypatch.context() as patch:
        patch.setattr(coloured_noise, "_taken_up", lambda q: widths.append(q.shape[2]) or whole(q))
        test = score_test(fit, columns)
    assert set(widths) == {5}
    basis = np.linalg.qr(np.hstack([fit.basis, columns]))[0]
    rest = fit.rest - basis @ (basis.T @ fit.rest)
    together = basis.reshape(len(samples), n, -1), rest.reshape(-1, n)
    assert test.density == pytest.approx(coloured_noise_of_basis([together], 1).density, rel=1e-12)


def test_columns_of_the_fit_add_nothing(lib: Library, noisy: Recording) -> None:
    """Property: columns that the fit has already, and joints at rest, are no test."""
    fit = free_fit(lib, samples_of(noisy, lib), np.ones(lib.n_joints))
    assert score_test(fit, fit.basis[:, :3]) is None
    still = replace(fit.samples, dq=0.0 * fit.samples.dq)
    assert friction_test(replace(fit, samples=still)) is None


def test_friction_of_a_load_is_found_at_its_joint(
    lib: Library, ideal_runs: tuple[Recording, ...]
) -> None:
    """Property: 20 % of the load in joint 5, beside a joint at rest, and in any unit of time."""
    samples = samples_of(ideal_runs[0], lib)
    noise = 0.05 * np.random.default_rng(4).normal(size=samples.tau.shape)
    tau, weights = samples.tau + noise, np.full(lib.n_joints, 400.0)
    tau[:, 4] += 0.2 * np.sign(samples.dq[:, 4]) * np.abs(samples.tau[:, 4])
    fit = free_fit(lib, replace(samples, tau=tau), weights)
    moving = np.arange(lib.n_joints) > 0
    one, other = (
        friction_test(replace(fit, samples=replace(fit.samples, dq=fit.samples.dq * scale)))
        for scale in (moving, 60.0 * moving)
    )
    plain = friction_test(free_fit(lib, replace(samples, tau=samples.tau + noise), weights))
    assert not plain.is_contradicted
    assert not plain.joints.any()  # those are for names in a sentence
    assert one.is_contradicted
    assert one.names(lib) == [lib.joint_names[4]]
    assert one.joints[0] == 0.0
    np.testing.assert_allclose(one.joints, other.joints, rtol=1e-9)


def test_a_gain_of_a_joint_with_little_torque(
    lib: Library, ideal_runs: tuple[Recording, ...]
) -> None:
    """Oracle: a gain of 2 at joint 7, whose torque is a hundredth of that of joint 2."""
    samples = samples_of(ideal_runs[0], lib)
    noise = 0.005 * np.random.default_rng(4).normal(size=samples.tau.shape)
    tau, weights = samples.tau + noise, np.full(lib.n_joints, 4e4)
    tau[:, 6] *= 2.0
    best = causes_of_rows(lib, replace(samples, tau=tau), weights, lib.pi0).named[0]
    assert (best.kind, best.joint) == ("gain", 6)
    assert 0.5 < best.size < 1.5


def test_a_delay_that_is_too_small_is_no_other_cause(
    lib: Library, ideal_runs: tuple[Recording, ...]
) -> None:
    """Property: 0.4 ms of delay in little noise are far above chance, and no zero or gain."""
    samples, t = samples_of(ideal_runs[0], lib), ideal_runs[0].t
    noise = 0.001 * np.random.default_rng(4).normal(size=samples.tau.shape)
    tau = samples.tau - 4e-4 * np.gradient(samples.tau, t, axis=0) + noise
    seen = causes_of_rows(lib, replace(samples, tau=tau), np.full(lib.n_joints, 1e6), lib.pi0)
    (delay,) = (each for each in seen.ranked if each.kind == "delay")
    assert delay.statistic > 10 * delay.threshold
    assert delay.size == pytest.approx(4e-4, rel=0.2)
    assert not seen.named


@pytest.mark.parametrize(("joints", "step"), [(7, 4), (28, 12)])
def test_robots_of_many_joints_take_fewer_samples(joints: int, step: int) -> None:
    """Oracle: 6000 samples: every fourth is 1500; every twelfth of 28 joints 14,000 equations."""

    class Taken(Exception):
        """Ends the fit where it has chosen its samples."""

    def take(chosen: slice) -> None:
        assert chosen == slice(None, None, step)
        raise Taken

    class Many:
        equations, rows = joints, staticmethod(take)

        def __len__(self) -> int:
            return 6000

    with pytest.raises(Taken):
        free_fit(SimpleNamespace(n_joints=joints), Many(), np.ones(joints))
