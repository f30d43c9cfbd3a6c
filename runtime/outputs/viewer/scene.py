"""The robot in a browser: one frame per link with its shapes, placed by the kernels."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from runtime.errors import RuntimeFault
from runtime.library import Array, Library
from runtime.outputs.viewer.shapes import BASE, Look

ROOT = "/robot"
HOST = "127.0.0.1"
PATH_POINTS = 400
PATH_COLOUR = (213, 94, 0)
FRAME_S = 0.04
"""Time step of an exported film [s]."""


def viewer_library() -> Any:
    """Import viser."""
    try:
        import viser
    except ImportError:
        raise RuntimeFault(
            "the viewer is not installed; install it with: pip install 'symgen[view]'"
        ) from None
    return viser


class Scene:
    """Server that shows one robot until `close`.

    Attributes:
        server: server of viser.
        frames: handles of the frames by link name.
    """

    def __init__(self, lib: Library, look: Look, port: int) -> None:
        self._lib = lib
        self.server = viewer_library().ViserServer(
            host=HOST, port=port, label=lib.name, verbose=False
        )
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
