"""Choose the columns of a recording that are its clock, positions, velocities and torques.

Every group of columns is a hypothesis for a signal, with a score: its name, origin and order speak
for it, numbers against it. The best is taken where no other is as good. Columns without a clear
name are distinguished by numbers: a velocity is the slope of its position.
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
from pipelines.importers.columns import Group, by_texts, groups_of, listed_joints
from pipelines.importers.config import CHOICE, SCORES
from pipelines.importers.evidence import Slope, crossed, slope_of
from pipelines.importers.names import read_name, vocabulary, words_of
from pipelines.importers.raw import RawTable
from pipelines.importers.tables import read_table
from pipelines.io.limits import FEWEST, sentinels
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot

WITHOUT_NAME, BY_FILE = "columns without a name", "columns named by their file"
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


@dataclass(frozen=True)
class Choice:
    """The group taken for a signal, None where it stays open; and the other candidates."""

    group: Group | None
    others: tuple[Group, ...] = ()

    @property
    def opened(self) -> Choice:
        return Choice(None, (*((self.group,) if self.group else ()), *self.others))


@dataclass(frozen=True, eq=False)
class Reading:
    """The columns of a recording by signal, as far as names and numbers decide."""

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
        return len(self.arm.names) or (len(groups[0].columns) if groups else 1)

    @property
    def message(self) -> str:
        """Return the message that the columns are fields of, which defines units in SI; else ""."""
        columns = (*self.table.columns, *self.table.text, *self.table.labels)
        parts = (part for name in columns for part in re.split("[./]", name))
        paths = {(re.match(r"(?s:.*)[^\W\d_]", part) or [""])[0] for part in parts}
        return next((name for name, fields in vocabulary().messages if fields <= paths), "")


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
    reading = _reading(path, table, _arm_beside(path.parent, robot))
    q, tau = reading.q, reading.tau
    if q.group is not None and (tau.group or tau.others):
        return reading
    tables = _tables_beside(path, table)
    of_torques = _file_quantity(path) in ("torque", "current")
    for found in tables:
        if (_file_quantity(Path(found.source)) in ("torque", "current")) != of_torques:
            other = _reading(path.parent / found.source, found, reading.arm)
            if not np.array_equal(other.table.rows, reading.table.rows):
                return reading
            if not q.group and (other.q.group or of_torques):
                reading, other = other, reading
            return replace(reading, tau=other.tau, torque_table=other.table)
    signals = {g.columns for c in (q, tau) for g in (c.group, *c.others) if g is not None}
    beside = tuple(other.source for other in tables) if len(signals) <= 1 else ()
    return replace(reading, beside=beside)


def _arm_beside(folder: Path, named: str | None) -> Arm:
    """Return the robot in the folder: its only URDF, or the only TOML file that describes one."""
    if named is not None:
        return Arm((named,), load_robot(named), named=True)
    urdf = sorted(folder.glob("*.urdf"))[: CHOICE.most_robots]
    found = []
    for path in urdf if len(urdf) == 1 else sorted(folder.glob("*.toml")) * (not urdf):
        try:
            found.append(Arm((path.name,), load_robot(path)))
        except RrridError as problem:  # of TOML, a recipe or another file
            if urdf:
                return Arm((path.name,), None, f"{problem.message}. {problem.remedy}")
    if len(found) == 1:
        return found[0]
    return Arm((*(path.name for path in urdf), *(arm.files[0] for arm in found)))


def _file_quantity(path: Path) -> str:
    """Return the quantity that the file's name says: "position" of pos_data.csv."""
    found = read_name(path.stem).quantity
    return found if found in ("position", "torque", "current") else ""


