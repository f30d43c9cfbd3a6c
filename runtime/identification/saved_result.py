"""Reader of result.json for commands that compute with an identified model.

π is written in the frames of the links, so that it holds for any library whose joints have the same
placements. Another gravity, other inertials or a newer generator leave π valid and are noted. Other
fixed links counted into the moving ones mean that π belongs to other bodies.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.user_builds import NAME
from runtime.errors import RecordingError
from runtime.estimators.methods import METHODS
from runtime.estimators.problem import Learned
from runtime.identification.result_schema import read_facts
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, PI_NAMES, first_moment, links, mass
from runtime.recording import Friction, Preparation, Recording, read_recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.current_gains import CurrentGains
from runtime.recording.notebook import Framed, html_table
from runtime.recording.unit_conversion import scaled

LARGEST_VALUE = 1e9
"""Bound of π and φ in SI units; larger values and NaN are refused."""
ALIKE = 1e-6
"""Bound in m, m/s² or entries of rotations below which two models differ only by rounding."""
_PLACE = ("rotation", "translation", "axis")


@dataclass(frozen=True, slots=True, eq=False)
class ModelOfResult:
    """The model that a result was identified with.

    Attributes:
        digest: `model_hash` of its library.
        gravity: (3,) in the base frame, m/s².
        kinds: kind and parent of every joint.
        places: rotation, translation [m] and axis of every joint, (n, 15).
        lumped: names of the fixed links that count into moving ones.
    """

    digest: str
    gravity: Array
    kinds: tuple[str, ...]
    places: Array
    lumped: frozenset[str]


@dataclass(frozen=True, slots=True, eq=False)
class SavedResult(Framed):
    """Parameters and friction of a result.json, with the preparation of its log.

    Attributes:
        robot: name of the robot.
        method: name of the method.
        joints: names of the joints.
        units: units of their torques.
        pi: standard parameters, (10 n,).
        friction: friction model with k columns.
        phi: friction coefficients, (n, k).
        history: sentences on the preparation of the log.
        preparation: settings of the preparation.
        model: model of the parameters; None in files that lack it.
        facts: the whole content of the file.
        learned: friction beyond φ, where the method learned one.
        gains: of the motor currents of its log; None where the log held torques.
    """

    robot: str
    method: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    pi: Array
    friction: Friction
    phi: Array
    history: tuple[str, ...]
    preparation: Preparation
    model: ModelOfResult | None
    facts: dict[str, Any] = field(default_factory=dict)
    learned: Learned | None = None
    gains: CurrentGains | None = None

    def log_of(
        self, log: str, lib: Library, recipe: str | None = None, run: str | None = None
    ) -> Recording:
        """Another log of the robot, motor currents as torques by the gains of the result."""
        recording = independent_joints(read_recording(log, recipe, run, lib.joint_names), lib)
        return recording if self.gains is None else scaled(recording, self.gains)

    def _repr_html_(self) -> str:
        """Torque errors and bodies of the links, as tables for notebooks."""
        percent, rms = self.facts.get("torque_error_percent"), self.facts.get("torque_rms")
        torque = [
            (name, _number(old, ".2f"), _number(new, ".2f"), f"{_number(size, '.4f')} {unit}")
            for name, unit, old, new, size in (
                zip(
                    *(self.joints, self.units, percent["before"], percent["after"], rms["after"]),
                    strict=True,
                )
                if percent and rms
                else ()
            )
        ]
        bodies = [
            (name, f"{m:.4f}", ", ".join(f"{x:.4f}" for x in h / m) if m else "–")
            for name, m, h in zip(
                self._link_names(), mass(links(self.pi)), first_moment(links(self.pi)), strict=True
            )
        ]
        title = f"{self.robot} by {self.method}: {self.facts.get('status', 'no result.json')}"
        head = ("joint", "error of URDF [%]", "error [%]", "RMS error")
        errors = html_table(title, torque, head)
        return errors + html_table("links", bodies, ("link", "mass [kg]", "centre of mass [m]"))

    def columns_of_frame(self) -> dict[str, list[Any]]:
        """Link, parameter, value and σ [SI], one row per entry of π."""
        rows = [(link, name) for link in self._link_names() for name in PI_NAMES]
        columns: dict[str, list[Any]] = {
            "link": [link for link, _ in rows],
            "parameter": [name for _, name in rows],
            "value": self.pi.tolist(),
        }
        sigma = (self.facts.get("uncertainty") or {}).get("pi_sigma")
        if sigma is not None:
            columns["sigma"] = list(sigma)
        return columns

    def _link_names(self) -> list[str]:
        """Names of the bodies of π, by their number where the file has none."""
        names = [str(each["name"]) for each in self.facts.get("links", ())]
        count = len(self.pi) // N_PARAMETERS
        return names if len(names) == count else [f"body {k + 1}" for k in range(count)]


def _number(value: float | None, form: str) -> str:
    """A number of the file; a dash where it has none."""
    return "–" if value is None else format(value, form)


def model_facts(lib: Library) -> dict[str, Any]:
    """The part `model` of result.json, which `ModelOfResult` is read from."""
    joints = [
        {
            "kind": joint.kind,
            "parent": joint.parent,
            **{key: np.array(getattr(joint, key)).tolist() for key in _PLACE},
        }
        for joint in lib.manifest.all_joints
    ]
    return {
        "model_hash": lib.manifest.model_hash,
        "gravity": lib.gravity.tolist(),
        "joints": joints,
        "lumped": [body["name"] for body in lib.manifest.lumped],
    }


def read_result(folder: Path, with_learned: bool = False) -> SavedResult:
    """Read the result that `identify` wrote; learned friction is refused without `with_learned`."""
    try:
        file = folder / "result.json" if folder.is_dir() else folder
        facts = read_facts(file)
        if not NAME.fullmatch(facts["robot"]):
            raise RecordingError(
                f"'{file}': expected the name of a robot (a-z, 0-9, _), got "
                f"{facts['robot']!r:.60}; correct the file, or identify again"
            )
        n = len(facts["joints"])
        terms = facts["friction"] or {"columns": [], "values": [[]] * n}
        net = terms.get("net")
        if net and not with_learned:
            raise RecordingError(
                f"'{file}': expected a result whose friction is its columns, got one of the method "
                f"{facts['method']}, which learned more, as evaluate takes it; identify again by "
                "another method"
            )
        saved = SavedResult(
            robot=str(facts["robot"]),
            method=str(facts["method"]),
            joints=tuple(facts["joints"]),
            units=tuple(facts["units"]),
            pi=np.array(facts["pi"], dtype=float),
            friction=Friction.from_facts(terms),
            phi=np.array(terms["values"], dtype=float),
            history=tuple(map(str, facts["recording"]["history"])),
            preparation=_preparation(facts["recording"]["preparation"]),
            model=None if facts["model"] is None else _model(facts["model"]),
            facts=facts,
            learned=_learned(facts["method"], net),
            gains=_gains(facts.get("current_gains"), n),
        )
        links = n if saved.model is None else len(saved.model.kinds)
        whole = len(saved.units) == n and saved.pi.shape == (N_PARAMETERS * links,)
        if not whole or saved.phi.shape != (n, len(saved.friction.columns)):
            raise ValueError
        if not (np.abs(np.concatenate([saved.pi, saved.phi.ravel()])) < LARGEST_VALUE).all():
            raise ValueError
        if saved.learned and saved.learned(np.zeros((1, *saved.phi.shape))).shape != (1, n):
            raise ValueError
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        raise RecordingError(
            f"'{folder}' holds no valid result.json; give the folder that identify wrote"
        ) from None
    return saved


def _learned(method: str, facts: Any) -> Learned | None:
    """Friction that a method learned; None where the file has none."""
    if not facts:
        return None
    read = METHODS[method].learned
    if read is None:
        raise ValueError
    return read(facts)


def _gains(facts: Any, joints: int) -> CurrentGains | None:
    """Gains of motor currents; None where the log held torques."""
    if not facts:
        return None
    gains = CurrentGains.from_facts(facts, "the result")
    if gains.gain.shape != (joints,) or not (np.abs(gains.gain) < LARGEST_VALUE).all():
        raise ValueError
    return gains


def _preparation(facts: dict[str, Any]) -> Preparation:
    """Preparation; delays per joint are a list in the file."""
    lists: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in facts.items()}
    return Preparation(**lists)


def _model(facts: dict[str, Any]) -> ModelOfResult:
    joints = facts["joints"]
    rows = [np.hstack([np.ravel(joint[key]) for key in _PLACE]) for joint in joints]
    places = np.array(rows, dtype=float).reshape(len(joints), 15)
    gravity = np.array(facts["gravity"], dtype=float).reshape(3)
    kinds = tuple(f"{joint['kind']} {joint['parent']}" for joint in joints)
    lumped = frozenset(str(name) for name in facts["lumped"])
    return ModelOfResult(str(facts["model_hash"]), gravity, kinds, places, lumped)


def require_model(
    saved: SavedResult, lib: Library, folder: Path, same_bodies: bool = False
) -> tuple[str, ...]:
    """Check that a result holds for the model of a library."""
    if saved.joints != lib.joint_names:
        raise RecordingError(
            f"'{folder}' identified {saved.robot}, whose joints differ from those of "
            f"'{lib.name}'; name its robot with --robot"
        )
    then, now = saved.model, _model(model_facts(lib))
    if then is None or then.digest == now.digest:
        return ()
    moved = ~(np.abs(then.places - now.places).max(axis=1) <= ALIKE)  # NaN counts as moved
    moved |= np.array([a != b for a, b in zip(then.kinds, now.kinds, strict=True)])
    if moved.any():
        raise RecordingError(
            f"'{folder}' was identified with a model whose joint "
            f"'{lib.all_joint_names[int(np.argmax(moved))]}' sits or turns differently "
            f"than that of '{lib.name}', so that its parameters belong to other frames; name the "
            "library that it was identified with by --robot, or identify again"
        )
    if then.lumped != now.lumped:
        other = ", ".join(sorted(then.lumped ^ now.lumped))
        difference = (
            f"'{folder}' was identified with other fixed links counted into moving ones than "
            f"'{lib.name}' has ({other})"
        )
        if same_bodies:
            raise RecordingError(
                f"{difference}; name the library that it was identified with by --robot"
            )
        return (f"{difference}: its masses belong to other bodies",)
    if not np.abs(then.gravity - now.gravity).max() <= ALIKE:
        old, new = (",".join(f"{x:g}" for x in g) for g in (then.gravity, now.gravity))
        return (
            f"'{folder}' was identified with gravity {old}, and '{lib.name}' has {new}: right "
            "if the arm was mounted again in between",
        )
    return (
        f"'{folder}' was identified with another build of this arm (model {then.digest[:12]}, "
        f"here {now.digest[:12]}): the joints are the same, inertials, limits or the generator "
        "are not",
    )
