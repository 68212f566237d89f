"""Turn the units people write into SI, at the edge of the files only."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from pipelines.errors import InputRejected, did_you_mean


@dataclass(frozen=True)
class Unit:
    """SI value = factor · value + offset, of a quantity of `schema.SIGNALS`."""

    quantity: str
    factor: float
    offset: float = 0.0

    @property
    def is_si(self) -> bool:
        return self.factor == 1.0 and self.offset == 0.0


# [N] per kgf and lbf: NIST SP 811 (2008), table B.8. A factor, or "/" and parts of a turn.
_FACTORS: Final = {
    "time": "s 1, ms 1e-3, us 1e-6, ns 1e-9, 100 ns 1e-7, min 60, d 86400",
    "position": "rad 1, mrad 1e-3, deg /360, ° /360, rev /1, turn /1, mdeg /360e3, arcmin /21600, "
    "arcsec /1296e3, m 1, cm 1e-2, mm 1e-3, um 1e-6",
    "velocity": "rad/s 1, deg/s /360, rpm /60, rev/s /1, mrad/s 1e-3, mdeg/s /360e3, m/s 1, "
    "cm/s 1e-2, mm/s 1e-3",
    "acceleration": "rad/s^2 1, deg/s^2 /360, rev/s^2 /1, m/s^2 1, mm/s^2 1e-3",
    "torque": "N m 1, mN m 1e-3, N mm 1e-3, N cm 1e-2, kN m 1e3, cN m 1e-2, uN m 1e-6, "
    "kgf m 9.80665, kgf cm 0.0980665, lbf ft 1.3558179483314004, lbf in 0.1129848290276167, "
    "ozf in 0.007061551814226044, N 1, mN 1e-3, kN 1e3",
    "current": "A 1, mA 1e-3, Arms 1",  # what it is times: N m per A rms
    "temperature": "degC 1, °C 1, K 1",
}


def _units() -> Iterator[tuple[str, Unit]]:
    for quantity, units in _FACTORS.items():
        for name, _, number in (unit.rpartition(" ") for unit in units.split(", ")):
            turns = number.removeprefix("/")
            factor = 2.0 * math.pi / float(turns) if turns != number else float(number)
            yield name, Unit(quantity, factor, -273.15 if name == "K" else 0.0)


UNITS: Final[dict[str, Unit]] = dict(_units())
_SPELLINGS: Final = str.maketrans(
    {"·": " ", "*": " ", "⋅": " ", "•": " ", "∙": " ", "・": " ", "²": "^2", "\u03bc": "µ"}
)
_OTHER_SPELLINGS: Final = {
    "rad": "弧度, ラジアン, рад, radians, radianes, radianti, radianos",
    "deg": "°, Grad, 度, град, град., grados, degrés, gradi, graus, graden, grader, stopnie",
    "rad/s": "弧度/秒, 弧度/s, рад/с",
    "deg/s": "Grad/s, 度/秒, 度/s, град/с, grados/s, degrés/s, gradi/s",
    "rpm": "1/min, U/min, r/min, 转/分, об/мин, tr/min, giri/min, obr/min, ot/min",
    "rad/s^2": "rad/s2",
    "deg/s^2": "deg/s2",
    "m/s^2": "m/s2",
    "s": "秒, с, Sekunden, secondes, segundos, secondi",
    "ms": "毫秒, ミリ秒, мс",
    "us": "µs, 微秒",
    "N m": "牛米, 牛 米, 牛顿米, Нм, Н м",
    "N mm": "Nmm, N.mm",
    "N cm": "Ncm, N.cm",
    "A": "安, 安培, А",
    "mA": "毫安, мА",
    "degC": "℃",
}
_ALIASES: Final = {
    word: unit for unit, words in _OTHER_SPELLINGS.items() for word in words.split(", ")
}
_WORDS: Final = (
    (r"\s*\b(?:per|pro|par|por|al)\b\s*|\s*/\s*", "/"),
    (r"\bmilli[ -]?(?=deg|rad|newton|amp|sec|met)", "m"),
    (r"\bmicro[ -]?(?=sec|met|newton)", "u"),
    (r"\bnano[ -]?(?=sec)", "n"),
    (r"\bcenti[ -]?(?=met|newton)", "c"),
    (r"newton[ -]?met(?:er|re)s?\b", "N m"),
    (r"newtons?\b", "N"),
    (r"met(?:er|re)s?\b", "m"),
    (r"deg(?:ree)?s?\b", "deg"),
    (r"rad(?:ian)?s?\b", "rad"),
    (r"\b(?:rev(?:olution)?|turn)s?\b", "rev"),
    (r"sec(?:ond)?s?\b", "s"),
    (r"amp(?:ere)?s?\b", "A"),
    (r"°", "deg"),
    (r"/s/s\b|/s\^?2\b", "/s^2"),
    (r"\bdps\b", "deg/s"),
    (r"\brps\b", "rev/s"),
    (r"rev/min(?:ute)?\b", "rpm"),
    (r"^min(?:ute)?s?$", "min"),
    (r"\bkg(?=[ -])", "kgf"),
    (r"(?i)^a[ _-]?rms$", "Arms"),
    (r"\b(ft|in)[ -](lb|oz)[sf]?\b", r"\2f \1"),  # people write the arm on either side
    (r"\blbs?(?=[ -])", "lbf"),
    (r"\boz(?=[ -])", "ozf"),
    (r"(?<=f)-", " "),
    (r"^([mcuk]?)n[ .-]?m$", r"\1N m"),
)


_SHARE: Final = re.compile(r"(\d++(?:\.\d++)?|\.\d++)?\s*+(%|‰|pct|per ?cent)", re.IGNORECASE)
_RATED: Final = {"torque": "N m", "current": "A", "velocity": "rad/s"}
_NO_WORDS: Final = re.compile(r"[013-9]|^.?$")  # of a unit; "s2" has a digit


def canonical_unit(unit: str) -> str:
    """Return `unit` as `UNITS` spells it: "Nm" and "N·m" are "N m"."""
    name = " ".join(str(unit).translate(_SPELLINGS).split())
    return _ALIASES.get(name) or (
        name if name in UNITS or _NO_WORDS.search(name) else _in_words(name)
    )


def _in_words(name: str) -> str:
    """Return the unit of "degrees per second" or "Newton metres"; any other name as it is."""
    plain = name.lower()
    for pattern, symbol in _WORDS:
        plain = re.sub(pattern, symbol, plain)
    found = _ALIASES.get(plain, plain)
    return found if found in UNITS and len(name) > 1 and not name.startswith("MN") else name


def of_rated(unit: str, quantity: str) -> str:
    """Say how a recipe takes a share of a rated torque, current or speed; "" where it is none."""
    found = _SHARE.fullmatch(unit.strip())
    step = float(found[1] or 1) if found is not None else 0.0
    if found is None or quantity not in _RATED or step == 0.0:
        return ""
    parts = (1000.0 if found[2] == "‰" else 100.0) / step
    unit = _RATED[quantity]
    scale = f"scale = rated {quantity} / {parts:g}, one a joint, from the drive's data sheet"
    return f"{scale}, and unit = '{unit}'"


def to_si(unit: str, quantity: str, *, where: object = "") -> Unit:
    """Return the conversion of `unit` for a signal of `quantity` ("position", "torque", …).

    Raises:
        InputRejected: S05, the unit is unknown or measures something else.
    """
    name = canonical_unit(unit)
    accepted = [known for known, value in UNITS.items() if value.quantity == quantity]
    found = UNITS.get(name)
    if share := of_rated(str(unit), quantity):
        words, remedy = f"'{unit}' is a share of what the drive is rated for", f"declare {share}"
        raise InputRejected("S05", words, where, remedy)
    if found is None or found.quantity != quantity:
        words = f"unknown unit '{unit}'{did_you_mean(name, UNITS)}"
        if found is not None:
            words = f"'{unit}' is a unit of {found.quantity}"
        words = f"{words}; {quantity} needs one of {', '.join(accepted)}"
        raise InputRejected("S05", words, where, "declare the unit the numbers are in")
    return found
