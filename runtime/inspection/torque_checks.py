"""Checks of the torque in their order: columns, signs, unit, gravity, delay, fit of the model.

Proposed is the first preparation that predicts within `WORSE` of the best in cross-validation and
whose accelerations pass the check of `regressor_choice`; where none does, the regressor of
momentum, which needs no accelerations.
"""

from collections.abc import Callable
from dataclasses import replace

from runtime.errors import RuntimeFault
from runtime.estimators.choice import regressor_choice
from runtime.estimators.regression.causes import Causes
from runtime.inspection.checks import column_faults, drives, gravity, model_fit, signals
from runtime.inspection.checks.torque_rows import TorqueRows, rough, scale, torque_rows_of
from runtime.inspection.finding import INFO, WARNING, Checked, Finding, joint_list
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recipe, Recording, Split
from runtime.recording.friction.columns import ROTOR
from runtime.recording.friction.model import DRIVE
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.reader import Raw, recording_of
from runtime.recording.rest_speeds import as_rest_speed
from runtime.recording.settings import names_where

_LOWERED = 5  # largest number of lower cut-offs that are tried
WORSE = 0.05  # excess of a candidate's score over the best up to which it may replace the choice
ROTORS = 0.7  # residual with rotor inertia over that without, below which checks of τ include it
_STEPS = (1, 2, 4, 5, 10, 20, 25, 40, 50, 100, 200, 250, 400, 500, 1000)  # factors of decimation


class CheckRun:
    """The plan so far, the recording read with it, and the findings."""

    def __init__(
        self, raw: Raw, plan: Recipe, lib: Library, findings: list[Finding], *, has_gains: bool
    ) -> None:
        """Read the log with the plan."""
        self._raw, self.plan, self.lib, self.findings = raw, plan, lib, findings
        self.has_gains = has_gains
        self.recording = recording_of(replace(raw, plan=plan))
        self._prepared: tuple[Recording, Preparation, Friction, TorqueRows] | None = None

    def run(self, check: Callable[[Recording, Recipe, Library], Checked]) -> None:
        """Run a check, and read the log again where it changes the plan."""
        plan, findings = check(self.recording, self.plan, self.lib)
        self.findings += findings
        if plan != self.plan:
            self.plan = plan
            self.recording = recording_of(replace(self._raw, plan=plan))

    def run_on_torque(
        self, check: Callable[[TorqueRows, Recipe], Checked], terms: Friction
    ) -> None:
        """Run a check of the torque on prepared rows."""
        torque_rows = self.torque_rows(terms)
        self.run(lambda _, plan, __: check(torque_rows, plan))

    def torque_rows(self, terms: Friction) -> TorqueRows:
        """Prepared rows of the recording, read with the plan so far; most checks change nothing."""
        usual, last = rough(self.recording, self.plan.preparation), self._prepared
        if last is None or last[0] is not self.recording or last[1:3] != (usual, terms):
            rows = torque_rows_of(self.recording, self.lib, usual, terms)
            last = self._prepared = (self.recording, usual, terms, rows)
        return last[3]

    def regressor(self, usual: Preparation) -> None:
        """Warn of accelerations that fail with a preparation."""
        _, failing = regressor_choice.choose_regressor(self.recording, self.lib, usual)
        self.findings += [Finding("differentiation", WARNING, each) for each in failing]


def check_torque(checks: CheckRun, propose: bool) -> None:
    """Order, sign and unit of τ, then its fit to the model."""
    lib, terms = checks.lib, checks.plan.friction or proposed_terms(checks.plan)
    try:
        if not lib.placeholders:  # comparisons with the torque of the URDF's links
            checks.run_on_torque(column_faults.column_faults, terms)
            _merge_orders(checks)
            terms = _with_rotors(checks, terms)
            checks.run_on_torque(scale, terms)
            _judge_reversal(checks, terms)
        checks.findings += _placeholders(lib)
        preparation = checks.plan.preparation
        if propose and preparation.filter == "none":
            ready, notes = proposed_preparation(
                checks.recording, lib, preparation, checks.plan.split, terms
            )
            checks.plan = checks.plan.replace(preparation=ready)
            checks.findings += notes
        checks.regressor(rough(checks.recording, checks.plan.preparation))
        if any(f.kind == "gravity" for f in checks.findings):
            return  # the model of the log is another one
        _check_fit(checks, terms)
    except RuntimeFault as fault:
        sentence = f"the torque could not be checked: {fault}"
        # Poses at rest need no accelerations: nothing is wrong with their log.
        posed = any(f.kind == "static_poses" for f in checks.findings)
        checks.findings.append(Finding("not_judged", INFO if posed else WARNING, sentence))


