"""MCAP, ROS 1 and ROS 2 bags → recordings; the files are made by the libraries of others."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_typestore

from runtime.errors import RecordingError
from runtime.recording import Recording, read_recording
from runtime.recording.recipes.recipe_file import recipe_from_table

TYPE = "sensor_msgs/msg/JointState"
NAMES = ("a", "b", "c")
START = 1_700_000_000 * 10**9
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)


def motion(n: int = 200) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    t = np.arange(n) * 0.01
    phase = np.outer(t, [1.0, 2.0, 3.0])
    rate = np.array([1.0, 2.0, 3.0])
    return t, np.sin(phase), rate * np.cos(phase), 5.0 + np.cos(phase)


def stamp_of(t: float) -> tuple[int, int]:
    return divmod(START + round(t * 1e9), 10**9)


def ros_state(store, t, names, q, dq, tau):
    """A JointState object of a type store."""
    header = store.types["std_msgs/msg/Header"]
    time = store.types["builtin_interfaces/msg/Time"](*stamp_of(t))
    extra = {"seq": 0} if store is ROS1 else {}
    fields = (np.asarray(values, dtype=np.float64) for values in (q, dq, tau))
    return store.types[TYPE](header(stamp=time, frame_id="", **extra), list(names), *fields)


def json_state(t, names, q, dq, tau) -> bytes:
    sec, nanosec = stamp_of(t)
    told = {"header": {"stamp": {"sec": sec, "nanosec": nanosec}}, "name": list(names)}
    told |= {"position": list(q), "velocity": list(dq), "effort": list(tau)}
    return json.dumps(told).encode()


State = tuple[str, float, tuple[str, ...], np.ndarray, np.ndarray, np.ndarray]


def states(topic: str = "/joint_states", names: tuple[str, ...] = NAMES) -> list[State]:
    columns = [NAMES.index(name) for name in names]
    t, *signals = motion()
    return [(topic, t[i], names, *(s[i, columns] for s in signals)) for i in range(len(t))]


def mcap_json(path: Path, told: list[State], compression=CompressionType.LZ4) -> Path:
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=8192, compression=compression)
        writer.start()
        schema = writer.register_schema(TYPE, "jsonschema", b"{}")
        topics = {x: writer.register_channel(x, "json", schema) for x in {x for x, *_ in told}}
        for topic, t, *state in told:
            logged = START + round(t * 1e9)
            writer.add_message(topics[topic], logged, json_state(t, *state), logged)
        writer.finish()
    return path


def mcap_cdr(path: Path, told: list[State]) -> Path:
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=8192, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema(TYPE, "ros2msg", b"")
        topics = {x: writer.register_channel(x, "cdr", schema) for x in {x for x, *_ in told}}
        for topic, t, *state in told:
            data = bytes(ROS2.serialize_cdr(ros_state(ROS2, t, *state), TYPE))
            writer.add_message(topics[topic], START, data, START)
        writer.finish()
    return path


def _ros2(path: Path, told: list[State], plugin: StoragePlugin) -> Path:
    path = path.with_suffix("")
    with Bag2Writer(path, version=9, storage_plugin=plugin) as bag:
        topics = {
            topic: bag.add_connection(topic, TYPE, typestore=ROS2)
            for topic in dict.fromkeys(topic for topic, *_ in told)
        }
        for topic, t, *state in told:
            data = ROS2.serialize_cdr(ros_state(ROS2, t, *state), TYPE)
            bag.write(topics[topic], START + round(t * 1e9), data)
    return path


def ros2_sqlite(path: Path, told: list[State]) -> Path:
    return _ros2(path, told, StoragePlugin.SQLITE3)


def ros2_mcap(path: Path, told: list[State]) -> Path:
    return _ros2(path, told, StoragePlugin.MCAP)


def ros1(path: Path, told: list[State]) -> Path:
    path = path.with_suffix(".bag")
    with Bag1Writer(path) as bag:
        topics = {
            topic: bag.add_connection(topic, TYPE, typestore=ROS1)
            for topic in dict.fromkeys(topic for topic, *_ in told)
        }
        for topic, t, *state in told:
            data = ROS1.serialize_ros1(ros_state(ROS1, t, *state), TYPE)
            bag.write(topics[topic], START + round(t * 1e9), data)
    return path


WRITERS: list[Callable[[Path, list[State]], Path]] = [
    mcap_json,
    mcap_cdr,
    ros2_sqlite,
    ros2_mcap,
    ros1,
]


def same(recording: Recording, order: tuple[int, ...] = (0, 1, 2)) -> None:
    t, q, dq, tau = motion()
    # Stamps are whole nanoseconds.
    assert recording.t == pytest.approx(t, abs=1e-9)
    for key, values in (("q", q), ("dq", dq), ("tau", tau)):
        assert np.array_equal(getattr(recording, key), values[:, list(order)])


@pytest.mark.parametrize("write", WRITERS)
def test_bags_of_other_libraries_give_the_same_bits(tmp_path, write):
    """Oracle: what rosbags and mcap have written is read to the last bit, in the robot's order."""
    path = write(tmp_path / "log.mcap", states())
    same(read_recording(path))
    turned = read_recording(path, joints=("c", "a", "b"))
    same(turned, (2, 0, 1))
    assert turned.joint_names == ("c", "a", "b")
    assert all(len(digest) == 64 for digest in turned.source.values())


