"""Rows of K in β = K π as text."""

ROUNDING = 1e-9
"""Share of the largest coefficient up to which one is rounding: K of closed loops solves a
least-squares problem, in which zeros come out as up to 3e-10."""


def describe_combination(names: list[str], row: list[float]) -> str:
    """Return one row of K as text: `link1.ZZ + link2.YY - 0.3 link3.m`."""
    least = ROUNDING * max(map(abs, row), default=0.0)
    terms = [(x, name) for x, name in zip(row, names, strict=True) if abs(x) > least]
    terms.sort(key=lambda term: term[0] != 1.0)
    text = " ".join(
        f"{'-' if x < 0 else '+'} {'' if abs(x) == 1 else f'{abs(x):.6g} '}{name}"
        for x, name in terms
    )
    return text.removeprefix("+ ")
