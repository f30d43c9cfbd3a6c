"""Rehearsal of a motion: the virtual robot with planted faults runs it before the real arm does.

| fault | planted |
|---|---|
| sign | the torque of one joint with the other sign |
| order | the torques of two joints exchanged |
| delay | the torque stamped late |
| tool | a body on the last link that the URDF lacks |
| friction | one joint with a multiple of its friction |
| gain | the torque of one joint scaled |

The steps of the campaign (`inspect`, `torque_faults`, identification) must name a fault, or recover
the arm in spite of it: its rigid-body torque along the motion is within `RECOVERED` of the truth.
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from runtime.campaign.estimation import arm_model
from runtime.campaign.gate import torque_faults
from runtime.campaign.gear_friction import smoothed
from runtime.common.tables import significant
from runtime.errors import RuntimeFault
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import sample_times
from runtime.inspection import ERROR, inspect_log
from runtime.library import Array, Library
from runtime.recording import Recording, write_recording
from runtime.simulation import Box, record, settings_of
from runtime.simulation.settings import VirtualFriction, VirtualRobotSettings

KINDS = ("sign", "order", "delay", "tool", "friction", "gain")
SIZES = {"delay": 0.01, "tool": 1.0, "friction": 3.0, "gain": 1.3}
"""Size of a fault: delay [s], mass [kg], factors."""
TOOL_COM = (0.0, 0.0, 0.08)
"""Centre of mass of the tool in the frame of the tip link [m]."""
RECOVERED = 0.1
"""Largest RMS error of the rigid-body torque of a joint along the motion, over the RMS of that
torque or a tenth of the largest of all joints: torques of wrists are small."""
SCALE = 0.7
"""Size of the motion in the rehearsal: a virtual robot with a tool or with friction that its
controller does not know leaves the path by some hundredths and must not reach an end of a joint."""
LATE = 3e-3
"""Delay from which on it is named [s]; it is estimated and compensated."""


@dataclass(frozen=True, slots=True)
class RehearsalVerdict:
    """Result of the rehearsal of one planted fault."""

    kind: str  # of `KINDS`, or "none"
    joint: int  # index of the joint
    sentences: tuple[str, ...]  # of the steps that named it
    # largest relative error of the rigid-body torque; NaN where nothing was identified
    error: float

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
    return tuple(
        rehearsed(lib, motion, kind, int(rng.integers(lib.n_joints)), seed) for kind in kinds
    )


def rehearsed(
    lib: Library,
    motion: Trajectory,
    kind: str,
    joint: int,
    seed: int,
    settings: VirtualRobotSettings | None = None,
) -> RehearsalVerdict:
    """Run a motion with one fault on a virtual robot, and check its log."""
    usual = settings or settings_of(lib)
    if kind == "friction":
        usual = replace(usual, friction=_stiff(usual, joint))
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
        seen = smoothed(planted, lib)
        sentences += torque_faults(lib, seen)
        model = arm_model(lib, [("rehearsal", seen)])
        late = float(np.median(model.gear.delay))
        sentences += [f"torques are stamped {1e3 * late:.1f} ms late"] if late > LATE else []
        states = small.at(lib, sample_times(small.duration, 50.0))[:3]
        error = _relative(
            *(lib.inverse_dynamics(*states, p) for p in (log.truth.pi, model.result.pi))
        )
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


def _stiff(settings: VirtualRobotSettings, joint: int) -> VirtualFriction:
    """Friction with one joint multiplied."""
    factor = np.ones(len(settings.rotor))
    factor[joint] = SIZES["friction"]
    f = settings.friction
    return replace(f, coulomb=factor * f.coulomb, viscous=factor * f.viscous)


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
