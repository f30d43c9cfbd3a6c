"""Identification of a log that stays in its file; what is held does not grow with its length.

    pass 1  windows of every part: first weights, residual correlations, pictures
    pass 2  all rows of the training part → one triangular factor (`runtime.estimators.regression`)
    pass 3  all rows of the test part → ‖τ − τ̂‖ of the answer

Blocks are prepared as the whole log would be (`blocks`), so that the factor is that of the whole.
Methods that need no more of the samples than factors and sums go the same way.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.descent.drivers import Preset
from runtime.estimators.descent.fit import in_batches
from runtime.estimators.methods import chosen_method, require_method
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import Problem
from runtime.estimators.regression.residuals import residuals
from runtime.estimators.regression.samples import (
    FROM_STATISTICS,
    Samples,
    samples_of,
    thesis_weights,
)
from runtime.identification.long_logs.blocks import Blocks, blocks_of, head_of
from runtime.identification.metrics import TorqueError, torque_error_of
from runtime.identification.problem_setup import PARTS, Assembly, require_enough
from runtime.identification.single_log import Identification, Streamed, identify_assembled
from runtime.library import Array, Library
from runtime.parallel import one_blas_thread
from runtime.recording import (
    Friction,
    Preparation,
    Recording,
    Split,
    StreamedRecording,
    check_consistency,
)
from runtime.recording.friction import geared
from runtime.recording.plausibility import require_plausible
from runtime.recording.recording import ALL

WINDOWS, LENGTH = 24, 4096
"""Windows of a part and prepared rows in each: ten of them give noise and correlations to 1 %."""


def require_streamable(method: str, preset: str | Preset | None = None) -> None:
    """Refuse a method that needs the samples themselves.

    Raises:
        IdentificationError: it does, or there is no such method.
    """
    require_method(method)
    if method not in FROM_STATISTICS or in_batches(preset):
        what = (
            f"the method {method}"
            if method not in FROM_STATISTICS
            else "a preset with mini-batches"
        )
        raise IdentificationError(
            f"{what} needs the samples one by one, which a streamed log does not hold; choose one "
            f"of {', '.join(FROM_STATISTICS)} (adam with the preset full), or use --no-stream"
        )


@dataclass(frozen=True, slots=True)
class Passes:
    """A streamed log, assembled: what methods are given, and where all its rows are.

    Attributes:
        assembly: its parts are windows.
        blocks: of the log.
        spans: part → its first instant and that of the next part.
        tell: is told what is being done.
    """

    assembly: Assembly
    blocks: Blocks
    spans: dict[str, tuple[float, float]]
    tell: Callable[[str], None]

    def counts(self) -> dict[str, int]:
        """Part → its rows, as prepared."""
        return {name: sum(map(len, self.assembly.recordings(name))) for name in PARTS}

    def errors(self, result: Identification) -> tuple[TorqueError, TorqueError]:
        """Errors of the first guess and of the answer over the test part."""
        lib = self.blocks.lib
        self.tell("predicting the test part")
        scale, before, after = np.zeros((3, lib.n_joints))
        count = 0
        for part in self.assembly.recordings("test"):
            samples = samples_of(part, lib)
            count += len(samples)
            scale += np.sum(samples.tau**2, axis=0)
            before += np.sum(residuals(lib, samples, lib.pi0, np.zeros(0)) ** 2, axis=0)
            after += np.sum(residuals(lib, samples, result.pi, result.phi) ** 2, axis=0)
        size = np.sqrt(scale)
        return (
            torque_error_of(np.sqrt(before), size, count),
            torque_error_of(np.sqrt(after), size, count),
        )

    def note(self, counts: dict[str, int]) -> str:
        """What is of all rows, and what of windows."""
        return (
            f"streamed {self.blocks.log.rows} rows in {len(self.blocks)} blocks: the fit "
            f"has seen all {counts['train']} training samples, the torque error all "
            f"{counts['test']} test samples; first weights and residual correlations come from up "
            f"to {WINDOWS} windows of {LENGTH} samples"
        )


@one_blas_thread
def assemble_streamed(
    log: StreamedRecording,
    lib: Library,
    *,
    preparation: Preparation | None = None,
    splitting: Split | None = None,
    friction_columns: Friction | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Passes:
    """A log in its file as a problem; arguments as for `assemble`.

    Raises:
        RuntimeFault: the data or options do not make an identification problem.
    """
    tell = progress or (lambda _: None)
    recipe = log.recipe
    preparation = preparation or (recipe.preparation if recipe else Preparation())
    if preparation.regressor == "energy":
        raise IdentificationError(
            "rows of energy are made of a log that is read as a whole, but this one is streamed; "
            "use --regressor momentum or --no-stream"
        )
    terms = friction_columns or (recipe.friction if recipe else None) or Friction(columns=())
    terms = geared(terms, _head(log, lib))
    blocks = blocks_of(log, lib, preparation, terms)
    tell(f"windows of {len(blocks)} blocks")
    spans = _spans(blocks, splitting or (recipe.split if recipe else None) or Split())
    parts = {name: _windows(blocks, name, *span) for name, span in spans.items()}
    train, held = samples_of(parts["train"], lib), samples_of(parts["validation"], lib)

    def recordings(name: str) -> Iterator[Recording]:
        tell(f"passing over the {name} part")
        return blocks.parts(*spans[name])

    def samples(name: str) -> Iterator[Samples]:
        return (samples_of(part, lib) for part in recordings(name))

    problem = Problem(
        lib=lib,
        train=train,
        validation=held,
        weights=thesis_weights(train.tau),
        start=lib.lam0,
        seed=seed,
        pieces=samples,
        terms=terms,
    )
    require_enough(train, lib)
    windows = (parts["train"], parts["validation"], parts["test"])
    assembly = Assembly(problem, windows, terms, one_run=True, pieces=recordings)
    return Passes(assembly, blocks, spans, tell)


@one_blas_thread
def identify_streamed(
    log: StreamedRecording,
    lib: Library,
    method: str | None = None,
    *,
    preset: str | Preset | None = None,
    preparation: Preparation | None = None,
    splitting: Split | None = None,
    friction_columns: Friction | None = None,
    prior: PriorFile | None = None,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Find π of a log in its file, by one of `FROM_STATISTICS`; arguments as for `identify`.

    `train`, `validation` and `test` of the result are windows; `streamed` counts all rows.

    Raises:
        RuntimeFault: the data or options do not make an identification problem.
    """
    method = chosen_method(method, preset, prior)
    require_streamable(method, preset)
    passes = assemble_streamed(
        log,
        lib,
        preparation=preparation,
        splitting=splitting,
        friction_columns=friction_columns,
        progress=progress,
    )
    result = identify_assembled(passes.assembly, method, preset=preset, prior=prior)
    before, after = passes.errors(result)
    counts = passes.counts()
    whole = Streamed(counts, passes.spans, before, after)
    return replace(result, streamed=whole, notes=(*result.notes, passes.note(counts)))


