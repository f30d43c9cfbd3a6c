"""A robot by name or folder, and one typed NumPy method per kernel of it."""

import ctypes
import os
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from platform import python_version

import numpy as np

from runtime.common.files import sha256_of
from runtime.common.user_builds import NAME, built_folders, is_user_build
from runtime.errors import LibraryError
from runtime.library.arrays import Array
from runtime.library.binding import Binding, typed
from runtime.library.free_base import FREEDOM, ROWS
from runtime.library.joint_kernels import BodyKernels, JointKernels, ProofKernels, SafetyKernels
from runtime.library.manifest import read_manifest
from runtime.library.motion_kernels import MotionKernels


class CompiledStatistics:
    """Triangles R of samples, and of triangles; columns are [F; Y_b; τ], friction joint by joint.

    The calls leave Python's lock, so that several threads may run them at once.
    """

    def __init__(self, binding: Binding, joints: int, base: int) -> None:
        self._joints, self._base = joints, base
        of_level, count, address = binding.of_level, ctypes.c_long, ctypes.c_void_p
        state, ends = (address,) * 4, (*(address,) * 5, count)
        self._update = binding.plain("statistics_update", address, ctypes.c_double, *(address,) * 5)
        self._work = typed(of_level("statistics_work"), count, count)
        self._join_work = typed(of_level("statistics_join_work"), count, count, count)
        self._run = typed(of_level("statistics"), count, count, *state, count, *ends)
        self._join = typed(of_level("statistics_join"), None, count, count, *(address,) * 3)

    def triangle(
        self,
        q: Array,
        dq: Array,
        ddq: Array,
        tau: Array,
        columns: Array,  # (N, n, k)
        weights: Array,  # (n,)
        sample_weights: Array | None,  # (N,)
        products: bool = True,
    ) -> tuple[Array, int]:
        """Triangle R with RᵀR = Σ s [F Y_b τ]ᵀ W [F Y_b τ], diagonal ≥ 0, of contiguous arrays."""
        k = columns.shape[2]
        size = self._joints * k + self._base + 1
        work, triangle = np.empty(self._work(k)), np.empty((size, size))
        state = (a.ctypes.data for a in (q, dq, ddq, tau))
        extra = None if sample_weights is None else sample_weights.ctypes.data
        ends = (weights.ctypes.data, extra, work.ctypes.data, triangle.ctypes.data)
        multiplied = self._run(len(q), *state, k, columns.ctypes.data, *ends, int(products))
        return triangle, int(multiplied)

    def update(
        self,
        triangle: Array,
        forgetting: float,
        q: Array,
        dq: Array,
        ddq: Array,
        tau: Array,
        weights: Array,
    ) -> None:
        """Add one sample to a triangle (n_b + 1, n_b + 1) over [β; τ], in place."""
        state = (a.ctypes.data for a in (q, dq, ddq, tau, weights))
        self._update(triangle.ctypes.data, forgetting, *state)

    def join(self, triangles: Array) -> Array:
        """One triangle (p, p) for the rows of several, (count, p, p) and contiguous."""
        count, size = triangles.shape[:2]
        work, triangle = np.empty(self._join_work(size, count)), np.empty((size, size))
        ends = (triangles.ctypes.data, work.ctypes.data, triangle.ctypes.data)
        self._join(size, count, *ends)
        return triangle


