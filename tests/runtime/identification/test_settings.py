"""Settings: one frozen object for every way to identify, with keywords beside it."""

import inspect
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.identification.settings import NAMES, SettingKeywords, Settings, settings_from
from runtime.identification.several_logs import NamedLog
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording, Split, write_recording
from runtime.recording.streamed import open_streamed

TERMS = Friction(("viscous", "coulomb"), 0.03)


def test_settings_and_keywords_give_the_same_answer(lib: Library, noisy: Recording) -> None:
    """Property: settings, keywords, and a keyword that replaces a setting, to the last bit."""
    usual = Settings(method="ols", friction=TERMS, certify=False, refit=False)
    by_settings = identify_recording(noisy, lib, usual)
    by_keywords = identify_recording(noisy, lib, "ols", friction=TERMS, certify=False)
    replaced = identify_recording(noisy, lib, Settings(friction=TERMS, refit=False), method="ols",
                                certify=False)  # fmt: skip
    assert by_settings.method == by_keywords.method == replaced.method == "ols"
    for other in (by_keywords, replaced):
        assert np.array_equal(by_settings.pi, other.pi)
        assert np.array_equal(by_settings.phi, other.phi)


def test_every_setting_is_documented() -> None:
    """Property: the fields stand in the class's docstring, and are keywords of identify."""
    for name in NAMES:
        assert f"\n    {name}: " in str(inspect.getdoc(Settings))
        assert name in SettingKeywords.__annotations__


@pytest.mark.parametrize(
    ("keywords", "match"),
    [({"cut_off": 3.0}, r"expected settings of method, preset, .*, got 'cut_off'; correct")],
)
def test_unknown_keywords_are_refused(keywords: dict[str, object], match: str) -> None:
    """Property: one sentence with the names that there are."""
    with pytest.raises(IdentificationError, match=match):
        settings_from(None, keywords)


def test_settings_that_a_task_cannot_honour_are_refused(
    lib: Library, noisy: Recording, tmp_path: Path
) -> None:
    """Property: a streamed log and several logs name the settings to leave out."""
    write_recording(noisy, tmp_path / "log.npz")
    log = open_streamed(tmp_path / "log.npz")
    with pytest.raises(IdentificationError, match="a streamed log takes no robust; leave it out"):
        identify_recording(log, lib, robust=True)
    twice = [NamedLog(name, noisy) for name in ("a", "b")]
    match = "several logs takes no validation, test; leave them out"
    with pytest.raises(IdentificationError, match=match):
        identify_recording(twice, lib, Settings(validation=noisy, test=noisy, split=Split()))


def test_a_preparation_excludes_its_steps() -> None:
    """Property: a cut-off, rate or regressor beside a preparation is refused, not ignored."""
    match = "a preparation states every step, so cutoff, rate beside it would have no effect"
    with pytest.raises(IdentificationError, match=match):
        Settings(preparation=Preparation(), cutoff=10.0, rate=100.0)
    assert Settings(preparation=Preparation()).cutoff is None
