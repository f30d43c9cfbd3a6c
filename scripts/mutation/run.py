"""A mutation run: sample of the rooms, tests on a copy of the repository, outcomes in a folder.

`outcomes.jsonl` has one line per mutant, `survivors-ROOM.txt` what no test noticed; both are
written
as the outcomes come.
"""

import json
import os
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Container, Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from shutil import copy2, which

import pytest

from scripts.mutation.children import Ended
from scripts.mutation.line_map import LineMap
from scripts.mutation.mutants import Mutant, mutants_of
from scripts.mutation.plan import Planner
from scripts.mutation.rooms import ROOMS
from scripts.mutation.server import HEAVY, QUIET, Job, Report, Server, enter, serve_cold

ROOT = Path(__file__).resolve().parents[2]
EQUIVALENTS = Path(__file__).with_name("equivalents.toml")
RESULTS = ROOT / "results" / "mutation"
TEMPORARY = tempfile.gettempdir()
"""As this process found it; a run points its tests to a folder of its own, which it removes."""
NOTICED, SURVIVED, EQUIVALENT = "noticed", "survived", "equivalent"


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of one mutant.

    Attributes:
        room: its room.
        path, line, before, after: as in `Mutant`.
        verdict: noticed, survived or equivalent.
        by: test that failed or exceeded its time.
        n_tests: number of tests started.
        seconds: CPU time [s].
    """

    room: str
    path: str
    line: int
    before: str
    after: str
    verdict: str
    by: str = ""
    n_tests: int = 0
    seconds: float = 0.0

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Room, path, before and after."""
        return self.room, self.path, self.before, self.after

    def text(self) -> str:
        """Return the lines of a list of survivors."""
        where = f"{self.path}:{self.line}  ({self.n_tests} tests)"
        return f"{where}\n  - {self.before}\n  + {self.after}"


