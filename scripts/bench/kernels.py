"""The run behind `scripts/bench_kernels`: contenders, interleaved rounds, one report."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench import peers
from bench.batch import Batch, Symbolic, make_batch, symbolic
from bench.compiled import burst, cycle, find, interleave, limits, processor, ratio
from bench.front import BenchError, Sheet, ratio_text
from bench.ours import LANES, LAYOUTS, Contender, Ours
from bench.pinocchio_cpp import pinocchio_cpp
from runtime.library import Array, Library

LABELS = {
    "base_inverse_dynamics": "τ (base parameters)",
    "inverse_dynamics": "τ (π)",
    "torque": "τ (λ)",
    "base_regressor": "Y_b",
    "regressor": "Y",
    "torque_jacobian": "∂τ/∂λ",
    "mass_matrix": "M",
    "forward_dynamics": "forward dynamics",
    "end_effector": "end effector",
    "loss_gradient": "loss and gradient",
}
AT_EVERY_LEVEL = ("base_inverse_dynamics", "base_regressor")
WITH_STORED = ("base_inverse_dynamics",)
"""Kernels that are also timed with stored sines and cosines."""
ORDER = ("neon", "v4", "v3", "v2", "portable")
LARGEST = 640 * 1024
"""Bytes of a kernel's outputs beyond which fewer samples are taken, so that all stays in cache."""
AGREEMENT = 1e-8
"""Largest relative difference between a peer and us: rounding times the condition of M."""

CPP = "Pinocchio C++"

RATIOS = (
    ("base_inverse_dynamics", "v4", "tiles", 50.0),
    ("base_inverse_dynamics", "v4", "stored", 80.0),
    ("base_regressor", "v4", "tiles", 75.0),
    ("base_inverse_dynamics", "v3", "tiles", 20.0),
    ("base_regressor", "v3", "tiles", 35.0),
    ("base_inverse_dynamics", "portable", "tiles", 5.0),
)
"""Kernel, level, layout, how many times longer Pinocchio in C++ takes at least."""
LONGEST = (("torque_jacobian", "v4", "tiles", 65.0),)
"""Kernel, level, layout, ns per sample at most."""
DEVIATION = 1e-12  # relative difference from Pinocchio at most, every kernel at every level


@dataclass(frozen=True, slots=True)
class Bar:
    """A requirement, its measured value, and whether it is met."""

    text: str
    measured: float
    met: bool


@dataclass(frozen=True, slots=True)
class Against:
    """A peer's algorithm, its ns per sample, and how many times longer it takes than we do."""

    algorithm: str
    ns: float
    ratio: float


@dataclass(frozen=True, slots=True)
class Row:
    """One kernel at one level on one layout of its arrays."""

    kernel: str
    level: str
    layout: str  # of `ours.LAYOUTS`
    samples: int  # per call
    ns: float
    operations: int  # per sample
    gflops: float
    share: float  # of the measured multiply-add limit at the level's width
    deviation: float | None  # largest relative difference from Pinocchio; None without it
    peers: dict[str, Against]


def measure(lib: Library, samples: int, rounds: int, cpp: bool) -> Sheet:
    """Time a library's kernels and its peers in the same rounds."""
    if samples < LANES or samples % LANES:
        raise BenchError(f"tiles hold {LANES} samples: expected a multiple of it, got {samples}")
    batch = make_batch(lib, samples)
    names = tuple(name for name in LABELS if name in lib.manifest.kernels)
    facts = symbolic(lib, names)
    compiler = find(("cc", "gcc", "clang"))
    levels = tuple(level for level in ORDER[ORDER.index(lib.level) :] if level in lib.levels)
    timers = Ours(lib, names, compiler)
    ours = _ours(timers, names, levels, batch)
    contenders: dict[tuple[str, ...], Callable[[], float]] = {("cycle",): cycle(compiler)}
    contenders |= {("limit", level): one for level, one in limits(compiler, levels).items()}
    contenders |= {("ours", *key): burst(one.run, one.samples) for key, one in ours.items()}
    rivals, missing = _rivals(lib, batch, facts, cpp)
    tail = batch.part(slice(-LANES, None))
    for label, peer in rivals.items():
        for name, rival in peer.contenders.items():
            if name in names:
                contenders[label, name] = burst(rival.run, samples)
                _compare(label, name, rival, timers.contender(name, levels[0], "batch", tail))
    deviations = _deviations(lib, batch, ours, missing)
    times_of = interleave(contenders, rounds)
    rows = tuple(
        _row(key, one.samples, facts[key[0]], times_of, rivals, deviations)
        for key, one in ours.items()
    )
    report = {
        "robot": lib.name,
        "samples": samples,
        "rounds": rounds,
        "processor": processor(),
        "timer": compiler.version,
        "clock": 1 / float(np.median(times_of[("cycle",)])),  # GHz
        "limits": {level: 1 / float(np.median(times_of["limit", level])) for level in levels},
        "peers": {label: peer.detail for label, peer in rivals.items()},
        "missing": missing,
        "deviation": max(deviations.values(), default=None),  # from Pinocchio
        "bars": _bars(rows),
        "rows": rows,
    }
    labels = [label for label in rivals if label != "NumPy"]  # it starts from a stored Y
    head = ("kernel", "level", "tiles, ns", "limit", "samples, ns", *labels)
    title = f"{lib.name}: ns per sample, {processor()}"
    caption = CAPTION.format(rounds=rounds, samples=samples)
    return Sheet(
        "bench_kernels", head, _lines(rows, labels), report, title, caption, _notes(report)
    )


