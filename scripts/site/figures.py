"""Pictures of docs/images: every figure once for the light and once for the dark scheme.

Needs the compiled FR3. `scripts/docs --figures` runs it; the pictures are committed.
"""

import os
import re
import tempfile
import textwrap
import tomllib
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np

import runtime
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import read_trajectory, sample_times
from runtime.excitation.search.design import design
from runtime.identification.single_log import identify_recording
from runtime.inspection import inspect_log
from runtime.library.parameters import inertia_matrix
from runtime.recording import Friction, Preparation

mpl.use("svg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs" / "images"
EXAMPLES = ROOT / "runtime" / "examples"
SCHEMES = {"light": "#3a4650", "dark": "#c9d1d9"}
"""Name of a colour scheme and its colour of lines and text."""
ORANGE, TEAL, GREY = "#d9822b", "#0f8b8d", "#8a949e"
SIZE = (6.4, 3.2)


def _consistency(axes: plt.Axes, ink: str) -> None:
    """Principal moments of the FR3's links, scaled to sum 1, in the plane of the first two."""
    lib = runtime.load("fr3")
    corners = np.array([[1, 0], [0, 1], [0, 0], [1, 0]])
    inner = np.array([[0.5, 0.5], [0.5, 0.0], [0.0, 0.5], [0.5, 0.5]])
    axes.plot(*corners.T, color=GREY, lw=1)
    axes.fill(*inner.T, color=TEAL, alpha=0.25)
    axes.plot(*inner.T, color=TEAL, lw=1.4)
    for k, pi in enumerate(lib.pi0.reshape(-1, 10)):
        m, c = pi[0], pi[1:4] / pi[0]
        about_origin = inertia_matrix(pi[4:])
        moments = np.linalg.eigvalsh(about_origin - m * (c @ c * np.eye(3) - np.outer(c, c)))[::-1]
        x, y = moments[:2] / moments.sum()
        axes.plot(x, y, "o", color=ORANGE, ms=5)
        axes.annotate(
            f"{k + 1}", (x, y), (6, -3), textcoords="offset points", color=ink, fontsize=8
        )
    axes.annotate("physically\nconsistent", (0.27, 0.38), ha="center", color=ink, fontsize=9)
    axes.annotate("positive moments only", (0.12, 0.72), color=GREY, fontsize=9, rotation=-45)
    axes.set(xlabel="J₁ / (J₁ + J₂ + J₃)", ylabel="J₂ / (J₁ + J₂ + J₃)", aspect="equal")


def _torque(axes: plt.Axes, ink: str) -> None:
    """Measured torque of joint 5 on the test part, with the URDF's and the identified one."""
    result = _identified()
    test, joint = result.test, 4
    axes.plot(
        test.t, np.asarray(test.tau)[:, joint], color=ink, lw=2.2, alpha=0.45, label="measured"
    )
    axes.plot(test.t, result.before(test)[:, joint], color=ORANGE, lw=1.2, label="URDF")
    predicted = result.predict_recording(test)[:, joint]
    axes.plot(test.t, predicted, color=TEAL, lw=1.2, ls="--", label="identified")
    axes.set(xlabel="time [s]", ylabel="torque of joint 5 [N·m]")
    _legend(axes, ink)


def _uncertainty(axes: plt.Axes, ink: str) -> None:
    """σ of the mass of every link: of the prior and after the log."""
    result = _identified()
    u = result.uncertainty
    if u is None:
        raise SystemExit("figures: the default method reports no uncertainty")
    posterior = u.sigma[::10]
    prior = posterior / np.sqrt(u.share[::10])
    at = np.arange(len(prior))
    axes.bar(at - 0.2, prior, 0.38, color=GREY, label="prior (URDF)")
    axes.bar(at + 0.2, posterior, 0.38, color=TEAL, label="after 10 s of motion")
    axes.set_xticks(at, [f"link {k + 1}" for k in at])
    axes.set(ylabel="σ of the mass [kg]")
    _legend(axes, ink)


def _excitation(axes: plt.Axes, ink: str) -> None:
    """Singular values of the base regressor with unit columns for two motions."""
    lib = runtime.load("fr3")
    designed = _motion()
    coefficients = np.zeros_like(designed.coefficients)
    coefficients[:, 0] = 0.1
    simple = Trajectory(designed.home, coefficients, designed.duration, designed.basis)
    for motion, colour, label in (
        (simple, ORANGE, "one harmonic"),
        (designed, TEAL, "designed motion"),
    ):
        q, dq, ddq, _ = motion.at(lib, np.linspace(0.0, motion.duration, 400))
        rows = lib.base_regressor(q, dq, ddq).reshape(-1, lib.base_matrix.shape[0])
        sigma = np.linalg.svd(rows / np.linalg.norm(rows, axis=0), compute_uv=False)
        text = f"{label}, cond {sigma[0] / sigma[-1]:.3g}"
        axes.semilogy(
            np.arange(1, len(sigma) + 1), sigma, "o-", color=colour, ms=3, lw=1, label=text
        )
    axes.set(xlabel="index", ylabel="singular value")
    _legend(axes, ink)


def _certificate(axes: plt.Axes, ink: str) -> None:
    """Velocity of the joint nearest to its limit in a certified motion, with the braking limits."""
    lib = runtime.load("fr3")
    motion = design(lib, duration=5.0, harmonics=3, starts=1, safety=Safety(table=0.0)).trajectory
    t = sample_times(motion.duration, 100.0)
    q, dq, _, _ = motion.at(lib, t)
    limit = np.array([joint.velocity for joint in lib.manifest.joints])
    joint = 3  # with the shortest range
    braking = tomllib.loads((ROOT / "symgen/robots/fr3.toml").read_text())["braking"]
    k, c, upper, lower = (braking[key][joint] for key in ("k", "c", "upper", "lower"))
    above = np.minimum(limit[joint], np.sqrt(k * (upper - q[:, joint])) - c)
    below = np.maximum(-limit[joint], c - np.sqrt(k * (q[:, joint] - lower)))
    axes.fill_between(t, below, above, color=TEAL, alpha=0.15, label="permitted")
    axes.plot(t, above, color=TEAL, lw=1)
    axes.plot(t, below, color=TEAL, lw=1)
    axes.plot(t, dq[:, joint], color=ORANGE, lw=1.6, label=f"velocity of joint {joint + 1}")
    axes.set(xlabel="time [s]", ylabel="velocity [rad/s]", ylim=(-3, 3.9))
    axes.legend(frameon=False, labelcolor=ink, fontsize=8, ncols=2, loc="upper center")


def _frames(axes: plt.Axes, ink: str) -> None:
    """Two links with frames at their joints; of the second the centre of mass and inertia of π."""
    joints = np.array([[0.0, 0.0], [1.5, 1.0], [3.3, 0.55]])
    axes.plot(*joints.T, color=GREY, lw=22, alpha=0.25, solid_capstyle="round")
    axes.plot(*joints[:2].T, "o", color=GREY, ms=9)
    for k, turn in enumerate((0.6, -0.25)):
        for angle, name in ((turn, "x"), (turn + np.pi / 2, "z")):
            end = joints[k] + 0.55 * np.array([np.cos(angle), np.sin(angle)])
            style = {"arrowstyle": "-|>", "color": ORANGE, "lw": 1.6}
            axes.annotate("", end, joints[k], arrowprops=style)
            shift = (4, -12 if name == "x" else 2)
            label = f"{name}{'₁₂'[k]}"
            axes.annotate(label, end, shift, textcoords="offset points", color=ORANGE)
    centre = np.array([2.5, 0.98])
    style = {"arrowstyle": "-|>", "color": TEAL, "lw": 1.6}
    axes.annotate("", centre, joints[1], arrowprops=style)
    axes.add_patch(mpl.patches.Ellipse(tuple(centre), 1.2, 0.5, angle=-14, fc="none", ec=TEAL))
    axes.plot(*centre, "o", color=TEAL, ms=7)
    axes.annotate("c", (2.1, 1.03), color=TEAL)
    axes.annotate("m, I", (2.58, 0.98), color=TEAL)
    axes.annotate("joint 1", (0.0, -0.3), ha="center", color=ink, fontsize=9)
    axes.annotate("joint 2", (1.5, 0.7), ha="center", color=ink, fontsize=9)
    text = "π₂ = (m, m c, I)\n1 + 3 + 6 numbers\nin the frame of joint 2,\nI about its origin"
    axes.annotate(text, (3.75, 0.95), va="center", color=ink, fontsize=10)
    axes.set(xlim=(-0.4, 5.6), ylim=(-0.4, 1.8), aspect="equal")
    axes.axis("off")


def _road(axes: plt.Axes, ink: str) -> None:
    """The bundled log on its way: samples, recipe, rows of the regressor, fit, errors."""
    result = _identified()
    names = ("log", "recipe", "rows", "fit", "report")
    boxes = [axes.inset_axes((0.206 * k, 0.08, 0.17, 0.72)) for k in range(len(names))]
    for k, (box, name) in enumerate(zip(boxes, names, strict=True)):
        box.set_title(name, color=ink, fontsize=11)
        box.set(xticks=[], yticks=[])
        if k:
            axes.annotate("→", (0.206 * k - 0.018, 0.44), ha="center", color=ORANGE, fontsize=15)
    log, test = runtime.read_recording(EXAMPLES / "fr3_simulated.npz"), result.test
    boxes[0].plot(log.t, log.q[:, 3], color=TEAL, lw=1)
    boxes[0].plot(log.t, log.tau[:, 3] / 10, color=ORANGE, lw=0.6)
    recipe = '[torque]\nunit = "N*m"\nsign = -1\n\n[preparation]\ncutoff_hz = 10\nrate_hz = 100'
    boxes[1].annotate(recipe, (0.05, 0.5), va="center", color=ink, fontsize=7, family="monospace")
    rows = result.lib.base_regressor(result.train.q, result.train.dq, result.train.ddq)[:12]
    boxes[2].imshow(np.abs(rows.reshape(-1, rows.shape[-1])) ** 0.5, cmap="YlGnBu", aspect="auto")
    boxes[2].set_xlabel("Y β + F φ = τ", fontsize=8)
    near = slice(0, 150)
    boxes[3].plot(test.t[near], test.tau[near, 4], color=ink, lw=2.2, alpha=0.45)
    boxes[3].plot(test.t[near], result.before(test)[near, 4], color=ORANGE, lw=1.2)
    boxes[3].plot(test.t[near], result.predict_recording(test)[near, 4], "--", color=TEAL, lw=1.2)
    errors = [np.linalg.norm(tau - test.tau) / np.linalg.norm(test.tau) for tau in
              (result.before(test), result.predict_recording(test))]  # fmt: skip
    boxes[4].barh((1, 0), errors, 0.4, color=(ORANGE, TEAL))
    for k, error, name in zip((1, 0), errors, ("URDF", "identified"), strict=True):
        text = f" {name}: {100 * error:.2g} %"
        boxes[4].annotate(text, (0, k + 0.25), color=ink, fontsize=8)
    boxes[4].set(ylim=(-0.4, 1.6), xlabel="torque error")
    axes.axis("off")


def _finding(axes: plt.Axes, ink: str) -> None:
    """A log whose torque of joint 4 has the wrong sign, the torque of the URDF, the sentence."""
    lib, log = runtime.load("fr3"), runtime.read_recording(EXAMPLES / "fr3_simulated.npz")
    wrong = log.replace(tau=log.tau * np.where(np.arange(7) == 3, -1.0, 1.0))
    with tempfile.TemporaryDirectory() as folder:
        runtime.write_recording(wrong, path := Path(folder) / "log.csv")
        (finding,) = (f for f in inspect_log(path, lib).findings if f.kind == "torque_sign")
    zero = np.zeros_like(log.q)
    urdf = lib.inverse_dynamics(log.q, zero, zero, lib.pi0)
    axes.plot(log.t, wrong.tau[:, 3], color=ORANGE, lw=1, label="measured, joint 4")
    axes.plot(log.t, urdf[:, 3], color=TEAL, lw=1.4, label="gravity torque of the URDF")
    axes.set(xlabel="time [s]", ylabel="torque [N·m]")
    sentence = f"{finding.level} ({finding.kind}): {finding.sentence}"
    axes.set_title(textwrap.fill(sentence, 88), color=ink, fontsize=8, loc="left")
    _legend(axes, ink)


def _house(axes: plt.Axes, ink: str) -> None:
    """Levels of the import contract of pyproject.toml, one box per room of either package."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    (layers,) = (c["layers"] for c in contracts["contracts"] if c["type"] == "layers")
    levels = [re.findall(r"\w+", level) for level in layers if "__main__" not in level]
    height = 1.0 / len(levels)
    for k, rooms in enumerate(levels):
        for left, package, colour in ((0.0, "symgen", ORANGE), (1.06, "runtime", TEAL)):
            there = [room for room in rooms if _is_room(package, room)]
            for j, room in enumerate(there):
                width = 1.0 / len(there)
                corner = (left + j * width, 1.0 - (k + 1) * height)
                box = mpl.patches.FancyBboxPatch(
                    (corner[0] + 0.01, corner[1] + 0.01),
                    width - 0.02,
                    height - 0.02,
                    boxstyle="round,pad=0,rounding_size=0.015",
                    facecolor=colour + "30",
                    edgecolor=colour,
                    lw=0.8,
                )
                axes.add_patch(box)
                middle = (corner[0] + width / 2, corner[1] + height / 2)
                axes.annotate(room, middle, ha="center", va="center", color=ink, fontsize=8.5)
    for left, text in ((0.0, "symgen/  writes generated/<robot>/"), (1.06, "runtime/  reads it")):
        axes.annotate(text, (left + 0.5, 1.03), ha="center", color=ink, fontsize=9.5)
    axes.set(xlim=(-0.02, 2.08), ylim=(-0.02, 1.1))
    axes.axis("off")


def _is_room(package: str, name: str) -> bool:
    return (ROOT / package / name / "__init__.py").exists() or (
        ROOT / package / f"{name}.py"
    ).exists()


FIGURES: dict[str, tuple[Callable[[plt.Axes, str], None], tuple[float, float]]] = {
    "consistency": (_consistency, (4.6, 4.2)),
    "torque": (_torque, SIZE),
    "uncertainty": (_uncertainty, SIZE),
    "excitation": (_excitation, SIZE),
    "certificate": (_certificate, SIZE),
    "frames": (_frames, (6.4, 2.6)),
    "road": (_road, (9.0, 2.2)),
    "finding": (_finding, SIZE),
    "house": (_house, (7.2, 4.4)),
}


def _identified() -> runtime.Identification:
    log = runtime.read_recording(EXAMPLES / "fr3_simulated.npz")
    return identify_recording(
        log,
        runtime.load("fr3"),
        preparation=Preparation(filter="butterworth", cutoff_hz=10.0),
        friction=Friction(("viscous", "coulomb")),
    )


def _motion() -> Trajectory:
    return read_trajectory(EXAMPLES / "fr3_trajectory.json", runtime.load("fr3"))


def _legend(axes: plt.Axes, ink: str) -> None:
    axes.legend(frameon=False, labelcolor=ink, fontsize=8)


def draw(name: str, scheme: str, folder: Path = IMAGES) -> Path:
    """Draw one figure for one colour scheme."""
    ink = SCHEMES[scheme]
    settings = {
        "svg.hashsalt": name,
        "svg.fonttype": "none",
        "font.family": "sans-serif",
        "axes.edgecolor": ink,
        "axes.labelcolor": ink,
        "xtick.color": ink,
        "ytick.color": ink,
        "text.color": ink,
        "axes.spines.top": False,
        "axes.spines.right": False,
    }
    function, size = FIGURES[name]
    with mpl.rc_context(settings):
        figure, axes = plt.subplots(figsize=size, layout="constrained")
        function(axes, ink)
        path = folder / f"{name}-{scheme}.svg"
        figure.savefig(path, transparent=True, metadata={"Date": None, "Creator": None})
        plt.close(figure)
    return path


def main() -> None:
    """Draw every figure for both schemes."""
    os.chdir(ROOT)
    for name in FIGURES:
        for scheme in SCHEMES:
            print(draw(name, scheme).relative_to(ROOT))


if __name__ == "__main__":
    main()
