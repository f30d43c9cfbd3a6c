"""Published logs from their bare files: warnings beside the facts that they state, and models.

The facts are those of the publications, of the files that come with the logs, or of the files
themselves; a warning without a fact is counted as false. Models come by the commands of a user.
"""

import shutil
import sysconfig
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bench.front import ROOT, Sheet, python, sheet_of
from runtime.common.files import toml_of
from runtime.inspection import INFO, Finding, inspect_log
from runtime.library import Array, Library, load
from symgen.chain import ChainOptions
from symgen.chain.dh import robot_from_rows
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.robots import CASES, MORE, ONE_LEVEL
from tests.runtime.inspection import published_logs

EXAMPLES = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
RAW = {".txt", ".csv", ".npz"}
TIAGO = ("head_1_joint", "head_2_joint", "gripper_finger_joint", "gripper_right_finger_joint")
"""Joints of TIAGo that the log does not contain."""


@dataclass(frozen=True, slots=True)
class PublishedLog:
    """A log of the shared folder."""

    name: str  # for the table
    robot: str  # key of `library_of`
    place: str  # folder or file below data/
    run: str | None = None  # of a folder with several
    facts: dict[str, str] = field(default_factory=dict)  # kind of warning → true
    rate_hz: float | None = None  # rate of a log without a clock, None where it has one [Hz]


_DVRK = {
    "columns_by_content": "21 columns without header (its publication: q, dq, τ)",
    "differentiation": "at 200 Hz with encoder noise; its publication low-passes far below",
}
LOGS = (
    PublishedLog(
        "Panda",
        "fr3",
        "panda_gaz",
        facts={
            "repeated_rows": "6 % of the rows repeat the previous state, and as many ticks are "
            "missing (asynchronous logger)"
        },
    ),
    PublishedLog(
        "TX40",
        "tx40",
        "tx40_figaroh",
        facts={
            "missing_clock": "5 kHz is stated by the publication, not by the files",
            "position_range": "the files contain motor angles",
            "current_unit": "the file curr_data.csv states no unit",
        },
    ),
    PublishedLog("LWR 4+, run 1", "kuka_lwr4", "lwr4_flobaroid", "1"),
    PublishedLog(
        "LWR 4+, run 2",
        "kuka_lwr4",
        "lwr4_flobaroid",
        "2",
        facts={"jitter": "time stamps of the computer, 5 ± 0.5 ms"},
    ),
    PublishedLog("LWR 4+, run 3", "kuka_lwr4", "lwr4_flobaroid", "3"),
    PublishedLog(
        "Z1",
        "unitree_z1",
        "unitree_air/z1.npz",
        facts={
            "delay": "30 ms, found by hand too",
            "rotor": "the URDF alone leaves 94 % of the torque unexplained",
            "repeated_rows": "8 % of the rows repeat q and dq to the last bit while the arm moves",
            "velocity_constant": "the column of the gripper is 0 while its position changes",
        },
    ),
    PublishedLog(
        "Go2",
        "go2",
        "unitree_air/go2.npz",
        facts={
            "delay": "torque commanded over a bus",
            "rotor": "geared legs: others identified armature and friction from this log",
        },
    ),
    PublishedLog(
        "TIAGo",
        "tiago",
        "tiago",
        facts={
            "vendor_signal": "effort is raw motor current",
            "velocity_filtered": "the column is a first-order filter of the position, a = 0.95",
            "jitter": "time stamps of ROS, 10 ± 2 ms",
            "rest": "no joint moves before 6.8 s and after 68 s",
            "differentiation": "encoder counts differentiated twice at 100 Hz",
            "torque_sign": "currents of arm 3 and 4 count against the weight that they carry",
        },
    ),
    PublishedLog(
        "dVRK MTM",
        "mtm",
        "dvrk/mtm_one.csv",
        rate_hz=200.0,
        facts={
            **_DVRK,
            "repeated_rows": "14 % of the rows repeat the previous state while the arm moves",
            "outliers": "the torque of q6 makes its largest step, 9 times the RMS, and returns",
        },
    ),
    PublishedLog("dVRK PSM", "psm", "dvrk/psm_one_no_weight.csv", rate_hz=200.0, facts=_DVRK),
)

FURTHER = (
    PublishedLog("UR10, axis 1", "ur10", "ur_collisions/Axis_1_1.csv.gz"),
    PublishedLog("UR10, impact", "ur10", "ur_collisions/Drift00_WF_1.csv.gz"),
    PublishedLog("SO-101", "so101", "so101_sage/multisine.state_motor.csv.gz"),
)
"""Logs whose commands `scripts/fault_table --advice` runs, too."""


@dataclass(frozen=True, slots=True)
class Row:
    """Warnings and errors of one log, with or without a fault that is planted in it."""

    log: str
    kinds: tuple[str, ...]
    fault: str = ""
    outcome: str = ""  # of a planted fault
    joints: tuple[int, ...] = ()  # that it has
    facts: tuple[str, ...] = ()  # which found the kinds
    unfounded: tuple[str, ...] = ()  # kinds without a fact

    @property
    def shown(self) -> str:
        """The kinds for a table."""
        return ", ".join(f"`{kind}`" for kind in self.kinds)


def loud(findings: list[Finding]) -> list[Finding]:
    """Warnings and errors."""
    return [f for f in findings if f.level != INFO]


