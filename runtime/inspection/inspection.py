"""Inspection of a log: all checks in their order, with findings and a proposed recipe.

Each check returns a plan (a recipe) with which the next one reads the log: first the layout of the
files, then units, order and clock of the motion, then order, sign and unit of the torque, then the
fit of the model. Motor currents whose recipe states no gain are read with gain 1; the recipe stays
without gains, which `identify` estimates from the rows before the test part. Values that only the
user has (gears, the zero of motor angles) are a block to be filled in.
"""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from runtime.common.tables import Table
from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError, RecordingError
from runtime.inspection.checks import clock, outlying_rows, signals, units
from runtime.inspection.checks.column_faults import joint_order
from runtime.inspection.checks.columns import meaning
from runtime.inspection.checks.file_layout import draft
from runtime.inspection.checks.vendor_signals import vendor_torque
from runtime.inspection.finding import ERROR, INFO, LEVELS, WARNING, Checked, Finding
from runtime.inspection.torque_checks import CheckRun, check_commanded, check_torque, proposed_terms
from runtime.library import Library, require_library
from runtime.recording import Friction, Recipe, Recording
from runtime.recording.consistency import require_joints
from runtime.recording.coupled_joints import independent_joints, renamed_joints
from runtime.recording.formats import format_of_suffix
from runtime.recording.formats.text_tables import numbers_in
from runtime.recording.friction.model import DRIVE
from runtime.recording.log_files import LogFiles
from runtime.recording.notebook import Framed
from runtime.recording.reader import GivenRecipe, Raw, locate, read_raw, recording_of
from runtime.recording.recipes import recipe_file
from runtime.recording.recipes.recipe import COMMANDED, JSON_CELLS, Source
from runtime.recording.recipes.recipe_file import load_recipe
from runtime.recording.static_poses import static_poses

_PASSIVE = 1e-9  # torque of a dependent joint over the largest, below which no drive acts on it


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

    def tables(self) -> tuple[Table, ...]:
        """The findings, errors first."""
        rows = tuple((f.level, f.kind, f.sentence) for f in self.findings)
        title = f"{self.recording.name or 'log'} of {self.robot}: {len(rows)} findings"
        head = ("level", "finding", "what was measured, and what to do")
        return (Table(head, rows, title=title),)

    def columns_of_frame(self) -> dict[str, list[str]]:
        """Level, kind and sentence of the findings, one row each."""
        keys = ("level", "kind", "sentence")
        return {key: [getattr(f, key) for f in self.findings] for key in keys}

    def of_level(self, *levels: str) -> tuple[Finding, ...]:
        """The findings of these levels."""
        return tuple(f for f in self.findings if f.level in levels)


