"""Tell what the columns of a recording are, by their names, their numbers and the name of their file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.recording.raw import RawTable
from pipelines.log.recording.sources import read_table
from pipelines.log.units import UNITS, canonical_unit

__all__ = ["companion_of", "named_unit", "role_of", "roles_of"]

# What a column is, by its name. The first that fits counts; the order keeps "pos_ref" from being a position.
_NAMES: tuple[tuple[str, str], ...] = (
    ("q_ref",
     r"(q|pos|position|angle|theta)_?(ref|des|desired|cmd|target|set)\w*"
     r"|(ref|des|desired|target|cmd|set)_?(q|pos|position|angle)\w*"),
    ("dq", r"(dq|qd|qdot|vel|velocity|speed|omega|geschwindigkeit|drehzahl|\w*_(vel|velocity|speed))(?![a-z])\w*"),
    ("t", r"(t|time|timestamp|stamp|zeit|clock|sec|seconds?)(?![a-z])\w*|(t|time)(_|$).*"),
    ("tau", r"(tau|torque|trq|moment|effort|mom|drehmoment)\w*|\w*(torque|effort|moment)\w*"),
    ("current", r"(i|iq|curr|current|amp|strom)(?![a-z])\w*|\w*(current)\w*"),
    ("q", r"(q|pos|position|angle|theta|joint|enc|encoder|axis|j|winkel|achse|gelenk)(?![a-z])\w*"
          r"|\w*(_pos|position|_angle|encoder|winkel)\w*"),
)
_SUFFIX_UNITS = {"s": "s", "sec": "s", "ms": "ms", "us": "us", "ns": "ns", "rad": "rad", "deg": "deg", "rev": "rev",
                 "turns": "turn", "counts": "counts",
                 "cnt": "counts", "ticks": "counts", "a": "A", "ma": "mA", "nm": "N m", "mnm": "mN m", "rpm": "rpm"}


def role_of(column: str) -> str | None:
    """What a column holds, by its name alone: "t", "q", "tau", …"""
    word = re.sub(r"[^\w]+", "_", column.strip()).lower()
    return next((role for role, pattern in _NAMES if re.fullmatch(pattern, word)), None)


def _role_by_unit(unit: str) -> str | None:
    """What a column whose name says nothing holds, by the unit in its header: "M1 [Nm]" is a torque."""
    known = UNITS.get(canonical_unit(unit))
    roles = {"time": "t", "position": "q", "velocity": "dq", "torque": "tau", "current": "current"}
    return roles.get(known.quantity) if known is not None else None


def roles_of(table: RawTable, path: Path) -> dict[str, tuple[str, ...]]:
    """Which columns hold what, by their names; a column of time also by rising evenly. The file's name settles "Joint_1"."""
    found: dict[str, list[str]] = {}
    for name in table.columns:
        if (role := role_of(name) or _role_by_unit(table.units.get(name, ""))) is not None:
            found.setdefault(role, []).append(name)
    if "t" not in found:
        first = next(iter(table.columns))
        steps = np.diff(table.columns[first])
        if steps.size > 10 and (steps > 0).all() and np.std(steps) < 0.3 * np.mean(steps) and len(table.columns) > 2:
            found = {"t": [first]} | {role: [c for c in names if c != first] for role, names in found.items()}
    if re.search(r"tau|torque|curr|effort|moment",
                 path.stem.lower()) and "tau" not in found and "current" not in found and "q" in found:
        found["tau"] = found.pop("q")
    plain = [c for c in table.columns if c not in found.get("t", [])]
    if not set(found) - {"t"} and re.search(r"tau|torque|curr|effort", path.stem.lower()):
        found["tau"] = plain
    elif not set(found) - {"t"} and plain:
        found["q"] = plain
    return {role: tuple(names) if role != "t" else tuple(names[:1]) for role, names in found.items() if names}


def companion_of(path: Path, table: RawTable) -> RawTable | None:
    """A file beside it with the same columns and as many rows: positions here, torques there."""
    for other in sorted(path.parent.iterdir())[:200]:
        if other == path or other.suffix.lower() != path.suffix.lower() or not other.is_file() or other.stat().st_size > 1 << 30:
            continue
        try:
            candidate = read_table(other)
        except InputRejected:
            continue  # whatever else lies there is not what was asked about
        alike = list(candidate.columns) == list(table.columns) and candidate.rows.size == table.rows.size
        if alike and _is_torque(other) != _is_torque(path):
            return candidate
    return None


def _is_torque(path: Path) -> bool:
    return re.search(r"tau|torque|curr|effort|moment", path.stem.lower()) is not None


def named_unit(column: str, table: RawTable) -> str | None:
    """The unit in the header, or in the last part of the name."""
    header = canonical_unit(table.units.get(column, ""))
    if header in UNITS or header == "counts":
        return header
    parts = re.split(r"[_\s.]+", column.lower())
    return next((_SUFFIX_UNITS[p] for p in reversed(parts[1:]) if p in _SUFFIX_UNITS), None) if len(parts) > 1 else None
