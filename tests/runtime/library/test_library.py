"""The counter between the workshops: what loads, and what is refused."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import runtime
from runtime.common.files import sha256_of
from runtime.errors import LibraryError
from runtime.library import Library, load
from symgen.make import bundled_robots
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.conftest import REPOSITORY
from tests.robots import ONE_LEVEL


def test_loads_by_folder_and_by_name(tiny: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: by path, by Path, and by name from ./generated."""
    tiny.parent.rename(tiny.parents[1] / "generated")
    monkeypatch.chdir(tiny.parents[1])
    for how in ("tiny", "generated/tiny", Path("generated/tiny").resolve()):
        lib = runtime.load(how)
        assert lib.name == "tiny"
        assert (lib.joint_names, lib.link_names, lib.n_joints) == (("swing",), ("rod",), 1)
    assert repr(lib) == f"Library('tiny', 1 joints, {len(lib.base_columns)} base parameters)"


def test_unknown_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: says where it looked and what to run."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LibraryError, match=r"called 'r2d2' .*symgen build --urdf FILE --name r2d2"):
        load("r2d2")
    for name in bundled_robots():
        if not (REPOSITORY / "generated" / name).exists():
            with pytest.raises(LibraryError, match=rf"run: python -m symgen build --robot {name}$"):
                load(name)
    with pytest.raises(LibraryError, match=r"holds no manifest.json; run: python -m symgen build"):
        load(tmp_path / "r2d2")


def damage_remove_library(folder: Path) -> None:
    for name in ("libtiny.so", "compile.json"):  # from its C code it would be compiled
        (folder / name).unlink()


def damage_truncate_library(folder: Path) -> None:
    os.truncate(folder / "libtiny.so", 5000)


def damage_empty_library(folder: Path) -> None:
    (folder / "libtiny.so").write_bytes(b"")


def damage_flip_one_byte(folder: Path) -> None:
    data = bytearray((folder / "libtiny.so").read_bytes())
    data[len(data) // 2] ^= 1
    (folder / "libtiny.so").write_bytes(data)


def damage_remove_record(folder: Path) -> None:
    (folder / "build.json").unlink()


def damage_garble_record(folder: Path) -> None:
    (folder / "build.json").write_text("[]")


def damage_change_manifest(folder: Path) -> None:
    path = folder / "manifest.json"
    path.write_text(path.read_text().replace('"velocity": 3.0', '"velocity": 4.0'))


def damage_truncate_manifest(folder: Path) -> None:
    os.truncate(folder / "manifest.json", 100)


def damage_empty_manifest(folder: Path) -> None:
    (folder / "manifest.json").write_text("{}")


def damage_old_format(folder: Path) -> None:
    path = folder / "manifest.json"
    path.write_text(path.read_text().replace('"format": 4', '"format": 0'))


def damage_remove_manifest(folder: Path) -> None:
    (folder / "manifest.json").unlink()


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (damage_remove_library, "holds neither a compiled library nor a compile.json"),
        (damage_truncate_library, "is damaged or not the one built here"),
        (damage_empty_library, "is damaged or not the one built here"),
        (damage_flip_one_byte, "is damaged or not the one built here"),
        (damage_remove_record, "has no valid build.json"),
        (damage_garble_record, "has no valid build.json"),
        (damage_change_manifest, "is older than its manifest.json"),
        (damage_truncate_manifest, "is damaged .not JSON."),
        (damage_empty_manifest, "is damaged .no valid 'format'."),
        (damage_old_format, "has the format 0, expected 4"),
        (damage_remove_manifest, "holds no manifest.json"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_damage_is_refused(tiny: Path, damage: Callable[[Path], None], message: str) -> None:
    """Property: one sentence with what to run; a truncated object never reaches the loader."""
    damage(tiny)
    with pytest.raises(LibraryError, match=f"{message}.*; run: python -m symgen build"):
        load(tiny)


def test_library_of_another_robot(tiny: Path, fr3: Library) -> None:
    """Property: refused by its bytes, and by its symbols even if the record is forged."""
    shutil.copy(fr3.folder / "libfr3.so", tiny / "libtiny.so")
    with pytest.raises(LibraryError, match="not the one built here"):
        load(tiny)
    record = json.loads((tiny / "build.json").read_text())
    record["sha256"] = sha256_of(tiny / "libtiny.so")
    (tiny / "build.json").write_text(json.dumps(record))
    with pytest.raises(LibraryError, match=r"cannot be used here .*tiny_model_hash"):
        load(tiny)


def test_library_of_another_model_of_the_same_name(tiny: Path, tmp_path: Path) -> None:
    """Property: the model hash inside the library is compared, whatever the record says."""
    heavy = BuildRequest("tiny", (tiny / "tiny.urdf").read_text().replace('"1.5"', '"1.7"'))
    other = build(heavy, tmp_path / "other", levels=ONE_LEVEL).folder
    shutil.copy(other / "libtiny.so", tiny / "libtiny.so")
    record = json.loads((tiny / "build.json").read_text())
    record["sha256"] = sha256_of(tiny / "libtiny.so")
    (tiny / "build.json").write_text(json.dumps(record))
    with pytest.raises(LibraryError, match=r"belongs to the model .*, its manifest to "):
        load(tiny)


def test_rebuilt_under_an_open_library(tiny: Path) -> None:
    """Property: a session that has the old build open gets the new one, and both keep working."""
    old = load(tiny)
    before = old.inverse_dynamics([0.3], [0.0], [0.0], old.pi0)
    heavy = BuildRequest("tiny", (tiny / "tiny.urdf").read_text().replace('"1.5"', '"3.0"'))
    build(heavy, tiny.parent, levels=ONE_LEVEL)
    new = load(tiny)
    assert new.pi0[0] == 3.0
    assert new.manifest.model_hash != old.manifest.model_hash
    np.testing.assert_array_equal(old.inverse_dynamics([0.3], [0.0], [0.0], old.pi0), before)
    # Gravity's torque at rest is linear in the mass.
    np.testing.assert_allclose(
        new.inverse_dynamics([0.3], [0.0], [0.0], new.pi0), 2 * before, rtol=1e-14
    )


def test_read_only_folder_and_missing_urdf(tiny: Path) -> None:
    """Property: loading writes nothing; the URDF is asked for only when needed."""
    (tiny / "tiny.urdf").unlink()
    tiny.chmod(0o555)
    try:
        lib = load(tiny)
        with pytest.raises(LibraryError, match=r"tiny\.urdf' is missing; run"):
            lib.urdf()
    finally:
        tiny.chmod(0o755)
