"""Every kind of log with every feature: commands on small virtual logs, and what they answer."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.library import Library
from tests.free_base_logs import Experiment, virtual_log

PAIR_URDF = """<robot name="pair"><link name="base"/>{}</robot>"""
SIDE = """
  <joint name="{side}_swing" type="revolute">
    <origin xyz="0 {y} 0.5"/><parent link="base"/><child link="{side}_upper"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="6" effort="60"/>
  </joint>
  <link name="{side}_upper"><inertial><origin xyz="0.05 0 0.2"/><mass value="2"/>
    <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.01"/></inertial></link>
  <joint name="{side}_elbow" type="revolute">
    <origin xyz="0 0 0.4"/><parent link="{side}_upper"/><child link="{side}_fore"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="6" effort="60"/>
  </joint>
  <link name="{side}_fore"><inertial><origin xyz="0.02 0 0.15"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.004"/></inertial></link>"""
PAIR = PAIR_URDF.format(SIDE.format(side="left", y=0.2) + SIDE.format(side="right", y=-0.2))
BODY = """<link name="base"><inertial><origin xyz="0 0 0.3"/><mass value="5"/>
    <inertia ixx="0.2" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.1"/></inertial></link>"""
WALKER = PAIR.replace('<link name="base"/>', BODY)
KP, KD, RATE, LATE = 300.0, 10.0, 200.0, 0.02
CURRENTS = """[time]
column = "t"
unit = "s"
key = "t"
layout = "npz"
[position]
unit = "rad"
layout = "npz"
key = "q"
[velocity]
unit = "rad/s"
layout = "npz"
key = "dq"
[torque]
unit = "A"
layout = "npz"
key = "i"
"""


@dataclass(frozen=True)
class Kind:
    """A kind of log.

    Attributes:
        name: in the table.
        logs: words of the command that name it.
        robot: "pair" or "walker".
        further: options that all commands on it have.
    """

    name: str
    logs: tuple[str, ...]
    robot: str = "pair"
    further: tuple[str, ...] = ("--cutoff", "20")


KINDS = (
    Kind("one log", ("one.npz",)),
    Kind("several logs", ("one.npz", "two.npz")),
    Kind("streamed log", ("one.npz", "--settings", "stream=true")),
    Kind("poses at rest", ("rest.npz",), further=()),
    Kind("commanded torque", ("servo.npz",)),
    Kind("motor currents", ("amps.npz", "--recipe", "amps.toml")),
    Kind("free base", ("walk.npz",), "walker", ("--friction", "viscous,coulomb")),
    Kind("several walks", ("walk.npz", "later.npz"), "walker", ("--friction", "viscous,coulomb")),
)
FEATURES: dict[str, tuple[str, ...]] = {
    "map": (),
    "adam, full": ("--method", "adam"),
    "adam, real": ("--settings", "preset=real"),
    "pc-ols": ("--method", "pc-ols"),
    "ols, wls": ("--method", "wls"),
    "lm": ("--method", "lm"),
    "ekf, ukf": ("--method", "ekf"),
    "nn": ("--method", "nn"),
    "friction auto": ("--friction", "auto"),
    "friction by name": ("--friction", "viscous,coulomb"),
    "cut-off auto": ("--cutoff", "auto"),
    "momentum": ("--settings", "regressor=momentum"),
    "energy": ("--settings", "regressor=energy"),
    "delay auto": ("--delay", "auto"),
    "encoder bias": ("--settings", "encoder_bias=true"),
    "symmetric": ("--settings", "symmetric=left:right"),
    "tied": ("--settings", "symmetric=left:right", "--settings", "tie=true", "--delay", "auto"),
    "robust": ("--settings", "robust=true"),
    "prior": ("--prior", "arm.toml"),
    "known payload": ("--settings", "payload_of=two.npz=payload.json"),
    "statistics for fleet": ("--settings", "save_statistics=true"),
}
"""Feature of identify → its options."""
AFTERWARDS: dict[str, tuple[str, ...]] = {
    "report": ("report", "OUT"),
    "evaluate": ("evaluate", "OUT", "LOG"),
    "export": ("export", "OUT", "--to", "urdf", "--overwrite"),
    "observe": ("observe", "LOG", "--model", "OUT", "--overwrite"),
    "watch": ("watch", "OUT", "LOG"),
    "predict": ("predict", "LOG", "--more", "same"),
    "sample": ("sample", "OUT", "--count", "2", "--to", "urdf", "--overwrite"),
    "rerun": ("rerun", "OUT"),
    "compare": ("compare", "LOGS", "--methods", "map,ols,lm", "--overwrite"),
    "gains": ("gains", "LOG", "--total-mass", "6"),
}
"""Command that follows → its words; LOG is the log itself, LOGS all of them, OUT the result."""

