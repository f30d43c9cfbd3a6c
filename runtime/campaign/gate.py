"""The gate before a stage: its certificate, the logs recorded so far, and a rehearsal.

A stage is released where the motion keeps every limit at its speed, the last log has no error that
`inspect` finds, its torques follow the URDF and friction, and it agrees with the model that was
identified without it. `torque_faults` compares the torque columns with the URDF, joint by joint:

    τ_j = r_j τ_URDF,j + φ₁ ζ_j + φ₂ dq_j + o_j + e_j

Dry friction opposes motion whatever the links weigh, so that φ₁ < 0 is a wrong sign. Torques of
another joint leave a large share of e. r_j far from 1 is a gain, a load, or a URDF that is wrong by
more than `RATIO`; it counts where τ_URDF,j outweighs the friction, or the part of it that friction
does not imitate outweighs e by far.

In the rehearsal a virtual robot runs the motion with one planted fault. The steps of the campaign
must name it, or recover the arm in spite of it: its rigid-body torque along the motion is within
`RECOVERED` of the truth.
"""

import tempfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from runtime.campaign import gear_friction
from runtime.common.tables import significant
from runtime.errors import RuntimeFault
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import sample_times
from runtime.excitation.proof.certificate import certificate_of
from runtime.inspection import ERROR, inspect_log
from runtime.library import Array, Library
from runtime.recording import Recording, read_recording, write_recording
from runtime.simulation import Box, record, settings_of

AGREEMENT = 3.0  # largest RMS residual of a new log over that of the band that the model states
EMPTY_CELL = Safety()  # limits of the robot alone
RATIO = 0.2
"""Largest deviation of r from 1; links that differ by 5 % from the URDF leave 0.04, a body of 1 kg
on the last link of an FR3 changes it by 0.4."""
UNEXPLAINED = 0.5
"""Largest RMS of e over the standard deviation of τ; sound logs stay below 0.25, exchanged columns
leave 0.74 and more on one of the two joints."""
DISTINCT = 10.0
"""Standard deviation of the part of τ_URDF,j that friction and an offset do not imitate, over that
of e, from which on r is known to 0.1. Sound joints with three times the usual friction reach 6 and
more, and their r is off by up to 0.06."""
SMALL = 0.1  # torques of wrists below this share of the largest one are left to the first rule
CLEAR = 2.0  # size of a torque over the one that it is compared with from which on it counts


@dataclass(frozen=True, slots=True)
class Release:
    """Decision on a stage."""

    reasons: tuple[str, ...]  # sentences on why the stage is refused; empty where it is released
    checked: tuple[str, ...]  # what was checked
    # RMS of the residual over that of the band, per joint; None without a model
    agreement: tuple[float, ...] | None = None

    @property
    def is_released(self) -> bool:
        """Whether the stage may run."""
        return not self.reasons

    def to_facts(self) -> dict[str, object]:
        """JSON-ready content."""
        return {"released": self.is_released} | asdict(self)


def released(
    lib: Library,
    motion: Trajectory,
    log: Path | None,
    agreement: tuple[float, ...] | None = None,
    safety: Safety = EMPTY_CELL,
) -> Release:
    """Decide whether a stage may run."""
    reasons: list[str] = []
    checked = ["limits at every instant"]
    reasons += [
        f"the motion uses {100 * use.bound:.4g} % of the limit of {use.kind}"
        for use in certificate_of(lib, motion, safety).broken
    ]
    if log is not None:
        checked.append("faults of the last log")
        errors = inspect_log(log, lib).of_level(ERROR)
        reasons += [f"{log.name}: {each.sentence}" for each in errors]
        checked.append("torque of every joint against the URDF")
        rows = gear_friction.smoothed(read_recording(log, joints=lib.joint_names), lib)
        reasons += [f"{log.name}: {each}" for each in torque_faults(lib, rows)]
    if agreement is not None:
        checked.append("agreement of the last log with the model before it")
        worst = int(np.argmax(agreement))
        if not agreement[worst] <= AGREEMENT:
            reasons.append(
                f"the residual of the last log on {lib.joint_names[worst]} is "
                f"{agreement[worst]:.2g} times the band of the model, where {AGREEMENT:g} is "
                "allowed; has the load, the friction or a sensor changed?"
            )
    return Release(tuple(reasons), tuple(checked), agreement)


