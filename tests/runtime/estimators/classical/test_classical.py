"""runtime.estimators.classical: OLS and the convex optimum, against independent formulations."""

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from runtime import Identification, Recording
from runtime.errors import IdentificationError
from runtime.estimators.classical.least_squares import fit_ols
from runtime.estimators.classical.pc_ols import SLACK, ConvexOptimum, convex_optimum, fit_pc_ols
from runtime.estimators.problem import Problem, best_friction
from runtime.estimators.regression.factor import Statistics, compress
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction
from runtime.recording.friction.model import add_columns


def problem_of(lib: Library, samples: Samples) -> Problem:
    return Problem(lib, samples, samples, thesis_weights(samples.tau), lib.lam0)


@pytest.fixture(scope="module")
def clean(lib: Library, ideal_runs: tuple[Recording, ...]) -> Problem:
    """Noise-free, no friction."""
    return problem_of(lib, samples_of(ideal_runs[0], lib))


@pytest.fixture(scope="module")
def measured(lib: Library, noisy: Recording) -> Problem:
    """Friction and noise."""
    recording = add_columns(noisy, Friction(("viscous", "coulomb"), 0.03))
    return problem_of(lib, samples_of(recording, lib))


@pytest.fixture(scope="module")
def measured_statistics(measured: Problem) -> Statistics:
    return measured.statistics()


@pytest.fixture(scope="module")
def optimum(lib: Library, measured_statistics: Statistics) -> ConvexOptimum:
    return convex_optimum(lib, measured_statistics)


def stacked(lib: Library, samples: Samples) -> np.ndarray:
    """All rows [Y_b F], (N n, n_b + n k), without compression."""
    y = lib.base_regressor(samples.q, samples.dq, samples.ddq)
    count, n, k = samples.columns.shape
    spread = np.zeros((count, n, n * k))
    for j in range(n):
        spread[:, j, j * k : (j + 1) * k] = samples.columns[:, j]
    return np.concatenate([y, spread], axis=2).reshape(count * n, -1)


def test_ols_recovers_the_truth_without_noise(
    lib: Library, clean: Problem, pi_true: np.ndarray
) -> None:
    """Oracle: β of the simulated robot; π is nearest to the guess among those with K π = β."""
    fit = fit_ols(clean)
    beta = lib.base_matrix @ pi_true
    # Rounding 1e-16 × condition number 5 × √7000 rows, relative to the largest β.
    assert np.abs(lib.base_matrix @ fit.pi - beta).max() <= 1e-10 * np.abs(beta).max()
    k = lib.base_matrix
    step = fit.pi - lib.pi0
    # Nearest: the step has no part in the null space of K.
    inside = k.T @ np.linalg.lstsq(k.T, step, rcond=None)[0]
    assert np.linalg.norm(step - inside) <= 1e-12 * np.linalg.norm(step)
    assert fit.lam is None


def test_ols_solves_the_normal_equations(lib: Library, measured: Problem) -> None:
    """Property: the residual of all rows is orthogonal to every column of [Y_b F]."""
    fit = fit_ols(measured)
    rows = stacked(lib, measured.train)
    x = np.concatenate([lib.base_matrix @ fit.pi, fit.phi.ravel()])
    residual = rows @ x - measured.train.tau.ravel()
    cosine = rows.T @ residual / np.linalg.norm(rows, axis=0) / np.linalg.norm(residual)
    # Rounding × √7000 rows × condition number.
    assert np.abs(cosine).max() <= 1e-10


def test_ols_equals_numpy_on_all_rows(lib: Library, measured: Problem) -> None:
    """Oracle: numpy's least squares on the uncompressed, unweighted rows."""
    fit = fit_ols(measured)
    rows = stacked(lib, measured.train)
    expected = np.linalg.lstsq(rows, measured.train.tau.ravel(), rcond=None)[0]
    got = np.concatenate([lib.base_matrix @ fit.pi, fit.phi.ravel()])
    # Rounding × condition number of the raw columns (1e3).
    assert np.linalg.norm(got - expected) <= 1e-10 * np.linalg.norm(expected)


