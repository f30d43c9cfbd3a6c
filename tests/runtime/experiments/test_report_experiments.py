"""experiments: folders of studies in; page, Markdown, pictures and README out.

Oracle: a study written by hand, whose numbers are known.
"""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from runtime.errors import RuntimeFault
from runtime.experiments.report import read_experiments, write_experiments
from tests.browser import Watched, chromium
from tests.runtime.conftest import Command
from tests.runtime.pages import Reader

MARK = "ab" * 32
AIRM = {"adam": [0.10, 0.20, 0.30], "map": [0.01, 0.02, 0.06]}
Change = Callable[[dict[str, Any]], object]


def view(name: str, kind: str, **more: Any) -> dict[str, Any]:
    empty = {"cases": [], "metrics": [], "series": [], "axes": ["", ""], "document": ""}
    return {"id": name, "kind": kind, "title": f"about {name}"} | empty | more


def study(folder: Path, change: Change | None = None) -> Path:
    """Write the folder `toy` of a finished study of three trials, two methods, every figure."""
    place = folder / "toy"
    place.mkdir(parents=True)
    rows = [
        {"case": "p=0.15", "method": method, "trial": k, "status": "ok", "consistent": True}
        | {"airm": value, "tau_error_1": 10 * value, "tau_error_2": 5 * value}
        for method, values in AIRM.items()
        for k, value in enumerate(values)
    ]
    table = pa.Table.from_pylist(rows).replace_schema_metadata({"config_hash": MARK})
    pq.write_table(table, place / "trials.parquet")
    t = np.linspace(0, 1, 50)
    joints = np.sin(t[:, None] * [1.0, 2.0])
    series = {"t": t, "one": t**2, "two": joints, "path": np.c_[t, t**2, np.cos(t)]}
    np.savez(place / "series.npz", **series)
    summary = [
        {"case": "p=0.15", "method": m, "metric": name, "mean": scale * float(np.mean(v))}
        | {"std": scale * float(np.std(v, ddof=1)), "n": 3}
        for m, v in AIRM.items()
        for name, scale in (("airm", 1), ("tau_error_1", 10), ("tau_error_2", 5))
    ]
    summary += [
        {"case": "p=0.15", "method": m, "metric": "consistent", "mean": 1.0, "std": 0.0, "n": 3}
        for m in AIRM
    ]
    published = {"id": "table-5.2", "source": "Table 5.2", "case": "p=0.15", "method": "adam"}
    torque = ["tau_error_1", "tau_error_2"]
    raw = {
        "format": 1,
        "study": "toy",
        "title": "A toy study",
        "robot": "toy",
        "joints": ["shoulder", "elbow"],
        "model_hash": "cd" * 32,
        "versions": {"numpy": "2"},
        "command": "python -m runtime reproduce all",
        "trials": 3,
        "config": {"seed": 5},
        "config_hash": MARK,
        "files": {n: digest(place / n) for n in ("trials.parquet", "series.npz")},
        "cases": {"p=0.15": "perturbed <b>"},
        "methods": {"adam": "the document's", "map": "ours"},
        "views": [
            view("table-5.2", "table", cases=["p=0.15"], metrics=["airm", *torque, "consistent"]),
            view("fig-5.2", "band", series=["t", "one", "one"], axes=["iteration", "AIRM"]),
            view("fig-3.1", "lines", series=["t", "two", "two"], axes=["t", "N·m"]),
            view("fig-3.2", "lines", series=["t", "one", "one"]),
            view("fig-3.3", "path", series=["path"]),
            view("fig-4.1", "loglog", series=["t", "one", "one"]),
            view("fig-A.1", "motion", series=["t", "two", "two", "two", "two"]),
            view("fig-5.8", "bars", cases=["p=0.15"], metrics=torque),
        ],
        "facts": {"rate_hz": 100.0, "filter": "none"},
        "summary": summary,
        "document": [
            published | {"metric": "airm", "mean": 0.0402, "std": 0.0409},
            published | {"metric": "tau_error_1", "mean": 0.1, "std": 0.13},
            published | {"metric": "consistent", "mean": 1.0, "std": None},
        ],
    }
    if change:
        change(raw)
    (place / "result.json").write_text(json.dumps(raw))
    known = {"config_hash": MARK, "trials": 3, "config": {"seed": 5}}
    (place / "config.json").write_text(json.dumps(known))
    return folder


