"""`python -m runtime excite` on robots of other makers, whose URDFs state less than the FR3's."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from runtime.errors import IdentificationError
from runtime.excitation.limits.constraints import DEFAULT_ACCELERATION, DEFAULT_RANGE
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import read_trajectory
from runtime.excitation.proof.certificate import certificate_of
from runtime.excitation.search.design import design
from runtime.library import Library
from tests.oracle import pinocchio_model
from tests.runtime.conftest import Command
from tests.runtime.excitation.test_excitation import closed_form

GetRobot = Callable[[str], Library]
DURATION, HARMONICS = 5, 3
WORDS = (
    "--duration",
    DURATION,
    "--settings",
    f"harmonics={HARMONICS}",
    "--settings",
    f"starts={1}",
    "--out",
    "x.json",
)


@pytest.fixture
def arm(robot: GetRobot, request: pytest.FixtureRequest) -> GetRobot:
    """A robot of `tests.robots.CASES`, or the arm of two joints."""
    return lambda name: request.getfixturevalue(name) if name == "double" else robot(name)


def assert_safe(lib: Library, path: Path, share: float | None) -> None:
    """Closed forms at 1 kHz and Pinocchio's RNEA, with the stated and the assumed limits."""
    facts = json.loads(path.read_text())
    t = np.arange(int(1000 * facts["duration"]) + 1) / 1000
    phi = closed_form(HARMONICS, t, facts["duration"])
    moved, dq, ddq = (phi[..., k] @ np.array(facts["coefficients"]).T for k in range(3))
    limits, q = lib.limits(), facts["home"] + moved
    slack = 1e-9  # rounding of coefficients of 70 that cancel down to 1
    known = np.isfinite(limits["upper"])
    assert (q <= np.where(known, limits["upper"], q.max() + 1) + slack).all()
    assert (q >= np.where(known, limits["lower"], q.min() - 1) - slack).all()
    assert (np.abs(moved[:, ~known]) <= DEFAULT_RANGE + slack).all()
    pairs = (dq, "velocity", np.pi), (ddq, "acceleration", DEFAULT_ACCELERATION)
    for values, key, missing in pairs:
        bound = np.where(np.isfinite(limits[key]), limits[key], missing)
        assert (np.abs(values) <= bound + slack).all(), key
    # A motion that uses nothing of its limits would be a poor one.
    assert np.abs(dq).max() > 0.3
    if share is not None:
        model = pinocchio_model(lib.urdf(), np.array(lib.manifest.gravity))
        data = model.createData()
        states = zip(q, dq, ddq, strict=True)
        tau = np.array([pinocchio.rnea(model, data, *state) for state in states])
        assert (np.abs(tau) <= share * limits["effort"]).all()


CASES = {
    "xarm7": (),
    "ur5": ("--criterion", "a", "--settings", f"torque_fraction={0.4}"),
    "iiwa14": ("--criterion", "v", "--settings", "payload_only=true"),
    "kinova_gen3": (
        "--criterion",
        "d",
        "--box",
        "-1,1,-1,1,0.1,2",
        "--settings",
        f"viscous={1}",
        "--settings",
        f"coulomb={0.5}",
    ),
    "double": (),
}


@pytest.mark.parametrize("name", CASES)
def test_all_limits_that_the_robot_states(command: Command, arm: GetRobot, name: str) -> None:
    """Oracle: Pinocchio at 1 kHz; what is assumed or not looked at is told."""
    lib, words = arm(name), CASES[name]
    share = 0.4 if "the setting torque_fraction" in words else 0.95
    ran = command("excite", "--robot", lib.folder, *WORDS, *words)
    assert ran.code == 0, ran.err
    path = Path("x.json")
    assert_safe(lib, path, share)
    assert certificate_of(lib, read_trajectory(path, lib), Safety(torque_fraction=share)).holds
    assert "holds at every instant" in ran.out
    assert f"no acceleration limit for {', '.join(lib.joint_names)}: 10 assumed" in ran.out
    assert f"note: '{name}' has no collision proxies" in ran.out
    assert "self-collision" in ran.out


@pytest.mark.parametrize("name", CASES)
def test_the_documents_problem(command: Command, arm: GetRobot, name: str) -> None:
    """Oracle: closed forms at 1 kHz."""
    lib = arm(name)
    ran = command("excite", "--robot", lib.folder, *WORDS, "--settings", "document=true")
    assert ran.code == 0, ran.err
    assert_safe(lib, Path("x.json"), None)
    assert certificate_of(lib, read_trajectory(Path("x.json"), lib)).holds


@pytest.mark.parametrize("basis", ["fourier", "bspline"])
def test_other_bases(command: Command, double: Library, basis: str) -> None:
    """Property: the certificate holds at all speeds asked for, files for a robot are written."""
    words = (
        "--settings",
        f"basis={basis}",
        "--speed",
        10,
        "--speed",
        100,
        "--export",
        "ros",
        "--settings",
        "unchecked=all",
    )
    ran = command("excite", "--robot", double.folder, *WORDS, *words)
    assert ran.code == 0, ran.err
    assert ran.out.count("holds at every instant") == 2
    assert Path("x-speed10.ros.yaml").exists()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--table", 0), "'double' has no collision proxies, so a table cannot be checked"),
        (("--settings", f"clearance={0.02}"), "so a clearance between its links cannot be checked"),
        (("--settings", "payload_only=true"), "excites 4 of 10 unknown columns"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    command: Command, double: Library, words: tuple[object, ...], sentence: str
) -> None:
    """Property: exit code 2, no file."""
    ran = command("excite", "--robot", double.folder, *WORDS, *words)
    assert ran.code == 2
    assert sentence in ran.err
    assert ran.err.count("\n") == 1
    assert not Path("x.json").exists()


def test_joints_without_limits_move_about_their_home(double: Library) -> None:
    """Property: a home beyond ±π is as good as any other; the assumption is told."""
    home = np.array([0.0, 4.0])
    result = design(double, duration=DURATION, harmonics=HARMONICS, starts=1, home=home)
    turned = result.trajectory.at(double, np.linspace(0, DURATION, 500))[0][:, 1]
    # Rounding of coefficients of 70 that cancel down to 1.
    assert np.abs(turned - home[1]).max() <= DEFAULT_RANGE + 1e-9
    assert "no upper position limit for elbow: 3.142 above home assumed" in result.assumptions
    with pytest.raises(IdentificationError, match="2 of joint 'shoulder' is not inside"):
        design(double, duration=DURATION, harmonics=HARMONICS, starts=1, home=np.array([2.0, 0.0]))
