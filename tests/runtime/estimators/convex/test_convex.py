"""The convex room: barrier, prior, elimination, Newton, path; oracles are cvxpy and Clarabel."""

import cvxpy
import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.estimators.classical.pc_ols import SMALLEST_GAP, cone_optimum, gamma_sequence
from runtime.estimators.contradictions import prior_test
from runtime.estimators.convex.entropic_prior import (
    CAD,
    bodies_of,
    log_evidence,
    prior_about,
    prior_from,
    prior_of,
)
from runtime.estimators.convex.newton import HalfSpaces, _solved, convex_problem, minimise
from runtime.estimators.regression.factor import Reduced, Statistics, compress, reduce
from runtime.estimators.regression.samples import Samples
from runtime.library import Library
from tests.runtime.estimators.convex.paths import follow

NOISE = 0.05


def measured(lib, columns: int = 0, seed: int = 0, noise: float = NOISE) -> Samples:
    """Random states of a robot 10 % off its URDF, with friction columns and torque noise."""
    rng = np.random.default_rng(seed)
    q, dq, ddq = rng.normal(size=(3, 150, lib.n_joints))
    lam = lib.lam0 * (1 + 0.1 * rng.normal(size=lib.lam0.size))
    c = rng.normal(size=(150, lib.n_joints, columns))
    tau = lib.torque(q, dq, ddq, lam) + 0.3 * c.sum(axis=2)
    return Samples(q, dq, ddq, tau + noise * rng.normal(size=tau.shape), c)


def compressed(lib, columns: int = 0, seed: int = 0, noise: float = NOISE) -> Statistics:
    weights = np.full(lib.n_joints, 1 / max(noise, 1e-3) ** 2)
    return compress(lib, measured(lib, columns, seed, noise), weights)


def test_basis_says_all_about_p(robot):
    """Oracle: the library's P(π), and the barrier's derivatives by central differences."""
    lib = robot("tree")
    bodies = bodies_of(lib)
    rng = np.random.default_rng(1)
    pi = lib.pi_from_lam(lib.lam0 + 0.1 * rng.normal(size=lib.lam0.size))
    # Rounding of sums of ten terms.
    np.testing.assert_allclose(bodies.pseudo_inertia(pi), lib.pseudo_inertia(pi), atol=1e-14)
    traces, blocks = bodies.curvature(pi)
    step = 1e-6 * rng.normal(size=pi.size) * np.abs(pi).min()
    ahead, behind = bodies.log_det(pi + step), bodies.log_det(pi - step)
    slope = (traces * step.reshape(-1, 10)).sum(axis=1)
    # Cancellation: eps · |log det| ≈ 1e-14 over slopes of 1e-6.
    np.testing.assert_allclose((ahead - behind) / 2, slope, rtol=1e-6, atol=1e-13)
    turned = bodies.curvature(pi + step)[0] - bodies.curvature(pi - step)[0]
    along = -np.einsum("kij,kj->ki", blocks, step.reshape(-1, 10))
    np.testing.assert_allclose(turned / 2, along, rtol=1e-5, atol=1e-5 * np.abs(along).max())
    assert bodies.log_det(-pi) is None
    root = bodies.spread(pi)
    # Rounding over the condition of a curvature of a small link, 1e8.
    unit = np.swapaxes(root, 1, 2) @ blocks @ root
    np.testing.assert_allclose(unit, np.broadcast_to(np.eye(10), unit.shape), atol=1e-7)
    rod = pi.copy()
    rod[4:10] = 0.0  # a point mass but for 1e-13, whose curvature cannot be factored
    rod[4:7] = 1e-13
    rod[1:4] = 0.0
    assert np.isfinite(bodies.spread(rod)).all()


def test_prior_is_the_minimiser_of_its_divergence(fr3):
    """Property: without information the answer is the prior; its thin axes are at the floor."""
    prior = prior_of(fr3)
    nothing = Reduced(np.zeros((0, 70)), np.zeros(0), 0.0, 1.0, 1.0)
    start = fr3.pi_from_lam(fr3.lam0 * 1.3)
    minimum = minimise(convex_problem(nothing, prior, 1.0), start)
    assert minimum.converged
    # A decrement of 1e-3 is ½‖P0^-½ ΔP P0^-½‖²: 4.5 % per direction at most; Newton overshoots it.
    np.testing.assert_allclose(minimum.pi, prior.centre, rtol=1e-3, atol=1e-4)
    masses, sigma = prior.centre.reshape(-1, 10), fr3.pseudo_inertia(prior.centre)
    com = masses[:, 1:4] / masses[:, :1]
    about = sigma[:, :3, :3] - masses[:, 0, None, None] * com[:, :, None] * com[:, None]
    shares = np.linalg.eigvalsh(about)
    # Rounding of the shift to the centre of mass.
    assert (shares[:, 0] / shares.sum(axis=1)).min() >= 0.05 * (1 - 1e-6) / 1.15
    np.testing.assert_array_equal(masses[:, :4], fr3.pi0.reshape(-1, 10)[:, :4])


