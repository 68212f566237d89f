"""Choose the columns of a recording that are its clock, positions, velocities and torques.

Columns of one quantity and of equal words are a group, one column a joint: in the robot's order
where they hold its joints' names, else by their numbers. What was measured comes before what is
only named; a signal with two candidates of one rank is left open. Columns without a telling name
are distinguished by one relation: a velocity is the slope of its position.
"""

from __future__ import annotations

import itertools
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.importers.config import GUESS
from pipelines.importers.names import (
    NOISE,
    ColumnName,
    quantity_of,
    read_name,
    unit_called,
    words_of,
)
from pipelines.importers.raw import RawTable
from pipelines.io.log import Array
from pipelines.io.units import UNITS

_QUANTITIES = {"q": ("position",), "dq": ("velocity",), "tau": ("torque", "current")}


@dataclass(frozen=True)
class Group:
    """Columns of one signal, one a joint from the base to the tip as far as that is known."""

    columns: tuple[str, ...]
    name: ColumnName
    units: tuple[str, ...]  # one a column, "" where neither header nor name says it
    order: str  # what it rests on: "the robot's names", "numbers", "words", "the file"

    @property
    def unit(self) -> str:
        """Return the unit of all columns; "" where one lacks it or they differ."""
        return self.units[0] if len(set(self.units)) == 1 else ""


@dataclass(frozen=True, eq=False)
class Clock:
    """Columns whose sum is the time, and the unit of each, "" where it is open."""

    columns: tuple[str, ...]
    units: tuple[str, ...]
    values: Array  # (samples,) in the unit of the only column, or [s] of two


@dataclass(frozen=True, eq=False)
class Roles:
    """The columns of a recording by signal, as far as names and numbers decide."""

    clock: Clock | None
    chosen: dict[str, Group] = field(default_factory=dict)  # q, dq, tau
    others: dict[str, tuple[Group, ...]] = field(default_factory=dict)  # further candidates
    slope: float | None = None  # recorded change of q over dq times recorded time


def matrix(table: RawTable, group: Group) -> Array:
    """Return (samples, joints)."""
    return np.column_stack([table.columns[column] for column in group.columns])


def choose(table: RawTable, joints: Sequence[str], planned: bool = False) -> Roles:
    """Return the columns of each signal.

    Args:
        joints: names of the robot's joints, empty where it is not known.
        planned: the file is named a plan: what its columns do not name measured is a command.

    Raises:
        InputRejected: T01, the only column of time runs backwards.
    """
    groups = _groups(table, joints)
    clock = _clock(table, groups)
    if planned or (clock and {"from", "start"} <= set(words_of(clock.columns[0]))):
        groups = [replace(g, name=replace(g.name, origin="commanded"))
                  if g.name.origin == "plain" else g for g in groups]  # fmt: skip
    sizes = [
        max((len(g.columns) for g in groups if g.name.quantity == wanted), default=0)
        for wanted in ("position", "torque", "current")
    ]
    n = len(joints) or next(filter(None, sizes), 1)
    roles = Roles(clock)
    for signal in _QUANTITIES:
        ranked = ((_rank(signal, g.name), g) for g in groups if len(g.columns) == n)
        found = sorted(((key, g) for key, g in ranked if key), key=lambda pair: pair[0])
        best = [g for key, g in found if key == found[0][0]]
        if len(best) == 1 and found[0][0][0] < GUESS.only_offered:
            roles.chosen[signal] = best[0]
        roles.others[signal] = tuple(g for _, g in found if roles.chosen.get(signal) is not g)
    if "q" not in roles.chosen and not roles.others["q"]:
        _by_slopes(table, groups, roles, n)
    if {"q", "dq"} <= roles.chosen.keys():
        q, dq = (matrix(table, roles.chosen[signal]) for signal in ("q", "dq"))
        roles = replace(roles, slope=slope_of(q, dq, clock.values if clock else None))
    return roles


def _rank(signal: str, name: ColumnName) -> tuple[int, int] | None:
    """Return how far a group is from a measurement of `signal`, and its unknown words.

    A torque comes before a current, and this before a command; parts of it are only offered.
    """
    if name.quantity not in _QUANTITIES[signal] or (name.partial and signal != "tau"):
        return None
    current = name.quantity == "current"
    place = {"measured": 0, "plain": 1, "commanded": 3}[name.origin]
    place = max(place, 2) if current else place + (name.motor and signal != "tau")
    commanded = name.origin == "commanded" and (signal != "tau" or current)
    return GUESS.only_offered if name.partial or commanded else place, len(name.unknown)


