"""Long straight-line bodies as several C functions, so that compiling them takes linear time.

The statements keep their order. A value that a later part needs is stored in `w`, whose places are
used again once the last part that needs a value has passed.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

LONG = 2400
"""Statements above which a body is split; arms of seven joints stay whole."""
PART = 600
"""Statements of a part: compilers take about as long per statement as in short functions."""


@dataclass(frozen=True, slots=True)
class Parts:
    """A split body.

    Attributes:
        bodies: statements of the parts, in the order of their calls.
        stored: length of `w`.
    """

    bodies: list[list[str]]
    stored: int


def parts_of(lines: Sequence[str], size: int = PART) -> Parts:
    """Split statements `const double tK = …;` and `output[i] = …;`."""
    chunks = [list(lines[k : k + size]) for k in range(0, len(lines), size)]
    defined: dict[str, int] = {}
    last: dict[str, int] = {}
    for k, chunk in enumerate(chunks):
        for line in chunk:
            target = _DEFINED.match(line)
            for name in _VALUE.findall(line[target.end() :] if target else line):
                last[name] = k
            if target:
                defined[target[1]] = k
    places: dict[str, int] = {}
    free: list[int] = []
    stored = 0
    bodies = []
    for k, chunk in enumerate(chunks):
        known = dict(places)

        def placed(match: re.Match[str], known: dict[str, int] = known) -> str:
            name = match[0]
            return f"w[{known[name]}]" if name in known else name

        body = []
        for line in chunk:
            body.append(_VALUE.sub(placed, line))
            target = _DEFINED.match(line)
            if target and last.get(target[1], k) > k:
                if not free:
                    free, stored = [stored], stored + 1
                places[target[1]] = free.pop()
                body.append(f"w[{places[target[1]]}] = {target[1]};")
        bodies.append(body)
        for name in [name for name in places if last[name] <= k]:
            free.append(places.pop(name))
    return Parts(bodies, stored)


_DEFINED = re.compile(r"const double (t\d+) = ")
_VALUE = re.compile(r"\bt\d+\b")
