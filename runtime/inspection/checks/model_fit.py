"""Checks of the torque against a fit of the robot's model, once units, signs and order are right.

The residual of least squares on base parameters and friction, W x = T, is compared with causes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from runtime.common.tables import significant
from runtime.estimators.contradictions import OTHER, remedy_of, sentence_of
from runtime.estimators.regression.causes import GAIN, TILT, ZERO, Cause, Causes, causes_of_rows
from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.estimators.regression.posterior import least_squares, posterior_of
from runtime.inspection.checks.signals import LITTLE
from runtime.inspection.checks.torque_rows import EPSILON, USUAL, TorqueRows, slopes_to_model
from runtime.inspection.finding import INFO, WARNING, Finding, joint_list
from runtime.library import Array, Library
from runtime.library.parameters import MASS, N_PARAMETERS, centre_of_mass, mass
from runtime.recording import Friction
from runtime.recording.rest_speeds import rest_speeds

SURE = 4.0  # standard deviations from which on a value is significant
TOOL_KG, TOOL_GAIN = 0.4, 0.6
"""Smallest tool that is reported [kg], and residual with it over the residual without it. The last
links of a CAD model err by 0.3 kg (LWR 4+), a Franka hand weighs 0.73 kg."""
STRANGE = 0.3  # residual over torque above which the model does not fit the log at all
COUPLED, INDEPENDENT = 0.35, 30.0
"""Share of a joint's squared residual that the speed of the other joint must explain, in both
directions, and the effective sample size that this check needs."""
ALONE = 0.5  # largest share of any joint beside the two, over that of the pair
MISSED = 0.2
"""Share of the whole torque that the bodies of the URDF must miss beside it: drives take nearly all
torque of a Z1 and a Go2, whose bodies miss 0.07 of it."""
OFF = 1.4  # factor between gains that is reported; the bodies of a URDF err by less
ALIKE = 3  # fewest joints of slopes equal to `OFF` beside which a single one is a wrong gain
LIMBS = 1.25
"""Factor of each of the coefficients of a joint over the median of its likes in other limbs, from
which on it is one of the torque: at the twelve joints of a Go2 they are 0.8 to 1.3 in a log without
a fault, and of one joint never all above 1.06, nor all below 0.92."""
PERFECT = 5e-4  # residual over torque below which the torque cannot come from a sensor
SILENT, GOOD = 1e-5, 5e-3
"""Noise of the raw torque over its RMS, and residual over torque: below both, the torque cannot
come from a sensor."""
FRICTIONLESS, FITTED = 1.3, 0.03
"""Residual without friction columns over that with them, median over the joints, and residual over
torque: below both, the joints have no friction. Arms with torque sensors behind the gears reach
2.4 to 4, motor torques 4 to 20."""
SLOW = 0.05  # RMS speed over that of the fastest joint below which a joint shows no friction
_DIFFERENCES = 4


@dataclass(frozen=True, slots=True, eq=False)
class UnconstrainedFit:
    """Least squares of base parameters and friction."""

    matrix: Array  # W of the equations over [β; φ], (N n, n_b + n k)
    rest: Array  # T − W x, (N n,)


def fitted(torque_rows: TorqueRows) -> UnconstrainedFit:
    """The fit to rows of the torque."""
    s, lib = torque_rows.samples, torque_rows.lib
    base = lib.base_regressor(s.q, s.dq, s.ddq).reshape(len(s) * lib.n_joints, -1)
    matrix = np.hstack([base, torque_rows.friction_rows()])
    return UnconstrainedFit(matrix, least_squares(matrix, s.tau.ravel())[1])


def unexplained(
    torque_rows: TorqueRows, fit: UnconstrainedFit, *, has_gains: bool = True
) -> list[Finding]:
    """A torque that no parameters of this robot explain."""
    tau = torque_rows.samples.tau
    if has_gains:
        misfit = float(np.linalg.norm(fit.rest) / np.linalg.norm(tau))
    else:
        misfit = _median_misfit(torque_rows, fit.matrix)
    if misfit < STRANGE:
        return []
    sentence = (
        f"least squares without constraints leaves {100 * misfit:.0f} % of the torque "
        "unexplained: another robot, other units or another order than assumed here, contact, "
        "or another signal than the joint torque; do not use a model identified from this log"
    )
    return [Finding("unexplained", WARNING, sentence, {"misfit": misfit})]


def _median_misfit(torque_rows: TorqueRows, matrix: Array) -> float:
    """Residual over torque, median of joints fitted one by one: unknown gains share nothing."""
    s = torque_rows.samples
    of_joints = matrix.reshape(*s.tau.shape, -1)
    shares = []
    slowest = rest_speeds(torque_rows.lib)
    for j in range(s.tau.shape[1]):
        moves = np.abs(s.dq[:, j]) >= slowest[j]
        columns = of_joints[moves, j]
        columns = columns[:, np.any(columns != 0.0, axis=0)]
        if len(columns) <= 2 * columns.shape[1]:
            continue
        _, rest = least_squares(columns, s.tau[moves, j])
        size = max(float(np.linalg.norm(s.tau[moves, j])), 1e-300)
        shares.append(float(np.linalg.norm(rest)) / size)
    return float(np.median(shares)) if shares else 0.0


def tool(torque_rows: TorqueRows) -> list[Finding]:
    """A body at the last link that the URDF lacks, or has too much, of either sign of mass."""
    s, lib = torque_rows.samples, torque_rows.lib
    n = lib.n_joints
    last = lib.regressor(s.q, s.dq, s.ddq)[:, :, -N_PARAMETERS:].reshape(len(s) * n, N_PARAMETERS)
    target = (s.tau - lib.inverse_dynamics(s.q, s.dq, s.ddq, lib.pi0)).ravel()
    extra = torque_rows.friction_rows()
    # Three passes: the weights of the joints follow their residuals.
    weights = np.ones(n)
    rest = before = target
    x = np.zeros(N_PARAMETERS)
    for _ in range(3):
        scale = np.tile(np.sqrt(weights), len(s))
        _, before = least_squares(extra * scale[:, None], target * scale)
        matrix = np.hstack([last, extra]) * scale[:, None]
        fit = posterior_of(matrix, target * scale)
        x, rest = fit.mean, target * scale - matrix @ fit.mean
        errors = (rest / scale).reshape(-1, n)
        weights = 1.0 / np.maximum(errors.var(axis=0), 1e-9 * errors.var(axis=0).max() + 1e-300)
    body = x[:N_PARAMETERS]
    mass_kg = float(mass(body))
    gain = float(np.linalg.norm(rest) / max(float(np.linalg.norm(before)), 1e-300))
    # σ of the mass with noise of N_eff samples.
    inflation = inflation_of(np.hstack([last, extra]), errors, weights)
    noise = np.sqrt(inflation * np.mean(rest**2))
    sigma = float(noise * np.nan_to_num(fit.sigma[MASS], nan=np.inf))
    if abs(mass_kg) < max(TOOL_KG, SURE * sigma) or gain > TOOL_GAIN:
        return []
    if mass_kg < -1.5 * float(mass(lib.pi0[-N_PARAMETERS:])):
        return []  # no tool weighs less than nothing: gravity, signs or gains are wrong
    com = centre_of_mass(body)
    link, centre = lib.link_names[-1], ", ".join(f"{c:.3f}" for c in com)
    what = (
        "the model lacks a body that is mounted there, or its links are too light: build the robot "
        "with the tool, or identify it with the command payload"
        if mass_kg > 0
        else "the model contains a body that is not mounted, such as a hand: build the robot with "
        "--tip set to the link before it"
    )
    sentence = (
        f"{mass_kg:+.2f} ± {2 * sigma:.2f} kg at {link} (centre {centre} m) "
        f"explain the residual of the model ({100 * gain:.0f} % remains); {what}"
    )
    evidence = {
        "mass_kg": mass_kg,
        "sigma_kg": sigma,
        "com_m": [float(c) for c in com],
        "left": gain,
    }
    return [Finding("tool", WARNING, sentence, evidence)]


def one_run(duration_s: float) -> Finding:
    """Note that a test on a part of the same run of this duration [s] is optimistic."""
    sentence = (
        f"this is one run of {duration_s:.3g} s: a test on a part of it "
        "underestimates the error of the model; record another motion for the test"
    )
    return Finding("one_run", INFO, sentence, {"duration_s": duration_s})


def inflation_of(matrix: Array, errors: Array, weights: Array) -> float:
    """Variance inflation N / N_eff of the errors of a fit."""
    scale = np.sqrt(weights)
    rows = matrix.reshape(*errors.shape, -1) * scale[:, None]
    return coloured_noise_of_rows(rows, errors * scale).inflation


def coupling(torque_rows: TorqueRows, fit: UnconstrainedFit, terms: Friction) -> list[Finding]:
    """Residual torques of two neighbours that follow the speed of each other.

    A motor that turns with two joints, R being its row of the gear matrix, loads both with its
    friction. Motions with common harmonics let the residual of one joint resemble the speed of
    another by chance, but not both ways.
    """
    s, lib = torque_rows.samples, torque_rows.lib
    if any(name.startswith("motor_") for name in terms.columns):
        return []
    errors = fit.rest.reshape(-1, lib.n_joints)
    inflation = inflation_of(fit.matrix, errors, 1.0 / np.maximum(errors.var(axis=0), 1e-300))
    if len(errors) / inflation < INDEPENDENT:
        return []
    share = partial(_share, s.dq, s.ddq, errors)
    pairs = []
    for j in range(lib.n_joints - 1):
        k = j + 1
        least = min(share(j, k), share(k, j))
        others = [m for m in range(lib.n_joints) if m not in (j, k)]
        if least > COUPLED and all(share(i, m) < ALONE * least for i in (j, k) for m in others):
            pairs.append((j, k, least))
    if not pairs:
        return []
    j, k, most = max(pairs, key=lambda pair: pair[2])
    names = lib.joint_names
    sentence = (
        f"the residuals of {names[j]} and {names[k]} follow the speed of each other "
        f"({100 * most:.0f} % of their squares or more), as where a gear couples their "
        "motors; if it does, give the full matrix under [gear] and add motor_viscous, "
        "motor_coulomb, motor_rotor to the columns of [friction]"
    )
    evidence = {"pairs": [[a, b, c] for a, b, c in pairs]}
    return [Finding("gear_coupling", WARNING, sentence, evidence)]


def _share(dq: Array, ddq: Array, errors: Array, j: int, k: int) -> float:
    """Share of the squared residual of joint j that the drive of joint k explains."""
    drive, shares = _drive(dq[:, j], ddq[:, j]), [0.0]
    _, left = least_squares(drive, errors[:, j])
    power = float(left @ left)
    for speed in (dq[:, k], dq[:, k] + dq[:, j], dq[:, k] - dq[:, j]) if power else ():
        _, free = least_squares(drive, _drive(speed, ddq[:, k]))
        _, after = least_squares(free, left)
        shares.append(1.0 - float(after @ after) / power)
    return max(shares)


def _drive(dq: Array, ddq: Array) -> Array:
    """Columns of a drive: viscous and Coulomb friction, inertia, (N, 3)."""
    return np.column_stack([dq, np.tanh(dq / 0.05), ddq])


def causes_left(torque_rows: TorqueRows, fit: UnconstrainedFit) -> Causes:
    """Causes of what the fit leaves, in weights of its residuals."""
    lib = torque_rows.lib
    power = fit.rest.reshape(-1, lib.n_joints).var(axis=0)
    weights = 1.0 / np.maximum(power, 1e-12 * power.max() + 1e-300)
    return causes_of_rows(lib, torque_rows.samples, weights, lib.pi0)


def explained(torque_rows: TorqueRows, causes: Causes) -> list[Finding]:
    """Gain of a joint, tilt or encoder zero that explains what the fit leaves.

    The comparison of causes needs no URDF; a gain must be that of the slope on it, too.
    """
    lib = torque_rows.lib
    # A gain of 2.5 looks like a delay, too: the slope on the torque of the URDF decides.
    gains = [c for c in causes.ranked if c.kind == GAIN and c.is_significant and not c.is_usable]
    of_gain = [each for best in gains[:1] for each in _gain(torque_rows, best)]
    best = next(iter(causes.named), None)
    kinds = {GAIN: "gain_error", TILT: "base_tilt", ZERO: "encoder_zero"}
    if of_gain or best is None or best.kind not in kinds or best in gains:
        return of_gain
    facts = {"joint": best.joint, "size": best.size, "statistic": best.statistic}
    sentence = f"{sentence_of(lib, causes.named)}; {remedy_of(lib, best)}"
    return [Finding(kinds[best.kind], INFO if best.is_usable else WARNING, sentence, facts)]


def _gain(torque_rows: TorqueRows, best: Cause) -> list[Finding]:
    """Gain of a joint where the slope on the torque of the URDF differs by as much."""
    lib = torque_rows.lib
    slopes, is_used = slopes_to_model(torque_rows)
    others = is_used & (np.arange(lib.n_joints) != best.joint)
    if not is_used[best.joint] or not others.any():
        return []
    gain, size = float(slopes[best.joint] / np.median(slopes[others])), best.size
    if gain <= 0 or (not (gain > OFF and size > 0) and not (gain < 1 / OFF and size < 0)):
        return []
    return [_wrong_gain(lib, best.joint, gain, "no bodies explain them together, and ", best)]


def _wrong_gain(lib: Library, joint: int, gain: float, why: str, cause: Cause) -> Finding:
    name = lib.joint_names[joint]
    sentence = (
        f"the torque of {name} is about {gain:.2g} times too large beside that of the other "
        f"joints: {why}the slope on the torque of the URDF "
        f"differs by as much; check its torque constant and gear ratio, and set gain of {name} "
        f"to {1 / gain:.2g} times the present one under [torque]"
    )
    evidence = {"joint": joint, "gain": gain, "statistic": cause.statistic}
    return Finding("torque_gain", WARNING, sentence, evidence)


def gain_by_slope(torque_rows: TorqueRows, causes: Causes) -> list[Finding]:
    """Gain of a joint that the residual leaves open, such as a leg's, by the slope on the URDF.

    All other slopes agree, and the links of a URDF err by less than the factor of this one.
    """
    apart = _apart(*slopes_to_model(torque_rows))
    if apart is None or USUAL[0] <= apart[1] <= USUAL[1]:
        return []
    joint, gain = apart
    cause = next((c for c in causes.ranked if c.kind == GAIN and c.joint == joint), None)
    # The residual would show a gain of this size, and shows none: the links of the URDF are wrong.
    if cause is None or cause.limit < 1 - min(gain, 1 / gain):
        return []
    return [_wrong_gain(torque_rows.lib, joint, gain, "", cause)]


def beside_limbs(torque_rows: TorqueRows) -> list[Array]:
    """Logarithms of the coefficients of every joint over those of its likes in other limbs, (k,).

        τ_j = g_j (s τ̂_j + a ddq_j + v dq_j + c tanh(dq_j / ε) + b)

    Limbs of one type have one rotor inertia a, viscous friction v and, where the URDF explains the
    torque, slope s; a gain multiplies all of them. What the other limbs, three or more, do not have
    in common does not count.
    """
    lib, s = torque_rows.lib, torque_rows.samples
    alike = _alike(lib)
    if max(map(len, alike)) < ALIKE:
        return [np.zeros(0)] * lib.n_joints
    _, is_used = slopes_to_model(torque_rows)
    model = np.sum(torque_rows.model_torque(), axis=0)
    signs = np.tanh(s.dq / EPSILON)
    columns = np.stack([model, s.ddq, s.dq, signs, np.ones_like(signs)], axis=2)
    each = np.array([least_squares(columns[:, j], s.tau[:, j])[0] for j in range(lib.n_joints)])
    each = np.maximum(each[:, :3], 0.0)
    each[~is_used, 0] = 0.0
    logs = []
    for x, joints in zip(each, alike, strict=True):
        others = each[joints] if len(joints) >= ALIKE else np.zeros((1, 3))
        agree = (x > 0) & (others.max(axis=0) < OFF * others.min(axis=0))
        logs.append(np.log(x[agree] / np.median(others[:, agree], axis=0)))
    return logs


def _alike(lib: Library) -> list[list[int]]:
    """Joints of other limbs with the depth, effort and mass of the link of each one."""
    joints, masses = lib.manifest.all_joints, lib.pi0[MASS::N_PARAMETERS]
    if len(joints) != lib.n_joints:
        return [[] for _ in range(lib.n_joints)]
    kinds: list[tuple[int, float | None, str]] = []
    for joint, kg in zip(joints, masses, strict=True):
        depth = kinds[joint.parent][0] + 1 if joint.parent >= 0 else 0
        kinds.append((depth, joint.effort, f"{kg:.6g}"))
    return [
        [k for k, other in enumerate(kinds) if other == kind and k != j]
        for j, kind in enumerate(kinds)
    ]


def gain_of_limbs(lib: Library, limbs: list[Array]) -> list[Finding]:
    """Gain of the one joint whose coefficients all differ from those of other limbs alike."""
    least = [max(x.min(), (-x).min()) if len(x) > 1 else 0.0 for x in limbs]
    apart = [j for j, size in enumerate(least) if size > np.log(LIMBS)]
    # Of a gain only its likes disagree; where joints of other kinds do, torques may be exchanged.
    unlike = {j for j, x in enumerate(limbs) if len(x) < 2}
    if len(apart) != 1 or not unlike <= set(_alike(lib)[apart[0]]):
        return []
    joint, name = apart[0], lib.joint_names[apart[0]]
    gain = float(np.exp(limbs[joint].mean()))
    sentence = (
        f"the torque of {name} is about {gain:.2g} times too large beside that of the same joint "
        "of the other limbs: rotor inertia, friction and the part of the links differ by as much; "
        f"check its torque constant and gear ratio, and set gain of {name} to {1 / gain:.2g} times "
        "the present one under [torque]"
    )
    return [Finding("torque_gain", WARNING, sentence, {"joint": joint, "gain": gain})]


def _apart(slopes: Array, is_used: NDArray[np.bool_]) -> tuple[int, float] | None:
    """Joint whose slope differs most from the others, and its factor; None where these differ."""
    used = np.flatnonzero(is_used & (slopes > 0))
    if len(used) <= ALIKE:
        return None
    logs = np.log(slopes[used])
    place = int(np.argmax(np.abs(logs - np.median(logs))))
    others = np.delete(logs, place)
    middle = float(np.median(others))
    if float(np.abs(others - middle).max()) > np.log(OFF):
        return None
    return int(used[place]), float(np.exp(logs[place] - middle))


def hidden_gains(
    torque_rows: TorqueRows, causes: Causes, limbs: Sequence[Array] = ()
) -> list[Finding]:
    """Note on joints of much torque whose gain neither URDF, residual nor other limbs confirm."""
    slopes, is_used = slopes_to_model(torque_rows)
    limits = causes.limits(GAIN)
    if limits.size and _apart(slopes, is_used) is None:  # the residual alone may show a gain
        is_used = is_used & (limits <= USUAL[1] - 1)
    is_used = is_used | np.array([len(each) > 1 for each in limbs] or [False])
    rms = np.sqrt(np.mean(torque_rows.whole.required("tau") ** 2, axis=0))
    hidden = [int(j) for j in np.flatnonzero(~is_used & (rms >= LITTLE * rms.max()))]
    if not hidden:
        return []
    names = joint_list(torque_rows.lib.joint_names, hidden)
    sentence = (
        f"a wrong torque gain of {names} would not be reported: the links of the URDF explain too "
        "little of the torque there; symgen gains determines it with a known load"
    )
    return [Finding("hidden_gains", INFO, sentence, {"joints": hidden})]


def other_robot(torque_rows: TorqueRows, fit: UnconstrainedFit) -> list[Finding]:
    """Bodies of the URDF that are far from those of the log; friction is free in all fits.

        mismatch = (‖r_URDF‖² − ‖r_free‖²)^½ / (‖r_0‖² − ‖r_free‖²)^½

    with the residuals r of friction alone (r_0), with the URDF and with free bodies, which explain
    the torque of any arm with the same axes.
    """
    s, lib = torque_rows.samples, torque_rows.lib
    tau, friction = s.tau.ravel(), torque_rows.friction_rows()
    urdf = lib.inverse_dynamics(s.q, s.dq, s.ddq, lib.pi0).ravel()
    rests = (fit.rest, *(least_squares(friction, t)[1] for t in (tau - urdf, tau)))
    free, by_urdf, none = (float(np.sum(rest**2)) for rest in rests)
    mismatch = float(np.sqrt(max(by_urdf - free, 0.0) / max(none - free, 1e-300)))
    if mismatch < OTHER or by_urdf - free < MISSED**2 * float(tau @ tau):
        return []
    sentence = (
        f"the bodies of the URDF miss {100 * mismatch:.0f} % of the rigid torque of this log, "
        "which other bodies on the same axes explain: the log is of another robot or variant, "
        "the arm carries something, or the masses of the URDF are placeholders; build the "
        "robot of the log"
    )
    return [Finding("other_robot", WARNING, sentence, {"mismatch": mismatch})]


def not_measured(torque_rows: TorqueRows, fit: UnconstrainedFit, raw_tau: Array) -> list[Finding]:
    """A torque that is the output of a model: it fits better than a measurement can.

    Three signs: a fit without constraints that is exact, noise below that of any sensor, and joints
    without friction. Every real joint has friction; torque sensors behind the gears measure a part.

    raw_tau (N, n) [N·m, N].
    """
    tau = torque_rows.samples.tau
    size = np.sqrt(np.mean(tau**2, axis=0))
    misfit = float(np.linalg.norm(fit.rest) / np.linalg.norm(tau))
    noise = noise_floor(raw_tau) / np.maximum(size, 1e-300)
    floor = float(np.median(noise))
    speed = np.sqrt(np.mean(torque_rows.samples.dq**2, axis=0))
    moves = speed >= SLOW * speed.max()  # a joint at rest shows no friction, and any model fits it
    friction = _share_of_friction(torque_rows, fit, moves)
    left = np.linalg.norm(fit.rest.reshape(tau.shape)[:, moves])
    frictionless = friction < FRICTIONLESS and left < FITTED * np.linalg.norm(tau[:, moves])
    if misfit > PERFECT and not (floor < SILENT and misfit < GOOD) and not frictionless:
        return []
    why = (
        f"the model fits it to {significant(100 * misfit)} %, and friction columns reduce the "
        f"residual by a factor of {friction:.2g} only, whereas real joints have friction"
        if frictionless
        else f"the model fits it to {significant(100 * misfit)} %, and its noise is "
        f"{significant(100 * floor)} % of its RMS"
    )
    sentence = (
        f"the torque is not a measurement: {why}; it is the output of a model (commanded, "
        "feed-forward or simulated torque), from which only that model can be identified; log "
        "the measured torque or current"
    )
    evidence = {
        "misfit": misfit,
        "noise_over_rms": [float(x) for x in noise],
        "without_friction_over_with": friction,
    }
    return [Finding("not_measured", WARNING, sentence, evidence)]


def noise_floor(values: Array) -> Array:
    """σ of white noise per column from fourth differences: ‖Δ⁴x‖ / √(70 N)."""
    differences = np.diff(values, n=_DIFFERENCES, axis=0)
    return np.asarray(np.sqrt(np.mean(differences**2, axis=0) / 70.0))


def _share_of_friction(torque_rows: TorqueRows, fit: UnconstrainedFit, moves: Array) -> float:
    """Residual without viscous and Coulomb columns over that with them, median of some joints."""
    n = torque_rows.lib.n_joints
    n_base = len(torque_rows.lib.base_columns)
    offsets = np.tile(np.eye(n), (len(torque_rows.samples), 1))
    tau = torque_rows.samples.tau.ravel()
    _, without = least_squares(np.hstack([fit.matrix[:, :n_base], offsets]), tau)
    powers = [np.sum(each.reshape(-1, n) ** 2, axis=0) for each in (without, fit.rest)]
    ratios = np.sqrt(powers[0] / np.maximum(powers[1], 1e-300))
    return float(np.median(ratios[moves]))
