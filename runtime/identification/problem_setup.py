"""A recording, a library and the choices of its user → one `Problem` and the parts it came from.

Everything that does not depend on the method happens here: plausibility, preparation, friction
columns, split, weights, first guess. Several methods of one assembly see the same numbers.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import IdentificationError
from runtime.estimators.problem import Bench, Problem
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.friction import geared
from runtime.recording.plausibility import require_plausible
from runtime.recording.preprocessing import prepare, prepare_power, split
from runtime.simulation.controller_file import ClosedLoop

PARTS = ("train", "validation", "test")


@dataclass(frozen=True, slots=True)
class Assembly:
    """What any method can be given.

    Attributes:
        problem: for the method.
        parts: prepared training, validation and test recording.
        friction: names and widths of the friction columns.
        one_run: the parts belong to one recording.
        pieces: of "train", "validation" or "test", where `parts` hold only some of the rows.
    """

    problem: Problem
    parts: tuple[Recording, Recording, Recording]
    friction: Friction
    one_run: bool
    pieces: Callable[[str], Iterable[Recording]] | None = None

    def recordings(self, name: str) -> Iterable[Recording]:
        """All rows of "train", "validation" or "test", a piece at a time."""
        if self.pieces is not None:
            return self.pieces(name)
        return (self.parts[PARTS.index(name)],)


def assemble(
    recording: Recording,
    lib: Library,
    *,
    preparation: Preparation | None = None,
    splitting: Split | None = None,
    friction_columns: Friction | None = None,
    validation: Recording | None = None,
    test: Recording | None = None,
    lam0: ArrayLike | None = None,
    loop: ClosedLoop | None = None,
    seed: int = 0,
    progress: Callable[[int, float], None] | None = None,
) -> Assembly:
    """Prepare, split and weigh a recording; arguments as for `identify`.

    Raises:
        RuntimeFault: the data or options do not make an identification problem.
    """
    require_plausible(recording, lib)
    recipe = recording.recipe
    terms = friction_columns or (recipe.friction if recipe else None) or Friction(columns=())
    terms = geared(terms, recording)
    usual = preparation or recording.preparation
    done = [
        _prepared(r, preparation, terms, lib)
        for r in (recording, validation, test)
        if r is not None
    ]
    if validation is None or test is None:
        if (validation is None) != (test is None):
            raise IdentificationError("give both a validation and a test recording, or neither")
        parts = split(done[0], splitting or (recipe.split if recipe else None) or Split())
    else:
        parts = (done[0], done[1], done[2])
    train, held = samples_of(parts[0], lib), samples_of(parts[1], lib)
    samples_of(parts[2], lib)
    if usual.regressor == "energy":
        train, held = _of_power(recording, validation, parts, usual, terms, lib)
    require_enough(train, lib)
    problem = Problem(
        lib=lib,
        train=train,
        validation=held,
        weights=thesis_weights(train.tau),
        start=lib.lam0 if lam0 is None else np.asarray(lam0, dtype=float),
        seed=seed,
        progress=progress,
        bench=Bench(
            recording,
            terms,
            _aligned(parts[0], lib, preparation, terms),
            (parts[0].t[0], parts[0].t[-1]),
            loop,
        ),
    )
    return Assembly(problem, (parts[0], parts[1], parts[2]), terms, test is None)


def _of_power(
    recording: Recording,
    validation: Recording | None,
    parts: tuple[Recording, Recording, Recording],
    preparation: Preparation,
    terms: Friction,
    lib: Library,
) -> tuple[Samples, Samples]:
    """The samples of power at the instants of the first two parts.

    Raises:
        IdentificationError: the recording was prepared before.
    """
    if recording.rows is not None or recording.columns is not None:
        raise IdentificationError(
            "rows of energy are made from the recording as read, but this one is prepared; give "
            "the log itself"
        )
    first = prepare_power(recording, preparation, terms, lib=lib)
    second = first
    if validation is not None:
        second = prepare_power(validation, preparation, terms, lib=lib)
    taken = (
        whole.take(np.isin(whole.t, part.t), "Took the instants of a part.")
        for whole, part in zip((first, second), parts, strict=False)
    )
    return tuple(samples_of(part, lib) for part in taken)  # type: ignore[return-value]


def require_enough(train: Samples, lib: Library) -> None:
    """Fewer equations than unknowns determine nothing, whatever the method.

    Raises:
        IdentificationError: so it is.
    """
    equations, unknowns = train.tau.size, len(lib.base_columns) + train.columns[0].size
    if equations < unknowns:
        raise IdentificationError(
            f"the {len(train)} training samples give {equations} equations for {unknowns} "
            "unknowns (base parameters and friction); record for longer, or train on more of it"
        )


def _prepared(
    recording: Recording, preparation: Preparation | None, terms: Friction, lib: Library
) -> Recording:
    if recording.columns is not None:
        return prepare(recording, preparation)
    return prepare(recording, preparation, terms, lib=lib)


def _aligned(
    part: Recording, lib: Library, preparation: Preparation | None, terms: Friction
) -> Callable[[Recording], Samples]:
    """Prepares another recording of the same clock like the first and takes the rows of `part`."""
    usual = preparation or part.preparation
    usual = replace(usual, rest_speed=None)

    def rows(other: Recording) -> Samples:
        done = _prepared(other, usual, terms, lib)

        def at(values: Array) -> Array:
            flat = values.reshape(len(done), -1).T
            taken = np.stack([np.interp(part.t, done.t, row) for row in flat], axis=1)
            return taken.reshape(len(part), *values.shape[1:])

        return samples_of(done.mapped(at, "Taken at the rows of the training.", t=part.t), lib)

    return rows
