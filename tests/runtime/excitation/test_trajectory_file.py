"""trajectory: a trajectory survives the disk, and only its own robot takes it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime import load
from runtime.errors import RecordingError, RuntimeFault
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import read_trajectory
from runtime.excitation.search.design import Design, write_trajectory
from runtime.library import Library


@pytest.fixture
def written(lib: Library, trajectories: tuple[Trajectory, ...], tmp_path: Path) -> Path:
    path = tmp_path / "new" / "t.json"
    write_trajectory(Design(trajectories[0], 4.88, (4.88, 5.0), {"velocity": 1.0}, ()), lib, path)
    return path


def test_round_trip_is_exact(
    lib: Library, trajectories: tuple[Trajectory, ...], written: Path
) -> None:
    """Property: every bit of home, coefficients and duration comes back; no draft is left."""
    read = read_trajectory(written, lib)
    assert np.array_equal(read.coefficients, trajectories[0].coefficients)
    assert np.array_equal(read.home, lib.home)
    assert read.duration == trajectories[0].duration
    assert [path.name for path in written.parent.iterdir()] == ["t.json"]
    facts = json.loads(written.read_text())
    assert (facts["robot"], facts["condition_number"]) == ("fr3", 4.88)


def test_the_basis_it_names_is_the_basis(lib: Library, written: Path) -> None:
    """Oracle: the formula in the file, evaluated as it stands, gives the motion."""
    facts = json.loads(written.read_text())
    formula = "cos 2 pi m s - 1 + 2 pi^2 m^2 s^2 (1-s)^2), s = t/t_f"
    assert facts["basis"] == f"q = home + sum_m a_m ({formula}"
    t = np.linspace(0, 10, 33)
    m, s = np.arange(1, 6), t[:, None] / facts["duration"]
    basis = np.cos(2 * np.pi * m * s) - 1 + 2 * np.pi**2 * m**2 * s**2 * (1 - s) ** 2
    q = basis @ np.array(facts["coefficients"]).T + facts["home"]
    # Rounding of coefficients of 70 that cancel.
    assert read_trajectory(written, lib).at(lib, t)[0] == pytest.approx(q, abs=1e-12)


def drop(key: str) -> Callable[[dict[str, Any]], object]:
    return lambda facts: facts.pop(key)


def put(key: str, value: Any) -> Callable[[dict[str, Any]], object]:
    return lambda facts: facts.update({key: value})


@pytest.mark.parametrize(
    ("damage", "match"),
    [
        (drop("home"), "is not a trajectory"),
        (drop("joints"), "is not a trajectory"),
        (put("duration", "ten"), "is not a trajectory"),
        (put("coefficients", [[1.0], [1.0, 2.0]]), "is not a trajectory"),
        (put("coefficients", [[1.0]] * 6), "another robot"),
        (put("coefficients", [[]] * 7), "another robot"),
        (put("coefficients", [1.0] * 7), "another robot"),
        (put("home", [0.0] * 6), "another robot"),
        (put("joints", list("abcdefg")), "another robot"),
        (put("home", [float("nan")] * 7), "not finite"),
        (put("coefficients", [[float("inf")]] * 7), "not finite"),
        (put("duration", float("inf")), "not finite"),
        (put("duration", 0.0), "not finite, or a duration that is not positive"),
    ],
)
def test_damaged_files_are_reported(
    lib: Library, written: Path, damage: Callable[[dict[str, Any]], object], match: str
) -> None:
    """Property: whatever is wrong inside, one sentence names the file."""
    facts = json.loads(written.read_text())
    damage(facts)
    written.write_text(json.dumps(facts))
    with pytest.raises(RecordingError, match=match) as caught:
        read_trajectory(written, lib)
    assert str(written) in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"[1, 2]", b"{", b"\xff\xfe\x00", b'"x"'])
def test_files_that_are_no_trajectory(lib: Library, tmp_path: Path, content: bytes) -> None:
    """Property: no bytes crash the reader; the sentence says how to make a trajectory."""
    path = tmp_path / "x.json"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="python -m runtime excite"):
        read_trajectory(path, lib)
    with pytest.raises(RecordingError, match="is not a trajectory"):
        read_trajectory(tmp_path / "nothing.json", lib)


def test_another_robot_refuses_it(written: Path, tiny_built: Path) -> None:
    """Property: the joints in the file must be those of the robot."""
    with pytest.raises(RecordingError, match="another robot than 'tiny'"):
        read_trajectory(written, load(tiny_built))


def test_a_place_that_cannot_be_written(
    lib: Library, trajectories: tuple[Trajectory, ...], tmp_path: Path
) -> None:
    """Property: a file in the way is told and stays what it was."""
    (tmp_path / "file").write_text("mine")
    result = Design(trajectories[0], 4.88, (4.88,), {}, ())
    with pytest.raises(RuntimeFault, match="cannot write"):
        write_trajectory(result, lib, tmp_path / "file" / "t.json")
    assert (tmp_path / "file").read_text() == "mine"
