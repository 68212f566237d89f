"""Read from a column's name which quantity it holds, whether it was measured, and of which joint.

A name is split into words: at signs, at changes of case, between letters and digits, and where a
run of letters consists of known words ("jointpos", "taucmd"). Known words (vocabulary.toml) give
the quantity, its source and its side; the other words and the numbers name the joint. The head noun
is the last one: a "torque current" is a current, a "current torque" a torque as it is now.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Literal

from pipelines.importers.config import NAMES
from pipelines.io.sandbox import parse_toml
from pipelines.io.units import UNITS, canonical_unit

Origin = Literal["measured", "plain", "commanded"]

QUANTITIES = ("position", "velocity", "acceleration", "torque", "current", "time", "index",
              "temperature", "other")  # fmt: skip
MOTION = ("position", "velocity", "acceleration")
_NARROW = {wide: wide - 0xFEE0 for wide in range(0xFF01, 0xFF5F) if chr(wide) != "，"}
_NARROW |= str.maketrans("【】〔〕", "[][]")
_LETTERS = str.maketrans({"ß": "ss", "ł": "l", "Ł": "L", "ı": "i"})
# Words of two letters and fewer that others are written to without a space.
_SHORT = frozenset(["q", "qd", "dq", "iq", "fb", "ff", "sp", "tq", "ee", "ft", "io"])
# Words and indices rather than units.
_NOT_IN_NAMES = frozenset(["m", "d", "n", "k", "min", "mn", "kn", "turn", "100ns", "arms"])
_JOINED = {  # pairs of words that are a single one
    ("q", "dot"): "dq", ("q", "ddot"): "ddq", ("d", "q"): "dq", ("dd", "q"): "ddq",
    ("q", "dd"): "ddq", ("theta", "dot"): "dtheta", ("d", "tau"): "dtau", ("tau", "dot"): "dtau",
}  # fmt: skip


@dataclass(frozen=True)
class ColumnName:
    """A column's name, understood as far as its words go."""

    column: str
    quantity: str  # "position", …, "other"; "" where no word is known
    origin: Origin
    motor: bool  # on the motor's side of the gear
    partial: bool  # a part of the torque, or a computed one
    filtered: bool
    label: tuple[str, ...]  # the remaining words and numbers: the joint
    role: tuple[str, ...]  # the known words, without the joint
    unit: str  # named by a part of the name; "" where no part does


@dataclass(frozen=True)
class Vocabulary:
    """The words of vocabulary.toml, without accents."""

    words: Mapping[str, frozenset[str]]  # quantities, "commanded", "measured", "joint", …
    sentences: Mapping[str, frozenset[str]]  # "generic", "gear", "plan", "void"
    messages: tuple[tuple[str, frozenset[str]], ...]  # that define SI units, each by its fields
    units: Mapping[str, str]  # words within a name that are units: "deg" and "degps"
    every: frozenset[str]
    roles: frozenset[str]  # words that are no quantity
    joined: tuple[str, ...]  # those that may be part of another, long ones first


def narrow_signs(text: str) -> str:
    """Return a text with wide letters and signs (Ａ, （, １, 【) as narrow ones in their places."""
    return text.translate(_NARROW)


def plain_letters(text: str) -> str:
    """Return a text without accents, wide letters and signs as narrow ones; a dotted φ is dφ."""
    split = unicodedata.normalize("NFD", narrow_signs(text))
    split = re.sub("([α-ω])\u0307", r"d\1", re.sub("([α-ω])\u0308", r"dd\1", split))
    bare = "".join(c for c in split if not "\u0300" <= c <= "\u036f")
    return unicodedata.normalize("NFC", bare).translate(_LETTERS)


