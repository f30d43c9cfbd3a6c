"""Logs and settings that the cases of `scripts/same_results` read, computed without the product.

Logs of the FR3 are the bundled one with the torque of a ball in the hand, of a push, of motor
currents, or of a control law; Pinocchio computes the ball. Files of public data are written in
layouts that the commands read.
"""

import csv
import gzip
import json
import sysconfig
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
EXAMPLES = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
MASS, CENTRE = 1.0, (0.0, 0.0, 0.15)
"""Of the ball, in the frame of link 7 [kg], [m]."""
KT = (11.0, 12.0, 9.0, 10.0, 6.0, 5.0, -4.0)
"""Torque constants of the log with currents [N·m/A]."""
Log = dict[str, np.ndarray]


def fr3_logs(place: Path, shared: Path) -> None:
    """Folder of variations of the bundled log."""
    with np.load(ROOT / "runtime/examples/fr3_simulated.npz") as file:
        log = {key: file[key] for key in ("t", "q", "dq", "tau")}
    tau, noise = log["tau"], np.random.default_rng(1).normal(0.0, 0.05, log["tau"].shape)
    ball = _ball(log)
    place.mkdir(exist_ok=True)
    _csv(place / "empty.csv", log)
    _csv(place / "loaded.csv", log | {"tau": tau + ball + noise})
    push = np.zeros_like(tau)
    push[(log["t"] > 2.0) & (log["t"] < 2.4), :4] = (3.0, 8.0, 3.0, 5.0)
    _csv(place / "pushed.csv", log | {"tau": tau + push + noise})
    _csv(place / "rubbing.csv", log | {"tau": tau + noise + 0.4 * np.tanh(log["dq"] / 0.05)})
    _csv(place / "heavy.csv", log | {"tau": 1.1 * (tau + noise)})
    for k, gain in enumerate((1.0, 1.01, 0.99), 1):
        again = np.random.default_rng(10 + k).normal(0.0, 0.05, tau.shape)
        _csv(place / f"unit{k}.csv", log | {"tau": gain * tau + again})
    _csv(place / "current.csv", log | {"tau": (tau + noise) / KT})
    _csv(place / "current_loaded.csv", log | {"tau": (tau + ball - noise) / KT})
    np.savez(place / "servo.npz", **_servo(log, 0.020))
    np.savez(place / "servo_late.npz", **_servo(log | {"tau": tau + noise}, 0.025))
    _formats(place, log)


def _ball(log: Log) -> np.ndarray:
    """Torque of the ball, by accelerations from differences of dq (N, 7)."""
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(ROOT / "symgen/robots/fr3.urdf"))
    loaded = pinocchio.Model(model)
    inertia = pinocchio.Inertia(MASS, np.array(CENTRE), 0.002 * np.eye(3))
    loaded.appendBodyToJoint(model.njoints - 1, inertia, pinocchio.SE3.Identity())
    ddq = np.gradient(log["dq"], log["t"], axis=0)
    rows = zip(log["q"], log["dq"], ddq, strict=True)
    data = model.createData(), loaded.createData()
    return np.array(
        [
            pinocchio.rnea(loaded, data[1], *x) - pinocchio.rnea(model, data[0], *x).copy()
            for x in rows
        ]
    )


def _servo(log: Log, late: float) -> Log:
    """Log of a law kp (q_des − q) + kd (dq_des − dq) that acts `late` seconds after its stamp."""
    kp, kd = 400.0, 20.0
    ahead = np.column_stack([np.interp(log["t"] + late, log["t"], row) for row in log["tau"].T])
    desired = log["q"] + (ahead + kd * log["dq"]) / kp
    arrays = {"q_des": desired, "dq_des": 0 * desired, "kp": np.full(7, kp), "kd": np.full(7, kd)}
    return {key: log[key] for key in ("t", "q", "dq")} | arrays


def _csv(path: Path, log: Log) -> None:
    n = log["q"].shape[1]
    names = [f"{key}{k}" for key in ("q", "dq", "tau") for k in range(1, n + 1)]
    table = np.column_stack([log["t"], log["q"], log["dq"], log["tau"]])
    np.savetxt(path, table, "%.17g", ",", header=",".join(["t", *names]), comments="")


def _formats(place: Path, log: Log) -> None:
    """The log as gzip, Parquet, HDF5 and MCAP with messages of joint states."""
    import h5py
    import pyarrow
    import pyarrow.parquet
    from mcap.writer import Writer

    (place / "log.csv.gz").write_bytes(gzip.compress((place / "empty.csv").read_bytes(), mtime=0))
    columns = {"t": log["t"]} | {
        f"{key}{k + 1}": log[key][:, k] for key in ("q", "dq", "tau") for k in range(7)
    }
    pyarrow.parquet.write_table(pyarrow.table(columns), place / "log.parquet")
    with h5py.File(place / "log.h5", "w") as file:
        for key, values in log.items():
            file[key] = values
    with (place / "log.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/JointState", "jsonschema", b"{}")
        channel = writer.register_channel("/joint_states", "json", schema)
        names = [f"fr3_joint{k}" for k in range(1, 8)]
        for k, t in enumerate(log["t"]):
            stamp = 1_700_000_000 * 10**9 + round(t * 1e9)
            sec, nanosec = divmod(stamp, 10**9)
            state = {"header": {"stamp": {"sec": sec, "nanosec": nanosec}}, "name": names}
            signals = {"position": "q", "velocity": "dq", "effort": "tau"}
            state |= {name: log[key][k].tolist() for name, key in signals.items()}
            writer.add_message(channel, stamp, json.dumps(state).encode(), stamp)
        writer.finish()


