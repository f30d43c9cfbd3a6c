"""Dry friction of drives: with a memory or without, the same everywhere or changing with q.

    e = τ(t + δ) − Y π0 − F φ,   F with coulomb or dahl, each without and with position

A linkage or a cable makes friction change with the position. Candidates are compared joint by joint
by cross-validation on contiguous blocks. A memory, with the stroke z_c of a reversal, and a delay
both make the torque of a reversal late: where the delay is unknown, a memory has to pay at the δ
that is best without it, and then has a δ of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from runtime.common.tables import significant
from runtime.estimators.regression import recorded_delay
from runtime.estimators.regression.samples import samples_of
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction.columns import COULOMB, DAHL, POSITION
from runtime.recording.preprocessing import prepare

DRY, MEMORY, ALONG = COULOMB.name, DAHL.name, POSITION.name
STROKES = tuple(5e-4 * 2.0 ** (k / 2) for k in range(9))
"""Strokes z_c that are tried [rad, m]; a parabola resolves fractions of their steps."""
DELAY_STEP_S = 0.005  # step of the delays that are tried [s]
FOLDS = 5
LEAST_GAIN = 0.1
"""Share by which further columns have to lower the mean square error (geometric mean of joints)."""
_RANK = 1e-10  # eigenvalue of a Gram matrix of unit columns, over the largest, below which it is 0


@dataclass(frozen=True, slots=True)
class _Trial:
    """Rows on which further columns are tried."""

    # those of the terms, then `position`, then `dahl` and `position` of each stroke, (N, n, k); of
    # the joints that move
    columns: Array
    rest: Array  # torque less the rigid model of the URDF, at every delay, (M, N, n) [N·m, N]
    count: int  # number of columns of the terms
    place: int  # of `coulomb` among them

    def losses(self, memory: int | None, position: bool) -> Array:
        """Mean of ln s_j² over the joints, of every delay, (M,), with the stroke of an index."""
        chosen = list(range(self.count))
        if memory is not None:
            chosen[self.place] = self.count + 1 + 2 * memory
        if position:
            chosen.append(self.count if memory is None else self.count + 2 + 2 * memory)
        errors = _errors(self.columns[:, :, chosen], self.rest)
        return np.asarray(np.log(np.maximum(errors, np.finfo(float).tiny)).mean(axis=1))


def _trial(whole: Recording, lib: Library, terms: Friction, late: bool) -> _Trial | None:
    """At most `ROWS` rows of a prepared recording; None for too few, or without motion."""
    samples, t = samples_of(whole, lib), whole.t
    delays: Array = np.zeros(1)
    if late:
        first = round(-recorded_delay.LATEST_S / DELAY_STEP_S)
        last = round(recorded_delay.EARLIEST_S / DELAY_STEP_S)
        delays = np.asarray(DELAY_STEP_S * np.arange(first, last + 1))
    rows = np.flatnonzero((t + delays[0] >= t[0]) & (t + delays[-1] <= t[-1]))
    if len(rows) < recorded_delay.FEWEST_ROWS:
        return None
    rows = rows[:: -(-len(rows) // recorded_delay.ROWS)]
    samples = samples.rows(rows)
    count, place = len(terms.columns), terms.columns.index(DRY)
    moving = samples.columns[:, :, place].any(axis=0)  # by dq, without which there is no sign of it
    if not moving.any():
        return None
    model, torques = samples.rigid(lib, lib.pi0), whole.required("tau").T
    shifted = np.array([[np.interp(t[rows] + d, t, row) for row in torques] for d in delays])
    rest = shifted.swapaxes(1, 2) - model
    return _Trial(samples.columns[:, moving], rest[:, :, moving], count, place)


def with_dry_friction(
    logs: Sequence[tuple[Recording, Preparation]], lib: Library, terms: Friction, late: bool
) -> tuple[Friction, str]:
    """Friction terms of commanded torques for which no command names any, common to the logs."""
    if DRY not in terms.columns:
        return terms, ""
    trials = list[_Trial]()
    for recording, preparation in logs:
        known = None if late else preparation.torque_delay_s
        usual = replace(recorded_delay.filtered(recording, preparation), torque_delay_s=known)
        more = replace(terms, columns=(*terms.columns, ALONG))
        others = [Friction((MEMORY, ALONG), dahl_stroke=stroke) for stroke in STROKES]
        trial = _trial(prepare(recording, usual, more, *others, lib=lib), lib, terms, late)
        if trial is not None:
            trials.append(trial)
    if not trials:
        return terms, ""
    # Simplest first: a further column has to pay at the delays that the simplest model has.
    simplest = [trial.losses(None, False) for trial in trials]
    at = [int(loss.argmin()) for loss in simplest]
    share = np.array([len(trial.columns) for trial in trials], dtype=float)
    share /= share.sum()

    def loss_at(losses: Sequence[Array], places: Sequence[int]) -> float:
        return float(sum(w * loss[k] for w, loss, k in zip(share, losses, places, strict=True)))

    no_memory = [trial.losses(None, True) for trial in trials]
    memory = {
        each: [[trial.losses(k, each) for trial in trials] for k in range(len(STROKES))]
        for each in (False, True)
    }
    candidates = [
        (loss_at(simplest, at), False, False),
        (loss_at(no_memory, at), False, True),
        *((min(loss_at(loss, at) for loss in memory[each]), True, each) for each in (False, True)),
    ]
    enough = min(loss for loss, *_ in candidates) - np.log(1 - LEAST_GAIN)
    least, has_memory, has_position = next(each for each in candidates if each[0] <= enough)
    if not has_memory and not has_position:
        return terms, ""
    chosen, stroke = terms, None
    if has_memory:  # its stroke and the delays that are best with it
        best = [
            loss_at(each, [int(loss.argmin()) for loss in each]) for each in memory[has_position]
        ]
        least, stroke = min(best), float(f"{minimum_on_grid(STROKES, best):.3g}")
        names = tuple(MEMORY if name == DRY else name for name in terms.columns)
        chosen = replace(terms, columns=names, dahl_stroke=stroke)
    if has_position:
        chosen = replace(chosen, columns=(*chosen.columns, ALONG))
    fall = 100 * (1 - np.exp((least - candidates[0][0]) / 2))
    kinds = [f"has a memory of {stroke:.2g} rad of travel (column dahl)"] if stroke else []
    kinds += ["changes with the position (column position)"] * has_position
    return chosen, (
        f"dry friction {' and '.join(kinds)}: the error of cross-validation falls by "
        f"{significant(fall)} %; --friction {','.join(terms.columns)} leaves it out"
    )


def _errors(columns: Array, rest: Array) -> Array:
    """Sums of squares of what the other blocks predict of each block."""
    lengths = np.linalg.norm(columns, axis=0)
    x = np.moveaxis(columns / np.where(lengths > 0, lengths, 1.0), 0, 1)  # (n, N, k)
    y = np.moveaxis(rest, 0, 2).swapaxes(0, 1)  # (n, N, M)
    edges = np.linspace(0, x.shape[1], FOLDS + 1).astype(int)
    blocks = [slice(*pair) for pair in pairwise(edges)]
    gram = np.array([x[:, b].swapaxes(1, 2) @ x[:, b] for b in blocks])
    cross = np.array([x[:, b].swapaxes(1, 2) @ y[:, b] for b in blocks])
    inverse = np.linalg.pinv(gram.sum(axis=0) - gram, rcond=_RANK, hermitian=True)
    phi = inverse @ (cross.sum(axis=0) - cross)
    left = [np.sum((y[:, b] - x[:, b] @ p) ** 2, axis=1) for b, p in zip(blocks, phi, strict=True)]
    return np.asarray(np.sum(left, axis=0).T)


def minimum_on_grid(places: Sequence[float] | Array, losses: Sequence[float] | Array) -> float:
    """Vertex of the parabola over ln x through the smallest loss and its neighbours."""
    best = int(np.argmin(losses))
    if not 0 < best < len(losses) - 1:
        return float(places[best])
    low, middle, high = (float(loss) for loss in losses[best - 1 : best + 2])
    bend = low - 2 * middle + high
    shift = 0.5 * (low - high) / bend if bend > 0 else 0.0
    return float(places[best] * np.exp(shift * np.log(places[best + 1] / places[best])))
