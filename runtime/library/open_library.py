"""Opens the compiled library of a generated folder when it is whole and belongs to its manifest."""

import ctypes
import shutil
import tempfile
from pathlib import Path

from runtime.common.files import json_of, sha256_of
from runtime.common.user_builds import is_user_build
from runtime.errors import LibraryError
from runtime.library.compile_cache import compiled_library
from runtime.library.manifest import Manifest

AGAIN = "run: python -m symgen build"


def open_library(folder: Path, manifest: Manifest, level: str | None = None) -> ctypes.CDLL:
    """Open the library in a generated folder, or else that of its C code in the cache.

    Checked: its bytes are those that were compiled, from this manifest, for this machine. The
    library of a folder is opened only if this user has built it; otherwise its C code is compiled.
    """
    name = f"lib{manifest.robot}.so"
    place = folder
    if not (folder / name).exists():
        place = compiled_library(folder, manifest.robot, level)
    digest = _checked(place, folder, name)
    if place == folder and not is_user_build(folder / name, digest):
        place = compiled_library(folder, manifest.robot, level)
        _checked(place, folder, name)
    path = place / name
    again = AGAIN if place == folder else "set SYMGEN_CACHE to another folder, or " + AGAIN
    try:
        dll = ctypes.CDLL(str(path.resolve()))
        model_hash = _model_hash(dll, manifest)
        if model_hash != manifest.model_hash:
            # For a known path the loader returns the older build that this process has open.
            with tempfile.TemporaryDirectory() as fresh:
                dll = ctypes.CDLL(shutil.copy(path, fresh))
            model_hash = _model_hash(dll, manifest)
    except (OSError, AttributeError) as error:
        raise LibraryError(f"the library '{path}' cannot be used here ({error}); {again}") from None
    if model_hash != manifest.model_hash:
        raise LibraryError(
            f"the library '{path}' belongs to the model {model_hash[:12]}, its manifest to "
            f"{manifest.model_hash[:12]}; {AGAIN}"
        )
    return dll


def _checked(place: Path, folder: Path, name: str) -> str:
    """SHA-256 of a library whose bytes agree with its build.json and the manifest."""
    path = place / name
    try:
        record = json_of(place / "build.json")
        sha256, sources = record["sha256"], record["sources"]
        stated = sources["manifest.json"]
    except (OSError, ValueError, KeyError, TypeError):
        raise LibraryError(
            f"'{place}' has no valid build.json beside its library; {AGAIN}"
        ) from None
    # Opening a truncated shared object kills the process, so its bytes are checked first.
    digest = sha256_of(path)
    if digest != sha256:
        raise LibraryError(f"the library '{path}' is damaged or not the one built here; {AGAIN}")
    manifest_hash = sha256_of(folder / "manifest.json")
    if stated != manifest_hash:
        raise LibraryError(f"the library '{path}' is older than its manifest.json; {AGAIN}")
    return digest


def _model_hash(dll: ctypes.CDLL, manifest: Manifest) -> str:
    answer = dll[f"{manifest.robot}_model_hash"]
    answer.restype = ctypes.c_char_p
    return str(answer().decode())
