"""Bytes and a generator → damaged bytes; of text also by numbers, lines, words and depth."""

import gzip
import re
from collections.abc import Callable
from functools import cache

import numpy as np

Rng = np.random.Generator
Mutator = Callable[[bytes, Rng], bytes]

CANARY = "canary.txt"
"""File beside the folder of the damaged files that no reader may open."""
NUMBERS = (
    *(b"nan", b"inf", b"-inf", b"NaN", b"Infinity", b"1e308", b"-1e308", b"1e999", b"1e-320"),
    *(
        b"-0",
        b"0",
        b"-1",
        b"1",
        b"9" * 25,
        b"9" * 400,
        b"9" * 5000,
        b"",
        b"1_000",
        b"true",
        b"null",
    ),
    *(b"2147483648", b"18446744073709551616", b'"1"', b"[1]", b"{}", b"1,5", "٣".encode()),
)
WORDS = (
    *(b"../../../../../../etc/passwd", b"/dev/zero", b"/dev/stdin", b"../" + CANARY.encode()),
    *(b"", b".", b"..", b"\x00", b"a" * 100_000, b"{run}", b"{0.__class__}", b"%s%n", b"__class__"),
    *("\u202e\ud7ff".encode(), b"\xff\xfe", b"$(touch hacked)", b"`touch hacked`", b"-rf", b"nan"),
)
DEPTH = 20_000


def _cut(size: int, rng: Rng) -> tuple[int, int]:
    first, last = np.sort(rng.integers(0, size + 1, 2))
    return int(first), int(min(last, first + 4096))


def flip_bits(data: bytes, rng: Rng) -> bytes:
    """Flip one to eight bits."""
    if not data:
        return data
    out = bytearray(data)
    for where in rng.integers(0, len(out), rng.integers(1, 9)):
        out[where] ^= 1 << int(rng.integers(8))
    return bytes(out)


def truncate(data: bytes, rng: Rng) -> bytes:
    """Keep only the beginning."""
    return data[: int(rng.integers(0, len(data) + 1))]


def remove(data: bytes, rng: Rng) -> bytes:
    """Remove a piece."""
    first, last = _cut(len(data), rng)
    return data[:first] + data[last:]


def splice(data: bytes, rng: Rng) -> bytes:
    """Insert a copy of a piece somewhere else."""
    first, last = _cut(len(data), rng)
    where = int(rng.integers(0, len(data) + 1))
    return data[:where] + data[first:last] + data[where:]


def overwrite(data: bytes, rng: Rng) -> bytes:
    """Overwrite a few bytes by zeros, ones or noise, as lengths and counts of binary formats."""
    where, size = int(rng.integers(0, len(data) + 1)), int(rng.choice([1, 2, 4, 8, 64]))
    fill = (bytes(size), b"\xff" * size, rng.bytes(size))[int(rng.integers(3))]
    return data[:where] + fill + data[where + size :]


def _replaced(pattern: bytes, values: tuple[bytes, ...]) -> Mutator:
    """One to three matches, each by one of the values."""
    regex = re.compile(pattern)

    def mutate(data: bytes, rng: Rng) -> bytes:
        for _ in range(int(rng.integers(1, 4))):
            matches = list(regex.finditer(data))
            if not matches:
                return data
            span = matches[int(rng.integers(len(matches)))].span()
            data = data[: span[0]] + values[int(rng.integers(len(values)))] + data[span[1] :]
        return data

    return mutate


numbers = _replaced(rb"-?\d+(?:\.\d+)?(?:e-?\d+)?", NUMBERS)
words = _replaced(rb"(?<=\")[^\"\n]*(?=\")", WORDS)
bare_words = _replaced(rb"[A-Za-z_]+\d*", (*WORDS, b"t", b"q1", b"mass", b"kernels", b"link"))


def lines(data: bytes, rng: Rng) -> bytes:
    """A line removed, doubled, or exchanged with another."""
    rows = data.split(b"\n")
    i, j = rng.integers(0, len(rows), 2)
    kind = rng.integers(3)
    if kind == 0:
        del rows[i]
    elif kind == 1:
        rows.insert(j, rows[i])
    else:
        rows[i], rows[j] = rows[j], rows[i]
    return b"\n".join(rows)


def nested(*brackets: tuple[bytes, bytes]) -> Mutator:
    """A number, or the whole document, inside very many brackets of one of these kinds."""

    def mutate(data: bytes, rng: Rng) -> bytes:
        opened, closed = brackets[int(rng.integers(len(brackets)))]
        deep = opened * DEPTH
        if rng.integers(2):
            return deep + data + closed * DEPTH
        matches = list(re.finditer(rb"-?\d+(?:\.\d+)?", data))
        if not matches:
            return deep
        first, last = matches[int(rng.integers(len(matches)))].span()
        return data[:first] + deep + data[first:last] + closed * DEPTH + data[last:]

    return mutate