class Library(JointKernels, MotionKernels, SafetyKernels, ProofKernels, BodyKernels):
    """Compiled physics of one robot; every method takes one sample or N.

    n independent joints, L links, n_b base parameters; L = n unless joints are coupled or the base
    is free. π and λ of all links are flat, link by link, (10 L,), those of a free base first. `pi0`
    and `lam0` are those of the URDF. With a free base, n + 6 entries stand for n in rows of torque.
    """

    def __init__(self, folder: Path, level: str | None = None, threads: int | None = None) -> None:
        self.folder = folder
        self.manifest = read_manifest(folder / "manifest.json")
        self.binding = Binding(folder, self.manifest, level, threads)
        self.level, self.levels = self.binding.level, self.binding.levels
        m = self.manifest
        self.compiled_statistics = (
            CompiledStatistics(
                self.binding, len(m.joints) + (FREEDOM if m.floating else 0), len(m.base_columns)
            )
            if self.binding.of_level("statistics") is not None
            else None
        )
        """The statistics of this level in C; None where the library has none."""
        self.name = m.robot
        self.joint_names = tuple(j.name for j in m.joints)
        """Names of the n independent joints, the order of q."""
        self.all_joint_names = tuple(j.name for j in m.all_joints[m.floating :])
        """Names of all joints, one per moving link: the order of `all_positions`."""
        self.link_names = tuple(j.link for j in m.all_joints)
        self.n_joints, self.n_links = len(m.joints), len(m.all_joints)
        self.row_names = (*(ROWS if m.floating else ()), *self.joint_names)
        """Names of the rows of torques and regressors; those of a free base come first."""
        self.n_rows = len(self.row_names)
        self.pi0: Array = np.array(m.pi0)
        self.lam0: Array = np.array(m.lam0)
        self.base_matrix: Array = np.array(m.base_matrix)
        """K in β = K π, (n_b, 10 L)."""
        self.base_columns = m.base_columns
        """Indices into π; Y_b = Y[:, base_columns]."""
        self.home: Array = np.array(m.home)
        self.gravity: Array = np.array(m.gravity)
        self.proxies = m.proxies
        """Capsules that enclose the links, `ProxyFacts`; empty where the robot has none."""
        self.pairs = m.pairs
        """`PairFacts`: the rows of `clearance`."""
        self.moving_proxies = m.moving_proxies
        """Names of the proxies that are the rows of `plane_clearance`."""
        self.braking = m.braking
        """Velocity limits near the ends of the range, `BrakingFacts`; None without."""

    def __repr__(self) -> str:
        sizes = f"{self.n_joints} joints, {len(self.base_columns)} base parameters"
        return f"Library({self.name!r}, {sizes})"

    def limits(self) -> dict[str, Array]:
        """Limits per joint, (n,), ±inf where unlimited.

        lower, upper [rad or m], velocity, acceleration and jerk (their derivatives), effort
        [N·m or N], torque_rate (its derivative); tip_speed [m/s], of the tip, is one number ().
        """
        m, inf = self.manifest, np.inf

        def column(key: str, missing: float) -> Array:
            values = [getattr(j, key) for j in m.joints]
            return np.array([missing if v is None else v for v in values], dtype=float)

        free = (inf,) * self.n_joints
        return {
            "lower": column("lower", -inf),
            "upper": column("upper", inf),
            "velocity": column("velocity", inf),
            "effort": column("effort", inf),
            "acceleration": np.array(m.acceleration or free),
            "jerk": np.array(m.jerk or free),
            "torque_rate": np.array(m.torque_rate or free),
            "tip_speed": np.array(inf if m.tip_speed is None else m.tip_speed),
        }

    @property
    def placeholders(self) -> tuple[str, ...]:
        """Links whose π0 means nothing: the URDF has no <inertial>, and no mass was stated."""
        return tuple(k for k, source in self.manifest.assumed.items() if source == "placeholder")

    def urdf(self) -> str:
        """The URDF that the kernels describe, as symgen normalised it."""
        path = self.folder / f"{self.name}.urdf"
        try:
            return path.read_text(encoding="utf-8")
        except OSError:
            raise LibraryError(f"'{path}' is missing; run: python -m symgen build") from None

    @property
    def versions(self) -> dict[str, str]:
        """Versions of Python, of the packages that compute a result, and of the generator."""
        packages = (import_module(name) for name in ("numpy", "scipy", "clarabel"))
        used = {each.__name__: str(each.__version__) for each in packages}
        return {"python": python_version()} | used | self.manifest.versions

    @property
    def descends(self) -> bool:
        """Whether this level holds the loops of the compiled descents."""
        return self.binding.of_level("adam") is not None


