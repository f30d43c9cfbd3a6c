"""Expected accuracy of a motion, before the robot moves, for a given torque noise.

Least squares on f t_f samples with white noise σ has the covariance (G + G₀)⁻¹, G the information
of the motion (`information`). With friction (viscous, Coulomb, offset of every joint) estimated
beside the unknowns, theirs is the block of the inverse over all columns [Y_b F]. Filtered logs have
correlated noise: their errors are larger by the root of the variance inflation.

Base parameters that no motion within the limits shows have no accuracy: the design leaves them out.
In a narrow range of positions the columns of a mechanism's regressor become combinations of each
other: over ±0.05 rad 1, q and q² differ, q³ is lost. With columns of unit length, [F Y] of friction
and base parameters of several random motions, R_kk of the pivoted factorisation of what F leaves of
Y is the part of a column that no other produces. Where R_kk ≤ `SHOWN`, and motions with twice the
functions do not help, the design leaves the parameter at the value of the URDF, as `identify` does.
"""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import dct
from scipy.linalg import qr

from runtime.errors import IdentificationError
from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.criteria import (
    PAYLOAD,
    covariance,
    mean_gram,
    rank,
    sizes,
    too_many,
    unseen_joints,
)
from runtime.excitation.search.design_settings import MOST_HARMONICS, DesignSettings
from runtime.excitation.search.information import COST_SAMPLES, FRICTION, Information, information
from runtime.excitation.search.single_start import Search
from runtime.library import Array, Library
from runtime.library.parameters import FIRST_MOMENT, MASS, N_PARAMETERS, PI_NAMES, mass
from runtime.recording import Friction
from runtime.recording.friction.columns import OFFSET
from runtime.recording.friction.coupled_motors import spread
from runtime.recording.friction.model import columns as friction_columns
from runtime.recording.settings import JointMotion

SAMPLES = (COST_SAMPLES, 1000)  # 80 as in the cost, optimistic by some percent; and nearly all
MOST_SAMPLES = 2**14
"""Largest number of samples of the motion that stand for a log, which may have millions; the mean
of the rows of a smooth motion hardly depends on their number."""
_OFFSET = (OFFSET.name,)  # column that is fitted beside a payload: sensors drift
_COM = np.array([0.0, 0.0, 0.1])  # centre of mass of the payload in the last link's frame, m


@dataclass(frozen=True, slots=True)
class Score:
    """All criteria of one motion for one set of columns."""

    samples: int  # equally spaced, both ends included
    columns: int  # number of columns of the regressor, friction included
    friction: tuple[str, ...]  # names of its columns, empty without
    condition: float  # cond of these columns at unit length, by this motion without earlier logs
    relative_error: float  # RMS over the unknowns of σ / size
    torque_error: float  # RMS error of the torque on unseen motions, all joints together, N·m or N
    half_axis: float  # geometric mean of half-axes of the unknowns' ellipsoid, mixed SI


@dataclass(frozen=True, slots=True)
class Prediction:
    """Expected accuracy of least squares on a motion."""

    known: Information  # noise, rate, unknowns and earlier logs, which it counts
    scores: tuple[Score, ...]  # without and with friction, at each of `SAMPLES`
    sigma: Array  # standard deviations of the unknowns, (k,) SI; friction is not estimated
    sigma_with_friction: Array | None  # with friction; None where it is not identifiable
    # RMS standard deviation of each joint's torque on unseen motions, (n,) N·m or N; friction is
    # not estimated
    torque: Array
    # σ of a payload of 1 kg, 0.1 m before the last link, on a known arm, kg; with the offsets of
    # the torques. None where it is not identifiable
    payload_mass: float | None
    payload_com: Array | None  # σ of its centre of mass, (3,) m
    notes: tuple[str, ...]  # sentences on what is not identifiable

    @property
    def payload_only(self) -> bool:
        """Whether the unknowns are the ten of the last link, not the base parameters."""
        return self.known.columns is not None and not self.known.left_out

    def facts(self) -> dict[str, object]:
        """The prediction as a JSON object."""

        def numbers(values: Iterable[float] | None) -> list[float] | None:
            return None if values is None else [float(value) for value in values]

        known = self.known
        return {
            "torque_noise": numbers(known.noise),
            "rate_hz": known.rate,
            "earlier_logs_count": known.earlier is not None,
            "unknowns": "payload" if self.payload_only else "base parameters",
            **({"left_out": list(known.left_out)} if known.left_out else {}),
            "criteria": [
                {
                    "samples": score.samples,
                    "columns": score.columns,
                    "friction": list(score.friction),
                    "condition_number_of_unit_columns": score.condition,
                    "relative_error": score.relative_error,
                    "torque_error": score.torque_error,
                    "half_axis": score.half_axis,
                }
                for score in self.scores
            ],
            "sigma": numbers(self.sigma),
            "sigma_with_friction": numbers(self.sigma_with_friction),
            "sigma_of_torque_per_joint": numbers(self.torque),
            "sigma_of_payload_mass": self.payload_mass,
            "sigma_of_payload_com": numbers(self.payload_com),
            "notes": list(self.notes),
        }


