"""Has a robot changed since its model was made? Tests of single parts, with their number counted.

For a hypothesis with the orthonormal columns Q of C_h over the noise, and residual e,

    z = Qᵀ e,   cov z = S 1 + Qᵀ F L Lᵀ Fᵀ Q,   χ² = zᵀ (cov z)⁻¹ z

S is the density of the noise that the hypothesis leaves at the frequencies of its columns
(`coloured_noise`), errors of the model included; F L is the posterior of the model in the rows of
the log. The part is named by the likelihood with unknown noise per joint,

    N_eff Σ_j log(‖e_j‖² / ‖e_j − C_h x‖²) − k log N_eff + 2 log prior          (Schwarz 1978)

a single inner link only where it explains clearly more than all base parameters do, and a single
part only where it leaves no other significant change. The p-value of that hypothesis is multiplied
by the number of hypotheses (Bonferroni).

A hypothesis, one per part of the robot, is e = τ − τ̂ = C_h x + noise. The columns C_h are those of
the gain of one sensor (τ̂_j), the bias of one sensor (1), friction of one joint or of all (τ_f
without its offset), one link (its ten columns of Y), a body on the last link, all base parameters,
or a delay of the torque (−dτ̂/dt).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.estimators.regression.posterior import APART, posterior_of
from runtime.estimators.regression.samples import NORMAL_95, Samples, samples_of, weights_from
from runtime.identification.identified import torque_of
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.library.manifest import torque_units
from runtime.library.parameters import link_columns
from runtime.monitoring.model import MonitoredModel, model_of
from runtime.recording import Recording
from runtime.recording.preprocessing.segments import rate_of
from runtime.recording.settings import COLUMNS

GROUPS = ("sensor gain", "sensor bias", "friction", "links", "payload", "model", "clock")
"""Parts of a robot that are distinguished."""
RARE = 0.01
"""Probability of a change of a link relative to one of the tip, where tools are changed."""
ALPHA = 0.01
"""Corrected p-value below which a robot counts as changed."""
MARGIN = 0.25
"""Lead of a single inner link over all base parameters, in parts of the difference of their
penalties, below which the whole model is named. Bodies of 0.3 kg on one link of an ideal arm lead
by 0.3 to 0.5, the best link of a virtual FR3 whose links all differ by 4 % by 0.2 and less."""
MOST_ROWS = 4000
"""Rows of a log that are tested, evenly spread."""


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """Linear change of the torque.

    Attributes:
        group: of `GROUPS`.
        where: joint or link; "" for the whole robot.
        columns: C, (N, n, k).
        scale: factor from the first coefficient to the size that is stated.
        unit: of that size.
        prior: relative probability before the data.
    """

    group: str
    where: str
    columns: Array
    scale: float
    unit: str
    prior: float = 1.0


def hypotheses(
    lib: Library, model: MonitoredModel, pi: Array, t: Array, samples: Samples
) -> Iterator[Hypothesis]:
    """Hypotheses on a log, one at a time.

    pi (10 n,), t (N,) [s].
    """
    count, n = samples.tau.shape
    rigid = samples.rigid(lib, pi)
    friction = samples.friction(model.phi) if model.phi.size else np.zeros_like(rigid)
    changing = [not COLUMNS[name].is_constant for name in model.terms.columns]
    dry = samples.friction(model.phi * changing) if model.phi.size else friction
    tau = rigid + friction
    yield Hypothesis("clock", "", -rate_of(t, tau)[:, :, None], 1e3, "ms")
    units = torque_units(lib.manifest)
    for j, name in enumerate(lib.joint_names):
        only = np.zeros((count, n, 1))
        for group, values, scale, unit in (
            ("sensor gain", tau[:, j], 100.0, "%"),
            ("sensor bias", np.ones(count), 1.0, units[j]),
            ("friction", dry[:, j], 100.0, "%"),
        ):
            if np.any(values):
                columns = only.copy()
                columns[:, j, 0] = values
                yield Hypothesis(group, name, columns, scale, unit)
    if dry.any():
        yield Hypothesis("friction", "", dry[:, :, None], 100.0, "%")
    rows = lib.regressor(samples.q, samples.dq, samples.ddq)
    for k, name in enumerate(lib.link_names):
        is_tip = k == len(lib.link_names) - 1
        columns = rows[:, :, link_columns(k)]
        prior = 1.0 if is_tip else RARE
        yield Hypothesis("payload" if is_tip else "links", name, columns, 1.0, "kg", prior)
    yield Hypothesis("model", "", samples.base_rows(lib), 1.0, "")


@dataclass(frozen=True, slots=True)
class Change:
    """Test of one hypothesis.

    Attributes:
        group: part of the robot.
        where: joint or link; "" for the whole robot.
        chi2: test statistic.
        freedom: k, number of determined coefficients.
        p_value: of the hypothesis alone.
        score: criterion by which the part is named.
        size: estimated change, in `unit`; None where there is no single number.
        interval: its 95 % interval.
        unit: of the size.
    """

    group: str
    where: str
    chi2: float
    freedom: int
    p_value: float
    score: float
    size: float | None
    interval: tuple[float, float] | None
    unit: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a robot has changed, by one log.

    Attributes:
        log: name of it.
        changed: corrected p-value below `ALPHA`.
        best: the hypothesis that explains the log best.
        p_value: of it, corrected for the number of hypotheses.
        n_eff: effective number of samples.
        error: torque error of the model on the log, overall in %.
        tests: all hypotheses, the best first.
    """

    log: str
    changed: bool
    best: Change
    p_value: float
    n_eff: float
    error: float
    tests: tuple[Change, ...]

    def sentence(self) -> str:
        """One sentence that names the part and the size."""
        if not self.changed:
            return (
                f"{self.log}: no change; the torque error of {self.error:.2g} % is within what the "
                f"model and {self.n_eff:.0f} independent samples allow (p = {self.p_value:.2g})"
            )
        best = self.best
        place = f" of {best.where}" if best.where else ""
        size = ""
        if best.size is not None and best.interval is not None:
            low, high = best.interval
            size = f" by {best.size:+.3g} {best.unit} (95 %: {low:+.3g} to {high:+.3g})"
        return f"{self.log}: {best.group}{place} changed{size} (p = {self.p_value:.2g})"


