"""semidefinite_polish on matrices whose least condition number is known; no robot."""

import numpy as np
import pytest

from runtime.excitation.search import conic
from runtime.excitation.search.conic import SLACK, LinearRows
from runtime.excitation.search.semidefinite_polish import Spectrum, _Model, polish, weight_of


class Affine:
    """C(x) = C₀ + Σ x_i C_i, plus Σ x_i² D_i."""

    def __init__(self, constant: np.ndarray, slopes: np.ndarray, bends: np.ndarray | None = None):
        self.constant, self.slopes_ = constant, slopes
        self.bends = np.zeros_like(slopes) if bends is None else bends

    def at(self, points: np.ndarray) -> np.ndarray:
        linear = np.einsum("kp,pij->kij", points, self.slopes_)
        return self.constant + linear + np.einsum("kp,pij->kij", points**2, self.bends)

    def slopes(self, points: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        gradient = np.einsum("pij,ij->p", self.slopes_, weight) + 2 * points * np.einsum(
            "pij,ij->p", self.bends, weight
        )
        return self.at(points), gradient


def box(n: int, size: float) -> LinearRows:
    return LinearRows(np.vstack([np.eye(n), -np.eye(n)]), np.full(2 * n, size))


def symmetric(rng: np.random.Generator, *shape: int) -> np.ndarray:
    x = rng.normal(size=shape)
    return x + np.swapaxes(x, -1, -2)


def log_cond(matrix: np.ndarray) -> float:
    values = np.linalg.eigvalsh(matrix)
    return float(np.log(values[-1] / values[0]) / 2)


def test_the_optimum_where_all_eigenvalues_meet() -> None:
    """Oracle: diag(1 + x₁, 2 + x₂, 3 + x₃) is best where its entries are equal, with cond 1."""
    toy = Affine(np.diag([1.0, 2.0, 3.0]), np.stack([np.diag(row) for row in np.eye(3)]))
    result = polish(toy, np.zeros(3), box(3, 2.0), tolerance=1e-12)
    # log cond ≥ 0 is reached by steps that converge quadratically.
    assert result.value == pytest.approx(0.0, abs=1e-6)
    assert len(result.history) < 15


def built_in() -> tuple[Affine, np.ndarray, np.ndarray]:
    """Least at x = 0, with cond 3: there both ends are double and the multipliers known.

    C(x) = Q diag(1, 1, 2, 3, 3) Qᵀ + Σ x_i C_i, every C_i orthogonal to V₁ U₁ V₁ᵀ/3 − V₂ U₂ V₂ᵀ,
    which is Overton's condition; log cond of an affine function is quasiconvex: x = 0 is global.
    """
    rng = np.random.default_rng(0)
    q = np.linalg.qr(rng.normal(size=(5, 5)))[0]
    constant = (q * [1.0, 1.0, 2.0, 3.0, 3.0]) @ q.T
    turn = np.array([[0.6, 0.2], [0.2, 0.4]])
    first, second = q[:, 3:] @ turn @ q[:, 3:].T, q[:, :2] @ (np.eye(2) - turn) @ q[:, :2].T
    normal = first / 3 - second
    slopes = 0.3 * symmetric(rng, 4, 5, 5)
    slopes -= np.einsum("pij,ij->p", slopes, normal)[:, None, None] * normal / np.sum(normal**2)
    return Affine(constant, slopes), first, second


def test_an_optimum_with_clusters_at_both_ends() -> None:
    """Oracle: the one that is built in, from five starts around it."""
    toy, _, _ = built_in()
    best = np.log(3.0) / 2
    for seed in range(5):
        x = 0.2 * np.random.default_rng(seed).normal(size=4)
        start = log_cond(toy.at(x[None])[0])
        result = polish(toy, x, box(4, 3.0), tolerance=1e-10)
        assert start > best + 0.05
        # The model is exact to second order: what is left is the tolerance times a few.
        assert result.value == pytest.approx(best, abs=1e-7)
        assert result.x == pytest.approx(np.zeros(4), abs=1e-4)


def test_multipliers_at_the_optimum() -> None:
    """Oracle: at the optimum the step is none and its duals are U₁ and U₂; they are kept."""
    toy, first, second = built_in()
    at = Spectrum.of(toy.constant)
    model = _Model.around(toy, np.zeros(4), at, None)
    step = model.step(np.zeros(4), box(4, 3.0), 0.3)
    assert step is not None
    # Interior points find duals to about the root of the tolerance of 1e-9.
    assert step.step == pytest.approx(np.zeros(4), abs=1e-4)
    assert step.weights[0] == pytest.approx(first, abs=1e-4)
    assert step.weights[1] == pytest.approx(second, abs=1e-4)
    kept = weight_of(at, at.upper(), at.values[-1], first), weight_of(at, at.lower(), 1.0, second)
    assert kept[0] == pytest.approx(first, abs=1e-12)
    assert kept[1] == pytest.approx(second, abs=1e-12)
    foreign = weight_of(at, at.upper(), at.values[-1], second)  # of no use at this end
    assert np.trace(foreign @ first) > 0.4


def test_curvature_of_simple_ends() -> None:
    """Oracle: second differences of λ_max/λ_max(0) − λ_min/λ_min(0) along random directions.

    The bends widen the spectrum everywhere, so that the curvature is positive as it is.
    """
    rng = np.random.default_rng(5)
    bends = np.stack([np.diag([-0.3, 0.0, 0.1, 2.0])] * 3)
    toy = Affine(np.diag([1.0, 2.0, 2.5, 6.0]), 0.4 * symmetric(rng, 3, 4, 4), bends)
    model = _Model.around(toy, np.zeros(3), Spectrum.of(toy.constant), None)
    for _ in range(5):
        d = rng.normal(size=3)
        h = 1e-3
        spectra = np.linalg.eigvalsh(toy.at(np.stack([h * d, 0 * d, -h * d])))
        spread = spectra[:, -1] / 6.0 - spectra[:, 0]
        expected = (spread[0] - 2 * spread[1] + spread[2]) / h**2
        # Truncation h² = 1e-6 of the oracle times fourth derivatives of the size of some ten.
        assert d @ model.curvature @ d == pytest.approx(expected, rel=1e-4)


def test_curved_matrices_converge_superlinearly() -> None:
    """Property: with B the curvature, a dozen steps end at 1e-9; without bends they would not."""
    rng = np.random.default_rng(3)
    constant = np.diag([1.0, 1.2, 2.0, 3.0])
    toy = Affine(constant, 0.3 * symmetric(rng, 6, 4, 4), 0.5 * symmetric(rng, 6, 4, 4))
    result = polish(toy, np.zeros(6), box(6, 1.0), iterations=40, tolerance=1e-10)
    again = polish(toy, result.x, box(6, 1.0), iterations=40, tolerance=1e-12)
    assert result.value < log_cond(constant) - 0.1
    assert result.value - again.value < 1e-8
    assert len(result.history) < 25


@pytest.mark.parametrize("rounds", [1, 30])
@pytest.mark.parametrize("seed", range(8))
def test_never_worse_and_always_inside(
    seed: int, rounds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: history falls, ends at log cond of x, and the bounds are kept.

    Also where rows that a programme has not looked at cut its step.
    """
    monkeypatch.setattr(conic, "_ROUNDS", rounds)
    rng = np.random.default_rng(seed)
    constant = np.diag(rng.uniform(1.0, 4.0, size=6))
    toy = Affine(constant, symmetric(rng, 5, 6, 6) / 4, symmetric(rng, 5, 6, 6))
    rows = LinearRows(rng.normal(size=(60, 5)), np.full(60, 0.3))
    result = polish(toy, np.zeros(5), rows)
    assert result.history[0] == pytest.approx(log_cond(constant), rel=1e-12)
    assert (np.diff(result.history) < 0).all()
    assert result.value == result.history[-1]
    assert result.value == pytest.approx(log_cond(toy.at(result.x[None])[0]), rel=1e-12)
    assert (rows.matrix @ result.x / rows.bound).max() <= 1 + 2 * SLACK


def test_a_singular_start_is_returned() -> None:
    """Property: where log cond is infinite there is no model, and nothing happens."""
    toy = Affine(np.diag([1.0, 0.0]), np.zeros((1, 2, 2)))
    result = polish(toy, np.zeros(1), box(1, 1.0))
    assert result.value == np.inf
    assert not result.x.any()
