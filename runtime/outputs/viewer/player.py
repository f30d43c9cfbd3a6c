"""Controls of the viewer: play, pause, speed, time; bars of q, dq and τ against their limits."""

import time
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from runtime.common.optional import optional
from runtime.errors import RecordingError
from runtime.excitation.motion.trajectory import read_trajectory
from runtime.library import Array, Library
from runtime.outputs.viewer.shapes import BASE, Look
from runtime.recording import read_recording
from runtime.recording.coupled_joints import independent_joints

ROOT = "/robot"
HOST = "127.0.0.1"
PATH_POINTS = 400
PATH_COLOUR = (213, 94, 0)
FRAME_S = 0.04  # time step of an exported film [s]


class Scene:
    """Server that shows one robot until `close`.

    Attributes:
        server: server of viser.
        frames: handles of the frames by link name.
    """

    def __init__(self, lib: Library, look: Look, port: int) -> None:
        self._lib = lib
        viser = optional("viser", "the viewer", "view")
        self.server = viser.ViserServer(host=HOST, port=port, label=lib.name, verbose=False)
        world = self.server.scene
        world.set_up_direction("+z")
        world.add_grid("/ground", width=2.0, height=2.0, cell_size=0.1)
        names = (BASE, *lib.link_names)
        self.frames = {name: world.add_frame(f"{ROOT}/{name}", show_axes=False) for name in names}
        for shape in look.shapes:
            position, wxyz, scale = parts(shape.pose)
            world.add_mesh_trimesh(
                f"{ROOT}/{shape.link}/{shape.name}",
                shape.mesh,
                scale=scale,
                position=position,
                wxyz=wxyz,
            )
        camera = self.server.initial_camera
        camera.position, camera.look_at = (1.6, -1.6, 1.1), (0.0, 0.0, 0.45)
        self.pose(lib.home)

    @property
    def url(self) -> str:
        """Address for the browser."""
        return f"http://{HOST}:{self.server.get_port()}"

    def pose(self, q: Array) -> None:
        """Place all links at the joint positions q (n,) [rad, m]."""
        with self.server.atomic():
            for name, pose in zip(self._lib.link_names, self._lib.link_poses(q), strict=True):
                frame = self.frames[name]
                frame.position, frame.wxyz, _ = parts(pose)

    def trace(self, q: Array) -> None:
        """Draw the path of the tip at joint positions q (N, n) [rad, m]."""
        kept = q[:: max(1, len(q) // PATH_POINTS)]
        points = self._lib.end_effector(kept)[:, :3, 3]
        if len(points) > 1:
            pairs = np.stack([points[:-1], points[1:]], axis=1)
            self.server.scene.add_line_segments("/path", pairs, colors=PATH_COLOUR, thickness=0.006)

    def film(self, positions: Array) -> str:
        """HTML file that plays joint positions (N, n) [rad, m], one frame every `FRAME_S`."""
        serializer = self.server.get_scene_serializer()
        for q in positions:
            self.pose(q)
            serializer.insert_sleep(FRAME_S)
        return str(serializer.as_html())

    def close(self) -> None:
        """Stop the server and its threads."""
        self.server.stop()


def parts(pose: Array) -> tuple[Array, Array, tuple[float, float, float]]:
    """Position (3,) [m], quaternion w, x, y, z and scales of a pose [R S, p; 0 1]."""
    x, y, z = (float(size) for size in np.linalg.norm(pose[:3, :3], axis=0))
    turn = Rotation.from_matrix(pose[:3, :3] / [x, y, z])
    return pose[:3, 3], turn.as_quat(scalar_first=True), (x, y, z)


RATE_HZ = 100.0  # sample rate of a trajectory [Hz]

TRAJECTORY = ".json"


@dataclass(frozen=True, slots=True)
class PlayedMotion:
    """Motion that the viewer plays."""

    name: str  # shown above the controls
    t: Array  # (N,) time from 0 [s]
    q: Array  # (N, n) joint positions [rad, m]
    dq: Array | None  # (N, n) joint velocities [rad/s, m/s]; None where unknown
    tau: Array | None  # (N, n) torques [N·m, N]; None where unknown

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return float(self.t[-1])

    def at(self, t: float) -> tuple[Array, Array | None, Array | None]:
        """q, dq and τ at the time t [s], (n,) each, by linear interpolation."""

        def between(values: Array) -> Array:
            return np.array([np.interp(t, self.t, column) for column in values.T])

        dq = None if self.dq is None else between(self.dq)
        tau = None if self.tau is None else between(self.tau)
        return between(self.q), dq, tau


def read_motion(
    source: str, lib: Library, recipe: str | None = None, run: str | None = None
) -> PlayedMotion:
    """Read a trajectory of `excite` or a recording."""
    path = Path(source)
    if path.suffix == TRAJECTORY:
        trajectory = read_trajectory(path, lib)
        t = np.linspace(0, trajectory.duration, 1 + round(trajectory.duration * RATE_HZ))
        q, dq, ddq, _ = trajectory.at(lib, t)
        return PlayedMotion(path.name, t, q, dq, lib.inverse_dynamics(q, dq, ddq, lib.pi0))
    log = independent_joints(read_recording(source, recipe, run, lib.joint_names), lib)
    if log.q.shape[1] != lib.n_joints:
        raise RecordingError(
            f"expected {lib.n_joints} joints of '{lib.name}', got {log.q.shape[1]} in '{source}'; "
            "name the robot with --robot"
        )
    if not np.isfinite(log.q).all():
        raise RecordingError(
            f"expected finite positions in '{source}', got NaN or infinity; correct the log"
        )
    return PlayedMotion(log.name or path.name, log.t - log.t[0], log.q, log.dq, log.tau)


TICK_S = 1 / 30
BARS_S = 0.1
SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "4")
_GOOD, _FULL = "#0072B2", "#D55E00"
NEAR = 0.95  # share of a limit from which the bar changes its colour


class Player:
    """Controls in the browser, and the clock of the motion."""

    def __init__(self, lib: Library, scene: Scene, motion: PlayedMotion) -> None:
        self._lib, self._scene, self._motion = lib, scene, motion
        gui = scene.server.gui
        gui.add_markdown(f"**{lib.name}** · {motion.name} · {motion.duration:.1f} s")
        self.play = gui.add_checkbox("play", True)
        self.speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        longest = max(motion.duration, 0.01)
        self.time = gui.add_slider("time [s]", 0.0, longest, 0.01, initial_value=0.0)
        self.bars = gui.add_html("")
        self._shown = -1.0
        self._barred = -np.inf
        self.show(0.0)

    def show(self, t: float) -> None:
        """Show the pose at the time t [s], and update the bars at most every `BARS_S`."""
        q, dq, tau = self._motion.at(t)
        self._scene.pose(q)
        self._shown = t
        if time.monotonic() - self._barred > BARS_S or not self.play.value:
            self.bars.content = bars(self._lib, q, dq, tau)
            self._barred = time.monotonic()

    def tick(self, elapsed: float) -> None:
        """Advance by `elapsed` seconds of real time, or to the time that the slider was set to."""
        if self.time.value != round(self._shown, 2):
            self._shown = float(self.time.value)
        t = self._shown
        if self.play.value:
            t = (t + float(self.speed.value) * elapsed) % max(self._motion.duration, 0.01)
            self.time.value = round(t, 2)
        self.show(t)

    def run(self) -> None:
        """Play until Ctrl-C."""
        last = time.monotonic()
        while True:
            time.sleep(TICK_S)
            now = time.monotonic()
            self.tick(now - last)
            last = now


def bars(lib: Library, q: Array, dq: Array | None, tau: Array | None) -> str:
    """HTML table with a row per joint: q, dq and τ (n,) as shares of their limits."""
    lines = []
    for j, joint in enumerate(lib.manifest.joints):
        share = None
        if joint.lower is not None and joint.upper is not None:  # of half the range
            share = abs(2 * q[j] - joint.lower - joint.upper) / (joint.upper - joint.lower)
        cells = [_cell(q[j], share)]
        for values, limit in ((dq, joint.velocity), (tau, joint.effort)):
            known = None if values is None else float(values[j])
            cells.append(_cell(known, None if known is None or not limit else abs(known) / limit))
        lines.append(f'<tr title="{escape(joint.name)}"><th>{j + 1}</th>{"".join(cells)}</tr>')
    turning = all(joint.unit == "rad" for joint in lib.manifest.joints)
    units = ("rad", "rad/s", "N·m") if turning else ("rad|m", "rad|m /s", "N·m|N")
    heads = (f"<td>{name} {unit}</td>" for name, unit in zip(("q", "dq", "τ"), units, strict=True))
    return (
        '<table style="font:12px sans-serif;width:100%;padding:0 .8em;border-spacing:.5em .25em">'
        f'<tr style="opacity:.6"><th></th>{"".join(heads)}</tr>{"".join(lines)}</table>'
    )


def _cell(value: float | None, share: float | None) -> str:
    """Cell with a number and the bar of its share; the number alone without a limit."""
    if value is None:
        return "<td>–</td>"
    if share is None:
        return f"<td>{value:+.2f}</td>"
    colour = _FULL if share > NEAR else _GOOD
    return (
        f'<td>{value:+.2f} <span style="float:right;opacity:.6">{100 * share:.0f} %</span>'
        '<div style="clear:both;height:5px;background:#8883;border-radius:3px">'
        f'<div style="width:{100 * min(share, 1.0):.0f}%;height:5px;background:{colour};'
        'border-radius:3px"></div></div></td>'
    )