def entities(data: bytes, rng: Rng) -> bytes:
    """Entities that explode, or that name a file."""
    bomb = b"".join(b'<!ENTITY e%d "%s">' % (i, b"&e%d;" % (i - 1) * 10) for i in range(1, 12))
    outside = b'<!ENTITY e11 SYSTEM "file:../' + CANARY.encode() + b'">'
    doctype = b'<!DOCTYPE robot [<!ENTITY e0 "x">' + (outside, bomb)[int(rng.integers(2))] + b"]>"
    return doctype + data.partition(b"?>")[2].replace(b'name="', b'name="&e11;', 1)


def expressions(data: bytes, rng: Rng) -> bytes:
    """Expressions of xacro that compute for long, call Python, or expand without end."""
    places = [match.span() for match in re.finditer(rb"\$[{(][^})]*[})]", data)]
    if not places or rng.integers(6) == 0:
        name = (b"rod", b"again")[int(rng.integers(2))]
        call = b'<xacro:%s name="x" parent="y"><origin/></xacro:%s>' % (name, name)
        macro = b'<xacro:macro name="again" params="name parent *origin">' + 2 * call
        return data.replace(b"</robot>", macro + b"</xacro:macro>" + call + b"</robot>")
    first, last = places[int(rng.integers(len(places)))]
    word = (
        *(b"${9**9**9}", b"${10**10**8}", b"${'a' * 10**9}", b"${[0] * 10**8}", b"${1/0}"),
        *(b"${().__class__.__base__}", b"${__import__('os').system('touch hacked')}", b"${x}"),
        *(b"$(find nothing)", b"$(env HOME)", b"$(cwd)", b"$(eval 1 + 1)", b"$(arg none)", b"${"),
        *(b"${open('../canary.txt')}", b"${range(10**9)}", b"${max(range(10**9))}", b"${nan}"),
        *(b"${sum(x for x in range(10**9))}", b"${'%s' % ('x' * 10**8)}", b"${(lambda: 1)}"),
    )
    return data[:first] + word[int(rng.integers(len(word)))] + data[last:]


def keys(data: bytes, rng: Rng) -> bytes:
    """TOML keys of very many parts or letters, and texts that do not end."""
    long = (
        b"a" + b".a" * 50_000 + b" = 1\n",
        b"[" + b"a." * 5_000 + b"a]\n",
        b"a" * 100_000 + b" = 1\n",
        b"'a'" + b".'a'" * 5_000 + b" = 1\n",
        b'\\"' * 50_000,
        b'"""' + b'\\"' * 50_000,
    )[int(rng.integers(6))]
    return data + b"\n" + long if rng.integers(2) else long + data


def column(data: bytes, rng: Rng) -> bytes:
    """A column of a CSV in a unit that no machine has, such as a clock in 1e-12 s."""
    head, *rows = data.split(b"\n")
    k = int(rng.integers(0, min(2, head.count(b",")) + 1))
    scale = 10.0 ** float(rng.choice([-300, -100, -12, -9, 9, 12, 100, 300]))

    def scaled(row: bytes) -> bytes:
        cells = row.split(b",")
        if len(cells) > k:
            cells[k] = repr(float(cells[k]) * scale).encode()
        return b",".join(cells)

    return b"\n".join([head, *map(scaled, rows)])


def compressed(data: bytes, rng: Rng) -> bytes:
    """Damage inside a gzip file; or zeros that grow a thousandfold."""
    if rng.integers(8) == 0:
        return _bomb()
    inside = gzip.decompress(data)
    if len(inside) > 2**24:  # the bomb
        return data
    return gzip.compress(TEXT[int(rng.integers(len(TEXT)))](inside, rng), 1)


@cache
def _bomb() -> bytes:
    return gzip.compress(bytes(2**28))


def links(data: bytes, rng: Rng) -> bytes:
    """A URDF with a long chain of fixed or moving links, or names that end comments and cells."""
    if rng.integers(2):
        name = (b"a */ int x; /*", b"a | b", b"&lt;b&gt;", b"a??/", b"../x")[int(rng.integers(5))]
        found = re.findall(rb'name="([^"]+)"', data)
        return data.replace(b'"%s"' % found[int(rng.integers(len(found)))], b'"%s"' % name)
    count = int(rng.choice([60, 120, 600]))
    kind = (b"fixed", b"continuous")[int(rng.integers(2))]
    root = re.findall(rb'<link name="([^"]+)"', data)[-1]
    parents = [root, *(b"long%d" % k for k in range(count - 1))]
    chain = b"".join(
        b'<link name="long%d"/><joint name="more%d" type="%s"><parent link="%s"/>'
        b'<child link="long%d"/></joint>' % (k, k, kind, parent, k)
        for k, parent in enumerate(parents)
    )
    return data.replace(b"</robot>", chain + b"</robot>")


ANY: tuple[Mutator, ...] = (flip_bits, truncate, remove, splice, overwrite)
TEXT: tuple[Mutator, ...] = (*ANY, numbers, numbers, numbers, words, bare_words, lines, lines)
