"""A log and a robot in, findings and a proposed recipe out: the questions in their order.

Each answer is a plan (a recipe) that the next question is asked under: first what the files are,
then units, order and clock of the motion, then sign, unit and order of the torque, then the model.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from runtime.errors import RecordingError, RuntimeFault
from runtime.inspection.checks import (
    clock,
    gravity,
    joint_order,
    model_fit,
    motion,
    signals,
    torque_signs,
    units,
)
from runtime.inspection.checks.column_names import meaning
from runtime.inspection.checks.file_layout import draft
from runtime.inspection.checks.torque_rows import TorqueRows, rough, torque_rows_of
from runtime.inspection.cutoff_choice import ROWS_PER_CUTOFF, CutoffChoice, choose_cutoff
from runtime.inspection.finding import ERROR, INFO, LEVELS, WARNING, Finding
from runtime.inspection.regressor_choice import choose_regressor
from runtime.library import Library
from runtime.notebook import html_table
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recipe, Recording, load_recipe
from runtime.recording.friction import ROTOR, names_where
from runtime.recording.plausibility import require_joints
from runtime.recording.reader import Raw, locate, read_raw, recording_of

_STEPS = (1, 2, 4, 5, 10, 20, 25, 40, 50, 100, 200, 250, 400, 500, 1000)
"""One row of so many is kept."""


@dataclass(frozen=True, slots=True)
class Inspection:
    """What the doctor found.

    Attributes:
        robot: its name.
        findings: errors first.
        plan: the recipe that the findings propose.
        recording: read with this plan, before any preparation.
        rest: (from, to) of the rests, s.
    """

    robot: str
    findings: tuple[Finding, ...]
    plan: Recipe
    recording: Recording
    rest: tuple[tuple[float, float], ...]

    def _repr_html_(self) -> str:
        """The findings, errors first, as a table for notebooks."""
        rows = [(f.level, f.kind, f.sentence) for f in self.findings]
        title = f"{self.recording.name or 'log'} of {self.robot}: {len(rows)} findings"
        return html_table(title, rows, ("level", "finding", "what was measured, and what to do"))

    def of_level(self, *levels: str) -> tuple[Finding, ...]:
        """The findings of these levels."""
        return tuple(f for f in self.findings if f.level in levels)


@one_blas_thread
def inspect_log(
    path: str | Path,
    lib: Library,
    recipe: str | Path | Recipe | None = None,
    run: str | None = None,
    *,
    bare: bool = False,
    rate_hz: float | None = None,
    propose: bool = False,
) -> Inspection:
    """Ask a log everything.

    Args:
        path: file, folder or known data set.
        lib: of the robot.
        recipe: to read it with; default is what `identify` would take, else a draft from names.
        run: which, where a recipe has several.
        bare: ask the files alone, whatever recipe lies beside them.
        rate_hz: of a log without a clock.
        propose: choose the cut-off, too, as a recipe needs it; takes seconds.

    Raises:
        RuntimeFault: the log cannot be read, or is none of this robot.
    """
    raw, findings = _read(locate(path), lib, recipe, run, bare, rate_hz)
    findings += _of_file(raw)
    plan, told = clock.order_of_time(raw, raw.plan)
    findings += told
    asked = _Asked(raw, plan, findings)
    require_joints(asked.recording, lib)
    asked.ask(lambda r, p: motion.velocity_pairs(r, p, lib))
    asked.ask(lambda r, p: units.units(r, p, lib))
    blind = any(f.kind == "missing_clock" and f.level == ERROR for f in findings)
    asked.ask(lambda r, p: joint_order.joint_order(r, p, lib))
    asked.ask(lambda r, p: clock.clock(r, p, raw))
    recording = asked.recording
    findings += motion.wraps(recording)
    if not blind:
        findings += signals.saturation(recording, lib) + signals.rest(recording, asked.plan)
    if recording.tau is None or not recording.tau.any():
        said = "the log has no torque, or only zeros, so nothing can be identified; log it"
        findings.append(Finding("no_torque", ERROR, said))
    elif blind or any(f.kind == "position_range" for f in findings):
        said = "the torque was not judged, because the motion is not that of this robot yet"
        findings.append(Finding("not_judged", INFO, said))
    else:
        _torque(asked, lib, propose)
        findings += signals.little_torque(asked.recording, lib)
    motors = any(f.kind == "position_range" for f in findings) and not asked.plan.gear
    # Whether motors are coupled, and need columns of their own, the matrix will tell.
    plan = asked.plan.replace(robot=lib.name) if motors else _completed(asked.plan, lib)
    return Inspection(
        robot=lib.name,
        findings=tuple(sorted(findings, key=lambda f: LEVELS.index(f.level))),
        plan=plan,
        recording=asked.recording,
        rest=tuple(signals.rest_spans(asked.recording)),
    )


class _Asked:
    """The plan so far, the recording read with it, and what was found."""

    def __init__(self, raw: Raw, plan: Recipe, findings: list[Finding]) -> None:
        self._raw, self.plan, self.findings = raw, plan, findings
        self.recording = recording_of(replace(raw, plan=plan))

    def ask(self, question: Callable[[Recording, Recipe], tuple[Recipe, list[Finding]]]) -> None:
        """Ask, and read anew where the answer changes the plan."""
        plan, told = question(self.recording, self.plan)
        self.findings += told
        if plan != self.plan:
            self.plan = plan
            self.recording = recording_of(replace(self._raw, plan=plan))

    def ask_torque(
        self,
        question: Callable[[TorqueRows, Recipe], tuple[Recipe, list[Finding]]],
        lib: Library,
        terms: Friction,
    ) -> None:
        """Ask the prepared rows."""
        torque_rows = self.torque_rows(lib, terms)
        self.ask(lambda _, plan: question(torque_rows, plan))

    def torque_rows(self, lib: Library, terms: Friction) -> TorqueRows:
        """The bench of the recording as it stands."""
        usual = rough(self.recording, self.plan.preparation)
        return torque_rows_of(self.recording, lib, usual, terms)


def _read(
    place: Path,
    lib: Library,
    recipe: str | Path | Recipe | None,
    run: str | None,
    bare: bool,
    rate_hz: float | None,
) -> tuple[Raw, list[Finding]]:
    """By the recipe, else as `identify` reads it, else by a draft."""
    if recipe is not None:
        return read_raw(place, load_recipe(recipe), run), []
    if place.is_dir() and not bare:
        try:
            return read_raw(place, None, run), []
        except RecordingError:
            pass
    plan, findings = draft(place, lib.n_joints, rate_hz)
    return read_raw(place, plan, run), findings


def _of_file(raw: Raw) -> list[Finding]:
    """What the reader has dropped or skipped, in its own words, and names that say too much."""
    findings = [Finding("corrupt_rows", WARNING, said, trap=9) for said in raw.dropped]
    findings += [Finding("file_form", INFO, said, trap=9) for said in raw.remarks]
    findings += [Finding("other_file", WARNING, said) for said in raw.pins]
    for kind, signal in raw.plan.signals().items():
        titles = [str(c) for c in signal.columns] or [signal.key or signal.file]
        odd = next((title for title in titles if not meaning(title).is_measured), None)
        if odd is None:
            continue
        findings.append(
            Finding(
                "not_measured",
                WARNING,
                f"the {kind} is read from '{odd}', which sounds like a command or a model, not "
                "like a measurement: it fits a model wonderfully and says nothing about the "
                "robot; log the measured one",
                {"kind": kind, "title": odd},
                trap=4,
            )
        )
    return findings


def _torque(asked: _Asked, lib: Library, propose: bool) -> None:
    """Order, sign and unit of τ, then what it says about the model."""
    terms = asked.plan.friction or _terms(asked.plan)
    try:
        for question in (
            torque_signs.torque_order,
            torque_signs.joint_signs,
            torque_signs.scale,
            gravity.gravity,
        ):
            asked.ask_torque(question, lib, terms)
        preparation = asked.plan.preparation
        if propose and preparation.filter == "none":
            choice = choose_cutoff(asked.recording, lib, preparation, asked.plan.split, terms)
            asked.plan = asked.plan.replace(preparation=_thinned(choice, asked.recording))
            asked.findings.append(Finding("cutoff", INFO, choice.sentence))
        usual = rough(asked.recording, asked.plan.preparation)
        _, failing = choose_regressor(asked.recording, lib, usual)
        asked.findings += [Finding("differentiation", WARNING, said) for said in failing]
        torque_rows = asked.torque_rows(lib, terms)
        matrix = model_fit.fit_rows(torque_rows)
        late = model_fit.delay(torque_rows, matrix, asked.plan)
        if late:
            shifted = replace(
                asked.plan.preparation, torque_delay_s=float(f"{late[0].evidence['delay_s']:.3g}")
            )
            asked.plan = asked.plan.replace(preparation=shifted)
            torque_rows = asked.torque_rows(lib, terms)
            matrix = model_fit.fit_rows(torque_rows)
        tau = asked.recording.required("tau")
        strange = model_fit.unexplained(torque_rows, matrix)
        asked.findings += late + strange + model_fit.too_good(torque_rows, matrix, tau)
        torque = asked.plan.torque
        guessed = not asked.plan.gear and torque is not None and torque.unit == "A"
        if not strange and not guessed:  # wrong gains feign both
            asked.findings += model_fit.tool(torque_rows) + model_fit.coupling(
                torque_rows, matrix, terms
            )
        asked.findings.append(model_fit.one_run(torque_rows))
    except RuntimeFault as fault:
        said = f"the torque could not be judged: {fault}"
        asked.findings.append(Finding("not_judged", WARNING, said))


def _thinned(choice: CutoffChoice, recording: Recording) -> Preparation:
    """The chosen preparation with the rows that its band needs, and without rest."""
    ready = choice.preparation
    grid = ready.grid_hz or (1.0 / ready.clock_tick if ready.clock_tick else recording.rate_hz)
    most = grid / (ROWS_PER_CUTOFF * choice.chosen.cutoff_hz)
    step = max(k for k in _STEPS if k <= max(most, 1.0))
    return replace(
        ready,
        trim_s=float(f"{ready.trim_s:.2g}") if ready.trim_s else None,
        rate_hz=float(f"{grid / step:.6g}") if step > 1 else None,
        rest_speed=ready.rest_speed or signals.REST_SPEED,
    )


def _terms(plan: Recipe) -> Friction:
    """Friction to propose: that of coupled motors where the gear couples them."""
    gear = plan.gear
    coupled = any(x != 0.0 for i, row in enumerate(gear) for j, x in enumerate(row) if i != j)
    motors = (ROTOR.name, *names_where(lambda column: column.of_motors))
    return Friction(columns=(*Friction().columns, *(motors if coupled else ())))


def _completed(plan: Recipe, lib: Library) -> Recipe:
    """With the robot's name and friction, as a file that `identify` takes."""
    friction = plan.friction or _terms(plan)
    return plan.replace(robot=lib.name, friction=replace(friction, gear=()))
