"""Training, validation and test parts from the value of --split."""

from runtime.cli.common import numbers_option
from runtime.errors import IdentificationError
from runtime.recording import EVERYTHING, Split


def split_of(text: str | None) -> Split | None:
    """Parts of a log."""
    if text is None:
        return None
    if text == "all":
        return EVERYTHING
    a, b = fractions_of(text)
    return Split((0.0, a), (a, b), (b, 1.0))


def fractions_of(text: str) -> tuple[float, float]:
    """Ends of training and validation from "A,B"."""
    a, b = numbers_option(text, 2, "--split")
    if not 0 < a < b < 1:
        raise IdentificationError(f"--split needs 0 < A < B < 1, got '{text}'")
    return a, b
