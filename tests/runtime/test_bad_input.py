"""Bad input at the door: one sentence on stderr, exit code 2, and no file created or changed.

Every case goes through the command line; the folder's bytes are hashed before and after.
"""

import hashlib
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime import Recording, load, write_recording
from runtime.excitation import Design, Trajectory
from runtime.library import Library
from runtime.trajectory_file import write_trajectory
from tests.runtime.conftest import Command

Words = tuple[object, ...]


@dataclass(frozen=True, slots=True)
class Desk:
    """A folder with a good log (`good.csv`, `good.npz`) and a good trajectory, and their robot."""

    folder: Path
    log: Recording
    lib: Library
    pendulum: Library

    def put(self, name: str, content: str | bytes) -> str:
        data = content.encode() if isinstance(content, str) else content
        (self.folder / name).write_bytes(data)
        return name

    def changed(self, **changes: Any) -> str:
        """A log that differs from the good one in some signals."""
        write_recording(self.log.replace(**changes), self.folder / "bad.csv")
        return "bad.csv"

    def rows(self, rows: slice) -> str:
        write_recording(self.log.take(rows, "cut"), self.folder / "bad.csv")
        return "bad.csv"

    def lines(self) -> list[str]:
        return (self.folder / "good.csv").read_text().splitlines()

    def identify(self, log: str, *words: object) -> Words:
        return ("identify", log, "--robot", self.lib.folder, "--out", "out", *words)

    def simulate(self, *words: object, robot: Library | None = None) -> Words:
        chosen = (robot or self.lib).folder
        motion = ("--trajectory", "good.json", "--out", "s.csv", "--ideal")
        return ("simulate", "--robot", chosen, *motion, *words)

    def excite(self, *words: object) -> Words:
        return ("excite", "--robot", self.lib.folder, "--starts", "1", "--out", "e.json", *words)

    def robot(self, damage: Callable[[Path], object]) -> Words:
        """identify with a copy of the robot's folder that was damaged."""
        copy = Path(shutil.copytree(self.lib.folder, self.folder / "robot"))
        damage(copy)
        return ("identify", "good.csv", "--robot", "./robot", "--out", "out")

    def trajectory(self, **changes: Any) -> Words:
        """simulate with a trajectory file that was changed."""
        path = self.folder / "good.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | changes))
        return self.simulate()


@pytest.fixture
def desk(
    lib: Library,
    noisy: Recording,
    trajectories: tuple[Trajectory, ...],
    tiny_built: Path,
    tmp_path: Path,
) -> Desk:
    log = noisy.take(slice(0, 400), "short")
    write_recording(log, tmp_path / "good.csv")
    write_recording(log, tmp_path / "good.npz")
    write_trajectory(Design(trajectories[0], 4.9, (4.9,), {}, ()), lib, tmp_path / "good.json")
    (tmp_path / "file").write_text("in the way")
    return Desk(tmp_path, log, lib, load(tiny_built))


def digests(folder: Path) -> dict[str, str]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def forge(folder: Path, library: Path) -> None:
    """Another robot's library under this robot's name, with its checksum put right."""
    shutil.copy(library, folder / "libfr3.so")
    record = json.loads((folder / "build.json").read_text())
    record["sha256"] = hashlib.sha256(library.read_bytes()).hexdigest()
    (folder / "build.json").write_text(json.dumps(record))


def foreign(desk: Desk) -> Path:
    return desk.pendulum.folder / "libtiny.so"


def truncate(path: Path, share: float = 0.5) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def pickled(desk: Desk) -> str:
    arrays = {"t": np.array([{"a": 1}], dtype=object), "q": np.zeros((3, 7))}
    np.savez(desk.folder / "bad.npz", allow_pickle=True, **arrays)
    return "bad.npz"


def six_joints(desk: Desk) -> str:
    r = desk.log
    six = Recording(r.t, *(getattr(r, key)[:, :6] for key in ("q", "dq", "ddq", "tau")))
    write_recording(six, desk.folder / "bad.csv")
    return "bad.csv"


def still(desk: Desk) -> str:
    q = np.tile(desk.lib.home, (len(desk.log), 1))
    tau = desk.lib.inverse_dynamics(q, 0 * q, 0 * q, desk.lib.pi0)
    return desk.changed(q=q, dq=0 * q, ddq=0 * q, tau=tau)


NOISE = np.random.default_rng(0).bytes(5000)
DEGREE = 180 / np.pi

Case = Callable[[Desk], Words]

