"""Contacts of a real arm: none in free motion, pushes that we add are found in time."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording, write_recording
from runtime.library import Library
from runtime.monitoring.model import MonitoredModel, model_of
from runtime.monitoring.noise import (
    AlarmRate,
    ObserverNoise,
    _fast,
    noise_of_observer,
    read_held_out,
)
from runtime.monitoring.observation import (
    Detector,
    both_torques,
    observation_of,
    signals_of,
    slow_speeds,
    usual_torque,
)
from runtime.monitoring.observer import ObserverSettings, contacts_of, wrench_at
from runtime.recording import Friction, Preparation
from runtime.recording.settings import JointMotion
from tests.oracle import pinocchio_model
from tests.runtime.conftest import Command
from tests.runtime.monitoring.conftest import Monitored

PUSHES = ((1, 2.0, 14.0), (1, -2.0, 16.0), (5, 0.6, 15.0), (5, -0.6, 18.0))
"""Joint, torque [N·m] and instant [s] of pushes of 0.3 s."""


def observed(command: Command, log: Path, folder: Path, *words: object) -> dict:
    """JSON of `observe`."""
    rate = ("--settings", "false_alarms=1 per hour")
    ran = command("observe", log, "--model", folder, *rate, "--json", *words)
    assert ran.code == 0, ran.err
    return json.loads(ran.out)


UR10 = """[time]
unit = "ms"
layout = "csv"
column = 0
from_zero = true

[position]
unit = "deg"
layout = "csv"
columns = [1, 2, 3, 4, 5, 6]

[torque]
unit = "A"
layout = "csv"
columns = [13, 14, 15, 16, 17, 18]
gain = [13.0, 13.0, 10.0, 9.0, 9.0, 9.0]

