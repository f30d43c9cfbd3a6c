"""Warnings about a result: sentences on its limits, each with what to do."""

import re
from collections.abc import Iterable

import numpy as np

from runtime.common.tables import significant
from runtime.estimators.contradictions import FOLLOWS
from runtime.estimators.friction_bounds import NEGATIVE, NEGATIVE_CAUSE, negative_share
from runtime.estimators.methods import METHODS
from runtime.identification import metrics
from runtime.identification.identified import Identification
from runtime.identification.posterior_file import friction_sigma
from runtime.library import Array
from runtime.recording import Recording
from runtime.recording.preprocessing import is_filtered
from runtime.recording.recipes.recipe import COMMANDED
from runtime.recording.rest_speeds import STILL
from runtime.recording.settings import COLUMNS

SUSPICIOUSLY_GOOD = 1e-4
"""Overall error [%] below which a torque cannot come from a real sensor."""
WORSE = 1.1
"""Error of the result over that of the URDF above which the difference is hardly chance."""
UNEXPLAINED = 20.0
"""Overall error [%] above which the cause is not the method: all real logs that were tried end
below 10 % once units, filter and friction are right."""
RETRACED = 0.8
"""Share of test rows near a training row above which the test is no new motion."""
_NEAR = 0.05
"""Largest difference of a position or speed, over its range in training, of rows that count as
equal: controllers repeat a motion within 1 %."""
_TEST_ROWS, _TRAINING_ROWS = 100, 1000
"""Rows that are compared; between those of training a joint moves by 1 % of its range."""


def retraced(train: Recording, test: Recording) -> float:
    """Share of test rows whose positions and speeds, up to their direction, were in training."""

    def rows(recording: Recording, count: int) -> Array:
        chosen = np.linspace(0, len(recording) - 1, count).round().astype(int)
        chosen = chosen[np.diff(chosen, prepend=-1) > 0]
        state = np.hstack([recording.q[chosen], np.abs(recording.required("dq")[chosen])])
        return np.asarray(state, dtype=float)

    known = rows(train, _TRAINING_ROWS)
    size = np.ptp(known, axis=0)
    moving = size > STILL
    if not moving.any():
        return 0.0
    known, new = (each[:, moving] / size[moving] for each in (known, rows(test, _TEST_ROWS)))
    near = np.ones((len(new), len(known)), dtype=bool)
    for value, others in zip(new.T, known.T, strict=True):
        near &= np.abs(value[:, None] - others) < _NEAR
    return float(np.mean(near.any(axis=1)))


def warnings_of(
    result: Identification, before: metrics.TorqueError, after: metrics.TorqueError
) -> list[str]:
    """Sentences about the limits of a result."""
    warnings = [*still_joints(result), *result.notes, *of_the_log(result.train.history)]
    if result.train.torque_source == COMMANDED:
        warnings.append(
            "the torque is commanded by a control law, not measured: errors are shares of the "
            "commanded torque, and a wrong gain kp scales masses and friction alike"
        )
    warnings += _of_columns(result)
    if result.train.gains is not None:
        warnings += result.train.gains.sentences()
    if after.overall > max(WORSE * before.overall, SUSPICIOUSLY_GOOD):
        warnings.append(
            f"on the test data this model is worse than the URDF ({significant(before.overall, 3)} "
            f"% became {significant(after.overall, 3)} %): keep the URDF, and record a longer "
            "motion for training"
        )
    if after.overall > UNEXPLAINED:
        warnings.append(_unexplained(result, after))
    warnings += _negative(result)
    if not result.has_test:
        warnings.append(
            "all rows were used for the training, so that the errors are those of the training "
            "data; test the model by evaluate with another log"
        )
    elif result.one_run:
        warnings.append(
            "training, validation and test are parts of one run, which underestimates the error; "
            "record a second trajectory for the test"
        )
        share = 0.0 if result.streamed is not None else retraced(result.train, result.test)
        if share > RETRACED:
            warnings.append(
                f"{100 * share:.0f} % of the test rows repeat positions and speeds of the training "
                "rows, as in a motion out and back: the error shows the noise of this motion, not "
                "the error on others"
            )
    if result.test.rows is not None:
        rows = "the power of all joints together" if result.weights.size == 1 else "momenta"
        warnings.append(
            f"the fit uses {rows} and no accelerations; errors are those of the torque after the "
            "same filter"
        )
    if not result.is_consistent:
        warnings.append("some links are not physically consistent; use map for a model to simulate")
    if objective := METHODS[result.method].objective:
        warnings.append(
            f"{result.method} {objective}; its gap is measured in the weighted "
            "loss of the other methods"
        )
    if after.overall < SUSPICIOUSLY_GOOD:
        warnings.append(
            "the fit is exact to rounding: the torque is simulated or the output of a model, not a "
            "measurement"
        )
    unknowns = result.lib.base_matrix.shape[0]
    if len(result.train) * result.lib.n_joints < 3 * unknowns:
        warnings.append("there are fewer than three equations per unknown; record for longer")
    return warnings


