"""Regression: samples → a triangular factor, residuals, coloured noise, and the torque loss.

‖R [β; φ] − r‖² + ρ = Σ s rᵀ W r with r = Y_b β + F φ − τ (Eqs. 3.11, 4.5). The rows
are reduced by orthogonal transformations, never by normal equations, so that ill-conditioned data
keep their digits.
"""
