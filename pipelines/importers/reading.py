"""Choose the columns of a recording that are its clock, positions, velocities and torques.

Names decide first (`column_groups`); columns without a clear name are distinguished by evidence: a
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
from pipelines.importers.clock import Clock, find_clock
from pipelines.importers.column_groups import (
    Choice,
    Group,
    by_texts,
    choose,
    file_quantity,
    groups_of,
    of_torques,
    tables_beside,
    texts_of,
)
from pipelines.importers.column_names import WORDS, words_of
from pipelines.importers.evidence import Slope, crossed, slope_of
from pipelines.importers.raw import RawTable
from pipelines.io.experiment import Array
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot

__all__ = ["BY_FILE", "WITHOUT_NAME", "Arm", "Reading", "arm_beside", "files_beside", "matrix",
           "read_recording", "with_companion"]  # fmt: skip

WITHOUT_NAME, BY_FILE = "columns without a name", "columns named by their file"
_PLANS = frozenset({"plan", "planned", "reference", "ref", "desired", "setpoint", "setpoints",
                    "target", "targets"})  # fmt: skip
_FEEDFORWARD, _FEEDBACK = frozenset({"ff", "feedforward"}), frozenset({"fb", "feedback"})
_FILE_OF_AXIS = re.compile(
    r"(.*(?:joint|axis|axe|achse|motor|mot|id|actuator|servo|drive|node|j|m|a)[ _-]?)(\d+)(\D*)",
    re.IGNORECASE,
)
# Messages by fields that others have not, whose definition says rad, rad/s and N m: ROS
# sensor_msgs/JointState, libfranka's RobotState, Universal Robots' RTDE outputs, MuJoCo's mjData.
_MESSAGES = (
    ("sensor_msgs/JointState", {"joint_states", "position"}),
    ("sensor_msgs/JointState", {"field", "position", "effort"}),
    ("sensor_msgs/JointState", {"header", "position", "effort"}),
    ("libfranka's RobotState", {"q", "tau_J"}),
    ("libfranka's RobotState", {"q", "tau_ext_hat_filtered"}),
    ("Universal Robots' RTDE", {"actual_q", "actual_current"}),
    ("mjData", {"qpos", "qfrc_actuator"}),
)
_MOST_JOINTS = 16
_UNIT_NORM = 1e-3  # error of a quaternion's norm, written with four digits or more
_MOST_BLOCKS = 6


@dataclass(frozen=True)
class Arm:
    """The robot in the folder of a recording: its file, and what could be read of it."""

    files: tuple[str, ...] = ()  # several: which one is open
    robot: RobotDescription | None = None
    problem: str = ""  # why it could not be read
    named: bool = False  # by the user

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.robot.joints) if self.robot else ()

    @property
    def n(self) -> int | None:
        return self.robot.n_joints if self.robot else None


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
    by_evidence: bool  # the columns have no telling names
    beside: tuple[str, ...] = ()  # files with as many columns and rows, where this has one signal

    @property
    def joints(self) -> int:
        groups = [choice.group for choice in (self.q, self.tau) if choice.group]
        return self.arm.n or (len(groups[0].columns) if groups else 1)

    @property
    def message(self) -> str:
        """Return the message that the columns are fields of, which defines units in SI; else ""."""
        columns = (*self.table.columns, *self.table.text, *self.table.labels)
        parts = (part for name in columns for part in re.split("[./]", name))
        paths = {(re.match(r"(?s:.*)[^\W\d_]", part) or [""])[0] for part in parts}
        return next((message for message, fields in _MESSAGES if fields <= paths), "")

    @property
    def sisters(self) -> tuple[str, ...]:
        """Return the files of the folder with this name but another number: one file a joint."""
        named = _FILE_OF_AXIS.fullmatch(self.path.stem)
        if named is None:
            return ()
        pattern = re.compile(rf"{re.escape(named[1])}\d+{re.escape(named[3])}")
        files = sorted(self.path.parent.glob(f"*{self.path.suffix}"))[:200]
        others = (file for file in files if file != self.path)
        return tuple(file.name for file in others if pattern.fullmatch(file.stem))


def arm_beside(folder: Path, named: str | None = None) -> Arm:
    """Return the robot in the folder: its only URDF, or the only TOML file that describes one."""
    if named is not None:
        return Arm((named,), load_robot(named), named=True)
    files = sorted(folder.glob("*.urdf"))[:9]
    descriptions = []
    for path in [] if files else sorted(folder.glob("*.toml"))[:9]:
        try:
            descriptions.append((path.name, load_robot(path)))
        except RrridError:
            continue  # a recipe, or another file of TOML
    if len(descriptions) == 1:
        return Arm((descriptions[0][0],), descriptions[0][1])
    if len(files) != 1:
        return Arm(tuple(path.name for path in files) + tuple(name for name, _ in descriptions))
    try:
        return Arm((files[0].name,), load_robot(files[0]))
    except RrridError as problem:
        return Arm((files[0].name,), None, f"{problem.message}. {problem.remedy}")


def matrix(table: RawTable, columns: Sequence[str]) -> Array:
    """Return (samples, columns)."""
    return np.column_stack([table.columns[column] for column in columns])


def read_recording(path: Path, table: RawTable, arm: Arm) -> Reading:
    """Choose the columns of `table`."""
    groups, clock = _groups_and_clock(path, table, arm)
    t, n = clock.values if clock else None, arm.n
    q = choose(groups, ("position",), n, commanded=False)
    if q.group is None and all(group.origin == "commanded" for group in q.others):
        q = _unnamed_positions(table, groups, n, q)
    q = _undisputed(table, q)
    n = n or (len(q.group.columns) if q.group else None)
    tau = _torque(table, groups, q, n)
    dq = choose(groups, ("velocity",), n, commanded=False)
    by_evidence = False
    if q.group is None and not q.others:
        found = _blocks(table, groups, t, arm, tau)
        by_evidence = found is not None
        q, dq, tau = found or (q, dq, tau)
    slope = None
    if q.group and dq.group:
        x, speed = matrix(table, q.group.columns), matrix(table, dq.group.columns)
        slope = slope_of(x, speed, t)
        others = [g for g in q.others if g.origin != "commanded"]
        others = [g for g in others if len(g.columns) == speed.shape[1]]
        if slope is None and any(slope_of(matrix(table, g.columns), speed, t) for g in others):
            q = _left_open(q)  # the velocity is another position's
        elif slope is None and dq.group.columns and crossed(x, speed, t):
            q, dq = _left_open(q), _left_open(dq)  # in two orders of the joints
    if q.group and tau.group and q.group.order != tau.group.order:
        # Of positions in the robot's order, that of the torques cannot be known, or the reverse.
        tau = _left_open(tau) if "robot" in (q.group.order, tau.group.order) else tau
    return Reading(path, table, arm, clock, q, dq, tau, table, slope, by_evidence)


def _left_open(choice: Choice) -> Choice:
    return Choice(None, (*((choice.group,) if choice.group else ()), *choice.others))


def _groups_and_clock(path: Path, table: RawTable, arm: Arm) -> tuple[list[Group], Clock | None]:
    """Return the groups that may be signals, and the clock."""
    slides = arm.robot is not None and not all(arm.robot.revolute)
    groups = _with_file_name(groups_of(table, arm.names, slides), path)
    clock = find_clock(table, groups)
    used = clock.columns if clock else ()
    rest = [tuple(c for c in g.columns if c not in used) for g in groups]
    groups = [replace(g, columns=c) for g, c in zip(groups, rest, strict=True) if c]
    groups = [_without_rest(table, g, arm.n) for g in groups if not _is_orientation(table, g)]
    notes = table.notes if arm.n is None else ()
    listed = [re.findall(r"[\w./:-]+", note.partition(" = ")[2]) for note in notes]
    groups = [_without_gripper(group, listed) for group in groups]
    groups = [g for g in groups if g.quantity != "position" or _moves(table, g)]
    return _derivatives(table, _parts_and_plans(groups, path, used), clock), clock


def _moves(table: RawTable, group: Group) -> bool:
    return bool(np.ptp(matrix(table, group.columns), axis=0).any())


def _torque(table: RawTable, groups: Sequence[Group], q: Choice, n: int | None) -> Choice:
    tau = choose(groups, ("torque", "current"), n, commanded=True)
    if q.group and tau.group:
        x, y = matrix(table, tau.group.columns), matrix(table, q.group.columns)
        # Equal but for a delay are positions and their targets by any name: tq_0, tq_1, …
        if x.shape == y.shape and (np.std(x - y, axis=0) < 0.2 * np.std(y, axis=0)).all():
            tau = Choice(None, tau.others)
    unnamed = [g for g in groups if not g.quantity and n in (None, len(g.columns))]
    unnamed = [g for g in unnamed if not (q.group and g.columns == q.group.columns)]
    commanded = tau.group is not None and tau.group.origin == "commanded"
    if unnamed and (commanded or (q.group and not tau.group)):
        # Columns that no word explains may be the measured torque.
        tau = Choice(None, (*_left_open(tau).others, *unnamed))
    return tau


def with_companion(reading: Reading, companion: RawTable | None) -> Reading:
    """Add the torques, or the positions, of a file with the same columns and rows."""
    if companion is None:
        return reading
    other = read_recording(reading.path.parent / companion.source, companion, reading.arm)
    if not reading.q.group and (other.q.group or of_torques(reading.path)):
        reading, other = other, reading
    return replace(reading, tau=other.tau, torque_table=other.table)


def files_beside(reading: Reading) -> tuple[RawTable | None, tuple[str, ...]]:
    """Return the companion of a file that lacks positions or torques; else what may be one.

    Names alone tell a companion; of a file with one signal, all others are named.
    """
    found = (reading.q, reading.tau)
    if found[0].group is not None and (found[1].group or found[1].others):
        return None, ()
    signals = {g.columns for c in found for g in (c.group, *c.others) if g is not None}
    tables = tables_beside(reading.path, reading.table, by_name=len(signals) > 1)
    first = next(tables, None)
    if first is None or of_torques(Path(first.source)) != of_torques(reading.path):
        return first, ()
    return None, tuple(table.source for table in (first, *tables))


def _with_file_name(groups: list[Group], path: Path) -> list[Group]:
    """Give the only group without a quantity that of the file's name.

    A file named after torques or currents holds one of both; its name alone decides no unit.
    """
    unnamed = [g for g in groups if not g.quantity]
    quantity = file_quantity(path)
    named = quantity in {g.quantity for g in groups}
    if len(unnamed) != 1 or not quantity or named or not unnamed[0].names_joints:
        return groups
    known = "position" if quantity == "position" else "torque"
    with_name = replace(unnamed[0], quantity=known, words=BY_FILE)
    return [with_name if g is unnamed[0] else g for g in groups]


def _without_rest(table: RawTable, group: Group, n: int | None) -> Group:
    """Leave out constant columns behind those of the robot's joints: unused axes, an object."""
    first, rest = group.columns[:n], group.columns[n:] if n else ()
    rest_moves = any(np.ptp(table.columns[c]) > 0.0 for c in rest)
    first_moves = all(np.ptp(table.columns[c]) != 0.0 for c in first)
    return replace(group, columns=first) if rest and not rest_moves and first_moves else group


