"""Mass of the load of a run from the difference to a run of the same motion without it.

    τ' − τ − (Y' − Y) π = Y_link π_load(m, r) + offset + viscous + Coulomb + gain τ

The motions differ by some thousandths, which the links π of the run without load account for. The
load is a point of mass m at r on one of the bodies; the other terms are free for every joint, so
that friction cancels but for its change. Rows above `END` are left out: the pitch carries
torque there that the model lacks, and other torque in each run.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from runtime.library import Array, Library
from runtime.recording import Friction, Preparation
from runtime.recording.preprocessing import prepare
from scripts.dvrk.fits import CUTOFF, RATE, fitted, log

JOINTS = 3
"""Joints of the arm, which the load acts on."""
END = 0.5
"""Largest angle of the pitch, rad."""
STEP = 5
"""Every fifth row is taken: 40 Hz."""
PERIOD = 6.0
"""Of the motion, s."""
SPEED = 0.05
"""Width of the sign of dq [rad/s, m/s]."""
PLACES = (-0.15, 0.15)
"""First guesses of each coordinate of r, m."""


@dataclass(frozen=True, slots=True, eq=False)
class LoadFit:
    """Load on one body."""

    link: str  # name of the body
    mass: float  # kg
    spread: float  # standard error of the mass from those of single periods, kg
    place: Array  # r in the frame of the body, (3,) [m]
    errors: Array  # per joint, norm of the residual over that of the difference less its mean, (3,)


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Difference of two runs at N instants."""

    difference: Array  # of the torques, less that of the motions, (N, 3) [N·m, N]
    terms: Array  # free terms of each joint, (3, N, 4)
    regressor: Array  # of all bodies, (N, 3, 10 n)
    periods: Array  # number of the period of each row, (N,)

    def of_period(self, number: int) -> "Rows":
        """Rows of one period."""
        taken = self.periods == number
        return Rows(
            self.difference[taken], self.terms[:, taken], self.regressor[taken], self.periods[taken]
        )

    def unexplained(self, torque: Array) -> Array:
        """Difference less a torque (N, 3) and the best free terms, over its size per joint."""
        rest = self.difference - torque
        for k in range(JOINTS):
            terms = self.terms[k]
            rest[:, k] -= terms @ np.linalg.lstsq(terms, rest[:, k], rcond=None)[0]
        return np.asarray(rest / self.difference.std(axis=0))


def difference(lib: Library, data: Path, empty: str, loaded: str) -> Rows:
    """Difference of the run with the load to that without."""
    pi = fitted(lib, data, empty, empty).pi
    steps = Preparation(filter="butterworth", cutoff_hz=CUTOFF, trim_s=1.0)
    tau, rigid, moved = [], [], None
    for run in (empty, loaded):
        moved = prepare(log(data, run), steps, Friction(()), lib=lib)
        tau.append(moved.required("tau")[:, :JOINTS])
        motion = (moved.q, moved.required("dq"), moved.required("ddq"))
        rigid.append(lib.inverse_dynamics(*motion, pi)[:, :JOINTS])
    taken = np.flatnonzero(motion[0][:, 1] < END)[::STEP]
    dq, before = motion[1][taken, :JOINTS], tau[0][taken]
    terms = [np.ones_like(dq), dq, np.tanh(dq / SPEED), before]
    return Rows(
        (tau[1] - tau[0] - rigid[1] + rigid[0])[taken],
        np.stack(terms, axis=-1).transpose(1, 0, 2),
        lib.regressor(*(values[taken] for values in motion))[:, :JOINTS],
        taken // round(PERIOD * RATE),
    )


def point(mass: float, r: Array) -> Array:
    """π of a point of a mass [kg] at r (3,) [m]: mass, first moment, inertia about the origin."""
    inertia = mass * (r @ r * np.eye(3) - np.outer(r, r))
    xx, xy, xz, yy, yz, zz = inertia[np.triu_indices(3)]
    return np.array([mass, *(mass * r), xx, yy, zz, xy, xz, yz])


def load_on(rows: Rows, body: int, name: str) -> LoadFit:
    """The load as a point on one of the bodies."""
    starts = [np.array([0.1, x, y, z]) for x in PLACES for y in PLACES for z in PLACES]
    best = min((_fit(rows, body, start) for start in starts), key=lambda each: float(each[1]))[0]
    single = [_fit(rows.of_period(k), body, best)[0][0] for k in np.unique(rows.periods)]
    spread = np.std(single, ddof=1) / np.sqrt(len(single))
    rest = rows.unexplained(_torque(rows, body, best))
    return LoadFit(name, float(best[0]), float(spread), best[1:], np.sqrt(np.mean(rest**2, axis=0)))


def _torque(rows: Rows, body: int, x: Array) -> Array:
    return np.asarray(rows.regressor[..., 10 * body : 10 * body + 10] @ point(x[0], x[1:]))


def _fit(rows: Rows, body: int, start: Array) -> tuple[Array, float]:
    def rest(x: Array) -> Array:
        return rows.unexplained(_torque(rows, body, x)).ravel()

    found = least_squares(rest, start, x_scale=np.array([0.05, 0.1, 0.1, 0.1]), max_nfev=60)
    return found.x, found.cost
