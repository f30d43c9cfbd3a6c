"""Logs of all joints of a robot with coupled joints or closed loops → its independent joints.

q_all = A q + b or g(q),   τ = Gᵀ τ_all:   positions of the independent joints, torques by virtual
power with G = A or ∂g/∂q

Names of a log's joints and those of the robot may differ in a prefix: fer_joint1, fr3_joint1. A
prefix is a name of the robot in front of the same words. It is replaced where every joint of the
robot has exactly one counterpart; the step is noted. Other differences are stated in a recipe.
"""

import re
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import Any

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Library
from runtime.recording.recording import SIGNALS, Recording
from runtime.recording.streamed import StreamedRecording


def renamed_joints(of_log: Collection[str], robot: Sequence[str]) -> tuple[str, ...]:
    """Names of the log in the order of the robot; () where there are none or several.

    fr3_joint1 … fr3_joint7 → fer_joint1 … fer_joint7: all names of the robot begin with fr3_, and
    of the log exactly one prefix stands before every joint1 … joint7.
    """
    if set(robot) <= set(of_log):
        return tuple(robot)
    ends = zip(min(robot), max(robot), strict=False)
    shared = "".join(a for a, _ in takewhile(lambda pair: pair[0] == pair[1], ends))
    # the word before the number belongs to the name: joint1 and motor1 differ
    common = re.sub(r"[^\W_]*$", "", shared)
    stems = [name.removeprefix(common) for name in robot]
    fronts = {name.removesuffix(stems[0]) for name in of_log if name.endswith(stems[0])}
    whole = [front for front in sorted(fronts) if not front[-1:].isalnum()]
    fitting = [front for front in whole if {front + stem for stem in stems} <= set(of_log)]
    return tuple(fitting[0] + stem for stem in stems) if len(fitting) == 1 else ()


APART, OF_RANGE = 0.02, 0.2
"""A log contradicts a coupling where the median distance exceeds APART [rad, m] and this share of
the joint's range: backlash and sensor offsets are smaller, a wrong factor or sign is larger."""


def independent_joints(recording: Recording, lib: Library) -> Recording:
    """The recording in the independent joints of the robot, in their order.

    Joints are matched by name where the log has names. Else a log of the independent joints, or of
    a robot without couplings, is returned as it is, and one with one column per link is in the
    order of `lib.all_joint_names`.
    """
    reduced = _reduced(_in_order(recording, lib), lib)
    if lib.manifest.loops and reduced.n_joints == lib.n_joints:
        lib.require_closed(reduced.q)
    return reduced


def _in_order(recording: Recording, lib: Library) -> Recording:
    """The joints of the robot by name, with the law of their torque."""
    names = recording.joint_names
    places = () if recording.columns is not None else _places(names, lib)
    if not places:
        return recording
    taken = ", ".join(names[k] for k in places)
    sentence = f"Took the joints {taken} of the log by their names."
    return _picked(recording, places, joint_names=lib.joint_names).noted(sentence)


def in_order_of(lib: Library, log: StreamedRecording) -> StreamedRecording:
    """The log of a file with the joints of the robot, by name."""
    places = _places(log.joint_names, lib)
    if not places:
        return log
    if len(places) < len(log.joint_names):
        raise IdentificationError(
            f"'{log.name}' is larger than memory and contains more joints than '{lib.name}'; write "
            "a log of the robot's joints, or read it as a whole with --settings stream=false"
        )
    plan = log.plan.reordered(places, lib.joint_names)
    return replace(log, plan=plan, joint_names=lib.joint_names)


def _places(names: tuple[str, ...], lib: Library) -> tuple[int, ...]:
    """Places of the joints of the robot among the names of a log; () where it is as it should."""
    robot = lib.joint_names
    wanted = renamed_joints(names, robot) if names else ()
    if wanted in {(), names} or len({*names} & {*lib.all_joint_names}) > len(robot):
        return ()
    return tuple(names.index(name) for name in wanted)


def _picked(recording: Recording, places: Sequence[int], **changes: Any) -> Recording:
    """The recording of the joints at these places, with some fields changed."""
    of_joints = {key: getattr(recording, key) for key in SIGNALS}
    joints = list(places)
    picked = {key: x[:, joints] for key, x in of_joints.items() if x is not None}
    signals = {key: x[:, joints] for key, x in recording.signals.items()}
    law = None if recording.law is None else recording.law.reordered(places)
    return recording.replace(**{**picked, "signals": signals, "law": law, **changes})


def _reduced(recording: Recording, lib: Library) -> Recording:
    count = recording.n_joints
    is_tree = lib.manifest.coupling is None and not lib.manifest.loops
    if is_tree or recording.columns is not None or count == lib.n_joints:
        return recording
    names = recording.joint_names or (lib.all_joint_names if count == lib.n_links else ())
    if not set(lib.joint_names) <= set(names):
        return recording
    places = [names.index(name) for name in lib.joint_names]
    rows = [k for k, name in enumerate(lib.all_joint_names) if name in names]
    columns = [names.index(lib.all_joint_names[k]) for k in rows]
    _require_agreement(recording, lib, rows, columns, places)
    tau = None
    if recording.tau is not None:
        jacobian = lib.joint_jacobian(recording.q[:, places])[:, rows]
        tau = np.einsum("tk,tkn->tn", recording.tau[:, columns], jacobian)
    names_of_robot = lib.joint_names if recording.joint_names else ()
    return _picked(recording, places, tau=tau, joint_names=names_of_robot).noted(
        f"Reduced {count} joints to the {lib.n_joints} independent ones; torques of the others act "
        "on these by their couplings."
    )


def _require_agreement(
    recording: Recording, lib: Library, rows: list[int], columns: list[int], places: list[int]
) -> None:
    expected = lib.all_positions(recording.q[:, places])[:, rows]
    apart = recording.q[:, columns] - expected
    if lib.manifest.loops:  # an encoder of a loop's joint may begin some turns away
        turning = np.array([lib.manifest.all_joints[k].kind != "prismatic" for k in rows])
        apart -= np.where(turning, 2 * np.pi * np.round(np.median(apart, axis=0) / 2 / np.pi), 0.0)
    apart = np.median(np.abs(apart), axis=0)
    allowed = APART + OF_RANGE * np.ptp(expected, axis=0)
    worst = int(np.argmax(apart / allowed))
    if apart[worst] > allowed[worst]:
        raise IdentificationError(
            f"joint '{lib.all_joint_names[rows[worst]]}' of the recording '{recording.name}' "
            f"deviates from its coupling by {apart[worst]:.3g} (median, rad or m); correct factor "
            "and offset of the coupling, or unit and sign in the recipe"
        )
