"""A body in the hand of a robot: its share of the torques, and a box around it.

The body is rigid in a moving link. It adds its ten parameters to those of the link; its box keeps
a distance from the capsules of the other links and from a table. Files are read elsewhere.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Array
from runtime.library.parameters import link_columns

EMPTY_HAND = "empty hand"
"""What a certificate states of the load where no body is carried."""


@dataclass(frozen=True, slots=True)
class CarriedBox:
    """A box fixed in a link; picklable.

    Attributes:
        center: in the link's frame, (3,) m.
        rotation: axes of the box in the link's frame, rows of (3, 3).
        size: lengths of its edges, (3,) m.

    Raises:
        IdentificationError: an edge is not a finite length above 0.
    """

    center: tuple[float, ...]
    rotation: tuple[tuple[float, ...], ...]
    size: tuple[float, ...]

    def __post_init__(self) -> None:
        if not (np.isfinite([*self.center, *self.size]).all() and min(self.size) > 0):
            raise IdentificationError(
                "the box of a carried body needs a finite place and edges above 0 m, got edges of "
                f"{', '.join(f'{x:g}' for x in self.size)} m"
            )


@dataclass(frozen=True, slots=True)
class CarriedBody:
    """A body that moves with a link; picklable.

    Attributes:
        link: index of the moving link that carries it.
        pi: its parameters in that link's frame, (10,): kg, kg·m ×3, kg·m² ×6.
        box: box around it, or None where its shape is not known.
    """

    link: int
    pi: tuple[float, ...]
    box: CarriedBox | None = None

    @property
    def sentence(self) -> str:
        """Mass and box, for certificates."""
        if self.box is None:
            return f"{self.pi[0]:g} kg, no box"
        edges = " x ".join(f"{1e3 * edge:g}" for edge in self.box.size)
        return f"{self.pi[0]:g} kg in a box of {edges} mm"


def with_load(pi: Array, body: CarriedBody | None) -> Array:
    """Parameters of the links with a carried body, π_link + π_body.

    pi (10 n,) → (10 n,).
    """
    if body is None:
        return pi
    loaded = pi.copy()
    loaded[link_columns(body.link)] += body.pi
    return loaded
