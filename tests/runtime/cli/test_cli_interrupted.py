"""`python -m runtime` and Ctrl-C: the best so far is kept, or nothing is written."""

import json
import runpy
import signal
import subprocess
import sys
import types
from pathlib import Path

import pytest

from runtime.library import Library
from tests.runtime.conftest import Command
from tests.runtime.processes import QUIET

# The process stops for good at a known point inside the method; only SIGINT gets it going again.
WAITING = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job inherits "ignore"
import runtime.estimators.descent.fit
import {module} as room
runtime.estimators.descent.fit.CHUNK = 50  # a look at Ctrl-C every 50 iterations
original = room.{function}

def waiting(*args, progress, **options):
    shown = getattr(progress, "iteration", progress)
    def report(done, *rest):
        shown(done, *rest)
        if done == {stop}:
            print("waiting", flush=True)
            time.sleep(100)
    return original(*args, progress=report, **options)

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
            out, err = process.communicate(timeout=300)
        finally:
            process.kill()
    return process.returncode, out, err


def test_ctrl_c_keeps_the_best_identification(lib: Library, log: Path, tmp_path: Path) -> None:
    """Property: SIGINT during the descent writes the best point so far, and says so."""
    code = WAITING.format(
        module="runtime.identification.single_log", function="identify_recording", stop=50
    )
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
    code = WAITING.format(module="runtime.cli.excite", function="design", stop=1)
    words = (
        "--settings",
        "harmonics=2",
        "--settings",
        "starts=1000",
        "--duration",
        "4",
        "--out",
        "a.json",
    )
    words = ("--settings", "document=true", *words)
    ran = interrupted(code, "excite", "--robot", lib.folder, *words, cwd=tmp_path)
    assert ran[0] == 0, ran
    facts = json.loads((tmp_path / "a.json").read_text())
    assert facts["condition_numbers_of_starts"] == pytest.approx(
        [facts["condition_number"]], rel=0.02
    )


@pytest.mark.parametrize(
    ("package", "module"), [("runtime", "runtime.cli"), ("symgen", "symgen.cli.console")]
)
def test_ctrl_c_while_the_packages_load(
    package: str, module: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: the first second of a command is like every other, a line and no traceback."""

    class Loading(types.ModuleType):
        def __getattr__(self, _: str) -> None:
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, module, Loading(module))
    with pytest.raises(SystemExit) as end:
        runpy.run_module(package, run_name="__main__")
    assert end.value.code == 130
    assert capsys.readouterr().err == f"{package}: interrupted\n"


def test_ctrl_c_before_there_is_anything(
    command: Command, lib: Library, log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: one sentence, the shell's exit code for SIGINT, and no file."""

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("runtime.recording.streamed.read_recording", interrupt)
    ran = command("identify", log, "--robot", lib.folder)
    assert (ran.code, ran.err.count("\n")) == (130, 1)
    assert "interrupted" in ran.err
    assert list(tmp_path.iterdir()) == []
