"""Artificial arms of any length, serial or branching, built with the timed kernels only."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from bench.batch import facts_of
from bench.front import BenchError, shared
from runtime.library import Library, load

NEEDED = ("inverse_dynamics", "torque")
"""Kernels that are always built: one for the states, one by which the library is identified."""
REAL = "models/universal_robots/ur5_robot.urdf"


@dataclass(frozen=True, slots=True)
class Arm:
    """A built arm and the operations of its kernels per sample."""

    lib: Library
    operations: dict[str, int]
    label: str


def every_arm(counts: tuple[int, ...], missing: dict[str, str]) -> Iterator[tuple[str, str, str]]:
    """Label, C name and URDF of every robot; small ones first."""
    for n in counts:
        yield f"serial, {n}", f"serial{n}", serial(n)
        if n == 6:
            try:
                yield "UR5", "ur5", (shared() / REAL).read_text(encoding="utf-8")
            except (OSError, BenchError) as error:
                missing["UR5"] = str(error)
        if n == 12:
            yield "two arms of 5 on a trunk of 2", "tree12", branching(2, 2, 5)


def build_arm(
    name: str, label: str, urdf: str, root: Path, level: str, timed: tuple[str, ...]
) -> Arm:
    """Build the timed kernels for one level; a whole library of 20 joints takes minutes."""
    from runtime.common.files import sha256_of
    from runtime.common.user_builds import record_build
    from symgen import __version__
    from symgen.catalogue import make_catalogue
    from symgen.chain import read_chain
    from symgen.emit.files import emit
    from symgen.make.compiler import compile_library
    from symgen.make.facts import initial_parameters, model_facts
    from symgen.make.pipeline import ONCE, PER_LEVEL
    from symgen.make.request import BuildRequest

    request = BuildRequest(name, urdf)
    chain = read_chain(request.urdf, request.options)
    pi0, projected = initial_parameters(chain, request.project)
    catalogue = make_catalogue(chain)
    kernels = tuple(kernel for kernel in catalogue.kernels if kernel.name in {*timed, *NEEDED})
    facts = model_facts(chain, request, catalogue.base, pi0, projected)
    versions = {"symgen": __version__, "casadi": version("casadi")}
    files = emit(name, kernels, facts, versions).files
    folder = root / name
    folder.mkdir()
    for file, text in (files | {f"{name}.urdf": chain.urdf}).items():
        (folder / file).write_text(text, encoding="utf-8", newline="\n")
    per_level = [folder / file for file in PER_LEVEL if file in files]
    once = [folder / file for file in ONCE if file in files]
    made = compile_library(once, folder / f"lib{name}.so", per_level, wanted=[level])
    record = {"sha256": made.sha256, "sources": {f: sha256_of(folder / f) for f in files}}
    (folder / "build.json").write_text(json.dumps(record))
    record_build(name, folder, made.sha256)
    operations = {kernel.name: facts_of(kernel).operations for kernel in kernels}
    return Arm(load(folder, level), operations, label)


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