REASONS = {
    "a": ("one by one|samples of one run|sample by sample", "filters, nets and mini-batches take "
          "the samples one by one, of one run at the controller's rate"),
    "b": ("rows of energy", "rows of energy mix the joints: no offset per joint and log, and none "
          "of a log that stays in its file"),
    "c": ("in memory, but it is streamed|takes no robust|read as a whole, but --settings "
          "stream=true",
          "needs the whole log in memory, which --settings stream=true avoids"),
    "d": ("the setting payload_of expects LOG=FILE", "one of several logs carries the known "
                                                     "payload"),
    "e": ("poses at rest|compares drives|excites \\d+ of|training rows or more|columns as inputs|"
          "three samples", "poses at rest: few rows, without motion"),
    "f": ("uses the friction columns", "the method has no rotor inertia, which a commanded torque "
          "needs"),
    "g": ("gains are unknown", "the cut-off is chosen on torques, before gains are estimated"),
    "i": ("torque or motor currents, got one without", "a commanded torque is that of a law: no "
          "sensor, whose gain could be wrong"),
    "h": ("free base|fixed base", "rows of a free base: wrenches that were not measured are "
          "eliminated instant by instant, which integrals over time, a chosen cut-off, biases of "
          "encoders and observers do not allow"),
}  # fmt: skip
"""Letter → what its sentence on stderr holds, and the reason in the table."""


def cell_of(code: object, err: str) -> str:
    """Cell of the table: yes, or the letter of the reason."""
    if code in {0, 1}:  # 1: watch reports a change
        return "yes"
    for letter, (pattern, _) in REASONS.items():
        if re.search(pattern, err):
            return letter
    return f"? {err}"


def table(cells: Mapping[tuple[str, str], str]) -> str:
    """The table in Markdown, with its reasons."""
    names = [kind.name for kind in KINDS]
    lines = [f"| | {' | '.join(names)} |", f"|---|{'---|' * len(names)}"]
    for feature in (*FEATURES, *AFTERWARDS):
        lines.append(f"| {feature} | {' | '.join(cells[feature, name] for name in names)} |")
    legend = [f"- **{letter}**: {reason}." for letter, (_, reason) in sorted(REASONS.items())]
    return "\n".join([*lines, "", *legend])