def torque_faults(lib: Library, motion: Recording) -> tuple[str, ...]:
    """Sentences on joints whose torque contradicts the URDF and its own friction."""
    usual = gear_friction.GearFriction.usual(lib.n_joints)
    columns, _, rows = gear_friction.prepared_columns(motion, usual, gear_friction.PREPARATION)
    tau = rows.required("tau")
    model = lib.inverse_dynamics(rows.q, rows.required("dq"), rows.required("ddq"), lib.pi0)
    dahl, viscous = gear_friction.FRICTION.index("dahl"), gear_friction.FRICTION.index("viscous")
    sentences, largest = [], float(model.std(axis=0).max())
    for j, name in enumerate(lib.joint_names):
        zeta, speed = columns[:, j, dahl], columns[:, j, viscous]
        parts = np.column_stack([model[:, j], zeta, speed, np.ones(len(tau))])
        x, *_ = np.linalg.lstsq(parts, tau[:, j], rcond=None)
        rest = float(np.std(tau[:, j] - parts @ x))
        rigid, dry = x[0] * model[:, j], x[1] * zeta
        others = parts[:, 1:] @ np.linalg.lstsq(parts[:, 1:], model[:, j], rcond=None)[0]
        apart = float(np.std(x[0] * (model[:, j] - others)))
        friction = float(np.std(dry + x[2] * speed))
        if x[1] < 0 and np.std(dry) > CLEAR * rest:
            sentences.append(f"the torque of {name} has the wrong sign: friction drives the joint")
        elif rest > UNEXPLAINED * np.std(tau[:, j]):
            sentences.append(
                f"the torque of {name} follows neither the URDF nor its friction "
                f"({100 * rest / np.std(tau[:, j]):.0f} % of it is left); is it of another joint?"
            )
        elif abs(x[0] - 1) > RATIO and (
            np.std(rigid) > CLEAR * max(friction, rest)
            or (apart > DISTINCT * rest and np.std(model[:, j]) > SMALL * largest)
        ):
            sentences.append(
                f"the torque of {name} is {x[0]:.2f} times that of the URDF: a load that it does "
                "not contain, a gain of the sensor, or wrong inertias"
            )
    return tuple(sentences)


KINDS = ("sign", "order", "delay", "tool", "friction", "gain")
"""Torque of the other sign, exchanged or late, a body on the last link, friction, scaled torque."""
SIZES = {"delay": 0.01, "tool": 1.0, "friction": 3.0, "gain": 1.3}
"""Size of a fault: delay [s], mass [kg], factors."""
TOOL_COM = (0.0, 0.0, 0.08)  # centre of mass of the tool in the frame of the tip link [m]
RECOVERED = 0.1
"""Largest RMS error of the rigid-body torque of a joint along the motion, over the RMS of that
torque or a tenth of the largest of all joints: torques of wrists are small."""
SCALE = 0.7
"""Size of the motion in the rehearsal: a virtual robot with a tool or with friction that its
controller does not know leaves the path by some hundredths and must not reach an end of a joint."""
LATE = 3e-3  # delay from which on it is named [s]; it is estimated and compensated


@dataclass(frozen=True, slots=True)
class RehearsalVerdict:
    """Result of the rehearsal of one planted fault."""

    kind: str  # of `KINDS`, or "none"
    joint: int  # index of the joint
    sentences: tuple[str, ...]  # of the steps that named it
    error: float  # largest relative error of the rigid-body torque; NaN if nothing is identified

    @property
    def is_named(self) -> bool:
        """Whether a step named the fault."""
        return bool(self.sentences)

    @property
    def is_recovered(self) -> bool:
        """Whether the arm is identified in spite of the fault."""
        return bool(self.error <= RECOVERED)


