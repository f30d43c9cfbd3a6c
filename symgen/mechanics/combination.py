"""Rows of K in β = K π as text, without CasADi: commands that only read a manifest need them."""

_LEAST_SHARE = 1e-9
"""Coefficient of K, relative to the largest of its row, up to which it is rounding error.

K of closed loops solves a least-squares problem, in which zeros come out as up to 3e-10.
"""


def describe_combination(names: list[str], row: list[float]) -> str:
    """Return a row of K in β = K π as text: `link1.ZZ + link2.YY - 0.3 link3.m`."""
    least = _LEAST_SHARE * max(map(abs, row), default=0.0)
    terms = [(x, name) for x, name in zip(row, names, strict=True) if abs(x) > least]
    terms.sort(key=lambda term: term[0] != 1.0)
    text = " ".join(
        f"{'-' if x < 0 else '+'} {'' if abs(x) == 1 else f'{abs(x):.6g} '}{name}"
        for x, name in terms
    )
    return text.removeprefix("+ ")
