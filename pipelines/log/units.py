"""Turn the units people write into SI, at the edge of the files only."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from pipelines.errors import InputRejected, did_you_mean

__all__ = ["UNITS", "Unit", "canonical_unit", "to_si"]


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

UNITS: Final[dict[str, Unit]] = {
    # time
    "s": Unit("time", 1.0), "ms": Unit("time", 1e-3), "us": Unit("time", 1e-6),
    "ns": Unit("time", 1e-9), "100 ns": Unit("time", 1e-7), "min": Unit("time", 60.0), "d": Unit("time", 86400.0),
    # position, revolute and prismatic
    "rad": Unit("position", 1.0), "mrad": Unit("position", 1e-3), "deg": Unit("position", math.pi / 180.0),
    "°": Unit("position", math.pi / 180.0), "rev": Unit("position", _TURN), "turn": Unit("position", _TURN),
    "m": Unit("position", 1.0), "mm": Unit("position", 1e-3), "um": Unit("position", 1e-6),
    # velocity
    "rad/s": Unit("velocity", 1.0), "deg/s": Unit("velocity", math.pi / 180.0), "rpm": Unit("velocity", _TURN / 60.0),
    "rev/s": Unit("velocity", _TURN), "m/s": Unit("velocity", 1.0), "mm/s": Unit("velocity", 1e-3),
    # acceleration
    "rad/s^2": Unit("acceleration", 1.0), "deg/s^2": Unit("acceleration", math.pi / 180.0),
    "rev/s^2": Unit("acceleration", _TURN), "m/s^2": Unit("acceleration", 1.0), "mm/s^2": Unit("acceleration", 1e-3),
    # torque and force
    "N m": Unit("torque", 1.0), "mN m": Unit("torque", 1e-3), "N mm": Unit("torque", 1e-3), "N cm": Unit("torque", 1e-2),
    "kN m": Unit("torque", 1e3),
    "N": Unit("torque", 1.0), "mN": Unit("torque", 1e-3), "kN": Unit("torque", 1e3),
    # current
    "A": Unit("current", 1.0), "mA": Unit("current", 1e-3),
    # temperature
    "degC": Unit("temperature", 1.0), "°C": Unit("temperature", 1.0), "K": Unit("temperature", 1.0, -273.15),
}

_SPELLINGS: Final = str.maketrans({"·": " ", "*": " ", "⋅": " ", "•": " ", "∙": " ", "・": " ", "²": "^2", "\u03bc": "µ"})
_ALIASES = {"µs": "us",
                   "Nm": "N m", "mNm": "mN m", "Nmm": "N mm", "Ncm": "N cm", "kNm": "kN m", "degree": "deg", "degrees": "deg",
                   "radian": "rad", "radians": "rad", "seconds": "s", "sec": "s", "rad/s2": "rad/s^2",
                   "rad/s/s": "rad/s^2", "m/s2": "m/s^2", "deg/s2": "deg/s^2", "N.m": "N m", "N-m": "N m", "1/min": "rpm",
                   "rad/sec": "rad/s",
                   "deg/sec": "deg/s", "Rad": "rad", "RAD": "rad", "Deg": "deg", "DEG": "deg", "msec": "ms", "usec": "us",
                   "nsec": "ns", "Grad": "deg", "Grad/s": "deg/s", "U/min": "rpm",
                   "°": "deg", "°/s": "deg/s", "°/s^2": "deg/s^2", "r/min": "rpm", "℃": "degC"}
_IN_OTHER_LANGUAGES: Final = {
    "rad": "弧度 ラジアン рад radians radianes radianti radianos",
    "deg": "度 град град. grados degrés gradi graus graden grader stopnie",
    "rad/s": "弧度/秒 弧度/s рад/с", "deg/s": "度/秒 度/s град/с grados/s degrés/s gradi/s",
    "rpm": "转/分 об/мин tr/min giri/min obr/min ot/min",
    "s": "秒 с Sekunden secondes segundos secondi", "ms": "毫秒 ミリ秒 мс", "us": "微秒",
    "N m": "牛米 牛顿米 Нм", "A": "安 安培 А", "mA": "毫安 мА",
}  # fmt: skip
_ALIASES |= {word: unit for unit, words in _IN_OTHER_LANGUAGES.items() for word in words.split()}
_ALIASES |= {"牛 米": "N m", "Н м": "N m"}


def canonical_unit(unit: str) -> str:
    """`unit` as `UNITS` spells it: "Nm" and "N·m" are "N m"."""
    name = " ".join(str(unit).translate(_SPELLINGS).split())
    return _ALIASES.get(name, name)


def to_si(unit: str, quantity: str, *, where: object = "") -> Unit:
    """The conversion of `unit` for a signal of `quantity` ("position", "torque", …).

    Raises:
        InputRejected: S05, the unit is unknown or measures something else.
    """
    name = canonical_unit(unit)
    accepted = [known for known, value in UNITS.items() if value.quantity == quantity]
    found = UNITS.get(name)
    if found is None or found.quantity != quantity:
        what = f"unknown unit '{unit}'{did_you_mean(name, UNITS)}" if found is None else f"'{unit}' is a unit of {found.quantity}"
        raise InputRejected("S05", f"{what}; {quantity} needs one of {', '.join(accepted)}", where=where,
                            remedy="declare the unit the numbers are in")
    return found
