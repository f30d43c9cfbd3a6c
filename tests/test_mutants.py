"""Mutants of `scripts/mutate`: what is altered, how a run counts, which mutants change nothing."""

import ast
import tomllib
from pathlib import Path

import pytest

from scripts.mutation.mutants import Mutant, mutants_of, sample
from scripts.mutation.rooms import ROOMS, Room
from scripts.mutation.run import (
    EQUIVALENT,
    EQUIVALENTS,
    INVALID,
    NOTICED,
    ROOT,
    SURVIVED,
    Outcome,
    equivalents,
    markdown,
    outcomes_in,
    run,
)

PYTHON = '''"""A docstring with 1 < 2."""


def clipped(x: "int < 3", low: float = 0.5) -> float:
    """Another docstring - with a sign."""
    if x < low and x != 2:
        raise ValueError("expected 1 - 2", 3)
    return min(x, -low) * (x - 1)
'''
SHORT = 3000
"""Bytes of a file whose mutants are a few dozen: all of a long one are drawn in seconds."""
C = """/* 1.0 * 2.0 */
#include "a-b.h"
{% if a * b %}
x = fmin(a, b) + 2.5 * c[i];
"""


def test_signs_constants_and_comparisons_are_altered(tmp_path: Path) -> None:
    """Oracle: the list by hand; docstrings, annotations and messages stay."""
    file = tmp_path / "room.py"
    file.write_text(PYTHON, encoding="utf-8")
    pairs = sorted((m.line, " ".join(m.after.split())) for m in mutants_of(file, tmp_path))
    assert pairs == [
        (4, 'def clipped(x: "int < 3", low: float = -0.5) -> float:'),
        (4, 'def clipped(x: "int < 3", low: float = 1.5) -> float:'),
        (6, "if not x < low and x != 2:"),
        (6, "if x < low and x != 1:"),
        (6, "if x < low and x != 3:"),
        (6, "if x < low and x == 2:"),
        (6, "if x < low or x != 2:"),
        (6, "if x >= low and x != 2:"),
        (8, "return min(x, -low) * (x + 1)"),
        (8, "return min(x, -low) * (x - 0)"),
        (8, "return min(x, -low) * (x - 2)"),
        (8, "return min(x, -low) / (x - 1)"),
        (8, "return min(x, low) * (x - 1)"),
    ]


def test_templates_are_altered_outside_comments(tmp_path: Path) -> None:
    """Property: signs, constants and minima of one line, no directive, comment or statement."""
    file = tmp_path / "room.c.jinja2"
    file.write_text(C, encoding="utf-8")
    mutants = mutants_of(file, tmp_path)
    assert {m.line for m in mutants} == {4}
    assert {
        "x = fmax(a, b) + 2.5 * c[i];",
        "x = fmin(a, b) - 2.5 * c[i];",
        "x = fmin(a, b) + (2+1).5 * c[i];",
        "x = fmin(a, b) + 2.5 / c[i];",
    } <= {m.after for m in mutants}


