"""Tell from a column's name what quantity it holds, whether it was measured, and of which joint.

A name is split into words: at signs, at changes of case, between letters and digits, and where
a run of letters is made of known words ("jointpos", "taucmd"). Known words give the quantity, its
source and its side; the other words and the numbers name the joint. The head noun is the last one:
a "torque current" is a current, a "current torque" a torque as it is now.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from pipelines.log.recording.vocabulary import ALL_WORDS, QUANTITIES, WORDS, plain_letters
from pipelines.log.units import UNITS, canonical_unit

__all__ = ["ColumnName", "read_name", "signal_of", "words_of"]

Origin = Literal["measured", "plain", "commanded"]


_COMMANDED, _MEASURED, _MOTOR, _JOINT = (
    WORDS[k] for k in ("commanded", "measured", "motor", "joint")
)
_PARTIAL = WORDS[
    "partial"
]  # of a torque, or what a controller computed: not the torque that moved the joint
_ESTIMATED = WORDS[
    "estimated"
]  # a computed torque; of a motion, what the drive makes of its encoder: the measurement
_VARIANT = WORDS["variant"]
_NOUNS = {quantity: WORDS[quantity] for quantity in QUANTITIES}
_LEAST_OF_COMPOUND = (
    3  # Latin letters of a word that others are written to without a space, but for these
)
_SHORT = frozenset(
    {"q", "qd", "dq", "iq", "fb", "ff", "sp", "tq", "ee", "ft", "io", "est", "soll", "ist"}
)


def _compounding(word: str) -> bool:
    """Tell whether a word may be part of another: any of a script without spaces, and the longer ones of Latin letters."""
    return len(word) >= _LEAST_OF_COMPOUND or not word.isascii() or word in _SHORT


_COMPOUND = sorted(
    (
        word
        for meaning, words in WORDS.items()
        for word in words
        if _compounding(word) and (meaning not in ("noise", "variant") or not word.isascii())
    ),
    key=len,
    reverse=True,
)
_UNIT_WORDS = {
    "s": "s sec secs second seconds",
    "ms": "msec millis millisec milliseconds",
    "us": "usec usecs micros microsec microseconds",
    "ns": "nsec nsecs nanosec nanosecs nanos nanosecond nanoseconds",
    "rad": "radian radians",
    "deg": "degree degrees grad",
    "rev": "turns",
    "counts": "counts cnt cnts ticks inc incs",
    "A": "a amps",
    "rad/s": "rads",
    "deg/s": "dps",
    "mdeg/s": "mdps",
    "%": "pct percent",
    "‰": "permille promille",
    "LSB": "lsb",
}
_NOT_IN_NAMES = frozenset(
    {"m", "d", "n", "k", "min", "mn", "kn", "turn", "100ns"}
)  # words and indices rather than units
_SUFFIX_UNITS = {
    word: unit
    for join in ("", "p")
    for unit in reversed(UNITS)
    if (word := re.sub("[ ^]", "", unit.lower()).replace("/", join)) not in _NOT_IN_NAMES
}
_SUFFIX_UNITS |= {word: unit for unit, words in _UNIT_WORDS.items() for word in words.split()}


_ROLE_WORDS = frozenset[str]().union(
    *(words for meaning, words in WORDS.items() if meaning not in QUANTITIES), {"d"}
)


@dataclass(frozen=True)
class ColumnName:
    """A column's name, understood as far as its words go."""

    column: str
    quantity: str  # "position", …, "other"; "" where no word is known
    origin: Origin
    motor: bool  # on the motor's side of the gear
    partial: bool  # a part of the torque, or a computed one
    filtered: bool
    label: tuple[str, ...]  # the words and numbers that are left: the joint
    role: tuple[str, ...]  # the words that say what it is, without the joint
    unit: str  # named by a part of the name; "" where no part does


def words_of(name: str) -> list[str]:
    """Return the words and numbers of a name in lower case: "measuredJointPos_A1" -> measured joint pos a 1."""
    words: list[str] = []
    name = _whole_words(plain_letters(name))
    for part in re.findall(r"\d+|[^\W\d_]+", name):
        pieces = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[^A-Z]+", part)
        whole = len(pieces) < 2 or canonical_unit(part) in UNITS  # mNm is a unit, not m and Nm
        for piece in [part] if whole else pieces:
            words += _parts(piece.lower())
    # "q_dot" and "q_ddot" are one word, and so is "d_q".
    for dots, joined in (
        (("q", "dot"), "dq"),
        (("q", "ddot"), "ddq"),
        (("d", "q"), "dq"),
        (("dd", "q"), "ddq"),
        (("q", "dd"), "ddq"),
        (("theta", "dot"), "dtheta"),
        (("d", "tau"), "dtau"),
        (("tau", "dot"), "dtau"),
    ):
        for k in range(len(words) - 1, 0, -1):
            if (words[k - 1], words[k]) == dots:
                words[k - 1 : k + 1] = [joined]
    return words


def _whole_words(name: str) -> str:
    """Return the name in which "NanoSec" and "nano_sec" are a single word."""
    return re.sub(
        r"(?i)(nano|micro|milli)[\s_]*(s(?:ec(?:ond)?s?)?)(?![a-z])",
        lambda m: (m[1] + m[2]).capitalize(),
        name,
    )


@lru_cache(maxsize=4096)
def _parts(word: str) -> tuple[str, ...]:
    """Return the known words that `word` is made of without a rest, else `word` alone."""
    if len(word) > 40 or word in ALL_WORDS or word in _SUFFIX_UNITS:
        return (word,)
    for first in _COMPOUND:
        if word.startswith(first) and len(word) > len(first):
            rest = _parts(word[len(first) :])
            if all(part in _KNOWN for part in rest):
                return (first, *rest)
    return (word,)