def some(*ids: str) -> Change:
    """Only these views: pictures take time."""
    return lambda raw: raw.update(views=[v for v in raw["views"] if v["id"] in ids])


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_the_page_shows_document_ours_and_map(tmp_path: Path) -> None:
    folder = study(tmp_path / "results")
    write_experiments(folder, tmp_path / "page.html", tables_to=tmp_path / "tables.md")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    page = Reader(text)
    for words in (
        "final AIRM of the document is reproduced within a factor of 5; MAP is closer to the "
        "truth on the same data in 1 of 1 cases.",  # 0.2 / 0.0402
        "AIRM 0.0402 ± 0.0409 0.200 ± 0.100 0.0300 ± 0.0265",
        "joint 1 [%] 0.1 ± 0.13 2.00 ± 1.00 0.300 ± 0.265",
        "joint 2 [%] – 1.00 ± 0.50 0.150 ± 0.132",
        "physical consistency 100 % 100 % 100 %",
        "perturbed <b>",
        "from toy, config abababababab",
        MARK,
        "fewer trials than the 150 of the document, so that means are less certain: toy (3)",
        "not in this folder: excitation",
    ):
        assert words in page.text
    assert page.tags.count("svg") == 7
    assert text.count("document, λ-Adam") == 1  # bars beside the table's numbers, in the legend
    assert "#study-toy" in page.addresses
    assert {a[1:] for a in page.addresses} <= set(page.ids)
    assert len(page.ids) == len(set(page.ids))
    assert "mathdefault" not in text
    lines = (tmp_path / "tables.md").read_text(encoding="utf-8").splitlines()
    assert "| AIRM | 0.0402 ± 0.0409 | 0.200 ± 0.100 | 0.0300 ± 0.0265 |" in lines
    assert "[^toy]: toy/result.json, config abababababab, 3 trials" in lines


def test_the_same_results_give_the_same_bytes(tmp_path: Path) -> None:
    folder = study(tmp_path / "results", some("table-5.2", "fig-5.2", "fig-3.3", "fig-5.8"))
    made = []
    for name in ("a", "b"):
        home = tmp_path / name
        home.mkdir()
        (home / "README.md").write_text("# x\n<!-- reproduce -->\nold\n<!-- /reproduce -->\nend\n")
        written = write_experiments(
            folder,
            home / "page.html",
            figures_to=home / "figures",
            readme=home / "README.md",
            command="report",
        )
        assert set(written) == {path for path in home.rglob("*") if path.is_file()}
        made.append({p.relative_to(home): p.read_bytes() for p in written})
    assert made[0] == made[1]
    assert len(made[0]) == 1 + 3 + 1 + 3
    assert all(len(made[0][p]) <= 60_000 for p in made[0] if p.parts[0] == "images")
    text = made[0][Path("README.md")].decode()
    assert text.startswith("# x\n<!-- reproduce -->\n`report` wrote")
    assert text.endswith("<!-- /reproduce -->\nend\n")
    assert "old" not in text
    row = "| Table 5.2 | p = 0.15 | AIRM | 0.0402 ± 0.0409 | 0.200 ± 0.100 | 0.0300 ± 0.0265 |"
    assert f"{row} `abababababab` |" in text
    assert "![Figure 5.8: about fig-5.8](images/fig-5.8.png)" in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda raw: raw.update(format=2), "is damaged"),
        (lambda raw: raw.pop("views"), "no valid 'views'"),
        (lambda raw: raw.update(config_hash="ef" * 32), "have different configs"),
        (lambda raw: raw.update(config={"seed": 6}), "have different configs"),
        (
            lambda raw: raw["summary"][0].update(mean=0.19),
            r"differs from its trials \(p=0.15 adam airm\)",
        ),
        (lambda raw: raw["summary"][0].update(std=0.19), "differs from its trials"),
        (lambda raw: raw["summary"][0].update(n=150), "differs from its trials"),
        (lambda raw: raw["summary"].pop(), "differs from its trials"),
        (
            lambda raw: raw["files"].update({"series.npz": "0"}),
            "series.npz' does not match its SHA-256",
        ),
        (lambda raw: raw["views"][1].update(series=["z"]), "missing series"),
        (lambda raw: raw["views"][1].update(kind="pie"), "kind 'pie'"),
    ],
)
def test_a_result_that_does_not_hold_together_is_one_sentence(
    tmp_path: Path, change: Change, message: str
) -> None:
    with pytest.raises(RuntimeFault, match=message):
        read_experiments(study(tmp_path, change))


