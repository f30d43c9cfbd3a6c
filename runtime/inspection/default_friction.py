"""Friction model and rotors of a log for which none are named, within a fraction of a second.

    none → offset → viscous → coulomb, each without and with rotor        (cumulative columns)

All columns are prepared together, with Coulomb columns of some widths ε, and compressed to one
triangular factor per block. A candidate is a choice of columns of these factors, so that its
cross-validation costs some small least squares

    x_b = argmin ‖R x − r‖² + (N/N_eff) ‖L⁻¹ (β − β₀)‖²,   L Lᵀ = K Σ_π Kᵀ,  x = [β; φ]

over the blocks other than b, with the spread Σ_π of the inertial prior of `map` about the URDF.
Without it a slow log, one block of which moves as no other does, counts against every friction
model.
`friction_choice` tries more models and searches their widths.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.estimators.convex import CAD, bodies_of, prior_of
from runtime.estimators.regression import Statistics, compress
from runtime.estimators.regression.residuals import inflation
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.estimators.robust import explicit, scaled, weights_of_rows
from runtime.inspection.cross_validation import BLOCKS, LEAST_GAIN, solved
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.friction import unresolved, without_columns
from runtime.recording.preprocessing import before_test, prepare

DEFAULT_COLUMNS = ("offset", "viscous", "coulomb", "rotor")
"""Columns of the candidates."""
SPEEDS = tuple(0.005 * 2.0**k for k in range(6))
"""Widths ε of the Coulomb column that are tried first, rad/s or m/s."""
FINER = 2.0 ** (np.arange(-3, 4) / 4)
"""Factors on the best of them that are tried next."""
MOST_LOSS = 0.05
"""Mean square error above the best, relative to it, that a simpler candidate may have: five blocks
of a slow log differ so much that one standard error would admit any loss."""
UNKNOWN = 1e3
"""Factor on the spread of the prior of robots whose URDF states no masses."""
ROWS = 4000
"""Rows that the choice uses, evenly spread."""
_PASSES = 2
"""Passes in which the noise of the joints is estimated from the residuals."""


@dataclass(frozen=True, slots=True)
class DefaultFriction:
    """The friction model chosen for a log.

    Attributes:
        terms: columns and widths.
        scores: columns of every candidate with its cross-validated mean square error over that of
            the noise.
        sentence: the choice and its reason.
    """

    terms: Friction
    scores: tuple[tuple[tuple[str, ...], float], ...]
    sentence: str


@one_blas_thread
def choose_default_friction(
    recording: Recording,
    lib: Library,
    preparation: Preparation | None = None,
    splitting: Split | None = None,
    coulomb_speed: float | None = None,
    allowed: Sequence[str] = DEFAULT_COLUMNS,
    robust: bool = False,
) -> DefaultFriction:
    """Choose offset, viscous, Coulomb and rotor columns by cross-validation on contiguous blocks.

    The training and validation parts are used; the test part is cut off before any filter.

    Args:
        recording: as read; friction columns that it holds are not used.
        lib: library of the robot.
        preparation: None is the recipe's.
        splitting: shares of the parts; None is the recipe's, else the first 60 % are used.
        coulomb_speed: ε [rad/s]; None searches it.
        allowed: columns that the method can use.
        robust: weight the rows as `identify` does with `robust`.

    Returns:
        The simplest candidate within one standard error of the best. Where the rows are too few
        for a choice it is the model without friction, and the sentence states the reason.

    Raises:
        RuntimeFault: the log cannot be prepared.
    """
    parts = splitting or (recording.recipe.split if recording.recipe else None) or Split()
    bare = before_test(recording, parts).replace(columns=None, column_names=())
    shared = tuple(name for name in ("offset", "viscous", "rotor") if name in allowed)

    def trial_of(speeds: Array) -> _Trial:
        terms = [Friction(("coulomb",), float(speed)) for speed in speeds]
        return _trial(prepare(bare, preparation, Friction(shared), *terms, lib=lib), lib, robust)

    speeds = np.array(SPEEDS if coulomb_speed is None else (coulomb_speed,))
    try:
        trial = trial_of(speeds)
        speed = float(speeds[0])
        if "coulomb" in allowed and coulomb_speed is None:
            speeds = _best_speed(trial, len(shared), speeds) * FINER
            trial = trial_of(speeds)
            speed = _best_speed(trial, len(shared), speeds)
    except IdentificationError as fault:
        return DefaultFriction(Friction(()), (), f"no friction was fitted: {fault}")
    names = [*shared, *("coulomb" for _ in speeds)]
    width = len(shared) + int(np.argmin(np.abs(np.log(speeds / speed))))
    kinds = [name for name in DEFAULT_COLUMNS if name in allowed and name != "rotor"]
    stages = [tuple(kinds[:k]) for k in range(len(kinds) + 1)]
    rotors: list[tuple[str, ...]] = [()]
    if "rotor" in allowed:
        rotors.append(("rotor",))
    candidates = [(*stage, *rotor) for stage in stages for rotor in rotors]
    places = {name: width if name == "coulomb" else names.index(name) for name in kinds}
    places |= {"rotor": names.index("rotor")} if "rotor" in allowed else {}
    scores = [trial.scores(tuple(places[name] for name in each)) for each in candidates]
    chosen = _simplest(scores)
    usual = Friction(candidates[chosen])
    if "coulomb" in candidates[chosen]:
        usual = replace(usual, coulomb_speed=speed)
    sentence = (
        f"friction model {usual}, chosen by cross-validation on {BLOCKS} blocks of the training "
        "part; --friction none fits the inertia only, --friction auto tries more models"
    )
    listed = zip(candidates, (float(s.mean()) for s in scores), strict=True)
    return DefaultFriction(usual, tuple(listed), sentence)


def _best_speed(trial: "_Trial", shared: int, speeds: Array) -> float:
    """ε with the smallest error of the richest model: vertex of a parabola in ln ε at the best."""
    scores = [float(trial.scores((*range(shared), shared + k)).mean()) for k in range(len(speeds))]
    best = int(np.argmin(scores))
    if not 0 < best < len(speeds) - 1:
        return float(speeds[best])
    low, middle, high = scores[best - 1 : best + 2]
    bend = low - 2 * middle + high
    shift = 0.5 * (low - high) / bend if bend > 0 else 0.0
    step = np.log(speeds[best + 1] / speeds[best])  # of a geometric sequence
    return float(speeds[best] * np.exp(shift * step))


def _simplest(scores: Sequence[Array]) -> int:
    """First candidate within one standard error, and `MOST_LOSS`, of the best score."""
    best = min(scores, key=lambda score: float(score.mean()))
    least = float(best.mean())

    def is_near(score: Array) -> bool:
        gap = score - best
        error = float(gap.std(ddof=1) / np.sqrt(len(gap)))
        return float(gap.mean()) <= max(min(error, MOST_LOSS * least), LEAST_GAIN * least)

    return next(k for k, score in enumerate(scores) if is_near(score))


@dataclass(frozen=True, slots=True)
class _Trial:
    """Factors of the blocks with all columns.

    Attributes:
        blocks: statistics of every block.
        others: statistics of all other blocks together, with the prior.
        joints: number n of joints.
    """

    blocks: tuple[Statistics, ...]
    others: tuple[Statistics, ...]
    joints: int

    def scores(self, columns: tuple[int, ...]) -> Array:
        """Mean square error of every block, predicted by the others with some of the columns."""
        count = (self.blocks[0].factor.shape[1] - self.blocks[0].n_base) // self.joints
        left_out = np.tile(~np.isin(np.arange(count), columns), self.joints)
        return np.array([
            _error(block, rest, left_out) / (block.n_samples * self.joints)
            for block, rest in zip(self.blocks, self.others, strict=True)
        ])  # fmt: skip


def _error(block: Statistics, others: Statistics, left_out: NDArray[np.bool_]) -> float:
    """Weighted sum of squared residuals on a block of the estimate from the others."""
    x, _ = solved([others.without(left_out)])
    rest = block.without(left_out).factor @ x - block.target
    return float(rest @ rest + block.rest)


def _trial(done: Recording, lib: Library, robust: bool) -> _Trial:
    """Compressed blocks of a prepared recording, weighted by the noise of the joints."""
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
        whole = scaled(rows, weights_of_rows(lib, rows).weights)
        blocks = [whole.rows(cut) for cut in cuts]
    weights = thesis_weights(whole.tau)
    for _ in range(_PASSES):
        stats = [compress(lib, block, weights) for block in blocks]
        x, _rank = solved([stats[0].merged(*stats[1:])])
        rests = _residuals(lib, blocks, x)
        variance = np.mean(np.concatenate(rests) ** 2, axis=0)
        weights = 1.0 / np.maximum(variance, 1e-12 * variance.max() + 1e-30)
    stats = [compress(lib, block, weights) for block in blocks]
    prior = _prior(lib, stats[0], inflation(np.concatenate(rests), weights))
    others = [
        rest[0].merged(*rest[1:], prior)
        for k in range(len(stats))
        if (rest := [s for i, s in enumerate(stats) if i != k])
    ]
    return _Trial(tuple(stats), tuple(others), lib.n_joints)


def _prior(lib: Library, like: Statistics, samples_per_independent: float) -> Statistics:
    """Rows √(N/N_eff) L⁻¹ (β − β₀) of the inertial prior, of no sample."""
    matrix, pi = lib.base_matrix, lib.pi0
    spread = bodies_of(lib).spread(prior_of(lib, pi).centre) / np.sqrt(CAD)
    links = matrix.reshape(len(matrix), -1, N_PARAMETERS)
    root = np.einsum("bki,kij->bkj", links, spread).reshape(matrix.shape)
    covariance = root @ root.T * (UNKNOWN**2 if lib.placeholders else 1.0)
    values, vectors = np.linalg.eigh(covariance)
    scale = np.sqrt(samples_per_independent / np.maximum(values, 1e-12 * values[-1]))
    rows = scale[:, None] * vectors.T
    whole = np.zeros_like(like.factor)
    target = np.zeros_like(like.target)
    whole[: len(rows), : len(rows)] = rows
    target[: len(rows)] = rows @ (matrix @ pi)
    return replace(like, factor=whole, target=target, rest=0.0, n_samples=0.0)


def _residuals(lib: Library, blocks: list[Samples], x: Array) -> list[Array]:
    """Residuals of [β; φ] on every block."""
    beta, phi = x[: len(lib.base_columns)], x[len(lib.base_columns) :].reshape(lib.n_joints, -1)
    return [b.tau - b.base_rigid(lib, beta) - b.friction(phi) for b in blocks]
