"""Prior of a type of robot: its file, and what it decides in an identification."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import IdentificationError
from runtime.estimators.convex import map_estimate
from runtime.estimators.prior_file import read_prior
from runtime.estimators.problem import NoiseFloor
from runtime.estimators.regression.coloured_noise import ColouredNoise
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.library.parameters import links, mass
from runtime.monitoring.fleet.fleet_prior import fit_fleet, fit_friction, prior_text, write_prior
from runtime.recording import Preparation
from tests.runtime.monitoring.virtual_units import TERMS, Fleet


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("centre = 3", "centre expects a table or nothing, got 3; correct it"),
        ("[centre]\nfr3_link1 = [1, 2]", "10 numbers"),
        ("[centre]\nnobody = [1]", "centre.nobody expects 10 numbers m,"),
        (f"[centre]\nnobody = {[1] * 10}", "entry 'centre.nobody'; known are fr3_link1,"),
        ("[centre]\nfr3_link1 = [1, 0, 0, 0, -1, -1, -1, 0, 0, 0]", "fr3_link1"),
        ("[friction.fr3_joint1]\nviscous = 3", "[value, σ]"),
        ("[friction.fr3_joint1]\nviscous = [3, 0]", "[value, σ]"),
        (
            "[friction.fr3_joint1]\nsticky = [3, 1]",
            "'friction.fr3_joint1.sticky'; known are viscous,",
        ),
        ("[friction.elbow]\nviscous = [3, 1]", "'friction.elbow'; known are fr3_joint1,"),
        ("[friction]\ncoulomb_speed = -1", "width above 0"),
        ("[friction]\nfr3_joint1 = 3", "a table of columns for friction.fr3_joint1, got 3"),
        ("[friction.coulomb_speed]\nviscous = [3, 1]", "width above 0"),
        ("noise = 3", "noise expects a table or nothing, got 3; correct it"),
        ("[noise]\nelbow = 1", "'noise.elbow'; known are inflation, fr3_joint1,"),
        ("[noise]\ninflation = 0.5", "at least 1"),
        ("[noise]\nfr3_joint1 = -1", "at least 0"),
        ("fleet = 3", "units"),
        ("[fleet]\nunits = -1", "units"),
    ],
)
def test_bad_priors_of_a_type(text: str, said: str, lib: Library, tmp_path: Path) -> None:
    """Property: one sentence with the entry."""
    path = tmp_path / "fleet.toml"
    path.write_text(text)
    with pytest.raises(IdentificationError) as error:
        read_prior(path, lib)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_friction_of_a_joint_stands_at_its_place(lib: Library, tmp_path: Path) -> None:
    """Oracle: the file; what it does not state has no prior."""
    path = tmp_path / "fleet.toml"
    path.write_text(
        "[friction.fr3_joint2]\nviscous = [3, 1]\n"
        "[friction.fr3_joint7]\ncoulomb = [0.3, 0.1]\nviscous = [2, 0.5]"
    )
    known = read_prior(path, lib).friction
    assert known is not None
    assert known.columns == ("viscous", "coulomb")
    mean, sigma = np.zeros((7, 2)), np.full((7, 2), np.inf)
    mean[1, 0], mean[6] = 3, (2, 0.3)
    sigma[1, 0], sigma[6] = 1, (0.5, 0.1)
    np.testing.assert_array_equal(known.mean, mean)
    np.testing.assert_array_equal(known.sigma, sigma)


def test_friction_of_another_width_is_refused(
    noisy: Recording, lib: Library, tmp_path: Path
) -> None:
    """Property: a Coulomb coefficient belongs to its width; the sentence names the option."""
    path = tmp_path / "fleet.toml"
    path.write_text("[friction]\ncoulomb_speed = 0.05\n[friction.fr3_joint1]\ncoulomb = [0.3, 0.1]")
    prior = read_prior(path, lib)
    with pytest.raises(
        IdentificationError, match=r"coulomb_speed = 0\.05.*give --settings coulomb_speed=0\.05$"
    ):
        identify_recording(noisy, lib, friction=TERMS, prior=prior)


def test_the_prior_of_a_type_decides_what_no_motion_shows(lib: Library, noisy: Recording) -> None:
    """Oracle: masses of links that the data leave undetermined are those of the centre.

    The mass of the first link moves no torque. Its prior couples it to moments that do, by 0.2 %.
    """
    centre = lib.pi0.copy()
    links(centre)[0] *= 1.7
    prior = dataclasses.replace(_trusted(), centre=centre)
    result = identify_recording(noisy, lib, friction=TERMS, prior=prior, certify=False)
    assert mass(links(result.pi))[0] == pytest.approx(1.7 * mass(links(lib.pi0))[0], rel=0.01)


def test_the_trust_in_a_type_counts_all_of_the_noise(
    lib: Library, noisy: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: with N_eff = N / 10⁶ a result is nearer to the centre of a type; that about the
    URDF, whose trust counts the autocorrelation of the residuals alone, stays.
    """
    prior, found = dataclasses.replace(_trusted(), centre=1.2 * lib.pi0), []
    for inflation in (1.0, 1e6):
        noise = ColouredNoise(inflation, 1.0)
        monkeypatch.setattr(map_estimate, "coloured_noise_of", lambda *_, noise=noise: noise)
        words = {"friction": TERMS, "certify": False}
        found.append(
            [identify_recording(noisy, lib, prior=each, **words) for each in (prior, None)]
        )
    far, near = (
        np.linalg.norm(typed.beta - 1.2 * (lib.base_matrix @ lib.pi0)) for typed, _ in found
    )
    assert near < 0.7 * far
    np.testing.assert_array_equal(found[0][1].pi, found[1][1].pi)


