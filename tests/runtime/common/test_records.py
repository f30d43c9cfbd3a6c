"""Records of documents: property: what a table lacks or has too much is one sentence."""

import importlib
from collections.abc import Iterator
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import pytest
from msgspec import Meta, field
from msgspec.structs import fields

from runtime.common.records import Factors, Name, Record, Vector3, record_from_table
from tests.conftest import REPOSITORY

BOUNDS = ("gt", "ge", "lt", "le", "multiple_of", "min_length", "max_length", "pattern")
FOREIGN = {"__main__", "ros2", "libfranka", "ur", "torch_functions", "jax_functions"}
"""Modules that start something, or need the software of a robot or of learning."""


class Spring(Record, frozen=True):
    """A toy with every kind of field."""

    name: str
    of: dict[str, float] = field(default_factory=dict)
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stiffness: Annotated[float, Meta(ge=0)] | None = None


class Mechanism(Record, frozen=True):
    """A toy with a list of tables."""

    spring: tuple[Spring, ...] = ()


def read(table: object) -> Mechanism:
    """The toy of a table."""
    return record_from_table(Mechanism, table, "'m.toml'", ValueError)


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"sprig": []}, "'m.toml' has the unknown key 'sprig'; did you mean 'spring'?"),
        ({"zzz": []}, "'m.toml' has the unknown key 'zzz'; known are spring"),
        ({"spring": [{"of": {}}]}, "'m.toml' expects the key name in spring[0], got none; add it"),
        (
            {"spring": [{"name": "a", "stifness": 1}]},
            "'m.toml' has the unknown key 'stifness' in spring[0]; did you mean 'stiffness'?",
        ),
        (
            {"spring": [{"name": "a"}, {"name": "b", "stiffness": -1}]},
            "'m.toml': spring[1].stiffness expects a number of at least 0, got -1; correct it",
        ),
        (
            {"spring": [{"name": "a", "xyz": [1, 2]}]},
            "'m.toml': spring[0].xyz expects a list of length 3, got [1, 2]; correct it",
        ),
        (
            {"spring": [{"name": "a", "stiffness": True}]},
            "'m.toml': spring[0].stiffness expects a number or nothing, got True; correct it",
        ),
        (
            {"spring": [{"name": "a", "xyz": [1, 2, float("nan")]}]},
            "'m.toml': spring[0].xyz[2] expects a finite number, got inf or nan; correct it",
        ),
        (
            {"spring": [{"name": "a", "of": {"x": 1.0, "y": "z"}}]},
            "'m.toml': spring[0].of.y expects a number, got 'z'; correct it",
        ),
        ({"spring": {"a": "b" * 90}}, "'m.toml': spring expects a list, got {'a': 'bbb"),
        (
            {"spring": [{"name": "a", "xyz": [1, -(10**400), 2]}]},
            "'m.toml': spring[0].xyz[1] expects a number of at most 1.8e+308 in size, got -1000",
        ),
        (3, "'m.toml': it expects a table, got 3; correct it"),
    ],
)
def test_a_fault_is_one_sentence(table: object, sentence: str) -> None:
    """Property: place, what was expected, what came, what to do; long values are cut."""
    with pytest.raises(ValueError, match=r"^'m.toml'") as caught:
        read(table)
    assert str(caught.value).startswith(sentence)
    assert len(str(caught.value)) < 200


def test_a_key_of_another_form_is_refused() -> None:
    """Property: the sentence names the table."""
    kind = dict[Annotated[str, Meta(min_length=2)], float]
    with pytest.raises(
        ValueError, match=r"^m: springs expects a text of length of at least 2, got"
    ):
        record_from_table(dict[str, kind], {"springs": {"a": 1}}, "m", ValueError)


def test_tables_are_read() -> None:
    """Property: lists become tuples, whole numbers become floats."""
    record = read({"spring": [{"name": "a", "xyz": [1, 2, 3], "of": {"j": 2}}]})
    assert record.spring[0].xyz == (1.0, 2.0, 3.0)
    assert record.spring[0].of == {"j": 2.0}


def members(kind: Any, bounded: bool = False) -> Iterator[tuple[Any, bool]]:
    """Types of a union, and whether bounds belong to them."""
    if get_origin(kind) is Annotated:
        inner, *notes = get_args(kind)
        stated = {key for note in notes for key in BOUNDS if getattr(note, key, None) is not None}
        yield from members(inner, bounded or bool(stated))
    elif get_origin(kind) in {Union, UnionType}:
        for each in get_args(kind):
            yield from members(each, bounded)
    else:
        yield kind, bounded


def reads_foreign_memory(kind: Any) -> bool:
    """Whether bounds and a tuple of fixed length stand in one union, here or further inside."""
    here = list(members(kind))
    fixed = any(get_origin(each) is tuple and ... not in get_args(each) for each, _ in here)
    bounded = any(is_bounded for _, is_bounded in here)
    inner = (arg for each, _ in here for arg in get_args(each))
    return (len(here) > 1 and fixed and bounded) or any(map(reads_foreign_memory, inner))


def subclasses(kind: type[Record]) -> Iterator[type[Record]]:
    """All records below one."""
    for each in kind.__subclasses__():
        yield each
        yield from subclasses(each)


@pytest.mark.parametrize(
    ("kind", "is_bad"),
    [
        (Annotated[float, Meta(ge=0)] | Vector3, True),
        (dict[str, Annotated[Name | tuple[float, float], Meta(description="x")] | None], True),
        (tuple[Vector3 | Factors, ...], True),
        (Annotated[float, Meta(ge=0)] | tuple[float, ...] | None, False),
        (Annotated[float, Meta(description="x")] | Vector3, False),
        (tuple[Annotated[float, Meta(ge=0)], float] | None, False),
    ],
)
def test_unions_that_crash_msgspec_are_recognised(kind: Any, is_bad: bool) -> None:
    """Property: bounds beside a tuple of fixed length; inside the tuple they do no harm."""
    assert reads_foreign_memory(kind) == is_bad


def test_no_record_has_a_union_that_crashes_msgspec() -> None:
    """Property: msgspec 0.22 reads foreign memory where such a field is decoded or deleted."""
    for package in ("runtime", "symgen"):
        for path in sorted((REPOSITORY / package).rglob("*.py")):
            if path.stem not in FOREIGN and not path.stem.endswith("_child"):
                name = ".".join(path.relative_to(REPOSITORY).with_suffix("").parts)
                importlib.import_module(name.removesuffix(".__init__"))
    kinds = set(subclasses(Record))
    assert len(kinds) > 30
    bad = [f"{k.__module__}.{k.__name__}.{f.name}" for k in kinds for f in fields(k)
           if reads_foreign_memory(f.type)]  # fmt: skip
    assert not bad
