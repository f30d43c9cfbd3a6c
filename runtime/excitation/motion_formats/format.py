"""The record of a file format of motions, and what its writers share."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from runtime.excitation.proof.certified_motion import CertifiedMotion


@dataclass(frozen=True, slots=True)
class MotionFormat:
    """A file format in which a motion is written.

    Attributes:
        name: word by which a user selects it.
        suffix: end of the file name, with its dot.
        sentence: what the file holds, for help texts.
        write: writes the motion at a sampling rate [Hz] to a path, atomically.
        rate: sampling rate where the user states none, Hz.
    """

    name: str
    suffix: str
    sentence: str
    write: Callable[[CertifiedMotion, float, Path], None]
    rate: float = 1000.0


def write_comments(file: IO[bytes], lines: tuple[str, ...]) -> None:
    """Write lines that begin with #."""
    file.write("".join(f"# {line}\n" for line in lines).encode())
