"""Whether the friction of drives changes with the position, as behind a linkage or a cable.

    e = τ(t + δ) − Y π0 − F φ,   F with or without the column `position`

Both are fitted joint by joint and compared by cross-validation on contiguous blocks; a delay
that is not known yet is like viscous friction and rotor inertia, and changes the comparison little.
"""

from dataclasses import replace

import numpy as np

from runtime.estimators.regression.recorded_delay import FEWEST, ROWS, filtered
from runtime.estimators.regression.samples import samples_of
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.commanded_torque import COMMANDED
from runtime.recording.preprocessing import prepare

POSITION = "position"
"""Name of the column."""
FOLDS = 5
"""Contiguous blocks of the cross-validation."""
LEAST_GAIN = 0.1
"""Share by which the column has to lower the mean square error, in the mean of the joints."""


def with_position(
    recording: Recording, lib: Library, preparation: Preparation, terms: Friction
) -> tuple[Friction, str]:
    """Friction terms of a commanded torque for which no command names any.

    Args:
        recording: rows before the test part.
        lib: library of the robot.
        preparation: its filter and delay are used.
        terms: columns of a drive.

    Returns:
        The terms, with `position` where it lowers the error, and a sentence; empty without.
    """
    if recording.torque_source != COMMANDED or "coulomb" not in terms.columns:
        return terms, ""
    more = replace(terms, columns=(*terms.columns, POSITION))
    usual = replace(filtered(recording, preparation), torque_delay_s=preparation.torque_delay_s)
    samples = samples_of(prepare(recording, usual, more, lib=lib), lib)
    if len(samples) < FEWEST:
        return terms, ""
    samples = samples.rows(np.arange(0, len(samples), -(-len(samples) // ROWS)))
    rest = samples.tau - samples.rigid(lib, lib.pi0)
    without, error = (
        _error(samples.columns[:, :, :count], rest)
        for count in (len(terms.columns), len(more.columns))
    )
    share = float(np.mean(error / np.maximum(without, np.finfo(float).tiny)))
    if not share < 1 - LEAST_GAIN:
        return terms, ""
    return more, (
        "Coulomb friction changes with the position (column position): the error of "
        f"cross-validation falls by {100 * (1 - np.sqrt(share)):.2g} %; "
        f"--friction {','.join(terms.columns)} leaves it out"
    )


def _error(columns: Array, rest: Array) -> Array:
    """Sums of squares of what the other blocks predict of each block.

    Args:
        columns: friction columns, (N, n, k).
        rest: torque without that of the links, (N, n).

    Returns:
        The sum of every joint, (n,) [(N·m)²].
    """
    fold = np.arange(len(rest)) * FOLDS // len(rest)
    left = np.empty_like(rest)
    for j in range(rest.shape[1]):
        lengths = np.linalg.norm(columns[:, j], axis=0)
        rows = columns[:, j] / np.where(lengths > 0, lengths, 1.0)
        for k in range(FOLDS):
            out = fold == k
            phi = np.linalg.lstsq(rows[~out], rest[~out, j], rcond=1e-6)[0]
            left[out, j] = rest[out, j] - rows[out] @ phi
    return np.asarray(np.sum(left**2, axis=0))
