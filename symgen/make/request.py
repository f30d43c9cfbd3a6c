"""What to build: a URDF, changes to it, and the configuration of the robot."""

import hashlib
import json
import re
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path

from msgspec import to_builtins

from runtime.common.compiler import find_compiler
from runtime.common.files import json_of, text_of
from symgen.chain import ChainOptions
from symgen.chain.mechanism import mechanism_from_table
from symgen.errors import BuildError
from symgen.make import ROBOTS, VERSION, bundled_robots
from symgen.make.config import CONFIG_KEYS, RobotConfig, config_from_table, read_config


@dataclass(frozen=True, slots=True)
class BuildRequest:
    """Everything that decides the bytes of a generated folder."""

    name: str  # folder and prefix of the C functions: a-z, 0-9, _
    urdf: str  # text of the URDF
    options: ChainOptions = field(default_factory=ChainOptions)  # changes to the URDF
    # what a URDF does not contain: home, further limits, proxies
    config: RobotConfig = field(default_factory=RobotConfig)
    project: bool = False  # True replaces inconsistent inertias by the nearest consistent ones

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", self.name):
            raise BuildError(
                f"the robot's name becomes a C prefix and a folder: expected lower-case letters, "
                f"digits and _, got '{self.name}'; choose another --name"
            )

    @property
    def fingerprint(self) -> str:
        """Hash of the inputs, of this package's source and of the tools that shape the output."""
        inputs = json.dumps(asdict(self), sort_keys=True, default=to_builtins)
        digest = hashlib.sha256(inputs.encode())
        package = Path(__file__).parents[1]
        for path in sorted(package.rglob("*")):
            if path.suffix in {".py", ".jinja2", ".h"}:
                digest.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
        digest.update(VERSION.encode())
        for tool in ("casadi", "pin", "numpy", "jinja2"):
            digest.update(f"{tool} {version(tool)}".encode())
        digest.update(" ".join(find_compiler()).encode())
        return digest.hexdigest()


def bundled_request(name: str) -> BuildRequest:
    """Return the request for a robot that ships with symgen."""
    urdf = ROBOTS / f"{name}.urdf"
    if not urdf.exists():
        known = ", ".join(bundled_robots())
        raise BuildError(
            f"no bundled robot is called '{name}' (there are {known}); "
            "build your own with --urdf FILE --name NAME"
        )
    return BuildRequest(name, urdf.read_text(), config=read_config(ROBOTS / f"{name}.toml"))


def request_from_folder(folder: Path) -> BuildRequest:
    """Return the request that regenerates a folder from its URDF and manifest."""
    name = folder.name
    try:
        manifest = json_of(folder / "manifest.json")
        urdf = text_of(folder / f"{name}.urdf")
        options = ChainOptions(
            tip=manifest["options"]["tip"],
            gravity=tuple(manifest["gravity"]),
            removed=tuple(manifest["removed"]),
            assumed=dict(manifest.get("assumed", {})),
            mechanism=mechanism_from_table(manifest.get("mechanism", {}), "manifest.json"),
            floating=bool(manifest.get("floating", False)),
        )
        table = {key: manifest[key] for key in CONFIG_KEYS if manifest[key] is not None}
        config = config_from_table(table, f"'{folder / 'manifest.json'}'")
        project = bool(manifest["options"]["project"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BuildError(
            f"'{folder}' is not a complete generated folder ({type(error).__name__}: {error}); "
            "build it again with: python -m symgen build"
        ) from None
    return BuildRequest(name, urdf, options, config, project)