# name: (what is typed, what the sentence must say)
LOGS: dict[str, tuple[Case, str]] = {
    "missing": (
        lambda d: d.identify("nothing.csv"),
        "no file or folder 'nothing.csv'; give a path",
    ),
    "empty": (lambda d: d.identify(d.put("e.csv", "")), "e.csv is empty"),
    "header only": (
        lambda d: d.identify(d.put("h.csv", d.lines()[0] + "\n")),
        "has a header but no rows",
    ),
    "NaN everywhere": (
        lambda d: d.identify(
            d.put("n.csv", "\n".join([d.lines()[0], *[",".join(["nan"] * 29)] * 50]))
        ),
        "50 of 50 rows are corrupt",
    ),
    "other joint count": (
        lambda d: d.identify(six_joints(d)),
        "has 6 joints, the robot 'fr3' has 7",
    ),
    "degrees in q": (lambda d: d.identify(d.changed(q=DEGREE * d.log.q)), "look like degrees"),
    "degrees in all": (
        lambda d: d.identify(
            d.changed(q=DEGREE * d.log.q, dq=DEGREE * d.log.dq, ddq=DEGREE * d.log.ddq)
        ),
        "its limits are .* rad; state unit",
    ),
    "ms": (lambda d: d.identify(d.changed(t=1000 * d.log.t)), "time looks like ms"),
    "ms without dq": (
        lambda d: d.identify(d.changed(t=1000 * d.log.t, dq=None, ddq=None)),
        "too low to differentiate q; if its time is in ms",
    ),
    "unsorted": (
        lambda d: d.identify(
            d.put("u.csv", "\n".join([d.lines()[0], *d.lines()[200:], *d.lines()[1:200]]))
        ),
        "time that increases, but it goes from",
    ),
    "negated torque": (lambda d: d.identify(d.changed(tau=-d.log.tau)), "set sign = -1"),
    "no torque": (lambda d: d.identify(d.changed(tau=None)), "has no torque"),
    "zero torque": (lambda d: d.identify(d.changed(tau=0 * d.log.tau)), "is 0 throughout"),
    "truncated NPZ": (
        lambda d: d.identify((truncate(d.folder / "good.npz"), "good.npz")[1]),
        "truncated or no NPZ",
    ),
    "pickled NPZ": (lambda d: d.identify(pickled(d)), "pickled Python objects"),
    "noise as CSV": (lambda d: d.identify(d.put("x.csv", NOISE)), "expected to be UTF-8 text"),
    "noise as NPZ": (lambda d: d.identify(d.put("x.npz", NOISE)), "expected to be an NPZ"),
    "unknown suffix": (lambda d: d.identify(d.put("x.mat", NOISE)), "ends in .npz"),
    "five rows": (lambda d: d.identify(d.rows(slice(0, 5))), "equations for 43 unknowns"),
    "five rows, pc-ols": (
        lambda d: d.identify(d.rows(slice(0, 5)), "--method", "pc-ols"),
        "record for longer",
    ),
    "one row": (lambda d: d.identify(d.rows(slice(0, 1))), "no sample is left"),
    "constant joints, ols": (lambda d: d.identify(still(d), "--method", "ols"), "excites 5 of 43"),
}
OPTIONS: dict[str, tuple[Case, str]] = {
    "unknown recipe": (
        lambda d: d.identify("good.csv", "--recipe", "nope"),
        "no recipe 'nope'; give the path of a TOML file or one of",
    ),
    "unknown key": (
        lambda d: d.identify("good.csv", "--recipe", d.put("r.toml", "[preparation]\ncutof = 3\n")),
        "unknown key 'cutof'; did you mean 'cutoff_hz'",
    ),
    "unknown method": (
        lambda d: d.identify("good.csv", "--method", "magic"),
        "no method 'magic'; choose one of map",
    ),
    "unknown preset": (
        lambda d: d.identify("good.csv", "--preset", "magic"),
        "no preset 'magic'; choose one of simulation",
    ),
    "unknown friction": (
        lambda d: d.identify("good.csv", "--friction", "viscous,magic"),
        "no friction column 'magic'; choose from viscous",
    ),
    "friction twice": (
        lambda d: d.identify("good.csv", "--friction", "viscous,viscous"),
        "name one twice",
    ),
    "split of words": (lambda d: d.identify("good.csv", "--split", "a,b"), "needs 2 numbers"),
    "split of one": (lambda d: d.identify("good.csv", "--split", "0.5"), "needs 2 numbers"),
    "split backwards": (lambda d: d.identify("good.csv", "--split", "0.6,0.5"), "0 < A < B < 1"),
    "split of NaN": (lambda d: d.identify("good.csv", "--split", "nan,nan"), "0 < A < B < 1"),
    "empty split": (lambda d: d.identify("good.csv", "--split", "0.5,0.5001"), "no sample is left"),
    "negative rate": (lambda d: d.identify("good.csv", "--rate", "-5"), "a number above 0, got -5"),
    "rate above": (lambda d: d.identify("good.csv", "--rate", "1000"), "100 Hz or less"),
    "cut-off above": (lambda d: d.identify("good.csv", "--cutoff", "60"), "half the rate"),
    "no coulomb speed": (
        lambda d: d.identify("good.csv", "--friction", "coulomb", "--coulomb-speed", "0"),
        "coulomb_speed expects a number above 0",
    ),
    "file in the way": (
        lambda d: ("identify", "good.csv", "--robot", d.lib.folder, "--out", "file"),
        "cannot write 'file/",
    ),
    "file on the way": (
        lambda d: ("identify", "good.csv", "--robot", d.lib.folder, "--out", "file/x"),
        "cannot write 'file/x/",
    ),
}
ROBOTS: dict[str, tuple[Case, str]] = {
    "unknown": (
        lambda _: ("identify", "good.csv", "--robot", "nope", "--out", "out"),
        "no generated robot is called 'nope' .* python -m symgen build",
    ),
    "folder without one": (
        lambda _: ("identify", "good.csv", "--robot", ".", "--out", "out"),
        "holds no manifest.json; run: python -m symgen build",
    ),
    "not compiled, and nothing to compile": (
        lambda d: d.robot(
            lambda f: [(f / name).unlink() for name in ("libfr3.so", "compile.json")]
        ),
        "neither a compiled library nor a compile.json",
    ),
    "truncated": (lambda d: d.robot(lambda f: truncate(f / "libfr3.so")), "is damaged"),
    "of another robot": (
        lambda d: d.robot(lambda f: shutil.copy(foreign(d), f / "libfr3.so")),
        "is damaged or not the one built here",
    ),
    "of another robot, forged": (
        lambda d: d.robot(lambda f: forge(f, foreign(d))),
        "cannot be used here .* python -m symgen build",
    ),
    "stale manifest": (
        lambda d: d.robot(lambda f: edit(f / "manifest.json", '"home"', ' "home"')),
        "older than its manifest.json",
    ),
    "manifest cut short": (
        lambda d: d.robot(lambda f: truncate(f / "manifest.json")),
        r"is damaged \(not JSON\)",
    ),
    "manifest of another kind": (
        lambda d: d.robot(lambda f: (f / "manifest.json").write_text("[]")),
        "manifest.json' is damaged",
    ),
    "no build record": (
        lambda d: d.robot(lambda f: (f / "build.json").unlink()),
        "has no valid build.json",
    ),
}
OTHERS: dict[str, tuple[Case, str]] = {
    "evaluate nothing": (
        lambda d: ("evaluate", ".", "good.csv", "--robot", d.lib.folder),
        "holds no valid result.json",
    ),
    "report nothing": (lambda _: ("report", "."), "cannot read 'result.json'"),
    "excite for 0 s": (lambda d: d.excite("--duration", "0"), "positive duration"),
    "excite for NaN s": (lambda d: d.excite("--duration", "nan"), "positive duration"),
    "excite for a year": (lambda d: d.excite("--duration", "3e7"), "positive duration"),
    "excite at 0 Hz": (lambda d: d.excite("--rate", "0"), "positive duration and sampling rate"),
    "excite at -10 Hz": (lambda d: d.excite("--rate", "-10"), "sampling rate .* got 10 s and -10"),
    "excite without harmonics": (lambda d: d.excite("--harmonics", "0"), "at least one harmonic"),
    "excite without starts": (lambda d: d.excite("--starts", "0"), "and one start"),
    "excite into a CSV": (lambda d: d.excite("--out", "e.csv"), "ends in .json"),
    "excite into a file": (
        lambda d: d.excite("--harmonics", "2", "--out", "file/e.json"),
        "cannot write 'file/e.json'",
    ),
    "simulate at -5 Hz": (lambda d: d.simulate("--rate", "-5"), "positive .* sampling rate"),
    "simulate at 0 Hz": (lambda d: d.simulate("--rate", "0"), "positive .* sampling rate"),
    "simulate negative noise": (lambda d: d.simulate("--torque-noise", "-1"), "noise cannot be -1"),
    "simulate negative friction": (lambda d: d.simulate("--viscous", "-1"), "viscous cannot be -1"),
    "simulate NaN": (lambda d: d.simulate("--perturb", "nan"), "lower the perturbation"),
    "simulate into .mat": (lambda d: d.simulate("--out", "s.mat"), "ends in .csv, .npz, .parquet"),
    "simulate into a file": (
        lambda d: d.simulate("--out", "file/s.csv"),
        "cannot write 'file/s.csv'",
    ),
    "trajectory missing": (
        lambda d: d.simulate("--trajectory", "nope.json"),
        "is no trajectory .* python -m runtime excite",
    ),
    "trajectory of another robot": (
        lambda d: d.simulate(robot=d.pendulum),
        "belongs to another robot than 'tiny'",
    ),
    "trajectory for ever": (lambda d: d.trajectory(duration=float("inf")), "not finite"),
    "trajectory too long": (lambda d: d.trajectory(duration=1e9), "fewer than 10,000,000 samples"),
}


