"""One unit of a fleet: rows over the base parameters in units of their noise, and its friction.

Friction is eliminated, so that A β = b + ε with ε ~ N(0, 1) is what a unit contributes to the
inertias of the type. Its friction follows from β:  φ = f − G β + N(0, v).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from runtime.estimators.convex.eliminate_friction import Elimination, reduce
from runtime.estimators.convex.prior_agreement import LEAST_DENSITY
from runtime.identification.statistics_file import UnitStatistics
from runtime.library import Array, Library
from runtime.recording.settings import WIDTHS, widths_of


@dataclass(frozen=True, slots=True)
class Unit:
    """Contribution of one unit."""

    name: str  # of the unit
    columns: tuple[str, ...]  # names of the k friction columns that belong to the whole log
    # widths of these columns: coulomb_speed, stribeck_speed [rad/s], dahl_stroke [rad]
    widths: tuple[float, float, float]
    factor: Array  # A, (n_b, n_b), in units of the noise
    target: Array  # b, (n_b,)
    # f, G and v per joint and column, (n, k, n_b + 2); v is infinite where the log does not
    # determine the coefficient
    friction: Array
    noise: Array  # standard deviation of the torque per joint, (n,) [N·m, N]; NaN where not known
    density: float  # S, variance with which noise over its standard deviation enters the unknowns


def unit_of(known: UnitStatistics, lib: Library, name: str) -> Unit:
    """Eliminate friction from the statistics of one unit."""
    base = lib.base_matrix
    over_beta = replace(known.statistics, base_matrix=np.eye(len(base)))
    data, elimination = reduce(over_beta, lib.n_joints)
    level = max(known.density, LEAST_DENSITY)
    # Rows of A over β alone, n_b of them: the triangle of [A b].
    rows = np.column_stack([data.factor, data.target]) / np.sqrt(level)
    count = len(base)
    triangle = np.zeros((count, count + 1))
    upper = np.linalg.qr(rows, mode="r")[:count]
    triangle[: len(upper)] = upper
    n, columns = lib.n_joints, known.shared
    every = _friction(elimination, level, count).reshape(n, len(known.columns), count + 2)
    places = [known.columns.index(each) for each in columns]
    return Unit(
        name,
        columns,
        known.widths,
        np.ascontiguousarray(triangle[:, :count]),
        triangle[:, count].copy(),
        np.ascontiguousarray(every[:, places]),
        np.full(n, np.nan) if known.noise is None else known.noise,
        known.density,
    )


def common_columns(units: Sequence[Unit]) -> tuple[str, ...]:
    """Friction columns that all units have with the same widths, in the order of the first."""
    first = units[0]
    names = [name for name in first.columns if all(name in unit.columns for unit in units)]
    alike = [all(unit.widths[k] == first.widths[k] for unit in units) for k in range(len(WIDTHS))]
    differing = {width for width, same in zip(WIDTHS, alike, strict=True) if not same}
    return tuple(name for name in names if not widths_of((name,)) & differing)


def _friction(system: Elimination, level: float, count: int) -> Array:
    """f, G and v of φ = f − G β, (n k, n_b + 2), in the order of φ."""
    rank, size = len(system.matrix), system.lengths.size
    rows = np.zeros((size, count + 2))
    rows[:, -1] = np.inf
    if rank:
        known = system.order[:rank]
        inverse = solve_triangular(system.matrix, np.eye(rank))
        rows[known, 0] = inverse @ system.target
        rows[known, 1:-1] = inverse @ system.over_pi
        rows[known, -1] = level * np.sum(inverse**2, axis=1)
    scale = system.lengths[:, None]
    rows[:, :-1] /= scale
    rows[:, -1:] /= scale**2
    return rows
