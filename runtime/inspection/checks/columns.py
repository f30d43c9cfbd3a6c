"""Signal, joint and unit of the columns of a file, from their titles or from their numbers.

`tau_J_3 [mA]` is a torque of joint 3 in mA; `q_d2` is a commanded position, not a measurement.

Columns without titles are recognised by their numbers. A clock increases by nearly constant steps.
Positions, velocities and torques are blocks of n neighbouring columns: the derivative of the
positions correlates with the velocities, that of the velocities with the accelerations, positions
are the smoothest, and what is left is torque. Seven columns with a unit quaternion are a pose,
which is not used. A commanded copy of a signal correlates with it and is smoother than the
measurement.
"""

import re
from dataclasses import dataclass

import numpy as np

from runtime.library import Array

MOST_ROWS = 20_000  # rows that are compared; more change no correlation
FEWEST_ROWS = 20  # rows below which nothing is concluded
LARGEST_NUMBER = 1e100  # largest size of a number; squares of larger ones overflow
STEADY = 0.5  # largest standard deviation of a clock's steps, relative to their median
DERIVATIVE = 0.9  # least correlation, median of joints, of a derivative with the signal that it is
ACCELERATION = 0.95  # for accelerations: a torque that only accelerates a mass is close
ALIKE = 0.15  # largest deviation of the slopes of an acceleration from one unit for all joints
NOISY = 0.6  # least correlation of a second derivative: noise of positions grows, not its slopes
LARGEST_ANGLE = 720.0  # two turns in degrees; beyond, positions like joints' are lengths in mm
UNIT_LENGTH = 1e-3  # largest difference of the squared length of a quaternion from 1
COPY = 0.98  # least correlation of two copies of one signal
_SMOOTHING = 9  # rows of the moving average before the derivative, against rounding of positions
_UNITS = ((0.2, "s"), (2e2, "ms"), (2e5, "us"), (np.inf, "ns"))
"""Largest median step of a clock in each unit, for rates of 5 Hz and above."""
KINDS: dict[str, tuple[str, ...]] = {
    "acceleration": ("ddq", "qdd", "acc", "acceleration", "accelerations"),
    "velocity": ("dq", "qd", "vel", "velocity", "velocities", "speed", "omega"),
    "torque": (
        *("tau", "torque", "torques", "torq", "trq", "effort", "efforts", "moment", "moments"),
        *("current", "curr", "currents", "load"),
    ),
    "position": ("q", "pos", "position", "positions", "angle", "angles", "theta"),
    "time": ("t", "time", "times", "timestamp", "stamp", "clock"),
}
COMMANDED = {
    *("d", "des", "desired", "target", "cmd", "command", "commanded", "ref", "reference", "set"),
    *("setpoint", "goal", "gen", "model", "sim", "computed", "expected", "nominal"),
}
OF_TIP = {"tcp", "cartesian", "eef", "flange"}  # signals in space, such as actual_TCP_speed
RATED = "rated"  # unit of a torque that is stated as a share of the rated one of a joint
UNIT_WORDS: dict[str, dict[str, str]] = {
    "time": {"s": "s", "sec": "s", "ms": "ms", "us": "us", "µs": "us", "ns": "ns"},
    "position": {"rad": "rad", "deg": "deg", "degree": "deg", "degrees": "deg", "mm": "mm"},
    "velocity": {"rad": "rad/s", "deg": "deg/s", "dps": "deg/s", "rpm": "rpm"},
    "acceleration": {"rad": "rad/s^2", "deg": "deg/s^2"},
    "torque": {"nm": "N*m", "mnm": "mN*m", "ma": "mA", "a": "A"}
    | dict.fromkeys(("pct", "percent", "rated", "permille"), RATED),
}
KIND_OF_UNIT = {  # signal of a title in an unknown language, by its unit in brackets
    **dict.fromkeys(("s", "sec", "ms", "us", "µs", "ns"), "time"),
    **dict.fromkeys(("rad", "deg"), "position"),
    **dict.fromkeys(("rad/s", "deg/s", "rpm"), "velocity"),
    **dict.fromkeys(("rad/s^2", "rad/s²", "rad/s2", "deg/s^2", "deg/s²"), "acceleration"),
    **dict.fromkeys(("nm", "mnm", "a", "ma"), "torque"),
}


@dataclass(frozen=True, slots=True)
class ColumnBlock:
    """Neighbouring columns of one signal."""

    kind: str  # of signal; "" where the columns are not used
    columns: tuple[int, ...]  # their numbers, from 0
    unit: str  # of a clock; "" otherwise
    reason: str  # why, half a sentence


