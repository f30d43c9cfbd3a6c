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
from runtime.identification.metrics import torque_error
from runtime.identification.problem_setup import assemble, settings_for
from runtime.identification.settings import Settings, bare_settings, shares_of, terms_of
from runtime.identification.several_logs.agreement import LeftOutLog, LogAgreement
from runtime.identification.several_logs.joint_fit import (
    OFFSET,
    NamedLog,
    joined,
    parts_of,
    prepared_of,
    shared_terms,
)
from runtime.identification.single_log import identify_assembled
from runtime.library import Library
from runtime.library.parameters import links, mass
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction import geared

ONE_LOG_ONLY = (
    *("preparation", "validation", "test", "lam0", "inputs", "certify", "friction_prior"),
)
"""Fields of `Settings` that belong to one log, or that the comparison of the logs needs."""


@one_blas_thread
def identify_logs(
    logs: Sequence[NamedLog],
    lib: Library,
    settings: Settings | str | None = None,
    *,
    progress: Callable[[int, float], None] | None = None,
    **keywords: Any,
) -> Identification:
    """Identify one set of parameters from several logs, each split like a single one."""
    chosen = settings_for(lib, bare_settings(settings, keywords))
    chosen.require_default(ONE_LOG_ONLY, "a fit of several logs")
    chosen = replace(chosen, method=chosen_method(chosen.method, chosen.preset, chosen.prior))
    names = _names(logs, chosen)
    first = logs[0].recording
    terms = geared(terms_of(first, chosen), first, lib)
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
    return replace(result, agreement=agreement)


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
            friction=replace(self.terms, columns=shared_terms(self.terms)),
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
