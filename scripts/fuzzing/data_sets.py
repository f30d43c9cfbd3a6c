"""Good HDF5 files and LeRobot data sets, each in an empty folder."""

import json
from pathlib import Path

import numpy as np

from runtime.library import Library
from scripts.fuzzing.goods import motion


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
