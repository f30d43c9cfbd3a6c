"""Check of the direction of gravity together with the sign of τ (traps 3, 5).

    τ = ± [Y₀(q, dq, ddq) + s Y_g(q)] π + F φ,   s ∈ {1, 0, −1}

with Y_g = Y(q, 0, 0) and Y₀ = Y − Y_g. Least squares makes every mass negative and fits −g nearly
as well as g. Under P(π) ≻ 0 (maximum a posteriori with a weak prior) only one of them fits, so that
consistent bodies decide. An arm on a wall differs: gravity then loads joint 1, which no sign
explains. The columns of that case come from the poses of the tip with the outer joints at zero,
with unit masses in a frame of each link:

    τ_d = ∂/∂q [e_d · (p_k, R_k)] θ_k,   d = x, y, z in the base frame
"""

import shlex
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import RuntimeFault
from runtime.estimators.convex import NONE, Reduced, convex_problem, prior_of, solve
from runtime.inspection.checks.torque_rows import TorqueRows, least_squares
from runtime.inspection.finding import ERROR, WARNING, Finding
from runtime.library import Array, Library
from runtime.recording import Recipe

MUCH = 0.6
"""Residual with another sign over that with the present one, below which it is reported."""
ALIKE = 1.3
"""Residual of another sign over the best one, below which the data do not decide."""
FEW = 250
"""Rows of the consistent fits; more do not change the decision."""
TILTED, UNEXPLAINED = 0.6, 0.1
"""Residual with free gravity over that with the model's direction, and residual over torque, from
which on a tilted base is considered."""
_STEP = 1e-5
G = 9.81
"""m/s², for a model without gravity."""
_NAMES = {1.0: "as in the model", 0.0: "absent", -1.0: "reversed"}


@dataclass(frozen=True, slots=True)
class Trial:
    """One sign of τ with one of gravity, with the relative residuals of two fits.

    Attributes:
        sign: of τ, 1 or −1.
        gravity: s, 1, 0 or −1.
        consistent: residual of consistent bodies over the torque.
        free: residual of least squares over the torque.
    """

    sign: float
    gravity: float
    consistent: float
    free: float


def gravity(torque_rows: TorqueRows, plan: Recipe) -> tuple[Recipe, list[Finding]]:
    """Sign of τ and of gravity together, and gravity off the model's axis.

    Measured: residual of consistent bodies for two signs of τ and three of gravity.

    Args:
        torque_rows: prepared rows.
        plan: recipe so far.

    Returns:
        The recipe, with the sign of τ reversed where that is the cause; "torque_sign" or
        "gravity" where another case leaves less than `MUCH` of the residual.
    """
    trials = [
        _trial(torque_rows, sign, scale) for sign in (1.0, -1.0) for scale in (1.0, 0.0, -1.0)
    ]
    present, best = trials[0], min(trials, key=lambda t: t.consistent)
    evidence = {
        f"tau {t.sign:+.0f}, gravity {t.gravity:+.0f}": [t.consistent, t.free] for t in trials
    }
    if best is not present and best.consistent < MUCH * present.consistent:
        return _reversed(torque_rows.lib, plan, present, best, trials, evidence)
    if present.consistent > UNEXPLAINED:
        return plan, _tilted(torque_rows, evidence)
    return plan, []


def _reversed(
    lib: Library, plan: Recipe, present: Trial, best: Trial, trials: list[Trial], evidence: dict
) -> tuple[Recipe, list[Finding]]:
    """The finding of a better case: reversed torque, compensated gravity, or an arm mounted so."""
    rivals = [t for t in trials if t is not best and t.consistent < ALIKE * best.consistent]
    doubt = f" (the motion is too slow to exclude {_name(rivals[0])})" if rivals else ""
    comparison = (
        f"with {_name(best)}, physically consistent bodies leave {100 * best.consistent:.2g} % of "
        f"the torque unexplained, in the present case {100 * present.consistent:.2g} % (least "
        f"squares with negative masses {100 * present.free:.2g} %){doubt}"
    )
    if best.sign < 0 and best.gravity > 0 and plan.torque is not None:
        before = np.atleast_1d(np.asarray(plan.torque.sign, dtype=float))
        sign = tuple(float(-s) for s in before) if before.size > 1 else float(-before[0])
        cause = "the log holds the torque that acts on the robot, not the torque that it applies"
        return plan.replace(torque=replace(plan.torque, sign=sign)), [
            Finding(
                "torque_sign",
                ERROR,
                f"{comparison}: {cause}; set sign = -1 under [torque]",
                evidence,
                trap=3,
            )
        ]
    if best.gravity == 0.0:
        what = (
            "the signal lacks the gravity compensation of the controller; log the whole torque, or "
            f"build the robot without gravity: {_build(lib, 'weightless', '0,0,0')}"
        )
    else:
        what = (
            "gravity acts in the opposite direction of the model; build the robot so: "
            f"{_build(lib, 'turned', _numbers(-lib.gravity))}"
        )
    return plan, [Finding("gravity", ERROR, f"{comparison}: {what}", evidence, trap=5)]


def _build(lib: Library, suffix: str, gravity: str) -> str:
    """Command that builds the same arm with another gravity in the frame of the base."""
    name = f"{lib.name}_{suffix}"
    urdf = lib.folder / f"{lib.name}.urdf"
    return (
        f"python -m symgen build --urdf {shlex.quote(str(urdf))} --name {name} --gravity {gravity} "
        "(with the other options of its build, such as --tip, --project, --config)"
    )


def _numbers(vector: Array) -> str:
    return ",".join(f"{x:g}" for x in vector + 0.0)


