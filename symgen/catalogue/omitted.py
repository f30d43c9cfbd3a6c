"""Kernels that a robot does not get, each with what to use instead.

The manifest lists them, and the run time answers a call of one with its sentence.
"""

from symgen.chain import Chain

_FIXED = "build the robot without --floating for motions that a fixed base carries out"
_FREE_BASE = {
    "momentum_regressor": "use base_regressor with differentiated velocities: the momentum of a "
    "free base is not a derivative by coordinates",
    "energy_regressor": "use base_regressor with differentiated velocities",
    "harmonic_basis": _FIXED,
    "transfer_basis": _FIXED,
    "regressor_adjoint": _FIXED,
    "torque_derivatives": "use mass_matrix for the derivative by ddq and differences of "
    "inverse_dynamics for the others",
    "torque_rate": "use differences of inverse_dynamics along the motion",
    "torque_rate_adjoint": _FIXED,
    "torque_course": "use differences of inverse_dynamics along the motion",
    "tip_motion": "use end_effector for the pose of the tip",
    "clearance": _FIXED,
    "plane_clearance": _FIXED,
    "coriolis_matrix": "use bias_forces for C dq",
    "slotine_li_regressor": "use regressor",
    "mobility_bound": "use the eigenvalues of mass_matrix",
}


def omitted_kernels(chain: Chain) -> dict[str, str]:
    """Names of the kernels that this robot does not get.

    Args:
        chain: of the robot.

    Returns:
        Kernel → what to use instead.
    """
    return dict(_FREE_BASE) if chain.floating else {}
