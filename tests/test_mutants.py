"""Mutants of `scripts/mutate`: what is altered, what stays, and that all of them still parse."""

import ast
from pathlib import Path

from scripts.mutation.mutants import mutants_of
from scripts.mutation.rooms import ROOMS
from scripts.mutation.run import EQUIVALENTS, ROOT

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
        (4, 'def clipped(x: "int < 3", low: float = 1.0) -> float:'),
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
        "x = fmin(a, b) + (2.5 * 2) * c[i]",
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
