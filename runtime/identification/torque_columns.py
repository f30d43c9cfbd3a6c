"""Columns that are the torque of the log itself, by Gauss–Newton about the model.

    (1 + g) τ = Y π + F φ,   1 + g per joint unknown

With τ as a column, g = −1 explains every log. The fit is thus that of τ = (Y π + F φ)/(1 + g) + e,
whose linearisation at the present estimate, times 1 + ĝ, has the torque h of the model as column,

    h + (1 + ĝ)(τ − h) = Y π + F φ − g h + (1 + ĝ) e,   h = (Y π̂ + F φ̂)/(1 + ĝ)

and ends where h is that of its own fit. There a common factor of all 1 + g, π and φ changes
nothing, as in the equations: the prior alone determines it.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.problem_setup import Assembly
from runtime.library import Array, Library
from runtime.recording import Friction
from runtime.recording.settings import COLUMNS

PASSES = 30
"""Limit of the passes."""
CLOSE = 1e-5
"""Change of g at which the passes end, far below what a log determines."""
LEAST = 0.05
"""Smallest 1 + g by which h is divided."""


def is_torque(names: Iterable[str]) -> NDArray[np.bool_]:
    """Whether each of some columns is the torque itself, (k,)."""
    return np.array([name in COLUMNS and COLUMNS[name].is_torque for name in names], dtype=bool)


def without_torque_columns(terms: Friction) -> Friction:
    """The terms without columns of the torque, for choices by the error of a fit."""
    flags = is_torque(terms.columns)
    kept = (name for name, flag in zip(terms.columns, flags, strict=True) if not flag)
    return replace(terms, columns=tuple(kept))


def with_modelled_torque(assembly: Assembly, fit: Callable[[Problem], Fit]) -> Assembly:
    """The assembly with −h of its own fit in the columns of the torque; unchanged without such."""
    problem, names = assembly.problem, assembly.problem.friction_names
    flags = is_torque(names)
    if not flags.any():
        return assembly
    if problem.pieces is not None or problem.train.equations < problem.lib.n_joints:
        listed = ", ".join(np.array(names)[flags])
        raise IdentificationError(
            f"the friction column {listed} is fitted in passes over rows of every joint in memory, "
            "got a streamed log or rows of power; use --settings stream=false and --settings "
            "regressor=acceleration or "
            "momentum"
        )
    gain = np.ones(problem.lib.n_joints)
    modelled = _replaced(assembly, flags, lambda samples: np.zeros_like(samples.tau), gain)
    for _ in range(PASSES):
        model = fit(modelled.problem)
        before, gain = gain, np.maximum(1 + model.phi[:, flags].sum(axis=1), LEAST)
        phi = np.where(flags, 0.0, model.phi)
        modelled = _replaced(assembly, flags, _torque_of(problem.lib, model.pi, phi, gain), gain)
        if np.abs(gain - before).max() < CLOSE and (gain != 1).any():
            break
    return modelled


def _torque_of(lib: Library, pi: Array, phi: Array, gain: Array) -> Callable[[Samples], Array]:
    """h (N, n) of a model."""

    def torque(samples: Samples) -> Array:
        known = lib.known_torque(samples.q)
        return np.asarray((samples.rigid(lib, pi) + samples.friction(phi) + known) / gain)

    return torque


def _replaced(
    assembly: Assembly, flags: NDArray[np.bool_], torque: Callable[[Samples], Array], gain: Array
) -> Assembly:
    """The assembly with −h in the columns of the torque, and the rows of its problem scaled."""
    problem = assembly.problem

    def of(samples: Samples) -> Samples:
        h = torque(samples)
        rest = samples.tau + problem.lib.known_torque(samples.q) - h
        columns = np.where(flags, -h[..., None], samples.columns)
        return replace(samples, tau=samples.tau + (gain - 1) * rest, columns=columns)

    train, validation, test = (
        part.replace(columns=of(samples_of(part, problem.lib)).columns) for part in assembly.parts
    )
    problem = replace(problem, train=of(problem.train), validation=of(problem.validation))
    return replace(assembly, problem=problem, parts=(train, validation, test))
