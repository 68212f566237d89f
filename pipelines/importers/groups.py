"""Group the columns of a recording by their names, one group a signal, in the joints' order.

A group holds the columns of one quantity, one origin (measured, plain, commanded) and one side. The
robot beside the recording, where there is one, gives the joints' names and count; otherwise numbers
give the order, and names without numbers leave the order of the file.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Literal

from pipelines.importers.config import NAMES
from pipelines.importers.names import ColumnName, Origin, read_name, words_of
from pipelines.importers.raw import RawTable
from pipelines.io.units import canonical_unit

_GENERIC = frozenset({"joint", "joints", "jnt", "axis", "link"})
_JOINT_SIDE = _GENERIC | {"jnts", "axes", "achse", "gelenk", "j", "a", "q", "qpos", "jpos"}
_LEARNING = {"observation", "action", "norm", "normalized", "normalised", "scaled"}
_NAME = re.compile(r"[\w./:-]+")
Order = Literal["robot", "numbers", "file", "text"]
Side = Literal["joint", "motor", "scaled", ""]


@dataclass(frozen=True)
class Group:
    """Columns that belong together, one a joint."""

    quantity: str
    origin: Origin
    motor: bool
    partial: bool
    filtered: bool
    columns: tuple[str, ...]
    order: Order  # text: as columns of text name them, and no robot has these names
    words: str  # the group in words, for comments
    unknown: frozenset[str] = frozenset()  # words of all its names that no vocabulary has
    gripper: tuple[str, ...] = ()  # columns left out: the file's list of names calls them so

    @property
    def side(self) -> Side:
        """Return the side of the gear by name: q is a joint's; robot learning may scale it."""
        if _LEARNING & set(self.words.split()):
            return "scaled"
        return "motor" if self.motor else "joint" if self.names_joints else ""

    @property
    def names_joints(self) -> bool:
        return self.order == "robot" or bool(set(self.words.split()) & _JOINT_SIDE)

    @property
    def rank(self) -> tuple[int, bool, bool]:
        """Order of preference: measured, plain, commanded; joint, motor; raw, filtered."""
        return (("measured", "plain", "commanded").index(self.origin), self.motor, self.filtered)


@dataclass(frozen=True)
class Choice:
    """The group taken for a signal, None where the names leave it open; and the others of it."""

    group: Group | None
    others: tuple[Group, ...] = ()

    @property
    def left_open(self) -> Choice:
        return Choice(None, (*((self.group,) if self.group else ()), *self.others))


Member = tuple[ColumnName, int | None]  # a column and its joint (from 0), where it is known


def groups_of(table: RawTable, joints: Sequence[str] = (), slides: bool = False) -> list[Group]:
    """Return the groups of the columns; `joints` names the robot's, from the base to the tip.

    Where one of them `slides`, its force is grouped with the torques of the others.
    """
    patterns = _patterns(table, joints)
    shared = _shared_path(table)
    ports = {column.rpartition("/")[2] for column in table.columns if "/" in column}
    port = f"/{ports.pop()}" if len(ports) == 1 else ""  # the "Out1" of dSPACE's blocks
    kinds: dict[tuple[object, ...], list[Member]] = {}
    for column in table.columns:
        rest, place = column.removeprefix(shared).removesuffix(port), None
        for k in sorted(range(len(patterns)), key=lambda k: -len(patterns[k].pattern)):
            if found := patterns[k].search(rest):
                rest, place = rest[: found.start()] + " " + rest[found.end() :], k
                break
        if slides and _number(words_of(rest)) is not None:
            rest = re.sub("(?i)force|kraft|fuerza|forza", "torque", rest)
        name = replace(read_name(rest, canonical_unit(table.units.get(column, ""))), column=column)
        place = _place_by_words(name.label, joints) if place is None else place
        key = (name.quantity, name.origin, name.motor, name.partial, name.filtered, name.role)
        kinds.setdefault(key, []).append((name, place))
    groups, texts = [], texts_of(table, joints)
    for part in (part for members in kinds.values() for part in _split(members, len(joints))):
        if {"x", "y", "z"} <= {name.column.removeprefix(shared).lower() for name, _ in part}:
            part = [(replace(name, quantity="other"), place) for name, place in part]  # a pose
        groups.append(_ordered(part, joints, texts))
    return groups


