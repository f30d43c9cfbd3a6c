"""Has a robot changed since its model was made? Tests of single parts, with their number counted.

The scores z of a log over all changes (`scores`) have the mean μ and the covariance C on a healthy
robot: noise, misfit, the usual change between days, and the error of the model. A hypothesis is
that some coefficients x moved, those of one part of the robot,

    z − μ = Qᵀ H M x + e,   cov e = C:   x̂ of generalised least squares,   χ² = x̂ᵀ (cov x̂)⁻¹ x̂

M are the gain of one sensor, its bias or drift during the log, those of all, friction of one joint
or of all, its change during the log, ten parameters of one link or of a body on the last one, all
base parameters, or a delay of the torque. They are in units of plausible sizes, so that directions
that a log does not determine have singular values of C^-½ Qᵀ H M below 1, and are left out. The
headline is the hypothesis that explains most,

    χ² − k log N_eff + 2 log prior                                              (Schwarz 1978)

and the whole model where no single part explains half of what all changes do and the model is more
significant than a part that is no inner link, or where a single inner link explains hardly more
than all base parameters. The others are stated by what it leaves.
The p-value of a hypothesis is multiplied by their number (Bonferroni).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import fdtrc, fdtri, stdtrit

from runtime.common.tables import significant
from runtime.errors import IdentificationError
from runtime.estimators.regression.samples import Samples, samples_of, weights_from
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.library.parameters import link_columns
from runtime.monitoring import scores
from runtime.monitoring.free_base import free_changed_rows, free_changes_of
from runtime.monitoring.model import model_of
from runtime.recording import Recording
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.recipes.recipe import COMMANDED

GROUPS = (
    *("sensor gain", "sensor bias", "sensor drift"),
    *("friction", "warming", "links", "payload", "model", "clock"),
)
"""Parts of a robot that are distinguished."""
BODY, LEVER = 0.25, 0.2
"""Plausible change of a body: share of the mass of the robot, and its lever [m]."""
RARE = 0.001
"""Probability of a change of a link relative to one of the tip, where tools are changed."""
ALPHA = 0.01  # corrected p-value below which a robot counts as changed
MARGIN = 0.4
"""Lead of a single inner link over all base parameters, in parts of the difference of their
penalties, below which the whole model is named. A body of 0.3 kg on one link of an ideal arm leads
by 0.8, with a bias of another sensor by 0.3, the best link of a virtual FR3 whose links all differ
by 4 % by 0.2 and less."""
HALF = 0.5  # share of the explained χ² below which a part is not the change
DETERMINED = 0.5  # σ of a size over the plausible size, above which it is not stated
UNKNOWN_DELAY = 0.02
"""Standard deviation of the delay of a result that neither states nor estimates one [s]: real arms
have 0 to 30 ms. Its own held-out rows show how much of it is left."""
OF_COMMANDS = 6.0
"""Default errors of the model of a walk by commanded torques over those of an arm: its σ contain no
misfit of the drives. Three healthy days each of foreign simulated walks teach 1.1, 3, 5 and 8."""
WatchedLog = Recording | FreeBaseRecording  # a log that is prepared, or one of a free base as read
MOST_ROWS = 4000  # rows of a log that are tested, evenly spread


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """Change of one part of the robot."""

    group: str  # of `GROUPS`
    where: str  # joint or link; "" for the whole robot
    moved: Array  # M, columns of all changes over its own coefficients, (K + n_b, k)
    size: Array  # weights of the coefficients in the size that is stated, (k,)
    unit: str  # of that size; "" where there is none
    prior: float = 1.0  # relative probability before the data


def hypotheses(lib: Library, changes: scores.Changes, pi: Array) -> list[Hypothesis]:
    """Hypotheses on a log of a robot of π (10 n,)."""
    named, base = len(changes.names), lib.base_matrix
    sizes = changes.units * [scores.PLAUSIBLE[kind] for kind, _ in changes.names]
    eye = np.eye(named + len(base))[:, :named] * sizes
    parts = []
    for k, (group, where) in enumerate(changes.names):
        if group != "friction":
            unit, scale = changes.shown[k]
            parts.append(Hypothesis(group, where, eye[:, [k]], sizes[[k]] * scale, unit))
    for group in ("sensor bias", "sensor drift"):
        each = changes.of(group)
        if each.size:
            parts.append(Hypothesis(group, "", eye[:, each], np.zeros(len(each)), ""))
    for where in (*lib.joint_names, ""):
        each = changes.of("friction", where or None)
        if each.size:
            moved = eye[:, each].sum(axis=1, keepdims=True)
            parts.append(Hypothesis("friction", where, moved, 100 * sizes[each[:1]], "%"))
    mass = BODY * max(float(pi.reshape(-1, 10)[:, 0].clip(0).sum()), 1e-3)
    body = mass * np.repeat([1.0, LEVER, LEVER**2], [1, 3, 6])
    first, links = body * np.eye(1, 10)[0], []
    inner = {joint.parent for joint in lib.manifest.all_joints}
    for k, name in enumerate(lib.link_names):
        columns = base[:, link_columns(k)]
        # What carries tools: the body of a robot that walks, and links that carry no other one,
        # motors on the frame left out.
        is_tip = (k == 0 and lib.manifest.floating) or (k not in inner and columns[:, :4].any())
        links.append(np.vstack([np.zeros((named, 10)), columns * body]))
        group, prior = ("payload", 1.0) if is_tip else ("links", RARE)
        parts.append(Hypothesis(group, name, links[-1], first, "kg", prior))
    parts.append(Hypothesis("model", "", np.hstack(links), np.zeros(10 * len(links)), ""))
    return parts


@dataclass(frozen=True, slots=True)
class Change:
    """Test of one hypothesis."""

    group: str  # part of the robot
    where: str  # joint or link; "" for the whole robot
    chi2: float  # test statistic
    freedom: int  # k, number of determined coefficients
    p_value: float  # of the hypothesis alone
    score: float  # criterion by which the part is named
    size: float | None  # estimated change, in `unit`; None where there is no single number
    interval: tuple[float, float] | None  # its 95 % interval
    unit: str  # of the size
    least: float | None = None  # smallest change that would count, in `unit`


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a robot has changed, by one log.

    Attributes:
        log: name of the log.
        changed: whether the corrected p-value is below `ALPHA`.
        best: the hypothesis that explains the log best: its group, where, size, interval and unit.
        p_value: its p-value, corrected for the number of hypotheses.
        n_eff: effective number of samples.
        error: torque error of the model on the log, overall in %.
        tests: all hypotheses, each alone, the best first.
        beside: the others, by what the best one leaves where it is the change.
        references: number of logs from which the usual change between days was learnt; without them
            it is assumed.
    """

    log: str
    changed: bool
    best: Change
    p_value: float
    n_eff: float
    error: float
    tests: tuple[Change, ...]
    beside: tuple[Change, ...] = ()
    references: int = 0

    def hidden(self) -> str:
        """One sentence on the changes that are too small to count in this log."""
        sizes: dict[tuple[str, str], list[float]] = {}
        for test in self.tests:
            if test.least is not None and (test.group != "friction" or not test.where):
                sizes.setdefault((test.group, test.unit), []).append(test.least)
        parts = []
        for (group, unit), values in sizes.items():
            low, high = min(values), max(values)
            one = high <= 1.2 * low
            parts.append(f"{group} {f'{high:.2g}' if one else f'{low:.2g} to {high:.2g}'} {unit}")
        learnt = f"learnt from {self.references} logs" if self.references else "assumed"
        advice = "" if self.references else ", logs of healthy days (--reference) determine it"
        return (
            f"{self.log}: hidden are changes below {', '.join(parts)}; the usual change between "
            f"days is {learnt}{advice}"
        )

    def sentence(self) -> str:
        """One sentence that names the part and the size."""
        if not self.changed:
            return (
                f"{self.log}: no change; the torque error of {significant(self.error)} % is within "
                "the noise, the errors of the model and the usual change between days (p = "
                f"{self.p_value:.2g})"
            )
        best = self.best
        place = f" of {best.where}" if best.where else ""
        size = ""
        if best.size is not None and best.interval is not None:
            low, high = best.interval
            size = f" by {best.size:+.3g} {best.unit} (95 %: {low:+.3g} to {high:+.3g})"
            if best.freedom > 1 and low < 0 < high:
                size = f" in its centre of mass or inertia, its mass{size}"
        return f"{self.log}: {best.group}{place} changed{size} (p = {self.p_value:.2g})"


