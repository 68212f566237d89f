"""Choose the columns of a recording that are its clock, positions, velocities and torques.

Names decide first (`column_roles`); columns without a clear name are distinguished by evidence: a
velocity is the slope of its position. Where neither decides, nothing is chosen.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path

import numpy as np

from pipelines.errors import RrridError
from pipelines.log.experiment import Array
from pipelines.log.recording.clock_guess import Clock, find_clock
from pipelines.log.recording.column_groups import (
    Choice,
    Group,
    by_texts,
    choose,
    companion_of,
    file_quantity,
    groups_of,
    texts_of,
)
from pipelines.log.recording.column_names import WORDS, words_of
from pipelines.log.recording.evidence import Slope, crossed, slope_of
from pipelines.log.recording.raw import RawTable
from pipelines.log.robot import RobotDescription
from pipelines.log.robot_files import load_robot

__all__ = [
    "BY_FILE",
    "WITHOUT_NAME",
    "Arm",
    "Reading",
    "arm_beside",
    "companion_for",
    "matrix",
    "read_recording",
    "with_companion",
]

WITHOUT_NAME, BY_FILE = "columns without a name", "columns named by their file"
_PLANS = frozenset(
    {"plan", "planned", "reference", "ref", "desired", "setpoint", "setpoints", "target", "targets"}
)
_FEEDFORWARD, _FEEDBACK = frozenset({"ff", "feedforward"}), frozenset({"fb", "feedback"})
_FILE_OF_AXIS = re.compile(
    r"(.*(?:joint|axis|axe|achse|motor|mot|id|actuator|servo|drive|node|j|m|a)[ _-]?)(\d+)(\D*)",
    re.IGNORECASE,
)
_PATH = re.compile(r"[./]")
# Messages by fields that others have not, whose definition says rad, rad/s and N m: ROS sensor_msgs/JointState,
# libfranka's RobotState, Universal Robots' RTDE outputs, MuJoCo's mjData.
_MESSAGES = tuple(
    (message, frozenset(fields.split()))
    for message, fields in (
        ("sensor_msgs/JointState", "joint_states position"),
        ("sensor_msgs/JointState", "field position effort"),
        ("sensor_msgs/JointState", "header position effort"),
        ("libfranka's RobotState", "q tau_J"),
        ("libfranka's RobotState", "q tau_ext_hat_filtered"),
        ("Universal Robots' RTDE", "actual_q actual_current"),
        ("mjData", "qpos qfrc_actuator"),
    )
)
_MOST_JOINTS = 16
_UNIT_NORM = 1e-3  # error of a quaternion's norm, written with four digits or more
_MOST_BLOCKS = 6


@dataclass(frozen=True)
class Arm:
    """The robot beside a recording: its file, and what could be read of it."""

    files: tuple[str, ...] = ()  # several: which one is open
    robot: RobotDescription | None = None
    problem: str = ""  # why it could not be read
    named: bool = False  # by the user

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.robot.joints) if self.robot else ()


@dataclass(frozen=True, eq=False)
class Reading:
    """The columns of a recording by signal, as far as names and evidence decide."""

    path: Path
    table: RawTable
    arm: Arm
    clock: Clock | None
    q: Choice
    dq: Choice
    tau: Choice
    torque_table: RawTable  # the file that holds the torques
    slope: Slope | None  # of q against dq, per recorded unit of time
    by_evidence: bool  # the columns have no names that tell

    @property
    def joints(self) -> int:
        groups = [choice.group for choice in (self.q, self.tau) if choice.group]
        return (
            self.arm.robot.n_joints if self.arm.robot else len(groups[0].columns) if groups else 1
        )

    @property
    def message(self) -> str:
        """Return the message whose definition gives the unit of its fields, in SI, where the columns are those fields; else ""."""
        names = [
            word
            for name in (*self.table.columns, *self.table.text, *self.table.labels)
            for word in _PATH.split(name)
        ]
        paths = {re.sub(r"[\W\d_]+$", "", name) for name in names}
        return next((message for message, fields in _MESSAGES if fields <= paths), "")

    @property
    def sisters(self) -> tuple[str, ...]:
        """Return the files beside that are named like this one but for the number of an axis: one file a joint."""
        named = _FILE_OF_AXIS.fullmatch(self.path.stem)
        if named is None:
            return ()
        pattern = re.compile(rf"{re.escape(named[1])}\d+{re.escape(named[3])}")
        files = sorted(self.path.parent.glob(f"*{self.path.suffix}"))[:200]
        return tuple(
            file.name for file in files if file != self.path and pattern.fullmatch(file.stem)
        )


def arm_beside(folder: Path, named: str | None = None) -> Arm:
    """Return the robot in the folder: its only URDF, or the only TOML file that describes one."""
    if named is not None:
        return Arm((named,), load_robot(named), named=True)
    files = sorted(folder.glob("*.urdf"))[:9]
    descriptions = []
    for path in [] if files else sorted(folder.glob("*.toml"))[:9]:
        try:
            descriptions.append((path, load_robot(path)))
        except RrridError:
            continue  # a recipe, or another file of TOML
    if len(descriptions) == 1:
        return Arm((descriptions[0][0].name,), descriptions[0][1])
    if len(files) != 1:
        return Arm(tuple(path.name for path in (*files, *(path for path, _ in descriptions))))
    try:
        return Arm((files[0].name,), load_robot(files[0]))
    except RrridError as problem:
        return Arm((files[0].name,), None, f"{problem.message}. {problem.remedy}")


def matrix(table: RawTable, columns: Sequence[str]) -> Array:
    """Return (samples, columns)."""
    return np.column_stack([table.columns[column] for column in columns])


def read_recording(path: Path, table: RawTable, arm: Arm) -> Reading:
    """Choose the columns of `table`, and of a companion file where the torques are in another."""
    slides = arm.robot is not None and not all(arm.robot.revolute)
    groups = _with_file_name(groups_of(table, arm.names, slides), path)
    clock = find_clock(table, groups)
    used = clock.columns if clock else ()
    groups = [
        replace(g, columns=rest)
        for g in groups
        if (rest := tuple(c for c in g.columns if c not in used))
    ]
    n = arm.robot.n_joints if arm.robot else None
    groups = [_without_rest(table, g, n) for g in groups if not _is_orientation(table, g)]
    groups = [
        g
        for g in groups
        if g.quantity != "position" or np.ptp(matrix(table, g.columns), axis=0).any()
    ]
    groups = _derivatives(table, _parts_and_plans(groups, path, used), clock)
    q = choose(groups, ("position",), n, commanded=False)
    if q.group is None and all(group.origin == "commanded" for group in q.others):
        q = _unnamed_positions(table, groups, n, q)
    q = _undisputed(table, q)
    n = n or (len(q.group.columns) if q.group else None)
    unnamed = tuple(
        g
        for g in groups
        if not g.quantity
        and n in (None, len(g.columns))
        and not (q.group and g.columns == q.group.columns)
    )
    tau = choose(groups, ("torque", "current"), n, commanded=True)
    if (
        q.group
        and tau.group
        and _equal(matrix(table, tau.group.columns), matrix(table, q.group.columns))
    ):
        # Numbers that equal the positions are their targets by any name: tq_0, tq_1, …
        tau = Choice(None, tau.others)
    commanded = tau.group is not None and tau.group.origin == "commanded"
    if unnamed and (commanded or (q.group and not tau.group)):
        # Columns that no word explains may be the measured torque.
        tau = Choice(None, (*((tau.group,) if tau.group else ()), *tau.others, *unnamed))
    dq = choose(groups, ("velocity",), n, commanded=False)
    by_evidence = False
    if q.group is None and not q.others:
        found = _blocks(table, groups, clock, arm, tau)
        by_evidence = found is not None
        q, dq, tau = found or (q, dq, tau)
    slope = None
    if q.group and dq.group:
        t, speed = clock.values if clock else None, matrix(table, dq.group.columns)
        slope = slope_of(matrix(table, q.group.columns), speed, t)
        alternatives = [
            g for g in q.others if g.origin != "commanded" and len(g.columns) == speed.shape[1]
        ]
        if slope is None and any(
            slope_of(matrix(table, g.columns), speed, t) for g in alternatives
        ):
            q = Choice(None, (q.group, *q.others))  # the velocity is another position's
        elif (
            slope is None
            and q.group
            and dq.group.columns
            and crossed(matrix(table, q.group.columns), speed, t)
        ):
            q, dq = (
                Choice(None, (q.group, *q.others)),
                Choice(None, (dq.group, *dq.others)),
            )  # in two orders of the joints
    return Reading(path, table, arm, clock, q, dq, _in_one_order(q, tau), table, slope, by_evidence)


def with_companion(reading: Reading, companion: RawTable | None) -> Reading:
    """Add the torques, or the positions, of a file with the same columns and rows."""
    if companion is None:
        return reading
    other = read_recording(reading.path.parent / companion.source, companion, reading.arm)
    if other.q.group and not reading.q.group:
        reading, other = other, reading
    return replace(reading, tau=other.tau, torque_table=other.table)


def companion_for(reading: Reading) -> RawTable | None:
    """Return the companion file of a recording that lacks positions or torques."""
    lacking = reading.q.group is None or (reading.tau.group is None and not reading.tau.others)
    return companion_of(reading.path, reading.table) if lacking else None


def _with_file_name(groups: list[Group], path: Path) -> list[Group]:
    """Give groups without a quantity that of the file's name, where it is the only such group.

    A file named after torques or currents holds one of both; its name alone decides no unit.
    """
    unnamed = [g for g in groups if not g.quantity]
    named = {g.quantity for g in groups}
    quantity = file_quantity(path)
    if len(unnamed) != 1 or not quantity or quantity in named or not unnamed[0].names_joints:
        return groups
    known = "position" if quantity == "position" else "torque"
    return [replace(g, quantity=known, words=BY_FILE) if g is unnamed[0] else g for g in groups]


def _without_rest(table: RawTable, group: Group, n: int | None) -> Group:
    """Leave out columns behind those of the robot's joints that never change: unused axes, an object that rests."""
    first, rest = group.columns[:n], group.columns[n:] if n else ()
    if (
        not rest
        or any(np.ptp(table.columns[c]) > 0.0 for c in rest)
        or any(np.ptp(table.columns[c]) == 0.0 for c in first)
    ):
        return group
    return replace(group, columns=first)