def write_logs(lib: Library, folder: Path) -> None:
    """Logs of all kinds of the robot `pair`."""
    rng, n = np.random.default_rng(0), lib.n_joints
    pi = lib.pi0 * np.where(np.arange(10 * n) % 10 == 0, 1.1, 1.05)

    def motion(t: np.ndarray, phase: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        w = np.array([1.1, 2.3, 3.7])[:, None, None] * np.linspace(0.8, 1.3, n)
        a = 0.35 / np.arange(1, 4)[:, None, None]
        x = w * t[None, :, None] + phase + np.arange(n)
        return (a * np.sin(x)).sum(0), (a * w * np.cos(x)).sum(0), -(a * w**2 * np.sin(x)).sum(0)

    def torque(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        return lib.inverse_dynamics(q, dq, ddq, pi) + 0.6 * dq + 0.8 * np.tanh(dq / 0.05)

    # Gains of motor currents need the lifts of 4 s; of all others 3 s do, 600 rows.
    long = np.arange(0.0, 4.0, 1 / RATE)
    t = long[:600]
    for name, phase in (("one", 0.0), ("two", 0.7)):
        q, dq, ddq = motion(t, phase)
        tau = torque(q, dq, ddq) + 0.05 * rng.normal(size=q.shape)
        np.savez(folder / f"{name}.npz", t=t, q=q, dq=dq, tau=tau)
    q, dq, ddq = motion(long, 0.0)
    tau = torque(q, dq, ddq) + 0.05 * rng.normal(size=q.shape)
    np.savez(folder / "amps.npz", t=long, q=q, dq=dq, i=tau / np.linspace(4.0, 9.0, n))
    (folder / "amps.toml").write_text(CURRENTS)
    q, dq = q[:600], dq[:600]
    late = torque(*motion(t + LATE, 0.0)) + 0.05 * rng.normal(size=q.shape)
    gains = {"kp": np.full(n, KP), "kd": np.full(n, KD)}
    desired = q + (late + KD * dq) / KP
    np.savez(folder / "servo.npz", t=t, q=q, dq=dq, q_des=desired, dq_des=0 * q, **gains)
    np.savez(folder / "rest.npz", **_poses(torque, n, rng))
    (folder / "arm.toml").write_text('trust = "cad"\n')
    body = {"link": lib.link_names[-1], "pi_in_link": [0.5, 0, 0, 0.05, 0.01, 0, 0, 0.01, 0, 0.01]}
    (folder / "payload.json").write_text(str(body).replace("'", '"'))


def _poses(
    torque: Callable[..., np.ndarray], n: int, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Eight poses, each reached from both sides and held for a second."""
    q, dq, tau = [], [], []
    for pose in rng.uniform(-1.2, 1.2, size=(8, n)):
        for side in (-1.0, 1.0):
            way = np.linspace(0.3 * side, 0.0, 60)[:, None]
            q += [*(pose + way), *np.repeat(pose[None], 100, axis=0)]
            dq += [*np.full((60, n), -side * 0.5), *np.zeros((100, n))]
            pull = torque(pose[None], np.zeros((1, n)), np.zeros((1, n)))[0] - 0.8 * side
            tau += [*np.repeat(pull[None], 160, axis=0)]
    rows = {"q": np.array(q), "dq": np.array(dq), "tau": np.array(tau)}
    noise = 0.01 * rng.normal(size=rows["tau"].shape)
    return {"t": np.arange(len(q)) / 100.0} | rows | {"tau": rows["tau"] + noise}


def write_walk(folder: Path) -> None:
    """Logs of the robot `walker`, with friction of its joints: a walk, and the rest of it."""
    feet, rows = ("left_fore", "right_fore"), 420  # of which 238 train: robust weights need 200
    whole = virtual_log(WALKER, feet, 0, Experiment(count=2 * rows)).arrays
    for name, part in (("walk", slice(0, rows)), ("later", slice(rows, None))):
        arrays = {key: x[part] if len(x) == 2 * rows else x for key, x in whole.items()}
        rng = np.random.default_rng(part.start)
        arrays["tau"] = arrays["tau"] + 0.6 * arrays["dq"] + 0.8 * np.tanh(arrays["dq"] / 0.05)
        for key, sigma in {"tau": 0.05, "contact_wrench": 0.3}.items():
            arrays[key] = arrays[key] + sigma * rng.normal(size=arrays[key].shape)
        np.savez(folder / f"{name}.npz", **arrays)


def words_of(kind: Kind, feature: str, robot: Path) -> tuple[list[str], list[str]]:
    """Command line that the cell needs before, whose result is OUT, and that of the cell."""
    log, out = [*kind.logs, "--robot", str(robot)], kind.name.replace(" ", "-")
    usual = ["identify", *log, "--settings", "report=false", "--overwrite", "--out"]
    first = [*usual, out, *kind.further]
    if feature in FEATURES:
        options = FEATURES[feature]
        further = () if options[:1] == kind.further[:1] else kind.further
        return [], [*usual, "cell", *further, *options]
    last = kind.logs[-1] if kind.name.startswith("several") else kind.logs[0]
    words = [{"LOG": last, "OUT": out}.get(word, word) for word in AFTERWARDS[feature]]
    if "LOG" in AFTERWARDS[feature]:
        words += ["--robot", str(robot)]
        words += ["--recipe", kind.logs[-1]] if "--recipe" in kind.logs else []
    if "LOGS" in words:
        words = [*words[:1], *log, *kind.further, *words[2:]]
    return first, words
