"""sensor_gains: torque gains and biases from a weighed payload, with honest intervals."""

import json

import numpy as np
import pytest
from scipy import signal

from runtime import read_recording, write_recording
from runtime.errors import RuntimeFault
from runtime.identification.payload.body import (
    KnownPayload,
    mount_of,
    pi_of_body,
    read_known_payload,
)
from runtime.identification.sensor_gains import identify_gains, linear, problem_of, reduced, solve
from runtime.recording import Friction, Recipe
from runtime.recording.reader import plan_of
from runtime.recording.recipes.recipe import Signal
from runtime.recording.recipes.recipe_file import load_recipe, recipe_text
from tests.runtime.identification.sensor_gains.weighed import (
    BIAS,
    BODY,
    COM,
    GAINS,
    INERTIA,
    NOISE,
    POINT,
    TERMS,
    TRIALS,
    WIDTH,
    measured,
)


@pytest.mark.parametrize("payload", [BODY, POINT], ids=["inertia known", "inertia unknown"])
@pytest.mark.parametrize("scale", [1.0, 0.02], ids=["N·m", "A"])
def test_exact_data_give_exact_gains_and_biases(payload, scale, runs, lib):
    """Oracle: the sensors; Pinocchio moves the payload. Currents are gains far from 1."""
    gains = scale * GAINS
    result = identify_gains(*measured(runs, gains=gains), lib, payload, friction=TERMS)
    # Rounding 1e-16 of 80 N·m times the condition 1e3 of the scaled columns, over 0.1 N·m that the
    # payload moves at the last joint: 1e-10.
    np.testing.assert_allclose(result.estimate / gains, 1.0, atol=1e-10)
    np.testing.assert_allclose(result.bias, BIAS, atol=1e-9)
    assert result.is_determined.all()
    assert result.status.startswith("identified the gains of all fr3_joint1, ")
    assert ("inertia of the payload was not given" in " ".join(result.notes)) == (payload is POINT)


