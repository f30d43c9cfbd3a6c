"""result_file: what is said of an answer that deserves no trust, and of none that does."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime import Identification, Recording, write_recording
from runtime.identification.metrics import TorqueError
from runtime.identification.result_file import warnings_of
from runtime.library import Library
from tests.runtime.conftest import Command

JOINTS = np.ones(7)


def said(result: Identification, before: float, after: float) -> str:
    errors = (TorqueError(JOINTS, overall, JOINTS) for overall in (before, after))
    return " ".join(warnings_of(result, *errors))


@pytest.mark.parametrize(("after", "worse"), [(1.0, False), (2.1, False), (2.3, True)])
def test_an_answer_worse_than_the_urdf(
    panda_adam: Identification, after: float, worse: bool
) -> None:
    """Property: it is said with both numbers, and not where chance does it."""
    assert (f"2 % became {after:.3g} %): keep the URDF" in said(panda_adam, 2.0, after)) == worse


def test_torque_that_nothing_explains(panda_adam: Identification) -> None:
    """Property: the next command is named, and only what was not asked for already."""
    assert "unexplained" not in said(panda_adam, 30.0, 19.0)
    requested = said(panda_adam, 30.0, 21.0)  # low-passed, with three columns of friction
    assert "21 % of the test torque is unexplained" in requested
    assert "python -m runtime inspect LOG" in requested
    assert "--cutoff" not in requested
    assert "--friction" not in requested
    train = panda_adam.train.replace(history=("Read 9 rows.",))
    bare = replace(panda_adam, train=train, phi=np.zeros((7, 0)))
    assert "--cutoff auto; no friction was modelled: --friction auto; check units" in said(
        bare, 30.0, 21.0
    )
    assert "--cutoff" not in said(replace(bare, method="ekf"), 30.0, 21.0)


def test_joints_that_never_move(panda_adam: Identification) -> None:
    """Property: they are named; half a millimetre of vibration is no motion."""
    assert "never moved" not in said(panda_adam, 4.0, 2.0)
    q = panda_adam.train.q.copy()
    q[:, [1, 4]] = np.linspace(1.0, 1.0005, len(q))[:, None]
    still = replace(panda_adam, train=panda_adam.train.replace(q=q))
    assert "fr3_joint2, fr3_joint5 never moved" in said(still, 4.0, 2.0)


@pytest.mark.parametrize(("moving", "words"), [(0, "no joint moves"), (2, "(5 of 7 joints)")])
def test_rest_is_said_first(
    clean: Recording, lib: Library, command: Command, tmp_path: Path, moving: int, words: str
) -> None:
    """Property: before the table of errors, and first in result.json."""
    rest = np.arange(7) >= moving
    still = clean.replace(
        q=np.where(rest, clean.q[0], clean.q), dq=np.where(rest, 0.0, clean.dq), ddq=None
    )
    write_recording(still, tmp_path / "still.npz")
    ran = command("identify", "still.npz", "--robot", lib.folder, "--out", "out")
    assert ran.code == 0, ran.err
    assert words in ran.out
    assert ran.out.index("warning: ") < ran.out.index("torque error on test data")
    assert words in json.loads((tmp_path / "out" / "result.json").read_text())["warnings"][0]


def test_an_answer_shown_in_a_notebook_is_a_line(panda_adam: Identification) -> None:
    """Property: no arrays; who, from what, and whether it can exist."""
    shown = repr(panda_adam)
    assert shown.startswith("Identification('adam', fr3 from ")
    assert "consistent; " in shown
    assert panda_adam.uncertainty is not None
    assert repr(panda_adam.uncertainty) == f"Uncertainty({panda_adam.uncertainty.advice()})"
    assert repr(panda_adam.train).endswith(" s at 100 Hz; q dq ddq tau)")
    assert max(map(len, (shown, repr(panda_adam.train)))) < 300


def test_what_was_wrong_with_the_log(panda_adam: Identification) -> None:
    """Property: corrupt rows with their lines, and warnings of the reader, also of joined logs."""
    history = (
        "Read 4500 rows.",
        "Dropped 1 of 9 rows as corrupt (cut short): lines 4.",
        "a: Warning: a rate of 1 Hz is unusual.",
        "Dropped 3 segments with fewer than 15 samples (9 rows).",
    )
    noted = replace(panda_adam, train=panda_adam.train.replace(history=history))
    error = TorqueError(JOINTS, 2.0, JOINTS)
    sentences = set(warnings_of(noted, error, error))
    assert sentences - set(warnings_of(panda_adam, error, error)) >= {
        "Dropped 1 of 9 rows as corrupt (cut short): lines 4",
        "a: a rate of 1 Hz is unusual",
    }
    assert not any("segments" in sentence for sentence in sentences)
