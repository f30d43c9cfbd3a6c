"""Check the sdist and the wheel in a folder: python -m scripts.packages DIR

Metadata are valid; every module, template, recipe, robot, example, tutorial and generated file of
the repository is inside; no library, no test and nothing else is.
"""

import subprocess
import sys
import tarfile
import zipfile
from email.parser import BytesParser
from pathlib import Path

from packaging.metadata import Metadata

ROOT = Path(__file__).parents[1]
SHIPPED = ("symgen/", "runtime/", "generated/")
BUILT = (".so", ".pyc", "build.json")


def faults_of(folder: Path) -> list[str]:
    """One sentence per fault of the only sdist and the only wheel in a folder."""
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as archive:
        inside = set(archive.namelist())
        (facts,) = (name for name in inside if name.endswith(".dist-info/METADATA"))
        in_wheel = {name for name in inside if ".dist-info/" not in name}
        metadata = archive.read(facts)
    with tarfile.open(sdist) as archive:
        in_sdist = {name.partition("/")[2] for name in archive.getnames()}
    wanted = tracked()
    moved = {name.replace("generated/", "runtime/generated/", 1) for name in wanted}
    return [
        *metadata_faults(metadata),
        *(f"the wheel lacks {name}" for name in sorted(moved - in_wheel)),
        *(f"the wheel has {name}, which is not ours" for name in sorted(in_wheel - moved)),
        *(f"the sdist lacks {name}" for name in sorted(wanted - in_sdist)),
        *(
            f"the sdist has {name}"
            for name in sorted(in_sdist)
            if name.endswith(BUILT) or name.startswith(("tests/", "scripts/", "results/"))
        ),
    ]


def metadata_faults(data: bytes) -> list[str]:
    """Faults of METADATA by the specification of core metadata and by this project."""
    metadata = Metadata.from_email(data, validate=True)  # raises with every fault in it
    needs = {
        requirement.name for requirement in metadata.requires_dist or () if not requirement.marker
    }
    faults = [
        f"the base install needs {name}" for name in ("casadi", "pin", "mujoco") if name in needs
    ]
    if not BytesParser().parsebytes(data).get_payload():
        faults.append("the metadata have no description")
    return faults


def tracked() -> set[str]:
    """Files of the packages that git tracks or would track."""
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard", *SHIPPED]
    run = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    return {name for name in run.stdout.splitlines() if (ROOT / name).exists()}


def main() -> int:
    """Print the faults; exit code 1 if there are any."""
    faults = faults_of(Path(sys.argv[1]))
    print("\n".join(faults) or "sdist and wheel: metadata and contents as expected")
    return int(bool(faults))


if __name__ == "__main__":
    raise SystemExit(main())
