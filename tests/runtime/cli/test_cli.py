"""`python -m runtime`: every command, on the FR3 and on a second robot."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import runtime
from runtime.cli import app
from runtime.common.commands import GROUPS
from runtime.library import Library
from tests.runtime.conftest import Command
from tests.runtime.processes import QUIET

COMMANDS = sorted(
    command.name for group in GROUPS.values() for command in group if command.package == "runtime"
)


def python(*words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *map(str, words)],
        cwd=cwd,
        env=QUIET,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_the_commands_are_these() -> None:
    """Property: a renamed command breaks the README and the scripts of others."""
    assert {"identify", "evaluate", "excite", "simulate", "report"} <= set(COMMANDS)


@pytest.mark.parametrize("name", [None, *COMMANDS])
def test_help(name: str | None) -> None:
    """Property: every command explains itself and its options."""
    words = ["--help"] if name is None else [name, "--help"]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0
    for word in COMMANDS if name is None else ("Usage", "--help"):
        assert word in answer.output


def test_help_on_a_narrow_terminal() -> None:
    """Property: no mark of the layout, no name cut off, names in brackets, lines that flow."""
    texts = [
        CliRunner().invoke(app, [name, "--help"], env={"COLUMNS": "80"}).output
        for name in ("identify", "excite")
    ]
    assert "motor_rotor" in texts[0]
    assert "Every other layout is described by a recipe" in texts[0]
    assert "[[obstacle]]" in " ".join(texts[1].replace("│", " ").split())
    assert "\\b" not in "".join(texts)


def test_no_arguments_are_a_question() -> None:
    """Property: bare `python -m runtime` shows the commands."""
    answer = CliRunner().invoke(app, [])
    assert answer.exit_code in {0, 2}  # typer's choice differs by version
    assert "identify" in answer.output


def test_identify_writes_everything(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: result.json with its documented keys, a URDF that loads, a report, a table."""
    words = ("--friction", "viscous,coulomb", "--settings", "coulomb_speed=0.03")
    ran = command("identify", log, "--robot", lib.folder, *words, "--verbose")
    assert ran.code == 0, ran.err
    folder = tmp_path / "results" / "log-map"
    written = {path.name for path in folder.iterdir()}
    assert written == {
        *("result.json", "predictions.npz", "posterior.npz", "identified.urdf", "report.html"),
        "settings.toml",
    }
    facts = json.loads((folder / "result.json").read_text())
    assert facts["method"] == "map"
    errors, rms = facts["torque_error_percent"], facts["torque_rms"]
    assert errors["after_overall"] < errors["before_overall"]
    assert [len(errors[key]) for key in ("before", "after")] == [7, 7]
    assert [len(rms[key]) for key in ("before", "after")] == [7, 7]
    assert {"name", "mass", "min_relative_eigenvalue"} <= set(facts["links"][0])
    assert facts["consistent"] is True
    assert np.isfinite(facts["gap_to_convex_optimum"])
    assert facts["seconds"] > 0
    assert facts["provenance"]["command"].startswith("python -m runtime identify")
    for name in lib.joint_names:
        assert name in ran.out
    assert (folder / "report.html").stat().st_size > 10_000
    assert "identified.urdf (verified" in ran.out
    assert facts["uncertainty"]["advice"] in ran.out.replace("\n", " ")
    assert [len(link["verdicts"]) for link in facts["uncertainty"]["links"]] == [10] * 7
    assert "Uncertainty of the links" in (folder / "report.html").read_text(encoding="utf-8")
    assert command("identify", log, "--robot", lib.folder, "--prior", "no.toml").code == 2


