"""Regression rows of the sensor gains, from two runs and a known payload.

    τᵐ = G (Y_b β + F φ + [loaded run] Y_k π_L) + b_run + e,   G = diag g

Rows belong to the channels: the joints, or the motors where the gear couples them, τ_m = R⁻ᵀ τ. The
six entries of an unknown inertia of the payload are further unknowns.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.current_gains.scaling import of_gain_one
from runtime.identification.payload import KnownPayload, Mount, mount_of, pi_of_body
from runtime.library import Array, Library
from runtime.library.parameters import INERTIA
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction import OFFSET, geared, spread
from runtime.recording.plausibility import require_plausible
from runtime.recording.preprocessing import prepare

RUNS = ("empty", "loaded")
FEWEST = 50
"""Samples of a run below which neither noise nor correlation can be estimated."""
_BLOCK = 4096
"""Rows that are computed at once."""
_DIGITS = 1e-4
"""Relative difference up to which torques count as the same, written with fewer digits."""


@dataclass(frozen=True, slots=True)
class GainProblem:
    """Samples and payload from which the gains are identified.

    Attributes:
        lib: library of the robot.
        runs: samples without and with the payload.
        mount: link and frame of the payload.
        payload: known payload.
        to_channels: R⁻ᵀ (n, n) where the gear couples joints, else None.
        channels: names of the n channels.
    """

    lib: Library
    runs: tuple[Samples, ...]
    mount: Mount
    payload: KnownPayload
    to_channels: Array | None
    channels: tuple[str, ...]

    @property
    def n_samples(self) -> int:
        """Number of samples of both runs."""
        return sum(map(len, self.runs))

    @property
    def n_blocks(self) -> int:
        """Number of blocks that `blocks` yields."""
        return sum(-(-len(run) // _BLOCK) for run in self.runs)

    def blocks(self) -> Iterator[Array]:
        """Rows [1 per run, X, y, τᵐ] of every channel, (n, N, p + 4), with τᵐ = g (X θ + y) + b."""
        bodies, known = self.mount.bodies, self.payload
        to_link = np.linalg.inv(self.mount.to_frame)
        inertia = np.zeros((3, 3)) if known.inertia is None else known.inertia
        pi = to_link @ pi_of_body(bodies, known.mass, known.com, inertia)
        free = to_link[:, INERTIA] if known.inertia is None else to_link[:, :0]
        for k, samples in enumerate(self.runs):
            for start in range(0, len(samples), _BLOCK):
                s = samples.rows(slice(start, start + _BLOCK))
                Y = k * self.lib.regressor(s.q, s.dq, s.ddq)[:, :, self.mount.columns]
                base = self.lib.base_regressor(s.q, s.dq, s.ddq)
                friction = spread(s.columns, s.coupling)
                parts = [base, friction, Y @ free, (Y @ pi)[:, :, None], s.tau[:, :, None]]
                rows = np.concatenate(parts, axis=2)
                if self.to_channels is not None:
                    rows = np.einsum("mj,ijk->imk", self.to_channels, rows)
                ones = np.zeros((*rows.shape[:2], len(RUNS)))
                ones[:, :, k] = 1.0
                yield np.swapaxes(np.concatenate([ones, rows], axis=2), 0, 1)


def problem_of(
    empty: Recording,
    loaded: Recording,
    lib: Library,
    payload: KnownPayload,
    link: str | None,
    friction: Friction | None,
    preparation: Preparation | None,
) -> GainProblem:
    """Check and prepare both recordings."""
    mount = _mount(lib, payload, link)
    _require_two_runs(empty, loaded)
    terms = friction or Friction(("viscous", "coulomb"))
    terms = replace(terms, columns=tuple(name for name in terms.columns if name != OFFSET.name))
    runs = []
    for run in (empty, loaded):
        require_plausible(run, lib)
        bare = of_gain_one(run).replace(columns=None, column_names=())
        runs.append(samples_of(prepare(bare, preparation, geared(terms, run, lib), lib=lib), lib))
        if len(runs[-1]) < FEWEST:
            raise IdentificationError(
                f"expected {FEWEST} samples or more of '{run.name}' after its preparation, got "
                f"{len(runs[-1])}; record for longer"
            )
    R = np.array(empty.recipe.gear if empty.recipe else ())
    coupled = np.count_nonzero(R) > np.count_nonzero(np.diagonal(R)) if R.size else False
    return GainProblem(
        lib=lib,
        runs=tuple(runs),
        mount=mount,
        payload=payload,
        to_channels=np.asarray(np.linalg.inv(R).T) if coupled else None,
        channels=tuple(f"motor {m + 1}" for m in range(len(R))) if coupled else lib.joint_names,
    )


def _mount(lib: Library, payload: KnownPayload, link: str | None) -> Mount:
    """The mount, after the check that the payload is given in its frame."""
    mount = mount_of(lib, link or payload.link)
    if payload.frame and payload.frame != mount.frame:
        raise IdentificationError(
            f"the payload is given in the frame of '{payload.frame}', but expected in that of "
            f"'{mount.frame}' for a payload on '{mount.link}'; name the link that carries it"
        )
    return mount


def _require_two_runs(empty: Recording, loaded: Recording) -> None:
    """Refuse two recordings that are equal, of different robots or read differently."""
    names = empty.joint_names, loaded.joint_names
    if empty.n_joints != loaded.n_joints or (all(names) and names[0] != names[1]):
        robots = [", ".join(each) or f"{run.n_joints} joints" for each, run in
                  zip(names, (empty, loaded), strict=True)]  # fmt: skip
        raise IdentificationError(
            f"'{empty.name}' and '{loaded.name}' are of different robots ({robots[0]}; "
            f"{robots[1]}); give two runs of one"
        )
    if _same(empty.tau, loaded.tau):
        raise IdentificationError(
            f"'{empty.name}' and '{loaded.name}' hold the same torques; give one run without and "
            "one with the payload"
        )
    if _reading(empty) != _reading(loaded):
        raise IdentificationError(
            f"'{empty.name}' and '{loaded.name}' were read with different units, gains, signs or "
            "gears of torque; read both with one recipe"
        )


def _same(one: Array | None, other: Array | None) -> bool:
    """Whether two torques are equal to the digits of a file."""
    if one is None or other is None or one.shape != other.shape:
        return False
    return bool(np.linalg.norm(one - other) <= _DIGITS * np.linalg.norm(one))


def _reading(run: Recording) -> tuple[object, ...]:
    """Gear, unit, gain, sign and order with which a torque was read."""
    if run.recipe is None:
        return ()
    torque = run.recipe.torque
    scaling = (torque.unit, torque.gain, torque.sign, torque.order) if torque else ()
    return (run.recipe.gear, *scaling)