def inspected(arrays: Mapping[str, Array], lib: Library, *recipe: Any) -> list[Finding]:
    """Findings of a log with these signals."""
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder) / "log.npz", **arrays)
        return [*inspect_log(Path(folder) / "log.npz", lib, *recipe).findings]


def study(shared: Path, builds: Path | None) -> Iterator[Row]:
    """Inspect the bare files of every log."""
    with tempfile.TemporaryDirectory() as scratch:
        root = builds or Path(scratch)
        libraries: dict[str, Library] = {}
        for log in LOGS:
            if log.robot not in libraries:
                libraries[log.robot] = library_of(log.robot, shared, root)
            place = bare(shared / "data" / log.place, Path(scratch) / "raw")
            lib, how = libraries[log.robot], {"bare": True, "rate_hz": log.rate_hz}
            findings = inspect_log(place, lib, None, log.run, **how).findings
            kinds = tuple(dict.fromkeys(f.kind for f in loud([*findings])))
            unfounded = tuple(kind for kind in kinds if kind not in log.facts)
            facts = tuple(log.facts[kind] for kind in kinds if kind in log.facts)
            yield Row(log.name, kinds, facts=facts, unfounded=unfounded)


def bare(place: Path, folder: Path) -> Path:
    """The files of a log alone, in a folder whose name says nothing; a single file as it is."""
    if place.is_file():
        return place
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for file in place.iterdir():
        if file.suffix in RAW:
            shutil.copy(file, folder)
    return folder


def library_of(robot: str, shared: Path, root: Path) -> Library:
    """The robot of a log, built into a folder unless it is current there."""
    if robot == "fr3":
        return load("fr3")
    return load(build(_request(robot, shared), root, levels=ONE_LEVEL).folder)


def _request(robot: str, shared: Path) -> BuildRequest:
    if case := CASES.get(robot) or MORE.get(robot):
        return case.request(robot, shared / "models")
    own = {
        "go2": EXAMPLES / "go2_description/urdf/go2.urdf",
        "so101": shared / "models/so101/so101_new_calib.urdf",
    }
    if robot in own:
        return BuildRequest(robot, own[robot].read_text(encoding="utf-8"))
    if robot == "tiago":
        urdf = (shared / "data/tiago/tiago_48_schunk.urdf").read_text(encoding="utf-8")
        options = ChainOptions(base="torso_fixed_link", locks=dict.fromkeys(TIAGO, 0.0))
        return BuildRequest(robot, urdf, options, project=True)
    table = toml_of(ROOT / f"scripts/dvrk/{robot}.toml")
    text, mechanism = robot_from_rows(table, robot)
    return BuildRequest(robot, text, ChainOptions(masses={}, mechanism=mechanism))


def sheet(rows: list[Row]) -> Sheet:
    """One line per log, then the number of warnings without a fact."""
    lines = [(row.log, row.shown or "none", "; ".join(row.facts)) for row in rows]
    unfounded = [f"{row.log}: {kind}" for row in rows for kind in row.unfounded]
    lines.append(("**without a fact**", f"**{len(unfounded)}**", ""))
    head = ("log", "warnings and errors", "what is true of the log")
    return Sheet("real_logs", head, lines, rows, notes=unfounded)


RAW_COLUMNS = (
    *("log", "tested on", "proposed band", "error in it", "error in the published band"),
    "published",
)
"""Errors in percent of the torque; "log" states what was added by hand."""


def raw_study(shared: Path, root: Path, builds: Path) -> Sheet:
    """Run the commands on the three logs."""

    def known(robot: str, name: str) -> tuple[Library, Path]:
        return library_of(robot, shared, builds), bare(shared / "data" / name, root / robot)

    def band(recipe: str) -> str:
        return f"{toml_of(root / recipe)['preparation']['cutoff_hz']:g} Hz"

    panda = known("fr3", "panda_gaz")
    usual, chosen = (published_logs.panda(_run, *panda, root, *words) for words in
                     ((), ("--friction", "auto")))  # fmt: skip
    own, wide = (f"{one:.2f} %, with `--friction auto` {auto:.2f} %" for one, auto in
                 zip(usual, chosen, strict=True))  # fmt: skip
    tx40 = published_logs.tx40(_run, *known("tx40", "tx40_figaroh"), root)
    lwr4, urdf = published_logs.lwr4(_run, *known("kuka_lwr4", "lwr4_flobaroid"), root)
    by_maker = "with gear matrix, zero offsets, torque unit and rate from its maker"
    rows = [
        ("Panda, `panda_gaz`", "last 40 %", band("panda.toml"), own, f"10 Hz: {wide}", "1.32 %"),
        (f"TX40, `tx40_figaroh`, {by_maker}", "4.6–7.4 s", band("tx40-last.toml"),
         f"{tx40[0]:.1f} %", f"20 Hz: {tx40[1]:.1f} %", "7.3 %"),
        ("LWR 4+, `lwr4_flobaroid`", "run 3, trained on runs 1 and 2", band("lwr4.toml"),
         f"{lwr4:.1f} % (URDF {urdf:.1f} %)", "", "8.8 %"),
    ]  # fmt: skip
    return sheet_of("raw_files", dict.fromkeys(RAW_COLUMNS, ""), rows)


def _run(*words: object) -> None:
    """Run a command; findings end `inspect` with 1, which is no failure."""
    done = python("-m", "runtime", *words)
    if done.returncode > 1:
        raise RuntimeError(f"{' '.join(done.args)} failed: {done.stderr}")
