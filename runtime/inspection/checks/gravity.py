"""Check of the direction of gravity together with the sign of τ.

    τ = ± [Y₀(q, dq, ddq) + s Y_g(q)] π + F φ,   s ∈ {1, 0, −1}

with Y_g = Y(q, 0, 0) and Y₀ = Y − Y_g. Least squares makes every mass negative and fits −g nearly
as well as g. Where τ is opposite to the gravity torque of the URDF, the sign of friction decides
(`torque_evidence`): it dissipates, unless τ itself has the opposite sign. Without significant
friction, consistent bodies decide: under P(π) ≻ 0 (maximum a posteriori with a weak prior) only one
sign fits. Another direction than that of the model: `other_direction`.

The evidence of one joint is a regression on the torque of the URDF,

    τ_j = a g_j(q) + s m_j(q, dq, ddq) + c tanh(dq_j / ε) + v dq_j + b

with gravity part g and inertial part m. a is −1 where gravity or τ has the opposite sign. Friction
dissipates: P_j = mean(c |dq_j| + v dq_j²) > 0 in every real joint, so that P_j < 0 is a torque of
opposite sign. Standard deviations are those of coloured noise.

Direction of gravity in the base frame, fitted to the torque.

An arm on a wall: gravity loads joint 1, which no sign explains. The gravity torque of any direction
g comes from the poses of the links, with unit masses in a frame of each:

    τ_g = Σ_d g_d A_d θ,   A_d = ∂/∂q [e_d · (R_k, p_k)],   d = x, y, z

The residual is minimised over the unit sphere, θ being free. g and −g fit equally (θ → −θ); the
sign is that which gives the bodies of the URDF: A(g) θ at the model's direction resembles its
torque.
"""

import shlex
from dataclasses import dataclass

import numpy as np

from runtime.common.tables import significant
from runtime.errors import RuntimeFault
from runtime.estimators.convex.entropic_prior import NONE, prior_of
from runtime.estimators.convex.newton import convex_problem, solve
from runtime.estimators.regression.causes import potential_rows
from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.estimators.regression.factor import reduced_of
from runtime.estimators.regression.posterior import least_squares, orthonormal, posterior_of
from runtime.estimators.regression.samples import Samples
from runtime.inspection.checks.torque_rows import EPSILON, TorqueRows, partial_slope
from runtime.inspection.finding import ERROR, WARNING, Checked, Finding, joint_list
from runtime.library import Array, Integers, Library
from runtime.recording import Recipe

LOADED, OPPOSITE_SHARE = 0.7, 0.8
"""Partial correlation of τ with the gravity torque from which on a joint follows it, and share of
the gravity torque that joints opposite to it must carry."""
SURE = 6.0
"""Standard deviations from which on a sign counts; the noise of friction is not white, and 4 are
reached by chance on logs of 5 s."""
MUCH = 0.6  # residual with another sign over that with the present one, below which it is reported
ALIKE = 1.3  # residual of another sign over the best one, below which the data do not decide
FEW = 250  # rows of the fits; more do not change the decision
TURNED = 0.02  # residual over torque from which on another direction is considered: a tilt of 2°
_NAMES = {1.0: "as in the model", 0.0: "absent", -1.0: "reversed"}
SIGNS, GRAVITIES = (1.0, -1.0), tuple(_NAMES)  # compared signs of τ and gravities, present first


@dataclass(frozen=True, slots=True)
class TorqueEvidence:
    """Regression of every joint on the torque of the URDF, (n,) each."""

    gravity: Array  # a
    load: Array  # RMS of g
    correlation: Array  # partial correlation of τ with g
    power: Array  # P [W], in the unit of the logged torque
    power_over_sigma: Array  # P over its standard deviation

    @property
    def gravity_is_against(self) -> bool:
        """Whether τ is opposite to the gravity torque at the joints that carry most of it."""
        return float(self.load[self.opposite].sum()) > OPPOSITE_SHARE * float(self.load.sum())

    @property
    def opposite(self) -> Integers:
        """Joints whose torque follows the gravity torque with the opposite sign."""
        return np.flatnonzero(self.correlation < -LOADED)

    @property
    def friction_sign(self) -> int:
        """1 where friction dissipates, −1 where it drives, 0 where that is not significant."""
        whole = float(np.sum(np.clip(self.power_over_sigma, -3 * SURE, 3 * SURE)))
        return int(np.sign(whole)) if abs(whole) > SURE * np.sqrt(len(self.power)) else 0


def torque_evidence(torque_rows: TorqueRows) -> TorqueEvidence:
    """Regress τ of every joint on gravity torque, inertial torque and friction."""
    inertial, falls = torque_rows.model_torque()
    speeds, tau = torque_rows.samples.dq, torque_rows.samples.tau
    columns = [
        _joint(falls[:, j], inertial[:, j], speeds[:, j], tau[:, j]) for j in range(tau.shape[1])
    ]
    return TorqueEvidence(*(np.array(column) for column in zip(*columns, strict=True)))


