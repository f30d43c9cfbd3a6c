"""The friction ladder finds the model that made the data, and no richer one."""

import json

import numpy as np
import pytest

from runtime import Recording, write_recording
from runtime.errors import IdentificationError
from runtime.estimators.choice.friction_choice import FRICTION_MODELS, choose_friction
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, Split
from runtime.recording.friction.columns import gravity_load
from runtime.recording.friction.model import columns, torque
from runtime.recording.settings import JointMotion

NOISE = 0.02
WHOLE = Split((0.0, 0.9), (0.9, 0.95), (0.95, 1.0))
PHI = {  # N·m per unit of the column: of the size of a Franka's, see the common plant's friction
    "offset": 0.2,
    "viscous": 0.4,
    "coulomb": 0.5,
    "asymmetric": 0.15,
    "stribeck": 0.3,
    "dahl": 0.5,
    "load": 0.02,
    "rotor": 0.1,
}


def _with_friction(
    clean: Recording, lib: Library, terms: Friction, noise: float = NOISE
) -> Recording:
    """The exact motion, its rigid torque, friction and white noise."""
    motion = JointMotion(clean.dq, clean.q, clean.ddq, lib)
    C = columns(motion, terms)
    phi = np.tile([PHI[name] for name in terms.columns], (lib.n_joints, 1))
    tau = clean.tau + (torque(C, phi) if terms.columns else 0.0)
    draw = np.random.default_rng(3).normal(size=tau.shape)
    return clean.replace(tau=tau + noise * draw)


@pytest.mark.parametrize("candidate", ["coulomb", "asymmetric", "stribeck", "dahl", "load"])
def test_the_candidate_that_made_the_data_is_chosen(candidate, lib, ideal_runs):
    """Oracle: simulated truth, and its widths."""
    truth = Friction(
        FRICTION_MODELS[candidate], coulomb_speed=0.03, stribeck_speed=0.15, dahl_stroke=4e-3
    )
    log = _with_friction(ideal_runs[0], lib, truth)
    choice = choose_friction(log, lib, split=WHOLE)
    assert choice.chosen.name == candidate, choice.sentence
    # Widths come one after the other, not jointly: ε within 15 % of the truth where a Stribeck peak
    # beside it is of the same shape, within 3 % alone (2 % is the search's own accuracy).
    near = {"rtol": 0.15 if candidate == "stribeck" else 0.03}
    if "coulomb" in truth.columns:
        np.testing.assert_allclose(choice.chosen.terms.coulomb_speed, 0.03, **near)
    if candidate == "stribeck":
        np.testing.assert_allclose(choice.chosen.terms.stribeck_speed, 0.15, **near)
    if candidate == "dahl":
        np.testing.assert_allclose(choice.chosen.terms.dahl_stroke, 4e-3, **near)
    # The true model's score is the noise: 1 + 2 · 71 unknowns / 6650 equations, and √(2 / 6650).
    assert abs(choice.chosen.score - 1.0) < 0.06


def test_a_gear_has_memory_load_and_rotor(lib, ideal_runs):
    """Oracle: simulated truth; without one of the three, `auto` is worse than the default."""
    truth = Friction(("offset", "viscous", "dahl", "load", "rotor"), 0.03, dahl_stroke=4e-3)
    log = _with_friction(ideal_runs[0], lib, truth)
    choice = choose_friction(log, lib, split=WHOLE)
    assert choice.chosen.terms.columns == truth.columns, choice.sentence
    assert abs(choice.chosen.score - 1.0) < 0.06


def test_without_friction_none_is_chosen(lib, ideal_runs):
    """Property: noise alone does not lift the ladder, and AIC agrees."""
    choice = choose_friction(
        _with_friction(ideal_runs[0], lib, Friction(())), lib, split=WHOLE, coulomb_speed=0.02
    )
    assert choice.chosen.name == "none"
    assert min(choice.candidates, key=lambda r: r.aic).name == "none"
    assert "'none'" in choice.sentence


def test_a_real_log_gets_below_the_bar_with_the_chosen_model(panda, lib):
    """Oracle: a Franka's log; chosen on the first 60 %, least squares there, the rest held out.

    Bar 1.3 % of torque (with tanh-Coulomb at 0.02 rad/s: 1.31 %).
    """
    choice = choose_friction(panda, lib, names=("viscous", "coulomb", "dahl"))
    result = identify_recording(
        panda,
        lib,
        "ols",
        friction=choice.chosen.terms,
        split=Split((0.0, 0.59), (0.59, 0.6), (0.6, 1.0)),
        certify=False,
    )
    tau = result.test.tau
    error = np.linalg.norm(tau - result.predict_recording(result.test)) / np.linalg.norm(tau)
    assert choice.chosen.name == "dahl"
    assert 100 * error < 1.25


