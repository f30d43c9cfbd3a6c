"""Arms of good and of impossible bodies, for tests of `symgen inspect`."""

import re
from pathlib import Path

import numpy as np

from symgen.inspect.inspection import Inspection, inspect_text
from tests.taylor import Array


def inspect(text: str, path: Path = Path("robot.urdf")) -> Inspection:
    return inspect_text(text, path, with_base=False)


def block(mass: float, com: Array, tensor: Array) -> str:
    entries = " ".join(
        f'i{"xyz"[i]}{"xyz"[j]}="{float(tensor[i, j])!r}"' for i in range(3) for j in range(i, 3)
    )
    xyz = " ".join(repr(float(x)) for x in com)
    return f'<inertial><origin xyz="{xyz}"/><mass value="{mass!r}"/><inertia {entries}/></inertial>'


def solid(mass: float, box: tuple[float, float, float]) -> Array:
    """Inertia of a solid box."""
    square = np.array(box) ** 2
    return mass / 12 * np.diag(square.sum() - square)


def steiner(mass: float, com: Array) -> Array:
    """m (|c|² 1 − c cᵀ), the shift from the centre of mass to the link origin."""
    return mass * (com @ com * np.eye(3) - np.outer(com, com))


def arm(inertials: list[str], shapes: dict[int, str] | None = None) -> str:
    """A serial arm with links 0.3 m apart, one <inertial> text per moving link."""
    parts = ['<robot name="arm"><link name="base"/>']
    for k, inertial in enumerate(inertials, 1):
        parent = f"link{k - 1}" if k > 1 else "base"
        axis = ("0 0 1", "0 1 0", "1 0 0")[k % 3]
        parts.append(
            f'<joint name="joint{k}" type="revolute"><origin xyz="0.1 0 0.3"/>'
            f'<parent link="{parent}"/><child link="link{k}"/><axis xyz="{axis}"/>'
            '<limit lower="-2" upper="2" velocity="2" effort="50"/></joint>'
            f'<link name="link{k}">{inertial}{(shapes or {}).get(k, "")}</link>'
        )
    return "".join(parts) + "</robot>"


GOOD = block(2.0, np.array([0.05, 0.01, 0.1]), solid(2.0, (0.1, 0.12, 0.3)))


def before_2024(models: Path) -> str:
    """The FR3 with the manufacturer's inertials until June 2024."""
    folder = models / "franka_fr3"
    lines = (folder / "inertials_4bb824f_pre_triangle_fix.yaml").read_text().splitlines()
    text, values, link = (folder / "fr3.urdf").read_text(), {}, ""
    for line in [*lines, "end:"]:
        key, _, value = (word.strip() for word in line.partition(":"))
        if not line.startswith(" "):
            if values:
                keys = ("xx", "xy", "xz", "yy", "yz", "zz")
                entries = " ".join(f'i{k}="{values[k]}"' for k in keys)
                inertial = (
                    f'<inertial><origin rpy="0 0 0" xyz="{values["xyz"]}"/>'
                    f'<mass value="{values["mass"]}"/><inertia {entries}/></inertial>'
                )
                pattern = rf'(<link name="fr3_{link}">.*?)<inertial>.*?</inertial>'
                text, count = re.subn(pattern, rf"\g<1>{inertial}", text, count=1, flags=re.DOTALL)
                assert count == 1
            link, values = key, {}
        else:
            values[key] = value
    return text


POINT = np.array([0.05, 0.01, 0.1])
BRICK = solid(2.0, (0.1, 0.12, 0.3))
TILTED = np.array([[0.02, 0.004, -0.003], [0.004, 0.025, 0.002], [-0.003, 0.002, 0.018]])
BOX = '<collision><geometry><box size="0.1 0.12 0.3"/></geometry></collision>'
FLAT = block(1.5, POINT, BRICK - np.diag([0.0, 0.0, 0.003]) + np.diag([0.004, 0, 0]))
"""J = 0.0242, 0.0167, 0.0011: impossible by 0.0065."""
