"""Cost of builds of artificial robots of any number of joints, serial or branching."""

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench.front import Sheet, python, sheet_of
from runtime.library import load

COUNTS = {7: (), 15: (1, 2, 7), 29: (1, 4, 7), 60: (4, 8, 7)}
"""Joints → trunk, branches and joints per branch of `branching`; empty: a serial arm."""
SAMPLES = 20_000  # states of a timed batch
_RUN = """
import json, resource, sys
from pathlib import Path
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
build(BuildRequest(sys.argv[1], Path(sys.argv[2]).read_text()), Path(sys.argv[3]))
parts = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
cpu = sum(part.ru_utime + part.ru_stime for part in parts)
print(json.dumps([cpu, max(part.ru_maxrss for part in parts) / 1024]))
"""

_COSTS = {"build, CPU s": ".1f", "MB": ".0f", "τ, ns per sample": ".0f"}
COLUMNS = {"joints": "", **_COSTS, "kernels omitted": ""}
"""Build for all levels and its largest process; τ of a sample in a batch on one core."""


def sizes(counts: tuple[int, ...], serial: tuple[int, ...], folder: Path) -> Sheet:
    """Build robots of these sizes without a compiler cache, serial chains too; and exponents."""
    rows = [_size(count, COUNTS[count], folder) for count in counts]
    rows += [_size(count, (), folder) for count in serial]
    whole = sheet_of("bench_sizes", COLUMNS, rows, title="build cost")
    if len(rows) < 2:
        return whole
    joints, costs = np.log([*counts, *serial]), np.log([row[1:4] for row in rows])
    slopes = (f"{slope:.2f}" for slope in np.polyfit(joints, costs, 1)[0])
    return replace(whole, lines=[*whole.lines, ["exponent", *slopes, ""]])


def _size(joints: int, shape: tuple[int, ...], folder: Path) -> tuple:
    urdf = branching(*shape) if shape else serial(joints)
    name = f"size{joints}" if shape else f"serial{joints}"
    path = folder / f"{name}.urdf"
    path.write_text(urdf, encoding="utf-8")
    run = python("-c", _RUN, name, path, folder, CCACHE_DISABLE="1")
    run.check_returncode()
    cpu, memory = json.loads(run.stdout)
    lib = load(folder / name, threads=1)
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, SAMPLES, joints))
    times = []
    for _ in range(5):
        start = time.perf_counter()
        lib.inverse_dynamics(q, dq, ddq, lib.pi0)
        times.append(time.perf_counter() - start)
    omitted = len(lib.manifest.omitted)
    torque_ns = 1e9 * min(times) / SAMPLES
    label = f"{joints}{'' if shape else ' serial'}"
    return label, cpu, memory, torque_ns, omitted


_AXES = ("1 0 0", "0 1 0", "0 0 1")


def serial(n: int, seed: int = 0) -> str:
    """A chain of n revolute joints.

    Neighbouring axes are at right angles, as most arms have them; where a joint sits on its link
    and what the link weighs is random.
    """
    return _urdf(f"serial{n}", [k - 1 for k in range(n)], seed)


def branching(trunk: int, branches: int, length: int, seed: int = 0) -> str:
    """A trunk that carries several arms of the same length."""
    parents = [k - 1 for k in range(trunk)]
    for branch in range(branches):
        first = trunk + branch * length
        parents += [trunk - 1, *range(first, first + length - 1)]
    return _urdf(f"tree{len(parents)}", parents, seed)


def _urdf(name: str, parents: list[int], seed: int) -> str:
    """Joint k moves link k; parent −1 is the base."""
    rng = np.random.default_rng(seed)
    parts = [f'<robot name="{name}">', '<link name="base"/>']
    axes: list[int] = []
    for k, parent in enumerate(parents):
        last = axes[parent] if parent >= 0 else int(rng.integers(3))
        axes.append((last + 1 + int(rng.integers(2))) % 3)
        above = f"link{parent + 1}" if parent >= 0 else "base"
        parts += [
            _link(f"link{k + 1}", rng),
            f'<joint name="joint{k + 1}" type="revolute"><parent link="{above}"/>'
            f'<child link="link{k + 1}"/><origin xyz="{_numbers(rng.uniform(-0.3, 0.3, 3))}"/>'
            f'<axis xyz="{_AXES[axes[-1]]}"/>'
            '<limit lower="-3" upper="3" velocity="3" effort="100"/></joint>',
        ]
    return "\n".join((*parts, "</robot>"))


def _link(name: str, rng: np.random.Generator) -> str:
    """A body of positive density: the inertia of point masses around its centre."""
    mass, points = rng.uniform(1, 5), rng.normal(0, 0.1, (6, 3))
    points -= points.mean(axis=0)
    second = mass * points.T @ points / len(points)
    inertia = np.trace(second) * np.eye(3) - second
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    entries = " ".join(
        f'{key}="{value:.9g}"'
        for key, value in zip(names, inertia[np.triu_indices(3)], strict=True)
    )
    return (
        f'<link name="{name}"><inertial><origin xyz="{_numbers(rng.uniform(-0.1, 0.1, 3))}"/>'
        f'<mass value="{mass:.9g}"/><inertia {entries}/></inertial></link>'
    )


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{x:.6g}" for x in values)
