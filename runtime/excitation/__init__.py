"""Excitation trajectories that make base parameters visible: Fourier + quintic, best of starts.

q(t) = home + Σ_m a_m φ_m(t) per joint (Eqs. 3.24–3.28); the cost is log cond of the
column-normalised base regressor at equally spaced samples (Eq. 3.29) with its exact gradient from
the generated adjoint; the limits are linear in a.
"""

from runtime.excitation.basis import BASES, COSINE, Basis, basis_of, fourier_basis
from runtime.excitation.cost import COST_SAMPLES, ConditionCost
from runtime.excitation.criteria import log_condition
from runtime.excitation.design import LONGEST, Design, design
from runtime.excitation.goals import CRITERIA
from runtime.excitation.information import Information, information
from runtime.excitation.limits import (
    DEFAULT_ACCELERATION,
    DEFAULT_RANGE,
    LIMIT_STEP,
    Limits,
    whitening,
)
from runtime.excitation.prediction import Prediction, covariance_of, predict, torque_band
from runtime.excitation.safety import Safety
from runtime.excitation.search import START
from runtime.excitation.trajectory import Trajectory

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
    "Design",
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
