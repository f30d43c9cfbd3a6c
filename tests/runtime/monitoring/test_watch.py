"""Watch in Python: the verdicts of the command, by a result in memory or in its folder."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import runtime
from runtime import Recording
from runtime.errors import RuntimeFault
from runtime.library import Library
from runtime.recording import Friction, Preparation
from runtime.recording.free_base import free_base_of
from tests.free_base_logs import virtual_log
from tests.robots import DATA
from tests.runtime.conftest import Command
from tests.runtime.monitoring.conftest import Monitored


@pytest.fixture(scope="module")
def later(panda: Recording) -> Recording:
    """A cut of the log with a sensor that reads 10 % high."""
    rows = panda.t >= panda.t[0] + 0.5 * panda.duration
    log = panda.take(rows, "the second half").replace(recipe=None, name="later")
    return log.replace(tau=log.required("tau") * [1, 1.1, 1, 1, 1, 1, 1])


def test_python_gives_the_verdict_of_the_command(
    lib: Library, monitored: Monitored, later: Recording, command: Command, tmp_path: Path
) -> None:
    """Oracle: JSON of `symgen watch` on the same folder and log."""
    runtime.write_recording(later, tmp_path / "later.npz")
    facts = json.loads(command("watch", monitored.folder, "later.npz", "--json").out)
    of_file, of_log = (
        runtime.watch(monitored.folder, each, lib)[0] for each in (tmp_path / "later.npz", later)
    )
    assert facts["sentence"] == of_file.sentence() == of_log.sentence()
    assert of_file.best.where == "fr3_joint2"
    assert facts["p_value"] == of_file.p_value == of_log.p_value


def test_a_result_in_memory_is_that_of_its_folder(panda: Recording, tmp_path: Path) -> None:
    """Property: the same verdict, and p = 1 for the log of the result itself."""
    lib = runtime.load("fr3")
    trial = runtime.identify(panda, lib, friction=(), refit=False, certify=False)
    assert trial.row_marks is None
    result = runtime.identify(panda, lib)
    record = runtime.write_result(result, tmp_path / "new" / "arm")
    assert record.provenance.command == "runtime.identify"
    (here,), (there,) = runtime.watch(result, panda), runtime.watch(tmp_path / "new" / "arm", panda)
    assert (here.p_value, here.best) == (there.p_value, there.best)
    assert here.p_value == 1.0
    share = runtime.evaluate(result, panda).fitted_share
    assert share == runtime.read_result(tmp_path / "new" / "arm").fitted_share(panda) > 0.9


def test_runs_of_one_data_set_are_logs(
    robot: Callable[[str], Library], command: Command, tmp_path: Path
) -> None:
    """Oracle: the runs of a real arm, read in Python, where their names get a mark."""
    lib = robot("kuka_lwr4")
    runs = [runtime.read_recording("lwr4_flobaroid", None, run) for run in ("1", "2")]
    runtime.write_result(runtime.identify(runs[0], lib, friction=(), refit=False), tmp_path / "arm")
    words = ("lwr4_flobaroid", "--settings", "run=1,2", "--robot", lib.folder, "--json")
    logs = json.loads(command("watch", tmp_path / "arm", *words).out)["logs"]
    verdicts = runtime.watch(tmp_path / "arm", runs, lib)
    assert [each.log for each in verdicts] == ["lwr4_flobaroid", "lwr4_flobaroid'"]
    assert [each["log"] for each in logs] == ["lwr4_flobaroid run 1", "lwr4_flobaroid run 2"]
    assert [each["p_value"] for each in logs] == [each.p_value for each in verdicts]


def test_what_is_no_log_or_no_result_is_refused(
    monitored: Monitored, panda: Recording, tmp_path: Path
) -> None:
    """Property: one sentence each, and no file is written."""
    urdf = (DATA / "hopper.urdf").read_text(encoding="utf-8")
    walk = free_base_of(virtual_log(urdf, ("left_foot",), 1).arrays, "walk")
    for log, words in (
        (3, "expected a log or several"),
        ([], "got none"),
        (walk, "robot with a free base"),
        ("none.csv", "there is no file"),
    ):
        with pytest.raises(RuntimeFault, match=words):
            runtime.watch(monitored.folder, log)  # type: ignore[arg-type]
    with pytest.raises(RuntimeFault, match=r"expected a result of runtime\.identify"):
        runtime.watch(monitored.saved, panda)  # type: ignore[arg-type]
    with pytest.raises(RuntimeFault, match="expected the folder"):
        runtime.write_result(monitored.result, 3)  # type: ignore[arg-type]
    with pytest.raises(RuntimeFault, match="are in its folder"):
        runtime.write_result(monitored.saved, tmp_path)  # type: ignore[arg-type]
    assert not [*tmp_path.iterdir()]


def test_a_fast_motion_is_no_change_of_a_model_of_slow_ones(lib: Library) -> None:
    """Property: a cut-off of 1 Hz inside the band of the later motion bends its torque by 4 %."""
    w = 2 * np.pi * np.array([0.1, 0.17, 0.26])[:, None]

    def swing(fast: float, seed: int, off: float = 0.0) -> Recording:
        rng, t = np.random.default_rng(seed), np.arange(0.0, 20.0, 0.01)
        size, phase = rng.uniform(0.1, 0.3, (3, 7)), rng.uniform(0.0, 6.0, (3, 7))
        angle = fast * w * t[:, None, None] + phase
        q = lib.home + np.sum(size * np.sin(angle), axis=1)
        dq = np.sum(fast * w * size * np.cos(angle), axis=1)
        ddq = -np.sum((fast * w) ** 2 * size * np.sin(angle), axis=1)
        pi = lib.pi0 + np.repeat(np.arange(lib.n_links) == 5, 10) * off * lib.pi0
        tau = lib.inverse_dynamics(q, dq, ddq, pi) + 2.0 * dq
        return Recording(t=t, q=q, dq=dq, tau=tau + 0.02 * rng.normal(size=q.shape))

    steps = Preparation(filter="butterworth", cutoff_hz=1.0, trim_s=1.0)
    friction = Friction(("viscous", "offset"))
    result = runtime.identify(swing(1.0, 0), lib, preparation=steps, friction=friction)
    same, heavier = runtime.watch(result, [swing(3.0, 5), swing(3.0, 5, off=0.5)])
    assert same.p_value == 1.0
    assert heavier.changed
