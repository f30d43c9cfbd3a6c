"""When accelerations fail: the reported noise and distortion are the true ones."""

import json
from dataclasses import replace

import numpy as np
import pytest

from runtime import Recording, identify
from runtime.errors import IdentificationError
from runtime.estimators.choice.regressor_choice import (
    BENT,
    NOISY,
    choose_regressor,
    differentiation_of,
    noisy_accelerations,
)
from runtime.inspection import inspect_log
from runtime.library import Library
from runtime.recording import Preparation, write_recording
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing import segments as clock
from tests.runtime.conftest import Command

QUIET = Preparation(filter="butterworth", cutoff_hz=5.0, trim_s=0.5)
"""Five times the band of the motion."""


@pytest.fixture(scope="module")
def clean(ideal_runs: tuple[Recording, ...]) -> Recording:
    return ideal_runs[0].replace(ddq=None)


def shaken(log: Recording, q: float = 0.0, dq: float = 0.0) -> Recording:
    """White noise on positions and velocities."""
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(2, *log.q.shape))
    return log.replace(q=log.q + q * noise[0], dq=log.dq + dq * noise[1])


@pytest.mark.parametrize(
    ("derivative", "noise"), [("position", {"q": 1e-3}), ("measured", {"dq": 2e-2})]
)
@pytest.mark.parametrize("cutoff", [None, 5.0, 20.0])
def test_the_share_of_noise(lib: Library, clean: Recording, derivative, noise, cutoff):
    """Oracle: the power of ddq with noise less ddq without, over that with it.

    2 f_c · 10 s independent numbers give a variance to √(2/100) = 14 % at 5 Hz, in four of seven
    joints worse; their mean to 6 %.
    """
    form = "butterworth" if cutoff else "none"
    usual = replace(QUIET, filter=form, cutoff_hz=cutoff, derivative=derivative)
    loud = shaken(clean, **noise)
    result = differentiation_of(loud, lib, usual)
    with_noise, without = (prepare(each, usual).ddq for each in (loud, clean))
    share = np.mean((with_noise - without) ** 2, axis=0) / np.mean(with_noise**2, axis=0)
    assert np.mean(result.noise / share) == pytest.approx(1.0, abs=0.15)
    assert differentiation_of(clean, lib, usual).noise.max() < 1e-4


def test_the_grid_is_made_once(lib: Library, clean: Recording, monkeypatch):
    """Property: clock and grid serve all three preparations; each took 6 ms of `identify`."""
    grids = []
    whole = clock.resample
    monkeypatch.setattr(clock, "resample", lambda *call: grids.append(call) or whole(*call))
    uneven = clean.take(np.r_[0:200, 202:300], "Two rows missing.")
    result = differentiation_of(uneven, lib, replace(QUIET, max_gap_s=0.1))
    assert result is not None
    assert len(grids) == 1


def test_holes_and_joints_at_rest_are_no_noise(lib: Library, clean: Recording):
    """Property: ν of a log with a hole stays rounding, and a still joint is not evaluated."""
    holed = clean.take(np.r_[0:400, 500:1001], "A hole.")
    assert differentiation_of(holed, lib, QUIET).noise.max() < 1e-4
    loud = shaken(clean, dq=2e-2)
    q, dq = loud.q.copy(), loud.dq.copy()
    q[:, 3], dq[:, 3] = q[0, 3], np.random.default_rng(1).normal(0, 2e-2, len(dq))
    result = differentiation_of(loud.replace(q=q, dq=dq), lib, replace(QUIET, cutoff_hz=20.0))
    assert result.noise[3] == 0.0
    assert (np.delete(result.noise, 3) > 0.01).any()


def test_a_fit_without_another_regressor_is_given_a_cutoff(lib: Library, clean: Recording):
    """Property: the noise is named with a cut-off at which it is within the bound, which bends the
    torque as well but is no noise; clean accelerations leave nothing to say.
    """
    loud = shaken(clean, dq=2e-2)
    usual = replace(QUIET, filter="none", cutoff_hz=None, derivative="measured")
    assert noisy_accelerations(clean, lib, usual) == ()
    (sentence,) = noisy_accelerations(loud, lib, usual)
    cutoff = float(sentence.rpartition("--settings cutoff=")[2].split()[0])
    assert noisy_accelerations(loud, lib, replace(QUIET, cutoff_hz=cutoff)) == ()


def test_the_bend(lib: Library, clean: Recording):
    """Oracle: the URDF's torque, filtered itself; nothing is bent far above the motion.

    δ compares with F S τ, here with F τ: S takes 1e-4 of a motion of 1 Hz at 100 Hz.
    """
    model = clean.replace(tau=lib.inverse_dynamics(clean.q, clean.dq, acceleration(clean), lib.pi0))
    for cutoff, expected in ((1.0, True), (2.0, True), (5.0, False)):
        usual = replace(QUIET, cutoff_hz=cutoff)
        done = prepare(model, usual)
        rigid = lib.inverse_dynamics(done.q, done.dq, done.ddq, lib.pi0)
        bend = np.linalg.norm(rigid - done.tau) / np.linalg.norm(done.tau)
        result = differentiation_of(clean, lib, usual)
        assert result.distortion == pytest.approx(bend, rel=0.1, abs=3e-4)
        assert (result.distortion > BENT) == result.fails == expected


