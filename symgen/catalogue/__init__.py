"""The kernels that every robot ships: each one line of algebra and one sentence.

Batches run over samples, over links (maps of one body) or over points of a time grid.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from symgen import dynamics, inertia
from symgen.base_parameters import Array, BaseParameters, numeric_base
from symgen.catalogue.bodies import body_kernels
from symgen.catalogue.motion import motion_kernels
from symgen.catalogue.safety import safety_kernels
from symgen.catalogue.trajectory import trajectory_kernels
from symgen.chain import Chain
from symgen.collision import CollisionModel
from symgen.kernel import Kernel

P = inertia.N_PARAMETERS


@dataclass(frozen=True, slots=True)
class Catalogue:
    """All kernels of one robot and the base parameters that shaped some of them."""

    kernels: tuple[Kernel, ...]
    base: BaseParameters


def make_catalogue(chain: Chain, collision: CollisionModel | None = None) -> Catalogue:
    """Write every kernel of a chain; distances only where there are proxies."""
    base = numeric_base(chain, _sampled_regressor(chain))
    kernels = (
        *motion_kernels(chain, base),
        *body_kernels(),
        *trajectory_kernels(chain, base),
        *safety_kernels(chain, collision or CollisionModel()),
    )
    return Catalogue(kernels, base)


def _sampled_regressor(chain: Chain) -> Any:
    n = len(chain.joints)
    q, dq, ddq = (ca.SX.sym(name, n) for name in ("q", "dq", "ddq"))
    rows = ca.densify(ca.vec(dynamics.regressor(chain, q, dq, ddq).T))
    function = ca.Function("Y", [q, dq, ddq], [rows], {"cse": True})

    def sample(q: Array, dq: Array, ddq: Array) -> Array:
        stacked = np.asarray(function.map(len(q))(q.T, dq.T, ddq.T))
        return stacked.T.reshape(len(q), n, P * n)

    return sample
