"""Friction and rotors chosen for a log for which none are named."""

import json

import numpy as np
import pytest

import runtime
from runtime import Recording, load, read_recording
from runtime.estimators.choice.default_friction import (
    DEFAULT_COLUMNS,
    SPRINGS,
    choose_default_friction,
)
from runtime.estimators.choice.friction_choice import choose_friction
from runtime.estimators.regression.samples import samples_of
from runtime.identification.metrics import torque_error
from runtime.identification.prepared_log import usable_columns
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, Split, write_recording
from runtime.recording.friction.model import columns, torque
from runtime.recording.preprocessing import prepare
from runtime.recording.settings import JointMotion
from tests.runtime.diagnosis import EXAMPLE
from tests.runtime.virtual_arms import cobot

PHI = {"offset": 0.2, "viscous": 0.4, "coulomb": 0.5, "rotor": 0.1, "load": 0.05}
"""Of the size of a small arm's: N·m, N·m·s/rad, N·m, kg·m², and 5 % of the torque of gravity."""
WHOLE = Split((0.0, 0.9), (0.9, 0.95), (0.95, 1.0))


def with_friction(clean: Recording, lib: Library, terms: Friction) -> Recording:
    """The exact motion, its rigid torque, friction and 0.02 N·m of white noise."""
    C = columns(JointMotion(clean.dq, clean.q, clean.ddq, lib), terms)
    phi = np.tile([PHI[name] for name in terms.columns], (lib.n_joints, 1))
    tau = clean.tau + (torque(C, phi) if terms.columns else 0.0)
    return clean.replace(tau=tau + 0.02 * np.random.default_rng(3).normal(size=tau.shape))


@pytest.mark.parametrize(
    "names",
    [
        (),
        ("rotor",),
        ("offset",),
        ("offset", "viscous"),
        ("offset", "viscous", "coulomb"),
        ("offset", "viscous", "coulomb", "rotor"),
        ("offset", "viscous", "coulomb", "load", "rotor"),
    ],
)
def test_the_columns_that_made_the_data_are_chosen(names, lib, ideal_runs):
    """Oracle: simulated truth."""
    log = with_friction(ideal_runs[0], lib, Friction(names, coulomb_speed=0.03))
    choice = choose_default_friction(log, lib, split=WHOLE)
    assert choice.terms.columns == names
    if "coulomb" in names:
        # Two grids and a parabola; 0.02 N·m of noise leave some percent.
        assert choice.terms.coulomb_speed == pytest.approx(0.03, rel=0.05)
    assert "--friction none fits the inertia only" in choice.sentence
    # The true model's score is the noise: 1 + 2 · 71 unknowns / 6300 equations, and √(2 / 6300).
    assert abs(dict(choice.scores)[names] - 1.0) < 0.06


@pytest.mark.parametrize("rotor", [(), ("rotor",)])
def test_friction_with_memory_gets_a_dahl_column(rotor, lib, ideal_runs):
    """Oracle: simulated truth; Coulomb columns leave most of the friction at reversals."""
    true = Friction(("offset", "viscous", "dahl", *rotor), dahl_stroke=0.02)
    clean = ideal_runs[0]
    C = columns(JointMotion(clean.dq, clean.q, clean.ddq, lib), true)
    phi = np.tile([{**PHI, "dahl": 0.5}[name] for name in true.columns], (lib.n_joints, 1))
    noise = 0.02 * np.random.default_rng(3).normal(size=clean.tau.shape)
    log = clean.replace(tau=clean.tau + torque(C, phi) + noise)
    choice = choose_default_friction(log, lib, split=WHOLE)
    assert choice.terms.columns == true.columns
    # A parabola through strokes a factor of 4 apart, then of √2; 0.02 N·m leave some percent.
    assert choice.terms.dahl_stroke == pytest.approx(0.02, rel=0.1)
    assert "--friction offset,viscous,coulomb" in choice.sentence
    without = choose_default_friction(log, lib, split=WHOLE, coulomb_speed=0.03)
    assert "dahl" not in without.terms.columns
    assert "dahl" not in choose_default_friction(log, lib, allowed=DEFAULT_COLUMNS).terms.columns


def test_the_default_predicts_the_cobot(tmp_path):
    """Simulated truth: within 5 % of the best settings on another motion (`scripts/default_table`).

    The best of all settings there has 4.13 % of torque error; Coulomb columns have 9.2 %.
    """
    lib = load("ur5e")
    first, second = (cobot(lib, lib.folder, motion_seed=seed) for seed in (None, 101))
    logs = []
    for arm in (first, second):
        np.savez(tmp_path / "log.npz", **arm.log.arrays)
        ready = Preparation(filter="butterworth", cutoff_hz=10.0, rate_hz=50.0, max_gap_s=0.05)
        plan = arm.log.recipe.replace(preparation=ready)
        logs.append(read_recording(tmp_path / "log.npz", plan))
    errors = []
    auto = choose_friction(logs[0], lib, names=("dahl",), extra=("rotor",)).chosen.terms
    for terms in (choose_default_friction(logs[0], lib).terms, auto):
        result = identify_recording(logs[0], lib, Settings(friction=terms, certify=False))
        samples = samples_of(prepare(logs[1], None, terms, lib=lib), lib)
        errors.append(torque_error(samples.tau, result.predict_samples(samples)).overall)
    assert errors[0] < 1.05 * errors[1]


