"""Proxies and pairs as the TOML tables `[[proxy]]` and `[[pair]]`, read and written."""

from collections.abc import Iterable
from typing import Any

from symgen.collision.model import CollisionModel, Pair, Proxy
from symgen.errors import CollisionError

_PROXY = ("name", "link", "start", "end", "radius")
_PAIR = ("first", "second", "margin")


def collision_from_tables(proxies: Any, pairs: Any, where: str) -> CollisionModel:
    """Return the model of parsed tables."""
    for rows, keys, name in ((proxies, _PROXY, "proxy"), (pairs, _PAIR, "pair")):
        if not isinstance(rows, list) or not all(
            isinstance(row, dict) and set(row) == set(keys) for row in rows
        ):
            raise CollisionError(f"{where}: each [[{name}]] needs exactly {', '.join(keys)}")
    try:
        return CollisionModel(
            tuple(
                Proxy(
                    _text(r["name"]),
                    _text(r["link"]),
                    _point(r["start"]),
                    _point(r["end"]),
                    _number(r["radius"]),
                )
                for r in proxies
            ),
            tuple(Pair(_text(r["first"]), _text(r["second"]), _number(r["margin"])) for r in pairs),
        )
    except (TypeError, ValueError, OverflowError):
        raise CollisionError(
            f"{where}: in [[proxy]] and [[pair]] name, link, first and second are text, start and "
            "end three numbers, radius and margin one"
        ) from None


def tables_from_collision(model: CollisionModel) -> dict[str, list[dict[str, Any]]]:
    """The model as plain tables, JSON-ready."""
    return {
        "proxy": [
            {
                "name": p.name,
                "link": p.link,
                "start": list(p.start),
                "end": list(p.end),
                "radius": p.radius,
            }
            for p in model.proxies
        ],
        "pair": [{"first": p.first, "second": p.second, "margin": p.margin} for p in model.pairs],
    }


def toml_from_collision(model: CollisionModel) -> str:
    """The model as TOML text."""
    tables = tables_from_collision(model)
    lines: list[str] = []
    for name, rows in tables.items():
        for row in rows:
            lines += ["", f"[[{name}]]", *(f"{key} = {_written(v)}" for key, v in row.items())]
    return "\n".join(lines) + "\n"


def _written(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, Iterable):
        return "[" + ", ".join(map(_written, value)) + "]"
    return repr(float(value))


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value or '"' in value or "\\" in value:
        raise TypeError
    return value


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError
    return float(value)


def _point(value: Any) -> tuple[float, float, float]:
    x, y, z = map(_number, value)
    return x, y, z
