"""Faults planted into published logs of real robots, at every joint, and what `inspect` says.

The logs are thinned, so that the table takes some minutes. A fault counts as named where a warning
of its kind has its joints, as stated where the log is said not to show it, and as wrong where a
warning is there that the unchanged log does not have. A delay counts as named where its stated
interval, with that of the unchanged log, contains it. The commanded torques of control laws are
taken as measured ones.
"""

import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.front import Sheet
from bench.real_logs import Row, inspected, library_of, loud
from runtime.inspection import Finding
from runtime.library import Array, Library
from runtime.recording import read_recording

Arrays = dict[str, Array]
LOGS = (
    ("Panda", "fr3", "panda_gaz", 5),
    ("TX40", "tx40", "tx40_figaroh", 20),
    ("LWR 4+", "kuka_lwr4", "lwr4_flobaroid", 1),
    ("Z1", "unitree_z1", "unitree_air/z1.npz", 1),
    ("Go2", "go2", "unitree_air/go2.npz", 1),
)
"""Robot of the table, key of `library_of`, place below data/, and step of the rows."""
LATE_S, GAIN = (0.0, 0.01, 0.03, 0.1), 2.5
DELAY = "delay"
NAMED, STATED, SILENT, WRONG = "named", "stated", "silent", "wrong"
UNCHANGED = "unchanged"
SIDES, MOVES = ("tau",), ("q", "dq")
OF_JOINT = (
    ("torque 0", ("constant_torque",), SIDES, 0.0),
    ("torque negated", ("torque_sign",), SIDES, -1.0),
    ("motion negated", ("position_sign",), MOVES, -1.0),
    (f"gain × {GAIN}", ("torque_gain", "torque_unit"), SIDES, GAIN),
)
OF_PAIR = (
    ("torques exchanged", ("torque_order",), SIDES),
    ("motions exchanged", ("position_order", "joint_order"), MOVES),
)
"""Name, kinds of the findings that name it, signals and their factor."""


@dataclass(frozen=True, slots=True)
class Plant:
    """One fault of one log."""

    name: str
    kinds: tuple[str, ...]  # of the findings that name it
    joints: tuple[int, ...]  # that it must state; none of a fault of all
    arrays: Arrays
    late: float | None = None  # delay of the torque [s]


def study(shared: Path, builds: Path | None, only: str | None = None) -> Iterator[Row]:
    """Inspect the unchanged logs, then every fault."""
    with tempfile.TemporaryDirectory() as scratch:
        root = builds or Path(scratch)
        for name, robot, place, step in LOGS:
            if only not in {None, name}:
                continue
            lib = library_of(robot, shared, root)
            arrays = arrays_of(shared / "data" / place, step)
            usual = inspected(arrays, lib)
            yield Row(name, tuple(f.kind for f in loud(usual)), UNCHANGED, SILENT)
            for plant in plants(arrays, lib):
                yield _row(name, plant, usual, inspected(plant.arrays, lib), lib)


def arrays_of(place: Path, step: int) -> Arrays:
    """Signals of a published set as its recipe reads them; τ of a control law as a measured one."""
    recipe = None if place.suffix else place.name
    log = read_recording(place, recipe, run="1" if place.name.startswith("lwr4") else None)
    parts = {"t": log.t, "q": log.q, "dq": log.dq, "tau": log.tau}
    return {key: part[::step] for key, part in parts.items() if part is not None}


def plants(log: Arrays, lib: Library) -> Iterator[Plant]:
    """All faults of one log; wrong joints are neighbours."""
    n = lib.n_joints

    def changed(keys: tuple[str, ...], change: Callable[[Array], Array]) -> Arrays:
        return log | {key: change(log[key]) for key in keys if key in log}

    for j in range(n):
        for name, kinds, keys, factor in OF_JOINT:
            factors = np.where(np.arange(n) == j, factor, 1.0)
            yield Plant(name, kinds, (j,), changed(keys, lambda x, f=factors: x * f))
    for j in range(n - 1):
        order = np.arange(n)
        order[[j, j + 1]] = j + 1, j
        for name, kinds, keys in OF_PAIR:
            moved = changed(keys, lambda x, o=order: x[..., o])
            yield Plant(name, kinds, (j, j + 1), moved)
    yield Plant("every torque negated", ("torque_sign",), (), changed(SIDES, lambda x: -x))
    yield Plant("torque in mN·m", ("torque_unit",), (), changed(SIDES, lambda x: 1e3 * x))
    yield Plant("degrees", ("position_unit",), (), changed(MOVES, np.degrees))
    still = np.zeros_like(log["q"])
    falls = lib.inverse_dynamics(log["q"], still, still, lib.pi0)
    yield Plant("gravity reversed", ("gravity",), (), changed(SIDES, lambda x: x - 2 * falls))
    for late in LATE_S:
        shifted = np.stack([np.interp(log["t"] - late, log["t"], x) for x in log["tau"].T], axis=1)
        yield Plant(f"{1e3 * late:.0f} ms late", ("time_shift",), (), log | {"tau": shifted}, late)


