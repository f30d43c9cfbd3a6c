"""`scripts/same_results` finds what differs between two commits, and nothing else."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import REPOSITORY


@pytest.fixture
def differences(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path, Path], list[str]]:
    """Lines of a comparison, without the last one, which counts them."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    from bench.same_results import RTOL, compare

    def lines(before: Path, after: Path) -> list[str]:
        said: list[str] = []
        assert compare(before, after, (), RTOL, said.append) == len(said) - 1
        return said[:-1]

    return lines


def case(folder: Path, mass: float = 2.5, small: float = 0.0, out: str = "mass: 2.5 kg") -> Path:
    """Folder of results with one case that wrote a JSON file and arrays."""
    times = f"time of the method: {mass} s\nmap  0.180  0.251  j2 0.043  –  {mass}  6"
    run = {"command": "identify", "exit": 0, "out": f"{out}\n{times}", "err": ""}
    place = folder / "one" / "out"
    place.mkdir(parents=True)
    (folder / "one.json").write_text(json.dumps([run]))
    facts = {"links": [{"mass": mass, "name": "a"}], "seconds": mass, "gap": None}
    (place / "result.json").write_text(json.dumps(facts))
    cells = "</td><td>".join(("map", "0.180", "0.251", "j2 0.043", "–", f"{mass}", "6"))
    (place / "page.html").write_text(f'<tr data-m="map"><td>{cells}</td></tr>', encoding="utf-8")
    np.savez(place / "arrays.npz", pi=np.array([1.0, 1e-5 * mass, small]))
    return folder


@pytest.mark.parametrize(
    ("change", "count"),
    [
        ({}, 0),
        ({"mass": 2.5 * (1 + 1e-12)}, 0),
        # The second number of the array is below a thousandth of the first, and compared with that.
        ({"mass": 2.5 * (1 + 1e-8)}, 1),
        ({"mass": 2.5 * (1 + 1e-7)}, 2),
        ({"small": 1e-13}, 0),
        ({"small": 1e-11}, 1),
        ({"out": "mass: 2.5000000001 kg"}, 0),
        ({"out": "mass: 2.51 kg"}, 1),
        ({"out": "mass: 2.5000000100000000123 kg"}, 1),  # no digest, however many digits
        ({"out": "mass of the link: 2.5 kg"}, 2),  # a line of each
    ],
)
def test_planted_differences(
    change: dict[str, float | str],
    count: int,
    differences: Callable[[Path, Path], list[str]],
    tmp_path: Path,
) -> None:
    """Property: 1e-8 is found and 1e-12 is not; rounding of zeros and times do not count."""
    lines = differences(case(tmp_path / "before"), case(tmp_path / "after", **change))  # type: ignore[arg-type]
    assert len(lines) == count, lines


def test_rounding_of_the_first_checkout_is_allowed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Property: ten times what another instruction set changes, and no more; roots as products."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    from bench.same_results import RTOL, compare

    folders = before, rounded, *changed = [
        case(tmp_path / str(shift), 2.5 * (1 + shift)) for shift in (0.0, 1e-7, 9e-7, 2e-6)
    ]
    for k, folder in enumerate(folders):
        turn = np.array([[np.cos(k), np.sin(k)], [-np.sin(k), np.cos(k)]])
        root = np.array([[2.0, 1.0], [0.0, 3.0]])
        arrays = {"factor": turn @ root, "target": turn @ [1.0, 2.0], "pi_root": root @ turn}
        np.savez(folder / "one" / "out" / "posterior.npz", **arrays)
    counts = [compare(before, x, (), RTOL, lambda _: None, rounded) for x in changed]
    assert counts == [0, 2]


def test_a_missing_file_and_a_missing_case_are_differences(
    differences: Callable[[Path, Path], list[str]], tmp_path: Path
) -> None:
    before, after = case(tmp_path / "before"), case(tmp_path / "after")
    (after / "one" / "out" / "arrays.npz").unlink()
    assert differences(before, after) == ["one: out/arrays.npz pi: only before"]
    (after / "one.json").unlink()
    assert differences(before, after) == [f"one: no such case in {after}"]


def test_one_case_runs(
    tmp_path: Path, differences: Callable[[Path, Path], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: two runs of one checkout agree, and a command that fails is a result."""
    from bench import same_results

    script = [sys.executable, str(REPOSITORY / "scripts" / "same_results")]
    monkeypatch.setitem(same_results.CASES, "models", ("list", "describe nothing"))
    for name in ("before", "after"):
        same_results.write(tmp_path / name, REPOSITORY, ["models"], 1)
    runs = json.loads((tmp_path / "before" / "models.json").read_text())
    assert {run["exit"] for run in runs} == {0, 2}
    assert differences(tmp_path / "before", tmp_path / "after") == []
    wrong = subprocess.run([*script, "write", str(tmp_path), "--only", "no"], check=False)
    assert wrong.returncode == 2
