"""Parts of result.json: log, links, uncertainty, friction and course of the fit, JSON-ready."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from runtime.estimators.classical.pc_ols import BOUNDARY
from runtime.estimators.regression.samples import samples_of
from runtime.estimators.uncertainty import BAND_SAMPLES
from runtime.identification.friction_intervals import interval_facts
from runtime.identification.identified import Identification
from runtime.library.parameters import N_PARAMETERS, centre_of_mass, links, mass
from runtime.recording import Preparation


def recording_facts(result: Identification) -> dict[str, Any]:
    """Part `recording`: name, duration, rows, preparation and split of the log."""
    parts: Mapping[str, Any] = {
        "train": result.train,
        "validation": result.validation,
        "test": result.test,
    }
    ends = {name: (float(r.t[0]), float(r.t[-1])) for name, r in parts.items()}
    samples = {name: len(r) for name, r in parts.items()}
    if result.streamed is not None:
        ends, samples = result.streamed.spans, result.streamed.samples
    counted = [
        name
        for name in parts
        if name == "train" or (result.has_test and not (name == "validation" and result.is_joined))
    ]
    ends = {name: ends[name] for name in counted}
    samples = {name: samples[name] if name in counted else 0 for name in parts}
    spans = ", ".join(f"{name} {a:.2f}–{b:.2f} s" for name, (a, b) in ends.items())
    return {
        "name": result.train.name.removesuffix("/train"),
        "duration": float(sum(b - a for a, b in ends.values())),
        "samples": samples,
        "history": list(result.train.history),
        "preparation": _changed(result.train.prepared),
        "split": spans,
    }


def _changed(preparation: Preparation | None) -> dict[str, Any]:
    """Settings of a preparation that are not the default."""
    usual = Preparation()
    facts = dataclasses.asdict(preparation or usual)
    return {key: value for key, value in facts.items() if value != getattr(usual, key)}


def link_facts(result: Identification) -> list[dict[str, Any]]:
    """Part `links`: masses and centres of mass before and after, and consistency."""
    smallest = result.relative_eigenvalues
    rows = zip(
        result.lib.link_names, links(result.pi), links(result.lib.pi0), smallest, strict=True
    )
    return [
        {
            "name": name,
            "mass": float(mass(now)),
            "mass_before": float(mass(then)),
            "com": centre_of_mass(now).tolist(),
            "com_before": centre_of_mass(then).tolist(),
            "min_relative_eigenvalue": float(eigenvalue),
        }
        for name, now, then, eigenvalue in rows
    ]


def uncertainty_facts(result: Identification) -> dict[str, Any] | None:
    """Part `uncertainty`; the covariance itself stays with the `Identification`."""
    u, lib = result.uncertainty, result.lib
    if u is None:
        return None
    test = samples_of(result.test, lib)
    step = max(1, len(test) // BAND_SAMPLES)
    band = u.band_of(lib, test.rows(slice(None, None, step)))
    size = N_PARAMETERS
    sigma, spreads = u.sigma, u.com_sigma(result.pi)
    verdicts = [u.verdicts[k * size : (k + 1) * size] for k in range(lib.n_links)]
    return {
        "advice": u.advice(),
        "n_eff": u.n_eff,
        "inflation": u.inflation,
        "excited": u.rank,
        "weakest_direction": u.conditioning,
        "boundary": bool(np.abs(result.relative_eigenvalues).min() < BOUNDARY),
        "links": [
            {
                "mass_sigma": float(sigma[k * size]),
                "com_sigma": None if s is None else s.tolist(),
                "verdicts": list(v),
            }
            for k, (s, v) in enumerate(zip(spreads, verdicts, strict=True))
        ],
        "pi_sigma": u.sigma.tolist(),
        "posterior_over_prior": u.share.tolist(),
        "beta_sigma": u.beta_sigma.tolist(),
        "beta_verdicts": list(u.beta_verdicts),
        "noise": u.noise.tolist(),
        "model_band": np.sqrt(np.mean(band**2, axis=0)).tolist(),
        "white": u.white.tolist(),
        "gain_limits": [float(x) if np.isfinite(x) else None for x in u.tests.gain_limits],
    }


def friction_facts(result: Identification) -> dict[str, Any] | None:
    """Part `friction`: columns, coefficients and intervals; None where none was fitted."""
    if not result.phi.size:
        return None
    names = result.friction.columns
    if not result.log_names:
        names = result.train.column_names or names
    motors = result.train.motors
    return {
        **result.friction.facts(),
        "columns": list(names),
        "values": result.usual_phi.tolist(),
        **interval_facts(result),
        **({} if motors is None else {"gear": motors.tolist()}),
        **({} if result.learned is None else {"learned": True}),
    }


def trained_facts(result: Identification) -> dict[str, Any] | None:
    """Part `trained`: parameters of the training rows; None where they are those of the result."""
    if result.trained is None:
        return None
    phi = dataclasses.replace(result, phi=result.trained.phi).usual_phi
    return {"pi": result.trained.pi.tolist(), "friction_values": phi.tolist()}


def trace_facts(result: Identification) -> dict[str, Any] | None:
    """Part `convergence`: losses by iteration; None for methods without iterations."""
    if result.trace is None:
        return None
    return {
        "iteration": list(result.trace.iteration),
        "training": list(result.trace.training),
        "validation": list(result.trace.validation),
    }
