"""Group the columns of a recording by what their names say, one group a signal, in the joints' order.

A group holds the columns of one quantity, one origin (measured, plain, commanded) and one side. The
robot beside the recording, where there is one, gives the joints' names and count; otherwise
numbers give the order, and names without number leave the order of the file.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import Literal

from pipelines.errors import InputRejected
from pipelines.log.recording.column_names import ColumnName, read_name, words_of
from pipelines.log.recording.raw import RawTable
from pipelines.log.recording.sources import read_table
from pipelines.log.units import canonical_unit

__all__ = [
    "Choice",
    "Group",
    "by_texts",
    "choose",
    "companion_of",
    "file_quantity",
    "groups_of",
    "texts_of",
    "unit_of_group",
]

_GENERIC = frozenset({"joint", "joints", "jnt", "axis", "link"})
_JOINT_SIDE = _GENERIC | {"jnts", "axes", "achse", "gelenk", "j", "a", "q", "qpos", "jpos"}

Order = Literal["robot", "numbers", "file", "text"]


@dataclass(frozen=True)
class Group:
    """Columns that belong together, one a joint."""

    quantity: str
    origin: Literal["measured", "plain", "commanded"]
    motor: bool
    partial: bool
    filtered: bool
    columns: tuple[str, ...]
    order: Order  # text: as columns of text name them, and no robot has these names
    words: str  # the group in words, for comments
    unknown: frozenset[str] = (
        frozenset()
    )  # words of all its names that say neither what it is nor which joint

    @property
    def side(self) -> Literal["joint", "motor", "scaled", ""]:
        """Return the side of the gear that the names state: q is a joint's by convention; learning may scale its data."""
        if {"observation", "action", "norm", "normalized", "normalised", "scaled"} & set(
            self.words.split()
        ):
            return "scaled"
        return "motor" if self.motor else "joint" if self.names_joints else ""

    @property
    def names_joints(self) -> bool:
        return self.order == "robot" or bool(set(self.words.split()) & _JOINT_SIDE)

    @property
    def rank(self) -> tuple[int, bool, bool]:
        """Order of preference: measured before plain before commanded, joint before motor, raw before filtered."""
        return (("measured", "plain", "commanded").index(self.origin), self.motor, self.filtered)


@dataclass(frozen=True)
class Choice:
    """The group taken for a signal, or None where the names leave it open; and the others of that quantity."""

    group: Group | None
    others: tuple[Group, ...] = ()


def groups_of(table: RawTable, joints: Sequence[str] = (), slides: bool = False) -> list[Group]:
    """Return the groups of the columns of `table`; `joints` names the robot's, from the base to the tip.

    Where one of them `slides`, its force stands beside the torques of the others.
    """
    texts = texts_of(table, joints)
    patterns = _patterns(table, joints)
    found: dict[tuple[object, ...], list[tuple[ColumnName, int | None]]] = {}
    shared, port = _shared_path(table), _shared_port(table)
    for column in table.columns:
        rest, place = _without_joint(column.removeprefix(shared).removesuffix(port), patterns)
        rest = (
            re.sub("(?i)force|kraft|fuerza|forza", "torque", rest)
            if slides and _number(words_of(rest)) is not None
            else rest
        )
        name = replace(read_name(rest, canonical_unit(table.units.get(column, ""))), column=column)
        if place is None:
            place = _place_by_words(name.label, joints)
        key = (name.quantity, name.origin, name.motor, name.partial, name.filtered, name.role)
        found.setdefault(key, []).append((name, place))
    groups = []
    for members in found.values():
        for part in _split(members):
            if {"x", "y", "z"} <= {name.column.removeprefix(shared).lower() for name, _ in part}:
                part = [
                    (replace(name, quantity="other"), place) for name, place in part
                ]  # the tool's pose
            groups.append(_ordered(part, joints, texts))
    return groups


def _shared_path(table: RawTable) -> str:
    """Return the path that all columns but the clock have, the recording's name: "payload." of "payload.joints[0].pos".

    It says nothing of a column, unless that all are commanded, or apart from the clock computed: "cmd.".
    """
    signals = [
        column for column in table.columns if read_name(column).quantity not in ("time", "index")
    ]
    every, path = (_common_path(names) for names in (list(table.columns), signals))
    said = read_name(
        path.removeprefix(every).replace("Model Root", "")
    )  # that of every signal of Simulink's models
    path = every if said.partial and said.origin != "measured" else path or every
    return "" if read_name(path).origin == "commanded" else path


