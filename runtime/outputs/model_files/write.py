"""Identified parameters → files that load: written, read by their own engine, compared, kept."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from numpy.typing import ArrayLike

from runtime.errors import ExportError, NotRealisableError
from runtime.files import replacing
from runtime.library import Library
from runtime.outputs.model_files import check
from runtime.outputs.model_files.engines import Unreadable
from runtime.outputs.model_files.franka import dynamics_text, inertials_text
from runtime.outputs.model_files.header import header_text
from runtime.outputs.model_files.mjcf import mjcf_text
from runtime.outputs.model_files.model import Model, make_model, require_consistent
from runtime.outputs.model_files.sdf import sdf_text
from runtime.outputs.model_files.urdf import urdf_text
from runtime.recording import Friction


@dataclass(frozen=True, slots=True)
class Format:
    """A kind of file: its name with {robot}, its writer and its check."""

    name: str
    write: Callable[[Model], str]
    check: Callable[[Model, str], str]


FORMATS = {
    "urdf": Format("{robot}.urdf", urdf_text, check.check_urdf),
    "mjcf": Format("{robot}.xml", mjcf_text, check.check_mjcf),
    "sdf": Format("{robot}.sdf", sdf_text, check.check_sdf),
    "inertials": Format("inertials.yaml", inertials_text, check.check_inertials),
    "friction": Format("dynamics.yaml", dynamics_text, check.check_dynamics),
    "header": Format("{robot}_identified.h", header_text, check.check_header),
}


@dataclass(frozen=True, slots=True)
class Exported:
    """What became of one format: the path, or None, and the sentence that says why."""

    kind: str
    path: Path | None
    sentence: str


def write_urdf(
    lib: Library,
    pi: ArrayLike,
    path: str | os.PathLike[str],
    terms: Friction | None = None,
    phi: ArrayLike | None = None,
) -> str:
    """Write the identified URDF, after proving that it reloads to the same torques.

    The file appears complete or not at all; a file that was there survives every refusal.

    Args:
        lib: the robot that π belongs to.
        pi: (10 n,), every link fully physically consistent.
        path: file to write; its folder is created.
        terms: friction columns, where some were identified.
        phi: their coefficients, (n, k).

    Returns:
        One sentence that says how the file was verified, or that it was not.

    Raises:
        ShapeError: π does not have 10 entries per link.
        ExportError: an inconsistent link, or a failed reload.
        RuntimeFault: the file cannot be written.
    """
    return _write(make_model(lib, pi, terms, phi), "urdf", Path(path))


def export_model(
    lib: Library,
    pi: ArrayLike,
    kinds: Sequence[str],
    folder: Path,
    *,
    terms: Friction | None = None,
    phi: ArrayLike | None = None,
    overwrite: bool = False,
) -> list[Exported]:
    """Write some of `FORMATS` into a folder, each if it is right, whatever becomes of the others.

    Args:
        lib: the robot that π belongs to.
        pi: (10 n,).
        kinds: keys of `FORMATS`.
        folder: made where it is missing.
        terms: friction columns, where some were identified.
        phi: their coefficients, (n, k).
        overwrite: replace files that are there.

    Raises:
        ShapeError: π does not have 10 entries per link.
        ExportError: an unknown format, or a file that is there and must not be replaced; nothing
            is written then.
        RuntimeFault: the folder cannot be written.
    """
    paths = {}
    for kind in kinds:
        if kind not in FORMATS:
            raise ExportError(f"expected some of {', '.join(FORMATS)} to export, got '{kind}'")
        paths[kind] = folder / FORMATS[kind].name.format(robot=lib.name)
    there = [str(path) for path in paths.values() if path.exists()]
    if there and not overwrite:
        raise ExportError(
            f"'{there[0]}' exists; name another folder with --out, or allow it with --overwrite"
        )
    done = []
    for kind, path in paths.items():
        try:
            # What a joint rubs does not ask whether the links can exist.
            model = make_model(lib, lib.pi0 if kind == "friction" else pi, terms, phi)
            done.append(Exported(kind, path, _write(model, kind, path)))
        except ExportError as error:
            done.append(Exported(kind, None, str(error)))
    return done


def _write(model: Model, kind: str, path: Path) -> str:
    """One file, checked before it takes its place; returns the verdict."""
    require_consistent(model)
    if kind == "friction" and not model.drive.is_known:
        raise ExportError(
            "not written: the result has no viscous or dry friction; identify it with "
            "--friction viscous,coulomb"
        )
    chosen = FORMATS[kind]
    try:
        text = chosen.write(model)
        verdict = chosen.check(model, text)
    except (Unreadable, NotRealisableError) as error:
        raise ExportError(f"not written: cannot reload the {kind} ({error})") from None
    with replacing(path) as file:
        file.write(text.encode())
    return verdict
