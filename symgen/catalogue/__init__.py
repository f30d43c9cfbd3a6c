"""The kernels of every robot, each with one line of algebra and one sentence.

The manifest lists kernels that a robot does not get, with what to use instead. Straight-line code
of second derivatives and of regressors grows with the square of the joints: a large robot has no
kernels that others replace, and the longest of the rest have no vector code.
"""

from dataclasses import dataclass, field, replace

from symgen.catalogue.design import (
    proof_kernels,
    safety_kernels,
    torque_derivatives,
    trajectory_kernels,
)
from symgen.catalogue.loops import body_kernels, loop_kernels, without_seeds
from symgen.catalogue.motion import control_kernels, motion_kernels, passive_kernels
from symgen.chain import Chain
from symgen.collision.model import CollisionModel
from symgen.kernel import Kernels
from symgen.mechanics import dynamics
from symgen.mechanics.base_parameters import BaseParameters, numeric_base

_FIXED = "build the robot without --floating for motions that a fixed base carries out"
_FREE_BASE = {
    "momentum_regressor": "use base_regressor with differentiated velocities: the momentum of a "
    "free base is not a derivative by coordinates",
    "energy_regressor": "use base_regressor with differentiated velocities",
    **dict.fromkeys(("harmonic_basis", "transfer_basis", "regressor_adjoint"), _FIXED),
    "torque_rate": "use differences of inverse_dynamics along the motion",
    "torque_rate_adjoint": _FIXED,
    "torque_course": "use differences of inverse_dynamics along the motion",
    "tip_motion": "use end_effector for the pose of the tip",
    **dict.fromkeys(("clearance", "plane_clearance"), _FIXED),
    **dict.fromkeys(("torque_bounds", "tip_bounds", "speed_bounds"), _FIXED),
    "coriolis_matrix": "use bias_forces for C dq",
    "slotine_li_regressor": "use regressor",
    "mobility_bound": "use the eigenvalues of mass_matrix",
}
_PART = "use it on a part of the robot: build with --base and --tip, or --lock"
_LARGE = {
    "momentum_regressor": "use base_regressor with differentiated velocities",
    "energy_regressor": "use base_regressor with differentiated velocities",
    "regressor_adjoint": _PART,
    "torque_derivatives": "use mass_matrix for the derivative by ddq and differences of "
    "inverse_dynamics for the others",
    "torque_rate": _FREE_BASE["torque_rate"],
    "torque_rate_adjoint": _PART,
    "torque_course": _FREE_BASE["torque_course"],
    "coriolis_matrix": "use bias_forces for C dq",
    "slotine_li_regressor": "use regressor",
}

LONG = 6000  # operations above which a kernel of a large robot has no vector code
_NO_SUMS = {"loss_gradient": "use base_regressor, or a method on compressed data such as map"}
"""Kernels that exist as vector code only, because a batch adds up their outputs."""


def shortened(chain: Chain, kernels: Kernels) -> tuple[Kernels, dict[str, str]]:
    """Kernels of a large robot, the longest without vector code, and the omitted ones."""
    if not chain.is_large:
        return kernels, {}
    sizes = {kernel.name: kernel.operations for kernel in kernels if not kernel.factors}
    long = {name for name, size in sizes.items() if size > LONG and name in _SQUARE}
    dropped = {name: instead for name, instead in _NO_SUMS.items() if name in long}
    shipped = []
    for kernel in kernels:
        if kernel.name in dropped:
            continue
        is_long = bool(long & {kernel.name, *kernel.factors})
        shipped.append(replace(kernel, rare=True) if is_long else kernel)
    return tuple(shipped), dropped


_SQUARE = {  # kernels whose length grows with the square of the joints
    *("regressor", "base_regressor", "forward_dynamics", "mass_matrix", "loss_gradient"),
    *("base_parameters", "base_adjoint"),
}


@dataclass(frozen=True, slots=True)
class Catalogue:
    """All kernels of one robot, and the base parameters that some of them use."""

    kernels: Kernels  # in the order of the generated files
    base: BaseParameters  # base parameters
    omitted: dict[str, str] = field(default_factory=dict)  # omitted kernel → what to use instead


def make_catalogue(chain: Chain, collision: CollisionModel | None = None) -> Catalogue:
    """Return all kernels of a chain."""
    base = numeric_base(chain, dynamics.sampled_regressor(chain))
    omitted = (_LARGE if chain.is_large else {}) | (_FREE_BASE if chain.floating else {})
    kernels = (*motion_kernels(chain, base, omitted), *body_kernels())
    if not chain.floating:
        kernels += trajectory_kernels(chain, base, omitted)
        kernels += safety_kernels(chain, collision or CollisionModel(), omitted)
        kernels += (*proof_kernels(chain), *passive_kernels(chain))
    elif "torque_derivatives" not in omitted:
        kernels += (torque_derivatives(chain),)
    kernels += (*control_kernels(chain, omitted), *loop_kernels(chain))
    shipped, dropped = shortened(chain, without_seeds(chain, kernels))
    return Catalogue(shipped, base, omitted | dropped)
