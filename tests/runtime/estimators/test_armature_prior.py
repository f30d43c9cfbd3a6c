"""Prior of rotor inertia: files, models, the mean of an undetermined rotor, refusals."""

from pathlib import Path

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.estimators.prior_file import read_prior
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Recording

MJCF = '<mujoco><joint name="fr3_joint2" armature="0.2"/><joint name="x" armature="9"/></mujoco>'


def test_values_of_a_file_and_of_a_model(lib: Library, tmp_path: Path) -> None:
    """Property: a stated value replaces that of the model; other joints have no prior."""
    (tmp_path / "arm.xml").write_text(MJCF)
    path = tmp_path / "prior.toml"
    path.write_text('armature_from = "arm.xml"\n[armature]\nfr3_joint1 = [0.1, 0.01]\n')
    armature = read_prior(path, lib).armature
    assert armature is not None
    assert armature[0].tolist() == [0.1, 0.01]
    assert armature[1].tolist() == [0.2, 0.1]
    assert np.isinf(armature[2:, 1]).all()
    stated = ("", '<dynamics damping="2"/>', '<dynamics armature="0.3"/>')
    joints = "".join(f'<joint name="fr3_joint{k}">{x}</joint>' for k, x in enumerate(stated, 3))
    (tmp_path / "arm.xml").write_text(f"<robot>{joints}</robot>")
    armature = read_prior(path, lib).armature
    assert armature is not None
    assert armature[4].tolist() == [0.3, 0.15]
    assert np.isinf(armature[[1, 2, 3, 5, 6], 1]).all()


def test_the_prior_pulls_a_rotor_to_its_mean(
    lib: Library, noisy: Recording, tmp_path: Path
) -> None:
    """Property: a tight prior holds the rotor, a wide one leaves it where the data have it.

    Joint 1 turns about a vertical axis, so that only the sum of its rotor and the inertia of the
    link is in the data: the tight prior is met to a thousandth of its standard deviation.
    """
    path, terms = tmp_path / "prior.toml", Friction(("viscous", "coulomb", "rotor"))
    rotor = {}
    for sigma in (1e-4, 1e4):
        path.write_text(f"[armature]\nfr3_joint1 = [0.1, {sigma}]\n")
        result = identify_recording(
            noisy, lib, prior=read_prior(path, lib), friction=terms, certify=False
        )
        rotor[sigma] = result.phi[0, 2]
    free = identify_recording(noisy, lib, friction=terms, certify=False).phi[0, 2]
    assert rotor[1e-4] == pytest.approx(0.1, abs=1e-4)
    assert rotor[1e4] == pytest.approx(free, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[armature]\nelbow = 0.1\n", "unknown entry 'armature.elbow'; known are fr3_joint1"),
        (
            "[armature]\nfr3_joint1 = -0.1\n",
            r"armature\.fr3_joint1 expects kg·m² above 0, or \[kg·m², σ\], got",
        ),
        (
            "[armature]\nfr3_joint1 = [0.1, 0.1, 0.1]\n",
            r"armature\.fr3_joint1 expects kg·m² above 0, or \[kg·m², σ\], got",
        ),
        (
            "[armature]\nfr3_joint1 = [0.1, -0.1]\n",
            r"armature\.fr3_joint1 expects kg·m² above 0, or \[kg·m², σ\], got",
        ),
        (
            "[armature]\nfr3_joint1 = [0.0, 0.1]\n",
            r"armature\.fr3_joint1 expects kg·m² above 0, or \[kg·m², σ\], got",
        ),
        ("armature = 3\n", "armature expects a table, got 3"),
        ('armature_from = "none.xml"\n', "cannot be read"),
        ("armature_from = 3\n", "armature_from expects a text or nothing, got 3; correct it"),
        ('[friction.fr3_joint1]\nviscous = ["0.5", 0.1]\n', r"friction\.fr3_joint1\.viscous"),
        ("[friction.fr3_joint1]\nviscous = [true, 0.1]\n", r"friction\.fr3_joint1\.viscous"),
    ],
)
def test_a_wrong_prior_is_refused(lib: Library, tmp_path: Path, text: str, expected: str) -> None:
    """Property: one sentence that names the entry."""
    path = tmp_path / "prior.toml"
    path.write_text(text)
    with pytest.raises(IdentificationError, match=expected):
        read_prior(path, lib)


def test_armature_needs_the_column(lib: Library, noisy: Recording, tmp_path: Path) -> None:
    """Property: a prior of rotors without rotors in the model is refused, with the remedy."""
    path = tmp_path / "prior.toml"
    path.write_text("[armature]\nfr3_joint1 = 0.1\n")
    with pytest.raises(IdentificationError, match="add rotor to --friction"):
        identify_recording(noisy, lib, prior=read_prior(path, lib), friction=Friction(("viscous",)))
