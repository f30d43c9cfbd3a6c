"""Prepared logs → one recording whose offset columns belong to one log each.

    τ_s = Y π + F φ + o_s + Y π_s:   π, φ are those of the arm; o_s of log s, π_s its known payload

Torque sensors drift from day to day and cables are moved, hence o_s. The torque of a known payload
is taken off the measured one after the motion has passed the filter. Between two logs there is a
hole in time, so that nothing is differentiated or filtered across them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.regression.samples import samples_of
from runtime.files import json_of
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, link_columns, links, mass
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction import OFFSET as OFFSET_COLUMN
from runtime.recording.plausibility import require_plausible
from runtime.recording.preprocessing import prepare
from runtime.recording.recording import SIGNALS

OFFSET = OFFSET_COLUMN.name
PAUSE = 10.0
"""Seconds between two logs on the common clock; longer than any gap that is interpolated."""


@dataclass(frozen=True, slots=True, eq=False)
class NamedLog:
    """One log as read.

    Attributes:
        name: what a report calls it; no two sessions share one.
        recording: as read.
        preparation: how it is prepared; None for that of its recipe.
        carried: π of a known payload, added to that of the links, (10 n,); None for none.
    """

    name: str
    recording: Recording
    preparation: Preparation | None = None
    carried: Array | None = None


def read_carried(path: Path, lib: Library) -> Array:
    """π (10 n,) that a payload adds, from the payload.json of `python -m runtime payload`.

    Raises:
        RecordingError: no such file, or of a link that the robot does not have.
    """
    try:
        facts = json_of(path)
        link, values = str(facts["link"]), np.array(facts["pi_in_link"], dtype=float)
        if values.shape != (N_PARAMETERS,) or not np.isfinite(values).all():
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError):
        raise RecordingError(
            f"'{path}' holds no payload; give the payload.json that the command payload writes"
        ) from None
    if link not in lib.link_names:
        raise RecordingError(
            f"the payload '{path}' hangs on {link}, but '{lib.name}' has the links "
            f"{', '.join(lib.link_names)}; choose the robot that it was found on"
        )
    carried = np.zeros_like(lib.pi0)
    carried[link_columns(lib.link_names.index(link))] = values
    return carried


def prepared_of(log: NamedLog, lib: Library, terms: Friction) -> Recording:
    """The prepared log without the torque of its payload.

    Raises:
        RuntimeFault: the log is not of this robot, or a step cannot be taken.
    """
    require_plausible(log.recording, lib)
    bare = log.recording.replace(columns=None, column_names=(), name=log.name)
    usual = log.preparation or bare.preparation
    if usual.regressor == "energy":
        raise IdentificationError(
            "several logs have an offset per joint each, which rows of energy cannot tell; use "
            "--regressor momentum"
        )
    data = prepare(bare, usual, terms, lib=lib)
    if log.carried is None:
        return data
    samples = samples_of(data, lib)
    extra = samples.rigid(lib, log.carried)
    total = mass(links(log.carried)).sum()
    return data.replace(tau=samples.tau - extra).noted(
        f"Took the torque of a known payload of {total:.4g} kg off the measured one."
    )


def shared_terms(terms: Friction) -> tuple[str, ...]:
    """Columns whose coefficients all logs share."""
    return tuple(name for name in terms.columns if name != OFFSET)


def joined(parts: Sequence[Recording], names: Sequence[str], all_names: Sequence[str]) -> Recording:
    """The parts one after the other, with an offset column for each of `all_names`.

    Args:
        parts: prepared alike; with a column `offset`, or none.
        names: of their logs.
        all_names: of all logs; those that have no part here have a silent column.

    Raises:
        IdentificationError: some of the parts have rows without accelerations and some have not.
    """
    first = parts[0]
    if any((part.rows is None) != (first.rows is None) for part in parts):
        raise IdentificationError(
            "some of the logs are prepared with accelerations and some without; give all of them "
            "one regressor"
        )
    shared = [k for k, name in enumerate(first.column_names) if name != OFFSET]
    own = len(shared) < len(first.column_names)
    columns, t, start = [], [], 0.0
    for part, name in zip(parts, names, strict=True):
        t.append(part.t - part.t[0] + start)
        start = float(t[-1][-1]) + PAUSE
        if part.columns is not None:
            offsets = np.zeros((*part.q.shape, len(all_names) if own else 0))
            if own:
                place = first.column_names.index(OFFSET)
                offsets[..., all_names.index(name)] = part.columns[..., place]
            columns.append(np.concatenate([part.columns[..., shared], offsets], axis=2))
    signals = {
        key: np.concatenate([getattr(part, key) for part in parts])
        for key in (*SIGNALS, "rows")
        if getattr(first, key) is not None
    }
    titles = [first.column_names[k] for k in shared]
    titles += [f"{OFFSET} {name}" for name in all_names] if own else []
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
