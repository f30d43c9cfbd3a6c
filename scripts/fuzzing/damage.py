"""Damaged files drawn by hypothesis: bytes, numbers, words and lines; kinds by suffix of a file."""

import gzip
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from scripts.fuzzing import archives, bags
from scripts.fuzzing.drawing import Draw, Mutator, chance, pick, pieces, replaced
from scripts.fuzzing.trees import json_tree, toml_tree, xml_tree, yaml_tree

CANARY = "canary.txt"  # file beside the folder of the damaged files that no reader may open
PLACES = ("nothing", "folder", "pipe", "device", "itself", "nowhere", "empty")
"""What may stand in the place of a file."""
SHARE = 50  # one of so many files is something else in the place of a file
BATCH = 10
"""Files that are drawn together, before the first of them is read; what is read decides nothing."""
WORDS = (
    *(b"../../../../../../etc/passwd", b"/dev/zero", b"/dev/stdin", b"../" + CANARY.encode()),
    *(b"", b".", b"..", b"\x00", b"a" * 100_000, b"{run}", b"{0.__class__}", b"%s%n", b"__class__"),
    *("\u202e\ud7ff".encode(), b"\xff\xfe", b"$(touch hacked)", b"`touch hacked`", b"-rf", b"nan"),
)
DEPTH = 20_000

words = replaced(rb"(?<=\")[^\"\n]*(?=\")", WORDS)
bare_words = replaced(rb"[A-Za-z_]+\d*", (*WORDS, b"t", b"q1", b"mass", b"kernels", b"link"))


def lines(draw: Draw, data: bytes) -> bytes:
    """A line removed, doubled, or exchanged with another."""
    rows = data.split(b"\n")
    i, j = draw(st.tuples(*[st.integers(0, len(rows) - 1)] * 2))
    match draw(st.integers(0, 2)):
        case 0:
            del rows[i]
        case 1:
            rows.insert(j, rows[i])
        case _:
            rows[i], rows[j] = rows[j], rows[i]
    return b"\n".join(rows)


def nested(*brackets: tuple[bytes, bytes]) -> Mutator:
    """A number, or the whole document, inside very many brackets of one of these kinds."""

    def mutate(draw: Draw, data: bytes) -> bytes:
        opened, closed = (DEPTH * each for each in pick(draw, brackets))
        matches = list(re.finditer(rb"-?\d+(?:\.\d+)?", data))
        if not matches or draw(st.booleans()):
            return opened + data + closed if matches else opened
        first, last = pick(draw, matches).span()
        return data[:first] + opened + data[first:last] + closed + data[last:]

    return mutate


def entities(draw: Draw, data: bytes) -> bytes:
    """Entities that explode, or that name a file."""
    bomb = b"".join(b'<!ENTITY e%d "%s">' % (i, b"&e%d;" % (i - 1) * 10) for i in range(1, 12))
    outside = b'<!ENTITY e11 SYSTEM "file:../' + CANARY.encode() + b'">'
    doctype = b'<!DOCTYPE robot [<!ENTITY e0 "x">' + pick(draw, (outside, bomb)) + b"]>"
    return doctype + data.partition(b"?>")[2].replace(b'name="', b'name="&e11;', 1)


EXPRESSIONS = (
    *(b"${9**9**9}", b"${10**10**8}", b"${'a' * 10**9}", b"${[0] * 10**8}", b"${1/0}"),
    *(b"${().__class__.__base__}", b"${__import__('os').system('touch hacked')}", b"${x}"),
    *(b"$(find nothing)", b"$(env HOME)", b"$(cwd)", b"$(eval 1 + 1)", b"$(arg none)", b"${"),
    *(b"${open('../canary.txt')}", b"${range(10**9)}", b"${max(range(10**9))}", b"${nan}"),
    *(b"${sum(x for x in range(10**9))}", b"${'%s' % ('x' * 10**8)}", b"${(lambda: 1)}"),
)


def expressions(draw: Draw, data: bytes) -> bytes:
    """Expressions of xacro that compute for long, call Python, or expand without end."""
    if chance(draw, 6) or not re.search(rb"\$[{(]", data):
        name = pick(draw, (b"rod", b"again"))
        call = b'<xacro:%s name="x" parent="y"><origin/></xacro:%s>' % (name, name)
        macro = b'<xacro:macro name="again" params="name parent *origin">' + 2 * call
        return data.replace(b"</robot>", macro + b"</xacro:macro>" + call + b"</robot>")
    return replaced(rb"\$[{(][^})]*[})]", EXPRESSIONS)(draw, data)


KEYS = (
    *(b"a" + b".a" * 50_000 + b" = 1\n", b"[" + b"a." * 5_000 + b"a]\n"),
    *(b"a" * 100_000 + b" = 1\n", b"'a'" + b".'a'" * 5_000 + b" = 1\n"),
    *(b'\\"' * 50_000, b'"""' + b'\\"' * 50_000),
)


def keys(draw: Draw, data: bytes) -> bytes:
    """TOML keys of very many parts or letters, and texts that do not end."""
    long = pick(draw, KEYS)
    return data + b"\n" + long if draw(st.booleans()) else long + data


def column(draw: Draw, data: bytes) -> bytes:
    """A column of a CSV in a unit that no machine has, such as a clock in 1e-12 s."""
    head, *rows = data.split(b"\n")
    k = draw(st.integers(0, min(2, head.count(b","))))
    scale = 10.0 ** pick(draw, (-300, -100, -12, -9, 9, 12, 100, 300))

    def scaled(row: bytes) -> bytes:
        cells = row.split(b",")
        if len(cells) > k:
            cells[k] = repr(float(cells[k]) * scale).encode()
        return b",".join(cells)

    return b"\n".join([head, *map(scaled, rows)])