def _parts_and_plans(groups: list[Group], path: Path, clock: Sequence[str]) -> list[Group]:
    """Tell the points of a plan, by its clock (ROS: time_from_start) or file, and the parts of a controller's torque."""
    planned = any({"from", "start"} <= set(words_of(column)) for column in clock)
    if planned or (
        _PLANS & set(words_of(path.stem)) and all(g.origin != "measured" for g in groups)
    ):
        groups = [replace(g, origin="commanded") for g in groups]
    said = [set(g.words.split()) for g in groups]
    if not any(words & _FEEDFORWARD for words in said):
        return groups
    return [
        replace(g, partial=g.partial or (g.quantity == "torque" and bool(words & _FEEDBACK)))
        for g, words in zip(groups, said, strict=True)
    ]


def _derivatives(table: RawTable, groups: list[Group], clock: Clock | None) -> list[Group]:
    """Name by evidence what names leave open: the slope of a position is its velocity, that of a velocity an acceleration."""
    known = [g for g in groups if g.quantity in ("position", "") and len(g.columns) <= _MOST_JOINTS]
    values = {
        g: matrix(table, g.columns) for g in sorted(known, key=lambda g: g.rank)[:_MOST_BLOCKS]
    }
    source: dict[Group, Group] = {}  # derivative -> what it is the slope of
    for a, b in permutations(values, 2):
        if slope_of(values[a], values[b], clock.values if clock else None, every=True) is not None:
            source.setdefault(b, a)
    named = {g: "acceleration" if a in source else "velocity" for g, a in source.items()}
    return [
        replace(
            g,
            quantity=named[g],
            origin=g.origin if WORDS["commanded"] & set(g.words.split()) else source[g].origin,
        )
        if g in named
        else g
        for g in groups
    ]