@cache
def vocabulary() -> Vocabulary:
    """Return the words that are known, read once."""
    table = parse_toml(files("pipelines.importers").joinpath("vocabulary.toml").read_text("utf-8"))
    sentences, messages, named = (table.pop(key) for key in ("sentences", "messages", "units"))
    words = {meaning: frozenset(plain_letters(x).split()) for meaning, x in table.items()}
    every = frozenset[str]().union(*words.values())
    of_quantities = frozenset[str]().union(*(words[quantity] for quantity in QUANTITIES))
    alone = words["noise"] | words["variant"]
    parts = {w for w in every if not w.isascii()}
    parts |= {w for w in every - alone if len(w) > NAMES.short or w in _SHORT}
    units: dict[str, str] = {}
    for join in ("", "p"):
        for unit in reversed(UNITS):
            word = re.sub("[ ^]", "", unit.lower()).replace("/", join)
            units |= {} if word in _NOT_IN_NAMES else {word: unit}
    units |= {word: unit for unit, spelled in named.items() for word in spelled.split()}
    return Vocabulary(
        words=words,
        sentences={kind: frozenset(x.split()) for kind, x in sentences.items()},
        messages=tuple((name, frozenset(x.split())) for name, y in messages.items() for x in y),
        units=units,
        every=every,
        roles=(every - of_quantities) | {"d"},
        joined=tuple(sorted(parts, key=lambda word: (-len(word), word))),
    )


def words_of(name: str) -> list[str]:
    """Return the words and numbers of a name: "measuredJointPos_A1" -> measured joint pos a 1."""
    words: list[str] = []
    for part in re.findall(r"\d+|[^\W\d_]+", _whole_words(plain_letters(name))):
        pieces = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[^A-Z]+", part)
        whole = len(pieces) == 1 or canonical_unit(part) in UNITS  # mNm is a unit, not m and Nm
        for piece in [part] if whole else pieces:
            words += _parts(piece.lower())
    for pair, joined in _JOINED.items():
        for k in range(len(words) - 1, 0, -1):
            if (words[k - 1], words[k]) == pair:
                words[k - 1 : k + 1] = [joined]
    return words


def _whole_words(name: str) -> str:
    """Return the name in which "NanoSec" and "nano_sec" are a single word."""
    pattern = r"(?i)(nano|micro|milli)[\s_]*(s(?:ec(?:ond)?s?)?)(?![a-z])"
    return re.sub(pattern, lambda m: (m[1] + m[2]).capitalize(), name)


@cache
def _parts(word: str) -> tuple[str, ...]:
    """Return the known words that `word` consists of without a rest, else `word` alone."""
    known = vocabulary()
    if word.isdecimal() or word in known.every or word in known.units:
        return (word,)
    joinable = {*known.joined, *known.words["variant"], "raw"}
    for first in known.joined if len(word) <= NAMES.longest_word else ():
        if word.startswith(first) and len(word) > len(first):
            rest = _parts(word[len(first) :])
            if joinable.issuperset(rest):
                return (first, *rest)
    return (word,)


