"""The kernels as operators of torch: values, derivatives, vmap, torch.compile, messages."""

import numpy as np
import pytest

import runtime
from runtime.errors import LibraryError, ShapeError
from runtime.library import Library
from tests.runtime.tapes.conftest import bounds, differentiable, state_of

torch = pytest.importorskip("torch", reason="torch is not installed: pip install 'symgen[torch]'")

# torch.func.jvp compiles decompositions of torch when it is first used.
pytestmark = pytest.mark.filterwarnings("ignore:`torch.jit.script`:FutureWarning")


def recorded(*arrays: np.ndarray) -> list["torch.Tensor"]:
    return [torch.tensor(x, requires_grad=True) for x in arrays]


def test_gradients(lib: Library) -> None:
    """Derivative: gradcheck of every function in every argument."""
    cases = differentiable(runtime.torch(lib), lib, lib.name == "palletizer", torch.tensor)
    for name, (function, state) in cases.items():
        arrays = recorded(*state)
        assert torch.autograd.gradcheck(function, arrays, **bounds(name))


def test_values_are_those_of_the_library(lib: Library) -> None:
    """Oracle: the library's own methods, bit by bit; λ as well."""
    on_tape, (q, dq, ddq, tau, weight, rotor) = runtime.torch(lib), state_of(lib, 9)
    pairs = [
        (on_tape.inverse_dynamics(q, dq, ddq), lib.inverse_dynamics(q, dq, ddq, lib.pi0)),
        (on_tape.mass_matrix(q), lib.mass_matrix(q, lib.pi0)),
        (on_tape.bias(q, dq), lib.bias_forces(q, dq, lib.pi0)),
        (on_tape.gravity(q), lib.bias_forces(q, 0 * dq, lib.pi0)),
        (
            on_tape.forward_dynamics(q, dq, tau, rotor=rotor),
            lib.forward_dynamics(q, dq, tau, lib.pi0, rotor),
        ),
        (
            on_tape.regressor_loss(q, dq, ddq, tau, weight=weight),
            lib.loss_gradient(q, dq, ddq, tau, weight, lib.pi0)[0],
        ),
    ]
    for ours, theirs in pairs:
        np.testing.assert_allclose(ours.numpy(), theirs, rtol=1e-13)
    by_lam = on_tape.inverse_dynamics(q, dq, ddq, lam=lib.lam0)
    np.testing.assert_allclose(by_lam.numpy(), lib.torque(q, dq, ddq, lib.lam0), rtol=1e-9)


def test_transforms(fr3: Library) -> None:
    """Oracle: vmap, jacrev, broadcasting and torch.compile against plain calls, without breaks."""
    on_tape, (q, dq, ddq, tau, *_) = runtime.torch(fr3), state_of(fr3, 4)
    q, dq, ddq, tau = map(torch.tensor, (q, dq, ddq, tau))
    pi = torch.tensor(fr3.pi0)
    plain = on_tape.inverse_dynamics(q, dq, ddq)
    mapped = torch.vmap(on_tape.inverse_dynamics, in_dims=(0, 0, 0, None))(q, dq, ddq, pi)
    assert torch.equal(mapped, plain)
    assert torch.equal(
        on_tape.inverse_dynamics(q[:, None], dq[:, None], ddq)[2, 3],
        plain.new_tensor(fr3.inverse_dynamics(q[2], dq[2], ddq[3], fr3.pi0)),
    )
    slope = torch.func.jacrev(on_tape.inverse_dynamics)(q[0], dq[0], ddq[0])
    expected = fr3.torque_derivatives(q[:1], dq[:1], ddq[:1], fr3.pi0)[1][0]
    np.testing.assert_allclose(slope.numpy(), expected, rtol=1e-12)
    sets = torch.stack([pi, 2 * pi])
    losses = torch.vmap(lambda p: on_tape.regressor_loss(q, dq, ddq, tau, p))(sets)
    assert torch.equal(losses[1], on_tape.regressor_loss(q, dq, ddq, tau, 2 * pi))

    def cost(q: "torch.Tensor", pi: "torch.Tensor") -> "torch.Tensor":
        return on_tape.forward_dynamics(q, dq, tau, pi).square().sum()

    fresh = runtime.torch(fr3)  # not called before it is compiled
    still = torch.compile(fresh.gravity, fullgraph=True, backend="aot_eager")
    assert torch.equal(still(q), on_tape.gravity(q))
    compiled = torch.compile(cost, fullgraph=True, backend="aot_eager")
    slopes = []
    for function in (cost, compiled):
        arrays = recorded(q.numpy(), pi.numpy())
        slopes.append(torch.autograd.grad(function(*arrays), arrays))
    for ours, theirs in zip(*slopes, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-12, atol=0)


