"""Fleet: the centre and the spread of a type, units that stand out, and the prior of a new unit."""

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2, kstest, multivariate_normal

from runtime import Recording, identify
from runtime.errors import IdentificationError
from runtime.estimators.convex import prior_of
from runtime.estimators.prior_file import read_prior
from runtime.estimators.regression import compress
from runtime.estimators.regression.samples import samples_of
from runtime.excitation import Trajectory
from runtime.identification.statistics_file import (
    MARK,
    UnitStatistics,
    read_statistics,
    statistics_of,
    write_statistics,
)
from runtime.library import Library
from runtime.library.parameters import links, mass
from runtime.monitoring.fleet import gather as room
from runtime.monitoring.fleet.alternation import centre_of
from runtime.monitoring.fleet.friction import fit_friction, random_effects
from runtime.monitoring.fleet.gather import gather, statistics_files
from runtime.monitoring.fleet.hierarchy import _View, fit_fleet
from runtime.monitoring.fleet.unit import Unit, unit_of
from runtime.recording import Friction
from runtime.recording.preprocessing import prepare
from runtime.simulation import Plant, ideal
from runtime.simulation.virtual_robot import perturbed
from tests.runtime.conftest import Command

UNITS, SPREAD, NOISE = 20, 0.05, 0.3
"""Number of units, their relative spread (κ = 1/SPREAD² = 400), and torque noise, N·m."""
TERMS = Friction(("viscous", "coulomb"))
VISCOUS, COULOMB, OF_FRICTION = 0.5, 0.3, 0.1


@dataclasses.dataclass(frozen=True)
class Fleet:
    """Virtual units of one type, known to the last digit."""

    type: np.ndarray
    pi: tuple[np.ndarray, ...]
    statistics: tuple[UnitStatistics, ...]
    units: tuple[Unit, ...]


class Killed(Exception):
    """End of a run before its time."""


def statistics_about(
    lib: Library, motion: Recording, pi: np.ndarray, name: str, rng: np.random.Generator
) -> UnitStatistics:
    """Statistics of one unit: exact triangle of the motion, target with its noise."""
    samples = samples_of(prepare(motion, None, TERMS, lib=lib), lib)
    whole = compress(lib, samples, np.full(lib.n_joints, NOISE**-2))
    phi = np.array([VISCOUS, COULOMB]) * np.exp(OF_FRICTION * rng.normal(size=(lib.n_joints, 2)))
    x = np.concatenate([lib.base_matrix @ pi, phi.ravel()])
    target = whole.factor @ x + rng.normal(size=x.size)
    rest = float(lib.n_joints * len(samples))
    drawn = dataclasses.replace(whole, target=target, rest=rest)
    return UnitStatistics(
        name, lib.name, lib.joint_names, TERMS.columns, (0.02, 0.1, 0.002), drawn, 1.0
    )


@pytest.fixture(scope="module")
def motion(lib: Library, trajectories: tuple[Trajectory, ...]) -> Recording:
    """The training motion at 25 Hz."""
    return ideal(lib, trajectories[0], Plant(lib.pi0), rate_hz=25.0)


@pytest.fixture(scope="module")
def fleet(lib: Library, motion: Recording) -> Fleet:
    """20 units that differ by 5 % about a type that is 20 % off the URDF."""
    rng = np.random.default_rng(2)
    centre = perturbed(lib, lib.pi0, 0.2, rng)
    pi = tuple(perturbed(lib, centre, SPREAD, rng) for _ in range(UNITS))
    known = tuple(
        statistics_about(lib, motion, each, f"u{k:02d}", rng) for k, each in enumerate(pi)
    )
    return Fleet(centre, pi, known, tuple(unit_of(each, lib, each.unit) for each in known))


def test_the_centre_minimises_its_cost(lib: Library) -> None:
    """Derivative: the slope of κ Σ D(P_u, X) + κ_0 D(X, P_URDF) in X vanishes, to rounding.

    The matrices of a link have condition numbers of some 1e3, hence 1e-10.
    """
    rng = np.random.default_rng(0)
    urdf = lib.pseudo_inertia(prior_of(lib).centre).reshape(-1, 4, 4)
    draws = [lib.pseudo_inertia(perturbed(lib, prior_of(lib).centre, 0.3, rng)) for _ in range(3)]
    P = np.stack([each.reshape(-1, 4, 4) for each in draws])
    for kappa, kappa_0 in ((400.0, 16.0), (1.0, 16.0), (2.0, 6.0)):
        X = centre_of(P, urdf, kappa, kappa_0)
        inverse = np.linalg.inv(X)
        slope = kappa * (len(P) * inverse - inverse @ P.sum(axis=0) @ inverse)
        slope += kappa_0 * (np.linalg.inv(urdf) - inverse)
        assert np.abs(X @ slope).max() < 1e-10 * kappa * len(P)
        assert (np.linalg.eigvalsh(X) > 0).all()


