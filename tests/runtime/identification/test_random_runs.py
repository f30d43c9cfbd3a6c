"""Random runs of what users compose: method, friction, preset, split, filter, logs, prior."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest

from runtime import Identification, Library, Recording, load, write_recording
from runtime.common.threads import one_blas_thread
from runtime.errors import RuntimeFault
from runtime.estimators.prior_file import read_prior
from runtime.estimators.regression.samples import samples_of
from runtime.identification.metrics import torque_error
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import read_result
from runtime.identification.several_logs import NamedLog
from runtime.identification.single_log import identify_recording
from runtime.outputs.model_files.formats.urdf import urdf_text
from runtime.outputs.model_files.model import make_model
from runtime.recording import Friction, Preparation, Split
from runtime.recording.streamed import open_streamed
from tests.oracle import pinocchio_model

RUNS = 500
METHODS = (
    *2 * ("map", "map", "map", "ols", "wls", "pc-ols", "lm", "adam", "iv", "ekf"),
    "log-cholesky",  # takes longer than all others together
)
COLUMNS = ("viscous", "coulomb", "offset", "rotor", "stribeck", "load")
ROWS = 240
SHARES = (0.6, 0.25, 0.15)
"""Of the robots in the runs: those of more joints take longer."""
CONSISTENT = ("map", "pc-ols", "lm", "log-cholesky", "adam")


def recorded(lib: Library, rng: np.random.Generator) -> Recording:
    """Log of a random motion with friction and noise; its parameters are off the URDF's by 10 %."""
    t, n = 0.01 * np.arange(ROWS), lib.n_joints
    rates = rng.uniform(3.0, 9.0, (3, n))
    q, dq, ddq = (np.tile(lib.home, (ROWS, 1)) * (k == 0) for k in range(3))
    for rate, size in zip(rates, rng.uniform(0.1, 0.4, (3, n)), strict=True):
        phase = t[:, None] * rate
        q += size * np.sin(phase)
        dq += size * rate * np.cos(phase)
        ddq -= size * rate**2 * np.sin(phase)
    lam = lib.lam0 + 0.1 * rng.normal(size=lib.lam0.shape) * np.maximum(np.abs(lib.lam0), 1e-3)
    tau = lib.torque(q, dq, ddq, lam) + 0.2 * dq + 0.1 * np.tanh(20 * dq)
    tau += rng.normal(scale=0.02, size=tau.shape)
    return Recording(t=t, q=q, dq=dq, ddq=ddq, tau=tau, name="log")


def settings(lib: Library, rng: np.random.Generator, prior: Path) -> dict[str, Any]:
    """Random keywords of `identify`."""
    first, second = np.sort(rng.uniform(0.25, 0.85, 2))
    chosen: dict[str, Any] = {"method": str(rng.choice(METHODS)), "seed": int(rng.integers(100))}
    columns = [name for name in COLUMNS if rng.random() < 0.4]
    chosen["friction"] = Friction(tuple(columns)) if columns else None
    if second - first > 0.05 and rng.random() < 0.7:
        chosen["split"] = Split((0.0, first), (first, second), (second, 1.0))
    if chosen["method"] == "adam":
        chosen["preset"] = str(rng.choice(["simulation", "real"]))
    if chosen["method"] == "map" and rng.random() < 0.3:
        chosen["prior"] = read_prior(prior, lib)
    if rng.random() < 0.3:
        chosen["preparation"] = Preparation(filter="butterworth", cutoff_hz=rng.uniform(8, 30))
    return chosen


def logs_of(log: Recording, form: str) -> list[Recording]:
    """The log, and with it, for two logs, the same motion backwards in time."""
    if form != "two":
        return [log]
    return [log, log.replace(q=log.q[::-1], dq=-log.dq[::-1], ddq=log.ddq[::-1], tau=log.tau[::-1])]


def run(
    lib: Library, logs: list[Recording], chosen: dict[str, Any], form: str, folder: Path
) -> Identification:
    """One identification from one log, from two, or from a file that is streamed."""
    if form == "two":
        named = [NamedLog(name, log) for name, log in zip("ab", logs, strict=True)]
        return identify_recording(named, lib, **chosen)
    if form == "streamed":
        write_recording(logs[0], folder / "log.npz")
        return identify_recording(open_streamed(folder / "log.npz"), lib, **chosen)
    return identify_recording(logs[0], lib, **chosen)


def error_of_urdf(result: Identification) -> float:
    """Test error in %, by Pinocchio from the exported URDF, with the friction columns."""
    text = urdf_text(make_model(result.lib, result.pi))
    model = pinocchio_model(text, result.lib.gravity)
    data, rows = model.createData(), samples_of(result.test, result.lib)
    tau = [pinocchio.rnea(model, data, *row) for row in zip(rows.q, rows.dq, rows.ddq, strict=True)]
    return torque_error(rows.tau, np.array(tau) + rows.friction(result.phi)).overall


