"""Comparison of several logs that were fitted together, by further fits.

Leave one out: the result of all other logs predicts the one that is left out. Repeatability: every
log is also fitted alone, and the standard deviation of the base parameters over the logs is divided
by the one that their covariances predict. A ratio above one means that the logs differ by more than
noise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression.samples import residuals, samples_of
from runtime.identification.identified import Identification
from runtime.identification.metrics import torque_error
from runtime.identification.result_record import LeftOutPart, RepeatabilityPart, SessionsPart
from runtime.library import Array, Library
from runtime.library.parameters import links, mass
from runtime.recording import Preparation, Recording
from runtime.recording.friction import OFFSET as OFFSET_COLUMN
from runtime.recording.recording import SIGNALS
from runtime.recording.row_marks import same_rows

OFFSET = OFFSET_COLUMN.name
AGREEING = 2.0
"""Ratio of spread to expected spread below which logs agree; with three logs the ratio itself
scatters by a third."""
PAUSE = 10.0
"""Time between two logs on the common clock [s]; longer than any gap that is interpolated."""


@dataclass(frozen=True, slots=True, eq=False)
class NamedLog:
    """One log as read.

    Attributes:
        name: name in a report; unique among the logs.
        recording: as read.
        preparation: steps of its preparation; None is that of its recipe.
        carried: π of a known payload, added to that of the links, (10 n,); None for none.
    """

    name: str
    recording: Recording
    preparation: Preparation | None = None
    carried: Array | None = None


def agreement_of(
    logs: Sequence[NamedLog],
    prepared: Sequence[Recording],
    offsets: Array | None,
    samples: tuple[int, ...],
    fit: Callable[[Recording, bool], Identification],
    lib: Library,
) -> tuple[SessionsPart, tuple[str, ...]]:
    """The comparison of logs, whose rows are all prepared, and notes on it.

    fit: of joined rows, with or without certificates.
    """
    names = tuple(log.name for log in logs)
    bare = [joined([log], [name], [name]) for log, name in zip(prepared, names, strict=True)]
    singles = [fit(each, True) for each in bare]
    masses = np.array([mass(links(single.pi)) for single in singles])
    sigma = [single.uncertainty.beta_sigma for single in singles if single.uncertainty is not None]
    spread = np.std([single.beta for single in singles], axis=0, ddof=1)
    expected = np.sqrt(np.mean(np.square(sigma), axis=0))
    known = expected > 0
    ratio = float(np.sqrt(np.mean((spread[known] / expected[known]) ** 2)))
    mass_spread = np.std(masses, axis=0, ddof=1)
    pairs = same_rows([(log.name, log.recording) for log in logs])
    shared = ", ".join(
        f"{a} and {b} share {100 * share:.0f} % of their rows" for a, b, share in pairs
    )
    part = SessionsPart(
        names=names,
        payload_kg=tuple(_payload_mass(log) for log in logs),
        train_samples=samples,
        offsets=None if offsets is None else tuple(map(tuple, offsets.tolist())),
        delay_s=None,
        leave_one_out=tuple(
            _left_out(k, prepared, names, fit, each, lib)
            for k, each in enumerate(zip(bare, singles, strict=True))
        ),
        repeatability=RepeatabilityPart(
            masses=tuple(map(tuple, masses.tolist())),
            mass_spread=tuple(mass_spread.tolist()),
            beta_spread=tuple(spread.tolist()),
            beta_sigma_expected=tuple(expected.tolist()),
            ratio=ratio,
            sentence=f"{shared}: logs with common rows do not show whether results repeat"
            if shared
            else _sentence(ratio, float(mass_spread.max())),
        ),
    )
    return part, (f"{shared}; give each log once",) if shared else ()


def _sentence(ratio: float, mass_spread: float) -> str:
    """Whether the logs agree within their noise."""
    verdict = (
        "the logs agree within their noise"
        if ratio < AGREEING
        else "the logs differ by more than noise: temperature, cables, a payload or a clock "
        "changed between them"
    )
    return (
        f"the base parameters of single logs spread {ratio:.2g} times as much as their covariances "
        f"predict, link masses up to {mass_spread:.2g} kg; {verdict}"
    )


def _left_out(
    index: int,
    logs: Sequence[Recording],
    names: Sequence[str],
    fit: Callable[[Recording, bool], Identification],
    alone: tuple[Recording, Identification],
    lib: Library,
) -> LeftOutPart:
    """Errors of the result of all other logs on all rows of one log."""
    other_names = [each for each in names if each != names[index]]
    rest = [log for k, log in enumerate(logs) if k != index]
    others = fit(joined(rest, other_names, other_names), False)
    samples = samples_of(alone[0], lib)
    phi = others.phi
    if OFFSET in logs[index].column_names:
        phi = replace(others, log_names=tuple(other_names)).usual_phi
    tau = samples.tau
    before = tau + residuals(lib, samples, lib.pi0, np.zeros(0))
    after = tau + residuals(lib, samples, others.pi, phi)
    shifted = after - np.mean(after - tau, axis=0)  # the offset of this log is its mean residual
    single = tau + residuals(lib, samples, alone[1].pi, alone[1].phi)
    errors = [torque_error(tau, each) for each in (before, after, shifted, single)]
    return LeftOutPart(
        name=names[index],
        before_overall=errors[0].overall,
        after_overall=errors[1].overall,
        log_offset_overall=errors[2].overall,
        single_log_overall=errors[3].overall,
        rms=tuple(errors[1].rms.tolist()),
    )


def _payload_mass(log: NamedLog) -> float:
    """Mass of the known payload of a log, kg."""
    if log.carried is None:
        return 0.0
    return float(mass(links(log.carried)).sum())


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
    columns, t, start = [], [], 0.0
    for part, name in zip(parts, names, strict=True):
        t.append(part.t - part.t[0] + start)
        start = float(t[-1][-1]) + PAUSE
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
        t=np.concatenate(t),
        **signals,
        columns=np.concatenate(columns) if columns else None,
        column_names=tuple(titles) if columns else (),
        name=" + ".join(names),
        source={f: digest for part in parts for f, digest in part.source.items()},
        history=history,
    )
