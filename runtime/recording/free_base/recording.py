"""Data of a recording with a free base: motion of joints and base, contacts."""

from dataclasses import dataclass

from runtime.recording.recording import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """Contacts of a robot with the world.

    Attributes:
        links: names of the C links.
        position: (C, 3) point that the wrench is about, in the frame of the link [m].
        wrench: (N, C, 6) force and moment on the robot [N, N·m]; NaN where it is unknown.
        axes: "link" or "world".
        offset_sigma: (C,) standard deviation of unknown offsets of the vertical forces [N]; None
            where the log does not state it.
        sharing_sigma: standard deviation of γ: a sensor that reads the share s of ΣF_z reads
            F (1 + γ (1 − s)); None where the log does not state it.
        crosstalk_sigma: (2,) standard deviations of c: a sensor reads c·m more, with m the moments
            about x and y of the link at `position` [1/m]; None where the log does not state them.
        cutoff_hz: cut-off of the first-order low-pass of the sensors of the vertical forces [Hz];
            None where the log states none.
        sensed: (N, C) 1 where the force is that of a sensor, 0 where a flag states that there is
            none; filtered like the forces.
    """

    links: tuple[str, ...]
    position: FloatArray
    wrench: FloatArray
    axes: str
    offset_sigma: FloatArray | None = None
    sharing_sigma: float | None = None
    crosstalk_sigma: FloatArray | None = None
    cutoff_hz: float | None = None
    sensed: FloatArray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FreeBaseRecording:
    """Motion of joints and base at N instants, with torques and contacts.

    Attributes:
        name: of the file.
        t: (N,) s.
        q: (N, n) rad or m, in the order of the file.
        joint_names: n names, empty where the file has none.
        rotation: (N, 3, 3) R of the base in the world.
        position: (N, 3) origin of the base in the world [m].
        contacts: of the robot with the world.
        dq, ddq, tau: (N, n), None where they were not measured.
        twist, acceleration: (N, 6) of the base, None where they were not measured.
        unread: names of arrays of the file that are not part of the layout.
    """

    name: str
    t: FloatArray
    q: FloatArray
    joint_names: tuple[str, ...]
    rotation: FloatArray
    position: FloatArray
    contacts: Contacts
    dq: FloatArray | None = None
    ddq: FloatArray | None = None
    tau: FloatArray | None = None
    twist: FloatArray | None = None
    acceleration: FloatArray | None = None
    unread: tuple[str, ...] = ()
