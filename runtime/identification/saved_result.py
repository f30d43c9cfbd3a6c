"""Reader of result.json for commands that compute with an identified model.

π is written in the frames of the links, so that it holds for any library whose joints have the same
placements. Another gravity, other inertials or a newer generator leave π valid and are noted. Other
fixed links counted into the moving ones mean that π belongs to other bodies.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from runtime.common.user_builds import NAME
from runtime.errors import RecordingError
from runtime.estimators.methods import METHODS
from runtime.estimators.problem import Learned
from runtime.identification.result_record import (
    LARGEST_VALUE,
    CurrentGain,
    FrictionPart,
    JointPlace,
    ModelPart,
    ResultRecord,
    read_record,
)
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, PI_NAMES, first_moment, links, mass
from runtime.recording import Friction, Preparation, Recording, read_recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.current_gains import CurrentGains
from runtime.recording.notebook import Framed, html_table
from runtime.recording.settings import COULOMB_SPEED
from runtime.recording.unit_conversion import scaled

ALIKE = 1e-6
"""Bound in m, m/s² or entries of rotations below which two models differ only by rounding."""


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
        record: the whole content of the file; None of a model that is of no file.
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
    model: ModelPart | None
    record: ResultRecord | None = None
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
        known = self.record
        torque = [
            (name, _number(old, ".2f"), _number(new, ".2f"), f"{_number(size, '.4f')} {unit}")
            for name, unit, old, new, size in (
                zip(
                    *(self.joints, self.units),
                    known.torque_error_percent.before,
                    known.torque_error_percent.after,
                    known.torque_rms.after,
                    strict=True,
                )
                if known is not None
                else ()
            )
        ]
        bodies = [
            (name, f"{m:.4f}", ", ".join(f"{x:.4f}" for x in h / m) if m else "–")
            for name, m, h in zip(
                self._link_names(), mass(links(self.pi)), first_moment(links(self.pi)), strict=True
            )
        ]
        status = "no result.json" if known is None else known.status
        title = f"{self.robot} by {self.method}: {status}"
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
        known = None if self.record is None else self.record.uncertainty
        if known is not None:
            columns["sigma"] = list(known.pi_sigma)
        return columns

    def _link_names(self) -> list[str]:
        """Names of the bodies of π, by their number where the file has none."""
        names = [] if self.record is None else [each.name for each in self.record.links]
        count = len(self.pi) // N_PARAMETERS
        return names if len(names) == count else [f"body {k + 1}" for k in range(count)]


def _number(value: float | None, form: str) -> str:
    """A number of the file; a dash where it has none."""
    return "–" if value is None else format(value, form)


def model_part(lib: Library) -> ModelPart:
    """The part `model` of result.json."""
    return ModelPart(
        model_hash=lib.manifest.model_hash,
        gravity=tuple(lib.gravity.tolist()),
        joints=tuple(
            JointPlace(
                kind=joint.kind,
                parent=joint.parent,
                rotation=joint.rotation,
                translation=tuple(np.array(joint.translation).tolist()),
                axis=tuple(np.array(joint.axis).tolist()),
            )
            for joint in lib.manifest.all_joints
        ),
        lumped=tuple(body["name"] for body in lib.manifest.lumped),
    )


def read_result(folder: Path, with_learned: bool = False) -> SavedResult:
    """Read the result that `identify` wrote; learned friction is refused without `with_learned`."""
    file = folder / "result.json" if folder.is_dir() else folder
    record = read_record(file)
    if not NAME.fullmatch(record.robot):
        raise RecordingError(
            f"'{file}': expected the name of a robot (a-z, 0-9, _), got "
            f"{record.robot!r:.60}; correct the file, or identify again"
        )
    n = len(record.joints)
    terms = record.friction or FrictionPart(
        columns=(), values=((),) * n, coulomb_speed=COULOMB_SPEED
    )
    if terms.net and not with_learned:
        raise RecordingError(
            f"'{file}': expected a result whose friction is its columns, got one of the method "
            f"{record.method}, which learned more, as evaluate takes it; identify again by "
            "another method"
        )
    try:
        saved = SavedResult(
            robot=record.robot,
            method=record.method,
            joints=record.joints,
            units=record.units,
            pi=np.array(record.pi),
            friction=Friction.from_facts(msgspec.to_builtins(terms)),
            phi=np.array(terms.values, dtype=float),
            history=record.recording.history,
            preparation=_preparation(record.recording.preparation),
            model=record.model,
            record=record,
            learned=_learned(record.method, terms.net),
            gains=_gains(record.current_gains),
        )
        bodies = n if saved.model is None else len(saved.model.joints)
        if saved.pi.shape != (N_PARAMETERS * bodies,):
            raise ValueError(f"pi expects {N_PARAMETERS * bodies} numbers, got {saved.pi.size}")
        if not (np.abs(np.concatenate([saved.pi, saved.phi.ravel()])) < LARGEST_VALUE).all():
            raise ValueError(f"pi and friction.values expect numbers below {LARGEST_VALUE:g}")
        if saved.learned and saved.learned(np.zeros((1, *saved.phi.shape))).shape != (1, n):
            raise ValueError("friction.net does not fit to the joints")
    except (RecordingError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise RecordingError(
            f"'{folder}' holds no valid result.json ({error}); give the folder that identify wrote"
        ) from None
    return saved


def _learned(method: str, facts: Any) -> Learned | None:
    """Friction that a method learned; None where the file has none."""
    if not facts:
        return None
    read = METHODS[method].learned
    if read is None:
        raise ValueError(f"the method {method} learns no friction.net")
    return read(facts)


def _gains(gains: tuple[CurrentGain, ...] | None) -> CurrentGains | None:
    """Gains of motor currents; None where the log held torques."""
    if not gains:
        return None
    read = CurrentGains.from_facts([msgspec.to_builtins(each) for each in gains], "the result")
    if not (np.abs(read.gain) < LARGEST_VALUE).all():
        raise ValueError(f"current_gains expect numbers below {LARGEST_VALUE:g}")
    return read


def _preparation(facts: dict[str, Any]) -> Preparation:
    """Preparation; delays per joint are a list in the file."""
    lists: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in facts.items()}
    return Preparation(**lists)


def _places(model: ModelPart) -> Array:
    """Rotation, translation [m] and axis of every joint, (n, 15)."""
    rows = [np.hstack([np.ravel(x) for x in (j.rotation, j.translation, j.axis)])
            for j in model.joints]  # fmt: skip
    return np.array(rows, dtype=float).reshape(len(rows), 15)


def require_model(
    saved: SavedResult, lib: Library, folder: Path, same_bodies: bool = False
) -> tuple[str, ...]:
    """Check that a result holds for the model of a library."""
    if saved.joints != lib.joint_names:
        raise RecordingError(
            f"'{folder}' identified {saved.robot}, whose joints differ from those of "
            f"'{lib.name}'; name its robot with --robot"
        )
    then, now = saved.model, model_part(lib)
    if then is None or then.model_hash == now.model_hash:
        return ()
    kinds = [[(joint.kind, joint.parent) for joint in each.joints] for each in (then, now)]
    moved = ~(np.abs(_places(then) - _places(now)).max(axis=1) <= ALIKE)  # NaN counts as moved
    moved |= np.array([a != b for a, b in zip(*kinds, strict=True)])
    if moved.any():
        raise RecordingError(
            f"'{folder}' was identified with a model whose joint "
            f"'{lib.all_joint_names[int(np.argmax(moved))]}' sits or turns differently "
            f"than that of '{lib.name}', so that its parameters belong to other frames; name the "
            "library that it was identified with by --robot, or identify again"
        )
    if others := set(then.lumped) ^ set(now.lumped):
        other = ", ".join(sorted(others))
        difference = (
            f"'{folder}' was identified with other fixed links counted into moving ones than "
            f"'{lib.name}' has ({other})"
        )
        if same_bodies:
            raise RecordingError(
                f"{difference}; name the library that it was identified with by --robot"
            )
        return (f"{difference}: its masses belong to other bodies",)
    if not np.abs(np.subtract(then.gravity, now.gravity)).max() <= ALIKE:
        old, new = (",".join(f"{x:g}" for x in g) for g in (then.gravity, now.gravity))
        return (
            f"'{folder}' was identified with gravity {old}, and '{lib.name}' has {new}: right "
            "if the arm was mounted again in between",
        )
    return (
        f"'{folder}' was identified with another build of this arm (model {then.model_hash[:12]}, "
        f"here {now.model_hash[:12]}): the joints are the same, inertials, limits or the generator "
        "are not",
    )