def _row(log: str, plant: Plant, usual: list[Finding], seen: list[Finding], lib: Library) -> Row:
    """Whether the fault is named, stated as hidden, not mentioned, or something else is accused."""
    before = {f.kind for f in loud(usual)}
    right = [f for f in loud(seen) if f.kind in plant.kinds or _is_rival(f, plant)]
    right = [f for f in right if all(_has(f, j, lib) for j in plant.joints)]
    kinds = [f.kind for f in loud(seen) if f.kind not in before]
    others = [kind for kind in kinds if kind not in {f.kind for f in right}]
    is_named = bool(right) if plant.late is None else _contains(plant.late, usual, seen)
    outcome = SILENT
    if is_named:
        outcome = NAMED
    elif others:
        outcome = WRONG
    elif _is_stated(plant, seen):
        outcome = STATED
    return Row(log, tuple(kinds), plant.name, outcome, plant.joints)


def _is_stated(plant: Plant, findings: list[Finding]) -> bool:
    """Whether the log is said not to show the fault."""
    if "torque_gain" in plant.kinds:
        unsure = [f for f in findings if f.kind in {"hidden_gains", "little_torque"}]
        return any(plant.joints[0] in f.evidence["joints"] for f in unsure)
    hidden = next((f.evidence for f in findings if f.kind == "hidden_faults"), None)
    if hidden is None:
        return False
    if not plant.joints:
        return plant.kinds[0] == "gravity" and "gravity" in hidden["whole"]
    return bool(
        set(plant.joints) & {*hidden["resting"], *hidden["unexplained"]}
        or (len(plant.joints) == 1 and plant.joints[0] in hidden["signs"])
        or list(plant.joints) in hidden["pairs"]
    )


def _contains(late: float, usual: list[Finding], findings: list[Finding]) -> bool:
    """Whether the stated interval, beside that of the unchanged log, contains a delay."""
    ends = [f.evidence["interval_s"] for each in (usual, findings) for f in each if f.kind == DELAY]
    if len(ends) < 2:
        return False
    first, last = ((sum(each) / 2, (each[1] - each[0]) / 2) for each in ends)
    return abs(last[0] - first[0] - late) <= float(np.hypot(first[1], last[1]))


def _is_rival(finding: Finding, plant: Plant) -> bool:
    """Whether a finding names the fault beside one that explains as much."""
    return bool(set(finding.evidence.get("rivals", ())) & set(plant.kinds))


def _has(finding: Finding, joint: int, lib: Library) -> bool:
    return lib.joint_names[joint] in finding.sentence or finding.kind == "torque_unit"


def sheet(rows: list[Row]) -> Sheet:
    """One line per fault, one column per log: joints whose fault is named, and the others."""
    logs = list(dict.fromkeys(row.log for row in rows))
    names = [name for name in dict.fromkeys(row.fault for row in rows) if name != UNCHANGED]
    lines = []
    for name in names:
        cells = [[r.outcome for r in rows if r.fault == name and r.log == log] for log in logs]
        lines.append((name, *(_cell(Counter(cell)) for cell in cells)))
    every = [Counter(r.outcome for r in rows if r.log == log and r.fault in names) for log in logs]
    lines.append(("**all**", *(f"**{_cell(each)}**" for each in every)))
    unchanged = {r.log: r.shown or "none" for r in rows if r.fault == UNCHANGED}
    lines.append(("warnings on the unchanged log", *(unchanged[log] for log in logs)))
    notes = [
        f"{r.log}, {r.fault} {r.joints}: {r.outcome} ({', '.join(r.kinds)})"
        for r in rows
        if r.outcome in {SILENT, WRONG} and r.fault in names
    ]
    return Sheet("planted_faults", ("fault", *logs), lines, rows, notes=notes)


def _cell(count: Counter) -> str:
    """Counts of the outcomes."""
    if not count:
        return ""
    others = ", ".join(f"{count[k]} {k}" for k in (STATED, SILENT, WRONG) if count[k])
    return f"{count[NAMED]} of {count.total()}" + (f" ({others})" if others else "")