def test_the_marginal_likelihood_is_that_of_the_normal_law(lib: Library, fleet: Fleet) -> None:
    """Oracle: T and −log p of SciPy's normal law with the dense covariance 1 + A H Hᵀ Aᵀ/κ."""
    unit, prior = fleet.units[0], prior_of(lib, fleet.type, floor=0.0)
    A, b = unit.factor, unit.target
    view = _View(lib, prior, A[None], b[None], prior.centre)
    for kappa in (30.0, 400.0):
        covariance = np.eye(len(A)) + A @ view.H @ view.H.T @ A.T / kappa
        rest = b - A @ lib.base_matrix @ prior.centre
        T = float(rest @ np.linalg.solve(covariance, rest))
        assert view.statistic(kappa)[0] == pytest.approx(T, rel=1e-8)
        exact = -multivariate_normal(np.zeros(len(A)), covariance).logpdf(rest)
        ours = T / 2 + np.log(1 + view.values[0] / kappa).sum() / 2
        assert ours + len(A) / 2 * np.log(2 * np.pi) == pytest.approx(exact, rel=1e-8)


def test_centre_and_spread_are_recovered(lib: Library, fleet: Fleet) -> None:
    """Oracle: κ = 1/0.05² within its interval twice as wide, T is χ², no unit stands out.

    The centre predicts units of the type better than the URDF does.
    """
    fit = fit_fleet(lib, fleet.units)
    low, high = fit.interval
    assert low**2 / fit.kappa < SPREAD**-2 < high**2 / fit.kappa
    assert fit.trust < fit.kappa
    assert not fit.stands_out.any()
    assert kstest(fit.statistic, chi2(len(lib.base_matrix)).cdf).pvalue > 1e-3
    assert (lib.relative_eigenvalues(fit.centre) > 0).all()
    assert all((lib.relative_eigenvalues(each) > 0).all() for each in fit.pi)
    known = fleet.units[0]
    A = known.factor @ lib.base_matrix
    wrong = [float(np.linalg.norm(A @ (pi - fleet.type))) for pi in (fit.centre, lib.pi0)]
    assert wrong[0] < wrong[1] / 3


def test_a_unit_with_another_tool_stands_out(lib: Library, fleet: Fleet, motion: Recording) -> None:
    """Property: one unit carries 0.3 kg on link 7; it alone is named, and κ hardly moves."""
    extra = fleet.pi[4].copy()
    links(extra)[-1] += [0.3, 0.01, 0.0, 0.03, 2e-3, 2e-3, 1e-3, 0.0, 0.0, 0.0]
    odd = statistics_about(lib, motion, extra, "odd", np.random.default_rng(8))
    units = [*fleet.units[:4], unit_of(odd, lib, "odd"), *fleet.units[5:]]
    fit, without = fit_fleet(lib, units), fit_fleet(lib, fleet.units)
    assert np.flatnonzero(fit.stands_out).tolist() == [4]
    assert lib.link_names[fit.links[4]] == lib.link_names[-1]
    difference = mass(links(fit.pi[4]))[-1] - mass(links(fit.centre))[-1]
    assert 0.15 < difference < 0.45
    assert without.interval[0] < fit.kappa < without.interval[1]


def test_too_few_units_are_refused(lib: Library, fleet: Fleet) -> None:
    """Property: one sentence."""
    with pytest.raises(IdentificationError, match="at least 3 units, got 2"):
        fit_fleet(lib, fleet.units[:2])


def test_a_further_unit_lies_within_its_band() -> None:
    """Oracle: 95 % normal bands of a further value hold at least 92 % of 1000, for three spreads.

    Student's t of ten values costs a normal band 2.2 %; 1000 trials have a deviation of 0.8 %.
    """
    rng = np.random.default_rng(1)
    for tau in (0.0, 0.5, 3.0):
        inside = []
        for _ in range(1000):
            variance = rng.uniform(0.5, 2.0, size=10)
            values = 5 + tau * rng.normal(size=10) + np.sqrt(variance) * rng.normal(size=10)
            mean, sigma = random_effects(values, variance)
            inside.append(abs(5 + tau * rng.normal() - mean) < 1.96 * sigma)
        assert np.mean(inside) > 0.92 - 0.008


