"""Choose the columns of a recording that are its clock, positions, velocities and torques.

Names decide first (`groups`); columns without a clear name are distinguished by evidence: a
velocity is the slope of its position. Where neither decides, nothing is chosen.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path

import numpy as np

from pipelines.errors import InputRejected, RrridError
from pipelines.importers.clock import Clock, find_clock
from pipelines.importers.config import CHOICE
from pipelines.importers.evidence import Slope, crossed, slope_of
from pipelines.importers.groups import Choice, Group, by_texts, choose, groups_of, texts_of
from pipelines.importers.names import messages, read_name, spoken, vocabulary, words_of
from pipelines.importers.raw import RawTable
from pipelines.importers.tables import read_table
from pipelines.io.limits import FEWEST
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot

WITHOUT_NAME, BY_FILE = "columns without a name", "columns named by their file"
_FILE_OF_AXIS = re.compile(
    r"(.*(?:joint|axis|axe|achse|motor|mot|id|actuator|servo|drive|node|j|m|a)[ _-]?)(\d+)(\D*)",
    re.IGNORECASE,
)
_MEASURED = ("position", "velocity", "acceleration", "torque", "current", "")


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
    lost: tuple[float, ...] = ()  # numbers that mark lost samples
    lost_rows: str = ""  # rows that do, in words

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
        return next((message for message, fields in messages() if fields <= paths), "")

    @property
    def sisters(self) -> tuple[str, ...]:
        """Return the files of the folder with this name but another number: one file a joint."""
        named = _FILE_OF_AXIS.fullmatch(self.path.stem)
        if named is None:
            return ()
        pattern = re.compile(rf"{re.escape(named[1])}\d+{re.escape(named[3])}")
        files = sorted(self.path.parent.glob(f"*{self.path.suffix}"))[: CHOICE.most_files]
        others = (file for file in files if file != self.path)
        return tuple(file.name for file in others if pattern.fullmatch(file.stem))


def matrix(table: RawTable, columns: Sequence[str]) -> Array:
    """Return (samples, columns)."""
    return np.column_stack([table.columns[column] for column in columns])


def read_recording(path: Path, robot: str | None = None) -> Reading:
    """Read a recording and its companion file, and choose their columns.

    A file with one signal has a companion of the same columns and rows: torques beside positions,
    where their names say so. Else all such files are named.

    Args:
        robot: description to use instead of that in the folder of the recording.

    Raises:
        InputRejected: the file cannot be read as a table of numbers.
    """
    table = read_table(path)
    if len(table.columns) > CHOICE.most_columns:
        message = f"{len(table.columns)} columns: too many to guess what each is"
        remedy = "export the joints' signals alone, or write the recipe"
        raise InputRejected("F16", message, where=path, remedy=remedy)
    table, count = _without_lost_rows(table)
    lost_rows = f"{count} of {table.rows.size} rows" if count else ""
    lost = _lost_numbers(table)
    table = _sound_samples(table, lost)
    reading = _reading(path, table, _arm_beside(path.parent, robot))
    reading = replace(reading, lost=lost, lost_rows=lost_rows)
    q, tau = reading.q, reading.tau
    if q.group is not None and (tau.group or tau.others):
        return reading
    signals = {g.columns for c in (q, tau) for g in (c.group, *c.others) if g is not None}
    tables = _tables_beside(path, table, by_name=len(signals) > 1)
    first = next(tables, None)
    if first is None:
        return reading
    if _of_torques(Path(first.source)) == _of_torques(path):
        return replace(reading, beside=tuple(other.source for other in (first, *tables)))
    other_table = _sound_samples(_without_lost_rows(first)[0], lost)
    if not np.array_equal(other_table.rows, table.rows):
        return reading
    other = _reading(path.parent / first.source, other_table, reading.arm)
    if not q.group and (other.q.group or _of_torques(path)):
        reading, other = replace(other, lost=lost, lost_rows=lost_rows), reading
    return replace(reading, tau=other.tau, torque_table=other.table)


def _arm_beside(folder: Path, named: str | None) -> Arm:
    """Return the robot in the folder: its only URDF, or the only TOML file that describes one."""
    if named is not None:
        return Arm((named,), load_robot(named), named=True)
    files = sorted(folder.glob("*.urdf"))[: CHOICE.most_robots]
    found = []
    for path in sorted(folder.glob("*.toml"))[: CHOICE.most_robots] if not files else []:
        try:
            found.append(Arm((path.name,), load_robot(path)))
        except RrridError:
            continue  # a recipe, or another file of TOML
    if len(found) == 1:
        return found[0]
    if len(files) != 1:
        return Arm(tuple(path.name for path in files) + tuple(arm.files[0] for arm in found))
    try:
        return Arm((files[0].name,), load_robot(files[0]))
    except RrridError as problem:
        return Arm((files[0].name,), None, f"{problem.message}. {problem.remedy}")


def _file_quantity(path: Path) -> str:
    """Return the quantity that the file's name says: "position" of pos_data.csv."""
    found = read_name(path.stem).quantity
    return found if found in ("position", "torque", "current") else ""


