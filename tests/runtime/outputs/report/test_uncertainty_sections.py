"""Tables of the report on uncertainty."""

import numpy as np
import pytest

from runtime.outputs.report.uncertainty import (
    LinkUncertainty,
    ResultUncertainty,
    read_uncertainty,
    uncertainty_sections,
)


def test_parameters_are_named_by_their_verdict() -> None:
    """Oracle: m and XX are identified, mX has no effect, all others keep the prior."""
    verdicts = ["prior-dominated"] * 10
    verdicts[0] = verdicts[4] = "identified"
    verdicts[1] = "unobservable"
    link = LinkUncertainty(0.1, None, tuple(verdicts))
    one = np.ones(1)
    whole = ResultUncertainty("advice", 10.0, 1.0, False, (link,), one, one, one)
    section = uncertainty_sections(whole, ("joint1",), ("link1",))[0]
    cells = section.table.rows[0]
    assert cells[3:] == ("m XX", "mY mZ YY ZZ XY XZ YZ", "mX")
    assert "no effect on the torque" in section.lead


def test_the_gain_that_a_log_cannot_show_has_a_column() -> None:
    """Property: a share per joint, "any" for no limit; older results have no column."""
    link = LinkUncertainty(0.1, None, ("identified",) * 10)
    two = np.ones(2)
    known = ResultUncertainty("advice", 10.0, 1.0, False, (link,), two, two, two, (0.45, None))
    older = ResultUncertainty("advice", 10.0, 1.0, False, (link,), two, two, two)
    table = uncertainty_sections(known, ("joint1", "joint2"), ("link1",))[1].table
    assert [row[-1] for row in table.rows] == ["45\N{NO-BREAK SPACE}%", "any"]
    assert len(uncertainty_sections(older, ("joint1", "joint2"), ("link1",))[1].table.header) == 4


def test_a_link_with_too_few_verdicts_is_damaged() -> None:
    """Property: a result.json with nine words for ten parameters is refused when it is read."""
    link = {"mass_sigma": 1.0, "com_sigma": None, "verdicts": ["identified"] * 9}
    facts = {
        **{"advice": "", "n_eff": 1.0, "inflation": 1.0, "boundary": False},
        **{"links": [link], "noise": [1.0], "model_band": [1.0], "white": [1.0]},
    }
    with pytest.raises(ValueError, match="verdicts, expected 10 words"):
        read_uncertainty(facts, 1, 1)
