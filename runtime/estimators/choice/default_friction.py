"""Friction model and rotors of a log for which none are named, within a fraction of a second.

    none → offset → viscous → coulomb, each without and with rotor        (cumulative columns)
    dahl in place of coulomb, each without and with rotor                 (where it pays)
    load beside coulomb or dahl                                           (where it pays)

All columns are prepared together and compressed to one triangular factor per block; a candidate is
a choice of its columns. `friction_choice` tries more models and searches their widths. The estimate
of a candidate is

    x_b = argmin ‖R x − r‖² + (N/N_eff) (‖L⁻¹ (β − β₀)‖² + Σ φ_jk² ⟨F_jk²⟩ / ⟨τ_j²⟩)

over the blocks other than b, x = [β; φ] and L Lᵀ = K Σ_π Kᵀ, with the spread Σ_π of the inertial
prior of `map` about the URDF, and friction F_jk φ_jk of the size of the torque of its joint.
Without them a slow log, one block of which moves as no other does, counts against every friction
model: a joint that reverses in block b alone has its dry friction and its offset in one column of
the others.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.choice.dry_friction import minimum_on_grid
from runtime.estimators.choice.friction_choice import (
    BLOCKS,
    LEAST_GAIN,
    excess_of,
    misfit,
    solved,
    weights_by_fits,
    with_width,
)
from runtime.estimators.convex.entropic_prior import CAD, bodies_of, prior_of
from runtime.estimators.regression.factor import Statistics, compress
from runtime.estimators.regression.samples import Samples, inflation, samples_of, thesis_weights
from runtime.estimators.robust import explicit, weights_of_rows
from runtime.library import Array, Library, require_library
from runtime.library.parameters import N_PARAMETERS
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.friction.columns import COULOMB, DAHL, LOAD, OFFSET, ROTOR, VISCOUS
from runtime.recording.friction.model import unresolved, without_columns
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.recording import require_recording
from runtime.recording.settings import SPRING, widths_of

STROKES = tuple(4e-4 * 4.0**k for k in range(4))  # Dahl strokes z_c that are tried first [rad, m]
FINER_STROKES = 2.0 ** (np.arange(-2, 3) / 2)  # factors on the best of them that are tried next
LEAST_GAIN_OF_MORE = 0.1  # share of the mean square error that a Dahl or load column must save
SPEEDS = tuple(0.005 * 2.0**k for k in range(6))  # Coulomb widths ε tried first [rad/s, m/s]
FINER = 2.0 ** (np.arange(-3, 4) / 4)  # factors on the best of them that are tried next
MOST_LOSS = 0.05
"""Mean square error above the best, relative to it, that a simpler candidate may have: five blocks
of a slow log differ so much that one standard error would admit any loss."""
DEFAULT_COLUMNS = tuple(each.name for each in (OFFSET, VISCOUS, COULOMB, ROTOR))
"""Columns of the candidates without memory."""
MEMORY = DAHL.name  # column that replaces "coulomb" where friction depends on the path
LOADED = LOAD.name  # beside "coulomb" or "dahl" of gears whose dry friction grows with load
SPEED, STROKE = "coulomb_speed", "dahl_stroke"  # widths of terms
SPRINGS = SPRING  # word for columns of all springs of unknown stiffness, which every candidate has
USABLE = (*DEFAULT_COLUMNS, MEMORY, LOADED, SPRINGS)  # columns of a method that can use all of them
UNKNOWN = 1e3  # factor on the spread of the prior of robots whose URDF states no masses
ROWS = 4000  # rows that the choice uses, evenly spread
_PASSES = 2  # passes in which the noise of the joints is estimated from the residuals


@dataclass(frozen=True, slots=True)
class DefaultFriction:
    """The friction model chosen for a log."""

    terms: Friction  # columns and widths
    # columns of every candidate, and its cross-validated mean square error over that of the noise
    scores: tuple[tuple[tuple[str, ...], float], ...]
    sentence: str  # the choice and its reason


@one_blas_thread
def choose_default_friction(
    recording: Recording,
    lib: Library,
    preparation: Preparation | None = None,
    split: Split | None = None,
    coulomb_speed: float | None = None,
    allowed: Sequence[str] = USABLE,
    robust: bool = False,
) -> DefaultFriction:
    """Choose offset, viscous, Coulomb or Dahl, and rotor columns by cross-validation on blocks.

    The training and validation parts are used; the test part is cut off before any filter. Springs
    of unknown stiffness, which the mechanism of the robot states, are columns of every candidate.

    Args:
        recording: as read; friction columns that it holds are not used.
        lib: library of the robot.
        preparation: None is the recipe's.
        split: shares of the parts; None is the recipe's, else the first 60 % are used.
        coulomb_speed: ε [rad/s] of the Coulomb column, with which "dahl" is not tried; None
            searches it.
        allowed: columns that the method can use, `SPRINGS` for those of springs.
        robust: weight the rows as `identify` does with `robust`.

    Returns:
        The simplest candidate within one standard error of the best. Where the rows are too few
        for a choice it is the model without friction, and the sentence states the reason.

    Raises:
        RuntimeFault: the log cannot be prepared.
    """
    require_recording(recording)
    require_library(lib)
    bare = before_test(recording, split).replace(columns=None, column_names=())
    springs = tuple(f"{SPRINGS}{name}" for name in lib.manifest.springs if SPRINGS in allowed)
    beside = (OFFSET.name, VISCOUS.name, ROTOR.name)
    shared = (*(name for name in beside if name in allowed), *springs)

    def trial_of(*further: Friction) -> FrictionTrial:
        terms = (Friction(shared), *further)
        return trial_on(prepare(bare, preparation, *terms, lib=lib), terms, lib, robust)

    speeds = np.array(SPEEDS if coulomb_speed is None else (coulomb_speed,))
    try:
        trial, speed = _at_widths(trial_of, shared, COULOMB.name, SPEED, speeds)
        if COULOMB.name in allowed and coulomb_speed is None:
            trial, speed = _at_widths(trial_of, shared, COULOMB.name, SPEED, speed * FINER)
    except IdentificationError as fault:
        return DefaultFriction(Friction(()), (), f"no friction was fitted: {fault}")
    kinds = [name for name in DEFAULT_COLUMNS[:-1] if name in allowed]
    stages = [tuple(kinds[:k]) for k in range(len(kinds) + 1)]
    rotors = [(), (ROTOR.name,)][: 1 + (ROTOR.name in allowed)]
    candidates = [(*stage, *rotor, *springs) for stage in stages for rotor in rotors]
    scores = [trial.scores(Friction(each, speed)) for each in candidates]
    chosen = _simplest(scores)
    usual = Friction(candidates[chosen])
    if COULOMB.name in candidates[chosen]:
        usual = replace(usual, coulomb_speed=speed)
    gain = ""
    if COULOMB.name in usual.columns and coulomb_speed is None and MEMORY in allowed:
        with_memory, share = _with_memory(trial_of, shared, usual)
        if with_memory is not None:
            gain = (
                f" (friction with memory, which reduces the torque error by {100 * share:.0f} %; "
                f"--friction {','.join(usual.columns)} fits friction without memory)"
            )
            usual = with_memory
    if LOADED in allowed and {COULOMB.name, MEMORY} & set(usual.columns):
        usual, share, score = _with_load(trial_of, usual)
        if share:
            candidates.append(usual.columns)
            scores.append(score)
            gain += (
                f" (dry friction that grows with the load of the joint, which reduces the torque "
                f"error by {100 * share:.0f} %)"
            )
    sentence = (
        f"friction model {usual}{gain}, chosen by cross-validation on {BLOCKS} blocks of the "
        "training part; --friction none fits the inertia only, --friction auto tries more models"
    )
    listed = zip(candidates, (float(s.mean()) for s in scores), strict=True)
    return DefaultFriction(usual, tuple(listed), sentence)


def _with_memory(
    trial_of: Callable[..., "FrictionTrial"], shared: tuple[str, ...], usual: Friction
) -> tuple[Friction | None, float]:
    """The model with a Dahl column in place of the Coulomb column, if it predicts much better."""
    plain = (*(name for name in shared if name != ROTOR.name), MEMORY)
    kinds = [plain, (*plain, ROTOR.name)][: 1 + (ROTOR.name in shared)]
    strokes, share, one = np.array(STROKES), 0.0, np.ones(1)
    for factors in (FINER_STROKES, one, one):  # grid, finer grid, columns at the best stroke
        coulomb = replace(usual, columns=(COULOMB.name,))
        trial, best = _at_widths(trial_of, shared, MEMORY, STROKE, strokes, coulomb)
        models = [Friction(each, dahl_stroke=best) for each in kinds]
        scores = [trial.scores(each) for each in models]
        chosen = _simplest(scores)
        ratio = _saved_share(trial.scores(usual), scores[chosen])
        if not ratio:
            return None, 0.0
        share, strokes = 1.0 - np.sqrt(1.0 - ratio), best * factors
    return models[chosen], float(share)


def _with_load(
    trial_of: Callable[..., "FrictionTrial"], usual: Friction
) -> tuple[Friction, float, Array]:
    """The model with a column of the load, the share of the error it saves, else 0, and scores."""
    dry = next(name for name in usual.columns if name in {COULOMB.name, MEMORY})
    place = usual.columns.index(dry) + 1
    loaded = replace(usual, columns=(*usual.columns[:place], LOADED, *usual.columns[place:]))
    trial = trial_of(replace(usual, columns=(dry, LOADED)))
    scores = trial.scores(loaded)
    ratio = _saved_share(trial.scores(usual), scores)
    return (loaded, 1.0 - np.sqrt(1.0 - ratio), scores) if ratio else (usual, 0.0, scores)


def _saved_share(without: Array, scores: Array) -> float:
    """Share of the mean square error that further columns save; 0 where that is too little."""
    saved, error = excess_of(without, scores)
    share = saved / float(without.mean())
    return 0.0 if share < LEAST_GAIN_OF_MORE or saved < error else share


def _at_widths(
    trial_of: Callable[..., "FrictionTrial"],
    shared: tuple[str, ...],
    name: str,
    key: str,
    widths: Array,
    *others: Friction,
) -> tuple["FrictionTrial", float]:
    """Trial of a column at every width, and the width with the smallest error of all columns."""
    trial = trial_of(*(with_width(Friction((name,)), key, each) for each in widths), *others)
    richest = [with_width(Friction((*shared, name)), key, each) for each in widths]
    return trial, minimum_on_grid(widths, [float(trial.scores(each).mean()) for each in richest])


def _simplest(scores: Sequence[Array]) -> int:
    """First candidate within one standard error, and `MOST_LOSS`, of the best score."""
    best = min(scores, key=lambda score: float(score.mean()))
    least = float(best.mean())

    def is_near(score: Array) -> bool:
        gap, error = excess_of(score, best)
        return gap <= max(min(error, MOST_LOSS * least), LEAST_GAIN * least)

    return next(k for k, score in enumerate(scores) if is_near(score))


@dataclass(frozen=True, slots=True)
class FrictionTrial:
    """Factors of the blocks with all columns."""

    columns: tuple[tuple[str, Friction], ...]  # name of every column, and terms with its width
    blocks: tuple[Statistics, ...]  # statistics of every block
    others: tuple[Statistics, ...]  # per block, all other blocks together, with the prior
    joints: int  # number n of joints

    def scores(self, model: Friction) -> Array:
        """Mean square error of every block, predicted by the others with a model."""
        chosen = [self._place(name, model) for name in model.columns]
        left_out = np.tile(~np.isin(np.arange(len(self.columns)), chosen), self.joints)
        pairs = zip(self.blocks, self.others, strict=True)
        each = [misfit(block, solved([rest.without(left_out)])[0]) for block, rest in pairs]
        return np.array(each) / [block.n_samples * self.joints for block in self.blocks]

    def _place(self, name: str, model: Friction) -> int:
        """Column of a name whose width is the nearest to that of a model."""
        places = [k for k, (each, _) in enumerate(self.columns) if each == name]
        for width in widths_of((name,)):
            ratios = [getattr(self.columns[k][1], width) / getattr(model, width) for k in places]
            places = [places[int(np.argmin(np.abs(np.log(ratios))))]]
        return places[0]


def trial_on(
    done: Recording, terms: Sequence[Friction], lib: Library, robust: bool
) -> FrictionTrial:
    """Compressed blocks of a recording prepared with terms, weighted by the noise of the joints."""
    if done.columns is not None and done.tau is not None:
        done = without_columns(done, unresolved(done.columns, done.tau))
    whole = samples_of(done, lib)
    taken = np.arange(0, len(whole), max(1, len(whole) // ROWS))
    cuts = [cut for cut in np.array_split(taken, BLOCKS) if cut.size]
    blocks = [whole.rows(cut) for cut in cuts]
    equations = sum(map(len, blocks[:-1])) * lib.n_joints
    unknowns = len(lib.base_columns) + lib.n_joints * len(DEFAULT_COLUMNS)
    if len(blocks) < BLOCKS or equations < 2 * unknowns:
        raise IdentificationError(
            f"{len(whole)} training rows are too few to choose a model; name one with --friction"
        )
    if robust:
        rows = explicit(lib, whole)
        whole = rows.weighted(weights_of_rows(lib, rows).weights)
        blocks = [whole.rows(cut) for cut in cuts]
    weights, rest = weights_by_fits(lib, blocks, thesis_weights(whole.tau), _PASSES)
    stats = [compress(lib, block, weights) for block in blocks]
    prior = _prior(lib, stats[0], whole.rows(taken), inflation(rest, weights))
    without = [[s for s in stats if s is not block] for block in stats]
    others = [rest[0].merged(*rest[1:], prior) for rest in without]
    columns = tuple((name, each) for each in terms for name in each.columns)
    return FrictionTrial(columns, tuple(stats), tuple(others), lib.n_joints)


def _prior(lib: Library, like: Statistics, samples: Samples, ratio: float) -> Statistics:
    """Rows √(N/N_eff) L⁻¹ (β − β₀) of the inertial prior and those of φ, of no sample."""
    matrix, pi = lib.base_matrix, lib.pi0
    spread = bodies_of(lib).spread(prior_of(lib, pi).centre) / np.sqrt(CAD)
    links = matrix.reshape(len(matrix), -1, N_PARAMETERS)
    root = np.einsum("bki,kij->bkj", links, spread).reshape(matrix.shape)
    values, vectors = np.linalg.eigh(root @ root.T * (UNKNOWN**2 if lib.placeholders else 1.0))
    scale = np.sqrt(ratio / np.maximum(values, 1e-12 * values[-1]))
    rows = scale[:, None] * vectors.T
    torque = np.sqrt(np.mean(samples.tau**2, axis=0))
    over = np.sqrt(ratio) / np.where(torque > 0, torque, 1.0)
    friction = over[:, None] * samples.column_sizes()
    whole = np.zeros_like(like.factor)
    target = np.zeros_like(like.target)
    whole[: len(rows), : len(rows)] = rows
    whole[len(rows) :, len(rows) :] = np.diag(friction.ravel())
    target[: len(rows)] = rows @ (matrix @ pi)
    return replace(like, factor=whole, target=target, rest=0.0, n_samples=0.0)