def blocks_by_content(values: Array, joints: int) -> tuple[ColumnBlock, ...]:
    """Assign the columns of a table to signals."""
    rows = values[np.isfinite(values).all(axis=1)][:MOST_ROWS]
    if len(rows) < FEWEST_ROWS or np.abs(rows).max() > LARGEST_NUMBER:
        return ()
    single = _clock_and_counters(rows)
    starts, pose = list[int](), set[int]()
    for pose in (*_poses(rows, set(single)), set[int]()):
        starts = _starts(rows, joints, {*single, *pose})
        if starts:
            break
    if len(starts) < 2:
        return ()
    if pose:
        single[min(pose)] = ColumnBlock("", tuple(sorted(pose)), "", "pose with a unit quaternion")
    named = _signals([rows[:, s : s + joints] for s in starts])
    blocks = [
        ColumnBlock(kind, tuple(range(s, s + joints)), "", reason)
        for s, (kind, reason) in zip(starts, named, strict=True)
    ]
    inside = {column for block in blocks for column in block.columns}
    for column in set(range(rows.shape[1])) - inside - set(single) - pose:
        reason = "no signal of all joints" if np.ptp(rows[:, column]) else "constant"
        single[column] = ColumnBlock("", (column,), "", reason)
    return tuple(sorted((*blocks, *single.values()), key=lambda block: block.columns))


def _clock_and_counters(rows: Array) -> dict[int, ColumnBlock]:
    """The clock, and increasing columns that are not used, by their number."""
    steps = np.diff(rows, axis=0)
    spread = {}
    for column, step in enumerate(steps.T):
        middle = float(np.median(step))
        if (step > 0).all() and step.std() < STEADY * middle:
            spread[column] = float(step.std() / middle)
    counters = [k for k in spread if (steps[:, k] == 1.0).all()]
    clocks = sorted((k for k in spread if k not in counters), key=lambda k: (spread[k], k))
    blocks = {k: ColumnBlock("", (k,), "", "row counter") for k in counters}
    for place, k in enumerate(clocks):
        middle = float(np.median(steps[:, k]))
        unit = next(unit for largest, unit in _UNITS if middle <= largest)
        reason = f"increases by {middle:.4g} per row"
        blocks[k] = ColumnBlock("" if place else "time", (k,), "" if place else unit, reason)
    return blocks


def _poses(rows: Array, taken: set[int]) -> list[set[int]]:
    """Columns that a pose may take: a unit quaternion and the position before or behind it."""
    width, poses = rows.shape[1], list[set[int]]()
    for first in range(width - 3):
        length = (rows[:, first : first + 4] ** 2).sum(axis=1)
        # rounded decimals change the length by some of their last digit
        if np.abs(length - 1).max() > UNIT_LENGTH or not np.ptp(rows[:, first : first + 4]):
            continue
        for start in (first - 3, first):
            columns = set(range(start, start + 7))
            if not columns & taken and 0 <= start <= width - 7:
                poses.append(columns)
    return poses


def _starts(rows: Array, joints: int, taken: set[int]) -> list[int]:
    """First columns of the blocks, between constant columns or whole runs of other columns."""
    constant = set(np.flatnonzero(np.ptp(rows, axis=0) == 0).tolist())
    for apart, least in ((taken | constant, 0), (taken, 0), (taken | constant, joints)):
        runs: list[list[int]] = [[]]
        for column in range(rows.shape[1]):
            if column in apart:
                runs.append([])
            else:
                runs[-1].append(column)
        runs = [run for run in runs if len(run) >= least]
        odd = [run for run in runs if len(run) % joints]
        if len(odd) == 1:  # a temperature or a pose of angles beside the signals
            _leave_out(rows, joints, runs, odd[0])
        elif odd:
            continue
        starts = [run[k] for run in runs for k in range(0, len(run), joints)]
        if starts:
            return starts
    return []


