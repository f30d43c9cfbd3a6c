"""Logs of a few seconds, in which noise looks like a change."""

import pytest

from runtime import read_recording, write_recording


@pytest.mark.parametrize("start", [214, 642])
def test_short_logs_of_a_healthy_robot_have_not_changed(lib, tmp_path, command, start):
    """Property: 2.5 s of one log, of which the test has 1 s, named a change in others (p = 1e-9).

    A log in which the noise cannot be told from changes is refused.
    """
    log = read_recording("fr3_simulated")
    for name, rows in (("model", (start, start + 251)), ("later", (251, 502)), ("short", (0, 120))):
        write_recording(log.take(slice(*rows), name), tmp_path / f"{name}.csv")
    words = ("--robot", lib.folder, "--settings", "report=false", "--out", "out")
    assert command("identify", "model.csv", *words).code == 0
    assert command("watch", "out", "later.csv").code == 0
    for logs in (("short.csv",), ("later.csv", "--reference", "short.csv")):
        ran = command("watch", "out", *logs)
        assert ran.code == 2
        assert "'short' holds 0.79 s of motion, in which changes of this robot look" in ran.err
