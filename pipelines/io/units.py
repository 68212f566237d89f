"""Turn the units people write into SI, at the edge of the files only."""

from __future__ import annotations

import math
import re
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


_TURN = 2.0 * math.pi
_KGF, _LBF = 9.80665, 4.4482216152605  # numerics: [N] NIST SP 811 (2008), table B.8

UNITS: Final[dict[str, Unit]] = {
    # time
    "s": Unit("time", 1.0),
    "ms": Unit("time", 1e-3),
    "us": Unit("time", 1e-6),
    "ns": Unit("time", 1e-9),
    "100 ns": Unit("time", 1e-7),
    "min": Unit("time", 60.0),
    "d": Unit("time", 86400.0),
    # position, revolute and prismatic
    "rad": Unit("position", 1.0),
    "mrad": Unit("position", 1e-3),
    "deg": Unit("position", math.pi / 180.0),
    "°": Unit("position", math.pi / 180.0),
    "rev": Unit("position", _TURN),
    "turn": Unit("position", _TURN),
    "mdeg": Unit("position", math.pi / 180e3),
    "arcmin": Unit("position", math.pi / 10800.0),
    "arcsec": Unit("position", math.pi / 648e3),
    "m": Unit("position", 1.0),
    "cm": Unit("position", 1e-2),
    "mm": Unit("position", 1e-3),
    "um": Unit("position", 1e-6),
    # velocity
    "rad/s": Unit("velocity", 1.0),
    "deg/s": Unit("velocity", math.pi / 180.0),
    "rpm": Unit("velocity", _TURN / 60.0),
    "rev/s": Unit("velocity", _TURN),
    "mrad/s": Unit("velocity", 1e-3),
    "mdeg/s": Unit("velocity", math.pi / 180e3),
    "m/s": Unit("velocity", 1.0),
    "cm/s": Unit("velocity", 1e-2),
    "mm/s": Unit("velocity", 1e-3),
    # acceleration
    "rad/s^2": Unit("acceleration", 1.0),
    "deg/s^2": Unit("acceleration", math.pi / 180.0),
    "rev/s^2": Unit("acceleration", _TURN),
    "m/s^2": Unit("acceleration", 1.0),
    "mm/s^2": Unit("acceleration", 1e-3),
    # torque and force
    "N m": Unit("torque", 1.0),
    "mN m": Unit("torque", 1e-3),
    "N mm": Unit("torque", 1e-3),
    "N cm": Unit("torque", 1e-2),
    "kN m": Unit("torque", 1e3),
    "cN m": Unit("torque", 1e-2),
    "uN m": Unit("torque", 1e-6),
    "kgf m": Unit("torque", _KGF),
    "kgf cm": Unit("torque", 1e-2 * _KGF),
    "lbf ft": Unit("torque", 0.3048 * _LBF),
    "lbf in": Unit("torque", 0.0254 * _LBF),
    "ozf in": Unit("torque", 0.0254 * _LBF / 16.0),
    "N": Unit("torque", 1.0),
    "mN": Unit("torque", 1e-3),
    "kN": Unit("torque", 1e3),
    # current
    "A": Unit("current", 1.0),
    "mA": Unit("current", 1e-3),
    "Arms": Unit("current", 1.0),  # what it is times: N m per A rms
    # temperature
    "degC": Unit("temperature", 1.0),
    "°C": Unit("temperature", 1.0),
    "K": Unit("temperature", 1.0, -273.15),
}

_SPELLINGS: Final = str.maketrans(
    {"·": " ", "*": " ", "⋅": " ", "•": " ", "∙": " ", "・": " ", "²": "^2", "\u03bc": "µ"}
)
_ALIASES = {
    "µs": "us",
    "Nmm": "N mm",
    "N.mm": "N mm",
    "Ncm": "N cm",
    "N.cm": "N cm",
    "rad/s2": "rad/s^2",
    "m/s2": "m/s^2",
    "deg/s2": "deg/s^2",
    "1/min": "rpm",
    "Grad": "deg",
    "Grad/s": "deg/s",
    "U/min": "rpm",
    "r/min": "rpm",
    "°": "deg",
    "℃": "degC",
}
_IN_OTHER_LANGUAGES: Final = {
    "rad": "弧度 ラジアン рад radians radianes radianti radianos",
    "deg": "度 град град. grados degrés gradi graus graden grader stopnie",
    "rad/s": "弧度/秒 弧度/s рад/с",
    "deg/s": "度/秒 度/s град/с grados/s degrés/s gradi/s",
    "rpm": "转/分 об/мин tr/min giri/min obr/min ot/min",
    "s": "秒 с Sekunden secondes segundos secondi",
    "ms": "毫秒 ミリ秒 мс",
    "us": "微秒",
    "N m": "牛米 牛顿米 Нм",
    "A": "安 安培 А",
    "mA": "毫安 мА",
}
_ALIASES |= {word: unit for unit, words in _IN_OTHER_LANGUAGES.items() for word in words.split()}
_ALIASES |= {"牛 米": "N m", "Н м": "N m"}
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
    (r"\b(?:ft|in)[ -](?:lbs?|lbf|oz)\b", lambda m: _turned(m[0])),
    (r"\blbs?(?=[ -])", "lbf"),
    (r"\boz(?=[ -])", "ozf"),
    (r"(?<=f)-", " "),
    (r"^([mcuk]?)n[ .-]?m$", r"\1N m"),
)


_SHARE: Final = re.compile(r"(\d++(?:\.\d++)?|\.\d++)?\s*+(%|‰|pct|per ?cent)", re.IGNORECASE)
_RATED: Final = {"torque": "N m", "current": "A", "velocity": "rad/s"}
_NO_WORDS: Final = re.compile(r"[013-9]|^.?$")  # of a unit; "s2" has a digit


def _turned(name: str) -> str:
    """Return "lbf ft" of "ft-lb": people write the arm on either side."""
    arm, force = re.split("[ -]", name)
    return f"{force.rstrip('fs')}f {arm}"


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
