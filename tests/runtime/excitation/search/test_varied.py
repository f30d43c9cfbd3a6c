"""Motions near good ones: kinds of variations, their limits, and what compares their ends."""

from typing import Any

import numpy as np
import pytest

from runtime.excitation.search import single_start
from runtime.excitation.search.criteria import RELATIVE, SHARE, sizes, unseen_torque
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import ConditionCost, information
from runtime.excitation.search.single_start import FAR_NOISE, Search, varied_far
from runtime.excitation.search.sqp import Descended
from runtime.library import Array, Library

JOINTS, SIZE = 5, 4


def problem(lib: Library, criterion: str = "mixed") -> DesignSettings:
    return DesignSettings(4.0, 3, criterion=criterion, information=information(lib, 0.05, 100.0))


def far(number: int) -> tuple[Array, Array]:
    """Parent and variation, (joints, functions)."""
    parent = np.random.default_rng(9).normal(size=(1, JOINTS * SIZE))
    x = varied_far(np.random.default_rng(number), parent, number, JOINTS)
    return parent.reshape(JOINTS, SIZE), x.reshape(JOINTS, SIZE)


def test_kinds_of_far_variations() -> None:
    """Property: of eight, seven have noise and one a mirrored joint."""
    kinds = []
    for number in range(8):
        parent, x = far(number)
        changed = (x != parent).all(axis=1)
        assert ((x == parent).all(axis=1) | changed).all()
        is_mirrored = np.array_equal(x[changed], -parent[changed])
        kinds.append((int(changed.sum()), bool(is_mirrored)))
    noise = (JOINTS, False)
    assert kinds == [*[noise] * 4, (1, True), *[noise] * 3]


def test_size_of_the_noise_far_from_a_parent() -> None:
    """Property: RMS within FAR_NOISE, 4 σ of the mean square of 20 normal numbers around it."""
    scatter = np.sqrt(1 + 4 * np.sqrt(2 / (JOINTS * SIZE)))
    for number in (0, 1, 2, 3, 5, 6, 7):
        parent, x = far(number)
        size = float(np.sqrt(np.square(x - parent).mean()))
        assert FAR_NOISE[0] / scatter < size < FAR_NOISE[1] * scatter


def test_a_joint_beyond_its_limits_leaves_the_others(
    double: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: the descent begins with that joint on its limit and the other one unchanged."""
    search = Search(double, problem(double))
    parent = 0.9 * search.start(0)[1]
    begun: list[Array] = []

    def begin(_objective: Any, x: Array, *_: Any, **__: Any) -> Descended:
        begun.append(x)
        return Descended(x, 0.0, 0, np.eye(len(x)))

    def far_beyond(_rng: Any, known: Array, *_: Any) -> Array:
        return known[0] * np.repeat([1.0, 7.0], known.shape[1] // 2)

    monkeypatch.setattr(single_start, "descend", begin)
    monkeypatch.setattr(single_start, "varied_far", far_beyond)
    _, a = search.variation(1, (parent,), 0.0)
    assert len(begun) == 1
    assert a[0] == pytest.approx(parent[0], rel=1e-9)  # rounding
    share = a[1] / parent[1]
    assert share == pytest.approx(share[0], rel=1e-9)
    use = max(float(values[1]) for values in search.limits.use(a).values())
    assert use == pytest.approx(1.0, abs=1e-9)


def test_ends_of_mixed_are_compared_by_cond_itself(double: Library) -> None:
    """Oracle: v, a and the cond that is printed, from their definitions."""
    search = Search(double, problem(double))
    a, known = search.guess(3), search.settings.information
    assert known is not None
    cost = ConditionCost(double, double.home, 3, 4.0, information=known)
    covariance: list[Array] = []

    def measure(gram: Array) -> tuple[float, Array]:
        covariance.append(np.linalg.inv(gram))
        return 0.0, 0 * gram

    cost.measure(a, measure)
    size = sizes(double, known)
    v = np.sqrt(np.trace(unseen_torque(double, double.home) @ covariance[0]))
    relative = np.sqrt(np.mean(np.diag(covariance[0]) / size**2))
    plain = ConditionCost(double, double.home, 3, 4.0).value_gradient(a)[0]
    wanted = (1 - RELATIVE) * np.log(v) + RELATIVE * np.log(relative) + SHARE * plain
    assert search.value(a) == pytest.approx(wanted, abs=1e-9)  # rounding × cond² of G
    other = Search(double, problem(double, "v"))
    assert other.value(a) == pytest.approx(np.log(v), abs=1e-9)