def _of_torques(path: Path) -> bool:
    return _file_quantity(path) in ("torque", "current")


def _tables_beside(path: Path, table: RawTable, by_name: bool) -> Iterator[RawTable]:
    """Yield the files of the folder with the same columns and rows, as a rule of other signals.

    Positions and torques by their names come first, and alone where `by_name`. Another number makes
    no other signal: run_2.csv beside run_1.csv.
    """
    stem = re.sub(r"\d+", "#", path.stem)
    found = [
        other
        for other in sorted(path.parent.glob("*"))[: CHOICE.most_files]
        if other.suffix.lower() == path.suffix.lower()
        and re.sub(r"\d+", "#", other.stem) != stem
        and other.is_file()
        and other.stat().st_size <= CHOICE.largest_beside
    ]
    found.sort(key=lambda other: _file_quantity(other) != "position")
    named = [other for other in found if _of_torques(other) != _of_torques(path)]
    rest = [] if by_name else [other for other in found if other not in named]
    for other in (*named, *rest[: CHOICE.most_beside]):
        try:
            candidate = read_table(other)
        except InputRejected:
            continue  # another file of the folder
        same = list(candidate.columns) == list(table.columns)
        if same and candidate.rows.size == table.rows.size:
            yield candidate


def _lost_numbers(table: RawTable) -> tuple[float, ...]:
    """Return whole numbers that mark lost samples: far off all other numbers of their column."""
    found: Counter[float] = Counter()
    for column in table.columns.values():
        values = column[np.isfinite(column) & (np.abs(column) < CHOICE.no_number)]
        for number in (float(values.min()), float(values.max())) if values.size else ():
            others = values[values != number]
            rare = others.size > CHOICE.usable * values.size
            if number in (0.0, np.inf) or number != round(number) or not rare:
                continue  # zero is also a joint at rest
            room, varied = float(np.ptp(others)), np.unique(others[: CHOICE.looked_at]).size
            off = min(abs(number - others.min()), abs(number - others.max()))
            if varied >= CHOICE.varied and off > CHOICE.far_off * room > 0.0:
                found[number] += values.size - others.size
    return tuple(sorted(number for number, cells in found.items() if cells > 1))


def _without_lost_rows(table: RawTable) -> tuple[RawTable, int]:
    """Make holes of rows in which all that was measured is zero, far from the rows around them.

    Far is a jump, into the zeros and out of them, beyond all other steps of some column.
    """
    columns = {}
    for name, column in table.columns.items():
        said, values = read_name(name), np.where(np.abs(column) < CHOICE.no_number, column, np.nan)
        varied = np.unique(values[: CHOICE.looked_at]).size >= CHOICE.varied
        measured = said.quantity in _MEASURED and said.origin != "commanded"
        if measured and varied and (np.diff(values) < 0).any():
            columns[name] = values
    x = np.column_stack(list(columns.values())) if columns else np.zeros((0, 0))
    lost = (x == 0.0).all(axis=1)
    starts = np.flatnonzero(~lost[:-1] & lost[1:])
    ends = np.flatnonzero(lost[:-1] & ~lost[1:])
    ends = ends[ends > starts[0]] if starts.size else starts
    if len(columns) <= 1 or not ends.size or lost.mean() > 1.0 - CHOICE.usable:
        return table, 0
    steps = np.abs(np.diff(x, axis=0))
    jumps = np.minimum(steps[starts[: ends.size]], steps[ends])
    usual = np.nan_to_num(steps[~lost[:-1] & ~lost[1:]]).max(axis=0)
    if not (np.median(np.nan_to_num(jumps), axis=0) > CHOICE.far_off * usual).any():
        return table, 0
    holes = {name: np.where(lost, np.nan, table.columns[name]) for name in columns}
    return replace(table, columns={**table.columns, **holes}), int(lost.sum())


