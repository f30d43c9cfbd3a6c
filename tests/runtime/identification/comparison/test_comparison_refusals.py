"""Comparisons that are refused in one sentence."""

import json
from pathlib import Path

import pytest

import runtime
from runtime import read_recording, write_recording
from runtime.errors import IdentificationError
from runtime.identification.comparison.run import compare
from runtime.identification.problem_setup import assemble
from runtime.library import Library
from tests.runtime.conftest import Command

EXAMPLE = Path(runtime.__file__).parent / "examples" / "fr3_simulated.npz"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--methods", "map,magic"), "--methods needs names with commas of map, adam"),
        (("--settings", "split=0.5,0.7,0.9"), "--split needs 2 numbers"),
        (
            ("--settings", "truth=no.json"),
            "expected a JSON with 70 numbers 'pi' of 'fr3', as simulate writes it, got 'no.json'",
        ),
        (("--settings", "controller=no.toml"), "cannot be read as TOML"),
        (("--friction", "treacle"), "treacle"),
    ],
)
def test_bad_options_are_one_sentence(
    lib: Library, command: Command, tmp_path: Path, words: tuple[str, ...], sentence: str
) -> None:
    """Property: exit code 2, one sentence, nothing written."""
    ran = command("compare", EXAMPLE, "--robot", lib.folder, *words)
    assert ran.code == 2
    assert sentence in ran.err
    assert len(ran.err.strip().splitlines()) == 1
    assert not (tmp_path / "results").exists()


def test_truths_of_others(lib: Library, command: Command, tmp_path: Path) -> None:
    """Property: a truth beside the log that is another robot's is refused, not ignored."""
    write_recording(read_recording(EXAMPLE), tmp_path / "log.npz")
    truth = {"robot": "other", "pi": lib.pi0.tolist()}
    (tmp_path / "log.truth.json").write_text(json.dumps(truth))
    ran = command("compare", "log.npz", "--robot", lib.folder, "--methods", "map")
    assert ran.code == 2
    assert "numbers 'pi' of 'fr3', as simulate writes it, got 'log.truth.json'" in ran.err


def test_unknown_methods_are_refused(lib: Library) -> None:
    """Property: a wrong name is an error of the call, not a row."""
    with pytest.raises(IdentificationError, match="there is no method 'magic'"):
        compare(assemble(read_recording(EXAMPLE), lib), ("map", "magic"))