@dataclass(frozen=True, slots=True, eq=False)
class Baseline:
    """What a healthy robot leaves, from the rows of a result and logs of reference."""

    saved: SavedResult  # the result
    root: Array  # of the covariance of [β; φ], (p, columns)
    over: Array  # 1/σ of its held-out residual, (n,) [1/(N·m)]; of a free base the logs' own
    changes: scores.Changes  # that are distinguished
    # of a healthy robot, by the scores of a log that is tested, too
    usual: Callable[..., scores.Usual]


def baseline_of(
    lib: Library,
    saved: SavedResult,
    root: Array,
    sigma: Array,
    test_rows: tuple[Array, Samples] | None = None,
    references: Sequence[Recording] = (),
) -> Baseline:
    """Baseline of a result, with its own held-out rows (t, samples) and logs of reference.

    root (p, columns) [β; φ], sigma (n,) [N·m, N].
    """
    model = model_of(saved, lib)
    torques = [test_rows[1].tau] if test_rows else []
    torques += [samples_of(_thinned(each), lib).tau for each in references]
    tau = np.concatenate(torques) if torques else sigma[None]
    over, changes = np.sqrt(weights_from(sigma, tau)), scores.changes_of(lib, model, tau)
    held_out = []
    if test_rows:
        rows = scores.changed_rows(lib, model, saved.pi, *test_rows, over, changes.ranges)
        held_out = [scores.scores_of_rows(rows, root)] if rows.tells() else []
    return _baseline(lib, saved, root, over, changes, held_out, references)