def _sound_samples(table: RawTable, lost: Sequence[float]) -> RawTable:
    """Return the rows without a hole, an absurd or a lost number, and columns of mostly numbers."""
    usable = {
        name: np.isfinite(values) & (np.abs(values) < CHOICE.no_number) & ~np.isin(values, lost)
        for name, values in table.columns.items()
    }
    # A table of several topics leaves cells of the others empty: the rows of most columns count.
    masks = Counter(known.tobytes() for known in usable.values() if known.any())
    topic = np.frombuffer(masks.most_common(1)[0][0] if masks else b"", dtype=np.bool_)
    usable = {name: known[topic] for name, known in usable.items()}
    names = [name for name, known in usable.items() if known.mean() > CHOICE.usable]
    keep = np.all([usable[name] for name in names], axis=0) if names else np.zeros(0, dtype=bool)
    if keep.sum() < FEWEST:
        message = f"{int(keep.sum())} samples without a hole"
        remedy = "give a recording of a motion"
        raise InputRejected("T08", message, where=table.source, remedy=remedy)
    rows = np.flatnonzero(topic)[keep]
    lines = None if table.lines is None else table.lines[rows]
    columns = {name: table.columns[name][rows] for name in names}
    return replace(table, columns=columns, rows=table.rows[rows], lines=lines)


def _reading(path: Path, table: RawTable, arm: Arm) -> Reading:
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
            q = q.left_open  # the velocity is another position's
        elif slope is None and crossed(x, speed, t):
            q, dq = q.left_open, dq.left_open  # in two orders of the joints
    if q.group and tau.group and q.group.order != tau.group.order:
        # Of positions in the robot's order, that of the torques cannot be known, or the reverse.
        tau = tau.left_open if "robot" in (q.group.order, tau.group.order) else tau
    return Reading(path, table, arm, clock, q, dq, tau, table, slope, by_evidence)


def _groups_and_clock(path: Path, table: RawTable, arm: Arm) -> tuple[list[Group], Clock | None]:
    """Return the groups that may be signals, and the clock."""
    slides = arm.robot is not None and not all(arm.robot.revolute)
    every = groups_of(table, arm.names, slides)
    # A file named after torques or currents holds one of both; its name alone decides no unit.
    quantity, unnamed = _file_quantity(path), [g for g in every if not g.quantity]
    named = quantity in {g.quantity for g in every}
    if len(unnamed) == 1 and quantity and not named and unnamed[0].names_joints:
        known = "position" if quantity == "position" else "torque"
        by_file = replace(unnamed[0], quantity=known, words=BY_FILE)
        every = [by_file if g is unnamed[0] else g for g in every]
    clock = find_clock(table, every)
    used = clock.columns if clock else ()
    notes = table.notes if arm.n is None else ()
    listed = [re.findall(r"[\w./:-]+", note.partition(" = ")[2]) for note in notes]
    groups = []
    for group in every:
        columns = tuple(c for c in group.columns if c not in used)
        x = matrix(table, columns) if columns else np.zeros((1, 0))
        quaternion = len(columns) == CHOICE.quaternion and np.ptp(x) > 0
        if quaternion and np.abs((x**2).sum(axis=1) - 1.0).max() < CHOICE.unit_norm:
            continue
        if not columns or (group.quantity == "position" and not np.ptp(x, axis=0).any()):
            continue
        moves = np.ptp(x, axis=0) > 0.0
        if arm.n and len(columns) > arm.n and moves[: arm.n].all() and not moves[arm.n :].any():
            columns = columns[: arm.n]  # and constant ones behind: unused axes, an object
        groups.append(_without_gripper(replace(group, columns=columns), listed))
    return _derivatives(table, _parts_and_plans(groups, path, used), clock), clock


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
    plan = spoken("plan") & set(words_of(path.stem)) and all(g.origin != "measured" for g in groups)
    if planned or plan:
        groups = [replace(g, origin="commanded") for g in groups]
    said = [set(g.words.split()) for g in groups]
    if not any(words & {"ff", "feedforward"} for words in said):
        return groups
    pairs = zip(groups, said, strict=True)
    parts = [g.quantity == "torque" and bool(words & {"fb", "feedback"}) for g, words in pairs]
    return [replace(g, partial=g.partial or x) for g, x in zip(groups, parts, strict=True)]


def _derivatives(table: RawTable, groups: list[Group], clock: Clock | None) -> list[Group]:
    """Name by evidence: the slope of a position is its velocity, that of it an acceleration."""
    known = [g for g in groups if g.quantity in ("position", "")]
    known = sorted((g for g in known if len(g.columns) <= CHOICE.most_joints), key=lambda g: g.rank)
    values = {g: matrix(table, g.columns) for g in known[: CHOICE.most_blocks]}
    t = clock.values if clock else None
    source: dict[Group, Group] = {}  # derivative -> what it is the slope of
    for a, b in permutations(values, 2):
        if slope_of(values[a], values[b], t, every=True) is not None:
            source.setdefault(b, a)
    named = []
    for g in groups:
        if g in source:
            kept = vocabulary()["commanded"] & set(g.words.split())
            origin = g.origin if kept else source[g].origin
            kind = "acceleration" if source[g] in source else "velocity"
            g = replace(g, quantity=kind, origin=origin)
        named.append(g)
    return named


