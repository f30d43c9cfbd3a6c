"""MJCF file → MuJoCo's compiled model, within bounds of files, time and memory.

MuJoCo opens what `file` attributes name, however large, and waits at a pipe for ever. Before it
does, every file that exists must be a regular one of bounded size, in included files too.
Attributes are searched in the text: MuJoCo accepts files that are not well-formed XML. Its compiler
runs in a process of its own, as a height field or a replicate takes memory without end.
"""

import re
import stat
import tempfile
from dataclasses import dataclass
from html import unescape
from itertools import chain, product
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.child import ExceededError, Limits, answer_of
from runtime.common.files import LARGEST_DOCUMENT
from symgen.errors import BuildError

LARGEST_ASSET = 2**28  # largest mesh, texture or height field, bytes
MOST = 50_000  # largest number of files that are named
_MOST_PLACES = 1_000_000  # largest number of pairs of a folder and a name that are looked at
_NAMED = re.compile(r"""\b(file\w*|meshdir|texturedir|assetdir)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
"""Names of files (file, fileright, fileup, … of a texture) and of their folders."""
LIMITS = Limits(seconds=30, patience=55.0, memory=2**32, file=2**30)  # limits of MuJoCo's compiler


@dataclass(frozen=True, slots=True, eq=False)
class CompiledMjcf:
    """What MuJoCo makes of a file."""

    name: str  # of the model
    model: Any  # MuJoCo's model; None where it rejects the file
    notes: tuple[str, ...] = ()  # sentences on what was left out
    reason: str = ""  # why MuJoCo rejects the file; empty where it does not
    bodies: tuple[dict[str, Any], ...] = ()  # bodies, joints: as written, of a rejected file
    joints: tuple[dict[str, Any], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
    """Bodies of a compiled model as links, whose frames lie at the anchors of their last joints."""

    mujoco: Any  # the package
    model: Any  # its compiled model
    names: list[str]  # of the links
    shifts: dict[int, np.ndarray]  # body of the robot → its last joint's anchor in it, (3,) m

    def joint(self, k: int) -> str:
        """Name of a joint."""
        return self.model.joint(k).name or f"joint_{k}"

    def tendon(self, k: int) -> str:
        """Name of a tendon."""
        return self.model.tendon(k).name or f"tendon_{k}"

    def is_joint(self, k: int, *kinds: str) -> bool:
        """Whether a joint is of one of these kinds: FREE, BALL, SLIDE, HINGE."""
        types = self.mujoco.mjtJoint
        kind_of_joint = int(self.model.jnt_type[k])
        return kind_of_joint in {int(getattr(types, f"mjJNT_{kind}")) for kind in kinds}


def compile_mjcf(path: Path, limits: Limits = LIMITS) -> CompiledMjcf:
    """Compile an MJCF file."""
    try:
        import mujoco
    except ImportError:
        raise BuildError(
            f"'{path}' is an MJCF file, which MuJoCo reads; run: pip install mujoco"
        ) from None
    require_bounded_files(path)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "model.mjb"
        try:
            job = {"path": str(path), "out": str(out)}
            answer = answer_of("symgen.sources.mjcf_child", job, limits)
        except ExceededError as error:
            raise BuildError(
                f"MuJoCo cannot compile '{path}': it takes more than {error}; remove height "
                "fields, textures, replicates and assets that no joint needs"
            ) from None
        if "unparsed" in answer:
            raise BuildError(
                f"MuJoCo cannot parse '{path}' ({answer['unparsed']}); correct the file"
            )
        name = answer["name"] or path.stem
        if "reason" in answer:
            written = tuple(answer["bodies"]), tuple(answer["joints"])
            return CompiledMjcf(name, None, (), answer["reason"], *written)
        return CompiledMjcf(name, mujoco.MjModel.from_binary_path(str(out)), tuple(answer["notes"]))


def rotation_of(quaternion: Any) -> np.ndarray:
    """Rotation of a quaternion (w, x, y, z), as MuJoCo computes it."""
    import mujoco

    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.array(quaternion, dtype=float))
    return matrix.reshape(3, 3)


def require_bounded_files(path: Path) -> None:
    """Refuse an MJCF file that names pipes, devices or files of hundreds of megabytes."""
    folders, names, known = set[Path](), set[str](), set[Path]()
    pending = [path]
    while pending:
        file = pending.pop()
        if file in known:
            continue
        known.add(file)
        text = _text_of(file)
        if not text and file != path:  # a mesh or an image names no file
            continue
        listed, places = _named_in(text)
        new = {path.parent, file.parent, *(f.parent / p for f in (path, file) for p in places)}
        fresh, more = new - folders, listed - names
        folders |= fresh
        names |= more
        if len(names) > MOST:
            raise BuildError(f"'{path}' names more than {MOST} files; leave some out")
        if len(folders) * len(names) > _MOST_PLACES:
            raise BuildError(
                f"'{path}' names {len(names)} files, which may lie in {len(folders)} folders: more "
                f"than {_MOST_PLACES} places to look at; include fewer folders"
            )
        # An asset may lie in a folder that a later file names: each pair is looked at once.
        for folder, name in chain(product(fresh, names), product(folders - fresh, more)):
            if _is_bounded(path, folder / name):
                pending.append(folder / name)


def _named_in(text: str) -> tuple[set[str], set[str]]:
    """Names of files, and of their folders."""
    files, places = set[str](), set[str]()
    for key, *values in _NAMED.findall(text):
        (places if key.endswith("dir") else files).add(unescape("".join(values)))
    return files, places


def _is_bounded(path: Path, asset: Path) -> bool:
    """Whether a file exists."""
    try:
        status = asset.stat()
    except (OSError, ValueError):  # MuJoCo names what it does not find
        return False
    if stat.S_ISDIR(status.st_mode):
        return False
    if not stat.S_ISREG(status.st_mode):
        raise BuildError(f"'{path}' names '{asset}', which is not a regular file; remove it")
    if status.st_size > LARGEST_ASSET:
        raise BuildError(
            f"'{path}' names '{asset}' of more than {LARGEST_ASSET >> 20} MiB; remove it"
        )
    return True


def _text_of(file: Path) -> str:
    """Text of a file that may be XML; empty for a mesh, an image or a file of other text."""
    try:
        if file.stat().st_size > LARGEST_DOCUMENT:
            return ""
        data = file.read_bytes()
    except OSError:  # MuJoCo says why
        return ""
    head = data[:512].lstrip(b"\xef\xbb\xbf \t\r\n")
    return data.decode(errors="replace") if head.startswith(b"<") else ""
