"""From a log and the settings to its rows: preparation, split, friction columns, all chosen.

    cut-off → gains of currents → regressor → friction model

What the settings do not state is chosen by the data before the test part, of a streamed log by its
first rows. Of poses at rest that were reached from both sides the mean of each pair is taken.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from runtime.errors import IdentificationError
from runtime.estimators.choice import regressor_choice as choices
from runtime.estimators.choice.default_friction import USABLE, choose_default_friction
from runtime.estimators.choice.friction_choice import FRICTION_MODELS, choose_friction
from runtime.estimators.methods import require_method
from runtime.identification.current_gains import with_current_gains
from runtime.identification.long_logs import head_of
from runtime.identification.settings import (
    AUTO,
    CHOSEN,
    SILENT,
    Progress,
    Settings,
    cutoff_of,
    default_terms,
    friction_of,
)
from runtime.identification.single_log import without_torque_columns
from runtime.library import Library
from runtime.recording import EVERYTHING, Friction, Preparation, Recording, Split
from runtime.recording.coupled_joints import in_order_of, independent_joints
from runtime.recording.current_gains import CurrentGains
from runtime.recording.friction.columns import OFFSET, ROTOR
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.recipes.recipe import COMMANDED
from runtime.recording.settings import has_memory
from runtime.recording.static_poses import static_poses
from runtime.recording.streamed import StreamedRecording
from runtime.recording.unit_conversion import scaled

_ANY_HZ = 1.0  # placeholder of a cut-off that cross-validation replaces, Hz


@dataclass(frozen=True, slots=True, eq=False)
class PreparedLog:
    """A log with its preparation, split and friction columns."""

    recording: Recording  # the log, or its first rows where it is streamed
    preparation: Preparation | None  # filter, decimation, equations; None: of the recipe
    split: Split | None  # training, validation and test parts; None for those of the recipe
    friction: Friction | None  # friction columns; None for those of the recipe
    notes: tuple[str, ...] = ()  # sentences about what was chosen automatically
    streamed: StreamedRecording | None = None  # the log in its file; None where it is in memory
    is_at_rest: bool = False  # whether the rows are poses at rest, without motion

    @property
    def steps(self) -> Preparation:
        """Its preparation, stated or that of the recipe."""
        return self.preparation or self.recording.preparation

    @property
    def is_commanded(self) -> bool:
        """Whether it has a motion with a commanded torque, as it was read."""
        is_read = self.recording.columns is None and not self.is_at_rest
        return self.recording.torque_source == COMMANDED and is_read

    def settings(self, settings: Settings, preparation: Preparation | None) -> Settings:
        """Settings of a fit of this log, with nothing left to choose."""
        usual = Settings()
        rows: dict[str, Any] = {name: getattr(usual, name) for name in (*CHOSEN, "coulomb_speed")}
        rows |= {"preparation": preparation, "split": self.split, "friction": self.friction}
        return replace(settings, **rows)


def prepared_log(
    log: Recording | StreamedRecording,
    lib: Library,
    settings: Settings,
    usable: Sequence[str] = (),
    progress: Progress = SILENT,
    gains: CurrentGains | None = None,
) -> PreparedLog:
    """Choose cut-off, regressor and friction model of a log where the settings do not state them.

    Where neither settings nor recipe name columns of friction they are chosen from `usable`. Gains
    of currents are those of another log, or of this one.
    """
    recording, streamed = _in_order(log, lib)
    recording = recording if gains is None else scaled(recording, gains)
    parts = settings.split if settings.test is None else EVERYTHING
    terms = friction_of(recording, settings)
    prepared, notes, quality = settings.preparation, tuple[str, ...](), None
    is_read = prepared is None and recording.columns is None  # and no step is stated
    if is_read:
        at_rest = None if streamed else _at_rest(recording, settings, parts)
        if at_rest is not None:
            return at_rest
        prepared, notes, quality = chosen_filter(recording, lib, settings, terms, progress)
        if settings.cutoff is None:
            notes = tuple(f"{each}; --settings regressor=acceleration takes none" for each in notes)
    if recording.has_unknown_gains:
        recording = with_current_gains(recording, lib, preparation=prepared, split=parts)
    if is_read:
        progress.step("checking the accelerations")
        seen, chooses = before_test(recording, settings.split), settings.regressor == AUTO
        prepared, sentences = choices.choose_regressor(seen, lib, prepared, chooses, quality)
        notes = (*notes, *sentences)
    if streamed is not None:
        streamed = replace(streamed, gains=recording.gains)  # those of the first rows
    if recording.columns is not None:
        return PreparedLog(recording, prepared, settings.split, terms, notes, streamed)
    steps = prepared, parts, settings.coulomb_speed
    if terms is not None and terms.columns[:1] == (AUTO,):
        progress.step("choosing a friction model")
        further = without_torque_columns(replace(terms, columns=terms.columns[1:]))
        rotor = ROTOR.name in usable
        names = [k for k, each in FRICTION_MODELS.items() if rotor or ROTOR.name not in each]
        choice = choose_friction(recording, lib, *steps, names, extra=further.columns)
        progress.choice(choice)
        beside = tuple(name for name in terms.columns[1:] if name not in further.columns)
        terms, notes = choice.chosen.terms, (*notes, choice.sentence)
        terms = replace(terms, columns=(*terms.columns, *beside))
    elif usable and settings.friction is None and default_terms(recording) is None:
        progress.step("choosing a friction model")
        of_type = settings.prior.friction_model if settings.prior else None
        if of_type is not None and (has_memory(usable) or not has_memory(of_type.columns)):
            terms, note = of_type, f"the friction model is that of the fleet: {of_type}"
        else:
            chosen = choose_default_friction(
                recording, lib, *steps, allowed=tuple(usable), robust=settings.robust
            )
            terms, note = chosen.terms, chosen.sentence
        notes += (note,)
    return PreparedLog(recording, prepared, settings.split, terms, notes, streamed)


def _in_order(
    log: Recording | StreamedRecording, lib: Library
) -> tuple[Recording, StreamedRecording | None]:
    """Rows in the joints of the robot, and the log whose first rows they are, if it is streamed."""
    if isinstance(log, StreamedRecording):
        streamed = in_order_of(lib, log)
        return head_of(streamed), streamed
    return independent_joints(log, lib), None


def chosen_filter(
    recording: Recording, lib: Library, settings: Settings, terms: Friction | None, shown: Progress
) -> tuple[Preparation | None, tuple[str, ...], choices.Differentiation | None]:
    """The preparation with its cut-off, a sentence where that was chosen, and its quality if known.

    It is chosen where it is asked for, and where nothing states a filter and differentiation fails.
    """
    is_free, quality = settings.cutoff == AUTO, None
    stated = settings.cutoff, settings.rate, settings.regressor
    if recording.preparation.filter == "none" and all(each is None for each in stated):
        seen = before_test(recording, settings.split)
        quality = choices.differentiation_of(seen, lib, recording.preparation)
    is_noisy = quality is not None and quality.is_noisy
    cutoff = _ANY_HZ if is_free else cutoff_of(settings.cutoff)
    regressor = None if settings.regressor == AUTO else settings.regressor
    prepared = preparation_of(recording, cutoff, settings.rate, regressor)
    if not (is_free or is_noisy):
        return prepared, (), quality
    shown.step("choosing a cut-off")
    is_named = terms is not None and terms.columns[:1] != (AUTO,)
    known = without_torque_columns(terms) if terms is not None and is_named else None
    wanted = prepared if is_free else preparation_of(recording, _ANY_HZ, None)
    try:
        choice = choices.choose_cutoff(recording, lib, wanted, settings.split, known)
    except IdentificationError:  # too few rows or too slow: choose_regressor states the noise
        if is_free:
            raise
        return prepared, (), quality
    shown.choice(choice)
    sentence = choice.sentence
    if quality is not None:
        sentence += f"; without one {quality.noise_in(lib)}"
    return choice.preparation, (sentence,), None


def filter_for_accelerations(
    recording: Recording, lib: Library, cutoff: float | None, rate: float | None
) -> tuple[Preparation | None, tuple[str, ...]]:
    """As `chosen_filter`, for fits that take no rows but those of accelerations.

    A chosen cut-off is lowered to harmless noise of accelerations; a note states other noise.
    """
    stated = Settings(cutoff=cutoff, rate=rate)
    prepared, notes, _ = chosen_filter(recording, lib, stated, None, SILENT)
    quality = choices.differentiation_of(recording, lib, prepared) if prepared and notes else None
    if prepared is not None and quality is not None:
        if not quality.is_noisy:
            return prepared, notes
        lower = float(f"{0.95 * quality.harmless_hz:.2g}")  # at the bound itself rounding decides
        notes = (f"{notes[0]}; lowered to {lower:g} Hz, since at it {quality.noise_in(lib)}",)
        prepared = replace(prepared, cutoff_hz=lower, trim_s=1.0 / lower)
    return prepared, (*notes, *choices.noisy_accelerations(recording, lib, prepared))


def usable_columns(methods: Sequence[str]) -> tuple[str, ...]:
    """Columns among which the default friction model of some methods is chosen."""
    records = [require_method(name) for name in methods]
    if any(record.default_columns for record in records) and len(records) == 1:
        return ()
    limits = [set(record.columns) for record in records if record.columns is not None]
    return tuple(name for name in USABLE if all(name in limit for limit in limits))


def preparation_of(
    recording: Recording, cutoff: float | None, rate: float | None, regressor: str | None = None
) -> Preparation | None:
    """Preparation of the recipe with cut-off, rate and regressor in place; None where none is."""
    if cutoff is None and rate is None and regressor is None:
        return None
    base = recording.preparation
    if regressor is not None:
        base = replace(base, regressor=regressor)
    if cutoff is not None:
        base = replace(base, filter="butterworth", cutoff_hz=cutoff)
        if base.max_gap_s is None:
            base = replace(base, max_gap_s=3.0 / recording.rate_hz)
    return replace(base, rate_hz=rate) if rate is not None else base


def _at_rest(recording: Recording, settings: Settings, parts: Split | None) -> PreparedLog | None:
    """Rows of a log of poses that were reached from both sides."""
    filters = (settings.cutoff, settings.rate, settings.regressor)
    if recording.has_unknown_gains or any(each is not None for each in filters):
        return None
    rows = static_poses(recording)
    if rows is None:
        return None
    wanted = friction_of(recording, replace(settings, coulomb_speed=None))
    has_offset = wanted is not None and OFFSET.name in wanted.columns
    note = (
        f"the log contains {len(rows)} poses at rest that were reached from both sides: the fit "
        "takes the mean of each pair, in which Coulomb friction cancels, and determines the "
        "gravity torque alone; give --cutoff to identify from its motion"
    )
    terms = Friction((OFFSET.name,) if has_offset else ())
    return PreparedLog(rows, Preparation(), parts, terms, (note,), is_at_rest=True)
