"""Identity of models: whether the parameters of a result hold for the model of a library.

π is written in the frames of the links, so that it holds for any library whose joints have the same
placements. Another gravity, other inertials or a newer generator leave π valid and are noted. Other
fixed links counted into the moving ones mean that π belongs to other bodies.
"""

from collections.abc import Iterable
from pathlib import Path

import msgspec
import numpy as np

from runtime.common.records import Vector3
from runtime.errors import RecordingError
from runtime.identification.result_record import JointPlace, ModelPart, ResultRecord
from runtime.library import Library

FRAMES, BODIES, PRIOR = "frames", "bodies", "prior"
"""Kinds of differences: π of one model means nothing, other bodies, or the same in the other."""
ALIKE = 1e-6
"""Bound in m, m/s² or entries of rotations below which two models differ only by rounding."""


def model_part(lib: Library) -> ModelPart:
    """The part `model` of result.json."""
    facts = lib.manifest
    return ModelPart(
        model_hash=facts.model_hash,
        gravity=msgspec.convert(lib.gravity.tolist(), Vector3),
        joints=msgspec.convert(facts.all_joints, tuple[JointPlace, ...], from_attributes=True),
        lumped=tuple(body["name"] for body in facts.lumped),
    )


def require_model(
    record: ResultRecord, lib: Library, folder: Path | str, same_bodies: bool = False
) -> tuple[str, ...]:
    """Check that a result holds for the model of a library."""
    if record.joints != lib.joint_names:
        raise RecordingError(
            f"'{folder}' identified {record.robot}, whose joints differ from those of "
            f"'{lib.name}'; name its robot with --robot"
        )
    if record.model is None:
        return ()
    joints = [f"'{name}'" for name in lib.all_joint_names]
    notes = differences(record.model, model_part(lib), (str(folder), lib.name), joints)
    refused = {FRAMES, BODIES} if same_bodies else {FRAMES}
    if fault := next((sentence for kind, sentence in notes if kind in refused), None):
        raise RecordingError(
            f"{fault}; name the library that it was identified with by --robot, or identify again"
        )
    return tuple(sentence for _, sentence in notes)


def differences(
    one: ModelPart, two: ModelPart, names: tuple[str, str], joints: Iterable[str]
) -> list[tuple[str, str]]:
    """Kind of every difference of two models, and a sentence; other frames hide what follows."""
    if one.model_hash == two.model_hash:
        return []
    first, second = f"'{names[0]}' was identified with", f"'{names[1]}'"
    count, other = len(one.joints), len(two.joints)
    if count != other:
        return [(FRAMES, f"{first} a model of {count} joints, {second} has {other}")]
    places = zip(joints, one.joints, two.joints, strict=True)
    if moved := next((name for name, a, b in places if not same_place(a, b)), None):
        sentence = (
            f"{first} a model whose joint {moved} sits or turns differently than that of {second}, "
            "so that its parameters belong to other frames"
        )
        return [(FRAMES, sentence)]
    notes = []
    if others := ", ".join(sorted(set(one.lumped) ^ set(two.lumped))):
        sentence = (
            f"{first} other fixed links counted into moving ones than {second} has ({others}): "
            "its masses belong to other bodies"
        )
        notes.append((BODIES, sentence))
    if not np.abs(np.subtract(one.gravity, two.gravity)).max() <= ALIKE:
        old, new = (",".join(f"{x:g}" for x in each.gravity) for each in (one, two))
        sentence = f"{first} gravity {old}, and {second} has {new}: right if the arm was mounted"
        notes.append((PRIOR, f"{sentence} again in between"))
    build = (
        f"{first} another build of this arm (model {one.model_hash[:12]}, {second} has "
        f"{two.model_hash[:12]}): the joints are the same, inertials, limits or the generator are "
        "not"
    )
    return notes or [(PRIOR, build)]


def same_place(a: JointPlace, b: JointPlace) -> bool:
    """Whether two joints are of one kind and differ by rounding only."""
    pairs = ((a.rotation, b.rotation), (a.translation, b.translation), (a.axis, b.axis))
    near = all(np.allclose(x, y, rtol=0, atol=ALIKE) for x, y in pairs)  # NaN counts as moved
    return near and (a.kind, a.parent) == (b.kind, b.parent)