def _groups(table: RawTable, joints: Sequence[str]) -> list[Group]:
    """Return columns of one quantity and equal words together, in the order of the joints."""
    labels = [[word for word in words_of(name) if word not in NOISE] for name in joints]
    alike = defaultdict[tuple[object, ...], list[tuple[str, ColumnName, int]]](list)
    for column in table.columns:
        joint, rest = _joint_in(column, labels)
        name = read_name(rest, table.units.get(column, ""))
        kind = (name.quantity, name.origin, name.motor, name.partial, name.role)
        alike[*kind, joint < 0, name.unknown].append((column, name, joint))
    for key, members in [*alike.items()]:
        column, name, joint = members[0]
        if len(members) == 1 and joint < 0 and name.unknown and not name.numbers:
            # named after a joint that no robot explains, "waist": its words give no order
            alike[*key[:-1], "words"].append((column, name, joint))
            del alike[key]
    listed, groups = _listed_order(table, joints), []
    for key, members in alike.items():
        order = "words" if key[-1] == "words" and len(members) > 1 else "the file"
        numbers = zip(*(name.numbers for _, name, _ in members), strict=False)
        varying = [k for k, x in enumerate(numbers) if len(set(x)) == len(members) > 1]
        if members[0][2] >= 0:
            members, order = sorted(members, key=lambda member: member[2]), "the robot's names"
        elif listed and len(members) == len(listed):
            members = sorted(members, key=lambda m: m[1].numbers[varying[0]] if varying else 0)
            members, order = [members[k] for k in listed], "the robot's names"
        elif varying:
            members = sorted(members, key=lambda member: member[1].numbers[varying[0]])
            order = "numbers"
        columns, names, _ = zip(*members, strict=True)
        name = replace(names[0], unknown=()) if order == "words" else names[0]
        groups.append(Group(columns, name, tuple(each.unit for each in names), order))
    return groups


def _joint_in(column: str, labels: Sequence[list[str]]) -> tuple[int, str]:
    """Return which joint a column names (-1 none), and the words that are left of it."""
    words = words_of(column)
    size, start, joint = max(
        (
            (len(label), start, joint)
            for joint, label in enumerate(labels)
            if any(not word.isdecimal() and not read_name(word).role for word in label)
            for start in range(len(words) - len(label) + 1)
            if words[start : start + len(label)] == label
        ),
        default=(0, 0, -1),
    )
    if joint < 0:
        return joint, column
    left = words[:start] + words[start + size :]
    # Words as the column writes them, so that a unit such as Nm stays one.
    parts = [part for part in re.split(r"[\W_]+", column) if part and {*words_of(part)} <= {*left}]
    covered = {word for part in parts for word in words_of(part)}
    return joint, "_".join([*(word for word in left if word not in covered), *parts])


def _listed_order(table: RawTable, joints: Sequence[str]) -> list[int]:
    """Return the columns in the robot's order where texts of the file list its joints' names."""
    said = " ".join((*table.text.values(), *table.notes))
    found = [re.search(rf"(?<!\w){re.escape(joint)}(?!\w)", said) for joint in joints]
    places = [match.start() for match in found if match]
    complete = len(places) == len(joints) > 1
    return np.argsort(np.argsort(places)).tolist() if complete else []


def _clock(table: RawTable, groups: Sequence[Group]) -> Clock | None:
    """Return the clock: columns named a time, else the first without a name, else a counter."""
    of = {column: g.name for g in groups for column in g.columns}
    times = [c for c in table.columns if of[c].quantity == "time"]
    unit = {c: read_name(c, table.units.get(c, "")).unit or _unit_alone(c) for c in times}
    for whole, fraction in itertools.pairwise(times):
        small = UNITS[unit[fraction]].factor if unit[fraction] in UNITS else 1.0
        a, b = table.columns[whole], table.columns[fraction]
        values = a - a[0] + b * small
        whole_seconds = (a == np.round(a)).all() and not _rises(a) and b.max() * small < 1.0
        if small < GUESS.fraction and whole_seconds and _rises(values):
            return Clock((whole, fraction), ("s", unit[fraction]), values)
    rising = [c for c in times if _rises(table.columns[c])]
    if times and not rising:
        where = f"{table.source}, column '{times[0]}'"
        if any(_rises(-table.columns[c]) for c in times):
            message, remedy = "falls from row to row: the newest row is first", "sort the rows"
            raise InputRejected("T01", message, where, f"{remedy}, the oldest first")
        message = "does not rise from row to row: several rows a sample, or too few digits?"
        remedy = "export one row a sample, and its time with all digits"
        raise InputRejected("S11", message, where, remedy)
    first = next(iter(table.columns))
    if not rising and not of[first].quantity and len(table.columns) > GUESS.least:
        even = _rises(table.columns[first]) and _unevenness(table, first) < GUESS.even
        rising = [first] * even
    if rising:
        best = min(rising, key=lambda c: round(_unevenness(table, c), 2))
        return Clock((best,), (unit.get(best, ""),), table.columns[best])
    counters = [c for c in table.columns if of[c].quantity == "index" and _rises(table.columns[c])]
    return Clock((counters[0],), ("sample",), table.columns[counters[0]]) if counters else None


