"""Functions of `import runtime`: a log from inspection to report in memory; arguments of no use."""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest

import runtime
from runtime.errors import RuntimeFault
from runtime.excitation.search.design_settings import DesignKeywords
from runtime.identification.result_file import write_result
from runtime.identification.settings import SettingKeywords
from runtime.library import Library


def test_a_log_from_inspection_to_report(fr3: Library, tmp_path: Path) -> None:
    """Oracle: the saved result gives the errors and the URDF of the result in memory."""
    log = runtime.read_recording("fr3_simulated")
    assert runtime.inspect("fr3_simulated", fr3).robot == "fr3"
    result = runtime.identify(log, fr3, friction="viscous,coulomb", refit=False)
    write_result(result, tmp_path, "a test")
    ours = runtime.evaluate(result, log, fr3)
    theirs = runtime.evaluate(str(tmp_path), "fr3_simulated")
    assert ours.torque_error_percent == theirs.torque_error_percent
    after, before = (
        ours.torque_error_percent.after_overall,
        ours.torque_error_percent.before_overall,
    )
    assert after is not None
    assert before is not None
    assert after < before
    assert ours.mass_matrix.is_positive_definite
    (header,) = runtime.export(result, tmp_path / "models", "header")
    assert header.path == tmp_path / "models" / "fr3_identified.h"
    assert runtime.report(tmp_path).read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_a_motion_within_all_limits(robot: Callable[[str], Library]) -> None:
    """Property: `excite` keeps what `design` does not: torque and distances."""
    best = runtime.excite(robot("gantry"), duration=3.0, harmonics=2, starts=1)
    assert best.safety is not None
    assert max(best.use.values()) <= 1 + 1e-9


@pytest.mark.parametrize(
    ("record", "keywords"),
    [(runtime.Settings, SettingKeywords), (runtime.DesignSettings, DesignKeywords)],
)
def test_keywords_are_the_fields(record: type, keywords: type) -> None:
    """Property: names and types of the keywords are those of the settings."""
    hints = get_type_hints(record)
    assert get_type_hints(keywords) == {each.name: hints[each.name] for each in fields(record)}


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda lib, _: runtime.inspect(3, lib), "file or folder of a log, got 3"),
        (lambda _, log: runtime.inspect(log, "fr3"), "a library, as runtime.load gives it"),
        (lambda lib, _: runtime.identify("log.csv", lib), "a log, as runtime.read_recording gives"),
        (lambda _, log: runtime.identify(log, "fr3"), "a library, as runtime.load gives it"),
        (lambda lib, log: runtime.evaluate(3, log, lib), "a result of runtime.identify or"),
        (lambda lib, log: runtime.excite(log), "a library, as runtime.load gives it"),
        (lambda lib, log: runtime.export(lib, "models"), "a result of runtime.identify or"),
        (lambda lib, log: runtime.export(lib, 3), "a folder for the files, got 3"),
        (lambda lib, log: runtime.report(3), "the folder of a result, got 3"),
        (lambda lib, log: runtime.read_result(3), "the folder of a result, got 3"),
        (lambda lib, log: runtime.load(3), "the name or folder of a robot, got 3"),
        (lambda lib, log: runtime.read_recording(3), "the path or name of a log, got 3"),
        (lambda lib, log: runtime.write_recording(lib, "log.csv"), "a log, as runtime.read_rec"),
        (lambda lib, log: runtime.choose_friction(3, lib), "a log, as runtime.read_recording"),
        (lambda lib, log: runtime.choose_default_friction("a", lib), "a log, as runtime.read_rec"),
        (lambda lib, log: runtime.identify_payload("log.csv", lib), "a log, as runtime.read_rec"),
        (lambda lib, log: runtime.identify_gains(3, 3, lib, 3), "a log, as runtime.read_recording"),
    ],
)
def test_a_wrong_type_gets_a_sentence(
    call: Callable[[Any, Any], object], sentence: str, fr3: Library
) -> None:
    """Property: what was expected and what came, for each function."""
    log = runtime.Recording(t=np.arange(3.0), q=np.zeros((3, 7)))
    with pytest.raises(RuntimeFault) as error:
        call(fr3, log)
    assert f"expected {sentence}" in str(error.value).replace("expected the file", "expected file")
