"""Names that options take, for the completion of shells."""

from collections.abc import Iterable
from importlib import import_module

_REGISTRIES = {
    "--method": "runtime.estimators.methods:METHODS",
    "--preset": "runtime.estimators.descent.fit:PRESETS",
    "--friction": "runtime.recording.friction_column:COLUMNS",
    "--to": "runtime.outputs.model_files.export_format:EXPORT_FORMATS",
    "--export": "runtime.excitation.motion_export:MOTION_FORMATS",
    "--criterion": "runtime.excitation.search.criteria:CRITERIA",
    "--basis": "runtime.excitation.motion.basis:BASES",
}
"""Option → where its names are the keys."""


def values_of(option: str) -> Iterable[str]:
    """Names that an option takes.

    Args:
        option: with its dashes.

    Returns:
        The names; empty for numbers, files and texts.
    """
    if option not in _REGISTRIES:
        return ()
    module, _, name = _REGISTRIES[option].partition(":")
    return tuple(getattr(import_module(module), name))
