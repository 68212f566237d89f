"""Group the columns of a recording by their names, one group a signal, in the joints' order.

A group holds the columns of one quantity, one origin (measured, plain, commanded) and one side. The
robot beside the recording, where there is one, gives the joints' names and count; otherwise numbers
give the order, and names without numbers leave the order of the file.
"""

from __future__ import annotations

import re
from collections import defaultdict
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
_LEARNING = frozenset(
    {"observation", "action", "norm", "normalized", "normalised", "scaled"}
)  # of robot learning
_NAME = re.compile(r"[\w./:-]+")
Order = Literal["robot", "numbers", "file", "text"]
Member = tuple[ColumnName, int | None]  # a column and its joint (from 0), where it is known


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
    def scaled(self) -> bool:
        """Return whether robot learning may have scaled it."""
        return bool(_LEARNING & set(self.words.split()))

    @property
    def names_joints(self) -> bool:
        return self.order == "robot" or bool(set(self.words.split()) & _JOINT_SIDE)


def groups_of(table: RawTable, joints: Sequence[str] = (), slides: bool = False) -> list[Group]:
    """Return the groups of the columns; `joints` names the robot's, from the base to the tip.

    Where one of them `slides`, its force is grouped with the torques of the others.
    """
    patterns = _patterns(table, joints)
    shared = _shared_path(table)
    ports = {column.rpartition("/")[2] for column in table.columns if "/" in column}
    port = f"/{ports.pop()}" if len(ports) == 1 else ""  # the "Out1" of dSPACE's blocks
    kinds: dict[tuple[object, ...], list[Member]] = defaultdict(list)
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
        kinds[key].append((name, place))
    texts, groups = listed_joints(table, joints), []
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
    """Return a pattern for each joint's name, without words such as "joint" if that is enough.

    All of the robot's names, or none: columns joint_0, joint_1, … do not name joint_1, joint_2, …
    """
    every = [re.findall(r"\d+|[A-Z]?[a-z]+|[A-Z]+", name) for name in joints]
    bare = [[word for word in words if word.lower() not in _GENERIC] for words in every]
    for names in (every, bare):
        plain = (len("".join(w)) > NAMES.short and any(map(str.isalpha, w)) for w in names)
        if not joints or not all(plain):
            continue
        bodies = ["[^A-Za-z0-9]?".join(words) for words in names]
        whole = (rf"(?<![A-Za-z0-9]){body}(?![A-Za-z0-9])" for body in bodies)
        found = [re.compile(pattern, re.IGNORECASE) for pattern in whole]
        if all(any(pattern.search(c) for c in table.columns) for pattern in found):
            return found
    return []


def _place_by_words(label: Sequence[str], joints: Sequence[str]) -> int | None:
    """Return the joint whose name has the words of `label`: ("elbow",) is "elbow_joint"."""
    if not any(word.isalpha() for word in label):
        return None
    bare = [[word for word in words_of(name) if word not in _GENERIC] for name in joints]
    common = set(bare[0]).intersection(*bare[1:]) if len(bare) > 1 else set()
    wanted, *own = ([word for word in words if word not in common] for words in (label, *bare))
    matches = [k for k, words in enumerate(own) if bare[k] and words == wanted]
    return matches[0] if len(matches) == 1 else None


def listed_joints(table: RawTable, joints: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that columns of text name, in the order of the file.

    They are in a note, in one column ("['elbow', …]") or in columns of their own (name[0] is
    "elbow_joint"). Without a robot, any different words will do.
    """
    texts = list(table.labels.values())
    cells = [_NAME.findall(text) for text in texts if text.strip()[:1] in ("[", "(")]
    families: dict[tuple[str, ...], list[str]] = defaultdict(list)
    for column, text in table.labels.items():
        families[tuple(word for word in words_of(column) if not word.isdecimal())].append(text)
    family = max(families.values(), key=len, default=[])
    if joints:
        notes = (_NAME.findall(note) for note in table.notes)
        known = [[word for word in words if word in joints] for words in notes]
        for words in (*known, *cells):
            if set(joints) <= set(words):
                return tuple(words)
        places = [k for k, text in enumerate(texts) if text in joints]
        if places:
            return tuple(texts[places[0] : places[-1] + 1])
    else:
        words = [w for w in cells if w[1:] and not any(x[0].isdecimal() for x in w)]
        if words:
            return tuple(words[0])
    return tuple(family) if len(set(family)) == len(family) > 1 else ()


def by_texts(
    columns: Sequence[str], texts: Sequence[str], joints: Sequence[str]
) -> tuple[list[str], Order | None]:
    """Return the columns in the robot's order by the `texts` that name them.

    Without texts of these columns there is no order.
    """
    if len(texts) != len(columns) or len(texts) == 1:
        return list(columns), None
    if joints and set(joints) <= set(texts):
        return [columns[texts.index(joint)] for joint in joints], "robot"
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
    parts: dict[tuple[str, ...], list[Member]] = defaultdict(list)
    for member in members:
        parts[tuple("#" if w.isdecimal() else w for w in member[0].label)].append(member)
    found = [part for alike in parts.values() for part in _by_number(alike, n)]
    if all(len(part) > 1 for part in found):
        return found
    whole = [part for part in found if len(part) == n > 1]
    return [*whole, [member for member in members if not any(member in part for part in whole)]]


def _by_number(members: list[Member], n: int) -> list[list[Member]]:
    """Split columns by a number that does not count from 0 or 1, as joints do: J1.6064h."""
    for at in range(len(members[0][0].label) if len(members) > n > 1 else 0):
        parts: dict[str, list[Member]] = defaultdict(list)
        for member in members:
            parts[member[0].label[at].lstrip("0")].append(member)
        counted = set(parts) <= {"", *map(str, range(len(parts) + 1))}
        if not counted and all(len(part) == n for part in parts.values()):
            return list(parts.values())
    return [members]


def _ordered(members: list[Member], joints: Sequence[str], texts: Sequence[str]) -> Group:
    """Return the group with its columns from the base to the tip, as far as that can be known."""
    names, places = [name for name, _ in members], [place for _, place in members]
    numbers = [_number(name.label) for name in names]
    order: Order = "file"
    if joints and sorted(p for p in places if p is not None) == list(range(len(joints))):
        names, order = [names[places.index(place)] for place in range(len(joints))], "robot"
    elif {*places} == {None} and None not in numbers and len(set(numbers)) == len(numbers):
        names, order = sorted(names, key=lambda name: _number(name.label) or 0), "numbers"
    columns = [name.column for name in names]
    if order != "robot":
        columns, by_text = by_texts(columns, texts, joints)
        order = by_text or order
    said = [{w for w in name.label if w.isalpha() and (w[1:] or not w.isascii())} for name in names]
    unknown = frozenset(said[0].intersection(*said[1:])) if len(names) > 1 else frozenset()
    first = names[0]
    words = " ".join(first.role) or " ".join(first.label)
    kind = first.quantity, first.origin, first.motor, first.partial, first.filtered
    return Group(*kind, tuple(columns), order, words, unknown)


def _number(label: Sequence[str]) -> int | None:
    numbers = [word for word in label if word.isdecimal()]
    return int(numbers[-1][:9]) if numbers else None


def own_units(columns: Sequence[str], table: RawTable) -> list[str | None]:
    """Return the unit of each column as the header or its name says it; None where neither does.

    It may be one that `UNITS` does not have, such as "%".
    """
    headers = [canonical_unit(table.units.get(column, "")).strip() for column in columns]
    pairs = zip(headers, columns, strict=True)
    return [h if h not in ("", "-", "1") else read_name(c).unit or None for h, c in pairs]
