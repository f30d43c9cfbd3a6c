"""Bad input at the door: one sentence on stderr, exit code 2, and no file created or changed.

Every case goes through the command line; the folder's bytes are hashed before and after.
"""

import hashlib
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording, write_recording
from tests.runtime.conftest import Command
from tests.runtime.desk import Desk, Words, digests, edit, truncate


def forge(folder: Path, library: Path) -> None:
    """Another robot's library under this robot's name, with its checksum put right."""
    shutil.copy(library, folder / "libfr3.so")
    record = json.loads((folder / "build.json").read_text())
    record["sha256"] = hashlib.sha256(library.read_bytes()).hexdigest()
    (folder / "build.json").write_text(json.dumps(record))


def foreign(desk: Desk) -> Path:
    return desk.pendulum.folder / "libtiny.so"


def pickled(desk: Desk) -> str:
    arrays = {"t": np.array([{"a": 1}], dtype=object), "q": np.zeros((3, 7))}
    np.savez(desk.folder / "bad.npz", allow_pickle=True, **arrays)
    return "bad.npz"


def six_joints(desk: Desk) -> str:
    r = desk.log
    six = Recording(r.t, *(getattr(r, key)[:, :6] for key in ("q", "dq", "ddq", "tau")))
    write_recording(six, desk.folder / "bad.csv")
    return "bad.csv"


