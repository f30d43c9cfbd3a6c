"""Results in a notebook: small HTML tables, well formed and escaped."""

import dataclasses
import sys
import types
from pathlib import Path
from typing import Any

import pytest

from runtime import Identification, Recording, identify_payload
from runtime.common.tables import Table
from runtime.errors import RuntimeFault
from runtime.identification.comparison.run import compare
from runtime.identification.problem_setup import assemble
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import read_result
from runtime.inspection import Finding, Inspection
from runtime.library import Library
from runtime.recording import Friction, Recipe
from tests.runtime.pages import Reader

EVIL = "<script>&\"'"


def shown(result: Any) -> Reader:
    """The tables of a result, read by a parser that raises when tags do not nest."""
    page = Reader(result._repr_html_())
    assert "script" not in page.tags
    assert page.tags[0] == "table"
    return page


def test_texts_are_escaped() -> None:
    page = Reader(Table((EVIL, EVIL), ((EVIL, EVIL),), title=EVIL).__html__())
    assert "script" not in page.tags
    assert page.text.count(EVIL) == 5


def test_a_recording_shows_its_signals(noisy: Recording) -> None:
    page = shown(noisy.replace(name=EVIL))
    assert f"{EVIL}: {len(noisy)} rows of 7 joints" in page.text
    assert f"tau N·m, N {noisy.tau.min():.4g} {noisy.tau.max():.4g}" in page.text


def test_an_identification_shows_errors_and_bodies(panda_adam: Identification) -> None:
    page = shown(dataclasses.replace(panda_adam, status=EVIL))
    assert f"fr3 by adam: consistent; {EVIL}" in page.text
    assert all(name in page.text for name in (*panda_adam.lib.link_names, "all joints"))


def test_a_comparison_shows_its_rows(lib: Library, noisy: Recording) -> None:
    assembly = assemble(noisy, lib, friction=Friction(("viscous",)))
    page = shown(compare(assembly, ("ols", "iv")))
    assert "fr3: every method on the same data" in page.text
    assert "not run" in page.text


def test_a_payload_shows_its_ten_values(lib: Library, noisy: Recording) -> None:
    payload = identify_payload(noisy, lib)
    page = shown(payload)
    assert payload.status in page.text
    assert page.tags.count("tr") == 11


@pytest.mark.parametrize("level", ["error", "info"])
def test_an_inspection_shows_its_findings(level: str, noisy: Recording) -> None:
    finding = Finding("clock", level, EVIL, {"rows": 3})
    page = shown(finding)
    assert f"{level}: clock" in page.text
    assert "rows 3" in page.text
    page = shown(Inspection("fr3", (finding,), Recipe(), noisy, ()))
    assert f"{level} clock {EVIL}" in page.text


@pytest.mark.parametrize("package", ["pandas", "polars"])
def test_results_convert_to_data_frames(package, noisy, panda_adam, monkeypatch) -> None:
    """Property: columns of one length reach DataFrame; a missing package is one sentence."""
    monkeypatch.setitem(sys.modules, package, None)  # import_module then raises
    with pytest.raises(RuntimeFault, match=f"run: pip install {package}"):
        getattr(noisy, f"to_{package}")()
    monkeypatch.setitem(sys.modules, package, types.SimpleNamespace(DataFrame=dict))
    table = getattr(noisy, f"to_{package}")()
    assert list(table)[:2] == ["t", "q1"]
    assert (table["tau7"] == noisy.tau[:, 6]).all()
    bodies = getattr(panda_adam, f"to_{package}")()
    assert {len(values) for values in bodies.values()} == {70}
    assert bodies["value"] == panda_adam.pi.tolist()
    assert bodies["parameter"][:2] == ["m", "mX"]


def test_a_result_that_is_read_again_shows_and_converts_itself(
    panda_adam: Identification, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: result.json shows the errors and bodies of the result, and the same frame."""
    write_result(panda_adam, tmp_path, "identify")
    saved = read_result(tmp_path)
    text, first = shown(saved).text, shown(panda_adam).text
    assert f"fr3 by adam: {panda_adam.status}" in text
    numbers = {f"{m:.4f}" for m in panda_adam.pi[::10]} | set(panda_adam.lib.link_names)
    assert all(each in text and each in first for each in numbers)
    monkeypatch.setitem(sys.modules, "polars", types.SimpleNamespace(DataFrame=dict))
    table, whole = saved.to_polars(), panda_adam.to_polars()
    assert table["value"] == whole["value"]
    assert table["link"] == whole["link"]
    assert ("sigma" in table) == ("sigma" in whole)
