"""Read what a file states of its numbers in plain text: units, the rate, counts a turn, gears.

Comments, lines above the table and entries of metadata ("physics_dt = 0.008") are cut into clauses.
A clause states a unit for the quantity of that unit, or of the column that it names; a clause about
other things (the tool's pose, a filter) states nothing of the joints, and one with a negation
nothing at all.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from pipelines.importers.config import NOTES
from pipelines.importers.names import narrow_signs, plain_letters, read_name, vocabulary, words_of
from pipelines.io.units import UNITS, canonical_unit

_NUMBER = r"(?<![\w.,:])([+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)(?![\d:])"
_COUNT = (
    r"(?:counts?|ticks?|cnts?|cts|steps?|incs?|increments?|inkremente?|incrementi?|lsb|units?"
    r"|digits?|bits?)"
)
_TURN = r"(?:rev\w*|turn\w*|umdr\w*|u\b|r\b|tours?\b|giro\b|vuelta\b|圈|转|回転|360)"
_PER = r"\s*(?:/|\bper\b|\bpro\b|\bpar\b|\bpor\b|\bal?\b|\bje\b|_per_)\s*"
_COUNTS = (
    re.compile(rf"{_NUMBER}\s*{_COUNT}{_PER}(?:one |full |motor |joint )?{_TURN}"),
    re.compile(rf"\b(?:cpr|counts?{_PER}{_TURN}|ticks?{_PER}{_TURN})\W*{_NUMBER}"),
    re.compile(rf"{_NUMBER}\s*cpr\b"),
)
_BITS = re.compile(r"(?<![\d.])(\d\d)[ -]?bit")
_EQUALS = r"\s*(?:=|is|corresponds to|equals)\s*"
_SCALE = (
    re.compile(rf"{_NUMBER}\s*([^\W\d][^\s\d/]*){_PER}(?:one )?{_COUNT}\b"),
    re.compile(rf"(?<![\w.])1 ?{_COUNT}{_EQUALS}{_NUMBER}\s*([^\W\d][^\s\d,;]*)"),
)
_RATIO = re.compile(r"(?<![\d:.])(\d+(?:[.,]\d+)?)\s*:\s*(\d+(?:[.,]\d+)?)(?![\d:])")
_QUANTITY = re.compile(
    rf"{_NUMBER}\s*(k?hz|fps|sps|[mµμu]?s(?:ec\w*)?|milli\w+|micro\w+|毫秒|ミリ秒|秒)?(?![\w/])"
)
# Of a second, as programs write a step.
_FRACTION = re.compile(r"(?<![\w./])1\.?0* ?/ ?(\d+)\.?0*(?![\w./])(?: ?s(?:ec\w*)?\b)?")
_THINNED = re.compile(
    r"decimat\w*+\W++(?!1\b)|(?:down.?|sub)sampl|every (?:\d+(?:st|nd|rd|th)|second |other|tenth)"
    r"|jede[rn]? \d"
)
_UNIT_OF_NAME = re.compile(r"[a-z].*[\[(_ ](k?hz|[mµμu]?s)(?:[\])]|\b)(?=[^a-z]*$)")
_SAMPLED = re.compile(
    r"sampl|\bf_?s\b|\bt_?s\b|\bdt\b|_dt\b|\bfps\b|\brate\b|logg|record|acqui|scan|abtast|takt"
    r"|zyklus|cycle|echantillon|cadence|muestre|campion|amostra|bemonster|probkow|vzorkov|ornekleme"
    r"|дискрет|采样|サンプリング|샘플링|interval|period|timestep|time step|step_?(?:size|time)"
    r"|delta_x"
)
_NOT_SAMPLED = re.compile(
    r"filter|cut.?off|low.?pass|pwm|bandwidth|excit|sine|chirp|resonan|control|servo|count\b"
    r"|duration|start|offset|length|fourier|\bfor\b|baud|regel|frequency of|trajectory|camera"
    r"|buffer|update|inner|current loop"
)
_STEP = frozenset({"dt", "ts", "step", "interval", "period"})
_SI = re.compile(
    r"\bsi[ -](?:base )?(?:units?|einheiten|unites?)\b"
    r"|\b(?:units?|einheiten|unites?|unidades|unita)\W+(?:\w+ )?si\b"
)
_SI_UNITS = {"position": "rad", "velocity": "rad/s", "torque": "N m", "current": "A", "time": "s"}
_OF_EACH = frozenset({"per", "pro", "par", "por", "je", "a", "/", "1"})
_AROUND = "#%/*!;\"' \t,"  # a comment


@dataclass(frozen=True)
class Statement:
    """A value and the words of the file that state it."""

    value: str
    words: str
    number: float = math.nan


def _clauses(notes: Sequence[str]) -> Iterator[str]:
    """Yield the parts of lines that say one thing each; two cells are a name and its value."""
    for line in notes:
        text = narrow_signs(line).replace('",', '";').strip().lstrip("#%/*!;\"' ")
        text = text.strip(" ,;\t\"'")[: NOTES.longest]
        split = re.split(r"[;\t]|,(?!\d)|(?<=[^\W\d]),", text)
        cells = [cell.strip() for cell in split if cell.strip()]
        values = cells[1:3] if cells[3:] else cells[1:2]
        if values and all(re.fullmatch(r"[+-]?\d\S*( ?[^\W\d]+)?", cell) for cell in values):
            yield " ".join(cells)
            continue
        before = ""
        ends = r"[;\t|、，；]|,(?!\d)|\.\s|\s/\s|\bund\b|\band\b|\bet\b"
        for part in map(str.strip, re.split(ends, text)):
            if canonical_unit(part.strip("[]() ")) in UNITS:  # "pose in mm and rad"
                yield f"{before} {part}".strip()
            elif part:
                before = part.rpartition(" ")[0]
                yield part


def _words(clause: str) -> set[str]:
    return set(words_of(clause)) | set(re.findall(r"[^\W\d_]+", plain_letters(clause).lower()))


def _units(clause: str) -> Iterator[tuple[str, str]]:
    """Yield (unit, words before it but for other units) of a clause, of units without a number.

    A single letter is one in brackets or behind "in", "unit" or a colon; "Nm" alone is a unit.
    """
    pieces = re.findall(r"[\[(][^\])(\[]{1,20}[\])]|[^\s\[\]()]+", clause)
    pieces = [piece for piece in pieces if re.search(r"[\w°/]", piece)]
    k, words = 0, list[str]()
    while k < len(pieces):
        before = pieces[k - 1].lower() if k else ""
        for length in (3, 2, 1):
            said = pieces[k : k + length]
            bare = " ".join(said).strip(".,:=\"'")
            unit = canonical_unit(bare.strip("[]() "))
            if len(said) < length or unit not in UNITS:
                continue
            behind = pieces[k + length].strip("=:") if k + length < len(pieces) else ""
            beside = (before.strip("=:±~"), behind)
            if before in _OF_EACH or any(re.match(r"[+-]?\d", word) for word in beside):
                continue
            announced = re.fullmatch(r"in|en|em|units?|einheit(?:en)?|.*[:=]", before)
            named = bare[:1] in "[(" or announced or len(pieces) == 1
            if named or (len(unit) > 1 and bare.lower() != "min"):
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
        if words & vocabulary().sentences["void"] or (words & vocabulary().words["other"]) - {
            "data"
        }:
            continue
        if words & (vocabulary().words["temperature"] | vocabulary().sentences["gear"]):
            continue
        ordered = (
            words & vocabulary().words["commanded"] and not words & vocabulary().words["measured"]
        )
        of_motor = (
            words & vocabulary().words["motor"]
            and not words & vocabulary().words["joint"]
            and not motor
        )
        if ordered or of_motor or (quantity == "torque" and words & vocabulary().words["partial"]):
            continue
        if _SI.search(plain_letters(clause).lower()) and quantity in _SI_UNITS and not linear:
            found.setdefault(_SI_UNITS[quantity], clause)
        for unit, before in _units(clause):
            if UNITS[unit].quantity != quantity:
                continue
            beside = {word for word in _words(before) if not word.isdecimal()}
            generic = beside <= vocabulary().sentences["generic"] | vocabulary().words["joint"] | {
                unit.lower()
            }
            fits = quantity != "position" or linear == (unit in ("m", "cm", "mm", "um"))
            if fits and (generic or read_name(before).quantity == quantity):
                found.setdefault(canonical_unit(unit), clause)
    if not found:
        return None
    same = len({UNITS[unit] for unit in found}) == 1
    return Statement(next(iter(found)) if same else "", _quoted(found.values()))


def _quoted(clauses: Iterable[str]) -> str:
    return " and ".join(f"'{clause}'" for clause in dict.fromkeys(clauses))


def _only(found: dict[float, str], tolerance: float, form: str) -> Statement | None:
    """Return the only number of those found with its words; without a number where they differ."""
    found = {number: clause for number, clause in found.items() if number != 0.0}
    if not found:
        return None
    first = next(iter(found))
    if not all(abs(number / first - 1.0) <= tolerance for number in found):
        return Statement("", _quoted(found.values()))
    return Statement(format(first, form), _quoted(found.values()), first)


def stated_rate(notes: Sequence[str]) -> Statement | None:
    """Return the rate of the samples [Hz] that the file states, as such or by their interval.

    Its number is nan where the file states two.
    """
    found: dict[float, str] = {}
    for clause in _clauses(notes):
        text = _FRACTION.sub(r"\1 hz", plain_letters(clause).lower())
        if _THINNED.search(text):
            found.setdefault(math.nan, clause)
        if not _SAMPLED.search(text) or _NOT_SAMPLED.search(text):
            continue
        named = _UNIT_OF_NAME.search(text)
        for digits, behind in _QUANTITY.findall(text):
            number, unit = _number(digits), behind or (named[1] if named else "")
            known, rate = UNITS.get(canonical_unit(unit)), 0.0
            if unit in ("hz", "fps", "sps", "khz"):
                rate = number * (1e3 if unit == "khz" else 1.0)
            elif known is not None and known.quantity == "time" and number > 0.0:
                rate = 1.0 / (number * known.factor)
            elif not unit and _STEP & set(re.findall(r"[a-z]+", text)):
                rate = 1.0 / number if 0.0 < number < 1.0 else 0.0  # [s], as programs write it
            elif not unit and re.search(r"rate|fps|\bf_?s\b|freq", text):
                rate = number
            if NOTES.slowest <= rate <= NOTES.fastest:
                found.setdefault(rate, clause)
    return _only(found, 0.02, "g")


def stated_of_some_joints(notes: Sequence[str], n: int) -> list[str]:
    """Return the sentences about some of `n` joints alone, by number, and not about a unit.

    A person must read them.
    """
    of_joint, found = (vocabulary().words["joint"] | {"q"}) - {"a"}, []
    for clause in _clauses(notes):
        words = words_of(clause[: NOTES.longest])
        pairs = itertools.pairwise(words)
        numbers = {number for word, number in pairs if word in of_joint and number.isdecimal()}
        more = (
            {word for word in words if not word.isdecimal()}
            - of_joint
            - vocabulary().words["noise"]
        )
        if 0 < len(numbers) < n and len(more) >= NOTES.fewest_words and not any(_units(clause)):
            found.append(clause.strip(_AROUND)[: NOTES.longest])
    return found


def stated_counts(notes: Sequence[str]) -> Statement | None:
    """Return the counts of one turn of an encoder that the file states, nan where several."""
    found: dict[float, str] = {}
    encoder = {"encoder", "resolution", "enc", "drehgeber", "codeur", "absolute"}
    for clause in _clauses(notes):
        text = plain_letters(clause).lower()
        for pattern in _COUNTS:
            for number in pattern.findall(text):
                found.setdefault(_number(number), clause)
        if _words(clause) & encoder:
            for bits in _BITS.findall(text):
                found.setdefault(2.0 ** int(bits), clause)
    for scale in stated_scale(notes, "position"):
        if size := scale.number * UNITS[scale.value].factor:
            found.setdefault(2.0 * math.pi / size, scale.words)
    return _only(found, 1e-3, ".10g")


def stated_scale(notes: Sequence[str], quantity: str) -> list[Statement]:
    """Return the value of one unit of a raw number, as "2.69 mA per unit": unit and number."""
    found = []
    for clause in _clauses(notes):
        for number, name in (pair for pattern in _SCALE for pair in pattern.findall(clause)):
            unit = canonical_unit(name)
            if unit in UNITS and UNITS[unit].quantity == quantity:
                found.append(Statement(unit, clause, _number(number)))
    return found


def stated_gear(notes: Sequence[str]) -> Statement | None:
    """Return the gear ratio that the file states: "6:1", "1:101", "gear ratio 50"."""
    found: dict[float, str] = {}
    for note in notes:
        line = note[: NOTES.longest]
        if _words(line) & vocabulary().sentences["gear"]:
            ratios = [max(map(_number, pair)) for pair in _RATIO.findall(line)]
            for ratio in ratios or map(_number, re.findall(_NUMBER, line)):
                found.setdefault(ratio, note.strip(_AROUND)[: NOTES.longest])
    return _only(found, 1e-3, ".10g")


def _number(text: str) -> float:
    return float(text.replace(",", "."))
