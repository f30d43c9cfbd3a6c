"""What an identification left on disk, for those who compute with it again."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.documents import json_of
from runtime.errors import RecordingError
from runtime.library import Array, Library
from runtime.library.manifest import PI_NAMES
from runtime.network import FrictionNet
from runtime.payload.reading import LARGEST
from runtime.recording import Friction


@dataclass(frozen=True, slots=True)
class Saved:
    """π (10 n,) and friction of a result.json; φ is (n, k), k columns."""

    robot: str
    method: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    pi: Array
    friction: Friction
    phi: Array
    net: FrictionNet | None


def read_result(folder: Path) -> Saved:
    """The result that `identify` wrote into a folder.

    Raises:
        RecordingError: there is none, or not a valid one.
    """
    try:
        facts = dict(json_of(folder / "result.json"))
        n = len(facts["joints"])
        terms = facts["friction"] or {"columns": [], "values": [[]] * n}
        net = terms.get("net")
        saved = Saved(
            robot=str(facts["robot"]),
            method=str(facts["method"]),
            joints=tuple(facts["joints"]),
            units=tuple(facts["units"]),
            pi=np.array(facts["pi"], dtype=float),
            friction=Friction.from_facts(terms),
            phi=np.array(terms["values"], dtype=float),
            net=net and FrictionNet(np.array(net["theta"]), np.array(net["scale"])),
        )
        whole = len(saved.units) == n and saved.pi.shape == (len(PI_NAMES) * n,)
        if not whole or saved.phi.shape != (n, len(saved.friction.columns)):
            raise ValueError
        if not (np.abs(np.concatenate([saved.pi, saved.phi.ravel()])) < LARGEST).all():
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise RecordingError(
            f"'{folder}' holds no valid result.json; give the folder that identify wrote"
        ) from None
    return saved


def require_robot(saved: Saved, lib: Library, folder: Path) -> None:
    """Raise RecordingError where a result is of a robot with other joints."""
    if saved.joints != lib.joint_names:
        raise RecordingError(
            f"'{folder}' identified {saved.robot}, whose joints differ from those of "
            f"'{lib.name}'; name its robot with --robot"
        )
