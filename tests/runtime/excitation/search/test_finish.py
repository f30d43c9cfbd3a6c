"""Repairs of a motion that exceeds nonlinear limits on the fine grid."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.excitation.search.design import SLOWER, repaired
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.single_start import Search
from runtime.library import Array, Library

SECONDS = 4.0


class Rows:
    """One limit: |a| < size, or |a| / duration < size."""

    def __init__(self, size: float, duration: float = 1.0) -> None:
        self._most = size * duration

    def worst(self, a: Array) -> float:
        return float(np.abs(a).max() / self._most - 1)

    def strongest(self, a: Array) -> list[str]:
        return [f"toy {len(a)}"]

    def by_constraint(self, a: Array) -> list[Array]:
        return [np.array([self.worst(a)])]


@pytest.mark.parametrize(
    ("excess", "least"), [(1.0, 1.0), (1.04, 0.92), (3.0, 0.9 / 3), (9.0, 0.9 / 9)]
)
def test_a_motion_shrinks_into_its_limits(
    double: Library, monkeypatch: pytest.MonkeyPatch, excess: float, least: float
) -> None:
    """Oracle: a limit that is exceeded by a factor and does not depend on time ends between 90 %
    and all of its size; the duration stays.
    """
    done, a = finish(double, monkeypatch, excess, False)
    scale = float(np.linalg.norm(done.trajectory.coefficients) / np.linalg.norm(a))
    assert least <= scale <= 1.0 / excess
    assert done.trajectory.duration == SECONDS
    assert done.use["toy"] <= 1


def test_a_motion_slows_down_before_it_shrinks_by_more(
    double: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: a limit of speed that is exceeded by 1.3 takes a duration 1.3 to 1.32 times as long;
    more than SLOWER allows, and a tenth of the motion beyond, is refused.
    """
    done, a = finish(double, monkeypatch, 1.3, True)
    np.testing.assert_array_equal(done.trajectory.coefficients, a)
    assert 1.3 <= done.trajectory.duration / SECONDS <= 1.3 * 1.01 + 1e-3 / SECONDS
    shrunk, _ = finish(double, monkeypatch, 2 * SLOWER[-1], True)
    assert shrunk.trajectory.duration == SECONDS
    with pytest.raises(IdentificationError, match="the limits of toy 2 and neither a smaller"):
        finish(double, monkeypatch, 11.0, False)


def finish(
    double: Library, monkeypatch: pytest.MonkeyPatch, excess: float, timed: bool
) -> tuple[Any, Array]:
    """A motion that exceeds a limit by a factor, repaired, and its coefficients before."""
    search = Search(double, DesignSettings(SECONDS, 3, criterion="cond"))
    a = 1e-3 * np.random.default_rng(0).normal(size=(2, search.guess(0).shape[1]))
    size = float(np.abs(a).max()) * (1 + 1e-3) / excess

    def rows(step: float, *, duration: float = SECONDS, share: float = 1.0) -> Rows:
        return Rows(size, duration / SECONDS if timed else 1.0)

    monkeypatch.setattr(search, "constraints", (SimpleNamespace(kind="toy"),))
    monkeypatch.setattr(search, "limit_rows", rows)
    return repaired(search, a), a
