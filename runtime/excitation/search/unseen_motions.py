"""Motions on which the torque of an identified model is to be predicted: fixed for a robot."""

import numpy as np

from runtime.excitation.limits.dependent_joints import dependent_joints
from runtime.excitation.limits.limit_rows import LimitRows, Limits, whitening
from runtime.excitation.motion.trajectory import COSINE, Trajectory
from runtime.excitation.search.measures import mean_gram
from runtime.library import Array, Library

UNSEEN = 40
"""Number of motions."""
UNSEEN_DURATION, UNSEEN_HARMONICS, UNSEEN_SAMPLES = 10.0, 5, 40
"""Of each motion: duration [s], cosines per joint, samples of its way out."""
SMALLER = 0.97
"""Factor of a motion that breaks a limit of a dependent joint, as often as needed."""
UNSEEN_SEED = 20
"""The same motions for all designs of a robot."""


def unseen_motions(lib: Library, home: Array) -> list[Trajectory]:
    """Random cosines, each scaled until it reaches a limit, those of dependent joints included."""
    shape = (lib, home, UNSEEN_HARMONICS, UNSEEN_DURATION)
    matrix, _ = Limits(*shape).inequalities()
    spread = whitening(matrix, lib.n_joints)
    rng = np.random.default_rng(UNSEEN_SEED)
    dependents = dependent_joints(lib, home)
    # Both ways are the same path: even limits need its first half.
    phi = COSINE.at(lib, UNSEEN_HARMONICS, np.linspace(0.0, UNSEEN_DURATION, 201), UNSEEN_DURATION)
    rows = LimitRows(dependents, home, phi, half=True)
    # A home beyond such a limit has no way inside it.
    has_room = rows.worst(np.zeros((lib.n_joints, phi.shape[1]))) < 0.0
    motions = []
    for x in rng.normal(size=(UNSEEN, len(spread))):
        a = spread @ x
        a = (a / np.max(matrix @ a)).reshape(lib.n_joints, -1)
        while has_room and rows.worst(a) > 0.0:
            a = SMALLER * a
        motions.append(Trajectory(home, a, UNSEEN_DURATION))
    return motions


def unseen_times() -> Array:
    """Samples of the way out of an unseen motion, s; it comes back the same way."""
    return np.linspace(0.0, UNSEEN_DURATION / 2, UNSEEN_SAMPLES)


def unseen_torque(lib: Library, home: Array) -> Array:
    """Mean square of the torque per error of β: Q = mean of Y_bᵀ Y_b over unseen motions."""
    t = unseen_times()
    result = np.zeros((len(lib.base_columns),) * 2)
    for motion in unseen_motions(lib, home):
        rows = lib.base_regressor(*motion.at(lib, t)[:3])
        result += np.einsum("tjk,tjl->kl", rows, rows, optimize=True)
    return result / (UNSEEN * len(t))


def unseen_rows(lib: Library, home: Array) -> Array:
    """Base regressor (N, n, n_b) of all samples of unseen motions."""
    t = unseen_times()
    return np.concatenate(
        [lib.base_regressor(*motion.at(lib, t)[:3]) for motion in unseen_motions(lib, home)]
    )


def unseen_joints(lib: Library, home: Array) -> Array:
    """The same mean as `unseen_torque`, joint by joint, (n, n_b, n_b)."""
    rows = unseen_rows(lib, home)
    return np.stack([mean_gram(rows[:, j : j + 1]) for j in range(lib.n_joints)])