def _joint(falls: Array, inertial: Array, dq: Array, tau: Array) -> tuple[float, ...]:
    """a, RMS of g, partial correlation, P and P/σ of one joint."""
    friction = np.column_stack([np.tanh(dq / EPSILON), dq])
    others = np.column_stack([inertial, friction, np.ones_like(dq)])
    slope, correlation = partial_slope(others, tau, falls)
    matrix = np.column_stack([falls, others]) if slope else others
    fit = posterior_of(matrix, tau)
    rest = tau - matrix @ fit.mean
    # Mean power of friction as a linear function of the coefficients.
    weights = np.zeros(matrix.shape[1])
    weights[-3:-1] = np.mean(friction * dq[:, None], axis=0)
    inflation = coloured_noise_of_rows(matrix[:, None, :], rest[:, None]).inflation
    variance = inflation * float(np.mean(rest**2))
    spread = float(np.sum((weights @ fit.root) ** 2))
    power = float(weights @ fit.mean)
    load = float(np.sqrt(np.mean(falls**2)))
    return slope, load, correlation, power, power / np.sqrt(max(variance * spread, 1e-300))


@dataclass(frozen=True, slots=True)
class SignTrial:
    """One sign of τ with one of gravity, with the relative residuals of two fits."""

    sign: float  # of τ, 1 or −1
    gravity: float  # s, 1, 0 or −1
    consistent: float  # residual of consistent bodies over the torque
    free: float  # residual of least squares over the torque


def gravity(torque_rows: TorqueRows, plan: Recipe) -> Checked:
    """Sign of τ and of gravity by friction, else by the residual of consistent bodies; its axis."""
    evidence_of_joints = torque_evidence(torque_rows)
    if evidence_of_joints.gravity_is_against and evidence_of_joints.friction_sign:
        return _by_friction(torque_rows.lib, plan, evidence_of_joints)
    trials = _trials(torque_rows)
    present, best = trials[0], min(trials, key=lambda t: t.consistent)
    evidence = {
        f"tau {t.sign:+.0f}, gravity {t.gravity:+.0f}": [t.consistent, t.free] for t in trials
    }
    if best is not present and best.consistent < MUCH * present.consistent:
        return _reversed(torque_rows.lib, plan, present, best, trials, evidence)
    if present.consistent > TURNED:
        return plan, other_direction(torque_rows, evidence)
    return plan, []


def _by_friction(lib: Library, plan: Recipe, evidence: TorqueEvidence) -> Checked:
    """The finding where τ is opposite to the gravity torque, by the sign of friction."""
    loaded = [int(j) for j in evidence.opposite]
    slopes = ", ".join(f"{evidence.gravity[j]:.2g}" for j in loaded)
    powers = [float(x) for x in evidence.power_over_sigma]
    facts = {"slopes": [float(x) for x in evidence.gravity], "friction_power_over_sigma": powers}
    opposite = (
        "τ is opposite to the gravity torque of the model at "
        f"{joint_list(lib.joint_names, loaded)} (slope {slopes})"
    )
    if evidence.friction_sign > 0:
        sure = f"{opposite}, while friction has its usual sign, so that gravity is reversed"
        return plan, [_gravity_reversed(lib, sure, facts)]
    if plan.torque is None:
        return plan, []
    sentence = (
        f"{opposite}, and friction drives the joints instead of braking them: {_CAUSE_OF_SIGN}"
    )
    return negated(plan), [Finding("torque_sign", ERROR, sentence, facts)]


_CAUSE_OF_SIGN = (
    "the log holds the torque that acts on the robot, not the torque that it applies; set "
    "sign = -1 under [torque]"
)


def negated(plan: Recipe) -> Recipe:
    """The recipe with the opposite sign of τ."""
    return plan if plan.torque is None else plan.replace(torque=plan.torque.signed(-1.0))


def _gravity_reversed(lib: Library, comparison: str, facts: dict) -> Finding:
    what = (
        "gravity acts in the opposite direction of the model; build the robot so: "
        f"{build_command(lib, 'turned', -lib.gravity)}"
    )
    return Finding("gravity", ERROR, f"{comparison}: {what}", facts)


def _reversed(
    lib: Library,
    plan: Recipe,
    present: SignTrial,
    best: SignTrial,
    trials: list[SignTrial],
    evidence: dict,
) -> Checked:
    """The finding of a better case: reversed torque, compensated gravity, or an arm mounted so."""
    rivals = [t for t in trials if t is not best and t.consistent < ALIKE * best.consistent]
    doubt = f" (the motion is too slow to exclude {_name(rivals[0])})" if rivals else ""
    comparison = (
        f"with {_name(best)}, physically consistent bodies leave "
        f"{significant(100 * best.consistent)} % of the torque unexplained, in the present case "
        f"{significant(100 * present.consistent)} % (least squares with negative masses "
        f"{significant(100 * present.free)} %){doubt}"
    )
    if best.sign < 0 and best.gravity > 0 and plan.torque is not None:
        sentence = f"{comparison}: {_CAUSE_OF_SIGN}"
        return negated(plan), [Finding("torque_sign", ERROR, sentence, evidence)]
    if best.gravity < 0.0:
        return plan, [_gravity_reversed(lib, comparison, evidence)]
    what = (
        "the signal lacks the gravity compensation of the controller; log the whole torque, or "
        f"build the robot without gravity: {build_command(lib, 'weightless', 0.0 * lib.gravity)}"
    )
    return plan, [Finding("gravity", ERROR, f"{comparison}: {what}", evidence)]