def _undisputed(table: RawTable, q: Choice) -> Choice:
    """Leave positions open where other measured ones differ by a constant: from which zero?"""
    if q.group is None:
        return q
    x = matrix(table, q.group.columns)
    for other in q.others:
        rival = other.origin != "commanded" and other.motor == q.group.motor
        if not rival or len(other.columns) != x.shape[1]:
            continue
        apart = x - matrix(table, other.columns)
        size, noise = np.std(x, axis=0), np.std(apart, axis=0)
        offset = np.abs(np.median(apart, axis=0))
        near = noise.max() < CHOICE.follows * size.max()
        if near and (offset > CHOICE.offset * noise + CHOICE.rounding * size).any():
            return q.left_open
    return q


def _torque(table: RawTable, groups: Sequence[Group], q: Choice, n: int | None) -> Choice:
    tau = choose(groups, ("torque", "current"), n, commanded=True)
    if q.group and tau.group:
        x, y = matrix(table, tau.group.columns), matrix(table, q.group.columns)
        # Equal but for a delay are positions and their targets by any name: tq_0, tq_1, …
        close = x.shape == y.shape and np.std(x - y, axis=0) < CHOICE.follows * np.std(y, axis=0)
        tau = Choice(None, tau.others) if np.all(close) else tau
    unnamed = [g for g in groups if not g.quantity and n in (None, len(g.columns))]
    unnamed = [g for g in unnamed if not (q.group and g.columns == q.group.columns)]
    commanded = tau.group is not None and tau.group.origin == "commanded"
    if unnamed and (commanded or (q.group and not tau.group)):
        # Columns that no word explains may be the measured torque.
        tau = Choice(None, (*tau.left_open.others, *unnamed))
    return tau


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
    texts = texts_of(table, arm.names)

    def plain(block: Sequence[str], quantity: str = "") -> Group:
        ordered, order = by_texts(block, texts, arm.names)
        names = tuple(ordered) if quantity else tuple(block)
        by_text = (quantity and order) or "file"
        return Group(quantity, "plain", False, False, False, names, by_text, WITHOUT_NAME)

    if not columns:
        return None
    open_blocks = [columns]
    for blocks in _splits(columns, arm.n):
        values = [matrix(table, block) for block in blocks]
        slopes = [
            (a, b)
            for a, b in permutations(range(len(blocks)), 2)
            if slope_of(values[a], values[b], t, every=True)
        ]
        derived = {b for _, b in slopes}
        pairs = [(a, b) for a, b in slopes if a not in derived]  # of q, dq and ddq the first two
        if len(pairs) != 1:
            open_blocks = blocks if pairs or arm.robot else open_blocks
            if pairs:
                break  # two positions with one velocity: measured and reference look alike
            continue
        (a, b) = pairs[0]
        # What follows neither position nor velocity, and is no acceleration:
        others = tuple(
            plain(block, "torque")
            for block, x in zip(blocks, values, strict=True)
            if not (_same(x, values[a]) or _same(x, values[b]))
            and slope_of(values[b], x, t) is None
        )
        if not tau.group and not tau.others:
            tau = Choice(others[0]) if len(others) == 1 else Choice(None, others)
        return Choice(plain(blocks[a], "position")), Choice(plain(blocks[b], "velocity")), tau
    named = tuple(g for g in groups if not g.quantity and len(g.columns) == (arm.n or 0))
    candidates = named or tuple(plain(part) for part in open_blocks)
    tau = tau if tau.group or tau.others else Choice(None, candidates)
    return Choice(None, candidates), Choice(None), tau


def _splits(columns: list[str], n: int | None) -> Iterator[list[list[str]]]:
    """Yield the columns in blocks of as many as joints, side by side or interleaved; few first."""
    for joints in (n,) if n else range(CHOICE.most_joints, 0, -1):
        k, rest = divmod(len(columns), joints)
        if not rest and 1 < k <= CHOICE.most_blocks:
            yield [columns[b * joints : (b + 1) * joints] for b in range(k)]
            yield [columns[b::k] for b in range(k)]


def _same(x: Array, y: Array) -> bool:
    """Return whether one block follows the other: a reference and its measurement."""
    moving = [(a, b) for a, b in zip(x.T, y.T, strict=False) if np.ptp(a) > 0 and np.ptp(b) > 0]
    alike = [float(np.corrcoef(a, b)[0, 1]) for a, b in moving]
    return bool(alike) and min(alike) > CHOICE.alike
