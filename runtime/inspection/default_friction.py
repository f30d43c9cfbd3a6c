"""Friction model and rotors of a log for which none are named, within a fraction of a second.

    none → offset → viscous → coulomb, each without and with rotor        (cumulative columns)
    dahl in place of coulomb, each without and with rotor                 (where it pays)

All columns are prepared together, with Coulomb columns of some widths ε, and compressed to one
triangular factor per block. A candidate is a choice of columns of these factors, so that its
cross-validation costs some small least squares (`column_trial`).
A Dahl column depends on the path, so that no torque of a single instant follows from it. It
replaces the Coulomb column only where it reduces the mean square error by `LEAST_MEMORY_GAIN`.
`friction_choice` tries more models and searches their widths.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression.dry_friction_choice import minimum_on_grid
from runtime.inspection.candidate_columns import DEFAULT_COLUMNS, MEMORY, SPRINGS, USABLE
from runtime.inspection.column_trial import Trial, trial_on
from runtime.inspection.cross_validation import BLOCKS, LEAST_GAIN
from runtime.library import Array, Library
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.friction import spring_names
from runtime.recording.preprocessing import before_test, prepare

STROKES = tuple(4e-4 * 4.0**k for k in range(4))
"""Strokes z_c of the Dahl column that are tried first, rad or m."""
FINER_STROKES = 2.0 ** (np.arange(-2, 3) / 2)
"""Factors on the best of them that are tried next."""
LEAST_MEMORY_GAIN = 0.1
"""Share of the mean square error that a Dahl column must save: 5 % of the torque error."""
SPEEDS = tuple(0.005 * 2.0**k for k in range(6))
"""Widths ε of the Coulomb column that are tried first, rad/s or m/s."""
FINER = 2.0 ** (np.arange(-3, 4) / 4)
"""Factors on the best of them that are tried next."""
MOST_LOSS = 0.05
"""Mean square error above the best, relative to it, that a simpler candidate may have: five blocks
of a slow log differ so much that one standard error would admit any loss."""


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
        splitting: shares of the parts; None is the recipe's, else the first 60 % are used.
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
    parts = splitting or (recording.recipe.split if recording.recipe else None) or Split()
    bare = before_test(recording, parts).replace(columns=None, column_names=())
    springs = spring_names(lib) if SPRINGS in allowed else ()
    shared = tuple(name for name in ("offset", "viscous", "rotor") if name in allowed) + springs

    def trial_of(*terms: Friction) -> Trial:
        return trial_on(prepare(bare, preparation, Friction(shared), *terms, lib=lib), lib, robust)

    speeds = np.array(SPEEDS if coulomb_speed is None else (coulomb_speed,))
    try:
        trial = trial_of(*_coulomb(speeds))
        speed = float(speeds[0])
        if "coulomb" in allowed and coulomb_speed is None:
            speeds = _best_width(trial, len(shared), speeds) * FINER
            trial = trial_of(*_coulomb(speeds))
            speed = _best_width(trial, len(shared), speeds)
    except IdentificationError as fault:
        return DefaultFriction(Friction(()), (), f"no friction was fitted: {fault}")
    names = [*shared, *("coulomb" for _ in speeds)]
    width = len(shared) + int(np.argmin(np.abs(np.log(speeds / speed))))
    kinds = [name for name in DEFAULT_COLUMNS if name in allowed and name != "rotor"]
    stages = [tuple(kinds[:k]) for k in range(len(kinds) + 1)]
    rotors: list[tuple[str, ...]] = [()]
    if "rotor" in allowed:
        rotors.append(("rotor",))
    candidates = [(*stage, *rotor, *springs) for stage in stages for rotor in rotors]
    places = {
        name: width if name == "coulomb" else names.index(name) for name in (*kinds, *springs)
    }
    places |= {"rotor": names.index("rotor")} if "rotor" in allowed else {}
    scores = [trial.scores(tuple(places[name] for name in each)) for each in candidates]
    chosen = _simplest(scores)
    usual = Friction(candidates[chosen])
    if "coulomb" in candidates[chosen]:
        usual = replace(usual, coulomb_speed=speed)
    gain = ""
    if "coulomb" in usual.columns and coulomb_speed is None and MEMORY in allowed:
        with_memory, share = _with_memory(trial_of, shared, usual)
        if with_memory is not None:
            gain = (
                f" (friction with memory, which reduces the torque error by {100 * share:.0f} %; "
                f"--friction {','.join(usual.columns)} fits friction without memory)"
            )
            usual = with_memory
    sentence = (
        f"friction model {usual}{gain}, chosen by cross-validation on {BLOCKS} blocks of the "
        "training part; --friction none fits the inertia only, --friction auto tries more models"
    )
    listed = zip(candidates, (float(s.mean()) for s in scores), strict=True)
    return DefaultFriction(usual, tuple(listed), sentence)


def _coulomb(speeds: Array) -> list[Friction]:
    return [Friction(("coulomb",), float(speed)) for speed in speeds]


def _with_memory(
    trial_of: Callable[..., Trial], shared: tuple[str, ...], usual: Friction
) -> tuple[Friction | None, float]:
    """The model with a Dahl column in place of the Coulomb column, if it predicts much better."""
    coulomb = Friction(("coulomb",), usual.coulomb_speed)
    plain = tuple(k for k, name in enumerate(shared) if name != "rotor")
    geared = (*plain, shared.index("rotor")) if "rotor" in shared else plain
    before = tuple(k for k, name in enumerate(shared) if name in usual.columns)
    strokes, share, columns = np.array(STROKES), 0.0, plain
    one = np.ones(1)
    for factors in (FINER_STROKES, one, one):  # grid, finer grid, columns at the best stroke
        terms = [Friction((MEMORY,), dahl_stroke=float(stroke)) for stroke in strokes]
        trial = trial_of(*terms, coulomb)
        without = trial.scores((*before, len(shared) + len(strokes)))
        best = _best_width(trial, len(shared), strokes)
        place = len(shared) + int(np.argmin(np.abs(np.log(strokes / best))))
        scores = [trial.scores((*each, place)) for each in (plain, geared)]
        columns = (plain, geared)[_simplest(scores)]
        saved = without - trial.scores((*columns, place))
        error = float(saved.std(ddof=1) / np.sqrt(len(saved)))
        ratio = float(saved.mean() / without.mean())
        if ratio < LEAST_MEMORY_GAIN or float(saved.mean()) < error:
            return None, 0.0
        share, strokes = 1.0 - np.sqrt(1.0 - ratio), best * factors
    names = tuple(shared[k] for k in columns)
    dry = tuple(name for name in names if name != "rotor")
    rotor = ("rotor",) if "rotor" in names else ()
    return Friction((*dry, MEMORY, *rotor), dahl_stroke=float(strokes[0])), float(share)


def _best_width(trial: Trial, shared: int, speeds: Array) -> float:
    """ε or z_c with the smallest error of the richest model: vertex of a parabola at the best."""
    scores = [float(trial.scores((*range(shared), shared + k)).mean()) for k in range(len(speeds))]
    return minimum_on_grid(speeds, scores)


def _simplest(scores: Sequence[Array]) -> int:
    """First candidate within one standard error, and `MOST_LOSS`, of the best score."""
    best = min(scores, key=lambda score: float(score.mean()))
    least = float(best.mean())

    def is_near(score: Array) -> bool:
        gap = score - best
        error = float(gap.std(ddof=1) / np.sqrt(len(gap)))
        return float(gap.mean()) <= max(min(error, MOST_LOSS * least), LEAST_GAIN * least)

    return next(k for k, score in enumerate(scores) if is_near(score))