def _name(trial: SignTrial) -> str:
    sign = "τ as logged" if trial.sign > 0 else "τ negated"
    return f"{sign} and gravity {_NAMES[trial.gravity]}"


def _thinned(torque_rows: TorqueRows) -> tuple[Samples, Array, Array, Array]:
    """Some samples with Y, Y_g and the friction columns, (N, n, …) each."""
    lib, s = torque_rows.lib, torque_rows.samples
    step = max(1, len(s) // FEW)
    few = s.rows(slice(None, None, step))
    still = np.zeros_like(few.q)
    friction = torque_rows.friction_rows().reshape(len(s), lib.n_joints, -1)[::step]
    full = lib.regressor(few.q, few.dq, few.ddq)
    return few, full, lib.regressor(few.q, still, still), friction


def _trials(torque_rows: TorqueRows) -> list[SignTrial]:
    """Fit consistent bodies, and unconstrained parameters, to ±τ with gravity s g."""
    lib, (few, full, falls, friction) = torque_rows.lib, _thinned(torque_rows)
    weights = 1.0 / np.sqrt(np.mean(few.tau**2, axis=0) + 0.01 * np.mean(few.tau**2))
    target = (few.tau * weights).ravel()
    size = max(float(np.linalg.norm(target)), 1e-300)
    # Friction columns are projected out, so that only the bodies are constrained.
    basis = np.linalg.qr((friction * weights[:, None]).reshape(target.size, -1))[0]
    target = target - basis @ (basis.T @ target)
    prior, trials = prior_of(lib), {}
    for scale in GRAVITIES:
        rows = ((full + (scale - 1.0) * falls) * weights[:, None]).reshape(target.size, -1)
        rows = rows - basis @ (basis.T @ rows)
        _, rest = least_squares(rows, target)
        free = float(np.linalg.norm(rest)) / size
        for sign in SIGNS:
            # Consistent fit: most probable bodies under a prior of next to no weight.
            freedom = max(len(target) - rows.shape[1], 1)
            data = reduced_of(rows, sign * target, len(few), freedom)
            gamma = NONE * max(data.variance, 1e-6) / data.count
            pi = solve(lib, convex_problem(data, prior, gamma)).pi
            loss = np.sqrt(max(2.0 * data.value(pi) * data.count, 0.0))
            trials[sign, scale] = SignTrial(sign, scale, float(loss) / size, free)
    return [trials[sign, scale] for sign in SIGNS for scale in GRAVITIES]


TILTED, SLIGHTLY = 0.6, 0.4
"""Residual with fitted gravity over that with the model's direction, below which another direction
is reported: where much of the torque is unexplained, and where little is."""
UNEXPLAINED, LITTLE = 0.1, 0.02  # residual over torque; a tilt by the angle a leaves about a / 2
AXIS = np.cos(np.radians(12.0))  # to an axis along which the arm is mounted: errors are degrees
G = 9.81  # m/s², for a model without gravity
_SMALLEST = np.radians(1.0)  # resolution of the direction


def other_direction(torque_rows: TorqueRows, evidence: dict) -> list[Finding]:
    """Base on a wall or tilted: gravity off the model's direction fits much better."""
    lib, (few, full, falls, friction) = torque_rows.lib, _thinned(torque_rows)
    try:
        turns = list(potential_rows(lib, few.q).reshape(3, few.tau.size, -1))
    except RuntimeFault:
        return []
    common = np.concatenate([full - falls, friction], axis=2).reshape(few.tau.size, -1)
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
    vector = size * best * fit.sign(best, present, (falls @ lib.pi0).ravel())
    return [_finding(lib, vector, size, (along, left), evidence)]


def build_command(lib: Library, suffix: str, gravity: Array) -> str:
    """Command that builds the same arm with another gravity."""
    name = f"{lib.name}_{suffix}"
    urdf = lib.folder / f"{lib.name}.urdf"
    return (
        f"python -m symgen build --urdf {shlex.quote(str(urdf))} --name {name} --gravity "
        f"{_numbers(gravity)} (with the other options of its build, such as --tip, --settings "
        "project=true, --config)"
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
    sentence = (
        f"gravity of the model ({_numbers(lib.gravity)} m/s² in the base frame) leaves "
        f"{significant(100 * along)} % of the torque unexplained even with negative masses, the "
        f"fitted gravity ({_numbers(fitted)} m/s²{f', nearly along {name}' if exact else ''}) "
        f"{significant(100 * left)} %: {cause}"
    )
    facts = evidence | {"gravity": [float(x) for x in vector], "along": along, "left": left}
    return Finding("gravity", ERROR if exact else WARNING, sentence, facts)


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
