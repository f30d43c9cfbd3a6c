"""Several logs in one fit: one recording of prepared rows, whose offset columns belong to one log.

    τ_s = Y π + F φ + o_s + Y π_s:   π, φ are those of the arm; o_s of log s, π_s its known payload

Torque sensors drift and cables move between logs, hence o_s. The torque of a known payload is
subtracted from the measured one after the motion has passed the filter. Two logs are separated by a
hole in time, so that no derivative or filter crosses it.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.methods import chosen_method, methods_from_statistics, require_method
from runtime.estimators.problem import FrictionPrior
from runtime.estimators.regression.samples import samples_of
from runtime.identification.identified import Identification
from runtime.identification.payload.known import read_payload_facts
from runtime.identification.problem_setup import Assembly, FitOfAssembly, Parts, assembled
from runtime.identification.progress import SILENT, Progress
from runtime.identification.settings import Settings, shares_of, terms_of
from runtime.identification.several_logs.agreement import OFFSET, NamedLog, agreement_of, joined
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, link_columns, links, mass
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.consistency import require_plausible
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction import geared
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import prepared_parts

ONE_LOG_ONLY = ("preparation", "validation", "test", "inputs")
"""Fields of `Settings` that belong to one log."""


def read_carried(path: Path, lib: Library) -> Array:
    """Read the parameters that a known payload adds.

    → (10 n,) π of the payload at the place of its link, 0 for the other links.
    """
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
    settings: Settings,
    *,
    progress: Progress = SILENT,
    is_joined: bool = False,
) -> Assembly:
    """Assemble the problem of several logs, each split like a single one."""
    settings.require_default(ONE_LOG_ONLY, "a fit of several logs")
    names = _names(logs, chosen_method(settings.method, settings.preset, settings.prior))
    first = logs[0].recording
    terms = geared(terms_of(first, settings), first, lib)
    shared = tuple(name for name in terms.columns if name != OFFSET)
    shares = shares_of(first, settings)
    cut = [_parts_of(log, lib, terms, shares, is_joined) for log in logs]
    regressor = (cut[0][0].prepared or Preparation()).regressor
    fitted_terms = replace(terms, columns=shared)

    def assembly_of(parts: Parts) -> Assembly:
        width = parts[0].required("columns").shape[2] if parts[0].columns is not None else 0
        prior = _of_shared(settings.friction_prior, len(shared), width)
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

        def fit(log: Recording, certify: bool) -> Identification:
            return fitted(assembly_of((log, log, log)), certify)

        whole = [_prepared(*_bare(log, lib), log, lib, terms) for log in logs]
        rows = tuple(len(each[0]) for each in cut)
        agreement, notes = agreement_of(logs, whole, offsets, rows, fit, lib)
        return replace(result, agreement=agreement, notes=(*notes, *result.notes))

    train, validation, test = (joined([each[k] for each in cut], names, names) for k in range(3))
    assembly = assembly_of((train, validation, test))
    notes = (*assembly.notes, *_unlike([each[0] for each in cut], names))
    return replace(assembly, logs=names, notes=notes, finish=finish)


def _of_shared(prior: FrictionPrior | None, shared: int, width: int) -> FrictionPrior | None:
    """The prior of the columns that the logs share, which are first, and none of their offsets."""
    if prior is None:
        return None
    mean, sigma = np.zeros((len(prior.mean), width)), np.full((len(prior.mean), width), np.inf)
    mean[:, :shared], sigma[:, :shared] = prior.mean[:, :shared], prior.sigma[:, :shared]
    return FrictionPrior(mean, sigma)


def _names(logs: Sequence[NamedLog], method: str) -> tuple[str, ...]:
    """Names of the logs, after the check that there are two or more and the method suits them."""
    names = tuple(log.name for log in logs)
    if len(set(names)) < max(len(names), 2):
        raise IdentificationError(
            f"expected two logs or more with different names, got {', '.join(names)}; rename or "
            "add one"
        )
    if not require_method(method).from_statistics:
        raise IdentificationError(
            f"'{method}' needs the samples of one run and cannot join several logs; use one of "
            f"{', '.join(methods_from_statistics())}"
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


def _parts_of(
    log: NamedLog, lib: Library, terms: Friction, shares: Split, is_joined: bool
) -> Parts:
    """Split a log, prepare its parts and subtract the torque of its known payload."""
    bare, preparation = _bare(log, lib)

    def prepared(part: Recording, steps: Preparation) -> Recording:
        return _prepared(part, steps, log, lib, terms)

    return prepared_parts(bare, shares, preparation, prepared, is_joined)


def _bare(log: NamedLog, lib: Library) -> tuple[Recording, Preparation]:
    """The log as read without friction columns, and its preparation."""
    recording = independent_joints(log.recording, lib)
    require_plausible(recording, lib)
    usual = log.preparation or log.recording.preparation
    if usual.regressor == "energy":
        raise IdentificationError(
            "rows of energy do not determine an offset per joint and log, which a fit of several "
            "logs needs; use --regressor momentum"
        )
    return recording.replace(columns=None, column_names=(), name=log.name), usual


def _prepared(
    bare: Recording, preparation: Preparation, log: NamedLog, lib: Library, terms: Friction
) -> Recording:
    """Prepared rows without the torque of the known payload."""
    data = prepare(bare, preparation, terms, lib=lib)
    if log.carried is None:
        return data
    samples = samples_of(data, lib)
    extra = samples.rigid(lib, log.carried)
    total = mass(links(log.carried)).sum()
    return data.replace(tau=data.required("tau") - extra).noted(
        f"Subtracted the torque of a known payload of {total:.4g} kg from the measured one."
    )
