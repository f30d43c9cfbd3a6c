"""Methods that descend in λ: from a `Problem` to a `Fit`, one at a time or many at once."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from runtime.common.threads import cores, one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.descent.adam import Preset, Watch, descend, descend_many
from runtime.estimators.descent.descent import (
    Descent,
    descent_of,
    levenberg_descend,
    newton_descend,
)
from runtime.estimators.methods import Method
from runtime.estimators.optimizers import (
    AdamOptions,
    LevenbergOptions,
    Outcome,
    Status,
    StoppingRule,
    Trace,
)
from runtime.estimators.problem import Fit, Problem, best_friction, in_unit, mass_unit
from runtime.estimators.regression.factor import TorqueObjective
from runtime.library import Array, Library

__all__ = ["PRESETS", "fit_levenberg", "fit_many", "fit_of", "start_of"]

PRESETS = {
    "simulation": Preset(AdamOptions(1e-3), StoppingRule(1500, 25), 64),
    "real": Preset(AdamOptions(1e-4), StoppingRule(2500, 25), 64),
    "full": Preset(AdamOptions(1e-3), StoppingRule(20000, 200, threshold=1e-8), None),
}

THINNEST_AXIS = 1e-6
"""Σ_com eigenvalues below this fraction of the trace are raised to it after a descent in λ:
sign-normalised steps can carry a, b or c through 0, where P is singular."""


def in_batches(preset: str | Preset | None) -> bool:
    """Whether Adam draws mini-batches with these settings; by default it takes all samples."""
    chosen = PRESETS.get(preset) if isinstance(preset, str) else preset
    return chosen is not None and chosen.batch is not None


def preset_of(preset: str | Preset | None) -> Preset:
    """Settings by their name; the settings themselves pass through, None is "full"."""
    preset = preset or "full"
    if not isinstance(preset, str):
        return preset
    if preset not in PRESETS:
        raise IdentificationError(
            f"there is no preset '{preset}'; choose one of {', '.join(PRESETS)}"
        )
    return PRESETS[preset]


def fit_adam(problem: Problem, preset: str | Preset | None = None) -> Fit:
    """Descend in x = [λ, ψ] from the first guess with its best friction (Sec. 4.6, 4.7)."""
    settings = preset_of(preset)
    descent = start_of(problem)
    return fit_of(descent, descend(descent, settings))


def fit_levenberg(problem: Problem, cholesky: bool = False) -> Fit:
    """Descend by Levenberg–Marquardt from the first guess with its best friction.

    Where it stops short of an optimum on the boundary of consistency, and where the library has no
    compiled loop, Newton's method goes on.

    Args:
        problem: samples, weights and first guess.
        cholesky: whether bodies have log-Cholesky coordinates in place of λ.

    Returns:
        Fit with π (10 n,) [kg, kg·m, kg·m²] and φ (n, k).
    """
    descent = start_of(problem, cholesky)
    outcome = levenberg_descend(descent, LevenbergOptions())
    if outcome.status in {Status.MAX_ITERATIONS, Status.STALLED}:
        descent, outcome = _in_cholesky(descent, outcome)
        outcome = newton_descend(descent, outcome)
    return fit_of(descent, outcome)


def _in_cholesky(descent: Descent, outcome: Outcome) -> tuple[Descent, Outcome]:
    """A descent and its end in log-Cholesky coordinates."""
    if descent.cholesky:
        return descent, outcome
    lib, size = descent.problem.lib, descent.problem.start.size
    safe, _ = _thickened(lib, descent.bodies(outcome.x))
    x = np.concatenate([lib.cholesky_from_pi(safe), outcome.x[size:]])
    return replace(descent, x0=x, cholesky=True), replace(outcome, x=x)


@one_blas_thread
def fit_many(
    problems: Sequence[Problem],
    preset: Preset,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    watch: Watch | None = None,
) -> list[Fit]:
    """`fit_adam` on many problems of one robot at once: multi-start, Monte Carlo.

    Args:
        problems: problems of the same robot.
        preset: settings of all descents.
        threads: of the compiled loop; by default one per core.
        progress: called with the iterations done.
        watch: observer of all descents.

    Returns:
        One fit per problem.
    """
    count = threads or cores()
    if not problems:
        return []
    if not problems[0].lib.descends:
        return [fit_adam(problem, preset) for problem in problems]
    with ThreadPoolExecutor(count) as pool:
        descents = list(pool.map(start_of, problems))
    outcomes = descend_many(descents, preset, count, progress, watch)
    return [fit_of(d, o) for d, o in zip(descents, outcomes, strict=True)]


def start_of(problem: Problem, cholesky: bool = False) -> Descent:
    """Descent from the first guess with its best friction.

    Args:
        problem: samples, weights and first guess.
        cholesky: whether bodies have log-Cholesky coordinates in place of λ.

    Returns:
        Descent from x = [λ, ψ], (10 n + n k,), in the unit of mass of the robot.
    """
    unit = mass_unit(problem.lib, problem.lib.pi_from_lam(problem.start))
    problem = in_unit(problem, unit)
    objective = TorqueObjective(problem.lib, problem.train, problem.weights)
    guess = problem.lib.pi_from_lam(problem.start)
    phi = best_friction(problem.statistics(), guess, problem.train.columns.shape[1:])
    bodies = problem.start
    if cholesky:
        bodies = problem.lib.cholesky_from_pi(problem.lib.nearest_realisable(guess, THINNEST_AXIS))
    return descent_of(problem, objective, objective.join(bodies, phi), cholesky, unit)


def fit_of(descent: Descent, outcome: Outcome) -> Fit:
    """Fit of the outcome of a descent, with π kept off the boundary of consistency.

    Args:
        descent: descent with its problem and unit.
        outcome: its best point x = [λ, ψ], (10 n + n k,).

    Returns:
        Fit in SI units, π (10 n,) [kg, kg·m, kg·m²], φ (n, k) and λ (10 n,).
    """
    lib, unit = descent.problem.lib, descent.unit
    lam, phi = descent.objective.split(outcome.x)
    left_out = descent.problem.left_out
    if left_out is not None:  # their columns are 0: steps of Newton leave rounding there
        phi = np.where(left_out.reshape(phi.shape), 0.0, phi)
    raw = unit * descent.bodies(outcome.x)
    pi, notes = _thickened(lib, raw)
    trace = outcome.trace
    if unit != 1:  # L in (N·m)² again
        losses = (tuple(unit**2 * np.array(row)) for row in (trace.training, trace.validation))
        trace = Trace(trace.iteration, *losses)
    return Fit(
        pi=pi,
        phi=unit * phi,
        lam=lib.lam_from_pi(pi) if notes or descent.cholesky or unit != 1 else lam,
        status=outcome.status.value,
        iterations=outcome.iterations,
        trace=trace,
        notes=notes,
        unrepaired=float(lib.relative_eigenvalues(raw).min()),
    )


def _thickened(lib: Library, pi: Array) -> tuple[Array, tuple[str, ...]]:
    """π with Σ_com of each link at least `THINNEST_AXIS` of its trace, and a note on the change."""
    safe = lib.nearest_realisable(pi, THINNEST_AXIS)
    thin = lib.relative_eigenvalues(pi) < THINNEST_AXIS
    result = np.where(np.repeat(thin, pi.size // lib.n_links), safe, pi)
    if not thin.any():
        return pi, ()
    names = ", ".join(np.array(lib.link_names)[thin])
    change = float(np.abs(result - pi).max())
    return result, (
        f"the estimate of {names} lies on the boundary of consistency (a plate or a rod); the thin "
        f"axes were kept at the smallest allowed size (largest change {change:.1e} kg·m²)",
    )


ADAM = Method(
    "adam",
    "gradient descent in λ, consistent by construction (document Sec. 4)",
    fit_adam,
    label="λ-Adam",
    from_statistics=True,
    uses_validation=True,
    takes_preset=True,
    in_batches=in_batches,
)
LEVENBERG_MARQUARDT = Method(
    "lm",
    "Levenberg-Marquardt in λ on the compressed data, consistent by construction",
    fit_levenberg,
    from_statistics=True,
    uses_validation=True,
)
LOG_CHOLESKY = Method(
    "log-cholesky",
    "Levenberg-Marquardt in log-Cholesky coordinates, consistent by construction",
    partial(fit_levenberg, cholesky=True),
    label="log-cholesky",
    from_statistics=True,
    uses_validation=True,
)
