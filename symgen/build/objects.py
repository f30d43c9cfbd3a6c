"""Objects that the compiler made before, by content, for builds of this user.

<folder>/<key>.o, key = SHA-256 of the compiler, the flags, and the text of a source and of its
headers without comments, the prefix of the robot and the hash of its model. A build compiles only
what no other one has. A robot whose limits or bodies have changed needs nothing; another robot
needs all but the programs that know only sizes. In an object that another robot left, `objcopy`
renames the symbols, and the hash of the model, 64 characters, is replaced.

The folder is $SYMGEN_OBJECTS, else `objects` in $SYMGEN_CACHE or in the user's cache folder;
SYMGEN_OBJECTS=off compiles all. An object whose digest differs, or that others can write, does not
count.
"""

import hashlib
import json
import os
import platform
import re
import shutil
import stat
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import platformdirs

from symgen.build.compiler import compiler_version
from symgen.errors import CompilerError

UNUSED_S = 30 * 86400.0
"""Time without use after which an object is deleted [s]."""
DRAFT, DRAFT_S = ".new", 3600.0
"""Suffix of an object that is being written, and time after which its build was killed [s]."""
OFF = "off"
"""Value of $SYMGEN_OBJECTS that turns the cache off."""


class Objects:
    """Cache of the objects of one robot; several threads may use it at once.

    Args:
        robot: prefix of the functions.
        compiler: words of the command of the compiler.
    """

    def __init__(self, robot: str, compiler: tuple[str, ...]) -> None:
        self._robot, self._folder = robot, _folder()
        program = Path(shutil.which(compiler[0]) or compiler[0])
        facts = [program.stat().st_size, program.stat().st_mtime_ns] if program.exists() else []
        places = [os.environ.get(name, "") for name in _SEARCHED]
        tools = [*compiler, compiler_version(compiler), platform.libc_ver(), platform.machine()]
        self._tools = json.dumps([tools, facts, places])
        self._renames = bool(shutil.which("objcopy") and shutil.which("nm"))
        self._texts: dict[Path, str] = {}

    def restore(self, source: Path, flags: Sequence[str], unit: Path) -> bool:
        """Write an object that was made before."""
        if self._folder is None:
            return False
        entry = self._folder / f"{self._key(source, flags)}.o"
        try:
            if not _is_private(entry):
                return False
            head, _, data = entry.read_bytes().partition(b"\n")
            facts = json.loads(head)
            if facts["sha256"] != hashlib.sha256(data).hexdigest():
                return False
            model = _model(source.read_text(encoding="utf-8"))
            if bool(model) != bool(facts["model"]):
                return False
            unit.write_bytes(
                data.replace(facts["model"].encode(), model.encode()) if model else data
            )
            if facts["robot"] != self._robot:
                _rename(unit, facts["robot"], self._robot)
            os.utime(entry)
        except (OSError, ValueError, KeyError, TypeError, subprocess.CalledProcessError):
            unit.unlink(missing_ok=True)
            return False
        return True

    def keep(self, source: Path, flags: Sequence[str], unit: Path) -> None:
        """Store an object for later builds; a folder that cannot be written is left alone."""
        if self._folder is None:
            return
        data, model = unit.read_bytes(), _model(source.read_text(encoding="utf-8"))
        if model and data.count(model.encode()) != 1:
            return  # another build could not replace it
        digest = hashlib.sha256(data).hexdigest()
        facts = {"sha256": digest, "robot": self._robot, "model": model}
        with suppress(OSError):
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not _is_private(self._folder):
                return
            handle, draft = tempfile.mkstemp(prefix=".", suffix=DRAFT, dir=self._folder)
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(json.dumps(facts).encode() + b"\n" + data)
                os.replace(draft, self._folder / f"{self._key(source, flags)}.o")
            except BaseException:  # a full disk, or Ctrl-C
                Path(draft).unlink(missing_ok=True)
                raise

    def prune(self) -> None:
        """Delete objects that no build has used for `UNUSED_S`, and drafts of killed builds."""
        if self._folder is None or not _is_private(self._folder):
            return
        with suppress(OSError):  # another program has removed the folder
            for path in list(self._folder.iterdir()):
                limit = DRAFT_S if path.suffix == DRAFT else UNUSED_S
                with suppress(OSError):  # another build prunes, too
                    if time.time() - path.stat().st_mtime > limit:
                        path.unlink()

    def _key(self, source: Path, flags: Sequence[str]) -> str:
        if source not in self._texts:
            self._texts[source] = self._without_names(_with_headers(source))
        words = json.dumps([self._tools, [*flags], self._texts[source]])
        return hashlib.sha256(words.encode()).hexdigest()

    def _without_names(self, text: str) -> str:
        """Text without the prefix of the robot, where every use of it is a symbol or a macro."""
        quoted = re.sub(r"^#include .*", "", text, flags=re.MULTILINE)
        if not self._renames or re.search(rf'"[^"\n]*{self._robot}[^"\n]*"', quoted):
            return text
        macro = rf"(?<![A-Z0-9])(?<!__){self._robot.upper()}_"
        return re.sub(rf"\b{self._robot}(?=_|\.h\b)", "@", re.sub(macro, "@_", text))


