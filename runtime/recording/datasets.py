"""Places of the known data sets: package, $SYMGEN_DATA, `shared` beside the repository, download.

The examples come with the package; of other data nothing is copied into the repository. A download
is pinned by commit and sha256 in the bundled recipe of the set, and is kept in the cache folder of
the operating system.
"""

import logging
import os
import shutil
from pathlib import Path

from runtime.errors import RecordingError
from runtime.recording.recipes.recipe_file import bundled_names, load_recipe

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
"""Logs that come with the package: <name>.npz."""


def known_names() -> tuple[str, ...]:
    """Names of the known data sets: the examples of the package, then those of bundled recipes."""
    return (*sorted(path.stem for path in EXAMPLES.glob("*.npz")), *bundled_names())


def locate(name: str) -> Path:
    """Log or folder with the raw files of a known data set, downloaded where necessary."""
    if name not in known_names():
        raise RecordingError(
            f"there is no data set {name!r}; the known ones are {', '.join(known_names())}"
        )
    if name not in bundled_names():
        return EXAMPLES / f"{name}.npz"
    for folder in _local_folders(name):
        if folder.is_dir():
            return folder
    return _download(name)


def _local_folders(name: str) -> list[Path]:
    """$SYMGEN_DATA/data/name if that is set, else ../shared/data/name beside the repository."""
    root = os.environ.get("SYMGEN_DATA", "")
    if root:
        return [Path(root) / "data" / name]
    repository = Path(__file__).resolve().parents[2]
    return [repository.parent / "shared" / "data" / name]


def _download(name: str) -> Path:
    """The pinned files of a data set in the cache of pooch."""
    import pooch  # a third of a second, which logs from files need not wait for

    source = load_recipe(name).source
    tried = " and ".join(str(folder) for folder in _local_folders(name))
    advice = f"set SYMGEN_DATA to the folder that holds data/{name}"
    if not source.base or not source.sha256:
        raise RecordingError(
            f"the data set {name!r} is not in {tried} and its files cannot be "
            f"downloaded; get them from {source.url} and {advice}"
        )
    folder = Path(pooch.os_cache("symgen")) / "data" / name
    fetcher = pooch.create(
        path=folder,
        base_url=source.base.replace("{commit}", source.commit),
        registry={file: f"sha256:{digest}" for file, digest in source.sha256.items()},
    )
    log = logging.getLogger(__name__)
    try:
        for file in source.sha256:
            log.info("data set %s: fetching %s (commit %.8s)", name, file, source.commit)
            fetcher.fetch(file)
    except (OSError, ValueError) as error:
        _remove_if_empty(folder)
        raise RecordingError(
            f"the data set {name!r} is not in {tried} and could not be downloaded "
            f"({type(error).__name__}); {advice}, or try again with a network"
        ) from error
    return folder


def _remove_if_empty(folder: Path) -> None:
    if folder.is_dir() and not any(folder.iterdir()):
        shutil.rmtree(folder)
