"""One fit to several logs, and the comparison of the logs by further fits.

Leave one out: the result of all other logs predicts the one that is left out. Repeatability: every
log is also fitted alone, and the standard deviation of the base parameters over the logs is divided
by the one that their covariances predict. A ratio above one means that the logs differ by more than
noise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.methods import (
    DEFAULT,
    METHODS,
    chosen_method,
    methods_from_statistics,
    require_method,
)
from runtime.estimators.regression.samples import residuals, samples_of
from runtime.identification.identified import Identification
from runtime.identification.metrics import TorqueError, torque_error
from runtime.identification.problem_setup import assemble, settings_for
from runtime.identification.settings import Settings, settings_from, shares_of
from runtime.identification.several_logs.joint_fit import (
    OFFSET,
    NamedLog,
    joined,
    parts_of,
    prepared_of,
    shared_terms,
)
from runtime.identification.single_log import identify_assembled
from runtime.library import Array, Library
from runtime.library.parameters import links, mass
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction import default_terms, geared

AGREEING = 2.0
"""Ratio of spread to expected spread below which logs agree; with three logs the ratio itself
scatters by a third."""
ONE_LOG_ONLY = (
    *("preparation", "validation", "test", "lam0", "inputs", "certify", "friction_prior"),
)
"""Fields of `Settings` that belong to one log, or that the comparison of the logs needs."""


@dataclass(frozen=True, slots=True)
class LeftOutLog:
    """Torque errors on one log of the result of all others.

    Attributes:
        name: name of the log.
        before: torque error of the URDF.
        after: torque error of the result of the others, with their mean offset.
        with_offset: the same with the offset of this log, which is the mean of its residual.
        alone: overall error of the fit to this log alone on the same rows, %.
    """

    name: str
    before: TorqueError
    after: TorqueError
    with_offset: TorqueError
    alone: float


@dataclass(frozen=True, slots=True)
class LogAgreement:
    """Comparison of several logs that were fitted together.

    Attributes:
        names: names of the logs.
        carried: mass of the known payload of every log, kg.
        samples: training rows per log.
        offsets: torque offsets of each log in the joint fit, (logs, n) N·m or N; None without
            offset columns.
        left_out: leave-one-out errors, one per log.
        masses: link masses identified from every log alone, (logs, n) kg.
        spread: standard deviation of each base parameter over the logs, (n_b,).
        expected_spread: the same predicted by the covariances of the single fits, (n_b,).
        delays: name, delay and standard deviation of every log [s]; None where not estimated.
    """

    names: tuple[str, ...]
    carried: tuple[float, ...]
    samples: tuple[int, ...]
    offsets: Array | None
    left_out: tuple[LeftOutLog, ...]
    masses: Array
    spread: Array
    expected_spread: Array
    delays: tuple[dict[str, Any], ...] | None = None

    @property
    def ratio(self) -> float:
        """Root mean square of spread over expected spread."""
        known = self.expected_spread > 0
        return float(np.sqrt(np.mean((self.spread[known] / self.expected_spread[known]) ** 2)))

    def sentence(self) -> str:
        """One sentence on whether the logs agree within their noise."""
        verdict = (
            "the logs agree within their noise"
            if self.ratio < AGREEING
            else "the logs differ by more than noise: temperature, cables, a payload or a clock "
            "changed between them"
        )
        return (
            f"the base parameters of single logs spread {self.ratio:.2g} times as much as their "
            "covariances predict, link masses up to "
            f"{float(np.std(self.masses, axis=0, ddof=1).max()):.2g} kg; {verdict}"
        )

    def facts(self) -> dict[str, Any]:
        """JSON-ready; the part `sessions` of result.json."""
        return {
            "names": list(self.names),
            "payload_kg": list(self.carried),
            "train_samples": list(self.samples),
            "offsets": None if self.offsets is None else self.offsets.tolist(),
            "delay_s": None if self.delays is None else list(self.delays),
            "leave_one_out": [
                {
                    "name": log.name,
                    "before_overall": log.before.overall,
                    "after_overall": log.after.overall,
                    "own_offset_overall": log.with_offset.overall,
                    "alone_overall": log.alone,
                    "rms": log.after.rms.tolist(),
                }
                for log in self.left_out
            ],
            "repeatability": {
                "masses": self.masses.tolist(),
                "mass_spread": np.std(self.masses, axis=0, ddof=1).tolist(),
                "beta_spread": self.spread.tolist(),
                "beta_promised": self.expected_spread.tolist(),
                "ratio": self.ratio,
                "sentence": self.sentence(),
            },
        }


@one_blas_thread
def identify_logs(
    logs: Sequence[NamedLog],
    lib: Library,
    settings: Settings | str | None = None,
    *,
    progress: Callable[[int, float], None] | None = None,
    **keywords: Any,
) -> tuple[Identification, LogAgreement]:
    """Identify one set of parameters from several logs, each split like a single one."""
    chosen = settings_for(lib, settings_from(settings, keywords))
    chosen.require_default(ONE_LOG_ONLY, "a fit of several logs")
    chosen = replace(chosen, method=chosen_method(chosen.method, chosen.preset, chosen.prior))
    names = _names(logs, chosen)
    first = logs[0].recording
    terms = chosen.friction_columns or default_terms(first) or Friction(columns=())
    terms = geared(terms, first, lib)
    prepared = [prepared_of(log, lib, terms) for log in logs]
    # The joint fit: all training parts in one recording, likewise validation and test.
    shares = shares_of(first, chosen)
    fit = _Fit(lib, chosen, terms)
    joins = not METHODS[chosen.method or DEFAULT].uses_validation
    cut = [parts_of(log, lib, terms, shares, joins) for log in logs]
    train, validation, test = (joined([each[k] for each in cut], names, names) for k in range(3))
    result = fit.of(train, validation, test, progress=progress, refit=chosen.refit, joins=joins)
    # The joined rows are prepared already; the result states how.
    train, validation, test = (
        part.replace(prepared=prepared[0].prepared)
        for part in (result.train, result.validation, result.test)
    )
    result = replace(
        result,
        train=train,
        validation=validation,
        test=test,
        is_joined=joins,
        notes=(*result.notes, *_unlike(prepared, names)),
    )
    offsets = None
    if OFFSET in terms.columns:
        offsets = result.phi[:, -len(names) :].T
        usual = replace(terms, columns=(*shared_terms(terms), OFFSET))
        result = replace(result, friction=usual, log_names=tuple(names))
    # Repeatability: every log alone, on all of its rows.
    bare = [joined([log], [name], [name]) for log, name in zip(prepared, names, strict=True)]
    singles = [fit.of(one, one, one) for one in bare]
    masses = [mass(links(single.pi)) for single in singles]
    sigma = [single.uncertainty.beta_sigma for single in singles if single.uncertainty is not None]
    agreement = LogAgreement(
        names=tuple(names),
        carried=tuple(_payload_mass(log) for log in logs),
        samples=tuple(len(each[0]) for each in cut),
        offsets=offsets,
        left_out=tuple(_left_out(k, prepared, names, fit, one) for k, one in enumerate(singles)),
        masses=np.array(masses),
        spread=np.std([single.beta for single in singles], axis=0, ddof=1),
        expected_spread=np.sqrt(np.mean(np.square(sigma), axis=0)),
    )
    return result, agreement


def _names(logs: Sequence[NamedLog], settings: Settings) -> list[str]:
    """Names of the logs, after the check that there are two or more and the method suits them."""
    names = [log.name for log in logs]
    if len(set(names)) < max(len(names), 2):
        raise IdentificationError(
            f"expected two logs or more with different names, got {', '.join(names)}; rename or "
            "add one"
        )
    if settings.method is not None and not require_method(settings.method).from_statistics:
        raise IdentificationError(
            f"'{settings.method}' needs the samples of one run and cannot join several logs; use "
            f"one of {', '.join(methods_from_statistics())}"
        )
    return names


def _unlike(prepared: Sequence[Recording], names: Sequence[str]) -> tuple[str, ...]:
    """Sentence on logs that are prepared in another way than the first; each has its delay."""
    steps = [replace(log.prepared or Preparation(), torque_delay_s=None) for log in prepared]
    others = [name for each, name in zip(steps, names, strict=True) if each != steps[0]]
    if not others:
        return ()
    return (
        f"prepared in another way than {names[0]}: {', '.join(others)}; the result states the "
        f"preparation of {names[0]}; give one recipe, or --cutoff and --rate, for all logs",
    )


@dataclass(frozen=True, slots=True)
class _Fit:
    """The same fit for any choice of prepared logs."""

    lib: Library
    settings: Settings
    terms: Friction

    def of(
        self,
        train: Recording,
        validation: Recording,
        test: Recording,
        certify: bool = True,
        progress: Callable[[int, float], None] | None = None,
        refit: bool = False,
        joins: bool = False,
    ) -> Identification:
        """The result on prepared recordings, fitted again to all their rows on request."""
        settings = replace(
            self.settings,
            preparation=Preparation(),
            friction_columns=replace(self.terms, columns=shared_terms(self.terms)),
            validation=validation,
            test=test,
            certify=certify,
            refit=refit,
        )
        assembly = assemble(train, self.lib, settings, progress=progress)
        if refit:  # the parts are those of the same logs
            assembly = replace(assembly, one_run=True, is_joined=joins)
        return replace(identify_assembled(assembly, settings), one_run=False)


def _left_out(
    index: int,
    logs: Sequence[Recording],
    names: Sequence[str],
    fit: _Fit,
    alone: Identification,
) -> LeftOutLog:
    """Errors of the result of all other logs on all rows of one log."""
    name, log, lib = names[index], logs[index], fit.lib
    other_names = [each for each in names if each != name]
    rest = joined([each for each in logs if each is not log], other_names, other_names)
    others = fit.of(rest, rest, rest, certify=False)
    samples = samples_of(joined([log], [name], [name]), lib)
    phi = others.phi
    if OFFSET in log.column_names:
        phi = replace(others, log_names=tuple(other_names)).usual_phi
    tau = samples.tau
    before = tau + residuals(lib, samples, lib.pi0, np.zeros(0))
    after = tau + residuals(lib, samples, others.pi, phi)
    shifted = after - np.mean(after - tau, axis=0)  # the offset of this log is its mean residual
    single = tau + residuals(lib, samples, alone.pi, alone.phi)
    errors = [torque_error(tau, each) for each in (before, after, shifted, single)]
    return LeftOutLog(name, errors[0], errors[1], errors[2], errors[3].overall)


def _payload_mass(log: NamedLog) -> float:
    """Mass of the known payload of a log, kg."""
    if log.carried is None:
        return 0.0
    return float(mass(links(log.carried)).sum())
