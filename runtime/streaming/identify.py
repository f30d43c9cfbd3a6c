"""Identification of a log that stays in its file; what is held does not grow with its length.

    pass 1  windows of every part: weights, residual correlations, pictures
    pass 2  all rows of the training part → one triangular factor (`runtime.statistics`)
    pass 3  all rows of the test part → ‖τ − τ̂‖ of the answer

Blocks are prepared as the whole log would be (`blocks`), so that the factor is that of the whole.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from runtime.assembly import Assembly, require_enough
from runtime.errors import IdentificationError
from runtime.friction import geared
from runtime.identification import Identification, Streamed, identify_assembled
from runtime.library import Array, Library
from runtime.metrics import TorqueError, torque_error_of
from runtime.objective import samples_of, thesis_weights
from runtime.plausibility import require_plausible
from runtime.prior_file import PriorFile
from runtime.problem import Problem
from runtime.recording import (
    Friction,
    Preparation,
    Recording,
    Split,
    StreamedRecording,
    check_consistency,
)
from runtime.recording.recording import ALL
from runtime.residuals import residuals
from runtime.statistics import Statistics, compress
from runtime.streaming.blocks import Blocks, blocks_of, head_of
from runtime.threads import one_blas_thread

WINDOWS, LENGTH = 24, 4096
"""Windows of a part and prepared rows in each: ten of them give noise and correlations to 1 %."""
TOGETHER = 16
"""Factors that wait until they are joined."""


@one_blas_thread
def identify_streamed(
    log: StreamedRecording,
    lib: Library,
    *,
    preparation: Preparation | None = None,
    splitting: Split | None = None,
    friction_columns: Friction | None = None,
    prior: PriorFile | None = None,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """The most probable consistent model ("map") of a log in its file; arguments as `identify`.

    `train`, `validation` and `test` of the result are windows; `streamed` counts all rows.

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
    passes = _Passes(blocks, spans, tell)
    problem = Problem(
        lib=lib,
        train=train,
        validation=held,
        weights=thesis_weights(train.tau),
        start=lib.lam0,
        compressor=passes.compressed,
    )
    require_enough(train, lib)
    recordings = (parts["train"], parts["validation"], parts["test"])
    assembly = Assembly(problem, recordings, terms, one_run=True)
    result = identify_assembled(assembly, "map", prior=prior)
    before, after, tested = passes.errors(result)
    samples = {
        "train": passes.trained,
        "validation": len(parts["validation"]),
        "test": tested,
    }
    note = (
        f"streamed {log.rows} rows in {len(blocks)} blocks: the fit "
        f"has seen all {passes.trained} training samples, the torque error all {tested} test "
        f"samples; weights and residual correlations come from up to {WINDOWS} windows of "
        f"{LENGTH} samples"
    )
    whole = Streamed(samples, spans, before, after)
    return replace(result, streamed=whole, notes=(*result.notes, note))


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
        name: (instant(getattr(parts, name)[0]), instant(getattr(parts, name)[1]))
        for name in ("train", "validation", "test")
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


@dataclass(slots=True)
class _Passes:
    """The passes over all rows of a part."""

    blocks: Blocks
    spans: dict[str, tuple[float, float]]
    tell: Callable[[str], None]
    trained: int = 0

    def compressed(self, weights: Array) -> Statistics:
        """The factor of the training part."""
        lib = self.blocks.lib
        self.tell("compressing the training part")
        whole = _joined(
            compress(lib, samples_of(part, lib), weights)
            for part in self.blocks.parts(*self.spans["train"])
        )
        self.trained = round(whole.n_samples)
        return whole

    def errors(self, result: Identification) -> tuple[TorqueError, TorqueError, int]:
        """Errors of the first guess and of the answer over the test part, and its samples."""
        lib = self.blocks.lib
        self.tell("predicting the test part")
        scale, before, after = np.zeros((3, lib.n_joints))
        count = 0
        for part in self.blocks.parts(*self.spans["test"]):
            samples = samples_of(part, lib)
            count += len(samples)
            scale += np.sum(samples.tau**2, axis=0)
            before += np.sum(residuals(lib, samples, lib.pi0, np.zeros(0)) ** 2, axis=0)
            after += np.sum(residuals(lib, samples, result.pi, result.phi) ** 2, axis=0)
        size = np.sqrt(scale)
        return (
            torque_error_of(np.sqrt(before), size, count),
            torque_error_of(np.sqrt(after), size, count),
            count,
        )


def _joined(factors: Iterable[Statistics]) -> Statistics:
    """All factors together, of which few are held at a time."""
    held: list[Statistics] = []
    for factor in factors:
        held.append(factor)
        if len(held) == TOGETHER:
            held = [held[0].merged(*held[1:])]
    return held[0].merged(*held[1:])
