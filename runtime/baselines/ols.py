"""IDIM-OLS: min ‖W_b β + F φ − T‖, unweighted, on base parameters, by QR (Eq. 3.7).

Nothing keeps the result physical. π is the vector nearest to the first guess with K π = β.
Source: Gautier 1997; document Sec. 3.1.3.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.friction.motors import PREFIX
from runtime.library import Array, Library
from runtime.library.manifest import PI_NAMES
from runtime.problem import Fit, Problem
from runtime.statistics import Statistics

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
    found = solve(problem.statistics(np.ones(problem.lib.n_joints)), problem.lib, terms_of(problem))
    text = f"solved by QR; condition number of the normalised columns {found.condition:.1f}"
    return fit_of_base(problem, found.beta, found.phi, text)


def terms_of(problem: Problem) -> tuple[str, ...]:
    """Names of the friction columns; empty where nobody told them."""
    return problem.bench.friction.columns if problem.bench else ()


def solve(statistics: Statistics, lib: Library, terms: tuple[str, ...] = ()) -> Solution:
    """Least squares of compressed samples, all columns normalised.

    Args:
        statistics: of the samples.
        lib: of the robot.
        terms: names of each joint's friction columns. Rotors and coupled motors are 0 throughout
            where others stand for them already, and stay 0.

    Raises:
        IdentificationError: the motion does not excite all of them.
    """
    matrix, norms = statistics.unit_columns()
    n_b = len(lib.base_columns)
    others = [name != "rotor" and not name.startswith(PREFIX) for name in terms]
    shown = np.any(matrix != 0, axis=0)
    shown[:n_b] = True
    shown[n_b:] |= np.tile(others, lib.n_joints) if others else True
    sigma = np.linalg.svd(matrix[:, shown], compute_uv=False)
    rank = int(np.sum(sigma > RANK_TOLERANCE * sigma[0]))
    if rank < shown.sum():
        raise IdentificationError(
            f"the motion excites {rank} of {shown.sum()} columns (base parameters and friction), "
            "so least squares has no unique answer; record a richer trajectory, or use a method "
            "that keeps to the first guess where the data are silent: map, adam, pc-ols"
        )
    found = np.linalg.lstsq(matrix, statistics.target, rcond=None)[0] / norms
    solution = np.where(shown, found, 0.0)  # rounding of a strong weight is no coefficient
    beta, phi = np.split(solution, [statistics.n_base])
    return Solution(beta, phi.reshape(lib.n_joints, -1), float(sigma[0] / sigma[-1]))


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
    possible = bool((lib.relative_eigenvalues(pi) > 0).all() and (pi[:: len(PI_NAMES)] > 0).all())
    lam = lib.lam_from_pi(pi) if possible else None
    return Fit(pi, phi, lam, status, iterations, notes=notes)
