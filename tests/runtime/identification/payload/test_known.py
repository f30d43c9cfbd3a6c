"""Payloads that are given: which of them may calibrate torque sensors."""

import json

import pytest

from runtime.identification.payload.body import read_known_payload


@pytest.mark.parametrize(("facts", "identified"), [({}, False), ({"sigma": [0.01]}, True)])
def test_a_file_is_of_an_identified_payload_where_it_has_sigmas(facts, identified, tmp_path):
    """Property: a weighed mass has no σ in the file, one identified from torques does."""
    path = tmp_path / "payload.json"
    path.write_text(json.dumps({"mass": 2.0, "com": [0.0, 0.0, 0.1], **facts}))
    assert read_known_payload(str(path)).identified is identified


def test_numbers_are_a_weighed_payload():
    """Known case: MASS,CX,CY,CZ of a scale may calibrate the sensors."""
    assert not read_known_payload("2,0,0,0.1").identified