def _tables_beside(path: Path, table: RawTable) -> list[RawTable]:
    """Return the files of the folder with the same columns and rows, as a rule of other signals.

    Another number makes no other signal: run_2.csv beside run_1.csv.
    """
    stem, found = re.sub(r"\d+", "#", path.stem), list[RawTable]()
    near = sorted(path.parent.glob(f"*{path.suffix}"))[: CHOICE.most_files]
    for other in [x for x in near if x.is_file() and re.sub(r"\d+", "#", x.stem) != stem]:
        if len(found) < CHOICE.most_beside and other.stat().st_size <= CHOICE.largest_beside:
            try:
                candidate = read_table(other)
            except InputRejected:
                continue  # another file of the folder
            same = list(candidate.columns) == list(table.columns)
            found += [candidate] if same and candidate.rows.size == table.rows.size else []
    return sorted(found, key=lambda x: _file_quantity(Path(x.source)) != "position")


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
    if len(columns) <= 1:
        return table, 0
    x = np.column_stack(list(columns.values()))
    lost = (x == 0.0).all(axis=1)
    steps, sound = np.abs(np.diff(x, axis=0)), ~lost[:-1] & ~lost[1:]
    into, out = steps[~lost[:-1] & lost[1:]], steps[lost[:-1] & ~lost[1:]]
    if min(len(into), len(out)) == 0 or lost.mean() > 1.0 - CHOICE.usable:
        return table, 0
    jumps = np.minimum(*(np.median(np.nan_to_num(part), axis=0) for part in (into, out)))
    if not (jumps > CHOICE.far_off * np.nan_to_num(steps[sound]).max(axis=0)).any():
        return table, 0
    holes = {name: np.where(lost, np.nan, table.columns[name]) for name in columns}
    return replace(table, columns={**table.columns, **holes}), int(lost.sum())


def _sound_samples(table: RawTable) -> tuple[RawTable, tuple[float, ...]]:
    """Return the rows without a hole, an absurd or a filler number, and columns of mostly numbers.

    The fillers come with it: numbers that mark lost samples.
    """
    names, lost, usable = [*table.columns], set[float](), {}
    for name in names:
        values = table.columns[name]
        filler = sentinels(values[:, None])[:, 0]
        filler &= filler.mean() < 1.0 - CHOICE.usable
        lost |= set(values[filler].tolist())
        usable[name] = np.isfinite(values) & (np.abs(values) < CHOICE.no_number) & ~filler
    # A table of several topics leaves cells of the others empty: the rows of most columns count.
    masks = Counter(known.tobytes() for known in usable.values() if known.any())
    topic = np.frombuffer(masks.most_common(1)[0][0] if masks else b"", dtype=np.bool_)
    names = [name for name in names if usable[name][topic].mean() > CHOICE.usable]
    keep = np.all([usable[name][topic] for name in names], axis=0) & bool(names)
    if keep.sum() < FEWEST:
        message, remedy = f"{keep.sum()} samples without a hole", "give a recording of a motion"
        raise InputRejected("T08", message, where=table.source, remedy=remedy)
    rows = np.flatnonzero(topic)[keep]
    lines = None if table.lines is None else table.lines[rows]
    columns = {name: table.columns[name][rows] for name in names}
    return replace(table, columns=columns, rows=table.rows[rows], lines=lines), tuple(sorted(lost))


def _reading(path: Path, raw: RawTable, arm: Arm) -> Reading:
    """Choose the columns of a table."""
    whole, zeros = _without_lost_rows(raw)
    lost_rows = f"{zeros} of {raw.rows.size} rows" if zeros else ""
    table, lost = _sound_samples(whole)
    groups, clock = _groups_and_clock(path, table, arm)
    t, n = clock.values if clock else None, len(arm.names) or None
    q = _undisputed(table, _best(_positions(table, groups, n)))
    n = n or (len(q.group.columns) if q.group else None)
    tau = _best(_torques(table, groups, q, n))
    dq = _best([(_score(g, n), g) for g in groups if g.quantity == "velocity"])
    slope, by_evidence = None, False
    if q.group is None and not q.others:
        found = _blocks(table, groups, t, arm, tau)
        by_evidence = found is not None
        q, dq, tau = found or (q, dq, tau)
    if q.group and dq.group:
        x, speed = matrix(table, q.group.columns), matrix(table, dq.group.columns)
        slope = slope_of(x, speed, t)
        others = (g for g in q.others if g.origin != "commanded" and g.quantity)
        if slope is None and any(slope_of(matrix(table, g.columns), speed, t) for g in others):
            q = q.opened  # the velocity is another position's
        elif slope is None and crossed(x, speed, t):
            q, dq = q.opened, dq.opened  # in two orders of the joints
    if q.group and tau.group and "robot" in {q.group.order, tau.group.order}:
        # Of positions in the robot's order, that of the torques cannot be known, or the reverse.
        tau = tau if q.group.order == tau.group.order else tau.opened
    return Reading(path, table, arm, clock, q, dq, tau, table, slope, by_evidence,
                   lost=lost, lost_rows=lost_rows)  # fmt: skip


def _best(hypotheses: Sequence[tuple[float, Group]]) -> Choice:
    """Return the hypothesis of the best score, open where another is as good or none is good."""
    ranked = sorted(hypotheses, key=lambda pair: -pair[0])
    groups = tuple(group for _, group in ranked)
    tied = ranked[1:] and ranked[0][0] == ranked[1][0]
    if not ranked or ranked[0][0] <= 0.0 or tied or not groups[0].quantity:
        return Choice(None, groups)
    return Choice(groups[0], tuple(group for group in groups[1:] if group.quantity))


