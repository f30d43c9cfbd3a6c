"""Libraries that only some kinds of log need: imported when such a log is read."""

import importlib
from types import ModuleType

from runtime.errors import RecordingError


def imported(module: str, kind: str) -> ModuleType:
    """Module of the extra `logs`."""
    try:
        return importlib.import_module(module)
    except ImportError:
        library = module.split(".", maxsplit=1)[0]
        raise RecordingError(
            f"reading or writing {kind} needs the library {library}, which is not installed; "
            "run: pip install 'symgen[logs]'"
        ) from None