def rehearse(lib: Library, motion: Trajectory, seed: int = 0) -> tuple[RehearsalVerdict, ...]:
    """Let the virtual robot run a motion with one fault of each kind."""
    rng = np.random.default_rng([seed, 3])
    kinds = KINDS if lib.n_joints > 1 else tuple(kind for kind in KINDS if kind != "order")
    return tuple(rehearsed(lib, motion, k, int(rng.integers(lib.n_joints)), seed) for k in kinds)


def rehearsed(
    lib: Library, motion: Trajectory, kind: str, joint: int, seed: int
) -> RehearsalVerdict:
    """Run a motion with one fault on a virtual robot, and check its log."""
    usual = settings_of(lib)
    if kind == "friction":
        factor, f = np.ones(lib.n_joints), usual.friction
        factor[joint] = SIZES["friction"]
        stiff = replace(f, coulomb=factor * f.coulomb, viscous=factor * f.viscous)
        usual = replace(usual, friction=stiff)
    tool = Box(SIZES["tool"], TOOL_COM) if kind == "tool" else None
    small = replace(motion, coefficients=SCALE * motion.coefficients)
    log = record(lib, small, usual, seed=seed, truth_seed=seed, payload=tool)
    planted = _planted(log.recording, kind, joint)
    sentences, error = [], np.nan
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "rehearsal.npz"
            write_recording(planted, path)
            sentences += [each.sentence for each in inspect_log(path, lib).of_level(ERROR)]
        seen = gear_friction.smoothed(planted, lib)
        sentences += torque_faults(lib, seen)
        model = gear_friction.arm_model(lib, [("rehearsal", seen)])
        late = float(np.median(model.gear.delay))
        sentences += [f"torques are stamped {1e3 * late:.1f} ms late"] if late > LATE else []
        states = small.at(lib, sample_times(small.duration, 50.0))[:3]
        bodies = log.truth.pi, model.result.pi
        error = _relative(*(lib.inverse_dynamics(*states, pi) for pi in bodies))
    except RuntimeFault as fault:  # a log that a step refuses is named by its message
        sentences.append(str(fault))
    return RehearsalVerdict(kind, joint, tuple(sentences), float(error))


def unnoticed(verdicts: tuple[RehearsalVerdict, ...], lib: Library) -> tuple[str, ...]:
    """Planted faults that were neither named nor recovered."""
    return tuple(
        f"a fault of kind '{each.kind}' on {lib.joint_names[each.joint]} was neither named nor "
        f"recovered ({_error(each)})"
        for each in verdicts
        if not (each.is_named or each.is_recovered)
    )


def _error(verdict: RehearsalVerdict) -> str:
    if np.isnan(verdict.error):
        return "no model was identified"
    return f"torque error {significant(100 * verdict.error)} %"


def _planted(log: Recording, kind: str, joint: int) -> Recording:
    """The log with a fault of its torque columns."""
    tau = np.array(log.required("tau"))
    if kind == "sign":
        tau[:, joint] *= -1
    elif kind == "order":
        other = joint + 1 if joint + 1 < tau.shape[1] else joint - 1
        tau[:, [joint, other]] = tau[:, [other, joint]]
    elif kind == "delay":
        tau = np.stack([np.interp(log.t - SIZES["delay"], log.t, row) for row in tau.T], axis=1)
    elif kind == "gain":
        tau[:, joint] *= SIZES["gain"]
    return log.replace(tau=tau)


def _relative(true: Array, model: Array) -> float:
    """Largest RMS error of a joint over its RMS torque, at least a tenth of the largest."""
    size = np.sqrt(np.mean(true**2, axis=0))
    error = np.sqrt(np.mean((model - true) ** 2, axis=0))
    return float(np.max(error / np.maximum(size, 0.1 * size.max())))
