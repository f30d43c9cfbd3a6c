"""The run behind `scripts/bench_kernels --joints`: how cost per sample grows with the arm."""

import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench import pinocchio_cpp
from bench.arms import Arm, build_arm, every_arm
from bench.batch import make_batch
from bench.compiled import Compiler, burst, find, interleave, limits, processor, ratio
from bench.front import BenchError, Sheet
from bench.kernels import LABELS, fitting
from bench.ours import Ours
from runtime.library import Array

COUNTS = (2, 3, 4, 6, 7, 9, 12, 16, 20)
TIMED = ("base_inverse_dynamics", "base_regressor")
SAMPLES = 256
LONGEST = 300.0  # build time after which no further robot is started, s


@dataclass(frozen=True, slots=True)
class Row:
    """One kernel of one robot on tiles."""

    robot: str
    joints: int
    kernel: str
    operations: int
    ns: float
    per_operation: float
    share: float
    code: int | None  # bytes of machine code per tile; None where nm does not report
    output: int  # bytes of the outputs of one tile
    ratio: float | None  # how many times longer Pinocchio in C++ takes; None without it


def measure(
    level: str, counts: tuple[int, ...], rounds: int, cpp: bool, report: Callable[[str], None]
) -> Sheet:
    """Build the arms one after the other, then time them all in the same rounds."""
    compiler = find(("cc", "gcc", "clang"))
    built: dict[str, float] = {}
    missing: dict[str, str] = {}
    contenders: dict[tuple[str, ...], Callable[[], float]] = {}
    contenders["limit",] = limits(compiler, (level,))[level]
    robots: dict[str, Arm] = {}
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for label, name, text in every_arm(counts, missing):
            spent = time.perf_counter() - begin
            if spent > LONGEST:
                missing[label] = f"building had taken {spent:.0f} s already"
                continue
            start = time.perf_counter()
            robots[name] = robot = build_arm(name, label, text, Path(folder), level, TIMED)
            built[label] = time.perf_counter() - start
            report(f"{label}: built in {built[label]:.1f} s")
            contenders |= _contenders(robot, compiler, level, cpp, missing)
        report(f"{len(contenders)} measurements in {rounds} rounds")
        times = interleave(contenders, rounds)
        rows = tuple(_row(robot, kernel, times) for kernel in TIMED for robot in robots.values())
    facts = {"level": level, "processor": processor(), "rounds": rounds, "rows": rows}
    facts |= {"built": built, "missing": missing}
    title = f"ns per sample against the number of joints, {level}, {processor()}"
    caption = (
        f"Tiles in place, data in cache, sine and cosine included; the best of each of {rounds} "
        "interleaved rounds, medians over the rounds. Serial arms and trees are made up: axes at "
        "right angles, offsets and bodies at random. code: of one tile; what exceeds the "
        "instruction cache of a core is fetched anew for every tile."
    )
    seconds = ", ".join(f"{robot} {value:.1f}" for robot, value in built.items())
    notes = [f"built (only these kernels, one level), s: {seconds}"]
    notes += [growth(tuple(r for r in rows if r.kernel == kernel)) for kernel in TIMED]
    notes += [f"{label} was left out: {why}." for label, why in missing.items()]
    return Sheet("bench_joints", _HEAD, [*map(_cells, rows)], facts, title, caption, notes)


def _contenders(
    robot: Arm, compiler: Compiler, level: str, cpp: bool, missing: dict[str, str]
) -> dict[tuple[str, ...], Callable[[], float]]:
    lib = robot.lib
    ours, batch = Ours(lib, TIMED, compiler), make_batch(lib, SAMPLES)
    times: dict[tuple[str, ...], Callable[[], float]] = {}
    for kernel in TIMED:
        part = fitting(batch, ours.numbers(kernel))
        one = ours.contender(kernel, level, "tiles", part)
        if one is None:
            raise BenchError(f"the library of '{lib.name}' has no {kernel} on tiles")
        times["ours", lib.name, kernel] = burst(one.run, part.size)
    if cpp:
        try:
            rival = pinocchio_cpp.pinocchio_cpp(lib, batch)
        except BenchError as error:
            missing["Pinocchio C++"] = str(error)
            return times
        for kernel in TIMED:
            run = rival.contenders[kernel].run
            times["Pinocchio C++", lib.name, kernel] = burst(run, batch.size)
    return times


def _row(robot: Arm, kernel: str, times_of: dict[tuple[str, ...], Array]) -> Row:
    lib, times = robot.lib, times_of["ours", robot.lib.name, kernel]
    count, ns = robot.operations[kernel], float(np.median(times))
    theirs = times_of.get(("Pinocchio C++", lib.name, kernel))
    numbers = sum(a.size for a in lib.manifest.kernels[kernel].outputs)
    return Row(
        robot=robot.label,
        joints=lib.n_joints,
        kernel=kernel,
        operations=count,
        ns=ns,
        per_operation=ns / count,
        share=float(np.median(count / times * times_of[("limit",)])),
        code=_code(Path(lib.folder) / f"lib{lib.name}.so", kernel),
        output=64 * numbers,
        ratio=None if theirs is None else ratio(theirs, times),
    )


def _code(library: Path, kernel: str) -> int | None:
    """Bytes of a kernel's work on one tile, as nm lists its functions."""
    nm = shutil.which("nm")
    if nm is None:
        return None
    command = [nm, "-S", str(library)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    pattern = rf"^\w+ (\w+) \w (?:\w+_)?{kernel}_(?:tile|lanes)\b"
    sizes = re.findall(pattern, run.stdout, re.MULTILINE)
    return sum(int(size, 16) for size in sizes) or None


def growth(rows: tuple[Row, ...]) -> str:
    """How time grows against operations from the smallest arm to the largest, and at its worst."""
    arms = sorted((row for row in rows if row.robot.startswith("serial")), key=lambda r: r.joints)
    if len(arms) < 2:
        return "growth: needs at least two serial arms"
    pairs = [(a, b) for k, a in enumerate(arms) for b in arms[k + 1 :]]
    worst = max(pairs, key=lambda pair: pair[1].per_operation / pair[0].per_operation)
    steps = [
        f"from {a.joints} to {b.joints} joints {b.operations / a.operations:.1f} times the "
        f"operations take {b.ns / a.ns:.1f} times as long"
        for a, b in ((arms[0], arms[-1]), worst)
    ]
    return f"growth of {LABELS[rows[0].kernel]}: {steps[0]}; at worst {steps[1]}"


_HEAD = ("kernel", "robot, joints", "ops", "ns", "ps per op", "limit", "code, KiB", "Pinocchio C++")


def _cells(row: Row) -> tuple[str, ...]:
    return (
        LABELS[row.kernel],
        row.robot,
        str(row.operations),
        f"{row.ns:.1f}",
        f"{1e3 * row.per_operation:.1f}",
        f"{100 * row.share:.0f} %",
        "" if row.code is None else f"{row.code / 1024:.0f}",
        "" if row.ratio is None else f"{row.ratio:.0f}×",
    )
