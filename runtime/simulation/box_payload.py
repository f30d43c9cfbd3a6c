"""A box in the hand of a virtual robot: P = m [[Σ, c], [cᵀ, 1]],  Σ = diag(L²)/12 + c cᵀ."""

from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.records import Record, Vector3, record_from_table, record_from_toml
from runtime.common.texts import numbers_of
from runtime.errors import IdentificationError
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS

LARGEST_PAYLOAD = 1e6  # largest number of a payload that is read, kg and m


class Box(Record, frozen=True):
    """A homogeneous box, its edges along the axes of the link's frame; also the TOML file of it."""

    mass: float  # kg
    com: Vector3  # centre, in the frame of the link, m
    size: Vector3 = (0.0, 0.0, 0.0)  # edges, m
    link: str | None = None  # link that carries it; None is the link of the tip

    def __post_init__(self) -> None:
        numbers = np.array([self.mass, *self.com, *self.size], dtype=float)
        if numbers.size != 7 or not (np.abs(numbers) < LARGEST_PAYLOAD).all() or not self.mass > 0:
            raise IdentificationError(
                "a payload expects a mass above 0 kg, a centre x, y, z and edges of a box in m, "
                f"got {self.mass!r}, {self.com!r}, {self.size!r}"
            )
        if min(self.size) < 0:
            raise IdentificationError(
                f"a payload expects edges from 0 m up, got {self.size}; give lengths"
            )

    def place(self, lib: Library) -> int:
        """Index of the link that carries it."""
        link = self.link or lib.manifest.tip_frame.link
        if link not in lib.link_names:
            raise IdentificationError(
                f"no moving link of '{lib.name}' is called '{link}'; the payload can hang on "
                f"{', '.join(lib.link_names)}"
            )
        return lib.link_names.index(link)

    def pi(self, lib: Library) -> Array:
        """Its parameters, to be added to the π of the robot, (10 n,)."""
        P = np.eye(4)
        P[:3, 3] = P[3, :3] = self.com
        P[:3, :3] = np.diag(np.square(self.size)) / 12 + np.outer(self.com, self.com)
        blocks = np.zeros((lib.n_links, 4, 4))
        blocks[self.place(lib)] = self.mass * P
        return pi_from_pseudo(lib, blocks)

    def facts(self, lib: Library) -> dict[str, Any]:
        """The box as a JSON object."""
        link = lib.link_names[self.place(lib)]
        size, com = list(self.size), list(self.com)
        return {"mass": self.mass, "com": com, "size": size, "link": link}


def pi_from_pseudo(lib: Library, P: Array) -> Array:
    """Parameters π (10 n,) of pseudo-inertias (n, 4, 4), inverse of `Library.pseudo_inertia`."""
    units = lib.pseudo_inertia(np.tile(np.eye(N_PARAMETERS), (1, lib.n_links)))[:, 0]
    rows, columns = np.triu_indices(4)
    return np.asarray(np.linalg.solve(units[:, rows, columns].T, P[:, rows, columns].T).T.ravel())


def read_payload(text: str) -> Box:
    """Read a payload of an option: MASS,CX,CY,CZ[,LX,LY,LZ] in kg and m, or a TOML file."""
    if text.endswith(".toml"):
        return record_from_toml(Box, Path(text), f"the payload '{text}'", IdentificationError)
    numbers = numbers_of(text)
    if len(numbers) not in {4, 7}:
        raise IdentificationError(
            "--payload expects MASS,CX,CY,CZ or MASS,CX,CY,CZ,LX,LY,LZ in kg and m, or a TOML with "
            f"{', '.join(Box.__struct_fields__)}; got '{text}'"
        )
    table = {"mass": numbers[0], "com": numbers[1:4], "size": numbers[4:] or [0, 0, 0]}
    return record_from_table(Box, table, "--payload", IdentificationError)
