"""Several logs of a commanded torque: their ends, and the dry friction of the first."""

from dataclasses import replace
from pathlib import Path

from runtime.identification.prepared_log import PreparedLog
from runtime.identification.settings import Settings
from runtime.identification.several_logs.drives import with_drives
from runtime.library import load
from runtime.recording import Friction, Preparation
from runtime.recording.friction import DRIVE
from tests.runtime.servo_logs import dry_servo_log

PREPARATION = Preparation(filter="butterworth", cutoff_hz=10.0)


def test_friction_is_chosen_on_the_first_log(tiny_built: Path, tmp_path: Path) -> None:
    """Property: columns that are named stay, and a measured torque is left as it was."""
    lib = load(tiny_built)
    log, _ = dry_servo_log(lib, tmp_path, memory=True, slope=0.0)
    usual = PreparedLog(log, PREPARATION, None, Friction(DRIVE))
    first, other = with_drives([usual, usual], lib, Settings(delay="auto"))
    assert first.friction is not None
    assert first.friction.columns == ("viscous", "dahl", "offset", "rotor")
    assert first.notes[-1].startswith("dry friction has a memory")
    assert other.friction == Friction(DRIVE)
    for each in (first, other):
        assert each.preparation == replace(PREPARATION, trim_s=0.1)
    named = Settings(friction="viscous,coulomb,offset,rotor")
    assert with_drives([usual, usual], lib, named)[0].friction == Friction(DRIVE)
    for left in (replace(usual, is_at_rest=True), replace(usual, recording=measured(log))):
        assert with_drives([left, left], lib, Settings()) == [left, left]


def measured(log):
    """The log, its torque as if from a sensor."""
    return log.replace(torque_source="measured")
