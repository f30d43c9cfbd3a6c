"""Inspection of a log: all checks in their order, with findings and a proposed recipe.

Each check returns a plan (a recipe) with which the next one reads the log: first the layout of the
files, then units, order and clock of the motion, then order, sign and unit of the torque, then the
fit of the model.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from runtime.errors import RecordingError, RuntimeFault
from runtime.inspection.checks import (
    clock,
    drives,
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
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recipe, Recording, load_recipe
from runtime.recording.commanded_torque import COMMANDED
from runtime.recording.friction import DRIVE, ROTOR, names_where
from runtime.recording.notebook import Framed, html_table
from runtime.recording.plausibility import require_joints
from runtime.recording.reader import Raw, locate, read_raw, recording_of

_STEPS = (1, 2, 4, 5, 10, 20, 25, 40, 50, 100, 200, 250, 400, 500, 1000)
"""Factors of decimation that are proposed."""


@dataclass(frozen=True, slots=True)
class Inspection(Framed):
    """Result of an inspection.

    Attributes:
        robot: name of the robot.
        findings: errors first, then warnings, then information.
        plan: the proposed recipe.
        recording: the log read with this plan, before any preparation.
        rest: (from, to) of the intervals of rest [s].
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

    def columns_of_frame(self) -> dict[str, list[str]]:
        """Level, kind and sentence of the findings, one row each."""
        return {
            key: [getattr(f, key) for f in self.findings] for key in ("level", "kind", "sentence")
        }

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
    """Check a log for units, order, signs, clock and torque, and propose a recipe.

    Args:
        path: file, folder or known data set.
        lib: library of the robot.
        recipe: recipe to read the log with; None is the one that `identify` would take, else a
            draft from names and shapes.
        run: name of the run, where the recipe has several.
        bare: True ignores a recipe that lies beside the files.
        rate_hz: rate of a log without a clock [Hz].
        propose: True also chooses the cut-off, which takes seconds.

    Returns:
        The findings and the proposed recipe.

    Raises:
        RuntimeFault: the log cannot be read, or has another number of joints than the robot.
    """
    raw, findings = _read(locate(path), lib, recipe, run, bare, rate_hz)
    findings += _of_file(raw)
    plan, backward = clock.order_of_time(raw, raw.plan)
    findings += backward
    checks = _Checks(raw, plan, findings)
    require_joints(checks.recording, lib)
    checks.run(lambda r, p: motion.velocity_pairs(r, p, lib))
    checks.run(lambda r, p: units.units(r, p, lib))
    blind = any(f.kind == "missing_clock" and f.level == ERROR for f in findings)
    checks.run(lambda r, p: joint_order.joint_order(r, p, lib))
    checks.run(lambda r, p: clock.clock(r, p, raw))
    recording = checks.recording
    findings += motion.wraps(recording)
    if not blind:
        findings += signals.saturation(recording, lib) + signals.rest(recording, checks.plan)
    if recording.tau is None or not recording.tau.any():
        sentence = "the log has no torque, or only zeros, so that nothing can be identified; log it"
        findings.append(Finding("no_torque", ERROR, sentence))
    elif blind or any(f.kind == "position_range" for f in findings):
        sentence = "the torque was not checked; correct the clock and the positions first"
        findings.append(Finding("not_judged", INFO, sentence))
    elif recording.torque_source == COMMANDED:
        _commanded(checks, lib)
    else:
        _torque(checks, lib, propose)
        findings += signals.little_torque(checks.recording, lib)
    motors = any(f.kind == "position_range" for f in findings) and not checks.plan.gear
    # Columns of coupled motors are proposed once the gear matrix is known.
    plan = checks.plan.replace(robot=lib.name) if motors else _completed(checks.plan, lib)
    return Inspection(
        robot=lib.name,
        findings=tuple(sorted(findings, key=lambda f: LEVELS.index(f.level))),
        plan=plan,
        recording=checks.recording,
        rest=tuple(signals.rest_spans(checks.recording)),
    )


class _Checks:
    """The plan so far, the recording read with it, and the findings."""

    def __init__(self, raw: Raw, plan: Recipe, findings: list[Finding]) -> None:
        self._raw, self.plan, self.findings = raw, plan, findings
        self.recording = recording_of(replace(raw, plan=plan))

    def run(self, check: Callable[[Recording, Recipe], tuple[Recipe, list[Finding]]]) -> None:
        """Run a check, and read the log again where it changes the plan."""
        plan, findings = check(self.recording, self.plan)
        self.findings += findings
        if plan != self.plan:
            self.plan = plan
            self.recording = recording_of(replace(self._raw, plan=plan))

    def run_on_torque(
        self,
        check: Callable[[TorqueRows, Recipe], tuple[Recipe, list[Finding]]],
        lib: Library,
        terms: Friction,
    ) -> None:
        """Run a check of the torque on prepared rows."""
        torque_rows = self.torque_rows(lib, terms)
        self.run(lambda _, plan: check(torque_rows, plan))

    def torque_rows(self, lib: Library, terms: Friction) -> TorqueRows:
        """Prepared rows of the recording, read with the plan so far."""
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
    """The log read by the recipe, else as `identify` reads it, else by a draft."""
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
    """Findings of the reader, and signals whose names stand for a command or a model (trap 4)."""
    findings = [Finding("corrupt_rows", WARNING, each, trap=9) for each in raw.dropped]
    findings += [Finding("file_form", INFO, each, trap=9) for each in raw.remarks]
    findings += [Finding("other_file", WARNING, each) for each in raw.pins]
    for kind, signal in raw.plan.signals().items():
        titles = [str(c) for c in signal.columns] or [signal.key or signal.file]
        odd = next((title for title in titles if not meaning(title).is_measured), None)
        if odd is None:
            continue
        findings.append(
            Finding(
                "not_measured",
                WARNING,
                f"the {kind} is read from '{odd}', a name of a command or a model, not of a "
                "measurement: it fits a model very well but contains nothing of the robot; log the "
                "measured signal",
                {"kind": kind, "title": odd},
                trap=4,
            )
        )
    return findings


