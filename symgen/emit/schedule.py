"""List scheduling of straight-line statements, to keep the processor's pipes full.

CasADi writes expressions depth first, which keeps few values alive. A recursion along a chain of
bodies is then limited by latency, since a processor looks ahead by less than one such body of code.
Where the longest chain of dependent statements takes more than half as long as issuing all of them,
the statements are ordered by height instead, as the scheduler of a compiler would.
"""

import re
from dataclasses import dataclass

LATENCY = 4
"""Cycles until the result of a multiplication or addition is available (current processors)."""
LONGER = {"vd_sincos(": 60, "vd_exp(": 60, "vd_sqrt(": 20, "1.0 / ": 13}
"""Cycles of statements that contain these texts; the functions are those of lanes.h."""
ISSUE = 2
"""Multiplications that start per cycle."""
ALIVE = 28
"""Live values above which a statement that frees registers goes first; AVX-512 has 32 registers."""


@dataclass(frozen=True, slots=True)
class Statement:
    """One line of C.

    Attributes:
        text: the line.
        defines: name that it defines, "" for a store.
        uses: names that it uses.
    """

    text: str
    defines: str
    uses: tuple[str, ...]


@dataclass(slots=True)
class _Node:
    """Statements that become one instruction: a sum, with the product that only the sum uses."""

    statements: list[Statement]
    needs: set[int]
    feeds: set[int]
    latency: int = LATENCY
    height: int = 0


def scheduled(statements: list[Statement]) -> list[Statement]:
    """Return the statements in an order that respects their dependences.

    The order is kept if the longest chain of dependent statements takes less than half of the time
    of issuing all of them.
    """
    nodes = _nodes(statements)
    for node in reversed(nodes):
        node.height = node.latency + max((nodes[k].height for k in node.feeds), default=0)
    if max((node.height for node in nodes), default=0) <= len(nodes) / ISSUE / 2:
        return statements
    return [statement for k in _by_height(nodes) for statement in nodes[k].statements]


def _nodes(statements: list[Statement]) -> list[_Node]:
    where = {s.defines: k for k, s in enumerate(statements) if s.defines}
    users: dict[str, int] = {}
    for statement in statements:
        for name in statement.uses:
            users[name] = users.get(name, 0) + 1
    # A product that only one sum uses is fused with it (multiply-add): both become one node.
    owner = list(range(len(statements)))
    for k, statement in enumerate(statements):
        if not _SUM.fullmatch(statement.text):
            continue
        products = [
            n for n in statement.uses if users[n] == 1 and _is_product(statements, where, n)
        ]
        if products:
            owner[where[products[-1]]] = k  # of two products a multiply-add takes one
    number = {k: i for i, k in enumerate(sorted(set(owner)))}
    nodes = [_Node([], set(), set()) for _ in number]
    for k, statement in enumerate(statements):
        node = nodes[number[owner[k]]]
        node.statements.append(statement)
        node.latency = max(node.latency, _latency(statement.text))
    for k, statement in enumerate(statements):
        here = number[owner[k]]
        for name in statement.uses:
            there = number[owner[where[name]]]
            if there != here:
                nodes[here].needs.add(there)
                nodes[there].feeds.add(here)
    return nodes


def _latency(text: str) -> int:
    return next((cycles for mark, cycles in LONGER.items() if mark in text), LATENCY)


def _is_product(statements: list[Statement], where: dict[str, int], name: str) -> bool:
    return _PRODUCT.fullmatch(statements[where[name]].text) is not None


def _by_height(nodes: list[_Node]) -> list[int]:
    """List scheduling on a model processor: the statement farthest from the end goes first."""
    waits = [len(node.needs) for node in nodes]
    unread = [len(node.feeds) for node in nodes]
    ready_at = [0] * len(nodes)
    # Change of the number of live values: its result, minus operands that it is the last to read.
    growth = [int(bool(node.feeds)) - sum(unread[m] == 1 for m in node.needs) for node in nodes]
    done = [False] * len(nodes)
    ready = {k for k, count in enumerate(waits) if count == 0}
    order: list[int] = []
    cycle = alive = 0
    while ready:  # one cycle per pass
        for _ in range(ISSUE):
            now = [k for k in ready if ready_at[k] <= cycle]
            if not now:
                break
            if alive < ALIVE:
                chosen = min(now, key=lambda k: (-nodes[k].height, k))
            else:
                chosen = min(now, key=lambda k: (growth[k], -nodes[k].height, k))
                if growth[chosen] > 0 and any(growth[k] <= 0 for k in ready):
                    break  # wait: a statement that frees a register becomes ready
            ready.remove(chosen)
            done[chosen] = True
            order.append(chosen)
            alive += growth[chosen]
            for m in nodes[chosen].needs:  # the remaining reader of an operand will free it
                unread[m] -= 1
                if unread[m] == 1:
                    growth[next(k for k in nodes[m].feeds if not done[k])] -= 1
            for m in nodes[chosen].feeds:  # available once all operands have passed the pipe
                waits[m] -= 1
                ready_at[m] = max(ready_at[m], cycle + nodes[chosen].latency)
                if waits[m] == 0:
                    ready.add(m)
        cycle += 1
    return order


_SUM = re.compile(r"const vd \w+ = \S+ [+-] \S+;")
_PRODUCT = re.compile(r"const vd \w+ = \S+ \* \S+;")
