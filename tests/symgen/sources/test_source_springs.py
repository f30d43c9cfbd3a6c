"""Springs and gravity of MJCF and SDF: against MuJoCo, and beside a mechanism file."""

from pathlib import Path

import casadi as ca
import mujoco
import numpy as np
import pytest

from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.mechanism import Mechanism, Spring, mechanism_from_table
from symgen.cli.make import request_from_urdf
from symgen.errors import BuildError, UrdfError
from symgen.mechanics.passive import known_torque
from symgen.sources import Source, read_source

BODIES = """<body name="arm" pos="0 0.1 0.3" euler="0.2 0.1 0.3">
  <joint name="lift" type="hinge" axis="0.6 0 0.8" pos="0.02 -0.03 0.05" ref="0.4"
    stiffness="4" springref="0.35"/>
  <inertial pos="0.03 0.02 0.1" mass="2" diaginertia="0.02 0.03 0.025"/>
  <site name="a" pos="0 .1 0"/>
  <body name="finger" pos="0.2 0 0.1">
    <joint name="slide-1" type="slide" axis="0 1 0" pos="0.02 0 0" ref="0.05" stiffness="90"/>
    <inertial pos="0 0 0.05" mass="0.3" diaginertia="0.001 0.002 0.001"/>
    <site name="b" pos=".3 .1 .2"/>
  </body></body>"""
TENDONS = """<tendon>
  <fixed name="both" stiffness="3" springlength="0.1">
    <joint joint="lift" coef="0.5"/><joint joint="slide-1" coef="-2"/></fixed>
  <spatial name="strut" stiffness="700" springlength="0.3"><site site="a"/>
    <site site="b"/></spatial>
  <fixed name="limp"><joint joint="lift" coef="1"/></fixed></tendon>"""


def mjcf(tmp_path: Path, tendons: str = TENDONS) -> Path:
    path = tmp_path / "robot.xml"
    path.write_text(
        f'<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>{BODIES}'
        f"</worldbody>{tendons}</mujoco>"
    )
    return path


def chain_of(path: Path, mechanism: Mechanism | None = None) -> Chain:
    text, whole = read_source(Source(path), mechanism or Mechanism())
    return read_chain(text, ChainOptions(mechanism=whole))


def test_mjcf_springs_are_those_of_mujoco(tmp_path: Path) -> None:
    """Oracle: passive forces of MuJoCo at random postures; damping is zero there."""
    path = mjcf(tmp_path)
    chain = chain_of(path)
    assert [s.name for s in chain.mechanism.spring] == ["lift", "slide_1", "both", "strut"]
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    q = ca.SX.sym("q", 2)
    torque = ca.Function("torque", [q], [known_torque(chain, q)])
    for position in np.random.default_rng(0).normal(0.1, 0.3, (20, 2)):
        data.qpos[:] = position
        mujoco.mj_forward(model, data)
        # rounding of forces of 200 N
        np.testing.assert_allclose(
            np.array(torque(position)).ravel(), -data.qfrc_passive, rtol=0, atol=1e-11
        )


@pytest.mark.parametrize(
    "tendon",
    [
        '<fixed name="slack" stiffness="3" springlength="0 1">'
        '<joint joint="lift" coef="1"/></fixed>',
        '<spatial name="long" stiffness="3"><site site="a"/><site site="b"/><site site="a"/>'
        "</spatial>",
    ],
)
def test_other_tendons_with_stiffness_are_refused(tmp_path: Path, tendon: str) -> None:
    """Property: a spring that has no counterpart is named, not left out."""
    with pytest.raises(
        BuildError, match=r"tendon '(slack|long)' is a spring, expected one without"
    ):
        read_source(Source(mjcf(tmp_path, f"<tendon>{tendon}</tendon>")), Mechanism())


def sdf(tmp_path: Path, *joints: tuple[str, str, str, str]) -> Path:
    """A file with joints of a name, a parent, a child and a stiffness."""
    link = (
        "<link name='{}'><inertial><mass>1</mass><inertia><ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz>"
        "</inertia></inertial></link>"
    )
    joint = (
        "<joint name='{0}' type='revolute'><parent>{1}</parent><child>{2}</child><axis><xyz>0 1 0"
        "</xyz><dynamics><spring_reference>.2</spring_reference><spring_stiffness>{3}"
        "</spring_stiffness></dynamics></axis></joint>"
    )
    path = tmp_path / "robot.sdf"
    path.write_text(
        "<sdf version='1.6'><model name='m'>"
        + "".join(map(link.format, ("base", "a", "b")))
        + "".join(joint.format(*each) for each in joints)
        + "</model></sdf>"
    )
    return path


