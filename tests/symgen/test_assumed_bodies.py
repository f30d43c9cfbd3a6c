"""URDFs that state no masses: bodies by the setting masses, placeholders, and identification with
them.
"""

import re

import numpy as np
import pytest

import runtime
from runtime.errors import IdentificationError
from runtime.identification.single_log import identify_recording
from symgen.chain import ChainOptions, read_chain
from symgen.errors import UrdfError
from symgen.make.pipeline import build, generate
from symgen.make.request import BuildRequest, request_from_folder
from tests.conftest import TINY_URDF
from tests.robots import DATA, ONE_LEVEL
from tests.symgen.test_cli import run

TREE = (DATA / "tree.urdf").read_text()
BARE = re.sub(r"<inertial>.*?</inertial>", "", TREE, flags=re.DOTALL)
"""A robot of four moving links without any <inertial>."""
MOVING = ("trunk", "left_arm", "left_hand", "right_arm")


def read(text: str, masses: dict[str, float]):
    return read_chain(text, ChainOptions(masses=masses))


def test_placeholders_where_nothing_is_stated() -> None:
    """Property: every moving link is a consistent body of 1 kg; kinematics are not changed."""
    chain = read(BARE, {})
    assert chain.assumed == dict.fromkeys(MOVING, "placeholder")
    assert [j.mass for j in chain.joints] == [1.0] * 4
    assert [j.translation for j in chain.joints] == [j.translation for j in read_chain(TREE).joints]
    for joint in chain.joints:
        moments = np.linalg.eigvalsh(np.array(joint.inertia))
        assert 0 < moments[2] < moments[0] + moments[1]
    assert read(TREE, {}).assumed == {}


def test_stated_masses() -> None:
    """Oracle: the file of masses; a link that has none of its own keeps the refusal."""
    masses = {"trunk": 5.0, "left_arm": 2.0, "left_hand": 0.5, "right_arm": 2.5}
    chain = read(BARE, masses)
    assert [j.mass for j in chain.joints] == list(masses.values())
    assert chain.assumed == dict.fromkeys(masses, "given mass")
    with pytest.raises(UrdfError, match=r"'right_arm' moves .* no mass, .* the setting masses"):
        read(BARE, {"trunk": 5.0, "left_arm": 2.0, "left_hand": 0.5})


@pytest.mark.parametrize(
    ("text", "masses", "message"),
    [
        (BARE, {"roof": 1.0}, "names the link 'roof', which the URDF does not define"),
        (TREE, {"trunk": 1.0}, "names the link 'trunk', which has an <inertial>"),
        (BARE, {"trunk": -1.0}, "expected a mass above 0 kg for 'trunk', got -1"),
    ],
)
def test_faulty_masses(text: str, masses: dict[str, float], message: str) -> None:
    """Property: one sentence that names the link."""
    with pytest.raises(UrdfError, match=message):
        read(text, masses)


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> runtime.Library:
    """The pendulum without <inertial>, built."""
    text = TINY_URDF[: TINY_URDF.index("<inertial>")] + "</link></robot>"
    request = BuildRequest("bare", text, ChainOptions(masses={}))
    made = build(request, tmp_path_factory.mktemp("bare"), levels=ONE_LEVEL)
    assert "rod" in runtime.load(made.folder).placeholders
    assert any("placeholder of 1 kg" in note for note in made.notes)
    return runtime.load(made.folder)


def test_a_folder_of_placeholders_is_in_sync(bare: runtime.Library) -> None:
    """Property: `check` regenerates it from its own URDF and manifest."""
    files = generate(request_from_folder(bare.folder))[0]
    assert files["manifest.json"] == (bare.folder / "manifest.json").read_text()


def test_identification_without_prior(bare: runtime.Library) -> None:
    """Oracle: the true base parameters, from noise-free torque; map is refused by name."""
    rng = np.random.default_rng(1)
    t = np.arange(400) * 0.01
    q = 0.4 + 0.5 * np.sin(2 * t)
    dq, ddq = np.cos(2 * t), -2 * np.sin(2 * t)
    pi = np.array([1.5, 0.15, 0.0, 0.3, 0.08, 0.095, 0.025, 0.0, -0.03, 0.0])
    tau = bare.torque(q[:, None], dq[:, None], ddq[:, None], bare.lam_from_pi(pi))
    tau = tau + 1e-6 * rng.normal(size=tau.shape)
    log = runtime.Recording(t=t, q=q[:, None], dq=dq[:, None], ddq=ddq[:, None], tau=tau)
    result = identify_recording(log, bare)
    assert result.method == "pc-ols"
    assert any("states no <inertial>" in note for note in result.notes)
    # 1e-4: noise of 1e-6 over torques of order one, over 192 rows, times the condition
    np.testing.assert_allclose(result.beta, bare.base_matrix @ pi, rtol=1e-4, atol=1e-4)
    with pytest.raises(IdentificationError, match="method 'map' needs an inertial prior"):
        identify_recording(log, bare, "map")


def test_build_with_masses(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: the command reads the file, says what it assumed and that the base is fixed."""
    (tmp_path / "own.urdf").write_text(
        TINY_URDF[: TINY_URDF.index("<inertial>")] + "</link></robot>"
    )
    (tmp_path / "masses.toml").write_text("rod = 1.5\n")
    words = ("build", "--urdf", tmp_path / "own.urdf", "--name", "own", "--out", tmp_path / "out")
    level = ("--settings", f"level={ONE_LEVEL[0]}")
    code, out, err = run(capsys, *words, "--settings", f"masses={tmp_path / 'masses.toml'}", *level)
    assert (code, err) == (0, "")
    assert "note: mass of rod as stated by the setting masses" in out
    assert "note: no joint of the URDF attaches 'base' to the world; it is taken as fixed" in out
    (tmp_path / "masses.toml").write_text("rod = 'heavy'\n")
    code, _, err = run(capsys, *words, "--settings", f"masses={tmp_path / 'masses.toml'}", *level)
    assert code == 2
    assert "rod expects a mass in kg, got 'heavy'; correct it" in err


def test_a_base_joint_of_the_file_needs_no_note() -> None:
    """Property: a fixed joint from an empty root is the base that the file states."""
    world = TINY_URDF.replace(
        '<link name="base"/>',
        '<link name="world"/><link name="base"/><joint name="stand" type="fixed">'
        '<parent link="world"/><child link="base"/></joint>',
    )
    assert read_chain(TINY_URDF).base_is_assumed
    assert not read_chain(world).base_is_assumed
    assert not read_chain(TINY_URDF, ChainOptions(base="base")).base_is_assumed
