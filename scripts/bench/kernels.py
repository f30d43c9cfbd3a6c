"""The run behind `scripts/bench_kernels`: contenders, interleaved rounds, one report."""

from collections.abc import Callable
from typing import Any

import numpy as np

from bench import peers
from bench.compiled import burst, interleave, limits, processor, ratio
from bench.front import BenchError, Sheet, ratio_text
from bench.ours import LANES, LAYOUTS, Batch, Contender, Ours, Symbolic, make_batch, symbolic
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


def measure(lib: Library, samples: int, rounds: int, cpp: bool) -> Sheet:
    """Time a library's kernels and its peers in the same rounds."""
    if samples < LANES or samples % LANES:
        raise BenchError(f"tiles hold {LANES} samples: expected a multiple of it, got {samples}")
    batch = make_batch(lib, samples)
    names = tuple(name for name in LABELS if name in lib.manifest.kernels)
    facts = symbolic(lib, names)
    levels = tuple(level for level in ORDER[ORDER.index(lib.level) :] if level in lib.levels)
    timers = Ours(lib, names)
    ours = _ours(timers, names, levels, batch)
    contenders: dict[tuple[str, ...], Callable[[], float]] = {
        ("limit", level): one for level, one in limits(levels).items()
    }
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
    rows = [
        _row(key, one.samples, facts[key[0]], times_of, rivals) | {"deviation": deviations.get(key)}
        for key, one in ours.items()
    ]
    report = {
        "robot": lib.name,
        "samples": samples,
        "rounds": rounds,
        "processor": processor(),
        "limits": {level: 1 / float(np.median(times_of["limit", level])) for level in levels},
        "peers": {label: peer.detail for label, peer in rivals.items()},
        "missing": missing,
        "deviation": max(deviations.values(), default=None),  # from Pinocchio
        "rows": rows,
    }
    head = ("kernel", "level", "tiles, ns", "limit", "samples, ns", *rivals)
    title = f"{lib.name}: ns per sample, {processor()}"
    caption = CAPTION.format(rounds=rounds, samples=samples)
    lines = _lines(rows, [*rivals])
    return Sheet("bench_kernels", head, lines, report, title, caption, _notes(report))


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
        "Pinocchio C++": lambda: peers.pinocchio_cpp(lib, batch),
        "Pinocchio Python": lambda: peers.pinocchio_python(lib, batch),
        "MuJoCo Python": lambda: peers.mujoco_python(lib, batch),
        "CasADi VM": lambda: peers.casadi_vm(
            {name: (one.function, one.inputs) for name, one in facts.items()}, batch
        ),
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
) -> dict[str, Any]:
    """One kernel at one level on one layout: samples per call, ns and operations per sample.

    `share` is that of the measured multiply-add limit at the level's width, `ratio` how many times
    longer a peer takes.
    """
    name, level, layout = key
    times = times_of["ours", *key]
    count = facts.operations - (facts.sines if layout == "stored" else 0)
    against = {
        label: {
            "algorithm": peer.contenders[name].algorithm,
            "ns": float(np.median(times_of[label, name])),
            "ratio": ratio(times_of[label, name], times),
        }
        for label, peer in rivals.items()
        if name in peer.contenders
    }
    ns = float(np.median(times))
    share = float(np.median(count / times * times_of["limit", level]))
    row = {"kernel": name, "level": level, "layout": layout, "samples": samples, "ns": ns}
    return row | {"operations": count, "gflops": count / ns, "share": share, "peers": against}


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


def _lines(rows: list[dict[str, Any]], labels: list[str]) -> list[tuple[str, ...]]:
    """One line per kernel and level, tiles and samples side by side."""
    pairs: dict[tuple[str, str, bool], dict[bool, dict[str, Any]]] = {}
    for row in rows:
        key = (row["kernel"], row["level"], row["layout"] == "stored")
        pairs.setdefault(key, {})[row["layout"] == "batch"] = row
    lines = []
    for (kernel, level, stored), pair in pairs.items():
        row = pair.get(False) or pair[True]
        tiles, samples = (f"{pair[k]['ns']:.1f}" if k in pair else "" for k in (False, True))
        label = LABELS[kernel] + (", sine and cosine stored" if stored else "")
        ratios = (ratio_text(row["peers"].get(x, {}).get("ratio")) for x in labels)
        lines.append((label, level, tiles, f"{100 * row['share']:.0f} %", samples, *ratios))
    return lines


def _notes(report: dict[str, Any]) -> list[str]:
    """Limits, algorithms of the peers and missing peers, one line each."""
    limits = ", ".join(f"{level} {value:.1f}" for level, value in report["limits"].items())
    lines = [f"limit of one core, GFLOP/s: {limits}"]
    for label, detail in report["peers"].items():
        used = {row["kernel"]: row["peers"].get(label) for row in report["rows"]}
        names = ", ".join(f"{kernel}: {one['algorithm']}" for kernel, one in used.items() if one)
        lines += [f"{label}: {names}", f"    {detail}"]
    return lines + [f"{label} did not run: {why}." for label, why in report["missing"].items()]
