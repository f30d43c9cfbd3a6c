"""The runs behind `scripts/bench_start`: CPU time of a command over that of its libraries."""

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from bench.compiled import BenchError
from bench.markdown import markdown_table

_ROOT = Path(__file__).resolve().parents[2]
_LIBRARIES = "import numpy, scipy.linalg"
_FIGURES = "import numpy, scipy.linalg, matplotlib.figure"


@dataclass(frozen=True, slots=True)
class Row:
    """Medians of one command."""

    work: str  # what was run
    libraries: str  # statement of the interpreter that it is compared with; "" for a build
    seconds: float  # CPU time of the command [s]
    peer: float  # CPU time of the libraries [s]; NaN without them
    goal: float  # ratio, or CPU time [s] of a build

    @property
    def value(self) -> float:
        """Ratio of both times; CPU time [s] of a build."""
        return self.seconds / self.peer if self.libraries else self.seconds

    def as_json(self) -> dict[str, Any]:
        """JSON-ready values."""
        facts = asdict(self) | {"value": self.value}
        return facts | {"peer": self.peer if self.libraries else None}


def measure(rounds: int, log: str, only_imports: bool = False) -> list[Row]:
    """Time every command and its libraries in turn."""
    if rounds < 1:
        raise BenchError(f"expected at least one round, got {rounds}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        identify = ("-m", "runtime", "identify", log, "--robot", "fr3")
        out = ("--out", str(folder / "out"), "--overwrite")
        cases = (
            ("import runtime", ("-c", "import runtime"), _LIBRARIES, 1.2),
            ("symgen --help", ("-m", "symgen", "--help"), "import typer, rich", 4.0),
            ("identify with report", (*identify, *out), _FIGURES, 1.8),
            ("identify --no-report", (*identify, *out, "--no-report"), _LIBRARIES, 1.8),
        )
        rows = []
        for work, words, libraries, goal in cases[: 2 if only_imports else None]:
            _cpu(folder, words)  # compiles and reads what later runs find
            pairs = [(_cpu(folder, words), _cpu(folder, ("-c", libraries))) for _ in range(rounds)]
            own, peer = (statistics.median(times) for times in zip(*pairs, strict=True))
            rows.append(Row(work, libraries, own, peer, goal))
        if not only_imports:
            rows.append(_build(folder))
    return rows


def _build(folder: Path) -> Row:
    """The FR3 under another name and without its configuration, by the plain compiler."""
    text = (_ROOT / "symgen/robots/fr3.urdf").read_text(encoding="utf-8")
    (folder / "arm.urdf").write_text(text.replace('name="fr3"', 'name="arm"', 1), encoding="utf-8")
    words = ("build", "--urdf", "arm.urdf", "--name", "arm", "--snap", "1e-9")
    builds = str(folder / "builds")
    place = {"CCACHE_DISABLE": "1", "SYMGEN_BUILDS": builds}
    (folder / "builds").mkdir(mode=0o700)
    seconds = _cpu(folder, ("-m", "symgen", *words, "--out", str(folder / "generated")), place)
    shutil.rmtree(folder / "generated")
    return Row("build --urdf, 7 joints", "", seconds, float("nan"), 9.0)


def _cpu(folder: Path, words: Sequence[str], place: Mapping[str, str] | None = None) -> float:
    """CPU time of an interpreter and of all its processes [s]."""
    environment = {**os.environ, "PYTHONPATH": str(_ROOT), **(place or {})}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # installed packages have their byte code
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


def _cells(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """Text of every row."""
    return [
        (
            row.work,
            f"{row.seconds:.2f}",
            f"{row.peer:.2f} ({row.libraries})" if row.libraries else "",
            f"{row.value:.2f} ×" if row.libraries else "",
            f"≤ {row.goal:g} ×" if row.libraries else f"≤ {row.goal:g} s",
        )
        for row in rows
    ]


_HEADER = ("work", "CPU s", "libraries alone, CPU s", "ratio", "goal")


def table(rows: Sequence[Row]) -> Table:
    """Rows for a terminal."""
    shown = Table(*_HEADER)
    for cells in _cells(rows):
        shown.add_row(*cells)
    return shown


def markdown(rows: Sequence[Row]) -> str:
    """Rows as a Markdown table."""
    return markdown_table(_HEADER, _cells(rows))
