"""observer.c: the observer with its thresholds in C99, for a control loop.

It needs kernels.c of the generated robot and <math.h>; it allocates nothing, and one state serves
one thread. The model's band is constant there, its median over the observed log; all other terms
of the thresholds follow the state. What a session changes is learnt as by an observation in
Python. The templates are in `observer`.
"""

from importlib.resources import files
from string import Template

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array, Library
from runtime.monitoring import observation
from runtime.monitoring.noise import REVERSAL_S
from runtime.monitoring.observation import (
    SLOPE_STEPS,
    Detector,
    direct_steps,
    slow_speeds,
    unknown_dry_friction,
)
from runtime.recording.friction.columns import OFFSET, ROTOR, VISCOUS

FILES = ("observer.h", "observer.c", "example_observer.c")
FORMS = {
    "viscous": "v",
    "coulomb": "s",
    "offset": "1.0",
    "asymmetric": "v * s",
    "dahl": "z",
    "stribeck": "s * exp(-(v / STRIBECK) * (v / STRIBECK))",
}
"""Friction column → C expression of the speed v, its smooth sign s and the state z of a memory."""


def observer_c(lib: Library, detector: Detector, band: Array) -> dict[str, str]:
    """Texts of observer.h, observer.c and example_observer.c; band: (n,) [N·m, N]."""
    model, s = detector.model, detector.settings
    inertial = model.inertial
    names = [
        name for name, is_rotor in zip(model.terms.columns, inertial, strict=True) if not is_rotor
    ]
    foreign = [name for name in names if name not in FORMS]
    foreign += [n for n in np.array(model.terms.columns)[inertial].tolist() if n != ROTOR.name]
    if foreign or model.delay_s or "known_torque" in lib.manifest.kernels:
        what = ", ".join(foreign) or "a delay or a known torque"
        raise ExportError(f"observer.c is not written: there is no C code for {what}")
    n = lib.n_joints
    kept = model.phi[:, ~inertial]
    where = {name: f"friction[j][{k}]" for k, name in enumerate(names)}
    values = {
        "robot": lib.name,
        "upper": lib.name.upper(),
        "model_hash": lib.manifest.model_hash,
        "n": n,
        "base": len(model.beta),
        "steps": s.steps,
        "lag": max(s.steps, SLOPE_STEPS),
        "rests": round(REVERSAL_S * s.rate_hz),
        "rate": repr(float(s.rate_hz)),
        "bandwidth": f"{s.bandwidth:.6g}",
        "decay": repr(s.decay),
        "coulomb_speed": repr(model.terms.coulomb_speed),
        "stribeck_speed": repr(model.terms.stribeck_speed),
        "beta": _row(model.beta),
        "columns": max(kept.shape[1], 1),
        "phi": ", ".join(f"{{{_row(each) or '0.0'}}}" for each in kept),
        "rotor": _row(model.phi[:, inertial].sum(axis=1)),
        "over": direct_steps(s.rate_hz),
        "first_known": direct_steps(s.rate_hz) if np.any(detector.is_direct) else 1,
        "variance": _row(detector.noise.sigma**2 + band**2),
        "level": _row(detector.levels),
        "least": _row(detector.noise.least),
        "still": _row(unknown_dry_friction(lib, model)),
        "noise": _row(detector.noise.sigma**2),
        "direct": ", ".join(str(int(each)) for each in np.broadcast_to(detector.is_direct, n)),
        "share": _row(np.broadcast_to(detector.share, n)),
        "block": observation.block_steps(s.rate_hz),
        "hold": observation.HOLD_BLOCKS,
        "starts": observation.START_BLOCKS,
        "outlier": repr(observation.OUTLIER**2),
        **_parts("first", observation.first_covariance(np.ones(1))),
        **_parts("drift", observation.drift_of_block(np.ones(1))),
        "dry": _row(model.dry_friction),
        "lasting": _row(model.lasting_friction),
        "dahl_stroke": repr(model.terms.dahl_stroke),
        "slow": _row(slow_speeds(lib, model)),
        "from_position": int(s.velocity == "position"),
        "terms": "".join(f" + {where[name]} * ({FORMS[name]})" for name in names),
        "viscous": f" + {where[VISCOUS.name]} * v" if VISCOUS.name in where else "",
        "offset": _row(kept[:, names.index(OFFSET.name)] if OFFSET.name in names else np.zeros(n)),
        "home": _row(lib.home),
        "loops": 10 * (s.steps + 1) + round(s.rate_hz),
    }
    templates = files("runtime.outputs") / "observer"
    return {
        name: Template((templates / f"{name}.in").read_text(encoding="utf-8")).substitute(values)
        for name in FILES
    }


def _parts(name: str, variances: Array) -> dict[str, str]:
    """Variances (1, 3) of bias, viscous and dry friction, for σ = 1."""
    parts = ("bias", "viscous", "dry")
    return {f"{name}_{part}": repr(float(x)) for part, x in zip(parts, variances[0], strict=True)}


def _row(values: Array) -> str:
    return ", ".join(repr(float(value)) for value in values)
