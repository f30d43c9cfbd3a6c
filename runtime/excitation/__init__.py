"""Excitation trajectories that make base parameters visible: Fourier + quintic, best of starts.

q(t) = home + Σ_m a_m φ_m(t) per joint (Eqs. 3.24–3.28); the cost is log cond of the
column-normalised base regressor at equally spaced samples (Eq. 3.29) with its exact gradient from
the generated adjoint; the limits are linear in a.
"""

from typing import TYPE_CHECKING

from runtime.startup.lazy_names import lazy_names

if TYPE_CHECKING:
    from runtime.excitation.limits.joint_limits import (
        DEFAULT_ACCELERATION,
        DEFAULT_RANGE,
        LIMIT_STEP,
        Limits,
        whitening,
    )
    from runtime.excitation.limits.safety import Safety
    from runtime.excitation.motion.basis import BASES, COSINE, basis_of
    from runtime.excitation.motion.family import Basis
    from runtime.excitation.motion.fourier import fourier_basis
    from runtime.excitation.motion.trajectory import Trajectory
    from runtime.excitation.search.condition_cost import COST_SAMPLES, ConditionCost
    from runtime.excitation.search.criteria import CRITERIA, Criterion
    from runtime.excitation.search.design import Design, design
    from runtime.excitation.search.design_settings import LONGEST, DesignSettings
    from runtime.excitation.search.information import Information, information
    from runtime.excitation.search.measures import log_condition
    from runtime.excitation.search.prediction import Prediction, covariance_of, predict, torque_band
    from runtime.excitation.search.single_start import START

__all__ = [
    "BASES",
    "COSINE",
    "COST_SAMPLES",
    "CRITERIA",
    "DEFAULT_ACCELERATION",
    "DEFAULT_RANGE",
    "LIMIT_STEP",
    "LONGEST",
    "START",
    "Basis",
    "ConditionCost",
    "Criterion",
    "Design",
    "DesignSettings",
    "Information",
    "Limits",
    "Prediction",
    "Safety",
    "Trajectory",
    "basis_of",
    "covariance_of",
    "design",
    "fourier_basis",
    "information",
    "log_condition",
    "predict",
    "torque_band",
    "whitening",
]

__getattr__ = lazy_names(
    __name__,
    {
        "BASES": "runtime.excitation.motion.basis",
        "Basis": "runtime.excitation.motion.family",
        "COSINE": "runtime.excitation.motion.basis",
        "COST_SAMPLES": "runtime.excitation.search.condition_cost",
        "CRITERIA": "runtime.excitation.search.criteria",
        "ConditionCost": "runtime.excitation.search.condition_cost",
        "Criterion": "runtime.excitation.search.criteria",
        "DEFAULT_ACCELERATION": "runtime.excitation.limits.joint_limits",
        "DEFAULT_RANGE": "runtime.excitation.limits.joint_limits",
        "Design": "runtime.excitation.search.design",
        "DesignSettings": "runtime.excitation.search.design_settings",
        "Information": "runtime.excitation.search.information",
        "LIMIT_STEP": "runtime.excitation.limits.joint_limits",
        "LONGEST": "runtime.excitation.search.design_settings",
        "Limits": "runtime.excitation.limits.joint_limits",
        "Prediction": "runtime.excitation.search.prediction",
        "START": "runtime.excitation.search.single_start",
        "Safety": "runtime.excitation.limits.safety",
        "Trajectory": "runtime.excitation.motion.trajectory",
        "basis_of": "runtime.excitation.motion.basis",
        "covariance_of": "runtime.excitation.search.prediction",
        "design": "runtime.excitation.search.design",
        "fourier_basis": "runtime.excitation.motion.fourier",
        "information": "runtime.excitation.search.information",
        "log_condition": "runtime.excitation.search.measures",
        "predict": "runtime.excitation.search.prediction",
        "torque_band": "runtime.excitation.search.prediction",
        "whitening": "runtime.excitation.limits.joint_limits",
    },
)
