"""Faults in logs and what `inspect` says; defaults of `identify` beside other settings.

Robots and faults of the virtual logs are those of the tests (`tests.runtime.virtual_arms`,
`tests.runtime.faults`). The arm on a wall and the robots of the real logs are built into a
temporary folder. A setting is fitted to one log of each robot and predicts the torque of another
motion; the preparation of both is that which `inspect` proposes for the first.

Into published logs, which are thinned, so that the table takes some minutes, faults are put at
every joint. One counts as named where a warning of its kind has its joints, as stated where the log
is said not to show it, and as wrong where a warning is there that the unchanged log does not have.
A delay counts as named where its stated interval, with that of the unchanged log, contains it. The
commanded torques of control laws are taken as measured ones.
"""

import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from bench.front import Sheet
from bench.real_logs import Row, inspected, library_of, loud
from runtime.errors import RuntimeFault
from runtime.estimators.choice.default_friction import DEFAULT_COLUMNS, choose_default_friction
from runtime.estimators.choice.friction_choice import choose_friction
from runtime.estimators.regression.samples import samples_of
from runtime.identification import metrics
from runtime.identification.identified import Identification
from runtime.identification.prepared_log import usable_columns
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify_recording as fit
from runtime.inspection import Finding, inspect_log
from runtime.library import Array, Library, load
from runtime.recording import Friction, Recording, read_recording
from runtime.recording.preprocessing import prepare
from symgen.chain import ChainOptions
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.robots import ONE_LEVEL
from tests.runtime.faults import FAULTS
from tests.runtime.virtual_arms import WALL, Arm, cobot, wall_arm

CLEAN = "clean"
RIGHT, OTHER = "named", "not named"
REAL = (("panda_gaz", "fr3"), ("tx40_figaroh", "tx40"), ("lwr4_flobaroid", "kuka_lwr4"))
"""Published logs with their recipes, and the robots that they are of."""


def study(shared: Path, seed: int | None) -> list[Row]:
    """Inspect the clean logs and all faulty ones."""
    seeds = {} if seed is None else {"seed": seed}
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        arms = virtual_arms(shared / "models", root)
        rows = [row for name, arm_of in arms.items() for row in _rows(name, arm_of(**seeds))]
        for name, robot in REAL:
            lib = library_of(robot, shared, root)
            rows.append(
                _row(name, CLEAN, loud([*inspect_log(shared / "data" / name, lib, name).findings]))
            )
        return rows


def virtual_arms(models: Path, root: Path) -> dict[str, Callable[..., Arm]]:
    """What makes the two virtual robots."""
    ur10, xarm7 = models / "universal_robots/ur10_robot.urdf", models / "xarm7/xarm7.urdf"
    return {
        "cobot": partial(cobot, load("ur5e"), ur10),
        "arm on a wall": partial(wall_arm, on_a_wall(models, root), xarm7),
    }


def on_a_wall(models: Path, root: Path) -> Library:
    """A KUKA iiwa 14 with gravity along +x of its base."""
    options = ChainOptions(gravity=WALL, snap=1e-4)  # its URDF rounds angles to four digits
    urdf = (models / "iiwa14/iiwa14_uebersax.urdf").read_text(encoding="utf-8")
    return load(build(BuildRequest("iiwa14_wall", urdf, options), root, levels=ONE_LEVEL).folder)


def _rows(robot: str, arm: Arm) -> Iterator[Row]:
    """The clean log, then every fault."""
    yield _row(robot, CLEAN, loud(inspected(arm.log.arrays, arm.lib, arm.log.recipe)))
    for fault in FAULTS:
        log = fault.put(arm)
        findings = loud(inspected(log.arrays, arm.lib, log.recipe))
        right = any(f.kind in fault.kinds and fault.states(arm, f) for f in findings)
        yield _row(robot, fault.name, findings, right)


def _row(robot: str, fault: str, findings: list[Finding], right: bool = False) -> Row:
    is_right = right or (fault == CLEAN and not findings)
    return Row(robot, tuple(f.kind for f in findings), fault, RIGHT if is_right else OTHER)