@pytest.mark.parametrize("function", ["gravity", "forward_dynamics", "regressor_loss"])
def test_forward_mode(fr3: Library, function: str) -> None:
    """Oracle: reverse mode, with π mapped by vmap; a default device elsewhere changes nothing."""
    on_tape, (q, dq, ddq, tau, *_) = runtime.torch(fr3), state_of(fr3, 3)
    state = {"gravity": (q,), "forward_dynamics": (q, dq, tau)}.get(function, (q, dq, ddq, tau))
    called, tensors = getattr(on_tape, function), [torch.tensor(x) for x in (*state, fr3.pi0)]
    every = tuple(range(len(tensors)))
    with torch.device("meta"):
        pairs = [each(called, every)(*tensors) for each in (torch.func.jacfwd, torch.func.jacrev)]
    for ours, theirs in zip(*pairs, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-12, atol=1e-12)


def test_single_precision_and_messages(fr3: Library) -> None:
    """Property: float32 stays; wrong types, shapes and second derivatives get a sentence."""
    on_tape, (q, dq, ddq, *_) = runtime.torch(fr3), state_of(fr3, 3)
    single = [torch.tensor(x, dtype=torch.float32) for x in (q, dq, ddq)]
    tau = on_tape.inverse_dynamics(*single)
    assert tau.dtype == torch.float32
    np.testing.assert_allclose(tau, fr3.inverse_dynamics(q, dq, ddq, fr3.pi0), atol=1e-4)
    with pytest.raises(
        ShapeError, match=r"dq of 'fr3' needs the shape \(\.\.\., 7\), got \(3, 6\)"
    ):
        on_tape.bias(q, dq[:, :6])
    with pytest.raises(ShapeError, match=r"q needs an array of numbers, got 'home'"):
        on_tape.gravity("home")
    with pytest.raises(ShapeError, match=r"q needs float64 or float32, got torch\.int64"):
        on_tape.gravity(torch.zeros(7, dtype=torch.int64))
    with pytest.raises(ShapeError, match="expected pi or lam, got both"):
        on_tape.gravity(q, fr3.pi0, lam=fr3.lam0)
    with pytest.raises(
        LibraryError, match=r"expected a library, as runtime\.load gives it, got 'fr3'"
    ):
        runtime.torch("fr3")  # type: ignore[arg-type]
    (x,) = recorded(q)
    (slope,) = torch.autograd.grad(on_tape.gravity(x).sum(), x, create_graph=True)
    with pytest.raises(LibraryError, match="expected first derivatives, got a second one"):
        slope.sum().backward()


@pytest.mark.parametrize("outer", ["jacrev", "jacfwd"])
@pytest.mark.parametrize("argument", ["q", "pi"])
def test_second_derivatives_are_refused(fr3: Library, outer: str, argument: str) -> None:
    """Property: a sentence in both modes, also for the loss, whose gradient is an output."""
    on_tape, (q, dq, ddq, tau, *_) = runtime.torch(fr3), state_of(fr3, 3)
    first = {
        "q": torch.func.jacrev(on_tape.gravity),
        "pi": torch.func.jacrev(lambda pi: on_tape.regressor_loss(q, dq, ddq, tau, pi)),
    }
    at = torch.tensor({"q": q[0], "pi": fr3.pi0}[argument])
    with pytest.raises(LibraryError, match="expected first derivatives, got a second one"):
        getattr(torch.func, outer)(first[argument])(at)
