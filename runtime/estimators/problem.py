"""One identification problem and one answer to it: what every method takes and gives."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from runtime.errors import IdentificationError, NeedsError
from runtime.estimators.friction_net import FrictionNet
from runtime.estimators.optimizers import Trace
from runtime.estimators.regression import Statistics, compress_all
from runtime.estimators.regression.coloured_noise import Colour
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library
from runtime.recording import Friction, Recording
from runtime.simulation.controller_file import ClosedLoop


@dataclass(frozen=True, slots=True)
class Origin:
    """Origin of the samples, for methods that simulate or filter.

    Attributes:
        recording: the training recording before it was prepared and split.
        friction: names and width of the friction columns.
        aligned: another recording on the same clock, prepared alike → its rows of the training
            samples.
        span: first and last instant of the training samples, s.
        controller: closed loop under which the recording was made, where it is known.
    """

    recording: Recording
    friction: Friction
    aligned: Callable[[Recording], Samples]
    span: tuple[float, float]
    controller: ClosedLoop | None = None


@dataclass(frozen=True)  # no slots: the statistics are computed once and kept
class Problem:
    """Same data, same weights, same start for every method.

    Attributes:
        train, validation: samples to fit and to stop on.
        weights: diagonal of W, (n,).
        start: λ of the first guess, (10 n,).
        seed: of mini-batches.
        progress: called with iteration and best validation loss.
        origin: of the samples, for methods that simulate or filter.
        pieces: of "train" or "validation", where `train` and `validation` hold only some of the
            samples.
        terms: friction columns, where there is no origin that states them.
    """

    lib: Library
    train: Samples
    validation: Samples
    weights: Array
    start: Array
    seed: int = 0
    progress: Callable[[int, float], None] | None = None
    origin: Origin | None = None
    pieces: Callable[[str], Iterable[Samples]] | None = None
    terms: Friction | None = None

    def statistics(self, weights: Array | None = None) -> Statistics:
        """Compressed training data, with the problem's weights unless others are given."""
        return self._weighted if weights is None else self._compressed(weights)

    @cached_property
    def _weighted(self) -> Statistics:
        return self._compressed(self.weights)

    def _compressed(self, weights: Array) -> Statistics:
        return compress_all(self.lib, self.samples("train"), weights)

    def held(self) -> Statistics:
        """Compressed held-out data with the problem's weights."""
        return compress_all(self.lib, self.samples("validation"), self.weights)

    def samples(self, part: str) -> Iterable[Samples]:
        """All samples of "train" or "validation", a piece at a time."""
        if self.pieces is not None:
            return self.pieces(part)
        return (self.train if part == "train" else self.validation,)

    def controlled(self, method: str) -> tuple[Origin, ClosedLoop]:
        """Origin of the samples, and the closed loop under which they were recorded.

        Args:
            method: its name, for the message.

        Returns:
            Both, where the controller is known.

        Raises:
            NeedsError: the controller is unknown.
        """
        if self.origin is None or self.origin.controller is None:
            raise NeedsError(
                f"the method {method} simulates the robot under its controller and needs its "
                "description; give the controller's gains and the reference motion "
                "by --controller FILE.toml"
            )
        return self.origin, self.origin.controller

    @property
    def friction_names(self) -> tuple[str, ...]:
        """Names of the friction columns; empty where they are unknown."""
        terms = self.origin.friction if self.origin else self.terms
        return terms.columns if terms else ()


@dataclass(frozen=True, slots=True)
class Fit:
    """What a method found.

    Attributes:
        pi: (10 n,).
        phi: friction coefficients (n, k), k = 0 without friction.
        lam: (10 n,), None where π has none.
        status: a sentence.
        optimum: smallest loss of any consistent model, where the method has found it anyway.
        notes: sentences about what was done on the way.
        weights: diagonal of W, where the method has its own.
        statistics: of the training samples with these weights.
        colour: of the noise with these weights, where the method has asked for it.
        net: friction beyond φ, where the method learned one.
    """

    pi: Array
    phi: Array
    lam: Array | None
    status: str
    iterations: int | None = None
    trace: Trace | None = None
    optimum: float | None = None
    notes: tuple[str, ...] = ()
    weights: Array | None = None
    statistics: Statistics | None = None
    colour: Colour | None = None
    net: FrictionNet | None = None

    def noise(self) -> tuple[Array, Colour]:
        """Diagonal of W (n,) and noise of the weighted rows, of a method that estimates both.

        Raises:
            IdentificationError: the method estimates no noise.
        """
        if self.weights is None or self.colour is None:
            raise IdentificationError(
                f"expected an estimate of the noise, got none ({self.status}); use the method map"
            )
        return self.weights, self.colour

    @property
    def n_eff(self) -> float | None:
        """Independent training samples, where the colour of the noise is known."""
        if self.statistics is None or self.colour is None:
            return None
        return self.statistics.n_samples / self.colour.inflation


def best_friction(statistics: Statistics, pi: Array, shape: tuple[int, ...]) -> Array:
    """Friction coefficients (n, k) that fit best at fixed π."""
    columns = statistics.factor[:, statistics.n_base :]
    rest = -statistics.residual(pi, np.zeros(columns.shape[1]))
    solution = np.linalg.lstsq(columns, rest, rcond=None)[0]
    return np.asarray(solution, dtype=float).reshape(shape)