def _without_gripper(group: Group, listed: Sequence[Sequence[str]]) -> Group:
    """Leave out the columns that as many different names, listed in the file, call a gripper's."""
    width = len(group.columns)
    names = next((words for words in listed if len(words) == len({*words}) == width), ())
    pairs = zip(group.columns, names, strict=False)
    gripper = tuple(c for c, name in pairs if re.search("grip|finger|jaw|claw", name.lower()))
    kept = tuple(column for column in group.columns if column not in gripper)
    return replace(group, columns=kept, gripper=gripper) if kept else group


def _parts_and_plans(groups: list[Group], path: Path, clock: Sequence[str]) -> list[Group]:
    """Mark the points of a plan, by its clock (ROS: time_from_start) or file, and torque parts."""
    planned = any({"from", "start"} <= set(words_of(column)) for column in clock)
    plan = _PLANS & set(words_of(path.stem)) and all(g.origin != "measured" for g in groups)
    if planned or plan:
        groups = [replace(g, origin="commanded") for g in groups]
    said = [set(g.words.split()) for g in groups]
    if not any(words & _FEEDFORWARD for words in said):
        return groups
    pairs = zip(groups, said, strict=True)
    parts = [g.quantity == "torque" and bool(words & _FEEDBACK) for g, words in pairs]
    return [replace(g, partial=g.partial or x) for g, x in zip(groups, parts, strict=True)]