def _shared_path(table: RawTable) -> str:
    """Return the path that all columns but the clock have: "payload." of "payload.joints[0].pos".

    It says nothing of a column, unless that all are commanded, or without the clock computed.
    """

    def common(names: Sequence[str]) -> str:
        folders = zip(*(re.split(r"(?<=[./])", name)[:-1] for name in names), strict=False)
        same = takewhile(lambda parts: len(set(parts)) == 1 < len(parts), folders)
        return "".join(parts[0] for parts in same)

    clocks = ("time", "index")
    signals = [column for column in table.columns if read_name(column).quantity not in clocks]
    every, path = common(list(table.columns)), common(signals)
    # Simulink's models name every signal so.
    said = read_name(path.removeprefix(every).replace("Model Root", ""))
    path = every if said.partial and said.origin != "measured" else path or every
    return "" if read_name(path).origin == "commanded" else path


def _patterns(table: RawTable, joints: Sequence[str]) -> list[re.Pattern[str]]:
    """Return a pattern for each joint's name, with or without words such as "joint".

    All of the robot's names, or none: columns joint_0, joint_1, … do not name joint_1, joint_2, …
    """
    for generic in (frozenset[str](), _GENERIC):
        every = [re.findall(r"\d+|[A-Z]?[a-z]+|[A-Z]+", name) for name in joints]
        names = [[word for word in words if word.lower() not in generic] for words in every]
        if any(
            len("".join(words)) <= NAMES.short or not any(map(str.isalpha, words))
            for words in names
        ):
            continue
        bodies = ["[^A-Za-z0-9]?".join(words) for words in names]
        found = [
            re.compile(rf"(?<![A-Za-z0-9]){body}(?![A-Za-z0-9])", re.IGNORECASE) for body in bodies
        ]
        if found and all(any(pattern.search(c) for c in table.columns) for pattern in found):
            return found
    return []


def _place_by_words(label: Sequence[str], joints: Sequence[str]) -> int | None:
    """Return the joint whose name has the words of `label`: ("elbow",) is "elbow_joint"."""
    if not any(word.isalpha() for word in label):
        return None
    bare = [[word for word in words_of(name) if word not in _GENERIC] for name in joints]
    common = set(bare[0]).intersection(*bare[1:]) if len(bare) > 1 else set()
    wanted = [word for word in label if word not in common]
    own = [[word for word in words if word not in common] for words in bare]
    matches = [k for k, words in enumerate(bare) if words and own[k] == wanted]
    return matches[0] if len(matches) == 1 else None


