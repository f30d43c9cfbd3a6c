"""Rows of a log that stays in its file, in memory that does not grow with its length.

    pass 1  windows of every part: first weights, residual correlations, pictures
    pass 2  all rows of the training part → one triangular factor (`runtime.estimators.regression`)
    pass 3  all rows of the test part → ‖τ − τ̂‖ of the answer
    on request all rows of all parts → factor of the second fit (`single_log.refitted`)

Blocks are prepared as the whole log would be (`blocks`), so that the factor is that of the whole.
Every method that needs only factors and sums of the samples can be used. No block reaches beyond
its part, so that no row of the test part has an effect on the others
(`runtime.recording.preprocessing.parts` does the same for a log in memory).
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.descent.adam import Preset
from runtime.estimators.methods import (
    chosen_method,
    methods_from_statistics,
    require_method,
)
from runtime.estimators.regression.samples import residuals, samples_of
from runtime.identification.identified import Identification, WholeLog
from runtime.identification.long_logs.blocks import REACH, Blocks, blocks_of, head_of
from runtime.identification.metrics import TorqueError, torque_error_of
from runtime.identification.problem_setup import (
    PARTS,
    Assembly,
    FitOfAssembly,
    assembled,
)
from runtime.identification.progress import SILENT, Progress
from runtime.identification.settings import Settings, bare_settings, shares_of, terms_of
from runtime.library import Array, Library
from runtime.recording import (
    Friction,
    Preparation,
    Recording,
    Split,
    StreamedRecording,
    check_consistency,
)
from runtime.recording.consistency import require_plausible
from runtime.recording.friction import geared
from runtime.recording.preprocessing.parts import for_part, span_of_part, validation_start
from runtime.recording.recording import ARRAYS

WINDOWS, LENGTH = 24, 4096
"""Windows of a part, and prepared rows in each; ten of them give noise and correlations to 1 %."""
WHOLE_ONLY = ("validation", "test", "inputs", "robust")
"""Fields of `Settings` that need a log held in memory."""


@dataclass(frozen=True, slots=True, eq=False)
class StreamedPart:
    """One part of a streamed log.

    Attributes:
        blocks: blocks of its rows, or of those of the training part, which include it.
        span: first and last instant of its prepared rows [s].
        first: first instant that is taken of the blocks [s].
    """

    blocks: Blocks
    span: tuple[float, float]
    first: float = -np.inf

    def recordings(self) -> Iterator[Recording]:
        """Prepared rows, one block at a time in the order of time."""
        return self.blocks.parts(self.first, np.inf)

    def count(self) -> int:
        """Number of prepared rows."""
        return self.blocks.count(self.first)


def parts_of_log(
    log: StreamedRecording,
    lib: Library,
    preparation: Preparation,
    terms: Friction,
    shares: Split,
    is_joined: bool = False,
    rate_hz: float | None = None,
) -> dict[str, StreamedPart]:
    """Divide a streamed log into its parts."""
    start = float(log.instants([0], REACH)[0])
    end = float(log.block(max(log.rows - REACH, 0), log.rows).t[-1])
    duration = end - start or 1.0
    rate = head_of(log).rate_hz if rate_hz is None else rate_hz

    def share_of(row: int) -> float:
        return float(log.instants([row], REACH)[0] - start) / duration

    @cache
    def row(share: float) -> int:
        return log.rows if share == 1.0 else first_row(share_of, log.rows, share)

    def part(name: str, share: tuple[float, float]) -> StreamedPart:
        rows = row(share[0]), row(share[1])
        if rows[0] >= rows[1]:
            raise RecordingError(
                f"no row of {log.name} is in the {name} part, {share[0]:g} to {share[1]:g} of the "
                "duration; use another --split"
            )
        short = for_part(preparation, (share[1] - share[0]) * duration)
        span = span_of_part((start, end), share, short)
        guarded = short.trim_s is None
        kept = (
            span[0] if guarded and share[0] > 0.0 else -np.inf,
            span[1] if guarded and share[1] < 1.0 else np.inf,
        )
        return StreamedPart(blocks_of(log, lib, short, terms, rows, kept, rate), span)

    train = part("train", shares.joined() if is_joined else shares.train)
    if shares.is_everything:
        return dict.fromkeys(("train", "validation", "test"), train)
    if is_joined:
        low = validation_start(shares, train.span)
        validation = StreamedPart(train.blocks, (low, train.span[1]), low)
    else:
        validation = part("validation", shares.validation)
    return {"train": train, "validation": validation, "test": part("test", shares.test)}


def first_row(share_of: Callable[[int], float], count: int, share: float) -> int:
    """First row whose share of the duration is not below a bound.

    The search begins where a uniform clock has that row and doubles its steps from there, since
    every share is read from the file.
    """
    place = min(max(int(np.ceil(share * (count - 1))), 0), count - 1)
    is_later = share_of(place) < share
    low, high, step = (place + 1, count, 1) if is_later else (0, place, 1)
    while low < high:
        probe = min(low + step, high) - 1 if is_later else max(high - step, low)
        is_below = share_of(probe) < share
        low, high = (probe + 1, high) if is_below else (low, probe)
        if is_below != is_later:
            break
        step *= 2
    return bisect_left(range(count), share, low, high, key=share_of)


def require_streamable(method: str, preset: str | Preset | None = None) -> None:
    """Refuse a method that needs the samples themselves."""
    record = require_method(method)
    if record.needs_samples(preset):
        what = "a preset with mini-batches" if record.from_statistics else f"the method {method}"
        raise IdentificationError(
            f"{what} needs the samples one by one, which a streamed log does not hold; choose one "
            f"of {', '.join(methods_from_statistics())} (adam with the preset full), "
            "or use --no-stream"
        )


@one_blas_thread
def assemble_streamed(
    log: StreamedRecording,
    lib: Library,
    settings: Settings | str | None = None,
    *,
    progress: Progress = SILENT,
    is_joined: bool = False,
    **keywords: Any,
) -> Assembly:
    """Assemble the problem of a log that stays in its file."""
    chosen = bare_settings(settings, keywords)
    chosen.require_default(WHOLE_ONLY, "a streamed log")
    method = chosen_method(chosen.method, chosen.preset, chosen.prior)
    require_streamable(method, chosen.preset)
    recipe = log.recipe
    preparation = chosen.preparation or (recipe.preparation if recipe else Preparation())
    if preparation.regressor == "energy":
        raise IdentificationError(
            "rows of energy need the whole log in memory, but this one is streamed; use "
            "--regressor momentum or --no-stream"
        )
    head = check_consistency(head_of(log))
    require_plausible(head, lib)
    terms = geared(terms_of(head, chosen), head, lib)
    shares = shares_of(log, chosen)
    whole = parts_of_log(log, lib, preparation, terms, shares, is_joined, head.rate_hz)
    progress.step("windows of the parts")

    def pieces(name: str) -> Iterator[Recording]:
        progress.step(f"passing over the {name} part")
        return whole[name].recordings()

    train, validation, test = (_windows(whole[name], name) for name in PARTS)
    assembly = assembled(
        (train, validation, test),
        lib,
        chosen,
        terms,
        preparation.regressor,
        is_joined=is_joined,
        pieces=pieces,
    )
    counts = {name: part.count() for name, part in whole.items()}
    spans = {name: part.span for name, part in whole.items()}
    blocks = {id(part.blocks): len(part.blocks) for part in whole.values()}
    note = (
        f"streamed {log.rows} rows in {sum(blocks.values())} blocks: the first fit uses all "
        f"{counts['train']} training samples, the torque error all {counts['test']} test samples; "
        "the first weights and the residual correlations come from up to "
        f"{WINDOWS} windows of {LENGTH} samples"
    )

    def finish(result: Identification, _: FitOfAssembly) -> Identification:
        errors = _errors(assembly, result)
        streamed = WholeLog(counts, spans, *errors)
        return replace(result, streamed=streamed, notes=(*result.notes, note))

    return replace(assembly, source_note=note, finish=finish)


def _errors(assembly: Assembly, result: Identification) -> tuple[TorqueError, ...]:
    """Torque errors over the whole test part: first guess, result, URDF with friction."""
    lib, fit = result.lib, result.trained or result
    models = [(lib.pi0, np.zeros(0)), (fit.pi, fit.phi)]
    if result.urdf_phi is not None:
        models.append((lib.pi0, result.urdf_phi))
    scale, rests = np.zeros(lib.n_joints), np.zeros((len(models), lib.n_joints))
    count = 0
    for part in assembly.recordings("test"):
        samples = samples_of(part, lib)
        count += len(samples)
        scale += np.sum(samples.tau**2, axis=0)
        for k, (pi, phi) in enumerate(models):
            rests[k] += np.sum(residuals(lib, samples, pi, phi) ** 2, axis=0)
    size = np.sqrt(scale)
    return tuple(torque_error_of(np.sqrt(rest), size, count) for rest in rests)


def _windows(part: StreamedPart, name: str) -> Recording:
    """Windows spread evenly over a part, joined to one recording with gaps in time.

    All blocks of the part are prepared and stored, since the passes that follow need them.
    """
    blocks = part.blocks
    within = blocks.within(part.first, np.inf)
    chosen = set(np.linspace(within.start, within.stop - 1, WINDOWS).round().astype(int).tolist())
    windows = []
    for index, block in zip(within, blocks.in_order(within), strict=True):
        if block is None or index not in chosen:
            continue
        inside = np.flatnonzero(block.t >= part.first)[:LENGTH]
        if inside.size:
            windows.append(block.take(inside, "Took a window."))
    if not windows:
        raise IdentificationError(
            f"no sample of {blocks.log.name} is left in the {name} part; use another --split"
        )
    head = windows[0]
    sentence = f"Took {len(windows)} windows of the {name} part ({sum(map(len, windows))} rows)."

    def joined(key: str) -> Array | None:
        values = [getattr(each, key) for each in windows]
        return None if values[0] is None else np.concatenate(values)

    signals = {key: joined(key) for key in ("t", *ARRAYS)}
    whole = head.replace(**signals, signals={}, name=f"{head.name}/{name}")
    return whole.noted(sentence)
