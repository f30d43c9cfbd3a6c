"""Options of `symgen identify`: files that they name, and those that do not fit together."""

from pathlib import Path
from typing import TYPE_CHECKING

from runtime.errors import IdentificationError
from runtime.library import Library

if TYPE_CHECKING:
    from runtime.estimators.prior_file import PriorFile
    from runtime.simulation.controller_file import ClosedLoop


def require_for_several(controller: Path | None, drives: object) -> None:
    """Refuse options of one log where several are given.

    Args:
        controller: value of --controller.
        drives: values of --encoder-bias and --symmetric.

    Raises:
        IdentificationError: one of them is given.
    """
    if controller is not None:
        raise IdentificationError(
            "--controller belongs to one log, but several are given; leave it out"
        )
    if drives:
        raise IdentificationError(
            "--encoder-bias and --symmetric belong to one log, but several are given; identify "
            "each alone"
        )


def require_for_streamed(controller: Path | None, drives: object) -> None:
    """Refuse options that need the samples of the whole log, which is streamed.

    Args:
        controller: value of --controller.
        drives: values of --encoder-bias and --symmetric.

    Raises:
        IdentificationError: one of them is given.
    """
    if controller is not None:
        raise IdentificationError(
            "the closed loop of --controller is simulated over all samples, but the log is "
            "streamed; leave out --controller, or give --no-stream"
        )
    if drives:
        raise IdentificationError(
            "--encoder-bias and --symmetric need the whole log in memory, but it is streamed; "
            "give --no-stream"
        )


def prior_of(path: Path | None, lib: Library) -> "PriorFile | None":
    """Inertial prior of --prior.

    Args:
        path: of the file; None without the option.
        lib: library of the robot.

    Returns:
        The prior.

    Raises:
        RuntimeFault: the file is no prior of this robot.
    """
    if path is None:
        return None
    from runtime.estimators.prior_file import read_prior

    return read_prior(path, lib)


def controller_of(path: Path | None, lib: Library) -> "ClosedLoop | None":
    """Closed loop of --controller.

    Args:
        path: of the file; None without the option.
        lib: library of the robot.

    Returns:
        The closed loop.

    Raises:
        RuntimeFault: the file describes no controller of this robot.
    """
    if path is None:
        return None
    from runtime.simulation.controller_file import read_controller

    return read_controller(path, lib)
