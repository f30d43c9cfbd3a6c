"""A file is right when what reads it moves like the library: 1000 random states, 1e-9.

max |τ_engine(file) − damping dq − armature ddq − Y π| / max |Y π|  ≤  1e-9
"""

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array, Library
from runtime.outputs.model_files.engines import Reloaded, compiler, drake, mujoco, pinocchio, yaml
from runtime.outputs.model_files.engines.answer import STATES, random_states
from runtime.outputs.model_files.header import header_arrays
from runtime.outputs.model_files.model import Model
from runtime.outputs.model_files.urdf import urdf_text

TOLERANCE = 1e-9
"""Torque difference over the largest torque; 17 digits and two recursions leave about 1e-14."""


def check_urdf(model: Model, text: str) -> str:
    """The sentence that goes with a URDF; ExportError where it is not the robot."""
    return _against(model, pinocchio.reload(text, model.lib), pinocchio.INSTALL)


def check_mjcf(model: Model, text: str) -> str:
    """The sentence that goes with an MJCF; ExportError where it is not the robot."""
    return _against(model, mujoco.reload(text, model.lib), mujoco.INSTALL)


def check_sdf(model: Model, text: str) -> str:
    """The sentence that goes with an SDF; ExportError where it is not the robot."""
    return _against(model, drake.reload(text, model.lib), drake.INSTALL)


def check_inertials(model: Model, text: str) -> str:
    """The same for inertials.yaml, put into the URDF of the kernels."""
    return _check_yaml(model, yaml.urdf_with_inertials(text, model.lib, urdf_text(model)))


def check_dynamics(model: Model, text: str) -> str:
    """The same for dynamics.yaml, put into the URDF with the model's inertias."""
    return _check_yaml(model, yaml.urdf_with_friction(text, model.lib, urdf_text(model)))


def check_header(model: Model, text: str) -> str:
    """The same for a C header, compiled; its arrays must be what was identified, bit for bit."""
    lib, wanted = model.lib, header_arrays(model)
    names = {f"{lib.name}_identified_{key}": array.shape for key, array in wanted.items()}
    found = compiler.read_back(text, names)
    if found is None:
        return _unchecked(compiler.INSTALL)
    read = dict(zip(wanted, found.values(), strict=True))
    for key, array in wanted.items():
        if not np.array_equal(read[key], array):
            raise ExportError(f"not written: a C compiler reads another {key} in the header")
    q, dq, ddq = random_states(lib)
    expected = lib.inverse_dynamics(q, dq, ddq, model.pi)
    torques = {
        "pi": lib.inverse_dynamics(q, dq, ddq, read["pi"]),
        "lam": lib.torque(q, dq, ddq, read["lam"]),
        "beta": lib.base_regressor(q, dq, ddq) @ read["beta"],
    }
    worst = 0.0
    for key, tau in torques.items():
        worst = max(worst, difference := _difference(tau, expected))
        if not difference <= TOLERANCE:
            raise ExportError(
                f"not written: {key} gives torques that differ by {difference:.1e} of the largest"
            )
    return _verified("a C compiler", worst)


def _check_yaml(model: Model, urdf: str | None) -> str:
    if urdf is None:
        return _unchecked(yaml.INSTALL)
    return _against(model, pinocchio.reload(urdf, model.lib), pinocchio.INSTALL)


def _against(model: Model, found: Reloaded | None, install: str) -> str:
    """Hold what an engine read against π and what is known of the drives."""
    if found is None:
        return _unchecked(install)
    lib = model.lib
    expected = lib.inverse_dynamics(*random_states(lib), model.pi)
    difference = _difference(found.tau, expected)
    if not difference <= TOLERANCE:
        raise ExportError(
            f"not written: reloaded by {found.engine}, it gives torques that differ by "
            f"{difference:.1e} of the largest torque, where {TOLERANCE:g} is allowed; "
            f"{_culprit(lib, model.pi, found.pi)}"
        )
    for what in ("damping", "friction", "armature"):
        read = getattr(found, what)
        for k, value in enumerate(getattr(model.drive, what) if read is not None else ()):
            if value is not None and abs(read[k] - value) > TOLERANCE * value:
                raise ExportError(
                    f"not written: reloaded by {found.engine}, the {what} of joint "
                    f"'{lib.joint_names[k]}' is {read[k]:g} and not {value:g}"
                )
    return _verified(found.engine, difference)


def _difference(tau: Array, expected: Array) -> float:
    return float(np.abs(tau - expected).max() / np.abs(expected).max())


def _culprit(lib: Library, wanted: Array, read: Array) -> str:
    """Which link is another, or that none is, so that joints must be."""
    ours = wanted.reshape(read.shape)
    error = np.abs(read - ours).max(axis=1) / np.abs(ours).max()
    if error.max() > TOLERANCE:
        return f"the inertia of the link '{lib.link_names[int(error.argmax())]}' is another"
    return (
        "all inertias are right, so the placement or the axis of a joint is another; "
        "run: python -m symgen build"
    )


def _verified(engine: str, difference: float) -> str:
    return (
        f"verified: reloaded by {engine}, torques agree to {difference:.1e} of the largest torque "
        f"at {STATES} random states"
    )


def _unchecked(install: str) -> str:
    return f"not checked by reloading, which needs more: {install}"