def _is_orientation(table: RawTable, group: Group) -> bool:
    """Tell whether four columns are a unit quaternion by any name: their squares add up to one."""
    if len(group.columns) != 4:
        return False
    x = matrix(table, group.columns)
    return bool(np.ptp(x) > 0 and np.abs((x**2).sum(axis=1) - 1.0).max() < _UNIT_NORM)


def _undisputed(table: RawTable, q: Choice) -> Choice:
    """Leave positions open beside others that are measured as well and differ by a constant: from which zero?"""
    if q.group is None:
        return q
    x = matrix(table, q.group.columns)
    for other in q.others:
        if (
            len(other.columns) != x.shape[1]
            or other.origin == "commanded"
            or other.motor != q.group.motor
        ):
            continue
        y = matrix(table, other.columns)
        offset, noise = np.abs(np.median(x - y, axis=0)), np.std(x - y, axis=0)
        if (
            noise.max() < 0.2 * np.std(x, axis=0).max()
            and (offset > 5.0 * noise + 1e-3 * np.std(x, axis=0)).any()
        ):
            return Choice(None, (q.group, *q.others))
    return q


def _unnamed_positions(
    table: RawTable, groups: Sequence[Group], n: int | None, found: Choice
) -> Choice:
    """Take columns that are called joints, and nothing else, for their positions.

    Torques, currents or velocities must be named as well, and a commanded position must be followed.
    """
    beside = [g for g in groups if g.quantity in ("torque", "current", "velocity")]
    named = [g for g in groups if not g.quantity and g.names_joints and n in (None, len(g.columns))]
    if len(named) != 1 or not any(len(g.columns) == len(named[0].columns) for g in beside):
        return found if not found.others else Choice(None, (*found.others, *named))
    references = [g for g in found.others if len(g.columns) == len(named[0].columns)]
    followed = [
        _same(matrix(table, g.columns), matrix(table, named[0].columns)) for g in references
    ]
    if references and not all(followed):
        return Choice(None, (*found.others, *named))
    return Choice(replace(named[0], quantity="position"), found.others)