@pytest.mark.parametrize("filtered", [False, True])
def test_unbiased_and_intervals_cover(filtered, runs, dense, lib):
    """Property: Monte Carlo, white and filtered at 10 Hz; N_eff is short of the latter by little.

    The linear form is bent by the noise that stands in its columns.
    """
    true = dense if filtered else runs
    rng = np.random.default_rng(11)
    b, a = signal.butter(4, 10.0 / 50.0)
    result, bent = [], []
    for trial in range(TRIALS // (1 + filtered)):
        noise = NOISE * rng.normal(size=(2, *true[0].tau.shape))
        noise = signal.filtfilt(b, a, noise, axis=1) if filtered else noise
        pair = measured(true, noise)
        result.append(identify_gains(*pair, lib, BODY, friction=TERMS))
        if not filtered and trial % 4 == 0:
            rows = reduced(problem_of(*pair, lib, BODY, None, TERMS, None).blocks())
            bent.append(linear(rows[:, 2:, 2:])[1])
    errors = np.array([each.estimate for each in result]) - GAINS
    sigma = np.array([each.sigma for each in result])
    off = np.array([each.bias for each in result]) - BIAS
    off_sigma = np.array([each.bias_sigma for each in result])
    cover = np.mean(np.abs(errors) < 1.96 * sigma)
    cover_bias = np.mean(np.abs(off) < 1.96 * off_sigma)
    # Seven joints within what one would be at two standard errors: 2.7 by Šidák.
    assert (np.abs(_standard(errors)) < 2.7).all()
    assert (np.abs(_standard(off.reshape(len(off), -1))) < 2.9).all()  # of fourteen
    assert 0.90 <= cover <= 0.98
    assert 0.90 <= cover_bias <= 0.98
    if not filtered:
        assert np.abs(_standard(np.array(bent) - GAINS)).max() > 5


def _standard(errors):
    """Mean over its standard error, per column."""
    return errors.mean(axis=0) / (errors.std(axis=0, ddof=1) / np.sqrt(len(errors)))


def test_joints_without_a_determined_gain_are_named_and_left_alone(runs, lib, payload_pi):
    """Property: 300 g move joint 7 by 0.06 N·m, far below its noise of 1 N·m; its gain stays 1."""
    empty, full = runs
    Y = lib.regressor(full.q, full.dq, full.ddq)[:, :, mount_of(lib).columns]
    light = full.replace(tau=full.tau - 0.9 * Y @ payload_pi)
    noise = NOISE * np.random.default_rng(3).normal(size=(2, *full.tau.shape))
    noise[..., 6] *= 20
    pair = measured((empty, light), noise)
    terms = Friction((*TERMS.columns, "offset"), coulomb_speed=WIDTH)
    result = identify_gains(*pair, lib, KnownPayload(0.3, COM, 0.1 * INERTIA), friction=terms)
    assert not result.is_determined[6]
    assert result.gain[6] == 1.0
    assert result.is_determined[:4].all()
    named = " ".join(result.notes)
    assert "fr3_joint7 (± " in named
    assert "which stays at 1" in named
    assert "fr3_joint7" not in result.status
    # Whatever is not determined is still free in the fit, so that the others are not bent by it.
    np.testing.assert_array_less(np.abs(result.estimate - GAINS), 4 * result.sigma)
    loud = measured((empty, light), 40 * noise)
    with pytest.raises(RuntimeFault, match="changes the torques of these runs too little"):
        identify_gains(*loud, lib, KnownPayload(0.3, COM, 0.1 * INERTIA), friction=terms)
    # A requested offset is the bias of the runs already, and leaves it as sure as it was.
    assert (result.bias_sigma[:, :6] < 0.1).all()


def test_coupled_motors_have_separate_gains(runs, lib):
    """Oracle: τ_m = R⁻ᵀ τ scaled motor by motor; no gain of a joint does that."""
    R = np.diag([100.0, 100, 100, 100, 50, 50, 50])
    R[6, 5] = 50.0
    recipe = Recipe(gear=tuple(map(tuple, R.tolist())))
    pair = tuple(
        run.replace(tau=(GAINS * (run.tau @ np.linalg.inv(R))) @ R, recipe=recipe) for run in runs
    )
    result = identify_gains(*pair, lib, BODY, friction=TERMS)
    np.testing.assert_allclose(result.estimate, GAINS, atol=1e-10)
    assert result.channels[6] == "motor 7"


def test_a_wrong_weight_and_a_circular_payload_are_pointed_at(runs, lib):
    """Property: true sensors and 3 kg given as 2.7 kg look like gains that are all 3/2.7 alike."""
    noise = NOISE * np.random.default_rng(4).normal(size=(2, *runs[0].tau.shape))
    pair = measured(runs, noise, gains=np.ones(7))
    wrong = identify_gains(*pair, lib, KnownPayload(2.7, COM, 0.9 * INERTIA), friction=TERMS)
    assert any("all gains equal 1.11" in note for note in wrong.notes)
    assert any(" kg instead of 2.7 kg has the same effect" in note for note in wrong.notes)
    fine = identify_gains(
        *pair, lib, KnownPayload(3.0, COM, INERTIA, identified=True), friction=TERMS
    )
    assert not any("all gains equal" in note for note in fine.notes)
    assert any("mass from a scale" in note for note in fine.notes)


def test_a_known_payload_is_numbers_or_a_file(lib, tmp_path, payload_pi):
    """Oracle: Pinocchio's π of the same body; the file and the numbers tell one payload."""
    words = read_known_payload("3,0.01,0.02,0.05,0.004,0.005,0.003,0.0001,0.0002,0.0003")
    np.testing.assert_array_equal(np.diag(words.inertia), np.diag(INERTIA))
    assert words.inertia[0, 1] == words.inertia[1, 0] == 1e-4
    assert (words.inertia[0, 2], words.inertia[1, 2]) == (2e-4, 3e-4)
    facts = {"mass": 3.0, "com": COM.tolist(), "inertia": INERTIA.tolist(), "link": "fr3_link7"}
    (tmp_path / "p.json").write_text(json.dumps(facts | {"sigma": [0.0]}))
    file = read_known_payload(str(tmp_path / "p.json"))
    assert (file.mass, file.link, file.identified) == (3.0, "fr3_link7", True)
    mount = mount_of(lib, file.link)
    pi = pi_of_body(mount.bodies, file.mass, file.com, file.inertia)
    np.testing.assert_allclose(np.linalg.solve(mount.to_frame, pi), payload_pi, atol=1e-15)


def test_the_command_writes_a_recipe_that_identify_takes(runs, lib, command, tmp_path):
    """Property: read with it, the log has the true torques; currents become N·m per A."""
    for run in measured(runs, gains=0.1 * GAINS, bias=0 * BIAS):
        write_recording(run, tmp_path / f"{run.name}.csv")
    plan = plan_of(tmp_path / "empty.csv")
    ampere = Signal("A", layout="csv", columns=plan.torque.columns, gain=1.0)
    (tmp_path / "amps.toml").write_text(recipe_text(plan.replace(torque=ampere)))
    words = (
        "gains",
        "empty.csv",
        "loaded.csv",
        "--robot",
        lib.folder,
        "--settings",
        f"coulomb_speed={WIDTH}",
    )
    known = ("--payload", "3,0.01,0.02,0.05,0.004,0.005,0.003,0,0,0")
    options = ("--settings", "friction=viscous,coulomb", "--recipe", "amps.toml")
    ran = command(*words, *known, *options, "--recipe-out", "new.toml")
    assert ran.code == 0, ran.err
    assert f"{10 / GAINS[0]:.4g} N·m/A" in ran.out
    assert "bias loaded" in ran.out
    assert load_recipe(tmp_path / "new.toml").torque.unit == "A"
    for run in runs:
        again = read_recording(tmp_path / f"{run.name}.csv", tmp_path / "new.toml")
        # Gains to 1e-10, as above.
        np.testing.assert_allclose(again.tau, run.tau, rtol=1e-9, atol=1e-9)
    low = command(*words, *known)
    assert "89.5 % low" in low.out
    assert "recipe: [torque] gain = [9.52" in low.out


def test_noise_of_few_samples_is_unbiased(runs, lib):
    """Monte Carlo: σ_j² of 2 × 50 samples behind 64 + 14 unknowns; its mean is the noise's.

    40 draws of 622 degrees of freedom: √(2/(622·40)) = 0.9 %, four of it; a count without the
    unknowns is 11 % low.
    """
    few = tuple(run.take(slice(0, 500, 10), "Fifty rows.") for run in runs)
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(40):
        pair = measured(few, NOISE * rng.normal(size=(2, *few[0].tau.shape)))
        problem = problem_of(*pair, lib, BODY, None, TERMS, None)
        ratios.append(solve(reduced(problem.blocks()), problem.n_samples, 2).noise ** 2 / NOISE**2)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.036)


def test_a_large_bias_is_as_unsure_as_its_gain(runs, lib):
    """Monte Carlo: b/g errs by −(b + mean τ)/g of the error of g, beside the noise of the mean.

    The biases are minus the mean torque, where that vanishes, and twice the mean torque. 40 trials:
    a standard deviation to 1/√80 = 11 %, of seven of them 5 % on average, some alike.
    """
    rng = np.random.default_rng(2)
    means = [run.tau.mean(axis=0) for run in runs]
    bias = np.array([-means[0], 2 * means[1]])
    outcome = []
    for _ in range(40):
        noise = NOISE * rng.normal(size=(2, *runs[0].tau.shape))
        outcome.append(identify_gains(*measured(runs, noise, bias=bias), lib, BODY, friction=TERMS))
    spread = np.std([each.bias for each in outcome], axis=0, ddof=1)
    sigma = np.mean([each.bias_sigma for each in outcome], axis=0)
    ratio = np.exp(np.mean(np.log(spread / sigma), axis=1))
    np.testing.assert_allclose(ratio, 1.0, atol=0.2)