def _derivatives(table: RawTable, groups: list[Group], clock: Clock | None) -> list[Group]:
    """Name by evidence: the slope of a position is its velocity, that of it an acceleration."""
    known = [g for g in groups if g.quantity in ("position", "")]
    known = sorted((g for g in known if len(g.columns) <= _MOST_JOINTS), key=lambda g: g.rank)
    values = {g: matrix(table, g.columns) for g in known[:_MOST_BLOCKS]}
    t = clock.values if clock else None
    source: dict[Group, Group] = {}  # derivative -> what it is the slope of
    for a, b in permutations(values, 2):
        if slope_of(values[a], values[b], t, every=True) is not None:
            source.setdefault(b, a)
    named = []
    for g in groups:
        if g in source:
            kept = WORDS["commanded"] & set(g.words.split())
            origin = g.origin if kept else source[g].origin
            kind = "acceleration" if source[g] in source else "velocity"
            g = replace(g, quantity=kind, origin=origin)
        named.append(g)
    return named


def _is_orientation(table: RawTable, group: Group) -> bool:
    """Return whether four columns are a unit quaternion by any name."""
    if len(group.columns) != 4:
        return False
    x = matrix(table, group.columns)
    return bool(np.ptp(x) > 0 and np.abs((x**2).sum(axis=1) - 1.0).max() < _UNIT_NORM)


