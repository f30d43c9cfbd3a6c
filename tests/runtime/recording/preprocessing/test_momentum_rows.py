"""Rows without accelerations: exact at any cut-off, with all friction; who takes them."""

import json
from dataclasses import replace

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import IdentificationError
from runtime.estimators.methods import methods_from_statistics
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification import long_logs as blocks
from runtime.identification import metrics
from runtime.identification.long_logs import blocks_of
from runtime.identification.several_logs import NamedLog
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, write_recording
from runtime.recording.friction.coupled_motors import coupling_of_terms
from runtime.recording.friction.model import columns, torque
from runtime.recording.preprocessing import pipeline, prepare
from runtime.recording.preprocessing.pipeline import prepare_power
from runtime.recording.recipes.recipe_file import recipe_from_table
from runtime.recording.settings import JointMotion
from runtime.recording.streamed import open_streamed
from runtime.simulation import Plant, ideal
from tests.runtime.conftest import Command
from tests.runtime.motions import moving

# Simpson's rule over two steps of 10 ms misses h⁴/180 of a fourth derivative: 5e-8 of the torque
# of a motion below 1 Hz comes out, 2e-7 of the power, which moves twice as fast.
SIMPSON = 1e-6
GEAR = tuple(
    tuple(1.0 if i == j else 0.5 * (i == 5 and j == 4) for j in range(7)) for i in range(7)
)
TERMS = Friction(("viscous", "offset", "rotor", "motor_viscous", "motor_rotor"), gear=GEAR)
PLAIN = Friction(("viscous", "offset"))


def at(cutoff_hz: float, regressor: str = "momentum", **others: float) -> Preparation:
    return Preparation(filter="butterworth", cutoff_hz=cutoff_hz, regressor=regressor, **others)


def misfit(samples: Samples, lib: Library, pi: np.ndarray, phi: np.ndarray) -> float:
    rest = samples.rigid(lib, pi) + samples.friction(phi) - samples.tau
    return float(np.linalg.norm(rest) / np.linalg.norm(samples.tau))


@pytest.fixture(scope="module")
def rubbing(lib: Library, ideal_runs: tuple[Recording, ...], pi_true: np.ndarray):
    """A log without ddq of an arm with friction, rotors and a coupled motor, and its φ."""
    run = ideal_runs[0]
    phi = np.random.default_rng(3).uniform(0.1, 0.5, (lib.n_joints, len(TERMS.columns)))
    extra = torque(
        columns(JointMotion(run.dq, run.q, run.ddq), TERMS), phi, coupling_of_terms(TERMS)
    )
    return run.replace(tau=run.tau + extra, ddq=None), phi


def of_power(preparation: Preparation, log: Recording, lib: Library) -> Samples:
    make = prepare_power if preparation.regressor == "energy" else prepare
    return samples_of(make(log, preparation, TERMS, lib=lib), lib)


@pytest.mark.parametrize("regressor", ["momentum", "energy"])
@pytest.mark.parametrize("cutoff", [1.0, 10.0])
def test_rows_hold_at_any_cutoff_with_every_friction(lib, pi_true, rubbing, regressor, cutoff):
    """Oracle: π and φ of the simulation leave nothing, far below the band of the motion, too."""
    log, phi = rubbing
    samples = of_power(at(cutoff, regressor), log, lib)
    assert samples.tau.shape[1] == (1 if regressor == "energy" else lib.n_joints)
    assert misfit(samples, lib, pi_true, phi) < SIMPSON
    rows = samples.friction_rows()
    assert np.allclose(rows @ phi.ravel(), samples.friction(phi), atol=1e-9)


