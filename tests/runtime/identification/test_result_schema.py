"""result_record: one record for the writer and the readers, and files of other formats."""

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from runtime import Identification
from runtime.errors import RecordingError
from runtime.identification.result_file import write_result
from runtime.identification.result_record import FORMAT, RENAMED, ResultRecord
from runtime.identification.saved_result import migrated, read_record, read_result
from runtime.outputs.report.report import read_result as read_report
from scripts.site import result_keys
from tests.runtime.pages import predictions

OLD = Path(__file__).parents[2] / "data" / "result_format_1.json"


def conforms(value: Any, schema: dict[str, Any], defs: dict[str, Any]) -> bool:
    """Whether a value is of a JSON Schema, as far as msgspec writes one."""
    if "$ref" in schema:
        schema = defs[schema["$ref"].rpartition("/")[2]]
    if "anyOf" in schema:
        return any(conforms(value, each, defs) for each in schema["anyOf"])
    kinds = {"null": type(None), "string": str, "boolean": bool, "integer": int, "array": list}
    kind = kinds.get(schema.get("type"), object)
    if schema.get("type") == "number":
        return isinstance(value, int | float)
    if schema.get("type") != "object":
        items = schema.get("items", {})
        inner = value if kind is list and isinstance(value, list) and items else ()
        return isinstance(value, kind) and all(conforms(each, items, defs) for each in inner)
    known = schema.get("properties", {})
    return (
        isinstance(value, dict)
        and set(schema.get("required", ())) <= set(value)
        and (not known or set(value) <= set(known))
        and all(conforms(value[key], known[key], defs) for key in value if key in known)
    )


def test_what_is_written_is_what_the_schema_names(
    panda_adam: Identification, tmp_path: Path
) -> None:
    """Property: the file conforms to the JSON Schema, and is read as what was written."""
    record = write_result(panda_adam, tmp_path, "a test")
    facts = json.loads((tmp_path / "result.json").read_text())
    assert facts["format"] == FORMAT == 3
    schema = json.loads(result_keys.json_schema())
    assert conforms(facts, schema, schema["$defs"])
    assert not conforms(facts | {"joints": 3}, schema, schema["$defs"])
    assert msgspec.to_builtins(read_record(tmp_path / "result.json")) == msgspec.to_builtins(record)
    missing = {key: value for key, value in facts.items() if key != "status"}
    (tmp_path / "result.json").write_text(json.dumps(missing))
    with pytest.raises(RecordingError, match="expects the key status, got none"):
        read_record(tmp_path / "result.json")


def test_a_file_of_format_1_is_read_as_before(tmp_path: Path) -> None:
    """Property: both readers take an old file, with and without its number."""
    facts = json.loads(OLD.read_text())
    np.savez(tmp_path / "predictions.npz", **predictions())
    for number in ({"format": 1}, {}):
        old = {key: value for key, value in facts.items() if key != "format"} | number
        (tmp_path / "result.json").write_text(json.dumps(old))
        saved, (record, _) = read_result(tmp_path), read_report(tmp_path)
        assert saved.record.model is None
        assert saved.phi.tolist() == facts["friction"]["values"]
        assert saved.record.recording.history == tuple(facts["recording"]["history"])
        assert record.warnings == ("rail is hardly excited",)
        assert record.uncertainty is None


def test_migration_adds_what_format_3_has() -> None:
    """Property: nothing that was there changes, and the result is whole."""
    facts = json.loads(OLD.read_text())
    before = json.dumps(facts)
    now = migrated(facts)
    assert json.dumps(facts) == before
    msgspec.convert(now, ResultRecord)
    assert now["format"] == FORMAT
    assert {k: v for k, v in now.items() if k in facts and k not in {"format", "recording"}} == {
        k: v for k, v in facts.items() if k not in {"format", "recording"}
    }
    assert now["recording"] == facts["recording"] | {"preparation": {}}
    assert migrated(now) is now


def test_old_names_are_read(panda_adam: Identification, tmp_path: Path) -> None:
    """Property: a file with the names of format 2 is the record of format 3."""
    write_result(panda_adam, tmp_path, "a test")
    text = (tmp_path / "result.json").read_text()
    for old, name in RENAMED.items():
        text = text.replace(f'"{name}":', f'"{old}":')
    assert '"white":' in text
    older = tmp_path / "older.json"
    older.write_text(text.replace('"format": 3', '"format": 2').replace(' "base": "fixed",\n', ""))
    assert msgspec.to_builtins(read_record(older)) == msgspec.to_builtins(
        read_record(tmp_path / "result.json")
    )


def test_a_later_format_is_refused(tmp_path: Path) -> None:
    """Property: one sentence with the number, the version that wrote it, and what to do."""
    facts = json.loads(OLD.read_text()) | {"format": FORMAT + 1}
    facts["provenance"]["versions"] = {"symgen": "9.1.0"}
    (tmp_path / "result.json").write_text(json.dumps(facts))
    match = r"has the format 4 \(written by symgen 9.1.0\), expected 3 or less; update symgen"
    for reader in (read_result, read_report):
        with pytest.raises(RecordingError, match=match):
            reader(tmp_path)


@pytest.mark.parametrize("number", [0, -1, True, "2", None, 1.5])
def test_a_format_that_is_no_number_is_damage(tmp_path: Path, number: object) -> None:
    facts = json.loads(OLD.read_text()) | {"format": number}
    (tmp_path / "result.json").write_text(json.dumps(facts))
    with pytest.raises(RecordingError, match=r"no valid result\.json"):
        read_result(tmp_path)


def test_the_table_for_the_documentation_is_whole() -> None:
    """Property: one line per key, none twice, each with a meaning."""
    rows = list(result_keys.keys(ResultRecord))
    assert len(rows) == len({key for key, _, _ in rows}) > 100
    assert all(kind and meaning for _, kind, meaning in rows)
    lines = result_keys.markdown().splitlines()
    assert all(line.count("|") in {0, 3, 4} for line in lines)
    assert {key.rpartition(".")[2] for key, _, _ in rows} >= set(RENAMED.values())
