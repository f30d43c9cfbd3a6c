"""Pinocchio through its Python interface, one call per sample."""

from collections.abc import Callable
from importlib.metadata import version

import numpy as np

from bench.batch import Batch
from bench.peers.peer import REGRESSOR, Contender, Peer, one_by_one
from bench.peers.pinocchio_model import pinocchio_model
from runtime.library import Array, Library


def pinocchio_python(lib: Library, batch: Batch) -> Peer:
    """The same algorithms through Pinocchio's Python interface, one call per sample."""
    model, ids = pinocchio_model(lib)
    import pinocchio as pin

    data, n = model.createData(), lib.n_joints
    columns = np.array([model.joints[i].idx_v for i in ids])
    order = np.empty(n, dtype=int)
    order[columns] = np.arange(n)
    q, dq, ddq, tau = (x[:, order] for x in (batch.q, batch.dq, batch.ddq, batch.tau))
    motion = (q, dq, ddq)

    def contender(algorithm: str, *arrays: Array, last: Callable[[], Array] | None) -> Contender:
        function = getattr(pin, algorithm)
        return Contender(
            f"pin.{algorithm}",
            one_by_one(batch, lambda *row: function(model, data, *row), *arrays),
            last,
        )

    rnea = contender("rnea", *motion, last=lambda: data.tau[columns])
    regressor = contender(REGRESSOR, *motion, last=None)
    return Peer(
        f"pin {version('pin')}",
        {
            "inverse_dynamics": rnea,
            "base_inverse_dynamics": rnea,
            "torque": rnea,
            "regressor": regressor,
            "base_regressor": regressor,
            "mass_matrix": contender("crba", q, last=None),
            "forward_dynamics": contender(
                "aba",
                q,
                dq,
                tau,
                last=lambda: pin.aba(model, data, q[-1], dq[-1], tau[-1])[columns],
            ),
            "end_effector": contender("forwardKinematics", q, last=None),
        },
    )
