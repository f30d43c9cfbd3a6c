"""Records of documents: property: what a table lacks or has too much is one sentence."""

from typing import Annotated

import pytest
from msgspec import Meta, field

from runtime.common.records import Record, record_from_table, table_from_record


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
        (3, "'m.toml': it expects a table, got 3; correct it"),
    ],
)
def test_a_fault_is_one_sentence(table: object, sentence: str) -> None:
    """Property: place, what was expected, what came, what to do; long values are cut."""
    with pytest.raises(ValueError, match=r"^'m.toml'") as caught:
        read(table)
    assert str(caught.value).startswith(sentence)
    assert len(str(caught.value)) < 200


def test_tables_are_read_and_written() -> None:
    """Property: lists become tuples, whole numbers become floats, defaults are not written."""
    record = read({"spring": [{"name": "a", "xyz": [1, 2, 3], "of": {"j": 2}}]})
    assert record.spring[0].xyz == (1.0, 2.0, 3.0)
    table = table_from_record(record)
    assert table == {"spring": [{"name": "a", "xyz": [1.0, 2.0, 3.0], "of": {"j": 2.0}}]}
    assert read(table) == record