@pytest.mark.parametrize("regressor", ["acceleration", "momentum", "energy"])
def test_torques_of_known_springs_are_taken_away(lib, rubbing, regressor, monkeypatch):
    """Oracle: τ − k of a spring of constant torque, and its power −Σ k dq in rows of power."""
    plain = of_power(at(10.0, regressor), rubbing[0], lib)
    spring = np.arange(1.0, 8.0)
    monkeypatch.setattr(Library, "known_torque", lambda _, q: np.tile(spring, (len(q), 1)))
    taken = plain.tau - of_power(at(10.0, regressor), rubbing[0], lib).tau
    each = plain.dq @ spring[:, None] if regressor == "energy" else np.tile(spring, (len(taken), 1))
    np.testing.assert_allclose(taken, each, atol=1e-9)


def test_accelerations_do_not(lib, pi_true, rubbing):
    """The same log at 1 Hz: filtered q and dq, multiplied, are not the filtered product."""
    log, phi = rubbing
    samples = samples_of(prepare(log, at(1.0, "acceleration"), TERMS, lib=lib), lib)
    assert misfit(samples, lib, pi_true, phi) > 0.03  # 0.06 comes out


@pytest.mark.parametrize("regressor", ["momentum", "energy"])
def test_nothing_looks_across_a_hole(lib, pi_true, rubbing, regressor, monkeypatch):
    """Oracle as above, on a log with a hole; groups of columns and chunks of instants join."""
    monkeypatch.setattr(pipeline, "HELD", 20_000)
    monkeypatch.setattr(pipeline, "CHUNK", 99)  # 298 = 3 · 99 + 1: one row is left
    log, phi = rubbing
    holed = log.take(np.r_[0:300, 420:1000], "A hole.")
    samples = of_power(at(5.0, regressor), holed, lib)
    assert len(samples) == len(holed) - 4  # Simpson's rule takes both ends of two segments
    assert misfit(samples, lib, pi_true, phi) < SIMPSON


def test_regressors_of_a_long_log_stay_in_the_cache(lib, pi_true, rubbing, monkeypatch):
    """Property: at most 2 MiB at a time; fresh memory for each took seven times the kernel."""
    sizes = []
    whole = Library.momentum_regressor

    def measured(self, q, dq):
        pair = whole(self, q, dq)
        sizes.append(sum(rows.nbytes for rows in pair))
        return pair

    monkeypatch.setattr(Library, "momentum_regressor", measured)
    log = rubbing[0]
    pipeline.torque_of_rows(log, lib, lib.base_matrix @ pi_true)
    assert max(sizes) <= 2**21 < sum(sizes)


def test_velocity_from_positions(lib, pi_true, ideal_runs):
    """Oracle as above without dq: splines of the low-passed q, whose band is the motion's.

    The edges, where the filter of q knows one side only, are trimmed: 2e-6 is left of them.
    """
    log = ideal_runs[0].replace(ddq=None, dq=None)
    samples = samples_of(prepare(log, at(2.0, trim_s=1.0), lib=lib), lib)
    assert misfit(samples, lib, pi_true, np.zeros((7, 0))) < 1e-4


def test_decimated_and_without_rest_like_the_other_rows(lib, noisy):
    """Property: the instants are those of the usual preparation but for the ends."""
    kept = {"rate_hz": 50.0, "trim_s": 0.5, "rest_speed": 0.02}
    log = noisy.replace(ddq=None)
    usual, made = (
        prepare(log, at(5.0, form, **kept), PLAIN, lib=lib) for form in ("acceleration", "momentum")
    )
    assert made.ddq is None
    assert made.rows.shape == (len(made), 7, 43)
    # 50 Hz of 100 Hz begin with the first instant, which Simpson's rule has taken.
    assert abs(len(made) - len(usual)) <= 2


@pytest.fixture(scope="module")
def counted(lib: Library, trajectories, pi_true: np.ndarray) -> tuple[Recording, ...]:
    """Three runs at 12.5 Hz with friction and noise, without dq."""
    plant = Plant(pi_true, viscous=0.5, coulomb=0.3, torque_noise=0.05)
    rng = np.random.default_rng(2)
    return tuple(
        ideal(lib, each, plant, rate_hz=12.5, rng=rng).replace(dq=None, ddq=None)
        for each in trajectories
    )


