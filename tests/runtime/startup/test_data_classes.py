"""Data classes with shared methods: the standard library's are the oracle."""

import copy
import dataclasses
import inspect
import pickle
import re
from dataclasses import field
from typing import Any

import pytest

from runtime.startup.data_classes import dataclass
from tests.conftest import REPOSITORY


def example(decorator: Any, **options: bool) -> Any:
    """A class with every kind of field under one of the two decorators."""

    @decorator(**options)
    class Example:
        """Fields by place and by name, with a default, a factory and one that is not compared."""

        rows: int
        name: str = "q"
        cells: list[int] = field(default_factory=list)
        hidden: float = field(default=0.5, repr=False, compare=False)
        width: int = field(default=2, kw_only=True)

        def __post_init__(self) -> None:
            if self.rows < 0:
                raise ValueError("expected rows ≥ 0")

    return Example


OPTIONS = (
    {},
    {"slots": True},
    {"frozen": True},
    {"frozen": True, "slots": True},
    {"frozen": True, "slots": True, "eq": False},
)


def outcome(function: Any, *values: Any) -> Any:
    """What a function returns, or the class of its error."""
    try:
        return function(*values)
    except (TypeError, AttributeError, ValueError) as error:
        return type(error)


def plain(value: Any) -> Any:
    """A value for a comparison between both classes: an instance by what it shows and holds."""
    if dataclasses.is_dataclass(value):
        return repr(value), dataclasses.asdict(value)  # type: ignore[arg-type]
    return value


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_behaves_as_the_standard_library(options: dict[str, bool]) -> None:
    """Oracle: dataclasses.dataclass with the same options; values, errors and refusals agree."""
    ours, theirs = example(dataclass, **options), example(dataclasses.dataclass, **options)
    calls = (
        lambda made: made(3),
        lambda made: made(3, "dq", [1], 0.1, width=4),
        lambda made: made(rows=3, cells=[2]),
        lambda made: made(),
        lambda made: made(1, rows=1),
        lambda made: made(1, depth=2),
        lambda made: made(1, "q", [], 0.5, 2),
        lambda made: made(-1),
        lambda made: made(3) == made(3, hidden=0.7),
        lambda made: made(3) == made(4),
        lambda made: made(3) == 3,
        lambda made: made(3, cells=()).__hash__ is None,
        lambda made: hash(made(3, cells=())) == hash(made(3, cells=(), hidden=9.0)),
        lambda made: hash(made(3, cells=[])),
        lambda made: setattr(made(3), "rows", 4),
        lambda made: delattr(made(3), "rows"),
        lambda made: dataclasses.replace(made(3), name="tau"),
        lambda made: copy.copy(made(3, cells=[1])),
        lambda made: copy.deepcopy(made(3, cells=[1])),
        lambda made: [one.name for one in dataclasses.fields(made)],
        lambda made: made.__match_args__,
        lambda made: str(inspect.signature(made)).replace("<factory>", "<class 'list'>"),
        lambda made: made(3).cells is made(3).cells,
    )
    for number, call in enumerate(calls):
        assert plain(outcome(call, ours)) == plain(outcome(call, theirs)), number


@dataclass(frozen=True, slots=True)
class Pair:
    """At the top of a module, where pickle finds it."""

    first: int
    second: int


@dataclass(frozen=True, slots=True)
class Triple(Pair):
    """A field more."""

    third: int


def test_inherits_and_pickles() -> None:
    """Property: fields of the base come first; a copy by pickle is equal and still frozen."""
    triple = Triple(1, 2, third=3)
    again = pickle.loads(pickle.dumps(triple))  # noqa: S301
    assert (again, repr(again)) == (triple, "Triple(first=1, second=2, third=3)")
    assert triple != Pair(1, 2)
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field 'second'"):
        again.second = 4


def test_an_unknown_attribute_of_a_frozen_class_is_refused() -> None:
    """Property: with slots, too, where the standard library raises a TypeError about super()."""
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field 'fourth'"):
        Pair(1, 2).fourth = 4  # type: ignore[attr-defined]


def test_defined_methods_stay() -> None:
    """Property: what a class writes itself is kept, as in the standard library."""

    @dataclass(frozen=True)
    class Named:
        """A class with its comparison and its text."""

        name: str

        def __eq__(self, other: object) -> bool:
            return isinstance(other, Named)

        def __hash__(self) -> int:
            return 7

        def __repr__(self) -> str:
            return "named"

    assert Named("a") == Named("b")
    assert (repr(Named("a")), hash(Named("a"))) == ("named", 7)


def test_no_class_is_compiled() -> None:
    """Property: every module of runtime takes these; six compilations for each took 60 ms."""
    compiled = re.compile(r"^\s*from dataclasses import .*\bdataclass\b|@dataclasses\.", re.M)
    modules = (REPOSITORY / "runtime").rglob("*.py")
    places = [path for path in modules if compiled.search(path.read_text(encoding="utf-8"))]
    assert places == [REPOSITORY / "runtime/startup/data_classes.py"]
