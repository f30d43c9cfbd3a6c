"""Mutants of Python by cosmic-ray and of templates of C by universalmutator, drawn by a seed.

Of cosmic-ray's operators those that leave Python that can run; messages of errors stay.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from io import StringIO
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator
from universalmutator.mutator import mutants_regexp

_PAIRS = {
    "Binary": "Add_Sub Sub_Add Mul_Div Div_Mul FloorDiv_Mul Pow_Mul",
    "Comparison": "Lt_GtE LtE_Lt Gt_LtE GtE_Gt Eq_NotEq NotEq_Eq Is_IsNot IsNot_Is",
}
OPERATORS = (
    *(f"Replace{kind}Operator_{pair}" for kind, pairs in _PAIRS.items() for pair in pairs.split()),
    *("ReplaceUnaryOperator_Delete_USub", "ReplaceUnaryOperator_Delete_Not", "NumberReplacer"),
    *("AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr"),
    *("ReplaceOrWithAnd", "ZeroIterationForLoop", "ReplaceBreakWithContinue"),
)
IDLE = ("raise_stmt", "fstring", "decorator", "import_name", "import_from")
"""Parts of the syntax of Python whose change alters no result."""
RULES = ("universal.rules", "c_like.rules")
IDLE_C = (r"^\s*#", r"\{%", r"//", r"\{#")
"""Lines of a template that stay: directives, statements of Jinja and comments."""
DISTORTING = re.compile(r"break;|continue;|\"\"|begin|end|else")
"""Rules of universalmutator that hardly ever leave C that compiles."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One altered file."""

    path: str  # from the root of the repository
    line: int  # from 1
    before: str  # the line without indentation
    change: str  # name of the change within the line
    make: Callable[[], str]  # the altered file

    @property
    def after(self) -> str:
        """The altered line without indentation."""
        return self.make().splitlines()[self.line - 1].strip()


def mutants_of(file: Path, root: Path) -> list[Mutant]:
    """Every mutant of a file of Python or a template of C."""
    text, name = file.read_text(encoding="utf-8"), file.relative_to(root).as_posix()
    lines = [line.strip() for line in text.splitlines()]
    made = _python(text) if file.suffix == ".py" else _template(text)
    return [Mutant(name, line, lines[line - 1], change, make) for line, change, make in made]


def sample(files: list[Path], root: Path, seed: int) -> Iterator[Mutant]:
    """Mutants in the order of a hash of seed and line: changes elsewhere do not redraw them."""
    every = {
        (m.path, m.before, m.change): m
        for f in reversed(files)
        for m in reversed(mutants_of(f, root))
    }
    for key in sorted(
        every, key=lambda key: sha256("\n".join([str(seed), *key]).encode()).digest()
    ):
        yield every[key]


Piece = tuple[int, str, Callable[[], str]]


def _python(text: str) -> Iterator[Piece]:
    nodes, lines = [*ast_nodes(get_ast(text))], text.splitlines()
    for name in OPERATORS:
        operator = get_operator(f"core/{name}")()
        places = [
            (node, *start) for node in nodes for start, _ in operator.mutation_positions(node)
        ]
        for k, (node, line, column) in enumerate(places):
            idle = node.search_ancestor(*IDLE) or "strict=" in lines[line - 1]
            if not idle:  # strict=, of zip: a check, no result
                indent = len(lines[line - 1]) - len(lines[line - 1].lstrip())
                twin = sum(place[1:] == (line, column) for place in places[:k])
                change = f"{name} {column - indent} {twin}"
                yield line, change, partial(mutate_code, text, operator, k)


def _template(text: str) -> Iterator[Piece]:
    lines = text.splitlines(keepends=True)

    def altered(line: int, new: str) -> str:
        return "".join([*lines[: line - 1], new, *lines[line:]])

    with redirect_stdout(StringIO()):  # the names of the rules
        found = mutants_regexp(lines, [*RULES], ignorePatterns=[*IDLE_C])
    for line, new, (rule, _), *_ in found:
        if not DISTORTING.search(rule.partition(" ==>")[2]) and new.count("\n") == 1:
            yield line, new.strip(), partial(altered, line, new)
