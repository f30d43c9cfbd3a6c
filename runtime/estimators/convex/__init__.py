"""The convex estimators: maximum a posteriori with an entropic prior, and its limit PC-IDIM-OLS.

    min over π of (‖A π − b‖² + ρ)/2N + Σ_k γ_k [tr(P0_k⁻¹ P_k) − log det P_k]

Every minimiser is strictly consistent, P_k ≻ 0. Source: Lee, Wensing & Park 2019 (prior);
Wensing, Kim & Slotine 2018 (P ⪰ 0); document Sec. 3.1.4.
"""
