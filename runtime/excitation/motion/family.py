"""Bases of motions: what each of them provides, and the record by which a user selects it."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from runtime.library import Array, Library


class Basis(Hashable, Protocol):
    """A family of functions, hashable; a motion uses as many as it has coefficients per joint."""

    @property
    def name(self) -> str:
        """Key in `BASES`."""

    @property
    def zero_jerk(self) -> bool:
        """The third derivative is zero at both ends."""

    @property
    def is_symmetric(self) -> bool:
        """φ(s) = φ(1 − s): half of the motion determines the whole."""

    @property
    def equation(self) -> str:
        """Equation as text, for files."""

    def size(self, harmonics: int) -> int:
        """Number of functions per joint."""

    def at(self, lib: Library, size: int, t: Array, duration: float) -> Array:
        """Functions in time.

        Args:
            lib: the robot, whose kernel the cosines use.
            size: number of functions.
            t: times, (N,) s.
            duration: t_f, s.

        Returns:
            φ_m and three time derivatives, (N, size, 4).
        """

    def derivatives(self, orders: int, size: int, s: Array) -> Array:
        """Derivatives by s.

        Args:
            orders: number of derivatives, the function itself included.
            size: number of functions.
            s: t / t_f, (N,), 0 ≤ s ≤ 1.

        Returns:
            d^k φ_m/ds^k, k < orders, (orders, N, size).
        """

    def bound(self, order: int, size: int) -> Array:
        """Largest size of a derivative.

        Args:
            order: k of the derivative.
            size: number of functions.

        Returns:
            Upper bounds of |d^k φ_m/ds^k| over 0 ≤ s ≤ 1, (size,).
        """


class ClosedForm:
    """A basis whose functions in time follow from its derivatives by s."""

    __slots__ = ()

    def at(self: Basis, lib: Library, size: int, t: Array, duration: float) -> Array:
        """Functions in time, by the closed form.

        Args:
            lib: unused.
            size: number of functions.
            t: times, (N,) s.
            duration: t_f, s.

        Returns:
            φ_m and three time derivatives, (N, size, 4).
        """
        del lib
        derivatives = self.derivatives(4, size, t / duration)
        powers = duration ** -np.arange(len(derivatives), dtype=float)
        return np.moveaxis(derivatives * powers[:, None, None], 0, 2)


@dataclass(frozen=True, slots=True)
class BasisFamily:
    """A basis as users select it."""

    name: str  # word by which a user selects it, as in trajectory files
    sentence: str  # what the functions are, for help texts
    make: Callable[[bool], Basis]  # the basis; true for a third derivative of zero at both ends
