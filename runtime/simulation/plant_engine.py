"""Choice of the engine of a virtual robot: MuJoCo, or the kernels where joints follow others."""

from numpy.typing import ArrayLike

from runtime.library import Array, Library
from runtime.simulation.mechanism import has_mechanism
from runtime.simulation.mujoco_engine import Engine, engine
from runtime.simulation.reduced_engine import ReducedEngine


def plant_engine(
    lib: Library, pi: Array, rotor: ArrayLike = 0.0, step: float = 2.5e-4, ranges: bool = True
) -> Engine | ReducedEngine:
    """Engine of a robot with given parameters.

    pi (10 L,), rotor (n,) [kg·m², kg].
    """
    if has_mechanism(lib):
        return ReducedEngine(lib, pi, rotor, step)
    return engine(lib, pi, rotor, step, ranges)
