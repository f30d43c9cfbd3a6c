"""The classical methods: same problem in, same answer out."""

from collections.abc import Callable

from runtime.estimators.classical.ekf import fit_ekf
from runtime.estimators.classical.iv_didim import fit_didim, fit_iv
from runtime.estimators.classical.neural import INPUTS, fit_neural
from runtime.estimators.classical.ols import fit_ols
from runtime.estimators.classical.pc_ols import (
    ConvexOptimum,
    cone_optimum,
    convex_optimum,
    fit_pc_ols,
)
from runtime.estimators.classical.ukf import fit_ukf
from runtime.estimators.classical.wls import fit_wls
from runtime.estimators.problem import Fit, Problem

BASELINES: dict[str, Callable[[Problem], Fit]] = {
    "pc-ols": fit_pc_ols,
    "ols": fit_ols,
    "wls": fit_wls,
    "iv": fit_iv,
    "didim": fit_didim,
    "ekf": fit_ekf,
    "ukf": fit_ukf,
    "nn": fit_neural,
}
"""Method → what solves a problem by it."""

__all__ = [
    "BASELINES",
    "INPUTS",
    "ConvexOptimum",
    "cone_optimum",
    "convex_optimum",
    "fit_didim",
    "fit_ekf",
    "fit_iv",
    "fit_neural",
    "fit_ols",
    "fit_pc_ols",
    "fit_ukf",
    "fit_wls",
]