def _with_rotors(checks: CheckRun, terms: Friction) -> Friction:
    """Friction columns with rotors, where these take a part of what links and friction leave."""
    if checks.plan.friction is not None or ROTOR.name in terms.columns:
        return terms
    if checks.has_gains:
        shares = drives.shares_of(checks.recording, checks.lib, checks.plan.preparation)
        if shares is None or shares.drives > ROTORS * shares.friction:
            return terms
    return replace(terms, columns=(*terms.columns, ROTOR.name))


def _judge_reversal(checks: CheckRun, terms: Friction) -> None:
    """Gravity against the sign of all torques; where that is silent, what the columns showed."""
    common = [f for f in checks.findings if f.evidence.get("common")]
    before = len(checks.findings)
    checks.run_on_torque(gravity.gravity, terms)
    if any(f.kind in {"gravity", "torque_sign"} for f in checks.findings[before:]):
        for each in common:
            checks.findings.remove(each)
    elif any(f.kind == "torque_sign" for f in common):
        checks.run(lambda _, plan, __: (gravity.negated(plan), []))


def _merge_orders(checks: CheckRun) -> None:
    """One finding where all signals were put into another order, and one of them back again."""
    kinds = {f.kind: f for f in checks.findings if f.kind.endswith("_order")}
    torque, position = checks.plan.torque, checks.plan.position
    if "joint_order" not in kinds or torque is None or position is None:
        return
    usual = tuple(range(checks.lib.n_joints))
    if torque.order == usual and position.order:
        kind, again, order = "position_order", "torque_order", list(position.order)
        what, where = "positions and velocities", "[position] and [velocity]"
        others = "torques, whose order is right"
    elif position.order == usual and torque.order:
        kind, again, order = "torque_order", "position_order", list(torque.order)
        what, where, others = "torques", "[torque]", "positions, whose order is right"
    else:
        return
    if again not in kinds:
        return
    moved = [j for j, column in enumerate(order) if column != j]
    sentence = (
        f"the {what} of {joint_list(checks.lib.joint_names, moved)} are exchanged: in the order "
        f"{', '.join(map(str, order))} (counted from 0) they fit limits, gravity and the {others}; "
        f"compare with the logger, and set order = {order} under {where}"
    )
    first = checks.findings.index(kinds["joint_order"])
    checks.findings.remove(kinds[again])
    checks.findings[first] = Finding(kind, WARNING, sentence, {"joints": moved, "order": order})


def check_commanded(checks: CheckRun) -> None:
    """Law, delay and drives of a commanded torque; unit, sign and order are those of the law."""
    lib = checks.lib
    checks.findings += drives.commanded(checks.recording, checks.plan)
    try:
        if not lib.placeholders:
            checks.run(drives.law_gain)
            before = len(checks.findings)
            checks.run_on_torque(column_faults.column_faults, Friction(DRIVE))
            if any(f.level == WARNING for f in checks.findings[before:]):
                return  # delay and drives are those of other columns
            terms = drives.friction_of(checks.recording, lib, checks.plan)
            checks.run(lambda r, p, lib: drives.delay(r, lib, p, terms))
            checks.findings += drives.rotor(checks.recording, lib, checks.plan, terms)
            if checks.plan.friction is None and terms != Friction(DRIVE):
                checks.plan = checks.plan.replace(friction=terms)
        checks.findings += _placeholders(lib)
        usual = drives.filtered(checks.recording, checks.plan.preparation)
        if checks.plan.preparation.filter == "none":
            usual = replace(usual, cutoff_hz=_harmless_cutoff(checks.recording, lib, usual))
            late = checks.plan.preparation.torque_delay_s
            checks.plan = checks.plan.replace(preparation=replace(usual, torque_delay_s=late))
        checks.regressor(usual)
        checks.findings.append(model_fit.one_run(checks.recording.duration))
    except RuntimeFault as fault:
        sentence = f"the torque could not be checked: {fault}"
        checks.findings.append(Finding("not_judged", WARNING, sentence))