def free_baseline_of(
    lib: Library,
    saved: SavedResult,
    root: Array,
    log: FreeBaseRecording,
    references: Sequence[FreeBaseRecording] = (),
) -> Baseline:
    """Baseline of a result of a free base for logs as `log`, arguments as of `baseline_of`."""
    changes = free_changes_of(lib, saved, log)
    return _baseline(lib, saved, root, np.ones(0), changes, [], references)


def _baseline(
    lib: Library,
    saved: SavedResult,
    root: Array,
    over: Array,
    changes: scores.Changes,
    held_out: list[scores.Scores],
    references: Sequence[WatchedLog],
) -> Baseline:
    record = saved.record
    of_commands = record.is_free and record.torque_source == COMMANDED
    others = [
        scores.scores_of_rows(_rows(lib, saved, over, changes, each), root) for each in references
    ]
    known = _delay_sigma(saved), OF_COMMANDS if of_commands else 1.0, bool(record.doubts)

    def usual(*later: scores.Scores) -> scores.Usual:
        return scores.usual_of(changes, root.shape[1], held_out, others, *known, later)

    if not others:
        return Baseline(saved, root, over, changes, usual)
    learnt = usual()
    return Baseline(saved, root, over, changes, lambda *_: learnt)


def _delay_sigma(saved: SavedResult) -> float:
    """What a result does not know of the delay of its torque [s]."""
    record = saved.record
    known = record.delays
    if record.sessions is not None:
        known += record.sessions.delay_s or ()
    sigma = [np.max(each.sigma) for each in known if each.sigma]
    if sigma:
        return float(max(sigma))
    return 0.0 if saved.preparation.torque_delay_s is not None else UNKNOWN_DELAY


