"""A mutation run: a seeded sample of the mutants of rooms, each against the tests of its room.

Mutants are written into copies of the repository. `outcomes.jsonl` has one line per mutant,
`survivors-ROOM.txt` what no test noticed; both are written as the outcomes come.
"""

import json
import re
import shlex
import shutil
import sys
import time
import tomllib
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from cosmic_ray.testing import run_tests
from cosmic_ray.util import restore_contents
from cosmic_ray.work_item import TestOutcome

from scripts.bench.front import markdown as table_of
from scripts.mutation.mutants import Mutant, sample
from scripts.mutation.rooms import ROOMS, Room

ROOT = Path(__file__).resolve().parents[2]
EQUIVALENTS = Path(__file__).with_name("equivalents.toml")
RESULTS = ROOT / "results" / "mutation"
NOTICED, SURVIVED, EQUIVALENT, INVALID = "noticed", "survived", "equivalent", "invalid"
"""A mutant is invalid if it does not compile."""
PATIENCE_S = 60.0  # time that the tests of a mutant may take beyond four times the usual one [s]
LEFT_OUT = (".git", ".venv", "results", "__pycache__", ".*_cache", ".hypothesis")


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of one mutant."""

    room: str
    path: str
    line: int
    before: str
    after: str
    verdict: str
    seconds: float = 0.0  # until the first test failed

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Room, path, before and after."""
        return self.room, self.path, self.before, self.after


def run(
    names: Sequence[str],
    count: int,
    seed: int,
    processes: int = 1,
    again: bool = False,
    rooms: dict[str, Room] = ROOMS,
    root: Path = ROOT,
    folder: Path = RESULTS,
) -> list[Outcome]:
    """Outcomes of `count` mutants per room; those known are kept, with `again` but survivors."""
    folder.mkdir(parents=True, exist_ok=True)
    known = {outcome.key: outcome for outcome in outcomes_in(folder)}
    idle, trees = equivalents(), SimpleQueue[Path]()
    for k in range(processes):
        shutil.rmtree(folder / f"tree-{k}", ignore_errors=True)
        shutil.copytree(root, folder / f"tree-{k}", ignore=shutil.ignore_patterns(*LEFT_OUT))
        trees.put(folder / f"tree-{k}")

    def on_a_tree(work: Callable[[Path], Any]) -> Any:
        tree = trees.get()
        try:
            return work(tree)
        finally:
            trees.put(tree)

    with ThreadPoolExecutor(processes) as threads:
        usual = dict(
            zip(
                names,
                threads.map(lambda name: on_a_tree(lambda t: _usual(t, rooms[name])), names),
                strict=True,
            )
        )

        def outcome_of(job: tuple[str, Mutant]) -> Outcome:
            name, mutant = job
            head = name, mutant.path, mutant.line, mutant.before, mutant.after
            if _plain(mutant.path, mutant.before, mutant.after) in idle:
                return Outcome(*head, EQUIVALENT)
            return on_a_tree(lambda t: Outcome(*head, *_met(t, rooms[name], mutant, usual[name])))

        jobs = []
        for name in names:
            for mutant in islice(sample(rooms[name].files(root), root, seed), count):
                last = known.get((name, mutant.path, mutant.before, mutant.after))
                if last is None or (again and last.verdict == SURVIVED):
                    jobs.append((name, mutant))
        for outcome in threads.map(outcome_of, jobs):
            known[outcome.key] = outcome
            _write(folder, known.values())
    return [outcome for outcome in known.values() if outcome.room in names]


def _usual(tree: Path, room: Room) -> float:
    """Time that the tests of a room take without a mutant [s]; they must pass."""
    start = time.monotonic()
    outcome, said = run_tests(_command(tree, room), 3600.0)
    if outcome is not TestOutcome.SURVIVED:
        raise RuntimeError(f"the tests of a room fail without any mutant:\n{said[-3000:]}")
    return time.monotonic() - start


def _met(tree: Path, room: Room, mutant: Mutant, usual: float) -> tuple[str, float]:
    """Verdict of the tests of a room, and their time [s]; one that hangs is noticed."""
    start = time.monotonic()
    with restore_contents(tree / mutant.path):
        (tree / mutant.path).write_text(mutant.make(), encoding="utf-8")
        outcome, said = run_tests(_command(tree, room), PATIENCE_S + 4.0 * usual)
    verdict = SURVIVED if outcome is TestOutcome.SURVIVED else NOTICED
    if verdict == NOTICED and "CompilerError" in said:
        verdict = INVALID
    return verdict, round(time.monotonic() - start, 1)


def _command(tree: Path, room: Room) -> str:
    """Pytest in a copy of the repository, which begins with the tests that failed last."""
    words = ["env", "-C", str(tree), f"PYTHONPATH={tree}", sys.executable, "-m", "pytest"]
    words += ["-x", "-q", "--failed-first", "--basetemp", str(tree / ".tests")]
    words += room.test_files(tree)
    return shlex.join([*words, "-k", room.only] if room.only else words)


def outcomes_in(folder: Path) -> list[Outcome]:
    """Outcomes of a folder, in the order of the run."""
    file = folder / "outcomes.jsonl"
    rows = file.read_text("utf-8").splitlines() if file.is_file() else []
    return [Outcome(**json.loads(row)) for row in rows]


def _write(folder: Path, outcomes: Iterable[Outcome]) -> None:
    rows = [json.dumps(asdict(o), ensure_ascii=False) + "\n" for o in outcomes]
    (folder / "outcomes.jsonl").write_text("".join(rows), encoding="utf-8")
    for room in {o.room for o in outcomes}:
        left = [o for o in outcomes if (o.room, o.verdict) == (room, SURVIVED)]
        lines = [f"{o.path}:{o.line}\n  - {o.before}\n  + {o.after}\n" for o in left]
        (folder / f"survivors-{room}.txt").write_text("".join(lines), encoding="utf-8")


def equivalents() -> dict[tuple[str, ...], str]:
    """Reason by path, line and altered line without spaces of mutants that change no result."""
    entries = tomllib.loads(EQUIVALENTS.read_text(encoding="utf-8"))["equivalent"]
    return {_plain(e["path"], e["before"], e["after"]): e["reason"] for e in entries}


def _plain(*words: str) -> tuple[str, ...]:
    return tuple(re.sub(r"\s", "", word) for word in words)


def share(outcomes: Sequence[Outcome]) -> float:
    """Share of the mutants noticed, equivalent ones left out; 1 where there are none."""
    noticed = sum(o.verdict == NOTICED for o in outcomes)
    counted = noticed + sum(o.verdict == SURVIVED for o in outcomes)
    return noticed / counted if counted else 1.0


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Counts by room and their sum; what does not compile does not count."""
    valid = [o for o in outcomes if o.verdict != INVALID]
    groups = {o.room: [one for one in valid if one.room == o.room] for o in valid}
    rows = []
    for name, some in [*groups.items(), ("all", valid)]:
        counts = [sum(o.verdict == v for o in some) for v in (NOTICED, SURVIVED, EQUIVALENT)]
        rows.append([name, *map(str, (len(some), *counts)), f"{100 * share(some):.0f} %"])
    return table_of(("room", "mutants", "noticed", "survived", "equivalent", "share"), rows)
