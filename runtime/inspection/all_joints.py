"""Plan of a log of all joints of a robot with couplings or loops, for its independent joints."""

from dataclasses import replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.inspection.finding import INFO, Finding
from runtime.library import Library
from runtime.recording import Recipe
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.reader import Raw, recording_of

_PASSIVE = 1e-9
"""Torque of a dependent joint over the largest torque, below which no drive acts on it."""


def of_independent_joints(
    raw: Raw, plan: Recipe, lib: Library
) -> tuple[Raw, Recipe, list[Finding]]:
    """Take the columns of the independent joints where a log holds all of them."""
    recording = recording_of(replace(raw, plan=plan))
    few = independent_joints(recording, lib)
    if few is recording or few.n_joints == recording.n_joints:
        return raw, plan, []
    names = recording.joint_names or lib.all_joint_names
    places = [names.index(name) for name in lib.joint_names]
    if recording.tau is not None:
        others = np.abs(np.delete(recording.tau, places, axis=1))
        if others.max(initial=0.0) > _PASSIVE * np.abs(recording.tau).max():
            raise IdentificationError(_refusal(lib, "torques act on joints that follow others"))
    signals = plan.signals()
    if any(
        len(signal.columns) != recording.n_joints or signal.order for signal in signals.values()
    ):
        raise IdentificationError(_refusal(lib, "its columns have no names of their own"))
    changes = {
        kind: replace(signal, columns=tuple(signal.columns[k] for k in places))
        for kind, signal in signals.items()
    }
    sentence = (
        f"the log holds all {recording.n_joints} joints, of which those of q are checked: "
        f"{', '.join(lib.joint_names)}; the positions of the others agree with the mechanism"
    )
    tables = {
        kind: replace(table, values=table.values[:, places]) if kind in changes else table
        for kind, table in raw.tables.items()
    }
    changed = replace(raw, tables=tables)
    return changed, plan.replace(**changes), [Finding("all_joints", INFO, sentence)]


def _refusal(lib: Library, reason: str) -> str:
    return (
        f"the log holds all joints of '{lib.name}', and {reason}; identify reads it as it is, but "
        f"inspect checks the independent joints: name the columns of {', '.join(lib.joint_names)} "
        "in a recipe"
    )
