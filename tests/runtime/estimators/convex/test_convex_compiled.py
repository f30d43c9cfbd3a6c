"""The convex estimators in C against their NumPy reference; oracle of both is in test_convex."""

import dataclasses

import numpy as np
import pytest

from runtime.errors import LibraryError
from runtime.estimators.classical.pc_ols import follow_compiled
from runtime.estimators.convex.entropic_prior import CAD, bodies_of, prior_from, prior_of
from runtime.estimators.convex.newton import (
    Constraints,
    ConvexProblem,
    constrained,
    convex_problem,
    minimise,
    minimise_anywhere,
    solve,
    solve_many,
)
from runtime.estimators.regression.factor import reduce
from runtime.library import Library, load
from runtime.library.compiled_descent import CompiledConvex
from tests.robots import levels_here
from tests.runtime.estimators.convex.paths import follow
from tests.runtime.estimators.convex.test_convex import compressed
from tests.taylor import assert_second_order, taylor_slope


def problem(lib: Library, seed: int = 0, columns: int = 0) -> ConvexProblem:
    data, _ = reduce(compressed(lib, columns, seed), lib.n_joints)
    return convex_problem(data, prior_of(lib), CAD * data.variance / data.count)


@pytest.fixture(params=["fr3", "double"])
def arm(any_robot, request):
    """The FR3, and an arm of two joints, whose vectors are mostly their remainders."""
    return any_robot(request.param)


@pytest.mark.parametrize("columns", [0, 2])
@pytest.mark.parametrize("name", ["fr3", "tree", "double"])
def test_compiled_equals_reference(any_robot, name, columns):
    """Oracle: the NumPy steps, at every instruction set."""
    lib = any_robot(name)
    p = problem(lib, 1, columns)
    reference = minimise(p)
    for level in levels_here(lib):
        minimum = solve(load(lib.folder, level), p)
        assert (minimum.converged, minimum.steps) == (True, reference.steps)
        # Rounding through a Hessian of condition 1e6; measured 1e-11.
        size = np.abs(reference.pi).max()
        np.testing.assert_allclose(minimum.pi, reference.pi, atol=1e-8 * size)
        assert minimum.loss == pytest.approx(reference.loss, rel=1e-10)


def test_compiled_path_equals_reference(arm):
    """Oracle: the NumPy path; the same losses to far below its own certificate."""
    p = problem(arm, 2, 1)
    ours, theirs = follow_compiled(arm, p.data, p.prior), follow(p.data, p.prior)
    assert ours.converged
    assert theirs.converged
    np.testing.assert_allclose(ours.losses, theirs.losses, rtol=1e-9)
    np.testing.assert_array_equal(ours.gammas, theirs.gammas)
    assert ours.gap == pytest.approx(theirs.gap, rel=1e-2)
    assert ours.weight == pytest.approx(theirs.weight, rel=1e-3)


def test_many_are_the_same_as_one_by_one(arm):
    """Property: trials of one call equal single calls to the bit, for any number of threads."""
    problems = [problem(arm, seed) for seed in range(5)]
    alone = [solve(arm, p) for p in problems]
    assert len({m.loss for m in alone}) == 5
    for threads in (1, 2, 3, 9):
        for one, other in zip(alone, solve_many(arm, problems, threads=threads), strict=True):
            np.testing.assert_array_equal(one.pi, other.pi)
    assert solve_many(arm, []) == []


def test_data_far_from_the_prior_are_minimised_by_continuation(fr3):
    """Oracle: NumPy and C agree with 3 kg in the hand, where Newton's method alone fails."""
    p = problem(fr3)
    load = np.array([3.0, 0.06, -0.09, 0.45, 0.07, 0.07, 0.01, 0.002, -0.009, 0.0135])
    far = p.prior.centre.copy()
    far[-10:] += load
    p = dataclasses.replace(p, data=dataclasses.replace(p.data, target=p.data.factor @ far))
    direct = minimise(p)
    assert not direct.converged
    ours, theirs = solve(fr3, p), minimise_anywhere(p)
    assert ours.converged
    assert theirs.converged
    # Rounding through a Hessian of condition 1e6; measured 1e-14.
    np.testing.assert_allclose(ours.pi, theirs.pi, atol=1e-8 * np.abs(far).max())
    assert ours.loss < direct.loss / 5


def test_fewer_bodies_than_the_robot_has(arm):
    """Oracle: the reference, on the ten unknowns of one body: a payload."""
    whole = problem(arm)
    prior = prior_from(bodies_of(arm), whole.prior.centre[-10:])
    factor = whole.data.factor[:, -10:]
    rng = np.random.default_rng(0)
    target = factor @ prior.centre * 1.3 + rng.normal(size=len(factor))
    data = dataclasses.replace(whole.data, factor=factor, target=target)
    p = convex_problem(data, prior, 0.1)
    ours, theirs = solve(arm, p), minimise(p)
    assert ours.converged
    np.testing.assert_allclose(ours.pi, theirs.pi, atol=1e-9 * np.abs(theirs.pi).max())


