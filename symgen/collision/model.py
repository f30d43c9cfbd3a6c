"""Capsules fixed in a link, pairs of them that must keep a distance, and their TOML tables.

The tables are written here, not by tomli-w, which writes one coordinate per line.
"""

import math
import operator
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, to_builtins

from runtime.common.files import toml_value
from runtime.common.records import Record, Vector3
from symgen.errors import CollisionError

BASE = "base"  # name of the fixed base in proxies, whatever the base link is called
MARGIN = 0.02  # distance that two proxies keep where there is room for it, m
Word = Annotated[
    str, Meta(pattern=r'\A[^"\\]+\Z', description="a text without quotes and backslashes")
]


class Proxy(Record, frozen=True, kw_only=False):
    """All points within `radius` of the segment from `start` to `end`; a sphere if these agree."""

    name: Word  # unique
    link: Word  # moving link that carries it, or `BASE`
    start: Vector3  # start, end: m, in the frame of that link (of its joint), or of the base link
    end: Vector3
    radius: float  # m

    @property
    def length(self) -> float:
        """|end − start|, m; generated code contains it: no BLAS, whose digits differ by core."""
        return math.sqrt(sum(d * d for d in map(operator.sub, self.end, self.start)))


class Pair(Record, frozen=True, kw_only=False):
    """Two proxies by name and the distance that they must keep, m."""

    first: Word
    second: Word
    margin: float


@dataclass(frozen=True, slots=True)
class CollisionModel:
    """Proxies of a robot and the pairs of them that a motion must keep apart."""

    proxies: tuple[Proxy, ...] = ()
    pairs: tuple[Pair, ...] = ()

    def __post_init__(self) -> None:
        names: set[str] = set()
        for proxy in self.proxies:
            if proxy.name in names:
                raise CollisionError(f"two proxies are called '{proxy.name}'; names must be unique")
            names.add(proxy.name)
            numbers = (*proxy.start, *proxy.end, proxy.radius)
            if not np.isfinite(numbers).all() or proxy.radius <= 0:
                raise CollisionError(
                    f"proxy '{proxy.name}' needs finite ends and a radius above 0 m, got "
                    f"{numbers[:3]}, {numbers[3:6]} and {proxy.radius:g}"
                )
        for pair in self.pairs:
            for name in (pair.first, pair.second):
                if name not in names:
                    raise CollisionError(
                        f"a pair names the proxy '{name}', which does not exist; "
                        f"proxies are {', '.join(sorted(names)) or 'none'}"
                    )
            if pair.first == pair.second or not np.isfinite(pair.margin):
                raise CollisionError(
                    f"the pair '{pair.first}' and '{pair.second}' needs two proxies and a finite "
                    f"margin in m, got {pair.margin:g}"
                )

    def joint_of(self, proxy: Proxy, links: list[str]) -> int:
        """Index of the moving link that carries a proxy, −1 for the base."""
        if proxy.link == BASE:
            return -1
        if proxy.link not in links:
            raise CollisionError(
                f"proxy '{proxy.name}' lies on the link '{proxy.link}', which does not move in "
                f"this robot; its moving links are {', '.join(links)}, the fixed one is '{BASE}'"
            )
        return links.index(proxy.link)

    def named(self, name: str) -> Proxy:
        """Return the proxy of this name."""
        return next(proxy for proxy in self.proxies if proxy.name == name)


def tables_from_collision(model: CollisionModel) -> dict[str, list[dict[str, Any]]]:
    """The model as plain tables, JSON-ready."""
    return {"proxy": to_builtins(model.proxies), "pair": to_builtins(model.pairs)}


def toml_from_collision(model: CollisionModel) -> str:
    """The model as TOML text."""
    tables = tables_from_collision(model)
    lines: list[str] = []
    for name, rows in tables.items():
        for row in rows:
            lines += ["", f"[[{name}]]", *(f"{key} = {toml_value(v)}" for key, v in row.items())]
    return "\n".join(lines) + "\n"