def predict(
    lib: Library, trajectory: Trajectory, known: Information, names: tuple[str, ...] = FRICTION
) -> Prediction:
    """Expected accuracy of a motion."""
    joints = [known.of_unknowns(one) for one in unseen_joints(lib, trajectory.home)]
    seen = np.sum(joints, axis=0)
    size, scores, notes = sizes(lib, known), [], []
    spreads: dict[tuple[str, ...], Array] = {}
    for columns in dict.fromkeys(((), names)):
        try:
            for samples in SAMPLES:
                gram, condition = _gram(lib, trajectory, known, columns, samples)
                error = spreads[columns] = _covariance(gram, len(size), trajectory)
                relative = float(np.sqrt(np.mean(np.diag(error) / size**2)))
                torque = float(np.sqrt(np.sum(seen * error)))
                axis = float(np.exp(np.linalg.slogdet(error)[1] / (2 * len(error))))
                scores.append(Score(samples, len(gram), columns, condition, relative, torque, axis))
        except IdentificationError as error:
            if not columns:
                raise
            notes.append(f"with friction {', '.join(columns)}: {error}")
    if known.left_out:
        notes.append(
            f"no figure counts the errors of the {len(known.left_out)} base parameters that no "
            "motion within these limits shows"
        )
    best = spreads[()]
    mass_and_com: tuple[float | None, Array | None] = (None, None)
    with suppress(IdentificationError):  # a motion that does not show them
        ten = information(lib, known.noise, known.rate, payload=True)
        mass_and_com = payload_sigma(covariance_of(lib, trajectory, ten, _OFFSET))
    return Prediction(
        known,
        tuple(scores),
        np.sqrt(np.diag(best)),
        np.sqrt(np.diag(spreads[names])) if names in spreads else None,
        np.sqrt([np.sum(one * best) for one in joints]),
        *mass_and_com,
        tuple(notes),
    )


def covariance_of(
    lib: Library,
    trajectory: Trajectory,
    known: Information,
    names: tuple[str, ...] = (),
    samples: int | None = None,
) -> Array:
    """Covariance of the unknowns by least squares on the motion, friction estimated too."""
    count = samples or min(round(known.rate * trajectory.duration) + 1, MOST_SAMPLES)
    gram, _ = _gram(lib, trajectory, known, names, count)
    k = len(lib.base_columns) if known.columns is None else known.columns.shape[1]
    return _covariance(gram, k, trajectory)


def _gram(
    lib: Library, trajectory: Trajectory, known: Information, names: tuple[str, ...], samples: int
) -> tuple[Array, float]:
    """Information over [unknowns, friction] and cond of these columns."""
    t = np.linspace(0.0, trajectory.duration, samples)
    q, dq, ddq, _ = trajectory.at(lib, t)
    rows = lib.base_regressor(q, dq, ddq)
    if known.columns is not None:
        rows = rows @ known.columns
    k = rows.shape[2]
    of_joints = friction_columns(JointMotion(dq), Friction(names))
    rows = np.concatenate([rows, spread(of_joints, None)], axis=2)
    flat = rows.reshape(-1, rows.shape[2])
    lengths = np.linalg.norm(flat, axis=0)
    condition = float(np.linalg.cond(flat / np.where(lengths > 0, lengths, 1.0)))
    if known.spectrum is not None:
        weight = known.spectrum.amplitudes(np.arange(samples) / (2 * samples * (t[1] - t[0])))
        rows = dct(rows, axis=0, norm="ortho") * weight[:, :, None]
    gram = mean_gram(rows / known.noise[:, None]) * (known.rate * trajectory.duration)
    if known.earlier is not None:
        gram[:k, :k] += known.of_unknowns(known.earlier)
    return gram, condition


def _covariance(gram: Array, unknowns: int, trajectory: Trajectory) -> Array:
    inverse = covariance(gram)
    if inverse is None:
        raise IdentificationError(too_many(rank(gram), len(gram), trajectory.coefficients.shape[1]))
    return inverse[:unknowns, :unknowns]


def payload_sigma(error: Array) -> tuple[float, Array]:
    """σ of mass and centre of a payload 0.1 m before the last link, δc = (δ(mc) − c δm) / m."""
    load = mass(PAYLOAD)
    slope = np.zeros((3, len(PAYLOAD)))
    slope[:, MASS], slope[:, FIRST_MOMENT] = -_COM / load, np.eye(3) / load
    return float(np.sqrt(error[MASS, MASS])), np.sqrt(np.diag(slope @ error @ slope.T))


def unit_payload_sentence(mass: float, com: Array) -> str:
    """Sentence on the accuracy of a payload of 1 kg."""
    position = " ".join(f"{1000 * value:.2f}" for value in com)
    return (
        f"a payload of 1 kg on a known arm: mass to ±{1000 * mass:.2f} g, "
        f"centre of mass to ±({position}) mm"
    )


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
