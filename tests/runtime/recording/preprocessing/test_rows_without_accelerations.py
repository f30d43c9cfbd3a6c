"""Methods that need accelerations refuse rows prepared without them."""

import pytest

from runtime import Recording
from runtime.errors import NeedsError, RecordingError
from runtime.estimators.regression.samples import samples_of
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation
from runtime.recording.preprocessing import prepare


def at(cutoff_hz: float, regressor: str = "momentum", **others: float) -> Preparation:
    return Preparation(filter="butterworth", cutoff_hz=cutoff_hz, regressor=regressor, **others)


@pytest.fixture(scope="module")
def made(lib: Library, noisy: Recording):
    return noisy.replace(ddq=None)


@pytest.mark.parametrize(
    ("method", "preset", "form"),
    [
        ("nn", None, "momentum"),
        ("ekf", None, "momentum"),
        ("iv", None, "momentum"),
        ("adam", "simulation", "momentum"),
        ("wls", None, "energy"),
    ],
)
def test_methods_that_do_not(lib, made, method, preset, form):
    """One sentence: what is missing and what to use."""
    with pytest.raises(NeedsError, match="use --settings regressor=acceleration, or one of map"):
        identify_recording(
            made, lib, method, preset=preset, preparation=at(2.0, form), friction=Friction()
        )


def test_whoever_asks_for_accelerations_is_told(lib, made):
    """The one door to ddq refuses where there is none."""
    samples = samples_of(prepare(made, at(2.0), lib=lib), lib)
    with pytest.raises(NeedsError, match="expected accelerations, got rows prepared without"):
        _ = samples.ddq
    with pytest.raises(RecordingError, match="library of the robot, got none"):
        prepare(made, at(2.0))
    with pytest.raises(RecordingError, match=r"\[preparation\] regressor expects one of"):
        at(2.0, "power")
