"""Decimal numbers without an exponent, eight characters at a time in the words of arrays.

    value = (10^f · a + b) / 10^f,  a the digits before the point, b the f digits after it

Numerator and denominator are exact below 2⁵³ and 10²², so that their quotient is the number that
`float` returns (Clinger, "How to read floating point numbers accurately", PLDI 1990). Digits of a
word are added up in pairs, fours and eights.
"""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint64]

MOST_DIGITS = 8
"""Of a number before and after its point."""
MOST_OTHERS = 8
"""One number in so many may have another form; beyond that `float` for each is as fast."""
_NUMBER = re.compile(rb"[-+0-9.eE]+")
_ZEROS = np.uint64(0x3030303030303030)
_ONES = np.uint64(0x0101010101010101)
_TOPS = np.uint64(0x8080808080808080)
_HIGH = np.uint64(0xF0F0F0F0F0F0F0F0)
_POINTS = np.uint64(0x2E2E2E2E2E2E2E2E)
_SIXES = np.uint64(0x0606060606060606)
_THREES = np.uint64(0x3333333333333333)
_BYTE, _SIGN = np.uint64(0xFF), np.uint64(ord("-") ^ ord("0"))
_EXACT = np.uint64(2**53)
_POWERS = 10 ** np.arange(9, dtype=np.uint64)


def decimal_rows(
    text: str, separator: str, width: int, picks: Sequence[int]
) -> NDArray[np.float64] | None:
    """Chosen columns of lines of numbers.

    Args:
        text: whole lines.
        separator: of cells.
        width: number of cells of every line.
        picks: indices of the columns.

    Returns:
        (N, len(picks)); None where a line has another width, or a cell is not a number of digits,
        sign, point and exponent, or too many have another form than digits around a point.
    """
    if not text.isascii():
        return None
    data = text.replace("\r\n", "\n").encode("ascii")
    characters = np.frombuffer(data if data.endswith(b"\n") else data + b"\n", dtype=np.uint8)
    is_end = characters == ord("\n")
    ends = np.flatnonzero(is_end if width == 1 else is_end | (characters == ord(separator)))
    if len(ends) % width:
        return None
    if (
        width > 1
        and not (is_end.take(ends).reshape(-1, width) == (np.arange(width) == width - 1)).all()
    ):
        return None
    starts = np.concatenate(([0], ends[:-1] + 1)).reshape(-1, width)[:, picks].ravel()
    values = decimals(data, starts, ends.reshape(-1, width)[:, picks].ravel())
    return None if values is None else values.reshape(-1, len(picks))


def decimals(
    data: bytes, starts: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.float64] | None:
    """Numbers of cells, each to the last bit as by `float`.

    Args:
        data: text in ASCII.
        starts: (N,) index of the first character of each cell.
        ends: (N,) index behind its last character.

    Returns:
        (N,); None where a cell is not a number of digits, sign, point and exponent, or too many
        have another form than digits around a point.
    """
    text = np.frombuffer(data + bytes(16 + -len(data) % 8), dtype="<u8")
    head = _word(text, starts)
    negative = (head & _BYTE == ord("-")).view(np.uint8).astype(np.uint64)
    head ^= negative * _SIGN  # the sign becomes a leading zero
    # The lowest byte that is a point: x − 1 borrows into the top bit of a byte that is zero.
    other = head ^ _POINTS
    marks = (other - _ONES) & ~other & _TOPS
    lowest = (marks & -marks).astype(np.float64)  # 2^(8 k + 7), its exponent is in bits 52 to 62
    whole = (lowest.view(np.int64) >> 55) - (1023 + 7 >> 3)
    after = ends - starts - whole - 1
    regular = (marks != 0) & (whole > 0) & (after > 0) & (after <= MOST_DIGITS)
    np.clip(whole, 1, MOST_DIGITS, out=whole)
    np.clip(after, 1, MOST_DIGITS, out=after)
    a, is_number = _digits(head, whole)
    regular &= is_number
    b, is_number = _digits(_word(text, starts + whole + 1), after)
    regular &= is_number
    power = _POWERS.take(after)
    numerator = a * power + b
    regular &= numerator < _EXACT
    values: NDArray[np.float64] = numerator.astype(np.float64) / power.astype(np.float64)
    values.view(np.uint64)[:] |= negative << np.uint64(63)
    others = np.flatnonzero(~regular)
    if len(others) * MOST_OTHERS > len(starts) + MOST_OTHERS:
        return None
    for index in others:
        cell = data[starts[index] : ends[index]]
        if not _NUMBER.fullmatch(cell):
            return None
        try:
            values[index] = float(cell)
        except ValueError:
            return None
    return values


def _word(text: Words, places: NDArray[np.int64]) -> Words:
    """(N,) the eight characters from each place on, the first one lowest."""
    index, bits = places >> 3, ((places & 7) << 3).view(np.uint64)
    low = text.take(index)
    high = text[1:].take(index)
    # Two shifts: one by 64 bits, where the place is aligned, is not defined.
    return low >> bits | high << np.uint64(1) << (np.uint64(63) - bits)


def _digits(words: Words, counts: NDArray[np.int64]) -> tuple[Words, NDArray[np.bool_]]:
    """Number that the first characters of each word write, and whether all of them are digits."""
    half = (counts << 2).view(np.uint64)
    digits = words << (np.uint64(64) - half - half)
    digits |= _ZEROS >> half >> half  # leading zeros; a shift by 64 bits is not defined
    is_number = (digits & _HIGH) | ((digits + _SIXES & _HIGH) >> np.uint64(4)) == _THREES
    pairs = digits & np.uint64(0x0F0F0F0F0F0F0F0F)
    pairs = (pairs * np.uint64(10) + (pairs >> np.uint64(8))) & np.uint64(0x00FF00FF00FF00FF)
    fours = (pairs * np.uint64(100) + (pairs >> np.uint64(16))) & np.uint64(0x0000FFFF0000FFFF)
    return (fours * np.uint64(10000) + (fours >> np.uint64(32))) & np.uint64(0xFFFFFFFF), is_number
