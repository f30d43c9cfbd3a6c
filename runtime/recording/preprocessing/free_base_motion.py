"""Low-pass and derivatives of a recording with a free base.

    [ω×] = Rᵀ Ṙ,   v = Rᵀ ṗ,   [ω̇×] = skew part of Ṙᵀ Ṙ + Rᵀ R̈,   v̇ = Rᵀ p̈ − ω × v

R, p and q pass the same zero-phase low-pass as torques and wrenches, and R is turned back into a
rotation. What the log states of velocities and accelerations is filtered and taken as it is.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording.free_base import Contacts, FreeBaseRecording
from runtime.recording.preprocessing.derivatives import differentiate
from runtime.recording.preprocessing.filters import low_pass
from runtime.recording.preprocessing.segments import resample
from runtime.recording.recording import FloatArray, Recording
from runtime.startup.data_classes import dataclass

_JITTER = 0.01
"""Deviation of a time step from the median from which the log is resampled, as elsewhere."""
_GAP_S = 0.1
"""Longest gap that is filled."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeBaseMotion:
    """Prepared rows: coordinates of the kernels, base first, and what acts on the robot.

    Attributes:
        t: (N,) s.
        q, dq, ddq: (N, 6 + n), see `runtime.library.free_base`.
        tau: (N, n) [N·m, N]; None where torques were not measured.
        contacts: contacts at these instants.
        rotation: (N, 3, 3) R of the base in the world.
    """

    t: FloatArray
    q: FloatArray
    dq: FloatArray
    ddq: FloatArray
    tau: FloatArray | None
    contacts: Contacts
    rotation: FloatArray

    def __len__(self) -> int:
        return len(self.t)

    def rows(self, taken: slice | NDArray[np.int64]) -> "FreeBaseMotion":
        """Some of the instants."""
        return FreeBaseMotion(
            self.t[taken],
            self.q[taken],
            self.dq[taken],
            self.ddq[taken],
            None if self.tau is None else self.tau[taken],
            replace(
                self.contacts,
                wrench=self.contacts.wrench[taken],
                sensed=None if self.contacts.sensed is None else self.contacts.sensed[taken],
            ),
            self.rotation[taken],
        )


def motion_of(
    recording: FreeBaseRecording, joints: tuple[str, ...], cutoff_hz: float | None = None
) -> FreeBaseMotion:
    """Filter and differentiate a recording.

    Args:
        recording: as read.
        joints: names of the n joints of the robot; joints of the file beyond them are left out.
        cutoff_hz: of the low-pass [Hz]; None filters nothing.

    Returns:
        Motion at the instants of the recording, or of a uniform clock of the same rate.

    Raises:
        RecordingError: a joint is missing, or the low-pass does not fit the clock.
    """
    from scipy.spatial.transform import Rotation

    places = _places(recording, joints)
    count = len(recording.t)
    wrench = recording.contacts.wrench.reshape(count, -1)
    filled = np.where(np.isnan(wrench), 0.0, wrench)
    blocks: dict[str, FloatArray] = {
        "position": recording.position,
        "rotation": recording.rotation.reshape(count, 9),
        "q": recording.q[:, places],
        "wrench": filled,
    }
    if recording.contacts.sensed is not None:
        blocks["sensed"] = recording.contacts.sensed
    for key in ("dq", "ddq", "tau"):
        values = getattr(recording, key)
        if values is not None:
            blocks[key] = values[:, places]
    for key in ("twist", "acceleration"):
        values = getattr(recording, key)
        if values is not None:
            blocks[key] = values
    whole = Recording(recording.t, np.hstack(list(blocks.values())), name=recording.name)
    steps = np.diff(recording.t)
    unknown = np.isnan(wrench)
    if np.abs(steps / np.median(steps) - 1).max() > _JITTER:
        whole = resample(whole, (count - 1) / whole.duration, _GAP_S)
        nearest = np.abs(recording.t[None, :] - whole.t[:, None]).argmin(axis=1)
        unknown = unknown[nearest]
    if cutoff_hz is not None:
        whole = low_pass(whole, cutoff_hz)
    whole = differentiate(whole, from_position=True)
    if len(whole) != len(unknown):
        raise RecordingError(
            f"{recording.name} has gaps with stretches too short for the low-pass; give a log in "
            "one piece"
        )

    def of(signals: FloatArray, key: str) -> FloatArray:
        first = 0
        for name, block in blocks.items():
            if name == key:
                return signals[:, first : first + block.shape[1]]
            first += block.shape[1]
        raise KeyError(key)

    x, dx, ddx = whole.q, whole.required("dq"), whole.required("ddq")
    turned = Rotation.from_matrix(of(x, "rotation").reshape(-1, 3, 3))
    twist, acceleration = _base_rates(
        turned.as_matrix(),
        *(of(each, "rotation").reshape(-1, 3, 3) for each in (dx, ddx)),
        *(of(each, "position") for each in (dx, ddx)),
    )
    if "twist" in blocks:
        twist, acceleration = of(x, "twist"), of(dx, "twist")
    if "acceleration" in blocks:
        acceleration = of(x, "acceleration")
    dq = of(x, "dq") if "dq" in blocks else of(dx, "q")
    second = of(dx, "dq") if "dq" in blocks else of(ddx, "q")
    ddq = of(x, "ddq") if "ddq" in blocks else second
    known = np.where(unknown, np.nan, of(x, "wrench"))
    contacts = recording.contacts
    return FreeBaseMotion(
        whole.t,
        np.hstack([of(x, "position"), turned.as_rotvec(), of(x, "q")]),
        np.hstack([twist, dq]),
        np.hstack([acceleration, ddq]),
        of(x, "tau") if "tau" in blocks else None,
        replace(
            contacts,
            wrench=known.reshape(len(whole), len(contacts.links), 6),
            sensed=of(x, "sensed") if "sensed" in blocks else None,
        ),
        turned.as_matrix(),
    )


def _base_rates(
    rotation: FloatArray,
    d_rotation: FloatArray,
    dd_rotation: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Twist and its derivative in axes of the base from derivatives in those of the world."""
    back = np.swapaxes(rotation, 1, 2)
    omega = _vee(back @ d_rotation)
    alpha = _vee(np.swapaxes(d_rotation, 1, 2) @ d_rotation + back @ dd_rotation)
    v = np.einsum("nij,nj->ni", back, velocity)
    dv = np.einsum("nij,nj->ni", back, acceleration) - np.cross(omega, v)
    return np.hstack([v, omega]), np.hstack([dv, alpha])


def _vee(matrix: FloatArray) -> FloatArray:
    """Vector of the skew-symmetric part."""
    skew = (matrix - np.swapaxes(matrix, 1, 2)) / 2
    return np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)


def _places(recording: FreeBaseRecording, joints: tuple[str, ...]) -> list[int]:
    names = recording.joint_names
    if not names:
        if recording.q.shape[1] != len(joints):
            raise RecordingError(
                f"{recording.name} has {recording.q.shape[1]} joints, the robot has {len(joints)}; "
                "name the columns by an array `joints`"
            )
        return list(range(len(joints)))
    missing = [joint for joint in joints if joint not in names]
    if missing:
        raise RecordingError(
            f"{recording.name} has no joint '{missing[0]}' of the robot; lock it by "
            "symgen build --lock, or add its column"
        )
    return [names.index(joint) for joint in joints]