def _placeholders(lib: Library) -> list[Finding]:
    """Note on links without inertials, whose placeholders no torque can be compared with."""
    if not lib.placeholders:
        return []
    sentence = (
        f"{len(lib.placeholders)} links of the URDF have no <inertial> but placeholders "
        f"({', '.join(lib.placeholders[:4])}{', …' if len(lib.placeholders) > 4 else ''}): order, "
        "sign, unit and gravity of τ cannot be compared with such a model and were not checked; "
        "build with the setting masses, or check them by hand"
    )
    return [Finding("placeholders", INFO, sentence, {"links": list(lib.placeholders)})]


def _harmless_cutoff(recording: Recording, lib: Library, usual: Preparation) -> float | None:
    """Cut-off of the proposal [Hz], lowered step by step where noise remains: motion goes too."""
    tried = usual
    for _ in range(_LOWERED):
        quality = regressor_choice.differentiation_of(recording, lib, tried)
        if quality is None or not quality.fails:
            return tried.cutoff_hz
        if quality.harmless_hz >= quality.cutoff_hz:
            break
        # Rounded to two digits, hardly ever up.
        tried = replace(tried, cutoff_hz=float(f"{0.98 * quality.harmless_hz:.2g}"))
    return usual.cutoff_hz


def _check_fit(checks: CheckRun, terms: Friction) -> None:
    """Delay of τ, whether it was measured, and what the model lacks."""
    lib, torque_rows = checks.lib, checks.torque_rows(terms)
    fit = model_fit.fitted(torque_rows)
    tau = checks.recording.required("tau")
    computed = model_fit.not_measured(torque_rows, fit, tau)
    # A tilt is one against the gravity of known links, a gain one of known masses.
    is_known = checks.has_gains and not (computed or lib.placeholders)
    causes = model_fit.causes_left(torque_rows, fit) if is_known else Causes()
    gain = model_fit.explained(torque_rows, causes)
    late: list[Finding] = []
    if not computed and all(f.kind != "torque_gain" for f in gain):
        given = (checks.recording, lib, checks.plan, terms)
        late = drives.delay_of_measured(*given, has_gains=checks.has_gains)
    before = checks.plan
    if any(finding.kind == "time_shift" for finding in late):
        delay_s = float(f"{late[0].evidence['delay_s']:.3g}")
        shifted = replace(checks.plan.preparation, torque_delay_s=delay_s)
        checks.plan = checks.plan.replace(preparation=shifted)
        torque_rows = checks.torque_rows(terms)
        fit = model_fit.fitted(torque_rows)
        computed = model_fit.not_measured(torque_rows, fit, tau)
        # What a tilt or a zero explained may have been the delay.
        causes = model_fit.causes_left(torque_rows, fit) if is_known else causes
        gain = model_fit.explained(torque_rows, causes) if gain else []
    limbs = model_fit.beside_limbs(torque_rows) if is_known else []
    if not any(f.kind == "torque_gain" for f in gain):
        of_limbs = model_fit.gain_of_limbs(lib, limbs)
        gain = model_fit.gain_by_slope(torque_rows, causes) or of_limbs or gain
    strange = model_fit.unexplained(torque_rows, fit, has_gains=checks.has_gains)
    if strange:  # what no bodies explain at any delay has none
        checks.plan, late = before, [each for each in late if each.kind != "time_shift"]
    checks.findings += late + strange + computed
    torque = checks.plan.torque
    guessed = torque is not None and torque.unit == "A" and not checks.plan.gear
    guessed = guessed and any(f.kind == "torque_unit" for f in checks.findings)
    guessed = guessed or not checks.has_gains
    if checks.has_gains and not guessed and not lib.placeholders:
        checks.findings += model_fit.hidden_gains(torque_rows, causes, limbs)
    if not strange and not guessed:  # wrong gains look like a tool or a coupling
        checks.findings += gain
        accused = any(f.level == WARNING for f in gain)
        no_tool = bool(accused or lib.placeholders)
        tool = [] if no_tool else model_fit.tool(torque_rows)
        coupled = [] if accused else model_fit.coupling(torque_rows, fit, terms)
        other = [] if no_tool or tool else model_fit.other_robot(torque_rows, fit)
        checks.findings += tool + coupled + other
    checks.findings.append(model_fit.one_run(torque_rows.whole.duration))


