"""Mutants of `scripts/mutate`: what is altered, how it enters a process, which tests it meets."""

import ast
import json
import os
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest
from coverage import CoverageData

from scripts.mutation.alteration import exchanges, functions_by_file, import_altered
from scripts.mutation.children import ended
from scripts.mutation.line_map import LineMap
from scripts.mutation.mutants import mutants_of
from scripts.mutation.plan import Planner
from scripts.mutation.rooms import ROOMS
from scripts.mutation.run import (
    EQUIVALENT,
    EQUIVALENTS,
    NOTICED,
    ROOT,
    SURVIVED,
    Outcome,
    equivalents,
)
from scripts.mutation.table import markdown

PYTHON = '''"""A docstring with 1 < 2."""


def clipped(x: "int < 3", low: float = 0.5) -> float:
    """Another docstring - with a sign."""
    if x < low and x != 2:
        raise ValueError("expected 1 - 2")
    return min(x, -low) * (x - 1)
'''
C = """/* 1.0 * 2.0 */
#include "a-b.h"
x = fmin(a, b) + 2.5 * c[i];  {# 3.0 #}
"""


def test_signs_constants_comparisons_and_minima_are_altered(tmp_path: Path) -> None:
    """Oracle: the list by hand; docstrings, annotations and messages stay."""
    file = tmp_path / "room.py"
    file.write_text(PYTHON, encoding="utf-8")
    pairs = [(m.line, m.after) for m in mutants_of(file, tmp_path)]
    assert pairs == [
        (4, 'def clipped(x: "int < 3", low: float = 5.0) -> float:'),
        (6, "if not (x < low and x != 2):"),
        (6, "if x >= low and x != 2:"),
        (6, "if x < low or x != 2:"),
        (6, "if x < low and x == 2:"),
        (6, "if x < low and x != 3:"),
        (8, "return max(x, -low) * (x - 1)"),
        (8, "return min(x,  low) * (x - 1)"),
        (8, "return min(x, -low) / (x - 1)"),
        (8, "return min(x, -low) * (x + 1)"),
        (8, "return min(x, -low) * (x - 2)"),
    ]


def test_templates_are_altered_outside_comments(tmp_path: Path) -> None:
    """Oracle: the list by hand."""
    file = tmp_path / "room.c.jinja2"
    file.write_text(C, encoding="utf-8")
    assert [m.after.split(";")[0] for m in mutants_of(file, tmp_path)] == [
        "x = fmax(a, b) + 2.5 * c[i]",
        "x = fmin(a, b) - 2.5 * c[i]",
        "x = fmin(a, b) + (2.5 * 10) * c[i]",
        "x = fmin(a, b) + 2.5 / c[i]",
    ]


