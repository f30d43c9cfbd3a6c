"""Direction of gravity in the base frame, fitted to the torque.

An arm on a wall: gravity loads joint 1, which no sign explains. The gravity torque of any direction
g comes from the poses of the links, with unit masses in a frame of each:

    τ_g = Σ_d g_d A_d θ,   A_d = ∂/∂q [e_d · (R_k, p_k)],   d = x, y, z

The residual is minimised over the unit sphere, θ being free. g and −g fit equally (θ → −θ); the
sign is that which gives the bodies of the URDF: A(g) θ at the model's direction resembles its
torque.
"""

import shlex

import numpy as np

from runtime.common.tables import significant
from runtime.errors import RuntimeFault
from runtime.estimators.regression.causes import potential_rows
from runtime.estimators.regression.posterior import least_squares, orthonormal
from runtime.inspection.checks.torque_rows import TorqueRows
from runtime.inspection.finding import ERROR, WARNING, Finding
from runtime.library import Array, Library

TILTED, SLIGHTLY = 0.6, 0.4
"""Residual with fitted gravity over that with the model's direction, below which another direction
is reported: where much of the torque is unexplained, and where little is."""
UNEXPLAINED, LITTLE = 0.1, 0.02
"""Residual over torque of the two cases. A tilt by the angle a leaves about a / 2."""
FEW = 250
"""Rows of the fits; more do not change the direction."""
AXIS = np.cos(np.radians(12.0))
"""Cosine to an axis of the base from which on the arm counts as mounted along it: the fit errs by
some degrees."""
G = 9.81
"""m/s², for a model without gravity."""
_SMALLEST = np.radians(1.0)
"""Resolution of the direction."""


def other_direction(torque_rows: TorqueRows, evidence: dict) -> list[Finding]:
    """Base on a wall or tilted: gravity off the model's direction fits much better."""
    lib, s = torque_rows.lib, torque_rows.samples
    few = s.rows(slice(None, None, max(1, len(s) // FEW)))
    still = np.zeros_like(few.q)
    try:
        turns = list(potential_rows(lib, few.q).reshape(3, len(few) * lib.n_joints, -1))
        inertial = lib.regressor(few.q, few.dq, few.ddq) - lib.regressor(few.q, still, still)
    except RuntimeFault:
        return []
    count = len(few) * lib.n_joints
    step = max(1, len(s) // FEW)
    friction = torque_rows.friction_rows().reshape(len(s), lib.n_joints, -1)[::step]
    common = np.hstack([inertial.reshape(count, -1), friction.reshape(count, -1)])
    fit = _Fit(common, turns, few.tau.ravel())
    size = float(np.linalg.norm(lib.gravity)) or G
    present = lib.gravity / size if lib.gravity.any() else np.array([0.0, 0.0, -1.0])
    along = fit.residual(present)
    if along < LITTLE:
        return []
    best = fit.minimum()
    left = fit.residual(best)
    if left > (SLIGHTLY if along < UNEXPLAINED else TILTED) * along:
        return []
    falls = lib.inverse_dynamics(few.q, still, still, lib.pi0).ravel()
    vector = size * best * fit.sign(best, present, falls)
    return [_finding(lib, vector, size, (along, left), evidence)]


def build_command(lib: Library, suffix: str, gravity: Array) -> str:
    """Command that builds the same arm with another gravity."""
    name = f"{lib.name}_{suffix}"
    urdf = lib.folder / f"{lib.name}.urdf"
    return (
        f"python -m symgen build --urdf {shlex.quote(str(urdf))} --name {name} --gravity "
        f"{_numbers(gravity)} (with the other options of its build, such as --tip, --settings "
        f"project=true, "
        "--config)"
    )


def _finding(
    lib: Library, vector: Array, size: float, residuals: tuple[float, float], evidence: dict
) -> Finding:
    """The finding of a fitted gravity vector."""
    along, left = residuals
    k = int(np.argmax(np.abs(vector)))
    axis = size * np.sign(vector[k]) * np.eye(3)[k]
    # Near the model's own axis it is a tilt of some degrees, not another mount.
    exact = abs(vector[k]) > AXIS * size and bool(axis @ lib.gravity < AXIS * size**2)
    name = f"{'-' if vector[k] < 0 else ''}{'xyz'[k]}"
    fitted = np.round(vector, 2)
    cause = (
        f"the arm is mounted on a wall or turned; build it so: {build_command(lib, 'wall', axis)}, "
        f"and once more with gravity along {'-' if vector[k] > 0 else ''}{'xyz'[k]} if the bodies "
        "become inconsistent"
        if exact
        else "the base is tilted; measure its angles, or build the robot so: "
        f"{build_command(lib, 'tilted', fitted)}"
    )
    return Finding(
        "gravity",
        ERROR if exact else WARNING,
        f"gravity of the model ({_numbers(lib.gravity)} m/s² in the base frame) leaves "
        f"{significant(100 * along)} % of the torque unexplained even with negative masses, the "
        "fitted "
        f"gravity ({_numbers(fitted)} m/s²{f', nearly along {name}' if exact else ''}) "
        f"{significant(100 * left)} %: {cause}",
        evidence | {"gravity": [float(x) for x in vector], "along": along, "left": left},
    )


def _numbers(vector: Array) -> str:
    return ",".join(f"{x:g}" for x in vector + 0.0)


class _Fit:
    """Residual of the torque as a function of the direction of gravity, bodies being free."""

    def __init__(self, common: Array, turns: list[Array], tau: Array) -> None:
        """Rows of the equations: common columns, A_x, A_y, A_z, and the torque."""
        basis = orthonormal(common)
        self._turns = turns
        self._free = [part - basis @ (basis.T @ part) for part in turns]
        self._target = tau - basis @ (basis.T @ tau)
        self._size = float(np.linalg.norm(tau))

    def _solved(self, direction: Array) -> tuple[Array, Array]:
        matrix = sum(d * part for d, part in zip(direction, self._free, strict=True))
        return least_squares(np.asarray(matrix), self._target)

    def residual(self, direction: Array) -> float:
        """Residual over the torque for one direction, (3,) of length 1."""
        return float(np.linalg.norm(self._solved(direction)[1])) / max(self._size, 1e-300)

    def minimum(self) -> Array:
        """Direction of least residual: half a sphere of starts, then steps that shrink."""
        grid = [np.array(v, dtype=float) for v in _HALF_SPHERE]
        best = min((v / np.linalg.norm(v) for v in grid), key=self.residual)
        least, step = self.residual(best), np.radians(20.0)
        while step > _SMALLEST:
            sides = np.linalg.svd(best[None])[2][1:]
            tries = [best + np.tan(step) * sign * side for side in sides for sign in (1.0, -1.0)]
            tries = [v / np.linalg.norm(v) for v in tries]
            costs = [self.residual(v) for v in tries]
            if min(costs) < least:
                least, best = min(costs), tries[int(np.argmin(costs))]
            else:
                step /= 2.0
        return best

    def sign(self, direction: Array, present: Array, falls: Array) -> float:
        """Sign of the direction whose bodies resemble those of the URDF."""
        theta, _ = self._solved(direction)
        turned = sum(d * part for d, part in zip(present, self._turns, strict=True)) @ theta
        return 1.0 if float(turned @ falls) >= 0 else -1.0


_HALF_SPHERE = [
    *((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1)),
    *((0, 1, -1), (1, 1, 1), (1, 1, -1), (1, -1, 1), (-1, 1, 1)),
]
