"""Unit of mass of a robot: arms of grams and of tons get the steps of arms of kilograms.

Steps in λ, thresholds of the loss and the noise of the document's weights are in kg, m and N·m, for
arms of a few kg per link. τ and F φ are linear in masses, so that a problem in another unit s of
mass has τ/s, φ/s and π/s, and a loss L/s². s is a power of four, which makes the conversion exact,
and 1 for usual arms.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from runtime.estimators.problem import Problem
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library
from runtime.library.parameters import lam_from_parts, lam_parts, links, mass

USUAL = 2.0
"""Median mass of a link of usual arms, kg."""
WITHIN = 16.0
"""Factor on it within which the unit stays 1 kg."""


def mass_unit(lib: Library, pi: Array) -> float:
    """Unit of mass s of a robot, kg."""
    middle = float(np.median(mass(links(pi))))
    if not middle > 0:
        middle = float(np.median(mass(links(lib.pi0))))
    if not 0 < middle < np.inf or USUAL / WITHIN <= middle <= USUAL * WITHIN:
        return 1.0
    return float(4.0 ** round(np.log(middle / USUAL) / np.log(4.0)))


def in_unit(problem: Problem, unit: float) -> Problem:
    """The same problem with another unit of mass."""
    if unit == 1.0:
        return problem
    pieces = problem.pieces

    def scaled(samples: Samples) -> Samples:
        return replace(samples, tau=samples.tau / unit)

    def scaled_pieces(part: str) -> Iterable[Samples]:
        return (scaled(samples) for samples in problem.samples(part))

    return replace(
        problem,
        train=scaled(problem.train),
        validation=scaled(problem.validation),
        start=_lam_in_unit(problem.start, unit),
        pieces=None if pieces is None else scaled_pieces,
    )


def _lam_in_unit(lam: Array, unit: float) -> Array:
    """λ of π/s, (10 n,): ln m − ln s, and semi-axes over √s; c and ω stay."""
    bodies = (lam_parts(body) for body in links(lam))
    return np.concatenate(
        [
            lam_from_parts(log_mass - np.log(unit), centre, omega, axes / np.sqrt(unit))
            for log_mass, centre, omega, axes in bodies
        ]
    )