def _score(group: Group, n: int | None, commanded: float = SCORES.refuted) -> float:
    """Return the score by name, origin and order of a group; `n` joints, if that is known.

    Measured comes before plain before commanded, the robot's order before any other, the joint's
    side before the motor's, raw before filtered.
    """
    score = SCORES.named + SCORES.in_order * (group.order == "robot")
    score += {"measured": SCORES.measured, "plain": 0.0, "commanded": -commanded}[group.origin]
    score -= SCORES.of_motor * group.motor + SCORES.filtered * group.filtered
    fits = not group.partial and n in (None, len(group.columns))
    return score if fits else score - SCORES.refuted


def _positions(
    table: RawTable, groups: Sequence[Group], n: int | None
) -> list[tuple[float, Group]]:
    """Return the hypotheses for positions; a commanded one will not do.

    Columns that are called joints, and nothing else, will where torques, currents or velocities are
    named as well, and a commanded position is followed.
    """
    found = [(_score(g, n), g) for g in groups if g.quantity == "position"]
    if any(g.origin != "commanded" for _, g in found):
        return found
    for group in [g for g in groups if not g.quantity and g.names_joints]:
        width = len(group.columns)
        further = [g for g in groups if g.quantity in ("torque", "current", "velocity")]
        known = n in (None, width) and any(len(g.columns) == width for g in further)
        x = matrix(table, group.columns)
        references = [matrix(table, g.columns) for _, g in found if len(g.columns) == width]
        if known and all(_same(reference, x) for reference in references):
            found.append((SCORES.unnamed, replace(group, quantity="position")))
        elif found and n in (None, width):
            found.append((0.0, group))
    return found


def _torques(
    table: RawTable, groups: Sequence[Group], q: Choice, n: int | None
) -> list[tuple[float, Group]]:
    """Return the hypotheses for torques, or currents; a commanded one will do.

    Columns that no word explains may be the measured torque: they leave it open beside a command.
    """
    found: list[tuple[float, Group]] = []
    y = matrix(table, q.group.columns) if q.group else np.zeros((0, 0))
    for group in [g for g in groups if g.quantity in ("torque", "current")]:
        x = matrix(table, group.columns)
        # Equal but for a delay are positions and their targets by any name: tq_0, tq_1, …
        target = x.shape == y.shape
        target = target and bool((np.std(x - y, 0) < CHOICE.follows * np.std(y, 0)).all())
        score = _score(group, n, SCORES.command) - SCORES.current * (group.quantity == "current")
        found += [] if target else [(score, group)]
    plain = [g for g in groups if not g.quantity and n in (None, len(g.columns))]
    taken = q.group.columns if q.group else ()
    plain = [g for g in plain if g.columns != taken] if q.group or found else []
    return found + [(SCORES.unnamed, group) for group in plain]


def _groups_and_clock(path: Path, table: RawTable, arm: Arm) -> tuple[list[Group], Clock | None]:
    """Return the groups that may be signals, and the clock."""
    n, slides = len(arm.names), arm.robot is not None and not all(arm.robot.revolute)
    every = groups_of(table, arm.names, slides)
    # A file named after torques or currents holds one of both; its name alone decides no unit.
    quantity, unnamed = _file_quantity(path), [g for g in every if not g.quantity]
    alone = len(unnamed) == 1 and unnamed[0].names_joints
    if quantity and alone and quantity not in {g.quantity for g in every}:
        known = "position" if quantity == "position" else "torque"
        by_file = replace(unnamed[0], quantity=known, words=BY_FILE)
        every = [by_file if g is unnamed[0] else g for g in every]
    clock = find_clock(table, every)
    used = clock.columns if clock else ()
    notes = table.notes if not n else ()
    listed = [re.findall(r"[\w./:-]+", note.partition(" = ")[2]) for note in notes]
    groups = []
    for group in every:
        columns = tuple(c for c in group.columns if c not in used)
        x = matrix(table, columns) if columns else np.zeros((1, 0))
        moves = np.ptp(x, axis=0) > 0.0
        norm = np.abs((x**2).sum(axis=1) - 1.0).max()
        quaternion = len(columns) == CHOICE.quaternion and norm < CHOICE.unit_norm and moves.any()
        if not columns or quaternion or (group.quantity == "position" and not moves.any()):
            continue
        if len(columns) > n > 0 and moves[:n].all() and not moves[n:].any():
            columns = columns[:n]  # and constant ones behind: unused axes, an object
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
    by_file = vocabulary().sentences["plan"] & set(words_of(path.stem))
    if planned or (by_file and all(g.origin != "measured" for g in groups)):
        groups = [replace(g, origin="commanded") for g in groups]
    said = [set(g.words.split()) for g in groups]
    if any(words & {"ff", "feedforward"} for words in said):
        parts = [g.quantity == "torque" for g in groups]
        parts = [
            x and bool(words & {"fb", "feedback"}) for x, words in zip(parts, said, strict=True)
        ]
        groups = [replace(g, partial=g.partial or x) for g, x in zip(groups, parts, strict=True)]
    return groups