DRIVER_HZ = 3.0
"""First-order low-pass of the force sensors, the default of the robot's driver wholeBodyDynamics
(forceTorqueFilterCutoffInHz), which its configuration leaves as it is. The model is identified in
this band, and predicts in each."""
SENSOR = (-0.0035, 0.0, -0.0605)
"""Place of the force sensor of either foot in the frame of its link by the URDF, where both have
the same axes [m]."""
CROSSTALK = (0.0, 0.5)
"""Standard deviation of what the sensors read of moments about x and y [N per N·m]: 0.39 to 0.69 in
the secondary calibration of this robot's leg sensors (robots-configuration, iCubGenova04)."""
OFFSET_N = 6.6
"""Standard deviation of the offset of a foot's sensor, 2 % of the weight of the robot [N]."""
SHARING = 0.1
"""Standard deviation of γ, the relative error of the sensors while both feet carry load."""


def icub_arrays(path: Path) -> Log:
    """Walking iCub with the errors of its vertical force sensors."""
    with np.load(path) as log:
        return {key: log[key] for key in ("q", "joints", "base_rpy")} | {
            "t": log["t"] - log["t"][0],
            "base_position": log["base_pos"],
            "contact_links": np.array(["l_ankle_2", "r_ankle_2"]),
            "contact_position": np.array([SENSOR, SENSOR]),
            "contact_force_z": np.stack([log["lf_fz"], log["rf_fz"]], axis=1),
            "contact_force_z_sigma": np.full(2, OFFSET_N),
            "contact_force_z_sharing": np.array(SHARING),
            "contact_force_z_crosstalk": np.array(CROSSTALK),
            "contact_force_z_cutoff": np.array(DRIVER_HZ),
        }


def go2_walking(place: Path, shared: Path) -> None:
    """Virtual Go2 with known wrenches of its four feet, 6 s at 200 Hz."""
    from tests.free_base_logs import Experiment, virtual_log

    urdf = (EXAMPLES / "go2_description/urdf/go2.urdf").read_text(encoding="utf-8")
    feet = tuple(f"{leg}_calf" for leg in ("FL", "FR", "RL", "RR"))
    noise = {"torque_noise": 0.001, "force_noise": 0.25, "moment_noise": 0.005}
    for k, seed in enumerate((0, 1)):
        log = virtual_log(urdf, feet, seed, Experiment(1200, 200.0, joint=None, **noise))
        name = place.stem + "_two" * k + place.suffix
        np.savez(place.with_name(name), **log.arrays)


def sage(path: Path, *names: str) -> list[np.ndarray]:
    """Time [s] and lists of joints of a file of SAGE."""
    with gzip.open(path, "rt", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    t = 1e-6 * np.array([float(row["timestamp"]) for row in rows])
    return [t, *(np.array([json.loads(row[name]) for row in rows]) for name in names)]


def so101(place: Path, shared: Path) -> None:
    """Folder of the motions of a servo arm, clock of the state [µs → s], currents without sign.

    They count against gravity: of either sign this is the one that identify does not refuse.
    """
    place.mkdir(exist_ok=True)
    for path in sorted((shared / "data/so101_sage").glob("*.state_motor.csv.gz")):
        t, q, dq, tau = sage(path, "positions", "velocities", "torques")
        name = path.name.replace(".state_motor.csv.gz", ".csv")
        _csv(place / name, {"q": q, "dq": dq, "tau": -tau, "t": t})


def text(words: str) -> Callable[[Path, Path], None]:
    """Writer of a text file."""
    return lambda place, shared: _write(place, words)


def _write(place: Path, words: str) -> None:
    place.write_text(words, encoding="utf-8")


INPUTS: dict[str, Callable[[Path, Path], None]] = {
    "fr3": fr3_logs,
    "icub_walking.npz": lambda place, shared: np.savez(
        place, **icub_arrays(shared / "data/icub_feet/walking.npz")
    ),
    "go2_walking": lambda place, shared: go2_walking(place.with_suffix(".npz"), shared),
    "so101": so101,
    "arm.toml": text("""\
trust = "cad"
total_mass = [17.0, 18.5]

[link.fr3_link7]
mass = [0.5, 1.5]
com_box = [[-0.05, -0.05, -0.1], [0.05, 0.05, 0.1]]
symmetry = ["xz"]
"""),
    "currents.toml": text("""\
[time]
column = "t"
unit = "s"

[position]
columns = ["q1", "q2", "q3", "q4", "q5", "q6", "q7"]
unit = "rad"

[velocity]
columns = ["dq1", "dq2", "dq3", "dq4", "dq5", "dq6", "dq7"]
unit = "rad/s"

[torque]
columns = ["tau1", "tau2", "tau3", "tau4", "tau5", "tau6", "tau7"]
unit = "A"
"""),
    "ur.toml": text("""\
[time]
unit = "ms"
layout = "csv"
column = 0
from_zero = true

[position]
unit = "deg"
layout = "csv"
columns = [1, 2, 3, 4, 5, 6]

[torque]
unit = "A"
layout = "csv"
columns = [13, 14, 15, 16, 17, 18]
gain = [13.0, 13.0, 10.0, 9.0, 9.0, 9.0]

[preparation]
max_gap_s = 0.05
grid_hz = 100.0
filter = "butterworth"
cutoff_hz = 5.0
"""),
    "cell.toml": text("""\
[[obstacle]]
name = "wall"
center = [0.9, 0.0, 0.5]
size = [0.1, 1.0, 1.0]
rpy = [0.0, 0.0, 0.0]
radius = 0.0
"""),
}
"""File or folder → what writes it at its place, from the shared folder."""
