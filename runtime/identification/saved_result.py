"""What an identification left on disk, for those who compute with it again.

π is written in the frames of the links: it holds for a library whose joints sit where those of the
identified one did. Another mount, other inertials or a newer generator change nothing of that and
are told; other fixed links counted into the moving ones mean that π is of other bodies.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.errors import RecordingError
from runtime.estimators.friction_net import FrictionNet
from runtime.files import json_of
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.recording import Friction, Preparation

LARGEST = 1e9
"""SI units; what no arm has, NaN included, is no result."""
ALIKE = 1e-6
"""m, m/s² or entries of rotations: below it two models are the same but for rounding."""
_PLACE = ("rotation", "translation", "axis")


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """What a result knows of the model that it was identified with.

    Attributes:
        digest: `model_hash` of its library.
        gravity: (3,) in the base frame, m/s².
        kinds: kind and parent of every joint.
        places: rotation, translation and axis of every joint, (n, 15).
        lumped: names of the fixed links that count into moving ones.
    """

    digest: str
    gravity: Array
    kinds: tuple[str, ...]
    places: Array
    lumped: frozenset[str]


@dataclass(frozen=True, slots=True)
class Saved:
    """π (10 n,) and friction of a result.json; φ is (n, k), k columns; what was done to the log.

    Older ones know no model.
    """

    robot: str
    method: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    pi: Array
    friction: Friction
    phi: Array
    net: FrictionNet | None
    history: tuple[str, ...]
    preparation: Preparation
    model: Model | None


def model_facts(lib: Library) -> dict[str, Any]:
    """What `Model` reads, JSON-ready."""
    joints = [
        {
            "kind": joint.kind,
            "parent": joint.parent,
            **{key: np.array(getattr(joint, key)).tolist() for key in _PLACE},
        }
        for joint in lib.manifest.joints
    ]
    return {
        "model_hash": lib.manifest.model_hash,
        "gravity": lib.gravity.tolist(),
        "joints": joints,
        "lumped": [body["name"] for body in lib.manifest.lumped],
    }


def read_result(folder: Path) -> Saved:
    """The result that `identify` wrote into a folder, or its file.

    Raises:
        RecordingError: there is none, or not a valid one.
    """
    try:
        file = folder / "result.json" if folder.is_dir() else folder
        facts = dict(json_of(file))
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
            history=tuple(map(str, facts["recording"]["history"])),
            preparation=Preparation(**facts["recording"].get("preparation", {})),
            model=_model(facts["model"], n) if "model" in facts else None,
        )
        whole = len(saved.units) == n and saved.pi.shape == (N_PARAMETERS * n,)
        if not whole or saved.phi.shape != (n, len(saved.friction.columns)):
            raise ValueError
        if not (np.abs(np.concatenate([saved.pi, saved.phi.ravel()])) < LARGEST).all():
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise RecordingError(
            f"'{folder}' holds no valid result.json; give the folder that identify wrote"
        ) from None
    return saved


def _model(facts: dict[str, Any], n: int) -> Model:
    joints = facts["joints"]
    rows = [np.hstack([np.ravel(joint[key]) for key in _PLACE]) for joint in joints]
    places = np.array(rows, dtype=float).reshape(n, 15)
    gravity = np.array(facts["gravity"], dtype=float).reshape(3)
    kinds = tuple(f"{joint['kind']} {joint['parent']}" for joint in joints)
    lumped = frozenset(str(name) for name in facts["lumped"])
    return Model(str(facts["model_hash"]), gravity, kinds, places, lumped)


def require_model(
    saved: Saved, lib: Library, folder: Path, same_bodies: bool = False
) -> tuple[str, ...]:
    """Sentences about how the model of a library differs from the one that was identified.

    Args:
        saved: of `folder`.
        lib: to compute with.
        folder: where the result lies, for the sentences.
        same_bodies: the fixed links that count into moving ones must be the same, too.

    Raises:
        RecordingError: other joints, joints that sit elsewhere, or other bodies.
    """
    if saved.joints != lib.joint_names:
        raise RecordingError(
            f"'{folder}' identified {saved.robot}, whose joints differ from those of "
            f"'{lib.name}'; name its robot with --robot"
        )
    theirs, own = saved.model, _model(model_facts(lib), lib.n_joints)
    if theirs is None or theirs.digest == own.digest:
        return ()
    moved = ~(np.abs(theirs.places - own.places).max(axis=1) <= ALIKE)  # NaN has moved, too
    moved |= np.array([a != b for a, b in zip(theirs.kinds, own.kinds, strict=True)])
    if moved.any():
        raise RecordingError(
            f"'{folder}' was identified with a model whose joint "
            f"'{lib.joint_names[int(np.argmax(moved))]}' sits or turns differently than that of "
            f"'{lib.name}', so its parameters are of other frames; name the library that it was "
            "identified with by --robot, or identify again"
        )
    if theirs.lumped != own.lumped:
        other = ", ".join(sorted(theirs.lumped ^ own.lumped))
        said = (
            f"'{folder}' was identified with other fixed links counted into moving ones than "
            f"'{lib.name}' has ({other})"
        )
        if same_bodies:
            raise RecordingError(f"{said}; name the library that it was identified with by --robot")
        return (f"{said}: its masses are of other bodies",)
    if not np.abs(theirs.gravity - own.gravity).max() <= ALIKE:
        before, now = (",".join(f"{x:g}" for x in g) for g in (theirs.gravity, own.gravity))
        return (
            f"'{folder}' was identified with gravity {before}, and '{lib.name}' has {now}: right "
            "if the arm was mounted anew in between",
        )
    return (
        f"'{folder}' was identified with another build of this arm (model {theirs.digest[:12]}, "
        f"here {own.digest[:12]}): the joints are the same, inertials, limits or the generator "
        "are not",
    )
