"""MCAP of measured, predicted and external torque, and a PlotJuggler layout that shows them.

Three topics of sensor_msgs/JointState in CDR, as ROS 2 records them: `/measured`, `/predicted` and
`/external`, position and velocity measured, effort the torque. The predicted torque is the measured
one plus the external one, τ_model = τ + r: their difference at the bandwidth of the observer.
"""

from collections.abc import Sequence
from io import BytesIO
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from runtime.monitoring.observation import Observation
from runtime.recording import Recording
from runtime.recording.formats.log_format import imported

FILES = ("external_torque.mcap", "external_torque.plotjuggler.xml")
TOPICS = ("/measured", "/predicted", "/external")
TYPE = "sensor_msgs/msg/JointState"
COLOURS = ("#1f77b4", "#ff7f0e", "#d62728")
NANO = 1_000_000_000


def torque_mcap(names: Sequence[str], data: Recording, seen: Observation) -> bytes:
    """MCAP file of an observed log; instants count from 0 of the log; seen: (N, n) [N·m, N]."""
    modules = ("mcap.writer", "rosbags.typesys")
    mcap, rosbags = (imported(module, "MCAP files") for module in modules)
    store = rosbags.get_typestore(rosbags.Stores.ROS2_HUMBLE)
    definition, _ = store.generate_msgdef(TYPE, ros_version=2)
    types = (TYPE, "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    state, header, time = (store.types[each] for each in types)
    tau, dq = data.required("tau"), data.required("dq")
    out = BytesIO()
    writer = mcap.Writer(out, compression=mcap.CompressionType.NONE)
    writer.start(profile="ros2", library="symgen")
    schema = writer.register_schema(TYPE, "ros2msg", definition.encode())
    channels = [writer.register_channel(topic, "cdr", schema) for topic in TOPICS]
    known = np.asarray(np.isfinite(seen.r).all(axis=1))
    for k, t in enumerate(seen.t):
        stamp = max(round(float(t) * NANO), 0)
        head = header(time(*divmod(stamp, NANO)), frame_id="")
        efforts = [tau[k], tau[k] + seen.r[k], seen.r[k]] if known[k] else [tau[k]]
        for channel, effort in zip(channels, efforts, strict=False):
            message = state(head, list(names), data.q[k], dq[k], effort)
            writer.add_message(channel, stamp, bytes(store.serialize_cdr(message, TYPE)), stamp)
    writer.finish()
    return out.getvalue()


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
