"""Excitation trajectories that make base parameters visible: Fourier + quintic, best of starts.

q(t) = home + Σ_m a_m φ_m(t) per joint (Eqs. 3.24–3.28); the cost is log cond of the
column-normalised base regressor at equally spaced samples (Eq. 3.29) with its exact gradient from
the generated adjoint; the limits are linear in a.
"""

from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.information import COST_SAMPLES, ConditionCost, log_condition

__all__ = ["COST_SAMPLES", "ConditionCost", "Trajectory", "log_condition"]
