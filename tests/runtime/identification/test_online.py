"""online and online.c: a replayed log is the whole log, and a changed arm is noticed."""

import ctypes

import numpy as np
import pytest

from runtime import OnlineEstimator
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, prior_of
from runtime.estimators.convex.newton import convex_problem, minimise
from runtime.estimators.regression.factor import compress, reduce
from runtime.estimators.regression.samples import samples_of
from runtime.recording import Friction
from runtime.recording.friction.model import add_columns


@pytest.fixture(autouse=True)
def _to_the_end(monkeypatch):
    """The oracle is minimised as far as its digits go."""
    monkeypatch.setattr("runtime.estimators.convex.newton.DECREMENT", 1e-12)


@pytest.fixture(scope="module")
def samples(noisy, lib):
    return samples_of(add_columns(noisy, Friction(("viscous", "coulomb"), 0.03)), lib)


def _motion(s):
    return s.q, s.dq, s.ddq, s.tau


def _bare(s):
    return type(s)(*_motion(s), s.columns[:, :, :0])


def _most_probable(lib, statistics):
    """The batch answer by NumPy's Newton."""
    data, eliminated = reduce(statistics, lib.n_joints)
    gamma = CAD * data.variance / data.count
    result = minimise(convex_problem(data, prior_of(lib), gamma))
    return result, eliminated.phi(result.pi)


def _same_torque(lib, s, a, b, tolerance):
    first, second = (lib.inverse_dynamics(s.q, s.dq, s.ddq, pi) for pi in (a, b))
    np.testing.assert_allclose(first, second, rtol=0, atol=tolerance)


@pytest.mark.parametrize("friction", [True, False])
@pytest.mark.parametrize("forgetting", [1.0, 0.99])
def test_a_replay_gives_what_the_batch_gives(friction, forgetting, lib, samples):
    """Oracle: `compress` of everything, each sample weighted by its age; Newton in NumPy."""
    s = samples if friction else _bare(samples)
    weights = np.linspace(1.0, 2.0, 7)
    k = s.columns.shape[2]
    online = OnlineEstimator(lib, weights, columns=k, forgetting=forgetting, every=97)
    last = None
    for start in (0, 1, 2, 300):  # one by one, then many at once
        stop = {0: 1, 1: 2, 2: 300, 300: len(s)}[start]
        part = [a[start:stop] for a in (*_motion(s), s.columns)]
        last = online.add(*part[:4], part[4] if friction else None) or last
    ages = forgetting ** np.arange(len(s) - 1, -1, -1.0)
    batch = compress(lib, s, weights, ages)
    # 1000 reflections in another order, of numbers of the triangle's size.
    scale = np.abs(batch.triangle()).max()
    np.testing.assert_allclose(
        online.statistics.triangle(), batch.triangle(), rtol=0, atol=1e-12 * scale
    )
    assert online.statistics.n_samples == pytest.approx(ages.sum(), rel=1e-12)
    now, (result, phi) = online.estimate(), _most_probable(lib, batch)
    assert last is not None
    assert now.converged
    # Newton ends within 1e-5 σ of the minimum at the latest, some 1e-7 N·m of torque.
    _same_torque(lib, s, now.pi, result.pi, 1e-6)
    np.testing.assert_allclose(now.phi.ravel(), phi, rtol=0, atol=1e-6)
    assert (lib.relative_eigenvalues(now.pi) > 0).all()


def test_a_load_taken_up_is_noticed_when_old_samples_fade(lib, ideal_runs, pi_true):
    """Property: with forgetting, link 7 gains the kilogram that hangs on it since half-time."""
    run = ideal_runs[0]
    rng = np.random.default_rng(0)
    heavier = pi_true.copy()
    heavier[60:] += [1.0, 0.0, 0.0, 0.1, 0.011, 0.011, 0.001, 0.0, 0.0, 0.0]
    masses = {}
    for forgetting in (1.0, 0.99):
        online = OnlineEstimator(lib, np.full(7, 400.0), forgetting=forgetting, every=250)
        for lap, pi in enumerate((pi_true, heavier, heavier)):
            tau = lib.inverse_dynamics(run.q, run.dq, run.ddq, pi)
            online.add(run.q, run.dq, run.ddq, tau + 0.05 * rng.normal(size=tau.shape))
            masses[forgetting, lap] = online.estimate().pi[60::10].sum()
    gained = {f: masses[f, 2] - masses[f, 0] for f in (1.0, 0.99)}
    # The load is shared with the directions that data do not see; half of it shows in the mass.
    assert gained[0.99] > gained[1.0]
    tau = lib.inverse_dynamics(run.q, run.dq, run.ddq, heavier)
    online = OnlineEstimator(lib, np.full(7, 400.0), forgetting=0.99, every=250)
    for pi in (pi_true, heavier, heavier):
        answer = online.add(
            run.q, run.dq, run.ddq, lib.inverse_dynamics(run.q, run.dq, run.ddq, pi)
        )
    predicted = lib.inverse_dynamics(run.q, run.dq, run.ddq, answer.pi)
    # 0.99^2000 of the light arm is left: 2e-9.
    assert np.linalg.norm(predicted - tau) < 1e-3 * np.linalg.norm(tau)


