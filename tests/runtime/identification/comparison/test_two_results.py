"""Two results side by side: planted differences are named, equal robots are not, with 95 %."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.identification.comparison.two_results import compare_results
from runtime.identification.saved_result import SavedResult, read_result
from tests.runtime.conftest import Command
from tests.runtime.pages import result, write

N_BASE = 40
SIGMA = np.geomspace(1e-3, 1.0, N_BASE)
NAMES = ("monday", "friday")


def saved(folder: Path, **changes: Any) -> SavedResult:
    """A result of two joints with uncertainty, read from a folder."""
    facts = result()
    sigma = {
        "advice": "record more",
        "n_eff": 500.0,
        "inflation": 2.0,
        "excited": N_BASE,
        "boundary": False,
        "links": [{"mass_sigma": 0.1, "com_sigma": None, "verdicts": ["identified"] * 10}] * 2,
        "beta_sigma": SIGMA.tolist(),
        **{key: [0.1, 0.2] for key in ("noise", "model_band", "white_lag_share")},
    }
    facts["friction"]["sigma"] = [[0.01, 0.02], [0.03, None]]
    facts |= {"beta": [0.0] * N_BASE, "uncertainty": sigma} | changes
    return read_result(write(folder, lambda raw: raw.update(facts)))


def moved(one: SavedResult, beta: Any, marks: Any = None) -> SavedResult:
    """The same result with other base parameters, and marks of its rows."""
    return replace(one, record=one.record.replace(beta=tuple(beta)), row_marks=marks)


def test_level_and_planted_difference(tmp_path: Path) -> None:
    """Oracle: of 200 pairs of one robot 5 % are marked; 8 σ of one parameter is named alone."""
    one = saved(tmp_path / "a")
    rng = np.random.default_rng(0)
    marked = 0
    for _ in range(200):
        a, b = (moved(one, rng.normal(0.0, SIGMA)) for _ in NAMES)
        marked += "0 of 40 differ" not in compare_results(a, b, NAMES).sentences[1]
    # Binomial(200, .05): 10 ± 3.1; four standard deviations are 1 to 22.
    assert 1 <= marked <= 22
    planted = np.zeros(N_BASE)
    planted[6] = -8 * np.sqrt(2) * SIGMA[6]
    both = compare_results(one, moved(one, planted), NAMES)
    assert both.sentences[1] == "base parameters: 1 of 40 differ: β7 (-8.0 σ)"
    base = both.values[1]
    assert base.flagged == {6}
    assert base.header[1:3] == NAMES


def test_sides_and_units(tmp_path: Path) -> None:
    """Property: both values with σ, second minus first, and a dash where σ is not known."""
    one = saved(tmp_path / "a")
    facts = result()
    facts["links"][0]["mass"] = 3.5
    friction = facts["friction"] | {"sigma": [[0.01, 0.02], [0.03, None]]}
    friction["values"] = [[0.1111, 0.3222], [0.3333, 0.5444]]
    two = saved(tmp_path / "b", links=facts["links"], friction=friction)
    both = compare_results(one, two, NAMES)
    masses, _, terms = both.values
    assert masses.rows[0] == (
        "link1", "2.5000 ± 0.1", "3.5000 ± 0.1", "1.0000", "+7.1", "differs"
    )  # fmt: skip
    assert terms.rows[2][0] == "shoulder Coulomb"
    assert terms.rows[2][3:] == ("0.1000", "+3.5", "differs")
    assert terms.rows[3][3:] == ("0.1000", "–", "–")
    assert ("method", "adam", "adam") in both.setup.rows
    assert both.errors.rows[1] == ("rail", *["5.43\N{NO-BREAK SPACE}%", "0.2468 N"] * 2)


def test_command(tmp_path: Path, command: Command) -> None:
    """Property: page and sentences; other joints and options of a fit are refused by a sentence."""
    saved(tmp_path / "a")
    saved(tmp_path / "b", beta=[8.0] * N_BASE)
    saved(tmp_path / "c", joints=["other", "rail"])
    ran = command("compare", "a", "b")
    assert ran.code == 0, ran.err
    assert "base parameters: 40 of 40 differ" in ran.out
    page = tmp_path / "results" / "a-b-compare" / "report.html"
    assert 'class="flagged"' in page.read_text()
    shutil.copytree(tmp_path / "b", tmp_path / "again" / "a")
    ran = command("compare", "a", tmp_path / "again" / "a")
    assert ran.code == 0, ran.err
    assert (tmp_path / "results" / "a-a-compare" / "report.html").is_file()
    for words, said in (
        (("a", "c"), "have other joints"),
        (("a", "b", "--cutoff", "10"), "--cutoff would change a fit"),
        (("a", "nowhere"), "nowhere"),
    ):
        ran = command("compare", *words)
        assert (ran.code, ran.err.count("\n")) == (2, 1)
        assert said in ran.err


def test_a_page_is_opened(
    tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: --open of report gives the page that was written to the browser, once."""
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    write(tmp_path / "a")
    monkeypatch.setattr("runtime.cli.report.write_report", lambda _, page: page)
    assert command("report", "a").code == 0
    assert command("report", "a", "--open").code == 0
    assert opened == [(tmp_path / "a" / "report.html").as_uri()]


def test_common_rows(tmp_path: Path) -> None:
    """Oracle: of 2000 rows 0, half or all are in both logs; the marks are the smallest hashes."""
    one, rng = saved(tmp_path / "a"), np.random.default_rng(1)
    rows = rng.integers(0, 2**63, 4000, dtype=np.uint64)
    for shift, share in ((0, 1.0), (1000, 0.5), (2000, 0.0)):
        marks = [np.sort(rows[k : k + 2000])[:512] for k in (0, shift)]
        pair = [moved(one, SIGMA, each) for each in marks]
        notes = [n for n in compare_results(*pair, NAMES).notes if n.startswith("the logs share")]
        assert len(notes) == (share > 0)
        # Binomial share of 256 marks: .03, times four.
        assert not notes or abs(float(notes[0].split()[3]) / 100 - share) < 0.12
