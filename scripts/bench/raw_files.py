"""Published logs from their bare files to a model, by the commands that a user types."""

import json
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

from bench.front import Sheet
from bench.real_logs import bare, library_of
from tests.runtime.inspection.published_logs import KNOWN_GEARS, KNOWN_RATE, KNOWN_ZEROS, in_band

ALONE = ("--no-refit",)
"""Parameters of the training part: the rows of the test would flatter the error in another band."""


@dataclass(frozen=True, slots=True)
class Row:
    """Errors of one log in percent of its torque."""

    log: str  # the log and what was added by hand
    tested: str  # rows of the test
    band_hz: float  # cut-off that `inspect` proposed
    error: str  # in this band
    published_band: str  # cut-off of the publication and the error in it, as text
    published: str  # error of the publication


def study(shared: Path, root: Path, builds: Path) -> list[Row]:
    """Run the commands on the three logs."""
    return [each(shared, root, builds) for each in (_panda, _tx40, _lwr4)]


def _panda(shared: Path, root: Path, builds: Path) -> Row:
    lib, raw = library_of("fr3", shared, builds), bare(shared / "data/panda_gaz", root / "panda")
    recipe = root / "panda.toml"
    _run("inspect", raw, "--robot", lib.folder, "--recipe-out", recipe)
    errors, wide = [], []
    for name, words in (("panda-default", ()), ("panda-auto", ("--friction", "auto"))):
        out = root / name
        _run(
            "identify", raw, "--robot", lib.folder, "--recipe", recipe, *words, *ALONE, "--out", out
        )
        errors.append(_overall(out))
        wide.append(in_band(out, raw, recipe, lib, 10.0, (12.6, 20.9)))
    return Row(
        "Panda, `panda_gaz`",
        "last 40 %",
        _band(recipe),
        f"{errors[0]:.2f} %, with `--friction auto` {errors[1]:.2f} %",
        f"10 Hz: {wide[0]:.2f} %, with `--friction auto` {wide[1]:.2f} %",
        "1.32 %",
    )


def _tx40(shared: Path, root: Path, builds: Path) -> Row:
    lib, raw = library_of("tx40", shared, builds), bare(shared / "data/tx40_figaroh", root / "tx40")
    first, known, recipe = (root / f"tx40-{name}.toml" for name in ("first", "known", "last"))
    _run("inspect", raw, "--robot", lib.folder, "--recipe-out", first)
    text = first.read_text(encoding="utf-8").replace("# rate_hz =", KNOWN_RATE)
    text = text.replace("\n[position]\n", f"\n[position]\n{KNOWN_ZEROS}\n")
    text = text[: text.index("# [gear]")] + KNOWN_GEARS
    known.write_text(text, encoding="utf-8")
    _run("inspect", raw, "--robot", lib.folder, "--recipe", known, "--recipe-out", recipe)
    out, robot = root / "tx40-result", ("--robot", lib.folder)
    split = ("--split", "0.582,0.5952")
    _run("identify", raw, *robot, "--recipe", recipe, "--out", out, *split, *ALONE)
    wide = in_band(out, raw, recipe, lib, 20.0, (4.6, 7.4))
    return Row(
        "TX40, `tx40_figaroh`, with gear matrix, zero offsets and rate from its maker",
        "4.6–7.4 s",
        _band(recipe),
        f"{_overall(out):.1f} %",
        f"20 Hz: {wide:.1f} %",
        "7.3 %",
    )


def _lwr4(shared: Path, root: Path, builds: Path) -> Row:
    lib = library_of("kuka_lwr4", shared, builds)
    raw, recipe = bare(shared / "data/lwr4_flobaroid", root / "lwr4"), root / "lwr4.toml"
    out, robot = root / "lwr4-result", ("--robot", lib.folder)
    _run("inspect", raw, *robot, "--recipe-out", recipe)
    _run("identify", raw, *robot, "--recipe", recipe, "--run", "1,2,3", "--out", out)
    left_out = _facts(out)["sessions"]["leave_one_out"][2]
    after, before = left_out["after_overall"], left_out["before_overall"]
    return Row(
        "LWR 4+, `lwr4_flobaroid`",
        "run 3, trained on runs 1 and 2",
        _band(recipe),
        f"{after:.1f} % (URDF {before:.1f} %)",
        "",
        "8.8 %",
    )


def _run(*words: object) -> None:
    """Run a command; findings end `inspect` with 1, which is no failure."""
    command = [sys.executable, "-m", "runtime", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode > 1:
        raise RuntimeError(f"{' '.join(command)} failed: {done.stderr}")


def _facts(folder: Path) -> dict:
    return dict(json.loads((folder / "result.json").read_text(encoding="utf-8")))


def _overall(folder: Path) -> float:
    return float(_facts(folder)["torque_error_percent"]["after_overall"])


def _band(recipe: Path) -> float:
    """Cut-off of a recipe [Hz]."""
    return float(tomllib.loads(recipe.read_text(encoding="utf-8"))["preparation"]["cutoff_hz"])


def sheet(rows: list[Row]) -> Sheet:
    """One line per log."""
    head = ("log", "tested on", "proposed band", "error in it", "error in the published band")
    lines = [
        (r.log, r.tested, f"{r.band_hz:g} Hz", r.error, r.published_band, r.published) for r in rows
    ]
    return Sheet("raw_files", (*head, "published"), lines, rows)