def _undisputed(table: RawTable, q: Choice) -> Choice:
    """Leave positions open where other measured ones differ by a constant: from which zero?"""
    if q.group is None:
        return q
    x = matrix(table, q.group.columns)
    for other in q.others:
        if len(other.columns) != x.shape[1] or other.origin == "commanded":
            continue
        if other.motor != q.group.motor:
            continue
        y = matrix(table, other.columns)
        size, noise = np.std(x, axis=0), np.std(x - y, axis=0)
        offset = np.abs(np.median(x - y, axis=0))
        if noise.max() < 0.2 * size.max() and (offset > 5.0 * noise + 1e-3 * size).any():
            return _left_open(q)
    return q


def _unnamed_positions(
    table: RawTable, groups: Sequence[Group], n: int | None, found: Choice
) -> Choice:
    """Take columns that are called joints, and nothing else, for their positions.

    Torques, currents or velocities must be named as well, and a commanded position be followed.
    """
    named = [g for g in groups if not g.quantity and g.names_joints]
    named = [g for g in named if n in (None, len(g.columns))]
    width = len(named[0].columns) if named else 0
    further = [g for g in groups if g.quantity in ("torque", "current", "velocity")]
    if len(named) != 1 or not any(len(g.columns) == width for g in further):
        return Choice(None, (*found.others, *named)) if found.others else found
    x = matrix(table, named[0].columns)
    references = [g for g in found.others if len(g.columns) == width]
    if not all(_same(matrix(table, g.columns), x) for g in references):
        return Choice(None, (*found.others, *named))
    return Choice(replace(named[0], quantity="position"), found.others)