def test_zstd_chunks_of_another_writer(tmp_path):
    """Oracle: the MCAP file inside a compressed ROS 2 bag gives the same bits, bag or bare."""
    told = states()
    writer = Bag2Writer(tmp_path / "z", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer as bag:
        topic = bag.add_connection(told[0][0], TYPE, typestore=ROS2)
        for _, t, *state in told:
            data = ROS2.serialize_cdr(ros_state(ROS2, t, *state), TYPE)
            bag.write(topic, START + round(t * 1e9), data)
    assert b"zstd" in (tmp_path / "z" / "z.mcap").read_bytes()
    same(read_recording(tmp_path / "z"))
    same(read_recording(tmp_path / "z" / "z.mcap"))


def test_recipe_states_topic_joints_sign_and_unit(tmp_path):
    """Oracle: the keys of a recipe mean the same in a bag as in a CSV."""
    path = mcap_cdr(tmp_path / "x.mcap", states() + states("/other"))
    with pytest.raises(RecordingError, match=r"/joint_states \(200 messages\), /other \(200"):
        read_recording(path)
    table = {
        "topic": "/other",
        "joints": ["b", "a", "c"],
        "time": {"unit": "s"},
        "position": {"unit": "rad", "order": [1, 0, 2]},
        "torque": {"unit": "N*m", "sign": -1},
    }
    recording = read_recording(path, recipe_from_table(table))
    _, q, _, tau = motion()
    assert np.array_equal(recording.q, q)
    assert np.array_equal(recording.tau, -tau[:, [1, 0, 2]])
    assert recording.dq is None
    with pytest.raises(RecordingError, match="no message of the topic '/none', but of"):
        read_recording(path, recipe_from_table({"topic": "/none"}))
    with pytest.raises(RecordingError, match=r"'z'|z are not among a, b, c"):
        read_recording(path, joints=("a", "b", "z"))


def test_partial_publishers_merge_by_name_and_stamp(tmp_path):
    """Oracle: two publishers with some joints each, shuffled, are the one that tells all."""
    told = states(names=("b", "a")) + states(names=("c",))
    np.random.default_rng(0).shuffle(told)
    recording = read_recording(mcap_json(tmp_path / "x.mcap", told), joints=NAMES)
    same(recording)
    history = " ".join(recording.history)
    assert "Merged 2 kinds" in history
    assert "came out of order" in history
    told = states()
    np.random.default_rng(0).shuffle(told)
    same(read_recording(mcap_json(tmp_path / "w.mcap", told)))
    apart = states(names=("a", "b")) + [
        (topic, t + 0.003, *rest) for topic, t, *rest in states(names=("c",))
    ]
    with pytest.raises(RecordingError, match="only 0 of 400 stamps have all of a, b, c"):
        read_recording(mcap_json(tmp_path / "y.mcap", apart), joints=NAMES)
    gripper = states() + states(names=("c",))
    same(read_recording(mcap_json(tmp_path / "z.mcap", gripper), joints=NAMES))


def test_missing_velocity_and_effort_and_stamps(tmp_path):
    """Oracle: fields that no message fills are missing; stamps of zero give way to log times."""
    none = np.zeros(0)
    told = [(topic, t, names, q, none, none) for topic, t, names, q, *_ in states()]
    recording = read_recording(mcap_json(tmp_path / "x.mcap", told))
    assert recording.dq is None
    assert recording.tau is None
    path = tmp_path / "y.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file, compression=CompressionType.NONE)
        writer.start()
        channel = writer.register_channel(
            "/joint_states", "json", writer.register_schema("JointState", "jsonschema", b"")
        )
        for _, t, names, q, *_ in states():
            told = json.dumps({"name": list(names), "position": list(q)}).encode()
            writer.add_message(channel, START + round(t * 1e9), told, START)
        writer.finish()
    recording = read_recording(path)
    assert recording.t == pytest.approx(motion()[0], abs=1e-9)
    assert any("instants of logging" in sentence for sentence in recording.history)


def test_a_file_cut_short_is_read_as_far_as_it_goes(tmp_path):
    """Property: a recorder that was killed leaves a log, and the history says what is lost."""
    data = mcap_json(tmp_path / "x.mcap", states()).read_bytes()
    (tmp_path / "x.mcap").write_bytes(data[: int(0.7 * len(data))])
    recording = read_recording(tmp_path / "x.mcap")
    assert 100 < len(recording) < 200
    assert any("cut short" in sentence for sentence in recording.history)
    (tmp_path / "x.mcap").write_bytes(data[:600])
    with pytest.raises(RecordingError, match="cut short or damaged"):
        read_recording(tmp_path / "x.mcap")


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> dict[str, bytes]:
    """Small bags of every kind, as bytes."""
    folder = tmp_path_factory.mktemp("whole")
    few = states()[:60]
    paths = [mcap_json(folder / "j.mcap", few), mcap_cdr(folder / "c.mcap", few)]
    paths += [ros1(folder / "r", few)]
    paths += list(ros2_sqlite(folder / "s", few).glob("*.db3"))
    return {path.suffix + path.stem: path.read_bytes() for path in paths}


@settings(max_examples=120, deadline=None)
@given(
    kind=st.sampled_from(["j.mcap", "c.mcap", "r.bag", "s.db3"]),
    places=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=4),
    cut=st.one_of(st.none(), st.floats(0, 1)),
    size=st.one_of(st.none(), st.tuples(st.floats(0, 1), st.sampled_from([4, 8]))),
)
def test_damaged_bags_are_one_sentence(tmp_path_factory, whole, kind, places, cut, size):
    """Property: whatever bytes are changed, a recording comes out or one sentence."""
    stem, suffix = kind.split(".")
    data = bytearray(whole[f".{suffix}{stem}"])
    for place, value in places:
        data[int(place * (len(data) - 1))] = value
    if size is not None:  # a size that lies: 4 or 8 bytes of ones
        at = int(size[0] * (len(data) - 9))
        data[at : at + size[1]] = b"\xff" * size[1]
    if cut is not None:
        data = data[: int(cut * len(data))]
    path = tmp_path_factory.mktemp("damaged") / f"log.{suffix}"
    path.write_bytes(bytes(data))
    try:
        recording = read_recording(path)
    except RecordingError as error:
        text = str(error)
        assert "\n" not in text
        assert "Traceback" not in text
    else:
        assert np.isfinite(recording.q).all()


def test_joints_of_another_prefix_and_more_joints(tmp_path):
    """Property: robot_a … of the robot is arm_a … of the bag, whose gripper is left out; noted."""
    names = ("arm_a", "arm_b", "arm_c", "hand_grip")
    told = [(topic, t, names, *(np.append(x, 0) for x in xs)) for topic, t, _, *xs in states()]
    path = mcap_json(tmp_path / "log.mcap", told)
    robot = ("robot_c", "robot_a", "robot_b")
    log = read_recording(path, joints=robot)
    same(log, (2, 0, 1))
    assert log.joint_names == robot
    assert "The joints arm_c … arm_b of the log count as robot_c … robot_b" in str(log.history)
