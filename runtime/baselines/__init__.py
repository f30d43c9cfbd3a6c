"""The classical methods: same problem in, same answer out."""

from runtime.baselines.ols import fit_ols
from runtime.baselines.pc_ols import ConvexOptimum, cone_optimum, convex_optimum, fit_pc_ols

__all__ = ["ConvexOptimum", "cone_optimum", "convex_optimum", "fit_ols", "fit_pc_ols"]