def test_sdf_springs(tmp_path: Path) -> None:
    """Property: stiffness and reference of a joint; zero stiffness is no spring."""
    path = sdf(tmp_path, ("j1", "base", "a", "1500"), ("j2", "a", "b", "0"))
    assert read_source(Source(path), Mechanism())[1].spring == (
        Spring("j1", {"j1": 1.0}, rest=0.2, stiffness=1500.0),
    )


def test_a_spring_of_a_joint_that_closes_a_loop_is_refused(tmp_path: Path) -> None:
    """Property: its angle is no coordinate of the tree, so the spring has no place; it is named."""
    ends = ("j1", "base", "a", "0"), ("j2", "a", "b", "0"), ("j3", "base", "b", "7")
    with pytest.raises(BuildError, match="'j3' closes a loop and has a spring, expected"):
        read_source(Source(sdf(tmp_path, *ends)), Mechanism())


def test_springs_of_negative_stiffness_are_refused(tmp_path: Path) -> None:
    """Property: in a robot file as in a mechanism file."""
    path = mjcf(tmp_path)
    for old, what in (('stiffness="90"', "joint 'slide-1'"), ('stiffness="700"', "tendon 'strut'")):
        other = tmp_path / "negative.xml"
        other.write_text(path.read_text().replace(old, 'stiffness="-9"'))
        with pytest.raises(BuildError, match=f"{what} has the stiffness -9, expected at least 0"):
            read_source(Source(other), Mechanism())
    with pytest.raises(BuildError, match="joint 'j1' has the stiffness -5"):
        read_source(Source(sdf(tmp_path, ("j1", "base", "a", "-5"))), Mechanism())


def test_springs_of_one_name_along_other_joints_stay(tmp_path: Path) -> None:
    """Property: a spring is replaced by one along its joints, and does not vanish by its name."""
    path = mjcf(tmp_path, "")
    springs = chain_of(path, Mechanism(spring=(Spring("lift", {"slide-1": 1.0}),))).mechanism.spring
    assert [(s.name, *s.of) for s in springs] == [("lift", "slide-1"), ("lift_2", "lift")]


def test_a_mechanism_file_takes_precedence(tmp_path: Path) -> None:
    """Property: its spring along the same joint replaces that of the file; others stay."""
    path, unknown = mjcf(tmp_path, ""), Spring("lift_k", {"lift": 1.0}, rest=0.35)
    springs = chain_of(path, Mechanism(spring=(unknown,))).mechanism.spring
    assert [(s.name, s.stiffness) for s in springs] == [("lift_k", None), ("slide_1", 90.0)]


@pytest.mark.parametrize(
    ("options", "sentence", "kept"),
    [
        (
            ChainOptions(),
            "springs of the file, whose torque counts as known: lift (4, rest 0.35)",
            2,
        ),
        (ChainOptions(locks={"lift": 0.4}), "springs of the file that are left out: lift", 1),
        (ChainOptions(floating=True), "springs of the file that are left out: lift, slide_1", 0),
    ],
)
def test_the_build_names_them(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    options: ChainOptions,
    sentence: str,
    kept: int,
) -> None:
    """Property: the user reads what counts as known, and what a lock or a free base leaves out."""
    source = Source(mjcf(tmp_path, ""))
    request = request_from_urdf(source, "robot", options, False, None, None)
    assert sentence in " ".join(capsys.readouterr().out.split())
    assert len(request.options.mechanism.spring) == kept