def _name(trial: Trial) -> str:
    sign = "τ as logged" if trial.sign > 0 else "τ negated"
    return f"{sign} and gravity {_NAMES[trial.gravity]}"


def _trial(torque_rows: TorqueRows, sign: float, scale: float) -> Trial:
    """Fit consistent bodies, and unconstrained parameters, to ±τ with gravity s g."""
    lib, s = torque_rows.lib, torque_rows.samples
    step = max(1, len(s) // FEW)
    few = s.rows(slice(None, None, step))
    n = lib.n_joints
    still = np.zeros_like(few.q)
    full = lib.regressor(few.q, few.dq, few.ddq)
    falls = lib.regressor(few.q, still, still)
    Y = full + (scale - 1.0) * falls
    weights = 1.0 / np.sqrt(np.mean(few.tau**2, axis=0) + 0.01 * np.mean(few.tau**2))
    rows = (Y * weights[:, None]).reshape(len(few) * n, -1)
    target = (sign * few.tau * weights).ravel()
    size = max(float(np.linalg.norm(target)), 1e-300)
    # Friction columns are projected out, so that only the bodies are constrained.
    friction = torque_rows.friction_rows().reshape(len(s), n, -1)[::step] * weights[:, None]
    basis = np.linalg.qr(friction.reshape(len(few) * n, -1))[0]
    rows, target = rows - basis @ (basis.T @ rows), target - basis @ (basis.T @ target)
    _, rest = least_squares(rows, target)
    free = float(np.linalg.norm(rest)) / size
    # Consistent fit: most probable bodies under a prior of next to no weight.
    triangle: Array = np.asarray(np.linalg.qr(np.column_stack([rows, target]), mode="r"))
    width = rows.shape[1]
    data = Reduced(
        np.ascontiguousarray(triangle[:width, :width]),
        np.ascontiguousarray(triangle[:width, width]),
        float(triangle[width, width] ** 2),
        float(len(few)),
        float(max(len(target) - width, 1)),
    )
    gamma = NONE * max(data.variance, 1e-6) / data.count
    pi = solve(lib, convex_problem(data, prior_of(lib), gamma)).pi
    loss = np.sqrt(max(2.0 * data.value(pi) * data.count, 0.0))
    return Trial(sign, scale, float(loss) / size, free)


def _tilted(torque_rows: TorqueRows, evidence: dict) -> list[Finding]:
    """The finding of a base on a wall or tilted, where gravity off the model's axis fits better."""
    lib, s = torque_rows.lib, torque_rows.samples
    step = max(1, len(s) // FEW)
    few = s.rows(slice(None, None, step))
    still = np.zeros_like(few.q)
    try:
        turns = _potential_rows(torque_rows, few.q)
        inertial = lib.regressor(few.q, few.dq, few.ddq) - lib.regressor(few.q, still, still)
    except RuntimeFault:
        return []
    n = lib.n_joints
    friction = torque_rows.friction_rows().reshape(len(s), n, -1)[::step].reshape(len(few) * n, -1)
    common = np.hstack([inertial.reshape(len(few) * n, -1), friction])
    target = few.tau.ravel()
    size = float(np.linalg.norm(target))

    def left(axes: tuple[int, ...]) -> float:
        matrix = np.hstack([common, *(turns[axis] for axis in axes)])
        return float(np.linalg.norm(least_squares(matrix, target)[1])) / size

    axis = int(np.argmax(np.abs(lib.gravity))) if lib.gravity.any() else 2
    along = left((axis,))
    others = {a: left((a,)) for a in range(3) if a != axis}
    every = left((0, 1, 2))
    best = min(others, key=lambda a: others[a])
    names = "xyz"
    facts = evidence | {"along": {names[axis]: along} | {names[a]: e for a, e in others.items()}}
    if along < UNEXPLAINED or every > TILTED * along:
        return []
    exact = others[best] < 1.5 * every
    wall = _numbers((float(np.linalg.norm(lib.gravity)) or G) * np.eye(3)[best])
    cause = (
        f"horizontal gravity along {names[best]} of the base leaves {100 * others[best]:.2g} %: "
        f"the arm is mounted on a wall; build it so: {_build(lib, 'wall', wall)}, and once more "
        f"with gravity along -{names[best]}: only the right one fits with physically consistent "
        "bodies"
        if exact
        else f"gravity in a free direction leaves {100 * every:.2g} %: the base is tilted; measure "
        "its angles and build the robot so: "
        f"{_build(lib, 'tilted', 'X,Y,Z')}"
    )
    return [
        Finding(
            "gravity",
            ERROR if exact else WARNING,
            f"gravity along {names[axis]}, as in the model, leaves {100 * along:.2g} % of the "
            f"torque unexplained even with negative masses; {cause}",
            facts,
            trap=5,
        )
    ]


def _potential_rows(torque_rows: TorqueRows, q: Array) -> list[Array]:
    """∂/∂q of the three coordinates of a frame fixed to each link, 3 × (N n, 4 n)."""
    lib = torque_rows.lib
    n = lib.n_joints
    rows = np.zeros((3, len(q), n, n, 4))
    for k in range(n):
        inner = q.copy()
        inner[:, k + 1 :] = 0.0
        for i in range(k + 1):
            step = np.zeros(n)
            step[i] = _STEP
            ahead, behind = lib.end_effector(inner + step), lib.end_effector(inner - step)
            slope = (ahead - behind)[:, :3] / (2.0 * _STEP)  # (N, 3, 4): R and p
            rows[:, :, i, k] = np.moveaxis(slope, 1, 0)
    return [each.reshape(len(q) * n, 4 * n) for each in rows]