_KNOWN = frozenset(_COMPOUND) | _VARIANT | {"raw"}


_SIGNALS = {
    "position": "q",
    "velocity": "dq",
    "acceleration": "ddq",
    "torque": "tau",
    "current": "current",
    "time": "t",
}


def signal_of(column: str) -> str | None:
    """Return the signal of a log that a column of that name can be: "q", "q_ref", "dq", "tau", "t", …"""
    name = read_name(column)
    if name.quantity == "position" and name.origin == "commanded":
        return "q_ref"
    return _SIGNALS.get(name.quantity)


def read_name(column: str, unit: str = "") -> ColumnName:
    """Return what the name of a column says; `unit` is what the header adds to it."""
    words = words_of(column)
    held = set(words)
    nouns = [
        (k, quantity)
        for k, word in enumerate(words)
        for quantity, known in _NOUNS.items()
        if word in known and not (word in ("a", "j") and len(words) > 2)
    ]
    at, quantity = _head(nouns)
    path, _, last = column.rpartition(".")
    if quantity not in ("temperature", "other") and path and read_name(last).quantity == "time":
        quantity = "time"  # "q_meas.time" is the clock beside a position
    if not quantity:
        quantity = _without_noun(held)
    named, unit_words = _unit_in_name(column, quantity)
    # A unit in the header is stronger than a word: "temps (s)" is a time, in French.
    by_unit = quantity if quantity == "other" else _quantity_of(unit) or quantity
    misused = (
        {words[at]}
        if at is not None and quantity not in (by_unit, "time") and len(words[at]) > 1
        else set()
    )
    quantity = by_unit
    unit = unit or named
    quantity = quantity or _quantity_of(unit)
    desired = at is not None and "d" in words[at + 1 :]  # Franka Emika: q_d, tau_J_d
    commanded = bool(held & _COMMANDED) or desired or any(word.startswith("soll") for word in words)
    now = quantity not in ("", "current") and bool(held & {"current", "cur", "curr"})
    estimated = bool(held & _ESTIMATED)
    moves = quantity in ("position", "velocity", "acceleration")
    now = now or (estimated and moves)
    measured = bool(held & _MEASURED) or now or any(word.startswith("ist") for word in words)
    origin: Origin = "commanded" if commanded else "measured" if measured else "plain"
    places = {place for place, _ in nouns if words[place] not in misused}
    is_role = [
        k in places or word in _ROLE_WORDS or word in unit_words for k, word in enumerate(words)
    ]
    label = tuple(word for word, known in zip(words, is_role, strict=True) if not known)
    role = tuple(
        sorted(
            word
            for word, known in zip(words, is_role, strict=True)
            if known and word not in unit_words
        )
    )
    # Where both are recorded, q is the joint's position and theta the motor's (Spong 1987, eq. 1).
    motor = bool(held & (_MOTOR | {"theta", "dtheta"}))
    return ColumnName(
        column,
        quantity,
        origin,
        motor,
        bool(held & _PARTIAL) or (estimated and not moves),
        bool(held & _VARIANT),
        label,
        role,
        unit,
    )


def _without_noun(words: set[str]) -> str:
    """Return the quantity of a name without a noun: data sets of robot learning call positions states and actions."""
    return "position" if {"observation", "state"} <= words or words & {"action", "actions"} else ""


def _quantity_of(unit: str) -> str:
    known = UNITS.get(canonical_unit(unit))
    return "position" if unit == "counts" else known.quantity if known is not None else ""


def _head(nouns: Sequence[tuple[int, str]]) -> tuple[int | None, str]:
    """Return the head noun's place and the quantity."""
    found = {quantity for _, quantity in nouns}
    for whole in ("temperature", "other"):
        if whole in found:
            return None, whole
    motion = [noun for noun in nouns if noun[1] not in ("time", "index")]
    times = [noun for noun in nouns if noun[1] == "time"]
    if motion:
        return motion[-1]
    return times[0] if times else nouns[0] if nouns else (None, "")


def _unit_in_name(column: str, quantity: str) -> tuple[str, frozenset[str]]:
    """Return the unit that a part of the name is, and its words: "pos_deg" -> "deg".

    A single letter is a unit of the quantity that the name says, and nothing else.
    """
    parts = [
        part for part in re.split(r"[\W_]+", _whole_words(column)) if part and not part.isdecimal()
    ]
    if len(parts) > 2 and (ratio := canonical_unit(f"{parts[-2]}/{parts[-1]}".lower())) in UNITS:
        return ratio, frozenset(parts[-2:])
    within = (re.findall(r"[A-Z]?[a-z]+", part) for part in parts)
    pieces = [
        piece
        for part, own in zip(parts, within, strict=True)
        for piece in own
        if 1 < len(piece) < len(part)
    ]
    for piece in (*reversed(parts), *reversed(pieces)):  # mNm before Nm
        word = piece.lower()
        unit = _SUFFIX_UNITS.get(word, "")
        if not unit or (len(parts) + len(pieces) == 1 and quantity != "time") or piece == "a":
            continue
        relative = unit in ("%", "‰", "LSB")  # of a rated value that only the drive knows
        if relative or _quantity_of(unit) == quantity or (not quantity and len(word) > 1):
            return unit, frozenset({word, *words_of(piece)})
    return "", frozenset()
