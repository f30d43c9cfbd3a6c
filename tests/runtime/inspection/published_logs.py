"""Published logs: what only the maker of the robot knows, and errors in another band."""

from pathlib import Path

from runtime.estimators.regression.samples import samples_of
from runtime.identification import metrics
from runtime.identification.saved_result import read_result
from runtime.library import Library
from runtime.recording import Preparation, read_recording
from runtime.recording.preprocessing import prepare

KNOWN_RATE = "rate_hz = 5000"
KNOWN_ZEROS = "offset = [0.0, -1.5707963267948966, 1.5707963267948966, 0.0, 0.0, 0.0]"
KNOWN_UNIT = ('unit = "A"', 'unit = "N*m"')  # of curr_data.csv, whose name says otherwise
KNOWN_GEARS = """[gear]
matrix = [
    [32.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 32.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 45.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, -48.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 45.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 32.0, 32.0],
]
"""


def in_band(
    folder: Path, log: Path, recipe: Path, lib: Library, f_c: float, span: tuple[float, float]
) -> float:
    """Overall error of a result on the rows of a span of time, low-passed at another cut-off.

    Args:
        folder: of the result.
        log: its log.
        recipe: that reads the log.
        lib: library of the robot.
        f_c: cut-off [Hz].
        span: from, to [s].

    Returns:
        The error [%].
    """
    saved, recording = read_result(folder), read_recording(log, recipe)
    single = recording.preparation
    plan = Preparation(
        clock_tick=single.clock_tick,
        max_gap_s=single.max_gap_s,
        filter="butterworth",
        cutoff_hz=f_c,
        rate_hz=10 * f_c,
        rest_speed=0.02,
    )
    rows = prepare(recording, plan, saved.friction, lib=lib)
    rows = rows.take((rows.t >= span[0]) & (rows.t <= span[1]), "test")
    s = samples_of(rows, lib)
    rigid = lib.inverse_dynamics(s.q, s.dq, s.ddq, saved.pi)
    return float(metrics.torque_error(s.tau, rigid + s.friction(saved.phi)).overall)
