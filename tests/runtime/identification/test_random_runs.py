"""Random runs of what users compose: method, friction, preset, split, filter, logs, prior."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest

from runtime import Identification, Library, Recording, identify, load, write_recording
from runtime.errors import RuntimeFault
from runtime.estimators.prior_file import read_prior
from runtime.estimators.regression.samples import samples_of
from runtime.identification.long_logs import identify_streamed
from runtime.identification.metrics import torque_error
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import read_result
from runtime.identification.several_logs import NamedLog, identify_logs
from runtime.outputs.model_files import make_model, urdf_text
from runtime.recording import Friction, Preparation, Split, open_streamed
from tests.oracle import pinocchio_model

RUNS = 500
METHODS = ("map", "map", "map", "ols", "wls", "pc-ols", "lm", "log-cholesky", "adam", "iv", "ekf")
COLUMNS = ("viscous", "coulomb", "offset", "rotor", "stribeck", "load")
ROWS = 240
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
    chosen["friction_columns"] = Friction(tuple(columns)) if columns else None
    if second - first > 0.05 and rng.random() < 0.7:
        chosen["splitting"] = Split((0.0, first), (first, second), (second, 1.0))
    if chosen["method"] == "adam":
        chosen["preset"] = str(rng.choice(["simulation", "real"]))
    if chosen["method"] == "map" and rng.random() < 0.3:
        chosen["prior"] = read_prior(prior, lib)
    if rng.random() < 0.3:
        chosen["preparation"] = Preparation(filter="butterworth", cutoff_hz=rng.uniform(8, 30))
    return chosen


def run(
    lib: Library, log: Recording, chosen: dict[str, Any], form: str, folder: Path
) -> Identification:
    """One identification from one log, from two, or from a file that is streamed."""
    if form == "two":
        other = log.replace(q=log.q[::-1], dq=-log.dq[::-1], ddq=log.ddq[::-1], tau=log.tau[::-1])
        return identify_logs([NamedLog("a", log), NamedLog("b", other)], lib, **chosen)[0]
    if form == "streamed":
        write_recording(log, folder / "log.npz")
        return identify_streamed(open_streamed(folder / "log.npz"), lib, **chosen)
    return identify(log, lib, **chosen)


def error_of_urdf(result: Identification) -> float:
    """Test error in %, by Pinocchio from the exported URDF, with the friction columns."""
    text = urdf_text(make_model(result.lib, result.pi))
    model = pinocchio_model(text, result.lib.gravity)
    data, rows = model.createData(), samples_of(result.test, result.lib)
    tau = [pinocchio.rnea(model, data, *row) for row in zip(rows.q, rows.dq, rows.ddq, strict=True)]
    return torque_error(rows.tau, np.array(tau) + rows.friction(result.phi)).overall


def poisoned(log: Recording, start: float) -> Recording:
    """The same log with another torque from an instant on; its sign stays plausible."""
    return log.replace(tau=np.where((log.t >= start)[:, None], 2.0 * log.tau + 0.5, log.tau))


PRIOR = 'trust = "cad"\n[link.rod]\nmass = [0.1, 9.0]\n'


def test_random_runs(tiny_built: Path, tmp_path: Path) -> None:
    """Property: whatever is composed ends in a result or in one sentence.

    What is written is read with the same bits; methods that bound consistency keep it; parts do
    not overlap; test rows have no effect on the model. Oracle: Pinocchio on the exported URDF gives
    the test error that is reported.
    """
    lib = load(tiny_built)
    (tmp_path / "prior.toml").write_text(PRIOR)
    finished = dict.fromkeys(("one", "two", "streamed", "exported", "poisoned"), 0)
    for seed in range(RUNS):
        rng = np.random.default_rng((2011, seed))
        log, form = recorded(lib, rng), str(rng.choice(["one", "one", "two", "streamed"]))
        chosen = settings(lib, rng, tmp_path / "prior.toml")
        try:
            result = run(lib, log, chosen, form, tmp_path)
        except RuntimeFault:
            continue
        finished[form] += 1
        assert np.isfinite(result.pi).all(), (seed, chosen)
        if result.method in CONSISTENT:
            assert result.is_consistent, (seed, chosen)
        if form == "one":
            ends = [(part.t[0], part.t[-1]) for part in (result.train, result.test)]
            assert ends[0][1] < ends[1][0], (seed, chosen)
            write_result(result, tmp_path / "out", "test")
            saved = read_result(tmp_path / "out")
            np.testing.assert_array_equal(saved.pi, result.pi)
            np.testing.assert_array_equal(saved.phi, result.phi)
        if form == "one" and result.is_consistent and seed % 3 == 0:
            finished["exported"] += 1
            reported = torque_error(result.test.tau, result.predict_test()).overall
            # Both sum some ten terms of the size of the torque.
            assert error_of_urdf(result) == pytest.approx(reported, rel=1e-9), (seed, chosen)
        if form == "one" and seed % 3 == 1:
            finished["poisoned"] += 1
            # Filtered parts are trimmed; the edge itself is rounded to a row.
            edge = (chosen.get("splitting") or Split()).test[0]
            start = log.t[0] + edge * log.duration + 0.01
            again = run(lib, poisoned(log, start), chosen, form, tmp_path)
            np.testing.assert_array_equal(again.pi, result.pi, err_msg=f"{seed} {chosen}")
            np.testing.assert_array_equal(again.phi, result.phi, err_msg=f"{seed} {chosen}")
    assert min(finished.values()) > RUNS // 50, finished
