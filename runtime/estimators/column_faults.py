"""Faults of the columns of a log, compared by how much of the torque each one explains.

    τ_j = s τ̂_j(q, dq, ddq) + c tanh(dq_j / ε) + v dq_j + J ddq_j + b,    s, c, v, J ≥ 0

with the torque τ̂ of the URDF. Friction brakes and inertia resists in every joint, so that a column
with the opposite sign, or of another joint, leaves residuals that no s, c, v, J ≥ 0 explain, also
where friction is all that a wrist joint carries. Gains are free: no unit is needed. A fault f is a
change of the columns, and its evidence compares the log with the fault undone:

    E_f = Σ_j ln(ρ_j / ρ_j^f),    ρ_j = ‖rest of τ_j‖² / ‖τ_j − mean‖²

over the joints that move. The same numbers tell what the log hides: a fault whose planting changes
Σ_j ln ρ_j by less than `EVIDENCE` leaves no trace in it.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment, nnls

from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Integers, Library
from runtime.recording.rest_speeds import rest_speeds

ROWS = 400  # rows of the regressions: residuals differ by factors
WIDTH = 2.5  # width ε of the smooth sign over the speed of rest
MOVES, FEWEST = 0.2, 30  # share and number of the rows in which a joint must move to be tested
EVIDENCE = 1.0
"""E from which on a fault counts: the residual falls by the factor e of its square. Unchanged logs
of real arms reach 0.9, at a wrist whose torque is mostly the ripple of its sensor."""
GOOD = 0.3  # ρ that joints of a fault must reach: what the model does not explain accuses nobody
ALIKE, NEAR = 0.5, 0.1
"""E below that of the best fault up to which another fault is named beside it; the same over its E
where that is more: an exchange with a joint that hardly moves explains as much as a sign."""
FLOOR = 1e-3  # least ρ: a fit below a thousandth is as good as any
MOST = 4  # faults that are undone one after the other
TORQUE_SIGN, POSITION_SIGN, BOTH_SIGN = "torque_sign", "position_sign", "joint_sign"
TORQUE_ORDER, POSITION_ORDER = "torque_order", "position_order"
REVERSED, GRAVITY = "every_torque_sign", "gravity"


@dataclass(frozen=True, slots=True)
class ColumnFault:
    """One fault of the columns."""

    kind: str  # one of the kinds above
    joints: tuple[int, ...]  # of the fault, ascending
    order: tuple[int, ...]  # column of every joint, (n,); 0 … n − 1 without an exchange
    evidence: float = 0.0  # E

    def sentence(self, names: tuple[str, ...]) -> str:
        """The fault in words."""
        where = ", ".join(names[j] for j in self.joints)
        if len(self.joints) == len(names) > 1:
            where = "every joint"
        return {
            TORQUE_SIGN: f"the torque of {where} has the opposite sign",
            POSITION_SIGN: f"position and velocity of {where} have the opposite sign of the "
            "model's joint",
            BOTH_SIGN: f"position, velocity and torque of {where} have the opposite sign of the "
            "model's joint",
            TORQUE_ORDER: f"the torques of {where} are exchanged",
            POSITION_ORDER: f"the positions and velocities of {where} are exchanged",
            REVERSED: "all torques have the opposite sign",
            GRAVITY: "gravity is opposite to that of the model",
        }[self.kind]


@dataclass(frozen=True, slots=True, eq=False)
class ColumnFaults:
    """Result of the comparison."""

    named: tuple[ColumnFault, ...]  # those that explain most, each after undoing those before
    rivals: tuple[tuple[ColumnFault, ...], ...]  # of each, faults of its joints nearly as good
    hidden: tuple[ColumnFault, ...]  # faults that would leave no trace in this log
    left: Array  # ρ as the log is, and with the faults undone, (2, n); NaN of joints that rest


def column_faults(lib: Library, samples: Samples) -> ColumnFaults:
    """Compare all signs, exchanges of two joints, and orders of τ, which may be in any unit."""
    step = max(1, len(samples) // ROWS)
    table = _Table(lib, samples.rows(slice(None, None, step)), rest_speeds(lib))
    first = table.left()
    named: list[ColumnFault] = []
    rivals: list[tuple[ColumnFault, ...]] = []
    faults = table.faults()
    while len(named) < MOST:
        ranked = sorted(faults, key=lambda fault: -fault.evidence)
        ranked = [each for each in ranked if each.evidence >= EVIDENCE]
        # What a fault explains best whose joints remain unexplained accuses no other joint.
        near = max(ALIKE, NEAR * ranked[0].evidence) if ranked else 0.0
        ranked = [each for each in ranked if each.evidence > ranked[0].evidence - near]
        ranked = [each for each in ranked if table.without(each).explains(each.joints)]
        if not ranked:
            break
        best, table = ranked[0], table.without(ranked[0])
        faults = table.faults()
        named.append(best)
        alike = [each for each in ranked[1:] if each.evidence > best.evidence - ALIKE]
        rivals.append(tuple(each for each in alike if each.joints == best.joints))
        if best.kind in {REVERSED, GRAVITY}:
            break
    # Undoing a fault f gains E_f; planting it loses as much.
    hidden = tuple(each for each in faults if each.evidence > -EVIDENCE)
    return ColumnFaults(tuple(named), tuple(rivals), hidden, np.array([first, table.left()]))


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Columns of the log as they are assumed."""

    lib: Library
    samples: Samples
    slow: Array  # speeds of rest, (n,)
    falls: float = 1.0  # sign of gravity

    def left(self) -> Array:
        """ρ of every joint, (n,); NaN of joints that rest or have a constant torque."""
        model = self.model()
        return np.array([self._left(model, j, j) for j in range(self.samples.equations)])

    def explains(self, joints: tuple[int, ...]) -> bool:
        """Whether the model explains the torque of these joints, as far as they move."""
        return not bool((np.nan_to_num(self.left()[list(joints)]) > GOOD).any())

    def model(self) -> Array:
        """Torque of the URDF, (N, n)."""
        lib, s = self.lib, self.samples
        torque = lib.inverse_dynamics(s.q, s.dq, s.ddq, lib.pi0)
        if self.falls > 0:
            return torque
        still = np.zeros_like(s.q)
        return torque - 2.0 * lib.inverse_dynamics(s.q, still, still, lib.pi0)

    def _left(self, model: Array, column: int, joint: int, sign: float = 1.0) -> float:
        """ρ of a column of τ at a joint."""
        s = self.samples
        moves = np.abs(s.dq[:, joint]) >= self.slow[joint]
        if moves.sum() < max(FEWEST, MOVES * len(moves)):
            return np.nan
        tau = sign * s.tau[moves, column]
        dq, ddq = s.dq[moves, joint], s.ddq[moves, joint]
        smooth = np.tanh(dq / (WIDTH * self.slow[joint]))
        columns = np.column_stack([model[moves, joint], smooth, dq, ddq])
        columns, tau = columns - columns.mean(axis=0), tau - tau.mean()
        sizes = np.linalg.norm(columns, axis=0)
        size = float(np.linalg.norm(tau))
        if size == 0.0:
            return np.nan
        _, rest = nnls(columns / np.where(sizes > 0, sizes, 1.0), tau / size)
        return max(float(rest) ** 2, FLOOR)

    def faults(self) -> list[ColumnFault]:
        """All faults with their evidence, in no order."""
        n = self.samples.equations
        model = self.model()
        here = np.array([self._left(model, j, j) for j in range(n)])
        tested = np.flatnonzero(np.isfinite(here))
        before = np.log(np.nan_to_num(here, nan=1.0))  # nothing is explained at rest
        if not tested.size:
            return []
        named = []
        for fault in self._candidates(tested):
            if fault.kind in {TORQUE_SIGN, TORQUE_ORDER}:
                after = here.copy()
                for j in fault.joints:
                    sign = -1.0 if fault.kind == TORQUE_SIGN else 1.0
                    after[j] = self._left(model, fault.order[j], j, sign)
            else:
                after = self.without(fault).left()
            gain = float(np.sum(before - np.log(np.nan_to_num(after, nan=1.0))))
            named.append(ColumnFault(fault.kind, fault.joints, fault.order, gain))
        return named

    def _candidates(self, tested: Integers) -> Iterator[ColumnFault]:
        n = self.samples.equations
        still = tuple(range(n))
        for j in tested:
            for kind in (TORQUE_SIGN, POSITION_SIGN, BOTH_SIGN):
                yield ColumnFault(kind, (int(j),), still)
        for j, k in itertools.combinations(range(n), 2):
            if not {j, k} & set(tested.tolist()):
                continue
            order = list(still)
            order[j], order[k] = k, j
            for kind in (TORQUE_ORDER, POSITION_ORDER):
                yield ColumnFault(kind, (j, k), tuple(order))
        best = self._best_order(tested)
        moved = tuple(j for j in still if best[j] != j)
        if len(moved) > 2:
            yield ColumnFault(TORQUE_ORDER, moved, best)
        loaded = tuple(int(j) for j in tested)
        yield ColumnFault(REVERSED, loaded, still)
        if self.lib.gravity.any():
            yield ColumnFault(GRAVITY, loaded, still)

    def _best_order(self, tested: Integers) -> tuple[int, ...]:
        """Order of the columns of τ with the least Σ ln ρ."""
        model, n = self.model(), self.samples.equations
        cost = np.zeros((n, n))  # (joint, column)
        for j in tested:
            cost[j] = [np.log(self._left(model, k, int(j))) for k in range(n)]
        _, columns = linear_sum_assignment(np.nan_to_num(cost))
        return tuple(int(k) for k in columns)

    def without(self, fault: ColumnFault) -> "_Table":
        """The columns with the fault undone."""
        sign = np.ones(self.samples.equations)
        sign[list(fault.joints)] = -1.0
        motion, torque = ("q", "dq", "acceleration"), ("tau",)
        if fault.kind == GRAVITY:
            return replace(self, falls=-self.falls)
        names = {POSITION_SIGN: motion, POSITION_ORDER: motion, BOTH_SIGN: (*motion, *torque)}
        changed = names.get(fault.kind, torque)

        def undone(key: str, values: Array) -> Array:
            if key not in changed:
                return values
            if fault.kind in {TORQUE_ORDER, POSITION_ORDER}:
                return values[:, list(fault.order)]
            return -values if fault.kind == REVERSED else values * sign

        return replace(self, samples=self.samples.mapped(undone))
