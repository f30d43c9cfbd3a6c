"""IDIM-OLS: min ‖W_b β + F φ − T‖, unweighted, on base parameters, by QR (Eq. 3.7).

Nothing keeps the result physical. π is the vector nearest to the first guess with K π = β.
Source: Gautier 1997; document Sec. 3.1.3.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.estimators.method import Method
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression import Statistics
from runtime.library import Array, Library
from runtime.library.parameters import links, mass
from runtime.recording.friction import names_where

RANK_TOLERANCE = 1e-9
"""Relative size below which a direction of the normalised columns counts as not excited."""


@dataclass(frozen=True, slots=True)
class Solution:
    """β, φ (n, k) and the condition number of the normalised columns."""

    beta: Array
    phi: Array
    condition: float


def fit_ols(problem: Problem) -> Fit:
    """Ordinary least squares on base parameters and friction together.

    Raises:
        IdentificationError: the motion does not excite all base parameters.
    """
    equal = np.ones(problem.train.equations)
    found = solve(problem.statistics(equal), problem.lib, problem.friction_names)
    text = f"solved by QR; condition number of the normalised columns {found.condition:.1f}"
    return fit_of_base(problem, found.beta, found.phi, text)


def solve(statistics: Statistics, lib: Library, terms: tuple[str, ...] = ()) -> Solution:
    """Least squares of compressed samples, all columns normalised.

    Args:
        statistics: of the samples.
        lib: of the robot.
        terms: names of each joint's friction columns. A rotor or coupled motor that does what
            base parameters do is counted in those, and gets 0.

    Raises:
        IdentificationError: the motion does not excite all of them.
    """
    matrix, norms = statistics.unit_columns()
    shown = np.ones(matrix.shape[1], dtype=bool)
    shown[statistics.n_base :] = ~counted_in_links(statistics, lib, terms)
    sigma = np.linalg.svd(matrix[:, shown], compute_uv=False)
    rank = int(np.sum(sigma > RANK_TOLERANCE * sigma[0]))
    if rank < shown.sum():
        raise IdentificationError(
            f"the motion excites {rank} of {shown.sum()} columns (base parameters and friction), "
            "so least squares has no unique answer; record a richer trajectory, or use a method "
            "that keeps to the first guess where the data are silent: map, adam, pc-ols"
        )
    solution = np.zeros(len(shown))
    solution[shown] = np.linalg.lstsq(matrix[:, shown], statistics.target, rcond=None)[0]
    solution /= norms
    beta, phi = np.split(solution, [statistics.n_base])
    return Solution(beta, phi.reshape(lib.n_joints, -1), float(sigma[0] / sigma[-1]))


def counted_in_links(
    statistics: Statistics, lib: Library, terms: tuple[str, ...]
) -> NDArray[np.bool_]:
    """(n k,): columns of rotors and coupled motors that do what base parameters do as well.

    On the first joint of an arm above all, a link's inertia does what the rotor does; a method
    that asks no prior cannot tell them apart. Source: Gautier's regrouping.
    """
    inertial = names_where(lambda column: column.is_inertial or column.of_motors)
    rotors = [name in inertial for name in terms]
    if not any(rotors):
        return np.zeros(statistics.factor.shape[1] - statistics.n_base, dtype=bool)
    return statistics.explained() & np.tile(rotors, lib.n_joints)


def pi_of_beta(problem: Problem, beta: Array) -> Array:
    """The π nearest to the first guess with K π = β."""
    guess, k = problem.lib.pi_from_lam(problem.start), problem.lib.base_matrix
    return np.asarray(guess + np.linalg.lstsq(k, beta - k @ guess, rcond=None)[0])


def fit_of_base(
    problem: Problem,
    beta: Array,
    phi: Array,
    status: str,
    iterations: int | None = None,
    notes: tuple[str, ...] = (),
) -> Fit:
    """The answer of a method that finds base parameters."""
    return fit_of_pi(problem, pi_of_beta(problem, beta), phi, status, iterations, notes)


def fit_of_pi(
    problem: Problem,
    pi: Array,
    phi: Array,
    status: str,
    iterations: int | None = None,
    notes: tuple[str, ...] = (),
) -> Fit:
    """The answer of a method that finds π, with λ where its links can exist."""
    lib = problem.lib
    possible = bool((lib.relative_eigenvalues(pi) > 0).all() and (mass(links(pi)) > 0).all())
    lam = lib.lam_from_pi(pi) if possible else None
    return Fit(pi, phi, lam, status, iterations, notes=notes)


OLS = Method(
    "ols",
    "ordinary least squares on base parameters, not always consistent (Eq. 3.7)",
    fit_ols,
    from_statistics=True,
    objective="minimises the unweighted error",
)
