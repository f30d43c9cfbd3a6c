"""result_schema: one schema for the writer and the readers, and files of other formats."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime import Identification
from runtime.errors import RecordingError
from runtime.identification.result_file import write_result
from runtime.identification.result_schema import (
    FORMAT,
    KEYS,
    markdown_table,
    migrated,
    read_facts,
    require_keys,
    require_kinds,
)
from runtime.identification.saved_result import read_result
from runtime.outputs.report.result import read_result as read_report
from tests.runtime.pages import predictions

OLD = Path(__file__).parents[2] / "data" / "result_format_1.json"


def paths_of(value: object, path: str = "") -> set[str]:
    """Dotted paths of all keys down to the depth of the schema."""
    parents = {key.path.rpartition(".")[0] for key in KEYS} - {""}
    identified: set[str] = set()
    for key, inner in value.items() if isinstance(value, dict) else ():
        full = f"{path}.{key}" if path else key
        identified.add(full)
        for each in inner if isinstance(inner, list) else [inner]:
            below = f"{full}[]" if isinstance(inner, list) else full
            if below in parents:
                identified |= paths_of(each, below)
    return identified


def test_what_is_written_is_what_the_schema_names(
    panda_adam: Identification, tmp_path: Path
) -> None:
    """Property: every key that is written stands in the schema, and the reverse."""
    write_result(panda_adam, tmp_path, "a test")
    facts = json.loads((tmp_path / "result.json").read_text())
    assert facts["format"] == FORMAT == 2
    optional = {key.path for key in KEYS if key.is_optional}
    lists = ("sessions.", "drive[].", "current_gains[].", "symmetric[].")
    several = {key.path for key in KEYS if key.path.startswith(lists)}
    written = paths_of(facts)
    assert written <= {key.path for key in KEYS}
    assert {key.path for key in KEYS} - optional - several <= written
    assert read_facts(tmp_path / "result.json") == facts


def test_a_file_of_format_1_is_read_as_before(tmp_path: Path) -> None:
    """Property: both readers take an old file, with and without its number."""
    facts = json.loads(OLD.read_text())
    np.savez(tmp_path / "predictions.npz", **predictions())
    for number in ({"format": 1}, {}):
        old = {key: value for key, value in facts.items() if key != "format"} | number
        (tmp_path / "result.json").write_text(json.dumps(old))
        saved, report = read_result(tmp_path), read_report(tmp_path)
        assert saved.model is None
        assert saved.phi.tolist() == facts["friction"]["values"]
        assert saved.history == tuple(facts["recording"]["history"])
        assert report.warnings == ("rail is hardly excited",)
        assert report.uncertainty is None


def test_migration_adds_what_format_2_has(tmp_path: Path) -> None:
    """Property: nothing that was there changes, and the result is whole."""
    facts = json.loads(OLD.read_text())
    before = json.dumps(facts)
    now = migrated(facts)
    assert json.dumps(facts) == before
    require_keys(now)
    require_kinds(now)
    assert now["format"] == FORMAT
    assert {k: v for k, v in now.items() if k in facts and k not in {"format", "recording"}} == {
        k: v for k, v in facts.items() if k not in {"format", "recording"}
    }
    assert now["recording"] == facts["recording"] | {"preparation": {}}


def test_a_later_format_is_refused(tmp_path: Path) -> None:
    """Property: one sentence with the number, the version that wrote it, and what to do."""
    facts = json.loads(OLD.read_text()) | {"format": FORMAT + 1}
    facts["provenance"]["versions"] = {"symgen": "9.1.0"}
    (tmp_path / "result.json").write_text(json.dumps(facts))
    match = r"has the format 3 \(written by symgen 9.1.0\), expected 2 or less; update symgen"
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
    lines = markdown_table().splitlines()
    assert len(lines) == len(KEYS) + 2 == len({key.path for key in KEYS}) + 2
    assert all(key.meaning for key in KEYS)
    assert all(line.count("|") == 6 for line in lines)