CASES = [
    pytest.param(case, match, id=f"{room}: {name}")
    for room, table in {"log": LOGS, "option": OPTIONS, "robot": ROBOTS, "other": OTHERS}.items()
    for name, (case, match) in table.items()
]


@pytest.mark.parametrize(("case", "match"), CASES)
def test_one_sentence_and_no_file(desk: Desk, command: Command, case: Case, match: str) -> None:
    """Property: expected, came, what to do; and nothing on the disk has changed."""
    words = case(desk)
    before = digests(desk.folder)
    ran = command(*words)
    assert ran.code == 2, ran
    assert digests(desk.folder) == before
    assert ran.err.startswith("runtime: ")
    assert len(ran.err.splitlines()) == 1
    assert "Traceback" not in ran.err + ran.out
    assert re.search(match, ran.err), ran.err


@pytest.mark.parametrize("words", [("--seed", "-1"), ("--seed", "x"), ("--nonsense", "1")])
@pytest.mark.parametrize("name", ["identify", "excite", "simulate"])
def test_bad_usage(desk: Desk, command: Command, name: str, words: tuple[str, ...]) -> None:
    """Property: what the parser of options refuses ends with 2, a reason and no file."""
    before = digests(desk.folder)
    log = ("good.csv",) if name == "identify" else ()
    ran = command(name, *log, "--robot", desk.lib.folder, *words)
    assert ran.code == 2
    assert words[0] in ran.err
    assert "Traceback" not in ran.err
    assert digests(desk.folder) == before


