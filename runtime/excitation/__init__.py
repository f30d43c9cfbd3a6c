"""Excitation trajectories that make base parameters visible: Fourier + quintic, best of starts.

q(t) = home + Σ_m a_m φ_m(t) per joint (Eqs. 3.24–3.28); the cost is log cond of the
column-normalised base regressor at equally spaced samples (Eq. 3.29) with its exact gradient from
the generated adjoint; the limits are linear in a.
"""

from runtime.excitation.limits.joint_limits import (
    DEFAULT_ACCELERATION,
    DEFAULT_RANGE,
    LIMIT_STEP,
    Limits,
    whitening,
)
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.fourier import fourier_basis
from runtime.excitation.motion.trajectory import BASES, COSINE, Trajectory, basis_of
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
