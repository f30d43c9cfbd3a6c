"""MCAP of measured, predicted and external torque, and a PlotJuggler layout that shows them.

Three topics of sensor_msgs/JointState in CDR, as ROS 2 records them: `/measured`, `/predicted` and
`/external`, position and velocity measured, effort the torque. The predicted torque is the measured
one plus the external one, τ_model = τ + r: their difference at the bandwidth of the observer.
"""

import struct
from collections.abc import Sequence
from io import BytesIO
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from runtime.library import Array
from runtime.monitoring.observation import Observation
from runtime.recording import Recording
from runtime.recording.formats.log_format import imported

FILES = ("external_torque.mcap", "external_torque.plotjuggler.xml")
TOPICS = ("/measured", "/predicted", "/external")
TYPE = "sensor_msgs/msg/JointState"
_RULE = "=" * 80
DEFINITION = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{_RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
"""Definition of the message with those of its parts."""
COLOURS = ("#1f77b4", "#ff7f0e", "#d62728")
NANO = 1_000_000_000


def torque_mcap(names: Sequence[str], data: Recording, seen: Observation) -> bytes:
    """MCAP file of an observed log; instants count from 0 of the log; seen: (N, n) [N·m, N]."""
    mcap = imported("mcap.writer", "MCAP files")
    tau, dq = data.required("tau"), data.required("dq")
    out = BytesIO()
    writer = mcap.Writer(out, compression=mcap.CompressionType.NONE)
    writer.start(profile="ros2", library="symgen")
    schema = writer.register_schema(TYPE, "ros2msg", DEFINITION.encode())
    channels = [writer.register_channel(topic, "cdr", schema) for topic in TOPICS]
    known = np.asarray(np.isfinite(seen.r).all(axis=1))
    message = JointStateEncoder(names)
    for k, t in enumerate(seen.t):
        stamp = max(round(float(t) * NANO), 0)
        efforts = [tau[k], tau[k] + seen.r[k], seen.r[k]] if known[k] else [tau[k]]
        for channel, effort in zip(channels, efforts, strict=False):
            content = message.encoded(stamp, data.q[k], dq[k], effort)
            writer.add_message(channel, stamp, content, stamp)
    writer.finish()
    return out.getvalue()


class JointStateEncoder:
    """CDR (little endian) of JointState messages with the same joints."""

    def __init__(self, names: Sequence[str]) -> None:
        """Encode the part between stamp and positions once."""
        head = _text("")
        head += _aligned(8 + len(head), 4) + struct.pack("<I", len(names))
        for name in names:
            head += _aligned(8 + len(head), 4) + _text(name)
        self._head = head
        self._count = len(names)

    def encoded(self, stamp: int, *arrays: Array) -> bytes:
        """One message."""
        body = struct.pack("<iI", *divmod(stamp, NANO)) + self._head
        for values in arrays:
            body += _aligned(len(body), 4) + struct.pack("<I", self._count)
            # Alignment counts from behind the four bytes that name the encoding.
            body += _aligned(len(body), 8) + np.asarray(values, dtype="<f8").tobytes()
        return b"\x00\x01\x00\x00" + body


def plotjuggler_layout(names: Sequence[str]) -> str:
    """Layout with one plot per joint: measured, predicted and external torque."""
    root = Element("root")
    window = SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    tab = SubElement(window, "Tab", {"tab_name": "joint torque", "containers": "1"})
    share = ";".join([f"{1 / len(names):.6g}"] * len(names))
    rows = {"orientation": "-", "count": str(len(names)), "sizes": share}
    splitter = SubElement(SubElement(tab, "Container"), "DockSplitter", rows)
    for name in names:
        area = SubElement(splitter, "DockArea", {"name": name})
        plot = SubElement(area, "plot", {"style": "Lines", "mode": "TimeSeries"})
        SubElement(plot, "limitY")
        for topic, colour in zip(TOPICS, COLOURS, strict=True):
            SubElement(plot, "curve", {"name": f"{topic}/{name}/effort", "color": colour})
    SubElement(window, "currentTabIndex", {"index": "0"})
    indent(root, space="  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, "unicode") + "\n"


def _text(text: str) -> bytes:
    """A string: its length with the final zero, its bytes, the zero."""
    data = text.encode() + b"\x00"
    return struct.pack("<I", len(data)) + data


def _aligned(size: int, step: int) -> bytes:
    return b"\x00" * (-size % step)
