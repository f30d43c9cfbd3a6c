"""Draws of hypothesis on which every kind of damage rests, and damage of plain bytes."""

import re
from collections.abc import Callable, Sequence
from typing import Any

from hypothesis import strategies as st

Draw = Callable[[st.SearchStrategy[Any]], Any]
Mutator = Callable[[Draw, bytes], bytes]
NUMBERS = (
    *(b"nan", b"inf", b"-inf", b"NaN", b"Infinity", b"1e308", b"-1e308", b"1e999", b"1e-320"),
    *(b"-0", b"0", b"-1", b"1", b"9" * 25, b"9" * 400, b"9" * 5000, b"", b"1_000", b"true"),
    *(b"null", b"2147483648", b"18446744073709551616", b'"1"', b"[1]", b"{}", b"1,5"),
    "٣".encode(),
)


def pick(draw: Draw, values: Sequence[Any]) -> Any:
    """One of some values."""
    return draw(st.sampled_from(values))


def chance(draw: Draw, count: int) -> bool:
    """True once in so many draws."""
    return draw(st.integers(0, count - 1)) == count - 1


def pieces(draw: Draw, data: bytes) -> bytes:
    """A piece removed, doubled, overwritten or moved, a few bits flipped, or the end cut off."""
    first = draw(st.integers(0, len(data)))
    size = pick(draw, (1, 1, 2, 4, 8, 64, 4096))
    piece, rest = data[first : first + size], data[first + size :]
    match draw(st.integers(0, 6)):
        case 0:
            return data[:first]
        case 1:
            return data[:first] + rest
        case 2:
            where = draw(st.integers(0, len(data)))
            return data[:where] + piece + data[where:]
        case 3:  # as lengths and counts of binary formats
            return data[:first] + pick(draw, (b"\0", b"\xff")) * len(piece) + rest
        case 4:
            return data[:first] + draw(st.binary(min_size=1, max_size=64)) + rest
    out = bytearray(data)
    for where in draw(st.lists(st.integers(0, 8 * len(data) - 1), min_size=1, max_size=8)):
        out[where // 8] ^= 1 << where % 8
    return bytes(out)


def replaced(pattern: bytes, values: Sequence[bytes]) -> Mutator:
    """One to three matches of a pattern, each by one of some values."""

    def mutate(draw: Draw, data: bytes) -> bytes:
        for _ in range(draw(st.integers(1, 3))):
            first, last = pick(draw, list(re.finditer(pattern, data))).span()
            data = data[:first] + pick(draw, values) + data[last:]
        return data

    return mutate


numbers = replaced(rb"-?\d+(?:\.\d+)?(?:e-?\d+)?", NUMBERS)
