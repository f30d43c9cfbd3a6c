"""Friction of a fleet: mean of every coefficient over the units, and their spread.

    φ_u ~ N(μ, τ² + v_u)   per joint and column, v_u the variance of the estimate of unit u

μ and the standard deviation of a further unit are means over τ, uniform on a grid, weighted by its
restricted likelihood.
Source: Patterson & Thompson 1971 for the restricted likelihood; Gelman 2006 for the uniform τ.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.library import Array, Library
from runtime.monitoring.fleet.hierarchy import FleetFit
from runtime.monitoring.fleet.unit import Unit, common_columns

GRID = 80
"""Values of τ, from 1/1000 of the smallest to the largest possible one."""
LEAST = 3
"""Smallest number of units that determine a coefficient."""


@dataclass(frozen=True, slots=True)
class FleetFriction:
    """Friction coefficients of a type.

    Attributes:
        columns: names of the k columns that all units have.
        widths: coulomb_speed, stribeck_speed [rad/s] and dahl_stroke [rad] of the columns.
        mean: μ, (n, k) [N·m per unit of the column]; NaN where nothing is known.
        sigma: standard deviation of a further unit, (n, k).
        units: coefficients of every unit, (U, n, k); NaN where its log does not determine one.
    """

    columns: tuple[str, ...]
    widths: tuple[float, float, float]
    mean: Array
    sigma: Array
    units: Array


def fit_friction(lib: Library, units: Sequence[Unit], fit: FleetFit) -> FleetFriction:
    """Friction of a type from its units."""
    columns = common_columns(units)
    shape = (lib.n_joints, len(columns))
    beta = fit.pi @ lib.base_matrix.T
    phi, variance = np.zeros((len(units), *shape)), np.zeros((len(units), *shape))
    for u, unit in enumerate(units):
        rows = unit.friction[:, [unit.columns.index(name) for name in columns]]
        slope = rows[..., 1:-1]
        phi[u] = rows[..., 0] - slope @ beta[u]
        of_beta = np.einsum("jki,il,jkl->jk", slope, fit.covariance[u], slope, optimize=True)
        # Large slopes cancel, so that the rounding of C_β may be below 0.
        variance[u] = rows[..., -1] + np.maximum(of_beta, 0.0)
    known = np.isfinite(variance)
    phi = np.where(known, phi, np.nan)
    mean, sigma = np.full(shape, np.nan), np.full(shape, np.inf)
    for at in np.ndindex(*shape):
        counted = known[:, *at] & ~fit.stands_out
        if counted.sum() >= LEAST:
            mean[at], sigma[at] = random_effects(phi[:, *at][counted], variance[:, *at][counted])
    return FleetFriction(columns, units[0].widths, mean, sigma, phi)


def random_effects(values: Array, variance: Array) -> tuple[float, float]:
    """Mean of values with a spread of their own, and the standard deviation of a further one."""
    largest = np.ptp(values) + np.sqrt(variance.max())
    smallest = 1e-3 * np.sqrt(variance.min())
    tau = np.concatenate([[0.0], np.geomspace(min(smallest, largest), largest, GRID)])
    weight = 1 / (variance + tau[:, None] ** 2)
    total = weight.sum(axis=1)
    mean = weight @ values / total
    misfit = np.sum(weight * (values - mean[:, None]) ** 2, axis=1)
    cost = misfit - np.log(weight).sum(axis=1) + np.log(total)
    # The mean over τ instead of the best τ: its likelihood is often largest at 0, which would
    # claim that all units are alike.
    share = np.exp((cost.min() - cost) / 2) * np.gradient(tau)
    share /= share.sum()
    centre = float(share @ mean)
    return centre, float(np.sqrt(share @ (tau**2 + 1 / total + (mean - centre) ** 2)))