def _leave_out(rows: Array, joints: int, runs: list[list[int]], odd: list[int]) -> None:
    """Divide the run of an odd length at further columns between its blocks, in `runs`.

    They lie where the derivative of a block is another one in every joint; of several such places
    where the last block is explained best by q, dq and ddq of the same joints.
    """
    places = []
    more = len(odd) % joints
    others = [run for run in runs if run is not odd]
    for first in range(0, len(odd) - more + 1, joints):
        parts = [*others, odd[:first], odd[first + more :]]
        starts = sorted(run[k] for run in parts for k in range(0, len(run), joints))
        blocks = [rows[:, s : s + joints] for s in starts]
        rates = [_derivative(block) for block in blocks]
        level = [_averaged(block)[1:-1] for block in blocks]
        alike = {
            (a, b): min(_correlations(rates[a], level[b]), default=0.0)
            for a in range(len(blocks))
            for b in range(len(blocks))
            if a != b
        }
        best = max(alike, key=lambda pair: alike[pair], default=(0, 0))
        if alike.get(best, 0.0) >= DERIVATIVE:
            q, dq, last = level[best[0]], level[best[1]], level[-1]
            shares = [
                _share(last[:, j], [q[:, j], dq[:, j], np.sign(dq[:, j]), rates[best[1]][:, j]])
                for j in range(joints)
            ]
            places.append((float(np.mean(shares)), parts))
    runs[:] = max(places, key=lambda place: place[0])[1] if places else []


def _share(y: Array, columns: list[Array]) -> float:
    """Share of the power of y that columns and a constant explain."""
    matrix = np.column_stack([np.ones(len(y)), *columns])
    left = y - matrix @ np.linalg.lstsq(matrix, y, rcond=None)[0]
    return float(1.0 - left.var() / y.var()) if y.var() > 0 else 0.0


def _signals(blocks: list[Array]) -> list[tuple[str, str]]:
    """Kind and reason of every block."""
    named: dict[int, tuple[str, str]] = {}
    count = range(len(blocks))
    rates = [_derivative(block) for block in blocks]
    level = [_averaged(block)[1:-1] for block in blocks]
    # (a, b): correlation of the derivative of block a with block b.
    by = np.array([[_correlation(x, y) for y in level] for x in rates])
    np.fill_diagonal(by, 0.0)
    a, b = (int(k) for k in np.unravel_index(np.argmax(by), by.shape))
    if by[a, b] >= DERIVATIVE:
        # d(dq)/dt = ddq correlates as well: the pair that begins with a derivative is (dq, ddq).
        before = int(np.argmax(by[:, a]))
        if by[before, a] >= DERIVATIVE and before != b:
            a, b = before, a
        said = f"(correlation {by[a, b]:.3f})"
        named[a] = ("position", f"its derivative is the velocity {said}")
        named[b] = ("velocity", f"derivative of the position {said}")
    else:
        a = min(count, key=lambda k: _roughness(blocks[k]))
        inside = [k for k in count if np.abs(blocks[k]).max() <= LARGEST_ANGLE]
        if a not in inside and len(inside) > 1:
            named[a] = ("", "more than two turns: a pose in mm, not joints")
            a = min(inside, key=lambda k: _roughness(blocks[k], 0.0))  # of the joint that moves
        named[a] = ("position", "the smoothest columns")
    for k in set(count) - set(named):
        copied = next((j for j in named if _correlation(level[k], level[j]) > COPY), None)
        if copied is not None:
            kind, reason = named[copied]
            if _roughness(blocks[k]) > _roughness(blocks[copied]) and kind:
                named[k], named[copied] = (kind, reason), ("", f"smoother copy of the {kind}")
            else:
                named[k] = ("", f"smoother copy of the {kind}" if kind else "copy")
        elif b in named and by[b, k] >= ACCELERATION:
            # The slope of d(dq)/dt on ddq is that of dq/dt on dq; on a torque it is 1 / inertia.
            ratio = _slopes(rates[b], level[k]) / np.median(_slopes(rates[a], level[b]))
            if len(blocks) > len(named) + 1 or (np.abs(ratio - 1.0) < ALIKE).all():
                reason = f"derivative of the velocity (correlation {by[b, k]:.3f})"
                named[k] = ("acceleration", reason)
        elif b not in named and _is_second_derivative(blocks[a], blocks[k]):
            named[k] = ("acceleration", "second derivative of the position")
    rest = [k for k in count if k not in named]
    for place, k in enumerate(rest):
        named[k] = ("", "not recognised") if place else ("torque", "no derivative of the others")
    return [named[k] for k in count]


def _averaged(block: Array) -> Array:
    """Moving average over `_SMOOTHING` rows, (N − 8, n)."""
    total = np.cumsum(np.vstack([np.zeros(block.shape[1]), block - block.mean(axis=0)]), axis=0)
    return np.asarray((total[_SMOOTHING:] - total[:-_SMOOTHING]) / _SMOOTHING, dtype=float)


