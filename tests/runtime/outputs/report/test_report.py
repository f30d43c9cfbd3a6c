"""runtime.outputs.report: results files in, one self-contained HTML file out."""

import base64
import hashlib
import html
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.errors import RuntimeFault
from runtime.outputs.report.figures import mass_change
from runtime.outputs.report.report import read_result, write_report
from tests.runtime.pages import Change, Reader, predictions, read, write


def test_a_full_result_shows_its_numbers(tmp_path: Path) -> None:
    page = read(write(tmp_path))
    for words in (
        "decreased from 27.18 % to 4.67 %; all links are physically consistent",
        "31.41 % 4.32 % 1.2345 0.1357 N·m",
        "22.22 % 5.43 % 6.7890 0.2468 N",
        "all joints 27.18 % 4.67 % – –",  # N and N·m have no common mean
        "link1 2.0000 2.5000 0.0, 12.0, 100.0 12.0 1.5e-04 consistent",
        "3.2e-07 %",
        "20 iterations",
        "shoulder 0.1111 0.2222",
        "low-pass at 20 Hz",
        "700 train, 150 validation, 400 test",
        "rail is hardly excited",
        "python -m runtime identify log.csv",
        "cd" * 32,
        "ab" * 32,
        "87.3",
        "stopped: the validation loss",
    ):
        assert words in page.text
    assert page.tags.count("svg") == 3


@pytest.mark.usefixtures("undrawn")
def test_the_overall_rms_is_the_mean_square_of_joints_of_one_unit(tmp_path: Path) -> None:
    page = read(write(tmp_path, lambda raw: raw.update(units=["N*m", "N*m"])))
    assert f"all joints 27.18 % 4.67 % {np.sqrt((1.2345**2 + 6.789**2) / 2):.4f}" in page.text


def test_a_baseline_that_is_not_physical_says_so_first(tmp_path: Path) -> None:
    def ols(raw: dict[str, Any]) -> None:
        nothing = dict.fromkeys(("lam", "convergence", "friction", "gap_to_convex_optimum"))
        raw.update(nothing, method="ols", consistent=False, iterations=None)
        raw["links"][1]["min_relative_eigenvalue"] = -0.02
        raw["links"][1]["com"] = [None] * 3

    page = read(write(tmp_path, ols))
    assert "4.67 %; not physically consistent: link2." in page.text
    assert "Physically consistent no smallest λ_min(P)/tr P: -2.0e-02" in page.text
    assert "not computed" in page.text
    assert "computing time" in page.text
    assert page.tags.count("svg") == 2
    for title in ("Friction", "Convergence"):
        assert title not in page.words


@pytest.mark.usefixtures("undrawn")
def test_only_the_errors_and_the_links_are_needed(tmp_path: Path) -> None:
    needed = ("format", "method", "robot", "joints", "links", "consistent")

    def bare(raw: dict[str, Any]) -> None:
        for key in set(raw) - {*needed, "torque_error_percent", "torque_rms"}:
            del raw[key]

    page = read(write(tmp_path, bare))
    assert "unnamed recording" in page.text
    assert "Samples: not recorded" in page.text


@pytest.mark.usefixtures("undrawn")
def test_worse_and_equal_errors_are_worded_as_such(tmp_path: Path) -> None:
    for after, words in (
        (30.0, "increased from 27.18 % to 30.00 %"),
        (27.18, "is unchanged at 27.18 %"),
    ):
        change = {"after_overall": after}
        folder = write(tmp_path, lambda raw, c=change: raw["torque_error_percent"].update(c))
        assert words in read(folder).text


def test_the_page_needs_nothing_from_outside(tmp_path: Path) -> None:
    """Property: no address leaves the file, and the policy forbids any that would."""
    text = write_report(write(tmp_path)).read_text(encoding="utf-8")
    assert "http://" not in text
    assert "https://" not in text
    assert "@import" not in text
    assert re.findall(r"url\((?!#)", text) == []
    page = Reader(text)
    assert all(address.startswith("#") for address in page.addresses)
    assert not {"iframe", "img", "link"} & set(page.tags)
    assert "default-src 'none'" in text


@pytest.mark.usefixtures("undrawn")
def test_only_the_script_of_the_page_may_run(tmp_path: Path) -> None:
    """Property: the policy's one hash is the SHA-256 of the page's one script."""
    text = write_report(write(tmp_path)).read_text(encoding="utf-8")
    (script,) = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert re.findall(r"script-src '([^']*)'\"", text) == [f"sha256-{digest}"]


def test_ids_are_unique_and_references_resolve(tmp_path: Path) -> None:
    """Property: two figures in one page must not clip each other."""
    text = write_report(write(tmp_path)).read_text(encoding="utf-8")
    page = Reader(text)
    assert len(page.ids) == len(set(page.ids))
    used = set(re.findall(r"url\(#([^)]+)\)", text)) | {a[1:] for a in page.addresses}
    assert used <= set(page.ids)


def test_colours_come_from_the_page(tmp_path: Path) -> None:
    """Property: no figure keeps a fixed colour that would vanish on a dark page."""
    text = write_report(write(tmp_path)).read_text(encoding="utf-8")
    svg = "".join(re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL))
    assert "var(--after)" in svg
    assert re.findall(r"#[0-9a-f]{6}\b", svg) == []


def test_hostile_names_are_text(tmp_path: Path) -> None:
    """Property: nothing of a recording, a joint, a link or a file becomes markup or maths."""
    bad = "<script>alert(1)</script>$\\frac{&\"' 手"

    def hostile(raw: dict[str, Any]) -> None:
        raw.update(robot=bad, status=bad, warnings=[bad], joints=[bad, "$x$"], units=[bad, bad])
        raw["recording"].update(name=bad, history=[bad], split=bad)
        raw["links"][0]["name"] = bad
        raw["friction"]["columns"] = [bad, bad]
        raw["provenance"].update(command=bad, files={bad: bad})

    page = read(write(tmp_path, hostile))
    assert page.tags.count("script") == 1
    assert page.text.count("<script>alert(1)</script>$\\frac{&\"' 手") > 8
    assert "$x$ " in page.text


