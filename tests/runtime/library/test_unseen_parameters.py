"""Designs in a narrow range of positions, where some base parameters act as others do."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.excitation.motion.trajectory import read_trajectory
from runtime.excitation.search.design import design
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import information
from runtime.excitation.search.prediction import without_unseen
from runtime.library import Library
from tests.runtime.conftest import Command

NARROW = 0.03
"""Share of the limits, in which two joints move by some hundredths of a radian."""


def test_parameters_that_no_motion_shows_are_left_out(
    wrist: Library, command: Command, tmp_path: Path
) -> None:
    """Oracle: by least squares on the designed motion, over columns of unit length, the kept
    columns produce each one left out to 1e-4 (ten times the limit of random motions), and their
    condition is one that Gram matrices resolve (1e7).

    The design for all parameters is refused, since the search cannot resolve them.
    """
    usual = DesignSettings(margin=NARROW, starts=1, duration=4.0, criterion="cond")
    with pytest.raises(IdentificationError, match="widen the range of positions"):
        design(wrist, usual)
    path = tmp_path / "narrow.json"
    words = (
        "--settings",
        "document=true",
        "--duration",
        "4",
        "--settings",
        "starts=1",
        "--settings",
        f"margin={NARROW}",
        "--settings",
        "processes=1",
    )
    ran = command("excite", "--robot", wrist.folder, *words, "--out", path)
    assert ran.code == 0
    file = json.loads(path.read_text())
    left = file["prediction"]["left_out"]
    assert 0 < len(left) < len(wrist.base_columns)
    assert len(file["prediction"]["sigma"]) == len(wrist.base_columns) - len(left)
    said = " ".join(ran.out.split())
    assert f"shows {len(left)} of {len(wrist.base_columns)} base parameters" in said
    assert "no figure counts the errors" in said
    motion = read_trajectory(path, wrist)
    rows = wrist.base_regressor(*motion.at(wrist, np.linspace(0, motion.duration, 200))[:3])
    columns = rows.reshape(-1, rows.shape[2])
    unit = columns / np.linalg.norm(columns, axis=0)
    kept = np.delete(unit, left, axis=1)
    for k in left:
        best = np.linalg.lstsq(kept, unit[:, k], rcond=None)[0]
        assert np.linalg.norm(unit[:, k] - kept @ best) < 1e-4
    assert np.linalg.cond(kept) < 1e7


def test_a_wide_range_shows_all(wrist: Library) -> None:
    """Property: nothing changes where random motions show all unknowns, or for a payload."""
    planned = information(wrist)
    wide = DesignSettings(starts=1, information=planned, criterion="mixed")
    assert without_unseen(wrist, wide, planned) == (wide, planned, "")
    payload = information(wrist, payload=True)
    narrow = DesignSettings(margin=NARROW, information=payload, criterion="a")
    assert without_unseen(wrist, narrow, payload)[2] == ""