def test_friction_of_the_type(lib: Library, fleet: Fleet) -> None:
    """Oracle: the means of 20 units within 4 standard errors, the spread of a tenth within half."""
    fit = fit_fleet(lib, fleet.units)
    friction = fit_friction(lib, fleet.units, fit)
    assert friction.columns == TERMS.columns
    error = friction.mean - np.array([VISCOUS, COULOMB])
    assert (np.abs(error) < 4 * friction.sigma / np.sqrt(UNITS) + 0.01).all()
    assert (friction.sigma > OF_FRICTION / 2 * np.array([VISCOUS, COULOMB])).all()


def test_a_log_gives_the_same_statistics_again(
    noisy: Recording, lib: Library, tmp_path: Path
) -> None:
    """Property: what is read is what was written, and is less than 60 kB."""
    result = identify(noisy, lib, friction_columns=TERMS)
    written = statistics_of(result, "u1")
    write_statistics(written, tmp_path / "statistics.npz")
    read = read_statistics(tmp_path / "statistics.npz")
    assert (read.unit, read.robot, read.joints) == ("u1", lib.name, lib.joint_names)
    assert (read.columns, read.widths) == (TERMS.columns, written.widths)
    np.testing.assert_array_equal(read.statistics.factor, written.statistics.factor)
    np.testing.assert_array_equal(read.statistics.target, written.statistics.target)
    assert read.density == written.density == result.uncertainty.information.density
    assert (tmp_path / "statistics.npz").stat().st_size < 60_000


@pytest.mark.parametrize(
    "damage", ["cut", "nan", "huge", "shape", "later", "robot", "pickle", "negative"]
)
def test_damaged_statistics_are_refused(damage: str, fleet: Fleet, tmp_path: Path) -> None:
    """Property: one sentence that says what to run."""
    path = tmp_path / "statistics.npz"
    write_statistics(fleet.statistics[0], path)
    arrays = dict(np.load(path))
    changes = {
        "nan": {"target": arrays["target"] * np.nan},
        "huge": {"factor": arrays["factor"] * 1e200},
        "shape": {"factor": arrays["factor"][:-1]},
        "later": {MARK: np.asarray(99)},
        "robot": {"robot": np.asarray("../../evil")},
        "pickle": {"joints": np.array([{}], dtype=object)},
        "negative": {"density": np.asarray(-1.0)},
        "cut": {},
    }
    np.savez(path, **(arrays | changes[damage]))  # type: ignore[arg-type]
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:700])
    with pytest.raises(IdentificationError, match=r"identify|install"):
        read_statistics(path)


