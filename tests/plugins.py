"""A toy package outside symgen that adds one record by an entry point, as an installed one does."""

import os
import sys
from pathlib import Path
from typing import Any

import pytest

from runtime.registry import Registry
from tests.conftest import REPOSITORY


def install_toy(folder: Path, group: str, name: str, source: str, record: str) -> dict[str, str]:
    """Lay out an installed distribution and return the environment in which Python sees it.

    Args:
        folder: stands for site-packages.
        group: entry-point group, such as "symgen.estimators".
        name: word by which a user selects the record.
        source: text of the module.
        record: attribute of the module that is the record.

    Returns:
        Environment variables for a subprocess that runs a command.
    """
    module = f"toy_{name.replace('-', '_')}"
    (folder / f"{module}.py").write_text(source)
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{group}]\n{name} = {module}:{record}\n")
    path = os.pathsep.join([str(folder), str(REPOSITORY)])
    return {**os.environ, "PYTHONPATH": path}


def add_toy(
    folder: Path,
    registry: Registry[Any],
    name: str,
    source: str,
    record: str,
    monkeypatch: pytest.MonkeyPatch,
) -> dict[str, str]:
    """Lay out an installed distribution that a registry of this process finds until the test ends.

    Args:
        folder: stands for site-packages.
        registry: of the records; it looks for entry points anew, and afterwards once more.
        name: word by which a user selects the record.
        source: text of the module.
        record: attribute of the module that is the record.
        monkeypatch: of the test.

    Returns:
        Environment variables for a process that finds it, too.
    """
    environment = install_toy(folder, registry.group, name, source, record)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, f"toy_{name}", raising=False)
    monkeypatch.setattr(registry, "_plugins", None)
    monkeypatch.setattr(registry, "_loaded", dict(registry._loaded))
    return environment