def read_name(column: str, unit: str = "") -> ColumnName:
    """Return what a column's name says; `unit` is what the header adds to it."""
    known, words = vocabulary().words, words_of(column)
    held = set(words)
    nouns = [
        (k, quantity)
        for k, word in enumerate(words)
        for quantity in QUANTITIES
        if word in known[quantity] and not (word in ("a", "j") and len(words) > NAMES.short)
    ]
    at, quantity = _head_noun(nouns)
    path, _, last = column.rpartition(".")
    if quantity not in ("temperature", "other") and path and read_name(last).quantity == "time":
        quantity = "time"  # "q_meas.time" is the clock beside a position
    # Data sets of robot learning call positions states and actions.
    if not quantity and ({"observation", "state"} <= held or held & {"action", "actions"}):
        quantity = "position"
    named, unit_words = _unit_in_name(column, quantity)
    # A unit in the header is stronger than a word: "temps (s)" is a time, in French.
    by_unit = quantity if quantity == "other" else quantity_of(unit) or quantity
    misused = at is not None and quantity not in (by_unit, "time") and len(words[at]) > 1
    unit = unit or named
    quantity = by_unit or quantity_of(unit)
    nouns_at = {k for k, _ in nouns if not (misused and words[k] == words[at or 0])}
    said = {
        k
        for k, word in enumerate(words)
        if k in nouns_at or word in vocabulary().roles or word in unit_words
    }
    estimated = bool(held & known["estimated"])  # a drive's motion from its encoder, or a torque
    return ColumnName(
        column,
        quantity,
        _origin(words, quantity, at, estimated),
        # Of two positions, q is the joint's and theta the motor's (Spong 1987, eq. 1).
        motor=bool(held & (known["motor"] | {"theta", "dtheta"})),
        partial=bool(held & known["partial"]) or (estimated and quantity not in MOTION),
        filtered=bool(held & known["variant"]),
        label=tuple(word for k, word in enumerate(words) if k not in said),
        role=tuple(sorted(words[k] for k in said if words[k] not in unit_words)),
        unit=unit,
    )


def _origin(words: Sequence[str], quantity: str, noun: int | None, estimated: bool) -> Origin:
    known, held = vocabulary().words, set(words)
    desired = noun is not None and "d" in words[noun + 1 :]  # Franka Emika: q_d, tau_J_d
    if held & known["commanded"] or desired or any(word.startswith("soll") for word in words):
        return "commanded"
    now = quantity not in ("", "current") and held & {"current", "cur", "curr"}
    by_word = held & known["measured"] or any(word.startswith("ist") for word in words)
    return "measured" if by_word or now or (estimated and quantity in MOTION) else "plain"


def quantity_of(unit: str) -> str:
    """Return the quantity of a unit; "" of any other word."""
    known = UNITS.get(canonical_unit(unit))
    return "position" if unit == "counts" else known.quantity if known is not None else ""


def _head_noun(nouns: Sequence[tuple[int, str]]) -> tuple[int | None, str]:
    """Return the head noun's place and the quantity."""
    found = {quantity for _, quantity in nouns}
    for whole in ("temperature", "other"):
        if whole in found:
            return None, whole
    motion = [noun for noun in nouns if noun[1] not in ("time", "index")]
    times = [noun for noun in nouns if noun[1] == "time"]
    # A "time index" counts, a "sample time" does not.
    counts = [n for n in nouns[-1:] if n[1] == "index" and (n[0] - 1, "time") in nouns]
    chosen = motion[-1:] or counts or times[:1] or nouns[:1]
    return chosen[0] if chosen else (None, "")


def _unit_in_name(column: str, quantity: str) -> tuple[str, frozenset[str]]:
    """Return the unit that a part of the name is, and its words: "pos_deg" -> "deg".

    A single letter is a unit of the quantity that the name says, and nothing else.
    """
    split = re.split(r"[\W_]+", _whole_words(column))
    parts = [part for part in split if part and not part.isdecimal()]
    if len(parts) > NAMES.short:
        ratio = canonical_unit(f"{parts[-2]}/{parts[-1]}".lower())
        if ratio in UNITS:
            return ratio, frozenset(parts[-2:])
    found = ((piece, part) for part in parts for piece in re.findall(r"[A-Z]?[a-z]+", part))
    pieces = [piece for piece, part in found if 1 < len(piece) < len(part)]
    for piece in (*reversed(parts), *reversed(pieces)):  # mNm before Nm
        word = piece.lower()
        unit = vocabulary().units.get(word, "")
        if not unit or (len(parts) + len(pieces) == 1 and quantity != "time") or piece == "a":
            continue
        relative = unit in ("%", "‰", "LSB")  # of a rated value that only the drive knows
        if relative or quantity_of(unit) == quantity or (not quantity and len(word) > 1):
            return unit, frozenset({word, *words_of(piece)})
    return "", frozenset()
