"""Drives of mirrored joints that are tied: their prior, and the second identification with it."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from runtime.estimators.problem import FrictionPrior
from runtime.identification.drive.symmetry import SPREAD, identify_tied, tied_prior
from runtime.identification.identified import Identification
from runtime.identification.settings import Settings
from runtime.recording import Friction

NAMES = ("FL_hip", "FR_hip", "RL_hip", "RR_hip", "FL_knee", "FR_knee", "head")
TERMS = Friction(("viscous", "dahl", "offset", "rotor"))


@dataclass(frozen=True)
class Result:
    """What a prior takes of an identification."""

    phi: np.ndarray
    notes: tuple[str, ...] = ("dry friction has a memory", "of both")
    friction: Friction = TERMS
    train: Any = field(default_factory=lambda: SimpleNamespace(column_names=TERMS.columns))
    lib: Any = field(default_factory=lambda: SimpleNamespace(joint_names=NAMES))


def result_of(seed: int) -> Identification:
    """An identification with random friction."""
    phi = np.random.default_rng(seed).uniform(0.1, 1.0, size=(len(NAMES), 4))
    return cast(Identification, Result(phi))


def test_prior_is_the_mean_of_each_group() -> None:
    """Oracle: means by hand; pairs that share a joint form one group, dry friction stays apart."""
    result = result_of(0)
    pairs = ("FL:FR", "RL:RR", "FL:RL")
    prior, note = tied_prior(NAMES, pairs, TERMS.columns, result.phi, None)
    assert note.startswith("viscous and armature of the joints")
    hips, knees = result.phi[:4].mean(axis=0), result.phi[4:6].mean(axis=0)
    for k in (0, 3):
        np.testing.assert_allclose(prior.mean[:, k], [*[hips[k]] * 4, *[knees[k]] * 2, 0.0])
        np.testing.assert_allclose(prior.sigma[:6, k], SPREAD * prior.mean[:6, k])
    assert np.isinf(prior.sigma[:, 1:3]).all()
    assert np.isinf(prior.sigma[6]).all()
    apart, _ = tied_prior(NAMES, ("FL:FR", "RL:RR"), TERMS.columns, result.phi, None)
    assert apart.mean[0, 0] == pytest.approx(result.phi[:2, 0].mean())
    assert apart.mean[2, 0] == pytest.approx(result.phi[2:4, 0].mean())


def test_a_stated_prior_stays_where_nothing_is_tied() -> None:
    """Property: the prior of friction that the settings have is kept for other coefficients."""
    shape = (len(NAMES), 4)
    known = FrictionPrior(np.full(shape, 0.3), np.full(shape, 0.05))
    prior, _ = tied_prior(NAMES, ("FL:FR",), TERMS.columns, result_of(1).phi, known)
    np.testing.assert_array_equal(prior.mean[2:4], known.mean[2:4])
    np.testing.assert_array_equal(prior.sigma[:, 1], known.sigma[:, 1])
    assert prior.sigma[0, 0] != known.sigma[0, 0]


def test_drives_are_identified_apart_and_then_tied() -> None:
    """Property: the second identification has the prior and the friction model of the first."""
    calls: list[Settings] = []

    def fit(settings: Settings) -> Identification:
        calls.append(settings)
        other = result_of(2)
        return other if len(calls) % 2 else replace(cast(Any, other), notes=("of both",))

    result = identify_tied(fit, Settings(), ("FL:FR",))
    first, second = calls
    assert first.friction_prior is None
    assert not first.certify
    assert second.certify
    assert second.friction == TERMS
    assert second.friction_prior is not None
    assert np.isfinite(second.friction_prior.sigma[:2, 0]).all()
    assert "tied to their mean within 10 %" in result.notes[0]
    assert result.notes[1:] == ("dry friction has a memory", "of both")
