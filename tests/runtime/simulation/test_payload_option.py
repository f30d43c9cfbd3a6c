"""Payloads of virtual robots, by numbers and by files."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from runtime.errors import IdentificationError
from runtime.library import Library, to_pinocchio_order
from runtime.simulation import Box, read_payload


def test_a_box_is_pinocchios(fr3: Library) -> None:
    """Oracle: pinocchio's box, moved to its place, in its parameter order."""
    box = Box(1.8, (0.01, 0.02, 0.167), (0.1, 0.08, 0.1), link="fr3_link6")
    theirs = pinocchio.Inertia.FromBox(1.8, 0.1, 0.08, 0.1)
    theirs.lever = np.array(box.com)
    pi = to_pinocchio_order(box.pi(fr3)).reshape(7, 10)
    assert pi[5] == pytest.approx(theirs.toDynamicParameters(), abs=1e-15)
    assert not np.delete(pi, 5, axis=0).any()
    assert Box(1.8, (0, 0, 0)).place(fr3) == 6


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2", "--payload expects MASS,CX,CY,CZ"),
        ("a,b,c,d", "--payload expects MASS,CX,CY,CZ"),
        ("-1,0,0,0", "mass above 0 kg"),
        ("nan,0,0,0", "mass above 0 kg"),
        ("1,0,0,0,0.1,0.1,-0.1", "a payload expects edges from 0 m up"),
        ("none.toml", "cannot be read as TOML"),
    ],
)
def test_payloads_that_are_none(text: str, message: str) -> None:
    """Property: one sentence that says what a payload is."""
    with pytest.raises(IdentificationError, match=message):
        read_payload(text)


def test_payloads_of_files(tmp_path: Path, fr3: Library) -> None:
    """Property: the file says what the option says, and its link; unknown keys are refused."""
    file = tmp_path / "box.toml"
    file.write_text("mass = 1.8\ncom = [0.01, 0.02, 0.167]\nsize = [0.1, 0.08, 0.1]\n")
    assert read_payload(str(file)) == read_payload("1.8,0.01,0.02,0.167,0.1,0.08,0.1")
    file.write_text("mass = 1.8\ncom = [0, 0, 0]\nlink = 'nowhere'\n")
    with pytest.raises(IdentificationError, match="no moving link of 'fr3' is called 'nowhere'"):
        read_payload(str(file)).pi(fr3)
    for text, message in (
        ("mass = 1\ncom = [0, 0, 0]\ncolour = 3", "unknown key 'colour'; known are mass, com"),
        ("mass = 1", "expects the key com, got none; add it"),
        ("mass = 1\ncom = 3", "com expects a list, got 3; correct it"),
    ):
        file.write_text(text)
        with pytest.raises(IdentificationError, match=message):
            read_payload(str(file))