def _in_one_order(q: Choice, tau: Choice) -> Choice:
    """Leave the torques open where positions are in the robot's order, and theirs cannot be known."""
    if (
        q.group
        and tau.group
        and "robot" in (q.group.order, tau.group.order)
        and q.group.order != tau.group.order
    ):
        return Choice(None, (tau.group, *tau.others))
    return tau


def _blocks(
    table: RawTable, groups: Sequence[Group], clock: Clock | None, arm: Arm, tau: Choice
) -> tuple[Choice, Choice, Choice] | None:
    """Return positions, velocities and torques among columns without names: dq is the slope of q.

    None where no column lacks a name. The unit of a torque found so is open: no name says it.
    """
    unnamed = {column for group in groups if not group.quantity for column in group.columns}
    columns = [c for c in table.columns if c in unnamed]
    columns = [c for c in columns if not (np.diff(table.columns[c]) == 1.0).all()]  # a counter
    if not columns:
        return None
    t = clock.values if clock else None
    open_blocks = [columns]
    for blocks in _splits(columns, arm.robot.n_joints if arm.robot else None):
        pairs = _pairs(table, blocks, t)
        if len(pairs) != 1:
            open_blocks = blocks if pairs or arm.robot else open_blocks
            if pairs:
                break  # two positions beside one velocity: measured and reference look alike
            continue
        q, dq = (
            _by_texts(_block(blocks[k], kind), table, arm)
            for k, kind in zip(pairs[0], ("position", "velocity"), strict=True)
        )
        others = [
            _by_texts(_block(block, "torque"), table, arm)
            for block in _neither(table, blocks, pairs[0], t)
        ]
        if not tau.group and not tau.others:
            tau = Choice(others[0]) if len(others) == 1 else Choice(None, tuple(others))
        return Choice(q), Choice(dq), tau
    named = tuple(
        g
        for g in groups
        if not g.quantity and len(g.columns) == (arm.robot.n_joints if arm.robot else 0)
    )
    candidates = named or tuple(_block(part, "") for part in open_blocks)
    return (
        Choice(None, candidates),
        Choice(None),
        tau if tau.group or tau.others else Choice(None, candidates),
    )


def _splits(columns: list[str], n: int | None) -> Iterator[list[list[str]]]:
    """Yield the columns in blocks of as many as there are joints, side by side or interleaved; few blocks first."""
    for joints in (n,) if n else range(_MOST_JOINTS, 0, -1):
        k, rest = divmod(len(columns), joints)
        if rest or not 2 <= k <= _MOST_BLOCKS:
            continue
        yield [columns[b * joints : (b + 1) * joints] for b in range(k)]
        yield [columns[b::k] for b in range(k)]


def _by_texts(group: Group, table: RawTable, arm: Arm) -> Group:
    columns, order = by_texts(group.columns, texts_of(table, arm.names), arm.names)
    return replace(group, columns=tuple(columns), order=order or group.order)


def _pairs(table: RawTable, blocks: list[list[str]], t: Array | None) -> list[tuple[int, int]]:
    """Return (position, velocity) of each block that is the slope of another; of q, dq and ddq only the first two."""
    values = [matrix(table, block) for block in blocks]
    found = [
        (a, b)
        for a in range(len(blocks))
        for b in range(len(blocks))
        if a != b and slope_of(values[a], values[b], t, every=True) is not None
    ]
    derived = {b for _, b in found}
    return [(a, b) for a, b in found if a not in derived]


def _neither(
    table: RawTable, blocks: list[list[str]], pair: tuple[int, int], t: Array | None
) -> list[list[str]]:
    """Return the blocks that follow neither the position nor the velocity, and are no acceleration."""
    q, dq = (matrix(table, blocks[k]) for k in pair)
    rest = [(block, matrix(table, block)) for k, block in enumerate(blocks) if k not in pair]
    return [
        block
        for block, x in rest
        if not _same(x, q) and not _same(x, dq) and slope_of(dq, x, t) is None
    ]


def _same(x: Array, y: Array) -> bool:
    """Tell whether one block follows the other: a reference and its measurement."""
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = [
            float(np.corrcoef(x[:, j], y[:, j])[0, 1])
            for j in range(x.shape[1])
            if np.ptp(x[:, j]) > 0 and np.ptp(y[:, j]) > 0
        ]
    return bool(alike) and min(alike) > 0.99


def _equal(x: Array, y: Array) -> bool:
    """Tell whether two blocks hold the same numbers, but for a delay: a torque never equals an angle."""
    return x.shape == y.shape and bool((np.std(x - y, axis=0) < 0.2 * np.std(y, axis=0)).all())


def _block(columns: Sequence[str], quantity: str) -> Group:
    return Group(quantity, "plain", False, False, False, tuple(columns), "file", WITHOUT_NAME)
