"""The kernels as functions of JAX: values, derivatives in both modes, vmap, jit, messages."""

import numpy as np
import pytest

import runtime
from runtime.errors import ShapeError
from runtime.library import Library
from tests.runtime.tapes.conftest import bounds, differentiable, state_of

jax = pytest.importorskip("jax", reason="JAX is not installed: pip install 'symgen[jax]'")
jnp = jax.numpy
test_util = pytest.importorskip("jax.test_util")


@pytest.fixture(autouse=True)
def _doubles():
    with jax.enable_x64(True):
        yield


@pytest.mark.parametrize("lib", ["fr3", "palletizer"], indirect=True)
def test_gradients(lib: Library) -> None:
    """Derivative: check_grads of every function in every argument, forward and reverse."""
    cases = differentiable(runtime.jax(lib), lib, lib.name == "palletizer", jnp.asarray)
    for name, (function, state) in cases.items():
        arrays = tuple(map(jnp.asarray, state))
        test_util.check_grads(function, arrays, 1, **bounds(name))


def test_transforms(fr3: Library) -> None:
    """Oracle: the library, for nested vmap, broadcasting, float32 and jit of a gradient."""
    on_tape, (q, dq, ddq, tau, *_) = runtime.jax(fr3), state_of(fr3, 4)
    plain = fr3.inverse_dynamics(q, dq, ddq, fr3.pi0)
    q, dq, ddq, tau, pi = map(jnp.asarray, (q, dq, ddq, tau, fr3.pi0))
    assert (on_tape.inverse_dynamics(q, dq, ddq) == plain).all()
    mapped = jax.vmap(on_tape.inverse_dynamics, in_axes=(0, 0, 0, None))(q, dq, ddq, pi)
    assert (mapped == plain).all()
    # Each q with each (dq, ddq), for two parameter sets: axes of length 1 in all places.
    every = on_tape.inverse_dynamics(
        q[:, None, None], dq[:, None], ddq[:, None], jnp.stack([pi, 2 * pi])
    )
    assert every.shape == (4, 4, 2, 7)
    expected = fr3.inverse_dynamics(
        np.asarray(q[1]), np.asarray(dq[3]), np.asarray(ddq[3]), fr3.pi0
    )
    np.testing.assert_allclose(every[1, 3, 1], 2 * expected, rtol=1e-12)
    single = on_tape.inverse_dynamics(*(x.astype(jnp.float32) for x in (q, dq, ddq)))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, plain, atol=1e-4)
    losses = jax.vmap(lambda p: on_tape.regressor_loss(q, dq, ddq, tau, p))(jnp.stack([pi, 2 * pi]))
    loss, slope = jax.jit(jax.value_and_grad(lambda p: on_tape.regressor_loss(q, dq, ddq, tau, p)))(
        pi
    )
    value, gradient, _ = fr3.loss_gradient(q, dq, ddq, tau, np.ones(7), fr3.pi0)
    assert losses[0] == loss
    np.testing.assert_allclose(loss, value, rtol=1e-13)
    np.testing.assert_allclose(slope, gradient, rtol=1e-12, atol=1e-12)
    fresh = runtime.jax(fr3)  # its first call keeps constants, which may be no tracers
    np.testing.assert_allclose(jax.jit(fresh.gravity)(q), fresh.gravity(q), rtol=1e-12, atol=1e-12)
    with pytest.raises(ShapeError, match=r"q of 'fr3' needs the shape \(\.\.\., 7\), got \(3,\)"):
        on_tape.gravity(jnp.zeros(3))
