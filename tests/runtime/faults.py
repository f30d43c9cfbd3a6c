"""Faults put into a clean log of a virtual arm, each with the findings that name it.

A fault changes the arrays of the file as a wrong cable, driver, logger or recipe would. `kinds` are
the findings of which one must be reported; `states` looks for what it must contain beside its kind.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pinocchio

from runtime.inspection import Finding
from runtime.library import Array
from tests.oracle import pinocchio_model
from tests.runtime.virtual_arms import Arm, Log

JOINT, OTHER = 1, 3
"""Joints that are changed: the second and the fourth, both loaded."""
BURST_ROWS, BURST = 40, 0.3
"""Rows and size [rad] of a burst."""
STAND_STILL_S = 6.0
SHORT_DELAY_S, LONG_DELAY_S = 0.030, 0.35
GAIN = 2.5
"""Factor of one joint whose gain is wrong."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault.

    Attributes:
        name: a few words.
        kinds: findings that name it.
        put: the log with the fault.
        states: whether a finding of these kinds states the right joint, place or value.
    """

    name: str
    kinds: tuple[str, ...]
    put: Callable[[Arm], Log]
    states: Callable[[Arm, Finding], bool] = lambda arm, finding: True


def _changed(arm: Arm, **arrays: Array) -> Log:
    """The clean log with some arrays exchanged."""
    return replace(arm.log, arrays=arm.log.arrays | arrays)


def _torque(arm: Arm, tau: Array) -> Log:
    """The clean log with another torque [N·m], in the unit of the file."""
    return _changed(arm, **{arm.torque: tau / arm.gains})


def _tau(arm: Arm) -> Array:
    """Logged torque in N·m, (N, n)."""
    return arm.log.arrays[arm.torque] * arm.gains


def _flipped(arm: Arm, *joints: int) -> Array:
    """−1 at these joints, 1 elsewhere, (n,)."""
    sign = np.ones(arm.lib.n_joints)
    sign[list(joints)] = -1.0
    return sign


def _swapped(arm: Arm, values: Array) -> Array:
    """The columns of two joints exchanged."""
    order = np.arange(arm.lib.n_joints)
    order[[JOINT, OTHER]] = OTHER, JOINT
    return values[:, order]


def _names_joint(arm: Arm, finding: Finding) -> bool:
    return arm.lib.joint_names[JOINT] in finding.sentence or "every joint" in finding.sentence


def _names_pair(arm: Arm, finding: Finding) -> bool:
    order = list(range(arm.lib.n_joints))
    order[JOINT], order[OTHER] = OTHER, JOINT
    return finding.evidence.get("order") == order


def _delayed(arm: Arm, delay: float) -> Log:
    """Torque stamped `delay` [s] too late."""
    t, tau = arm.log.arrays["t"], arm.log.arrays[arm.torque]
    late = np.stack([np.interp(t - delay, t, column) for column in tau.T], axis=1)
    first = int(np.searchsorted(t, t[0] + delay))
    rows = {key: values[first:] for key, values in (arm.log.arrays | {arm.torque: late}).items()}
    return replace(arm.log, arrays=rows)


def _dropped(arm: Arm) -> Log:
    """5 % of the rows lost, the others stamped at a constant rate."""
    arrays = arm.log.arrays
    count = len(arrays["t"])
    kept = np.sort(np.random.default_rng(5).permutation(count)[round(0.05 * count) :])
    step = float(np.mean(np.diff(arrays["t"])))
    rows = {key: values[kept] for key, values in arrays.items()}
    return replace(arm.log, arrays=rows | {"t": np.arange(len(kept)) * step})


def _frozen(arm: Arm) -> Log:
    """Every signal keeps its value for six seconds while the arm moves on."""
    t = arm.log.arrays["t"]
    first, last = np.searchsorted(t, [11.0, 11.0 + STAND_STILL_S])
    arrays = {key: values.copy() for key, values in arm.log.arrays.items()}
    for key in arrays.keys() - {"t"}:
        arrays[key][first:last] = arrays[key][first]
    return replace(arm.log, arrays=arrays)


def _burst(arm: Arm) -> Log:
    """Forty neighbouring rows of one joint with ± 0.3 rad."""
    q = arm.log.arrays["q"].copy()
    rng, first = np.random.default_rng(6), len(q) // 3
    q[first : first + BURST_ROWS, JOINT] += BURST * rng.choice([-1.0, 1.0], BURST_ROWS)
    return _changed(arm, q=q)


def _spikes(arm: Arm) -> Log:
    """Torques of four times the limit in twelve rows."""
    tau, rng = _tau(arm), np.random.default_rng(7)
    effort = arm.lib.limits()["effort"]
    for row in rng.choice(len(tau), 12, replace=False):
        joint = rng.integers(arm.lib.n_joints)
        tau[row, joint] = 4.0 * effort[joint] * rng.choice([-1.0, 1.0])
    return _torque(arm, tau)


def _shifted(arm: Arm) -> Log:
    """Rows shifted by half: velocities where positions belong, and so on."""
    names = ("q", "dq", arm.torque)
    table = np.hstack([arm.log.arrays[name] for name in names])
    rows = np.random.default_rng(8).choice(len(table), 9, replace=False)
    table[rows] = np.roll(table[rows], table.shape[1] // 2, axis=1)
    return _changed(arm, **dict(zip(names, np.split(table, 3, axis=1), strict=True)))


def _model_output(arm: Arm) -> Log:
    """Feed-forward torque of the URDF along the reference, with three decimals."""
    q, dq, ddq, _ = arm.log.reference.at(arm.lib, arm.log.arrays["t"])
    return _torque(arm, np.round(arm.lib.inverse_dynamics(q, dq, ddq, arm.lib.pi0), 3))


def _rigid(arm: Arm, urdf: str, gravity: Array, q: Array, dq: Array, ddq: Array) -> Array:
    """Torque of a URDF by Pinocchio, joints in the order of the file."""
    model = pinocchio_model(urdf, gravity)
    data = model.createData()
    return np.array([pinocchio.rnea(model, data, *row) for row in zip(q, dq, ddq, strict=True)])


def _gravity(arm: Arm, gravity: Array) -> Log:
    """The torque of the same arm under another gravity."""
    q = arm.log.arrays["q"]
    still = np.zeros_like(q)
    urdf = arm.lib.urdf()
    change = _rigid(arm, urdf, gravity, q, still, still)
    return _torque(arm, _tau(arm) + change - _rigid(arm, urdf, arm.lib.gravity, q, still, still))


def _other_robot(arm: Arm) -> Log:
    """The log of another robot with as many joints, on the same motion."""
    motion, rows = arm.log.simulated.motion, arm.log.rows
    states = [part[rows] for part in (motion.q, motion.dq, motion.ddq)]
    ours = _rigid(arm, arm.lib.urdf(), arm.lib.gravity, *states)
    theirs = _rigid(arm, arm.other_urdf.read_text(encoding="utf-8"), arm.lib.gravity, *states)
    return _torque(arm, _tau(arm) - ours + theirs)


def _tool(arm: Arm) -> Log:
    """A tool of 1.5 kg that the model lacks."""
    motion, rows = arm.log.simulated.motion, arm.log.rows
    states = [part[rows] for part in (motion.q, motion.dq, motion.ddq)]
    body = np.array([1.5, 0.0, 0.03, 0.12, 0.03, 0.03, 0.004, 0.0, 0.0, 0.0])
    return _torque(arm, _tau(arm) + arm.lib.regressor(*states)[:, :, -10:] @ body)


def _in_currents(arm: Arm) -> Log:
    """The cobot's recipe without its gains, the other arm's torque in motor currents."""
    if arm.log.recipe is None or arm.log.recipe.torque is None:
        return _torque(arm, _tau(arm) / np.linspace(18.0, 6.0, arm.lib.n_joints))
    unscaled = replace(arm.log.recipe.torque, gain=1.0)
    return replace(arm.log, recipe=arm.log.recipe.replace(torque=unscaled))


def _one_gain(arm: Arm) -> Log:
    factor = np.ones(arm.lib.n_joints)
    factor[JOINT] = GAIN
    return _torque(arm, _tau(arm) * factor)


def _builds_with(gravity: Array, finding: Finding) -> bool:
    """Whether the finding gives the option of the build that has this gravity."""
    return f"--gravity {','.join(f'{x:g}' for x in gravity + 0.0)} " in finding.sentence


def _delay_is(delay: float) -> Callable[[Arm, Finding], bool]:
    return lambda arm, f: abs(f.evidence.get("delay_s", 0.0) - delay) < 0.2 * delay


FAULTS = (
    Fault(
        "torque of one joint negated",
        ("torque_sign",),
        lambda arm: _torque(arm, _tau(arm) * _flipped(arm, JOINT)),
        _names_joint,
    ),
    Fault("every torque negated", ("torque_sign",), lambda arm: _torque(arm, -_tau(arm))),
    Fault(
        "position and velocity of one joint negated",
        ("position_sign",),
        lambda arm: _changed(
            arm,
            q=arm.log.arrays["q"] * _flipped(arm, JOINT),
            dq=arm.log.arrays["dq"] * _flipped(arm, JOINT),
        ),
        _names_joint,
    ),
    Fault(
        "velocity of one joint negated",
        ("velocity_sign",),
        lambda arm: _changed(arm, dq=arm.log.arrays["dq"] * _flipped(arm, JOINT)),
        _names_joint,
    ),
    Fault(
        "torques of two joints swapped",
        ("torque_order",),
        lambda arm: _changed(arm, **{arm.torque: _swapped(arm, arm.log.arrays[arm.torque])}),
        _names_pair,
    ),
    Fault(
        "positions and velocities of two joints swapped",
        ("position_order",),
        lambda arm: _changed(
            arm, q=_swapped(arm, arm.log.arrays["q"]), dq=_swapped(arm, arm.log.arrays["dq"])
        ),
        _names_pair,
    ),
    Fault(
        "velocities of two joints swapped",
        ("velocity_order",),
        lambda arm: _changed(arm, dq=_swapped(arm, arm.log.arrays["dq"])),
        _names_pair,
    ),
    Fault(
        "torque 30 ms late",
        ("time_shift",),
        lambda arm: _delayed(arm, SHORT_DELAY_S),
        _delay_is(SHORT_DELAY_S),
    ),
    Fault(
        "torque 350 ms late",
        ("time_shift",),
        lambda arm: _delayed(arm, LONG_DELAY_S),
        _delay_is(LONG_DELAY_S),
    ),
    Fault("5 % of the rows dropped, the rest stamped anew", ("restamped",), _dropped),
    Fault("log frozen for six seconds", ("frozen",), _frozen),
    Fault("40 rows of one position ± 0.3 rad", ("outliers",), _burst, _names_joint),
    Fault("12 torques of four times the limit", ("outliers",), _spikes),
    Fault("9 rows shifted by half a row", ("outliers",), _shifted),
    Fault("torque is the output of a model", ("not_measured",), _model_output),
    Fault(
        "gravity reversed",
        ("gravity",),
        lambda arm: _gravity(arm, -arm.lib.gravity),
        lambda arm, f: _builds_with(-arm.lib.gravity, f),
    ),
    Fault(
        "mounted in another direction",
        ("gravity",),
        lambda arm: _gravity(arm, np.roll(arm.lib.gravity, 1)),
        lambda arm, f: _builds_with(np.roll(arm.lib.gravity, 1), f),
    ),
    Fault("log of another robot", ("other_robot",), _other_robot),
    Fault("gain of one joint 2.5 times too large", ("torque_gain",), _one_gain, _names_joint),
    Fault("currents without gains", ("torque_unit",), _in_currents),
    Fault(
        "positions and velocities in degrees",
        ("position_unit",),
        lambda arm: _changed(
            arm, q=np.degrees(arm.log.arrays["q"]), dq=np.degrees(arm.log.arrays["dq"])
        ),
    ),
    Fault("clock in ms", ("time_unit",), lambda arm: _changed(arm, t=1e3 * arm.log.arrays["t"])),
    Fault(
        "velocities in degrees per second",
        ("velocity_unit",),
        lambda arm: _changed(arm, dq=np.degrees(arm.log.arrays["dq"])),
    ),
    Fault(
        "a tool that the model lacks",
        ("tool",),
        _tool,
        lambda arm, f: abs(f.evidence.get("mass_kg", 0.0) - 1.5) < 0.4,
    ),
)
"""The faults in the order of the table."""
