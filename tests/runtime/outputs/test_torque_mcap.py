"""MCAP of torques: read again by the reader of bags and by rosbags."""

import struct

import numpy as np
from defusedxml.ElementTree import fromstring

from runtime.monitoring.observation import Observation
from runtime.outputs.torque_mcap import TOPICS, plotjuggler_layout, torque_mcap
from runtime.recording import Recording
from runtime.recording.formats.bag_messages import messages

NAMES = ("turn", "lift_of_the_arm", "é")


def test_three_topics_are_read_again(tmp_path) -> None:
    """Oracle: the reader of bags; bit for bit, and rows without r are measured alone."""
    rng = np.random.default_rng(0)
    q, dq, tau, r = rng.normal(size=(4, 20, 3))
    r[:5] = np.nan
    t = np.arange(20) / 1000
    data = Recording(t=t, q=q, dq=dq, tau=tau, history=("made",))
    seen = Observation(t, r, np.ones_like(r), np.ones_like(r), (), 0.015)
    (tmp_path / "torque.mcap").write_bytes(torque_mcap(NAMES, data, seen))
    read = list(messages(tmp_path / "torque.mcap", []))
    by_topic = {topic: [m for m in read if m.topic == topic] for topic in TOPICS}
    assert [len(by_topic[topic]) for topic in TOPICS] == [20, 15, 15]
    assert {m.names for m in read} == {NAMES}
    np.testing.assert_array_equal([m.position for m in by_topic["/measured"]], q)
    np.testing.assert_array_equal([m.effort for m in by_topic["/measured"]], tau)
    np.testing.assert_array_equal([m.effort for m in by_topic["/external"]], r[5:])
    np.testing.assert_array_equal([m.effort for m in by_topic["/predicted"]], (tau + r)[5:])
    assert by_topic["/external"][0].stamp == 5_000_000


def test_messages_are_those_of_ros(tmp_path) -> None:
    """Oracle: the bytes by hand: an encoding, then numbers at multiples of their size."""
    q, dq, tau, r = np.random.default_rng(1).normal(size=(4, 1, 3))
    data = Recording(t=np.array([3.000000007]), q=q, dq=dq, tau=tau, history=("made",))
    seen = Observation(data.t, r, np.ones_like(r), np.ones_like(r), (), 0.015)
    body = struct.pack("<iII", 3, 7, 1) + b"\0"

    def added(size: int, *more: bytes) -> bytes:
        return b"".join([body, b"\0" * (-len(body) % size), *more])

    body = added(4, struct.pack("<I", len(NAMES)))
    for name in NAMES:
        text = name.encode() + b"\0"
        body = added(4, struct.pack("<I", len(text)), text)
    for values in (q, dq, tau):
        body = added(4, struct.pack("<I", 3))
        body = added(8, values.tobytes())
    assert b"\0\1\0\0" + body in torque_mcap(NAMES, data, seen)


def test_the_layout_names_every_curve() -> None:
    """Property: one plot per joint with the three topics."""
    plots = fromstring(plotjuggler_layout(NAMES)).findall(".//plot")
    curves = [[curve.get("name") for curve in plot.findall("curve")] for plot in plots]
    assert curves == [[f"{topic}/{name}/effort" for topic in TOPICS] for name in NAMES]