def test_a_slow_log_is_identified_where_accelerations_fail(lib, counted, pi_true):
    """Oracle: β of the simulation; 0.8 % at best by ddq of 12.5 Hz, 0.3 % by momentum."""
    train, validation, test = counted
    beta = lib.base_matrix @ pi_true

    def error(form: str, cutoff: float) -> float:
        found = identify_recording(
            train,
            lib,
            preparation=at(cutoff, form, trim_s=0.5),
            friction=Friction(),
            validation=validation,
            test=test,
            certify=False,
        )
        return float(np.linalg.norm(found.beta - beta) / np.linalg.norm(beta))

    usual = min(error("acceleration", f_c) for f_c in (2.0, 3.0, 4.5))
    ours = [error("momentum", f_c) for f_c in (1.0, 2.0, 4.5)]
    assert max(ours) < 0.5 * usual


@pytest.fixture(scope="module")
def made(lib: Library, noisy: Recording):
    return noisy.replace(ddq=None)


@pytest.mark.parametrize("method", methods_from_statistics())
def test_methods_that_take_them(lib, made, pi_true, method):
    """Oracle: the torque of the simulation; each predicts it at 2 Hz below half a percent."""
    found = identify_recording(made, lib, method, preparation=at(2.0), friction=Friction())
    error = metrics.torque_error(found.test.tau, found.predict_recording(found.test))
    assert error.overall < 0.5
    assert found.test.ddq is None
    assert np.isfinite(found.gap)
    assert found.uncertainty.noise.shape == (7,)


def test_energy_is_weaker_but_right(lib, trajectories, pi_true):
    """Oracle: β of the simulation. One row per instant: 30 times the error of momentum, and from
    10 % of the URDF's torque error to 2 %; the report is about joints all the same.
    """
    plant = Plant(1.1 * pi_true, viscous=0.5, torque_noise=0.05)
    rng = np.random.default_rng(4)
    runs = [ideal(lib, each, plant, rng=rng).replace(ddq=None) for each in trajectories]
    found = identify_recording(
        runs[0],
        lib,
        preparation=at(10.0, "energy"),
        friction=Friction(("viscous",)),
        validation=runs[1],
        test=runs[2],
    )
    tau = found.test.tau
    assert tau.shape[1] == 7
    before, after = (
        metrics.torque_error(tau, each).overall
        for each in (found.before(found.test), found.predict_recording(found.test))
    )
    assert after < 0.4 * before
    assert found.weights.shape == (1,)
    assert np.isfinite(found.gap)
    assert found.uncertainty.noise.shape == found.uncertainty.white.shape == (7,)
    # The noise of the low-passed torque, 0.05 N·m √(10/50), and what the model still lacks.
    assert (found.uncertainty.noise < 0.5).all()
    # Y_b K is Y to the rounding of K, so that rows have the band of their motion.
    s = samples_of(prepare(runs[2], at(10.0, "acceleration")), lib)
    band = found.uncertainty.model_band(lib, s.q, s.dq, s.ddq)
    assert found.uncertainty.band_of(lib, s) == pytest.approx(band, rel=1e-6)


def test_several_logs_with_a_payload(lib):
    """Oracle: masses with and without the payload that is told; energy has no offsets to tell."""
    ball = np.zeros((7, 10))
    ball[6] = (1.5, 0.0, 0.0, 0.18, 0.0216, 0.0216, 0.001, 0, 0, 0)
    logs = [moving(lib, 3000), moving(lib, 3000, payload=ball.ravel())]
    usual = at(5.0, rate_hz=100.0)
    sessions = [
        NamedLog(name, log, usual, carried)
        for name, log, carried in zip("ab", logs, (None, ball.ravel()), strict=True)
    ]
    found = identify_recording(sessions, lib, friction=Friction())
    agreement = found.agreement
    assert max(log.after_overall for log in agreement.leave_one_out) < 1.0
    assert found.test.ddq is None  # nothing was differentiated after all
    beta = lib.base_matrix @ lib.pi0
    assert np.linalg.norm(found.beta - beta) < 0.01 * np.linalg.norm(beta)
    wrong = [replace(each, preparation=replace(usual, regressor="energy")) for each in sessions]
    with pytest.raises(IdentificationError, match="use --settings regressor=momentum"):
        identify_recording(wrong, lib, friction=Friction())
    mixed = [sessions[0], replace(sessions[1], preparation=at(5.0, "acceleration"))]
    with pytest.raises(IdentificationError, match="give all of them one regressor"):
        identify_recording(mixed, lib, friction=Friction())


