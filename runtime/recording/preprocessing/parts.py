"""Training, validation and test part of a log, each prepared on its own.

The parts are cut from the rows as read. Clock, delay, filter and derivatives then work within one
part, so that no sample of one part has an effect on another. Filters have samples on one side only
at a cut, where the robot moves: rows close to it, the guard gap, are dropped.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from runtime.library import Array
from runtime.recording import Preparation, Recording, Split
from runtime.recording.recipes.recipe import COMMANDED

GUARD = 1.0  # guard gap times a Butterworth cut-off: 2.4 time constants of its slowest pole
LARGEST_SHARE = 0.25  # largest share of a part that is trimmed at either end
MOST_TRIMMED = 0.05  # largest share of a log that is left out at either end of a commanded torque

ROUNDING = 1e-9  # share of a part within which an instant is at its edge


def split(
    recording: Recording, parts: Split, is_joined: bool = False
) -> tuple[Recording, Recording, Recording]:
    """Train, validation and test parts by fractions of the duration; [from, to), the last one
    closed.

    `prepared_parts` splits first and prepares each part afterwards: then the fractions are those of
    the log, and no filter carries samples of one part into another.
    """

    def part(name: str) -> Recording:
        joins = is_joined and name == "train"
        first, last = parts.joined() if joins else getattr(parts, name)
        rows = rows_between(recording.t, first, last)
        label = f"{recording.name}/{name}" if recording.name else name
        sentence = (
            f"Took the {name} part, {first:g} to {last:g} of the duration "
            f"({rows.stop - rows.start} rows)."
        )
        return recording.take(rows, sentence).replace(name=label)

    return part("train"), part("validation"), part("test")


def rows_between(t: Array, first: float, last: float) -> slice:
    """Rows of the part [first, last) of the duration; with last = 1 the last row belongs to it."""
    share = (t - t[0]) / (float(t[-1] - t[0]) or 1.0)
    start, stop = (int(np.searchsorted(share, edge)) for edge in (first, last))
    return slice(start, len(t) if last == 1.0 else stop)


def before_test(recording: Recording, parts: Split | None = None) -> Recording:
    """Training and validation rows, before any filter mixes samples of the test part into them."""
    recipe = recording.recipe
    shares = parts or (recipe.split if recipe else None) or Split()
    last = shares.validation[1]
    if last == 1.0:
        return recording
    rows = rows_between(recording.t, 0.0, last)
    return recording.take(rows, f"Took the rows before the test part ({rows.stop} rows).")


def without_ends(recording: Recording, preparation: Preparation) -> Preparation:
    """The preparation without both ends of a commanded torque.

    There the low-pass extrapolates, and a robot that starts from rest holds any torque below its
    dry friction.
    """
    cutoff = preparation.cutoff_hz
    if recording.torque_source != COMMANDED or preparation.trim_s is not None or cutoff is None:
        return preparation
    trim = min(1.0 / cutoff, MOST_TRIMMED * recording.duration)
    return replace(preparation, trim_s=float(f"{trim:.3g}"))


def prepared_parts(
    recording: Recording,
    shares: Split,
    preparation: Preparation,
    prepare_part: Callable[[Recording, Preparation], Recording],
    is_joined: bool = False,
) -> tuple[Recording, Recording, Recording]:
    """Cut a recording into its parts and prepare each of them."""
    if shares.is_everything:
        return split(prepare_part(recording, preparation), shares)
    raw = split(recording, shares, is_joined)
    ends = float(recording.t[0]), float(recording.t[-1])

    def prepared(part: Recording, share: tuple[float, float]) -> Recording:
        short = for_part(preparation, part.duration)
        done = prepare_part(part, short).replace(prepared=preparation)
        low, high = span_of_part(ends, share, short)
        # A repaired clock may run longer than the logged one.
        high = max(high, float(done.t[-1]) - guard_gap(short, part.duration))
        rows = (done.t >= low) | (share[0] == 0.0)
        rows &= (done.t <= high) | (share[1] == 1.0)
        if short.trim_s is not None or rows.all():
            return done
        return done.take(rows, f"Dropped {(~rows).sum()} rows next to another part.")

    training = shares.joined() if is_joined else shares.train
    train, test = prepared(raw[0], training), prepared(raw[2], shares.test)
    if not is_joined:
        return train, prepared(raw[1], shares.validation), test
    span = span_of_part(ends, training, for_part(preparation, raw[0].duration))
    rows = train.t >= validation_start(shares, span)
    validation = train.take(rows, f"Took the validation part of these rows ({rows.sum()} rows).")
    return train, validation.replace(name=raw[1].name), test


def span_of_part(
    ends: tuple[float, float], share: tuple[float, float], preparation: Preparation
) -> tuple[float, float]:
    """First and last instant of the prepared rows of a part."""
    duration = ends[1] - ends[0]
    low, high = (ends[0] + each * duration for each in share)
    edge, gap = preparation.trim_s or 0.0, guard_gap(preparation, high - low)
    return low + edge + gap * (share[0] > 0.0), high - edge - gap * (share[1] < 1.0)


def validation_start(shares: Split, span: tuple[float, float]) -> float:
    """First instant of the validation part within the training part that includes it."""
    first, last = shares.joined()
    share = (shares.validation[0] - first) / (last - first)
    return span[0] + (share - ROUNDING) * (span[1] - span[0])


def for_part(preparation: Preparation, seconds: float) -> Preparation:
    """The preparation of a part, whose trimmed ends leave half of it at least."""
    most = LARGEST_SHARE * seconds
    if preparation.trim_s is None or preparation.trim_s <= most:
        return preparation
    return replace(preparation, trim_s=most)


def guard_gap(preparation: Preparation, seconds: float) -> float:
    """Time next to another part in which rows are dropped."""
    if preparation.filter == "none" or preparation.trim_s is not None:
        return 0.0
    gap = preparation.window_s or 0.0
    if preparation.filter == "butterworth" and preparation.cutoff_hz is not None:
        gap = GUARD / preparation.cutoff_hz
    return min(gap, LARGEST_SHARE * seconds)
