"""Names that options take: those that a shell completes, and lists of them."""

from collections.abc import Iterable, Sequence
from importlib import import_module

from runtime.errors import IdentificationError

_REGISTRIES = {
    "--method": "runtime.estimators.methods:METHODS",
    "--preset": "runtime.estimators.descent.fit:PRESETS",
    "--friction": "runtime.recording.settings:COLUMNS",
    "--to": "runtime.outputs.model_files.export_format:EXPORT_FORMATS",
    "--export": "runtime.excitation.motion_export:MOTION_FORMATS",
    "--criterion": "runtime.excitation.search.criteria:CRITERIA",
    "--basis": "runtime.excitation.motion.trajectory:BASES",
}
"""Option → where its names are the keys."""


def values_of(option: str) -> Iterable[str]:
    """Names that an option takes."""
    if option not in _REGISTRIES:
        return ()
    module, _, name = _REGISTRIES[option].partition(":")
    return tuple(getattr(import_module(module), name))


def listed(text: str, known: Sequence[str], option: str) -> tuple[str, ...]:
    """Names separated by commas."""
    names = tuple(dict.fromkeys(word.strip() for word in text.split(",")))
    if any(name not in known for name in names):
        raise IdentificationError(
            f"{option} needs names with commas of {', '.join(known)}; got '{text}'"
        )
    return names