def _blocks(
    table: RawTable, groups: Sequence[Group], t: Array | None, arm: Arm, tau: Choice
) -> tuple[Choice, Choice, Choice] | None:
    """Return positions, velocities and torques among columns without names: dq is the slope of q.

    None where no column lacks a name. The unit of a torque found so is open: no name says it.
    """
    unnamed = {column for group in groups if not group.quantity for column in group.columns}
    counters = {c for c in unnamed if (np.diff(table.columns[c]) == 1.0).all()}
    columns = [c for c in table.columns if c in unnamed - counters]
    if not columns:
        return None
    open_blocks = [columns]
    for blocks in _splits(columns, arm.n):
        pairs = _pairs(table, blocks, t)
        if len(pairs) != 1:
            open_blocks = blocks if pairs or arm.robot else open_blocks
            if pairs:
                break  # two positions with one velocity: measured and reference look alike
            continue
        q, dq = (_block(table, arm, blocks[k]) for k in pairs[0])
        q, dq = replace(q, quantity="position"), replace(dq, quantity="velocity")
        rest = _neither(table, blocks, pairs[0], t)
        others = tuple(replace(_block(table, arm, b), quantity="torque") for b in rest)
        if not tau.group and not tau.others:
            tau = Choice(others[0]) if len(others) == 1 else Choice(None, others)
        return Choice(q), Choice(dq), tau
    named = tuple(g for g in groups if not g.quantity and len(g.columns) == (arm.n or 0))
    candidates = named or tuple(_plain_group(part) for part in open_blocks)
    tau = tau if tau.group or tau.others else Choice(None, candidates)
    return Choice(None, candidates), Choice(None), tau


def _splits(columns: list[str], n: int | None) -> Iterator[list[list[str]]]:
    """Yield the columns in blocks of as many as joints, side by side or interleaved; few first."""
    for joints in (n,) if n else range(_MOST_JOINTS, 0, -1):
        k, rest = divmod(len(columns), joints)
        if rest or not 2 <= k <= _MOST_BLOCKS:
            continue
        yield [columns[b * joints : (b + 1) * joints] for b in range(k)]
        yield [columns[b::k] for b in range(k)]


def _pairs(table: RawTable, blocks: list[list[str]], t: Array | None) -> list[tuple[int, int]]:
    """Return (position, velocity) of blocks that are slopes; of q, dq and ddq the first two."""
    values = [matrix(table, block) for block in blocks]
    pairs = permutations(range(len(blocks)), 2)
    found = [(a, b) for a, b in pairs if slope_of(values[a], values[b], t, every=True)]
    derived = {b for _, b in found}
    return [(a, b) for a, b in found if a not in derived]


def _neither(
    table: RawTable, blocks: list[list[str]], pair: tuple[int, int], t: Array | None
) -> Iterator[list[str]]:
    """Yield the blocks that follow neither position nor velocity, and are no acceleration."""
    q, dq = (matrix(table, blocks[k]) for k in pair)
    for k, block in enumerate(blocks):
        x = matrix(table, block)
        alike = k in pair or _same(x, q) or _same(x, dq)
        if not alike and slope_of(dq, x, t) is None:
            yield block


def _same(x: Array, y: Array) -> bool:
    """Return whether one block follows the other: a reference and its measurement."""
    moving = [(a, b) for a, b in zip(x.T, y.T, strict=False) if np.ptp(a) > 0 and np.ptp(b) > 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = [float(np.corrcoef(a, b)[0, 1]) for a, b in moving]
    return bool(alike) and min(alike) > 0.99


def _block(table: RawTable, arm: Arm, columns: Sequence[str]) -> Group:
    group = _plain_group(columns)
    ordered, order = by_texts(group.columns, texts_of(table, arm.names), arm.names)
    return replace(group, columns=tuple(ordered), order=order or group.order)


def _plain_group(columns: Sequence[str]) -> Group:
    return Group("", "plain", False, False, False, tuple(columns), "file", WITHOUT_NAME)
