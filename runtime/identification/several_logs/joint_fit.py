"""Joining of prepared logs to one recording whose offset columns belong to one log each.

    τ_s = Y π + F φ + o_s + Y π_s:   π, φ are those of the arm; o_s of log s, π_s its known payload

Torque sensors drift and cables move between logs, hence o_s. The torque of a known payload is
subtracted from the measured one after the motion has passed the filter. Two logs are separated by a
hole in time, so that no derivative or filter crosses it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.regression.samples import samples_of
from runtime.identification.payload.known import read_payload_facts
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, link_columns, links, mass
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.consistency import require_plausible
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction import OFFSET as OFFSET_COLUMN
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import prepared_parts
from runtime.recording.recording import SIGNALS

OFFSET = OFFSET_COLUMN.name
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


def prepared_of(log: NamedLog, lib: Library, terms: Friction) -> Recording:
    """Prepare a log and subtract the torque of its known payload."""
    bare, preparation = _bare(log, lib)
    return _prepared(bare, preparation, log, lib, terms)


def parts_of(
    log: NamedLog, lib: Library, terms: Friction, shares: Split, is_joined: bool
) -> tuple[Recording, Recording, Recording]:
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


def shared_terms(terms: Friction) -> tuple[str, ...]:
    """Names of the columns whose coefficients all logs share."""
    return tuple(name for name in terms.columns if name != OFFSET)


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