class Journal:
    """Outcomes so far; the last one of a mutant counts."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "outcomes.jsonl"
        folder.mkdir(parents=True, exist_ok=True)

    def read(self) -> list[Outcome]:
        """Return the last outcome of each mutant, in the order of the run."""
        rows = self.file.read_text("utf-8").splitlines() if self.file.is_file() else []
        last: dict[tuple[str, ...], Outcome] = {}
        for row in rows:
            outcome = Outcome(**json.loads(row))
            last[outcome.key] = outcome
        return list(last.values())

    def keep(self, rooms: Sequence[str], wanted: Container[tuple[str, ...]]) -> None:
        """Drop the outcomes of rooms, except some.

        Args:
            rooms: their names.
            wanted: room, path, before and after of those that stay.
        """
        kept = [o for o in self.read() if o.room not in rooms or o.key in wanted]
        lines = [json.dumps(asdict(o), ensure_ascii=False) + "\n" for o in kept]
        self.file.write_text("".join(lines), encoding="utf-8")

    def add(self, outcome: Outcome) -> None:
        """Write an outcome, and the survivors of its room again."""
        with self.file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(outcome), ensure_ascii=False) + "\n")
        lines = [o.text() for o in self.read() if (o.room, o.verdict) == (outcome.room, SURVIVED)]
        target = self.folder / f"survivors-{outcome.room}.txt"
        target.write_text("\n".join([*lines, ""]), encoding="utf-8")


def sample(room: str, count: int, seed: int) -> list[Mutant]:
    """Return the mutants of a room that a run draws.

    Args:
        room: key of `ROOMS`.
        count: number of mutants, fewer where the room has no more.
        seed: of the choice.

    Returns:
        Mutants in the order of a hash of seed and text: changes elsewhere do not redraw them.
        Of equal lines of a file only the first counts.
    """
    every = {
        (mutant.path, mutant.before, mutant.after): mutant
        for file in reversed(ROOMS[room].files(ROOT))
        for mutant in reversed(mutants_of(file, ROOT))
    }
    keys = sorted(every, key=lambda key: sha256("\n".join([str(seed), *key]).encode()).digest())
    return [every[key] for key in keys[:count]]


def run(
    rooms: Sequence[str],
    count: int,
    seed: int,
    budget_s: float,
    processes: int,
    again: bool = False,
    resume: bool = False,
    folder: Path = RESULTS,
) -> list[Outcome]:
    """Run a seeded sample of the mutants of rooms.

    Args:
        rooms: keys of `ROOMS`.
        count: number of mutants per room.
        seed: of the sample.
        budget_s: CPU time of the tests per mutant [s].
        processes: number at a time.
        again: True keeps the outcomes so far and runs those mutants that survived.
        resume: True keeps the outcomes so far and runs the mutants without one.
        folder: of map, outcomes and survivors.

    Returns:
        The outcomes of these rooms.

    Raises:
        RuntimeError: no map, or the tests cannot be collected.
    """
    LineMap(ROOT, folder / "map")  # before any work: its error says how to record one
    journal = Journal(folder)
    drawn = {room: sample(room, count, seed) for room in rooms}
    last = {o.key: o.verdict for o in journal.read()} if again or resume else {}
    keys = {(room, m.path, m.before, m.after) for room, ms in drawn.items() for m in ms}
    journal.keep(rooms, keys & last.keys())
    wanted = ({SURVIVED} if again else set()) | (set() if again and not resume else {None})
    drawn = {
        room: [m for m in mutants if last.get((room, m.path, m.before, m.after)) in wanted]
        for room, mutants in drawn.items()
    }
    known = {(e["path"], e["before"], e["after"]) for e in equivalents()}
    jobs: dict[str, list[tuple[str, Job]]] = {}
    for room, mutants in drawn.items():
        for m in mutants:
            if (m.path, m.before, m.after) in known:
                journal.add(Outcome(room, m.path, m.line, m.before, m.after, EQUIVALENT))
            else:
                package = m.path.split("/")[0]
                one = Job(m, ROOMS[room].tests, robots=ROOMS[room].robots)
                jobs.setdefault(package, []).append((room, one))
    for library in HEAVY:
        __import__(library)
    os.environ.setdefault("SYMGEN_DATA", str(ROOT.parent / "shared"))
    tree = update_copy(folder / "tree")
    for some in jobs.values():
        room_of = {id(job.mutant): room for room, job in some}

        def report(job: Job, ended: Ended, room_of: dict[int, str] = room_of) -> None:
            m = job.mutant
            verdict = NOTICED if ended.noticed else SURVIVED
            words = (m.path, m.line, m.before, m.after, verdict, ended.by, ended.n_tests)
            journal.add(Outcome(room_of[id(m)], *words, round(ended.seconds, 1)))

        def planner_of(known: Sequence[str]) -> Planner:
            return Planner(ROOT, LineMap(ROOT, folder / "map"), known, budget_s)

        _run_package(tree, [job for _, job in some], planner_of, processes, report)
    return [o for o in journal.read() if o.room in rooms]


def equivalents() -> list[dict[str, str]]:
    """Return the mutants that change no result, each with path, before, after and reason."""
    entries = tomllib.loads(EQUIVALENTS.read_text(encoding="utf-8"))
    return list(entries.get("equivalent", []))


def update_copy(folder: Path) -> Path:
    """Make a folder equal to the files that git knows and to the built libraries.

    Args:
        folder: of the copy; what is not in the repository any more is removed.

    Returns:
        The folder.
    """
    listed = subprocess.run(
        [which("git") or "git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    built = [p.relative_to(ROOT).as_posix() for p in (ROOT / "generated").rglob("*") if p.is_file()]
    names = {n for n in [*listed.split("\0"), *built] if n and (ROOT / n).is_file()}
    for path in [p for p in folder.rglob("*") if p.is_file() and p.suffix != ".pyc"]:
        if path.relative_to(folder).as_posix() not in names:
            path.unlink()
    for name in names:
        source, target = ROOT / name, folder / name
        if not target.is_file() or target.read_bytes() != source.read_bytes():
            target.parent.mkdir(parents=True, exist_ok=True)
            copy2(source, target)
    return folder


def _run_package(
    tree: Path,
    jobs: Sequence[Job],
    planner_of: Callable[[Sequence[str]], Planner],
    processes: int,
    report: Report,
) -> None:
    """Run the mutants of one package: those of functions in a process that has imported it.

    Those that take effect at import come next, then the templates, one at a time.
    """
    with tempfile.TemporaryDirectory(prefix="mutate-", dir=TEMPORARY) as scratch:
        os.environ |= {"TMPDIR": scratch, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
        tempfile.tempdir = None
        left = Path(scratch, "left.json")
        child = os.fork()
        if child == 0:
            _serve(tree, Server(tree, jobs, planner_of, processes, report), left)
        _, status = os.waitpid(child, 0)
        if os.waitstatus_to_exitcode(status) != 0:
            raise RuntimeError("the run ended before its last mutant; its output says why")
        facts = json.loads(left.read_text("utf-8"))
        cold = [replace(jobs[k], tests=tuple(tests)) for k, tests in facts["jobs"]]
        planner = planner_of([test for job in cold for test in job.tests])
        planner.sound |= set(facts["sound"])
        planner.broken |= set(facts["broken"])
        python = [job for job in cold if job.mutant.path.endswith(".py")]
        templates = [job for job in cold if job not in python]
        serve_cold(tree, python, planner, processes, report)
        serve_cold(tree, templates, planner, 1, report)


def _serve(tree: Path, server: Server, left: Path) -> None:
    """Serve in this process, write what it leaves, and end it."""
    code = 1
    try:
        enter(tree)
        sys.dont_write_bytecode = False  # of the unaltered sources, before the forks
        pytest.main([*QUIET, "--continue-on-collection-errors", "tests"], plugins=[server])
        places = {id(job.mutant): k for k, job in enumerate(server.jobs)}
        rows = [(places[id(job.mutant)], job.tests) for job in server.cold]
        sound, broken = (sorted(names) for names in (server.planner.sound, server.planner.broken))
        facts = {"jobs": rows, "sound": sound, "broken": broken}
        left.write_text(json.dumps(facts), encoding="utf-8")
        code = 0 if server.served else 1
    finally:
        sys.stdout.flush()
        os._exit(code)