class _State:
    """`<robot>_online` of the header as one buffer, field after field."""

    def __init__(self, lib):
        n, base = lib.n_joints, len(lib.base_columns)
        width = -(-10 * n // 8) * 8
        work = 2 * width * width + 5 * width + 2 * base
        sizes = [4, 2, (base + 1) ** 2, width, width, width, n, base * width, base, work]
        self.buffer = np.zeros(sum(sizes))
        ends = np.cumsum(sizes)
        self.count, self.pi = self.buffer[2:3], self.buffer[ends[2] : ends[2] + 10 * n]
        self.factor = self.buffer[ends[1] : ends[2]].reshape(base + 1, base + 1)
        self.rejected = self.buffer[5:6].view(np.int64)


def test_the_plain_c_gives_the_same(lib, samples):
    """Oracle: the class in Python, which keeps its own triangle and calls another solver."""
    s = _bare(samples)
    online = OnlineEstimator(lib, every=10_000, kappa=CAD)
    online.add(*_motion(s))
    wanted = online.estimate()
    dll = ctypes.CDLL(str(lib.folder / f"lib{lib.name}.so"))
    pointer, number = ctypes.c_void_p, ctypes.c_double
    start, sample = dll.fr3_online_start, dll.fr3_online_sample
    start.argtypes, sample.argtypes = (pointer, pointer, number, number), (pointer,) * 6
    solve = dll.fr3_online_solve
    solve.argtypes = (pointer, pointer, ctypes.c_long)
    state, ones = _State(lib), np.ones(7)
    here = state.buffer.ctypes.data
    assert start(here, lib.pi0.ctypes.data, 1.0, CAD) == 1
    convex = ctypes.cast(dll[f"fr3_{lib.level}_convex"], pointer)
    assert solve(here, convex, 50) == 0  # nothing seen yet
    np.testing.assert_allclose(state.pi, prior_of(lib).centre, rtol=1e-12)
    for row in zip(*_motion(s), strict=True):
        assert sample(here, *(a.ctypes.data for a in (*row, ones))) == 1
    bad = np.full(7, np.nan)
    assert sample(here, *(a.ctypes.data for a in (bad, bad, bad, bad, ones))) == 0
    assert state.rejected[0] == 1
    assert state.count[0] == len(s)
    assert solve(here, convex, 50) == 1
    triangle = online.statistics.triangle()
    scale = np.abs(triangle).max()
    np.testing.assert_allclose(state.factor, triangle, rtol=0, atol=1e-12 * scale)
    _same_torque(lib, s, state.pi, wanted.pi, 1e-6)
    impossible = -lib.pi0
    assert start(here, impossible.ctypes.data, 1.0, CAD) == 0
    assert start(here, lib.pi0.ctypes.data, 1.5, CAD) == 0


def test_what_cannot_be_used_is_reported(lib, samples):
    """Property: samples that are not finite are left out and counted; wrong shapes are named."""
    s = _bare(samples)
    online = OnlineEstimator(lib, every=50)
    nothing = online.estimate()
    assert "too few samples" in nothing.status
    np.testing.assert_array_equal(nothing.pi, prior_of(lib).centre)
    tau = s.tau.copy()
    tau[3, 2], tau[5, 0] = np.nan, np.inf
    result = online.add(s.q, s.dq, s.ddq, tau)
    assert result.rejected == 2
    assert "2 samples were not finite and were left out" in result.status
    assert np.isfinite(result.pi).all()
    clean = OnlineEstimator(lib, every=10_000)
    keep = np.isfinite(tau).all(axis=1)
    clean.add(*(a[keep] for a in (s.q, s.dq, s.ddq, tau)))
    a, b = online.statistics.triangle(), clean.statistics.triangle()
    np.testing.assert_array_equal(a, b)
    still = OnlineEstimator(lib, every=10)
    zero = np.zeros((20, 7))
    assert np.isfinite(still.add(zero, zero, zero, zero).pi).all()
    with pytest.raises(IdentificationError, match="7 joints and 0 friction columns, got"):
        online.add(s.q[:, :6], s.dq, s.ddq, s.tau)
    for options, message in (
        ({"forgetting": 0.0}, "forgetting factor above 0"),
        ({"every": 0}, "every ≥ 1"),
        ({"weights": np.zeros(7)}, "7 weights above 0"),
    ):
        with pytest.raises(IdentificationError, match=message):
            OnlineEstimator(lib, **options)
