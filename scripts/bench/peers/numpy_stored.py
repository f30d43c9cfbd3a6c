"""NumPy's products with a regressor that is already stored."""

import time
from collections.abc import Callable

import numpy as np

from bench.batch import Batch
from bench.peers.peer import Contender, Peer
from runtime.library import Array, Library


def numpy_stored(lib: Library, batch: Batch) -> Peer:
    """NumPy products with the stored Y of all samples."""
    n = lib.n_joints
    y = lib.regressor(batch.q, batch.dq, batch.ddq)
    flat = y.reshape(-1, 10 * n)
    base = np.ascontiguousarray(flat[:, lib.base_columns])
    by_link = np.ascontiguousarray(flat.reshape(-1, n, 10).transpose(1, 0, 2))
    blocks = lib.pi_jacobian(batch.lam)
    kept: dict[str, Array] = {}

    def torque() -> None:
        kept["torque"] = flat @ batch.pi

    def base_torque() -> None:
        kept["torque"] = base @ batch.beta

    def jacobian() -> None:
        kept["jacobian"] = by_link @ blocks

    def loss() -> None:
        r = flat @ batch.pi - batch.tau.ravel()
        kept["gradient"] = flat.T @ (np.tile(batch.weight, batch.size) * r)

    def contender(
        algorithm: str, whole: Callable[[], None], last: Callable[[], Array] | None
    ) -> Contender:
        def run(calls: int) -> float:
            start = time.perf_counter_ns()
            for _ in range(calls):
                whole()
            return (time.perf_counter_ns() - start) / (calls * batch.size)

        return Contender(algorithm, run, last)

    product = contender("stored Y @ π", torque, lambda: kept["torque"][-n:])
    return Peer(
        f"numpy {np.__version__}",
        {
            "inverse_dynamics": product,
            "base_inverse_dynamics": contender(
                "stored Y_b @ β", base_torque, lambda: kept["torque"][-n:]
            ),
            "torque": product,
            "torque_jacobian": contender(
                "stored Y @ ∂π/∂λ", jacobian, lambda: kept["jacobian"][:, -n:].transpose(1, 0, 2)
            ),
            "loss_gradient": contender("stored Yᵀ W (Y @ π − τ)", loss, None),
        },
    )