def test_a_slow_real_log_has_friction(robot):
    """Real data: one standard error of five blocks of least squares admitted no friction on an
    LWR4, which is 8.0 % instead of 2.6 % on the test part.
    """
    log, lib = read_recording("lwr4_flobaroid", None, "1"), robot("kuka_lwr4")
    choice = choose_default_friction(log, lib)
    assert {"viscous", "coulomb"} <= set(choice.terms.columns)


def test_friction_that_one_block_alone_shows_is_not_dropped(lib):
    """Oracle: simulated truth; three joints turn back once, near the start, so that four of five
    blocks have their dry friction and offset in one column, up to the leakage of the filter.
    """
    t = np.arange(0.0, 10.0, 0.02)
    rates = 0.5 + 0.13 * np.arange(lib.n_joints)
    angles = 2 * np.pi * np.outer(t, rates) + np.arange(lib.n_joints)
    q = 0.5 * np.sin(angles)
    q[:, [0, 2, 4]] = -8.0 * (t[:, None] / 9.0 - 0.1) ** 2
    dq = np.gradient(q, t, axis=0)
    ddq = np.gradient(dq, t, axis=0)
    tau = lib.inverse_dynamics(lib.home + q, dq, ddq, lib.pi0)
    exact = Recording(t=t, q=lib.home + q, dq=dq, ddq=ddq, tau=tau)
    log = with_friction(exact, lib, Friction(("offset", "viscous", "coulomb"), coulomb_speed=0.03))
    log = log.replace(tau=log.tau + 0.3 * np.random.default_rng(0).normal(size=tau.shape))
    steps = Preparation(filter="butterworth", cutoff_hz=10.0, derivative="position", trim_s=0.3)
    choice = choose_default_friction(log, lib, steps, split=WHOLE)
    assert {"coulomb", "dahl"} & set(choice.terms.columns)
    scores = dict(choice.scores)
    assert scores["offset", "viscous", "coulomb"] < scores["offset", "viscous"]


def test_the_test_part_has_no_effect(lib, noisy):
    """Property: garbage in the last 40 % changes no figure of the choice, to the bit."""
    tau = noisy.tau.copy()
    first = int(np.flatnonzero(noisy.t - noisy.t[0] >= 0.6 * noisy.duration)[0])
    tau[first:] = 1e3
    damaged = choose_default_friction(noisy.replace(tau=tau), lib)
    assert damaged == choose_default_friction(noisy, lib)


def test_a_short_log_gets_none_and_the_reason(lib, noisy):
    """Property: no refusal where nobody asked for a choice."""
    choice = choose_default_friction(noisy.take(slice(0, 20), "short"), lib)
    assert choice.terms.columns == ()
    assert "too few to choose a model" in choice.sentence


def test_the_choice_is_among_the_columns_of_the_method():
    """Property: filters know no rotor; nets have their own inputs."""
    usual = ("offset", "viscous", "coulomb", "rotor", "dahl", "load", SPRINGS)
    assert usable_columns(["map"]) == usual
    assert usable_columns(["map", "ekf"]) == ("offset", "viscous", "coulomb")
    assert usable_columns(["nn"]) == ()


def test_identify_without_options_fits_friction(command, lib, tmp_path):
    """Property: on the bundled log, and the inertia alone on request; Python gives the same."""
    errors, notes = {}, {}
    for option in (("--friction", "none"), ()):
        ran = command("identify", EXAMPLE, "--robot", lib.folder, *option, "--out", "out")
        assert ran.code == 0, ran.err
        facts = json.loads((tmp_path / "out" / "result.json").read_text())
        errors[option] = facts["torque_error_percent"]["after_overall"]
        notes[option] = [w for w in facts["warnings"] if "friction model" in w]
        names = facts["friction"]["columns"] if facts["friction"] else []
        assert names == ([] if option else ["offset", "viscous", "coulomb"])
    assert len(notes[()]) == 1
    assert not notes["--friction", "none"]
    log = read_recording(EXAMPLE)
    same = runtime.identify(log, lib)
    # The same numbers to the last digit of the file.
    assert same.pi.tolist() == facts["pi"]
    requested = runtime.identify(log, lib, friction=(), refit=False, certify=False)
    assert requested.notes == ()
    assert requested.phi.size == 0
    # Measured 0.76 and 5.94 %.
    assert errors[()] < 1.0
    assert errors["--friction", "none"] > 5.0


def test_several_logs_take_the_model_of_the_first(command, lib, clean, tmp_path):
    """Property: one choice for all, said once; an offset becomes one per log."""
    for name, rows in (("a", slice(0, 500)), ("b", slice(500, 1001))):
        write_recording(clean.take(rows, name), tmp_path / f"{name}.npz")
    words = ("--out", "out", "--verbose")
    ran = command("identify", "a.npz", "b.npz", "--robot", lib.folder, *words)
    assert ran.code == 0, ran.err
    assert ran.out.count("chosen by cross-validation") == 1
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert set(facts["friction"]["columns"]) == {"viscous", "coulomb", "offset"}
    assert np.shape(facts["sessions"]["offsets"]) == (2, 7)


def test_a_width_alone_is_a_width_of_the_choice(command, lib, tmp_path):
    """Property: the setting coulomb_speed without --friction was without effect."""
    words = ("--robot", lib.folder, "--settings", "coulomb_speed=0.05", "--out", "out")
    assert command("identify", EXAMPLE, *words).code == 0
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["friction"]["coulomb_speed"] == 0.05
    assert "coulomb" in facts["friction"]["columns"]