def compressed(draw: Draw, data: bytes) -> bytes:
    """Damage inside a gzip file; or zeros that grow a thousandfold."""
    if chance(draw, 8):
        return _bomb()
    inside = gzip.decompress(data)
    if len(inside) > 2**24:  # the bomb
        return data
    return gzip.compress(pick(draw, TEXT)(draw, inside), 1)


@cache
def _bomb() -> bytes:
    return gzip.compress(bytes(2**28))


NAMES = (b"a */ int x; /*", b"a | b", b"&lt;b&gt;", b"a??/", b"../x")


def links(draw: Draw, data: bytes) -> bytes:
    """A URDF with a long chain of fixed or moving links, or names that end comments and cells."""
    if draw(st.booleans()):
        name = pick(draw, re.findall(rb'name="([^"]+)"', data))
        return data.replace(b'"%s"' % name, b'"%s"' % pick(draw, NAMES))
    count, kind = pick(draw, (60, 120, 600)), pick(draw, (b"fixed", b"continuous"))
    root = re.findall(rb'<link name="([^"]+)"', data)[-1]
    parents = [root, *(b"long%d" % k for k in range(count - 1))]
    chain = b"".join(
        b'<link name="long%d"/><joint name="more%d" type="%s"><parent link="%s"/>'
        b'<child link="long%d"/></joint>' % (k, k, kind, parent, k)
        for k, parent in enumerate(parents)
    )
    return data.replace(b"</robot>", chain + b"</robot>")


ANY: tuple[Mutator, ...] = (pieces,) * 5
TEXT: tuple[Mutator, ...] = (*ANY, *[archives.numbers] * 3, words, bare_words, lines, lines)

_JSON: tuple[Mutator, ...] = (*TEXT, nested((b"[", b"]"), (b'{"a":', b"}")), *[json_tree] * 12)
_TAGS = [(b"<%s>" % tag, b"</%s>" % tag) for tag in (b"link", b"body", b"geom", b"visual")]
_XML: tuple[Mutator, ...] = (*TEXT, nested(*_TAGS), entities, entities, *[xml_tree] * 12)
OF_SUFFIX: dict[str, tuple[Mutator, ...]] = {
    ".csv": (*TEXT, column, column),
    ".csv.gz": (*ANY, *[compressed] * 7),
    ".toml": (*TEXT, nested((b"[", b"]"), (b"{a=", b"}")), keys, keys, *[toml_tree] * 12),
    ".json": _JSON,
    ".yaml": (*TEXT, *[yaml_tree] * 12),
    ".urdf": (*_XML, links, links),
    ".xml": _XML,
    ".xacro": (*_XML, expressions, expressions, expressions),
    ".npz": (*ANY, *[archives.npz_parts] * 7),
    ".parquet": (*ANY, *[archives.parquet_columns] * 7),
    ".h5": (*ANY, *[archives.hdf5_parts] * 7),
    ".mat": (*ANY, *[archives.hdf5_parts] * 7),
    ".mcap": (*ANY, *[bags.remade_mcap("json", json_tree)] * 7),
    ".cdr.mcap": (*ANY, *[bags.remade_mcap("cdr", pieces)] * 7),
    ".bag": (*ANY, *[bags.remade_ros1(pieces)] * 7),
    ".db3": (*ANY, *[bags.remade_database] * 7),
    ".zstd": (*ANY, bags.zstd_bomb),
}
Damaged = bytes | str
"""What stands in the place of a file; a string of `PLACES` says that it is no file."""


@st.composite
def damaged(draw: Draw, data: bytes, file: str) -> Damaged:
    """One to three mutators of the file's kind, one after the other; never the file itself."""
    if chance(draw, SHARE):
        return str(pick(draw, PLACES))
    suffixes = sorted(OF_SUFFIX, key=len, reverse=True)
    choice = next((OF_SUFFIX[s] for s in suffixes if file.endswith(s)), ANY)
    out = data
    for _ in range(pick(draw, (1, 1, 2, 3))):
        with suppress(Exception):  # a mutator that cannot read what another has made leaves it
            out = pick(draw, choice)(draw, out)
    return out if out != data else pieces(draw, data) or b"\0"


def drawn(
    data: bytes, file: str, key: tuple[object, ...], first: int, count: int
) -> Iterator[Damaged]:
    """Damaged files by index; the same key, of seed and kind, and index give the same file."""
    for batch in range(first // BATCH, -(-(first + count) // BATCH)):
        start = batch * BATCH
        some = _batch(data, file, (*key, batch), first + count - start)
        yield from some[max(first - start, 0) :]


class _Enough(Exception):
    """The rest of a batch is not needed."""


def _batch(data: bytes, file: str, key: tuple[object, ...], count: int) -> list[Damaged]:
    """The first files of a batch, at most `count`."""
    files: list[Damaged] = []

    @seed(repr(key))
    @settings(
        max_examples=BATCH + 2,
        phases=[Phase.generate],
        database=None,
        deadline=None,
        report_multiple_bugs=False,
        suppress_health_check=list(HealthCheck),
    )
    @given(damaged(data, file))
    def draw_all(one: Damaged) -> None:
        files.append(one)
        if len(files) >= 2 + count:
            raise _Enough

    with suppress(_Enough):
        draw_all()
    return files[2 : 2 + min(count, BATCH)]  # the first ones have the simplest choice everywhere
