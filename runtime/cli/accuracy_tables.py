"""Tables and sentences on expected accuracy: base parameters, links, payload, more recording."""

from collections.abc import Sequence

import numpy as np

from runtime.common.tables import Table
from runtime.estimators.regression.posterior import DETERMINED
from runtime.identification.expected_accuracy import expected as accuracy
from runtime.library import Array, Library
from runtime.library.manifest import listed_torques
from runtime.library.parameters import N_PARAMETERS, inertia, links, mass


def torque_sentence(bands: Array, units: Sequence[str], gain_error: float = 0.0) -> str:
    """Sentence on the σ of predicted torque for motions that are not in the log."""
    sigmas = listed_torques(1000 * bands, units, ".2f", "m")
    if gain_error:
        off = f"{100 * gain_error:g} % off (the setting gain_error), which residuals hardly show"
        return f"with torque gains that may be {off}: {sigmas}"
    return f"expected σ of the predicted torque, joint by joint: {sigmas}"


def unit_payload_sentence(mass: float, com: Array) -> str:
    """Sentence on the accuracy of a payload of 1 kg."""
    position = " ".join(f"{1000 * value:.2f}" for value in com)
    return (
        f"a payload of 1 kg on a known arm: mass to ±{1000 * mass:.2f} g, "
        f"centre of mass to ±({position}) mm"
    )


def payload_sentence(expected: accuracy.Expected, alone: bool) -> str:
    """Sentence on the expected accuracy of a payload."""
    if expected.payload is None:
        return "note: a payload on the last link is not identifiable: too few joints turn it"
    sentence = (
        f"{unit_payload_sentence(float(mass(expected.payload.pi)), expected.payload.com)}, against "
        "an empty run of the same motion; without one, an arm whose links are "
        f"{100 * accuracy.ARM_ERROR:g} % off its model adds "
        f"±{1000 * mass(expected.payload.of_arm):.3g} g to the mass"
    )
    if not alone:
        return sentence
    sigmas = " ".join(f"{value:.2g}" for value in inertia(expected.payload.pi))
    return f"{sentence}, inertia xx yy zz xy xz yz about the link's origin to ±({sigmas}) kg·m²"


def base_table(expected: accuracy.Expected, lib: Library) -> Table:
    """Expected σ of every base parameter, the largest relative to its value first."""
    names, base = accuracy.base_names(lib), expected.base
    rows = tuple(
        (
            names[k].removeprefix("base "),
            "not identifiable" if base is None else f"{base[k]:.3g}",
            f"{expected.base_map[k]:.3g}",
            f"{100 * expected.relative[k]:.2f}",
        )
        for k in np.argsort(-expected.relative)
    )
    title = "base parameters: expected σ, the largest relative σ first"
    return Table(("around", "least squares", "MAP", "MAP % of value"), rows, title=title)


def link_table(expected: accuracy.Expected, lib: Library) -> Table:
    """Expected σ of mass, centre of mass and inertia of every link by MAP."""
    bodies = zip(
        lib.link_names, links(expected.pi), expected.com, links(expected.share), strict=True
    )
    rows = tuple(
        (
            name,
            f"{1000 * mass(pi):.2f}",
            " ".join(f"{1000 * value:.2f}" for value in com),
            f"{inertia(pi).max():.2g}",
            f"{np.sum(share < DETERMINED)} of {N_PARAMETERS}",
        )
        for name, pi, com, share in bodies
    )
    head = ("link", "mass g", "CoM mm", "inertia kg·m²", "from the data")
    return Table(head, rows, title="links: expected σ with the URDF as prior")


def gain_table(steps: Sequence[accuracy.GainOfRecording]) -> Table:
    """Improvement of σ by more recording: payload, largest, and count of those above 10 %."""
    names = sorted(name for name in steps[0].gains if name.startswith("payload"))
    rows = []
    for step in steps:
        top, gain = next(iter(step.gains.items()))
        cells = (f"{100 * x:.1f}" for x in (*(step.gains[name] for name in names), gain))
        rows.append(
            (f"{step.seconds:g} s", *cells, f"{len(step.gaining)} of {len(step.gains)}", top)
        )
    head = ("more", *names, "largest", "above 10 %", "largest gain of")
    title = f"expected gain of σ by more of {steps[0].motion}, %"
    return Table(head, tuple(rows), title=title)