def doubts_of(result: Identification, warnings: Iterable[str]) -> list[str]:
    """Reasons not to use a result as it is, the strongest first."""
    known = result.uncertainty
    contradicted = () if known is None else (*known.contradictions, *known.model_errors)
    strong = re.compile(
        r"worse than the URDF|is unexplained|not physically consistent|fewer than|log once"
    )
    stated = [warning for warning in warnings if strong.search(warning)]
    doubts = [*still_joints(result), *contradicted, *stated]
    return sorted(doubts, key=lambda doubt: doubt.endswith(FOLLOWS))


def of_the_log(history: Iterable[str]) -> list[str]:
    """Notes on the reading of a log: corrupt rows and warnings."""
    matches = (re.search(r"(^|: )(Warning: |(?=Dropped .* as corrupt))", step) for step in history)
    return [
        f"{match.string[: match.start()]}{match[1]}{match.string[match.end() :].rstrip('.')}"
        for match in matches
        if match
    ]


def _unexplained(result: Identification, after: metrics.TorqueError) -> str:
    """Remedies for a large error, the cheapest first."""
    filtered = METHODS[result.method].unfiltered or is_filtered(result.train.history)
    advice = ["no low-pass was used: --cutoff auto"] * (not filtered)
    advice += ["no friction was modelled: --friction auto"] * (not result.phi.size)
    return (
        f"{significant(after.overall, 3)} % of the test torque is unexplained, too much for a "
        f"useful model; {'; '.join(advice)}{'; ' if advice else ''}check units, order and signs "
        "with: python -m runtime inspect LOG"
    )


def _of_columns(result: Identification) -> list[str]:
    """Sentences that the records of the friction columns state about their coefficients."""
    names = [name for name in result.friction.columns if name in COLUMNS]
    if not result.phi.size or all(COLUMNS[name].sentences is None for name in names):
        return []
    phi, sigma = result.usual_phi, friction_sigma(result)
    spread = np.full(phi.shape, np.nan) if sigma is None else sigma
    said: list[str] = []
    for k, name in enumerate(names):
        sentences = COLUMNS[name].sentences
        if sentences is not None:
            said += sentences(result.lib.joint_names, phi[:, k], spread[:, k])
    return said


def _negative(result: Identification) -> list[str]:
    """Negative friction and rotors of a method that does not bound them."""
    columns, tau = result.train.columns, result.train.tau
    if not result.phi.size or columns is None or tau is None:
        return []
    names = result.train.column_names or result.friction.columns
    share = negative_share(columns, tau, result.phi, names)
    wrong = [
        f"{name} of {joint} {result.phi[j, k]:.3g}"
        for j, joint in enumerate(result.lib.joint_names)
        for k, name in enumerate(names)
        if share[j, k] > NEGATIVE
    ]
    if not wrong:
        return []
    return [
        f"negative coefficients that a joint cannot have: {', '.join(wrong)}; {NEGATIVE_CAUSE}; "
        "map and pc-ols bound them by 0"
    ]


def still_joints(result: Identification) -> tuple[str, ...]:
    """Sentence on joints that do not move in the whole training part, the first that matters.

    None for a streamed log, whose rows are not all in memory.
    """
    if result.streamed is not None:
        return ()
    names = np.array(result.lib.joint_names)
    still = names[np.ptp(result.train.q, axis=0) < STILL]
    if not len(still):
        return ()
    if len(still) == len(names):
        return (
            "no joint moves in the training part: the data determine at most the gravity torque "
            "of one pose, and all parameters are those of the URDF; record a motion that moves "
            "every joint",
        )
    return (
        f"{', '.join(still)} never moved in training ({len(still)} of {len(names)} joints): "
        "parameters that only such a motion determines are those of the URDF; record a motion "
        "that moves every joint",
    )
