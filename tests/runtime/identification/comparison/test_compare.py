"""`python -m runtime compare`: rows for every method, files, the page, Ctrl-C and bad input."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import runtime
from runtime import read_recording
from runtime.cli import app
from runtime.errors import IdentificationError
from runtime.estimators.methods import METHODS
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import write_motion
from runtime.identification.comparison.run import FAILED, NOT_RUN, RAN, compare
from runtime.identification.metrics import torque_error
from runtime.identification.problem_setup import assemble
from runtime.identification.single_log import identify_assembled
from runtime.library import Library
from runtime.recording import Friction
from tests.runtime.conftest import Command

EXAMPLE = Path(runtime.__file__).parent / "examples" / "fr3_simulated.npz"
TERMS = ("--friction", "viscous,coulomb", "--settings", "coulomb_speed=0.03")


@pytest.fixture(scope="module")
def facts_of_all(
    lib: Library, trajectories: tuple[Trajectory, ...], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Any]:
    """compare.json of all twelve methods on a simulated log with truth and loop; its folder."""
    folder = tmp_path_factory.mktemp("compare")
    write_motion(trajectories[0], lib, folder / "motion.json")
    log = folder / "log.npz"
    made = CliRunner().invoke(
        app,
        [
            *("simulate", "--robot", lib.folder, "--trajectory", str(folder / "motion.json")),
            *(
                "--out",
                str(log),
                "--settings",
                "viscous=0.3",
                "--settings",
                "coulomb=0.3",
                "--settings",
                "keep_every=5",
            ),
        ],
    )
    assert made.exit_code == 0, made.output
    ran = CliRunner().invoke(
        app,
        [
            *("compare", str(log), "--robot", lib.folder, *TERMS, "--cutoff", "20"),
            *(
                "--settings",
                "rate=100",
                "--settings",
                f"controller={log.with_suffix('.loop.toml')!s}",
            ),
            *("--out", str(folder / "out")),
        ],
    )
    assert ran.exit_code == 0, ran.output
    facts = json.loads((folder / "out" / "compare.json").read_text())
    return {**facts, "folder": folder, "printed": ran.output}


def rows_of(facts: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {row["method"]: row for row in facts["rows"]}


def test_every_method_has_a_row(facts_of_all: dict[str, Any]) -> None:
    """Property: with truth, loop and 200 Hz every method runs; figures are plausible."""
    rows = rows_of(facts_of_all)
    assert list(rows) == list(METHODS)
    assert {row["outcome"] for row in rows.values()} == {RAN}
    for row in rows.values():
        assert len(row["rms"]) == 7
        # 5 % of λ wrong is 3 % of β; noise of 0.05 N·m leaves a tenth of that in 480 samples.
        assert row["base_error_percent"] < 1.5
        assert 0 < row["test_percent"] < facts_of_all["before_percent"]
        assert row["seconds"] > 0
    for method in ("map", "adam", "lm", "log-cholesky", "pc-ols", "nn"):
        assert rows[method]["consistent"], method
    # PC-OLS minimises the loss in which all gaps are measured, up to its slack.
    assert 0 <= rows["pc-ols"]["gap_to_convex_optimum"] < 2e-3
    assert facts_of_all["advice"]["take"] in rows


def test_rows_say_what_identify_says(lib: Library) -> None:
    """Oracle: identify on the same training part, and the figures by their definitions."""
    log = read_recording(EXAMPLE)
    terms = Friction(("viscous", "coulomb"), 0.03)
    assembly = assemble(log, lib, friction=terms)
    made = {row.method: row for row in compare(assembly, ("map", "ols", "pc-ols")).rows}
    for method, row in made.items():
        alone = identify_assembled(assembly, method)
        assert row.status == alone.status
        error = torque_error(alone.test.tau, alone.predict_recording(alone.test))
        figures = row.figures
        assert figures is not None
        np.testing.assert_array_equal(figures.rms, error.rms)
        assert figures.test_percent == error.overall
        left_out = alone.validation
        unused = torque_error(left_out.tau, alone.predict_recording(left_out))
        assert figures.validation_percent == unused.overall
        assert figures.squares.sum() == pytest.approx(len(left_out) * np.sum(unused.rms**2))
        assert figures.smallest_relative_eigenvalue == alone.relative_eigenvalues.min()
        assert figures.base_error_percent is None
        if method != "map":  # whose own weights differ from the common ones
            # The loss by samples and by the compressed factor: rounding over a gap of 1e-4.
            assert figures.gap_to_convex_optimum == pytest.approx(alone.gap, rel=1e-6)


def test_same_input_same_bytes(lib: Library, command: Command, tmp_path: Path) -> None:
    """Property: two runs differ in times only; provenance names log, truth, model and options."""
    words = ("compare", EXAMPLE, "--robot", lib.folder, *TERMS, "--methods", "map,ols,nn")
    texts = []
    for _ in range(2):
        assert command(*words, "--out", "again").code == 0
        text = (tmp_path / "again" / "compare.json").read_text()
        texts.append(re.sub(r'"seconds": .*', "", text))
    assert texts[0] == texts[1]
    facts = json.loads((tmp_path / "again" / "compare.json").read_text())
    source = facts["provenance"]
    assert set(source["files"]) == {"fr3_simulated.npz", "fr3_simulated.truth.json"}
    assert all(len(digest) == 64 for digest in source["files"].values())
    assert source["model_hash"] == lib.manifest.model_hash
    assert source["options"]["methods"] == ["map", "ols", "nn"]
    assert [row["method"] for row in facts["rows"]] == ["map", "ols", "nn"]
    table = (tmp_path / "again" / "compare.md").read_text()
    assert "| map |" in table
    assert facts["advice"]["sentences"][0] in table


def test_what_is_missing_is_a_row(
    lib: Library, command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: no loop, 100 Hz, no columns: reasons; a failure and a breakdown: rows too."""

    def broken(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("singular")

    monkeypatch.setitem(METHODS._loaded, "adam", replace(METHODS["adam"], fit=broken))
    ran = command("compare", EXAMPLE, "--robot", lib.folder, "--friction", "none")
    assert ran.code == 0, ran.err
    rows = rows_of(
        json.loads((tmp_path / "results/fr3_simulated-compare/compare.json").read_text())
    )
    outcomes = {name: row["outcome"] for name, row in rows.items() if row["outcome"] != RAN}
    missing = dict.fromkeys(("iv", "didim", "ekf", "ukf", "nn"), NOT_RUN)
    assert outcomes == {**missing, "adam": FAILED}
    assert "--settings controller=FILE" in rows["iv"]["status"]
    assert "at 200 Hz or more" in rows["ekf"]["status"]
    assert "--friction" in rows["nn"]["status"]
    assert "its linear algebra failed on these data (singular)" in rows["adam"]["status"]
    assert "rms" not in rows["adam"]
    for method in outcomes:
        assert f"{method}: {rows[method]['status']}" in ran.out
    assert "Not run: iv, didim, ekf, ukf, nn; failed: adam" in ran.out


def test_without_an_optimum_there_is_no_gap(lib: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: a convex problem that was not solved costs the gaps, not the table."""

    def unsolved(*_: object) -> None:
        raise IdentificationError("no optimum")

    monkeypatch.setattr("runtime.identification.comparison.run.convex_optimum", unsolved)
    result = compare(assemble(read_recording(EXAMPLE), lib), ("map",))
    assert result.rows[0].figures is not None
    assert np.isnan(result.rows[0].figures.gap_to_convex_optimum)
    assert np.isnan(result.optimum)


def test_interrupted_rows_are_kept(lib: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: Ctrl-C in a method keeps the rows before it; later ones say why they are empty."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setitem(METHODS._loaded, "ols", replace(METHODS["ols"], fit=interrupt))
    names: list[str] = []
    assembly = assemble(read_recording(EXAMPLE), lib)
    rows = compare(assembly, ("map", "ols", "pc-ols"), started=names.append).rows
    assert [row.outcome for row in rows] == [RAN, NOT_RUN, NOT_RUN]
    assert rows[1].status.startswith("interrupted")
    assert names == ["map", "ols"]


def test_a_method_that_kept_its_best_point_ends_the_table(lib: Library) -> None:
    """Property: methods that catch Ctrl-C themselves have a row, and nothing is begun after it."""

    def interrupt(iteration: int, _: float) -> None:
        raise KeyboardInterrupt

    assembly = assemble(read_recording(EXAMPLE), lib)
    rows = compare(assembly, ("lm", "ols"), progress=interrupt).rows
    assert [row.outcome for row in rows] == [RAN, NOT_RUN]
    assert rows[0].status.startswith("interrupted by the user; the best point")


def test_methods_are_given_the_same_fresh_problem(
    lib: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: equal samples and weights, but no compressed data left by another's work."""
    seen: list[Any] = []
    fit = METHODS["pc-ols"].fit

    def spied(problem: Any) -> Any:
        assert "_weighted" not in vars(problem)
        seen.append(problem)
        return fit(problem)

    for name in ("pc-ols", "ols"):
        monkeypatch.setitem(METHODS._loaded, name, replace(METHODS[name], fit=spied))
    compare(assemble(read_recording(EXAMPLE), lib), ("pc-ols", "ols"))
    assert seen[0].train is seen[1].train
    assert seen[0].weights is seen[1].weights
    assert seen[0] is not seen[1]


@pytest.mark.usefixtures("drawn")
def test_the_page(facts_of_all: dict[str, Any], command: Command) -> None:
    """Property: a row and bars per method; the same bytes again."""
    folder = facts_of_all["folder"] / "out"
    page = (folder / "report.html").read_bytes()
    text = page.decode()
    for method in METHODS:
        assert f"<td>{method}</td>" in text
        assert text.count(f">{method}</text>") == 2  # once per line of panels
    assert facts_of_all["advice"]["sentences"][0] in text.replace("&#39;", "'")
    assert command("report", folder).code == 0
    assert (folder / "report.html").read_bytes() == page


def test_sections_beside_a_result(
    facts_of_all: dict[str, Any], lib: Library, command: Command, tmp_path: Path
) -> None:
    """Property: the page of a result has the methods where compare.json lies beside it."""
    folder = facts_of_all["folder"] / "out"
    made = command("identify", EXAMPLE, "--robot", lib.folder, *TERMS, "--out", "both")
    assert made.code == 0, made.err
    assert "Methods side by side" not in (tmp_path / "both" / "report.html").read_text()
    shutil.copy(folder / "compare.json", tmp_path / "both")
    assert command("report", "both").code == 0
    both = (tmp_path / "both" / "report.html").read_text()
    assert "Torque error per joint" in both
    assert "Methods side by side" in both


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('"format": 1', '"format": 9', "no valid format 1"),
        ('"rms": [', '"rms": [0.0, ', "expected 7 numbers"),
        ('"rows"', '"lines"', "no valid 'rows'"),
        ("{", "", "is damaged"),
    ],
)
def test_damaged_comparisons(
    facts_of_all: dict[str, Any],
    command: Command,
    tmp_path: Path,
    old: str,
    new: str,
    sentence: str,
) -> None:
    """Property: a file that is no comparison is one sentence, and no page."""
    text = (facts_of_all["folder"] / "out" / "compare.json").read_text()
    (tmp_path / "compare.json").write_text(text.replace(old, new, 1))
    ran = command("report", tmp_path)
    assert ran.code == 2
    assert sentence in ran.err
    assert not (tmp_path / "report.html").exists()