@pytest.fixture
def result(desk: Desk, command: Command) -> Path:
    """A good result of the good log."""
    assert command(*desk.identify("good.csv")).code == 0
    return desk.folder / "out"


def test_a_result_of_another_robot(desk: Desk, command: Command, result: Path) -> None:
    """Property: evaluate holds the joints of the result against those of the robot."""
    before = digests(desk.folder)
    ran = command("evaluate", result, "good.csv", "--robot", desk.pendulum.folder)
    assert (ran.code, len(ran.err.splitlines())) == (2, 1)
    assert "identified fr3, whose joints differ from those of 'tiny'" in ran.err
    assert digests(desk.folder) == before


@pytest.mark.parametrize(
    ("damage", "match"),
    [
        (truncate, "no valid result.json"),
        (lambda path: path.write_text("[]"), "no valid result.json"),
        (lambda path: edit(path, '"pi": [', '"pi": ["x", '), "no valid result.json"),
        (lambda path: edit(path, '"pi": [', '"pi": [1.0, '), "no valid result.json"),
    ],
    ids=["cut short", "a list", "words for numbers", "too many numbers"],
)
def test_a_damaged_result(
    desk: Desk, command: Command, result: Path, damage: Callable[[Path], object], match: str
) -> None:
    """Property: evaluate reads nothing but what identify wrote."""
    damage(result / "result.json")
    before = digests(desk.folder)
    ran = command("evaluate", result, "good.csv", "--robot", desk.lib.folder)
    assert (ran.code, len(ran.err.splitlines())) == (2, 1), ran
    assert match in ran.err
    assert digests(desk.folder) == before


def test_a_failure_leaves_the_older_result(desk: Desk, command: Command, result: Path) -> None:
    """Property: a bad log on top of a good result changes no byte of it."""
    bad = desk.changed(tau=-desk.log.tau)
    before = digests(desk.folder)
    assert command(*desk.identify(bad)).code == 2
    assert digests(desk.folder) == before
    assert (result / "result.json").exists()
