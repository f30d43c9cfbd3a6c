"""Options of `symgen identify`: files that they name, and those that do not fit together."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.errors import IdentificationError
from runtime.estimators.methods import METHODS
from runtime.library import Library

if TYPE_CHECKING:
    from runtime.estimators.prior_file import PriorFile


_ONE_LOG = {
    "several": (
        "--controller belongs to one log, but several are given; leave it out",
        "--encoder-bias and --symmetric belong to one log, but several are given; identify each "
        "alone",
    ),
    "streamed": (
        "the closed loop of --controller is simulated over all samples, but the log is streamed; "
        "leave out --controller, or give --no-stream",
        "--encoder-bias and --symmetric need the whole log in memory, but it is streamed; give "
        "--no-stream",
    ),
}
"""Logs → sentences that refuse --controller, and --encoder-bias with --symmetric."""


def require_one_log(logs: str, controller: Path | None, drives: object) -> None:
    """Refuse options that need the samples of one whole log."""
    for value, sentence in zip((controller, drives), _ONE_LOG[logs], strict=True):
        if value:
            raise IdentificationError(sentence)


def prior_of(path: Path | None, lib: Library) -> "PriorFile | None":
    """Inertial prior of --prior."""
    if path is None:
        return None
    from runtime.estimators.prior_file import read_prior

    return read_prior(path, lib)


def inputs_of(methods: Iterable[str], lib: Library, **files: Path | None) -> dict[str, Any]:
    """What these methods need beyond the log, from files by the names of the inputs."""
    readers = {name: read for each in methods for name, read in METHODS[each].files.items()}
    return {
        name: readers[name](path, lib) for name, path in files.items() if path and name in readers
    }
