"""The run behind `scripts/bench_kernels`: contenders, interleaved medians, one table."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.table import Table

from bench import peers
from bench.batch import Batch, make_batch
from bench.clock import calls_for, interleave
from bench.compiled import BenchError, Compiler, find
from bench.machine import limits, processor
from bench.ours import Ours
from runtime.library import Array, Library

KERNELS = (
    "inverse_dynamics",
    "torque",
    "torque_jacobian",
    "regressor",
    "base_regressor",
    "mass_matrix",
    "forward_dynamics",
    "end_effector",
    "loss_gradient",
)
ORDER = ("portable", "v2", "v3", "v4", "neon")
BURST = 3e5
"""Nanoseconds of one measurement, after one call that is not timed."""
AGREEMENT = 1e-8
"""Largest relative difference between a peer and us: rounding times the condition of M."""

CAPTION = (
    "One thread, data in cache, medians of {repeat} interleaved rounds. Ours: the C batch "
    "functions on {samples} samples, called in a loop from C; timed are the reading of the "
    "sample-major arrays into tiles of W lanes, sine and cosine, the kernel with its λ → π once "
    "per batch, and the writing of dense sample-major outputs, zeros included. Peers: the same "
    "states one at a time, {calls}; NumPy starts from a stored Y. ops: additions, products, "
    "divisions and one per sine or cosine, per sample, as the manifest counts them but without "
    "what the vector levels do once per batch. FMA: ops per time over the measured limit of one "
    "core at the level's width, a multiply-add counted as two."
)


@dataclass(frozen=True, slots=True)
class Against:
    """A peer's algorithm, its ns per sample, and how many times longer it takes than we do."""

    algorithm: str
    ns: float
    ratio: float


@dataclass(frozen=True, slots=True)
class Row:
    """One kernel at one level; `share` of the measured multiply-add limit."""

    kernel: str
    level: str
    ns: float
    operations: int
    gflops: float
    share: float
    peers: dict[str, Against]


@dataclass(frozen=True, slots=True)
class Report:
    """Everything that one run measured.

    Attributes:
        limits: level → GFLOP/s of one core.
        peers: peer → versions and commands.
        missing: peer → why it did not run.
    """

    robot: str
    samples: int
    repeat: int
    processor: str
    timer: str
    limits: dict[str, float]
    peers: dict[str, str]
    missing: dict[str, str]
    caption: str
    rows: tuple[Row, ...]

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def measure(lib: Library, samples: int, repeat: int, cpp: bool) -> Report:
    """Time all kernels of a library at all levels that run here, and its peers.

    Args:
        lib: loaded at its best level.
        samples: per batch.
        repeat: rounds.
        cpp: whether Pinocchio in C++ takes part.

    Raises:
        BenchError: no C compiler, or a level contradicts the portable code.
    """
    batch = make_batch(lib, samples)
    names = tuple(name for name in KERNELS if name in lib.manifest.kernels)
    levels = [level for level in ORDER[: ORDER.index(lib.level) + 1] if level in lib.levels]
    compiler = find(("cc", "gcc", "clang"))
    ceilings = limits(compiler, tuple(levels))
    contenders: dict[tuple[str, ...], Callable[[], float]] = {
        ("limit", level): function for level, function in ceilings.items()
    }
    reference = _ours(lib, names, levels, batch, compiler, contenders)
    functions, operations = _symbolic(lib, names)
    makers: dict[str, Callable[[], peers.Peer]] = {
        "Pinocchio C++": lambda: peers.pinocchio_cpp(lib, batch),
        "Pinocchio Python": lambda: peers.pinocchio_python(lib, batch),
        "MuJoCo Python": lambda: peers.mujoco_python(lib, batch),
        "CasADi VM": lambda: peers.casadi_vm(functions, batch),
        "NumPy": lambda: peers.numpy_stored(lib, batch),
    }
    if not cpp:
        del makers["Pinocchio C++"]
    found: dict[str, peers.Peer] = {}
    missing: dict[str, str] = {}
    for label, make in makers.items():
        try:
            found[label] = make()
        except BenchError as error:
            missing[label] = str(error)
            continue
        for name, contender in found[label].contenders.items():
            if name in names:
                contenders[label, name] = _burst(contender.run, samples)
                _compare(label, name, contender, reference[name])
    medians = interleave(contenders, repeat)
    rows = tuple(
        _row(name, level, operations[name], medians, found) for name in names for level in levels
    )
    calls = "Pinocchio C++ in a C++ loop, the others from a Python loop"
    return Report(
        robot=lib.name,
        samples=samples,
        repeat=repeat,
        processor=processor(),
        timer=compiler.version,
        limits={level: medians["limit", level] for level in levels},
        peers={label: peer.detail for label, peer in found.items()},
        missing=missing,
        caption=CAPTION.format(repeat=repeat, samples=samples, calls=calls),
        rows=rows,
    )


