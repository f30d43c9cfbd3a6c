"""Prepared and thinned rows on which the checks of the torque are computed, and that of its unit.

    τ_j = s τ̂_j + v dq_j + c tanh(dq_j / ε) + b

s is 1 where τ is the torque at the joint in N·m. One factor for all joints is a unit; different
factors are motor currents or motor torques. The torque of the URDF errs by 10 to 20 %, so that
gains computed from it are a start, not a calibration.
"""

from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression.posterior import least_squares
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.inspection.finding import ERROR, Checked, Finding
from runtime.library import Array, Integers, Library, Mask
from runtime.recording import Friction, Preparation, Recipe, Recording
from runtime.recording.friction.columns import ROTOR
from runtime.recording.friction.coupled_motors import spread
from runtime.recording.preprocessing import prepare
from runtime.recording.recipes.recipe import CURRENT
from runtime.recording.rest_speeds import rest_speeds

EPSILON = 0.05  # width of the smooth sign of dq, rad/s
ROWS = 900  # rows: some hundred of them are independent, and a fit of 100 unknowns takes 50 ms
FEWEST_ROWS, SLOWEST_HZ = 150, 20.0  # rows, rate [Hz] below which accelerations mean nothing
ROUGH_HZ = 5.0  # cut-off where the recipe has no filter, Hz
SHARE = 0.2  # the same over the rate of the log, where the rate is low


@dataclass(frozen=True, slots=True, eq=False)
class TorqueRows:
    """Prepared rows of one recording."""

    lib: Library  # library of the robot
    whole: Recording  # the recording on its grid, filtered, not decimated and with its rests
    rows: Integers  # indices of the thinned rows in which the arm moves, (N,)
    samples: Samples  # samples of these rows, with friction columns
    has_rotors: bool = False  # whether rotor inertia is among these columns

    def model_torque(self) -> tuple[Array, Array]:
        """Inertial and gravity part of the torque of the URDF at the rows, (N, n) each."""
        s, still = self.samples, np.zeros_like(self.samples.q)
        gravity = self.lib.inverse_dynamics(s.q, still, still, self.lib.pi0)
        return self.lib.inverse_dynamics(s.q, s.dq, s.ddq, self.lib.pi0) - gravity, gravity

    def friction_rows(self) -> Array:
        """Friction part of the equations over φ, (N n, n k), one block of columns per joint."""
        s = self.samples
        return spread(s.columns, s.coupling).reshape(len(s) * self.lib.n_joints, -1)


