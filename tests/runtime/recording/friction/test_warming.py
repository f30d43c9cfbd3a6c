"""Viscous friction that changes with the temperature or the time of operation."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime import Observer, write_recording
from runtime.errors import RecordingError
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.monitoring.model import model_of
from runtime.recording import Friction, Preparation, Recording, read_recording
from runtime.recording.friction.model import columns as friction_columns
from runtime.recording.preprocessing import prepare
from runtime.recording.settings import COLUMNS, JointMotion
from runtime.recording.streamed import open_streamed
from tests.plugins import add_toy
from tests.runtime.conftest import Command
from tests.runtime.motions import COULOMB, SPEED, VISCOUS, moving

NAMES = ("viscous", "coulomb", "offset", "viscous_temperature")
TERMS = Friction(NAMES, SPEED)
OF_KELVIN = -0.004 * np.arange(1.0, 8.0)
"""Change of the viscous friction of each joint [N·m·s/rad per K]."""
NOISE = 0.15
"""Torque noise of a seed [N·m]; that of `moving`, 0.05, is the same in all logs."""
OF_HOUR = -6.0 * np.arange(1.0, 8.0)
RECIPE = """
[extra.temperature]
columns = ["temperature1", "temperature2", "temperature3", "temperature4", "temperature5",
           "temperature6", "temperature7"]
