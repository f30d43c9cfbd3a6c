"""The kernels of every robot, each with one line of algebra and one sentence.

Batches run over time samples, over links (maps of one body) or over points of a time grid.
"""

from dataclasses import dataclass, field

from symgen.catalogue.bodies import body_kernels
from symgen.catalogue.design import (
    proof_kernels,
    safety_kernels,
    torque_derivatives,
    trajectory_kernels,
)
from symgen.catalogue.loops import loop_kernels, without_seeds
from symgen.catalogue.motion import control_kernels, motion_kernels, passive_kernels
from symgen.catalogue.omitted import omitted_kernels, shortened
from symgen.chain import Chain
from symgen.collision.model import CollisionModel
from symgen.kernel import Kernel
from symgen.mechanics import dynamics
from symgen.mechanics.base_parameters import BaseParameters, numeric_base


@dataclass(frozen=True, slots=True)
class Catalogue:
    """All kernels of one robot, and the base parameters that some of them use."""

    kernels: tuple[Kernel, ...]  # in the order of the generated files
    base: BaseParameters  # base parameters
    # kernel that this robot does not get → what to use instead
    omitted: dict[str, str] = field(default_factory=dict)


def make_catalogue(chain: Chain, collision: CollisionModel | None = None) -> Catalogue:
    """Return all kernels of a chain."""
    base = numeric_base(chain, dynamics.sampled_regressor(chain))
    omitted = omitted_kernels(chain)
    kernels = (*motion_kernels(chain, base, omitted), *body_kernels())
    if not chain.floating:
        kernels = (
            *kernels,
            *trajectory_kernels(chain, base, omitted),
            *safety_kernels(chain, collision or CollisionModel(), omitted),
            *proof_kernels(chain),
            *passive_kernels(chain),
        )
    elif "torque_derivatives" not in omitted:
        kernels = (*kernels, torque_derivatives(chain))
    kernels = (*kernels, *control_kernels(chain, omitted), *loop_kernels(chain))
    shipped, dropped = shortened(chain, without_seeds(chain, kernels))
    return Catalogue(shipped, base, omitted | dropped)
