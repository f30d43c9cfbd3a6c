"""From the options on a log to a recording with its preparation, split and friction columns."""

import dataclasses
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from rich.table import Table

from runtime.cli.common import numbers_option
from runtime.cli.log_options import AUTO
from runtime.common.terminal import console
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.choice.cutoff_choice import CutoffChoice, choose_cutoff
from runtime.estimators.choice.default_friction import MEMORY, USABLE, choose_default_friction
from runtime.estimators.choice.friction_choice import FrictionChoice, choose_friction
from runtime.estimators.choice.regressor_choice import choose_regressor
from runtime.estimators.methods import require_method
from runtime.identification.current_gains.scaling import with_current_gains
from runtime.identification.long_logs.blocks import head_of
from runtime.library import Library
from runtime.recording import (
    EVERYTHING,
    Friction,
    Preparation,
    Recording,
    Split,
    StreamedRecording,
    is_large,
    open_streamed,
    read_recording,
)
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction import OFFSET, default_terms
from runtime.recording.preprocessing import before_test
from runtime.recording.static_poses import static_poses

_ANY_HZ = 1.0
"""Placeholder of a cut-off that cross-validation replaces, Hz."""


@dataclass(frozen=True, slots=True, eq=False)
class LogOptions:
    """Values of the options on a log; None where an option is not given.

    The names are also keys of compare.json.

    Attributes:
        recipe: file that describes the log.
        run: name of the run in the recipe.
        friction: column names with commas, "auto" or "none".
        coulomb_speed: width of the smooth Coulomb sign, rad/s.
        cutoff: cut-off of the low-pass in Hz as text, or "auto".
        rate: rate of rows after decimation, Hz.
        split: "A,B", fractions of the duration.
        stream: True reads block by block, False as a whole, None decides by the file's size.
        regressor: form of the equations, or "auto".
    """

    recipe: str | None = None
    run: str | None = None
    friction: str | None = None
    coulomb_speed: float | None = None
    cutoff: str | None = None
    rate: float | None = None
    split: str | None = None
    stream: bool | None = False
    regressor: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PreparedLog:
    """A log that is read, with its preparation, split and friction columns.

    Attributes:
        recording: the log, or its first rows where it is streamed.
        preparation: filter, decimation and form of the equations; None for those of the recipe.
        splitting: training, validation and test parts; None for those of the recipe.
        friction: friction columns; None for those of the recipe.
        notes: sentences about what was chosen automatically.
        streamed: the log in its file; None where it is read as a whole.
        is_at_rest: whether the rows are poses at rest, without motion.
    """

    recording: Recording
    preparation: Preparation | None
    splitting: Split | None
    friction: Friction | None
    notes: tuple[str, ...] = ()
    streamed: StreamedRecording | None = None
    is_at_rest: bool = False


