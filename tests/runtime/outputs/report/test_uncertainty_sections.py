"""Tables of the report on uncertainty."""

import json
from pathlib import Path

import pytest

from runtime.errors import RecordingError
from runtime.identification.result_record import LinkUncertainty, UncertaintyPart
from runtime.identification.saved_result import read_record
from runtime.outputs.report.report import uncertainty_sections
from tests.runtime import pages


def uncertainty(verdicts: list[str], joints: int, gains: tuple = ()) -> UncertaintyPart:
    """Uncertainty of one link."""
    link = LinkUncertainty(mass_sigma=0.1, com_sigma=None, verdicts=tuple(verdicts))
    each = (1.0,) * joints
    return UncertaintyPart(
        **{"advice": "advice", "n_eff": 10.0, "inflation": 1.0, "excited": 0, "boundary": False},
        **{"weakest_direction": None, "links": (link,), "pi_sigma": (), "beta_sigma": ()},
        **{"posterior_over_prior": (), "beta_verdicts": (), "noise": each, "model_band": each},
        **{"white_lag_share": each, "detectable_gain_error": gains},
    )


def test_parameters_are_named_by_their_verdict() -> None:
    """Oracle: m and XX are identified, mX has no effect, all others keep the prior."""
    verdicts = ["prior-dominated"] * 10
    verdicts[0] = verdicts[4] = "identified"
    verdicts[1] = "unobservable"
    section = uncertainty_sections(uncertainty(verdicts, 1), ("joint1",), ("link1",))[0]
    cells = section.table.rows[0]
    assert cells[3:] == ("m XX", "mY mZ YY ZZ XY XZ YZ", "mX")
    assert "no effect on the torque" in section.lead


def test_the_gain_that_a_log_cannot_show_has_a_column() -> None:
    """Property: a share per joint, "any" for no limit; older results have no column."""
    verdicts = ["identified"] * 10
    known, older = uncertainty(verdicts, 2, (0.45, None)), uncertainty(verdicts, 2)
    table = uncertainty_sections(known, ("joint1", "joint2"), ("link1",))[1].table
    assert [row[-1] for row in table.rows] == ["45\N{NO-BREAK SPACE}%", "any"]
    assert len(uncertainty_sections(older, ("joint1", "joint2"), ("link1",))[1].table.header) == 4


def test_a_link_with_too_few_verdicts_is_damaged(tmp_path: Path) -> None:
    """Property: a result.json with nine words for ten parameters is refused when it is read."""
    link = {"mass_sigma": 1.0, "com_sigma": None, "verdicts": ["identified"] * 9}
    facts = {
        **{"advice": "", "n_eff": 1.0, "inflation": 1.0, "boundary": False},
        **{"links": [link] * 2, "noise": [1.0] * 2, "model_band": [1.0] * 2, "white": [1.0] * 2},
    }
    raw = pages.result() | {"uncertainty": facts}
    (tmp_path / "result.json").write_text(json.dumps(raw))
    match = r"uncertainty.links\[0\].verdicts expects the shape \(10,\), got \(9,\)"
    with pytest.raises(RecordingError, match=match):
        read_record(tmp_path / "result.json")