def _thinned(recording: Recording) -> Recording:
    step = max(1, -(-len(recording) // MOST_ROWS))
    return recording.take(slice(None, None, step), "Thinned.") if step > 1 else recording


def _rows(
    lib: Library, saved: SavedResult, over: Array, changes: scores.Changes, log: WatchedLog
) -> scores.ChangedRows:
    """Equations of a log that is long enough, thinned."""
    if isinstance(log, FreeBaseRecording):
        rows = free_changed_rows(lib, saved, log, changes, MOST_ROWS)
    else:
        log = _thinned(log)
        model, samples = model_of(saved, lib), samples_of(log, lib)
        rows = scores.changed_rows(lib, model, saved.pi, log.t, samples, over, changes.ranges)
    if not rows.tells():
        raise IdentificationError(
            f"'{log.name or 'log'}' holds {np.ptp(log.t):.2g} s of motion, in which changes of "
            "this robot look like noise; give a longer log"
        )
    return rows


def verdict_of(
    lib: Library, baseline: Baseline, recording: WatchedLog, is_known: bool = False
) -> Verdict:
    """Test whether a log is that of the robot of a result; a known one is in the baseline."""
    saved, changes = baseline.saved, baseline.changes
    rows = _rows(lib, saved, baseline.over, changes, recording)
    seen = scores.scores_of_rows(rows, baseline.root)
    usual = baseline.usual(seen)
    mean, covariance = scores.expected(changes, usual, seen)
    freedom = max(usual.freedom + seen.blocks - 1, 1.0)
    lower = np.linalg.cholesky(covariance)
    y, columns = (
        np.asarray(solve_triangular(lower, each, lower=True))
        for each in (seen.z - mean, seen.columns)
    )
    parts = hypotheses(lib, changes, saved.pi)

    def tested(values: Array) -> list[Change]:
        level = ALPHA / len(parts)
        return [_tested(each, values, columns, freedom, seen.n_eff, level) for each in parts]

    tests = tested(y)
    ranked = _ranked(tests, seen.n_eff)
    # A log of the model itself cannot differ from it.
    p_value = 1.0 if is_known else min(1.0, min(test.p_value for test in tests) * len(tests))
    best, beside = ranked[0], ranked[1:]
    if p_value < ALPHA and best.group != "model":
        everything = float(y @ y) - len(y)
        whole = next(test for test in ranked if test.group == "model")
        is_less = whole.p_value < best.p_value or best.group == "links"
        if best.chi2 - best.freedom < HALF * everything and is_less:
            beside = tuple(test for test in ranked if test is not whole)
            ranked = (whole, *beside)
        else:
            (part,) = (each for each in parts if (each.group, each.where) == _part(best))
            axes = _determined(columns @ part.moved)[0]
            others = _ranked(tested(y - axes @ (axes.T @ y)), seen.n_eff)
            beside = tuple(each for each in others if _part(each) != _part(best))
    return Verdict(
        recording.name or "log",
        p_value < ALPHA,
        ranked[0],
        p_value,
        seen.n_eff,
        rows.error,
        ranked,
        beside,
        usual.references,
    )


def _ranked(tests: list[Change], n_eff: float) -> tuple[Change, ...]:
    """Hypotheses by their score, the best first.

    All links of a wrong model differ, and one of them may explain most of it. Where one link is the
    whole change, its score exceeds that of all base parameters by their larger penalty, less what
    so many coefficients gain by chance.
    """
    ranked = sorted(tests, key=lambda test: -test.score)
    best, whole = ranked[0], next(test for test in tests if test.group == "model")
    penalty = (whole.freedom - best.freedom) * math.log(max(n_eff, math.e))
    if best.group == "links" and best.score - whole.score < MARGIN * penalty:
        ranked.remove(whole)
        ranked.insert(0, whole)
    return tuple(ranked)


def _part(change: Change) -> tuple[str, str]:
    return change.group, change.where


def _tested(
    hypothesis: Hypothesis, y: Array, columns: Array, freedom: float, n_eff: float, level: float
) -> Change:
    """χ² of a hypothesis by scores of covariance 1, y (r,) and columns (r, K + n_b).

    level: p-value below which a change counts.
    """
    axes, root, rest = _determined(columns @ hypothesis.moved)
    along, k = axes.T @ y, axes.shape[1]
    chi2, size = float(along @ along), float(hypothesis.size @ root @ along)
    # A direction that is left out may have its plausible size.
    left = float(np.linalg.norm(hypothesis.size @ rest))
    sigma = float(np.hypot(np.linalg.norm(hypothesis.size @ root), left))
    half = float(stdtrit(freedom, 0.975)) * sigma
    # With k coefficients a change counts from the quantile of F(k, ·) on.
    least = sigma * math.sqrt(k * fdtri(k, freedom, 1 - level)) if k else 0.0
    has_size = bool(hypothesis.unit) and sigma < DETERMINED * np.linalg.norm(hypothesis.size)
    return Change(
        hypothesis.group,
        hypothesis.where,
        chi2,
        k,
        float(fdtrc(k, freedom, chi2 / k)) if k else 1.0,
        chi2 - k * math.log(max(n_eff, math.e)) + 2 * math.log(hypothesis.prior),
        size if has_size else None,
        (size - half, size + half) if has_size else None,
        hypothesis.unit,
        least if has_size and least > 0 else None,
    )


def _determined(columns: Array) -> tuple[Array, Array, Array]:
    """Axes (r, k) of the directions that columns (r, m) of covariance 1 determine, their root.

    The root (m, k) gives the coefficients of the axes; the rest (m, m − k) are other directions.
    """
    axes, sizes, turn = np.linalg.svd(columns, full_matrices=columns.shape[0] < columns.shape[1])
    k = int(np.sum(sizes > 1.0))
    return axes[:, :k], turn[:k].T / sizes[:k], turn[k:].T