def _head(log: StreamedRecording, lib: Library) -> Recording:
    """The first rows, checked for units, signs and the robot."""
    head = check_consistency(head_of(log))
    require_plausible(head, lib)
    return head


def _spans(blocks: Blocks, parts: Split) -> dict[str, tuple[float, float]]:
    """Part → its first instant and that of the next part."""
    first, last = blocks.span()

    def instant(share: float) -> float:
        end = blocks.half_step if share == 1.0 else 0.0  # the last instant belongs to the log
        return first + share * (last - first) + end

    return {
        name: (instant(getattr(parts, name)[0]), instant(getattr(parts, name)[1])) for name in PARTS
    }


def _windows(blocks: Blocks, name: str, first: float, last: float) -> Recording:
    """Windows spread evenly over a part, as one recording with holes."""
    within = blocks.within(first, last)
    chosen = np.unique(np.linspace(within.start, within.stop - 1, WINDOWS).round().astype(int))
    found = []
    for index in chosen:
        block = blocks.prepared(int(index))
        if block is None:
            continue
        inside = np.flatnonzero((block.t >= first) & (block.t < last))[:LENGTH]
        if inside.size:
            found.append(block.take(inside, "Took a window."))
    if not found:
        raise IdentificationError(
            f"no sample of {blocks.log.name} is left in the {name} part; use another --split"
        )
    head = found[0]
    sentence = f"Took {len(found)} windows of the {name} part ({sum(map(len, found))} rows)."

    def joined(key: str) -> Array | None:
        values = [getattr(part, key) for part in found]
        return None if values[0] is None else np.concatenate(values)

    signals = {key: joined(key) for key in ("t", *ALL)}
    return head.replace(**signals, name=f"{head.name}/{name}").noted(sentence)
