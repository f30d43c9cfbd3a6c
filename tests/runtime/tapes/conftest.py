"""Robots of the tapes: an arm, a gantry, coupled joints, a closed loop, a free base."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from runtime.library import Library
from tests.runtime.library.conftest import palletizer, palletizer_folder, wrist

__all__ = ["palletizer", "palletizer_folder", "wrist"]

ROBOTS = ("fr3", "gantry", "wrist", "palletizer", "hopper")
State = tuple[np.ndarray, ...]
TOLERANCE = 1e-8
"""Of gradcheck and check_grads, absolute and relative."""


@pytest.fixture(params=ROBOTS)
def lib(request: pytest.FixtureRequest, robot: Callable[[str], Library]) -> Library:
    """Each of them."""
    if request.param in {"fr3", "gantry"}:
        return robot(request.param)
    library: Library = request.getfixturevalue(request.param)
    return library


def state_of(lib: Library, count: int) -> State:
    """q near the assembly, dq, ddq, τ near the model's torque, weights, inertia of the rotors."""
    rng = np.random.default_rng(5)
    base = np.full(lib.n_rows - lib.n_joints, 0.1)
    home = np.concatenate([base, lib.home])
    q = home + rng.uniform(-0.2, 0.2, (count, lib.n_rows))
    dq, ddq, off = rng.normal(0, 0.5, (3, count, lib.n_rows))
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + off
    return q, dq, ddq, tau, *rng.uniform(0.1, 1, (2, lib.n_rows))


def bounds(function: str) -> dict[str, float]:
    """Bounds of a check by differences, and their step.

    Rounding of 160 N·m (Go2) makes 1.5e-8 over 1e-6 and 3e-9 over 5e-6; the loss, whose torques are
    squared, bends more.
    """
    step = 1.2e-6 if function.startswith("regressor_loss") else 5e-6
    return {"atol": TOLERANCE, "rtol": TOLERANCE, "eps": step}


def differentiable(
    on_tape: Any, lib: Library, by_lam: bool, array: Callable[[np.ndarray], Any]
) -> dict[str, tuple[Callable[..., Any], State]]:
    """Every function with one state, in all its arguments: π, or also λ in its place.

    Accelerations and the loss are no lines in π: it is varied in units of the mass and size of each
    body, since a step of 5e-6 kg·m² is no small one for a finger.
    """
    q, dq, ddq, tau, weight, rotor = state_of(lib, 1)
    pi, lam = lib.pi0, lib.lam0
    units = np.outer(pi[::10], [1.0] + 3 * [0.1] + 6 * [0.01]).ravel()
    pi_of = (array(pi), array(units))
    of_lam = {
        "inverse_dynamics of λ": (
            lambda *x: on_tape.inverse_dynamics(*x[:3], lam=x[3]),
            (q, dq, ddq, lam),
        ),
        "mass_matrix of λ": (lambda *x: on_tape.mass_matrix(x[0], lam=x[1]), (q, lam)),
        "bias of λ": (lambda *x: on_tape.bias(*x[:2], lam=x[2]), (q, dq, lam)),
        "forward_dynamics of λ": (
            lambda *x: on_tape.forward_dynamics(*x[:3], rotor=x[3], lam=x[4]),
            (q, dq, tau, rotor, lam),
        ),
        "regressor_loss of λ": (
            lambda *x: on_tape.regressor_loss(*x[:4], lam=x[4]),
            (q, dq, ddq, tau, lam),
        ),
    }
    return {
        "inverse_dynamics": (on_tape.inverse_dynamics, (q, dq, ddq, pi)),
        "bias": (on_tape.bias, (q, dq, pi)),
        "gravity": (on_tape.gravity, (q, pi)),
        "mass_matrix": (on_tape.mass_matrix, (q, pi)),
        "forward_dynamics": (
            lambda *x: on_tape.forward_dynamics(*x[:3], pi_of[0] + pi_of[1] * x[3], x[4]),
            (q, dq, tau, 0 * pi, rotor),
        ),
        "regressor_loss": (
            lambda *x: on_tape.regressor_loss(*x[:4], pi_of[0] + pi_of[1] * x[4], x[5]),
            (q, dq, ddq, tau, 0 * pi, weight),
        ),
        "pi_from_lam": (on_tape.pi_from_lam, (lam,)),
        **(of_lam if by_lam else {}),
    }