def _derivatives(table: RawTable, groups: list[Group], clock: Clock | None) -> list[Group]:
    """Name by evidence: the slope of a position is its velocity, that of it an acceleration."""

    def by_name(group: Group) -> float:
        return -_score(group, len(group.columns), SCORES.command)

    known = [g for g in groups if g.quantity in ("position", "")]
    known = sorted((g for g in known if len(g.columns) <= CHOICE.most_joints), key=by_name)
    values = {g: matrix(table, g.columns) for g in known[: CHOICE.most_blocks]}
    t = clock.values if clock else None
    source: dict[Group, Group] = {}  # derivative -> what it is the slope of
    for a, b in permutations(values, 2):
        if slope_of(values[a], values[b], t, every=True) is not None:
            source.setdefault(b, a)
    named = []
    for g in groups:
        if g in source:
            kept = vocabulary().words["commanded"] & set(g.words.split())
            origin = g.origin if kept else source[g].origin
            kind = "acceleration" if source[g] in source else "velocity"
            g = replace(g, quantity=kind, origin=origin)
        named.append(g)
    return named


def _undisputed(table: RawTable, q: Choice) -> Choice:
    """Leave positions open where other measured ones differ by a constant: from which zero?"""
    x = matrix(table, q.group.columns) if q.group else np.zeros((0, 0))
    for other in q.others if q.group else ():
        apart = matrix(table, other.columns)
        rival = other.origin != "commanded" and q.group and other.motor == q.group.motor
        if not rival or apart.shape != x.shape:
            continue
        apart = x - apart
        size, noise = np.std(x, axis=0), np.std(apart, axis=0)
        offset = np.abs(np.median(apart, axis=0))
        near = noise.max() < CHOICE.follows * size.max()
        if near and (offset > CHOICE.offset * noise + CHOICE.rounding * size).any():
            return q.opened
    return q


def _blocks(
    table: RawTable, groups: Sequence[Group], t: Array | None, arm: Arm, tau: Choice
) -> tuple[Choice, Choice, Choice] | None:
    """Return positions, velocities and torques among columns without names: dq is the slope of q.

    None where no column lacks a name. The unit of a torque found so is open: no name says it.
    """
    unnamed = {column for group in groups if not group.quantity for column in group.columns}
    counters = {c for c in unnamed if (np.diff(table.columns[c]) == 1.0).all()}
    columns = [c for c in table.columns if c in unnamed - counters]
    texts = listed_joints(table, arm.names)

    def plain(block: Sequence[str], quantity: str = "") -> Group:
        ordered, order = by_texts(block, texts, arm.names) if quantity else (list(block), None)
        return Group(quantity, "plain", False, False, False, tuple(ordered), order or "file",
                     WITHOUT_NAME)  # fmt: skip

    if not columns:
        return None
    open_blocks = [columns]
    for blocks in _splits(columns, len(arm.names)):
        values = [matrix(table, block) for block in blocks]
        every = permutations(range(len(blocks)), 2)
        slopes = [(a, b) for a, b in every if slope_of(values[a], values[b], t, every=True)]
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
            if not (_same(x, values[a]) or _same(x, values[b]) or slope_of(values[b], x, t))
        )
        if not tau.group and not tau.others:
            tau = Choice(others[0]) if len(others) == 1 else Choice(None, others)
        return Choice(plain(blocks[a], "position")), Choice(plain(blocks[b], "velocity")), tau
    named = tuple(g for g in groups if not g.quantity and len(g.columns) == len(arm.names))
    candidates = named or tuple(plain(part) for part in open_blocks)
    tau = tau if tau.group or tau.others else Choice(None, candidates)
    return Choice(None, candidates), Choice(None), tau


def _splits(columns: list[str], n: int) -> Iterator[list[list[str]]]:
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