def _commanded(checks: _Checks, lib: Library) -> None:
    """Law, delay and drives of a commanded torque; unit, sign and order are those of the law."""
    checks.findings += drives.commanded(checks.recording, checks.plan)
    try:
        checks.run(lambda r, p: drives.delay(r, lib, p))
        checks.findings += drives.rotor(checks.recording, lib, checks.plan)
        usual = drives.filtered(checks.recording, checks.plan.preparation)
        _, failing = choose_regressor(checks.recording, lib, usual)
        checks.findings += [Finding("differentiation", WARNING, each) for each in failing]
        if checks.plan.preparation.filter == "none":
            late = checks.plan.preparation.torque_delay_s
            checks.plan = checks.plan.replace(preparation=replace(usual, torque_delay_s=late))
        checks.findings.append(model_fit.one_run(checks.recording.duration))
    except RuntimeFault as fault:
        sentence = f"the torque could not be checked: {fault}"
        checks.findings.append(Finding("not_judged", WARNING, sentence))


def _torque(checks: _Checks, lib: Library, propose: bool) -> None:
    """Order, sign and unit of τ, then its fit to the model."""
    terms = checks.plan.friction or _terms(checks.plan)
    try:
        for check in (
            torque_signs.torque_order,
            torque_signs.joint_signs,
            torque_signs.scale,
            gravity.gravity,
        ):
            checks.run_on_torque(check, lib, terms)
        preparation = checks.plan.preparation
        if propose and preparation.filter == "none":
            choice = choose_cutoff(checks.recording, lib, preparation, checks.plan.split, terms)
            checks.plan = checks.plan.replace(preparation=_thinned(choice, checks.recording))
            checks.findings.append(Finding("cutoff", INFO, choice.sentence))
        usual = rough(checks.recording, checks.plan.preparation)
        _, failing = choose_regressor(checks.recording, lib, usual)
        checks.findings += [Finding("differentiation", WARNING, each) for each in failing]
        torque_rows = checks.torque_rows(lib, terms)
        matrix = model_fit.fit_rows(torque_rows)
        late = model_fit.delay(torque_rows, matrix, checks.plan)
        if late:
            shifted = replace(
                checks.plan.preparation, torque_delay_s=float(f"{late[0].evidence['delay_s']:.3g}")
            )
            checks.plan = checks.plan.replace(preparation=shifted)
            torque_rows = checks.torque_rows(lib, terms)
            matrix = model_fit.fit_rows(torque_rows)
        tau = checks.recording.required("tau")
        strange = model_fit.unexplained(torque_rows, matrix)
        checks.findings += late + strange + model_fit.too_good(torque_rows, matrix, tau)
        torque = checks.plan.torque
        guessed = not checks.plan.gear and torque is not None and torque.unit == "A"
        if not strange and not guessed:  # wrong gains look like a tool or a coupling
            checks.findings += model_fit.tool(torque_rows) + model_fit.coupling(
                torque_rows, matrix, terms
            )
        checks.findings.append(model_fit.one_run(torque_rows.whole.duration))
    except RuntimeFault as fault:
        sentence = f"the torque could not be checked: {fault}"
        checks.findings.append(Finding("not_judged", WARNING, sentence))


def _thinned(choice: CutoffChoice, recording: Recording) -> Preparation:
    """The chosen preparation, decimated to the rate that its band needs, without intervals of
    rest.
    """
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
    """Friction columns to propose, with those of motors where the gear couples them."""
    if plan.law is not None:
        return Friction(DRIVE)
    gear = plan.gear
    coupled = any(x != 0.0 for i, row in enumerate(gear) for j, x in enumerate(row) if i != j)
    motors = (ROTOR.name, *names_where(lambda column: column.of_motors))
    return Friction(columns=(*Friction().columns, *(motors if coupled else ())))


def _completed(plan: Recipe, lib: Library) -> Recipe:
    """The plan with the robot's name and friction columns, complete for `identify`."""
    friction = plan.friction or _terms(plan)
    return plan.replace(robot=lib.name, friction=replace(friction, gear=()))
