"""Columns and arrays that the default convention does not read, where a signal is missing.

A log with qd1 … instead of dq1 … is read without velocities, which are then differentiated from
positions. What has the size of a signal is named, so that its title can be corrected.
"""

import re
from collections.abc import Iterable, Mapping

from runtime.recording.recipes.recipe import Recipe

_NUMBERED = re.compile(r"(.*?)\[?([0-9]{1,4})\]?")
"""Title that ends with the number of a joint."""
_SIGNALS = ("q", "dq", "ddq", "tau")
_WANTED = ("dq", "tau")
"""Signals whose absence is stated; accelerations are rarely measured."""
_SHOWN = 6
_NOT_READ = "are not read; if they are such a signal"


def unread_columns(titles: Iterable[str], name: str) -> tuple[str, ...]:
    """Sentence on numbered columns, one per joint, that are not read."""
    groups: dict[str, dict[int, str]] = {}
    for title in titles:
        if match := _NUMBERED.fullmatch(title):
            groups.setdefault(match[1], {})[int(match[2])] = title
    size = len(groups.get("q", {}))
    unread = [
        title
        for stem, group in groups.items()
        if stem not in _SIGNALS and sorted(group) in (list(range(size)), list(range(1, size + 1)))
        for title in group.values()
    ]
    return _sentence([key for key in _WANTED if key not in groups], "columns", unread, name)


def unread_arrays(
    shapes: Mapping[str, tuple[int, ...]], plan: Recipe, name: str
) -> tuple[str, ...]:
    """Sentence on arrays of the shape of q that are not read."""
    signals, law = plan.signals(), plan.of_law()
    time = () if plan.time is None else (plan.time,)
    taken = {part.key for part in (*signals.values(), *law.values(), *time)}
    # Of one joint (N,) and (N, 1) are the same.
    sizes = {key: shape if len(shape) > 1 else (*shape, 1) for key, shape in shapes.items()}
    size = sizes.get(signals["position"].key)
    unread = [key for key, each in sizes.items() if each == size and key not in taken]
    present = {"dq": "velocity" in signals, "tau": "torque" in signals or bool(law)}
    missing = [key for key in _WANTED if not present[key]]
    return _sentence(missing, "arrays", unread, name)


def states_unread(step: str) -> bool:
    """Whether a step of the history of a recording is such a sentence."""
    return _NOT_READ in step


def _sentence(missing: list[str], what: str, unread: list[str], name: str) -> tuple[str, ...]:
    if not missing or not unread:
        return ()
    more = f" and {len(unread) - _SHOWN} more" if len(unread) > _SHOWN else ""
    return (
        f"Warning: {name} has no {' and no '.join(missing)}, and its {what} "
        f"{', '.join(unread[:_SHOWN])}{more} {_NOT_READ}, rename them or "
        "describe them in a recipe.",
    )