@one_blas_thread
def inspect_log(
    path: str | Path,
    lib: Library,
    recipe: GivenRecipe = None,
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
    require_library(lib)
    if not isinstance(path, str | Path):
        raise RecordingError(f"expected the file or folder of a log, got {path!r:.60}")
    raw, findings = _read(locate(path), lib, recipe, run, bare, rate_hz)
    findings += _of_file(raw)
    plan, backward = clock.order_of_time(raw, raw.plan)
    findings += backward
    plan, meant = vendor_torque(plan, lib, is_drafted=recipe is None)
    findings += meant
    has_gains = not plan.has_unknown_gains
    raw, plan = with_gain_one(raw, plan)
    raw, plan, reduced = of_independent_joints(raw, plan, lib)
    findings += reduced
    checks = CheckRun(raw, plan, lib, findings, has_gains=has_gains)
    require_joints(checks.recording, lib)
    # Quantised torques at rest look like a frozen, saturated or corrupt signal.
    at_rest = static_poses(checks.recording) if has_gains else None
    if at_rest is None:
        checks.run(outlying_rows.frozen)
        checks.run(outlying_rows.outlying_rows)
    else:
        sentence = (
            f"the log contains {len(at_rest)} poses at rest that were reached from both sides: "
            "identify takes the mean of each pair, in which Coulomb friction cancels, and "
            "determines the gravity torque alone"
        )
        findings.append(Finding("static_poses", INFO, sentence, {"poses": len(at_rest)}))
    checks.run(signals.velocity_pairs)
    checks.run(signals.constant_velocity)
    checks.run(units.units)
    checks.run(signals.velocity_filter)
    blind = any(f.kind == "missing_clock" and f.level == ERROR for f in findings)
    constant = [] if at_rest is not None else signals.constant_torque(checks.recording, lib)
    findings += constant
    if not lib.placeholders and not constant:
        checks.run(joint_order)
    checks.run(lambda r, p, lib: clock.clock(r, p, raw, lib))
    recording = checks.recording
    findings += signals.wraps(recording)
    if not blind and at_rest is None:
        findings += signals.saturation(recording, lib) + signals.rest(recording, checks.plan, lib)
        findings[:0] = signals.still_joints(recording, lib)  # stated before what follows from it
    findings += signals.unsigned_torque(recording)
    _check_torque(checks, propose, blind=blind)
    if not has_gains:
        checks.plan, checks.findings = stated(checks.plan, checks.findings)
        findings = checks.findings
    motors = any(f.kind == "position_range" for f in findings) and not checks.plan.gear
    # Columns of coupled motors are proposed once the gear matrix is known.
    plan = checks.plan.replace(robot=lib.name)
    friction = plan.friction or proposed_terms(plan)
    usual = plan.friction is None and friction in {Friction(), Friction(DRIVE)}
    if not motors and not usual:  # usual columns are left to `identify`
        plan = plan.replace(friction=replace(friction, gear=()))
    return Inspection(
        robot=lib.name,
        findings=tuple(sorted(findings, key=lambda f: LEVELS.index(f.level))),
        plan=plan,
        recording=checks.recording,
        rest=tuple(signals.rest_spans(checks.recording, lib)),
    )


def _check_torque(checks: CheckRun, propose: bool, *, blind: bool) -> None:
    """Checks of the torque, where clock, positions and torque allow them."""
    recording, findings = checks.recording, checks.findings
    kinds = {f.kind for f in findings}
    if recording.tau is None or not recording.tau.any():
        sentence = "the log has no torque, or only zeros, so that nothing can be identified; log it"
        findings.append(Finding("no_torque", ERROR, sentence))
    elif blind or "position_range" in kinds:
        sentence = "the torque was not checked; correct the clock and the positions first"
        findings.append(Finding("not_judged", INFO, sentence))
    elif kinds & {"constant_torque", "unsigned_torque"}:
        sentence = "the torque was not checked further; log all torques with their signs first"
        findings.append(Finding("not_judged", INFO, sentence))
    elif recording.torque_source == COMMANDED:
        check_commanded(checks)
    else:
        check_torque(checks, propose)
        if checks.has_gains:  # unknown gains scale the torque of each joint
            findings += signals.little_torque(checks.recording, checks.lib)
    if not checks.has_gains or any(f.kind == "torque_unit" for f in findings):
        # Peaks in another unit are not those of a limit in N·m.
        findings[:] = [f for f in findings if (f.kind, f.level) != ("saturation", INFO)]


def _read(
    place: Path,
    lib: Library,
    recipe: GivenRecipe,
    run: str | None,
    bare: bool,
    rate_hz: float | None,
) -> tuple[Raw, list[Finding]]:
    """The log read by the recipe, else as `identify` reads it, else by a draft."""
    names = lib.joint_names
    if recipe is not None:
        return read_raw(place, load_recipe(recipe), run, names), []
    if place.is_dir() and not bare:
        try:
            return read_raw(place, None, run, names), []
        except RecordingError:
            pass
    plan, findings = draft(place, names, rate_hz)
    try:
        return read_raw(place, plan, run, names), findings
    except RecordingError:  # a bag whose names have nothing in common with those of the robot
        return read_raw(place, plan, run), findings


def _of_file(raw: Raw) -> Iterator[Finding]:
    """Findings of the reader, and signals whose names stand for a command or a model."""
    yield from (Finding("corrupt_rows", WARNING, each) for each in raw.dropped)
    remarks = (each.removeprefix("Warning: ") for each in raw.remarks)
    yield from (Finding("file_form", INFO, each) for each in remarks)
    yield from (Finding("other_file", WARNING, each) for each in raw.pins)
    for kind, signal in raw.plan.signals().items():
        titles = [str(c) for c in signal.columns] or [signal.key or signal.file]
        odd = next((title for title in titles if not meaning(title).is_measured), None)
        if odd is not None:
            sentence = (
                f"the {kind} is read from '{odd}', a name of a command or a model, not of a "
                "measurement: it fits a model very well but shows nothing of the robot; log the "
                "measured signal"
            )
            yield Finding("not_measured", WARNING, sentence, {"kind": kind, "title": odd})


def of_independent_joints(
    raw: Raw, plan: Recipe, lib: Library
) -> tuple[Raw, Recipe, list[Finding]]:
    """Take the columns of the independent joints where a log holds all of them."""
    recording = recording_of(replace(raw, plan=plan))
    few = independent_joints(recording, lib)
    if few is recording:
        return raw, plan, []
    names = recording.joint_names or lib.all_joint_names
    if few.n_joints == recording.n_joints:
        if few.joint_names == names or few.joint_names != lib.joint_names:
            return raw, plan, []
        places = [names.index(name) for name in renamed_joints(names, lib.joint_names)]
        return raw, plan.reordered(places, lib.joint_names), []
    places = [names.index(name) for name in lib.joint_names]
    if recording.tau is not None:
        others = np.abs(np.delete(recording.tau, places, axis=1))
        if others.max(initial=0.0) > _PASSIVE * np.abs(recording.tau).max():
            raise IdentificationError(_refusal(lib, "torques act on joints that follow others"))
    signals, count = plan.signals(), recording.n_joints
    if any(len(signal.columns) != count or signal.order for signal in signals.values()):
        raise IdentificationError(_refusal(lib, "its columns have no names of their own"))
    changes = {
        kind: replace(signal, columns=tuple(signal.columns[k] for k in places))
        for kind, signal in signals.items()
    }
    sentence = (
        f"the log holds all {recording.n_joints} joints, of which those of q are checked: "
        f"{', '.join(lib.joint_names)}; the positions of the others agree with the mechanism"
    )
    tables = {
        kind: replace(table, values=table.values[:, places]) if kind in changes else table
        for kind, table in raw.tables.items()
    }
    changed = replace(raw, tables=tables)
    return changed, plan.replace(**changes), [Finding("all_joints", INFO, sentence)]


def _refusal(lib: Library, reason: str) -> str:
    return (
        f"the log holds all joints of '{lib.name}', and {reason}; identify reads it as it is, but "
        f"inspect checks the independent joints: name the columns of {', '.join(lib.joint_names)} "
        "in a recipe"
    )


def with_gain_one(raw: Raw, plan: Recipe) -> tuple[Raw, Recipe]:
    """The log with currents counted as torques of gain 1."""

    def known(recipe: Recipe) -> Recipe:
        if recipe.torque is None or not recipe.has_unknown_gains:
            return recipe
        return recipe.replace(torque=replace(recipe.torque, gain=1.0))

    recipe = None if raw.recipe is None else known(raw.recipe)
    return replace(raw, plan=known(raw.plan), recipe=recipe), known(plan)


def stated(plan: Recipe, findings: list[Finding]) -> Checked:
    """The recipe without gains, and "current_gains" in place of the finding on the unit."""
    seen = next((each for each in findings if each.kind == "torque_unit"), None)
    rest = [each for each in findings if each.kind != "torque_unit"]
    sentence = (
        "the torque is a motor current in A with unknown gains: identify estimates them "
        "with the masses of the URDF as prior and states what remains undetermined; symgen gains "
        "fixes the common factor by --total-mass, the setting weighed or a known payload"
    )
    evidence = {} if seen is None else dict(seen.evidence)
    stated_gains = Finding("current_gains", INFO, sentence, evidence)
    torque = None if plan.torque is None else replace(plan.torque, gain=None)
    return plan.replace(torque=torque), [*rest, stated_gains]


_CLOCK_STUB = """[time]
# The rate of the logger, which the files do not contain:
# rate_hz ="""
MOST_FILES = 12  # files of a folder whose columns a skeleton lists


def recipe_text(inspection: Inspection) -> str:
    """TOML of the proposed recipe; its comments are to be read before it is used."""
    plan = inspection.plan
    blind = any(f.kind == "missing_clock" and f.level == ERROR for f in inspection.findings)
    todo = inspection.of_level(ERROR, WARNING)
    what = "its findings:" if todo else "it found nothing wrong."
    lines = [f"# Proposed by python -m runtime inspect; {what}"]
    for finding in todo:
        text = f"{finding.level}: {finding.sentence}"
        lines += textwrap.wrap(text, 96, initial_indent="#   ", subsequent_indent="#     ")
    text = recipe_file.recipe_text(plan.replace(name="", source=Source()))
    for block in text.strip("\n").split("\n\n"):
        if block != "[split]":  # the usual one
            lines += ["", _CLOCK_STUB if blind and block.startswith("[time]") else block]
    if any(f.kind == "position_range" for f in inspection.findings) and not plan.gear:
        lines += _gear_stub(len(inspection.recording.q[0]))
    return "\n".join(lines) + "\n"


def skeleton_text(log: str, joints: Sequence[str]) -> str:
    """TOML of a recipe to be filled in, with the columns or arrays of the file as comments."""
    place = locate(log)
    file: tuple[str, ...] = () if place.is_file() else ('file = "…"',)
    more = file
    named = ", ".join("…" for _ in joints)
    lines = [f"# Columns and units of {place.name} were not understood; state them, then identify."]
    files = LogFiles(place, Recipe())
    names = [place.name] if place.is_file() else sorted(p.name for p in place.iterdir())
    for name in (each for each in names[:MOST_FILES] if format_of_suffix(each)):
        reader = files.reader(name, "")
        arrays = [f"{key}  {list(shape)}" for key, shape in reader.arrays().items()]
        rows = reader.head()[:2]
        cells = [
            f"{k}  {'  '.join(column)}"[:96] for k, column in enumerate(zip(*rows, strict=False))
        ]
        if named != '"…"' and any(numbers_in(cell) for row in rows for cell in row):
            more = (*more, f'cells = "{JSON_CELLS}"')  # each signal is one column of lists
            named = '"…"'
        lines += [f"# {name} holds:", *(f"#   {each}" for each in arrays or cells)]
    order = f"Columns stand in the order of the joints: {', '.join(joints)}. Where the log lacks"
    order += " some, build the robot without them: --base, --tip, --lock."
    lines += textwrap.wrap(order, 96, initial_indent="# ", subsequent_indent="#   ")
    tables = {
        "time": (*file, "column = 0", 'unit = "s"'),
        "position": (f"columns = [{named}]", *more, 'unit = "rad"'),
        "torque": (f"columns = [{named}]", *more, 'unit = "N*m"'),
    }
    for name, keys in tables.items():
        lines += ["", f"# [{name}]", *(f"# {key}" for key in keys)]
    return "\n".join(lines) + "\n"


def _gear_stub(n: int) -> list[str]:
    rows = [
        "#     [" + ", ".join("1.0" if i == j else "0.0" for j in range(n)) + "]," for i in range(n)
    ]
    return [
        "",
        "# If these are motor angles and motor torques, take the gears from the manufacturer.",
        "# Write R of q_motor = R q_joint (the row of a motor that turns with another joint has",
        "# two entries), and under [position] the offset of the zero of each joint, in rad; then",
        "# inspect again with --recipe, which proposes the filter and the friction, too.",
        "# [gear]",
        "# matrix = [",
        *rows,
        "# ]",
    ]