def read_prepared_log(
    lib: Library,
    log: str,
    options: LogOptions,
    usable: Sequence[str] = (),
    robust: bool = False,
    of_type: Friction | None = None,
) -> PreparedLog:
    """Read a log and choose its cut-off, regressor and friction model where options are auto."""
    streamed = _streamed(lib, log, options)
    if streamed is not None:
        recording = head_of(streamed)
    else:
        recording = read_recording(log, options.recipe, options.run, lib.joint_names)
        recording = independent_joints(recording, lib)
    if streamed is not None and recording.has_unknown_gains:
        raise IdentificationError(
            "gains of motor currents are estimated on a log that is read as a whole, but this one "
            "is streamed; write gain = [...] under [torque] of the recipe, or give --no-stream"
        )
    parts = split_of(options.split)
    if streamed is None:
        at_rest = log_at_rest(recording, options, parts)
        if at_rest is not None:
            return at_rest
    terms = friction_of(recording, options.friction, options.coulomb_speed)
    chooses_friction = terms is not None and terms.columns[:1] == (AUTO,)
    if streamed is not None and (chooses_friction or options.cutoff == AUTO):
        raise IdentificationError(
            "a cut-off or a friction model is chosen on a log that is read as a whole, but this "
            "one is streamed; give --cutoff and --friction values, or give --no-stream"
        )
    notes: tuple[str, ...] = ()
    chooses_regressor = options.regressor == AUTO
    regressor = None if chooses_regressor else options.regressor
    prepared = preparation_of(recording, _hz(options.cutoff), options.rate, regressor)
    if options.cutoff == AUTO:
        base = preparation_of(recording, _ANY_HZ, options.rate, regressor)
        with console.status("choosing a cut-off"):
            cutoff = choose_cutoff(recording, lib, base, parts, None if chooses_friction else terms)
        console.print(cutoff_table(cutoff))
        prepared, notes = cutoff.preparation, (cutoff.sentence,)
    if recording.has_unknown_gains:
        recording = with_current_gains(recording, lib, preparation=prepared, splitting=parts)

    with console.status("checking the accelerations"):
        seen = before_test(recording, parts)
        prepared, sentences = choose_regressor(seen, lib, prepared, chooses_regressor)
    notes += sentences
    if streamed is not None:  # blocks do not hand on the state of the friction
        usable = tuple(name for name in usable if name != MEMORY)
    if usable and options.friction is None and default_terms(recording) is None:
        steps = prepared, parts
        terms, note = _chosen_terms(lib, recording, steps, options, usable, robust, of_type)
        notes += (note,)
    if terms is None or not chooses_friction:
        return PreparedLog(recording, prepared, parts, terms, notes, streamed=streamed)

    with console.status("choosing a friction model"):
        choice = choose_friction(
            recording, lib, prepared, parts, options.coulomb_speed, extra=terms.columns[1:]
        )
    console.print(friction_table(choice))
    return PreparedLog(recording, prepared, parts, choice.chosen.terms, (*notes, choice.sentence))


def _chosen_terms(
    lib: Library,
    recording: Recording,
    steps: tuple[Preparation | None, Split | None],
    options: LogOptions,
    usable: Sequence[str],
    robust: bool,
    of_type: Friction | None,
) -> tuple[Friction, str]:
    """Friction model of a fleet, or the default by cross-validation; with a sentence."""
    if of_type is not None and (MEMORY in usable or MEMORY not in of_type.columns):
        return of_type, f"the friction model is that of the fleet: {of_type}"

    with console.status("choosing a friction model"):
        chosen = choose_default_friction(
            recording, lib, *steps, options.coulomb_speed, tuple(usable), robust
        )
    return chosen.terms, chosen.sentence


def usable_columns(methods: Sequence[str]) -> tuple[str, ...]:
    """Columns among which the default friction model of some methods is chosen."""
    records = [require_method(name) for name in methods]
    if any(record.default_columns for record in records) and len(records) == 1:
        return ()
    limits = [set(record.columns) for record in records if record.columns is not None]
    return tuple(name for name in USABLE if all(name in limit for limit in limits))


def friction_of(recording: Recording, names: str | None, speed: float | None) -> Friction | None:
    """Friction columns of --friction and --coulomb-speed, else of the recipe."""
    default = default_terms(recording)
    if names is None and speed is None:
        return default
    written = recording.recipe.friction if recording.recipe else None
    known = written or Friction(columns=())
    columns, width = (default or known).columns, known.coulomb_speed if speed is None else speed
    if names is not None:
        columns = () if names == "none" else tuple(names.split(","))
    return dataclasses.replace(known, columns=columns, coulomb_speed=width)


def preparation_of(
    recording: Recording,
    cutoff: float | None,
    rate: float | None,
    regressor: str | None = None,
) -> Preparation | None:
    """Preparation of the recipe with --cutoff, --rate and --regressor in place."""
    if cutoff is None and rate is None and regressor is None:
        return None
    base = recording.preparation
    if regressor is not None:
        base = dataclasses.replace(base, regressor=regressor)
    if cutoff is not None:
        base = dataclasses.replace(base, filter="butterworth", cutoff_hz=cutoff)
        if base.max_gap_s is None:
            base = dataclasses.replace(base, max_gap_s=3.0 / recording.rate_hz)
    return dataclasses.replace(base, rate_hz=rate) if rate is not None else base