[preparation]
max_gap_s = 0.05
grid_hz = 100.0
filter = "butterworth"
cutoff_hz = 5.0
"""
"""Positions and currents with stamps that jitter by 2 ms. Torques are in units of the gains, which
the maker does not state: their size is that of gears of 100 and motors of .1 N·m/A."""
IMPACTS = {"Drift00_NF_1": 8.101, "Drift00_NF_2": 8.180}
"""Instants at which the force that the robot states exceeds 10 N, without its mean before [s]."""


def test_impacts_faster_than_the_calibration(
    command: Command, robot: Callable[[str], Library], shared_data: Path, tmp_path: Path
) -> None:
    """Oracle, real data: impacts at 4 °/s, calibrated on free sweeps at 1 °/s without speeds.

    20 ms are two samples of these logs. r has alarms up to .5 s before two of these impacts. A UR5
    serves for the UR10 of the logs: the base turns about the vertical against friction alone.
    """
    arm, logs = robot("ur5"), shared_data / "data" / "ur_collisions"
    (tmp_path / "ur.toml").write_text(UR10)
    words = ["--robot", arm.folder, "--recipe", tmp_path / "ur.toml"]
    ran = command(
        "identify", logs / "Axis_5_1.csv.gz", *words, "--out", "arm", "--settings", "report=false"
    )
    assert ran.code == 0, ran.err
    for free in ("Axis_1_1", "Axis_1_2"):
        words += ["--settings", f"calibrate={logs / free}.csv.gz"]
    for name, instant in IMPACTS.items():
        log = logs / f"{name}.csv.gz"
        first = observed(command, log, tmp_path / "arm", *words, "--out", name)["contacts"][0]
        assert first["joint"] == arm.joint_names[0], name
        assert 0 < first["time_s"] - instant < 0.02, name


@pytest.mark.usefixtures("drawn")
def test_free_motion_of_a_real_arm_raises_no_alarm(
    command: Command, monitored: Monitored, rest_file: Path, tmp_path: Path
) -> None:
    """Oracle, real data: no contact in the part that the model has not seen; files are written."""
    facts = observed(
        command,
        rest_file,
        monitored.folder,
        "--out",
        "seen",
        "--free",
        rest_file,
        "--settings",
        "mcap=true",
    )
    assert (facts["alarms"], facts["contacts"]) == (0, [])
    assert facts["free_motion"]["alarms"] == 0
    assert facts["notes"] == []
    assert facts["false_alarms"]["by_stretches_per_hour"] > 1.0  # the noise of this log varies
    arrays = np.load(tmp_path / "seen" / "external_torque.npz")
    assert arrays["r"].shape == arrays["sigma"].shape == (len(arrays["t"]), 7)
    assert (arrays["sigma"] > 0).all()
    assert len(facts["thresholds"]) == 7
    picture = (tmp_path / "seen" / "external_torque.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) > 10_000
    names = sorted(path.name for path in (tmp_path / "seen").iterdir())
    data, code = ["contacts.json"], ["observer.c", "observer.h"]
    pictures = [f"external_torque.{kind}" for kind in ("mcap", "npz", "plotjuggler.xml", "png")]
    assert names == [*data, "example_observer.c", *pictures, *code, "settings.toml"]


def test_pushes_on_a_real_arm_are_found(
    command: Command, monitored: Monitored, rest_of_log: Recording, tmp_path: Path
) -> None:
    """Oracle, real data: joint, sign and size of pushes that we add, each within 30 ms.

    A motor that works against a push from outside has the torque of the push added with the other
    sign. The size is a median of 0.3 s, in which σ of slow errors is 0.17 and 0.03 N·m.
    """
    tau, t = rest_of_log.tau.copy(), rest_of_log.t
    for j, size, start in PUSHES:
        tau[(t >= start) & (t < start + 0.3), j] -= size
    write_recording(rest_of_log.replace(tau=tau), tmp_path / "pushed.npz")
    facts = observed(
        command, tmp_path / "pushed.npz", monitored.folder, "--settings", "link=fr3_link7"
    )
    contacts = facts["contacts"]
    assert len(contacts) == len(PUSHES)
    for j, size, start in PUSHES:
        (contact,) = [c for c in contacts if abs(c["time_s"] - start) < 0.1]
        assert contact["joint"] == f"fr3_joint{j + 1}"
        assert contact["direction"] == np.sign(size)
        # The clock of this log jitters by some milliseconds about the repaired one.
        assert -0.005 < contact["time_s"] - start < 0.03
        assert contact["torque"] == pytest.approx(size, abs=3 * (0.17 if j == 1 else 0.03))
        assert contact["wrench"]["link"] == "fr3_link7"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--settings", "false_alarms=rarely"), "such as '1 per hour'"),
        (("--settings", "within=0.001"), "raise the setting within"),
        (("--settings", "link=hand"), "correct the setting link"),
    ],
)
def test_bad_options_are_one_sentence(
    words: tuple[str, ...],
    sentence: str,
    command: Command,
    monitored: Monitored,
    rest_file: Path,
    rest_of_log: Recording,
    tmp_path: Path,
) -> None:
    """Property: exit code 2, one sentence, and nothing is written."""
    tau = rest_of_log.tau + (rest_of_log.t[:, None] > 18) * np.eye(7)[1] * 9
    write_recording(rest_of_log.replace(tau=tau), tmp_path / "log.npz")
    ran = command("observe", "log.npz", "--model", monitored.folder, *words, "--out", "new")
    assert ran.code == 2
    assert sentence in ran.err
    assert "Traceback" not in ran.err
    assert not (tmp_path / "new").exists()


def test_a_slow_motion_of_unknown_friction_is_no_rest(lib: Library) -> None:
    """Oracle: half of 0.02 rad/s, the speed at rest, against twice ε of a known dry friction."""
    terms = Friction(("offset", "coulomb"), 0.05)
    phi = np.ones((7, 2))
    phi[3:, 1] = 0.0
    model = MonitoredModel(np.zeros(43), terms, phi, Preparation())
    np.testing.assert_allclose(slow_speeds(lib, model), [0.1] * 3 + [0.01] * 4)


def test_contacts_have_a_hysteresis() -> None:
    """Oracle: crossings closer than 50 ms are one contact; a later one and another sign are new."""
    t = np.arange(1000) / 1000
    r = np.zeros((1000, 1))
    r[100:150] = 3.0
    r[110:112] = 1.6  # above half of the threshold: still the same contact
    r[170:180] = 2.5  # 20 ms after the first one: the same contact
    r[500:600] = -4.0
    one = np.ones_like(r)
    first, second = contacts_of(t, r, one, 2 * one, ["j"], 0.01)
    assert (first.time_s, second.time_s) == pytest.approx((0.1, 0.5))
    assert (first.torque, second.torque) == pytest.approx((3.0, -4.0))
    assert (first.direction, second.direction) == (1, -1)
    assert first.end_s == pytest.approx(0.18)


def test_wrench_of_a_push_at_the_last_link(lib: Library) -> None:
    """Oracle: Pinocchio's Jacobian of the link, and the wrench from J' w, where J has rank six."""
    import pinocchio

    q = lib.home + 0.3
    w = np.array([10.0, -5.0, 3.0, 0.4, 0.2, -0.3])
    model = pinocchio_model(lib.urdf())
    data = model.createData()
    jacobian = pinocchio.computeFrameJacobian(
        model, data, q, model.getFrameId("fr3_link7"), pinocchio.LOCAL_WORLD_ALIGNED
    )
    np.testing.assert_allclose(lib.frame_jacobian(q, "fr3_link7"), jacobian, atol=1e-12)
    wrench = wrench_at(lib, q, jacobian.T @ w, "fr3_link7")
    assert wrench.rank == 6
    np.testing.assert_allclose([*wrench.force, *wrench.moment], w, atol=1e-9)
    assert wrench_at(lib, q, np.ones(7), "fr3_link3").rank == 3


@pytest.mark.parametrize(
    ("filter_of_log", "limit"), [({"cutoff_hz": 10.0}, 6.0), ({"filter": "none"}, 10.0)]
)
def test_residuals_count_below_the_filter_of_their_log(
    filter_of_log: dict[str, float], limit: float, lib: Library, monitored: Monitored
) -> None:
    """Property: above it r of the observed log counts; accelerations of a raw log never do."""
    model = model_of(monitored.saved, lib)
    preparation = dataclasses.replace(model.preparation, **filter_of_log)
    changed = dataclasses.replace(model, preparation=preparation)
    held_out = read_held_out(monitored.folder, changed)
    assert held_out.limit_hz == pytest.approx(limit)
    assert not held_out.is_used.all()  # reversals are left out


def test_unknown_first_state_of_dahl_friction_raises_no_threshold(
    lib: Library, monitored: Monitored, tmp_path: Path
) -> None:
    """Property: an error F exp(−travel/z_c) after every hole is left out of the largest residual.

    What remains is the 1 % of F that counts as forgotten, and twice as much beyond the low-pass.
    """
    model = model_of(monitored.saved, lib)
    terms = Friction(("dahl",), dahl_stroke=0.01)
    changed = dataclasses.replace(model, terms=terms, phi=np.ones((7, 1)))
    t = np.arange(600) / 100
    t[300:] += 1.0  # a hole: the state is unknown again
    dq = np.full((600, 7), 0.1)
    travel = 0.1 * (t - np.where(t < 3.5, 0.0, t[300]))
    rest = np.repeat(np.exp(-travel / 0.01)[:, None], 7, axis=1)
    np.savez(tmp_path / "predictions.npz", t=t, dq=dq, measured=rest, after=np.zeros_like(rest))
    held_out = read_held_out(tmp_path, changed)
    settings = ObserverSettings(100.0, 50.0)
    noise = noise_of_observer(settings, held_out, t, np.zeros((600, 7)))
    assert (noise.largest < 0.03).all()
    assert held_out.is_used.mean() > 0.7  # of 3 s each .46 s of travel and .1 s beside it


def test_variances_of_noise_model_and_session_count_once(
    lib: Library, monitored: Monitored, rest_of_log: Recording
) -> None:
    """Oracle: σ² is the sum of three variances, that of the model at rest ‖Y_b(q) L‖² of gravity.

    The threshold is z σ with what does not follow a variance, where it is above the least one.
    """
    model = model_of(monitored.saved, lib)
    still = rest_of_log.take(slice(0, 300), "still")
    q = np.repeat(still.q[:1] + 0.2, 300, axis=0)
    noise = np.random.default_rng(0).normal(0, 0.1, q.shape)
    log = still.replace(t=np.arange(300) / 200, q=q, dq=0 * q, tau=noise)
    root = np.zeros((len(model.beta) + model.phi.size, 2))
    root[: len(model.beta)] = 3 * np.random.default_rng(1).normal(size=(len(model.beta), 2))
    settings = ObserverSettings(200.0, 100.0)
    spread = ObserverNoise(*np.full((2, 7), 0.1), np.full(7, 0.01), np.zeros(7), np.ones((1, 7)))
    rate = AlarmRate("1 per hour", 1 / 3600)
    detector = Detector(model, settings, 0.025, rate, spread, np.full(7, 5.0), root)
    seen = signals_of(lib, detector, log)
    r, _, features = both_torques(lib, model, settings, log)
    _, session = usual_torque(r, features, spread.sigma, 200.0)
    y = lib.base_regressor(q, 0 * q, 0 * q)
    by_model = np.sum((y @ root[: len(model.beta)]) ** 2, axis=2)
    known = np.isfinite(r)
    expected = spread.sigma**2 + by_model + session
    np.testing.assert_allclose((seen.sigma**2)[known], expected[known], rtol=1e-6)
    found = observation_of(lib, detector, seen)
    others = detector.share * seen.extra + seen.rest
    np.testing.assert_allclose(
        (found.threshold - others)[known], 5 * np.sqrt(expected[known]), rtol=1e-6
    )


def test_a_band_counts_friction_with_a_memory_as_dry_friction(
    lib: Library, monitored: Monitored
) -> None:
    """Oracle: the sign of a speed of ten times the width of the smooth one."""
    model = dataclasses.replace(
        model_of(monitored.saved, lib), terms=Friction(("dahl",), 0.03), phi=np.ones((7, 1))
    )
    dq = 0.3 * np.array([[1.0, -1, 1, -1, 1, -1, 1]])
    _, rows = model.rows(lib, JointMotion(dq, lib.home[None], lib=lib))
    np.testing.assert_allclose(rows[0, :, -7:], -np.diag(np.sign(dq[0])), atol=1e-8)


def test_noise_of_sensors_leaves_short_stretches_out() -> None:
    """Property: half a second between two gaps of the clock has no part in the variance."""
    rng = np.random.default_rng(0)
    t = np.arange(2100) / 200 + np.where(np.arange(2100) < 2000, 0.0, 5.0)
    r = rng.normal(0, np.where(t < 10, 0.1, 0.2)[:, None], (2100, 2))
    whole, alone = (_fast(200.0, t[:end], r[:end], 10.0) for end in (2100, 2000))
    for a, b in zip(whole, alone, strict=True):
        np.testing.assert_array_equal(a, b)