def acceleration(log: Recording) -> np.ndarray:
    """Fourth-order differences of the measured velocity, the band of the motion is 1 Hz."""
    slope = np.gradient(log.dq, log.t, axis=0, edge_order=2)
    h = log.t[1] - log.t[0]
    v = log.dq
    slope[2:-2] = (v[:-4] - 8 * v[1:-3] + 8 * v[3:-1] - v[4:]) / (12 * h)
    return slope


def test_what_is_said(lib: Library, clean: Recording):
    """The sentence has the number, the reason and the option; auto takes it, and says so."""
    loud = shaken(clean, dq=2e-2)
    usual = replace(QUIET, cutoff_hz=20.0)
    assert choose_regressor(clean, lib, usual) == (usual, ())
    same, (sentence,) = choose_regressor(loud, lib, usual)
    assert same is usual
    assert "differentiation fails at 20 Hz" in sentence
    assert "is noise, which reduces its identified inertia" in sentence
    assert "--settings regressor=momentum --cutoff" in sentence
    taken, (chosen,) = choose_regressor(loud, lib, usual, replaces=True)
    assert taken.regressor == "momentum"
    assert f"--settings regressor=momentum --cutoff {taken.cutoff_hz:g} was taken" in chosen
    # The cut-off that is offered leaves as much noise as is harmless, to the form of the filter.
    again = differentiation_of(loud, lib, replace(usual, cutoff_hz=taken.cutoff_hz))
    assert again.noise.max() == pytest.approx(NOISY, rel=0.5)
    _, (bent,) = choose_regressor(clean, lib, replace(QUIET, cutoff_hz=1.0))
    assert "the low-pass of q and dq changes the torque" in bent
    assert "--cutoff 1, which needs no accelerations" in bent


@pytest.mark.parametrize(
    "change",
    [{"regressor": "momentum"}, {"filter": "average", "cutoff_hz": None, "window_s": 0.05}],
)
def test_nothing_is_said_of_what_is_not_done(lib: Library, clean: Recording, change):
    """Without derivatives, and behind filters whose gain nobody computed."""
    assert differentiation_of(clean, lib, replace(QUIET, **change)) is None
    with_ddq = clean.replace(ddq=np.zeros_like(clean.q))
    assert differentiation_of(with_ddq, lib, QUIET) is None


def test_commands(lib: Library, noisy: Recording, tmp_path, command: Command):
    """`identify` notes it, `--settings regressor=auto` takes momentum, the doctor warns of it."""
    log = noisy.replace(ddq=None, dq=None, q=np.round(noisy.q * 40) / 40)  # 250 counts per turn
    write_recording(log, tmp_path / "log.csv")
    said = ("identify", "log.csv", "--friction", "viscous,coulomb,offset", "--cutoff", "5")
    notes = {}
    for form in ("acceleration", "auto"):
        ran = command(*said, "--settings", f"regressor={form}", "--out", form)
        assert ran.code == 0, ran.err
        facts = json.loads((tmp_path / form / "result.json").read_text())
        (notes[form],) = (w for w in facts["warnings"] if "differentiation fails" in w)
    assert "needs no accelerations" in notes["acceleration"]
    assert "was taken" in notes["auto"]
    result = inspect_log(tmp_path / "log.csv", lib)
    kinds = [f.kind for f in result.findings]
    assert "differentiation" in kinds


def test_a_log_that_nobody_filtered(lib: Library, clean: Recording, pi_true, monkeypatch) -> None:
    """Oracle: the torque of the true links; without a low-pass, noise takes the inertias.

    What is stated stays, and a log without noise too; where no cut-off can be chosen, the noise is
    named.
    """
    loud = shaken(clean, dq=2e-2)
    made = {
        "chosen": identify(loud, lib, friction=(), refit=False),
        "stated": identify(loud, lib, friction=(), refit=False, regressor="acceleration"),
        "quiet": identify(clean, lib, friction=(), refit=False),
    }

    def refuse(*_: object) -> None:
        raise IdentificationError("too few equations")

    monkeypatch.setattr("runtime.estimators.choice.regressor_choice.choose_cutoff", refuse)
    made["refused"] = identify(loud, lib, friction=(), refit=False)
    said = {name: " ".join(result.notes) for name, result in made.items()}
    assert [name for name in said if "cut-off" in said[name]] == ["chosen"]
    assert "of the power of ddq of" in said["chosen"]
    exact = prepare(clean, QUIET)
    motion = exact.q, exact.dq, exact.ddq
    tau = lib.inverse_dynamics(*motion, pi_true)
    errors = {k: np.linalg.norm(lib.inverse_dynamics(*motion, made[k].pi) - tau) for k in made}
    assert errors["chosen"] < errors["stated"] / 20
    assert "differentiation fails without a low-pass" in said["refused"]
