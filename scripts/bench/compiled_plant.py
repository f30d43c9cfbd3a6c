"""The virtual robot with its loop in C: the same MuJoCo, an eighth of the time.

Hours of motion take minutes this way. The loop is that of `runtime.simulation.virtual_robot`, which
`largest_difference` compares with it.
"""

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from unittest.mock import patch

import numpy as np

from bench.compiled import compile_shared, find, open_shared
from runtime.errors import SimulationError
from runtime.excitation import Trajectory
from runtime.library import Array, Library
from runtime.simulation import virtual_robot
from runtime.simulation.plant import SimulatedMotion
from runtime.simulation.virtual_robot import VirtualLog

SOURCE = Path(__file__).with_name("compiled_plant.c")


class CompiledSimulator(virtual_robot._Simulator):
    """Plant, friction, drive and controller with the loop in C."""

    def run(
        self, reference: Array, jitter: Array, progress: Callable[[float], None] | None
    ) -> tuple[tuple[Array, Array], SimulatedMotion, Array]:
        """Measured q̂ and dq̂, true states, share of saturated ticks."""
        plant, belief, s = self._plant, self._belief, self._settings
        sort, (_, count, n) = plant.sorted, reference.shape
        law, sensors, period = s.friction, s.sensors, 1 / s.rate_hz
        keep = np.exp(-2 * np.pi * sensors.velocity_cutoff_hz * period)
        wanted = sort(reference)
        gains = np.ones(n)
        if s.law != "computed_torque":
            gains = belief.mass_diagonal(wanted[0, 0])
        of_joints = [
            self._effort,
            sort(s.stiffness),
            sort(s.damping),
            gains,
            sort(s.rotor),
            sort(law.coulomb * (1 + law.asymmetry)),
            sort(law.coulomb * (1 - law.asymmetry)),
            sort(law.stribeck * law.coulomb),
            sort(-1 / law.stribeck_speed**2),
            sort(law.viscous),
            sort(law.load),
            sort(law.ripple * law.coulomb),
            sort(law.ripple_waves),
            sort(law.ripple_phase),
            sort(s.step_s / law.dahl_stroke),
            sort(sensors.position_quantum),
            sort(keep),
            sort((1 - keep) / period),
        ]
        joints = np.ascontiguousarray(np.stack(of_joints), float)
        log, clipped = np.zeros((7, count, n)), np.zeros(n)
        sizes = (count, n, self._substeps, self._delay, int(s.law == "computed_torque"))
        arrays = (wanted, sort(jitter), joints, log, clipped)  # alive until the loop ends
        reached = _loop()(
            *(each._address for each in (plant.model, plant.data, belief.model, belief.data)),
            *sizes,
            *(ctypes.c_void_p(each.ctypes.data) for each in arrays),
        )
        if reached < count:
            raise SimulationError(f"the virtual robot lost its trajectory after {reached} ticks")
        seen_q, seen_dq, *true = (plant.restored(part) for part in log)
        return (seen_q, seen_dq), SimulatedMotion(*true), plant.restored(clipped / count)


def record(lib: Library, trajectory: Trajectory, *words: object, **more: object) -> VirtualLog:
    """As `runtime.simulation.virtual_robot.record`."""
    with patch.object(virtual_robot, "_Simulator", CompiledSimulator):
        return virtual_robot.record(lib, trajectory, *words, **more)  # type: ignore[arg-type]


def largest_difference(lib: Library, trajectory: Trajectory) -> float:
    """Largest difference of q, dq and τ of a log from that of the loop in Python."""
    one, other = (each(lib, trajectory, seed=0) for each in (record, virtual_robot.record))
    pairs = zip(one.recording.signals(), other.recording.signals(), strict=True)
    return max(float(np.abs(a - b).max()) for a, b in pairs)


@cache
def _loop() -> Callable[..., int]:
    """The compiled loop, linked to the MuJoCo of the Python package."""
    import mujoco

    home = Path(mujoco.__file__).parent
    (shared,) = home.glob("libmujoco.so*")
    flags = ("-O2", f"-I{home / 'include'}")
    path, _ = compile_shared(find(("cc", "gcc")), flags, SOURCE.read_text(), ".c", shared.name)
    ctypes.CDLL(str(shared), mode=ctypes.RTLD_GLOBAL)
    function = open_shared(path).run
    function.restype = ctypes.c_int
    function.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_int] * 5 + [ctypes.c_void_p] * 5
    return function
