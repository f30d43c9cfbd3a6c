"""Damage of JSON, TOML, YAML and XML documents as trees instead of bytes.

A value takes another type, a number becomes one that no machine has, a key goes, comes twice or is
one that Python or HTML would obey, a list grows, shrinks or nests, a branch is grafted elsewhere.
"""

import copy
import json
import tomllib
from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import numpy as np

Rng = np.random.Generator

STRANGE: tuple[Any, ...] = (
    *(float("nan"), float("inf"), float("-inf"), 1e308, -1e308, 1e-320, 1e20, -0.0, 0, -1, 1, 7),
    *(2**31, 2**53 + 1, 2**64, -(2**63), 10**400, True, False, None, "", "1", "nan", "1e3", "\x00"),
    *("a" * 10_000, "../../../../../../etc/passwd", "/dev/zero", "..", "\u202eтест\U0001f916"),
    *(
        "<script>alert(1)</script>",
        "{{ 7 * 7 }}",
        "[bold]x[/bold]",
        "[/x]",
        "%s%n",
        "{0.__class__}",
    ),
    *([], {}, [[]], [1.0], [[1.0, 2.0], [3.0]], [None], ["a"], {"a": 1}, {"__class__": "x"}),
    *([0.0] * 1000, [[0.0] * 30] * 30, [float("nan")] * 7, [1e308] * 7, ["x"] * 7),
)
DEEP = 2_000
"""Largest depth of nesting that a dumper writes; `mutators` nests deeper, as text."""


def damaged(tree: Any, rng: Rng) -> Any:
    """A copy of a tree of dicts, lists and values with one to four places changed."""
    tree = copy.deepcopy(tree)
    for _ in range(int(rng.integers(1, 5))):
        places = list(_places(tree))
        if not places:
            return _pick(STRANGE, rng)
        owner, key = places[int(rng.integers(len(places)))]
        kind = int(rng.integers(9))
        if kind <= 3:
            owner[key] = copy.deepcopy(_pick(STRANGE, rng))
        elif kind == 4:
            del owner[key]
        elif kind == 5:
            other, there = places[int(rng.integers(len(places)))]
            if there in other or (isinstance(other, list) and there < len(other)):
                owner[key] = copy.deepcopy(other[there])
        elif kind == 6:
            _rename(owner, key, rng)
        elif kind == 7:
            owner[key] = _resized(owner[key], rng)
        else:
            for _ in range(int(rng.choice([1, 3, 90]))):
                owner[key] = [owner[key]]
    return tree


def _places(tree: Any, most: int = 20_000) -> Any:
    """(owner, key) of everything in a tree; places near the root come as often as deep ones."""
    pending, counted = [tree], 0
    while pending and counted < most:
        node = pending.pop()
        keys = list(node) if isinstance(node, dict) else range(len(node))
        shallow = keys if isinstance(node, dict) else list(keys)[:8]  # long lists of numbers
        for key in shallow:
            counted += 1
            yield node, key
            if isinstance(node[key], dict | list) and node[key]:
                pending.append(node[key])


def _pick(values: tuple[Any, ...], rng: Rng) -> Any:
    return values[int(rng.integers(len(values)))]


def _rename(owner: Any, key: Any, rng: Rng) -> None:
    if isinstance(owner, dict):
        names = ("", "__class__", "x" * 5000, "../x", "nan", "<b>", f"{key} ", str(key).upper())
        owner[_pick(names, rng)] = owner.pop(key)


def _resized(value: Any, rng: Rng) -> Any:
    if isinstance(value, list):
        kind = int(rng.integers(4))
        return (value[:-1], value + value[-1:], value * 3, value[::-1])[kind]
    if isinstance(value, dict):
        return list(value.values())
    if isinstance(value, int | float) and not isinstance(value, bool):
        return _pick(
            (
                -value,
                value * 1e6,
                value * 1e-9,
                [value],
                str(value),
                int(np.clip(value, -1e18, 1e18)),
            ),
            rng,
        )
    return [value, value]