def test_the_centre_of_a_type_is_taken_as_it_is(fr3):
    """Property: thin axes of a first guess are raised, those of measured units are not."""
    thin = fr3.nearest_realisable(fr3.pi0, 1e-4)
    # Rounding of the decomposition of P.
    np.testing.assert_allclose(prior_about(fr3, fr3.pi0, thin).centre, thin, atol=1e-12)
    raised = prior_about(fr3, thin, None)
    np.testing.assert_array_equal(raised.centre, prior_of(fr3, thin).centre)
    assert np.abs(raised.centre - thin).max() > 1e-6


@pytest.mark.parametrize(("entry", "value"), [(20, -1.0), (20, 0.0), (21, np.nan), (26, np.inf)])
def test_a_prior_of_bad_numbers_names_the_link(fr3, entry, value):
    """Property: one mass that is not above 0 or one number that is not finite is refused."""
    pi = fr3.pi0.copy()
    pi[entry] = value
    with pytest.raises(IdentificationError, match=f"correct {fr3.link_names[2]} in the URDF"):
        prior_of(fr3, pi)
    with pytest.raises(IdentificationError):
        prior_from(bodies_of(fr3), pi)


def test_map_is_the_optimum_that_cvxpy_finds(robot):
    """Oracle: the same cost, spelled out for cvxpy and solved by Clarabel's exponential cones."""
    lib = robot("tree")
    data, _ = reduce(compressed(lib), lib.n_joints)
    prior = prior_of(lib)
    gamma = CAD * data.variance / data.count
    minimum = minimise(convex_problem(data, prior, gamma))
    assert minimum.converged
    basis = prior.bodies.basis
    scale = np.tile([1.0, *(0.1,) * 3, *(0.01,) * 6], lib.n_joints)
    x = cvxpy.Variable(scale.size)
    pi = cvxpy.multiply(scale, x)
    spread = np.diag([0.1, 0.1, 0.1, 1.0])
    shrink = np.linalg.inv(spread)
    cost = cvxpy.sum_squares(data.factor @ pi - data.target) / (2 * data.count)
    cost += gamma * (prior.slope @ pi)
    for k in range(lib.n_joints):
        p = sum(x[10 * k + i] * scale[i] * (shrink @ basis[i] @ shrink) for i in range(10))
        cost -= gamma * cvxpy.log_det(p)
    cvxpy.Problem(cvxpy.Minimize(cost)).solve(solver="CLARABEL")
    # A decrement of 1e-3 γ: √(2e-3) of a prior's standard deviation at worst, much less after
    # Newton's last step; cvxpy's own accuracy is 1e-6.
    np.testing.assert_allclose(minimum.pi, x.value * scale, rtol=2e-3, atol=2e-4)


@pytest.mark.parametrize(("factor", "rest", "unit"), [(0.0, 600.0, 3.0), (2.0, 0.0, 8e-9)])
def test_the_weights_fall_from_the_unexplained_loss_to_the_gap(factor, rest, unit):
    """Oracle: γ from 0.1 L₀ to 1e-7 L₀ / 4n by hand, each at most a tenth smaller than the last.

    L₀ = ρ/2N of 100 samples; where that is 0, 1e-9 of the loss of no torque, ‖b‖²/2N = 8.
    """
    data = Reduced(np.eye(70), np.full(70, factor * np.sqrt(400 / 70)), rest, 100.0, 1.0)
    gammas = gamma_sequence(data, 7)
    assert gammas[0] == pytest.approx(0.1 * unit, rel=1e-12)
    assert gammas[-1] == pytest.approx(1e-7 * unit / 28, rel=1e-12)
    ratios = gammas[:-1] / gammas[1:]
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-9)
    # ln(0.1 · 28 · 1e7) / ln 10 = 7.4: eight steps.
    assert (len(ratios), len(gamma_sequence(data, 7, shrink=2.0))) == (8, 26)


def test_a_singular_hessian_is_solved_in_the_units_of_its_diagonal():
    """Oracle: D [[1, 1], [1, 1]] D x = D (2, 2) has the smallest D x at (1, 1)."""
    sizes = np.array([1.0, 1e-6])
    x = _solved(np.outer(sizes, sizes), 2 * sizes, None)
    np.testing.assert_allclose(sizes * x, 1.0, rtol=0.05)  # 2 eps over the ridge of 1e-14