def _derivative(block: Array) -> Array:
    """Central difference of the moving average per row, (N − 10, n)."""
    smooth = _averaged(block)
    return smooth[2:] - smooth[:-2]


def _slopes(a: Array, b: Array) -> Array:
    """Slope of every column of one block on that of another, (n,), of those that vary."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    power = (b * b).sum(axis=0)
    return np.asarray((a * b).sum(axis=0)[power > 0] / power[power > 0])


def _is_second_derivative(q: Array, block: Array) -> bool:
    """Whether a block is d²q/dt² in one unit for all joints; torques have inertias of their own."""
    twice = _derivative(_derivative(q))
    inside = _averaged(_averaged(block))[2:-2]
    slopes = _slopes(twice, inside)
    if not slopes.size or _correlation(twice, inside) < NOISY:
        return False
    return bool((np.abs(slopes / np.median(slopes) - 1.0) < ALIKE).all())


def _correlation(a: Array, b: Array) -> float:
    """Correlation of two blocks, median over the joints in which both vary."""
    values = _correlations(a, b)
    return float(np.median(values)) if values.size else 0.0


def _correlations(a: Array, b: Array) -> Array:
    """Correlation of two blocks in each joint in which both vary."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    size = np.linalg.norm(a, axis=0) * np.linalg.norm(b, axis=0)
    varies = size > 0
    return np.asarray((a * b).sum(axis=0)[varies] / size[varies])


def _roughness(block: Array, quantile: float = 0.5) -> float:
    """RMS of second differences over the standard deviation, median or quantile over the joints."""
    deviation = block.std(axis=0)
    varies = deviation > 0
    second = np.diff(block[:, varies], n=2, axis=0)
    ratio = np.sqrt(np.mean(second**2, axis=0)) / deviation[varies]
    return float(np.quantile(ratio, quantile)) if varies.any() else np.inf


@dataclass(frozen=True, slots=True)
class Meaning:
    """Signal, joint and unit that a name stands for."""

    kind: str  # kind of signal; "" where the name has no known word
    joint: int  # number as written; −1 for none
    is_measured: bool  # False where a word stands for a command or a model
    unit: str  # unit as written; "" for none


def meaning(title: str) -> Meaning:
    """Read one title; its words are separated by case, digits and punctuation."""
    title = title.replace("%", " pct ").replace("‰", " permille ")
    # mA and mNm are one word, the A of an axis A1 is none.
    whole = re.sub(r"(?<![a-zA-Z])m(A|Nm)(?![a-z])", lambda unit: unit[0].lower(), title)
    whole = re.sub(r"(?<![a-zA-Z])[aA](?=\d)", "", whole)
    spaced = re.sub(r"([a-z])([A-Z])|([A-Z])([A-Z][a-z])", r"\1\3 \2\4", whole)
    words = [w for w in re.split(r"[^a-zA-Zµ]+", spaced.lower()) if w]
    digits = re.findall(r"\d{1,9}(?!\d)", title)
    of_joints = [] if OF_TIP & set(words) else KINDS.items()
    kind = next((k for k, known in of_joints if set(words) & set(known)), "")
    if of_joints and not kind and (stated := re.search(r"[\[(]\s*([^\])]+?)\s*[\])]", title)):
        kind = KIND_OF_UNIT.get(re.sub(r"[\s.*·⋅]", "", stated[1].lower()), "")
    units = UNIT_WORDS.get(kind, {})
    bracket = re.search(r"[\[(]\s*([a-zA-Zµ.*·⋅]+)", title)
    candidates = [re.sub(r"[.*·⋅]", "", bracket[1].lower())] if bracket else words[1:]
    unit = next((units[word] for word in candidates if word in units), "")
    joint = int(digits[-1]) if digits else -1
    return Meaning(kind=kind, joint=joint, is_measured=not (set(words) & COMMANDED), unit=unit)


def by_joint(titles: list[str], names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Titles that contain the names of the joints, such as `arm_1_joint_effort`."""
    groups: dict[str, dict[str, str]] = {}
    longest_first = sorted(names, key=len, reverse=True)
    for title in titles:
        name = next((each for each in longest_first if each in title), None)
        if name is not None:
            groups.setdefault(title.replace(name, "#"), {})[name] = title
    return {
        stem: tuple(members[name] for name in names)
        for stem, members in groups.items()
        if len(members) == len(names)
    }
