"""Several logs in one fit: one recording of prepared rows, whose offset columns belong to one log.

    τ_s = Y π + F φ + o_s + Y π_s:   π, φ are those of the arm; o_s of log s, π_s its known payload

Torque sensors drift and cables move between logs, hence o_s. The torque of a known payload is
subtracted from the measured one after the motion has passed the filter. Two logs are separated by a
hole in time, so that no derivative or filter crosses it.

The result of all other logs predicts the one that is left out. Every log is also fitted alone: the
standard deviation of the base parameters over the logs, divided by the one that their covariances
predict, is above one where the logs differ by more than noise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.methods import methods_from_statistics
from runtime.estimators.problem import FrictionPrior
from runtime.estimators.regression.samples import residuals, samples_of
from runtime.identification import settings as fit_settings
from runtime.identification.identified import Identification
from runtime.identification.metrics import torque_error
from runtime.identification.payload.body import read_payload_facts
from runtime.identification.problem_setup import Assembly, FitOfAssembly, Parts, assembled
from runtime.identification.result_record import LeftOutPart, RepeatabilityPart, SessionsPart, plain
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, link_columns, links, mass
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.consistency import require_plausible
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction.columns import OFFSET as OFFSET_COLUMN
from runtime.recording.friction.coupled_motors import geared
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import prepared_parts
from runtime.recording.preprocessing.segments import on_one_clock
from runtime.recording.recording import SIGNALS
from runtime.recording.row_marks import same_rows

OFFSET = OFFSET_COLUMN.name
AGREEING = 2.0
"""Ratio of spread to expected spread below which logs agree; with three logs the ratio itself
scatters by a third."""
Fitted = TypeVar("Fitted")


@dataclass(frozen=True, slots=True, eq=False)
class NamedLog:
    """One log as read."""

    name: str  # name in a report; unique among the logs
    recording: Recording  # as read
    preparation: Preparation | None = None  # steps of its preparation; None is that of its recipe
    carried: Array | None = None  # π of a known payload, added to the links', (10 n,)


def distinct(logs: Sequence[Any]) -> list[Any]:
    """The logs with names that differ."""
    named: list[Any] = []
    for log in logs:
        name = log.name
        while name in {other.name for other in named}:
            name += "'"
        named.append(replace(log, name=name))
    return named


def agreement_of(
    lib: Library,
    logs: Sequence[tuple[str, Recording]],
    fit_of: Callable[[Sequence[int]], Fitted],
    about: Callable[[Fitted], tuple[Array, Array | None]],
    predicted: Callable[[Fitted | None, int], Array],
    measured: Sequence[Array],
    **facts: Any,
) -> tuple[SessionsPart, tuple[str, ...]]:
    """Comparison of logs as read by fits to some of them, with further facts; and notes on it.

    A fit is to logs of some numbers, `about` it are π and a root of its covariance, `predicted` the
    torques of a log of a number by a fit, or by the URDF.
    """
    names = tuple(name for name, _ in logs)
    singles = [fit_of([k]) for k in range(len(logs))]

    def left_out(k: int) -> LeftOutPart:
        """Errors of the result of all other logs on all rows of one log."""
        tau, rest = measured[k], fit_of([j for j in range(len(logs)) if j != k])
        before, after, alone = (predicted(each, k) for each in (None, rest, singles[k]))
        shifted = after - np.mean(after - tau, axis=0)  # its offset is its mean residual
        errors = [torque_error(tau, each) for each in (before, after, shifted, alone)]
        urdf, others, offset, single = (each.overall for each in errors)
        return LeftOutPart(names[k], urdf, others, offset, single, plain(errors[1].rms))

    estimates = [about(single) for single in singles]
    masses = np.array([mass(links(pi)) for pi, _ in estimates])
    roots = [lib.base_matrix @ root for _, root in estimates if root is not None]
    sigma = [np.linalg.norm(root, axis=1) for root in roots]
    spread = np.std([lib.base_matrix @ pi for pi, _ in estimates], axis=0, ddof=1)
    expected = np.sqrt(np.mean(np.square(sigma), axis=0))
    known = expected > 0
    ratio = float(np.sqrt(np.mean((spread[known] / expected[known]) ** 2)))
    mass_spread = np.std(masses, axis=0, ddof=1)
    verdict = (
        "the logs agree within their noise"
        if ratio < AGREEING
        else "the logs differ by more than noise: temperature, cables, a payload or a clock "
        "changed between them"
    )
    pairs = same_rows(logs)
    shared = ", ".join(
        f"{a} and {b} share {100 * share:.0f} % of their rows" for a, b, share in pairs
    )
    part = SessionsPart(
        names=names,
        delay_s=None,
        leave_one_out=tuple(map(left_out, range(len(logs)))),
        repeatability=RepeatabilityPart(
            masses=plain(masses),
            mass_spread=plain(mass_spread),
            beta_spread=plain(spread),
            beta_sigma_expected=plain(expected),
            ratio=ratio,
            sentence=f"{shared}: logs with common rows do not show whether results repeat"
            if shared
            else f"the base parameters of single logs spread {ratio:.2g} times as much as their "
            f"covariances predict, link masses up to {mass_spread.max():.2g} kg; {verdict}",
        ),
        **facts,
    )
    return part, (f"{shared}; give each log once",) if shared else ()


def joined(parts: Sequence[Recording], names: Sequence[str], all_names: Sequence[str]) -> Recording:
    """Join prepared logs, with an offset column for each of `all_names`."""
    first = parts[0]
    if any((part.rows is None) != (first.rows is None) for part in parts):
        raise IdentificationError(
            "some of the logs are prepared with accelerations and some without; give all of them "
            "one regressor"
        )
    shared = [k for k, name in enumerate(first.column_names) if name != OFFSET]
    has_offsets = len(shared) < len(first.column_names)
    columns = []
    for part, name in zip(parts, names, strict=True):
        if part.columns is not None:
            offsets = np.zeros((*part.q.shape, len(all_names) if has_offsets else 0))
            if has_offsets:
                place = first.column_names.index(OFFSET)
                offsets[..., all_names.index(name)] = part.columns[..., place]
            columns.append(np.concatenate([part.columns[..., shared], offsets], axis=2))
    signals = {
        key: np.concatenate([getattr(part, key) for part in parts])
        for key in (*SIGNALS, "rows")
        if getattr(first, key) is not None
    }
    titles = [first.column_names[k] for k in shared]
    titles += [f"{OFFSET} {name}" for name in all_names] if has_offsets else []
    history = tuple(
        f"{name}: {sentence}"
        for part, name in zip(parts, names, strict=True)
        for sentence in part.history
    )
    return first.replace(
        t=on_one_clock([part.t for part in parts]),
        **signals,
        columns=np.concatenate(columns) if columns else None,
        column_names=tuple(titles) if columns else (),
        name=" + ".join(names),
        source={f: digest for part in parts for f, digest in part.source.items()},
        history=history,
    )


ONE_LOG_ONLY = ("preparation", "validation", "test", "inputs")  # `Settings` of one log


def read_carried(path: Path, lib: Library) -> Array:
    """π (10 n,) that a known payload adds: that of its link, 0 for the other links."""
    try:
        facts = read_payload_facts(path)
        link, values = str(facts["link"]), np.array(facts["pi_in_link"], dtype=float)
        if values.shape != (N_PARAMETERS,) or not np.isfinite(values).all():
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError):
        raise RecordingError(
            f"'{path}' holds no payload; give the payload.json that the command payload writes"
        ) from None
    if link not in lib.link_names:
        raise RecordingError(
            f"the payload '{path}' is mounted on {link}, but '{lib.name}' has the links "
            f"{', '.join(lib.link_names)}; choose the robot that it was identified on"
        )
    carried = np.zeros_like(lib.pi0)
    carried[link_columns(lib.link_names.index(link))] = values
    return carried


def assemble_logs(
    logs: Sequence[NamedLog],
    lib: Library,
    settings: fit_settings.Settings,
    *,
    progress: fit_settings.Progress = fit_settings.SILENT,
    is_joined: bool = False,
) -> Assembly:
    """Assemble the problem of several logs, each split like a single one."""
    fit_settings.require_default(settings, ONE_LOG_ONLY, "a fit of several logs")
    names = tuple(log.name for log in logs)
    if len(set(names)) < max(len(names), 2):
        raise IdentificationError(
            f"expected two logs or more with different names, got {', '.join(names)}; rename or "
            "add one"
        )
    if not settings.estimator.from_statistics:
        method = settings.estimator.name
        raise IdentificationError(
            f"'{method}' needs the samples of one run and cannot join several logs; use one of "
            f"{', '.join(methods_from_statistics())}"
        )
    first = logs[0].recording
    terms = geared(fit_settings.terms_of(first, settings), first, lib)
    shared = tuple(name for name in terms.columns if name != OFFSET)
    shares = fit_settings.shares_of(first, settings)
    cut: list[Parts] = []
    for log in logs:
        bare, steps = _bare(log, lib)
        each = partial(_prepared, log=log, lib=lib, terms=terms)
        cut.append(prepared_parts(bare, shares, steps, each, is_joined))
    regressor = (cut[0][0].prepared or Preparation()).regressor
    fitted_terms = replace(terms, columns=shared)

    def assembly_of(parts: Parts) -> Assembly:
        width = parts[0].required("columns").shape[2] if parts[0].columns is not None else 0
        prior, count = settings.friction_prior, len(shared)
        if isinstance(prior, FrictionPrior):  # of the shared columns, which are first
            of_shared = (each[:, :count] for each in (prior.mean, prior.sigma))
            prior = FrictionPrior.of_some((lib.n_joints, width), np.s_[:, :count], *of_shared)
        return assembled(
            *(parts, lib, replace(settings, friction_prior=prior), fitted_terms, regressor),
            progress=progress,
            is_joined=is_joined,
        )

    def finish(result: Identification, fitted: FitOfAssembly) -> Identification:
        offsets = None
        if OFFSET in terms.columns:
            offsets = result.phi[:, -len(names) :].T
            usual = replace(terms, columns=(*shared, OFFSET))
            result = replace(result, friction=usual, log_names=names)
        if not settings.certify:
            return result

        whole = [_prepared(*_bare(log, lib), log=log, lib=lib, terms=terms) for log in logs]
        bare = [joined([log], [name], [name]) for log, name in zip(whole, names, strict=True)]
        samples = [samples_of(log, lib) for log in bare]

        def fit_of(numbers: Sequence[int]) -> Identification:
            some = tuple(names[k] for k in numbers)
            log = joined([whole[k] for k in numbers], some, some)
            fit = fitted(assembly_of((log, log, log)), len(numbers) == 1)
            return replace(fit, log_names=some if offsets is not None else ())

        def predicted(fit: Identification | None, k: int) -> Array:
            pi, phi = (lib.pi0, np.zeros(0)) if fit is None else (fit.pi, fit.usual_phi)
            return samples[k].tau + residuals(lib, samples[k], pi, phi)

        agreement, notes = agreement_of(
            lib,
            [(log.name, log.recording) for log in logs],
            fit_of,
            # The sensors are the same in all logs.
            lambda fit: (fit.pi, fit.uncertainty.readings_root if fit.uncertainty else None),
            predicted,
            [each.tau for each in samples],
            payload_kg=tuple(
                0.0 if log.carried is None else float(mass(links(log.carried)).sum())
                for log in logs
            ),
            train_samples=tuple(len(each[0]) for each in cut),
            offsets=plain(offsets),
        )
        return replace(result, agreement=agreement, notes=(*notes, *result.notes))

    train, validation, test = (joined([each[k] for each in cut], names, names) for k in range(3))
    assembly = assembly_of((train, validation, test))
    notes = assembly.notes
    # Each log has its delay.
    ways = [replace(each[0].prepared or Preparation(), torque_delay_s=None) for each in cut]
    if others := [name for each, name in zip(ways, names, strict=True) if each != ways[0]]:
        notes += (
            f"prepared in another way than {names[0]}: {', '.join(others)}; the result states the "
            f"preparation of {names[0]}; give one recipe, or --cutoff and the setting rate, for "
            "all logs",
        )
    return replace(assembly, logs=names, notes=notes, finish=finish)


def _bare(log: NamedLog, lib: Library) -> tuple[Recording, Preparation]:
    """The log as read without friction columns, and its preparation."""
    recording = independent_joints(log.recording, lib)
    require_plausible(recording, lib)
    usual = log.preparation or log.recording.preparation
    if usual.regressor == "energy":
        raise IdentificationError(
            "rows of energy do not determine an offset per joint and log, which a fit of several "
            "logs needs; use --settings regressor=momentum"
        )
    return recording.replace(columns=None, column_names=(), name=log.name), usual


def _prepared(
    bare: Recording, preparation: Preparation, *, log: NamedLog, lib: Library, terms: Friction
) -> Recording:
    data = prepare(bare, preparation, terms, lib=lib)
    if log.carried is None:
        return data
    extra = samples_of(data, lib).rigid(lib, log.carried)
    total = mass(links(log.carried)).sum()
    return data.replace(tau=data.required("tau") - extra).noted(
        f"Subtracted the torque of a known payload of {total:.4g} kg from the measured one."
    )
