"""The order of statements: what must come first does, chains are broken up, the rest stays."""

from hypothesis import given
from hypothesis import strategies as st

from symgen.emit.ssa import Statement, scheduled


def chains(width: int, length: int) -> list[Statement]:
    """`width` independent chains of products, written one after the other, depth first."""
    lines = []
    for w in range(width):
        for k in range(length):
            name, before = f"t{w * length + k}", f"t{w * length + k - 1}" if k else "x[0]"
            uses = (before,) if k else ()
            lines.append(Statement(f"const vd {name} = {before} * x[1];", name, uses))
        lines.append(Statement(f"y[{w}] = {lines[-1].defines};", "", (lines[-1].defines,)))
    return lines


def respects_dependences(statements: list[Statement]) -> bool:
    """Every name is defined before it is used."""
    defined: set[str] = set()
    for statement in statements:
        if not defined.issuperset(statement.uses):
            return False
        defined.add(statement.defines)
    return True


@st.composite
def programs(draw: st.DrawFn) -> list[Statement]:
    """Straight-line code: sums, products and stores of earlier values, chains and fans."""
    lines: list[Statement] = []
    reach = draw(st.integers(1, 6))  # 1: everything waits for the line before
    for k in range(draw(st.integers(0, 150))):
        recent = [s.defines for s in lines if s.defines][-reach:]
        operands = [
            draw(st.sampled_from(recent)) if recent and draw(st.booleans()) else "x[0]"
            for _ in range(2)
        ]
        uses = tuple(dict.fromkeys(o for o in operands if o.startswith("t")))
        kind = draw(st.sampled_from(["+", "-", "*", "*", "/", "store"]))
        if kind == "store":
            lines.append(Statement(f"y[{k}] = {operands[0]};", "", uses[:1]))
            if operands[0] not in lines[-1].uses:
                lines[-1] = Statement(f"y[{k}] = x[0];", "", ())
        else:
            text = f"const vd t{k} = {operands[0]} {kind} {operands[1]};"
            lines.append(Statement(text, f"t{k}", uses))
    return lines


@given(programs())
def test_order_respects_dependences_and_loses_nothing(program: list[Statement]) -> None:
    """Property: a permutation in which every name is defined before its use; it always ends."""
    assert respects_dependences(program)
    order = scheduled(program)
    assert sorted(order, key=id) == sorted(program, key=id)
    assert respects_dependences(order)
    assert scheduled(program) == order


@given(st.integers(1, 40), st.integers(1, 60))
def test_chains_wider_than_the_registers_end(width: int, length: int) -> None:
    """Property: also where more values live than there are registers, every statement comes."""
    program = chains(width, length)
    order = scheduled(program)
    assert respects_dependences(order)
    assert sorted(order, key=id) == sorted(program, key=id)


def test_a_chain_is_listed_by_height() -> None:
    """Property: four chains of forty written one by one are worked off side by side."""
    program = chains(4, 40)
    order = scheduled(program)
    assert order != program
    starts = [k for k, s in enumerate(order) if not s.uses]
    assert max(starts) < 8  # all four are under way at once
    # Neighbours of one chain are a latency apart, as far as four chains can fill it.
    where = {s.defines: k for k, s in enumerate(order) if s.defines}
    gaps = [k - where[s.uses[0]] for k, s in enumerate(order) if s.uses and s.defines]
    assert min(gaps) >= 3


def test_what_does_not_wait_for_itself_is_left_alone() -> None:
    """Property: short chains beside each other stay in the order that keeps few values alive."""
    program = chains(40, 3)
    assert scheduled(program) is program
    assert scheduled([]) == []


def test_what_takes_long_is_begun_early() -> None:
    """Property: a root written behind forty products comes first, since others wait for it."""
    program = []
    for k in range(40):
        program.append(Statement(f"const vd t{k} = x[0] * x[{k}];", f"t{k}", ()))
        program.append(Statement(f"y[{k}] = t{k};", "", (f"t{k}",)))
    root = Statement("const vd t40 = vd_sqrt(x[0]);", "t40", ())
    program += [
        root,
        Statement("const vd t41 = t40 * x[1];", "t41", ("t40",)),
        Statement("y[40] = t41;", "", ("t41",)),
    ]
    assert scheduled(program)[0] == root
