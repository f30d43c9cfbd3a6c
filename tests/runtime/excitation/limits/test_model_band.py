"""Torque limits for every model of a band: the worst of its corners, its slopes and its proof."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.cli.motion_limits import LimitChoices, band_of_payload, band_of_prior
from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.nonlinear_limits import SampledMotion
from runtime.excitation.limits.safety import Safety
from runtime.excitation.limits.torque_limits import KINDS, TorqueLimit
from runtime.excitation.proof.certificate import certificate_of
from runtime.library import Library

MASS, REACH = 0.7, 0.1


@pytest.fixture(scope="module")
def safety(lib: Library) -> Safety:
    band = LimitChoices(payload_band=f"{MASS},{REACH}").limits(lib).band
    return Safety(viscous=(3.0,), coulomb=(1.0,), band=band, friction_band=0.25)


def motion_of(lib: Library) -> Trajectory:
    return Trajectory(lib.home, 1e-2 * np.random.default_rng(4).normal(size=(7, 5)), 3.0)


def states_of(motion: Trajectory, t: np.ndarray) -> np.ndarray:
    states = motion.basis.derivatives(5, 5, t / motion.duration) @ motion.coefficients.T
    states /= motion.duration ** np.arange(5.0)[:, None, None]
    states[0] += motion.home
    return states


def limit_of(lib: Library, safety: Safety, kind: str) -> TorqueLimit:
    return next(one for one in constraints(lib, lib.home, safety) if one.kind == kind)


def test_the_worst_model_of_the_band(lib: Library, safety: Safety) -> None:
    """Oracle: the full regressor, |Y| Δ, with friction at the end of its band."""
    states = states_of(motion_of(lib), np.linspace(0.1, 2.9, 40))
    g = limit_of(lib, safety, KINDS[0]).values(states[:4])
    columns = np.abs(lib.regressor(*states[:3])) @ np.array(safety.band)
    tau = lib.inverse_dynamics(*states[:3], lib.pi0)
    worst = [np.abs(tau + f * states[1]) + columns for f in (0.75 * 3.0, 1.25 * 3.0)]
    expected = np.maximum(*worst) / (0.95 * lib.limits()["effort"] - 1.25)
    # The larger sign, with the friction that adds to it; rounding of 70 products.
    assert np.maximum(g[:, :7], g[:, 7:]) + 1 == pytest.approx(expected, abs=1e-12)


def test_payloads_within_their_reach_are_in_the_band(lib: Library) -> None:
    """Property: masses of MASS in all at random places around the tip change no entry by more."""
    rng, band = np.random.default_rng(5), np.array(band_of_payload(lib, f"{MASS},{REACH}", None))
    tip = np.linalg.inv(lib.link_poses(lib.home)[-1]) @ lib.end_effector(lib.home)
    for _ in range(50):
        masses = rng.dirichlet(np.ones(4)) * MASS * rng.choice([-1, 1])
        spots = rng.normal(size=(4, 3))
        spots *= REACH / np.linalg.norm(spots, axis=1, keepdims=True)
        pi = np.zeros(10)
        for m, p in zip(masses, spots + tip[:3, 3], strict=True):
            inertia = m * (p @ p * np.eye(3) - np.outer(p, p))
            upper = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
            pi += np.concatenate([[m], m * p, upper])
        assert (np.abs(pi) <= band[-10:] + 1e-12).all()
    assert not band[:-10].any()


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_and_rates(lib: Library, safety: Safety, kind: str) -> None:
    """Derivative: central differences of the values, along random directions and in time."""
    limit, motion = limit_of(lib, safety, kind), motion_of(lib)
    t, h = np.linspace(0.2, 1.3, 12), 1e-6
    states = states_of(motion, t)
    direction = np.random.default_rng(6).normal(size=(4, 12, 7))
    up, down = (limit.values(states[:4] + s * h * direction) for s in (1, -1))
    chain = np.einsum("nrdj,dnj->nr", limit.slopes(states[:4]), direction[: limit.orders])
    # h² of the third derivative, and rounding 1e-13 / h.
    assert (up - down) / (2 * h) == pytest.approx(chain, abs=1e-6 * np.abs(chain).max())
    before, after = (limit.values(states_of(motion, t + s * h)[:4]) for s in (-1, 1))
    g, rate = limit.along(SampledMotion(lib, states))
    assert g == pytest.approx(limit.values(states[:4]), abs=1e-12)
    assert (after - before) / (2 * h) == pytest.approx(rate, abs=1e-6 * np.abs(rate).max())


def test_the_certificate_counts_the_band(lib: Library, safety: Safety) -> None:
    """Property: no model of the band exceeds the proven use at any of 3000 instants."""
    motion = motion_of(lib)
    proof = certificate_of(lib, motion, safety)
    assert "every model within masses ± 700 g and friction ± 25 %" in proof.load
    states, limits = states_of(motion, np.linspace(0, 3, 3001)), lib.limits()
    uses = {use.kind: use for use in proof.uses}
    assert uses["torque"].is_proven
    assert uses["torque rate"].is_proven
    rng, band, largest = np.random.default_rng(7), np.array(safety.band), np.zeros(2)
    for _ in range(8):
        pi = lib.pi0 + rng.choice([-1, 1], size=70) * band
        f = 3.0 * rng.uniform(0.75, 1.25)
        tau, rate, _ = lib.torque_with_rates(*states, pi)
        use = np.abs(tau + f * states[1]) / (0.95 * limits["effort"] - 1.25)
        speed = np.abs(rate + f * states[2]) / limits["torque_rate"]
        largest = np.maximum(largest, [use.max(), speed.max()])
    assert largest[0] <= uses["torque"].bound
    assert largest[1] <= uses["torque rate"].bound
    plain = certificate_of(lib, motion, replace(safety, band=(), friction_band=0.0))
    assert (
        uses["torque"].bound
        > largest[0]
        > next(use.bound for use in plain.uses if use.kind == "torque")
    )


def test_bands_that_are_none_are_refused(lib: Library) -> None:
    """Property: one sentence with what came."""
    with pytest.raises(
        Exception, match="needs a mass above 0 kg and a reach from 0 m up, got '0,1'"
    ):
        band_of_payload(lib, "0,1", None)
    with pytest.raises(Exception, match="the setting payload_band needs 2 numbers"):
        band_of_payload(lib, "1", None)
    with pytest.raises(Exception, match="a band of friction from 0 up is needed, got -5 %"):
        Safety(friction_band=-0.05)
    with pytest.raises(Exception, match="needs 70 half-widths, got 3"):
        constraints(lib, lib.home, Safety(band=(1.0, 1.0, 1.0)))


def test_the_band_of_the_prior(lib: Library) -> None:
    """Oracle: the mass of a body whose density is scaled has σ = m/√(4 κ), and bands add up."""
    band = band_of_prior(lib, "cad")
    assert band.shape == lib.pi0.shape
    # Scaling P by 1 + ε has the length ‖1‖ = 2; other directions change the mass further.
    assert (band[::10] >= 1.96 * lib.pi0[::10] / np.sqrt(4 * 16.0) - 1e-4).all()
    assert band_of_prior(lib, "4") == pytest.approx(2 * band, rel=1e-12)
    both = LimitChoices(payload_band="0.5,0.1", model_band="cad").limits(lib)
    assert np.array(both.band) == pytest.approx(
        band + band_of_payload(lib, "0.5,0.1", None), rel=1e-12
    )
    assert LimitChoices().limits(lib).band == ()
    with pytest.raises(
        Exception, match="the setting model_band needs cad, gripper, none or a trust above 0"
    ):
        band_of_prior(lib, "steel")


def test_all_columns_and_the_regressor_agree(lib: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: unit parameters one by one, against the kernel of the regressor."""
    limit = limit_of(lib, Safety(band=tuple(band_of_prior(lib, "cad"))), KINDS[0])
    states = states_of(motion_of(lib), np.linspace(0.1, 2.9, 5))[:4]
    g = limit.values(states)
    monkeypatch.setattr("runtime.excitation.limits.torque_limits._MANY", 100)
    assert g == pytest.approx(limit.values(states), abs=1e-12)  # rounding of 70 products
