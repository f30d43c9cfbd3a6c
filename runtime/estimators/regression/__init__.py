"""Regression: samples → a triangular factor, residuals, coloured noise, and the torque loss.

‖R [β; φ] − r‖² + ρ = Σ s rᵀ W r with r = Y_b β + F φ − τ (Eqs. 3.11, 4.5). The rows
are reduced by orthogonal transformations, never by normal equations, so that ill-conditioned data
keep their digits.
"""

from runtime.estimators.regression.compression import (
    BLOCK,
    CompressedObjective,
    compress,
    compress_all,
    reference_triangle,
)
from runtime.estimators.regression.factor import Statistics, from_triangle, joined, load_statistics

__all__ = [
    "BLOCK",
    "CompressedObjective",
    "Statistics",
    "compress",
    "compress_all",
    "from_triangle",
    "joined",
    "load_statistics",
    "reference_triangle",
]