def json_tree(data: bytes, rng: Rng) -> bytes:
    """A JSON document, sometimes with a key that stands twice."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):  # damaged before
        return data
    if int(rng.integers(12)) == 0 and isinstance(tree, dict) and tree:
        key = _pick(tuple(tree), rng)
        twice = json.dumps({key: _pick(STRANGE, rng)})[:-1] + ", "
        return (twice + json.dumps(tree)[1:]).encode(errors="surrogatepass")
    return json.dumps(damaged(tree, rng)).encode(errors="surrogatepass")


def yaml_tree(data: bytes, rng: Rng) -> bytes:
    """A YAML document, written as JSON, which is YAML; or aliases that explode."""
    from ruamel.yaml import YAML

    if int(rng.integers(8)) == 0:
        bomb = b"a0: &a0 [x, x]\n"
        for k in range(1, 40):
            bomb += b"a%d: &a%d [*a%d, *a%d]\n" % (k, k, k - 1, k - 1)
        return bomb + data
    if b"&a" in data:
        return data
    try:
        tree = json.loads(json.dumps(YAML(typ="safe").load(data.decode())))
    except Exception:  # damaged before
        return data
    return json.dumps(damaged(tree, rng)).encode(errors="surrogatepass")


def toml_tree(data: bytes, rng: Rng) -> bytes:
    """A TOML document; what TOML has no word for is left out."""
    if max(map(len, data.split(b"\n"))) > 5000:  # long keys, which the parser takes minutes for
        return data
    try:
        tree = tomllib.loads(data.decode())
    except (ValueError, RecursionError):  # damaged before
        return data
    changed = damaged(tree, rng)
    if not isinstance(changed, dict):
        return data
    lines = [f"{json.dumps(str(k))} = {_toml(v)}" for k, v in changed.items() if v is not None]
    return "\n".join(lines).encode(errors="replace")


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        inner = (f"{json.dumps(str(k))} = {_toml(v)}" for k, v in value.items() if v is not None)
        return "{" + ", ".join(inner) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(each) for each in value if each is not None) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value).replace("\\ud83e\\udd16", "")
    return repr(value)


ATTRIBUTES = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e999", "1e-320", "0", "-1", "", " ", "1 2", "x"),
    *("0 0 0", "1 0 0", "1e200 0 0", "nan nan nan", "../../../../../etc/passwd", "/dev/zero", "."),
    *("fixed", "floating", "planar", "revolute", "mesh.stl", "package://../../x.stl", "\u202e"),
)


def xml_tree(data: bytes, rng: Rng) -> bytes:
    """An XML document: elements and attributes changed, removed, doubled, grafted, nested."""
    try:
        ElementTree.register_namespace("xacro", "http://www.ros.org/wiki/xacro")
        root = ElementTree.fromstring(data)  # noqa: S314  our own file, or what was made of it
    except (ElementTree.ParseError, ValueError):  # damaged before
        return data
    for _ in range(int(rng.integers(1, 5))):
        elements = list(root.iter())
        node = elements[int(rng.integers(len(elements)))]
        other = elements[int(rng.integers(len(elements)))]
        _XML[int(rng.integers(len(_XML)))](node, other, rng)
    try:
        return ElementTree.tostring(root)
    except (RecursionError, ValueError, TypeError):
        return data


def _attribute(node: Any, other: Any, rng: Rng) -> None:
    if node.attrib:
        node.set(_pick(tuple(node.attrib), rng), str(_pick(ATTRIBUTES, rng)))


def _foreign_attribute(node: Any, other: Any, rng: Rng) -> None:
    if node.attrib and other.attrib:
        node.set(_pick(tuple(node.attrib), rng), str(_pick(tuple(other.attrib.values()), rng)))


def _without(node: Any, other: Any, rng: Rng) -> None:
    if node.attrib:
        del node.attrib[_pick(tuple(node.attrib), rng)]


def _childless(node: Any, other: Any, rng: Rng) -> None:
    if len(node):
        node.remove(node[int(rng.integers(len(node)))])


def _doubled(node: Any, other: Any, rng: Rng) -> None:
    if len(node):
        node.append(copy.deepcopy(node[int(rng.integers(len(node)))]))


def _grafted(node: Any, other: Any, rng: Rng) -> None:
    node.append(copy.deepcopy(other))


def _renamed(node: Any, other: Any, rng: Rng) -> None:
    node.tag = other.tag


def _sunk(node: Any, other: Any, rng: Rng) -> None:
    inner = copy.deepcopy(other)
    for _ in range(int(rng.choice([2, 50, 400]))):
        outer = ElementTree.Element(other.tag, dict(other.attrib))
        outer.append(inner)
        inner = outer
    node.append(inner)


_XML: tuple[Callable[[Any, Any, Rng], None], ...] = (
    *(_attribute, _attribute, _attribute, _foreign_attribute, _without),
    *(_childless, _doubled, _grafted, _renamed, _sunk),
)
