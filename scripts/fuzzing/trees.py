"""Damage of JSON, TOML, YAML and XML documents as trees instead of bytes.

A value takes another type, a number becomes one that no machine has, a key goes, comes twice or is
one that Python or HTML would obey, a list grows, shrinks or nests, a branch is grafted elsewhere.
"""

import copy
import json
import tomllib
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np
import tomli_w
from hypothesis import strategies as st

from scripts.fuzzing.drawing import Draw, chance, pick

STRANGE: tuple[Any, ...] = (
    *(float("nan"), float("inf"), float("-inf"), 1e308, -1e308, 1e-320, 1e20, -0.0, 0, -1, 1, 7),
    *(2**31, 2**53 + 1, 2**64, -(2**63), 10**400, True, False, None, "", "1", "nan", "1e3", "\x00"),
    *("a" * 10_000, "../../../../../../etc/passwd", "/dev/zero", "..", "\u202eтест\U0001f916"),
    *("<script>alert(1)</script>", "{{ 7 * 7 }}", "[bold]x[/bold]", "[/x]", "%s%n"),
    *("{0.__class__}", [], {}, [[]], [1.0], [[1.0, 2.0], [3.0]], [None], ["a"], {"a": 1}),
    *({"__class__": "x"}, [0.0] * 1000, [[0.0] * 30] * 30, [float("nan")] * 7, [1e308] * 7),
    ["x"] * 7,
)
VALUES = st.one_of(
    *[st.sampled_from(STRANGE).map(copy.deepcopy)] * 3, st.floats(), st.integers(), st.text()
)


def damaged(draw: Draw, tree: Any) -> Any:
    """A copy of a tree of dicts, lists and values with one to four places changed."""
    tree = copy.deepcopy(tree)
    for _ in range(draw(st.integers(1, 4))):
        places = list(_places(tree))
        if not places:
            return draw(VALUES)
        owner, key = pick(draw, places)
        match draw(st.integers(0, 8)):
            case 0:
                del owner[key]
            case 1:
                other, there = pick(draw, places)
                if there in other or (isinstance(other, list) and there < len(other)):
                    owner[key] = copy.deepcopy(other[there])
            case 2 if isinstance(owner, dict):
                names = ("", "__class__", "x" * 5000, "../x", "nan", "<b>", f"{key} ", key.upper())
                owner[pick(draw, names)] = owner.pop(key)
            case 3:
                owner[key] = pick(draw, _resized(owner[key]))
            case 4:
                for _ in range(pick(draw, (1, 3, 90))):
                    owner[key] = [owner[key]]
            case _:
                owner[key] = draw(VALUES)
    return tree


def _places(tree: Any, most: int = 20_000) -> Iterator[tuple[Any, Any]]:
    """(owner, key) of everything in a tree; of long lists of numbers the first eight."""
    pending, counted = [tree], 0
    while pending and counted < most:
        node = pending.pop()
        if isinstance(node, dict | list):
            for key in list(node) if isinstance(node, dict) else range(min(len(node), 8)):
                counted += 1
                yield node, key
                pending.append(node[key])


def _resized(value: Any) -> tuple[Any, ...]:
    """What a value may become."""
    if isinstance(value, list):
        return value[:-1], value + value[-1:], value * 3, value[::-1]
    if isinstance(value, dict):
        return (list(value.values()),)
    if isinstance(value, int | float) and not isinstance(value, bool):
        whole = int(np.clip(value, -1e18, 1e18))
        return -value, value * 1e6, value * 1e-9, [value], str(value), whole
    return ([value, value],)


def json_tree(draw: Draw, data: bytes) -> bytes:
    """A JSON document, sometimes with a key that stands twice."""
    tree = json.loads(data)
    if chance(draw, 12):
        twice = json.dumps({pick(draw, tuple(tree)): draw(VALUES)})[:-1] + ", "
        return (twice + json.dumps(tree)[1:]).encode(errors="surrogatepass")
    return json.dumps(damaged(draw, tree)).encode(errors="surrogatepass")


def yaml_tree(draw: Draw, data: bytes) -> bytes:
    """A YAML document, written as JSON, which is YAML; or aliases that explode."""
    from ruamel.yaml import YAML

    if chance(draw, 8):
        bomb = (b"a%d: &a%d [*a%d, *a%d]\n" % (k, k, k - 1, k - 1) for k in range(1, 40))
        return b"a0: &a0 [x, x]\n" + b"".join(bomb) + data
    if b"&a" in data:
        return data
    tree = json.loads(json.dumps(YAML(typ="safe").load(data.decode())))
    return json.dumps(damaged(draw, tree)).encode(errors="surrogatepass")


def toml_tree(draw: Draw, data: bytes) -> bytes:
    """A TOML document; what TOML has no word for is left out."""
    if max(map(len, data.split(b"\n"))) > 5000:  # long keys, which the parser takes minutes for
        return data
    tree = _without_none(damaged(draw, tomllib.loads(data.decode())))
    return tomli_w.dumps(tree).encode(errors="replace")


def _without_none(tree: Any) -> Any:
    if isinstance(tree, dict):
        return {key: _without_none(value) for key, value in tree.items() if value is not None}
    if isinstance(tree, list):
        return [_without_none(value) for value in tree if value is not None]
    return tree


ATTRIBUTES = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e999", "1e-320", "0", "-1", "", " ", "1 2", "x"),
    *("0 0 0", "1 0 0", "1e200 0 0", "nan nan nan", "../../../../../etc/passwd", "/dev/zero", "."),
    *("fixed", "floating", "planar", "revolute", "mesh.stl", "package://../../x.stl", "\u202e"),
)


def xml_tree(draw: Draw, data: bytes) -> bytes:
    """An XML document: elements and attributes changed, removed, doubled, grafted, nested."""
    ElementTree.register_namespace("xacro", "http://www.ros.org/wiki/xacro")
    root = ElementTree.fromstring(data)  # noqa: S314  our own file, or what was made of it
    for _ in range(draw(st.integers(1, 4))):
        elements = list(root.iter())
        _changed(draw, pick(draw, elements), pick(draw, elements))
    return ElementTree.tostring(root)


def _changed(draw: Draw, node: Any, other: Any) -> None:
    """Change an element of a document, with the help of another one."""
    names, own, children = list(node.attrib), list(other.attrib.values()), list(node)
    match draw(st.integers(0, 9)):
        case 0 | 1 | 2 if names:
            node.set(pick(draw, names), pick(draw, ATTRIBUTES))
        case 3 if names and own:
            node.set(pick(draw, names), pick(draw, own))
        case 4 if names:
            del node.attrib[pick(draw, names)]
        case 5 if children:
            node.remove(pick(draw, children))
        case 6 if children:
            node.append(copy.deepcopy(pick(draw, children)))
        case 7:
            node.append(copy.deepcopy(other))
        case 8:
            node.tag = other.tag
        case 9:
            inner = copy.deepcopy(other)
            for _ in range(pick(draw, (2, 50, 400))):
                outer = ElementTree.Element(other.tag, dict(other.attrib))
                outer.append(inner)
                inner = outer
            node.append(inner)
