"""Tables of the report on uncertainty."""

import numpy as np

from runtime.outputs.report.uncertainty import (
    LinkUncertainty,
    ResultUncertainty,
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
