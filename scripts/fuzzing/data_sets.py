"""Good HDF5 files and LeRobot data sets, each in an empty folder; how they are damaged inside."""

import json
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from runtime.library import Library
from scripts.fuzzing.archives import MOST_ROWS
from scripts.fuzzing.goods import motion

_TYPES = ("f2", "f4", "i8", "u1", "S3", "V8", "c16")
_SHAPES = ((0,), (0, 3), (1,), (7,), (2, 3, 4), (10**6, 1))


def hdf5(folder: Path, lib: Library) -> None:
    """A log as arrays of HDF5, at the top and in a struct of MATLAB."""
    import h5py

    log = motion(lib)
    with h5py.File(folder / "log.h5", "w") as file:
        for name in ("t", "q", "tau"):
            file.create_dataset(name, data=getattr(log, name), track_times=False)
    with h5py.File(folder / "log.mat", "w", userblock_size=512) as file:
        arm = file.create_group("arm", track_times=False)
        for name in ("t", "q", "tau"):
            values = np.atleast_2d(getattr(log, name).T)
            arm.create_dataset(name, data=values, track_times=False)
            arm[name].attrs["MATLAB_class"] = np.bytes_("double")


def hdf5_parts(data: bytes, rng: np.random.Generator) -> bytes:
    """Arrays of other names, types and shapes, compressed zeros, links, and groups in groups."""
    import h5py

    out = BytesIO(data)
    with h5py.File(out, "r+") as file:
        group: Any = file.get("arm", file)
        name = sorted(group)[int(rng.integers(len(group)))]
        if group[name].size > MOST_ROWS:  # of a round before this one: an honest file of 400 MB
            return data
        values = np.asarray(group[name])
        kind = int(rng.integers(9))
        del group[name]
        if kind == 0:
            group[name + "x"] = values
        elif kind == 1:
            group[name] = np.zeros(values.shape, _TYPES[int(rng.integers(len(_TYPES)))])
        elif kind == 2:
            group[name] = np.zeros(_SHAPES[int(rng.integers(len(_SHAPES)))])
        elif kind == 3:
            zeros = {"shape": (10**7, 20), "chunks": (10**5, 20), "compression": "gzip"}
            group.create_dataset(name, dtype="f8", **zeros)
        elif kind == 4:
            group[name] = h5py.ExternalLink("../canary.txt", "/q")
        elif kind == 5:
            group[name] = h5py.SoftLink(f"/{name}")
        elif kind == 6:
            place = group
            for _ in range(200):
                place = place.create_group(name)
        elif kind == 7:
            external = [("../canary.txt", 0, h5py.h5f.UNLIMITED)]
            group.create_dataset(name, values.shape, "f8", external=external)
        else:
            strange = (np.nan, np.inf, 1e308, 5e-324)[int(rng.integers(4))]
            group[name] = np.where(rng.random(values.shape) < 0.3, strange, values)
    return out.getvalue()


def lerobot(folder: Path, lib: Library) -> None:
    """A data set of version 3 with one episode, and its recipe."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    log = motion(lib)
    joints = [f"joint{k}.pos" for k in range(1, lib.n_joints + 1)]
    rows = {
        "observation.state": pa.array(np.degrees(log.q).tolist()),
        "action": pa.array(np.degrees(log.q + 0.01).tolist()),
        "timestamp": pa.array(log.t),
        "episode_index": pa.array(np.zeros(len(log.t), dtype=int)),
    }
    (folder / "data/chunk-000").mkdir(parents=True)
    (folder / "meta").mkdir()
    pq.write_table(pa.table(rows), folder / "data/chunk-000/file-000.parquet")
    wide = {"dtype": "float32", "shape": [len(joints)], "names": joints}
    one = {"dtype": "float32", "shape": [1], "names": None}
    features = {key: one if key[0] in "te" else wide for key in rows}
    info = {"codebase_version": "v3.0", "fps": 100, "features": features}
    (folder / "meta/info.json").write_text(json.dumps(info))
    (folder / "recipe.toml").write_text(
        f'[time]\nkey = "timestamp"\nunit = "s"\n'
        f'[position]\nkey = "observation.state"\ncolumns = {json.dumps(joints)}\nunit = "deg"\n'
        f'[torque]\nlaw = "pd"\nkp = {[2.0] * len(joints)}\nkd = 0.0\n'
        f"q_des = {json.dumps(joints)}\n"
    )