def _unit_alone(column: str) -> str:
    """Return the unit that a column of time is called itself: "nanosec", "header.stamp.sec"."""
    words = words_of(column)
    called = (unit_called(word) for word in ("".join(words[-2:]), *words[-1:]))
    return next((u for u in called if quantity_of(u) == "time" and u != "min"), "")


def _rises(values: Array) -> bool:
    steps = np.diff(values)
    return bool(np.mean(steps > 0) > GUESS.rising and (steps < 0).sum() <= GUESS.set_back)


def _unevenness(table: RawTable, column: str) -> float:
    steps = np.diff(table.columns[column])
    return float(np.std(steps) / max(abs(float(np.mean(steps))), 1e-300))


def slope_of(q: Array, dq: Array, t: Array | None) -> float | None:
    """Return r where q changes by r times the integral of dq over time, at every moving joint.

    None where dq is no velocity of q. Compared are changes over stretches of the recording, to
    which the noise of single samples adds little.
    """
    if q.shape != dq.shape:
        return None
    moves = (np.ptp(q, axis=0) > 0.0) & (np.ptp(dq, axis=0) > 0.0)
    if not moves.any():
        return None
    step = np.ones(len(q) - 1) if t is None else np.diff(t)
    inside = np.cumsum(0.5 * (dq[1:] + dq[:-1]) * step[:, None], axis=0)
    stride = max(1, len(inside) // GUESS.stretches)
    a = np.diff(q[1::stride, moves], axis=0)
    b = np.diff(inside[::stride, moves], axis=0)
    inner, size_a, size_b = (a * b).sum(axis=0), (a**2).sum(axis=0), (b**2).sum(axis=0)
    alike = inner / np.sqrt(np.maximum(size_a * size_b, 1e-300))
    ratios = inner / np.maximum(size_b, 1e-300)
    middle = float(np.median(ratios))
    same = bool((np.abs(ratios - middle) < GUESS.same_ratio * abs(middle)).all())
    return middle if (np.abs(alike) > GUESS.like).all() and middle > 0.0 and same else None


def _by_slopes(table: RawTable, groups: Sequence[Group], roles: Roles, n: int) -> None:
    """Find positions and velocities among blocks of columns without names; the rest is a torque."""
    clock = roles.clock.columns if roles.clock else ()
    unnamed = {c for g in groups if not g.name.quantity for c in g.columns}
    columns = [c for c in table.columns if c in unnamed and c not in clock]
    if n <= 1 and columns:
        n = next((k for k in range(GUESS.most_joints, 0, -1) if len(columns) == 3 * k), 1)
    blocks = [columns[k : k + n] for k in range(0, len(columns), n)]
    pairs: list[tuple[int, int]] = []
    made = [g for g in groups if not g.name.quantity and len(g.columns) > 1]
    if columns and len(columns) % n == 0 and len(blocks) <= GUESS.most_blocks:
        made = [Group(tuple(b), read_name(""), ("",) * n, "the file") for b in blocks]
        t = roles.clock.values if roles.clock else None
        values = [matrix(table, g) for g in made]
        pairs = [
            (a, b)
            for a, b in itertools.permutations(range(len(made)), 2)
            if slope_of(values[a], values[b], t) is not None
        ]
        pairs = [(a, b) for a, b in pairs if a not in {derived for _, derived in pairs}]
    if len(pairs) != 1:
        roles.others.update({s: roles.others[s] or tuple(made) for s in _QUANTITIES})
        return
    ((a, b),) = pairs
    roles.chosen.update(q=made[a], dq=made[b])
    rest = tuple(g for k, g in enumerate(made) if k not in (a, b))
    if "tau" not in roles.chosen and not roles.others["tau"]:
        roles.others["tau"] = rest
        if len(rest) == 1:
            roles.chosen["tau"], roles.others["tau"] = rest[0], ()