@pytest.mark.parametrize(("locked", "value"), [("lift", 0.4), ("slide-1", -0.2)])
def test_a_lock_moves_the_rest_of_a_tendon(tmp_path: Path, locked: str, value: float) -> None:
    """Oracle: passive forces of MuJoCo with that joint held; the tendon was refused by the lock."""
    path = mjcf(tmp_path, TENDONS[: TENDONS.index("<spatial")] + "</tendon>")
    options = ChainOptions(locks={locked: value})
    request = request_from_urdf(Source(path), "robot", options, False, None, None)
    chain = read_chain(request.urdf, request.options)
    model = mujoco.MjModel.from_xml_path(str(path))
    data, place = mujoco.MjData(model), ("lift", "slide-1").index(locked)
    data.qpos[place] = value
    q = ca.SX.sym("q", 1)
    torque = ca.Function("torque", [q], [known_torque(chain, q)])
    for position in (-0.3, 0.1, 0.5):
        data.qpos[1 - place] = position
        mujoco.mj_forward(model, data)
        # rounding of forces of 50 N
        assert float(torque(position)) == pytest.approx(-data.qfrc_passive[1 - place], abs=1e-12)


def test_a_tendon_to_a_joint_that_is_cut_off_is_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: its end is not part of the robot, so that it is named instead of refused."""
    path = mjcf(tmp_path, TENDONS[: TENDONS.index("<spatial")] + "</tendon>")
    request = request_from_urdf(Source(path), "robot", ChainOptions(tip="arm"), False, None, None)
    assert [s.name for s in request.options.mechanism.spring] == ["lift"]
    assert "left out: slide_1, both" in " ".join(capsys.readouterr().out.split())


def test_a_negative_stiffness_is_refused() -> None:
    """Property: a spring that pushes away from its rest is a sign error of the file."""
    table = {"spring": [{"name": "s", "joint": "j", "stiffness": -4.0}]}
    with pytest.raises(UrdfError, match="'s' has the stiffness -4, expected at least 0"):
        mechanism_from_table(table, "m.toml")


def test_unknown_springs_of_a_table_of_links(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: a file of DH rows may state springs of unknown stiffness, which are not named as
    known; the note tried to print their stiffness.
    """
    path = tmp_path / "arm.toml"
    path.write_text(
        'name = "arm"\n[[link]]\nname = "a"\njoint = "j1"\nmass = 1.0\n'
        '[[spring]]\nname = "soft"\njoint = "j1"\n[[spring]]\nname = "stiff"\njoint = "j1"\n'
        "stiffness = 2.0\n"
    )
    request = request_from_urdf(Source(path), "arm", ChainOptions(), False, None, None)
    said = " ".join(capsys.readouterr().out.split())
    assert "counts as known: stiff (2, rest 0)" in said
    assert "soft" not in said
    assert len(request.options.mechanism.spring) == 2


@pytest.mark.parametrize(
    ("stated", "given"), [("-1.62", None), ("-1.62", (0.0, 0.0, -1.62)), ("1e+308", None)]
)
def test_gravity_of_mjcf_is_noted(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    stated: str,
    given: tuple[float, float, float] | None,
) -> None:
    """Property: gravity of the file, which a build does not take, and compensated weight."""
    path = mjcf(tmp_path, "")
    text = path.read_text().replace("0 0 -9.81", f"0 0 {stated}")
    path.write_text(text.replace('<body name="finger"', '<body name="finger" gravcomp="1"'))
    request_from_urdf(Source(path), "robot", ChainOptions(gravity=given), False, None, None)
    out = " ".join(capsys.readouterr().out.split())
    assert (f"the file states the gravity 0,0,{stated} m/s²" in out) == (given is None)
    assert "the gravcomp of finger is left out" in out


def test_a_tendon_between_sites_of_a_locked_link_names_the_remedy(tmp_path: Path) -> None:
    """Property: a lock makes the link a part of another one; [[spring]] of its name replaces it."""
    locks, path = {"lift": 0.4}, mjcf(tmp_path)
    strut = Spring("strut", {}, "world", "finger", (0.0, 0.2, 0.3), (0.3, 0.1, 0.2), 0.3, 700.0)

    def torque(mechanism: Mechanism) -> ca.SX:
        options = ChainOptions(locks=locks, mechanism=mechanism)
        request = request_from_urdf(Source(path), "robot", options, False, None, None)
        chain = read_chain(request.urdf, request.options)
        return known_torque(chain, ca.SX.sym("q", 1))

    with pytest.raises(UrdfError, match=r"name one of .* in \[\[spring\]\] 'strut' of a mechanism"):
        torque(Mechanism())
    assert torque(Mechanism(spring=(strut,))).shape == (1, 1)
