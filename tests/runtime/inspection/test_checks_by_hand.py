"""Checks of one signal each, on rows small enough that the result is known by hand."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from runtime.estimators.choice.regressor_choice import CutoffCandidate, CutoffChoice
from runtime.estimators.contradictions import sentence_of
from runtime.estimators.regression.causes import Cause, Causes
from runtime.estimators.regression.recorded_delay import DelayProfile
from runtime.inspection import torque_checks as proposal
from runtime.inspection.checks import drives, model_fit, torque_rows
from runtime.inspection.checks.clock import _gaps, lost_rows
from runtime.inspection.checks.column_faults import mismatches
from runtime.inspection.checks.drives import rotor
from runtime.inspection.checks.file_layout import _untitled
from runtime.inspection.checks.gravity import _finding, _Fit
from runtime.inspection.checks.outlying_rows import frozen
from runtime.inspection.checks.units import units
from runtime.inspection.finding import INFO, Finding
from runtime.inspection.inspection import stated
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recipe, Recording
from runtime.recording.friction.model import DRIVE
from runtime.recording.recipes.recipe import Signal, Time
from tests.runtime.signals import sine

PLAN = Recipe(time=Time(unit="s"), position=Signal("rad"), torque=Signal("N*m"))


def test_signals_that_stop_while_the_arm_moves_on(double: Library) -> None:
    """Oracle: rows 100 to 199 keep their value: seen by the step of q behind, or by q itself."""
    t = np.arange(600) / 100.0
    index = np.where((np.arange(600) >= 100) & (np.arange(600) < 200), 100, np.arange(600))
    q, tau = np.sin(t)[:, None], np.cos(t)[:, None]
    for stopped, signals in ((q[index], ["q", "tau"]), (q, ["tau"])):
        log = Recording(t=t, q=stopped, tau=tau[index])
        plan, (finding,) = frozen(log, Recipe(), double)
        assert finding.evidence == {"spans_s": [[1.0, 1.99]], "signals": [signals]}
        assert plan.leave_out == ((1.0, 1.99),)
    # The arm stood still: q goes on from where it was.
    rest = np.sin(np.where(t < 1.0, t, np.where(t < 2.0, 1.0, t - 1.0)))[:, None]
    assert frozen(Recording(t=t, q=rest, tau=rest), Recipe(), double)[1] == []


@pytest.mark.parametrize("with_velocity", [True, False])
def test_lost_rows_are_counted(with_velocity: bool) -> None:
    """Oracle: every 50th row lost: 79 of the 80 lie between rows, of 3919 steps of the clock."""
    whole = sine(0.2, seconds=4.0)
    whole = whole if with_velocity else whole.replace(dq=None)
    kept = np.arange(4000) % 50 != 49
    log = whole.take(kept, "").replace(t=whole.t[: kept.sum()])
    (finding,) = lost_rows(log)
    assert finding.evidence["share"] == pytest.approx(79 / 3919, rel=0.02)
    assert lost_rows(whole) == []


def test_order_of_the_joints_by_gravity(lib: Library) -> None:
    """Oracle: torque proportional to gravity leaves nothing in its order alone."""
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (20, 7)) + lib.home
    still = np.zeros_like(q)
    tau = 3.0 * lib.inverse_dynamics(q, still, still, lib.pi0)
    orders = np.array([[1, 0, 2, 3, 4, 5, 6], [0, 1, 2, 3, 4, 5, 6], [0, 3, 2, 1, 4, 5, 6]])
    found = mismatches(q, tau, orders, lib)
    assert found[1] < 1e-7  # sqrt(1 − cos²) of rounding 1e-16
    assert (found[[0, 2]] > 0.2).all()


@pytest.mark.parametrize(
    ("time", "clock", "speed", "kinds"),
    [
        (Time(unit="s"), 1.0, 1.0, []),
        (Time(rate_hz=1000.0), 1.0, 180 / np.pi, ["velocity_unit"]),
        (Time(unit="s"), 1e3, 1.0, ["time_unit"]),
        (Time(unit="s"), 1e3, 180 / np.pi, ["time_unit", "velocity_unit"]),
        (Time(unit="s"), 1.0, 3.0, ["velocity_scale"]),
        (Time(rate_hz=1000.0), 1.0, -3.0, ["velocity_scale"]),
    ],
)
def test_units_of_time_and_velocity(lib, clean, time, clock, speed, kinds) -> None:
    """Oracle: the units that the log was written in, each changed alone and both together."""
    head = clean.take(slice(2000), "")
    dq = np.gradient(head.q, head.t, axis=0)
    log = Recording(t=clock * head.t, q=head.q, dq=speed * dq)
    plan = Recipe(time=time, position=Signal(unit="rad"), velocity=Signal(unit="rad/s"))
    done, findings = units(log, plan, lib)
    assert [each.kind for each in findings] == kinds
    assert done.time.unit == ("ms" if clock > 1 else time.unit)
    assert done.velocity.unit == ("deg/s" if speed > 50 else "rad/s")


def test_joints_without_limits_may_turn_many_times(double: Library) -> None:
    """Oracle: an elbow that turns six times is in rad, because τ resembles its gravity torque; the
    same log in degrees is named as such.
    """
    t = np.arange(2000) / 200.0
    q = np.column_stack([0.5 * np.sin(t), 2 * np.pi * 0.6 * t + 0.3 * np.sin(3 * t)])
    dq = np.gradient(q, t, axis=0)
    log = Recording(t=t, q=q, dq=dq, tau=double.inverse_dynamics(q, dq, 0 * q, double.pi0))
    plan = Recipe(time=Time(unit="s"), position=Signal(unit="rad"), velocity=Signal(unit="rad/s"))
    assert units(log, plan, double)[1] == []
    _, findings = units(log.replace(q=np.degrees(q), dq=np.degrees(dq)), plan, double)
    assert findings[0].kind in {"position_unit", "position_range"}


def test_the_longest_gap_is_one_that_counts() -> None:
    """Oracle: of gaps of 1 s and 9 s the second is across rows that the recipe leaves out."""
    t = np.concatenate([np.arange(100) / 100, 2 + np.arange(100) / 100, 12 + np.arange(100) / 100])
    is_logged = np.arange(len(t) - 1) != 199
    (finding,) = _gaps(t, is_logged, INFO)
    assert finding.evidence["count"] == 1
    assert finding.evidence["longest_s"] == pytest.approx(1.01)


def test_currents_without_gains_keep_the_other_findings() -> None:
    """Oracle: the finding on the unit gives its numbers to that on gains; the others stay."""
    other = Finding("rest", INFO, "at rest")
    unit = Finding("torque_unit", INFO, "currents", {"slopes": [2.0]})
    torque = Signal(unit="A", gain=1.0)
    plan = Recipe(time=Time(unit="s"), position=Signal(unit="rad"), torque=torque)
    plan, findings = stated(plan, [unit, other])
    assert [each.kind for each in findings] == ["rest", "current_gains"]
    assert findings[1].evidence == {"slopes": [2.0]}
    assert plan.torque is not None
    assert plan.torque.gain is None


def unfitted(rows: SimpleNamespace) -> model_fit.UnconstrainedFit:
    """A fit that leaves the whole torque."""
    tau = rows.samples.tau.ravel()
    return model_fit.UnconstrainedFit(np.zeros((tau.size, 1)), tau)


@pytest.mark.parametrize(
    ("slope", "tested", "is_reported"),
    [(1.6, 1.5, True), (0.6, 0.7, True), (1.6, 0.7, False), (0.6, 1.5, False), (1.3, 1.5, False)],
)
def test_gain_of_one_joint(monkeypatch, slope, tested, is_reported) -> None:
    """Oracle: reported where the slope differs by 1.4 or more, on the side of the test."""
    best = Cause("gain", 1, tested - 1, 0.01, 0.2, 99.0, 15.0)
    slopes = np.array([2.0, 2.0 * slope, 2.0]), np.ones(3, dtype=bool)
    monkeypatch.setattr(model_fit, "slopes_to_model", lambda _: slopes)
    robot = SimpleNamespace(n_joints=3, joint_names=("a", "b", "c"), pi0=np.zeros(30))
    rows = SimpleNamespace(lib=robot, samples=SimpleNamespace(tau=np.ones((4, 3))))
    findings = model_fit.explained(rows, Causes((best,)))
    assert [each.evidence["gain"] for each in findings] == ([slope] if is_reported else [])


@pytest.mark.parametrize(
    ("slopes", "sigma", "is_named", "is_hidden"),
    [
        ((1.5, 1.1, 1.2, 1.2), 0.8, False, False),
        ((1.5, 2.8, 1.2, 1.2), 0.8, True, False),
        ((1.5, 0.4, 1.2, 1.2), 0.8, True, False),
        ((1.5, 2.8, 1.2, 1.2), 0.01, False, False),  # the residual would show it
        ((2.0, 2.8, 0.9, 1.2), 0.8, False, True),  # the others do not agree
        ((1.5, 2.8, 1.2, 0.0), 0.8, False, True),  # nor are they enough
        ((1.5, 2.8, 1.2, 0.0), 0.01, False, False),
    ],
)
def test_a_gain_that_the_residual_leaves_open(
    monkeypatch, slopes, sigma, is_named, is_hidden
) -> None:
    """Oracle: a leg, whose free bodies explain any gain, has the slopes of the URDF alone."""
    each = tuple(Cause("gain", j, 0.1, sigma, 0.2, 0.1, 15.0) for j in range(4))
    used = np.array(slopes), np.array(slopes) > 0
    monkeypatch.setattr(model_fit, "slopes_to_model", lambda _: used)
    robot = SimpleNamespace(n_joints=4, joint_names=("a", "b", "c", "d"))
    whole = SimpleNamespace(required=lambda _: np.ones((4, 4)))
    rows = SimpleNamespace(lib=robot, whole=whole)
    named = model_fit.gain_by_slope(rows, Causes(each))
    assert [f.evidence["joint"] for f in named] == [1] * is_named
    hidden = [j for f in model_fit.hidden_gains(rows, Causes(each)) for j in f.evidence["joints"]]
    assert (1 in hidden) == is_hidden


@pytest.mark.parametrize(
    ("gain", "rotors", "drag", "named"),
    [
        (1.0, (1.0, 1.0, 1.0, 1.0), 1.0, {}),
        (2.0, (1.0, 1.1, 0.9, 1.0), 1.0, {1: 2.1}),
        (0.5, (1.0, 1.0, 1.0, 1.0), 1.0, {1: 0.5}),
        (1.0, (1.0, 2.0, 1.0, 1.0), 1.0, {}),  # only the rotor differs, no gain
        (1.0, (1.0, 1.0, 1.0, 1.0), 2.0, {}),  # only friction
        (2.0, (1.0, 1.0, 0.5, 1.0), 1.0, {}),  # the rotors of the others do not agree
    ],
)
def test_a_gain_beside_other_limbs(monkeypatch, gain, rotors, drag, named) -> None:
    """Oracle: the torque of joint 1, of four legs of one joint, times a gain.

    The bodies of the URDF explain none of it, as at the calf of a Go2.
    """
    t = np.arange(600) / 100.0
    dq = np.sin(np.outer(t, [3.0, 3.1, 2.9, 3.0])) + np.sin(np.outer(t, [7.0, 7.5, 8.0, 7.2]))
    ddq = np.gradient(dq, t, axis=0)
    factors = np.array([1.0, gain, 1.0, 1.0])
    tau = factors * (0.02 * np.array(rotors) * ddq + 0.3 * np.array([1, drag, 1, 1]) * dq)
    monkeypatch.setattr(model_fit, "slopes_to_model", lambda _: (np.ones(4), np.zeros(4, bool)))
    joints = [SimpleNamespace(parent=-1, effort=24.0) for _ in range(4)]
    robot = SimpleNamespace(
        n_joints=4,
        joint_names=("a", "b", "c", "d"),
        pi0=np.tile(np.r_[0.2, np.zeros(9)], 4),
        manifest=SimpleNamespace(all_joints=joints),
    )
    samples = SimpleNamespace(dq=dq, ddq=ddq, tau=tau)
    model = np.zeros_like(tau), 1e-3 * np.sin(np.outer(t, [1.0, 1.1, 1.2, 1.3]))
    whole = SimpleNamespace(required=lambda _: tau)
    rows = SimpleNamespace(lib=robot, samples=samples, model_torque=lambda: model, whole=whole)
    limbs = model_fit.beside_limbs(rows)
    found = model_fit.gain_of_limbs(robot, limbs)
    # The mean of 2.2 by the rotor and 2 by friction is 2.1.
    assert {f.evidence["joint"]: f.evidence["gain"] for f in found} == pytest.approx(
        named, rel=0.05
    )
    hidden = [f.evidence["joints"] for f in model_fit.hidden_gains(rows, Causes(), limbs)]
    assert any(1 in joints for joints in hidden) == (len(limbs[1]) < 2)


@pytest.mark.parametrize(("share", "kinds"), [(0.02, ["gain_error"]), (0.2, [])])
def test_a_small_gain_is_stated_as_by_identify(lib, monkeypatch, share, kinds) -> None:
    """Property: the words of `identify`, as a note; a large one needs the slope of the URDF."""
    best = Cause("gain", 1, 0.02, 0.01, share, 99.0, 15.0)
    monkeypatch.setattr(model_fit, "slopes_to_model", lambda _: (np.ones(7), np.ones(7, bool)))
    rows = SimpleNamespace(lib=lib, samples=SimpleNamespace(tau=np.ones((4, 7))))
    findings = model_fit.explained(rows, Causes((best,)))
    assert [each.kind for each in findings] == kinds
    for each in findings:
        assert each.level == INFO
        assert sentence_of(lib, (best,)) in each.sentence


def test_gear_that_couples_two_joints(monkeypatch) -> None:
    """Oracle: residuals that are the speed of the other joint; none where one has no residual."""
    monkeypatch.setattr(model_fit, "inflation_of", lambda *_: 1.0)
    t = np.arange(400) / 100.0
    dq = np.stack([np.sin(2 * np.pi * t), np.sin(5 * np.pi * t)], axis=1)
    ddq = np.gradient(dq, t, axis=0)
    robot = SimpleNamespace(n_joints=2, joint_names=("a", "b"))
    for size, count in ((1.0, 1), (0.0, 0)):
        samples = SimpleNamespace(tau=dq[:, ::-1] * [size, 1.0], dq=dq, ddq=ddq)
        rows = SimpleNamespace(lib=robot, samples=samples)
        findings = model_fit.coupling(rows, unfitted(rows), Friction())
        assert len(findings) == count
        for each in findings:
            assert each.evidence["pairs"] == [[0, 1, pytest.approx(1.0)]]


@pytest.mark.parametrize(("seconds", "searched"), [(4.0, 0.4), (30.0, 1.0)])
def test_delay_of_a_parabola(monkeypatch, seconds, searched) -> None:
    """Oracle: a profile of σ = 2.5 ms about 100 ms; the reach is a tenth, at most 1 s."""
    delays, reaches = np.linspace(0.0, 0.2, 101), []
    profile = DelayProfile(delays, ((delays - 0.1) / 0.0025) ** 2 / 2, 0.1, (0.0951, 0.1049), 0.8)

    def given(*arguments: object, has_gains: bool) -> DelayProfile:
        reaches.append(arguments[4])
        return profile

    monkeypatch.setattr(drives, "recorded_delay", given)
    log = sine(1.0, rate=100.0, seconds=seconds + 0.01)
    shift, stated_delay = drives.delay_of_measured(log, None, Recipe(), Friction())
    assert shift.evidence["delay_s"] == 0.1
    assert shift.evidence["sigma_s"] == pytest.approx(0.0025, rel=1e-2)
    assert shift.evidence["searched_s"] == pytest.approx(searched)
    assert reaches == [pytest.approx(searched)]
    assert stated_delay.evidence["interval_s"] == [0.0951, 0.1049]
    known = Recipe(preparation=Preparation(torque_delay_s=0.0995))
    assert [f.kind for f in drives.delay_of_measured(log, None, known, Friction())] == ["delay"]


@pytest.mark.parametrize("again", ["torque", "position"])
def test_two_orders_of_one_exchange(again) -> None:
    """Property: all columns exchanged and one kind of them back is an exchange of the others."""
    orders = {"torque": (1, 0), "position": (1, 0), again: (0, 1)}
    signals = {key: replace(getattr(PLAN, key), order=order) for key, order in orders.items()}
    findings = [Finding(f"{kind}_order", "warning", "") for kind in ("joint", again)]
    lib = SimpleNamespace(n_joints=2, joint_names=("a", "b"))
    run = SimpleNamespace(findings=findings, plan=PLAN.replace(**signals), lib=lib)
    proposal._merge_orders(run)
    (only,) = run.findings
    other = {"torque": "position", "position": "torque"}[again]
    assert (only.kind, only.evidence["order"]) == (f"{other}_order", [1, 0])


@pytest.mark.parametrize("silent", [False, True])
def test_a_common_sign_where_gravity_is_silent(monkeypatch, silent) -> None:
    """Property: what gravity shows replaces the finding of the columns, else τ is negated."""
    common = Finding("torque_sign", "warning", "", {"common": True})
    run = proposal.CheckRun.__new__(proposal.CheckRun)
    run.findings, run.plan = [common], PLAN
    found = [] if silent else [Finding("gravity", "error", "")]
    monkeypatch.setattr(run, "run_on_torque", lambda *_: run.findings.extend(found))
    monkeypatch.setattr(
        run, "run", lambda check: setattr(run, "plan", check(None, run.plan, None)[0])
    )
    proposal._judge_reversal(run, Friction())
    assert run.findings == ([common] if silent else found)
    assert run.plan.torque.sign == (-1.0 if silent else 1.0)


@pytest.mark.parametrize(("factor", "kinds"), [(2.0, []), (1000.0, ["torque_unit"])])
def test_torque_far_beyond_the_limits_of_effort(monkeypatch, factor, kinds) -> None:
    """Property: where links explain too little, the limits of effort show another unit."""
    unused = np.ones(2), np.zeros(2, dtype=bool)
    monkeypatch.setattr(torque_rows, "slopes_to_model", lambda _: unused)
    robot = SimpleNamespace(limits=lambda: {"effort": np.array([30.0, np.inf])})
    tau = factor * np.array([[30.0, 1.0], [-1.0, 1.0]])
    rows = SimpleNamespace(lib=robot, whole=SimpleNamespace(required=lambda _: tau))
    assert [f.kind for f in torque_rows.scale(rows, PLAN)[1]] == kinds


@pytest.mark.parametrize(("stated_trim", "trim"), [(0.1, 0.25), (0.7, 0.7)])
def test_trimmed_edges_follow_the_cutoff(monkeypatch, double, stated_trim, trim) -> None:
    """Oracle: 4 Hz in place of 10 Hz trims 1/4 s, unless the recipe states another length."""
    ten, four = (
        CutoffCandidate(hz, "measured", score, score - 1.0, 0.1, 1.0)
        for hz, score in ((10.0, 1.0), (4.0, 1.03))
    )
    ready = Preparation(filter="butterworth", cutoff_hz=10.0, trim_s=stated_trim)
    choice = CutoffChoice((ten, four), ten, replace(ready, derivative="measured"), "chosen")
    chosen = proposal.regressor_choice
    monkeypatch.setattr(chosen, "choose_cutoff", lambda *_: choice)
    monkeypatch.setattr(
        chosen,
        "differentiation_of",
        lambda _log, _lib, tried: SimpleNamespace(fails=tried.cutoff_hz > 5),
    )
    done, findings = proposal.proposed_preparation(sine(1.0), double, ready, None, Friction())
    assert (done.cutoff_hz, done.trim_s) == (4.0, trim)
    assert [each.kind for each in findings] == ["cutoff", "regressor"]


def test_rotors_of_an_arm_that_stands_still(lib: Library) -> None:
    """Property: where no joint moves nothing is said of rotors, whatever the torque."""
    t = np.arange(1000) / 100.0
    still = np.zeros((1000, 7))
    log = Recording(t=t, q=still + lib.home, dq=still, ddq=still, tau=still + 5.0)
    assert rotor(log, lib, Recipe(), Friction(DRIVE)) == []


def test_a_tilted_base_is_built_with_two_decimals() -> None:
    """Oracle: gravity of a base turned by 30° about x, 9.81 (0, 1/2, −√3/2)."""
    robot = SimpleNamespace(name="arm", folder=Path("arm"), gravity=np.array([0.0, 0.0, -9.81]))
    vector = 9.81 * np.array([0.0, 0.5, -np.sqrt(0.75)])
    finding = _finding(robot, vector, 9.81, (0.5, 0.01), {})
    assert "--name arm_tilted --gravity 0,4.9,-8.5 " in finding.sentence
    assert "the fitted gravity (0,4.9,-8.5 m/s²) 1 %" in finding.sentence
    assert finding.evidence["gravity"] == pytest.approx(list(vector))


def test_small_columns_of_free_bodies_count() -> None:
    """Oracle: a torque along a column 1e-7 as long as the others is explained without gravity."""
    rows = np.eye(6)
    common = np.column_stack([rows[0], 1e-7 * rows[1]])
    turns = [each[:, None] for each in rows[2:5]]
    assert _Fit(common, turns, rows[1]).residual(np.eye(3)[0]) < 1e-9
    assert _Fit(common, turns, rows[2]).residual(np.eye(3)[0]) < 1e-9
    assert _Fit(common, turns, rows[5]).residual(np.eye(3)[0]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("width", "places"),
    [
        (14, {"position": 0, "torque": 7}),
        (15, {"time": 0, "position": 1, "torque": 8}),
        (22, {"time": 0, "position": 1, "velocity": 8, "torque": 15}),
        (28, {"position": 0, "velocity": 7, "acceleration": 14, "torque": 21}),
        (16, {}),
        (7, {}),
    ],
)
def test_columns_without_titles_by_their_number(width, places) -> None:
    """Oracle: at most one column of time, then q τ, q dq τ or q dq ddq τ of seven joints."""
    signals = dict(_untitled(width, "log.csv", "log", 7))
    first = {
        kind: part["where"]["column"] if kind == "time" else part["where"]["columns"][0]
        for kind, part in signals.items()
    }
    assert first == places