def test_a_few_seconds_count_with_the_noise_of_the_type(lib: Library, noisy: Recording) -> None:
    """Property: no joint counts as less noisy, and N_eff as no larger, than the prior states.

    Rows of another regressor than the torque keep their own noise.
    """
    noise = NoiseFloor(np.full(lib.n_joints, 0.5), 4.0)
    prior, plain = dataclasses.replace(_trusted(), noise=noise), _trusted()
    results = [
        identify_recording(noisy, lib, friction=TERMS, prior=each) for each in (plain, prior)
    ]
    assert (results[0].weights > 10 * 0.5**-2).all()
    np.testing.assert_allclose(results[1].weights, 0.5**-2, rtol=1e-12)
    assert results[1].uncertainty.information.density >= 4.0
    momenta = Preparation(regressor="momentum")
    words = {"friction": TERMS, "preparation": momenta, "certify": False}
    alike = [identify_recording(noisy, lib, prior=each, **words) for each in (plain, prior)]
    np.testing.assert_array_equal(alike[0].weights, alike[1].weights)


def test_the_noise_of_a_prior_is_read_again(lib: Library, fleet: Fleet, tmp_path: Path) -> None:
    """Property: all digits; joints that a file does not list have no least noise."""
    fit = fit_fleet(lib, fleet.units)
    noise = NoiseFloor(np.linspace(0.1, 0.7, lib.n_joints) / 3, 41 / 3)
    names = [unit.name for unit in fleet.units]
    text = prior_text(lib, names, fit, fit_friction(lib, fleet.units, fit), noise)
    write_prior(tmp_path / "fleet.toml", text, lib)
    known = read_prior(tmp_path / "fleet.toml", lib).noise
    np.testing.assert_array_equal(known.sigma, noise.sigma)
    assert known.inflation == noise.inflation
    (tmp_path / "hand.toml").write_text("[noise]\nfr3_joint2 = 0.2")
    known = read_prior(tmp_path / "hand.toml", lib).noise
    np.testing.assert_array_equal(known.sigma, 0.2 * np.eye(lib.n_joints)[1])
    assert known.inflation == 1.0


def _trusted():  # type: ignore[no-untyped-def]
    from runtime.estimators.convex.newton import Constraints
    from runtime.estimators.prior_file import PriorFile

    return PriorFile(400.0, Constraints((), ()))