def test_the_same_results_give_the_same_bytes(tmp_path: Path) -> None:
    first = write_report(write(tmp_path / "a")).read_bytes()
    second = write_report(write(tmp_path / "b")).read_bytes()
    assert first == second
    assert write_report(tmp_path / "a").read_bytes() == first
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == [
        "predictions.npz",
        "report.html",
        "result.json",
    ]


def test_the_users_matplotlib_settings_do_not_reach_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import matplotlib as mpl

    first = write_report(write(tmp_path)).read_bytes()
    monkeypatch.setitem(mpl.rcParams, "lines.linestyle", ":")
    assert write_report(tmp_path).read_bytes() == first


def test_a_long_recording_stays_a_small_file(tmp_path: Path) -> None:
    path = write_report(write(tmp_path, samples=200_000))
    assert path.stat().st_size < 2_000_000


@pytest.mark.usefixtures("undrawn")
def test_a_report_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    folder = write(tmp_path)
    (folder / "report.html").mkdir()
    with pytest.raises(RuntimeFault, match=r"cannot write '.*report.html'"):
        write_report(folder)
    assert not list(folder.glob("*.part"))


def test_numbers_that_do_not_exist_are_dashes(tmp_path: Path) -> None:
    """A silent joint has an infinite relative error, a perfect fit has no logarithm."""

    def strange(raw: dict[str, Any]) -> None:
        raw["torque_error_percent"].update(before=[None, float("inf")], before_overall=None)
        raw["convergence"].update(training=[0, 0, 0], validation=None)

    page = read(write(tmp_path, strange))
    assert "is 4.67 % (before: –)" in page.text
    assert "shoulder – 4.32 %" in page.text
    assert "rail ∞ 5.43 %" in page.text


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"format": 2}', "[" * 100_000])
def test_a_damaged_result_is_one_sentence(tmp_path: Path, text: str) -> None:
    folder = write(tmp_path)
    (folder / "result.json").write_text(text)
    with pytest.raises(RuntimeFault, match=r"result.json' (is damaged|has the format)"):
        write_report(folder)
    assert not (folder / "report.html").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda raw: raw.pop("joints"), r"is damaged .*expects the key joints, got none"),
        (lambda raw: raw.update(joints="ab"), "joints expects a list, got 'ab'"),
        (lambda raw: raw.pop("torque_rms"), "expects the key torque_rms, got none"),
        (lambda raw: raw.update(links=[3]), "is damaged"),
        (
            lambda raw: raw["links"][0].update(com=[1, 2]),
            r"links\[0\].com expects a list of length 3",
        ),
        (lambda raw: raw["links"][0].update(mass="heavy"), "heavy"),
        (lambda raw: raw["links"][0].update(mass=float("inf")), "mass .* of link1 expect finite"),
        (lambda raw: raw["links"][0].update(mass=1e308), r"a number above 1e\+100"),
        (
            lambda raw: raw["torque_rms"].update(after=[1]),
            r"torque_rms.after expects the shape \(2,\)",
        ),
        (
            lambda raw: raw["friction"].update(values=[[1], [2]]),
            r"friction.values expects the shape \(2, 2\)",
        ),
        (lambda raw: raw.update(units=["N"]), r"units expects the shape \(2,\), got \(1,\)"),
    ],
)
def test_a_wrong_field_is_named(tmp_path: Path, change: Change, message: str) -> None:
    with pytest.raises(RuntimeFault, match=message):
        read_result(write(tmp_path, change))


def test_missing_and_damaged_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(RuntimeFault, match=r"cannot read '.*result.json' \(No such file"):
        write_report(tmp_path)
    folder = write(tmp_path)
    path = folder / "predictions.npz"
    np.savez(path, **predictions(joints=3))
    with pytest.raises(RuntimeFault, match=r"holds t \(400,\), measured \(400, 3\)"):
        write_report(folder)
    for damage in (path.read_bytes()[:300], b"", b"text"):
        path.write_bytes(damage)
        with pytest.raises(RuntimeFault, match=r"predictions.npz' is damaged"):
            write_report(folder)
    np.savez(path, t=np.zeros(3))
    with pytest.raises(RuntimeFault, match="is damaged"):
        write_report(folder)
    for value in (-1e308, np.inf, np.nan):
        np.savez(path, **predictions() | {"after": np.full((400, 2), value)})
        with pytest.raises(
            RuntimeFault, match="holds NaN or numbers above 1e\\+100; identify again"
        ):
            write_report(folder)
    np.savez_compressed(path, **predictions())
    whole = bytearray(path.read_bytes())
    whole[2000:2100] = bytes(100)
    path.write_bytes(whole)
    with pytest.raises(RuntimeFault, match="is damaged"):
        write_report(folder)
    path.unlink()
    with pytest.raises(RuntimeFault, match=r"cannot read '.*predictions.npz'"):
        write_report(folder)


def test_masses_are_drawn_with_their_sigma() -> None:
    """Property: σ stands beside the identified mass, and nothing where it is unknown."""
    before, after = np.array([1.0, 2.0]), np.array([1.5, 2.25])
    drawn = html.unescape(mass_change(["a", "b"], before, after, np.array([0.1, 0.02])))
    assert "1 → 1.5 ± 0.1" in drawn
    assert "2 → 2.25 ± 0.02" in drawn
    assert "±" not in html.unescape(mass_change(["a", "b"], before, after))