def test_every_room_has_sources_and_tests_and_its_mutants_parse() -> None:
    """Property: paths exist, each mutant differs from its file in one line, and is Python."""
    assert EQUIVALENTS.is_file()
    for name, room in ROOMS.items():
        assert all([*ROOT.glob(path)] for path in (*room.sources, *room.tests)), name
        files = room.files(ROOT)
        assert files, name
        files = [file for file in files if file.stat().st_size > SHORT] or files
        mutants = mutants_of(min(files, key=lambda file: file.stat().st_size), ROOT)
        assert mutants, name
        for mutant in mutants[:: max(1, len(mutants) // 2)]:
            assert mutant.before != mutant.after
            if mutant.path.endswith(".py"):
                ast.parse(mutant.make())


def test_a_sample_does_not_depend_on_other_lines(tmp_path: Path) -> None:
    """Property: one seed, one order; a line more before the others leaves their order."""
    file = tmp_path / "room.py"

    def drawn(text: str, seed: int) -> list[Mutant]:
        file.write_text(text, encoding="utf-8")
        return [m for m in sample([file], tmp_path, seed) if "below" not in m.before]

    first, longer, other = (
        [m.after for m in drawn(*case)]
        for case in ((PYTHON, 0), ("below = 1 < 2\n" + PYTHON, 0), (PYTHON, 1))
    )
    assert first == longer != other
    assert sorted(first) == sorted(other)


ROOM = """
import os, signal, time
LIMIT = 3
def above(x):
    if x in ():
        os.kill(os.getpid(), signal.SIGKILL)
    while x in ():
        time.sleep(LIMIT)
    return x > LIMIT
"""
TESTS = """
from room import above
def test_above():
    assert above(5)
    assert not above(1)
"""


def test_a_run_counts_what_tests_notice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: by hand; failure, crash and hanging are noticed, and files are as they were."""
    monkeypatch.setattr("scripts.mutation.run.PATIENCE_S", 1.0)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # half of the start of a process
    root, folder = tmp_path / "root", tmp_path / "results"
    (root / "tests").mkdir(parents=True)
    (root / "room.py").write_text(ROOM, encoding="utf-8")
    (root / "tests" / "test_room.py").write_text(TESTS, encoding="utf-8")
    rooms = {"small": Room(("room.py",), ("tests",))}
    outcomes = run(["small"], 100, 0, 1, False, rooms, root, folder)
    verdicts = {" ".join(o.after.split()): o.verdict for o in outcomes}
    noticed = {after for after, verdict in verdicts.items() if verdict == NOTICED}
    assert noticed == {"return x <= LIMIT", "if not x in ():", "while not x in ():"}
    assert verdicts["LIMIT = 4"] == verdicts["LIMIT = 2"] == SURVIVED
    assert (folder / "tree-0" / "room.py").read_text(encoding="utf-8") == ROOM
    assert "+ LIMIT = 4" in (folder / "survivors-small.txt").read_text(encoding="utf-8")
    sharper = TESTS + "    assert above(4) and not above(3)\n"
    (root / "tests" / "test_room.py").write_text(sharper, encoding="utf-8")
    again = run(["small"], 100, 0, 1, True, rooms, root, folder)
    assert {o.verdict for o in again if o.before == "LIMIT = 3"} == {NOTICED}
    assert outcomes_in(folder) == again
    (root / "tests" / "test_room.py").write_text("assert False\n", encoding="utf-8")
    with pytest.raises(RuntimeError, match="fail without any mutant"):
        run(["small"], 100, 0, 1, False, rooms, root, folder)


def test_the_table_leaves_equivalent_mutants_out_of_the_share() -> None:
    """Oracle: the row by hand; a mutant that does not compile is none."""
    outcomes = [
        Outcome("convex", "a.py", k, "x", "y", verdict)
        for k, verdict in enumerate([NOTICED] * 3 + [SURVIVED, EQUIVALENT, INVALID])
    ]
    assert markdown(outcomes).splitlines()[2] == "| convex | 5 | 3 | 1 | 1 | 75 % |"


def mutants_around(path: Path, before: str, folder: Path) -> list[Mutant]:
    """Mutants of the functions and classes of a file that have a line: of all it takes seconds."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        lines, parts = text.splitlines(), []
        for node in ast.parse(text).body:
            first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", ()))])
            parts.append(lines[first - 1 : node.end_lineno])
        those = [part for part in parts if before in map(str.strip, part)]
        text = "\n".join(line for part in those for line in part)
    (folder / path.name).write_text(text, encoding="utf-8")
    return mutants_of(folder / path.name, folder)


def test_every_equivalent_mutant_is_of_a_line_that_exists(tmp_path: Path) -> None:
    """Property: an entry names one file, a line of it, another line that is drawn, a reason."""
    entries = tomllib.loads(EQUIVALENTS.read_text(encoding="utf-8"))["equivalent"]
    assert len(equivalents()) == len(entries)
    for entry in entries:
        assert set(entry) == {"path", "before", "after", "reason"}
        mutants = mutants_around(ROOT / entry["path"], entry["before"], tmp_path)
        drawn = [m for m in mutants if m.before == entry["before"]]
        after = "".join(entry["after"].split())
        assert any("".join(m.after.split()) == after for m in drawn), entry
