"""runtime loads a generated robot and finds its inertial parameters from measured motion.

Run time only: numpy, scipy, clarabel; no casadi, no pinocchio. The usual road:

    lib = runtime.load("fr3")
    recording = runtime.read_recording("log.csv")
    result = runtime.identify(recording, lib)
"""

import os
import sys

# `python -m runtime` puts the working directory first on the path, where a file numpy.py beside a
# log would be run as a module. os and sys are loaded before any of them.
if (
    sys.orig_argv[1:3] == ["-m", "runtime"]
    and sys.path[:1] == [os.getcwd()]
    and os.path.dirname(os.path.dirname(os.path.abspath(__file__))) != sys.path[0]
):
    del sys.path[0]

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from runtime.estimators.choice.default_friction import choose_default_friction
    from runtime.estimators.choice.friction_choice import choose_friction
    from runtime.estimators.descent.adam import Preset
    from runtime.estimators.descent.fit import PRESETS
    from runtime.estimators.methods import METHODS
    from runtime.excitation.search.design import Design, excite
    from runtime.excitation.search.design_settings import DesignSettings
    from runtime.identification.evaluation import Evaluation, evaluate
    from runtime.identification.identified import Identification
    from runtime.identification.identify import identify
    from runtime.identification.online import OnlineEstimate, OnlineEstimator
    from runtime.identification.payload.body import Payload
    from runtime.identification.payload.estimate import identify_payload
    from runtime.identification.saved_result import SavedResult, read_result
    from runtime.identification.sensor_gains import Gains, identify_gains
    from runtime.identification.settings import Settings
    from runtime.inspection.inspection import Inspection
    from runtime.inspection.inspection import inspect_log as inspect
    from runtime.library import BaseMotion, Library, load, to_pinocchio_order
    from runtime.monitoring.observer import Observer
    from runtime.outputs.model_files.in_memory import export, to_mujoco, to_pinocchio
    from runtime.outputs.report.report import write_report as report
    from runtime.recording import Recording, read_recording, write_recording
    from runtime.tapes.doors import jax, torch

__version__ = "0.1.0"
"""Version of the package, that of symgen."""

__all__ = [
    "METHODS",
    "PRESETS",
    "BaseMotion",
    "Design",
    "DesignSettings",
    "Evaluation",
    "Gains",
    "Identification",
    "Inspection",
    "Library",
    "Observer",
    "OnlineEstimate",
    "OnlineEstimator",
    "Payload",
    "Preset",
    "Recording",
    "SavedResult",
    "Settings",
    "choose_default_friction",
    "choose_friction",
    "evaluate",
    "excite",
    "export",
    "identify",
    "identify_gains",
    "identify_payload",
    "inspect",
    "jax",
    "load",
    "read_recording",
    "read_result",
    "report",
    "to_mujoco",
    "to_pinocchio",
    "to_pinocchio_order",
    "torch",
    "write_recording",
]

_MODULES = {
    "BaseMotion": "runtime.library",
    "Design": "runtime.excitation.search.design",
    "DesignSettings": "runtime.excitation.search.design_settings",
    "Evaluation": "runtime.identification.evaluation",
    "Gains": "runtime.identification.sensor_gains",
    "Identification": "runtime.identification.identified",
    "Inspection": "runtime.inspection.inspection",
    "Library": "runtime.library",
    "METHODS": "runtime.estimators.methods",
    "Observer": "runtime.monitoring.observer",
    "OnlineEstimate": "runtime.identification.online",
    "OnlineEstimator": "runtime.identification.online",
    "PRESETS": "runtime.estimators.descent.fit",
    "Payload": "runtime.identification.payload.body",
    "Preset": "runtime.estimators.descent.adam",
    "Recording": "runtime.recording",
    "SavedResult": "runtime.identification.saved_result",
    "Settings": "runtime.identification.settings",
    "choose_default_friction": "runtime.estimators.choice.default_friction",
    "choose_friction": "runtime.estimators.choice.friction_choice",
    "evaluate": "runtime.identification.evaluation",
    "excite": "runtime.excitation.search.design",
    "export": "runtime.outputs.model_files.in_memory",
    "identify": "runtime.identification.identify",
    "identify_gains": "runtime.identification.sensor_gains",
    "identify_payload": "runtime.identification.payload.estimate",
    "inspect": "runtime.inspection.inspection:inspect_log",
    "jax": "runtime.tapes.doors",
    "load": "runtime.library",
    "read_recording": "runtime.recording",
    "read_result": "runtime.identification.saved_result",
    "report": "runtime.outputs.report.report:write_report",
    "to_mujoco": "runtime.outputs.model_files.in_memory",
    "to_pinocchio": "runtime.outputs.model_files.in_memory",
    "to_pinocchio_order": "runtime.library",
    "torch": "runtime.tapes.doors",
    "write_recording": "runtime.recording",
}
"""Module of every name, and its name there; imported at the first use: scipy takes 0.5 s."""


def __getattr__(name: str) -> Any:
    """Import a name of `__all__` at its first use."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, there = _MODULES[name].partition(":")
    value = getattr(import_module(module), there or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, *(name for name in globals() if name.startswith("__"))])
