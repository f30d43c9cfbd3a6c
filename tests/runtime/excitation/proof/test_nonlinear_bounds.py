"""bounds: what is not linear in the motion, between samples too."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import LimitRows, Limits, constraints, inside
from runtime.excitation.limits.nonlinear_limits import Constraint, SampledMotion
from runtime.excitation.limits.safety import CARRIED, UNCHECKED, Safety
from runtime.excitation.motion.trajectory import COSINE, basis_of
from runtime.excitation.proof.bounds import constraint_bounds, joint_bounds
from runtime.excitation.proof.certificate import certificate_of
from runtime.library import Library

EVERYTHING = Safety(table=0.0, box=(0.2, 0.8, -0.6, 0.6, 0.2, 1.0), viscous=(2.0,))
KINDS = ("braking", "torque", "torque rate", "tip box", "tip speed", "self-collision", "table")


def brute(
    constraint: Constraint, trajectory: Trajectory, lib: Library, times: np.ndarray
) -> np.ndarray:
    """Largest g per row at these times, (R,)."""
    phi = trajectory.basis.at(lib, trajectory.coefficients.shape[1], times, trajectory.duration)
    rows = LimitRows([constraint], trajectory.home, phi, half=False)
    return rows.by_constraint(trajectory.coefficients)[0].max(axis=1)


def fast_motion(lib: Library, size: float = 4e-3) -> Trajectory:
    rng = np.random.default_rng(11)
    return Trajectory(lib.home, size * rng.normal(size=(7, 8)), 2.0)


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_are_above_and_close(lib: Library, kind: str) -> None:
    """Oracle: 20 000 samples of a fast motion: above them, by what a millisecond bends at most."""
    motion = fast_motion(lib)
    constraint = next(x for x in constraints(lib, lib.home, EVERYTHING) if x.kind == kind)
    result = constraint_bounds(lib, [constraint], motion)
    assert kind != "braking" or constraint.measured(0, -1.0)[0] == 0.0  # of the room, none is used
    bounds = np.array([bound.bound for bound in result])
    largest = brute(constraint, motion, lib, np.linspace(0, 2, 20_001))
    assert (bounds >= largest - 1e-13).all()  # rounding of two evaluations of the basis
    # δ²/8 g'' with δ = 1 ms and (2π 8 / 2 s)² = 630/s² of the fastest wave, times 2 and its
    # squares in products of speeds.
    assert (bounds - largest).max() < 2e-3
    assert all(bound.is_proven and bound.intervals > 0 for bound in result)
    for bound, row in zip(result, range(len(result)), strict=True):
        at = brute(constraint, motion, lib, np.array([bound.time]))[row]
        assert at == pytest.approx(largest[row], abs=2e-3)  # half a step from there, as above


@pytest.mark.parametrize("kind", KINDS[1:])
def test_rates_are_those_of_the_slopes(lib: Library, kind: str) -> None:
    """Oracle: the chain rule with the slopes that a design descends along, and their values."""
    constraint = next(x for x in constraints(lib, lib.home, EVERYTHING) if x.kind == kind)
    basis, motion = COSINE.derivatives(5, 8, np.linspace(0.1, 0.9, 17)), fast_motion(lib)
    states = basis @ motion.coefficients.T / np.power(2.0, np.arange(5))[:, None, None]
    states[0] += lib.home
    g, rate = constraint.along(SampledMotion(lib, states))
    assert np.abs(g - constraint.values(states[:4])).max() < 1e-13  # two orders of the same sums
    chain = np.einsum(
        "nrdj,dnj->nr", constraint.slopes(states[:4]), states[1 : constraint.orders + 1]
    )
    assert np.abs(rate - chain).max() < 1e-12 * np.abs(chain).max()  # as before, of sums of 28


@pytest.mark.parametrize("basis", ["cosine", "fourier", "bspline"])
def test_long_intervals_lose_nothing(
    lib: Library, monkeypatch: pytest.MonkeyPatch, basis: str
) -> None:
    """Property: the bounds and times of all short intervals, for motions that touch limits."""
    chosen = basis_of(basis)
    size = chosen.size(4)
    a = np.random.default_rng(3).normal(size=(7, size))
    a[2] = 0  # rests: every interval is the largest one
    a = inside(Limits(lib, lib.home, size, 3.0, basis=chosen), a)
    motion = Trajectory(lib.home, a, 3.0, chosen)
    braking = constraints(lib, lib.home, Safety())[:1]

    def everything() -> np.ndarray:
        # Joint by joint: long intervals of all rows are divided together.
        motions = [replace(motion, coefficients=a * row[:, None]) for row in np.eye(7)]
        result = [bound for one in motions for bound in constraint_bounds(lib, braking, one)]
        rows = np.array([(bound.bound, bound.time) for bound in result]).T
        return np.hstack([rows, np.reshape(joint_bounds(lib, motion), (2, -1))])

    usual, result = everything(), []
    for braking_divided, divided in ((1, 1), (300, 3000)):  # few and very long ones
        monkeypatch.setattr("runtime.excitation.proof.bounds._DIVIDED", braking_divided)
        monkeypatch.setattr("runtime.excitation.proof.bounds.DIVIDED", divided)
        result.append(everything())
    for other in result:
        assert usual == pytest.approx(other, rel=1e-13)  # the rounding of s


@pytest.mark.parametrize("kind", KINDS)
def test_a_violation_between_samples_is_caught(lib: Library, kind: str) -> None:
    """Adversary: g < 0 at every sample of a 1 kHz grid, above 0 somewhere between two of them."""
    motion = fast_motion(lib)
    constraint = next(x for x in constraints(lib, lib.home, EVERYTHING) if x.kind == kind)
    grid, fine = np.linspace(0, 2, 2001), np.linspace(0, 2, 60_001)
    seen, true = brute(constraint, motion, lib, grid), brute(constraint, motion, lib, fine)
    between = true - seen
    row = int(np.argmax(between))
    assert between[row] > 1e-9, "the test's own motion must peak between samples"
    raised = _Raised(constraint, float(seen[row] + true[row]) / 2)
    assert brute(raised, motion, lib, grid)[row] < 0
    assert brute(raised, motion, lib, fine)[row] > 0
    bound = _bound_of(lib, raised, motion, row)
    assert bound > 0


class _Raised:
    """The same constraint with another limit: g − level."""

    def __init__(self, constraint: Constraint, level: float) -> None:
        self._law, self._level = constraint, level

    def __getattr__(self, name: str) -> object:
        return getattr(self._law, name)

    def values(self, motion: np.ndarray) -> np.ndarray:
        return self._law.values(motion) - self._level

    def along(self, sampled: SampledMotion) -> tuple[np.ndarray, np.ndarray]:
        g, slope = self._law.along(sampled)
        return g - self._level, slope


def _bound_of(lib: Library, raised: _Raised, motion: Trajectory, row: int) -> float:
    if raised.kind == "braking":  # the proof asks for the class
        return constraint_bounds(lib, [raised._law], motion)[row].bound - raised._level
    return constraint_bounds(lib, [raised], motion)[row].bound


def test_what_is_no_number_never_holds(lib: Library) -> None:
    """Property: NaN and infinite motions break every limit; a home without room, braking."""
    for value in (np.nan, np.inf):
        with np.errstate(all="ignore"):
            result = certificate_of(
                lib, Trajectory(lib.home, np.full((7, 2), value), 5.0), EVERYTHING
            )
        assert {use.kind for use in result.broken} == {use.kind for use in result.uses}
    home = lib.home.copy()
    assert lib.braking is not None
    home[3] = lib.braking.upper[3] - 0.005
    result = certificate_of(lib, Trajectory(home, np.zeros((7, 2)), 5.0), Safety())
    assert [use.bound for use in result.broken if use.kind == "braking"] == [np.inf]


def test_the_certificate_of_everything(lib: Library) -> None:
    """Property: one use per kind, one distance per pair and lifted proxy, and what is left out."""
    motion = fast_motion(lib, 1e-3)
    result = certificate_of(lib, motion, EVERYTHING)
    assert [use.kind for use in result.uses[4:]] == list(KINDS)
    assert result.unchecked == ()
    assert len(result.distances) == len(lib.pairs) + len(lib.moving_proxies) - 1  # link 1 turns
    assert certificate_of(lib, motion, Safety()).unchecked == ("table",)
    assert certificate_of(lib, motion).unchecked == UNCHECKED[: UNCHECKED.index(CARRIED)]
    closest = min(result.distances[: len(lib.pairs)], key=lambda use: use.value - use.limit)
    t = np.linspace(0, 2, 2001)
    distance = lib.clearance(motion.at(lib, t)[0])[0].min(axis=0)
    pair = [f"{pair.first} and {pair.second}" for pair in lib.pairs].index(closest.where)
    assert closest.value == pytest.approx(distance[pair], abs=1e-4)  # a tenth of a millimetre
    sentence = next(text for text in result.sentences() if text.startswith("self-collision"))
    assert f"at least {1e3 * closest.value:.2f} mm" in sentence
    assert f"(proven, {closest.intervals} intervals)" in sentence
