"""`python -m runtime`: every command, on the FR3 and on a second robot, and Ctrl-C."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import runtime
from runtime import Recording, write_recording
from runtime.cli import app
from runtime.excitation import Design, design
from runtime.library import Library
from tests.runtime.conftest import Command

COMMANDS = sorted(str(command.name) for command in app.registered_commands)
# One thread per process: two test processes on two cores would otherwise wait for each other.
QUIET = os.environ | {
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONPATH": str(Path(runtime.__file__).parents[1]),
}


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


def test_no_arguments_are_a_question() -> None:
    """Property: bare `python -m runtime` shows the commands."""
    answer = CliRunner().invoke(app, [])
    assert answer.exit_code in {0, 2}  # typer's choice differs by version
    assert "identify" in answer.output


@pytest.fixture(scope="module")
def log(noisy: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "log.csv"
    write_recording(noisy, path)
    return path


def test_identify_writes_everything(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: result.json with its promised keys, a URDF that loads, a report; a table told."""
    words = ("--friction", "viscous,coulomb", "--coulomb-speed", "0.03")
    ran = command("identify", log, "--robot", lib.folder, *words)
    assert ran.code == 0, ran.err
    folder = tmp_path / "results" / "log-map"
    written = {path.name for path in folder.iterdir()}
    assert written == {"result.json", "predictions.npz", "identified.urdf", "report.html"}
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
    assert "What the data determine" in (folder / "report.html").read_text(encoding="utf-8")
    assert command("identify", log, "--robot", lib.folder, "--prior", "no.toml").code == 2


