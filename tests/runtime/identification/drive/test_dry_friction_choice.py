"""Friction of drives with a memory and with the position: the columns, and their choice."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime.estimators.choice.dry_friction import _trial
from runtime.estimators.problem import FrictionPrior
from runtime.identification.identified import Identification
from runtime.identification.identify import identify
from runtime.identification.result_record import friction_part
from runtime.identification.settings import Settings
from runtime.library import Array, Library, load
from runtime.monitoring.model import model_of
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction.model import DRIVE, columns
from runtime.recording.preprocessing.parts import without_ends
from runtime.recording.recipes.recipe import COMMANDED
from runtime.recording.settings import JointMotion
from runtime.recording.streamed import StreamedRecording, open_streamed
from tests.runtime.servo_logs import STROKE, dry_servo_log

PREPARATION = Preparation(filter="butterworth", cutoff_hz=10.0, trim_s=0.2)


def identified(
    log: Recording | StreamedRecording,
    lib: Library,
    terms: Friction | None = None,
    known: FrictionPrior | None = None,
) -> Identification:
    """The result with the delay as an unknown."""
    settings = Settings(preparation=PREPARATION, friction=terms, gain_sigma=0, delay="auto")
    return identify(log, lib, replace(settings, friction_prior=known), encoder_bias=False)


def is_within(result: Identification, column: str, truth: Array | float) -> bool:
    """Whether a coefficient is within four standard deviations, left with probability 6e-5."""
    k = result.friction.columns.index(column)
    return bool((abs(result.phi[:, k] - truth) < 4 * result.friction_sigma[:, k]).all())


@pytest.mark.parametrize("varies", [True, False])
def test_position_is_chosen_where_friction_changes_with_it(tiny_built: Path, tmp_path, varies):
    """Property: the column is taken where the log needs it, with its coefficient, and else not."""
    lib, slope = load(tiny_built), 2.0 if varies else 0.0
    log, _ = dry_servo_log(lib, tmp_path, memory=False, slope=slope)
    result = identified(log, lib)
    assert result.friction.columns == (*DRIVE, "position")[: 5 if varies else 4]
    assert any("changes with the position" in note for note in result.notes) == varies
    if varies:
        assert is_within(result, "position", slope)
    assert identified(log, lib, Friction(columns=DRIVE)).friction.columns == DRIVE


@pytest.mark.parametrize("slope", [0.0, 2.0])
def test_memory_is_chosen_where_friction_has_one(tiny_built: Path, tmp_path, slope):
    """Property: dahl replaces coulomb, and its coefficient is the Coulomb friction of the drive.

    The stroke, an unknown beside the delay, is that of the log within 5 %. The noise of dq in the
    tanh of another model would move the delay, which is 0, by milliseconds.
    """
    lib = load(tiny_built)
    log, servo = dry_servo_log(lib, tmp_path, memory=True, slope=slope)
    result = identified(log, lib)
    names = tuple("dahl" if name == "coulomb" else name for name in DRIVE)
    assert result.friction.columns == (names if slope == 0 else (*names, "position"))
    assert result.friction.dahl_stroke == pytest.approx(STROKE, rel=0.05)
    assert any("has a memory of" in note for note in result.notes)
    assert is_within(result, "dahl", servo.phi[:, 1])
    drive, sigma = result.drive, result.friction_sigma
    assert drive is not None
    assert sigma is not None
    assert abs(drive.delay[0]) < 5e-4
    streamed = identified(open_streamed(tmp_path / "log.npz"), lib).friction
    stroke = result.friction.dahl_stroke  # of the same rows, less what feedback makes of noise
    assert replace(streamed, dahl_stroke=stroke) == result.friction
    assert streamed.dahl_stroke == pytest.approx(stroke, rel=1e-3)
    facts = drive.parts(lib.joint_names, result.phi, sigma, result.friction.columns)
    assert facts[0].coulomb == result.phi[0, 1]
    assert facts[0].sigma.coulomb == sigma[0, 1]


@pytest.mark.parametrize("load", [0.0, 0.04])
def test_every_joint_has_its_stroke_and_friction_of_the_load(lib: Library, tmp_path, load):
    """Property: strokes that differ by a factor of four are those of the log, with the delay of 0.

    Friction that grows with the load is taken where the log has it, with its coefficient; the load
    of the first joint, whose axis is vertical, is 0.
    """
    strokes = (2e-3, 1e-3, 4e-3, 2e-3, 1e-3, 4e-3, 2e-3)
    log, servo = dry_servo_log(lib, tmp_path, True, 0.0, strokes, load)
    result = identified(log, lib)
    assert result.friction.dahl_stroke == pytest.approx(strokes, rel=0.05)
    assert Friction.from_facts(result.friction.facts()) == result.friction
    written = friction_part(result.friction, result.phi, None)
    assert written.dahl_stroke == result.friction.dahl_stroke
    assert ("dahl_load" in result.friction.columns) == (load > 0)
    assert any("grows with the load" in note for note in result.notes) == (load > 0)
    assert is_within(result, "dahl", servo.phi[:, 1])
    drive = result.drive
    assert abs(drive.delay[0]) < 4 * drive.delay_sigma[0] < 2e-4
    if load:
        k = result.friction.columns.index("dahl_load")
        error, sigma = result.phi[1:, k] - load, result.friction_sigma[1:, k]
        assert (abs(error) < 4 * sigma).all()
    # Its columns again, and those before the load with a prior of their coefficients.
    again = identified(log, lib, result.friction)
    assert again.friction.columns == result.friction.columns
    plain = replace(result.friction, columns=(*DRIVE[:1], "dahl", *DRIVE[2:]))
    known = FrictionPrior(np.zeros((7, 4)), np.full((7, 4), np.inf))
    assert identified(log, lib, plain, known).friction.columns == plain.columns


def test_position_runs_from_one_limit_to_the_other(tiny_built: Path):
    """Oracle: x is −1 at the lower limit, 1 at the upper one, and the sign is that of the speed."""
    lib = load(tiny_built)
    limits = lib.limits()
    low, high = limits["lower"][0], limits["upper"][0]
    q = np.array([[low], [high], [(low + high) / 2], [high]])
    dq = np.array([[1.0], [1.0], [1.0], [-1.0]])
    terms = Friction(columns=("position",), coulomb_speed=1e-3)
    values = columns(JointMotion(dq, q, lib=lib), terms)[:, 0, 0]
    np.testing.assert_allclose(values, [-1.0, 1.0, 0.0, -1.0], atol=1e-12)


def test_position_beside_dahl_has_its_state(tiny_built: Path, tmp_path):
    """Oracle: the column is x ζ, of the path, or of a state that an observer has computed."""
    lib, t = load(tiny_built), np.linspace(0.0, 3.0, 200)[:, None]
    q, dq = 0.3 * np.sin(2 * t), 0.6 * np.cos(2 * t)
    terms = Friction(("dahl", "position"), dahl_stroke=STROKE)
    zeta, both = columns(JointMotion(dq, q, lib=lib), terms)[:, 0].T
    limits = lib.limits()
    middle, half = (
        (limits["upper"] + limits["lower"]) / 2,
        (limits["upper"] - limits["lower"]) / 2,
    )
    np.testing.assert_allclose(both, ((q - middle) / half)[:, 0] * zeta, atol=1e-15)
    log, _ = dry_servo_log(lib, tmp_path, memory=True, slope=2.0)
    model = model_of(identified(log, lib), lib)
    state = np.full((1, 1), 0.25)
    _, plain = model.columns(JointMotion(dq[50:51], q[50:51], lib=lib, zeta=state))
    place = ((q[50] - middle) / half)[0]
    names = list(model.terms.columns)
    assert plain[0, 0, names.index("dahl")] == 0.25
    assert plain[0, 0, names.index("position")] == pytest.approx(0.25 * place, abs=1e-15)
    phi = np.abs(model.phi[:, [names.index("dahl"), names.index("position")]])
    np.testing.assert_allclose(model.lasting_friction, phi.sum(axis=1))


def test_delays_reach_from_150_ms_behind_the_stamp_to_30_ms_before_it(tiny_built: Path):
    """Oracle: a torque that rises by 2 N·m/s differs by 0.36 N·m between the first and the last."""
    t = np.arange(600) / 100.0
    q, one = np.sin(t)[:, None], np.ones((600, 1))
    columns = np.stack([np.cos(t)[:, None], np.sign(np.cos(t))[:, None]], axis=2)
    names = ("viscous", "coulomb")
    log = Recording(
        t, q, np.cos(t)[:, None], -q, 2 * t[:, None], columns=columns, column_names=names
    )
    trial = _trial(log, load(tiny_built), Friction(names), True)
    assert trial is not None
    rows = trial.rest.shape[1]
    np.testing.assert_allclose(trial.rest[-1] - trial.rest[0], 0.36 * one[:rows], rtol=1e-9)


def test_both_ends_of_a_commanded_torque_are_left_out(tiny_built: Path, tmp_path):
    """Property: a period of the cut-off, a stated trim stays, and a measured torque is not cut."""
    log, _ = dry_servo_log(load(tiny_built), tmp_path, memory=False, slope=0.0)
    assert log.torque_source == COMMANDED
    usual = replace(PREPARATION, trim_s=None)
    assert without_ends(log, usual).trim_s == 0.1
    assert without_ends(log, replace(usual, cutoff_hz=0.2)).trim_s == 0.6  # 5 % of 12 s
    assert without_ends(log, PREPARATION) is PREPARATION
    assert without_ends(log.replace(torque_source="measured"), usual) is usual
    bare = Preparation()
    assert without_ends(log, bare) is bare
