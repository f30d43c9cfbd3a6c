"""Comparison of methods, one after the other, on one assembled problem; every one is a row.

All are measured against the same convex optimum L* in the same weights, whatever they minimise: L =
mean ½ rᵀWr of the training samples, the net's share included. L* is that of any friction, so that
bounds of friction coefficients (map, pc-ols) count in the gap.
"""

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import bytes_of, json_of
from runtime.common.tables import Table
from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError, NeedsError, RecordingError, RuntimeFault
from runtime.estimators.classical.pc_ols import BOUNDARY, convex_optimum
from runtime.estimators.methods import METHODS, require_method
from runtime.estimators.optimizers import Status
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.estimators.uncertainty import uncertainty_of
from runtime.identification import metrics
from runtime.identification.identified import Identification
from runtime.identification.problem_setup import Assembly
from runtime.identification.result_record import plain
from runtime.identification.result_tables import NOT_RUN, method_table
from runtime.identification.single_log import identify_assembled
from runtime.library import Array, Library
from runtime.recording.notebook import Shown

UNWRITTEN = ("squares", "contradictions", "model_errors")
"""Figures that compare.json does not state: they are what the advice is from."""
RAN, FAILED = "ran", "failed"


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of one result; the samples of every part are the same for every method."""

    train_percent: float  # train, validation and test: torque error of all joints, Eq. 5.1
    validation_percent: float
    test_percent: float
    rms: Array  # of τ − τ̂ on test, (n,), N·m or N
    squares: Array  # Σ_j (τ_j − τ̂_j)² per validation sample, (N,), (N·m)², for the choice
    base_error_percent: float | None  # 100 ‖β̂ − β‖/‖β‖ where the truth is known, else None
    seconds: float  # time of the method alone, s
    iterations: int | None  # None for closed forms
    smallest_relative_eigenvalue: float  # smallest λ_min(P_k)/tr P_k of all links
    consistent: bool  # every link is physically consistent
    boundary: bool  # a link is close to a plate or a rod
    gap_to_convex_optimum: float  # (L − L*)/L* on training samples, in the weights common to all
    excited: int  # number of base parameters that the motion excites
    determined: int  # combinations of them that the data determine better than the prior does
    contradictions: tuple[str, ...] = ()  # of the data to priors, joints and results
    model_errors: tuple[str, ...] = ()  # intervals' assumptions that residuals contradict


@dataclass(frozen=True, slots=True)
class MethodRow:
    """Outcome of one method."""

    method: str  # name in `METHODS`
    outcome: str  # "ran", "not run" or "failed"
    status: str  # how the method ended, or why it did not run
    figures: Figures | None = None  # None unless it ran


def row_facts(row: MethodRow) -> dict[str, Any]:
    """A row of compare.json."""
    head = {
        "method": row.method,
        "about": METHODS[row.method].sentence,
        "outcome": row.outcome,
        "status": row.status,
    }
    if row.figures is None:
        return head
    facts = {key: x for key, x in asdict(row.figures).items() if key not in UNWRITTEN}
    gap = plain(row.figures.gap_to_convex_optimum)
    return head | facts | {"rms": row.figures.rms.tolist(), "gap_to_convex_optimum": gap}


SUFFIX = ".truth.json"
UNTOUCHED = "interrupted by the user before its turn"
TINY = 1e-9  # share of the loss of τ̂ = 0 that replaces L* where the data are explained to rounding


@dataclass(frozen=True, slots=True)
class TrueParameters:
    """True base parameters."""

    beta: Array  # (n_b,) SI
    name: str  # name of their file
    sha256: str  # digest of its bytes


def beside(log: str) -> Path | None:
    """Path of LOG.truth.json, None where the log has none."""
    path = Path(log).with_suffix(SUFFIX)
    return path if Path(log).is_file() and path.is_file() else None


def read_truth(path: Path, lib: Library) -> TrueParameters:
    """Read the parameters π that `simulate` has written as JSON."""
    try:
        data = bytes_of(path)
        facts = json_of(data)
        pi, robot = np.array(facts["pi"], dtype=float), facts.get("robot", lib.name)
        if pi.shape != lib.pi0.shape or not np.isfinite(pi).all() or robot != lib.name:
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise RecordingError(
            f"expected a JSON with {lib.pi0.size} numbers 'pi' of '{lib.name}', as simulate writes "
            f"it, got '{path}'; correct it, name another with the setting truth, or move it away"
        ) from None
    return TrueParameters(lib.base_matrix @ pi, path.name, hashlib.sha256(data).hexdigest())


@dataclass(frozen=True, slots=True)
class Comparison(Shown):
    """Results of several methods on the same data."""

    assembly: Assembly  # problem and recordings of all rows
    rows: tuple[MethodRow, ...]  # one per method, in the requested order
    before: float  # torque error of the URDF without friction on the test part, %
    optimum: float  # L*; NaN where the convex problem was not solved
    truth: TrueParameters | None  # parameters of a simulated log; None for a real one

    def tables(self) -> tuple[Table, ...]:
        """One line per method."""
        title = f"{self.assembly.problem.lib.name}: every method on the same data"
        return (method_table([row_facts(row) for row in self.rows], title),)


@one_blas_thread
def compare(
    assembly: Assembly,
    methods: Sequence[str],
    *,
    truth: TrueParameters | None = None,
    started: Callable[[str], None] | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Comparison:
    """Run several methods on one problem, a row each; a failure of one method is a row."""
    for method in methods:
        require_method(method)
    problem = assembly.problem
    guess = problem.lib.pi_from_lam(problem.start)
    try:
        optimum = convex_optimum(problem.lib, problem.statistics(), guess).loss
    except IdentificationError:  # the row of pc-ols states the reason
        optimum = np.nan
    rows: list[MethodRow] = []
    try:
        for method in methods:
            if started is not None:
                started(method)
            # A new problem for each: its time must not profit from statistics of the one before.
            separate = replace(assembly, problem=replace(problem, progress=progress))
            rows.append(_row(separate, method, optimum, truth))
            if rows[-1].status == Status.INTERRUPTED.value:
                break
    except KeyboardInterrupt:
        pass
    rows += [MethodRow(method, NOT_RUN, UNTOUCHED) for method in methods[len(rows) :]]
    start = partial(Samples.rigid, lib=problem.lib, pi=problem.lib.pi0)
    before, *_ = _misfit(_part(assembly, "test"), start)
    return Comparison(assembly, tuple(rows), before.overall, optimum, truth)


def _row(
    assembly: Assembly, method: str, optimum: float, truth: TrueParameters | None
) -> MethodRow:
    try:
        result = identify_assembled(assembly, method, certify=False)
        figures = _figures(assembly, result, optimum, truth)
    except NeedsError as error:
        return MethodRow(method, NOT_RUN, str(error))
    except RuntimeFault as error:
        return MethodRow(method, FAILED, str(error))
    except np.linalg.LinAlgError as error:
        return MethodRow(method, FAILED, f"its linear algebra failed on these data ({error})")
    errors = (figures.test_percent, figures.validation_percent, figures.train_percent)
    if not np.isfinite([*errors, *figures.rms]).all():
        return MethodRow(
            method, FAILED, "its result predicts torques that are not finite; do not use it"
        )
    return MethodRow(method, RAN, result.status, figures)


def _figures(
    assembly: Assembly, result: Identification, optimum: float, truth: TrueParameters | None
) -> Figures:
    problem, lib = assembly.problem, result.lib
    predict = result.predict_samples
    shown, _, means = _misfit(problem.samples("train"), predict)
    if assembly.shown is not None:
        shown, *_ = _misfit(_part(assembly, "train"), predict)
    held, squares, _ = _misfit(_part(assembly, "validation"), predict)
    unseen, *_ = _misfit(_part(assembly, "test"), predict)
    loss, zero_loss = map(float, means @ problem.weights / 2)
    posterior = uncertainty_of(
        lib,
        problem.train,
        result.pi,
        result.phi,
        first_guess=lib.pi_from_lam(problem.start),
        compressed=problem.statistics,
        tests=assembly.shown is None,  # which are those of joints
    )
    smallest = result.relative_eigenvalues
    wrong = None
    if truth is not None:
        wrong = 100 * float(np.linalg.norm(result.beta - truth.beta) / np.linalg.norm(truth.beta))
    return Figures(
        train_percent=shown.overall,
        validation_percent=held.overall,
        test_percent=unseen.overall,
        rms=unseen.rms,
        squares=squares,
        base_error_percent=wrong,
        seconds=result.seconds,
        iterations=result.iterations,
        smallest_relative_eigenvalue=float(smallest.min()),
        consistent=result.is_consistent,
        boundary=result.is_consistent and bool(np.abs(smallest).min() < BOUNDARY),
        gap_to_convex_optimum=(loss - optimum) / max(optimum, TINY * zero_loss),
        excited=posterior.rank,
        determined=posterior.determined,
        contradictions=posterior.contradictions,
        model_errors=posterior.model_errors,
    )


def _misfit(
    parts: Iterable[Samples], predict: Callable[[Samples], Array]
) -> tuple[metrics.TorqueError, Array, Array]:
    """Torque error, Σ_j (τ_j − τ̂_j)² of every sample (N,), and mean squares of τ − τ̂ and τ, (2, n).

    The rows come one piece at a time.
    """
    sums, squares = np.zeros((2, 1)), []
    for samples in parts:
        rest = (samples.tau - predict(samples)) ** 2
        sums = sums + np.stack([rest.sum(axis=0), np.sum(samples.tau**2, axis=0)])
        squares.append(rest.sum(axis=1))
    whole, (size, scale) = np.concatenate(squares), np.sqrt(sums)
    return metrics.torque_error_of(size, scale, len(whole)), whole, sums / len(whole)


def _part(assembly: Assembly, name: str) -> Iterable[Samples]:
    if assembly.shown is not None:
        return (assembly.shown.samples[name],)
    return (samples_of(part, assembly.problem.lib) for part in assembly.recordings(name))
