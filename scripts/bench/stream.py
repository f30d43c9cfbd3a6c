"""The run behind `scripts/bench_stream`: a long simulated log, identified from its file.

The log is a sum of slow sines per joint with friction and noise, written block by block into a
temporary folder. A process of its own reads it, prepares it and identifies it, so that its peak of
memory is that of the identification alone.
"""

import json
import time
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.front import ROOT, Sheet, peak_memory, python, sheet_of
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.long_logs import blocks_of
from runtime.identification.single_log import identify_recording
from runtime.library import Library, load
from runtime.recording import Friction, Preparation
from runtime.recording.streamed import open_streamed

RATE, NOISE = 1000.0, 0.05
BLOCK = 65536
PREPARATION = Preparation(
    filter="butterworth", cutoff_hz=10.0, max_gap_s=3e-3, rate_hz=100.0, rest_speed=0.02
)
FRICTION = Friction(("viscous", "coulomb", "offset"))


def motion(lib: Library, rows: int) -> Iterator[tuple[np.ndarray, ...]]:
    """Blocks of t, q, dq, τ."""
    rng = np.random.default_rng(11)
    limits = lib.limits()
    middle, half = (limits["lower"] + limits["upper"]) / 2, (limits["upper"] - limits["lower"]) / 2
    speed = 2 * np.pi * rng.uniform(0.05, 0.35, (lib.n_joints, 5))
    size, shift = half[:, None] * 0.16, rng.uniform(0.0, 6.0, speed.shape)
    for start in range(0, rows, BLOCK):
        t = np.arange(start, min(start + BLOCK, rows)) / RATE
        phase = t[:, None, None] * speed + shift
        sine, cosine = np.sin(phase), np.cos(phase)
        q, dq = middle + np.sum(size * sine, axis=2), np.sum(size * speed * cosine, axis=2)
        ddq = -np.sum(size * speed**2 * sine, axis=2)
        tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0)
        tau += 0.5 * dq + 0.3 * np.tanh(dq / 0.02) + 0.1 + rng.normal(0.0, NOISE, q.shape)
        yield t, q, dq, tau


def write_columns(lib: Library, rows: int, path: Path) -> None:
    """Columns t, q1 …, dq1 …, tau1 …: Parquet in a row group per block, or CSV with all digits."""
    import pyarrow as pa
    from pyarrow import csv, parquet

    n = lib.n_joints
    titles = ["t", *(f"{key}{j}" for key in ("q", "dq", "tau") for j in range(1, n + 1))]
    schema = pa.schema([(title, pa.float64()) for title in titles])
    if path.suffix == ".csv":
        plain = csv.WriteOptions(quoting_header="none", quoting_style="none")
        writer = csv.CSVWriter(path, schema, write_options=plain)
    else:
        how = {"compression": "none", "use_dictionary": False}
        writer = parquet.ParquetWriter(path, schema, **how)
    with writer:
        for t, *signals in motion(lib, rows):
            values = np.hstack([t[:, None], *signals])
            writer.write_table(pa.table(list(values.T), schema=schema), BLOCK)


def write_npz(lib: Library, rows: int, path: Path) -> None:
    """Arrays t, q, dq, tau, not compressed, as numpy.savez would."""
    shapes = {"t": (rows,)} | dict.fromkeys(("q", "dq", "tau"), (rows, lib.n_joints))
    parts = {key: path.with_name(f"{key}.npy") for key in shapes}
    arrays = {
        key: np.lib.format.open_memmap(part, mode="w+", dtype=np.float64, shape=shapes[key])
        for key, part in parts.items()
    }
    done = 0
    for values in motion(lib, rows):
        for array, block in zip(arrays.values(), values, strict=True):
            array[done : done + len(block)] = block
        done += len(values[0])
    arrays.clear()
    with zipfile.ZipFile(path, "w") as archive:
        for key, part in parts.items():
            archive.write(part, f"{key}.npy")
            part.unlink()


