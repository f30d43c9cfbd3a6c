"""Commands that `identify` prints with a doubt or a refusal: each works as it is printed."""

import shlex
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording, write_recording
from runtime.library import Library
from tests.runtime.conftest import Command

LATE_S = 0.03


def _late(log: Recording) -> Recording:
    """The torque stamped too late."""
    tau = log.required("tau")
    late = [np.interp(log.t - LATE_S, log.t, column) for column in tau.T]
    return log.replace(tau=np.stack(late, axis=1))


def _negated(log: Recording) -> Recording:
    return log.replace(tau=-log.required("tau"))


def _exchanged(log: Recording) -> Recording:
    return log.replace(tau=log.required("tau")[:, [0, 3, 2, 1, 4, 5, 6]])


def _strong(log: Recording) -> Recording:
    """The torque of joint 4 times 1.3."""
    return log.replace(tau=log.required("tau") * np.array([1, 1, 1, 1.3, 1, 1, 1]))


def _turned(log: Recording) -> Recording:
    """The encoder of joint 4 reads 3° too much."""
    return log.replace(q=log.q + np.radians([0, 0, 0, 3.0, 0, 0, 0]))


def _lifted(log: Recording) -> Recording:
    """The torque of joint 2 reads 3 N·m too much."""
    return log.replace(tau=log.required("tau") + np.array([0, 3.0, 0, 0, 0, 0, 0]))


def _same(log: Recording) -> Recording:
    return log


@pytest.mark.parametrize(
    ("put", "more", "code", "mark", "cause"),
    [
        (_late, (), 0, "run: ", "too late"),
        (_negated, (), 2, "proposed by: ", "against the model"),
        (_exchanged, (), 0, "run: ", "exchanged"),
        (_strong, (), 0, "run: ", "mostly by a torque gain"),
        (_turned, (), 0, "run: ", "those of an encoder"),
        (_lifted, ("--friction", "viscous,coulomb"), 0, "run: ", "those of a constant torque"),
        (_same, ("--method", "ols"), 0, "run: ", "not physically consistent"),
    ],
    ids=["late", "negated", "exchanged", "gain", "encoder zero", "offset", "method"],
)
def test_a_command_of_an_advice_removes_the_doubt(
    put,
    more: tuple[str, ...],
    code: int,
    mark: str,
    cause: str,
    clean: Recording,
    lib: Library,
    command: Command,
    tmp_path: Path,
) -> None:
    """Property: the printed command runs, and then, by the recipe that it wrote, no doubt is left
    of the same kind.
    """
    write_recording(put(clean), tmp_path / "log.npz")
    words = ("log.npz", "--robot", lib.folder, *more, "--settings", "report=false", "--out", "out")
    ran = command("identify", *words)
    assert ran.code == code, ran.err
    printed = (ran.out + ran.err).split(mark)[1].splitlines()[0]
    shown = shlex.split(printed.removeprefix("python -m runtime "))
    again = command(*shown)
    if shown[0] in {"inspect", "gains"}:
        assert again.code == (shown[0] == "inspect"), again.err
        again = command("identify", *words, "--recipe", shown[-1], "--overwrite")
    assert again.code == 0, again.err
    said = " ".join(again.out.split())
    assert cause not in said, said


def test_a_file_without_header_is_inspected_as_printed(
    clean: Recording, lib: Library, command: Command, tmp_path: Path
) -> None:
    """Property: the refusal names the log and the robot, and its command writes the recipe."""
    rows = np.column_stack([clean.t, clean.q, clean.required("tau")])[:300]
    np.savetxt(tmp_path / "bare.csv", rows, delimiter=",")
    ran = command("identify", "bare.csv", "--robot", lib.folder)
    assert ran.code == 2
    again = command(*shlex.split(ran.err.split("proposed: python -m runtime ")[1]))
    assert again.code in {0, 1}, again.err
    assert (tmp_path / "proposed.toml").is_file()