def test_options_reach_the_method(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: preset, split, cut-off, rate and seed are what the result says."""
    words = (
        "--settings",
        "preset=simulation",
        "--split",
        "0.5,0.75",
        "--cutoff",
        "20",
        "--settings",
        "rate=50",
    )
    words += ("--friction", "none")
    ran = command(
        "identify", log, "--robot", lib.folder, *words, "--settings", "seed=3", "--out", "out"
    )
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["provenance"]["seed"] == 3
    # 10 s at 50 Hz, halves and quarters, without 1 / f_c = 0.05 s on both sides of the cuts.
    assert facts["recording"]["samples"] == {"train": 248, "validation": 120, "test": 123}
    history = " ".join(facts["recording"]["history"])
    assert "Low-passed at 20 Hz" in history
    assert facts["iterations"] <= 1500
    assert facts["friction"] is None


def test_an_older_urdf_does_not_outlive_its_result(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: beside a result that cannot exist lies no URDF of the result before it."""
    (tmp_path / "out").mkdir()
    urdf = tmp_path / "out" / "identified.urdf"
    urdf.write_text("<robot/>")
    words = ("--robot", lib.folder, "--method", "ols", "--out", "out", "--overwrite")
    ran = command("identify", log, *words)
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert (ran.code, facts["consistent"], urdf.exists()) == (0, False, False)


def test_identifying_twice_gives_the_same_bytes(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: deterministic but for the time it took; a report of the same folder is replaced."""
    texts = []
    for _ in range(2):
        assert command("identify", log, "--robot", lib.folder, "--out", "out").code == 0
        facts = json.loads((tmp_path / "out" / "result.json").read_text())
        del facts["seconds"]
        texts.append(facts)
    assert texts[0] == texts[1]
    assert len(list((tmp_path / "out").iterdir())) == 7


def test_evaluate_and_report(command: Command, lib: Library, log: Path, tmp_path: Path) -> None:
    """Property: evaluated on its own log, the error is that of result.json; the output is JSON."""
    words = ("--friction", "viscous,coulomb", "--settings", "coulomb_speed=0.03")
    assert command("identify", log, "--robot", lib.folder, "--out", "out", *words).code == 0
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    ran = command("evaluate", "out", log, "--robot", lib.folder, "--json")
    assert ran.code == 0, ran.err
    printed = json.loads(ran.out)["torque_error_percent"]
    # The same motion in other parts: alike within a third.
    assert printed["after_overall"] == pytest.approx(
        written["torque_error_percent"]["after_overall"], rel=0.3
    )
    ran = command("evaluate", "out", log, "--robot", lib.folder)
    assert (ran.code, ran.out.count("note")) == (0, 1)
    assert "the model was fitted to 100 % of the rows of this log" in ran.out
    assert "all joints" in ran.out
    report = tmp_path / "out" / "report.html"
    first = report.read_bytes()
    report.unlink()
    assert command("report", "out").code == 0
    assert report.read_bytes() == first


def test_evaluate_prepares_the_log_as_identify_did(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: the same error by the same options and by none; a note on a raw log."""
    words = ("--cutoff", "10", "--settings", "rate=50")
    assert command("identify", log, "--robot", lib.folder, "--out", "out", *words).code == 0
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    words_of_log = ("evaluate", "out", log, "--robot", lib.folder)
    printed = json.loads(command(*words_of_log, "--json", *words).out)
    # The same motion in other parts: alike within a third.
    assert printed["torque_error_percent"]["after_overall"] == pytest.approx(
        written["torque_error_percent"]["after_overall"], rel=0.3
    )
    (fitted,) = printed["notes"]
    assert fitted.startswith("the model was fitted to 100 % of the rows of this log")
    bare = json.loads(command(*words_of_log, "--json").out)
    assert bare["torque_error_percent"] == printed["torque_error_percent"]
    prepared = (
        "the log is prepared as the log of identify; --cutoff and the setting rate change that"
    )
    assert set(bare["notes"]) == {fitted, prepared}
    raw = command(*words_of_log, "--settings", "rate=50").out
    assert "note: the model was identified from a low-passed log, but this" in raw


def test_the_chain_on_a_second_robot(
    command: Command, robot: Callable[[str], Library], tmp_path: Path
) -> None:
    """Oracle: UR5 from excitation to evaluation; the truth is known, and it is found."""
    folder = robot("ur5").folder
    ran = command(
        "excite",
        "--robot",
        folder,
        "--settings",
        "starts=1",
        "--settings",
        "harmonics=3",
        "--out",
        "a.json",
    )
    assert ran.code == 0, ran.err
    assert "no acceleration limit" in ran.out
    for seed, name in ((1, "first"), (2, "second")):
        words = (
            "--settings",
            "coulomb=0.3",
            "--settings",
            "viscous=0.5",
            "--settings",
            "perturb=0.1",
            "--settings",
            "control_rate=500",
        )
        ran = command(
            *("simulate", "--robot", folder, "--trajectory", "a.json", "--out", f"{name}.csv"),
            *(*words, "--seed", "1" if name == "first" else seed),
        )
        assert ran.code == 0, ran.err
    ran = command(
        *("identify", "first.csv", "--robot", folder, "--friction", "viscous,coulomb"),
        *(
            "--settings",
            "coulomb_speed=0.03",
            "--cutoff",
            "15",
            "--settings",
            "rate=100",
            "--out",
            "out",
        ),
    )
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    errors = facts["torque_error_percent"]
    # λ off by 10 %, friction unknown: several percent; noise and filter leave less than one.
    assert errors["before_overall"] > 2.0
    assert errors["after_overall"] < 1.0
    assert facts["consistent"] is True
    truth = json.loads((tmp_path / "first.truth.json").read_text())
    lib = runtime.load(folder)
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.uniform(-1, 1, (3, 200, 6))
    wanted = lib.inverse_dynamics(q, dq, ddq, truth["pi"])
    got = lib.inverse_dynamics(q, dq, ddq, facts["pi"])
    start = lib.inverse_dynamics(q, dq, ddq, lib.pi0)
    assert np.linalg.norm(got - wanted) < 0.2 * np.linalg.norm(start - wanted)
    # Another perturbed robot: evaluate says that this model does not fit it as well.
    ran = command("evaluate", "out", "second.csv", "--robot", folder, "--json")
    assert ran.code == 0, ran.err
    other = json.loads(ran.out)["torque_error_percent"]["after_overall"]
    assert other > errors["after_overall"]


def test_excite_writes_a_motion_that_identify_could_use(
    command: Command, lib: Library, tmp_path: Path
) -> None:
    """Property: JSON and CSV agree; the CSV begins and ends at home."""
    words = (
        "--duration",
        "4",
        "--settings",
        "harmonics=2",
        "--settings",
        "starts=1",
        "--settings",
        "export_rate=100",
    )
    ran = command("excite", "--robot", lib.folder, *words)
    assert ran.code == 0, ran.err
    table = runtime.read_recording(tmp_path / "results" / "fr3-excite.motion.csv")
    assert (len(table), table.rate_hz) == (401, pytest.approx(100))
    # Coefficients of up to 100 cancel at rest.
    assert table.q[[0, -1]] == pytest.approx(np.tile(lib.home, (2, 1)), abs=1e-12)
    facts = json.loads((tmp_path / "results" / "fr3-excite.json").read_text())
    assert facts["condition_number"] > 1


def test_simulate_ideal_by_default_names(command: Command, lib: Library, tmp_path: Path) -> None:
    """Property: without a trajectory one is designed; the truth lies beside the log."""
    ran = command("simulate", "--robot", lib.folder, "--ideal", "--settings", "torque_noise=0")
    assert ran.code == 0, ran.err
    folder = tmp_path / "results"
    recording = runtime.read_recording(folder / "fr3-simulated.csv")
    truth = json.loads((folder / "fr3-simulated.truth.json").read_text())
    tau = lib.inverse_dynamics(recording.q, recording.dq, recording.ddq, truth["pi"])
    # 17 digits on disk: only rounding.
    assert recording.tau == pytest.approx(tau, abs=1e-12)


def test_a_real_process(lib: Library, log: Path, tmp_path: Path) -> None:
    """Property: `python -m runtime` from any folder, results beside the caller; errors exit 2."""
    ran = python("-m", "runtime", "identify", log, "--robot", lib.folder, cwd=tmp_path)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert (tmp_path / "results" / "log-map" / "report.html").exists()
    ran = python("-m", "runtime", "identify", "nothing.csv", "--robot", lib.folder, cwd=tmp_path)
    assert ran.returncode == 2
    assert ran.stdout == ""
    assert ran.stderr.startswith("runtime: there is no file or folder 'nothing.csv'")
    assert len(ran.stderr.splitlines()) == 1