Key = tuple[str, str, str]


def fitting(batch: Batch, numbers: int) -> Batch:
    """As much of the batch as keeps outputs of so many numbers per sample in cache."""
    size = min(batch.size, max(4 * LANES, LARGEST // (8 * numbers) // LANES * LANES))
    return batch.part(slice(size))


def _ours(
    ours: Ours, names: tuple[str, ...], levels: tuple[str, ...], batch: Batch
) -> dict[Key, Contender]:
    """(kernel, level, layout) → contender, as the table lists them, run once."""
    contenders: dict[Key, Contender] = {}
    for level in levels:
        for name in names if level == levels[0] else AT_EVERY_LEVEL:
            for layout in LAYOUTS:
                if layout == "stored" and name not in WITH_STORED:
                    continue
                one = ours.contender(name, level, layout, fitting(batch, ours.numbers(name)))
                if one is not None:
                    one.run(1)
                    contenders[name, level, layout] = one
    return contenders


def _rivals(
    lib: Library, batch: Batch, facts: dict[str, Symbolic], cpp: bool
) -> tuple[dict[str, peers.Peer], dict[str, str]]:
    """Peers that run on this machine, and the reason for each one that does not."""
    makers: dict[str, Callable[[], peers.Peer]] = {
        "Pinocchio C++": lambda: pinocchio_cpp(lib, batch),
        "Pinocchio Python": lambda: peers.pinocchio_python(lib, batch),
        "MuJoCo Python": lambda: peers.mujoco_python(lib, batch),
        "CasADi VM": lambda: peers.casadi_vm(
            {name: (one.function, one.inputs) for name, one in facts.items()}, batch
        ),
        "NumPy": lambda: peers.numpy_stored(lib, batch),
    }
    if not cpp:
        del makers["Pinocchio C++"]
    rivals: dict[str, peers.Peer] = {}
    missing: dict[str, str] = {}
    for label, make in makers.items():
        try:
            rivals[label] = make()
        except BenchError as error:
            missing[label] = str(error)
    return rivals, missing


def _compare(label: str, name: str, rival: peers.Contender, ours: Contender | None) -> None:
    if rival.last is None or ours is None:
        return
    ours.run(1)
    difference = peers.deviation(ours.answer()[-1:], np.ravel(rival.last())[None])
    if not difference < AGREEMENT:
        raise BenchError(
            f"{rival.algorithm} of {label} and our {name} differ by {difference:.1e} of the "
            "largest entry: they do not compute the same"
        )


def _deviations(
    lib: Library, batch: Batch, ours: dict[Key, Contender], missing: dict[str, str]
) -> dict[Key, float]:
    """Of every row from Pinocchio; none without Pinocchio."""
    try:
        expected = peers.oracle(lib, batch)
    except BenchError as error:
        missing["accuracy"] = str(error)
        return {}
    deviations: dict[Key, float] = {}
    for key, one in ours.items():
        deviations[key] = peers.deviation(one.answer(), expected[key[0]][: one.samples])
        if not deviations[key] < AGREEMENT:
            raise BenchError(
                f"{key[0]} ({key[2]}) at level {key[1]} differs from Pinocchio by "
                f"{deviations[key]:.1e}; run: python -m symgen build --settings force=true"
            )
    return deviations


def _row(
    key: Key,
    samples: int,
    facts: Symbolic,
    times_of: dict[tuple[str, ...], Array],
    rivals: dict[str, peers.Peer],
    deviations: dict[Key, float],
) -> Row:
    name, level, layout = key
    times = times_of["ours", *key]
    count = facts.operations
    if layout == "stored":
        count -= facts.sines
    against = {
        label: Against(
            peer.contenders[name].algorithm,
            float(np.median(times_of[label, name])),
            ratio(times_of[label, name], times),
        )
        for label, peer in rivals.items()
        if name in peer.contenders
    }
    ns = float(np.median(times))
    share = float(np.median(count / times * times_of["limit", level]))
    return Row(
        name, level, layout, samples, ns, count, count / ns, share, deviations.get(key), against
    )


def _bars(rows: tuple[Row, ...]) -> tuple[Bar, ...]:
    """Bars whose row and whose peer were measured."""
    by_key = {(row.kernel, row.level, row.layout): row for row in rows}
    result = []
    for *key, least in RATIOS:
        row = by_key.get(tuple(key))
        if row is not None and CPP in row.peers:
            times = row.peers[CPP].ratio
            text = f"{' '.join(key)}: at least {least:.0f} times as fast as {CPP}"
            result.append(Bar(text, times, times >= least))
    for *key, most in LONGEST:
        row = by_key.get(tuple(key))
        if row is not None:
            result.append(Bar(f"{' '.join(key)}: at most {most:.0f} ns", row.ns, row.ns <= most))
    known = [row.deviation for row in rows if row.deviation is not None]
    if known:
        worst = max(known)
        text = f"every kernel and level: within {DEVIATION:.0e} of Pinocchio"
        result.append(Bar(text, worst, worst <= DEVIATION))
    return tuple(result)


CAPTION = (
    "One thread, data in cache; the best of each of {rounds} interleaved rounds, medians over the "
    "rounds, ratios within a round. tiles: arrays of tiles of 8 samples in place, sine and cosine "
    "included or, where the row says so, stored; what depends on λ or π alone once per call. "
    "samples: sample-major arrays in and out, zeros included. Called in a loop from C on {samples} "
    "samples, on fewer where the outputs would leave the cache. Peers: how many times our tiles, "
    "the same states one at a time, Pinocchio C++ in a C++ loop, the others from a Python loop. "
    "limit: operations per time over the measured limit of one core at the level's width, a "
    "multiply-add counted as two, a sine or cosine as one."
)


def _lines(rows: tuple[Row, ...], labels: list[str]) -> list[tuple[str, ...]]:
    """One line per kernel and level, tiles and samples side by side."""
    pairs: dict[tuple[str, str, bool], dict[bool, Row]] = {}
    for row in rows:
        key = (row.kernel, row.level, row.layout == "stored")
        pairs.setdefault(key, {})[row.layout == "batch"] = row
    lines = []
    for (kernel, level, stored), pair in pairs.items():
        row = pair.get(False) or pair[True]
        label = LABELS.get(kernel, kernel)
        lines.append(
            (
                f"{label}, sine and cosine stored" if stored else label,
                level,
                f"{pair[False].ns:.1f}" if False in pair else "",
                f"{100 * row.share:.0f} %",
                f"{pair[True].ns:.1f}" if True in pair else "",
                *(ratio_text(row.peers[x].ratio if x in row.peers else None) for x in labels),
            )
        )
    return lines


def _notes(report: dict[str, Any]) -> list[str]:
    """Limits, requirements, algorithms of the peers and missing peers, one line each."""
    limits = ", ".join(f"{level} {value:.1f}" for level, value in report["limits"].items())
    timer, clock = report["timer"], report["clock"]
    lines = [f"limit of one core, GFLOP/s: {limits} (with {timer}); clock {clock:.2f} GHz"]
    cycles = {
        item.algorithm: item.ns * clock
        for row in report["rows"]
        for label, item in row.peers.items()
        if label == "Pinocchio C++"
    }
    if cycles:
        listed = ", ".join(f"{name} {count:.0f}" for name, count in cycles.items())
        lines.append(f"cycles of one call of Pinocchio C++: {listed}")
    for label, detail in report["peers"].items():
        used = {row.kernel: row.peers[label] for row in report["rows"] if label in row.peers}
        names = ", ".join(f"{kernel}: {item.algorithm}" for kernel, item in used.items())
        lines += [f"{label}: {names}", f"    {detail}"]
    lines += [f"{label} did not run: {why}." for label, why in report["missing"].items()]
    for bar in report["bars"]:
        lines.append(f"{'met   ' if bar.met else 'MISSED'} {bar.text}: {bar.measured:.3g}")
    return lines