def _shared_port(table: RawTable) -> str:
    """Return the last part of the path that all columns with a path have: the "Out1" of dSPACE's blocks."""
    ports = {column.rpartition("/")[2] for column in table.columns if "/" in column}
    return f"/{ports.pop()}" if len(ports) == 1 else ""


def _common_path(names: Sequence[str]) -> str:
    folders = zip(*(re.split(r"(?<=[./])", name)[:-1] for name in names), strict=False)
    return "".join(
        same[0] for same in takewhile(lambda parts: len(set(parts)) == 1 < len(parts), folders)
    )


def _patterns(table: RawTable, joints: Sequence[str]) -> list[re.Pattern[str]]:
    """Return a pattern for each joint's name, with or without words such as "joint"; none where a joint is not found.

    All of the robot's names, or none: columns joint_0, joint_1, … do not name the robot's joint_1, joint_2, …
    """
    for generic in (frozenset[str](), _GENERIC):
        names = [
            [w for w in re.findall(r"\d+|[A-Z]?[a-z]+|[A-Z]+", name) if w.lower() not in generic]
            for name in joints
        ]
        if any(sum(map(len, words)) < 3 or not any(map(str.isalpha, words)) for words in names):
            continue
        found = [
            re.compile(
                rf"(?<![A-Za-z0-9]){'[^A-Za-z0-9]?'.join(words)}(?![A-Za-z0-9])", re.IGNORECASE
            )
            for words in names
        ]
        if found and all(
            any(pattern.search(column) for column in table.columns) for pattern in found
        ):
            return found
    return []


def _without_joint(column: str, names: Sequence[re.Pattern[str]]) -> tuple[str, int | None]:
    """Return the column's name without the name of a joint in it, and the place of that joint (from 0)."""
    for place in sorted(range(len(names)), key=lambda k: -len(names[k].pattern)):
        if found := names[place].search(column):
            return column[: found.start()] + " " + column[found.end() :], place
    return column, None


def _place_by_words(label: Sequence[str], joints: Sequence[str]) -> int | None:
    """Return the joint whose name has the words of `label`: ("elbow",) is "elbow_joint". Numbers alone name none."""
    if not label or not any(word.isalpha() for word in label):
        return None
    bare = [[word for word in words_of(name) if word not in _GENERIC] for name in joints]
    common = set(bare[0]).intersection(*bare[1:]) if len(bare) > 1 else set()
    matches = [
        k
        for k, words in enumerate(bare)
        if [w for w in words if w not in common] == [w for w in label if w not in common] and words
    ]
    return matches[0] if len(matches) == 1 else None