def test_numbers_that_broke_are_gaps_or_one_sentence(tmp_path: Path) -> None:
    """Property: infinite curves leave a gap, infinite trials do not agree with their summary."""

    def infinite(raw: dict[str, Any]) -> None:
        place = tmp_path / "series" / "toy"
        with np.load(place / "series.npz") as file:
            series = {name: np.where(values > 0.9, np.inf, values) for name, values in file.items()}
        series["path"] = np.zeros((50, 3))
        np.savez(place / "series.npz", **series)
        raw["files"]["series.npz"] = digest(place / "series.npz")

    write_experiments(study(tmp_path / "series", infinite), tmp_path / "report.html")

    def not_a_number(raw: dict[str, Any]) -> None:
        place = tmp_path / "trials" / "toy"
        table = pq.read_table(place / "trials.parquet")
        gone = pa.array([np.nan] * table.num_rows)
        table = table.set_column(table.column_names.index("airm"), "airm", gone)
        pq.write_table(table, place / "trials.parquet")
        raw["files"]["trials.parquet"] = digest(place / "trials.parquet")
        for entry in raw["summary"]:
            entry["quartiles"] = [0.1, 0.2, 0.3]

    with pytest.raises(RuntimeFault, match="differs from its trials"):
        read_experiments(study(tmp_path / "trials", not_a_number))


def test_truncated_and_missing_files_are_named(tmp_path: Path) -> None:
    for name in ("result.json", "trials.parquet", "series.npz", "config.json"):
        place = study(tmp_path / name.partition(".")[0]) / "toy"
        whole = (place / name).read_bytes()
        (place / name).write_bytes(whole[: len(whole) // 2])
        with pytest.raises(
            RuntimeFault, match=r"is damaged|does not match its SHA-256 in result.json"
        ):
            read_experiments(place.parent)
    place = study(tmp_path / "gone") / "toy"
    (place / "series.npz").unlink()
    with pytest.raises(RuntimeFault, match=r"cannot read '.*series.npz' \(No such file"):
        read_experiments(place.parent)


def test_an_unfinished_study_is_listed_and_omitted(tmp_path: Path) -> None:
    folder = study(tmp_path)
    (folder / "late").mkdir()
    (folder / "late" / "config.json").write_text("{}")
    experiments, notes = read_experiments(folder)
    assert [e.name for e in experiments] == ["toy"]
    assert "late is not finished" in notes[0]
    (folder / "toy" / "result.json").unlink()
    with pytest.raises(RuntimeFault, match="holds no finished experiment"):
        read_experiments(folder)


def test_the_command_says_one_sentence_and_writes_nothing(tmp_path: Path, command: Command) -> None:
    folder = study(tmp_path / "results", lambda raw: raw["summary"].pop())
    ran = command("report", folder, "--settings", "markdown=tables.md")
    assert (ran.code, ran.err.count("\n")) == (2, 1)
    assert "differs from its trials" in ran.err
    assert not list(tmp_path.rglob("report.html")) + list(tmp_path.rglob("tables.md"))
    ran = command(
        "report", study(tmp_path / "good", some("table-5.2")), "--settings", "readme=true"
    )
    assert ran.code == 2
    assert "README.md' (No such file" in ran.err
    (tmp_path / "README.md").write_text("no place")
    ran = command("report", tmp_path / "good", "--settings", "readme=true")
    assert "expected the markers <!-- reproduce -->" in ran.err
    assert (tmp_path / "README.md").read_text() == "no place"
    page = tmp_path / "benchmarks.md"
    page.write_text("<!-- reproduce --><!-- /reproduce -->")
    ran = command("report", tmp_path / "good", "--settings", f"into={page}")
    assert ran.code == 0
    assert "| Table 5.2 |" in page.read_text()
    ran = command("report", tmp_path, "--settings", "figures=figures")
    assert "need a folder written by reproduce, got" in ran.err


def test_the_filter_hides_a_method_in_tables_and_figures(tmp_path: Path) -> None:
    """Oracle: Chromium; the columns, the head above them, and the bars of MAP."""
    folder = study(tmp_path, some("table-5.2", "fig-5.8"))
    write_experiments(folder, tmp_path / "page.html")
    with chromium() as browser:
        seen = Watched(browser, tmp_path / "page.html")
        page = seen.page
        table = "#s-table-5-2 table"
        assert seen.column(table, 3)[0].startswith("0.0300")
        visible = page.locator("svg [data-m='MAP'] path:visible")
        bars = visible.count()
        page.get_by_label("MAP").uncheck()
        assert not page.locator(f"{table} td[data-m='MAP']").first.is_visible()
        assert page.locator(f"{table} td[data-m='document']").first.is_visible()
        assert bars == 2
        assert visible.count() == 0
        page.get_by_label("MAP").check()
        assert visible.count() == 2
        assert not seen.complaints + seen.requests
