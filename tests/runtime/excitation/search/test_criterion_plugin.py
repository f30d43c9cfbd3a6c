"""A criterion and a format of motions of another package, used through the command line."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from runtime.errors import IdentificationError
from runtime.excitation.motion_export import MOTION_FORMATS
from runtime.excitation.search.criteria import CRITERIA
from runtime.excitation.search.design_settings import DesignSettings, settings_from
from runtime.library import Library
from tests.plugins import add_toy
from tests.runtime.conftest import Command

TRACE = """
import numpy as np
from runtime.excitation.search.criteria import Criterion, smooth_goal


def log_trace(gram):
    total = float(np.trace(gram))
    return -np.log(total) / 2, -np.eye(len(gram)) / total


TRACE = Criterion(
    "trace",
    "inverse root of the trace of the Gram matrix",
    "1/(N·m)",
    lambda lib, home, information: smooth_goal(log_trace),
    needs_information=False,
)
"""
KNOTS = """
from runtime.excitation.motion_export import MotionFormat


def write(motion, rate, path):
    path.write_text(f"{motion.lib.name} {motion.trajectory.duration:g} s at {rate:g} Hz")


KNOTS = MotionFormat("knots", ".knots.txt", "one line about the motion", write)
"""


def test_a_criterion_from_outside(
    lib: Library, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: help names both records, the search minimises the one, the other is written."""
    site = tmp_path / "site"
    site.mkdir()
    add_toy(site, CRITERIA, "trace", TRACE, "TRACE", monkeypatch)
    env = add_toy(site, MOTION_FORMATS, "knots", KNOTS, "KNOTS", monkeypatch)
    words = [sys.executable, "-m", "runtime", "excite", "--help"]  # written at the import
    helped = subprocess.run(
        words, cwd=tmp_path, env=env, capture_output=True, text=True, check=False
    )
    assert helped.returncode == 0, helped.stderr
    shown = " ".join(helped.stdout.split()).replace("│ │ ", "")
    assert "trace: inverse root of the trace" in shown
    options = (
        "--duration",
        "4",
        "--settings",
        "harmonics=2",
        "--settings",
        "starts=1",
        "--criterion",
        "trace",
    )
    ran = command(
        "excite",
        "--robot",
        str(lib.folder),
        *options,
        "--table",
        "none",
        "--export",
        "knots",
        "--out",
        "m.json",
    )
    assert ran.code == 0, ran.err
    assert "trace (1/(N·m))" in " ".join(ran.out.split())
    facts = json.loads((tmp_path / "m.json").read_text())
    assert len(facts["criterion_of_starts"]) == 1
    assert facts["criterion"] == "trace"
    assert (tmp_path / "m.knots.txt").read_text() == "fr3 4 s at 1000 Hz"


def test_every_criterion_describes_itself() -> None:
    """Property: a name, a sentence and a unit; only log cond ends in a kink."""
    for record in CRITERIA.records():
        assert CRITERIA[record.name] is record
        assert len(record.sentence.split()) > 2
        assert record.unit
        assert record.is_kinked == (record.name == "cond")


def test_settings_from_keywords() -> None:
    """Property: keywords replace options of the settings; an unknown one is named."""
    settings = DesignSettings(duration=6.0, starts=2)
    assert settings_from(settings, {}) == settings
    assert settings_from(settings, {"starts": 3}) == DesignSettings(duration=6.0, starts=3)
    assert settings_from(None, {}) == DesignSettings()
    with pytest.raises(IdentificationError, match="no option 'start'; did you mean 'starts'"):
        settings_from(settings, {"start": 3})
    with pytest.raises(IdentificationError, match="no option 'x'; choose from duration, harmonics"):
        settings_from(None, {"x": 3})