def test_newton_stops_at_a_stationary_point(fr3):
    """Property: the gradient by differences vanishes along random directions; P ≻ 0 strictly."""
    data, _ = reduce(compressed(fr3), 7)
    problem = convex_problem(data, prior_of(fr3), CAD * data.variance / data.count)
    minimum = minimise(problem)
    assert minimum.converged
    assert 1 <= minimum.steps <= 12
    assert fr3.relative_eigenvalues(minimum.pi).min() > 0
    hessian = minimum.hessian()
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-12 * np.abs(hessian).max())
    assert minimum.loss == pytest.approx(data.value(minimum.pi), rel=1e-14)
    again = minimise(problem, minimum.pi)
    assert again.steps == 0
    with pytest.raises(IdentificationError, match="start of the convex problem lies outside"):
        minimise(problem, -minimum.pi)


@pytest.mark.parametrize("columns", [0, 2])
def test_elimination_is_the_joint_least_squares(fr3, columns):
    """Oracle: lstsq over π and φ together reaches the same loss with the same φ."""
    statistics = compressed(fr3, columns)
    data, friction = reduce(statistics, 7)
    together = np.linalg.lstsq(statistics.over_pi(), statistics.target, rcond=1e-11)[0]
    pi, phi = together[:70], together[70:]
    # Rounding × condition number of 1e3.
    assert data.value(pi) == pytest.approx(statistics.value(pi, phi), rel=1e-9)
    np.testing.assert_allclose(friction.phi(pi), phi, rtol=1e-8, atol=1e-9)
    other = fr3.pi0
    assert data.value(other) == pytest.approx(statistics.value(other, friction.phi(other)))
    # ρ of noise σ with weights 1/σ² is one per degree of freedom: 1050 − 43 − φ; 3 σ of χ²/ν.
    assert data.variance == pytest.approx(1.0, abs=3 * np.sqrt(2 / 1000))


def test_silent_and_repeated_columns_get_zero(fr3):
    """Property: a column of zeros and a copy of another change neither loss nor finiteness."""
    s = measured(fr3, 1)
    twice = np.concatenate([s.columns, s.columns, np.zeros_like(s.columns)], axis=2)
    weights = np.full(7, 400.0)
    plain, _ = reduce(compress(fr3, s, weights), 7)
    data, friction = reduce(compress(fr3, Samples(s.q, s.dq, s.ddq, s.tau, twice), weights), 7)
    assert data.value(fr3.pi0) == pytest.approx(plain.value(fr3.pi0), rel=1e-9)
    assert data.freedom == plain.freedom
    phi = friction.phi(fr3.pi0).reshape(7, 3)
    assert np.isfinite(phi).all()
    assert (phi[:, 2] == 0).all()
    assert ((phi[:, 0] == 0) | (phi[:, 1] == 0)).all()


@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_path_ends_at_clarabels_optimum(fr3, noise):
    """Oracle: the second-order-cone program on the same rows; the bar is 1e-6 relative."""
    statistics = compressed(fr3, 1, noise=noise)
    data, _ = reduce(statistics, 7)
    path = follow(data, prior_of(fr3))
    cone = cone_optimum(fr3, statistics)
    silent = data.value(np.zeros(70))
    assert path.converged
    # Below 1e-9 of the loss of τ̂ = 0 both solvers only round.
    assert abs(path.losses[-1] - cone.loss) <= max(1e-6 * cone.loss, 1e-9 * silent)
    assert path.gap <= 1.1 * SMALLEST_GAP * max(path.losses[-1], 1e-9 * silent)
    assert (np.diff(path.losses) <= 1e-9 * path.losses[0]).all()
    assert (fr3.relative_eigenvalues(path.points) > 0).all()
    near = path.nearest(1e-3)
    assert near is not None
    assert data.value(near) <= 1.001 * path.losses[-1] + 1e-9 * silent


def test_half_spaces_and_subspaces_bind(fr3):
    """Property: a mass bound and a total mass hold; without them neither does."""
    data, _ = reduce(compressed(fr3), 7)
    prior = prior_of(fr3)
    gamma = CAD * data.variance / data.count
    free = minimise(convex_problem(data, prior, gamma)).pi
    heavy = np.zeros((1, 70))
    heavy[0, 0] = 1.0
    limit = np.array([0.8 * min(free[0], prior.centre[0])])
    start = prior.centre.copy()
    start[:10] *= 0.7 * limit[0] / start[0]
    inside = HalfSpaces(heavy, limit, 1e-2 * gamma)
    bound = minimise(convex_problem(data, prior, gamma, inside), start)
    assert bound.converged
    assert 0.9 * limit[0] < bound.pi[0] < limit[0]
    total = np.zeros((1, 70))
    total[0, ::10] = 1.0
    basis = np.linalg.svd(total)[2][1:].T
    fixed = convex_problem(data, prior, gamma, free=basis)
    held = minimise(fixed)
    assert held.converged
    # Rounding of sums over steps.
    assert held.pi[::10].sum() == pytest.approx(prior.centre[::10].sum(), rel=1e-12)
    assert free[::10].sum() != pytest.approx(prior.centre[::10].sum(), rel=1e-4)