def test_blocks_of_a_streamed_log(lib, tmp_path, monkeypatch):
    """Oracle: the rows of the whole log, but for the 1e-13 that filters leave beyond the overlap,
    times the gain of a derivative at 500 Hz: 1e-10 comes out.
    """
    monkeypatch.setattr(blocks, "BLOCK", 2048)
    log, usual = moving(lib, 6000), at(10.0, rate_hz=100.0, max_gap_s=6e-3)
    write_recording(log, tmp_path / "x.npz")
    streamed = open_streamed(tmp_path / "x.npz")
    parts = list(blocks_of(streamed, lib, usual, PLAIN).recordings())
    whole = prepare(log, usual, PLAIN, lib=lib)
    assert len(parts) > 2
    for key in ("t", "rows", "tau", "columns"):
        together = np.concatenate([getattr(part, key) for part in parts])
        expected = getattr(whole, key)
        assert np.abs(together - expected).max() < 1e-9 * np.abs(expected).max()
    # The fit reads stored blocks again; both fits see the same rows but for the edges of windows.
    found = identify_recording(streamed, lib, preparation=usual, friction=PLAIN)
    same = identify_recording(log, lib, preparation=usual, friction=PLAIN)
    np.testing.assert_allclose(found.beta, same.beta, atol=1e-3 * np.abs(same.beta).max())
    with pytest.raises(IdentificationError, match="--settings stream=false"):
        identify_recording(streamed, lib, preparation=replace(usual, regressor="energy"))


def test_a_recipe_may_ask_for_them(lib, made):
    """`evaluate` and every other reader of recipes take the rows that [preparation] names."""
    table = {"preparation": {"filter": "butterworth", "cutoff_hz": 2.0, "regressor": "momentum"}}
    data = prepare(made.replace(recipe=recipe_from_table(table)), lib=lib)
    assert data.rows is not None


def test_the_command(lib, made, tmp_path, command: Command):
    """`identify --settings regressor=momentum --cutoff 2` and `compare`, which tells who cannot."""
    write_recording(made, tmp_path / "log.csv")
    said = ("log.csv", "--friction", "viscous,coulomb,offset", "--cutoff", "2")
    ran = command("identify", *said, "--settings", "regressor=momentum", "--out", "out")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["torque_error_percent"]["after_overall"] < 0.5
    assert any("balance of momentum" in line for line in facts["recording"]["history"])
    assert any("uses momenta and no accelerations" in line for line in facts["warnings"])
    ran = command("identify", "log.csv", *said, "--settings", "regressor=auto", "--out", "two")
    assert ran.code == 0, ran.err  # the form is that of the first log
    sessions = json.loads((tmp_path / "two" / "result.json").read_text())["sessions"]
    assert len(sessions["names"]) == 2
    ran = command("compare", *said, "--settings", "regressor=energy", "--methods", "pc-ols,nn")
    assert ran.code == 0, ran.err
    rows = json.loads((tmp_path / "results" / "log-compare" / "compare.json").read_text())["rows"]
    assert [row["outcome"] for row in rows] == ["ran", "not run"]
    ran = command("identify", *said, "--settings", "regressor=power")
    assert ran.code == 2
    assert "regressor expects one of acceleration, momentum, energy" in ran.err
