"""The runs behind `scripts/bench_start`: CPU time of whole commands, in fresh interpreters."""

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.front import ROOT, BenchError, Sheet, sheet_of

_IDENTIFY = ("-m", "runtime", "identify", "{log}", "--robot", "fr3", "--out", "out", "--overwrite")
_CONSOLE = "from symgen.cli.console import main; main()"
COMMANDS = (
    ("symgen --help", ("-c", f"import sys; sys.argv = ['symgen', '--help']; {_CONSOLE}"), 0.5),
    ("import runtime", ("-c", "import runtime"), 0.3),
    ("identify {log}", _IDENTIFY, 2.0),
    ("identify {log} --settings report=false", (*_IDENTIFY, "--settings", "report=false"), 1.5),
)
"""Label, words of the interpreter, and largest CPU time on a quiet core [s]."""
_BUILD = ("-m", "symgen", "build", "--urdf", "arm.urdf", "--name", "arm", "--settings", "snap=1e-9")
LONGEST_BUILD = 9.0  # CPU time of a build of an arm of seven joints, at most [s]


def measure(rounds: int, log: str, only_imports: bool = False) -> list[dict[str, Any]]:
    """CPU time and bar [s], medians of runs; the build of the FR3 under another name once."""
    if rounds < 1:
        raise BenchError(f"expected at least one round, got {rounds}")
    with tempfile.TemporaryDirectory() as name:
        folder, rows = Path(name), []
        for label, words, goal in COMMANDS[: 2 if only_imports else None]:
            command = [word.format(log=log) for word in words]
            _cpu(folder, command)  # compiles and reads what later runs find
            seconds = statistics.median(_cpu(folder, command) for _ in range(rounds))
            rows.append({"work": label.format(log=log), "seconds": seconds, "goal": goal})
        if not only_imports:
            text = (ROOT / "symgen/robots/fr3.urdf").read_text(encoding="utf-8")
            text = text.replace('name="fr3"', 'name="arm"', 1)
            (folder / "arm.urdf").write_text(text, encoding="utf-8")
            seconds = _cpu(folder, (*_BUILD, "--out", str(folder / "generated")))
            rows.append(
                {"work": "build --urdf, 7 joints", "seconds": seconds, "goal": LONGEST_BUILD}
            )
    return rows


def _cpu(folder: Path, words: Sequence[str]) -> float:
    """CPU time of an interpreter and of all its processes, without a compiler cache [s]."""
    own = {"PYTHONPATH": str(ROOT), "CCACHE_DISABLE": "1", "SYMGEN_BUILDS": str(folder / "builds")}
    environment = os.environ | own
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # installed packages have their byte code
    (folder / "builds").mkdir(mode=0o700, exist_ok=True)
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(
            [sys.executable, *words], cwd=folder, env=environment, stdout=output, stderr=output
        )
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            output.seek(0)
            said = output.read().decode(errors="replace").strip()[-1000:]
            raise BenchError(f"'{' '.join(words)}' failed: {said}")
    return used.ru_utime + used.ru_stime


def sheet(rows: list[dict[str, Any]]) -> Sheet:
    """One line per command."""
    columns = {"work": "{work}", "CPU s": "{seconds:.2f}", "goal": "≤ {goal:g}"}
    return sheet_of("bench_start", columns, rows)
