"""Base parameters that no motion within the limits shows, and a design without them.

In a narrow range of positions the columns of a mechanism's regressor become combinations of each
other: over ±0.05 rad 1, q and q² differ, q³ is lost. With columns of unit length, [F Y] of friction
and base parameters of several random motions, R_kk of the pivoted factorisation of what F leaves of
Y is the part of a column that no other produces. Where R_kk ≤ `SHOWN`, and motions with twice the
functions do not help, the design leaves the parameter at the value of the URDF, as `identify` does.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import qr

from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.condition_cost import COST_SAMPLES
from runtime.excitation.search.design_settings import MOST_HARMONICS, DesignSettings
from runtime.excitation.search.information import Information
from runtime.excitation.search.measures import rank
from runtime.excitation.search.single_start import Search
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, PI_NAMES
from runtime.recording import Friction
from runtime.recording.friction.model import columns as friction_columns
from runtime.recording.settings import JointMotion

SHOWN = 1e-5
"""Least part of a column of unit length that no other column produces. The search works on Gram
matrices, which resolve 1e-7 (their rounding is the square of it); a torque error of 1e-4 of the
torque hides ten times what is left out here."""
MOTIONS = 4  # random motions that are examined together


def without_unseen(
    lib: Library, settings: DesignSettings, planned: Information
) -> tuple[DesignSettings, Information, str]:
    """The settings and the planned information without parameters that no motion shows."""
    same = settings, planned, ""
    if planned.columns is not None or planned.earlier is not None or _shows_all(lib, settings):
        return same
    more = min(2 * settings.harmonics, MOST_HARMONICS)
    if _shows_all(lib, replace(settings, harmonics=more)):
        return same
    left = unseen(_motions(lib, Search(lib, settings), MOTIONS), lib, planned.friction)
    if not left:
        return same
    kept = np.delete(np.eye(len(lib.base_columns)), left, axis=1)
    reduced = replace(planned, columns=kept, left_out=left)
    places = [divmod(lib.base_columns[k], N_PARAMETERS) for k in left]
    names = ", ".join(f"{PI_NAMES[k]} of {lib.link_names[link]}" for link, k in places)
    sentence = (
        f"note: no motion within these limits shows {len(left)} of {len(lib.base_columns)} base "
        f"parameters beside the others: {names}; the design leaves them at the values of the URDF, "
        "as identify with a prior (map) does; a wider range of positions shows them"
    )
    of_search = settings.information or replace(planned, friction=())
    chosen = replace(of_search, columns=kept, left_out=left)
    return replace(settings, information=chosen), reduced, sentence


def unseen(
    motions: tuple[tuple[Array, Array, Array], ...], lib: Library, names: tuple[str, ...]
) -> tuple[int, ...]:
    """Base parameters whose columns are combinations of others, to `SHOWN`."""
    q, dq, ddq = (np.concatenate(each) for each in zip(*motions, strict=True))
    rows = lib.base_regressor(q, dq, ddq)
    columns = friction_columns(JointMotion(dq), Friction(names))
    lengths = np.linalg.norm(rows.reshape(-1, rows.shape[2]), axis=0)
    rows = rows / np.where(lengths > 0, lengths, 1.0)
    for j in range(lib.n_joints if names else 0):  # friction acts on the torque of its joint alone
        along = np.linalg.lstsq(columns[:, j], rows[:, j], rcond=None)[0]
        rows[:, j] -= columns[:, j] @ along
    triangle = np.asarray(np.linalg.qr(rows.reshape(-1, rows.shape[2]), mode="r"))
    _, upper, order = qr(triangle, pivoting=True)
    parts = np.abs(np.diagonal(upper))
    return tuple(sorted(int(k) for k in order[parts <= SHOWN]))


def _shows_all(lib: Library, settings: DesignSettings) -> bool:
    """Whether a random motion determines all unknowns, with the friction of a search or none."""
    search = Search(lib, settings)
    gram = search.cost.correlations(search.guess(0)[None])[0]
    if rank(gram) < len(gram):
        return False
    rows = lib.base_regressor(*_motions(lib, search, 1)[0])
    flat = rows.reshape(-1, rows.shape[2])
    return rank(flat.T @ flat) == flat.shape[1]


def _motions(lib: Library, search: Search, count: int) -> tuple[tuple[Array, Array, Array], ...]:
    """Random motions within the limits of the joints, q, dq, ddq each."""
    duration = search.settings.duration
    t = np.linspace(0.0, duration, COST_SAMPLES)
    guesses = (search.guess(number) for number in range(count))
    motions = (Trajectory(search.home, a, duration, search.basis).at(lib, t) for a in guesses)
    return tuple((q, dq, ddq) for q, dq, ddq, _ in motions)
