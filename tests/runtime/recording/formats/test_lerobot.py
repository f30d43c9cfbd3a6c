"""LeRobot data sets of versions 2.1 and 3; the files are pyarrow's, the layout LeRobot's."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from runtime.errors import RecordingError
from runtime.recording import read_recording
from runtime.recording.formats.lerobot_format import PAUSE_S
from runtime.recording.recipes.recipe_file import recipe_from_table
from tests.runtime.logs import motion

NAMES = ["shoulder.pos", "elbow.pos", "gripper.pos"]
RECIPE = {
    "time": {"key": "timestamp", "unit": "s"},
    "position": {"key": "observation.state", "columns": NAMES[:2], "unit": "deg"},
    "torque": {"law": "pd", "kp": [2.0, 3.0], "kd": 0.0, "q_des": NAMES[:2]},
}


def data_set(folder: Path, version: str, names: object = NAMES) -> tuple[np.ndarray, np.ndarray]:
    """Two episodes of 200 frames, one file each in version 2.1 and one file in version 3."""
    t, q, _ = motion(400)
    state = np.degrees(np.hstack([q, q[:, :1]]))
    rows = {
        "observation.state": pa.FixedSizeListArray.from_arrays(pa.array(state.ravel()), 3),
        "action": pa.array((state + 10.0).tolist()),
        "timestamp": pa.array(np.tile(t[:200], 2)),
        "episode_index": pa.array(np.repeat([0, 1], 200)),
    }
    table, data = pa.table(rows), folder / "data/chunk-000"
    data.mkdir(parents=True)
    (folder / "meta").mkdir()
    feature = {"dtype": "float32", "shape": [3], "names": names}
    one = {"dtype": "float32", "shape": [1], "names": None}
    features = {key: one if key[0] in "te" else feature for key in rows}
    info = {"codebase_version": version, "fps": 100, "features": features}
    (folder / "meta/info.json").write_text(json.dumps(info))
    if version == "v3.0":
        pq.write_table(table, data / "file-000.parquet")
    else:
        for k in range(2):
            pq.write_table(table[200 * k : 200 * k + 200], data / f"episode_{k:06d}.parquet")
    return t, q


@pytest.mark.parametrize(
    ("version", "names"), [("v2.1", NAMES), ("v2.1", {"motors": NAMES}), ("v3.0", NAMES)]
)
def test_episodes_names_and_actions(tmp_path, version, names):
    """Oracle: the joints by name without the gripper, τ = kp (action − state), a pause between."""
    t, q = data_set(tmp_path / "set", version, names)
    log = read_recording(tmp_path / "set", recipe_from_table(RECIPE))
    assert log.q == pytest.approx(q, abs=1e-14)  # rounding of π/180
    assert log.tau == pytest.approx(
        np.tile([2.0, 3.0], (400, 1)) * np.radians(10.0),
        abs=1e-13,  # of numbers of size 100 deg
    )
    assert log.torque_source == "commanded"
    steps = np.diff(log.t)
    assert steps[199] == pytest.approx(PAUSE_S, abs=1e-12)
    assert np.delete(steps, 199) == pytest.approx(np.tile(np.diff(t[:200]), 2), abs=1e-12)
    assert any("2 episodes were joined" in text for text in log.history)
    assert len(log.source) == (1 if version == "v3.0" else 2)


def test_what_is_missing_is_one_sentence(tmp_path):
    """Property: no recipe, another feature, another name, no data and a damaged info.json."""
    place = tmp_path / "set"
    data_set(place, "v3.0")
    with pytest.raises(RecordingError, match=r"states no units; write a recipe.*action"):
        read_recording(place)
    for change, words in (
        ({"key": "effort"}, "feature 'effort', but has action"),
        ({"key": "observation.state", "columns": ["wrist"]}, "number 'wrist', but has shoulder"),
        ({"key": "observation.state", "columns": [0, 3]}, "number 3"),
    ):
        table = RECIPE | {"position": {"unit": "deg"} | change}
        with pytest.raises(RecordingError, match=words):
            read_recording(place, recipe_from_table(table))
    frames = place / "data/chunk-000/file-000.parquet"
    table = pq.read_table(frames)
    place_of = table.schema.get_field_index("episode_index")
    nothing = pa.array([[]] * len(table), pa.list_(pa.int64()))
    pq.write_table(table.set_column(place_of, "episode_index", nothing), frames)
    with pytest.raises(RecordingError, match="column 'episode_index' are expected to be of one"):
        read_recording(place, recipe_from_table(RECIPE))
    frames.unlink()
    frames.mkdir()
    with pytest.raises(
        RecordingError, match=r"cannot read file-000\.parquet in .* \(not a regular file"
    ):
        read_recording(place, recipe_from_table(RECIPE))
    frames.rmdir()
    with pytest.raises(RecordingError, match="but holds 0; download"):
        read_recording(place, recipe_from_table(RECIPE))
    (place / "meta/info.json").write_text("[" * 100_000)
    with pytest.raises(RecordingError, match=r"info\.json is expected to describe"):
        read_recording(place, recipe_from_table(RECIPE))
