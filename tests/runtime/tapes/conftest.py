"""Robots of the tapes: an arm, a gantry, coupled joints, a closed loop, a free base."""

from collections.abc import Callable

import numpy as np
import pytest

from runtime.library import Library
from tests.runtime.library.conftest import palletizer, palletizer_folder, wrist

__all__ = ["palletizer", "palletizer_folder", "wrist"]

ROBOTS = ("fr3", "gantry", "wrist", "palletizer", "hopper")
State = tuple[np.ndarray, ...]


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