def test_dahl_bends_as_the_differential_equation_says():
    """Oracle: dζ/dx = (1 − ζ sgn dx)/z_c integrated in closed form, out and back."""
    z = 2e-3
    q = np.concatenate([np.linspace(0, 0.01, 50), np.linspace(0.01, 0.0, 50)[1:]])[:, None]
    zeta = columns(JointMotion(np.zeros_like(q), q), Friction(("dahl",), dahl_stroke=z))[:, 0, 0]
    out = 1 - np.exp(-q[:50, 0] / z)
    back = -1 + (out[-1] + 1) * np.exp(-(0.01 - q[50:, 0]) / z)
    # Sums of 100 rounded exponentials.
    np.testing.assert_allclose(zeta, np.concatenate([out, back]), atol=1e-13)


def test_load_and_rotor_columns_are_of_the_arm(lib, ideal_runs):
    """Oracle: |Y(q, 0, 0) π₀|, and ddq."""
    run = ideal_runs[0]
    motion = JointMotion(run.dq, run.q, run.ddq, lib)
    C = columns(motion, Friction(("load", "rotor"), 0.05))
    still = np.zeros(7)
    expected = np.abs(lib.regressor(run.q[77], still, still) @ lib.pi0) * np.tanh(run.dq[77] / 0.05)
    np.testing.assert_allclose(C[77, :, 0], expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(C[..., 1], run.ddq)
    assert gravity_load(lib, run.q).min() >= 0


def test_a_rotor_that_a_link_can_replace_is_the_links_without_a_prior(lib, ideal_runs, pi_true):
    """Oracle: Gautier's rule, and the rotors that made the torque."""
    run, terms = ideal_runs[0], Friction(("rotor",))
    rotors = np.array([0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05])
    geared = run.replace(tau=run.tau + rotors * run.ddq)
    free = identify_recording(geared, lib, "ols", friction=terms, certify=False)
    # Axis 1 is fixed and axis 2 perpendicular to it: ω₁·z₁ = dq₁ and ω₂·z₂ = dq₂, so ZZ of links
    # 1 and 2 do what the rotors of their joints do. Rounding over a condition number of 20.
    assert free.phi[:2].tolist() == [[0.0], [0.0]]
    np.testing.assert_allclose(free.phi[2:, 0], rotors[2:], atol=1e-9)
    # The prior is right about links 1 and 2, so what they lack is the rotors'.
    start = lib.lam_from_pi(pi_true)
    kept = identify_recording(geared, lib, "map", friction=terms, lam0=start, certify=False)
    np.testing.assert_allclose(kept.phi[2:, 0], rotors[2:], atol=1e-6)
    # The prior widens links thinner than matter is, here by 2.5 and 1.3 g·m².
    np.testing.assert_allclose(kept.phi[:2, 0], rotors[:2], atol=4e-3)
    for result in (free, kept):
        tau = result.predict(run.q, run.dq, run.ddq)
        np.testing.assert_allclose(tau, geared.tau, atol=1e-5)


def test_bad_questions_are_reported(lib, ideal_runs):
    """Property: one sentence with the valid answers."""
    run = ideal_runs[0]
    with pytest.raises(IdentificationError, match="'sticky'; choose from auto, none, offset"):
        choose_friction(run, lib, names=("sticky",))
    with pytest.raises(IdentificationError, match="too few to choose a friction model"):
        choose_friction(run.take(slice(0, 40), "short"), lib)


def test_auto_on_the_command_line_says_what_it_chose(lib, ideal_runs, command, tmp_path):
    """Property: the table, the sentence among the notes, and the columns in result.json."""
    log = _with_friction(ideal_runs[0], lib, Friction(("offset", "viscous")))
    write_recording(log, tmp_path / "log.csv")
    words = ("--friction", "auto", "--settings", "coulomb_speed=0.02", "--out", "out", "--verbose")
    ran = command("identify", "log.csv", "--robot", lib.folder, *words)
    assert ran.code == 0, ran.err
    assert "Friction model: cross-validation error" in ran.out
    assert "note: friction model 'viscous' (offset, viscous) chosen by cross-validation" in ran.out
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["friction"]["columns"] == ["offset", "viscous"]


def test_the_test_part_has_no_effect(lib, noisy):
    """Property: garbage in the last 40 % changes no figure of the choice, to the bit."""
    tau = noisy.tau.copy()
    first = int(np.flatnonzero(noisy.t - noisy.t[0] >= 0.6 * noisy.duration)[0])
    tau[first:] = 20.0 * np.random.default_rng(0).normal(size=tau[first:].shape)
    filtered = Preparation(filter="butterworth", cutoff_hz=5.0)
    whole, damaged = (
        choose_friction(each, lib, filtered, names=("viscous", "coulomb"))
        for each in (noisy, noisy.replace(tau=tau))
    )
    assert whole == damaged