class ForeignRobotError(LibraryError):
    """A robot of this name lies in the working directory only, and was not built by this user."""

    def __init__(self, robot: str, folder: Path) -> None:
        self.folder = folder
        super().__init__(
            f"expected '{robot}' to come with the package or to be built by you, got it only in "
            f"'{folder}'; to run the code of that folder, give --robot {folder} or --settings "
            f"yes=true"
        )


@dataclass(frozen=True, slots=True)
class RobotFolder:
    """Generated folder of a robot."""

    folder: Path  # the folder
    origin: str  # whose it is, a phrase


def find(robot: str | os.PathLike[str]) -> RobotFolder:
    """Generated folder of a robot.

    A name, [a-z][a-z0-9_]*, is looked up in the package, then among the folders that this user has
    built, of which ./generated/<name> comes first. Anything else is a path.
    """
    if not isinstance(robot, str | os.PathLike):
        raise LibraryError(f"expected the name or folder of a robot, got {robot!r:.60}")
    if Path(robot).is_file():
        stem = Path(robot).stem
        raise LibraryError(
            f"expected the name or folder of a built robot, got the file '{robot}'; run: python -m "
            f"symgen build --urdf {robot} --name {stem if NAME.fullmatch(stem) else 'NAME'}"
        )
    if isinstance(robot, os.PathLike) or not NAME.fullmatch(robot):
        return RobotFolder(Path(robot), "the folder that was given")
    package = Path(__file__).parents[1]  # generated/ lies in it if installed, else beside it
    roots = [folder / "generated" for folder in (package, package.parent)]
    for root in roots:
        if (root / robot / "manifest.json").exists():
            return RobotFolder(root / robot, "the package")
    here = Path("generated") / robot
    if _is_built_here(here, robot):
        return RobotFolder(here, "your build")
    for folder in built_folders(robot):
        return RobotFolder(folder, "your build")
    if (here / "manifest.json").exists():
        raise ForeignRobotError(robot, here)
    bundled = (package.parent / "symgen" / "robots" / f"{robot}.urdf").exists()
    options = f"--robot {robot}" if bundled else f"--urdf FILE --name {robot}"
    raise LibraryError(
        f"no generated robot is called '{robot}' (looked in "
        f"{', '.join(str(root) for root in roots)}, your builds and {Path.cwd() / 'generated'}); "
        f"give the path of its folder, or run: python -m symgen build {options}"
    )


def _is_built_here(folder: Path, robot: str) -> bool:
    """Whether the library in a folder of the working directory was built by this user."""
    library = folder / f"lib{robot}.so"
    try:
        digest = sha256_of(library)
    except OSError:
        return False
    return (folder / "manifest.json").is_file() and is_user_build(library, digest)


def require_library(value: object) -> None:
    """Raise LibraryError for what is no library of a robot."""
    if not isinstance(value, Library):
        raise LibraryError(f"expected a library, as runtime.load gives it, got {value!r:.60}")


def load(
    robot: str | os.PathLike[str], level: str | None = None, threads: int | None = None
) -> Library:
    """Library of a robot by name, or by the folder that symgen wrote.

    A name, [a-z][a-z0-9_]*, is looked up among the robots that come with the package, then among
    those that you have built. A folder is loaded by its path, which contains a slash or is a Path:
    its code runs in this process. A compiled library that you did not build is never opened; the C
    code of its folder is compiled instead, as where there is no library, at the first use; a line
    on stderr says so. The library is kept in the user's cache folder ($SYMGEN_CACHE).

    Args:
        robot: name, or path of a generated folder.
        level: instruction set of the batch functions, by default the best that runs here: v4
            (AVX-512), v3 (AVX2), v2, neon or portable; casadi is CasADi's C, the reference.
            $SYMGEN_LEVELS restricts which are compiled.
        threads: number of threads for batches that take milliseconds; by default one per core.
            Results do not depend on it, to the last bit.

    Returns:
        The robot's kernels as NumPy methods.

    Raises:
        LibraryError: missing, stale, foreign or damaged; the message states the command to run.
    """
    return Library(find(robot).folder, level, threads)