def proposed_terms(plan: Recipe) -> Friction:
    """Friction columns to propose, with those of motors where the gear couples them."""
    if plan.law is not None:
        return Friction(DRIVE)
    coupled = any(x != 0.0 for i, row in enumerate(plan.gear) for j, x in enumerate(row) if i != j)
    motors = (ROTOR.name, *names_where(lambda column: column.of_motors))
    return Friction(columns=(*Friction().columns, *(motors if coupled else ())))


def proposed_preparation(
    recording: Recording,
    lib: Library,
    preparation: Preparation,
    split: Split | None,
    terms: Friction,
) -> tuple[Preparation, list[Finding]]:
    """Choose cut-off, derivative and regressor."""
    choice = regressor_choice.choose_cutoff(recording, lib, preparation, split, terms)
    findings = [Finding("cutoff", INFO, choice.sentence)]
    seen = before_test(recording, split)
    for ready in _candidates(choice):
        quality = regressor_choice.differentiation_of(seen, lib, ready)
        if quality is None or not quality.fails:
            if ready != choice.preparation:
                findings.append(_instead(ready, choice))
            return _thinned(ready, recording, lib), findings
    taken, sentences = regressor_choice.choose_regressor(
        seen, lib, choice.preparation, replaces=True
    )
    findings += [Finding("regressor", INFO, each) for each in sentences]
    return _thinned(taken or choice.preparation, recording, lib), findings


def _candidates(choice: regressor_choice.CutoffChoice) -> list[Preparation]:
    """The chosen preparation, then those of the others that predict nearly as well."""
    best = min(c.score for c in choice.candidates)
    near = [c for c in choice.candidates if c.score <= (1.0 + WORSE) * best]
    ready = choice.preparation
    # Trimmed edges follow the cut-off, unless the recipe states them.
    usual_trim = ready.trim_s == 1.0 / choice.chosen.cutoff_hz
    others = [
        replace(
            ready,
            cutoff_hz=c.cutoff_hz,
            derivative=c.derivative,
            trim_s=1.0 / c.cutoff_hz if usual_trim else ready.trim_s,
        )
        for c in sorted(near, key=lambda c: c.score)
    ]
    return [ready, *(each for each in others if each != ready)]


def _instead(ready: Preparation, choice: regressor_choice.CutoffChoice) -> Finding:
    """The note that another candidate is proposed."""
    from_q = " with velocities from q" * (ready.derivative == "position")
    sentence = (
        f"a cut-off of {ready.cutoff_hz:g} Hz{from_q} is proposed instead of "
        f"{choice.chosen.cutoff_hz:g} Hz, at which differentiation fails; it predicts nearly as "
        "well"
    )
    return Finding("regressor", INFO, sentence)


def _thinned(ready: Preparation, recording: Recording, lib: Library) -> Preparation:
    """A preparation decimated to the rate of its band; rest goes unless little would be left."""
    grid = ready.grid_hz or (1.0 / ready.clock_tick if ready.clock_tick else recording.rate_hz)
    most = grid / (regressor_choice.ROWS_PER_CUTOFF * (ready.cutoff_hz or grid))
    step = max(k for k in _STEPS if k <= max(most, 1.0))
    moves = signals.moving_joints(recording, lib).any(axis=1).mean() > 1.0 - signals.MOSTLY
    return replace(
        ready,
        trim_s=float(f"{ready.trim_s:.2g}") if ready.trim_s else None,
        rate_hz=float(f"{grid / step:.6g}") if step > 1 else None,
        rest_speed=ready.rest_speed or (as_rest_speed(lib) if moves else None),
    )
