"""Log-Cholesky parameters of a body and the barrier of its pseudo-inertia."""

import casadi as ca
import numpy as np
import pytest

from symgen.mechanics import inertia
from tests.symgen.mechanics.test_inertia import PI, PSEUDO, call
from tests.taylor import Array

_pi, _theta = ca.SX.sym("pi", 10), ca.SX.sym("theta", 10)
SOME = np.random.default_rng(0).uniform(0.1, 0.9, (5, 10)) * [-1, 1, -1, 1, 1, -1, 1, 1, 0.5, 0.2]
"""λ of ordinary bodies, no two entries alike."""
THETA = ca.Function("theta", [_pi], [inertia.cholesky_from_pi(_pi)])
FROM_THETA = ca.Function("pi", [_theta], [inertia.pi_from_cholesky(_theta)])
BARRIER = ca.Function("barrier", [_pi], list(inertia.barrier(_pi)))


@pytest.mark.parametrize("lam", SOME)
def test_log_cholesky_is_the_upper_factor_of_p(lam: Array) -> None:
    """Oracle: P = U Uᵀ with U written out from θ; π comes back."""
    pi = call(PI, lam)
    alpha, d1, d2, d3, s12, s23, s13, *t = call(THETA, pi)
    upper = np.array(
        [
            [np.exp(d1), s12, s13, t[0]],
            [0, np.exp(d2), s23, t[1]],
            [0, 0, np.exp(d3), t[2]],
            [0, 0, 0, 1],
        ]
    )
    # Rounding over the thinnest axis, 1/100 of the trace.
    np.testing.assert_allclose(
        np.exp(2 * alpha) * upper @ upper.T, call(PSEUDO, pi), rtol=1e-12, atol=1e-13
    )
    np.testing.assert_allclose(
        call(FROM_THETA, [alpha, d1, d2, d3, s12, s23, s13, *t]), pi, rtol=1e-12, atol=1e-13
    )


@pytest.mark.parametrize("lam", SOME)
def test_barrier_is_that_of_the_determinant(lam: Array) -> None:
    """Oracle: numpy's Cholesky, determinant and inverse of P; B_i = P(e_i)."""
    pi = call(PI, lam)
    pivot, logarithm, traces, curvature = (np.array(out) for out in BARRIER(pi))
    p, basis = call(PSEUDO, pi), [call(PSEUDO, e) for e in np.eye(10)]
    # Condition of P below 1e4.
    assert pivot == pytest.approx((np.diag(np.linalg.cholesky(p)) ** 2).min(), rel=1e-10)
    assert logarithm == pytest.approx(np.linalg.slogdet(p)[1], abs=1e-10)
    inverse = np.linalg.inv(p)
    np.testing.assert_allclose(traces.ravel(), [np.trace(inverse @ b) for b in basis], rtol=1e-9)
    expected = [[np.trace(inverse @ b @ inverse @ c) for c in basis] for b in basis]
    np.testing.assert_allclose(curvature, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    assert float(BARRIER(-pi)[0]) < 0
