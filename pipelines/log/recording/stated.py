"""Read what a file states of its numbers in plain text: units, the rate, counts a turn, gears.

Comments, lines above the table and entries of metadata ("physics_dt = 0.008") are cut into clauses. A clause
states a unit for the quantity of that unit, or of the column that it names; a clause that speaks of other
things (the tool's pose, a filter) states nothing of the joints, and one with a negation nothing at all.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pipelines.log.recording.column_names import (
    WORDS,
    narrow_signs,
    plain_letters,
    read_name,
    words_of,
)
from pipelines.log.units import UNITS, canonical_unit

__all__ = [
    "Statement",
    "stated_counts",
    "stated_gear",
    "stated_of_some_joints",
    "stated_rate",
    "stated_scale",
    "stated_unit",
]

_NUMBER = r"(?<![\w.,:])([+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)(?![\d:])"
_COUNT = r"(?:counts?|ticks?|cnts?|cts|steps?|incs?|increments?|inkremente?|incrementi?|lsb|units?|digits?|bits?)"
_TURN = r"(?:rev\w*|turn\w*|umdr\w*|u\b|r\b|tours?\b|giro\b|vuelta\b|圈|转|回転|360)"
_PER = r"\s*(?:/|\bper\b|\bpro\b|\bpar\b|\bpor\b|\bal?\b|\bje\b|_per_)\s*"
_COUNTS = (re.compile(rf"{_NUMBER}\s*{_COUNT}{_PER}(?:one |full |motor |joint )?{_TURN}"),
           re.compile(rf"\b(?:cpr|counts?{_PER}{_TURN}|ticks?{_PER}{_TURN})\W*{_NUMBER}"),
           re.compile(rf"{_NUMBER}\s*cpr\b"))  # fmt: skip
_BITS = re.compile(r"(?<![\d.])(\d\d)[ -]?bit")
_SCALE = (re.compile(rf"{_NUMBER}\s*([^\W\d][^\s\d/]*){_PER}(?:one )?{_COUNT}\b"),
          re.compile(rf"(?<![\w.])1 ?{_COUNT}\s*(?:=|is|corresponds to|equals)\s*{_NUMBER}\s*([^\W\d][^\s\d,;]*)"))  # fmt: skip
_RATIO = re.compile(r"(?<![\d:.])(\d+(?:[.,]\d+)?)\s*:\s*(\d+(?:[.,]\d+)?)(?![\d:])")
_QUANTITY = re.compile(
    rf"{_NUMBER}\s*(k?hz|fps|sps|[mµμu]?s(?:ec\w*)?|milli\w+|micro\w+|毫秒|ミリ秒|秒)?(?![\w/])"
)
_FRACTION = re.compile(
    r"(?<![\w./])1\.?0* ?/ ?(\d+)\.?0*(?![\w./])(?: ?s(?:ec\w*)?\b)?"
)  # of a second, as programs write a step
_THINNED = re.compile(
    r"decimat\w*+\W++(?!1\b)|(?:down.?|sub)sampl|every (?:\d+(?:st|nd|rd|th)|second |other|tenth)|jede[rn]? \d"
)
_GENERIC = frozenset({
    "all", "alle", "are", "base", "column", "columns", "data", "each", "einheit", "einheiten", "in", "is", "of",
    "otherwise", "si", "signals", "stated", "the", "to", "todas", "toutes", "unidad", "unidades", "unit", "unita", "unite",
    "unites", "units", "unless", "value", "values", "单位", "単位",
})  # fmt: skip
_UNIT_OF_NAME = re.compile(r"[a-z].*[\[(_ ](k?hz|[mµμu]?s)(?:[\])]|\b)(?=[^a-z]*$)")
_GEARS = frozenset({
    "gear", "gears", "gearbox", "gearing", "reduction", "reducer", "planetary", "harmonic", "getriebe",
    "untersetzung", "ubersetzung", "reducteur", "reductor", "riduttore", "riduzione", "reduccion", "减速比", "減速比",
})  # fmt: skip
_SAMPLED = re.compile(r"sampl|\bf_?s\b|\bt_?s\b|\bdt\b|_dt\b|\bfps\b|\brate\b|logg|record|acqui|scan|abtast|takt|zyklus|cycle|"
                      r"echantillon|cadence|muestre|campion|amostra|bemonster|"
                      r"probkow|vzorkov|ornekleme|дискрет|采样|サンプリング|샘플링|interval|period|timestep|time step|"
                      r"step_?(?:size|time)|delta_x")  # fmt: skip
_NOT_SAMPLED = re.compile(r"filter|cut.?off|low.?pass|pwm|bandwidth|excit|sine|chirp|resonan|control|servo|count\b|duration|start|"
                          r"offset|length|fourier|\bfor\b|baud|regel|"
                          r"frequency of|trajectory|camera|buffer|update|inner|current loop")  # fmt: skip
_VOID = frozenset({
    "before", "but", "conversion", "convert", "converted", "display", "displayed", "either", "except", "from", "gui",
    "kein", "likely", "maybe", "multiply", "nicht", "no", "non", "not", "or", "originally", "pas", "plot", "plots", "print",
    "home", "initial", "offset", "start", "zero",
    "printed", "probably", "raw", "show", "shown", "shows", "todo", "unknown", "was", "were",
})  # fmt: skip
_SI = re.compile(
    r"\bsi[ -](?:base )?(?:units?|einheiten|unites?)\b|\b(?:units?|einheiten|unites?|unidades|unita)\W+(?:\w+ )?si\b"
)
_SI_UNITS = {"position": "rad", "velocity": "rad/s", "torque": "N m", "current": "A", "time": "s"}
_LONGEST = 300  # characters of a line that is read
_OF_EACH = frozenset({"per", "pro", "par", "por", "je", "a", "/", "1"})
_STEPS = ("dt", "ts", "step", "interval", "period")
_SLOWEST, _FASTEST = 1.0, 1e5  # [Hz] what robots are recorded at


@dataclass(frozen=True)
class Statement:
    """A value and the words of the file that state it."""

    value: str
    words: str
    number: float = math.nan


def _clauses(notes: Sequence[str]) -> Iterator[str]:
    """Yield the parts of lines that say one thing each; a line of two cells is a name and its value."""
    for line in notes:
        text = narrow_signs(line).strip().lstrip("#%/*!;\"' ").strip(" ,;\t\"'")[:_LONGEST]
        cells = [
            cell.strip() for cell in re.split(r"[;\t]|,(?!\d)|(?<=[^\W\d]),", text) if cell.strip()
        ]
        if len(cells) > 1 and all(
            re.fullmatch(r"[+-]?\d\S*( ?[^\W\d]+)?", cell)
            for cell in cells[1 : 2 + (len(cells) > 3)]
        ):
            yield " ".join(cells)
            continue
        before = ""
        for part in map(
            str.strip, re.split(r"[;\t|、，；]|,(?!\d)|\.\s|\s/\s|\bund\b|\band\b|\bet\b", text)
        ):
            if (
                canonical_unit(part.strip("[]() ")) in UNITS
            ):  # "pose in mm and rad": a further unit of the same
                yield f"{before} {part}".strip()
            elif part:
                before = part.rpartition(" ")[0]
                yield part


def _words(clause: str) -> set[str]:
    return set(words_of(clause)) | set(re.findall(r"[^\W\d_]+", plain_letters(clause).lower()))


def _units(clause: str) -> Iterator[tuple[str, str]]:
    """Yield (unit, words before it but for other units) of the units in a clause that stand for themselves, not behind a number.

    A single letter is one in brackets or behind "in", "unit" or a colon; the clause "Nm" is a unit alone.
    """
    pieces = re.findall(r"[\[(][^\])(\[]{1,20}[\])]|[^\s\[\]()]+", clause)
    pieces = [piece for piece in pieces if re.search(r"[\w°/]", piece)]
    k, words = 0, list[str]()
    while k < len(pieces):
        for length in (3, 2, 1):
            said = pieces[k : k + length]
            bare = " ".join(said).strip(".,:=\"'")
            unit = canonical_unit(bare.strip("[]() "))
            before = pieces[k - 1].lower() if k else ""
            behind = pieces[k + length].strip("=:") if k + length < len(pieces) else ""
            number = (
                any(re.match(r"[+-]?\d", word) for word in (before.strip("=:±~"), behind))
                or before in _OF_EACH
            )
            named = (
                bare[:1] in "[("
                or re.fullmatch(r"in|en|em|units?|einheit(?:en)?|.*[:=]", before)
                or len(pieces) == 1
            )
            if (
                len(said) == length
                and unit in UNITS
                and not number
                and (named or (len(unit) > 1 and bare.lower() != "min"))
            ):
                yield unit, " ".join(words)
                k += length - 1
                break
        else:
            words.append(pieces[k])
        k += 1


def stated_unit(
    notes: Sequence[str], quantity: str, linear: bool = False, motor: bool = False
) -> Statement | None:
    """Return the unit of a quantity that the file states, its value "" where two lines disagree.

    Args:
        linear: of joints that slide.
        motor: of the motors, by the names of the columns.
    """
    found: dict[str, str] = {}
    for clause in _clauses(notes):
        words = _words(clause)
        if (
            words & _VOID
            or (words & WORDS["other"]) - {"data"}
            or words & (WORDS["temperature"] | _GEARS)
        ):
            continue
        ordered = bool(words & WORDS["commanded"]) and not words & WORDS["measured"]
        of_motor = bool(words & WORDS["motor"]) and not words & WORDS["joint"]
        if (
            ordered
            or (of_motor and not motor)
            or (quantity == "torque" and words & WORDS["partial"])
        ):
            continue
        if _SI.search(plain_letters(clause).lower()) and quantity in _SI_UNITS and not linear:
            found.setdefault(_SI_UNITS[quantity], clause)
        for unit, before in _units(clause):
            own = UNITS[unit].quantity
            beside = {word for word in _words(before) if not word.isdecimal()}
            told = read_name(before).quantity == own or beside <= _GENERIC | WORDS["joint"] | {
                unit.lower()
            }
            if (
                own == quantity
                and told
                and (own != "position" or linear == (unit in ("m", "cm", "mm", "um")))
            ):
                found.setdefault(canonical_unit(unit), clause)
    if not found:
        return None
    same = len({UNITS[unit] for unit in found}) == 1
    return Statement(
        next(iter(found)) if same else "",
        " and ".join(f"'{words}'" for words in dict.fromkeys(found.values())),
    )


def stated_rate(notes: Sequence[str]) -> Statement | None:
    """Return the rate of the samples [Hz] that the file states as such, or by their interval; nan where it states two."""
    found: dict[float, str] = {}
    for clause in _clauses(notes):
        text = _FRACTION.sub(r"\1 hz", plain_letters(clause).lower())
        if _THINNED.search(text):
            found.setdefault(math.nan, clause)
        if not _SAMPLED.search(text) or _NOT_SAMPLED.search(text):
            continue
        named = _UNIT_OF_NAME.search(text)
        for number, unit in _QUANTITY.findall(text):
            rate = _rate_of(_number(number), unit or (named[1] if named else ""), text)
            if _SLOWEST <= rate <= _FASTEST:
                found.setdefault(rate, clause)
    if not found:
        return None
    rates = list(found)
    same = not any(math.isnan(rate) or abs(rate / rates[0] - 1.0) > 0.02 for rate in rates)
    words = " and ".join(f"'{clause}'" for clause in dict.fromkeys(found.values()))
    return Statement(f"{rates[0]:g}", words, rates[0]) if same else Statement("", words)


def _rate_of(number: float, unit: str, text: str) -> float:
    """Return the rate [Hz] of a number with its unit, 0 where it is none."""
    if number <= 0.0:
        return 0.0
    if unit in ("hz", "fps", "sps", "khz"):
        return number * (1e3 if unit == "khz" else 1.0)
    interval = bool(set(re.findall(r"[a-z]+", text)) & set(_STEPS))
    if unit:
        known = UNITS.get(canonical_unit(unit))
        return (
            1.0 / (number * known.factor) if known is not None and known.quantity == "time" else 0.0
        )
    if interval:  # a step without a unit is in s, as programs write it
        return 1.0 / number if number < 1.0 else 0.0
    return number if re.search(r"rate|fps|\bf_?s\b|freq", text) and number >= 1.0 else 0.0


def stated_of_some_joints(notes: Sequence[str], n: int) -> list[str]:
    """Return the sentences about some of `n` joints alone, by number, and not about a unit: what they say, a person must read."""
    of_joint, found = (WORDS["joint"] | {"q"}) - {"a"}, []
    for clause in _clauses(notes):
        words = words_of(clause[:_LONGEST])
        numbers = {
            number
            for word, number in itertools.pairwise(words)
            if word in of_joint and number.isdecimal()
        }
        more = {word for word in words if not word.isdecimal()} - of_joint - WORDS["noise"]
        if 0 < len(numbers) < n and len(more) > 2 and not any(_units(clause)):
            found.append(clause.strip("#%/*!;\"' \t,")[:_LONGEST])
    return found


def stated_counts(notes: Sequence[str]) -> Statement | None:
    """Return the counts of one turn of an encoder that the file states, its number nan where it states several."""
    found: dict[float, str] = {}
    for clause in _clauses(notes):
        text = plain_letters(clause).lower()
        for pattern in _COUNTS:
            for number in pattern.findall(text):
                found.setdefault(_number(number), clause)
        if _words(clause) & {"encoder", "resolution", "enc", "drehgeber", "codeur", "absolute"}:
            for bits in _BITS.findall(text):
                found.setdefault(2.0 ** int(bits), clause)
    for scale in stated_scale(notes, "position"):
        if canonical_unit(scale.value) in UNITS:
            found.setdefault(
                2.0 * math.pi / (scale.number * UNITS[canonical_unit(scale.value)].factor),
                scale.words,
            )
    return _only(found)


def _only(found: dict[float, str]) -> Statement | None:
    numbers = list(found)
    if not numbers:
        return None
    same = all(abs(number / numbers[0] - 1.0) < 1e-3 for number in numbers)
    words = " and ".join(f"'{clause}'" for clause in dict.fromkeys(found.values()))
    return Statement(f"{numbers[0]:.10g}", words, numbers[0]) if same else Statement("", words)


def stated_scale(notes: Sequence[str], quantity: str) -> list[Statement]:
    """Return what one unit of a raw number is, as "2.69 mA per unit": its unit, and how many of it."""
    found = []
    for clause in _clauses(notes):
        for pattern in _SCALE:
            for number, unit in pattern.findall(clause):
                known = canonical_unit(unit)
                if known in UNITS and UNITS[known].quantity == quantity:
                    found.append(Statement(known, clause, _number(number)))
    return found


def stated_gear(notes: Sequence[str]) -> Statement | None:
    """Return the ratio of the gears that the file states: "6:1", "1:101", "gear ratio 50"; nan where it states several."""
    found: dict[float, str] = {}
    for line in notes:
        if _words(line[:_LONGEST]) & _GEARS:
            ratios = [max(map(_number, pair)) for pair in _RATIO.findall(line[:_LONGEST])]
            for ratio in ratios or map(_number, re.findall(_NUMBER, line[:_LONGEST])):
                found.setdefault(ratio, line.strip("#%/*!;\"' \t,")[:_LONGEST])
    return _only(found)


def _number(text: str) -> float:
    return float(text.replace(",", "."))
