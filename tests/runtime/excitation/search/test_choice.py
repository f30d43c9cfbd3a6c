"""The order in which ended starts are tried."""

from dataclasses import dataclass

import numpy as np
import pytest

from runtime.excitation.search.criteria import LAST_SHARE, LAST_SMOOTH
from runtime.excitation.search.design import NEARLY, in_order
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import information
from runtime.excitation.search.single_start import Search
from runtime.library import Array, Library


@dataclass(frozen=True)
class Logs:
    """A search whose starts are their own logs of v, a and cond."""

    weights: Array

    def balanced(self, a: Array) -> Array:
        return a

    def order(self, *starts: Array) -> list[Array]:
        return in_order(self, [(float(self.weights @ a), a) for a in starts])  # type: ignore[arg-type]


EQUAL = Logs(np.ones(3) / 3)


def same(order: list[Array], *starts: Array) -> bool:
    return len(order) == len(starts) and all(map(np.array_equal, order, starts))


def test_the_most_balanced_of_nearly_equal_starts_comes_first() -> None:
    """Property: a start that is bad in v alone gives way, unless it is better by NEARLY."""
    lopsided, even = np.array([0.06, -0.03, -0.033]), np.array([0.0, 0.0, 0.0])
    far = even + 2 * NEARLY
    assert same(EQUAL.order(lopsided, far, even), even, lopsided, far)
    better = lopsided - 2 * NEARLY
    assert same(EQUAL.order(even, better), better, even)
    assert in_order(EQUAL, []) == []  # type: ignore[arg-type]


def test_a_start_that_is_better_in_everything_comes_first() -> None:
    """Property: of random starts within NEARLY none is before one that is better in all three."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        starts = NEARLY / 4 * rng.uniform(-1, 1, size=(20, 3))
        order = EQUAL.order(*starts)
        first = order[0]
        assert not any((other < first).all() for other in order[1:])
        assert sorted(map(tuple, order)) == sorted(map(tuple, starts))


@pytest.mark.parametrize("criterion", ["mixed", "v", "cond"])
def test_quantities_of_a_goal(double: Library, criterion: str) -> None:
    """Property: mixed is the weighted sum of what it balances; others have their target alone."""
    known = information(double, 0.05, 100.0)
    search = Search(double, DesignSettings(4.0, 3, criterion=criterion, information=known))
    a = search.guess(1)
    logs = search.balanced(a)
    weights = [0.8, 0.2, 0.8] if criterion == "mixed" else [1.0]
    assert float(np.dot(weights, logs)) == pytest.approx(search.value(a), abs=1e-12)  # rounding
    others = [(search.value(search.guess(k)), search.guess(k)) for k in range(4)]
    if criterion != "mixed":
        by_target = [a for _, a in sorted(others, key=lambda one: one[0])]
        assert same(in_order(search, others), *by_target)


def test_the_last_descent_weighs_cond_more(
    double: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: errors and a Schatten norm from eigenvalues; only `refined` minimises it."""
    known = information(double, 0.05, 100.0)
    search = Search(double, DesignSettings(4.0, 3, criterion="mixed", information=known))
    assert search.goal.last is not None
    assert search.goal.errors is not None
    rows = np.random.default_rng(2).normal(size=(60, len(double.base_columns)))
    gram = rows.T @ rows
    size = np.sqrt(np.diag(gram))
    power, values = LAST_SMOOTH, np.linalg.eigvalsh(gram / np.outer(size, size))
    norms = np.log(np.sum(values**power)) + np.log(np.sum(values**-power))
    wanted = search.goal.errors(gram)[0] + LAST_SHARE * norms / (2 * power)
    assert search.goal.last(gram)[0] == pytest.approx(wanted, rel=1e-9)  # rounding × cond
    measures: list[object] = []
    objective = Search._objective
    monkeypatch.setattr(Search, "_objective", lambda s, m: measures.append(m) or objective(s, m))
    search.refined(search.start(0)[1])
    assert measures[-1] is search.goal.last
    assert search.goal.last not in measures[:-1]
