"""Time of `fleet` on many units: compressed statistics of virtual FR3s, drawn exactly.

All units share the triangle of one motion; their targets have the noise of a log.
"""

import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from runtime.estimators.regression import compress
from runtime.estimators.regression.samples import samples_of
from runtime.excitation import Trajectory
from runtime.identification.statistics_file import FILE, UnitStatistics, write_statistics
from runtime.library import Library
from runtime.recording import Friction
from runtime.recording.preprocessing import prepare
from runtime.simulation import Plant, ideal
from runtime.simulation.virtual_robot import perturbed

NOISE, SPREAD = 0.3, 0.05
"""Torque noise, N·m, and spread of the units."""
TERMS = Friction(("viscous", "coulomb"))
FRICTION = (0.5, 0.3)


def fleet_seconds(lib: Library, design: Trajectory, count: int) -> tuple[float, float]:
    """CPU and wall time of the command."""
    motion = ideal(lib, design, Plant(lib.pi0), rate_hz=25.0)
    samples = samples_of(prepare(motion, None, TERMS, lib=lib), lib)
    whole = compress(lib, samples, np.full(lib.n_joints, NOISE**-2))
    rng = np.random.default_rng(0)
    centre = perturbed(lib, lib.pi0, 4 * SPREAD, rng)
    phi = np.tile(FRICTION, lib.n_joints)
    widths = (TERMS.coulomb_speed, TERMS.stribeck_speed, TERMS.dahl_stroke)
    with TemporaryDirectory() as name:
        folder = Path(name)
        for k in range(count):
            pi = perturbed(lib, centre, SPREAD, rng)
            x = np.concatenate([lib.base_matrix @ pi, phi])
            drawn = replace(
                whole,
                target=whole.factor @ x + rng.normal(size=x.size),
                rest=float(lib.n_joints * len(samples)),
            )
            unit = folder / "units" / f"u{k:04d}"
            unit.mkdir(parents=True)
            known = UnitStatistics(
                unit.name, lib.name, lib.joint_names, TERMS.columns, widths, drawn, 1.0
            )
            write_statistics(known, unit / FILE)
        words = ["fleet", "units", "--robot", str(lib.folder.resolve()), "--out", "fleet.toml"]
        paths = os.pathsep.join([str(Path.cwd()), os.environ.get("PYTHONPATH", "")])
        start, before = time.perf_counter(), os.times()
        subprocess.run(
            [sys.executable, "-m", "runtime", *words],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": paths},
            capture_output=True,
            text=True,
            check=True,
        )
        after, wall = os.times(), time.perf_counter() - start
    cpu = after.children_user + after.children_system
    cpu -= before.children_user + before.children_system
    return cpu, wall