unit = "degC"
"""


def warm_log(lib: Library, seed: int = 0, first: float = 20.0) -> Recording:
    """A log whose motors warm up by 10 to 25 K, each in its time, with noise of its own."""
    log = moving(lib, 4000, 200.0)
    rng = np.random.default_rng(seed)
    rise, pace = rng.uniform(10, 25, 7), rng.uniform(5, 15, 7)
    warm = first + rise * (1 - np.exp(-log.t[:, None] / pace))
    more = OF_KELVIN * (warm - 25.0) * log.dq + rng.normal(0, NOISE, log.q.shape)
    return log.replace(tau=log.tau + more, signals={"temperature": warm})


def test_coefficients_and_their_intervals(lib: Library) -> None:
    """Monte Carlo: 95 % intervals of seven joints over twelve logs; truth by joint."""
    inside, values = [], []
    for seed in range(12):
        result = identify_recording(warm_log(lib, seed), lib, friction=TERMS, refit=True)
        sigma = result.friction_sigma
        truth = np.column_stack([[VISCOUS] * 7, [COULOMB] * 7, [0.0] * 7, OF_KELVIN])
        inside.append(np.abs(result.phi - truth) < 1.96 * sigma)
        values.append(result.phi[:, 3])
    # 84 intervals of each column, of which one log's are not independent: 95 ± 5 %.
    assert np.mean(inside, axis=(0, 1)).min() > 0.88
    # Noise of 0.16 N·m over 4000 rows and changes of 7 K: a few 1e-4.
    np.testing.assert_allclose(np.mean(values, axis=0), OF_KELVIN, atol=1e-3)


def test_columns_are_slopes_of_the_viscous_torque() -> None:
    """Derivative: differences by coefficient, temperature and time; zero at the references."""
    rng, h = np.random.default_rng(1), 1e-3
    dq, warm = rng.normal(size=(2, 20, 3))

    def column(name: str, signal: str, values: np.ndarray) -> np.ndarray:
        motion = JointMotion(dq, signals={signal: values})
        return friction_columns(motion, Friction((name,)))[..., 0]

    for name, signal, unit, zero in (
        ("viscous_temperature", "temperature", 1.0, 25.0),
        ("viscous_uptime", "uptime", 3600.0, 0.0),
    ):
        slope = (column(name, signal, warm + h) - column(name, signal, warm - h)) / (2 * h)
        np.testing.assert_allclose(slope, dq / unit, rtol=1e-8)
        assert not column(name, signal, np.full_like(dq, zero)).any()


@pytest.mark.parametrize("streamed", [False, True])
def test_drift_of_a_log_whose_clock_starts_anywhere(lib, tmp_path, streamed) -> None:
    """Oracle: the true drift per hour since the start, in all parts, of a streamed log too."""
    log = moving(lib, 4000, 200.0)
    log = log.replace(tau=log.tau + OF_HOUR * (log.t / 3600)[:, None] * log.dq, t=log.t + 5e4)
    write_recording(log, tmp_path / "log.npz")
    terms = Friction(("viscous", "coulomb", "offset", "viscous_uptime"), SPEED)
    if streamed:
        block = open_streamed(tmp_path / "log.npz").block(2000, 4000)
        phi = prepare(block, Preparation(), terms, lib=lib).columns[..., 3]
        np.testing.assert_allclose(phi, (block.t - 5e4)[:, None] / 3600 * block.dq, atol=1e-9)
        return
    result = identify_recording(read_recording(tmp_path / "log.npz"), lib, friction=terms)
    error = np.abs(result.phi[:, 3] - OF_HOUR) / result.friction_sigma[:, 3]
    assert error.max() < 3.5


def test_commands_with_and_without_the_temperature(lib, tmp_path: Path, command) -> None:
    """`identify`, `evaluate`, `observe`, `export`; one sentence where T is missing."""
    (tmp_path / "recipe.toml").write_text(RECIPE)
    write_recording(warm_log(lib), tmp_path / "warm.csv")
    write_recording(warm_log(lib, 1, first=5.0), tmp_path / "cold.csv")
    columns, recipe = ",".join(NAMES), ("--recipe", "recipe.toml")
    ran = command("identify", "warm.csv", *recipe, "--friction", columns, "--out", "with")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "with" / "result.json").read_text())
    values, ends = (np.array(facts["friction"][key]) for key in ("values", "interval_95"))
    np.testing.assert_allclose(values[:, 3], OF_KELVIN, atol=3e-3)
    assert (ends[:, 3, 1] - ends[:, 3, 0] < 1e-2).all()
    plain = ",".join(NAMES[:3])
    assert command("identify", "warm.csv", "--friction", plain, "--out", "without").code == 0
    errors = []
    for name, more in (("with", recipe), ("without", ())):
        ran = command("evaluate", name, "cold.csv", *more, "--json")
        assert ran.code == 0, ran.err
        errors.append(json.loads(ran.out)["torque_error_percent"]["after_overall"])
    assert errors[0] < 0.8 * errors[1]
    ran = command("observe", "cold.csv", "--model", "with", *recipe)
    assert ran.code == 0, ran.err
    ran = command("evaluate", "with", "cold.csv", "--json")  # by the recipe that it remembers
    assert json.loads(ran.out)["torque_error_percent"]["after_overall"] == errors[0]
    write_recording(warm_log(lib, 1).replace(signals={}), tmp_path / "bare.csv")
    for each in (("evaluate", "with", "bare.csv"), ("observe", "bare.csv", "--model", "with")):
        ran = command(*each)
        assert ran.code == 2, each
        said = " ".join((ran.err + ran.out).split())
        assert "'viscous_temperature' needs the signal 'temperature'" in said
        assert "[extra.temperature]" in said
    ran = command("export", "with", "--to", "urdf", "--out", "files")
    assert ran.code == 0, ran.err
    text = (tmp_path / "files" / "fr3.urdf").read_text()
    assert "viscous friction is that at 25 °C" in text


def test_predictions_need_the_signal(lib: Library) -> None:
    """Property: rows of a log are predicted, bare motions and single samples refused."""
    log = warm_log(lib)
    result = identify_recording(log, lib, friction=TERMS)
    rows = prepare(log, Preparation(), TERMS, lib=lib)
    rest = result.predict_recording(rows) - log.tau
    assert np.sqrt(np.mean(rest**2)) < 1.1 * NOISE
    with pytest.raises(RecordingError, match="needs the signal 'temperature'"):
        result.predict(log.q, log.dq, np.zeros_like(log.q))
    with pytest.raises(RecordingError, match="needs the signal 'temperature'"):
        Observer(lib, result, rate_hz=200.0)
    model = model_of(result, lib)
    _, force = model.balance(lib, JointMotion(log.dq, log.q, lib=lib, signals=log.signals))
    warmer = {"temperature": log.signals["temperature"] + 1.0}
    _, other = model.balance(lib, JointMotion(log.dq, log.q, lib=lib, signals=warmer))
    np.testing.assert_allclose(other - force, -result.phi[:, 3] * log.dq, atol=1e-9)


HUMID = """
from runtime.recording.settings import FrictionColumn

HUMID = FrictionColumn(
    "humid", "T² dq", lambda m, _: m.signals["temperature"] ** 2 * m.dq, signals=("temperature",)
)
"""


def test_a_plugin_uses_a_signal_of_the_recipe(
    lib: Library, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a column of another package is its record and its entry point."""
    (tmp_path / "site").mkdir()
    add_toy(tmp_path / "site", COLUMNS, "humid", HUMID, "HUMID", monkeypatch)
    write_recording(warm_log(lib), tmp_path / "warm.csv")
    (tmp_path / "recipe.toml").write_text(RECIPE)
    given = ["--robot", lib.folder, "--friction", "viscous,humid", "--recipe", "recipe.toml"]
    ran = command("identify", "warm.csv", *given, "--out", "out")
    assert ran.code == 0, ran.out + ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["friction"]["columns"] == ["viscous", "humid"]
