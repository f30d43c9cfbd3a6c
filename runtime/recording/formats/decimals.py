"""Decimal numbers without an exponent, eight digits at a time in the words of an array.

    value = (10^f · a + b) / 10^f,  a the digits before the point, b the f digits after it

Numerator and denominator are exact below 2⁵³ and 10²², so that their quotient is the number that
`float` returns (Clinger, "How to read floating point numbers accurately", PLDI 1990). The digits of
a word are added up in pairs, fours and eights.
"""

import re

import numpy as np
from numpy.typing import NDArray

from runtime.recording.formats.tables import FloatArray

DIGITS = 8
"""Most digits before the point, and after it."""
RARE = 16
"""One number in so many may have another form; beyond that NumPy's parser is as fast."""
_OTHER = re.compile(rb"[-+0-9.eE]+")
_POINT, _MINUS = ord("."), ord("-")
_ZEROS = np.uint64(0x3030303030303030)
_BEYOND_NINE, _TOPS = np.uint64(0x7676767676767676), np.uint64(0x8080808080808080)
_POWERS = 10 ** np.arange(DIGITS + 1, dtype=np.uint64)
_FOLDS = tuple(
    (np.uint64(10**digits), np.uint64(8 * digits), np.uint64(mask))
    for digits, mask in ((1, 0x00FF00FF00FF00FF), (2, 0x0000FFFF0000FFFF), (4, 0xFFFFFFFF))
)


def decimals(text: bytes, separator: bytes) -> FloatArray | None:
    """Numbers of cells, each to the last bit as by `float`."""
    padded = bytes(8) + text + separator
    characters = np.frombuffer(padded, np.uint8)[8:]
    marks = np.flatnonzero((characters == separator[0]) | (characters == _POINT))
    last = np.flatnonzero(characters.take(marks) == separator[0])
    if len(text) > (2 * DIGITS + 2) * len(last):
        return None
    ends, points = marks.take(last), marks.take(last - 1)
    starts = np.concatenate(([0], ends[:-1] + 1))
    negative = characters.take(starts) == _MINUS
    counts = np.stack((points - starts - negative, ends - points - 1))
    regular = np.diff(last, prepend=-1) == 2
    regular &= ((counts >= 1) & (counts <= DIGITS)).all(axis=0)
    np.clip(counts, 1, DIGITS, out=counts)
    value, is_number = _numbers(padded, np.stack((points, ends)), counts)
    power = _POWERS.take(counts[1])
    numerator = value[0] * power + value[1]
    regular &= is_number & (numerator < 2**53)
    values: FloatArray = numerator.astype(np.float64)
    values /= power.astype(np.float64)
    values *= 1.0 - 2.0 * negative
    others = np.flatnonzero(~regular)
    if len(others) * RARE > len(values) + RARE:
        return None
    for index in others:
        cell = text[starts[index] : ends[index]]
        try:
            values[index] = float(cell) if _OTHER.fullmatch(cell) else float("")
        except ValueError:
            return None
    return values


def _numbers(
    padded: bytes, places: NDArray[np.int64], counts: NDArray[np.int64]
) -> tuple[NDArray[np.uint64], NDArray[np.bool_]]:
    """Whole numbers that the digits in front of each place write."""
    # A word at every byte; the first character is in the lowest byte of its word.
    words = np.ndarray(len(padded) - 7, "<u8", padded, strides=(1,))
    digits = words.take(places).astype(np.uint64, copy=False)
    digits ^= _ZEROS
    others = (64 - 8 * counts).view(np.uint64)
    digits >>= others  # what stands in front of the digits becomes zero
    digits <<= others
    # A byte above 9, and only such a byte, carries into its top bit or has it set.
    higher = digits + _BEYOND_NINE
    higher |= digits
    other = (higher[0] | higher[1]) & _TOPS
    for factor, shift, mask in _FOLDS:
        np.right_shift(digits, shift, out=higher)
        digits *= factor
        digits += higher
        digits &= mask
    return digits, other == 0