def verdict_of(
    lib: Library, saved: SavedResult, root: Array, sigma: Array, recording: Recording
) -> Verdict:
    """Test whether a log is that of the robot of a result.

    root (p, columns) [β; φ], sigma (n,) [N·m, N].
    """
    step = max(1, -(-len(recording) // MOST_ROWS))
    recording = recording.take(slice(None, None, step), "Thinned.") if step > 1 else recording
    samples = samples_of(recording, lib)
    model = model_of(saved, lib)
    tau = torque_of(lib, samples, saved.pi, saved.phi)
    rest = samples.tau - tau
    over = np.sqrt(weights_from(sigma, samples.tau))
    e = rest * over
    known = np.concatenate([samples.base_rows(lib), samples.friction_rows()], axis=2)
    spread = (known * over[:, None]) @ root
    # Noise of what all columns of the model leave, whatever has changed.
    coloured = coloured_noise_of_rows(known * over[:, None], e)
    n_eff = len(e) / max(coloured.inflation, 1.0)
    parts = list(hypotheses(lib, model, saved.pi, recording.t, samples))
    tests = [_tested(each, e, over, spread, n_eff) for each in parts]
    ranked = _ranked(tests, n_eff)
    if ranked[0].group != "model" and ranked[0].p_value * len(tests) < ALPHA:
        (part,) = (each for each in parts if (each.group, each.where) == _part(ranked[0]))
        left = _left(part, e, over)
        others = [_tested(each, left, over, spread, n_eff) for each in parts if each is not part]
        ranked = _whole_if_several(ranked, others)
    # A part that is not the whole change is still evidence of one.
    strongest = max(tests, key=lambda test: test.score)
    p_value = min(1.0, min(ranked[0].p_value, strongest.p_value) * len(tests))
    error = 100 * float(np.linalg.norm(rest)) / max(float(np.linalg.norm(samples.tau)), 1e-300)
    return Verdict(
        recording.name or "log",
        p_value < ALPHA,
        ranked[0],
        p_value,
        n_eff,
        error,
        ranked,
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


def _whole_if_several(ranked: tuple[Change, ...], others: list[Change]) -> tuple[Change, ...]:
    """The whole model first where a part leaves another change: it is not all of it then."""
    count = len(others)
    if not any(each.score > 0 and each.p_value * count < ALPHA for each in others):
        return ranked
    whole = next(test for test in ranked if test.group == "model")
    return (whole, *(test for test in ranked if test is not whole))


def _part(change: Change) -> tuple[str, str]:
    return change.group, change.where


def _left(hypothesis: Hypothesis, e: Array, over: Array) -> Array:
    """Residual e − C_h x of least squares, (N, n), over the noise."""
    columns = hypothesis.columns * over[:, None]
    x = posterior_of(columns.reshape(e.size, -1), e.ravel(), rank=APART).mean
    return np.asarray(e - columns @ x)


def _tested(hypothesis: Hypothesis, e: Array, over: Array, spread: Array, n_eff: float) -> Change:
    """χ² of a hypothesis, with residuals e and posterior rows over the noise."""
    columns = hypothesis.columns * over[:, None]
    coloured = coloured_noise_of_rows(columns, e)
    flat = columns.reshape(e.size, -1)
    root = posterior_of(flat, rank=APART).root
    q = flat @ root
    z = q.T @ e.ravel()
    model = q.T @ spread.reshape(e.size, -1)
    covariance = max(coloured.density, 1e-300) * np.eye(len(z)) + model @ model.T
    chi2 = float(z @ np.linalg.solve(covariance, z))
    # The first coefficient: a mass, a relative change, a bias or a delay.
    first = root[0]
    size = float(first @ z) * hypothesis.scale
    half = NORMAL_95 * float(np.sqrt(first @ covariance @ first)) * hypothesis.scale
    k = len(z)
    left = e - (q @ z).reshape(e.shape)
    before, after = (np.sum(values**2, axis=0) + 1e-300 for values in (e, left))
    gained = n_eff * float(np.sum(np.log(before / after)))
    return Change(
        hypothesis.group,
        hypothesis.where,
        chi2,
        k,
        float(chdtrc(k, chi2)),
        gained - k * math.log(max(n_eff, math.e)) + 2 * float(np.log(hypothesis.prior)),
        size if hypothesis.unit else None,
        (size - half, size + half) if hypothesis.unit else None,
        hypothesis.unit,
    )
