"""Keys of result.json for the documentation, from the record: table, old names, JSON Schema."""

import json
from collections.abc import Iterator
from typing import Any, get_args, get_origin, get_type_hints

import msgspec

from runtime.identification.result_record import RENAMED, Part, ResultRecord

WORDS = {"str": "text", "float": "number", "int": "integer", "bool": "true or false",
         "tuple": "list", "dict": "table", "NoneType": "null", "Any": "any"}  # fmt: skip


def markdown() -> str:
    """Table of all keys, then that of the keys that had another name in formats 1 and 2."""
    rows = [*keys(ResultRecord)]
    lines = ["| key | type | meaning, shape, unit |", "|---|---|---|"]
    lines += [f"| `{key}` | {kind} | {meaning} |" for key, kind, meaning in rows]
    lines += ["", "Files of formats 1 and 2 are read. These keys had other names in them:", ""]
    lines += ["| format 1 and 2 | format 3 |", "|---|---|"]
    older = {name: old for old, name in RENAMED.items()}
    for table, _, name in (key.rpartition(".") for key, _, _ in rows):
        if name in older:
            lines.append(f"| `{table}.{older[name]}` | `{table}.{name}` |")
    return "\n".join(lines) + "\n"


def json_schema() -> str:
    """JSON Schema of result.json, each key with its description."""
    schema = msgspec.json.schema(ResultRecord)
    for kind in (ResultRecord, *parts(ResultRecord)):
        table = schema["$defs"][kind.__name__]
        for name, (meaning, *_) in kind.keys().items():
            table["properties"][name]["description"] = meaning
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def keys(kind: type[Part], path: str = "") -> Iterator[tuple[str, str, str]]:
    """Key, type and meaning of every field, those of inner tables after their own."""
    hints, notes = get_type_hints(kind), kind.keys()
    for field in msgspec.structs.fields(kind):
        name, of = f"{path}{field.name}", hints[field.name]
        is_optional = field.default is not msgspec.NODEFAULT
        words = dict.fromkeys(word(each) for each in members(of))
        meaning, _, inner = notes[field.name]
        yield name, " or ".join(words) + (", optional" if is_optional else ""), meaning
        if inner is not None:
            yield from keys(inner, f"{name}{'' if inner in members(of) else '[]'}.")


def parts(kind: type[Part]) -> Iterator[type[Part]]:
    """Tables inside a table."""
    for *_, inner in kind.keys().values():
        if inner is not None:
            yield inner
            yield from parts(inner)


def members(hint: Any) -> tuple[Any, ...]:
    """Types of a union, or the type."""
    return (hint,) if get_origin(hint) in (tuple, dict, None) else get_args(hint)


def word(kind: Any) -> str:
    """Word for a type of JSON."""
    name = getattr(get_origin(kind) or kind, "__name__", "any")
    return WORDS.get(name, "table")