def torque_rows_of(
    recording: Recording, lib: Library, preparation: Preparation, terms: Friction
) -> TorqueRows:
    """Prepare a recording for the checks of its torque."""
    bare = recording.replace(columns=None, column_names=(), motors=None)
    usual = replace(preparation, rate_hz=None, rest_speed=None, regressor="acceleration")
    whole = prepare(bare, usual, terms, lib=lib)
    if whole.rate_hz < SLOWEST_HZ or len(whole) < FEWEST_ROWS:
        raise IdentificationError(
            f"expected {FEWEST_ROWS} rows or more at {SLOWEST_HZ:g} Hz or more, which "
            f"accelerations need, got {len(whole)} rows at {whole.rate_hz:.3g} Hz; record "
            "for longer or faster"
        )
    samples = samples_of(whole, lib)
    if lib.manifest.springs or "known_torque" in lib.manifest.kernels:
        samples = _without_springs(samples, lib) if lib.manifest.springs else samples
        whole = whole.replace(tau=samples.tau)
    moving = np.any(np.abs(samples.dq) >= rest_speeds(lib), axis=1)
    rows = np.flatnonzero(moving if moving.sum() > ROWS // 4 else np.ones(len(samples), dtype=bool))
    rows = rows[:: max(1, len(rows) // ROWS)]
    return TorqueRows(lib, whole, rows, samples.rows(rows), ROTOR.name in terms.columns)


def _without_springs(samples: Samples, lib: Library) -> Samples:
    """Samples of τ − S k, with k of unknown springs by least squares over [β; φ; k]."""
    springs = lib.spring_columns(samples.q)
    take = slice(None, None, max(1, len(samples) // ROWS))
    few = samples.rows(take)
    others = few.rows_of_unknowns(lib)
    others = others.reshape(-1, others.shape[2])
    target = np.concatenate([springs, samples.tau[..., None]], axis=2)[take]
    _, rest = least_squares(others, target.reshape(len(others), -1))
    k, _ = least_squares(rest[:, :-1], rest[:, -1])
    return replace(samples, tau=samples.tau - springs @ k)


def rough(recording: Recording, preparation: Preparation) -> Preparation:
    """Preparation with a low-pass for the checks, where the recipe has no filter."""
    if preparation.filter != "none":
        return preparation
    grid = preparation.max_gap_s
    step = 1.0 / recording.rate_hz
    uniform = float(np.abs(np.diff(recording.t) / step - 1.0).max()) < 0.01
    f_c = min(ROUGH_HZ, SHARE * recording.rate_hz)
    return replace(
        preparation,
        filter="butterworth",
        cutoff_hz=f_c,
        max_gap_s=grid if grid or uniform else 4.0 * step,
        trim_s=min(1.0 / f_c, 0.05 * recording.duration),
    )


SURE = 0.7  # partial correlation of τ with the model's torque above which a slope is used
LOADED = 0.05  # RMS of the model's torque over the largest one, above which a joint is used
BEYOND = 10.0  # largest torque over the effort, median of joints, from which τ is not in N·m
USUAL = (0.5, 2.0)  # slopes that the errors of a URDF explain


def scale(torque_rows: TorqueRows, plan: Recipe) -> Checked:
    """Unit and gains of τ, from the slopes of the joints that gravity or inertia load."""
    slopes, is_used = slopes_to_model(torque_rows)
    if plan.torque is None or not is_used.any():
        has_unit = plan.torque is None or plan.torque_source == CURRENT
        return plan, [] if has_unit else _beyond(torque_rows)
    size = np.abs(slopes)
    middle = float(np.median(size[is_used]))
    evidence = {"slopes": [float(s) if k else None for s, k in zip(slopes, is_used, strict=True)]}
    factors = ", ".join(f"{s:.3g}" if k else "?" for s, k in zip(slopes, is_used, strict=True))
    spread = float(size[is_used].max() / size[is_used].min())
    # In amperes by its title, without a gain.
    is_unscaled = plan.torque_source == CURRENT and plan.torque.gain == 1.0
    if USUAL[0] <= middle <= USUAL[1] and spread < 4.0 and not is_unscaled:
        return plan, []
    if 400.0 <= middle <= 2500.0 and spread < 3.0 and plan.torque.unit == "N*m":
        sentence = (
            f"τ looks like mN·m: it is {factors} times the model's torque, joint by joint; set "
            "unit = 'mN*m' under [torque]"
        )
        torque = replace(plan.torque, unit="mN*m")
        return plan.replace(torque=torque), [Finding("torque_unit", ERROR, sentence, evidence)]
    known = [float(s) for s, k in zip(size, is_used, strict=True) if k]
    gains = [
        1.0 / s if k else 1.0 / float(np.median(known)) for s, k in zip(size, is_used, strict=True)
    ]
    evidence["gains"] = [float(f"{g:.4g}") for g in gains]
    before = np.broadcast_to(np.asarray(plan.torque.gain or 1.0, dtype=float), size.shape)
    torque = replace(
        plan.torque,
        unit=plan.torque.unit if plan.torque_source == CURRENT else "A",
        gain=tuple(float(f"{g * b:.4g}") for g, b in zip(gains, before, strict=True)),
    )
    sentence = (
        f"τ is not the joint torque in N·m: it is {factors} times the model's torque, joint by "
        "joint, as motor currents or motor torques are; give the gains from the data sheet "
        "(torque constant times gear ratio), or from two runs with and without a known payload. "
        f"The proposed gains {', '.join(f'{g:.3g}' for g in gains)} reproduce the masses of the "
        "URDF and are not a calibration: identified masses inherit their error"
    )
    return plan.replace(torque=torque), [Finding("torque_unit", ERROR, sentence, evidence)]


def _beyond(torque_rows: TorqueRows) -> list[Finding]:
    """The finding of torques far beyond the limits of effort, where links explain too little."""
    effort = torque_rows.lib.limits()["effort"]
    known = np.isfinite(effort) & (effort > 0)
    if not known.any():
        return []
    peak = np.abs(torque_rows.whole.required("tau")).max(axis=0)
    ratio = float(np.median(peak[known] / effort[known]))
    if ratio < BEYOND:
        return []
    sentence = (
        f"τ is not the joint torque in N·m: its peaks are {ratio:.3g} times the limits of effort "
        "of the URDF (median of the joints); set the unit under [torque], mN*m or A with gains"
    )
    return [Finding("torque_unit", ERROR, sentence, {"peak_over_effort": ratio})]


def slopes_to_model(torque_rows: TorqueRows) -> tuple[Array, Mask]:
    """Slope s of τ on the model's torque per joint, (n,), and whether it is used, (n,) booleans."""
    inertial, falls = torque_rows.model_torque()
    model = inertial + falls
    pairs = [_regressed(torque_rows, model, j) for j in range(torque_rows.lib.n_joints)]
    slopes, partial = np.array(pairs).T
    power = np.sqrt(np.mean(np.square(model), axis=0))
    return slopes, np.asarray((np.abs(partial) > SURE) & (power > LOADED * power.max()))


def _regressed(torque_rows: TorqueRows, model: Array, j: int) -> tuple[float, float]:
    """s and the partial correlation of τ with the model's torque at joint j."""
    s = torque_rows.samples
    dq = s.dq[:, j]
    others = np.column_stack([dq, np.tanh(dq / EPSILON), np.ones_like(dq)])
    if torque_rows.has_rotors:
        others = np.column_stack([others, s.ddq[:, j]])
    return partial_slope(others, s.tau[:, j], model[:, j])


def partial_slope(others: Array, tau: Array, model: Array) -> tuple[float, float]:
    """Slope of τ (N,) on a torque (N,) beside other columns (N, k), and partial correlation."""
    _, tau = least_squares(others, tau)
    _, rigid = least_squares(others, model)
    size = float(np.linalg.norm(rigid))
    if size <= 1e-6 * np.sqrt(len(rigid)):  # rounding, as of a joint along gravity
        return 0.0, 0.0
    both = float(rigid @ tau)
    return both / size**2, both / max(size * float(np.linalg.norm(tau)), 1e-300)