def test_a_killed_run_continues(
    lib: Library, fleet: Fleet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: parts that ended before the end are not computed again; the units are the same."""
    for each in fleet.statistics:
        write_statistics(each, tmp_path / "units" / each.unit / "statistics.npz")
    monkeypatch.setattr(room, "PART", 4)
    monkeypatch.setattr(room, "cores", lambda: 1)
    seen: list[str] = []
    parts = tmp_path / "parts"

    def counted(known: UnitStatistics, library: Library, name: str) -> Unit:
        if name == "u09" and not parts.joinpath("part-damaged.npz").exists():
            raise Killed
        seen.append(name)
        return unit_of(known, library, name)

    monkeypatch.setattr(room, "unit_of", counted)
    with pytest.raises(Killed):
        gather(lib, tmp_path / "units", parts)
    kept = len(list(parts.glob("part-*.npz")))
    assert kept == 2
    (parts / "part-damaged.npz").write_bytes(b"half")
    first = set(seen)
    seen.clear()
    units = gather(lib, tmp_path / "units", parts)
    assert not {"u00", "u01", "u07"} & set(seen)
    assert "u00" in first
    for ours, theirs in zip(units, fleet.units, strict=True):
        assert (ours.name, ours.columns, ours.widths) == (
            theirs.name,
            theirs.columns,
            theirs.widths,
        )
        for key in ("factor", "target", "friction"):
            np.testing.assert_array_equal(getattr(ours, key), getattr(theirs, key))


def test_the_commands_from_log_to_prior(
    command: Command,
    lib: Library,
    fleet: Fleet,
    log: Path,
    noisy: Recording,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Property: identify --save-statistics, fleet, identify --prior; nothing is overwritten."""
    monkeypatch.setattr("runtime.outputs.report.write_report", lambda folder: folder)  # slow
    words = ("--friction", "viscous,coulomb", "--out", "units/real", "--save-statistics")
    ran = command("identify", log, "--robot", lib.folder, *words)
    assert ran.code == 0, ran.err
    assert read_statistics(tmp_path / "units/real/statistics.npz").unit == "real"
    for each in fleet.statistics[:6]:
        write_statistics(each, tmp_path / "units" / f"{each.unit}.npz")
    ran = command("fleet", "units", "--robot", lib.folder, "--out", "fleet.toml", "--json")
    assert ran.code == 0, ran.err
    facts = json.loads(ran.out)
    assert facts["units"] == 7
    assert [each["unit"] for each in facts["stand_out"]] == ["real"]
    assert not (tmp_path / "fleet.toml.parts").exists()
    arrays = np.load(tmp_path / "fleet.npz")
    assert arrays["pi"].shape == (7, lib.pi0.size)
    prior = read_prior(tmp_path / "fleet.toml", lib)
    assert prior.units == 6
    assert prior.kappa == facts["trust"]
    result = identify(noisy, lib, friction_columns=TERMS, prior=prior, certify=False)
    assert result.is_consistent
    assert "6 units of the fleet" in result.notes[0]
    ran = command("fleet", "units", "--robot", lib.folder, "--out", "fleet.toml")
    assert ran.code == 2
    assert "--overwrite" in ran.err


@pytest.mark.parametrize("case", ["none", "empty", "damaged", "other"])
def test_bad_folders(
    case: str, command: Command, fleet: Fleet, lib: Library, tmp_path: Path
) -> None:
    """Property: exit code 2, one sentence, no file."""
    place = tmp_path / "units"
    if case != "none":
        place.mkdir()
    if case in {"damaged", "other"}:
        for each in fleet.statistics[:3]:
            write_statistics(each, place / each.unit / "statistics.npz")
    if case == "damaged":
        (place / "u01" / "statistics.npz").write_bytes(b"not an archive")
    if case == "other":
        odd = dataclasses.replace(fleet.statistics[1], joints=tuple("abcdefg"))
        write_statistics(odd, place / "u01" / "statistics.npz")
    ran = command("fleet", "units", "--robot", lib.folder, "--out", "fleet.toml")
    assert ran.code == 2
    sentence = ran.err.splitlines()[-1]
    assert "units" in sentence
    assert "Traceback" not in ran.err
    assert not (tmp_path / "fleet.toml").exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("centre = 3", "table [centre]"),
        ("[centre]\nfr3_link1 = [1, 2]", "10 numbers"),
        ("[centre]\nnobody = [1]", "links of 'fr3'"),
        ("[centre]\nfr3_link1 = [1, 0, 0, 0, -1, -1, -1, 0, 0, 0]", "fr3_link1"),
        ("[friction.fr3_joint1]\nviscous = 3", "[value, σ]"),
        ("[friction.fr3_joint1]\nviscous = [3, 0]", "[value, σ]"),
        ("[friction.fr3_joint1]\nsticky = [3, 1]", "friction columns"),
        ("[friction.elbow]\nviscous = [3, 1]", "joints"),
        ("[friction]\ncoulomb_speed = -1", "width above 0"),
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


def test_friction_of_another_width_is_refused(
    noisy: Recording, lib: Library, tmp_path: Path
) -> None:
    """Property: a Coulomb coefficient belongs to its width; the sentence names the option."""
    path = tmp_path / "fleet.toml"
    path.write_text("[friction]\ncoulomb_speed = 0.05\n[friction.fr3_joint1]\ncoulomb = [0.3, 0.1]")
    prior = read_prior(path, lib)
    with pytest.raises(IdentificationError, match=r"coulomb_speed = 0\.05.*--coulomb-speed 0\.05"):
        identify(noisy, lib, friction_columns=TERMS, prior=prior)


def test_the_prior_of_a_type_decides_what_no_motion_shows(lib: Library, noisy: Recording) -> None:
    """Oracle: masses of links that the data leave undetermined are those of the centre.

    The mass of the first link moves no torque. Its prior couples it to moments that do, by 0.2 %.
    """
    centre = lib.pi0.copy()
    links(centre)[0] *= 1.7
    prior = dataclasses.replace(_trusted(), centre=centre)
    result = identify(noisy, lib, friction_columns=TERMS, prior=prior, certify=False)
    assert mass(links(result.pi))[0] == pytest.approx(1.7 * mass(links(lib.pi0))[0], rel=0.01)


def _trusted():  # type: ignore[no-untyped-def]
    from runtime.estimators.convex.constraints import Constraints
    from runtime.estimators.prior_file import PriorFile

    return PriorFile(400.0, Constraints((), ()))


def test_a_pipe_among_the_units_is_refused(tmp_path: Path) -> None:
    """Property: opening a pipe would wait for its other end for ever; other pipes do not count."""
    (tmp_path / "u0").mkdir()
    os.mkfifo(tmp_path / "u0" / "statistics.npz")
    os.mkfifo(tmp_path / "other.npz")
    (path,) = statistics_files(tmp_path)
    with pytest.raises(IdentificationError, match="is damaged or holds no compressed statistics"):
        read_statistics(path)