def test_ols_refuses_motion_that_excites_too_little(lib: Library, clean: Problem) -> None:
    """Property: one moving joint is rank deficient; the sentence counts and advises."""
    s = clean.train
    still = np.zeros_like(s.q)
    q, dq, ddq = np.tile(lib.home, (len(s), 1)), still.copy(), still.copy()
    q[:, 1], dq[:, 1], ddq[:, 1] = s.q[:, 1], s.dq[:, 1], s.ddq[:, 1]
    samples = Samples(q, dq, ddq, lib.inverse_dynamics(q, dq, ddq, lib.pi0), s.columns)
    with pytest.raises(
        IdentificationError, match=r"excites \d+ of 43 columns .* map, adam, pc-ols"
    ):
        fit_ols(problem_of(lib, samples))


def independent_optimum(lib: Library, samples: Samples, weights: np.ndarray) -> float:
    """The smallest loss over P_k ⪰ 0, by cvxpy with P_k written out entry by entry (Eq. 3.9)."""
    n, k = samples.columns.shape[1:]
    y = lib.regressor(samples.q, samples.dq, samples.ddq)
    spread = np.zeros((len(y), n, n * k))
    for j in range(n):
        spread[:, j, j * k : (j + 1) * k] = samples.columns[:, j]
    rows = np.concatenate([y, spread, samples.tau[:, :, None]], axis=2)
    rows = (rows * np.sqrt(weights)[:, None]).reshape(-1, y.shape[2] + n * k + 1)
    upper = np.linalg.qr(rows, mode="r")
    # Columns of one size and a target of length 1, so that solver tolerances are relative.
    size = np.linalg.norm(upper[:, :-1], axis=0)
    size = np.where(size > 1e-9 * size.max(), size, size.max())
    unit = np.linalg.norm(upper[:, -1])
    x = cp.Variable(len(size))
    constraints = []
    for link in range(n):
        scaled = [x[10 * link + i] / size[10 * link + i] for i in range(10)]
        m, mx, my, mz, xx, yy, zz, xy, xz, yz = scaled
        half = (xx + yy + zz) / 2
        p = cp.bmat(
            [
                [half - xx, -xy, -xz, mx],
                [-xy, half - yy, -yz, my],
                [-xz, -yz, half - zz, mz],
                [mx, my, mz, m],
            ]
        )
        # A congruence with diag(5, 5, 5, 1) brings m², m·c and I to one size.
        d = np.diag([5.0, 5.0, 5.0, 1.0])
        constraints.append(d @ p @ d >> 0)
    residual = (upper[:, :-1] / size) @ x - upper[:, -1] / unit
    problem = cp.Problem(cp.Minimize(cp.norm(residual)), constraints)
    problem.solve(
        solver=cp.CLARABEL, tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10, max_iter=300
    )
    return float(problem.value * unit) ** 2 / (2 * len(samples))


def test_convex_optimum_against_cvxpy(
    lib: Library, measured: Problem, optimum: ConvexOptimum
) -> None:
    """Oracle: another formulation of Eq. 3.8 on simulated data with noise and friction."""
    expected = independent_optimum(lib, measured.train, measured.weights)
    # Both solvers stop at 1e-10 of ‖r‖; the loss is 1e-3 of that, squared.
    assert optimum.loss == pytest.approx(expected, rel=1e-6)


def test_convex_optimum_against_cvxpy_on_real_data(
    lib: Library, panda_adam: Identification
) -> None:
    """Oracle, real data: the bar that every result is held against is the true one."""
    samples = samples_of(panda_adam.train, lib)
    expected = independent_optimum(lib, samples, panda_adam.weights)
    # As above.
    assert panda_adam.optimum == pytest.approx(expected, rel=1e-6)


def test_convex_optimum_is_consistent(lib: Library, optimum: ConvexOptimum) -> None:
    """Property: every P_k ⪰ 0, to the feasibility of the solver."""
    assert lib.relative_eigenvalues(optimum.pi).min() >= -1e-8


