"""Records of documents: a frozen class is type, schema and reader of a table of TOML or JSON.

    class Spring(Record, frozen=True):
        name: str
        stiffness: Annotated[float, Meta(ge=0, description="N·m/rad, at least 0")] | None = None

    spring = record_from_table(Spring, table, "[[spring]]", UrdfError)

msgspec converts lists to tuples and whole numbers to floats and guesses nothing else. Its first
fault becomes one sentence: the place, what was expected, what came, and what to do. A description
of a type, `Meta(description="[lowest, highest] in kg")`, is what was expected.

Trap: msgspec 0.22 reads foreign memory where a type with bounds, a text too, stands in one union
with a tuple of fixed length; write `float | tuple[float, float]` and check the bounds after.
"""

import difflib
import math
import re
import sys
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Self, TypeVar, Union, get_args, get_origin

import msgspec
from msgspec import Meta

from runtime.common.files import toml_of

T = TypeVar("T")
Name = Annotated[str, Meta(min_length=1)]
Factors = Annotated[dict[str, float], Meta(min_length=1)]
Vector3 = tuple[float, float, float]
NotNegative = Annotated[float, Meta(ge=0)]
Positive = Annotated[float, Meta(gt=0)]  # types of fields that stand in several records
_PER_JOINT = Meta(description="one number from 0 up, or one per joint")
PerJoint = Annotated[NotNegative | tuple[NotNegative, ...], _PER_JOINT]

_FAULT = re.compile(r"(?P<text>.*?)(?: - at (?:`key` in )?`(?P<path>[^`]*)`)?", re.DOTALL)
_EXPECTED = re.compile(r"Expected (?P<kind>.+?)(?:, got .*)?", re.DOTALL)
_FIELD = re.compile(r"Object (?:contains unknown|missing required) field `(?P<name>.*)`", re.DOTALL)
_STEP = re.compile(r"\.(?P<key>[^.\[]+)|\[(?P<index>\d+|\.\.\.)\]")
_NAMES = {
    "str": "a text",
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
    "null": "nothing",
}
_SHOWN = 60  # characters of a value that a sentence shows


class Record(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of a document: its fields are the keys, each with type, bounds and default."""

    def replace(self, **changes: Any) -> Self:
        """Return a record with other values of some fields."""
        return msgspec.structs.replace(self, **changes)


def record_from_table(
    kind: type[T], table: Any, where: str, error: type[Exception], allows_infinite: bool = False
) -> T:
    """Record of a table, or one sentence on the first fault of the document `where`."""
    try:
        record = msgspec.convert(table, kind)
    except msgspec.ValidationError as fault:
        raise error(f"{where}{_sentence(kind, table, str(fault))}") from None
    except RecursionError:
        raise error(f"{where} is nested too deeply; write it flat") from None
    except UnicodeEncodeError:
        raise error(
            f"{where} expects Unicode text, got bytes of another code; correct it"
        ) from None
    if not allows_infinite and (place := _infinite(table)) is not None:
        raise error(
            f"{where}: {place.lstrip('.')} expects a finite number, got inf or nan; correct it"
        )
    return record


def record_from_toml(kind: type[T], path: Path, where: str, error: type[Exception]) -> T:
    """Record of a TOML file of finite numbers, or one sentence on the first fault in `where`."""
    try:
        table = toml_of(path)
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or fault
        raise error(
            f"{where} cannot be read as TOML ({reason}); correct the file or its path"
        ) from None
    return record_from_table(kind, table, where, error)


def _sentence(kind: Any, table: Any, fault: str) -> str:
    match = _FAULT.fullmatch(fault)
    text, path = (match["text"], match["path"] or "$") if match else (fault, "$")
    steps: list[Any] = []
    for step in _STEP.finditer(path):
        if step["index"] == "...":  # a value of a table with free keys
            steps.append(_wrong_key(_kind_at(kind, [*steps, "..."]), _value_at(table, steps)))
        else:
            steps.append(int(step["index"]) if step["index"] else step["key"])
    place = _place(steps)
    if field := _FIELD.fullmatch(text):
        keys = list(_fields(_kind_at(kind, steps)))
        inside = f" in {place}" if place else ""
        if "missing" in text:
            return f" expects the key {field['name']}{inside}, got none; add it"
        near = difflib.get_close_matches(field["name"], keys, n=1, cutoff=0.5)
        hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(keys)}"
        return f" has the unknown key '{field['name']}'{inside}; {hint}"
    expected = _EXPECTED.fullmatch(text)
    wanted = _words(expected["kind"]) if expected else text
    if text.endswith("out of range"):
        wanted = f"a number of at most {sys.float_info.max:.2g} in size"
    elif text.startswith("Invalid enum value"):
        wanted = f"one of {', '.join(filter(None, _choices(_kind_at(kind, steps))))}"
    for depth in range(len(steps), 0, -1):
        if described := _description(_kind_at(kind, steps[:depth])):
            wanted, steps = described, steps[:depth]
            place = _place(steps)
            break
    value = f"{_value_at(table, steps)!r}"
    shown = value if len(value) <= _SHOWN else f"{value[:_SHOWN]} …"
    return f": {place or 'it'} expects {wanted}, got {shown}; correct it"


def _place(steps: list[Any]) -> str:
    words = (f"[{each}]" if isinstance(each, int) else f".{each}" for each in steps)
    return "".join(words).removeprefix(".")


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


def members_of(kind: Any) -> list[Any]:
    """Types of a union, without bounds."""
    if get_origin(kind) is Annotated:
        return members_of(get_args(kind)[0])
    if get_origin(kind) in {Union, UnionType}:
        return [member for each in get_args(kind) for member in members_of(each)]
    return [kind]


def _description(kind: Any) -> str:
    if get_origin(kind) is Annotated:
        texts = [each.description for each in kind.__metadata__ if isinstance(each, Meta)]
        return next(filter(None, texts), "")
    inner = get_args(kind) if get_origin(kind) in {Union, UnionType} else ()
    return next(filter(None, map(_description, inner)), "")


def _fields(kind: Any) -> dict[str, Any]:
    """Keys and types of the records of a union."""
    structs = [each for each in members_of(kind) if isinstance(each, type)]
    structs = [each for each in structs if issubclass(each, msgspec.Struct)]
    return {f.encode_name: f.type for each in structs for f in msgspec.structs.fields(each)}


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
        fields = _fields(kind)
        if step in fields:
            kind = fields[step]
            continue
        is_key = isinstance(step, str)
        members = [each for each in members_of(kind) if (get_origin(each) is dict) == is_key]
        inner = [arg for each in members for arg in get_args(each) if arg is not Ellipsis]
        kind = inner[-1] if inner else kind
    return kind


def _value_at(table: Any, steps: list[Any]) -> Any:
    for step in steps:
        try:
            table = table[step]
        except (KeyError, IndexError, TypeError):
            return table
    return table


def _infinite(value: Any) -> str | None:
    """Place of the first number that is not finite, seen from `value`."""
    if isinstance(value, float):
        return None if math.isfinite(value) else ""
    is_table = isinstance(value, dict)
    if not is_table and not isinstance(value, list | tuple):
        return None
    for key, item in value.items() if is_table else enumerate(value):
        if (place := _infinite(item)) is not None:
            return (f".{key}" if is_table else f"[{key}]") + place
    return None
