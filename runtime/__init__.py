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
    from runtime.estimators.descent.fit import PRESETS, Preset
    from runtime.estimators.methods import METHODS
    from runtime.excitation.search.design import Design, excite
    from runtime.excitation.search.design_settings import DesignSettings
    from runtime.identification.evaluation import Evaluation, evaluate
    from runtime.identification.free_base.result import FreeBaseIdentification
    from runtime.identification.identified import Identification
    from runtime.identification.identify import identify
    from runtime.identification.online import OnlineEstimate, OnlineEstimator
    from runtime.identification.payload.body import Payload
    from runtime.identification.payload.estimate import identify_payload
    from runtime.identification.result_file import write_result
    from runtime.identification.saved_result import SavedResult, read_result
    from runtime.identification.sensor_gains import Gains, identify_gains
    from runtime.identification.settings import Settings
    from runtime.inspection.inspection import Inspection
    from runtime.inspection.inspection import inspect_log as inspect
    from runtime.library import BaseMotion, Library, load, to_pinocchio_order
    from runtime.monitoring.drift import Verdict
    from runtime.monitoring.observer import Observer
    from runtime.monitoring.watch import watch
    from runtime.outputs.model_files.export import export, to_mujoco, to_pinocchio
    from runtime.outputs.report.report import write_report as report
    from runtime.recording import Recording, read_recording, write_recording
    from runtime.recording.free_base import FreeBaseRecording, read_free_base
    from runtime.recording.preprocessing.segments import differentiate
    from runtime.tapes.functions import jax, torch

__version__ = "0.1.0"
"""Version of the package, that of symgen."""

__all__ = [
    "METHODS",
    "PRESETS",
    "BaseMotion",
    "Design",
    "DesignSettings",
    "Evaluation",
    "FreeBaseIdentification",
    "FreeBaseRecording",
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
    "Verdict",
    "choose_default_friction",
    "choose_friction",
    "differentiate",
    "evaluate",
    "excite",
    "export",
    "identify",
    "identify_gains",
    "identify_payload",
    "inspect",
    "jax",
    "load",
    "read_free_base",
    "read_recording",
    "read_result",
    "report",
    "to_mujoco",
    "to_pinocchio",
    "to_pinocchio_order",
    "torch",
    "watch",
    "write_recording",
    "write_result",
]

_MODULES = {  # module → names of it, imported at the first use: scipy takes 0.5 s
    "runtime.estimators.choice.default_friction": ("choose_default_friction",),
    "runtime.estimators.choice.friction_choice": ("choose_friction",),
    "runtime.estimators.descent.fit": ("PRESETS", "Preset"),
    "runtime.estimators.methods": ("METHODS",),
    "runtime.excitation.search.design": ("Design", "excite"),
    "runtime.excitation.search.design_settings": ("DesignSettings",),
    "runtime.identification.evaluation": ("Evaluation", "evaluate"),
    "runtime.identification.free_base.result": ("FreeBaseIdentification",),
    "runtime.identification.identified": ("Identification",),
    "runtime.identification.identify": ("identify",),
    "runtime.identification.online": ("OnlineEstimate", "OnlineEstimator"),
    "runtime.identification.payload.body": ("Payload",),
    "runtime.identification.payload.estimate": ("identify_payload",),
    "runtime.identification.result_file": ("write_result",),
    "runtime.identification.saved_result": ("SavedResult", "read_result"),
    "runtime.identification.sensor_gains": ("Gains", "identify_gains"),
    "runtime.identification.settings": ("Settings",),
    "runtime.inspection.inspection": ("Inspection",),
    "runtime.inspection.inspection:inspect_log": ("inspect",),
    "runtime.library": ("BaseMotion", "Library", "load", "to_pinocchio_order"),
    "runtime.monitoring.drift": ("Verdict",),
    "runtime.monitoring.observer": ("Observer",),
    "runtime.monitoring.watch": ("watch",),
    "runtime.outputs.model_files.export": ("export", "to_mujoco", "to_pinocchio"),
    "runtime.outputs.report.report:write_report": ("report",),
    "runtime.recording": ("Recording", "read_recording", "write_recording"),
    "runtime.recording.free_base": ("FreeBaseRecording", "read_free_base"),
    "runtime.recording.preprocessing.segments": ("differentiate",),
    "runtime.tapes.functions": ("jax", "torch"),
}


def __getattr__(name: str) -> Any:
    """Import a name of `__all__` at its first use."""
    place = next((place for place, names in _MODULES.items() if name in names), None)
    if place is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, there = place.partition(":")
    value = getattr(import_module(module), there or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, *(name for name in globals() if name.startswith("__"))])