def sheet(rows: list[Row]) -> Sheet:
    """One line per fault, one column per virtual robot, then the counts."""
    robots = list(dict.fromkeys(row.log for row in rows if row.fault != CLEAN))
    found = {(row.log, row.fault): row for row in rows}
    faults = [each.name for each in FAULTS]
    lines = [(name, *(_cell(found[r, name]) for r in robots)) for name in (CLEAN, *faults)]
    right = [sum(found[robot, name].outcome == RIGHT for name in faults) for robot in robots]
    lines.append(("named rightly", *(f"**{count} of {len(faults)}**" for count in right)))
    real = [row for row in rows if row.log not in robots]
    said = ", ".join(f"`{row.log}` {', '.join(row.kinds) or 'none'}" for row in real)
    below = f"\nWarnings and errors on real logs with their recipes: {said}."
    return Sheet("fault_table", ("fault", *robots), lines, rows, below=below)


def _cell(row: Row) -> str:
    """Findings of one log; those that do not name the fault are marked."""
    return (row.shown or "no warning") + ("" if row.outcome == RIGHT else f" ({OTHER})")


METHODS = ("map", "pc-ols", "adam", "ols", "wls")
COLUMNS: dict[str, tuple[str, ...]] = {
    "none": (),
    "viscous,coulomb": ("viscous", "coulomb"),
    "+ offset": ("offset", "viscous", "coulomb"),
    "+ rotor": ("offset", "viscous", "coulomb", "rotor"),
    "+ rotor, stribeck": ("offset", "viscous", "coulomb", "rotor", "stribeck"),
    "+ rotor, load": ("offset", "viscous", "coulomb", "rotor", "load"),
    "+ rotor, asymmetric": ("offset", "viscous", "coulomb", "rotor", "asymmetric"),
}
DEFAULT, AUTO = "default", "auto"
OTHER_MOTION = 100  # added to the seed of a robot for the motion that is predicted


@dataclass(frozen=True, slots=True)
class Error:
    """Error of one setting on one robot."""

    robot: str
    method: str
    friction: str  # name of the friction model
    columns: tuple[str, ...]  # its columns
    error: float  # of the torque on the other motion, percent; NaN where the method refuses