def test_every_room_has_sources_and_tests_and_its_mutants_parse() -> None:
    """Property: paths exist, each mutant differs from its file in one line, and is Python."""
    assert EQUIVALENTS.is_file()
    for name, room in ROOMS.items():
        assert all((ROOT / path).exists() for path in (*room.sources, *room.tests)), name
        files = room.files(ROOT)
        assert files, name
        mutants = mutants_of(files[len(files) // 2], ROOT)
        for mutant in mutants[:20]:
            assert mutant.before != mutant.after
            if mutant.path.endswith(".py"):
                ast.parse(mutant.text)


def test_a_mutant_enters_loaded_functions_or_the_next_import(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: code of functions is exchanged where it is bound, a constant only at import."""
    whole = "LIMIT = 2\n\n\ndef above(x, low=1):\n    return max(x - low, LIMIT)\n"
    file = tmp_path / "altered_room.py"
    file.write_text(whole, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "meta_path", [*sys.meta_path])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    above = import_module("altered_room").above
    functions = functions_by_file(tmp_path)["altered_room.py"]
    by_line = {m.after: exchanges(functions, file, m.text) for m in mutants_of(file, tmp_path)}
    assert [after for after, pairs in by_line.items() if not pairs] == [
        "LIMIT = 3",
        "def above(x, low=2):",
    ]
    ((function, code),) = by_line["return max(x + low, LIMIT)"]
    function.__code__ = code
    assert above(5) == 6
    monkeypatch.delitem(sys.modules, "altered_room")
    import_altered("altered_room", file, whole.replace("= 2", "= 9"))
    assert import_module("altered_room").above(5) == 9
    monkeypatch.delitem(sys.modules, "altered_room")


def test_tests_of_a_line_come_first_and_fastest_first(tmp_path: Path) -> None:
    """Oracle: a map by hand, and a source in which lines were inserted since.

    A constant has the tests of the lines that mention it; a later line of a statement has those of
    its first line.
    """
    old = "LIMIT = 2\n\ndef above(x):\n    y = (\n        x - 1)\n    return y > LIMIT\n"
    new = old.replace("def", "# a comment\n# of two lines\ndef")
    root, folder = tmp_path / "root", tmp_path / "map"
    for place in (root / "runtime", root / "tests" / "room", folder):
        place.mkdir(parents=True)
    (root / "runtime" / "room.py").write_text(new, encoding="utf-8")
    for name in ("near", "far"):
        (root / "tests" / "room" / f"test_{name}.py").write_text("", encoding="utf-8")
    (folder / "sources.json").write_text(json.dumps({"runtime/room.py": old}), encoding="utf-8")
    names = [f"tests/room/test_far.py::{c}" for c in "abcd"]
    rows = [json.dumps(row) for row in zip(names, [0.2, 0.01, 9.0, 0.02], strict=True)]
    (folder / "times.main.jsonl").write_text("\n".join(rows), encoding="utf-8")
    data = CoverageData(str(folder / "lines.main"))
    for name, lines in zip(names, [(4, 6), (4,), (6,), ()], strict=True):
        data.set_context(name)
        data.add_lines({"/elsewhere/runtime/room.py": lines})
    data.write()

    mutants = {m.after: m for m in mutants_of(root / "runtime" / "room.py", root)}
    planner = Planner(root, LineMap(root, folder), names, budget_s=60.0)

    def order(after: str, room: tuple[str, ...] = ()) -> str:
        return "".join(name[-1] for name in planner.tests(mutants[after], room))

    assert order("x + 1)") == "ba"
    assert order("LIMIT = 3") == "ac"
    assert order("return y <= LIMIT", ("tests/room",)) == "acbd"
    planner.noticed(mutants["LIMIT = 3"], names[2])
    planner.broken.add(names[1])
    assert order("return y <= LIMIT", ("tests/room",)) == "cad"
    planner.budget_s = 1.0
    assert order("return y <= LIMIT") == "ca"


def test_a_failure_and_a_crash_are_noticed() -> None:
    """Property: a child that returns 1, raises or is killed is a mutant noticed; 0 is not."""

    def work(job: str, journal: Path) -> int:
        journal.write_text("first\nsecond\n", encoding="utf-8")
        if job == "raises":
            raise ValueError
        if job == "killed":
            os.kill(os.getpid(), 9)
        return int(job == "fails")

    outcomes = dict(ended(["passes", "fails", "raises", "killed"], work, 2))
    assert {job for job, outcome in outcomes.items() if outcome.noticed} == {
        *("fails", "raises", "killed")
    }
    assert (outcomes["passes"].by, outcomes["fails"].by) == ("", "second")
    assert outcomes["passes"].n_tests == 2


def test_the_table_leaves_equivalent_mutants_out_of_the_share() -> None:
    """Oracle: the row by hand."""
    outcomes = [
        Outcome("convex", "a.py", k, "x", "y", verdict)
        for k, verdict in enumerate([NOTICED] * 3 + [SURVIVED, EQUIVALENT])
    ]
    assert markdown(outcomes).splitlines()[2] == "| convex | 5 | 3 | 1 | 1 | 75 % |"


def test_every_equivalent_mutant_is_of_a_line_that_exists() -> None:
    """Property: an entry names one file, a line of it, another line and a reason."""
    for entry in equivalents():
        assert set(entry) == {"path", "before", "after", "reason"}
        text = (ROOT / entry["path"]).read_text(encoding="utf-8")
        assert entry["before"] in {line.strip() for line in text.splitlines()}, entry
        assert entry["after"] != entry["before"]


def test_tests_of_a_template_build_a_small_robot_once(tmp_path: Path) -> None:
    """Oracle: by hand; builds of 4 s each do not count against a budget of 0.4 s of tests."""
    names = [f"tests/a.py::t{k}[{robot}]" for k in range(3) for robot in ("fr3", "small")]
    planner = Planner(tmp_path, SimpleNamespace(seconds={}), names, 0.4)
    planner.extra = dict.fromkeys(names, 4.0)
    small = [name for name in names if "small" in name]
    assert planner.of_room(["tests/a.py"], ("small",)) == small
    assert sorted(planner.of_room(["tests/a.py"])) == sorted(names)
