"""Numbers and names that all formats share, against values by hand."""

import numpy as np
import pytest
from defusedxml.ElementTree import fromstring

from runtime.errors import ExportError
from runtime.library import Library
from runtime.outputs.model_files import reload_check
from runtime.outputs.model_files.export_format import EXPORT_FORMATS, usual_formats
from runtime.outputs.model_files.formats import header
from runtime.outputs.model_files.formats.sdf import sdf_text
from runtime.outputs.model_files.joint_friction import joint_friction
from runtime.outputs.model_files.model import make_model
from runtime.outputs.model_files.reload_check import TOLERANCE
from runtime.outputs.model_files.urdf_tree import short_names, smallest_eigenvalue
from runtime.recording import Friction
from tests.runtime.outputs.model_files.test_model_files import drives_of_arm


def test_short_names_lose_their_common_prefix() -> None:
    """Known case: up to the last shared underscore; a single name stays whole."""
    assert short_names(["fr3_link1", "fr3_link2"]) == {"fr3_link1": "link1", "fr3_link2": "link2"}
    assert short_names(["arm_a", "arm_ab"]) == {"arm_a": "a", "arm_ab": "ab"}
    assert short_names(["left_arm", "right_arm"]) == {
        "left_arm": "left_arm",
        "right_arm": "right_arm",
    }
    assert short_names(["arm_link"]) == {"arm_link": "arm_link"}


def test_the_smallest_eigenvalue_is_a_share_of_the_trace() -> None:
    """Closed form: diagonal matrices; without a trace the eigenvalue itself."""
    assert smallest_eigenvalue(np.diag([1.0, 2.0, 3.0, 4.0])) == pytest.approx(0.1, rel=1e-12)
    assert smallest_eigenvalue(np.diag([-5.0, 1.0, 1.0, 1.0])) == pytest.approx(-2.5, rel=1e-12)
    assert smallest_eigenvalue(np.diag([-2.0, 2.0, 0.0, 0.0])) == pytest.approx(-2.0, rel=1e-12)
    assert smallest_eigenvalue(np.zeros((4, 4))) == 0.0


def test_a_friction_of_zero_is_known(arm: Library) -> None:
    """Property: zero is written; only what is negative is omitted, with a note."""
    n = arm.n_joints
    phi = np.full((n, 1), 0.5)
    phi[0], phi[1] = 0.0, -0.5
    friction = joint_friction(arm, Friction(("viscous",)), phi)
    assert friction.damping == (0.0, None, *(0.5,) * (n - 2))
    assert [note.split(" was ")[0] for note in friction.notes] == [
        f"damping of {arm.joint_names[1]}"
    ]


@pytest.mark.parametrize(
    ("gravity", "is_turned"),
    [
        ((0.0, 0.0, -9.81), False),
        ((1.0, 0.0, -9.0), True),
        ((0.0, 1.0, -9.0), True),
        ((0.0, 0.0, 9.81), True),
        ((0.0, 0.0, 0.0), True),
    ],
)
def test_sdf_says_where_its_gravity_is_not_down(
    gravity: tuple[float, ...], is_turned: bool, arm: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a world's gravity points along −z; any other one needs a turned model."""
    monkeypatch.setattr(arm, "gravity", np.array(gravity))
    text = sdf_text(make_model(arm, arm.pi0))
    assert ("Rotate the model so that gravity" in text) == is_turned


def test_sdf_limits_are_those_of_the_robot(arm: Library) -> None:
    """Known case: the URDF of the arm; 1e16 is SDF's number for no limit."""
    root = fromstring(sdf_text(make_model(arm, arm.pi0)).split("-->")[-1])
    limits = {
        joint.get("name"): {each.tag: float(each.text or "nan") for each in limit}
        for joint in root.iter("joint")
        if (limit := joint.find("axis/limit")) is not None
    }
    free = {"lower": -1e16, "upper": 1e16}
    assert limits["z_turn"] == free
    assert limits["m_slide"] == {"lower": -1.0, "upper": 1.0, "effort": 10.0, "velocity": 1.0}


@pytest.mark.parametrize(
    ("share", "is_kept"), [(0.0, True), (1.0, True), (1.1, False), (np.nan, False)]
)
def test_a_header_may_differ_by_its_tolerance(
    share: float, is_kept: bool, arm: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: the tolerance itself is allowed; more, and what is not a number, is not."""
    model = make_model(arm, arm.pi0)
    arrays = header.header_arrays(model)
    read = {f"arm_identified_{key}": array for key, array in arrays.items()}
    monkeypatch.setattr(header, "read_back", lambda *_: read)
    monkeypatch.setattr(reload_check, "torque_difference", lambda *_: share * TOLERANCE)
    if is_kept:
        assert header.check_header(model, "").startswith("verified")
    else:
        with pytest.raises(ExportError, match="not written: the torques of pi differ"):
            header.check_header(model, "")


@pytest.mark.parametrize("kind", usual_formats())
def test_formats_say_whether_they_write_a_folder(kind: str, arm: Library) -> None:
    """Property: several files by their path where a format is a folder, otherwise one text."""
    phi = np.full((arm.n_joints, 1), 0.5)
    model = make_model(arm, arm.pi0, Friction(("viscous",)), phi, drives=drives_of_arm(arm))
    written = EXPORT_FORMATS[kind].write(model)
    assert isinstance(written, str) != EXPORT_FORMATS[kind].is_folder