def _ours(
    lib: Library,
    names: tuple[str, ...],
    levels: list[str],
    batch: Batch,
    compiler: Compiler,
    contenders: dict[tuple[str, ...], Callable[[], float]],
) -> dict[str, Array]:
    """Enter our kernels; returns the last output of each for the last sample."""
    ours = Ours(lib, names, batch, compiler)
    reference: dict[str, Array] = {}
    for name in names:
        for level in levels:
            run, outputs = ours.measure(name, level)
            contenders["ours", name, level] = _burst(run, batch.size)
            answer = outputs[-1][-1].copy()
            difference = _difference(answer, reference.setdefault(name, answer))
            if not difference < AGREEMENT:
                raise BenchError(
                    f"{name} at level {level} differs from the portable code by {difference:.1e}; "
                    "run: python -m symgen build --force"
                )
    return reference


def _burst(run: Callable[[int], float], samples: int) -> Callable[[], float]:
    calls = calls_for(run, samples, BURST)

    def once() -> float:
        run(1)
        return run(calls)

    return once


def _compare(label: str, name: str, contender: peers.Contender, ours: Array) -> None:
    if contender.last is None:
        return
    difference = _difference(np.ravel(contender.last()), ours)
    if not difference < AGREEMENT:
        raise BenchError(
            f"{contender.algorithm} of {label} and our {name} differ by {difference:.1e} of the "
            "largest entry: they do not compute the same"
        )


def _difference(a: Array, b: Array) -> float:
    return float(np.abs(a - b).max() / max(np.abs(b).max(), 1e-300))


def _symbolic(
    lib: Library, names: tuple[str, ...]
) -> tuple[dict[str, tuple[object, tuple[str, ...]]], dict[str, tuple[int, int]]]:
    """CasADi functions with their inputs' names; operations of the portable and vector forms."""
    from symgen.catalogue import make_catalogue
    from symgen.chain import read_chain
    from symgen.request import request_from_folder

    request = request_from_folder(lib.folder)
    catalogue = make_catalogue(read_chain(request.urdf, request.options))
    kernels = {kernel.name: kernel for kernel in catalogue.kernels if kernel.name in names}
    functions = {
        name: (kernel.function, tuple(a.name for a in kernel.inputs))
        for name, kernel in kernels.items()
    }
    operations = {
        name: (lib.manifest.kernels[name].operations, _per_sample(kernels[name])) for name in names
    }
    return functions, operations


def _per_sample(kernel: Any) -> int:
    """Operations that depend on the sample; those on shared inputs run once per batch."""
    import casadi as ca

    f, count = kernel.function, 0
    own: dict[int, bool] = {}
    for k in range(f.n_instructions()):
        op, ins, outs = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
        if op == ca.OP_INPUT:
            own[outs[0]] = not kernel.inputs[ins[0]].shared
        elif op == ca.OP_CONST:
            own[outs[0]] = False
        elif op != ca.OP_OUTPUT:
            own[outs[0]] = any(own[i] for i in ins)
            count += own[outs[0]]
    return count


def _row(
    name: str,
    level: str,
    operations: tuple[int, int],
    medians: dict[tuple[str, ...], float],
    found: dict[str, peers.Peer],
) -> Row:
    ns = medians["ours", name, level]
    count = operations[level != "portable"]
    against = {
        label: Against(
            peer.contenders[name].algorithm, medians[label, name], medians[label, name] / ns
        )
        for label, peer in found.items()
        if name in peer.contenders
    }
    return Row(name, level, ns, count, count / ns, count / ns / medians["limit", level], against)


def table(report: Report) -> Table:
    """All rows; a peer's cell is its ns per sample and how many times ours that is."""
    title = f"{report.robot}: ns per sample, {report.processor}"
    shown = Table("kernel", "level", "ops", "ours", "FMA", title=title, caption=report.caption)
    for column in shown.columns[2:]:
        column.justify = "right"
    for label in report.peers:
        shown.add_column(label, justify="right")
    for row in report.rows:
        cells = []
        for label in report.peers:
            other = row.peers.get(label)
            cells.append(f"{other.ns:.0f} ({other.ratio:.1f}×)" if other else "")
        shown.add_row(
            row.kernel,
            row.level,
            str(row.operations),
            f"{row.ns:.1f}",
            f"{100 * row.share:.0f} %",
            *cells,
            end_section=row is report.rows[-1] or row.level == report.rows[-1].level,
        )
    return shown


def footnotes(report: Report) -> list[str]:
    """Limits, what each peer runs, who is missing, as lines."""
    limits = ", ".join(f"{level} {value:.1f}" for level, value in report.limits.items())
    lines = [f"limit of one core, GFLOP/s: {limits} (with {report.timer})"]
    for label, detail in report.peers.items():
        used = {row.kernel: row.peers[label] for row in report.rows if label in row.peers}
        names = ", ".join(f"{kernel}: {item.algorithm}" for kernel, item in used.items())
        lines += [f"{label}: {names}", f"    {detail}"]
    return lines + [f"{label} did not run: {why}." for label, why in report.missing.items()]