def texts_of(table: RawTable, joints: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that columns of text name, in the order of the file: name[0] is "elbow_joint", or name "['elbow', …]"."""
    for words in (re.findall(r"[\w./:-]+", note) for note in table.notes if joints):
        if set(joints) <= set(words):
            return tuple(word for word in words if word in joints)
    texts = list(table.labels.values())
    for words in (
        re.findall(r"[\w./:-]+", text) for text in texts if text.strip()[:1] in ("[", "(")
    ):
        if (
            len(words) > 1
            and (set(joints) <= set(words) or not joints)
            and not any(word[0].isdecimal() for word in words)
        ):
            return tuple(words)
    known = [k for k, text in enumerate(texts) if text in joints]
    if known:
        return tuple(texts[known[0] : known[-1] + 1])
    families: dict[tuple[str, ...], list[str]] = {}
    for column, text in table.labels.items():
        families.setdefault(
            tuple(word for word in words_of(column) if not word.isdecimal()), []
        ).append(text)
    found = max(families.values(), key=len, default=[])
    return tuple(found) if len(set(found)) == len(found) > 1 else ()


def by_texts(
    columns: Sequence[str], texts: Sequence[str], joints: Sequence[str]
) -> tuple[list[str], Order | None]:
    """Return the columns in the robot's order by the `texts` that name them; None where the texts say nothing of them."""
    if len(texts) != len(columns) or len(texts) < 2:
        return list(columns), None
    if joints and set(joints) <= set(texts):
        return [columns[list(texts).index(joint)] for joint in joints], "robot"
    numbers = [_number(words_of(text)) for text in texts]
    rising = None not in numbers and numbers == sorted(numbers, key=lambda number: number or 0)
    return list(columns), None if rising else "text"


def _split(
    members: list[tuple[ColumnName, int | None]],
) -> list[list[tuple[ColumnName, int | None]]]:
    """Split columns of one kind by the words beside their numbers: arm_q_1 … and leg_q_1 … are two groups.

    Where a word comes once only, the words name the joints: wrist_1, wrist_2, elbow.
    """
    places = [place for _, place in members if place is not None]
    if places and len(set(places)) == len(places):
        return [members]
    parts: dict[tuple[str, ...], list[tuple[ColumnName, int | None]]] = {}
    for member in members:
        words = tuple("#" if word.isdecimal() else word for word in member[0].label)
        parts.setdefault(words, []).append(member)
    several = [part for part in parts.values() if len(part) > 1]
    return list(parts.values()) if len(several) == len(parts) else [members]


def _ordered(
    members: list[tuple[ColumnName, int | None]], joints: Sequence[str], texts: Sequence[str]
) -> Group:
    """Return the group with its columns from the base to the tip, as far as that can be known."""
    names = [name for name, _ in members]
    places = [place for _, place in members]
    numbers = [_number(name.label) for name in names]
    order: Order = "file"
    if joints and sorted(place for place in places if place is not None) == list(
        range(len(joints))
    ):
        names, order = [names[places.index(place)] for place in range(len(joints))], "robot"
    elif (
        None not in numbers
        and len(set(numbers)) == len(numbers)
        and all(place is None for place in places)
    ):
        names, order = (
            [names[k] for k in sorted(range(len(names)), key=lambda k: numbers[k] or 0)],
            "numbers",
        )
    columns = [name.column for name in names]
    if order != "robot":
        columns, by_text = by_texts(columns, texts, joints)
        order = by_text or order
    first = names[0]
    said = [
        {w for w in name.label if w.isalpha() and (len(w) > 1 or not w.isascii())} for name in names
    ]
    unknown = frozenset(said[0].intersection(*said[1:]))
    words = " ".join(first.role) or " ".join(first.label)
    return Group(
        first.quantity,
        first.origin,
        first.motor,
        first.partial,
        first.filtered,
        tuple(columns),
        order,
        words,
        unknown if len(names) > 1 else frozenset(),
    )


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
    fitting = [
        g
        for g in groups
        if g.quantity in quantities and not g.partial and (commanded or g.origin != "commanded")
    ]
    others = [g for g in groups if g.quantity in quantities and g not in fitting]
    sized = [g for g in fitting if n is None or len(g.columns) == n]

    def key(group: Group) -> tuple[object, ...]:
        return (
            group.origin == "commanded",
            group.order != "robot",
            quantities.index(group.quantity),
            group.rank,
        )

    sized.sort(key=key)
    rest = tuple(g for g in (*fitting, *others) if not sized or g is not sized[0])
    if not sized:
        return Choice(None, rest)
    best = [g for g in sized if key(g) == key(sized[0])]
    return Choice(
        sized[0] if len(best) == 1 else None,
        rest if len(best) == 1 else (*best, *(g for g in rest if g not in best)),
    )


def unit_of_group(group: Sequence[str], table: RawTable) -> tuple[str | None, ...]:
    """Return the unit of each column as the header or its name says it; None where neither does.

    It may be one that `UNITS` does not have, such as "%".
    """
    headers = [canonical_unit(table.units.get(column, "")).strip() for column in group]
    return tuple(
        header if header not in ("", "-", "1") else read_name(column).unit or None
        for header, column in zip(headers, group, strict=True)
    )


def file_quantity(path: Path) -> str:
    """Return the quantity that the file's name says: "position" of pos_data.csv, "current" of curr_data.csv."""
    found = read_name(path.stem).quantity
    return found if found in ("position", "torque", "current") else ""


def companion_of(path: Path, table: RawTable) -> RawTable | None:
    """Return a file in the same folder with the same columns and as many rows: positions here, torques there."""
    for other in sorted(path.parent.iterdir())[:200]:
        if (
            other == path
            or other.suffix.lower() != path.suffix.lower()
            or not other.is_file()
            or other.stat().st_size > 1 << 30
        ):
            continue
        if (file_quantity(other) in ("torque", "current")) == (
            file_quantity(path) in ("torque", "current")
        ):
            continue
        try:
            candidate = read_table(other)
        except InputRejected:
            continue  # another file of the folder
        if (
            list(candidate.columns) == list(table.columns)
            and candidate.rows.size == table.rows.size
        ):
            return candidate
    return None