_SEARCHED = ("CPATH", "C_INCLUDE_PATH", "COMPILER_PATH", "GCC_EXEC_PREFIX")
"""Variables that change what a compiler reads."""
_MODEL = re.compile(r'"([0-9a-f]{64})"')
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_INCLUDED = re.compile(r'^#include "(\w+\.h)"$', re.MULTILINE)


def _model(text: str) -> str:
    """Hash of the model in a source; empty where it has none."""
    match = _MODEL.search(text)
    return match[1] if match else ""


def _with_headers(source: Path) -> str:
    """Text of a source and of all headers beside it that it includes, without comments and hash."""
    names, texts = [source.name], list[str]()
    for name in names:  # grows by what the files include
        text = _COMMENT.sub("", (source.parent / name).read_text(encoding="utf-8"))
        names += [included for included in _INCLUDED.findall(text) if included not in names]
        texts.append(_MODEL.sub('""', text))
    return "\n".join(texts)


def _rename(unit: Path, old: str, new: str) -> None:
    """Give all symbols of a robot in an object the prefix of another."""
    nm, objcopy = _path_of("nm"), _path_of("objcopy")
    listed = subprocess.run([nm, str(unit)], capture_output=True, text=True, check=True).stdout
    names = sorted({line.split()[-1] for line in listed.splitlines()})
    renamed = {name: new + name.removeprefix(old) for name in names if name.startswith(f"{old}_")}
    table = unit.with_suffix(".names")
    table.write_text("".join(f"{a} {b}\n" for a, b in renamed.items()), encoding="utf-8")
    try:
        command = [objcopy, f"--redefine-syms={table}", str(unit)]
        subprocess.run(command, capture_output=True, check=True)
    finally:
        table.unlink()


def _path_of(tool: str) -> str:
    path = shutil.which(tool)
    if path is None:
        raise FileNotFoundError(tool)
    return path


def _folder() -> Path | None:
    """Folder of the objects; None where the cache is off, or others can write its usual place."""
    requested = os.environ.get("SYMGEN_OBJECTS", "")
    if requested == OFF:
        return None
    cache = os.environ.get("SYMGEN_CACHE", "")
    root = Path(cache).expanduser() if cache else platformdirs.user_cache_path("symgen")
    folder = Path(requested).expanduser().absolute() if requested else root.absolute() / "objects"
    if not folder.exists() or (folder.is_dir() and _is_private(folder)):
        return folder
    if not requested:
        return None
    if not folder.is_dir():
        raise CompilerError(
            f"expected SYMGEN_OBJECTS to be a folder, got the file '{folder}'; name another, or off"
        )
    raise CompilerError(
        f"expected SYMGEN_OBJECTS to be a folder that only you can write, got '{folder}', which "
        "others own or can write; name another folder, or make it yours (chown, chmod go-w)"
    )


def _is_private(path: Path) -> bool:
    """Whether only this user, its own group and the administrator can change a file or folder."""
    try:
        facts = path.lstat()
    except OSError:
        return False
    of_group = facts.st_mode & stat.S_IWGRP and facts.st_gid != os.getegid()
    return facts.st_uid in {os.getuid(), 0} and not (facts.st_mode & stat.S_IWOTH or of_group)