def poisoned(log: Recording, start: float, signals: str) -> Recording:
    """The same log with other torques or other motions from an instant on, which stay plausible."""
    late = (log.t >= start)[:, None]
    if signals == "torque":
        return log.replace(tau=np.where(late, 2.0 * log.tau + 0.5, log.tau))
    mean = log.q.mean(axis=0)
    return log.replace(
        q=np.where(late, mean + 0.5 * (log.q - mean), log.q),
        dq=np.where(late, 0.5 * log.dq, log.dq),
        ddq=np.where(late, 0.5 * log.ddq, log.ddq),
    )


def assert_disjoint(result: Identification, form: str) -> None:
    """Parts share no row; a training part that includes the validation part states it."""
    if form == "streamed":
        assert result.streamed is not None
        spans = result.streamed.spans  # of which the windows below are parts
        assert spans["train"][1] <= spans["test"][0]
        assert spans["validation"][1] <= spans["test"][0]
        assert spans["train"][1] <= spans["validation"][0] or result.is_joined
    # Joined logs have a clock of their own in each part; their rows differ by noise.
    train, validation, test = (
        {row.tobytes() for row in np.hstack([part.q, part.dq, part.tau])}
        if form == "two"
        else set(part.t)
        for part in (result.train, result.validation, result.test)
    )
    assert train.isdisjoint(test)
    assert validation.isdisjoint(test)
    assert train.isdisjoint(validation) or result.is_joined


def assert_read_again(result: Identification, folder: Path) -> None:
    """What is written is read with the same bits."""
    write_result(result, folder, "test")
    saved = read_result(folder)
    np.testing.assert_array_equal(saved.pi, result.pi)
    np.testing.assert_array_equal(saved.phi, result.usual_phi)  # one offset for all logs


PRIOR = 'trust = "cad"\n[link.{}]\nmass = [0.1, 9.0]\n'


@pytest.fixture(scope="module")
def robots(tiny_built: Path, double: Library, robot: Callable[[str], Library]) -> list[Library]:
    """The pendulum, an arm of two joints, and a gantry that turns and slides twice each."""
    return [load(tiny_built), double, robot("gantry")]


@one_blas_thread  # once, not in each of a thousand calls
def test_random_runs(robots: list[Library], tmp_path: Path) -> None:
    """Property: whatever is composed ends in a result or in one sentence.

    What is written is read with the same bits; methods that bound consistency keep it; parts do
    not overlap; other motions and torques in the test rows have no effect on the model. Oracle:
    Pinocchio on the exported URDF gives the test error that is reported.
    """
    for lib in robots:
        (tmp_path / f"{lib.name}.toml").write_text(PRIOR.format(lib.link_names[-1]))
    finished: Counter[str] = Counter()
    for seed in range(RUNS):
        rng = np.random.default_rng((2011, seed))
        lib = robots[int(rng.choice(len(robots), p=SHARES))]
        log, form = recorded(lib, rng), str(rng.choice(["one", "one", "two", "streamed"]))
        chosen = settings(lib, rng, tmp_path / f"{lib.name}.toml")
        try:
            result = run(lib, logs_of(log, form), chosen, form, tmp_path)
        except RuntimeFault:
            continue
        finished[form] += 1
        finished[lib.name] += 1
        assert np.isfinite(result.pi).all(), (seed, chosen)
        if result.method in CONSISTENT:
            assert result.is_consistent, (seed, chosen)
        assert_disjoint(result, form)
        assert_read_again(result, tmp_path / "out")
        if form == "one" and result.is_consistent and seed % 3 == 0:
            finished["exported"] += 1
            reported = torque_error(result.test.tau, result.predict_test()).overall
            # Both sum some ten terms of the size of the torque.
            assert error_of_urdf(result) == pytest.approx(reported, rel=1e-9), (seed, chosen)
        if seed % 3 == 1:
            # Filtered parts are trimmed; the edge itself is rounded to a row.
            edge = (chosen.get("split") or Split()).test[0]
            start = log.t[0] + edge * log.duration + 0.01
            signals = str(rng.choice(["torque", "motion"]))
            finished[f"{signals} of {form}"] += 1
            others = [poisoned(each, start, signals) for each in logs_of(log, form)]
            again = run(lib, others, chosen | {"certify": False}, form, tmp_path)
            np.testing.assert_array_equal(again.pi, result.pi, err_msg=f"{seed} {chosen}")
            np.testing.assert_array_equal(again.phi, result.phi, err_msg=f"{seed} {chosen}")
    assert len(finished) == 3 + len(robots) + 1 + 6
    assert min(finished.values()) > RUNS // 100, finished
