"""Records of documents: a frozen class is type, schema and reader of a table of TOML or JSON.

    class Spring(Record, frozen=True):
        name: str
        stiffness: Annotated[float, Meta(ge=0, description="N·m/rad")] | None = None

    spring = record_from_table(Spring, table, "[[spring]]", UrdfError)

msgspec converts lists to tuples and whole numbers to floats and guesses nothing else. Its first
fault becomes one sentence: the place, what was expected, what came, and what to do.
"""

import difflib
import math
import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self, TypeVar, get_args, get_origin

import msgspec
from msgspec import Meta

T = TypeVar("T")
Name = Annotated[str, Meta(min_length=1)]
Factors = Annotated[dict[str, float], Meta(min_length=1)]
Vector3 = tuple[float, float, float]
"""Types of fields that stand in several records."""

_FAULT = re.compile(r"(?P<text>.*?)(?: - at `(?P<path>[^`]*)`)?", re.DOTALL)
_EXPECTED = re.compile(r"Expected (?P<kind>.+?)(?:, got .*)?", re.DOTALL)
_FIELD = re.compile(r"Object (?:contains unknown|missing required) field `(?P<name>.*)`", re.DOTALL)
_STEP = re.compile(r"\.(?P<key>[^.\[]+)|\[(?P<index>\d+|\.\.\.)\]")
_NAMES = {"str": "a text", "float": "a number", "int": "a whole number", "bool": "true or false",
          "array": "a list", "object": "a table", "null": "nothing"}  # fmt: skip
_SHOWN = 60
"""Characters of a value that a sentence shows."""


class Record(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of a document: its fields are the keys, each with type, bounds and default."""

    def replace(self, **changes: Any) -> Self:
        """Return a record with other values of some fields."""
        return msgspec.structs.replace(self, **changes)


def record_from_table(kind: type[T], table: Any, where: str, error: type[Exception]) -> T:
    """Record of a table, or one sentence on the first fault.

    Args:
        kind: a `Record`, or another type that msgspec converts.
        table: parsed TOML or JSON.
        where: the document, as the sentence names it.
        error: what is raised.

    Returns:
        The record; numbers in it are finite.
    """
    try:
        record = msgspec.convert(table, kind)
    except msgspec.ValidationError as fault:
        raise error(f"{where}{_sentence(kind, table, str(fault))}") from None
    except RecursionError:
        raise error(f"{where} is nested too deeply; write it flat") from None
    if place := _infinite(table, ""):
        raise error(f"{where}: {place} expects a finite number, got inf or nan; correct it")
    return record


def table_from_record(record: Record) -> dict[str, Any]:
    """Table that `record_from_table` reads as this record, without what has its default value."""
    table: dict[str, Any] = msgspec.to_builtins(record)
    return _without_defaults(record, table)


def _without_defaults(record: Any, table: Any) -> Any:
    if isinstance(record, tuple | list):
        return [_without_defaults(*pair) for pair in zip(record, table, strict=True)]
    if not isinstance(record, msgspec.Struct):
        return table
    kept = {}
    for field in msgspec.structs.fields(record):
        value, factory = getattr(record, field.name), field.default_factory
        default = field.default if factory is msgspec.NODEFAULT else factory()
        if value != default:
            kept[field.encode_name] = _without_defaults(value, table[field.encode_name])
    return kept


def _sentence(kind: Any, table: Any, fault: str) -> str:
    match = _FAULT.fullmatch(fault)
    text, path = (match["text"], match["path"] or "$") if match else (fault, "$")
    steps: list[Any] = []
    for step in _STEP.finditer(path):
        if step["index"] == "...":  # a value of a table with free keys
            steps.append(_wrong_key(_kind_at(kind, [*steps, "..."]), _value_at(table, steps)))
        else:
            steps.append(int(step["index"]) if step["index"] else step["key"])
    place = "".join(f"[{each}]" if isinstance(each, int) else f".{each}" for each in steps)
    place = place.removeprefix(".")
    if field := _FIELD.fullmatch(text):
        keys = _keys(_kind_at(kind, steps))
        inside = f" in {place}" if place else ""
        if "missing" in text:
            return f" expects the key {field['name']}{inside}, got none; add it"
        near = difflib.get_close_matches(field["name"], keys, n=1, cutoff=0.5)
        hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(keys)}"
        return f" has the unknown key '{field['name']}'{inside}; {hint}"
    expected = _EXPECTED.fullmatch(text)
    wanted = _words(expected["kind"]) if expected else text
    if text.startswith("Invalid enum value"):
        wanted = f"one of {', '.join(filter(None, _choices(_kind_at(kind, steps))))}"
    value = f"{_value_at(table, steps)!r}"
    shown = value if len(value) <= _SHOWN else f"{value[:_SHOWN]} …"
    return f": {place or 'it'} expects {wanted}, got {shown}; correct it"


def _words(kind: str) -> str:
    """`float` >= 0.0 → a number of at least 0."""

    def named(match: re.Match[str]) -> str:
        return " or ".join(_NAMES.get(each.strip(), each) for each in match[1].split("|"))

    text = re.sub(r"`([^`]*)`", named, kind)
    text = re.sub(r" of length >= 1$", " that is not empty", text)
    text = re.sub(r" >= (\S+)", lambda m: f" of at least {float(m[1]):g}", text)
    text = re.sub(r" <= (\S+)", lambda m: f" of at most {float(m[1]):g}", text)
    text = re.sub(r" > (\S+)", lambda m: f" above {float(m[1]):g}", text)
    return re.sub(r" < (\S+)", lambda m: f" below {float(m[1]):g}", text)


def _choices(kind: Any) -> tuple[str, ...]:
    if get_origin(kind) is Literal:
        return get_args(kind)
    return tuple(name for each in get_args(kind) for name in _choices(each))


def _keys(kind: Any) -> list[str]:
    structs = [each for each in (kind, *get_args(kind)) if isinstance(each, type)]
    structs = [each for each in structs if issubclass(each, msgspec.Struct)]
    return [field.encode_name for each in structs for field in msgspec.structs.fields(each)]


def _wrong_key(kind: Any, table: Any) -> str:
    """First key of a table whose value is not of a type."""
    for key, value in dict(table).items():
        try:
            msgspec.convert(value, kind)
        except msgspec.ValidationError:
            return str(key)
    return "..."


def _kind_at(kind: Any, steps: list[Any]) -> Any:
    """Type at a place of a record, found by the names of its fields."""
    for step in steps:
        options = [kind, *get_args(kind)]
        if isinstance(step, str):
            fields = [
                field.type
                for each in options
                if isinstance(each, type) and issubclass(each, msgspec.Struct)
                for field in msgspec.structs.fields(each)
                if field.encode_name == step
            ]
            if fields:
                kind = fields[0]
                continue
        inner = [a for o in options for a in get_args(o) if a is not Ellipsis]
        kind = inner[-1] if inner else kind
    return kind


def _value_at(table: Any, steps: list[Any]) -> Any:
    for step in steps:
        try:
            table = table[step]
        except (KeyError, IndexError, TypeError):
            return table
    return table


def _infinite(value: Any, place: str) -> str:
    """Place of the first number that is not finite; "" without one."""
    if isinstance(value, float):
        return "" if math.isfinite(value) else place
    inner: Any = ()
    if isinstance(value, Mapping):
        inner = ((f"{place}.{key}".lstrip("."), item) for key, item in value.items())
    elif isinstance(value, list | tuple):
        inner = ((f"{place}[{k}]", item) for k, item in enumerate(value))
    return next((inner_place for name, item in inner if (inner_place := _infinite(item, name))), "")