def texts_of(table: RawTable, joints: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that columns of text name, in the order of the file.

    They are in columns of their own (name[0] is "elbow_joint") or in one ("['elbow', …]").
    """
    for note in table.notes if joints else ():
        words = _NAME.findall(note)
        if set(joints) <= set(words):
            return tuple(word for word in words if word in joints)
    texts = list(table.labels.values())
    for text in (text for text in texts if text.strip()[:1] in ("[", "(")):
        words = _NAME.findall(text)
        named = set(joints) <= set(words) or not joints
        if len(words) > 1 and named and not any(word[0].isdecimal() for word in words):
            return tuple(words)
    known = [k for k, text in enumerate(texts) if text in joints]
    if known:
        return tuple(texts[known[0] : known[-1] + 1])
    families: dict[tuple[str, ...], list[str]] = {}
    for column, text in table.labels.items():
        stem = tuple(word for word in words_of(column) if not word.isdecimal())
        families.setdefault(stem, []).append(text)
    found = max(families.values(), key=len, default=[])
    return tuple(found) if len(set(found)) == len(found) > 1 else ()


def by_texts(
    columns: Sequence[str], texts: Sequence[str], joints: Sequence[str]
) -> tuple[list[str], Order | None]:
    """Return the columns in the robot's order by the `texts` that name them.

    Without texts of these columns there is no order.
    """
    if len(texts) != len(columns) or len(texts) == 1:
        return list(columns), None
    if joints and set(joints) <= set(texts):
        return [columns[list(texts).index(joint)] for joint in joints], "robot"
    numbers = [_number(words_of(text)) for text in texts]
    rising = None not in numbers and numbers == sorted(numbers, key=lambda number: number or 0)
    return list(columns), None if rising else "text"


def _split(members: list[Member], n: int) -> list[list[Member]]:
    """Split columns of one kind by their words: arm_q_1 … and leg_q_1 … are two groups.

    Where a word comes once only, the words name the joints: wrist_1, wrist_2, elbow; but a word
    that comes once for each of `n` joints names a signal. Names of one joint that differ in their
    units alone, pos_1_deg and pos_1_rad, are two signals.
    """
    units = {name.unit for name, _ in members}
    if len({(name.label, place) for name, place in members}) < len(members) and len(units) > 1:
        alike = ([m for m in members if m[0].unit == unit] for unit in sorted(units))
        return [part for group in alike for part in _split(group, n)]
    places = [place for _, place in members if place is not None]
    if places and len(set(places)) == len(places):
        return [members]
    parts: dict[tuple[str, ...], list[Member]] = {}
    for member in members:
        words = tuple("#" if word.isdecimal() else word for word in member[0].label)
        parts.setdefault(words, []).append(member)
    found = [part for alike in parts.values() for part in _by_number(alike, n)]
    if all(len(part) > 1 for part in found):
        return found
    whole = [part for part in found if len(part) == n > 1]
    rest = [member for member in members if not any(member in part for part in whole)]
    return [*whole, rest]


def _by_number(members: list[Member], n: int) -> list[list[Member]]:
    """Split columns by a number that does not count from 0 or 1, as joints do: J1.6064h."""
    labels = [name.label for name, _ in members]
    for at in range(len(labels[0]) if len(members) > n > 1 else 0):
        parts: dict[str, list[Member]] = {}
        for label, member in zip(labels, members, strict=True):
            parts.setdefault(label[at].lstrip("0"), []).append(member)
        counted = set(parts) <= {"", *map(str, range(len(parts) + 1))}
        if not counted and all(len(part) == n for part in parts.values()):
            return list(parts.values())
    return [members]


def _ordered(members: list[Member], joints: Sequence[str], texts: Sequence[str]) -> Group:
    """Return the group with its columns from the base to the tip, as far as that can be known."""
    names = [name for name, _ in members]
    places = [place for _, place in members]
    numbers = [_number(name.label) for name in names]
    order: Order = "file"
    if joints and sorted(p for p in places if p is not None) == list(range(len(joints))):
        names, order = [names[places.index(place)] for place in range(len(joints))], "robot"
    elif {*places} == {None} and None not in numbers and len(set(numbers)) == len(numbers):
        ranked = sorted(zip(numbers, names, strict=True), key=lambda pair: pair[0] or 0)
        names, order = [name for _, name in ranked], "numbers"
    columns = [name.column for name in names]
    if order != "robot":
        columns, by_text = by_texts(columns, texts, joints)
        order = by_text or order
    first = names[0]
    said = [{w for w in name.label if w.isalpha() and (w[1:] or not w.isascii())} for name in names]
    unknown = frozenset(said[0].intersection(*said[1:])) if len(names) > 1 else frozenset()
    words = " ".join(first.role) or " ".join(first.label)
    kind = first.quantity, first.origin, first.motor, first.partial, first.filtered
    return Group(*kind, tuple(columns), order, words, unknown)


def _number(label: Sequence[str]) -> int | None:
    numbers = [word for word in label if word.isdecimal()]
    return int(numbers[-1][:9]) if numbers else None


def choose(
    groups: Sequence[Group], quantities: Sequence[str], n: int | None, commanded: bool
) -> Choice:
    """Return the group that holds a signal of one of `quantities`, the earlier ones preferred.

    Args:
        n: number of joints; None where it is not known.
        commanded: whether a commanded one will do where no other is there.
    """
    every = [g for g in groups if g.quantity in quantities]
    fitting = [g for g in every if not g.partial and (commanded or g.origin != "commanded")]
    others = [g for g in every if g not in fitting]

    def key(group: Group) -> tuple[object, ...]:
        place = quantities.index(group.quantity)
        return (group.origin == "commanded", group.order != "robot", place, group.rank)

    sized = sorted((g for g in fitting if n is None or len(g.columns) == n), key=key)
    best = [g for g in sized if key(g) == key(sized[0])]
    rest = tuple(g for g in (*fitting, *others) if g not in best)
    return Choice(best[0], rest) if len(best) == 1 else Choice(None, (*best, *rest))


def unit_of_group(columns: Sequence[str], table: RawTable) -> tuple[str | None, ...]:
    """Return the unit of each column as the header or its name says it; None where neither does.

    It may be one that `UNITS` does not have, such as "%".
    """
    headers = [canonical_unit(table.units.get(column, "")).strip() for column in columns]
    return tuple(
        header if header not in ("", "-", "1") else read_name(column).unit or None
        for header, column in zip(headers, columns, strict=True)
    )
