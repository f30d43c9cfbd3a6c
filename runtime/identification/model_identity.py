"""Identity of models: whether the parameters of a result hold for the model of a library.

π is written in the frames of the links, so that it holds for any library whose joints have the same
placements. Another gravity, other inertials or a newer generator leave π valid and are noted. Other
fixed links counted into the moving ones mean that π belongs to other bodies.
"""

from pathlib import Path

import msgspec
import numpy as np

from runtime.common.records import Vector3
from runtime.errors import RecordingError
from runtime.identification.result_record import JointPlace, ModelPart, ResultRecord
from runtime.library import Library

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
    then, now = record.model, model_part(lib)
    if then is None or then.model_hash == now.model_hash:
        return ()
    if len(then.joints) != len(now.joints):
        raise RecordingError(
            f"'{folder}' was identified with a model of {len(then.joints)} joints, '{lib.name}' "
            f"has {len(now.joints)}; name the library that it was identified with by --robot"
        )
    places = zip(lib.all_joint_names, then.joints, now.joints, strict=True)
    if moved := next((name for name, old, new in places if not same_place(old, new)), None):
        raise RecordingError(
            f"'{folder}' was identified with a model whose joint '{moved}' sits or turns "
            f"differently than that of '{lib.name}', so that its parameters belong to other "
            "frames; name the library that it was identified with by --robot, or identify again"
        )
    if others := set(then.lumped) ^ set(now.lumped):
        other = ", ".join(sorted(others))
        difference = (
            f"'{folder}' was identified with other fixed links counted into moving ones than "
            f"'{lib.name}' has ({other})"
        )
        if same_bodies:
            raise RecordingError(
                f"{difference}; name the library that it was identified with by --robot"
            )
        return (f"{difference}: its masses belong to other bodies",)
    if not np.abs(np.subtract(then.gravity, now.gravity)).max() <= ALIKE:
        old, new = (",".join(f"{x:g}" for x in g) for g in (then.gravity, now.gravity))
        return (
            f"'{folder}' was identified with gravity {old}, and '{lib.name}' has {new}: right "
            "if the arm was mounted again in between",
        )
    return (
        f"'{folder}' was identified with another build of this arm (model {then.model_hash[:12]}, "
        f"here {now.model_hash[:12]}): the joints are the same, inertials, limits or the generator "
        "are not",
    )


def same_place(a: JointPlace, b: JointPlace) -> bool:
    """Whether two joints are of one kind and differ by rounding only."""
    pairs = ((a.rotation, b.rotation), (a.translation, b.translation), (a.axis, b.axis))
    near = all(np.allclose(x, y, rtol=0, atol=ALIKE) for x, y in pairs)  # NaN counts as moved
    return near and (a.kind, a.parent) == (b.kind, b.parent)
