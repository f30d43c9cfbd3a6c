"""Derivatives of the compiled dynamics: Taylor remainders of second order."""

from collections.abc import Callable

import numpy as np
import pytest

from runtime.library import Library
from tests.oracle import Array, random_states
from tests.taylor import assert_second_order, taylor_slope


def _unit(rng: np.random.Generator, size: int) -> Array:
    v = rng.normal(size=size)
    return v / np.linalg.norm(v)


@pytest.mark.parametrize("name", ["fr3", "tree", "gantry"])
def test_torque_jacobian_is_second_order(
    name: str, fr3: Library, robot: Callable[[str], Library]
) -> None:
    """Derivative: τ(λ + hv) − τ − h ∂τ/∂λ v falls as h²."""
    lib = fr3 if name == "fr3" else robot(name)
    rng = np.random.default_rng(4)
    q, dq, ddq = random_states(lib.n_joints, 1, 5)
    v = _unit(rng, lib.lam0.size)
    derivative = lib.torque_jacobian(q, dq, ddq, lib.lam0) @ v
    assert_second_order(
        taylor_slope(lambda lam: lib.torque(q, dq, ddq, lam), lib.lam0, v, derivative)
    )


def test_pi_jacobian_is_second_order(fr3: Library) -> None:
    """Derivative: ∂π/∂λ at the robot, and at ω = 0 where the exponential switches branches."""
    rng = np.random.default_rng(7)
    straight = fr3.lam0.copy().reshape(-1, 10)
    straight[:, 4:7] = 0.0
    for lam in (fr3.lam0, straight.ravel()):
        v = rng.normal(size=lam.shape).reshape(-1, 10)
        v /= np.linalg.norm(v)
        derivative = np.einsum("kpl,kl->kp", fr3.pi_jacobian(lam), v).ravel()
        assert_second_order(taylor_slope(fr3.pi_from_lam, lam, v.ravel(), derivative))


def test_loss_gradient_is_second_order(fr3: Library) -> None:
    """Derivative: ∇_λ L = (∂π/∂λ)ᵀ Σ YᵀWr over a mini-batch (Eqs. 4.5, 4.6, 4.32)."""
    rng = np.random.default_rng(8)
    q, dq, ddq = random_states(fr3.n_joints, 64, 9)
    truth = fr3.lam0 + rng.normal(0, 0.2, fr3.lam0.shape)
    tau, weight = fr3.torque(q, dq, ddq, truth), rng.uniform(0.5, 2, fr3.n_joints)

    def loss(lam: Array) -> float:
        return fr3.loss_gradient(q, dq, ddq, tau, weight, fr3.pi_from_lam(lam))[0]

    _, by_pi, _ = fr3.loss_gradient(q, dq, ddq, tau, weight, fr3.pi_from_lam(fr3.lam0))
    blocks = fr3.pi_jacobian(fr3.lam0)
    by_lam = np.einsum("kpl,kp->kl", blocks, by_pi.reshape(-1, 10)).ravel()
    v = _unit(rng, fr3.lam0.size)
    assert_second_order(taylor_slope(loss, fr3.lam0, v, by_lam @ v))


@pytest.mark.parametrize("name", ["fr3", "tree", "gantry"])
def test_regressor_adjoint_is_second_order(
    name: str, fr3: Library, robot: Callable[[str], Library]
) -> None:
    """Derivative: ∂⟨S, Y_b⟩/∂(q, dq, ddq), in all three arguments and in each alone."""
    lib = fr3 if name == "fr3" else robot(name)
    n = lib.n_joints
    rng = np.random.default_rng(12)
    x = np.array([part[0] for part in random_states(n, 1, 13)])
    seed = rng.normal(size=(n, len(lib.base_columns)))
    gradient = lib.regressor_adjoint(*x, seed)

    def value(flat: Array) -> float:
        return float(np.sum(seed * lib.base_regressor(*flat.reshape(3, n))))

    v = _unit(rng, 3 * n)
    assert_second_order(taylor_slope(value, x.ravel(), v, np.sum(gradient.ravel() * v)))
    # Y is linear in ddq and quadratic in dq: the whole and q alone carry the remainder.
    only_q = np.concatenate([_unit(rng, n), np.zeros(2 * n)])
    assert_second_order(taylor_slope(value, x.ravel(), only_q, gradient.ravel() @ only_q))
    only_dq = np.concatenate([np.zeros(n), _unit(rng, n), np.zeros(n)])
    assert_second_order(taylor_slope(value, x.ravel(), only_dq, gradient.ravel() @ only_dq))
    only_ddq = np.concatenate([np.zeros(2 * n), _unit(rng, n)])
    step = value(x.ravel() + only_ddq) - value(x.ravel())
    assert step == pytest.approx(gradient.ravel() @ only_ddq, rel=1e-11)