def still(desk: Desk, noise: float = 0.0) -> str:
    """A log without motion; its torque has noise [N·m]."""
    q = np.tile(desk.lib.home, (len(desk.log), 1))
    tau = desk.lib.inverse_dynamics(q, 0 * q, 0 * q, desk.lib.pi0)
    tau += np.random.default_rng(0).normal(scale=noise, size=q.shape)
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
        "truncated or not an NPZ",
    ),
    "pickled NPZ": (lambda d: d.identify(pickled(d)), "pickled Python objects"),
    "noise as CSV": (lambda d: d.identify(d.put("x.csv", NOISE)), "expected to be UTF-8 text"),
    "noise as NPZ": (lambda d: d.identify(d.put("x.npz", NOISE)), "expected to be an NPZ"),
    "unknown suffix": (lambda d: d.identify(d.put("x.foo", NOISE)), "ends in .csv, .txt"),
    "five rows": (lambda d: d.identify(d.rows(slice(0, 5))), "equations for 43 unknowns"),
    "five rows, pc-ols": (
        lambda d: d.identify(d.rows(slice(0, 5)), "--method", "pc-ols"),
        "record for longer",
    ),
    "one row": (lambda d: d.identify(d.rows(slice(0, 1))), "no sample is left"),
    "constant joints, ols": (
        lambda d: d.identify(still(d), "--method", "ols", "--friction", "none"),
        "excites 5 of 43 columns",
    ),
    "constant joints, ols with offsets": (
        lambda d: d.identify(still(d), "--method", "ols", "--friction", "offset"),
        "excites 7 of 50 columns",
    ),
    # Without noise, rounding decides which of these two friction models is chosen.
    "constant joints with noise, ols": (
        lambda d: d.identify(still(d, 0.05), "--method", "ols"),
        "excites 5 of 43 columns",
    ),
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
        lambda d: d.identify("good.csv", "--settings", "preset=magic"),
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
    "split of words": (
        lambda d: d.identify("good.csv", "--settings", "split=a,b"),
        "needs 2 numbers",
    ),
    "split of three": (
        lambda d: d.identify("good.csv", "--settings", "split=0.5,0.6,0.7"),
        "needs 2 numbers",
    ),
    "split beyond the end": (
        lambda d: d.identify("good.csv", "--settings", "split=1.5"),
        "0 < A < B < 1",
    ),
    "split backwards": (
        lambda d: d.identify("good.csv", "--settings", "split=0.6,0.5"),
        "0 < A < B < 1",
    ),
    "split of NaN": (
        lambda d: d.identify("good.csv", "--settings", "split=nan,nan"),
        "0 < A < B < 1",
    ),
    "empty split": (
        lambda d: d.identify("good.csv", "--settings", "split=0.5,0.5001"),
        "no sample is left",
    ),
    "negative rate": (
        lambda d: d.identify("good.csv", "--settings", "rate=-5"),
        "a number above 0, got -5",
    ),
    "rate above": (lambda d: d.identify("good.csv", "--settings", "rate=1000"), "100 Hz or less"),
    "cut-off above": (lambda d: d.identify("good.csv", "--cutoff", "60"), "half the rate"),
    "no coulomb speed": (
        lambda d: d.identify("good.csv", "--friction", "coulomb", "--settings", "coulomb_speed=0"),
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
    "file of a robot": (
        lambda _: ("identify", "good.csv", "--robot", "good.csv", "--out", "out"),
        "got the file 'good.csv'; run: python -m symgen build --urdf good.csv --name good$",
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
    "excite at 0 Hz": (
        lambda d: d.excite("--settings", "export_rate=0"),
        "positive duration and sampling rate",
    ),
    "excite at -10 Hz": (
        lambda d: d.excite("--settings", "export_rate=-10"),
        "sampling rate .* got 10 s and -10",
    ),
    "excite without harmonics": (
        lambda d: d.excite("--settings", "harmonics=0"),
        "at least one harmonic",
    ),
    "excite without starts": (lambda d: d.excite("--settings", "starts=0"), "and one start"),
    "excite into a CSV": (lambda d: d.excite("--out", "e.csv"), "ends in .json"),
    "excite into a file": (
        lambda d: d.excite("--settings", "harmonics=2", "--out", "file/e.json"),
        "cannot write 'file/e.json'",
    ),
    "simulate at -5 Hz": (
        lambda d: d.simulate("--settings", "control_rate=-5"),
        "positive .* sampling rate",
    ),
    "simulate at 0 Hz": (
        lambda d: d.simulate("--settings", "control_rate=0"),
        "positive .* sampling rate",
    ),
    "simulate negative noise": (
        lambda d: d.simulate("--settings", "torque_noise=-1"),
        "noise cannot be -1",
    ),
    "simulate negative friction": (
        lambda d: d.simulate("--settings", "viscous=-1"),
        "viscous cannot be -1",
    ),
    "simulate NaN": (lambda d: d.simulate("--settings", "perturb=nan"), "lower the perturbation"),
    "simulate into .mat": (lambda d: d.simulate("--out", "s.mat"), "ends in .csv, .npz, .parquet"),
    "simulate into a file": (
        lambda d: d.simulate("--out", "file/s.csv"),
        "cannot write 'file/s.csv'",
    ),
    "trajectory missing": (
        lambda d: d.simulate("--trajectory", "nope.json"),
        "is not a trajectory .* python -m runtime excite",
    ),
    "trajectory of another robot": (
        lambda d: d.simulate(robot=d.pendulum),
        "belongs to another robot than 'tiny'",
    ),
    "trajectory for ever": (lambda d: d.trajectory(duration=float("inf")), "not finite"),
    "trajectory too long": (lambda d: d.trajectory(duration=1e9), "beyond 3600 s"),
    "too many samples": (
        lambda d: d.simulate("--settings", "control_rate=1e9"),
        "fewer than 10,000,000 samples",
    ),
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


@pytest.mark.parametrize(
    "words", [("--settings", "seed=-1"), ("--settings", "seed=x"), ("--nonsense", "1")]
)
@pytest.mark.parametrize("name", ["identify", "excite", "simulate"])
def test_bad_usage(desk: Desk, command: Command, name: str, words: tuple[str, ...]) -> None:
    """Property: what the parser of options refuses ends with 2, a reason and no file."""
    before = digests(desk.folder)
    log = ("good.csv",) if name == "identify" else ()
    ran = command(name, *log, "--robot", desk.lib.folder, *words)
    assert ran.code == 2
    assert ("seed" if "seed" in words[1] else words[0]) in ran.err
    assert "Traceback" not in ran.err
    assert digests(desk.folder) == before
