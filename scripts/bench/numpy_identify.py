"""The same computations in NumPy, without generated loops.

π(λ), its Jacobian and Y_b come from the compiled library in one call over all of it; products,
sums, eigenvalues and steps are NumPy's.
"""

from collections.abc import Callable

import numpy as np

from runtime.estimators.optimizers import AdamOptions
from runtime.estimators.regression.samples import Samples
from runtime.excitation import COST_SAMPLES
from runtime.excitation.motion.trajectory import fourier_basis
from runtime.library import Array, Library

STEP = 1e-7  # step of the forward differences


def gram(lib: Library, samples: Samples, weights: Array) -> tuple[Array, Array]:
    """Σ Y_bᵀ W Y_b and Σ Y_bᵀ W τ from a stored Y_b."""
    y = lib.base_regressor(samples.q, samples.dq, samples.ddq)
    root = np.sqrt(weights)
    rows = (y * root[:, None]).reshape(-1, y.shape[-1])
    return rows.T @ rows, rows.T @ (samples.tau * root).ravel()


def adam_full(
    lib: Library, start: Array, samples: Samples, weights: Array
) -> Callable[[int], Array]:
    """(iterations) → λ by descent on all samples, from their Gram matrix."""
    hessian, linear = gram(lib, samples, weights)
    matrix, n = lib.base_matrix, len(samples)

    def slope(beta: Array) -> Array:
        return (hessian @ beta - linear) / n

    return lambda count: _descend(start, count, lambda lam: _chain(lib, matrix, lam, slope))


def adam_batch(
    lib: Library, start: Array, samples: Samples, weights: Array, batch: int
) -> Callable[[int], Array]:
    """(iterations) → λ by descent on mini-batches, from a stored Y_b."""
    y = lib.base_regressor(samples.q, samples.dq, samples.ddq)
    rng, matrix = np.random.default_rng(0), lib.base_matrix

    def slope(beta: Array) -> Array:
        rows = rng.integers(0, len(samples), batch)
        here = y[rows]
        residual = here @ beta - samples.tau[rows]
        return np.tensordot(residual * weights, here, 2) / batch

    return lambda count: _descend(start, count, lambda lam: _chain(lib, matrix, lam, slope))


def levenberg(
    lib: Library, start: Array, samples: Samples, weights: Array
) -> Callable[[int], Array]:
    """(steps) → λ by damped Gauss–Newton on the Cholesky factor of the Gram matrix."""
    hessian, linear = gram(lib, samples, weights)
    factor = np.linalg.cholesky(hessian).T
    target = np.linalg.solve(factor.T, linear)
    n = lib.n_joints
    by_link = lib.base_matrix.reshape(-1, n, 10).transpose(1, 0, 2)

    def step(lam: Array, damping: float) -> Array:
        residual = factor @ (lib.base_matrix @ lib.pi_from_lam(lam)) - target
        by_lam = (by_link @ lib.pi_jacobian(lam)).transpose(1, 0, 2).reshape(len(factor), -1)
        jacobian = factor @ by_lam
        normal = jacobian.T @ jacobian
        normal[np.diag_indices_from(normal)] += damping * np.diag(normal).max()
        return lam - np.linalg.solve(normal, jacobian.T @ residual)

    def run(count: int) -> Array:
        lam = start
        for _ in range(count):
            lam = step(lam, 1e-3)
        return lam

    return run


def log_condition(
    lib: Library, home: Array, harmonics: int, duration: float
) -> tuple[Callable[[Array], float], Callable[[Array], Array]]:
    """log cond of the column-normalised base regressor, and its gradient by forward differences.

    At half of the samples: out and back passes each of them twice.
    """
    t = np.linspace(0.0, duration, COST_SAMPLES)[: COST_SAMPLES // 2]
    basis = fourier_basis(lib, harmonics, t, duration)[..., :3]

    def value(a: Array) -> float:
        motion = np.einsum("jm,tmd->dtj", a, basis)
        y = lib.base_regressor(motion[0] + home, motion[1], motion[2])
        rows = y.reshape(-1, y.shape[-1])
        square = rows.T @ rows
        size = np.sqrt(np.diag(square))
        values = np.linalg.eigvalsh(square / np.outer(size, size))
        return float(np.log(values[-1] / values[0]) / 2)

    def gradient(a: Array) -> Array:
        here, result = value(a), np.empty(a.size)
        for k in range(a.size):
            there = a.copy()
            there.flat[k] += STEP
            result[k] = (value(there) - here) / STEP
        return result.reshape(a.shape)

    return value, gradient


def _chain(lib: Library, matrix: Array, lam: Array, slope: Callable[[Array], Array]) -> Array:
    """∂L/∂λ from ∂L/∂β, Eq. 4.32."""
    return lib.pi_adjoint(lam, slope(matrix @ lib.pi_from_lam(lam)) @ matrix)


def _descend(start: Array, count: int, gradient: Callable[[Array], Array]) -> Array:
    """Adam, Eqs. 4.42–4.46."""
    o, lam, m, v = AdamOptions(1e-4), start, np.zeros_like(start), np.zeros_like(start)
    for step in range(1, count + 1):
        g = gradient(lam)
        m, v = o.beta1 * m + (1 - o.beta1) * g, o.beta2 * v + (1 - o.beta2) * g**2
        size = np.sqrt(v / (1 - o.beta2**step)) + o.epsilon
        lam = lam - o.learning_rate * m / (1 - o.beta1**step) / size
    return lam
