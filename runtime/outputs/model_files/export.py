"""Identified parameters → model files: written, read by their engine, compared, then kept."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from numpy.typing import ArrayLike

from runtime.errors import ExportError, NotRealisableError
from runtime.library import Library
from runtime.outputs.model_files.drives import Drives
from runtime.outputs.model_files.engines.answer import Unreadable
from runtime.outputs.model_files.export_format import (
    EXPORT_FORMATS,
    ExportFormat,
    require_base,
    save,
)
from runtime.outputs.model_files.model import IdentifiedModel, make_model, require_consistent
from runtime.recording import Friction


@dataclass(frozen=True, slots=True)
class Exported:
    """Outcome of one format."""

    kind: str  # name of the format
    path: Path | None  # file or folder that was written; None where it was refused
    sentence: str  # how the file was verified, or why it was refused
    # whether the file was refused because the model lacks what only this format holds, see
    # `ExportFormat.holds_inertia`
    is_optional: bool = False


def write_urdf(
    lib: Library,
    pi: ArrayLike,
    path: str | os.PathLike[str],
    terms: Friction | None = None,
    phi: ArrayLike | None = None,
) -> str:
    """Write the identified URDF, after a check that it reloads to the same torques.

    The file appears complete or not at all; an existing file stays where the new one is refused.
    """
    return _write(make_model(lib, pi, terms, phi), EXPORT_FORMATS["urdf"], Path(path))


def export_model(
    lib: Library,
    pi: ArrayLike,
    kinds: Sequence[str],
    folder: Path,
    *,
    terms: Friction | None = None,
    phi: ArrayLike | None = None,
    drives: Drives | None = None,
    overwrite: bool = False,
) -> list[Exported]:
    """Write some of `EXPORT_FORMATS` into a folder, each one if its check passes."""
    paths = {}
    for kind in kinds:
        if kind not in EXPORT_FORMATS:
            raise ExportError(
                f"expected some of {', '.join(EXPORT_FORMATS)} to export, got '{kind}'"
            )
        paths[kind] = folder / EXPORT_FORMATS[kind].file.format(robot=lib.name)
    existing = [str(path) for path in paths.values() if path.exists()]
    if existing and not overwrite:
        raise ExportError(
            f"'{existing[0]}' exists; name another folder with --out, or allow it with --overwrite"
        )
    done = []
    for kind, path in paths.items():
        chosen = EXPORT_FORMATS[kind]
        try:
            require_base(lib, chosen)
            # Joint friction does not depend on whether the identified links are consistent.
            shown = pi if chosen.holds_inertia else lib.pi0
            model = make_model(lib, shown, terms, phi, drives=drives)
            done.append(Exported(kind, path, _write(model, chosen, path)))
        except ExportError as error:
            is_optional = not chosen.holds_inertia or lib.manifest.floating
            done.append(Exported(kind, None, str(error), is_optional))
    return done


def _write(model: IdentifiedModel, chosen: ExportFormat, path: Path) -> str:
    """Write one file or folder, checked before; return the sentence of the check."""
    require_consistent(model)
    if not chosen.holds_inertia and not model.friction.is_known:
        raise ExportError(
            "not written: the result has no viscous or dry friction; identify it with "
            "--friction viscous,coulomb"
        )
    try:
        text = chosen.write(model)
        verdict = chosen.check(model, text)
    except (Unreadable, NotRealisableError) as error:
        raise ExportError(f"not written: cannot reload the {chosen.name} ({error})") from None
    save(path, text)
    return verdict