WRITERS = {"parquet": write_columns, "npz": write_npz, "csv": write_columns}
TEXT = 2.4  # ratio of the characters of a number with its comma to the bytes of a double


def measure(robot: str, kind: str, size: int, folder: Path) -> dict[str, Any]:
    """One log of about `size` bytes, identified in a process of its own."""
    lib = load(robot)
    wide = TEXT if kind == "csv" else 1.0
    rows = int(size / (8 * wide * (1 + 3 * lib.n_joints)))
    path = folder / f"log.{kind}"
    WRITERS[kind](lib, rows, path)
    code = f"from bench.stream import child; child({robot!r}, {str(path)!r})"
    run = python("-c", code, PYTHONPATH=f"{ROOT}:{ROOT / 'scripts'}")
    path.unlink()
    if run.returncode:
        raise RuntimeError(run.stderr[-2000:])
    return {"kind": kind, **json.loads(run.stdout.splitlines()[-1])}


def child(robot: str, path: str) -> None:
    """Identify, then time the steps; prints times in CPU seconds, sizes and errors as JSON."""
    lib = load(robot)
    start = time.perf_counter()
    log = open_streamed(path)
    result = identify_recording(log, lib, preparation=PREPARATION, friction=FRICTION)
    dict(log.source)  # waits until the file is hashed
    wall = time.perf_counter() - start
    rss = peak_memory()
    start = time.process_time()
    log = open_streamed(path)
    blocks = blocks_of(log, lib, PREPARATION, FRICTION)
    for first, last in zip(blocks.edges, blocks.edges[1:], strict=False):
        log.block(first, last)
    read = time.process_time() - start
    for first, last in zip(blocks.edges, blocks.edges[1:], strict=False):
        log.block(first, last)
    again = time.process_time() - start - read
    start, count = time.process_time(), 0
    for part in blocks.recordings():
        count += len(part)
    prepare = time.process_time() - start - again
    samples = samples_of(result.train, lib)
    streamed = result.streamed
    if streamed is None:
        raise RuntimeError("the log was not streamed")
    bare = replace(samples, columns=np.zeros((*samples.q.shape, 0)))
    with_friction = _speed(lib, samples)
    facts = {
        "mega_rows": log.rows / 1e6,
        "megabytes": Path(path).stat().st_size / 1e6,
        "read": read,
        "prepare": prepare,
        "samples": count,
        "plain": _speed(lib, bare) / 1e6,
        "friction": with_friction / 1e6,
        "compress": streamed.samples["train"] / with_friction,
        "wall": wall,
        "peak": rss / 1e6,
        "before": streamed.errors[0].overall,
        "after": streamed.errors[1].overall,
    }
    print(json.dumps(facts))


def _speed(lib: Library, samples: Samples) -> float:
    """Samples per CPU second of one core, the best of five."""
    weights, best = np.ones(lib.n_joints), np.inf
    repeats = 1 + 200_000 // len(samples)
    for _ in range(5):
        start = time.process_time()
        for _ in range(repeats):
            compress(lib, samples, weights, threads=1)
        best = min(best, time.process_time() - start)
    return repeats * len(samples) / best


COLUMNS = {
    "log": "{kind}",
    "rows": "{mega_rows:.2f} M",
    "MB": "{megabytes:.0f}",
    "read, CPU s": "{read:.1f}",
    "prepare, CPU s": "{prepare:.1f}",
    "compress, CPU s": "{compress:.2f}",
    "samples/s per core": "{friction:.2f} M",
    "without friction": "{plain:.2f} M",
    "identify, wall s": "{wall:.2f}",
    "peak RSS, MB": "{peak:.0f}",
    "error %, before → after": "{before:.2f} → {after:.3f}",
}


def sheet(rows: list[dict[str, Any]]) -> Sheet:
    """One line per file."""
    return sheet_of("bench_stream", COLUMNS, rows, title="A log that stays in its file")
