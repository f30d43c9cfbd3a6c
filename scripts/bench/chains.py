"""URDF text of artificial arms: seeded, of any length, serial or branching."""

import numpy as np

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
