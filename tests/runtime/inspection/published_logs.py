"""Published logs: what only the maker of the robot knows, and errors in another band."""

from collections.abc import Callable
from pathlib import Path

from runtime.common.files import json_of
from runtime.estimators.regression.samples import samples_of
from runtime.identification import metrics
from runtime.identification.saved_result import read_result
from runtime.library import Library
from runtime.recording import Preparation, read_recording
from runtime.recording.preprocessing import prepare

KNOWN_RATE = "rate_hz = 5000"
KNOWN_ZEROS = "offset = [0.0, -1.5707963267948966, 1.5707963267948966, 0.0, 0.0, 0.0]"
KNOWN_UNIT = ('unit = "A"', 'unit = "N*m"')  # of curr_data.csv, whose name says otherwise
KNOWN_GEARS = """[gear]
matrix = [
    [32.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 32.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 45.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, -48.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 45.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 32.0, 32.0],
]
"""
ALONE = ("--settings", "refit=false")
"""Parameters of the training part: the rows of the test would flatter the error in another band."""
Run = Callable[..., object]
"""Runs a command of `symgen` by its words."""


def panda(run: Run, lib: Library, raw: Path, root: Path, *more: object) -> tuple[float, float]:
    """Errors on the last 40 % of a Panda: in the band that is proposed, and at 10 Hz [%]."""
    recipe, out = root / "panda.toml", root / f"panda{len(more)}"
    if not recipe.exists():
        run("inspect", raw, "--robot", lib.folder, "--recipe-out", recipe)
    words = ("--recipe", recipe, "--overwrite", *more, *ALONE)
    run("identify", raw, "--robot", lib.folder, *words, "--out", out)
    return overall(out), in_band(out, raw, recipe, lib, 10.0, (12.6, 20.9))


def tx40(run: Run, lib: Library, raw: Path, root: Path) -> tuple[float, float]:
    """Errors on 4.6 to 7.4 s of a TX40 with what its maker knows: proposed band, 20 Hz [%]."""
    first, known, recipe = (root / f"tx40-{name}.toml" for name in ("first", "known", "last"))
    robot, out = ("--robot", lib.folder), root / "tx40"
    run("inspect", raw, *robot, "--recipe-out", first)
    text = first.read_text(encoding="utf-8").replace("# rate_hz =", KNOWN_RATE).replace(*KNOWN_UNIT)
    text = text.replace("\n[position]\n", f"\n[position]\n{KNOWN_ZEROS}\n")
    known.write_text(text[: text.index("# [gear]")] + KNOWN_GEARS, encoding="utf-8")
    run("inspect", raw, *robot, "--recipe", known, "--recipe-out", recipe)
    words = ("--recipe", recipe, "--split", "0.582,0.5952", *ALONE)
    run("identify", raw, *robot, *words, "--out", out)
    return overall(out), in_band(out, raw, recipe, lib, 20.0, (4.6, 7.4))


def lwr4(run: Run, lib: Library, raw: Path, root: Path) -> tuple[float, float]:
    """Errors on run 3 of an LWR 4+ by runs 1 and 2, and by the URDF with their friction [%]."""
    recipe, robot, out = root / "lwr4.toml", ("--robot", lib.folder), root / "lwr4"
    run("inspect", raw, *robot, "--recipe-out", recipe)
    run("identify", raw, *robot, "--recipe", recipe, "--run", "1,2,3", "--out", out)
    left_out = json_of(out / "result.json")["sessions"]["leave_one_out"][2]
    return left_out["after_overall"], left_out["before_overall"]


def overall(folder: Path) -> float:
    """Error of a result on its test part [%]."""
    return float(json_of(folder / "result.json")["torque_error_percent"]["after_overall"])


def in_band(
    folder: Path, log: Path, recipe: Path, lib: Library, f_c: float, span: tuple[float, float]
) -> float:
    """Overall error of a result on the rows of a span of time, low-passed at another cut-off.

    Args:
        folder: of the result.
        log: its log.
        recipe: that reads the log.
        lib: library of the robot.
        f_c: cut-off [Hz].
        span: from, to [s].

    Returns:
        The error [%].
    """
    saved, recording = read_result(folder), read_recording(log, recipe)
    single = recording.preparation
    plan = Preparation(
        clock_tick=single.clock_tick,
        max_gap_s=single.max_gap_s,
        filter="butterworth",
        cutoff_hz=f_c,
        rate_hz=10 * f_c,
        rest_speed=0.02,
    )
    rows = prepare(recording, plan, saved.friction, lib=lib)
    rows = rows.take((rows.t >= span[0]) & (rows.t <= span[1]), "test")
    s = samples_of(rows, lib)
    rigid = lib.inverse_dynamics(s.q, s.dq, s.ddq, saved.pi)
    return float(metrics.torque_error(s.tau, rigid + s.friction(saved.phi)).overall)