def test_export_writes_what_others_load(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: every format of a result, checked and told; nothing replaced without leave."""
    words = ("--friction", "viscous,coulomb", "--method", "pc-ols", "--out", "out")
    assert command("identify", log, "--robot", lib.folder, *words).code == 0
    ran = command("export", "out", "--robot", lib.folder)
    assert ran.code == 0, ran.err
    written = {path.name for path in (tmp_path / "out" / "export").iterdir()}
    assert written == {
        *("fr3.urdf", "fr3.xml", "fr3.sdf", "inertials.yaml", "dynamics.yaml"),
        "fr3_identified.h",
    }
    assert ran.out.count("verified: reloaded by") == 6
    again = command("export", "out", "--robot", lib.folder, "--to", "mjcf,urdf")
    assert again.code == 2
    assert "fr3.xml' exists" in again.err
    assert command("export", "out", "--robot", lib.folder, "--to", "urdf", "--overwrite").code == 0
    assert "friction, header; got 'usd'" in command("export", "out", "--to", "usd").err
    assert "no valid result.json" in command("export", tmp_path).err


def test_export_says_what_it_could_not_write(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: bodies that cannot exist are refused one by one, exit code 2, nothing left."""
    run = command("identify", log, "--robot", lib.folder, "--method", "ols", "--out", "out")
    assert run.code == 0
    ran = command("export", "out", "--robot", lib.folder, "--to", "urdf,header")
    assert ran.code == 2
    assert "2 of 2 not written: urdf, header" in ran.err
    assert "urdf: not written: fr3_link" in ran.out or "urdf: link 'fr3_link" in ran.out
    assert not (tmp_path / "out" / "export").exists()


def test_inconsistent_models_get_no_urdf(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: least squares on noise gives no bodies, so there is nothing to simulate."""
    out = tmp_path / "out"
    ran = command("identify", log, "--robot", lib.folder, "--method", "ols", "--out", out)
    assert ran.code == 0
    assert json.loads((out / "result.json").read_text())["consistent"] is False
    assert not (out / "identified.urdf").exists()
    assert "not written" in ran.out


def test_options_reach_the_method(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: preset, split, cut-off, rate and seed are what the result says."""
    words = ("--preset", "simulation", "--split", "0.5,0.75", "--cutoff", "20", "--rate", "50")
    ran = command("identify", log, "--robot", lib.folder, *words, "--seed", "3", "--out", "out")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["provenance"]["seed"] == 3
    # 10 s at 50 Hz, halves and quarters.
    assert facts["recording"]["samples"] == {"train": 250, "validation": 125, "test": 126}
    history = " ".join(facts["recording"]["history"])
    assert "Low-passed at 20 Hz" in history
    assert facts["iterations"] <= 1500
    assert facts["friction"] is None


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
    assert len(list((tmp_path / "out").iterdir())) == 4


def test_evaluate_and_report(command: Command, lib: Library, log: Path, tmp_path: Path) -> None:
    """Property: evaluated on its own log, the model does what the result promises; JSON is JSON."""
    words = ("--friction", "viscous,coulomb", "--coulomb-speed", "0.03")
    assert command("identify", log, "--robot", lib.folder, "--out", "out", *words).code == 0
    promised = json.loads((tmp_path / "out" / "result.json").read_text())
    ran = command("evaluate", "out", log, "--robot", lib.folder, "--json")
    assert ran.code == 0, ran.err
    told = json.loads(ran.out)["torque_error_percent"]
    # The same motion in other parts: alike within a third.
    assert told["after_overall"] == pytest.approx(
        promised["torque_error_percent"]["after_overall"], rel=0.3
    )
    ran = command("evaluate", "out", log, "--robot", lib.folder)
    assert ran.code == 0
    assert "overall" in ran.out
    report = tmp_path / "out" / "report.html"
    first = report.read_bytes()
    report.unlink()
    assert command("report", "out").code == 0
    assert report.read_bytes() == first


def test_the_chain_on_a_second_robot(
    command: Command, robot: Callable[[str], Library], tmp_path: Path
) -> None:
    """Oracle: UR5 from excitation to evaluation; the truth is known, and it is found."""
    folder = robot("ur5").folder
    ran = command(
        "excite", "--robot", folder, "--starts", "1", "--harmonics", "3", "--out", "a.json"
    )
    assert ran.code == 0, ran.err
    assert "no acceleration limit" in ran.out
    for seed, name in ((1, "first"), (2, "second")):
        words = ("--coulomb", "0.3", "--viscous", "0.5", "--perturb", "0.1", "--rate", "500")
        ran = command(
            *("simulate", "--robot", folder, "--trajectory", "a.json", "--out", f"{name}.csv"),
            *(*words, "--seed", "1" if name == "first" else seed),
        )
        assert ran.code == 0, ran.err
    ran = command(
        *("identify", "first.csv", "--robot", folder, "--friction", "viscous,coulomb"),
        *("--coulomb-speed", "0.03", "--cutoff", "15", "--rate", "100", "--out", "out"),
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
    words = ("--duration", "4", "--harmonics", "2", "--starts", "1", "--rate", "100")
    ran = command("excite", "--robot", lib.folder, *words)
    assert ran.code == 0, ran.err
    table = runtime.read_recording(tmp_path / "results" / "fr3-excite.csv")
    assert (len(table), table.rate_hz) == (401, pytest.approx(100))
    # Coefficients of up to 100 cancel at rest.
    assert table.q[[0, -1]] == pytest.approx(np.tile(lib.home, (2, 1)), abs=1e-12)
    facts = json.loads((tmp_path / "results" / "fr3-excite.json").read_text())
    assert facts["condition_number"] > 1


def test_excite_exports_what_it_can_prove(command: Command, lib: Library, tmp_path: Path) -> None:
    """Property: files per kind and stage, a table per stage; the CSV only where asked for."""
    words = ("--duration", "4", "--harmonics", "2", "--starts", "1", "--rate", "100")
    stages = ("--speed", "10", "--speed", "100", "--export", "ros", "--export", "libfranka")
    ran = command("excite", "--robot", lib.folder, *words, *stages, "--plot", "--out", "m.json")
    assert ran.code == 0, ran.err
    assert "certificate at 10 % speed: holds at every instant" in ran.out
    assert "certificate at 100 % speed: holds at every instant" in ran.out
    kinds = ("certificate.json", "libfranka.csv", "ros.yaml")
    expected = {f"{stem}.{kind}" for stem in ("m", "m-speed10") for kind in kinds}
    pictures = ("m.png", "m-speed.png", "m-space.png")
    assert {path.name for path in tmp_path.iterdir()} == {"m.json", *pictures, *expected}
    assert f"trajectory: m.json, {', '.join(pictures)}" in ran.out
    slow = (tmp_path / "m-speed10.libfranka.csv").read_text()
    assert len(re.findall("^[0-9]", slow, re.MULTILINE)) == 40_001


def test_excite_exports_nothing_that_breaks_a_limit(
    command: Command, lib: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: one sentence, exit code 2; the design stays, no file for a robot is written."""
    from runtime.cli import excite

    def wild(*words: object, **options: object) -> Design:
        found = design(*words, **options)  # type: ignore[arg-type]
        inside = 0.9 * found.trajectory.coefficients  # positions hold, too fast is what it is
        faster = replace(found.trajectory, coefficients=inside, duration=2.5)
        return replace(found, trajectory=faster)

    monkeypatch.setattr(excite, "design", wild)
    words = ("--duration", "4", "--harmonics", "2", "--starts", "1", "--out", "m.json")
    # The slow stage would hold, the fast one does not: neither is written.
    stages = ("--speed", "10", "--speed", "100")
    ran = command("excite", "--robot", lib.folder, *words, *stages, "--export", "ros")
    assert ran.code == 2
    assert "does NOT hold" in ran.out
    assert ran.err.startswith("runtime: nothing is exported, the motion exceeds limits: ")
    assert re.search(r"add --speed \d\d, at which they are kept$", ran.err.strip())
    assert len(ran.err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["m.json"]
    ran = command("excite", "--robot", lib.folder, "--speed", "150", "--out", "n.json")
    assert (ran.code, (tmp_path / "n.json").exists()) == (2, False)
    assert "up to 100 %, got 150 %" in ran.err


def test_simulate_ideal_by_default_names(command: Command, lib: Library, tmp_path: Path) -> None:
    """Property: without a trajectory one is designed; the truth lies beside the log."""
    ran = command("simulate", "--robot", lib.folder, "--ideal", "--torque-noise", "0")
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


# The process stops for good at a known point inside the method; only SIGINT gets it going again.
WAITING = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job inherits "ignore"
import runtime.descent
import runtime.cli.{module} as room
runtime.descent.CHUNK = 50  # a look at Ctrl-C every 50 iterations
original = room.{function}

def waiting(*args, progress, **options):
    def told(done, *rest):
        progress(done, *rest)
        if done == {stop}:
            print("waiting", flush=True)
            time.sleep(100)
    return original(*args, progress=told, **options)

room.{function} = waiting
from runtime.cli import main
main()
"""


def interrupted(code: str, *words: object, cwd: Path) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a process that gets Ctrl-C once it says `waiting`."""
    with subprocess.Popen(
        [sys.executable, "-c", code, *map(str, words)],
        cwd=cwd,
        env=QUIET,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None
            for line in process.stdout:
                if "waiting" in line:
                    process.send_signal(signal.SIGINT)
                    break
            out, err = process.communicate(timeout=60)
        finally:
            process.kill()
    return process.returncode, out, err


def test_ctrl_c_keeps_the_best_identification(lib: Library, log: Path, tmp_path: Path) -> None:
    """Property: SIGINT during the descent writes the best point so far, and says so."""
    code = WAITING.format(module="identify", function="identify", stop=50)
    words = ("--robot", lib.folder, "--friction", "viscous,coulomb", "--out", "out")
    words += ("--method", "adam")
    ran = interrupted(code, "identify", log, *words, cwd=tmp_path)
    assert ran[0] == 0, ran
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["status"].startswith("interrupted by the user")
    assert facts["iterations"] == 50
    errors = facts["torque_error_percent"]
    assert errors["after_overall"] < errors["before_overall"]
    assert (tmp_path / "out" / "report.html").exists()
    assert "interrupted by the user" in ran[1]


def test_ctrl_c_keeps_the_best_excitation(lib: Library, tmp_path: Path) -> None:
    """Property: SIGINT after the first of many starts writes that one."""
    code = WAITING.format(module="excite", function="design", stop=1)
    words = ("--harmonics", "2", "--starts", "1000", "--duration", "4", "--out", "a.json")
    words = ("--document", *words)
    ran = interrupted(code, "excite", "--robot", lib.folder, *words, cwd=tmp_path)
    assert ran[0] == 0, ran
    facts = json.loads((tmp_path / "a.json").read_text())
    assert facts["condition_numbers_of_starts"] == pytest.approx(
        [facts["condition_number"]], rel=0.02
    )


def test_ctrl_c_before_there_is_anything(
    command: Command, lib: Library, log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: one sentence, the shell's exit code for SIGINT, and no file."""

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("runtime.cli.options.read_recording", interrupt)
    ran = command("identify", log, "--robot", lib.folder)
    assert (ran.code, ran.err.count("\n")) == (130, 1)
    assert "interrupted" in ran.err
    assert list(tmp_path.iterdir()) == []