def test_pc_ols_recovers_the_truth_without_noise(
    lib: Library, clean: Problem, pi_true: np.ndarray
) -> None:
    """Oracle: with a consistent truth the constraints are idle and β is the truth's."""
    fit = fit_pc_ols(clean)
    beta = lib.base_matrix @ pi_true
    # `floor` of fit_pc_ols lets the residual be 1e-6 ‖r‖; times the condition number 5.
    assert np.linalg.norm(lib.base_matrix @ fit.pi - beta) <= 5e-6 * np.linalg.norm(beta)
    assert lib.relative_eigenvalues(fit.pi).min() > 0
    assert lib.pi_from_lam(fit.lam) == pytest.approx(fit.pi, abs=1e-12)


def test_pc_ols_stays_near_the_guess_within_its_slack(
    lib: Library, measured: Problem, measured_statistics: Statistics, optimum: ConvexOptimum
) -> None:
    """Property: at most `SLACK` above the optimum, consistent, and nearer to the guess than it."""
    fit = fit_pc_ols(measured)
    loss = measured_statistics.value(fit.pi, fit.phi)
    # The slack that it gives away; 5 % of that for lifting a link off the boundary.
    assert optimum.loss * (1 - 1e-6) <= loss <= optimum.loss * (1 + 1.05 * SLACK)
    assert lib.relative_eigenvalues(fit.pi).min() >= 0
    assert np.linalg.norm(fit.pi - lib.pi0) < np.linalg.norm(optimum.pi - lib.pi0)


@given(seed=st.integers(0, 2**32 - 1), spread=st.sampled_from([0.001, 0.01, 0.1, 0.5]))
@settings(max_examples=40)
def test_no_consistent_model_beats_the_optimum(
    lib: Library,
    measured_statistics: Statistics,
    optimum: ConvexOptimum,
    pi_true: np.ndarray,
    seed: int,
    spread: float,
) -> None:
    """Property: any λ with its best friction has a loss of at least L*."""
    rng = np.random.default_rng(seed)
    lam = lib.lam_from_pi(pi_true)
    pi = lib.pi_from_lam(lam * (1 + spread * rng.normal(size=lam.size)))
    phi = best_friction(measured_statistics, pi, (7, 2))
    # The solver's own tolerance on L*.
    assert measured_statistics.value(pi, phi) >= optimum.loss * (1 - 1e-6)


def test_best_friction_is_stationary(
    lib: Library, measured: Problem, measured_statistics: Statistics
) -> None:
    """Property: no step in φ lowers the loss at fixed π; on clean friction φ is exact."""
    phi = best_friction(measured_statistics, lib.pi0, (7, 2))
    loss = measured_statistics.value(lib.pi0, phi)
    rng = np.random.default_rng(0)
    for _ in range(10):
        step = 1e-3 * rng.normal(size=phi.shape)
        assert measured_statistics.value(lib.pi0, phi + step) > loss
    s = measured.train
    tau = lib.inverse_dynamics(s.q, s.dq, s.ddq, lib.pi0) + s.columns @ np.array([0.4, 0.2])
    exact = compress(lib, Samples(s.q, s.dq, s.ddq, tau, s.columns), np.ones(7))
    # Rounding × condition number of two friction columns.
    estimated = best_friction(exact, lib.pi0, (7, 2))
    assert estimated == pytest.approx(np.tile([0.4, 0.2], (7, 1)), rel=1e-9)


def test_methods_by_name_agree_with_the_rooms(
    lib: Library, ideal_runs: tuple[Recording, ...], pi_true: np.ndarray
) -> None:
    """Property: identify_recording(method="ols" | "pc-ols") hands out what the baselines found."""
    for method in ("ols", "pc-ols"):
        result = identify_recording(
            ideal_runs[0], lib, method, validation=ideal_runs[1], test=ideal_runs[2]
        )
        beta = lib.base_matrix @ pi_true
        # As for pc-ols above.
        assert np.linalg.norm(result.beta - beta) <= 5e-6 * np.linalg.norm(beta)
        assert result.method == method
