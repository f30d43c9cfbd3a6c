"""Settings of all logs on a free base: methods, friction of measured torque, robust weights."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RuntimeFault
from runtime.estimators.prior_file import read_prior
from runtime.estimators.regression.factor import reduce
from runtime.identification.expected_accuracy.expected import expected_of_walk, named_of_walk
from runtime.identification.identify import identify
from runtime.identification.statistics_file import read_statistics
from runtime.library import Library, to_pinocchio_order
from runtime.recording.free_base import free_base_of
from runtime.recording.preprocessing.segments import interpolate
from tests.free_base_logs import HALF, Experiment, VirtualLog, virtual_log
from tests.robots import DATA
from tests.runtime.conftest import Command

Arrays = dict[str, np.ndarray]
HOPPER = (DATA / "hopper.urdf").read_text()
VISCOUS, COULOMB = np.array([0.5, 2.0, 0.3]), np.array([1.0, 1.5, 0.8])
DELAY_S = 0.006


@pytest.fixture(scope="module")
def log() -> VirtualLog:
    return virtual_log(HOPPER, ("left_foot", "right_thigh"), 0)


@pytest.fixture(scope="module")
def rubbing(log: VirtualLog) -> Arrays:
    """Torques measured at the motors, 6 ms after the motion, and wrenches, with noise."""
    a, rng = dict(log.arrays), np.random.default_rng(0)
    tau = a["tau"] + VISCOUS * a["dq"] + COULOMB * np.tanh(a["dq"] / 0.05)
    a["tau"] = interpolate(a["t"] + DELAY_S, a["t"], tau) + 0.02 * rng.normal(size=tau.shape)
    a["contact_wrench"] = a["contact_wrench"] + 0.1 * rng.normal(size=a["contact_wrench"].shape)
    return a


def true_beta(lib: Library, log: VirtualLog) -> np.ndarray:
    order = np.argsort(to_pinocchio_order(np.arange(10.0)))
    return lib.base_matrix @ log.pi.reshape(-1, 10)[:, order].ravel()


@pytest.mark.parametrize(
    ("method", "rows", "tolerance"),
    # Least squares ends at rounding of derivatives, 1e-6; the path of pc-ols within 1e-4 of its
    # optimum, Levenberg and Adam at their thresholds. Rows of the joints excite 18 of 28.
    [
        *(("ols", "base", 1e-5), ("wls", "base", 1e-5), ("pc-ols", "base", 1e-2)),
        *(("lm", "base", 1e-2), ("adam", "base", 5e-2)),
        *(("pc-ols", "joints", 1e-2), ("lm", "joints", 1e-2), ("adam", "joints", 5e-2)),
    ],
)
def test_methods_recover_the_bodies(
    hopper: Library, log: VirtualLog, method: str, rows: str, tolerance: float
) -> None:
    """Oracle: bodies of Pinocchio, by six equations of the base and by three of the joints."""
    result = identify(free_base_of(log.arrays, "log"), hopper, method, rows=rows)
    assert result.record.method == method
    beta = true_beta(hopper, log)
    seen = np.array(result.record.uncertainty.beta_sigma) < 0.1 * np.abs(beta).max()
    change = hopper.base_matrix @ result.pi - beta
    assert np.linalg.norm(change[seen]) < tolerance * np.linalg.norm(beta)
    before, after = result.record.torque_rms.before, result.record.torque_rms.after
    assert np.linalg.norm(after) < 2 * tolerance * np.linalg.norm(before)


def test_friction_and_delay_of_measured_torque(
    hopper: Library, log: VirtualLog, rubbing: Arrays
) -> None:
    """Oracle: planted friction and delay are within four σ, and σ is small."""
    record = identify(
        free_base_of(rubbing, "log"), hopper, friction=("viscous", "coulomb"), delay="auto"
    ).record
    assert record.torque_source == "measured"
    assert abs(record.delay_s.value - DELAY_S) < 4 * record.delay_s.sigma + 1e-4
    for column, planted in enumerate((VISCOUS, COULOMB)):
        values, sigmas = (np.array(x)[:, column] for x in (record.friction.values,
                                                           record.friction.sigma))  # fmt: skip
        assert (np.abs(values - planted) < 4 * sigmas + 0.01 * planted).all()
        assert (sigmas < 0.15 * planted).all()
    # Without the columns friction is a part of the bodies.
    plain = identify(free_base_of(rubbing, "log"), hopper).record
    assert plain.friction is None
    assert plain.delay_s is None
    assert record.torque_error_percent.after_overall < (
        0.5 * plain.torque_error_percent.after_overall
    )


def test_friction_is_chosen_by_cross_validation(hopper: Library, rubbing: Arrays) -> None:
    """Property: viscous and dry friction that is there is chosen, and none where none is."""
    record = identify(free_base_of(rubbing, "log"), hopper, friction="auto").record
    assert {"viscous", "coulomb"} <= set(record.friction.columns)
    assert any("chosen by cross-validation" in note for note in record.warnings)
    still = rubbing | {"tau": rubbing["tau"] * 0}
    with pytest.raises(RuntimeFault, match="every torque of the joints is zero"):
        identify(free_base_of(still, "log"), hopper, rows="joints", friction="auto")


def test_outliers_count_less(hopper: Library, log: VirtualLog, rubbing: Arrays) -> None:
    """Property: with 3 % of false forces the robust estimate is nearer to the bodies."""
    wrench = rubbing["contact_wrench"].copy()
    wrench[100:110, 0, :3] += 200.0
    walk = free_base_of(rubbing | {"contact_wrench": wrench}, "log")
    beta, errors = true_beta(hopper, log), []
    for robust in (False, True):
        result = identify(walk, hopper, rows="base", robust=robust)
        errors.append(float(np.linalg.norm(hopper.base_matrix @ result.pi - beta)))
    assert errors[1] < 0.5 * errors[0]
    assert any(note.startswith("robust: ") for note in result.record.warnings)


def test_the_command_gives_the_digits_of_python(
    hopper: Library, rubbing: Arrays, tmp_path: Path, command: Command
) -> None:
    """Property: one road; statistics for fleet hold what the posterior knows of β."""
    path, out = tmp_path / "walk.npz", tmp_path / "out"
    np.savez(path, **rubbing)  # type: ignore[arg-type]
    words = ("--cutoff", "20", "--friction", "viscous", "--split", "0.5", "--method", "pc-ols")
    statistics = ("--settings", "save_statistics=true", "--settings", "report=false")
    done = command("identify", path, "--robot", hopper.folder, *words, *statistics, "--out", out)
    assert done.code == 0, done.err
    facts = json.loads((out / "result.json").read_text())
    result = identify(
        free_base_of(rubbing, "walk"), hopper, "pc-ols", cutoff=20.0, friction="viscous",
        split=HALF,
    )  # fmt: skip
    assert facts["pi"] == list(result.pi)
    known = read_statistics(out / "statistics.npz")
    assert (known.columns, known.joints) == (("viscous",), hopper.joint_names)
    part, whole = (
        reduce(each, 9)[0].factor
        for each in (known.statistics, result.posterior.information.statistics)
    )
    np.testing.assert_allclose(part.T @ part, whole.T @ whole, rtol=1e-6, atol=1e-6)


def test_more_of_the_same_walk(hopper: Library, tmp_path: Path, command: Command) -> None:
    """Oracle: σ that is predicted from a half is that of identify with the whole log."""
    log = virtual_log(HOPPER, ("left_foot", "right_thigh"), 5, Experiment(count=2400, rate_hz=50.0))
    rng = np.random.default_rng(1)
    whole = dict(log.arrays)
    for key, sigma in {"tau": 0.3, "contact_wrench": 3.0}.items():
        whole[key] = whole[key] + sigma * rng.normal(size=whole[key].shape)
    half = {key: value[:1200] if len(value) == 2400 else value for key, value in whole.items()}
    short, long = (identify(free_base_of(each, "log"), hopper) for each in (half, whole))
    seconds = long.evidence.seconds - short.evidence.seconds
    now, later, reached = (
        expected_of_walk(short),
        expected_of_walk(short, seconds),
        expected_of_walk(long),
    )
    for each in (now, later, reached):
        assert each.base is not None
    # Sines of the first half and of the whole excite alike: information differs by some 10 %.
    assert np.median(np.abs(later.base / reached.base - 1)) < 0.1
    assert later.base == pytest.approx(now.base * np.sqrt(0.5), rel=0.01)
    total = named_of_walk(short, now)["total mass"]
    assert total == pytest.approx(short.record.total_mass.sigma, rel=1e-9)
    path = tmp_path / "walk.npz"
    np.savez(path, **half)  # type: ignore[arg-type]
    words = ("predict", path, "--robot", hopper.folder, "--more", "same")
    done = command(*words, "--json")
    assert done.code == 0, done.err
    facts = json.loads(done.out)
    assert facts["total mass"] == pytest.approx(total, rel=1e-9)
    assert [step["seconds"] for step in facts["more"]] == [10.0, 30.0, 60.0]
    done = command(*words)
    assert "total mass to ±" in done.out
    for wrong in (("--noise", "3"), ("--more", "other.npz")):
        done = command(*words[:4], *wrong)
        assert (done.code, "free base; leave it out" in done.err) == (2, True), done.err


def test_a_fleet_of_walking_robots(hopper: Library, tmp_path: Path, command: Command) -> None:
    """Property: units give the prior of their type, which a short walk takes."""

    def walk_of(unit: int, wear: float, noise: float) -> Arrays:
        walk = virtual_log(HOPPER, ("left_foot", "right_thigh"), unit).arrays
        errors = noise * np.random.default_rng(unit).normal(size=walk["tau"].shape)
        return walk | {"tau": walk["tau"] + wear * VISCOUS * walk["dq"] + errors}

    for unit in range(3):
        path, out = tmp_path / f"u{unit}.npz", tmp_path / "units" / f"u{unit}"
        np.savez(path, **walk_of(unit, 1 + 0.1 * unit, 0.02))  # type: ignore[arg-type]
        words = ("--robot", hopper.folder, "--friction", "viscous", "--settings", "report=false")
        done = command("identify", path, *words, "--settings", "save_statistics=true", "--out", out)
        assert done.code == 0, done.err
    done = command("fleet", tmp_path / "units", "--robot", hopper.folder, "--out", "type.toml")
    assert done.code == 0, done.err
    prior = read_prior(tmp_path / "type.toml", hopper)
    assert prior.friction is not None
    np.testing.assert_allclose(
        prior.friction.mean[:, 0], 1.1 * VISCOUS, rtol=0.1
    )  # σ of a unit: 2 to 6 %
    # A quarter of a second hardly shows friction, which is that of the type then.
    whole = walk_of(3, 1.1, 0.5)
    few = {key: x[:40] if len(x) == len(whole["t"]) else x for key, x in whole.items()}
    record = identify(free_base_of(few, "log"), hopper, rows="all", prior=prior).record
    assert record.friction.columns == ("viscous",)
    alone = identify(free_base_of(few, "log"), hopper, rows="all", friction="viscous").record
    away = [np.abs(np.array(r.friction.values)[:, 0] / (1.1 * VISCOUS) - 1).max()
            for r in (record, alone)]  # fmt: skip
    assert away[0] < 0.3 * away[1]
    assert any("the inertial prior is that of 3 units of the fleet" in n for n in record.warnings)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"method": "nn"}, "sample by sample, .* use one of map"),
        ({"preset": "real"}, "sample by sample"),
        ({"rows": "base", "friction": "viscous"}, "belong to the torques of joints"),
        ({"rows": "base", "delay": "auto"}, "belong to the torques of joints"),
        ({"cutoff": "auto"}, "give --cutoff HZ"),
        ({"regressor": "momentum"}, "takes no regressor"),
        ({"encoder_bias": True}, "takes no encoder_bias"),
        ({"gain_sigma": 0.1}, "takes no gain_sigma"),
        ({"symmetric": ("left:right",)}, "give friction columns"),
        ({"symmetric": ("left:right",), "tie": True}, "one link per joint|mirrored about"),
        ({"tie": True}, "symmetric=LEFT:RIGHT"),
    ],
)
def test_settings_that_are_refused(
    hopper: Library, log: VirtualLog, settings: dict, sentence: str
) -> None:
    """Property: what the rows of a free base cannot use is named, with what to do."""
    with pytest.raises(RuntimeFault, match=sentence):
        identify(free_base_of(log.arrays, "log"), hopper, **settings)


def test_methods_without_a_prior_refuse_errors_of_sensors(hopper: Library, log: VirtualLog) -> None:
    """Property: the offset of a force exchanges with the mass, which only a prior limits."""
    arrays = {key: value for key, value in log.arrays.items() if key != "contact_wrench"} | {
        "contact_force_z": log.arrays["contact_wrench"][:, :, 2],
        "contact_force_z_sigma": np.array([1.0, 1.0]),
    }
    with pytest.raises(RuntimeFault, match="use map, or leave contact_force_z_sigma"):
        identify(free_base_of(arrays, "log"), hopper, "ols", rows="base")


def test_logs_and_robots_that_do_not_fit(hopper: Library, fr3: Library, log: VirtualLog) -> None:
    """Property: a walk needs a free base, a log of joints a fixed one."""
    walk = free_base_of(log.arrays, "log")
    with pytest.raises(RuntimeFault, match=r"the base of '.*' is fixed, so a log with the motion"):
        identify(walk, fr3)
    with pytest.raises(RuntimeFault, match="is free, and the log is one of joints alone"):
        identify(walk.joints, hopper)
    with pytest.raises(RuntimeFault, match="the setting rows belongs to robots with a free base"):
        identify(walk.joints, fr3, rows="all")
