"""IDIM-OLS: min ‖W_b β + F φ − T‖, unweighted, on base parameters, by QR (Eq. 3.7).

Nothing keeps the result physical. π is the vector nearest to the first guess with K π = β.
Source: Gautier 1997; document Sec. 3.1.3.
"""

import numpy as np

from runtime.errors import IdentificationError
from runtime.library.manifest import PI_NAMES
from runtime.problem import Fit, Problem

RANK_TOLERANCE = 1e-9
"""Relative size below which a direction of the normalised columns counts as not excited."""


def fit_ols(problem: Problem) -> Fit:
    """Ordinary least squares on base parameters and friction together.

    Raises:
        IdentificationError: the motion does not excite all base parameters.
    """
    lib = problem.lib
    statistics = problem.statistics(np.ones(lib.n_joints))
    matrix, norms = statistics.unit_columns()
    n_b = len(lib.base_columns)
    shown = np.any(matrix != 0, axis=0)
    shown[:n_b] = True  # a friction column that is 0 throughout, such as a hidden rotor, stays 0
    sigma = np.linalg.svd(matrix[:, shown], compute_uv=False)
    rank = int(np.sum(sigma > RANK_TOLERANCE * sigma[0]))
    if rank < shown.sum():
        raise IdentificationError(
            f"the motion excites {rank} of {shown.sum()} columns (base parameters and friction), "
            "so ordinary least squares has no unique answer; record a richer trajectory, or use "
            "a method that keeps to the first guess where the data are silent: adam, pc-ols"
        )
    solution = np.linalg.lstsq(matrix, statistics.target, rcond=None)[0] / norms
    beta, phi = solution[:n_b], solution[n_b:].reshape(problem.train.columns.shape[1:])
    guess = lib.pi_from_lam(problem.start)
    k = lib.base_matrix
    pi = guess + np.linalg.lstsq(k, beta - k @ guess, rcond=None)[0]
    status = f"solved by QR; condition number of the normalised columns {sigma[0] / sigma[-1]:.1f}"
    possible = bool((lib.relative_eigenvalues(pi) > 0).all() and (pi[:: len(PI_NAMES)] > 0).all())
    return Fit(pi, phi, lib.lam_from_pi(pi) if possible else None, status)