def test_a_path_ends_where_steps_run_out(arm):
    """Property: with one or two steps per γ both stop at the same γ and say so."""
    p = problem(arm, 3)
    for most_steps in (1, 2):
        ours = follow_compiled(arm, p.data, p.prior, most_steps=most_steps)
        theirs = follow(p.data, p.prior, most_steps=most_steps)
        assert ours.converged == theirs.converged == (most_steps == 2 and arm.n_links == 2)
        assert len(ours.losses) == len(theirs.losses)
        assert len(ours.losses) < 9 or ours.converged
        np.testing.assert_allclose(ours.losses, theirs.losses, rtol=1e-9)


def test_a_level_without_the_program_is_refused(arm, monkeypatch):
    """Property: the reference level, the only one without it, is named by one sentence."""
    lib = load(arm.folder, "portable")
    monkeypatch.setattr(lib.binding, "of_level", lambda _: None)
    p = problem(lib)
    for call in (
        lambda: solve(lib, p),
        lambda: follow_compiled(lib, p.data, p.prior),
        lambda: CompiledConvex(lib.binding, [], 1e-3, 10),
    ):
        with pytest.raises(LibraryError, match=r"the level 'portable' .* has no compiled"):
            call()


def test_a_start_outside_does_not_converge(arm):
    """Property: C has no exceptions; an impossible start comes back as it was, unconverged."""
    p = problem(arm)
    minimum = solve(arm, p, -p.prior.centre)
    assert not minimum.converged
    assert minimum.steps == 0
    assert np.isfinite(minimum.pi).all()


def test_further_priors_without_any_change_nothing(arm):
    """Property: an empty set of constraints is the plain problem."""
    p = problem(arm)
    minimum, notes = constrained(Constraints(), p.data, p.prior, p.gamma)
    assert notes == ()
    # Another start: both stop within a decrement of 1e-3 γ, and Newton overshoots that.
    np.testing.assert_allclose(minimum.pi, solve(arm, p).pi, atol=1e-4)


def test_log_cholesky_is_the_factor_of_p(arm):
    """Oracle: P = U Uᵀ by numpy, and the Jacobian by Taylor remainders."""
    rng = np.random.default_rng(0)
    pi = arm.pi_from_lam(arm.lam0 + 0.05 * rng.normal(size=arm.lam0.size))
    theta = arm.cholesky_from_pi(pi)
    np.testing.assert_allclose(arm.pi_from_cholesky(theta), pi, rtol=1e-9, atol=1e-12)
    a, d, s, t = (theta.reshape(-1, 10)[0][k] for k in (0, slice(1, 4), slice(4, 7), slice(7, 10)))
    upper = np.diag([*np.exp(d), 1.0])
    upper[0, 1], upper[1, 2], upper[0, 2], upper[:3, 3] = s[0], s[1], s[2], t
    p = np.exp(2 * a) * upper @ upper.T
    np.testing.assert_allclose(p, arm.pseudo_inertia(pi)[0], rtol=1e-9, atol=1e-12)
    v = rng.normal(size=arm.lam0.size)
    blocks = arm.cholesky_jacobian(theta)
    along = np.einsum("kij,kj->ki", blocks, v.reshape(-1, 10)).ravel()
    assert_second_order(taylor_slope(arm.pi_from_cholesky, theta, v, along, 1e-1), 3.0)
    flat = arm.pi0.copy()
    flat[4:7] = 0.0
    assert np.isnan(arm.cholesky_from_pi(flat)).any()


def test_bodies_of_little_weight_are_solved_as_exactly(arm):
    """Property: with little γ for one body Newton ends by the smallest weight, not the largest.

    The gradient of that body then vanishes in units of its own γ: a decrement of 1e-3 γ_min leaves
    √(2e-3) of its prior's deviation at most, where one of 1e-3 γ_max could leave 45 of them.
    """
    p = problem(arm, 4)
    gamma = np.full(arm.n_links, p.gamma)
    # With 1e-6 neither converges on the FR3 within 200 steps; the arm of two joints does.
    gamma[-2] *= 1e-3 if arm.n_links > 2 else 1e-6
    weighted = convex_problem(p.data, p.prior, gamma)
    ours, theirs = solve(arm, weighted), minimise(weighted)
    assert ours.converged
    assert ours.decrement <= 1e-3 * gamma.min() or ours.decrement <= 4e-16 * ours.loss
    assert ours.steps == theirs.steps
    size = np.abs(theirs.pi).max()
    np.testing.assert_allclose(ours.pi, theirs.pi, atol=1e-6 * size)