def test_what_is_no_problem_is_refused(fr3):
    """Property: one sentence each."""
    data, _ = reduce(compressed(fr3), 7)
    prior = prior_of(fr3)
    with pytest.raises(IdentificationError, match="γ above 0"):
        convex_problem(data, prior, 0.0)
    with pytest.raises(IdentificationError, match="same bodies"):
        convex_problem(data, prior_from(prior.bodies, prior.centre[:10]), 1.0)
    with pytest.raises(IdentificationError, match="strictly consistent bodies"):
        prior_from(prior.bodies, np.zeros(10))
    light = fr3.pi0.copy()
    light[10] = 0.0
    with pytest.raises(IdentificationError, match="positive masses; correct fr3_link2"):
        prior_of(fr3, light)
    flat = fr3.pi0.copy()
    flat[4:7] = 0.0
    assert "fr3_link1" in prior_of(fr3, flat).notes[0]


def test_evidence_without_data_is_that_of_any_centre(fr3):
    """Property: the density of a prior is one over all bodies, thin or not, of any mass."""
    silent = np.zeros((1, fr3.pi0.size)), np.zeros(1)
    priors = [prior_of(fr3, scale * fr3.pi0, floor) for scale, floor in ((1, 0), (3, 0), (1, 0.05))]
    values = [log_evidence(each, *silent, CAD, each.centre) for each in priors]
    # Rounding of log |C| of 70 directions whose squares span 14 digits.
    np.testing.assert_allclose(values, values[0], atol=1e-6)


def test_evidence_contains_the_density_of_the_rows(fr3):
    """Oracle: ln N(b; A π, 1) of two targets, with the same rows and bodies."""
    rng = np.random.default_rng(0)
    rows, targets = rng.normal(size=(6, fr3.pi0.size)), rng.normal(size=(2, 6))
    prior = prior_of(fr3)
    logs = [log_evidence(prior, rows, b, CAD, prior.centre) for b in targets]
    densities = -np.sum((rows @ prior.centre - targets) ** 2, axis=1) / 2
    # Rounding of log |C|.
    assert logs[0] - logs[1] == pytest.approx(densities[0] - densities[1], abs=1e-6)


def test_the_statistic_of_a_prior_counts_rows_and_bodies(robot):
    """Oracle: ‖A π − b‖²/S + 2 κ Σ_k [tr X_k − ln det X_k − 4], X_k = P0_k⁻¹ P_k, at the MAP."""
    lib = robot("tree")
    data, _ = reduce(compressed(lib), lib.n_joints)
    prior, level = prior_of(lib), data.variance
    pi = minimise(convex_problem(data, prior, CAD * level / data.count)).pi
    now, then = (prior.bodies.pseudo_inertia(each) for each in (pi, prior.centre))
    ratio = np.linalg.solve(then, now)
    bodies = np.trace(ratio, axis1=1, axis2=2) - np.linalg.slogdet(ratio)[1] - 4
    rows = np.sum((data.factor @ pi - data.target) ** 2) / level
    test = prior_test(lib, data, prior, CAD, level)
    # A decrement of 1e-3 γ.
    assert test.statistic == pytest.approx(rows + 2 * CAD * bodies.sum(), rel=1e-3)
    assert bodies.sum() > 0.05


def test_the_thinnest_body_is_measured_about_its_centre_of_mass(fr3: Library) -> None:
    """Oracle: Σ_com = m/12 diag(a², b², c²) of a cuboid, far from the origin of its link."""
    basis = bodies_of(fr3).basis.reshape(10, 16)
    m, centre, moments = 3.0, np.array([0.3, -0.2, 0.5]), 0.25 * np.array([0.04, 0.01, 0.09])
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = np.diag(moments) + m * np.outer(centre, centre)
    matrix[:3, 3] = matrix[3, :3] = m * centre
    matrix[3, 3] = m
    pi = np.linalg.lstsq(basis.T, matrix.ravel(), rcond=None)[0]
    prior = prior_from(bodies_of(fr3), np.tile(pi, fr3.n_links))
    np.testing.assert_allclose(prior.thinnest(), 0.0025, rtol=1e-9)