def defaults(shared: Path, methods: tuple[str, ...] = METHODS) -> list[Error]:
    """Fit every setting to the training log of both robots."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        arms = virtual_arms(shared / "models", root).items()
        return [
            error
            for seed, (robot, arm_of) in enumerate(arms, 1)
            for error in _errors(
                robot, arm_of(), arm_of(motion_seed=seed + OTHER_MOTION), methods, root
            )
        ]


def _errors(
    robot: str, arm: Arm, unseen: Arm, methods: tuple[str, ...], root: Path
) -> Iterator[Error]:
    """Every setting on one robot."""
    lib = arm.lib
    train, test = (_recording(each, arm, root) for each in (arm, unseen))
    default = choose_default_friction(train, lib, allowed=usable_columns(["map"])).terms
    coulomb = choose_default_friction(train, lib, allowed=DEFAULT_COLUMNS).terms
    plain = Friction(COLUMNS["+ rotor"], coulomb.coulomb_speed)
    models = {DEFAULT: default} | {
        name: replace(plain, columns=names) for name, names in COLUMNS.items()
    }
    models[AUTO] = choose_friction(train, lib, extra=("rotor",)).chosen.terms
    for name, terms in models.items():
        for method in methods if name != DEFAULT else ("map",):
            try:
                wanted = Settings(method=method, friction=terms, certify=False, refit=True)
                error = _error(fit(train, lib, wanted), test)
            except RuntimeFault:
                error = float("nan")
            yield Error(robot, method, name, terms.columns, error)


def _recording(arm: Arm, first: Arm, root: Path) -> Recording:
    """The log of an arm, with the preparation that `inspect` proposes for the first one."""
    np.savez(root / "first.npz", **first.log.arrays)
    plan = inspect_log(root / "first.npz", arm.lib, first.log.recipe).plan.replace(friction=None)
    np.savez(root / "log.npz", **arm.log.arrays)
    return read_recording(root / "log.npz", plan)


def _error(result: Identification, test: Recording) -> float:
    """Overall torque error on another recording, percent."""
    rows = prepare(test, None, result.friction, lib=result.lib)
    samples = samples_of(rows, result.lib)
    return float(metrics.torque_error(samples.tau, result.predict_samples(samples)).overall)


def defaults_sheet(rows: list[Error]) -> Sheet:
    """One line per friction model, one column per robot and method, then the distances."""
    robots = list(dict.fromkeys(row.robot for row in rows))
    methods = list(dict.fromkeys(row.method for row in rows))
    errors = {(row.robot, row.friction, row.method): row.error for row in rows}
    pairs = [(robot, method) for robot in robots for method in methods]
    lines = [
        (name, *(_percent(errors.get((robot, name, method))) for robot, method in pairs))
        for name in dict.fromkeys(row.friction for row in rows)
    ]
    said = [_distance(robot, [row for row in rows if row.robot == robot]) for robot in robots]
    head = ("friction", *(f"{robot}, {method}" for robot, method in pairs))
    return Sheet("default_table", head, lines, rows, below="\n".join(["", *said]))


def _percent(error: float | None) -> str:
    return "" if error is None else "refused" if np.isnan(error) else f"{error:.2f}"


def _distance(robot: str, rows: list[Error]) -> str:
    """Default against the best setting of one robot."""
    default = next(row for row in rows if row.friction == DEFAULT)
    best = min((row for row in rows if not np.isnan(row.error)), key=lambda row: row.error)
    return (
        f"On the {robot} the default ({', '.join(default.columns) or 'no friction'}) has "
        f"{default.error:.2f} %, the best setting ({best.method}, {best.friction}) "
        f"{best.error:.2f} %: {100 * (default.error / best.error - 1):.1f} % above the best."
    )


Arrays = dict[str, Array]
PUBLISHED = (
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


def planted_study(shared: Path, builds: Path | None, only: str | None = None) -> Iterator[Row]:
    """Inspect the unchanged logs, then every fault."""
    with tempfile.TemporaryDirectory() as scratch:
        root = builds or Path(scratch)
        for name, robot, place, step in PUBLISHED:
            if only not in {None, name}:
                continue
            lib = library_of(robot, shared, root)
            arrays = arrays_of(shared / "data" / place, step)
            usual = inspected(arrays, lib)
            yield Row(name, tuple(f.kind for f in loud(usual)), UNCHANGED, SILENT)
            for plant in plants(arrays, lib):
                yield _judged(name, plant, usual, inspected(plant.arrays, lib), lib)


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


def _judged(log: str, plant: Plant, usual: list[Finding], seen: list[Finding], lib: Library) -> Row:
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


def planted_sheet(rows: list[Row]) -> Sheet:
    """One line per fault, one column per log: joints whose fault is named, and the others."""
    logs = list(dict.fromkeys(row.log for row in rows))
    names = [name for name in dict.fromkeys(row.fault for row in rows) if name != UNCHANGED]
    lines = []
    for name in names:
        cells = [[r.outcome for r in rows if r.fault == name and r.log == log] for log in logs]
        lines.append((name, *(_counts(Counter(cell)) for cell in cells)))
    every = [Counter(r.outcome for r in rows if r.log == log and r.fault in names) for log in logs]
    lines.append(("**all**", *(f"**{_counts(each)}**" for each in every)))
    unchanged = {r.log: r.shown or "none" for r in rows if r.fault == UNCHANGED}
    lines.append(("warnings on the unchanged log", *(unchanged[log] for log in logs)))
    notes = [
        f"{r.log}, {r.fault} {r.joints}: {r.outcome} ({', '.join(r.kinds)})"
        for r in rows
        if r.outcome in {SILENT, WRONG} and r.fault in names
    ]
    return Sheet("planted_faults", ("fault", *logs), lines, rows, notes=notes)


def _counts(count: Counter) -> str:
    """Counts of the outcomes."""
    if not count:
        return ""
    others = ", ".join(f"{count[k]} {k}" for k in (STATED, SILENT, WRONG) if count[k])
    return f"{count[NAMED]} of {count.total()}" + (f" ({others})" if others else "")
