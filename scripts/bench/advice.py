"""Commands that `inspect` and `identify` print as advice, each run as it is printed.

Logs: every fault of the tests in the logs of two virtual robots, the published logs, a walking
robot, and three that are identified with too few columns, by a method without bounds, or with
joints at rest. A command works where it ends with 0, and `inspect` also with 1 if it wrote the
recipe that it announces; such a recipe is then given to `identify`.
"""

import contextlib
import io
import re
import shlex
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.faults import virtual_arms
from bench.free_base import icub
from bench.front import Sheet, tell
from bench.real_logs import FURTHER, LOGS, bare, library_of
from bench.same_results_inputs import icub_arrays
from runtime.library import load
from runtime.recording import read_recording, write_recording
from runtime.recording.recipes.recipe_file import recipe_text
from symgen.cli.console import main
from tests.runtime.faults import FAULTS
from tests.runtime.virtual_arms import Arm

PROGRAM = "symgen"
_COMMAND = re.compile(rf"\b{PROGRAM} [a-z]+ (?=-|[A-Z]+\b|\S*[./])[^;\n]*")
_OTHERS = ("--settings", "report=false", "--settings", "yes=true")


@dataclass(frozen=True, slots=True)
class Row:
    """One printed command."""

    log: str
    source: str  # command that printed it
    doubt: str  # sentence that it followed
    command: str
    code: int
    works: bool
    after: str  # doubt or refusal that is left, "" for none


def study(shared: Path, builds: Path | None, only: str | None = None) -> Iterator[Row]:
    """Run what the advice of every log names."""
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch)
        for log, folder, words, more in _logs(shared, builds or root, root):
            if only is None or only in log:
                tell(log)
                with contextlib.chdir(folder):
                    for row in _followed(log, words, more):
                        tell(f"  {'works' if row.works else 'FAILS'}: {row.command}")
                        yield row


Log = tuple[str, Path, list[str], Sequence[str]]
"""Name, folder, words of both commands, and those of `identify` alone."""


def _logs(shared: Path, builds: Path, root: Path) -> Iterator[Log]:
    """Every log."""
    yield from _further(shared, builds, root)
    for log in (*LOGS, *FURTHER):
        folder = root / log.name.replace(" ", "")
        folder.mkdir()
        place = bare(shared / "data" / log.place, folder / "raw")
        run = () if log.run is None else ("--run", log.run)
        robot = library_of(log.robot, shared, builds).folder
        yield log.name, folder, [str(place), "--robot", str(robot), *run], ()
    for name, make in virtual_arms(shared / "models", builds).items():
        arm = make()
        for k, fault in enumerate(FAULTS):
            words = _written(arm, fault.put(arm), root / f"{name}{k}".replace(" ", "_"))
            yield f"{name}: {fault.name}", *words, ()


def _further(shared: Path, builds: Path, root: Path) -> Iterator[Log]:
    """A log without a fixed base, and those whose advice no fault of a log brings out."""
    folder = root / "icub"
    folder.mkdir()
    np.savez(folder / "log.npz", **icub_arrays(shared / "data/icub_feet/walking.npz"))
    robot = icub(shared / "data/icub_feet", builds).folder
    yield "iCub, walking", folder, ["log.npz", "--robot", str(robot)], ()
    clean = read_recording("fr3_simulated")
    one, moves = np.arange(7) == 1, np.arange(7) < 2
    resting = {"q": np.where(moves, clean.q, clean.q[0]), "dq": np.where(moves, clean.dq, 0.0)}
    cases = {
        "friction without offset": (
            clean.replace(tau=clean.tau + 3.0 * one),
            ("--friction", "viscous,coulomb"),
        ),
        "method ols": (clean, ("--method", "ols")),
        "five joints at rest": (clean.replace(**resting), ()),
    }
    for k, (name, (log, more)) in enumerate(cases.items()):
        folder = root / f"fr3_{k}"
        folder.mkdir()
        write_recording(log, folder / "log.npz")
        yield f"FR3: {name}", folder, ["log.npz", "--robot", str(load("fr3").folder)], more


def _written(arm: Arm, log, folder: Path) -> tuple[Path, list[str]]:
    """Folder with a log and its recipe, and the words that name both."""
    folder.mkdir()
    np.savez(folder / "log.npz", **log.arrays)
    words = ["log.npz", "--robot", str(arm.lib.folder)]
    if log.recipe is None:
        return folder, words
    (folder / "recipe.toml").write_text(recipe_text(log.recipe), encoding="utf-8")
    return folder, [*words, "--recipe", "recipe.toml"]


def _followed(log: str, words: Sequence[str], more: Sequence[str]) -> Iterator[Row]:
    """Both commands of a user, then each command that they print."""
    for source in (("inspect", *words), ("identify", *words, *more, "--out", "out", *_OTHERS)):
        _, text = run(*source)
        for printed in dict.fromkeys(_COMMAND.findall(text)):
            command = re.split(r" \(|[.,]$", printed.strip())[0]
            for file in Path().glob("proposed*.toml"):
                file.unlink()
            said = shlex.split(command)[1:]
            code, after = run(*said)
            works = code == 0
            if said[0] == "inspect" and "--recipe-out" in said:
                recipe = said[said.index("--recipe-out") + 1]
                works = code in {0, 1} and Path(recipe).is_file()
                again = ("--recipe", recipe, "--out", "again", *_OTHERS, "--overwrite")
                after = run("identify", *words, *more, *again)[1] if works else after
            yield Row(log, source[0], doubt(text), command, code, works, doubt(after))


def run(*words: str) -> tuple[int, str]:
    """Exit code and output of a command in this process."""
    before, sys.argv = sys.argv, [PROGRAM, *words]
    out, code = io.StringIO(), 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        sys.argv = before
    return code, out.getvalue()


def doubt(text: str) -> str:
    """First warning or refusal of an output."""
    lines = [
        line for line in text.splitlines() if line.startswith(("warning", f"{PROGRAM}: ", "error"))
    ]
    lines = [line for line in lines if "will be replaced" not in line]
    return lines[0] if lines else ""


def sheet(rows: list[Row]) -> Sheet:
    """Commands and those that work, by their name; failures below."""
    kinds = Counter(row.command.split()[1] for row in rows)
    works = Counter(row.command.split()[1] for row in rows if row.works)
    lines = [(f"`{kind}`", str(count), str(works[kind])) for kind, count in kinds.most_common()]
    lines.append(("**all**", f"**{kinds.total()}**", f"**{works.total()}**"))
    failed = [f"{row.log}: {row.command} ({row.code}) {row.after}" for row in rows if not row.works]
    return Sheet("advice", ("command", "printed", "works"), lines, rows, notes=failed)