def _streamed(lib: Library, log: str, options: LogOptions) -> StreamedRecording | None:
    """The log in its file, with --stream or where it is large and can be streamed."""
    if options.stream:
        return open_streamed(log, options.recipe, options.run, lib.joint_names)
    if options.stream is None and is_large(log):
        with suppress(RecordingError):  # compressed or damaged: `read_recording` says which
            return open_streamed(log, options.recipe, options.run, lib.joint_names)
    return None


def _hz(text: str | None) -> float | None:
    """Number of --cutoff; None where the option is missing or auto."""
    if text is None or text == AUTO:
        return None
    try:
        return float(text)
    except ValueError:
        raise IdentificationError(
            f"--cutoff needs a frequency in Hz or auto, got '{text}'"
        ) from None


def cutoff_table(choice: CutoffChoice) -> Table:
    """Candidates of --cutoff auto with their cross-validation errors; an arrow marks the choice."""
    table = Table("cut-off", title="Cut-off: cross-validation error on the unfiltered torque")
    for head in ("velocity", "error", "above the best", "independent rows"):
        table.add_column(head, justify="right")
    for c in choice.candidates:
        table.add_row(
            f"{'→ ' if c is choice.chosen else ''}{c.cutoff_hz:g} Hz",
            {"measured": "measured", "position": "from q"}[c.derivative],
            f"{c.score:.3f}",
            f"{c.excess:.3f} ± {c.excess_error:.3f}",
            f"{100 * c.white:.0f} %",
        )
    return table


def friction_table(choice: FrictionChoice) -> Table:
    """Candidates of --friction auto with their cross-validation errors; an arrow marks the choice.

    The error is in units of the torque noise.
    """
    table = Table("friction model", title="Friction model: cross-validation error over noise")
    for head in ("error", "above the best", "AIC", "unknowns"):
        table.add_column(head, justify="right")
    for candidate in choice.candidates:
        table.add_row(
            f"{'→ ' if candidate is choice.chosen else ''}{candidate.name}: {candidate.terms}",
            f"{candidate.score:.3f}",
            f"{candidate.excess:.3f} ± {candidate.excess_error:.3f}",
            f"{candidate.aic:.1f}",
            str(candidate.parameters),
        )
    return table


def split_of(text: str | None) -> Split | None:
    """Parts of a log."""
    if text is None:
        return None
    if text == "all":
        return EVERYTHING
    a, b = fractions_of(text)
    return Split((0.0, a), (a, b), (b, 1.0))


def fractions_of(text: str) -> tuple[float, float]:
    """Ends of training and validation from "A,B"."""
    a, b = numbers_option(text, 2, "--split")
    if not 0 < a < b < 1:
        raise IdentificationError(f"--split needs 0 < A < B < 1, got '{text}'")
    return a, b


def log_at_rest(
    recording: Recording, options: LogOptions, parts: Split | None
) -> PreparedLog | None:
    """Rows of a log of poses that were reached from both sides."""
    filters = (options.cutoff, options.rate, options.regressor)
    if recording.has_unknown_gains or any(each is not None for each in filters):
        return None
    rows = static_poses(recording)
    if rows is None:
        return None
    wanted = friction_of(recording, options.friction, None)
    has_offset = wanted is not None and OFFSET.name in wanted.columns
    note = (
        f"the log contains {len(rows)} poses at rest that were reached from both sides: the fit "
        "takes the mean of each pair, in which Coulomb friction cancels, and determines the "
        "gravity torque alone; give --cutoff to identify from its motion"
    )
    terms = Friction((OFFSET.name,) if has_offset else ())
    return PreparedLog(rows, Preparation(), parts, terms, (note,), is_at_rest=True)
